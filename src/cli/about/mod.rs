//! Verbs about the program itself (`doctor`, `schema`, `completions`, `man`), its help, and errors of
//! usage.

pub(in crate::cli) mod completions;
pub(in crate::cli) mod doctor;
pub(in crate::cli) mod reference;
pub(in crate::cli) mod schema;
pub(in crate::cli) mod usage;
