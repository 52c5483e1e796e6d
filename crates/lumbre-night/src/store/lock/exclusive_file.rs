//! Files that exactly one of several processes creates or removes, without file locks.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::path::Path;
use std::time::Duration;

use tempfile::{NamedTempFile, TempPath};

use crate::paths::folder_of;
use crate::store::write::atomic::{self, TEMP_PREFIX, TEMP_SUFFIX};

/// Time after which the right of a process to replace a file counts as abandoned. The process needs
/// it for two calls of the system.
const ABANDONED: Duration = Duration::from_secs(120);

/// Renames a temporary file to `path` unless a file exists there. Returns `None` if one does.
pub(crate) fn persist_exclusively(file: NamedTempFile, path: &Path) -> io::Result<Option<File>> {
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

/// Replaces the file at `path`, whose content was found to be `old`, by a temporary one. Returns
/// `None` if another process has replaced or removed it, or is about to.
///
/// The right to replace a content is a file that one process creates. That process passes the file
/// at `path` to `judge` again, so a process that looked before another one replaced it changes
/// nothing. In contrast to a file that is renamed away for a look, `path` always has a file.
pub(crate) fn replace_exclusively(
    path: &Path,
    old: &[u8],
    judge: impl FnOnce(&mut File) -> io::Result<bool>,
    new: NamedTempFile,
) -> io::Result<Option<File>> {
    let Some(_right) = right_to_replace(path, old)? else {
        return Ok(None);
    };
    let judged = match OpenOptions::new().read(true).write(true).open(path) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => false,
        opened => judge(&mut opened?)?,
    };
    if !judged {
        return Ok(None);
    }
    let (file, temporary) = new.into_parts();
    // Replaces files that other processes have open, on Windows too.
    fs::rename(&temporary, path)?;
    temporary.keep()?;
    Ok(Some(file))
}

/// Acquires the right to replace a content of a file. The right lasts until the returned path is
/// dropped. Returns `None` if another process has it. The right of a process that ended with it
/// lasts for [`ABANDONED`].
fn right_to_replace(path: &Path, old: &[u8]) -> io::Result<Option<TempPath>> {
    let folder = folder_of(path);
    let content = &blake3::hash(old).to_hex()[..16];
    for attempt in 0.. {
        let name = format!("{TEMP_PREFIX}{content}-{attempt}{TEMP_SUFFIX}");
        let right = folder.join(name);
        if persist_exclusively(atomic::temporary(folder)?, &right)?.is_some() {
            return Ok(Some(TempPath::try_from_path(right)?));
        }
        let is_abandoned = match File::open(&right) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => false,
            opened => atomic::age(&opened?, folder)? > ABANDONED,
        };
        if !is_abandoned {
            break;
        }
    }
    Ok(None)
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
    use std::io::Write;
    use std::time::SystemTime;

    use crate::store::lock::exclusive_file::*;

    /// Replaces the file if it has the content that was found before.
    fn replace(path: &Path, old: &str, new: &str) -> bool {
        let mut file = atomic::temporary(folder_of(path)).unwrap();
        file.write_all(new.as_bytes()).unwrap();
        let unchanged =
            |there: &mut File| Ok(io::read_to_string(there).is_ok_and(|text| text == old));
        replace_exclusively(path, old.as_bytes(), unchanged, file)
            .unwrap()
            .is_some()
    }

    #[test]
    fn a_file_is_replaced_only_by_a_process_that_knows_its_content() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("claim");
        assert!(!replace(&path, "first", "second"), "there is no file");
        fs::write(&path, "first").unwrap();
        assert!(replace(&path, "first", "second"));
        assert!(!replace(&path, "first", "third"), "it was replaced before");
        assert_eq!(fs::read_to_string(&path).unwrap(), "second");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
    }

    #[test]
    fn the_right_to_replace_a_content_belongs_to_one_process_and_ends_with_it() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("claim");
        fs::write(&path, "first").unwrap();
        let right = right_to_replace(&path, b"first").unwrap().unwrap();
        assert!(!replace(&path, "first", "second"));
        assert!(right_to_replace(&path, b"other").unwrap().is_some());
        // The process that has the right ends without giving it back.
        File::options()
            .write(true)
            .open(&right)
            .and_then(|file| file.set_modified(SystemTime::now() - 2 * ABANDONED))
            .unwrap();
        assert!(replace(&path, "first", "second"));
    }
}
