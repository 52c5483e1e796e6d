//! Translation of journal lines into events of a follower.

use std::collections::BTreeSet;
use std::sync::Arc;

use super::run::FollowedRun;
use super::{Follower, Update};
use crate::experiment::night::reference::BiasCheckSummary;
use crate::experiment::{CellRef, Event, Outcome, WaveRow};
use crate::store::parse_utc;
use crate::store::read::merged_journal::WorkerLine;
use crate::store::schema::journal::{
    JournalEvent, OutcomeKind, RunEnd, ShardEnd, ShardRecord, WaveRecord,
};

impl Follower {
    /// Follows a line of the journal, and reports its events. `live` is whether the line starts a
    /// run that is worth showing.
    pub(super) fn apply_line(
        &mut self,
        line: &WorkerLine,
        live: bool,
        first_poll: bool,
        changes: &mut Update,
    ) {
        let at_s = date_s(line);
        let cells = self.cells_of(line);
        if self.is_outdated(line, &cells) {
            return;
        }
        match &line.event {
            JournalEvent::NightStarted(_) => {
                // Whatever the process before measured last belongs to the night that it left.
                self.poll_runs(changes);
                self.runs.iter_mut().for_each(|run| run.running = false);
                self.active.clear();
                self.begin_night(at_s, changes);
            }
            JournalEvent::WorkerStarted(_) if !self.night_active => {
                self.begin_night(at_s, changes);
            }
            JournalEvent::NightFinished {} | JournalEvent::NightClosed {} => {
                self.night_active = false;
                self.report(at_s, Event::NightFinished, changes);
            }
            JournalEvent::Forecast(left) => self.report(at_s, Event::Forecast(*left), changes),
            JournalEvent::BiasCheck(check) => {
                for reference in references(&cells) {
                    let check = BiasCheckSummary::from(check.clone());
                    let event = Event::BiasCheck {
                        reference,
                        check,
                        compared: None,
                    };
                    self.report(at_s, event, changes);
                }
            }
            JournalEvent::CellStarted(_) => self.cell_started(line, &cells, live, changes),
            JournalEvent::ShardStarted(start) => {
                let key = shard_key(&start.run, &start.shard);
                self.active.insert(key, line.clone());
                for reference in references(&cells) {
                    let shard = start.shard.shard(reference);
                    self.report(at_s, Event::ShardActive { shard }, changes);
                }
            }
            JournalEvent::ShardFinished(end) => self.shard_finished(end, at_s, &cells, changes),
            JournalEvent::CellFinished(end) => {
                self.cell_finished(end, at_s, &cells, first_poll, changes);
            }
            JournalEvent::Message(message) => {
                let event = Event::Message {
                    level: message.level,
                    cell: cells.first().copied(),
                    text: message.text.clone(),
                };
                self.report(at_s, event, changes);
            }
            JournalEvent::WorkerStarted(_) | JournalEvent::WorkerFinished {} => {}
        }
    }

    /// Begins a night in this folder, in which earlier results are found done.
    fn begin_night(&mut self, at_s: f64, changes: &mut Update) {
        self.night_active = true;
        let night = Arc::new(self.night.again());
        self.report(at_s, Event::NightStarted { night }, changes);
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
        changes: &mut Update,
    ) {
        let id = line.event.run().unwrap_or_default();
        self.active.insert(id.to_owned(), line.clone());
        let worker = &line.worker;
        let other = |run: &FollowedRun| run.running && run.worker != *worker;
        let busy = self.journals.has_workers() && self.runs.iter().any(other);
        if live && !busy {
            self.show(line, changes);
            if self.journals.has_workers() {
                self.show_worker(worker, changes);
            }
        } else if self.journals.has_workers()
            && let Some(cell) = cells.first().copied()
        {
            self.report(date_s(line), Event::RunActive { cell }, changes);
        }
    }

    /// Reports the end of a run, after its last measurements.
    fn cell_finished(
        &mut self,
        end: &RunEnd,
        at_s: f64,
        cells: &[CellRef],
        first_poll: bool,
        changes: &mut Update,
    ) {
        self.active.remove(&end.run);
        if end.outcome == OutcomeKind::Done {
            self.done.insert(end.run.clone());
            let prefix = shard_prefix(&end.run);
            self.active.retain(|key, _| !key.starts_with(&prefix));
        }
        if let Some(run) = self.runs.iter_mut().find(|run| cells.contains(&run.cell)) {
            run.running = false;
            self.poll_runs(changes);
        }
        for cell in cells {
            let outcome = end.outcome(self.files.run_folder(*cell));
            // In the first poll, the folders decide which runs are done; the journal adds numbers.
            let is_done = matches!(outcome, Outcome::Done(_));
            let confirmed = !first_poll || is_done == self.is_finished(*cell);
            if confirmed {
                let last = end.last.as_ref().map(|last| self.last_row(last));
                let event = Event::ended(*cell, outcome, last.into_iter().collect());
                self.report(at_s, event, changes);
            }
        }
    }

    /// Reports the end of a shard. Its reference stays active while other shards of it are.
    fn shard_finished(
        &mut self,
        end: &ShardEnd,
        at_s: f64,
        cells: &[CellRef],
        changes: &mut Update,
    ) {
        self.active.remove(&shard_key(&end.run, &end.shard));
        self.mark_stopped(&end.run);
        let prefix = shard_prefix(&end.run);
        let is_active = self.active.keys().any(|key| key.starts_with(&prefix));
        for reference in references(cells) {
            let event = Event::ShardFinished {
                shard: end.shard.shard(reference),
                outcome: end.outcome(),
                last: end.last.as_ref().map(|last| self.last_row(last)),
                sums: None,
            };
            self.report(at_s, event, changes);
            if is_active {
                let cell = CellRef::Reference(reference);
                self.report(at_s, Event::RunActive { cell }, changes);
            }
        }
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
            && cells.iter().all(|cell| self.files.is_done(*cell))
    }

    /// Measurement with its metrics in the order of the outline.
    fn last_row(&self, last: &WaveRecord) -> WaveRow {
        last.row(self.night.plan.metrics.iter().map(|m| m.column.as_str()))
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

/// Indices of the references among these.
fn references(cells: &[CellRef]) -> Vec<usize> {
    let reference = |cell: &CellRef| match *cell {
        CellRef::Reference(reference) => Some(reference),
        CellRef::Cell(_) => None,
    };
    cells.iter().filter_map(reference).collect()
}

/// Beginning of the keys of a reference's shards among the active runs.
fn shard_prefix(run: &str) -> String {
    format!("{run} ")
}

/// Key of a shard among the active runs.
fn shard_key(run: &str, shard: &ShardRecord) -> String {
    format!("{}{}", shard_prefix(run), shard.number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::schema::journal::{NightStart, RunEnd, RunStart};

    #[test]
    fn runs_of_a_night_that_was_killed_are_not_live() {
        let started = |run: &str| {
            JournalEvent::CellStarted(RunStart {
                run: run.to_owned(),
                ..RunStart::default()
            })
        };
        let ended = |run: &str| {
            JournalEvent::CellFinished(RunEnd {
                run: run.to_owned(),
                ..RunEnd::default()
            })
        };
        let night = || JournalEvent::NightStarted(NightStart::default());
        let live = |events: Vec<JournalEvent>| {
            let line = |event| WorkerLine {
                worker: String::new(),
                date: String::new(),
                event,
            };
            let lines: Vec<WorkerLine> = events.into_iter().map(line).collect();
            live_lines(&lines).into_iter().collect::<Vec<_>>()
        };
        let running = vec![
            night(),
            started("a"),
            started("b"),
            ended("a"),
            started("c"),
        ];
        assert_eq!(live(running), [2, 4]);
        let killed = vec![night(), started("a"), started("b"), night(), started("c")];
        assert_eq!(live(killed), [4]);
        let over = vec![
            night(),
            started("a"),
            started("b"),
            JournalEvent::NightFinished {},
        ];
        assert_eq!(live(over), [2], "the newest run is shown");
    }
}
