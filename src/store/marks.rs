//! `finished/`: an empty file for every run that workers have settled, named by its id. One listing tells a worker what
//! thousands of looks into run folders would; it is a hint between workers, and never the truth about a run.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// The folder inside an experiment's.
const FOLDER: &str = "finished";
/// How the marks of runs that failed end.
const FAILED: &str = ".failed";
/// How long a listing is believed.
const FRESH: Duration = Duration::from_secs(5);

/// How a run was settled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Mark {
    Done,
    Failed,
}

/// The marks of one experiment.
#[derive(Debug)]
pub(super) struct Marks {
    folder: PathBuf,
    known: RefCell<(BTreeSet<String>, Option<Instant>)>,
}

impl Marks {
    pub(super) fn new(experiment: &Path) -> Marks {
        Marks { folder: experiment.join(FOLDER), known: RefCell::default() }
    }

    /// How a run was settled, as far as was known a moment ago.
    pub(super) fn find(&self, run: &str) -> Option<Mark> {
        let mut known = self.known.borrow_mut();
        if let Some(mark) = look(&known.0, run) {
            return Some(mark);
        }
        if known.1.is_some_and(|listed| listed.elapsed() < FRESH) {
            return None;
        }
        let names = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        *known = (names.map(|e| e.file_name().to_string_lossy().into_owned()).collect(), Some(Instant::now()));
        look(&known.0, run)
    }

    /// Marks a run.
    pub(super) fn put(&self, run: &str, mark: Mark) {
        let name = match mark {
            Mark::Done => run.to_owned(),
            Mark::Failed => format!("{run}{FAILED}"),
        };
        let made = fs::create_dir_all(&self.folder).and_then(|()| File::create(self.folder.join(&name)));
        if let Err(e) = made {
            tracing::debug!("{} is not marked: {e}", run);
        }
        self.known.borrow_mut().0.insert(name);
    }

    /// Takes the marks of a run away: it is not what they say.
    pub(super) fn forget(&self, run: &str) {
        for name in [run.to_owned(), format!("{run}{FAILED}")] {
            // Mostly there is none.
            let _ = fs::remove_file(self.folder.join(&name));
            self.known.borrow_mut().0.remove(&name);
        }
    }

    /// Takes the marks of all runs that failed away, so that they are tried again.
    pub(super) fn forget_failures(&self) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().ends_with(FAILED) {
                // One that stays keeps a run from being tried again, which the summary says.
                let _ = fs::remove_file(entry.path());
            }
        }
        *self.known.borrow_mut() = Default::default();
    }
}

fn look(known: &BTreeSet<String>, run: &str) -> Option<Mark> {
    if known.contains(run) {
        return Some(Mark::Done);
    }
    known.contains(&format!("{run}{FAILED}")).then_some(Mark::Failed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_one_marks_the_others_find() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (Marks::new(dir.path()), Marks::new(dir.path()));
        assert_eq!(a.find("ab"), None);
        a.put("ab", Mark::Done);
        a.put("cd", Mark::Failed);
        assert_eq!((a.find("ab"), a.find("cd"), a.find("ef")), (Some(Mark::Done), Some(Mark::Failed), None));
        assert_eq!((b.find("ab"), b.find("cd")), (Some(Mark::Done), Some(Mark::Failed)));
        b.forget_failures();
        assert_eq!((b.find("ab"), b.find("cd")), (Some(Mark::Done), None));
        b.forget("ab");
        assert_eq!((b.find("ab"), Marks::new(dir.path()).find("ab")), (None, None));
    }
}
