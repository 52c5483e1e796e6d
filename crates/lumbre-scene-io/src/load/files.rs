//! Record of the files that are opened to read scenes, and the folder that they have to be in.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

thread_local! {
    /// Files opened on this thread, while a recording is active.
    static OPENED: RefCell<Option<BTreeSet<PathBuf>>> = const { RefCell::new(None) };
}

/// Folder that all files have to be in. Without one, they may be anywhere.
static CONFINED: OnceLock<PathBuf> = OnceLock::new();

/// Refuses from now on every file of a scene or script outside a folder. Only the first call of a
/// process counts.
///
/// # Errors
/// When there is no such folder.
pub fn confine(folder: &Path) -> std::io::Result<()> {
    let folder = folder.canonicalize()?;
    CONFINED.get_or_init(|| folder);
    Ok(())
}

/// Checks that a file may be read: links are resolved, and it is in the folder of [`confine`].
///
/// # Errors
/// When it is outside, or does not exist; the text is the reason.
pub fn check(file: &Path) -> Result<(), String> {
    match CONFINED.get() {
        Some(folder) => is_inside(file, folder),
        None => Ok(()),
    }
}

/// Returns whether there is a file that may be read.
pub fn exists(file: &Path) -> bool {
    check(file).is_ok() && file.is_file()
}

/// Checks that a file is inside a folder whose path is canonical.
fn is_inside(file: &Path, folder: &Path) -> Result<(), String> {
    let outside = || {
        format!(
            "it is outside {}, to which files are confined",
            folder.display()
        )
    };
    // Whether a file outside exists is not told either.
    let real = file.canonicalize().map_err(|_| outside())?;
    real.starts_with(folder).then_some(()).ok_or_else(outside)
}

/// Runs a function and returns its result with all files that it opened on this thread to read
/// scenes: scene files, meshes, materials, textures, buffers, and the modules of Lua scenes.
pub fn opened_by<T>(work: impl FnOnce() -> T) -> (T, BTreeSet<PathBuf>) {
    let before = OPENED.replace(Some(BTreeSet::new()));
    let result = work();
    let opened = OPENED.replace(before).unwrap_or_default();
    // An enclosing recording includes the files of this one.
    opened.iter().for_each(|file| record(file));
    (result, opened)
}

/// Records that a file is opened to read a scene.
pub fn record(file: &Path) {
    OPENED.with_borrow_mut(|opened| {
        if let Some(opened) = opened {
            opened.insert(file.to_owned());
        }
    });
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn files_outside_a_folder_are_refused_by_any_path() {
        let dir = tempfile::tempdir().unwrap();
        let inside = dir
            .path()
            .join("inside")
            .canonicalize()
            .unwrap_or_else(|_| {
                let folder = dir.path().join("inside");
                std::fs::create_dir(&folder).unwrap();
                folder.canonicalize().unwrap()
            });
        std::fs::write(dir.path().join("secret"), "").unwrap();
        std::fs::write(inside.join("mesh.obj"), "").unwrap();
        std::os::unix::fs::symlink("../secret", inside.join("link.obj")).unwrap();
        assert_eq!(is_inside(&inside.join("mesh.obj"), &inside), Ok(()));
        assert_eq!(
            is_inside(&inside.join("../inside/mesh.obj"), &inside),
            Ok(())
        );
        for path in ["../secret", "link.obj", "/etc/passwd", "../none"] {
            let refused = is_inside(&inside.join(path), &inside).unwrap_err();
            assert!(refused.starts_with("it is outside"), "{path}: {refused}");
        }
    }

    #[test]
    fn nested_recordings_contain_the_files_opened_within_them() {
        record(Path::new("before"));
        let (inner, outer) = opened_by(|| {
            record(Path::new("a"));
            opened_by(|| record(Path::new("b"))).1
        });
        record(Path::new("after"));
        let names = |files: BTreeSet<PathBuf>| {
            files
                .iter()
                .map(|f| f.display().to_string())
                .collect::<Vec<_>>()
        };
        assert_eq!(
            (names(inner), names(outer)),
            (vec!["b".to_owned()], vec!["a".to_owned(), "b".to_owned()])
        );
    }
}
