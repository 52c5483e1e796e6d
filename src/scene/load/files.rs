//! Which files scenes are made of: all that is opened to read one, whatever names it.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

thread_local! {
    /// What was opened on this thread, while somebody wants to know.
    static OPENED: RefCell<Option<BTreeSet<PathBuf>>> = const { RefCell::new(None) };
}

/// Does some work, and says every file that it opened on this thread to read scenes: their own files, meshes, materials,
/// textures, buffers, and the modules of those written in Lua.
pub fn opened_by<T>(work: impl FnOnce() -> T) -> (T, BTreeSet<PathBuf>) {
    let before = OPENED.replace(Some(BTreeSet::new()));
    let done = work();
    let opened = OPENED.replace(before).unwrap_or_default();
    // Whoever wants to know of more wants to know of these too.
    opened.iter().for_each(|file| note(file));
    (done, opened)
}

/// Notes that a file is opened to read a scene.
pub fn note(file: &Path) {
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
    fn files_are_noted_while_somebody_wants_to_know() {
        note(Path::new("before"));
        let (inner, outer) = opened_by(|| {
            note(Path::new("a"));
            opened_by(|| note(Path::new("b"))).1
        });
        note(Path::new("after"));
        let names = |files: BTreeSet<PathBuf>| files.iter().map(|f| f.display().to_string()).collect::<Vec<_>>();
        assert_eq!((names(inner), names(outer)), (vec!["b".to_owned()], vec!["a".to_owned(), "b".to_owned()]));
    }
}
