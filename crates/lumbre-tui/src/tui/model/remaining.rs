//! Elapsed and estimated remaining time of the current run and of the night.

use super::eta;
use super::eta::Eta;
use super::night::{CurrentRun, NightModel};
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::{CellRef, Outcome, WaveRow};

impl NightModel {
    /// Wall time in seconds since the current run started, at `now_s` on the receiver's clock.
    pub fn cell_wall_s(&self, now_s: f64) -> f64 {
        let Some(current) = &self.current else {
            return 0.0;
        };
        let measured = current.curve.last().map_or(0.0, |row| row.wall_s);
        if current.running {
            measured + self.since_wave_s(current, now_s)
        } else {
            measured
        }
    }

    /// Seconds for which the current run has rendered since its last measurement. While other
    /// techniques of the same picture have their turn, it waits.
    fn since_wave_s(&self, current: &CurrentRun, now_s: f64) -> f64 {
        let mut rivals = self.interleaved.values();
        if rivals.any(|rival| rival.updated_s > current.updated_s) {
            return 0.0;
        }
        (now_s - current.updated_s).max(0.0)
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
        let fits = |column: &str| eta::fit(&current.curve, self.metrics(), column);
        let left = eta::render_left(self.stop_rule(current.cell)?, row, &fits)?;
        // Wall time also includes measuring and writing.
        let overhead = if row.render_s > 0.0 {
            (row.wall_s / row.render_s).max(1.0)
        } else {
            1.0
        };
        let since = self.since_wave_s(current, now_s);
        Some(Eta {
            seconds: (left.seconds * overhead - since).max(0.0),
            ..left
        })
    }

    /// Remaining wall time of the night: the latest forecast minus the time since it was made, and at
    /// least what the current run needs.
    ///
    /// Without a forecast, or if it does not cover every run or its time has passed, each waiting run counts
    /// with the mean wall time of the finished ones or, if none has finished, with the limit of its
    /// stop rule. Returns `None` if neither is known.
    pub fn night_eta(&self, now_s: f64) -> Option<Eta> {
        if self.finished_s.is_some() {
            return None;
        }
        self.planned()?;
        if let Some((left, at_s)) = self
            .forecast
            .filter(|(left, _)| left.unknown == 0 && left.known > 0)
        {
            let seconds = left.seconds - (now_s - at_s);
            let current = self.cell_eta(now_s).map_or(0.0, |eta| eta.seconds);
            if seconds > 0.0 {
                return Some(Eta {
                    seconds: seconds.max(current),
                    at_most: left.at_most,
                    forecast: left.rough,
                });
            }
        }
        let is_reference = |cell: &CellRef| matches!(cell, CellRef::Reference(_));
        let means = [false, true].map(|wanted| {
            let same_kind = self.night.all().filter(|c| is_reference(c) == wanted);
            self.mean_wall_s(same_kind)
        });
        let mut sum = Eta::default();
        for cell in self.night.all() {
            let mean = means[usize::from(is_reference(&cell))];
            let left = match self.night.state(cell)? {
                RunState::Pending | RunState::Damaged(_) => match (mean, self.stop_rule(cell)) {
                    (_, None) => Eta::default(),
                    (Some(seconds), _) => Eta {
                        seconds,
                        ..Eta::default()
                    },
                    (None, Some(rule)) => eta::render_left(rule, &WaveRow::default(), &|_| None)?,
                },
                RunState::Running if self.current.as_ref().is_some_and(|c| c.cell == cell) => {
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
        let rows = self
            .night
            .all()
            .filter_map(|cell| self.night.last_row(cell));
        rows.map(|row| row.invalid).sum()
    }

    /// Returns the mean wall time, in seconds, of those that were finished in this night; `None` if
    /// none was.
    fn mean_wall_s(&self, cells: impl Iterator<Item = CellRef>) -> Option<f64> {
        let done = cells
            .filter(|cell| matches!(self.night.outcome(*cell), Some(Outcome::Done(_))))
            .filter_map(|cell| self.night.last_row(cell));
        let (sum, n) = done.fold((0.0, 0u32), |(sum, n), row| (sum + row.wall_s, n + 1));
        (n > 0).then(|| sum / f64::from(n))
    }
}
