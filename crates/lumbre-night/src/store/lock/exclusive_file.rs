//! Files that exactly one of several processes creates or removes, without file locks.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::Path;

use crate::store::write::atomic;

/// Renames a temporary file to `path` unless a file exists there. Returns `None` if one does.
pub(crate) fn persist_exclusively(
    file: tempfile::NamedTempFile,
    path: &Path,
) -> io::Result<Option<File>> {
    match file.persist_noclobber(path) {
        Ok(file) => Ok(Some(file)),
        // A network file system may repeat a request and report its own success as a collision.
        Err(e)
            if e.error.kind() == io::ErrorKind::AlreadyExists
                && is_file_at(e.file.as_file(), path) =>
        {
            Ok(Some(e.file.as_file().try_clone()?))
        }
        // The owner of an earlier claim may have removed this temporary file.
        Err(e)
            if matches!(
                e.error.kind(),
                io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound
            ) =>
        {
            Ok(None)
        }
        Err(e) => Err(e.error),
    }
}

/// Removes the file at `path`, which only one process can do, and returns whether it did. The file
/// is renamed away and passed to `judge`. If `judge` does not return `true`, the file gets its name
/// back, unless another process has created a file there meanwhile.
pub(crate) fn remove_exclusively(
    folder: &Path,
    path: &Path,
    judge: impl FnOnce(&mut File) -> io::Result<bool>,
) -> io::Result<bool> {
    // Only the unique name is needed. A crash leaves a temporary file, which is removed later.
    let aside = atomic::temporary(folder)?.into_temp_path();
    match fs::rename(path, &aside) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        renamed => renamed?,
    }
    let judged = OpenOptions::new()
        .read(true)
        .write(true)
        .open(&aside)
        .and_then(|mut file| judge(&mut file));
    if !matches!(judged, Ok(true)) {
        // This fails if another process has created a file there, which then remains.
        let _ = fs::hard_link(&aside, path);
    }
    judged
}

/// Whether an open file is the one at `path`.
#[cfg(unix)]
pub(super) fn is_file_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: fs::Metadata, b: fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata()
        .is_ok_and(|open| fs::metadata(path).is_ok_and(|there| same(open, there)))
}

#[cfg(not(unix))]
pub(super) fn is_file_at(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use crate::store::lock::exclusive_file::*;

    #[test]
    fn a_file_that_is_not_confirmed_gets_its_name_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("claim");
        fs::write(&path, "another process's claim").unwrap();
        assert!(!remove_exclusively(dir.path(), &path, |_| Ok(false)).unwrap());
        assert_eq!(
            fs::read_to_string(&path).unwrap(),
            "another process's claim"
        );
        // A claim that another process creates meanwhile stays.
        let other = path.clone();
        assert!(
            !remove_exclusively(dir.path(), &path, |_| fs::write(other, "a third")
                .map(|()| false))
            .unwrap()
        );
        assert_eq!(fs::read_to_string(&path).unwrap(), "a third");
        assert!(remove_exclusively(dir.path(), &path, |_| Ok(true)).unwrap() && !path.exists());
        assert!(
            !remove_exclusively(dir.path(), &path, |_| Ok(true)).unwrap(),
            "it was removed before"
        );
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
