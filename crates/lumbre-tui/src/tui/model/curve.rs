//! Measurements of one run, thinned so that memory does not grow with the length of the run.

use std::sync::Arc;

use lumbre_night::experiment::WaveRow;

/// Largest number of rows that a curve stores.
pub const CAPACITY: usize = 4096;
/// Largest number of rows of a thinned curve.
pub const THIN: usize = 128;

/// Measurements of a run in order of time. Beyond [`CAPACITY`] rows every other row is dropped,
/// but never the first or the last.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curve {
    rows: Vec<Arc<WaveRow>>,
}

impl Curve {
    /// Creates a curve from the rows of a run.
    pub fn from_rows(rows: &[WaveRow]) -> Curve {
        let mut curve = Curve::default();
        for row in rows {
            curve.push(Arc::new(row.clone()));
        }
        curve
    }

    /// Adds the newest measurement.
    pub fn push(&mut self, row: Arc<WaveRow>) {
        if self.rows.len() >= CAPACITY {
            self.halve();
        }
        self.rows.push(row);
    }

    fn halve(&mut self) {
        let last = self.rows.len().saturating_sub(1);
        let mut index = 0;
        self.rows.retain(|_| {
            let retained = index % 2 == 0 || index == last;
            index += 1;
            retained
        });
    }

    /// Returns the curve with at most [`THIN`] rows, for drawing behind other curves.
    pub fn thinned(&self) -> Curve {
        let mut curve = self.clone();
        while curve.rows.len() > THIN {
            curve.halve();
        }
        curve
    }

    /// Returns the measurements, oldest first.
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &WaveRow> + ExactSizeIterator {
        self.rows.iter().map(Arc::as_ref)
    }

    /// Returns the newest measurement.
    pub fn last(&self) -> Option<&WaveRow> {
        self.rows.last().map(Arc::as_ref)
    }

    /// Fits the power law `y = a * x^b` by least squares over the last three doublings of `x` and
    /// returns `(ln a, b)`.
    ///
    /// Rows for which `x` or `y` is not positive and finite are ignored. A Monte Carlo RMSE over
    /// samples has `b = -1/2`. Returns `None` with fewer than four usable rows or without spread.
    pub fn fit(
        &self,
        x: impl Fn(&WaveRow) -> f64,
        y: impl Fn(&WaveRow) -> Option<f64>,
    ) -> Option<(f64, f64)> {
        let usable = |row: &WaveRow| {
            let (x, y) = (x(row), y(row)?);
            (x > 0.0 && y > 0.0 && x.is_finite() && y.is_finite()).then(|| (x.ln(), y.ln()))
        };
        let points: Vec<(f64, f64)> = self.rows().filter_map(usable).collect();
        let from = points.last()?.0 - 8f64.ln() - 1e-9;
        let tail: Vec<(f64, f64)> = points.into_iter().filter(|p| p.0 >= from).collect();
        if tail.len() < 4 {
            return None;
        }
        let n = tail.len() as f64;
        let (mean_x, mean_y) = (
            tail.iter().map(|p| p.0).sum::<f64>() / n,
            tail.iter().map(|p| p.1).sum::<f64>() / n,
        );
        let spread: f64 = tail.iter().map(|p| (p.0 - mean_x).powi(2)).sum();
        let product: f64 = tail.iter().map(|p| (p.0 - mean_x) * (p.1 - mean_y)).sum();
        let slope = (spread > 1e-12).then(|| product / spread)?;
        Some((mean_y - slope * mean_x, slope))
    }

    /// Returns the exponent of [`Curve::fit`] for the metric `column`.
    pub fn slope(&self, column: usize, x: impl Fn(&WaveRow) -> f64) -> Option<f64> {
        self.fit(x, |row| row.metrics.get(column).copied())
            .map(|(_, slope)| slope)
    }
}

#[cfg(test)]
mod tests {
    use crate::tui::model::curve::*;

    fn row(samples: u64, error: f64) -> WaveRow {
        WaveRow {
            samples,
            render_s: samples as f64 * 0.01,
            metrics: vec![error],
            ..WaveRow::default()
        }
    }

    #[test]
    fn a_long_curve_stays_within_the_capacity_and_keeps_its_ends() {
        let mut curve = Curve::default();
        for i in 1..=100_000u64 {
            curve.push(Arc::new(row(i, 1.0)));
            assert!(curve.rows().len() <= CAPACITY);
            assert_eq!(curve.rows().next().unwrap().samples, 1);
            assert_eq!(curve.last().unwrap().samples, i);
        }
        assert!(curve.rows().is_sorted_by(|a, b| a.samples < b.samples));
        let thin = curve.thinned();
        assert!(thin.rows().len() <= THIN && thin.rows().len() > THIN / 4);
        assert_eq!(
            (thin.rows().next(), thin.last()),
            (curve.rows().next(), curve.last())
        );
        assert!(curve.rows().len() > CAPACITY / 4);
    }

    #[test]
    fn the_slope_of_a_monte_carlo_error_is_a_half() {
        let rows: Vec<WaveRow> = (0..12)
            .map(|k| row(1 << k, 0.3 / f64::from(1 << k).sqrt()))
            .collect();
        let slope = Curve::from_rows(&rows)
            .slope(0, |r| r.samples as f64)
            .unwrap();
        assert!((slope + 0.5).abs() < 1e-12, "{slope}");
        assert_eq!(
            Curve::from_rows(&rows[..3]).slope(0, |r| r.samples as f64),
            None
        );
        assert_eq!(Curve::from_rows(&rows).slope(1, |r| r.samples as f64), None);
    }
}
