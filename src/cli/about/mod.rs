//! Verbs about the program itself: `doctor`, `schema`, `completions` and `man`.

pub(in crate::cli) mod completions;
pub(in crate::cli) mod doctor;
pub(in crate::cli) mod reference;
pub(in crate::cli) mod schema;
