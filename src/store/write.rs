//! Writing files so that a reader finds either the old one or the whole new one.

use std::fs::{self, File};
use std::io::Write;
use std::path::Path;
use std::time::{Duration, SystemTime};

use super::StoreError;

/// What temporary files are called; a crash may leave one, and whoever owns the folder next removes it.
const TEMP_PREFIX: &str = ".lumbre-";
const TEMP_SUFFIX: &str = ".tmp";

/// After so long nobody is still writing a temporary file.
const ABANDONED: Duration = Duration::from_secs(3600);

/// Writes a file beside its final name, syncs it, and renames it into place.
///
/// # Errors
/// When the folder cannot be created or the file cannot be written; nothing is then left under the final name but
/// what was there before.
pub fn atomic(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    // The parent of a bare file name is empty, which no folder is called.
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(|e| StoreError::io("create", folder, &e))?;
    let attempt = || -> std::io::Result<()> {
        let mut file = temporary(folder)?;
        file.write_all(bytes)?;
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        sync_folder(folder)
    };
    attempt().map_err(|e| StoreError::io("write", path, &e))
}

/// Writes a file only if its content would change, so that a night with nothing to do leaves dates alone.
///
/// # Errors
/// As [`atomic`].
pub(super) fn if_changed(path: &Path, bytes: &[u8]) -> Result<(), StoreError> {
    match fs::read(path) {
        Ok(old) if old == bytes => Ok(()),
        _ => atomic(path, bytes),
    }
}

/// Creates a folder and finds out whether files can be written in it, by one that has no name and so outlives no crash.
///
/// # Errors
/// [`StoreError::Unwritable`] with the system's reason.
pub fn probe(folder: &Path) -> Result<(), StoreError> {
    let attempt = || -> std::io::Result<()> {
        fs::create_dir_all(folder)?;
        let mut file = tempfile::tempfile_in(folder)?;
        file.write_all(b"probe")?;
        file.sync_all()
    };
    attempt().map_err(|e| StoreError::unwritable(folder, &e))
}

/// Removes temporary files that a crash left in a folder that nobody else writes to.
pub(super) fn sweep_temporaries(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name();
        if is_temporary(&name.to_string_lossy()) {
            // A leftover that cannot be removed harms nobody.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// What the clock of a folder's file system shows, which no machine's clock need agree with.
pub(super) fn now_in(folder: &Path) -> std::io::Result<SystemTime> {
    tempfile::tempfile_in(folder)?.metadata()?.modified()
}

/// The same in a folder to which others may be writing at this moment: only what is old.
pub(super) fn sweep_old_temporaries(folder: &Path) {
    let Ok(now) = now_in(folder) else { return };
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let modified = entry.metadata().and_then(|facts| facts.modified());
        let age = modified.ok().and_then(|moment| now.duration_since(moment).ok()).unwrap_or_default();
        if is_temporary(&entry.file_name().to_string_lossy()) && age > ABANDONED {
            // A leftover that cannot be removed harms nobody.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Whether a file's name is one of our temporary ones.
pub(super) fn is_temporary(name: &str) -> bool {
    name.starts_with(TEMP_PREFIX) && name.ends_with(TEMP_SUFFIX)
}

pub(super) fn temporary(folder: &Path) -> std::io::Result<tempfile::NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(TEMP_PREFIX).suffix(TEMP_SUFFIX);
    #[cfg(unix)]
    {
        // Results are ordinary files: the user's umask decides, not the secrecy of temporary files.
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

/// Makes a rename survive a power cut, where folders can be synced.
pub(super) fn sync_folder(folder: &Path) -> std::io::Result<()> {
    if cfg!(unix) { File::open(folder)?.sync_all() } else { Ok(()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn replaces_whole_files_and_leaves_no_other() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a/b/file.json");
        atomic(&path, b"first, and longer").unwrap();
        atomic(&path, b"second").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"second");
        assert_eq!(fs::read_dir(path.parent().unwrap()).unwrap().count(), 1);
    }

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_beside_it() {
        let dir = tempfile::tempdir().unwrap();
        // The target is a folder with something in it: the rename must fail.
        let path = dir.path().join("taken");
        fs::create_dir_all(path.join("inner")).unwrap();
        let error = atomic(&path, b"x").unwrap_err();
        assert!(error.to_string().contains("taken"), "{error}");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn unchanged_content_is_not_written_again() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("f");
        atomic(&path, b"same").unwrap();
        let before = fs::metadata(&path).unwrap().modified().unwrap();
        if_changed(&path, b"same").unwrap();
        assert_eq!(fs::metadata(&path).unwrap().modified().unwrap(), before);
        if_changed(&path, b"other").unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"other");
    }

    #[test]
    fn the_probe_names_the_folder_and_leaves_it_empty() {
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
