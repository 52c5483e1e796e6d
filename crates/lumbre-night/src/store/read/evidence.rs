//! Opens the files of runs for those who draw conclusions from them. Every file of a finished run is
//! compared with the checksum in its `done.json` or `ref.json` before it is used.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use super::run_reader::RunReader;
use crate::store::schema::run::{DONE, DoneFile, REFERENCE};
use crate::store::write::manifest_checksum;
use crate::store::{FILMS, regular_file};

/// Verified access to the files of runs. Remembers the manifests that it has read, so that the
/// pictures of a run cost one hash each, and collects what does not agree with its checksum.
#[derive(Debug, Default)]
pub struct Evidence {
    /// Results of reading the manifests by the folders of their runs.
    manifests: RefCell<BTreeMap<PathBuf, Manifest>>,
    /// BLAKE3 hashes, in hexadecimal, of image files that the plan identifies by their content.
    imported: RefCell<BTreeMap<PathBuf, String>>,
    problems: RefCell<BTreeSet<String>>,
}

/// Manifest of a run, `None` if it is not finished, or the problem of its files.
type Manifest = Result<Option<Rc<DoneFile>>, String>;

impl Evidence {
    /// Returns the results of the run with this id: its manifest is intact, names this run, and all
    /// files that it lists exist with their sizes. Returns `None` if the run is not finished.
    ///
    /// # Errors
    /// Description of what does not agree, which is among the [problems](Evidence::problems) too.
    pub fn run(&self, folder: &Path, id: &str) -> Manifest {
        let found = self.manifest(folder);
        let checked = found.and_then(|done| match &done {
            Some(found) if found.run() != id => Err("it belongs to another run".to_owned()),
            Some(found) => manifest_checksum::verify_sizes(folder, found).map(|()| done),
            None => Ok(None),
        });
        checked.map_err(|problem| self.report(folder, &problem))
    }

    /// Does what [`Evidence::run`] does. A run that is `expected` to be finished must have its last
    /// file, `done`.
    ///
    /// # Errors
    /// Description of what does not agree, or of what is missing.
    pub fn expected(&self, folder: &Path, id: &str, done: &str, expected: bool) -> Manifest {
        match self.run(folder, id)? {
            None if expected => Err(self.report(
                folder,
                &format!("{done} is missing, although the run was finished; run the night again"),
            )),
            found => Ok(found),
        }
    }

    /// Reads a file. A file of a finished run has to match the checksum in the manifest of the run,
    /// and an image file that a plan names has to be the one that it was planned with.
    ///
    /// # Errors
    /// When it cannot be read, or does not agree; the text names the file.
    pub fn read(&self, path: &Path) -> Result<Vec<u8>, String> {
        if let Some(hash) = self.imported.borrow().get(path) {
            let bytes = regular_file::read(path).map_err(|e| describe(path, &e))?;
            return if blake3::hash(&bytes).to_hex().as_str() == hash {
                Ok(bytes)
            } else {
                Err(self.report(path, "it has changed since it was planned with"))
            };
        }
        let real = std::fs::canonicalize(path).map_err(|e| describe(path, &e))?;
        let Some((folder, name)) = run_and_name(&real) else {
            return regular_file::read(path).map_err(|e| describe(path, &e));
        };
        let manifest = self.manifest(&folder);
        let done = manifest.map_err(|problem| self.report(&folder, &problem))?;
        match done.as_ref().and_then(|done| done.files().get(&name)) {
            Some(sum) => manifest_checksum::read(&folder, &name, sum)
                .map_err(|problem| self.report(&folder, &problem)),
            None => regular_file::read(path).map_err(|e| describe(path, &e)),
        }
    }

    /// Registers an image file whose content a plan identifies by this BLAKE3 hash in hexadecimal.
    pub fn expect(&self, path: &Path, blake3: &str) {
        let mut imported = self.imported.borrow_mut();
        imported.insert(path.to_owned(), blake3.to_owned());
    }

    /// Adds the problem of a file or folder. Returns it as a sentence.
    pub fn report(&self, path: &Path, problem: &str) -> String {
        let problem = format!("{}: {problem}", path.display());
        self.problems.borrow_mut().insert(problem.clone());
        problem
    }

    /// Everything so far that does not agree with its checksum, each problem once.
    pub fn problems(&self) -> Vec<String> {
        self.problems.borrow().iter().cloned().collect()
    }

    fn manifest(&self, folder: &Path) -> Manifest {
        let mut manifests = self.manifests.borrow_mut();
        let read = || RunReader::new(folder.to_owned()).manifest();
        let found = manifests.entry(folder.to_owned()).or_insert_with(|| {
            let read = read()?;
            Ok(read.map(Rc::new))
        });
        found.clone()
    }
}

/// Splits the path of a file into the folder of the run that contains it and its name there. Returns
/// `None` if it is in no run with a manifest.
fn run_and_name(path: &Path) -> Option<(PathBuf, String)> {
    let name = path.file_name()?.to_str()?;
    let parent = path.parent()?;
    let (folder, name) = if parent.file_name().is_some_and(|name| name == FILMS) {
        (parent.parent()?, format!("{FILMS}/{name}"))
    } else {
        (parent, name.to_owned())
    };
    let has_manifest = [DONE, REFERENCE]
        .iter()
        .any(|last| folder.join(last).exists());
    has_manifest.then(|| (folder.to_owned(), name))
}

/// Describes a file that the operating system could not read.
fn describe(path: &Path, error: &std::io::Error) -> String {
    format!("{}: {error}", path.display())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::schema::StoredFile;
    use crate::store::schema::run::RunResults;

    /// A finished run with a picture and a layer.
    fn run(folder: &Path) {
        std::fs::create_dir_all(folder.join(FILMS)).unwrap();
        std::fs::write(folder.join("final.exr"), b"picture").unwrap();
        std::fs::write(folder.join("films/bounces.exr"), b"layer").unwrap();
        let done = DoneFile::Rendered(Box::new(RunResults {
            run: "ab".to_owned(),
            ..RunResults::default()
        }));
        let done = manifest_checksum::add_checksums(folder, &done).unwrap();
        std::fs::write(folder.join(DONE), done.text()).unwrap();
    }

    #[test]
    fn a_file_with_another_content_of_the_same_size_is_refused_and_named() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().canonicalize().unwrap().join("ab");
        run(&folder);
        for name in ["final.exr", "films/bounces.exr"] {
            let evidence = Evidence::default();
            let path = folder.join(name);
            let intact = evidence.read(&path).unwrap();
            assert!(evidence.problems().is_empty());
            let mut changed = intact.clone();
            changed[2] ^= 1;
            std::fs::write(&path, changed).unwrap();
            let problem = evidence.read(&path).unwrap_err();
            assert!(
                problem.ends_with(&format!("{name} is damaged")),
                "{problem}"
            );
            assert_eq!(evidence.problems(), [problem]);
            std::fs::write(&path, intact).unwrap();
        }
    }

    #[test]
    fn manifests_that_changed_or_belong_to_another_run_are_refused() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().canonicalize().unwrap().join("ab");
        run(&folder);
        assert!(Evidence::default().run(&folder, "ab").unwrap().is_some());
        let problem = Evidence::default().run(&folder, "cd").unwrap_err();
        assert!(problem.contains("belongs to another run"), "{problem}");
        let done = std::fs::read_to_string(folder.join(DONE)).unwrap();
        let changed = done.replace("\"samples\": 0", "\"samples\": 9");
        std::fs::write(folder.join(DONE), changed).unwrap();
        let evidence = Evidence::default();
        let problem = evidence.run(&folder, "ab").unwrap_err();
        assert!(problem.contains("done.json is damaged"), "{problem}");
        assert!(evidence.read(&folder.join("final.exr")).is_err());
        assert_eq!(evidence.problems().len(), 1);
        std::fs::remove_file(folder.join(DONE)).unwrap();
        assert_eq!(Evidence::default().run(&folder, "ab"), Ok(None));
    }

    #[test]
    fn image_files_have_to_be_those_that_the_plan_names() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("truth.exr");
        std::fs::write(&path, b"truth").unwrap();
        let evidence = Evidence::default();
        evidence.expect(&path, blake3::hash(b"truth").to_hex().as_str());
        assert_eq!(evidence.read(&path).unwrap(), b"truth");
        std::fs::write(&path, b"other").unwrap();
        assert!(evidence.read(&path).is_err() && evidence.problems().len() == 1);
    }
}
