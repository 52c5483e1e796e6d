//! Integrity of a run's folder, checked against the checksums in its last file.

use std::path::Path;

use super::archive::read_json;
use crate::store::layout;
use crate::store::write::failure;
use crate::store::write::failure::FailureRecord;
use crate::store::write::{checkpoint, manifest_checksum};

/// Integrity of a run's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Integrity {
    /// The run is finished, for this reason, and every file matches its checksum.
    Intact(String),
    /// The run is finished, but a file is missing or changed; holds a description.
    Damaged(String),
    /// The run is not finished.
    Unfinished {
        /// Record of its last attempt, if that failed.
        failure: Option<FailureRecord>,
        /// Samples per pixel of the checkpoint that it resumes from, if there is one.
        checkpoint: Option<u64>,
    },
}

/// Checks every file in the folder of the run or reference with this id.
pub fn check_integrity(folder: &Path, id: &str) -> Integrity {
    let Some(marker) = layout::done_file(folder) else {
        let checkpoint = checkpoint::samples(folder, id);
        return Integrity::Unfinished {
            failure: failure::read(folder),
            checkpoint,
        };
    };
    let Some(done) = read_json(&folder.join(marker)) else {
        return Integrity::Damaged(format!("{marker} is damaged"));
    };
    match manifest_checksum::verify_hashes(folder, &done) {
        Ok(()) if done["run"].as_str() == Some(id) => {
            Integrity::Intact(done["reason"].as_str().unwrap_or_default().to_owned())
        }
        Ok(()) => Integrity::Damaged(format!("{marker} belongs to another run")),
        Err(problem) => Integrity::Damaged(problem),
    }
}
