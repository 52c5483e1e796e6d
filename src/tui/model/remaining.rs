//! Elapsed and estimated remaining time of the current run and of the night.

use super::entry::{EntryState, mean_wall_s};
use super::eta;
use super::eta::Eta;
use super::night::NightModel;
use crate::experiment::{CellRef, WaveRow};

impl NightModel {
    /// Wall time in seconds since the current run started, at `now_s` on the receiver's clock.
    pub fn cell_wall_s(&self, now_s: f64) -> f64 {
        let Some(current) = &self.current else {
            return 0.0;
        };
        let measured = current.curve.last().map_or(0.0, |row| row.wall_s);
        if current.running {
            measured + (now_s - current.updated_s).max(0.0)
        } else {
            measured
        }
    }

    /// Seconds since the night began, at `now_s` on the receiver's clock; constant after its end.
    pub fn night_s(&self, now_s: f64) -> f64 {
        self.started_s.map_or(0.0, |started| {
            (self.finished_s.unwrap_or(now_s) - started).max(0.0)
        })
    }

    /// Remaining wall time of the current run, as far as its stop rule allows an estimate.
    pub fn cell_eta(&self, now_s: f64) -> Option<Eta> {
        let current = self.current.as_ref().filter(|current| current.running)?;
        let row = current.curve.last()?;
        let metrics = self.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
        let fits = |column: &str| eta::fit(&current.curve, metrics, column);
        let left = eta::render_left(self.stop_rule(current.cell)?, row, &fits)?;
        // Wall time also includes measuring and writing.
        let overhead = if row.render_s > 0.0 {
            (row.wall_s / row.render_s).max(1.0)
        } else {
            1.0
        };
        let since = (now_s - current.updated_s).max(0.0);
        Some(Eta {
            seconds: (left.seconds * overhead - since).max(0.0),
            ..left
        })
    }

    /// Remaining wall time of the night: the latest forecast minus the time since it was made.
    ///
    /// Without a forecast, or if the forecast does not cover every run, each waiting run counts
    /// with the mean wall time of the finished ones or, if none has finished, with the limit of its
    /// stop rule. Returns `None` if neither is known.
    pub fn night_eta(&self, now_s: f64) -> Option<Eta> {
        if self.finished_s.is_some() {
            return None;
        }
        self.plan.as_ref()?;
        if let Some((left, at_s)) = self
            .forecast
            .filter(|(left, _)| left.unknown == 0 && left.known > 0)
        {
            let seconds = (left.seconds - (now_s - at_s)).max(0.0);
            return Some(Eta {
                seconds,
                at_most: left.at_most,
                forecast: left.rough,
            });
        }
        let means = (mean_wall_s(&self.references), mean_wall_s(&self.cells));
        let mut sum = Eta::default();
        let references = (0..self.references.len()).map(CellRef::Reference);
        for cell in references.chain((0..self.cells.len()).map(CellRef::Cell)) {
            let mean = if let CellRef::Reference(_) = cell {
                means.0
            } else {
                means.1
            };
            let left = match self.entry(cell)?.state {
                EntryState::Waiting => match (mean, self.stop_rule(cell)) {
                    (_, None) => Eta::default(),
                    (Some(seconds), _) => Eta {
                        seconds,
                        ..Eta::default()
                    },
                    (None, Some(rule)) => eta::render_left(rule, &WaveRow::default(), &|_| None)?,
                },
                EntryState::Running if self.current.as_ref().is_some_and(|c| c.cell == cell) => {
                    let spent = self.cell_wall_s(now_s);
                    let by_mean = mean.map(|mean| Eta {
                        seconds: (mean - spent).max(0.0),
                        ..Eta::default()
                    });
                    self.cell_eta(now_s).or(by_mean)?
                }
                _ => continue,
            };
            sum = sum.then(left);
        }
        Some(sum)
    }

    /// Number of invalid (NaN or infinite) samples of all runs of this night.
    pub fn invalid(&self) -> u64 {
        self.references
            .iter()
            .chain(&self.cells)
            .filter_map(|e| e.last.as_ref())
            .map(|row| row.invalid)
            .sum()
    }
}
