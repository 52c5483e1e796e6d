//! Reads and writes regular files only. A named pipe, a socket or a device in place of a file would
//! block its reader or writer for ever, so every reader of the store opens files here, and every
//! writer that opens a file of a known name opens it here, too.

use std::fs::{File, OpenOptions};
use std::io::{self, Read};
use std::path::Path;

/// Opens a regular file, or a link to one, for reading.
///
/// # Errors
/// When it cannot be opened, or is a folder, pipe, socket or device.
pub fn open(path: &Path) -> io::Result<File> {
    // Asked before it is opened, since opening a pipe waits for its writer.
    let found = std::fs::metadata(path)?;
    if !found.is_file() {
        return Err(io::Error::new(
            io::ErrorKind::InvalidInput,
            "it is not a regular file",
        ));
    }
    File::open(path)
}

/// Opens a file for writing, after removing a pipe, socket or device from its place.
///
/// # Errors
/// When that cannot be removed, or the file cannot be opened.
pub fn open_with(options: &OpenOptions, path: &Path) -> io::Result<File> {
    clear_place(path)?;
    options.open(path)
}

/// Removes what is neither a regular file, a folder nor a link.
fn clear_place(path: &Path) -> io::Result<()> {
    match std::fs::symlink_metadata(path) {
        Ok(found) if !found.is_file() && !found.is_dir() && !found.is_symlink() => {
            tracing::warn!(
                "{} is not a regular file and has been removed",
                path.display()
            );
            std::fs::remove_file(path)
        }
        _ => Ok(()),
    }
}

/// Reads a whole regular file.
///
/// # Errors
/// As [`open`], and when it cannot be read.
pub fn read(path: &Path) -> io::Result<Vec<u8>> {
    let mut file = open(path)?;
    let length = file.metadata()?.len();
    let mut bytes = Vec::new();
    bytes.try_reserve_exact(usize::try_from(length).unwrap_or(usize::MAX))?;
    file.read_to_end(&mut bytes)?;
    Ok(bytes)
}

/// Reads a whole regular file as text.
///
/// # Errors
/// As [`read`], and when it is not UTF-8.
pub fn read_to_string(path: &Path) -> io::Result<String> {
    String::from_utf8(read(path)?).map_err(|e| io::Error::new(io::ErrorKind::InvalidData, e))
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn only_pipes_are_removed_from_the_place_of_a_file() {
        let dir = tempfile::tempdir().unwrap();
        let (pipe, file) = (dir.path().join("pipe"), dir.path().join("file"));
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        std::fs::write(&file, "content").unwrap();
        for path in [&pipe, &file, dir.path(), &dir.path().join("nothing")] {
            clear_place(path).unwrap();
        }
        assert!(!pipe.exists() && file.exists());
    }

    #[test]
    fn pipes_devices_and_folders_are_refused_without_waiting() {
        let dir = tempfile::tempdir().unwrap();
        let pipe = dir.path().join("done.json");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.unwrap().success());
        for path in [&pipe, Path::new("/dev/zero"), dir.path()] {
            let error = read(path).unwrap_err().to_string();
            assert!(error.contains("not a regular file"), "{error}");
        }
        let file = dir.path().join("file");
        std::fs::write(&file, "content").unwrap();
        assert_eq!(read_to_string(&file).unwrap(), "content");
    }
}
