//! Atomic file writes: a reader finds either the old file or the complete new one.

use std::fs::{self, File};
use std::io::{ErrorKind, Write};
use std::path::Path;
use std::time::{Duration, SystemTime};

use crate::paths::folder_of;
use crate::store::{StoreError, regular_file};

/// Prefix of temporary files. The next owner of a folder removes those that a crash left.
pub(crate) const TEMP_PREFIX: &str = ".lumbre-";
/// Suffix of temporary files.
pub(crate) const TEMP_SUFFIX: &str = ".tmp";

/// Greatest number of attempts to create a file in a folder that other processes remove while it is
/// empty.
const MAX_ATTEMPTS: u32 = 1000;

/// Age after which a temporary file counts as abandoned.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Writes a temporary file in the same folder, syncs it, and renames it to `path`. Creates the
/// folder.
///
/// # Errors
/// When the folder cannot be created or the file cannot be written; an existing file is then
/// unchanged.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    write_before_others(path, bytes)?;
    sync_folder(folder_of(path)).map_err(|e| StoreError::io("write", path, &e))
}

/// Writes as [`write_atomically`], but for the sync of the folder: until another file there is
/// written, a power failure may leave the old state.
///
/// # Errors
/// As [`write_atomically`].
pub(super) fn write_before_others(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    let mut file = temporary_in_new(folder_of(path))?;
    let mut attempt = || -> std::io::Result<()> {
        file.write_all(bytes)?;
        file.as_file().sync_all()
    };
    let written = attempt().and_then(|()| file.persist(path).map_err(|e| e.error));
    written
        .map(drop)
        .map_err(|e| StoreError::io("write", path, &e))
}

/// Creates a folder, and a temporary file in it. Another process may remove the folder while it is
/// empty.
fn temporary_in_new(folder: &Path) -> Result<tempfile::NamedTempFile, StoreError> {
    let mut attempts = 0;
    // A folder that is removed while it is created exists already, and then it does not.
    let is_removal =
        |e: &std::io::Error| matches!(e.kind(), ErrorKind::NotFound | ErrorKind::AlreadyExists);
    loop {
        attempts += 1;
        match fs::create_dir_all(folder).and_then(|()| temporary(folder)) {
            Err(e) if is_removal(&e) && attempts < MAX_ATTEMPTS => {}
            made => return made.map_err(|e| StoreError::io("create a file in", folder, &e)),
        }
    }
}

/// Writes a file atomically if its content would change, so that a night with nothing to do leaves
/// modification times unchanged.
///
/// # Errors
/// As [`write_atomically`].
pub(crate) fn write_if_changed(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    match regular_file::read(path) {
        Ok(old) if old == bytes => Ok(()),
        _ => write_atomically(path, bytes),
    }
}

/// Creates a folder and checks that it is writable, with an anonymous file that leaves nothing
/// behind after a crash.
///
/// # Errors
/// [`StoreError::Unwritable`] with the reason of the operating system.
pub fn probe(folder: &Path) -> Result<(), StoreError> {
    let attempt = || -> std::io::Result<()> {
        fs::create_dir_all(folder)?;
        let mut file = tempfile::tempfile_in(folder)?;
        file.write_all(b"probe")?;
        file.sync_all()
    };
    attempt().map_err(|e| StoreError::unwritable(folder, &e))
}

/// Removes all temporary files in a folder that no other process writes to.
pub fn remove_temporaries(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if is_temporary(&name.to_string_lossy()) {
            // A temporary file that cannot be removed does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Current time by the clock of a folder's file system, which may differ from the machine's clock.
pub(crate) fn now_in(folder: &Path) -> std::io::Result<SystemTime> {
    tempfile::tempfile_in(folder)?.metadata()?.modified()
}

/// Time since a file was written, by the clock of the folder's file system.
pub(crate) fn age(file: &File, folder: &Path) -> std::io::Result<Duration> {
    let written = file.metadata()?.modified()?;
    Ok(now_in(folder)?.duration_since(written).unwrap_or_default())
}

/// Removes abandoned temporary files in a folder to which other processes may be writing.
pub(crate) fn remove_old_temporaries(folder: &Path) {
    let Ok(now) = now_in(folder) else { return };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let modified = entry.metadata().and_then(|facts| facts.modified());
        let age = modified
            .ok()
            .and_then(|moment| now.duration_since(moment).ok())
            .unwrap_or_default();
        if is_temporary(&entry.file_name().to_string_lossy()) && age > ABANDONED {
            // A temporary file that cannot be removed does no harm.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether a file name is one of Lumbre's temporary files.
pub(crate) fn is_temporary(name: &str) -> bool {
    name.starts_with(TEMP_PREFIX) && name.ends_with(TEMP_SUFFIX)
}

/// Creates a temporary file with ordinary permissions in a folder.
pub(crate) fn temporary(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMP_PREFIX).suffix(TEMP_SUFFIX);
    #[cfg(unix)]
    {
        // Results are ordinary files, so the user's umask decides instead of the default mode 0600.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Syncs a folder, so that a rename survives a power failure. Does nothing on systems other than
/// Unix.
pub(crate) fn sync_folder(folder: &Path) -> std::io::Result<()> {
    if cfg!(unix) {
        File::open(folder)?.sync_all()
    } else {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use crate::store::write::atomic::*;

    #[test]
    fn replaces_whole_files_and_leaves_no_other() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b/file.json");
        write_atomically(&path, b"first, and longer").unwrap();
        write_atomically(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        // The target is a folder with something in it: the rename must fail.
        let path = dir.path().join("taken");
        fs::create_dir_all(path.join("inner")).unwrap();
        let error = write_atomically(&path, b"x").unwrap_err();
        assert!(error.to_string().contains("taken"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_folder_that_is_removed_while_it_is_empty_is_created_again() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("planners");
        let write = |i: usize| {
            let file = folder.join(i.to_string());
            write_atomically(&file, b"x").and_then(|()| {
                fs::remove_file(&file).map_err(|e| StoreError::io("remove", &file, &e))
            })
        };
        std::thread::scope(|scope| {
            let writing = scope.spawn(|| (0..200).try_for_each(write));
            while !writing.is_finished() {
                let _ = fs::remove_dir(&folder);
                std::thread::sleep(Duration::from_micros(100));
            }
            writing.join().unwrap().unwrap();
        });
    }

    #[test]
    fn unchanged_content_is_not_written_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("f");
        write_atomically(&path, b"same").unwrap();
        let before = fs::metadata(&path).unwrap().modified().unwrap();
        write_if_changed(&path, b"same").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), before);
        write_if_changed(&path, b"other").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"other");
    }

    #[test]
    fn the_probe_reports_the_folder_and_leaves_it_empty() {
        let dir = tempfile::tempdir().unwrap();
        probe(&dir.path().join("fresh")).unwrap();
        assert_eq!(fs::read_dir(dir.path().join("fresh")).unwrap().count(), 0);
        let file = dir.path().join("file");
        fs::write(&file, b"").unwrap();
        let error = probe(&file.join("below")).unwrap_err();
        assert!(matches!(error, StoreError::Unwritable { .. }));
        assert!(error.to_string().contains("--out"), "{error}");
    }
}
