//! In what state a run's folder is, by everything that it holds.

use std::path::Path;

use super::archive::read_json;
use super::failure::{self, FailureRecord};
use super::{checkpoint, layout, seal};

/// The state of a run's folder.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Condition {
    /// Finished, for this reason, and every byte is what it was then.
    Whole(String),
    /// Finished, but something has happened to its files since.
    Damaged(String),
    /// Not finished.
    Unfinished {
        /// The failure of its last try, if it failed.
        failure: Option<FailureRecord>,
        /// Samples per pixel of the checkpoint from which it goes on, if it has one.
        checkpoint: Option<u64>,
    },
}

/// Looks at every file in the folder of a run or reference with this id.
pub fn condition(folder: &Path, id: &str) -> Condition {
    let Some(marker) = layout::last(folder) else {
        let checkpoint = checkpoint::samples(folder, id);
        return Condition::Unfinished { failure: failure::read(folder), checkpoint };
    };
    let Some(done) = read_json(&folder.join(marker)) else {
        return Condition::Damaged(format!("{marker} is damaged"));
    };
    match seal::inspect(folder, &done) {
        Ok(()) if done["run"].as_str() == Some(id) => {
            Condition::Whole(done["reason"].as_str().unwrap_or_default().to_owned())
        }
        Ok(()) => Condition::Damaged(format!("{marker} is of another run")),
        Err(problem) => Condition::Damaged(problem),
    }
}
