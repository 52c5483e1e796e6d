//! Confidence intervals of means.

/// The 95 % confidence interval of a mean.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interval {
    /// The mean minus and plus this half-width.
    Half(f64),
    /// From the mean divided by this factor to the mean times it: the interval of a geometric mean.
    Factor(f64),
    /// Lower and upper end.
    Ends(f64, f64),
}

impl Interval {
    /// Returns the lower and the upper end for a mean.
    pub fn ends(self, mean: f64) -> (f64, f64) {
        match self {
            Interval::Half(half) => (mean - half, mean + half),
            Interval::Factor(factor) => (mean / factor, mean * factor),
            Interval::Ends(low, high) => (low, high),
        }
    }

    /// Returns half the distance of the ends.
    pub(super) fn half_width(self, mean: f64) -> f64 {
        if let Interval::Half(half) = self {
            return half;
        }
        let (low, high) = self.ends(mean);
        0.5 * (high - low)
    }
}
