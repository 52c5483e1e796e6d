//! Lists experiments, their runs and the states of these, read from files alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::config_check;
use super::merged_journal::parse_lines;
use super::night_reader::NightReader;
use super::planned_night::planned_night;
use super::run_index::{FinishedSummary, RunIndex};
use super::run_reader::{Measurements, RunReader};
use crate::experiment::night::run::RunState;
use crate::experiment::{CellRef, EndCause, Night, Outcome, WaveRow};
use crate::store::schema::journal;
use crate::store::schema::plan::PlanFile;
use crate::store::schema::run::{ConfigFile, DONE, DoneFile};
use crate::store::schema::{ReadError, StoredFile};
use crate::store::write::failure;
use crate::store::{StoreError, layout, regular_file};

/// Experiments of an output folder.
#[derive(Clone, Debug, Default)]
pub struct Listing {
    /// Nights, ordered by folder. A finished run has a single row, with its samples per pixel and
    /// render time; runs that started and neither finished nor failed are interrupted.
    pub nights: Vec<Night>,
    /// Why other folders with a plan are not listed.
    pub refused: Vec<ReadError>,
}

/// Lists the experiments below `out`. A missing `out` has none. Finished runs are read through the
/// index, which is updated.
pub fn list_experiments(out: &Path) -> Listing {
    let mut index = RunIndex::open(out);
    let mut listing = Listing::default();
    for night in NightReader::all(out) {
        match night {
            Ok(files) => listing.nights.push(listed_night(&files, &mut index)),
            Err(error) => listing.refused.push(error),
        }
    }
    index.save();
    listing
}

fn listed_night(files: &NightReader, index: &mut RunIndex) -> Night {
    let mut night = planned_night(files);
    let mut states = StateReader {
        files,
        index,
        finished_here: BTreeMap::new(),
    };
    for (i, run) in night.runs.iter_mut().enumerate() {
        let run = Arc::make_mut(run);
        let (state, rows) = states.state(CellRef::Cell(i), &run.planned.id);
        (run.state, run.rows) = (state, Arc::new(rows));
    }
    for (i, reference) in night.references.iter_mut().enumerate() {
        let reference = Arc::make_mut(reference);
        let (state, rows) = states.state(CellRef::Reference(i), &reference.planned.id);
        (reference.state, reference.rows) = (state, Arc::new(rows));
    }
    night
}

/// State while the runs of one experiment are listed.
struct StateReader<'a> {
    files: &'a NightReader,
    index: &'a mut RunIndex,
    /// Folders of the finished runs that were listed before, by run id.
    finished_here: BTreeMap<String, PathBuf>,
}

impl StateReader<'_> {
    /// Determines the state of a run, and what is known of its measurements.
    fn state(&mut self, cell: CellRef, run: &str) -> (RunState, Vec<WaveRow>) {
        let folder = self.files.run_folder(cell);
        let marker = NightReader::done_name(cell);
        let ended = |outcome, rows| (RunState::Ended(outcome), rows);
        let damaged = |error: ReadError| (RunState::Damaged(error.to_string()), Vec::new());
        let elsewhere = |other: &PathBuf, finished: FinishedSummary| {
            ended(Outcome::Cached(other.clone()), finished.rows())
        };
        match self.index.finished(&folder, marker) {
            Ok(Some(finished)) => {
                self.finished_here.entry(run.to_owned()).or_insert(folder);
                let rows = finished.rows();
                return ended(Outcome::Done(EndCause::other(finished.reason)), rows);
            }
            Ok(None) => {}
            Err(error) => return damaged(error),
        }
        if let Some(other) = self.finished_here.get(run) {
            let finished = self.index.finished(other, marker);
            finished.map_or_else(damaged, |found| elsewhere(other, found.unwrap_or_default()))
        } else if let Some(other) = self.files.elsewhere().get(run) {
            let finished = self.index.finished(other, DONE);
            finished.map_or_else(damaged, |found| elsewhere(other, found.unwrap_or_default()))
        } else if let Some(failure) = failure::read(&folder) {
            ended(Outcome::Failed(failure.reason), Vec::new())
        } else if folder.exists() {
            ended(Outcome::Interrupted, Vec::new())
        } else {
            (RunState::Pending, Vec::new())
        }
    }
}

/// Folder of the experiment that was run last, which `latest` points at.
pub fn latest_experiment(out: &Path) -> Option<PathBuf> {
    let link = out.join("latest");
    let target = match fs::read_link(&link) {
        Ok(target) => target,
        // On systems without links, it is a text file with the name.
        Err(_) => PathBuf::from(regular_file::read_to_string(&link).ok()?.trim()),
    };
    let folder = out.join(target);
    folder.join(PlanFile::NAME).is_file().then_some(folder)
}

/// Folder of the run that the latest experiment's journal names last.
fn latest_run(out: &Path) -> Option<PathBuf> {
    let night = NightReader::at(latest_experiment(out)?).ok()?;
    let journal = regular_file::read_to_string(&night.folder().join(journal::FILE)).ok()?;
    let cells = night.cells_by_run();
    let lines: Vec<_> = parse_lines(&journal).collect();
    let named = lines.iter().rev().filter_map(|line| line.event.run());
    let folders = named.filter_map(|run| {
        let cell = cells.get(run)?.iter();
        let mut cell = cell.filter(|cell| matches!(cell, CellRef::Cell(_)));
        Some(night.run_folder(*cell.next()?))
    });
    let mut folders = folders.filter(|run| run.join(ConfigFile::NAME).is_file());
    folders.next()
}

/// Content of a run's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct RunRecord {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Place of the run in its plan, and its settings.
    pub config: ConfigFile,
    /// End of the run, if it is finished and every file matches its checksum.
    pub done: Option<DoneFile>,
    /// Measurements of the run; none if a file of it does not match its checksum.
    pub measurements: Measurements,
    /// Descriptions of what does not agree: a file with its checksum, or the configuration with the
    /// id of the run.
    pub problems: Vec<String>,
    /// Names and sizes in bytes of the files, ordered by name.
    pub files: Vec<(String, u64)>,
}

/// Reads a run, selected by its folder, by the first digits of its id among all runs and references
/// below `out`, or as `latest`: the cell that started or ended last in the latest experiment.
///
/// # Errors
/// When no run or more than one matches, or a file of it cannot be read.
pub fn read_run(out: &Path, what: &str) -> Result<RunRecord, StoreError> {
    let given = Path::new(what);
    if given.join(ConfigFile::NAME).is_file() {
        return read_record(given);
    }
    let missing = |hint: &str| StoreError::NoSuchRun {
        what: what.to_owned(),
        out: out.to_owned(),
        hint: format!(" ({hint})"),
    };
    if given.join(PlanFile::NAME).is_file() {
        return Err(missing(
            "this is an experiment's folder; `lumbre ls --runs` lists its runs",
        ));
    }
    if what == "latest" {
        let run = latest_run(out).ok_or_else(|| missing("nothing has been rendered there yet"))?;
        return read_record(&run);
    }
    if what.is_empty() || !what.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(missing(
            "give a run's folder, the first digits of its id, `latest`, or words of its path; \
             `lumbre ls --runs` lists all runs",
        ));
    }
    let prefix = what.to_ascii_lowercase();
    let named = |run: &PathBuf| {
        run.file_name()
            .and_then(|n| n.to_str())
            .is_some_and(|n| n.starts_with(&prefix))
    };
    let shelves = layout::folders_in(&out.join("refs"));
    let experiments = layout::folders_in(out)
        .into_iter()
        .map(|folder| folder.join("runs"));
    let found: Vec<PathBuf> = experiments
        .chain(shelves)
        .flat_map(|folder| layout::runs_below(&folder))
        .filter(named)
        .collect();
    match found.as_slice() {
        [] => Err(missing("`lumbre ls --runs` lists all runs")),
        [one] => read_record(one),
        several => Err(StoreError::Ambiguous {
            what: what.to_owned(),
            candidates: several
                .iter()
                .take(8)
                .map(|p| p.display().to_string())
                .collect(),
        }),
    }
}

fn read_record(folder: &Path) -> Result<RunRecord, StoreError> {
    let run = RunReader::new(folder.to_owned());
    let config = run.config()?;
    let mut problems: Vec<String> = config_check::check(folder, &config)
        .err()
        .into_iter()
        .collect();
    let verified = run.verified(&config.run);
    let measured = verified.and_then(|done| Ok((run.measurements(done.as_ref())?, done)));
    let (measurements, done) = measured.unwrap_or_else(|problem| {
        problems.push(problem);
        Default::default()
    });
    Ok(RunRecord {
        config,
        files: run.files()?,
        folder: folder.to_owned(),
        done,
        measurements,
        problems,
    })
}
