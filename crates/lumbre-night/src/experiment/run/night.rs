//! The runner of a night, from its first event to its last: the order of references and cells,
//! rounds of polling for runs of other processes, and messages.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use super::active_run::EndedRun;
use super::backoff::Backoff;
use super::state::{NightRunner, ReferenceState};
use super::summary::{NightSummary, RunError};
use crate::experiment::event::Event;
use crate::experiment::forecast::{Throughput, WorkloadKey, forecast};
use crate::experiment::outcome::{CellRef, Level, WaveRow};
use crate::experiment::plan::ReferenceSource;

/// Shortest time between two forecasts.
const FORECAST_INTERVAL: Duration = Duration::from_secs(2);

/// Smallest ratio of that time to the time of making a forecast, which looks at every cell.
const MIN_INTERVAL_PER_COST: u32 = 100;

impl NightRunner<'_, '_> {
    /// Runs the night to its end.
    pub(super) fn run(mut self) -> Result<NightSummary, RunError> {
        let started = Event::NightStarted {
            night: Arc::new(self.summary.night.clone()),
        };
        self.emit(&started)
            .map_err(|reason| RunError::Start { reason })?;
        let mut order = self.order();
        if self.options.smoke {
            let failing = self.smoke(&order.concat());
            order
                .iter_mut()
                .for_each(|group| group.retain(|cell| !failing.contains_key(cell)));
            for (cell, reason) in failing {
                let outcome = self.finish(cell, EndedRun::failed(reason));
                if let CellRef::Reference(index) = cell {
                    self.references[index] = ReferenceState::unavailable(&outcome);
                }
            }
        }
        self.render_all(order);
        match self.emit(&Event::NightFinished) {
            Ok(()) => Ok(self.summary),
            Err(reason) => Err(RunError::Finish {
                reason,
                summary: Box::new(self.summary),
            }),
        }
    }

    /// Returns the order of rendering, as groups that are rendered together: the interleave groups
    /// of cells, each after the references that it needs first. With a deadline, they come from
    /// coarse to fine.
    fn order(&self) -> Vec<Vec<CellRef>> {
        let plan = self.plan;
        let coarse_first = self.options.deadline.is_some();
        let groups = plan
            .interleave_groups(coarse_first)
            .into_iter()
            .map(|group| group.into_iter().map(CellRef::Cell).collect::<Vec<_>>());
        let mut seen = BTreeSet::new();
        let mut order: Vec<Vec<CellRef>> = Vec::new();
        for group in groups {
            let references = group.iter().filter_map(|cell| match cell {
                CellRef::Cell(i) => plan.cells[*i].reference,
                CellRef::Reference(_) => None,
            });
            let with_second = |r: usize| {
                let second = plan.references[r].bias_check.map(|check| check.with);
                [Some(r), second]
            };
            let new = references
                .flat_map(with_second)
                .flatten()
                .filter(|r| seen.insert(*r));
            order.extend(new.map(|r| vec![CellRef::Reference(r)]));
            order.push(group);
        }
        if let Some(only) = &self.options.only {
            order
                .iter_mut()
                .for_each(|group| group.retain(|cell| only.contains(cell)));
        }
        order.retain(|group| !group.is_empty());
        match self.options.start {
            Some(start) if self.options.deadline.is_none() => start.rotate(plan, order),
            _ => order,
        }
    }

    /// Renders all groups. Those that other processes work on are polled until they have ended,
    /// their owner has died, or the night ends.
    fn render_all(&mut self, mut order: Vec<Vec<CellRef>>) {
        let mut reported = false;
        let mut backoff = Backoff::new(u64::from(std::process::id()));
        loop {
            let mut elsewhere: Vec<(Vec<CellRef>, String)> = Vec::new();
            let before = self.ended;
            self.references_elsewhere.clear();
            let (now, mut later) = backoff.next_batch(order);
            for group in now {
                if self.should_end() {
                    return;
                }
                // A request that came too late for the previous cell must not apply to this one.
                self.control.skip.take();
                self.control.restart.take();
                self.emit_forecast();
                elsewhere.extend(self.render_group(&group));
            }
            later
                .iter_mut()
                .for_each(|group| group.retain(|cell| !self.is_finished(*cell)));
            later.retain(|group| !group.is_empty());
            let owner = elsewhere.first().map_or("", |(_, owner)| owner.as_str());
            if elsewhere.is_empty() && later.is_empty() {
                return;
            }
            let progressed = before < self.ended;
            if progressed {
                backoff.reset();
            }
            if !reported && !progressed {
                reported = true;
                let count = elsewhere
                    .iter()
                    .map(|(group, _)| group)
                    .chain(&later)
                    .map(Vec::len)
                    .sum::<usize>();
                let text =
                    format!("waiting for {count} runs of other processes, one of them {owner}");
                // A failed message is no reason to stop waiting.
                let _ = self.emit(&Event::Message {
                    level: Level::Info,
                    cell: None,
                    text,
                });
            }
            for _ in 0..backoff.next_ticks() {
                if self.control.stop_requested() || self.deadline_passed() {
                    break;
                }
                (self.seams.wait)();
            }
            order = later
                .into_iter()
                .chain(elsewhere.into_iter().map(|(group, _)| group))
                .collect();
        }
    }

    /// Whether the night ends now, before all runs have ended; reports the reason.
    fn should_end(&mut self) -> bool {
        if self.control.stop_requested() || self.control.after_cell.get() {
            self.summary.interrupted = true;
            return true;
        }
        let text = match self.options.max_fails {
            Some(max_fails) if self.failed >= max_fails.max(1) => {
                format!("the night ends early: {} runs have failed", self.failed)
            }
            _ if self.deadline_passed() => {
                "the night ends early: its deadline has passed".to_owned()
            }
            _ => return false,
        };
        // The night ends even if the message fails.
        let _ = self.emit(&Event::Message {
            level: Level::Warn,
            cell: None,
            text,
        });
        true
    }

    /// Whether the deadline has passed.
    pub(super) fn deadline_passed(&self) -> bool {
        self.options
            .deadline
            .is_some_and(|deadline| SystemTime::now() >= deadline)
    }

    /// Applies an event to the night and sends it to every sink, even after one has failed. Returns
    /// the first failure.
    pub(super) fn emit(&mut self, event: &Event) -> Result<(), String> {
        self.summary.night.apply(event);
        let mut result = Ok(());
        for sink in self.sinks.iter_mut() {
            if let Err(error) = sink.receive(event) {
                result = result.and(Err(error.to_string()));
            }
        }
        result
    }

    /// Emits a message about a cell or reference. If a sink cannot record it, the caller lets the
    /// run fail.
    pub(super) fn emit_message(
        &mut self,
        level: Level,
        cell: CellRef,
        text: String,
    ) -> Result<(), String> {
        self.emit(&Event::Message {
            level,
            cell: Some(cell),
            text,
        })
    }

    /// Emits a forecast of the remaining time, unless the last one is recent.
    fn emit_forecast(&mut self) {
        let start = Instant::now();
        if start < self.next_forecast {
            return;
        }
        let only = self.options.only.as_ref();
        let is_open = |cell: CellRef| {
            let first = match cell {
                CellRef::Cell(i) => CellRef::Cell(self.plan.cells[i].first),
                CellRef::Reference(_) => cell,
            };
            let is_finished = [cell, first].iter().any(|c| self.finished.contains(c));
            !is_finished && only.is_none_or(|only| only.contains(&cell))
        };
        let remaining = forecast(self.plan, &self.throughput, &is_open);
        // The night does not depend on it.
        let _ = self.emit(&Event::Forecast(remaining));
        self.next_forecast =
            Instant::now() + FORECAST_INTERVAL.max(MIN_INTERVAL_PER_COST * start.elapsed());
    }

    /// Records the throughput of a finished run for the forecast.
    pub(super) fn record_throughput(&mut self, cell: CellRef, rows: &[WaveRow]) {
        let plan = self.plan;
        let (config, stop) = match cell {
            CellRef::Cell(i) => (&plan.cells[i].config, &plan.cells[i].stop),
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render { config, stop, .. } => (config, stop),
                ReferenceSource::File { .. } => return,
            },
        };
        if let Some(throughput) = rows
            .last()
            .and_then(|last| Throughput::from_last_row(last, stop))
        {
            self.throughput
                .record(WorkloadKey::from_config(config), throughput);
        }
    }
}
