//! Nights on the command line: `run`, `plan` and `retry`, and the code they share.

pub(in crate::cli) mod deadline;
pub(in crate::cli) mod disk_full_retry;
pub(in crate::cli) mod last_command;
pub mod load;
mod load_average;
pub(in crate::cli) mod log;
pub(in crate::cli) mod notices;
pub(in crate::cli) mod permission;
pub(in crate::cli) mod plan;
pub(in crate::cli) mod progress_view;
pub(in crate::cli) mod recorder;
pub(in crate::cli) mod results;
pub(in crate::cli) mod run;
pub(in crate::cli) mod signals;
