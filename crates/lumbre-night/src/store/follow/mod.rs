//! Follows a night from outside, by its files alone: journals, measurements and images of running
//! runs, and the heartbeats of workers. [`Follower::poll`] returns what changed, as the events that
//! the process that renders emits; [`Follower::night`] is the night to which they lead.
//!
//! Nothing is locked and nothing is written. A folder can be followed while it grows, after the
//! night's end, from another process, or on another machine that has a copy. Whether a run is done
//! depends on its last file, as everywhere; the journal adds the time and the numbers.

mod journal_events;
mod run;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use super::StoreError;
use super::read::archive::Decode;
use super::read::merged_journal::{MergedJournal, WorkerLine};
use super::read::night_reader::NightReader;
use super::read::planned_night::planned_night;
use super::read::run_index::RunIndex;
use super::read::run_reader::{RunReader, describe};
use super::schema::journal::{JournalEvent, OutcomeKind, in_order};
use super::worker::registry::WorkerStatus;
use super::worker::registry::list_workers;
use crate::experiment::{CellRef, Event, Night, Outcome, WaveRow};
use lumbre_light::film::Image;
use lumbre_render::OpenStats;
use run::FollowedRun;
pub use run::TimesFile;

/// Interval at which the workers' heartbeats are read.
const WORKER_POLL: Duration = Duration::from_secs(2);

/// An event with the time at which it happened.
#[derive(Clone, Debug)]
pub struct TimedEvent {
    /// Time in seconds since 1970.
    pub at_s: f64,
    /// Event that happened.
    pub event: Event,
}

/// Changes since the last poll.
#[derive(Debug, Default)]
pub struct Update {
    /// Events, oldest first.
    pub events: Vec<TimedEvent>,
    /// Time-resolved films that were stored.
    pub times: Vec<TimesFile>,
    /// State of all workers of the night, every two seconds.
    pub workers: Option<Vec<WorkerStatus>>,
}

impl Update {
    fn is_empty(&self) -> bool {
        self.events.is_empty() && self.times.is_empty() && self.workers.is_none()
    }
}

/// Follows the night of one folder.
#[derive(Debug)]
pub struct Follower {
    files: NightReader,
    decode: Decode,
    /// The night, to which the reported events have been applied.
    night: Night,
    /// Cells and references by the ids of their runs.
    ids: BTreeMap<String, Vec<CellRef>>,
    journals: MergedJournal,
    /// Finished runs, whose last files match their checksums.
    finished: RunIndex,
    /// Descriptions of last files that do not match their checksums.
    problems: BTreeSet<String>,
    /// Journal lines of runs and shards that started and have not ended, by run id or shard key.
    active: BTreeMap<String, WorkerLine>,
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
    /// When the folder has no readable plan, or another version of the program wrote it.
    pub fn open(folder: &Path, decode: Decode) -> Result<Follower, StoreError> {
        let files = NightReader::open(folder)?;
        let night = planned_night(&files);
        Ok(Follower {
            journals: MergedJournal::new(files.folder()),
            night,
            ids: files.cells_by_run(),
            finished: RunIndex::open(files.out()),
            problems: BTreeSet::new(),
            files,
            decode,
            active: BTreeMap::new(),
            done: BTreeSet::new(),
            night_active: false,
            workers_polled: None,
            first_poll: true,
            runs: Vec::new(),
            recent_reference: None,
        })
    }

    /// The night, after everything that was reported.
    pub fn night(&self) -> &Night {
        &self.night
    }

    /// Folder of the experiment.
    pub fn folder(&self) -> &Path {
        self.files.folder()
    }

    /// Descriptions of the runs that are left out because their last file does not match its
    /// checksum.
    pub fn problems(&self) -> &BTreeSet<String> {
        &self.problems
    }

    /// Whether a run or reference is finished in its own folder, with a last file that matches its
    /// checksum.
    fn is_finished(&mut self, cell: CellRef) -> bool {
        let folder = self.files.run_folder(cell);
        let marker = NightReader::done_name(cell);
        match self.finished.finished(&folder, marker) {
            Ok(None) => self.files.is_done(cell),
            Ok(Some(_)) => true,
            Err(error) => {
                self.problems.insert(error.to_string());
                false
            }
        }
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

    /// Returns the changes since the last poll. The first poll returns everything that exists.
    pub fn poll(&mut self) -> Option<Update> {
        let mut changes = Update::default();
        let update = self.journals.poll();
        let first_poll = std::mem::take(&mut self.first_poll) || update.restarted;
        let lines = update.lines;
        // Rows and images are read only for runs that have not ended, and for the newest run. Those
        // of a whole night would be read and thrown away.
        let live = journal_events::live_lines(&lines);
        if first_poll {
            self.report_finished_runs(&lines, &mut changes);
        }
        for (i, line) in lines.iter().enumerate() {
            self.apply_line(line, live.contains(&i), first_poll, &mut changes);
        }
        self.poll_workers(&mut changes);
        if self.journals.has_workers() && self.runs.iter().all(|run| !run.running) {
            let first = self.active.values().next().map(|line| line.worker.clone());
            if let Some(worker) = first {
                self.show_worker(&worker, &mut changes);
            }
        }
        self.poll_runs(&mut changes);
        (!changes.is_empty()).then_some(changes)
    }

    /// Reports an event, and applies it to the night.
    fn report(&mut self, at_s: f64, event: Event, changes: &mut Update) {
        self.night.apply(&event);
        changes.events.push(TimedEvent { at_s, event });
    }

    /// Polls the workers from time to time. Runs of lost workers are reported as interrupted.
    fn poll_workers(&mut self, changes: &mut Update) {
        let recent = self
            .workers_polled
            .is_some_and(|at| at.elapsed() < WORKER_POLL);
        if !self.journals.has_workers() || recent {
            return;
        }
        self.workers_polled = Some(Instant::now());
        let workers = list_workers(self.files.folder());
        let at_s = now_s();
        let lost: BTreeSet<&str> = workers
            .iter()
            .filter(|w| w.is_lost())
            .map(|w| w.name.as_str())
            .collect();
        let mut abandoned = Vec::new();
        self.active.retain(|key, line| {
            let gone = lost.contains(line.worker.as_str());
            if gone {
                let run = line.event.run().unwrap_or_default();
                abandoned.push((key.clone(), run.to_owned()));
            }
            !gone
        });
        for (key, run) in abandoned {
            self.mark_stopped(&run);
            // Shards have keys that are no run ids, and their reference has not ended.
            for cell in self.ids.get(&key).cloned().unwrap_or_default() {
                if !self.files.is_done(cell) {
                    let event = Event::ended(cell, Outcome::Interrupted, Vec::new());
                    self.report(at_s, event, changes);
                }
            }
        }
        changes.workers = Some(workers);
    }

    /// Shows all runs that a worker renders, which are several if it interleaves them.
    fn show_worker(&mut self, worker: &str, changes: &mut Update) {
        let is_shown = |line: &WorkerLine| {
            let cell = line
                .event
                .run()
                .and_then(|id| self.ids.get(id))
                .and_then(|cells| cells.first());
            self.runs
                .iter()
                .any(|run| run.running && Some(&run.cell) == cell)
        };
        let to_show = |line: &&WorkerLine| line.worker == worker && !is_shown(line);
        let lines: Vec<WorkerLine> = self.active.values().filter(to_show).cloned().collect();
        for line in &lines {
            self.show(line, changes);
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
    fn show(&mut self, line: &WorkerLine, changes: &mut Update) {
        let at_s = journal_events::date_s(line);
        let id = line.event.run().unwrap_or_default();
        if let Some(cell) = self.ids.get(id).and_then(|cells| cells.first()).copied() {
            let (event, run) = self.start(cell, line);
            self.runs
                .retain(|other| other.running && other.cell != cell);
            self.runs.push(run);
            self.report(at_s, event, changes);
        }
    }

    /// Reports runs that are done without a line in the journal: the journal was lost, or they lie
    /// in a sibling folder.
    fn report_finished_runs(&mut self, lines: &[WorkerLine], changes: &mut Update) {
        let done = |line: &WorkerLine| match &line.event {
            JournalEvent::CellFinished(end) if end.outcome == OutcomeKind::Done => {
                Some(end.run.clone())
            }
            _ => None,
        };
        let reported: BTreeSet<String> = lines.iter().filter_map(done).collect();
        let unreported = self.ids.iter().filter(|(id, _)| !reported.contains(*id));
        let unreported: Vec<CellRef> = unreported.flat_map(|(_, cells)| cells).copied().collect();
        for cell in unreported {
            let Some(folder) = self.files.finished_folder(cell) else {
                continue;
            };
            let last = match self.stored_last_row(&folder) {
                Ok(last) => last,
                Err(problem) => {
                    self.problems.insert(problem);
                    continue;
                }
            };
            let rows = last.into_iter().collect();
            let event = Event::ended(cell, Outcome::Cached(folder), rows);
            self.report(0.0, event, changes);
        }
    }

    /// Last measurement of a finished run.
    ///
    /// # Errors
    /// When its last file does not match its checksum.
    fn stored_last_row(&self, folder: &Path) -> Result<Option<WaveRow>, String> {
        let done = RunReader::new(folder.to_owned()).done();
        let done = done.map_err(|e| format!("{}: {}", folder.display(), describe(&e)))?;
        let Some(results) = done.as_ref().and_then(|done| done.rendered()) else {
            return Ok(None);
        };
        let columns = self.night.plan.metrics.iter().map(|m| m.column.as_str());
        Ok(Some(WaveRow {
            wave: results.waves,
            samples: results.samples,
            render_s: results.render_s,
            lost_s: results.lost_s.unwrap_or(0.0),
            wall_s: results.wall_s,
            measure_s: results.measure_s,
            paths: results.paths,
            rays: results.rays,
            invalid: results.invalid,
            first_invalid: results.first_invalid,
            metrics: in_order(&results.metrics, columns),
        }))
    }

    /// Begins to follow a run, given the journal line of its start.
    fn start(&mut self, cell: CellRef, line: &WorkerLine) -> (Event, FollowedRun) {
        let run = self.files.run(cell);
        let config = run.config().ok();
        let settings = config.and_then(|config| config.settings().cloned().map(Arc::new));
        let open = match &line.event {
            JournalEvent::CellStarted(start) => start.stats(),
            JournalEvent::ShardStarted(start) => start.stats(),
            _ => OpenStats::default(),
        };
        let reference = match cell {
            CellRef::Cell(i) => self.night.runs.get(i).and_then(|run| run.reference),
            CellRef::Reference(_) => None,
        };
        let reference = reference.and_then(|i| self.reference_image(i));
        let axis = settings
            .as_ref()
            .and_then(|settings| settings.timing.as_ref())
            .map(|timing| timing.axis);
        let followed = FollowedRun::new(cell, run.folder().to_owned(), line.worker.clone(), axis);
        let event = Event::CellStarted {
            cell,
            open,
            reference,
            resumed: None,
            settings,
        };
        (event, followed)
    }

    fn reference_image(&mut self, i: usize) -> Option<Arc<Image>> {
        if let Some((recent, image)) = &self.recent_reference
            && *recent == i
        {
            return Some(Arc::clone(image));
        }
        let file = self.files.reference_picture(i)?;
        let image = Arc::new(run::read_image(&file, self.decode)?);
        self.recent_reference = Some((i, Arc::clone(&image)));
        Some(image)
    }

    /// Reports what is new of the shown runs.
    fn poll_runs(&mut self, changes: &mut Update) {
        let at_s = now_s();
        let mut runs = std::mem::take(&mut self.runs);
        for run in &mut runs {
            let (events, times) = run.poll(&self.night.plan.metrics, self.decode);
            for event in events {
                self.report(at_s, event, changes);
            }
            changes.times.extend(times);
        }
        self.runs = runs;
    }
}

/// Current time in seconds since 1970.
fn now_s() -> f64 {
    SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0.0, |d| d.as_secs_f64())
}
