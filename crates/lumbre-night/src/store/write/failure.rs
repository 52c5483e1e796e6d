//! `failed.json`: why the last attempt of a run failed, with the last lines of its log.

use std::fs;
use std::path::Path;

use crate::store::schema::StoredFile;
use crate::store::schema::run::FailedFile;
use crate::store::{StoreError, regular_file, utc};

/// Number of log lines that are stored with the reason.
pub const LOG_LINES: usize = 20;

/// Records a failure in the folder of its run, which is created.
///
/// # Errors
/// When the record cannot be written.
pub(crate) fn record(folder: &Path, run: &str, reason: &str) -> Result<(), StoreError> {
    let log = regular_file::read_to_string(&folder.join("log.txt")).unwrap_or_default();
    let lines: Vec<&str> = log.lines().collect();
    let last = &lines[lines.len().saturating_sub(LOG_LINES)..];
    let failed = FailedFile {
        run: run.to_owned(),
        reason: reason.to_owned(),
        log: last.iter().map(|line| (*line).to_owned()).collect(),
        date: utc(std::time::SystemTime::now()),
        ..FailedFile::default()
    };
    failed.write(folder)
}

/// Reads the record of the last attempt, if it failed. A record that cannot be read counts as a
/// failure, with the problem as its reason.
pub(crate) fn read(folder: &Path) -> Option<FailedFile> {
    match FailedFile::read(folder) {
        Err(error) if error.is_missing() => None,
        Err(error) => Some(FailedFile {
            reason: format!("unknown ({}{})", FailedFile::NAME, error.problem),
            ..FailedFile::default()
        }),
        Ok(failed) => Some(failed),
    }
}

/// Removes the failure record of a run that is retried or finished.
pub(crate) fn remove(folder: &Path) {
    // A record that cannot be removed is overruled by the run's last file.
    let _ = fs::remove_file(folder.join(FailedFile::NAME));
}
