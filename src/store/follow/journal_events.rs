//! Translation of journal lines into events of a follower.

use std::collections::BTreeSet;

use super::Follower;
use super::event::{FollowEvent, TimedEvent};
use super::run::FollowedRun;
use crate::experiment::{CellRef, Outcome, WaveRow};
use crate::store::parse_utc;
use crate::store::read::merged_journal::WorkerLine;
use crate::store::schema::journal::{
    JournalEvent, OutcomeKind, RunEnd, ShardEnd, ShardRecord, WaveRecord,
};
use crate::store::schema::run::BiasCheckFile;

impl Follower {
    /// Updates the state by a line of the journal, and reports its events. `live` is whether the
    /// line starts a run that is worth showing.
    pub(super) fn apply_line(
        &mut self,
        line: &WorkerLine,
        live: bool,
        first_poll: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        let at_s = date_s(line);
        let cells = self.cells_of(line);
        if self.is_outdated(line, &cells) {
            return;
        }
        let mut report = |event| events.push(TimedEvent { at_s, event });
        match &line.event {
            JournalEvent::NightStarted(_) => {
                self.night_active = true;
                self.active.clear();
                report(FollowEvent::NightStarted);
            }
            JournalEvent::WorkerStarted(_) if !self.night_active => {
                self.night_active = true;
                report(FollowEvent::NightStarted);
            }
            JournalEvent::NightFinished {} | JournalEvent::NightClosed {} => {
                self.night_active = false;
                report(FollowEvent::NightFinished);
            }
            JournalEvent::Forecast(left) => report(FollowEvent::Forecast(*left)),
            JournalEvent::BiasCheck(check) => {
                bias_checks(check, &cells).into_iter().for_each(report);
            }
            JournalEvent::CellStarted(_) => self.cell_started(line, &cells, live, events),
            JournalEvent::ShardStarted(start) => {
                let key = shard_key(&start.run, &start.shard);
                self.active.insert(key, line.clone());
                let changes = shard_changes(&start.shard, &cells, false);
                changes
                    .into_iter()
                    .chain(run_active(&cells))
                    .for_each(report);
            }
            JournalEvent::ShardFinished(end) => {
                self.shard_finished(end, &cells)
                    .into_iter()
                    .for_each(report);
            }
            JournalEvent::CellFinished(end) => {
                self.cell_finished(end, at_s, &cells, first_poll, events);
            }
            JournalEvent::Message(message) => report(FollowEvent::Message {
                level: message.level,
                cell: cells.first().copied(),
                text: message.text.clone(),
            }),
            JournalEvent::WorkerStarted(_) | JournalEvent::WorkerFinished {} => {}
        }
    }

    /// Cells and references with the run that a line is about.
    fn cells_of(&self, line: &WorkerLine) -> Vec<CellRef> {
        let cells = line.event.run().and_then(|run| self.ids.get(run));
        cells.cloned().unwrap_or_default()
    }

    /// Shows a run that started, unless another worker's runs are shown. Runs that the shown worker
    /// starts beside its others are interleaved with them.
    fn cell_started(
        &mut self,
        line: &WorkerLine,
        cells: &[CellRef],
        live: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        let id = line.event.run().unwrap_or_default();
        self.active.insert(id.to_owned(), line.clone());
        let worker = &line.worker;
        let other = |run: &FollowedRun| run.running && run.worker != *worker;
        let busy = self.journals.has_workers() && self.runs.iter().any(other);
        if live && !busy {
            self.show(line, events);
            if self.journals.has_workers() {
                self.show_worker(worker, events);
            }
        } else if self.journals.has_workers() {
            let at_s = date_s(line);
            events.extend(run_active(cells).map(|event| TimedEvent { at_s, event }));
        }
    }

    /// Reports the end of a run, after its last measurements.
    fn cell_finished(
        &mut self,
        end: &RunEnd,
        at_s: f64,
        cells: &[CellRef],
        first_poll: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        self.active.remove(&end.run);
        if end.outcome == OutcomeKind::Done {
            self.done.insert(end.run.clone());
            let prefix = shard_prefix(&end.run);
            self.active.retain(|key, _| !key.starts_with(&prefix));
        }
        if let Some(run) = self.runs.iter_mut().find(|run| cells.contains(&run.cell)) {
            run.running = false;
            self.poll_runs(events);
        }
        for cell in cells {
            let outcome = end.outcome(self.night.run_folder(*cell));
            // In the first poll, the folders decide which runs are done; the journal adds numbers.
            let is_done = matches!(outcome, Outcome::Done(_));
            let confirmed = !first_poll || is_done == self.is_finished(*cell);
            if confirmed {
                let event = FollowEvent::CellFinished {
                    cell: *cell,
                    outcome,
                    last: end.last.as_ref().map(|last| self.last_row(last)),
                };
                events.push(TimedEvent { at_s, event });
            }
        }
    }

    /// Events of the end of a shard. Its reference stays active while other shards of it are.
    fn shard_finished(&mut self, end: &ShardEnd, cells: &[CellRef]) -> Vec<FollowEvent> {
        let mut events = shard_changes(&end.shard, cells, end.outcome == OutcomeKind::Done);
        self.active.remove(&shard_key(&end.run, &end.shard));
        self.mark_stopped(&end.run);
        let prefix = shard_prefix(&end.run);
        if self.active.keys().any(|key| key.starts_with(&prefix)) {
            events.extend(run_active(cells));
        }
        events
    }

    /// Whether a line reports work on a run that is done. Lines of several workers are ordered to
    /// the second only, so the start of a shard may follow the end of its reference.
    fn is_outdated(&self, line: &WorkerLine, cells: &[CellRef]) -> bool {
        let work = matches!(
            line.event,
            JournalEvent::CellStarted(_)
                | JournalEvent::ShardStarted(_)
                | JournalEvent::ShardFinished(_)
        );
        work && line.event.run().is_some_and(|id| self.done.contains(id))
            && cells.iter().all(|cell| self.night.is_done(*cell))
    }

    /// Measurement with its metrics in the order of the outline.
    fn last_row(&self, last: &WaveRecord) -> WaveRow {
        last.row(self.outline.metrics.iter().map(|m| m.column.as_str()))
    }
}

/// Date of a journal line in seconds since 1970; 0 if it is no date.
pub(super) fn date_s(line: &WorkerLine) -> f64 {
    parse_utc(&line.date).unwrap_or(0) as f64
}

/// Indices of the lines that start runs of the current night which have not ended, and of the line
/// that starts the newest run.
pub(super) fn live_lines(lines: &[WorkerLine]) -> BTreeSet<usize> {
    let mut ended: BTreeSet<&str> = BTreeSet::new();
    let mut live = BTreeSet::new();
    let mut current_night = true;
    for (i, line) in lines.iter().enumerate().rev() {
        match &line.event {
            JournalEvent::CellStarted(start)
                if live.is_empty() || (current_night && !ended.contains(start.run.as_str())) =>
            {
                live.insert(i);
                ended.insert(&start.run);
            }
            JournalEvent::CellFinished(end) => {
                ended.insert(&end.run);
            }
            JournalEvent::NightStarted(_) | JournalEvent::NightFinished {} => current_night = false,
            _ => {}
        }
    }
    live
}

/// Event that the first of these cells renders on a worker that is not shown.
fn run_active(cells: &[CellRef]) -> Option<FollowEvent> {
    cells
        .first()
        .map(|cell| FollowEvent::RunActive { cell: *cell })
}

/// Events of a bias check of these references.
fn bias_checks(check: &BiasCheckFile, cells: &[CellRef]) -> Vec<FollowEvent> {
    let checked = |cell: &CellRef| match *cell {
        CellRef::Reference(reference) => Some(FollowEvent::BiasCheck {
            reference,
            agrees: check.agrees,
        }),
        CellRef::Cell(_) => None,
    };
    cells.iter().filter_map(checked).collect()
}

/// Events of a line about a shard, which may have been finished.
fn shard_changes(shard: &ShardRecord, cells: &[CellRef], finished: bool) -> Vec<FollowEvent> {
    let change = |cell: &CellRef| match cell {
        CellRef::Reference(reference) => Some(FollowEvent::ShardChanged {
            reference: *reference,
            finished: finished.then_some(shard.number),
            total: shard.count,
        }),
        CellRef::Cell(_) => None,
    };
    cells.iter().filter_map(change).collect()
}

/// Beginning of the keys of a reference's shards among the active runs.
fn shard_prefix(run: &str) -> String {
    format!("{run} ")
}

/// Key of a shard among the active runs.
fn shard_key(run: &str, shard: &ShardRecord) -> String {
    format!("{}{}", shard_prefix(run), shard.number)
}
