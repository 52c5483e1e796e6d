//! `journal.jsonl`: one line for each thing that happened in an experiment's folder, over all its nights.

use std::collections::BTreeMap;
use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::{StoreError, utc};

/// An open journal.
#[derive(Debug)]
pub(super) struct Journal {
    file: File,
    path: PathBuf,
}

impl Journal {
    /// Opens the journal for appending. A line that a crash cut off is ended, so that the next one stands alone.
    pub(super) fn open(path: PathBuf) -> Result<Journal, StoreError> {
        let attempt = || -> std::io::Result<File> {
            let mut file = OpenOptions::new().create(true).read(true).append(true).open(&path)?;
            if file.metadata()?.len() > 0 {
                let mut last = [0];
                file.seek(SeekFrom::End(-1))?;
                file.read_exact(&mut last)?;
                if last != *b"\n" {
                    file.write_all(b"\n")?;
                }
            }
            Ok(file)
        };
        let file = attempt().map_err(|e| StoreError::io("write", &path, &e))?;
        Ok(Journal { file, path })
    }

    /// Appends one line: the date, the event's name, and `fields`.
    pub(super) fn append(&mut self, event: &str, fields: &Json) -> Result<(), StoreError> {
        let mut line = serde_json::Map::new();
        line.insert("date".into(), utc(std::time::SystemTime::now()).into());
        line.insert("event".into(), event.into());
        line.extend(fields.as_object().into_iter().flatten().map(|(k, v)| (k.clone(), v.clone())));
        let text = Json::Object(line).to_string() + "\n";
        self.file.write_all(text.as_bytes()).map_err(|e| StoreError::io("write", &self.path, &e))
    }
}

/// The reason of every run whose last word in the journal is that it failed, by run id.
pub(super) fn failures(path: &Path) -> BTreeMap<String, String> {
    let mut failed = BTreeMap::new();
    let text = std::fs::read_to_string(path).unwrap_or_default();
    for line in text.lines().filter_map(|l| serde_json::from_str::<Json>(l).ok()) {
        let Some(run) = line["run"].as_str() else { continue };
        match (line["event"].as_str(), line["outcome"].as_str()) {
            (Some("cell_finished"), Some("failed")) => {
                failed.insert(run.to_owned(), line["reason"].as_str().unwrap_or("unknown").to_owned());
            }
            (Some("cell_started" | "cell_finished"), _) => {
                failed.remove(run);
            }
            _ => {}
        }
    }
    failed
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn a_cut_line_does_not_swallow_the_next_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        std::fs::write(&path, "{\"event\":\"cell_fin").unwrap();
        let finished = |outcome: &str| json!({"run": "ab", "outcome": outcome, "reason": "lens fell off"});
        Journal::open(path.clone()).unwrap().append("cell_finished", &finished("failed")).unwrap();
        assert_eq!(failures(&path).get("ab").map(String::as_str), Some("lens fell off"));
        Journal::open(path.clone()).unwrap().append("cell_finished", &finished("done")).unwrap();
        assert!(failures(&path).is_empty());
        assert_eq!(std::fs::read_to_string(&path).unwrap().lines().count(), 3);
    }
}
