//! Reads and writes every file of a night. [`Store`] is one experiment's folder open for writing,
//! [`Archive`] gives access to finished runs, and [`Follower`] watches a night from its files
//! alone.
//!
//! ```text
//! out/night-3f9a/    name and first digits of the plan's hash; out/latest points at the newest
//!   experiment.lua plan.json snapshot.json env.json journal.jsonl lock summary.csv figures/ tables/
//!   sheets/
//!   affinity/ planners/          device of each comparison group; heartbeats of planners
//!   workers/ finished/           workers' heartbeats and journals; completion markers
//!   runs/<readable path>/<run id>/   config.json metrics.csv log.txt snap-<spp>.{exr,png}
//!                                    final.exr final.png films/*.{exr,png} done.json
//! out/refs/ab/ab12../   config.json metrics.csv log.txt ref.exr ref.png half-{a,b}.exr noise.exr
//!                       ref.json
//! out/index.jsonl       results of finished runs, a cache that is rebuilt from the folders
//! ```
//!
//! The folders are authoritative. `done.json` (`ref.json` for a reference) is written last; a run
//! without it is incomplete. Every file is written under a temporary name in the same folder,
//! synced (except the index) and renamed. Only `metrics.csv`, `log.txt` and `journal.jsonl` grow
//! line by line, and a last line without a newline is ignored. [`schema`] has the fields of every
//! file.
//!
//! This module knows no image format. Images are passed as bytes, and callers supply the decoder.

mod follow;
mod layout;
pub mod lock;
pub mod read;
pub mod regular_file;
pub mod schema;
#[cfg(test)]
mod tests;
pub mod worker;
pub mod write;

use std::io::ErrorKind;
use std::path::PathBuf;

use crate::text;

pub use follow::{Follower, TimedEvent, TimesFile, Update};

pub use layout::FILMS;
pub use lock::claim::LEASE;

pub use read::archive::{Archive, Decode};
pub use read::evidence::Evidence;
pub use read::night_index::{Listing, RunRecord, latest_experiment, list_experiments, read_run};
pub use read::night_reader::NightReader;
pub use read::run_reader::{Integrity, Measurements, RunReader};
pub use read::throughput_history::throughput_history;

pub use schema::StoredFile;
pub use schema::plan::PlanSnapshot;
pub use schema::process::{RenderDevice, WorkerState};

pub use worker::plan_snapshot::PlanCommand;
pub use worker::registry::{WorkerInfo, WorkerStatus, list_workers};
pub use worker::worker_store::PlanStatus;

pub use write::atomic::{probe, remove_temporaries, write_atomically};
pub use write::experiment_folder::Store;
pub use write::failure::LOG_LINES;
pub use write::host::{Host, parse_utc, utc};
pub use write::manifest_checksum::BIAS_CHECK_PREFIX;
pub use write::plan_files::{config_file, plan_file};
pub use write::run_folder::{HALVES, NOISE, RAW, RunWriter};

/// Errors of the store.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// The folder for results is not writable.
    #[error(
        "cannot write to {}: {reason} (choose another folder with --out DIR, or make this one \
         writable)",
        path.display()
    )]
    Unwritable {
        /// Folder that is not writable.
        path: PathBuf,
        /// Error text of the operating system.
        reason: String,
        /// Whether the disk or a quota is full, so that a retry may succeed.
        full: bool,
    },
    /// A file operation failed.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        /// Attempted operation, such as `read`, `write` or `create`.
        action: &'static str,
        /// File or folder of the operation.
        path: PathBuf,
        /// Error text of the operating system.
        reason: String,
        /// Whether the disk or a quota is full, so that a retry may succeed.
        full: bool,
    },
    /// A file is missing, damaged, or of another version.
    #[error(transparent)]
    Read(schema::ReadError),
    /// No run matches a selector.
    #[error("no run matches `{what}` in {}{hint}", out.display())]
    NoSuchRun {
        /// Selector given by the user.
        what: String,
        /// Output folder that was searched.
        out: PathBuf,
        /// Advice for the user, with a leading separator.
        hint: String,
    },
    /// Several runs match a selector.
    #[error(
        "`{what}` matches several runs; give more digits or a path:\n  {}",
        candidates.join("\n  ")
    )]
    Ambiguous {
        /// Selector given by the user.
        what: String,
        /// Up to eight of the matching folders.
        candidates: Vec<String>,
    },
}

impl StoreError {
    /// Converts the error of a failed file operation.
    pub fn io(action: &'static str, path: &std::path::Path, error: &std::io::Error) -> StoreError {
        StoreError::Io {
            action,
            path: path.to_owned(),
            reason: text::describe_io(error),
            full: is_disk_full(error),
        }
    }

    /// Converts the error of a failed write probe.
    fn unwritable(path: &std::path::Path, error: &std::io::Error) -> StoreError {
        StoreError::Unwritable {
            path: path.to_owned(),
            reason: text::describe_io(error),
            full: is_disk_full(error),
        }
    }

    /// Whether the disk, or a quota on it, is full.
    pub fn is_full(&self) -> bool {
        matches!(
            self,
            StoreError::Io { full: true, .. } | StoreError::Unwritable { full: true, .. }
        )
    }
}

fn is_disk_full(error: &std::io::Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::StorageFull | ErrorKind::QuotaExceeded
    )
}
