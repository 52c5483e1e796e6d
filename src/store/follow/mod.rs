//! Follows a night from outside, by its files alone: journals, measurements and images of running
//! runs, and the heartbeats of workers. [`Follower::poll`] returns what changed as [`TimedEvent`]s.
//!
//! Nothing is locked and nothing is written. A folder can be followed while it grows, after the
//! night's end, from another process, or on another machine that has a copy. Whether a run is done
//! depends on its last file, as everywhere; the journal adds the time and the numbers.

pub(crate) mod event;
mod journal_events;
mod run;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value as Json;

use super::read::archive::{Decode, open_stats, read_json};
use super::read::merged_journal::{self, MergedJournal};
use super::read::{night_index, outline};
use super::worker::registry::list_workers;
use super::{StoreError, layout};
use crate::experiment::{CellRef, Outcome, PlanOutline, RunId};
use event::{FollowEvent, TimedEvent};
use lumbre_light::film::Image;
use run::FollowedRun;

/// Interval at which the workers' heartbeats are read.
const WORKER_POLL: Duration = Duration::from_secs(2);

/// Follows the night of one folder.
#[derive(Debug)]
pub struct Follower {
    folder: PathBuf,
    out: PathBuf,
    decode: Decode,
    outline: Arc<PlanOutline>,
    /// Cells and references by the ids of their runs.
    ids: BTreeMap<String, Vec<CellRef>>,
    /// Run folder of every cell, and the index of the reference that it is measured against.
    cells: Vec<(PathBuf, Option<usize>)>,
    /// Folder of every reference, or the image file that it is.
    references: Vec<PathBuf>,
    journals: MergedJournal,
    /// Journal lines of runs and shards that started and have not ended, by run id or shard key.
    active: BTreeMap<String, Json>,
    /// Ids of runs that a journal line reported as done.
    done: BTreeSet<String>,
    /// Whether a night has started and not ended.
    night_active: bool,
    /// Time at which the workers were last polled.
    workers_polled: Option<Instant>,
    /// Whether everything that exists has to be reported.
    first_poll: bool,
    /// Runs that are shown, oldest first: the interleaved runs of one worker, and the last run that
    /// ended.
    runs: Vec<FollowedRun>,
    /// The reference image that was read last.
    recent_reference: Option<(usize, Arc<Image>)>,
}

impl Follower {
    /// Follows the night in an experiment's folder. References are read from the folder beside it.
    ///
    /// # Errors
    /// When the folder has no readable plan.
    pub fn open(folder: &Path, decode: Decode) -> Result<Follower, StoreError> {
        let file = folder.join("plan.json");
        let plan = read_json(&file).ok_or_else(|| StoreError::Io {
            action: "read",
            path: file.clone(),
            reason: "the plan is missing or damaged (expected an experiment's folder; `lumbre ls` \
                     lists them)"
                .into(),
            full: false,
        })?;
        let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        let out = folder.parent().map(Path::to_owned).unwrap_or_default();
        let mut ids: BTreeMap<String, Vec<CellRef>> = BTreeMap::new();
        let list = |key: &str| plan[key].as_array().map_or(&[][..], Vec::as_slice);
        let mut add_id = |json: &Json, cell| {
            let id = json["run"].as_str().unwrap_or_default().to_owned();
            ids.entry(id).or_default().push(cell);
        };
        let mut cells = Vec::new();
        for (i, cell) in list("cells").iter().enumerate() {
            add_id(cell, CellRef::Cell(i));
            let run_folder = folder
                .join("runs")
                .join(cell["folder"].as_str().unwrap_or_default());
            let reference = cell["reference"]
                .as_u64()
                .and_then(|n| usize::try_from(n).ok());
            cells.push((run_folder, reference));
        }
        let mut references = Vec::new();
        for (i, reference) in list("references").iter().enumerate() {
            add_id(reference, CellRef::Reference(i));
            references.push(reference_path(&out, reference));
        }
        Ok(Follower {
            journals: MergedJournal::new(&folder),
            outline: Arc::new(outline::outline(&plan)),
            folder,
            out,
            decode,
            ids,
            cells,
            references,
            active: BTreeMap::new(),
            done: BTreeSet::new(),
            night_active: false,
            workers_polled: None,
            first_poll: true,
            runs: Vec::new(),
            recent_reference: None,
        })
    }

    /// Outline of the plan.
    pub fn outline(&self) -> &Arc<PlanOutline> {
        &self.outline
    }

    /// Folder of the experiment.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Time at which a journal or the measurements of a shown run were last written to.
    pub fn last_modified(&self) -> Option<SystemTime> {
        let modified = |path: &Path| fs::metadata(path).and_then(|m| m.modified()).ok();
        let runs = self
            .runs
            .iter()
            .filter_map(|run| modified(run.metrics_path()));
        self.journals.last_modified().max(runs.max())
    }

    /// Returns the events since the last poll, oldest first. The first poll returns everything that
    /// exists.
    pub fn poll(&mut self) -> Vec<TimedEvent> {
        let mut events = Vec::new();
        let update = self.journals.poll();
        let first_poll = std::mem::take(&mut self.first_poll) || update.restarted;
        let lines = update.lines;
        // Rows and images are read only for runs that have not ended, and for the newest run. Those
        // of a whole night would be read and thrown away.
        let live = journal_events::live_lines(&lines);
        if first_poll {
            self.report_finished_runs(&lines, &mut events);
        }
        for (i, line) in lines.iter().enumerate() {
            self.apply_line(line, live.contains(&i), first_poll, &mut events);
        }
        self.poll_workers(&mut events);
        if self.journals.has_workers() && self.runs.iter().all(|run| !run.running) {
            let first = self
                .active
                .values()
                .next()
                .map(|line| merged_journal::worker(line).to_owned());
            if let Some(worker) = first {
                self.show_worker(&worker, &mut events);
            }
        }
        self.poll_runs(&mut events);
        events
    }

    /// Polls the workers from time to time. Runs of lost workers are reported as interrupted.
    fn poll_workers(&mut self, events: &mut Vec<TimedEvent>) {
        let recent = self
            .workers_polled
            .is_some_and(|at| at.elapsed() < WORKER_POLL);
        if !self.journals.has_workers() || recent {
            return;
        }
        self.workers_polled = Some(Instant::now());
        let workers = list_workers(&self.folder);
        let at_s = now_s();
        let lost: BTreeSet<&str> = workers
            .iter()
            .filter(|w| w.is_lost())
            .map(|w| w.name.as_str())
            .collect();
        let mut abandoned = Vec::new();
        self.active.retain(|key, line| {
            let gone = lost.contains(merged_journal::worker(line));
            if gone {
                let run = line["run"].as_str().unwrap_or_default();
                abandoned.push((key.clone(), run.to_owned()));
            }
            !gone
        });
        for (key, run) in abandoned {
            self.mark_stopped(&run);
            // Shards have keys that are no run ids, and their reference has not ended.
            for cell in self.ids.get(&key).into_iter().flatten() {
                if !self.is_done(*cell) {
                    let event = FollowEvent::RunEnded {
                        cell: *cell,
                        outcome: Outcome::Interrupted,
                        last: None,
                    };
                    events.push(TimedEvent { at_s, event });
                }
            }
        }
        let event = FollowEvent::Workers(workers);
        events.push(TimedEvent { at_s, event });
    }

    /// Shows all runs that a worker renders, which are several if it interleaves them.
    fn show_worker(&mut self, worker: &str, events: &mut Vec<TimedEvent>) {
        let is_shown = |line: &Json| {
            let cell = line["run"]
                .as_str()
                .and_then(|id| self.ids.get(id))
                .and_then(|cells| cells.first());
            self.runs
                .iter()
                .any(|run| run.running && Some(&run.cell) == cell)
        };
        let to_show = |line: &&Json| merged_journal::worker(line) == worker && !is_shown(line);
        let lines: Vec<Json> = self.active.values().filter(to_show).cloned().collect();
        for line in &lines {
            self.show(line, events);
        }
    }

    /// Marks the shown runs with this id as no longer rendering.
    fn mark_stopped(&mut self, id: &str) {
        let cells = self.ids.get(id).map_or(&[][..], Vec::as_slice);
        self.runs
            .iter_mut()
            .filter(|run| cells.contains(&run.cell))
            .for_each(|run| run.running = false);
    }

    /// Shows a run that started, beside those that still render.
    fn show(&mut self, line: &Json, events: &mut Vec<TimedEvent>) {
        let at_s = journal_events::date_s(line);
        let id = line["run"].as_str().unwrap_or_default();
        if let Some(cell) = self.ids.get(id).and_then(|cells| cells.first()).copied() {
            let (event, run) = self.start(cell, line);
            self.runs
                .retain(|other| other.running && other.cell != cell);
            self.runs.push(run);
            events.push(TimedEvent { at_s, event });
        }
    }

    /// Reports runs that are done without a line in the journal: the journal was lost, or they lie
    /// in a sibling folder.
    fn report_finished_runs(&self, lines: &[Json], events: &mut Vec<TimedEvent>) {
        let reported: BTreeSet<&str> = lines
            .iter()
            .filter(|line| line["event"] == "cell_finished" && line["outcome"] == "done")
            .filter_map(|line| line["run"].as_str())
            .collect();
        let mut siblings = None;
        let unreported = self
            .ids
            .iter()
            .filter(|(id, _)| !reported.contains(id.as_str()));
        for (id, cells) in unreported {
            for cell in cells {
                let found = match cell {
                    _ if self.is_done(*cell) => Some(self.path_of(*cell)),
                    CellRef::Cell(_) => siblings
                        .get_or_insert_with(|| {
                            night_index::finished_in_siblings(
                                &self.out,
                                &self.outline.name,
                                &self.folder,
                            )
                        })
                        .get(id)
                        .cloned(),
                    CellRef::Reference(_) => None,
                };
                let Some(folder) = found else { continue };
                let last =
                    read_json(&folder.join("done.json")).and_then(|done| self.last_row(&done));
                events.push(TimedEvent {
                    at_s: 0.0,
                    event: FollowEvent::RunEnded {
                        cell: *cell,
                        outcome: Outcome::Cached(folder),
                        last,
                    },
                });
            }
        }
    }

    /// Run folder of a cell, or folder or image file of a reference.
    fn path_of(&self, cell: CellRef) -> PathBuf {
        match cell {
            CellRef::Cell(i) => self
                .cells
                .get(i)
                .map(|(folder, _)| folder.clone())
                .unwrap_or_default(),
            CellRef::Reference(i) => self.references.get(i).cloned().unwrap_or_default(),
        }
    }

    fn is_done(&self, cell: CellRef) -> bool {
        let path = self.path_of(cell);
        match cell {
            CellRef::Cell(_) => path.join("done.json").is_file(),
            CellRef::Reference(_) => path.join("ref.json").is_file() || path.is_file(),
        }
    }

    /// Begins to follow a run, given the journal line of its start.
    fn start(&mut self, cell: CellRef, line: &Json) -> (FollowEvent, FollowedRun) {
        let folder = self.path_of(cell);
        let config = read_json(&folder.join("config.json"))
            .and_then(|json| outline::config(&json["render"]));
        let open = open_stats(line);
        let reference = match cell {
            CellRef::Cell(i) => self.cells.get(i).and_then(|(_, reference)| *reference),
            CellRef::Reference(_) => None,
        };
        let reference = reference.and_then(|i| self.reference_image(i));
        let axis = config
            .as_ref()
            .and_then(|config| config.timing.as_ref())
            .map(|timing| timing.axis);
        let run = FollowedRun::new(cell, folder, merged_journal::worker(line).to_owned(), axis);
        let event = FollowEvent::RunStarted {
            cell,
            config: config.map(Box::new),
            open,
            reference,
        };
        (event, run)
    }

    fn reference_image(&mut self, i: usize) -> Option<Arc<Image>> {
        if let Some((recent, image)) = &self.recent_reference
            && *recent == i
        {
            return Some(Arc::clone(image));
        }
        let path = self.references.get(i)?;
        let file = if path.is_file() {
            path.clone()
        } else {
            path.join("ref.exr")
        };
        let image = Arc::new(run::read_image(&file, self.decode)?);
        self.recent_reference = Some((i, Arc::clone(&image)));
        Some(image)
    }

    /// Reports what is new of the shown runs.
    fn poll_runs(&mut self, events: &mut Vec<TimedEvent>) {
        let at_s = now_s();
        for run in &mut self.runs {
            run.poll(&self.outline, self.decode, &mut |event| {
                events.push(TimedEvent { at_s, event });
            });
        }
    }
}

/// Image file of a reference, its copy if the file is missing, or the folder of a rendered
/// reference.
fn reference_path(out: &Path, reference: &Json) -> PathBuf {
    let id = reference["run"].as_str().unwrap_or_default().to_owned();
    let folder = layout::reference_folder(out, &RunId(id));
    match reference["source"].as_str().map(PathBuf::from) {
        Some(file) if file.is_file() => file,
        Some(file) => folder.join(layout::imported_file_name(&file)),
        None => folder,
    }
}

/// Current time in seconds since 1970.
fn now_s() -> f64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0.0, |d| d.as_secs_f64())
}
