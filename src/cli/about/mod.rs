//! Verbs about the program itself (`doctor`, `schema`), its help, and errors of
//! usage.

pub(in crate::cli) mod doctor;
pub(in crate::cli) mod reference;
pub(in crate::cli) mod schema;
pub(in crate::cli) mod usage;
