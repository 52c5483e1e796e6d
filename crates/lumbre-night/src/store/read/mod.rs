//! Reading finished and running nights. Nothing here writes to a run's folder.

pub(crate) mod archive;
mod config_check;
pub mod evidence;
pub(crate) mod merged_journal;
pub mod night;
pub(crate) mod night_index;
pub mod night_reader;
pub(crate) mod planned_night;
pub(crate) mod run_index;
pub(crate) mod run_reader;
pub(crate) mod tail;
pub(crate) mod throughput_history;
