//! Names of files and folders: where each experiment, run and reference is stored.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::schema::StoredFile;
use super::schema::run::{ConfigFile, DONE, REFERENCE};
use crate::experiment::{Plan, RunId};
use crate::paths::extension;

/// Name of the folder of layer images inside a run's folder.
pub const FILMS: &str = "films";

/// Minimum number of digits of the plan's hash in an experiment folder's name.
pub(super) const HASH_DIGITS: usize = 4;
/// Maximum length of one folder name on a readable path, in bytes; file systems allow 255.
const LONGEST_NAME: usize = 120;

/// Names of the file that is written last: in runs, in references.
const DONE_FILES: [&str; 2] = [DONE, REFERENCE];

/// Whether a run or a reference is finished, which means that its last file exists.
pub(super) fn is_done(folder: &Path) -> bool {
    done_file(folder).is_some()
}

/// Returns the name of a run's or reference's last file, if it exists.
pub(super) fn done_file(folder: &Path) -> Option<&'static str> {
    DONE_FILES
        .into_iter()
        .find(|name| folder.join(name).is_file())
}

/// Path `<out>/<name>-<hash>`, with the first `digits` digits of the hash.
pub(super) fn experiment_folder(out: &Path, name: &str, hash: &str, digits: usize) -> PathBuf {
    out.join(format!("{name}-{}", &hash[..digits.min(hash.len())]))
}

/// Lists the folders of all experiments with this name, ordered by name.
pub(super) fn siblings(out: &Path, name: &str) -> Vec<PathBuf> {
    let belongs = |folder: &Path| {
        let digits = folder
            .file_name()
            .and_then(|n| n.to_str())
            .and_then(|n| n.strip_prefix(name)?.strip_prefix('-'));
        digits.is_some_and(|d| d.len() >= HASH_DIGITS && d.bytes().all(|b| b.is_ascii_hexdigit()))
    };
    folders_in(out).into_iter().filter(|f| belongs(f)).collect()
}

/// Lists the subfolders of a folder, ordered by name. Skips links such as `latest`.
pub(super) fn folders_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let mut found: Vec<PathBuf> = entries
        .filter(|e| e.file_type().is_ok_and(|t| t.is_dir()))
        .map(|e| e.path())
        .collect();
    found.sort();
    found
}

/// Lists everything in a folder that is no folder, ordered by name.
pub(super) fn files_in(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let files = entries.filter(|e| e.file_type().is_ok_and(|t| !t.is_dir()));
    let mut found: Vec<PathBuf> = files.map(|e| e.path()).collect();
    found.sort();
    found
}

/// Folder of a cell's run inside the experiment's folder, the same for all cells that are one run.
pub(super) fn run_folder(experiment: &Path, plan: &Plan, index: usize) -> PathBuf {
    experiment.join("runs").join(run_name(plan, index))
}

/// Folder of a cell's run relative to the folder of all runs.
pub(super) fn run_name(plan: &Plan, index: usize) -> PathBuf {
    let first = plan.first_cell(index);
    sanitize(&first.path).join(&first.id.0)
}

/// Folder of a reference.
pub(super) fn reference_folder(out: &Path, id: &RunId) -> PathBuf {
    let shelf = id.0.get(..2).unwrap_or("00");
    out.join("refs").join(shelf).join(&id.0)
}

/// File name of an imported reference image: `ref.` and the original extension in lower case.
pub(super) fn imported_file_name(file: &Path) -> String {
    let extension = extension(file);
    format!(
        "ref.{}",
        if extension.is_empty() {
            "image"
        } else {
            &extension
        }
    )
}

/// Lists the run folders below `folder`, those with a `config.json`, ordered by path.
pub(super) fn runs_below(folder: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        if next.join(ConfigFile::NAME).is_file() {
            found.push(next);
        } else {
            open.extend(folders_in(&next));
        }
    }
    found.sort();
    found
}

/// Maps the ids of all finished runs in these experiment folders to their run folders. Of several
/// runs with one id, the last counts.
pub(super) fn finished_runs(
    experiments: impl IntoIterator<Item = PathBuf>,
) -> BTreeMap<String, PathBuf> {
    experiments
        .into_iter()
        .flat_map(|folder| runs_below(&folder.join("runs")))
        .filter(|run| run.join(DONE).is_file())
        .filter_map(|run| Some((run.file_name()?.to_str()?.to_owned(), run)))
        .collect()
}

/// Returns any one run folder below `folder`.
pub(super) fn any_run_below(folder: &Path) -> Option<PathBuf> {
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        if next.join(ConfigFile::NAME).is_file() {
            return Some(next);
        }
        open.extend(folders_in(&next));
    }
    None
}

/// Converts a readable path to a relative path that is valid on every file system and cannot leave
/// its folder. Different inputs may give the same path; runs are distinguished by the id that follows
/// it.
pub(super) fn sanitize(path: &str) -> PathBuf {
    let component = |part: &str| -> String {
        let allowed = |c: char| c.is_alphanumeric() || "=._+-,[]".contains(c);
        let replaced = |c: char| if allowed(c) { c } else { '_' };
        let mut name: String = part.chars().map(replaced).collect();
        while name.len() > LONGEST_NAME {
            name.pop();
        }
        // Windows drops trailing dots, and `..` leads out of the folder.
        name.trim_end_matches('.').to_owned()
    };
    path.split(['/', '\\'])
        .map(component)
        .filter(|c| !c.is_empty())
        .collect()
}

/// Lists the finished runs of this experiment in the folders beside `folder`, by id.
pub(crate) fn finished_in_siblings(
    out: &Path,
    name: &str,
    folder: &Path,
) -> BTreeMap<String, PathBuf> {
    finished_runs(
        siblings(out, name)
            .into_iter()
            .filter(|other| other != folder),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn readable_paths_cannot_leave_their_folder() {
        assert_eq!(
            sanitize("scene=box/depth=5/rep=0"),
            PathBuf::from("scene=box/depth=5/rep=0")
        );
        assert_eq!(sanitize("/etc/../../passwd"), PathBuf::from("etc/passwd"));
        assert_eq!(sanitize("scene=C:\\a b?*"), PathBuf::from("scene=C_/a_b__"));
        assert!(sanitize(&"é".repeat(500)).to_str().unwrap().len() <= LONGEST_NAME);
    }

    #[test]
    fn siblings_are_those_with_the_same_name_and_a_hash() {
        let dir = tempfile::tempdir().unwrap();
        for name in [
            "night-3f9a",
            "night-beef-1234",
            "night-12",
            "night-00112",
            "nights-3f9a",
            "night",
        ] {
            fs::create_dir(dir.path().join(name)).unwrap();
        }
        let names = |n: &str| -> Vec<String> {
            siblings(dir.path(), n)
                .iter()
                .map(|p| p.file_name().unwrap().to_string_lossy().into_owned())
                .collect()
        };
        assert_eq!(names("night"), ["night-00112", "night-3f9a"]);
        assert_eq!(names("night-beef"), ["night-beef-1234"]);
    }
}
