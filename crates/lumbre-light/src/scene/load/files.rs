//! Record of the files that are opened to read scenes.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

thread_local! {
    /// Files opened on this thread, while a recording is active.
    static OPENED: RefCell<Option<BTreeSet<PathBuf>>> = const { RefCell::new(None) };
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
