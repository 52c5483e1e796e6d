//! The journal of an experiment's folder: `journal.jsonl` has one JSON line for each event, over
//! all nights and processes. It is informative; no decision depends on it.

use std::fs::{File, OpenOptions};
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::PathBuf;

use crate::store::schema::journal::{JournalEvent, JournalLine};
use crate::store::schema::one_line;
use crate::store::{StoreError, regular_file, utc};

/// Journal open for appending.
#[derive(Debug)]
pub(crate) struct Journal {
    file: File,
    path: PathBuf,
}

impl Journal {
    /// Opens the journal for appending. Ends a line that a crash cut off, so that the next line is
    /// separate.
    pub(crate) fn open(path: PathBuf) -> Result<Journal, StoreError> {
        let attempt = || -> std::io::Result<File> {
            let mut file = regular_file::open_with(
                OpenOptions::new().create(true).read(true).append(true),
                &path,
            )?;
            if file.metadata()?.len() > 0 {
                let mut last = [0];
                file.seek(SeekFrom::End(-1))?;
                file.read_exact(&mut last)?;
                if last != *b"\n" {
                    tracing::warn!(
                        "the last line of {} is incomplete and will be ignored",
                        path.display()
                    );
                    file.write_all(b"\n")?;
                }
            }
            Ok(file)
        };
        let file = attempt().map_err(|e| StoreError::io("write", &path, &e))?;
        Ok(Journal { file, path })
    }

    /// Appends one line. It is a single write to the end of the file, so that lines of several
    /// processes do not mix.
    pub(crate) fn append(&mut self, event: JournalEvent) -> Result<(), StoreError> {
        let date = utc(std::time::SystemTime::now());
        let text = one_line(&JournalLine { date, event });
        self.file
            .write_all(text.as_bytes())
            .map_err(|e| StoreError::io("write", &self.path, &e))
    }
}

#[cfg(test)]
mod tests {
    use crate::store::schema::journal::RunEnd;
    use crate::store::write::journal::*;

    #[test]
    fn a_cut_line_does_not_swallow_the_next_one() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        std::fs::write(&path, "{\"event\":\"cell_fin").unwrap();
        let event = JournalEvent::CellFinished(RunEnd {
            run: "ab".to_owned(),
            reason: "lens fell off".to_owned(),
            ..RunEnd::default()
        });
        Journal::open(path.clone())
            .unwrap()
            .append(event.clone())
            .unwrap();
        Journal::open(path.clone())
            .unwrap()
            .append(event.clone())
            .unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        let intact = |line: &&str| {
            serde_json::from_str::<JournalLine>(line).is_ok_and(|line| line.event == event)
        };
        assert_eq!(
            (text.lines().count(), text.lines().filter(intact).count()),
            (3, 2)
        );
    }
}
