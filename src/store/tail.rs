//! Reading a file that another process appends to, line by line, without reading anything twice.

use std::fs::File;
use std::io::{Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

/// The most that one look reads, so that a huge file is taken in pieces.
const PIECE: u64 = 64 << 20;

/// A file that grows.
#[derive(Debug)]
pub(super) struct Tail {
    path: PathBuf,
    /// Bytes taken in so far, always up to the end of a line.
    taken: u64,
}

/// What a look found.
#[derive(Debug, Default, PartialEq)]
pub(super) struct News {
    /// Whole new lines, with their ends.
    pub(super) text: String,
    /// Whether the file was shorter than what had been read: it was begun anew, and `text` starts at its top.
    pub(super) anew: bool,
}

impl Tail {
    /// A file that need not be there yet.
    pub(super) fn new(path: PathBuf) -> Tail {
        Tail { path, taken: 0 }
    }

    /// The file.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// What was appended since the last look. A line without its end waits for it; what cannot be read is no news.
    pub(super) fn look(&mut self) -> News {
        self.try_look().unwrap_or_default()
    }

    fn try_look(&mut self) -> std::io::Result<News> {
        let mut file = File::open(&self.path)?;
        let length = file.metadata()?.len();
        let anew = length < self.taken;
        if anew {
            self.taken = 0;
        }
        if length == self.taken {
            return Ok(News { text: String::new(), anew });
        }
        file.seek(SeekFrom::Start(self.taken))?;
        let mut bytes = Vec::new();
        file.take(PIECE).read_to_end(&mut bytes)?;
        bytes.truncate(bytes.iter().rposition(|b| *b == b'\n').map_or(0, |end| end + 1));
        self.taken += bytes.len() as u64;
        Ok(News { text: String::from_utf8_lossy(&bytes).into_owned(), anew })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::{OpenOptions, write};
    use std::io::Write;

    #[test]
    fn every_line_is_seen_once_and_whole() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("journal.jsonl");
        let mut tail = Tail::new(path.clone());
        assert_eq!(tail.look(), News::default(), "nothing is there");
        write(&path, "one\ntw").unwrap();
        assert_eq!(tail.look().text, "one\n");
        assert_eq!(tail.look().text, "");
        OpenOptions::new().append(true).open(&path).unwrap().write_all(b"o\nthree\n").unwrap();
        assert_eq!(tail.look().text, "two\nthree\n");
        write(&path, "anew\n").unwrap();
        assert_eq!(tail.look(), News { text: "anew\n".to_owned(), anew: true });
        write(&path, b"anew\nnot \xff text\n").unwrap();
        assert_eq!(tail.look().text, "not \u{fffd} text\n");
    }
}
