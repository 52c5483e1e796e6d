//! Names and places: which folder belongs to which experiment, run and reference.

use std::fs;
use std::path::{Path, PathBuf};

use crate::experiment::{Cell, RunId};

/// Fewest digits of the plan's hash in an experiment folder's name.
pub(super) const HASH_DIGITS: usize = 4;
/// Longest name of one folder on a readable path, in bytes; file systems end at 255.
const LONGEST_NAME: usize = 120;

/// The last file of a run and of a reference.
const LAST: [&str; 2] = ["done.json", "ref.json"];

/// Whether a run or a reference is done: whether its last file is there.
pub(super) fn is_done(folder: &Path) -> bool {
    last(folder).is_some()
}

/// The name of the last file of a run or a reference, if it is there.
pub(super) fn last(folder: &Path) -> Option<&'static str> {
    LAST.into_iter().find(|name| folder.join(name).is_file())
}

/// `<out>/<name>-<first digits of hash>`.
pub(super) fn experiment_folder(out: &Path, name: &str, hash: &str, digits: usize) -> PathBuf {
    out.join(format!("{name}-{}", &hash[..digits.min(hash.len())]))
}

/// Every folder of an experiment with this name, ordered by name.
pub(super) fn siblings(out: &Path, name: &str) -> Vec<PathBuf> {
    let belongs = |folder: &Path| {
        let digits = folder.file_name().and_then(|n| n.to_str()).and_then(|n| n.strip_prefix(name)?.strip_prefix('-'));
        digits.is_some_and(|d| d.len() >= HASH_DIGITS && d.bytes().all(|b| b.is_ascii_hexdigit()))
    };
    folders_in(out).into_iter().filter(|f| belongs(f)).collect()
}

/// The folders in a folder, ordered by name; links (such as `latest`) are left out.
pub(super) fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> =
        entries.filter(|e| e.file_type().is_ok_and(|t| t.is_dir())).map(|e| e.path()).collect();
    found.sort();
    found
}

/// The folder of a cell's run inside its experiment's.
pub(super) fn run_folder(experiment: &Path, cell: &Cell) -> PathBuf {
    experiment.join("runs").join(safe(&cell.path)).join(&cell.id.0)
}

/// The folder of a reference.
pub(super) fn reference_folder(out: &Path, id: &RunId) -> PathBuf {
    let shelf = id.0.get(..2).unwrap_or("00");
    out.join("refs").join(shelf).join(&id.0)
}

/// The name that the copy of an image file has in a reference's folder: `ref.` and its own extension.
pub(super) fn imported(file: &Path) -> String {
    let extension = file.extension().map(|e| e.to_string_lossy().to_lowercase()).unwrap_or_default();
    format!("ref.{}", if extension.is_empty() { "image" } else { &extension })
}

/// Every run folder below `folder`: those that hold a `config.json`, ordered by path.
pub(super) fn runs_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        if next.join("config.json").is_file() {
            found.push(next);
        } else {
            open.extend(folders_in(&next));
        }
    }
    found.sort();
    found
}

/// One run folder below `folder`, whichever is found first.
pub(super) fn any_run_below(folder: &Path) -> Option<PathBuf> {
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        if next.join("config.json").is_file() {
            return Some(next);
        }
        open.extend(folders_in(&next));
    }
    None
}

/// A relative path that is safe on every file system and cannot leave its folder. What makes two runs different is
/// their id, so that two values may well come to look alike here.
pub(super) fn safe(path: &str) -> PathBuf {
    let component = |part: &str| -> String {
        let keep = |c: char| if c.is_alphanumeric() || "=._+-,[]".contains(c) { c } else { '_' };
        let mut name: String = part.chars().map(keep).collect();
        while name.len() > LONGEST_NAME {
            name.pop();
        }
        // Windows drops dots at the end of names, and `..` leads out.
        name.trim_end_matches('.').to_owned()
    };
    path.split(['/', '\\']).map(component).filter(|c| !c.is_empty()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readable_paths_cannot_leave_their_folder() {
        assert_eq!(safe("scene=box/depth=5/rep=0"), PathBuf::from("scene=box/depth=5/rep=0"));
        assert_eq!(safe("/etc/../../passwd"), PathBuf::from("etc/passwd"));
        assert_eq!(safe("scene=C:\\a b?*"), PathBuf::from("scene=C_/a_b__"));
        assert!(safe(&"é".repeat(500)).to_str().unwrap().len() <= LONGEST_NAME);
    }

    #[test]
    fn siblings_are_those_with_the_same_name_and_a_hash() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["night-3f9a", "night-beef-1234", "night-12", "night-00112", "nights-3f9a", "night"] {
            fs::create_dir(dir.path().join(name)).unwrap();
        }
        let names = |n: &str| -> Vec<String> {
            siblings(dir.path(), n).iter().map(|p| p.file_name().unwrap().to_string_lossy().into_owned()).collect()
        };
        assert_eq!(names("night"), ["night-00112", "night-3f9a"]);
        assert_eq!(names("night-beef"), ["night-beef-1234"]);
    }
}
