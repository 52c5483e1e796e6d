//! Cells of a night: claimed, rendered in interleave groups, and recorded.

use super::active_run::{ActiveRun, EndedRun, RunRequest};
use super::state::NightRunner;
use super::state::ReferenceState;
use super::turns::memory_shortage;
use crate::experiment::event::Event;
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, Level, Outcome};
use crate::experiment::run_progress::{Claim, ReportedOutcome};

/// Whether a cell or reference can be rendered now.
pub(super) enum Readiness<'a> {
    /// It is claimed and ready to be rendered.
    Ready(Box<(ActiveRun<'a>, NoiseFloors)>),
    /// It has ended, with whatever outcome.
    Finished,
    /// Another process works on it or on its reference; the text identifies that process.
    HeldBy(String),
    /// It needs another kind of worker, for this reason.
    WrongWorker(String),
}

impl<'a> NightRunner<'a, '_> {
    /// Renders an interleave group, or a reference. Returns those that another process works on,
    /// and the name of one such process.
    pub(super) fn render_group(&mut self, group: &[CellRef]) -> Option<(Vec<CellRef>, String)> {
        let mut elsewhere: Option<(Vec<CellRef>, String)> = None;
        let mut runs = Vec::new();
        for cell in group {
            let readiness = match cell {
                CellRef::Reference(index) => self.process_reference(*index),
                CellRef::Cell(index) => self.prepare_cell(*index),
            };
            match readiness {
                Readiness::Finished => {}
                Readiness::WrongWorker(reason) => {
                    self.summary.other_workers.push((*cell, reason));
                }
                Readiness::Ready(run) => runs.push(*run),
                Readiness::HeldBy(owner) => elsewhere
                    .get_or_insert_with(|| (Vec::new(), owner))
                    .0
                    .push(*cell),
            }
        }
        if let [first, _, ..] = runs.as_slice() {
            let text = format!("interleaving {} techniques of one picture", runs.len());
            // A failed message is no reason not to render.
            let _ = self.emit_message(Level::Info, first.0.request.cell, text);
        }
        let mut shortage = memory_shortage(&runs, self.options.memory);
        if shortage.is_some() {
            // A scene can be compiled again; a run without memory fails.
            self.scenes.clear();
            shortage = memory_shortage(&runs, self.options.memory);
        }
        match shortage {
            Some(reason) => {
                for (run, _) in runs {
                    self.finish(run.request.cell, EndedRun::failed(reason.clone()));
                    self.history.release(self.plan, run.request.cell.into());
                }
            }
            None => self.render_interleaved(runs),
        }
        elsewhere
    }

    /// Claims a cell for rendering, unless it has ended or another process works on it. Records its
    /// result if it is found finished or fails.
    fn prepare_cell(&mut self, index: usize) -> Readiness<'a> {
        let plan = self.plan;
        let cell = CellRef::Cell(index);
        if self.is_finished(cell) {
            return Readiness::Finished;
        }
        if let Some(run) = self.history.finished_run(plan, cell) {
            self.finish(cell, EndedRun::cached(run));
            return Readiness::Finished;
        }
        if let Some(reference) = plan.cells[index].reference
            && let ReferenceState::Pending = self.references[reference]
        {
            // Another process had the reference at its turn; it will be processed before this cell
            // in the next round. If only some cells were requested, references are rendered on
            // demand.
            if let Readiness::HeldBy(owner) = self.process_reference(reference) {
                return Readiness::HeldBy(owner);
            }
        }
        match self.history.claim(plan, cell.into()) {
            Ok(Claim::Granted) => {}
            Ok(Claim::HeldBy(owner)) => return Readiness::HeldBy(owner),
            Ok(Claim::WrongWorker(reason)) => return Readiness::WrongWorker(reason),
            Err(error) => {
                self.finish(cell, EndedRun::failed(error.to_string()));
                return Readiness::Finished;
            }
        }
        // Another process may have finished it before the claim was granted.
        let ended = match self.history.finished_run(plan, cell) {
            Some(run) => EndedRun::cached(run),
            None => match self.active_run(index) {
                Ok(run) => return Readiness::Ready(Box::new(run)),
                Err(reason) => EndedRun::failed(reason),
            },
        };
        self.finish(cell, ended);
        self.history.release(plan, cell.into());
        Readiness::Finished
    }

    /// Makes the active run of a claimed cell, with the noise floors of its reference.
    fn active_run(&mut self, index: usize) -> Result<(ActiveRun<'a>, NoiseFloors), String> {
        let cell = &self.plan.cells[index];
        let reference = cell
            .reference
            .map(|r| self.reference_image(r, cell.config.resolution))
            .transpose()?;
        let floors = self.noise_floors(cell.reference.zip(reference.as_ref()))?;
        let request = RunRequest {
            cell: CellRef::Cell(index),
            config: &cell.config,
            scene: &cell.scene,
            seeds: std::slice::from_ref(&cell.seed),
            stop: cell.stop.clone(),
            shard: None,
            reference,
            resolution: None,
        };
        Ok((ActiveRun::new(request), floors))
    }

    /// Whether a cell or reference has ended. Adopts the outcome that another worker has reported,
    /// if any.
    pub(super) fn is_finished(&mut self, cell: CellRef) -> bool {
        if let CellRef::Reference(index) = cell
            && !matches!(self.references[index], ReferenceState::Pending)
        {
            return true;
        }
        let Some(reported) = self.history.reported_outcome(self.plan, cell) else {
            return false;
        };
        let ended = match reported {
            ReportedOutcome::Done(folder) => EndedRun::without_results(Outcome::Cached(folder)),
            ReportedOutcome::Failed(reason) => EndedRun::failed(reason),
        };
        if let CellRef::Reference(index) = cell {
            self.references[index] = match &ended.outcome {
                Outcome::Cached(_) => ReferenceState::Recorded,
                outcome => ReferenceState::unavailable(outcome),
            };
        }
        let settled = matches!(ended.outcome, Outcome::Cached(_));
        self.count(cell, &ended.outcome);
        let event = ended.event(cell);
        if settled {
            // The other worker has recorded it already.
            let _ = self.emit(&event);
        } else {
            self.summary.night.apply(&event);
        }
        true
    }

    /// Counts a cell or reference that has ended.
    fn count(&mut self, cell: CellRef, outcome: &Outcome) {
        self.finished.insert(cell);
        self.ended += 1;
        self.failed += usize::from(matches!(outcome, Outcome::Failed(_)));
    }

    /// Emits how a cell or reference ended and adds it to the summary. If a sink cannot record it,
    /// it counts as failed. Returns the final outcome.
    pub(super) fn finish(&mut self, cell: CellRef, mut ended: EndedRun) -> Outcome {
        if let Outcome::Done(_) = ended.outcome
            && !self.history.holds_claim(self.plan, cell.into())
        {
            let text = "another process took over this run while this process was suspended; its \
                        results are identical";
            // The run is not lost, only not recorded here.
            let _ = self.emit_message(Level::Warn, cell, text.to_owned());
            ended.outcome = Outcome::Interrupted;
        }
        let mut outcome = ended.outcome.clone();
        let event = ended.event(cell);
        if let Err(reason) = self.emit(&event) {
            let reason = format!("the result could not be recorded: {reason}");
            // The sink that failed may fail again; the others receive the message, and the summary
            // has the reason.
            let _ = self.emit_message(Level::Error, cell, reason.clone());
            outcome = Outcome::Failed(reason);
            let failed = Event::ended(cell, outcome.clone(), Vec::new());
            self.summary.night.apply(&failed);
        }
        if outcome == Outcome::Interrupted && self.control.stop_requested() {
            self.summary.interrupted = true;
        }
        if let (Outcome::Done(_) | Outcome::Cached(_), Event::CellFinished { rows, .. }) =
            (&outcome, &event)
        {
            self.record_throughput(cell, rows);
        }
        self.count(cell, &outcome);
        outcome
    }
}
