//! `failed.json`: why the last attempt of a run failed, with the last lines of its log.

use std::fs;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::atomic;
use crate::store::read::archive::read_json;
use crate::store::{StoreError, utc};

/// Name of the file in a run's folder.
const FILE: &str = "failed.json";

/// Number of log lines that are stored with the reason.
pub const LOG_LINES: usize = 20;

/// Record of a failed attempt.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FailureRecord {
    /// Reason of the failure.
    pub reason: String,
    /// Last lines of the run's log, oldest first, at most [`LOG_LINES`].
    pub log: Vec<String>,
}

/// Records a failure in the folder of its run, which is created.
///
/// # Errors
/// When the record cannot be written.
pub(crate) fn record(folder: &Path, run: &str, reason: &str) -> Result<(), StoreError> {
    let log = fs::read_to_string(folder.join("log.txt")).unwrap_or_default();
    let lines: Vec<&str> = log.lines().collect();
    let last = &lines[lines.len().saturating_sub(LOG_LINES)..];
    let moment = utc(std::time::SystemTime::now());
    let json = json!({ "run": run, "reason": reason, "log": last, "date": moment });
    atomic::write_atomically(
        &folder.join(FILE),
        crate::store::write::run_folder::pretty(&json).as_bytes(),
    )
}

/// Reads the record of the last attempt, if it failed. A damaged record counts as a failure with an
/// unknown reason.
pub(crate) fn read(folder: &Path) -> Option<FailureRecord> {
    let path = folder.join(FILE);
    if !path.is_file() {
        return None;
    }
    let json = read_json(&path).unwrap_or(Json::Null);
    let reason = json["reason"]
        .as_str()
        .unwrap_or("unknown (failed.json is damaged)")
        .to_owned();
    let log = json["log"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(|line| line.as_str().map(str::to_owned));
    Some(FailureRecord {
        reason,
        log: log.collect(),
    })
}

/// Removes the failure record of a run that is retried or finished.
pub(crate) fn remove(folder: &Path) {
    // A record that cannot be removed is overruled by the run's last file.
    let _ = fs::remove_file(folder.join(FILE));
}
