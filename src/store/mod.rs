//! The store: every file that a night leaves, and what earlier nights left.
//!
//! ```text
//! out/night-3f9a/    name and first digits of the plan's hash; out/latest points at the newest
//!   experiment.lua plan.json frozen.json env.json journal.jsonl lock summary.csv figures/ tables/
//!   bonds/ planners/             the device of every comparison; who planned and renders now
//!   workers/ finished/           of nights with workers: heartbeats and journals, marks
//!   runs/<readable path>/<run id>/   config.json metrics.csv log.txt snap-<spp>.{exr,png} final.exr final.png
//!                                    films/*.{exr,png} done.json
//! out/refs/ab/ab12../   config.json metrics.csv log.txt ref.exr ref.png half-{a,b}.exr noise.exr ref.json
//! out/index.sqlite      what finished runs say, a cache that is made anew from the folders
//! ```
//!
//! Folders are the truth: whether a run is done is whether its `done.json` (for a reference, `ref.json`) is there,
//! and that file is written last. Every file is written beside its final name, synced, and renamed; only
//! `metrics.csv`, `log.txt` and `journal.jsonl` grow line by line, and a line cut off by a crash is ignored.
//!
//! This room knows no image format: pictures come and go as bytes, and the decoder is handed in.

mod archive;
mod bonds;
mod checkpoint;
mod claim;
mod condition;
mod crew;
mod describe;
pub mod evidence;
mod experiment;
mod failure;
mod follow;
mod frozen;
mod host;
mod index;
mod journal;
mod journals;
mod layout;
mod list;
mod marks;
pub mod mount;
mod outline;
mod owner;
mod paces;
mod parts;
pub mod rehearsal;
pub mod rows;
mod run;
mod seal;
mod seen;
mod sums;
mod tail;
#[cfg(test)]
mod tests;
mod worker;
mod write;

use std::io::ErrorKind;
use std::path::PathBuf;

pub use archive::{Archive, Decode};
pub use claim::LEASE;
pub use condition::{Condition, condition};
pub use crew::{Device, Doing, Me, Worker, crew};
pub use describe::{cell_json, plan_json};
pub use experiment::Store;
pub use failure::{FailureRecord, LOG_LINES};
pub use follow::Follower;
pub use frozen::{Command, Frozen};
pub use host::{Host, seconds_of, utc};
pub use list::{ExperimentEntry, RunEntry, RunRecord, RunState, latest, list, read_run};
pub use paces::archived_paces;
pub use run::{FILMS, HALVES, NOISE, RunWriter};
pub use seen::{Seen, Sight};
pub use worker::Stock;
pub use write::{atomic, probe};

/// Why the store cannot do what it was asked.
#[derive(Debug, thiserror::Error)]
pub enum StoreError {
    /// Nothing can be written where results should go.
    #[error(
        "cannot write to {}: {reason} (choose another place with --out DIR, or make this one writable)",
        path.display()
    )]
    Unwritable {
        /// The folder.
        path: PathBuf,
        /// What the system said.
        reason: String,
        /// Whether there was no space left: it may come back.
        full: bool,
    },
    /// A file operation failed.
    #[error("cannot {action} {}: {reason}", path.display())]
    Io {
        /// What was tried: `read`, `write`, `create`.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// What the system said.
        reason: String,
        /// Whether there was no space left: it may come back.
        full: bool,
    },
    /// No run matches.
    #[error("no run matches `{what}` in {}{hint}", out.display())]
    NoSuchRun {
        /// What was asked for.
        what: String,
        /// Where it was looked for.
        out: PathBuf,
        /// What to do, with a leading separator.
        hint: String,
    },
    /// Several runs match.
    #[error("`{what}` matches several runs; give more digits or a path:\n  {}", candidates.join("\n  "))]
    Ambiguous {
        /// What was asked for.
        what: String,
        /// Some of the folders that match.
        candidates: Vec<String>,
    },
}

impl StoreError {
    /// The error of a failed file operation.
    fn io(action: &'static str, path: &std::path::Path, error: &std::io::Error) -> StoreError {
        StoreError::Io { action, path: path.to_owned(), reason: error.to_string(), full: is_of_space(error) }
    }

    /// The error of what cannot be written where results should go.
    fn unwritable(path: &std::path::Path, error: &std::io::Error) -> StoreError {
        StoreError::Unwritable { path: path.to_owned(), reason: error.to_string(), full: is_of_space(error) }
    }

    /// Whether the disk, or a quota on it, is full.
    pub fn is_full(&self) -> bool {
        matches!(self, StoreError::Io { full: true, .. } | StoreError::Unwritable { full: true, .. })
    }
}

fn is_of_space(error: &std::io::Error) -> bool {
    matches!(error.kind(), ErrorKind::StorageFull | ErrorKind::QuotaExceeded)
}
