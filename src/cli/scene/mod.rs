//! Verbs about scenes: `check`, `export`, `trace` and `bsdf`; and the built-in scenes.

pub(in crate::cli) mod bsdf;
pub(in crate::cli) mod builtin;
pub(in crate::cli) mod check;
pub(in crate::cli) mod export;
pub(in crate::cli) mod trace;
