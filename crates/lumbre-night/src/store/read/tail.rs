//! Reads a file that another process appends to, line by line, without reading anything twice.

use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use crate::store::regular_file;

/// Maximum number of bytes that one poll reads.
const MAX_READ: u64 = 64 << 20;

/// Position in a file that grows.
#[derive(Debug)]
pub(crate) struct Tail {
    path: PathBuf,
    /// Number of bytes read so far, always up to the end of a line.
    position: u64,
}

/// Result of a poll.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct TailUpdate {
    /// Complete new lines, with their newlines.
    pub(crate) text: String,
    /// Whether the file was shorter than the position. It was then replaced, and `text` starts at
    /// its beginning.
    pub(crate) restarted: bool,
}

impl Tail {
    /// Creates a tail at the start of a file, which need not exist yet.
    pub(crate) fn new(path: PathBuf) -> Tail {
        Tail { path, position: 0 }
    }

    /// Path of the file.
    pub(crate) fn path(&self) -> &Path {
        &self.path
    }

    /// Returns the lines appended since the last poll. Leaves a last line without a newline for
    /// later. Returns nothing if the file cannot be read.
    pub(crate) fn poll(&mut self) -> TailUpdate {
        self.try_poll().unwrap_or_default()
    }

    fn try_poll(&mut self) -> std::io::Result<TailUpdate> {
        let mut file = regular_file::open(&self.path)?;
        let length = file.metadata()?.len();
        let restarted = length < self.position;
        if restarted {
            self.position = 0;
        }
        if length == self.position {
            return Ok(TailUpdate {
                text: String::new(),
                restarted,
            });
        }
        file.seek(SeekFrom::Start(self.position))?;
        let mut bytes = Vec::new();
        file.take(MAX_READ).read_to_end(&mut bytes)?;
        bytes.truncate(
            bytes
                .iter()
                .rposition(|b| *b == b'\n')
                .map_or(0, |end| end + 1),
        );
        self.position += bytes.len() as u64;
        Ok(TailUpdate {
            text: String::from_utf8_lossy(&bytes).into_owned(),
            restarted,
        })
    }
}

#[cfg(test)]
mod tests {
    use crate::store::read::tail::*;
    use std::fs::{OpenOptions, write};
    use std::io::Write;

    #[test]
    fn every_line_is_seen_once_and_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        let mut tail = Tail::new(path.clone());
        assert_eq!(tail.poll(), TailUpdate::default(), "nothing is there");
        write(&path, "one\ntw").unwrap();
        assert_eq!(tail.poll().text, "one\n");
        assert_eq!(tail.poll().text, "");
        OpenOptions::new()
            .append(true)
            .open(&path)
            .unwrap()
            .write_all(b"o\nthree\n")
            .unwrap();
        assert_eq!(tail.poll().text, "two\nthree\n");
        write(&path, "again\n").unwrap();
        assert_eq!(
            tail.poll(),
            TailUpdate {
                text: "again\n".to_owned(),
                restarted: true
            }
        );
        write(&path, b"again\nnot \xff text\n").unwrap();
        assert_eq!(tail.poll().text, "not \u{fffd} text\n");
    }
}
