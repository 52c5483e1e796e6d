//! Files that a scene names: as written, or where the same file lies on this machine.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::ffi::OsString;
use std::path::{Path, PathBuf};

use super::files::exists;
use lumbre_light::scene::Note;

/// Greatest number of last parts of an absolute path that are searched.
const MAX_PARTS: usize = 8;

thread_local! {
    /// Notes on files that were found elsewhere than written.
    static ELSEWHERE: RefCell<BTreeSet<Note>> = const { RefCell::new(BTreeSet::new()) };
}

/// Returns the path of a file that a file in `folder` names; `/` and `\` separate folders.
///
/// A name that leads nowhere is searched in other case, and an absolute one, which another machine
/// wrote, by its last parts below the folder, as many as lead to a file. What is found so is noted:
/// see [`notes`]. Otherwise the path is the one that is written.
pub fn beside(folder: &Path, name: &str) -> PathBuf {
    let written = written(folder, name);
    if exists(&written) {
        return written;
    }
    let name = name.replace('\\', "/");
    let parts: Vec<&str> = name
        .split('/')
        .filter(|part| !matches!(*part, "" | "."))
        .collect();
    let is_absolute = name.starts_with('/') || name.get(1..2) == Some(":");
    let most = if is_absolute {
        parts.len().min(MAX_PARTS)
    } else {
        1
    };
    let first = if is_absolute { parts.len() - most } else { 0 };
    let mut tails = (first..first + most).filter_map(|start| parts.get(start..));
    match tails.find_map(|parts| in_any_case(folder, parts)) {
        Some(found) => {
            let message = format!("there is no file `{name}`; `{}` is used", found.display());
            let note = Note::new(folder, "files", message);
            ELSEWHERE.with_borrow_mut(|notes| notes.insert(note));
            found
        }
        None => written,
    }
}

/// Returns the path that a file in `folder` writes as `name`.
pub fn written(folder: &Path, name: &str) -> PathBuf {
    folder.join(name.replace('\\', "/"))
}

/// Returns the notes on files that were found elsewhere since the last call, each once.
pub fn notes() -> BTreeSet<Note> {
    ELSEWHERE.take()
}

/// Returns the file below a folder whose path has these parts in any case.
fn in_any_case(folder: &Path, parts: &[&str]) -> Option<PathBuf> {
    let mut path = folder.to_owned();
    for part in parts {
        let exact = path.join(part);
        path = if exact.exists() {
            exact
        } else {
            path.join(same_but_for_case(&path, part)?)
        };
    }
    exists(&path).then_some(path)
}

/// Returns the first name in a folder, in alphabetical order, that differs from another in case alone.
fn same_but_for_case(folder: &Path, name: &str) -> Option<OsString> {
    let folder = if folder.as_os_str().is_empty() {
        Path::new(".")
    } else {
        folder
    };
    let wanted = name.to_lowercase();
    let entries = std::fs::read_dir(folder).ok()?.flatten();
    let names = entries.map(|entry| entry.file_name());
    names
        .filter(|found| found.to_string_lossy().to_lowercase() == wanted)
        .min()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_of_other_machines_are_found_beside_the_scene_and_noted() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("room");
        std::fs::create_dir_all(folder.join("Textures/wood")).unwrap();
        std::fs::write(folder.join("Textures/wood/Oak.PNG"), "").unwrap();
        std::fs::write(folder.join("lamp.obj"), "").unwrap();
        let oak = folder.join("Textures/wood/Oak.PNG");
        let found = |name: &str| {
            // Twice, as two maps of a material name one image.
            beside(&folder, name);
            (beside(&folder, name), notes().len())
        };
        for name in [
            "textures/WOOD/oak.png",
            "textures\\wood\\oak.png",
            "C:\\models\\room\\Textures\\wood\\Oak.PNG",
            "/srv/models/textures/wood/oak.png",
        ] {
            assert_eq!(found(name), (oak.clone(), 1), "{name}");
        }
        assert_eq!(found("Textures/wood/Oak.PNG"), (oak, 0), "as written");
        assert_eq!(found("D:/lamp.obj"), (folder.join("lamp.obj"), 1));
        // Only what another machine wrote is searched in other folders.
        assert_eq!(
            found("meshes/lamp.obj"),
            (folder.join("meshes/lamp.obj"), 0)
        );
        assert_eq!(
            found("/none/chair.obj"),
            (PathBuf::from("/none/chair.obj"), 0)
        );
        assert_eq!(found(""), (folder.join(""), 0));
    }
}
