//! Events of a night, applied to its state.

use std::sync::Arc;

use super::Night;
use super::reference::{BiasCheckSummary, Reference};
use super::run::{Run, RunState};
use crate::experiment::event::Event;
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, Outcome, WaveRow};
use crate::experiment::shards::Shard;
use lumbre_metrics::floor::Floor;

impl Night {
    /// Follows an event. Events about cells that the plan does not have change nothing, so any
    /// order of events is safe.
    pub fn apply(&mut self, event: &Event) {
        match event {
            Event::NightStarted { night } => *self = Night::clone(night),
            Event::CellStarted { cell, resumed, .. } => {
                let last = resumed.as_ref().and_then(|rows| rows.last());
                self.set(*cell, RunState::Running, Some(newest(last)));
            }
            Event::RunActive { cell } => self.set(*cell, RunState::Running, None),
            Event::Wave { cell, row, .. } => {
                self.set(*cell, RunState::Running, Some(newest(Some(row))));
            }
            Event::NoiseFloors { reference, floors } => {
                if let Some(reference) = self.reference_mut(*reference) {
                    reference.floors = Some(Arc::clone(floors));
                }
            }
            Event::BiasCheck {
                reference, check, ..
            } => self.add_check(*reference, check),
            Event::ShardStarted { shard, resumed, .. } => {
                let last = resumed.as_ref().and_then(|rows| rows.last());
                let cell = CellRef::Reference(shard.reference);
                self.count_shard(shard, false);
                self.set(cell, RunState::Running, Some(newest(last)));
            }
            Event::ShardActive { shard } => {
                self.count_shard(shard, false);
                self.set(CellRef::Reference(shard.reference), RunState::Running, None);
            }
            Event::ShardFinished { shard, outcome, .. } => {
                self.count_shard(shard, matches!(outcome, Outcome::Done(_)));
                let cell = CellRef::Reference(shard.reference);
                if self.state(cell) == Some(&RunState::Running) {
                    self.set(cell, RunState::Pending, Some(Arc::default()));
                }
            }
            Event::CellFinished {
                cell,
                outcome,
                rows,
                floors,
                open,
                ..
            } => {
                let known = (!rows.is_empty()).then(|| Arc::clone(rows));
                self.set(*cell, RunState::Ended(outcome.clone()), known);
                self.set_facts(*cell, floors, open.as_ref());
            }
            Event::Times { .. }
            | Event::Picture { .. }
            | Event::Layer { .. }
            | Event::Halves { .. }
            | Event::Forecast(_)
            | Event::Message { .. }
            | Event::NightFinished => {}
        }
    }

    /// Returns the night as it begins when it is run again: finished runs are found done, and all
    /// others wait.
    pub fn again(&self) -> Night {
        let mut next = self.clone();
        for cell in self.all() {
            match self.state(cell) {
                Some(RunState::Ended(Outcome::Done(_))) => {
                    let folder = match cell {
                        CellRef::Cell(i) => self.runs[i].folder.clone(),
                        CellRef::Reference(i) => self.references[i].folder.clone(),
                    };
                    next.set(cell, RunState::Ended(Outcome::Cached(folder)), None);
                }
                // Whatever waits has no measurements, and need not be copied.
                Some(RunState::Ended(Outcome::Cached(_)) | RunState::Pending) => {}
                _ => next.set(cell, RunState::Pending, Some(Arc::default())),
            }
        }
        next
    }

    /// Sets the state of a run or reference, and its measurements unless they stay.
    fn set(&mut self, cell: CellRef, state: RunState, rows: Option<Arc<Vec<WaveRow>>>) {
        let (old_state, old_rows) = match cell {
            CellRef::Cell(i) => match self.run_mut(i) {
                Some(run) => (&mut run.state, &mut run.rows),
                None => return,
            },
            CellRef::Reference(i) => match self.reference_mut(i) {
                Some(reference) => (&mut reference.state, &mut reference.rows),
                None => return,
            },
        };
        *old_state = state;
        if let Some(rows) = rows {
            *old_rows = rows;
        }
    }

    /// Sets the noise floors and the cost of opening the renderer of a run, where they are known.
    fn set_facts(
        &mut self,
        cell: CellRef,
        floors: &NoiseFloors,
        open: Option<&lumbre_render::OpenStats>,
    ) {
        let columns = self.plan.metrics.iter().map(|metric| &metric.column);
        let known: Vec<(String, Floor)> = columns
            .zip(floors.iter())
            .filter_map(|(column, floor)| Some((column.clone(), (*floor)?)))
            .collect();
        let CellRef::Cell(i) = cell else {
            return;
        };
        if let Some(run) = self.run_mut(i) {
            if !known.is_empty() {
                run.floors = known;
            }
            if open.is_some() {
                run.open = open.cloned();
            }
        }
    }

    /// Notes that a shard of a reference started or finished.
    fn count_shard(&mut self, shard: &Shard, is_finished: bool) {
        if let Some(reference) = self.reference_mut(shard.reference) {
            let shards = reference.shards.get_or_insert_default();
            shards.count = shard.count;
            shards.finished.extend(is_finished.then_some(shard.number));
        }
    }

    /// Adds a comparison of a reference, in place of an earlier one with the same technique.
    fn add_check(&mut self, reference: usize, check: &BiasCheckSummary) {
        if let Some(reference) = self.reference_mut(reference) {
            reference
                .checks
                .retain(|other| other.technique != check.technique);
            reference.checks.push(check.clone());
        }
    }

    fn run_mut(&mut self, index: usize) -> Option<&mut Run> {
        self.runs.get_mut(index).map(Arc::make_mut)
    }

    fn reference_mut(&mut self, index: usize) -> Option<&mut Reference> {
        self.references.get_mut(index).map(Arc::make_mut)
    }
}

/// Returns the newest measurement alone, or none.
fn newest(row: Option<&WaveRow>) -> Arc<Vec<WaveRow>> {
    Arc::new(row.cloned().into_iter().collect())
}
