//! `failed.json`: why the last try of a run failed, and the last lines of its log.

use std::fs;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::archive::read_json;
use super::{StoreError, utc, write};

/// The name of the file.
const FILE: &str = "failed.json";

/// Lines of the log that are kept with the reason.
pub const LOG_LINES: usize = 20;

/// Why a run failed.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FailureRecord {
    /// The reason.
    pub reason: String,
    /// The last lines of its log, oldest first, at most [`LOG_LINES`].
    pub log: Vec<String>,
}

/// Records a failure in the folder of its run, which is made.
pub(super) fn record(folder: &Path, run: &str, reason: &str) -> Result<(), StoreError> {
    let log = fs::read_to_string(folder.join("log.txt")).unwrap_or_default();
    let lines: Vec<&str> = log.lines().collect();
    let last = &lines[lines.len().saturating_sub(LOG_LINES)..];
    let moment = utc(std::time::SystemTime::now());
    let json = json!({ "run": run, "reason": reason, "log": last, "date": moment });
    write::atomic(&folder.join(FILE), super::run::pretty(&json).as_bytes())
}

/// The last failure of a run, if its last try failed. A record that cannot be read still says that it did.
pub(super) fn read(folder: &Path) -> Option<FailureRecord> {
    let path = folder.join(FILE);
    if !path.is_file() {
        return None;
    }
    let json = read_json(&path).unwrap_or(Json::Null);
    let reason = json["reason"].as_str().unwrap_or("unknown: its record is damaged").to_owned();
    let log = json["log"].as_array().into_iter().flatten().filter_map(|line| line.as_str().map(str::to_owned));
    Some(FailureRecord { reason, log: log.collect() })
}

/// Forgets the failure of a run that is tried again or done.
pub(super) fn forget(folder: &Path) {
    // One that stays is overruled by what the run comes to.
    let _ = fs::remove_file(folder.join(FILE));
}
