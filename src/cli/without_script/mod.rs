//! Verbs that take a scene instead of a script: `render` makes one picture, `explore` shows one whose
//! settings change, `compare` makes an experiment that compares techniques, and `new` the script of
//! such an experiment, or a project with a technique of one's own.

pub(in crate::cli) mod compare;
mod experiment_text;
pub(in crate::cli) mod explore;
mod files;
pub(in crate::cli) mod new;
mod new_technique;
pub(in crate::cli) mod picture;
mod settings;
mod verdict;
