//! Completion markers: `finished/<run id>` is an empty file for every run that workers have
//! finished or failed. Listing this folder replaces reading thousands of run folders. Markers are
//! hints between workers; the run folder decides.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// Name of the folder inside an experiment's folder.
const FOLDER: &str = "finished";
/// Suffix of the markers of failed runs.
const FAILED: &str = ".failed";
/// Time for which a listing is reused.
const LISTING_VALID: Duration = Duration::from_secs(5);

/// Result that a marker records.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum CompletionMarker {
    Done,
    Failed,
}

/// Completion markers of one experiment.
#[derive(Debug)]
pub(crate) struct CompletionMarkers {
    folder: PathBuf,
    /// File names of the known markers, and when they were listed.
    known: RefCell<(BTreeSet<String>, Option<Instant>)>,
}

impl CompletionMarkers {
    pub(crate) fn new(experiment: &Path) -> CompletionMarkers {
        CompletionMarkers {
            folder: experiment.join(FOLDER),
            known: RefCell::default(),
        }
    }

    /// Result of a run, at most five seconds old.
    pub(crate) fn find(&self, run: &str) -> Option<CompletionMarker> {
        let mut known = self.known.borrow_mut();
        if let Some(marker) = lookup(&known.0, run) {
            return Some(marker);
        }
        if known
            .1
            .is_some_and(|listed| listed.elapsed() < LISTING_VALID)
        {
            return None;
        }
        let names = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        *known = (
            names
                .map(|e| e.file_name().to_string_lossy().into_owned())
                .collect(),
            Some(Instant::now()),
        );
        lookup(&known.0, run)
    }

    /// Writes the marker of a run. Failures are only logged, since markers are hints.
    pub(crate) fn write(&self, run: &str, marker: CompletionMarker) {
        let name = match marker {
            CompletionMarker::Done => run.to_owned(),
            CompletionMarker::Failed => format!("{run}{FAILED}"),
        };
        let made =
            fs::create_dir_all(&self.folder).and_then(|()| File::create(self.folder.join(&name)));
        if let Err(e) = made {
            tracing::debug!("cannot write the completion marker of {run}: {e}");
        }
        self.known.borrow_mut().0.insert(name);
    }

    /// Removes the markers of a run that turned out to be wrong.
    pub(crate) fn remove(&self, run: &str) {
        for name in [run.to_owned(), format!("{run}{FAILED}")] {
            // Usually there is no such file.
            let _ = fs::remove_file(self.folder.join(&name));
            self.known.borrow_mut().0.remove(&name);
        }
    }

    /// Removes the markers of all failed runs, so that they are retried.
    pub(crate) fn remove_failures(&self) {
        for entry in fs::read_dir(&self.folder).into_iter().flatten().flatten() {
            if entry.file_name().to_string_lossy().ends_with(FAILED) {
                // If a marker cannot be removed, its run is not retried and the summary lists it as
                // failed.
                let _ = fs::remove_file(entry.path());
            }
        }
        *self.known.borrow_mut() = Default::default();
    }
}

fn lookup(known: &BTreeSet<String>, run: &str) -> Option<CompletionMarker> {
    if known.contains(run) {
        return Some(CompletionMarker::Done);
    }
    known
        .contains(&format!("{run}{FAILED}"))
        .then_some(CompletionMarker::Failed)
}

#[cfg(test)]
mod tests {
    use crate::store::worker::completion_markers::*;

    #[test]
    fn markers_of_one_worker_are_found_by_others() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (
            CompletionMarkers::new(dir.path()),
            CompletionMarkers::new(dir.path()),
        );
        assert_eq!(a.find("ab"), None);
        a.write("ab", CompletionMarker::Done);
        a.write("cd", CompletionMarker::Failed);
        assert_eq!(
            (a.find("ab"), a.find("cd"), a.find("ef")),
            (
                Some(CompletionMarker::Done),
                Some(CompletionMarker::Failed),
                None
            )
        );
        assert_eq!(
            (b.find("ab"), b.find("cd")),
            (Some(CompletionMarker::Done), Some(CompletionMarker::Failed))
        );
        b.remove_failures();
        assert_eq!(
            (b.find("ab"), b.find("cd")),
            (Some(CompletionMarker::Done), None)
        );
        b.remove("ab");
        assert_eq!(
            (b.find("ab"), CompletionMarkers::new(dir.path()).find("ab")),
            (None, None)
        );
    }

    #[test]
    fn a_run_that_is_done_after_a_failure_counts_as_done() {
        let dir = tempfile::tempdir().unwrap();
        let markers = CompletionMarkers::new(dir.path());
        markers.write("ab", CompletionMarker::Failed);
        markers.write("ab", CompletionMarker::Done);
        for markers in [markers, CompletionMarkers::new(dir.path())] {
            assert_eq!(markers.find("ab"), Some(CompletionMarker::Done));
        }
    }

    #[test]
    fn new_markers_are_found_when_the_listing_is_old() {
        let dir = tempfile::tempdir().unwrap();
        let [a, b] = [(); 2].map(|()| CompletionMarkers::new(dir.path()));
        assert_eq!(b.find("ab"), None);
        a.write("ab", CompletionMarker::Done);
        assert_eq!(b.find("ab"), None, "the folder is listed every few seconds");
        let age = LISTING_VALID + Duration::from_millis(1);
        if let Some(before) = Instant::now().checked_sub(age) {
            b.known.borrow_mut().1 = Some(before);
            assert_eq!(b.find("ab"), Some(CompletionMarker::Done));
        }
    }
}
