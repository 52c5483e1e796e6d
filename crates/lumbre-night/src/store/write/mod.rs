//! Writing the folder of a night: runs, checkpoints, journal, metadata.

pub(crate) mod atomic;
pub(crate) mod checkpoint;
pub(crate) mod experiment_folder;
pub(crate) mod failure;
pub(crate) mod host;
pub(crate) mod journal;
pub mod manifest_checksum;
pub mod metrics_csv;
pub(crate) mod plan_files;
pub(crate) mod plan_folder;
pub(crate) mod reference_sums;
pub(crate) mod run_folder;
