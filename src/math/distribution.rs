//! Discrete distributions.

/// A distribution over `0..n` proportional to given weights, sampled by inversion.
#[derive(Clone, Debug, PartialEq)]
pub struct Discrete {
    /// Cumulative sums divided by the total; the last is exactly 1.
    cdf: Vec<f32>,
    /// Probability of each item.
    pmf: Vec<f32>,
    total: f64,
}

impl Discrete {
    /// Builds the distribution; `None` if no weight is positive or one is negative or not finite.
    pub fn new(weights: impl IntoIterator<Item = f32>) -> Option<Discrete> {
        let weights: Vec<f64> = weights.into_iter().map(f64::from).collect();
        let total: f64 = weights.iter().sum();
        if weights.iter().any(|w| !w.is_finite() || *w < 0.0) || total <= 0.0 || !total.is_finite() {
            return None;
        }
        let mut sum = 0.0;
        let mut cdf: Vec<f32> = weights
            .iter()
            .map(|w| {
                sum += w;
                (sum / total) as f32
            })
            .collect();
        // The last item with weight must catch every u < 1, also after rounding.
        let last = weights.iter().rposition(|w| *w > 0.0)?;
        cdf[last..].fill(1.0);
        let pmf = weights.iter().map(|w| (w / total) as f32).collect();
        Some(Discrete { cdf, pmf, total })
    }

    /// The item for `u` in `[0, 1)`, and its probability. Items of weight zero are never returned.
    #[inline]
    pub fn sample(&self, u: f32) -> (usize, f32) {
        let i = self.cdf.partition_point(|c| *c <= u).min(self.cdf.len() - 1);
        (i, self.pmf[i])
    }

    /// Probability of item `i`.
    #[inline]
    pub fn pmf(&self, i: usize) -> f32 {
        self.pmf[i]
    }

    /// Sum of the weights.
    pub fn total(&self) -> f64 {
        self.total
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{rng, stats};

    #[test]
    fn frequencies_follow_the_weights() {
        let weights = [0.0, 1.0, 5.0, 0.0, 0.25, 3.0, 0.0];
        let d = Discrete::new(weights).unwrap();
        let n = 100_000u32;
        let mut observed = [0.0; 7];
        for i in 0..n {
            let (item, p) = d.sample(rng::unit(rng::pcg4d([i, 0, 0, 9])[0]));
            assert_eq!(p, d.pmf(item));
            observed[item] += 1.0;
        }
        assert_eq!((observed[0], observed[3], observed[6]), (0.0, 0.0, 0.0));
        let expected: Vec<f64> = weights.iter().map(|w| f64::from(*w) / 9.25 * f64::from(n)).collect();
        assert!(stats::chi_square_p(&observed, &expected, 0) > 0.001);
    }

    #[test]
    fn extremes_and_nonsense() {
        let d = Discrete::new([0.0, 2.0, 0.0]).unwrap();
        assert_eq!(d.sample(0.0).0, 1);
        assert_eq!(d.sample(0.999_999_94).0, 1);
        assert!(Discrete::new([0.0, 0.0]).is_none());
        assert!(Discrete::new([1.0, -1.0]).is_none());
        assert!(Discrete::new([f32::NAN]).is_none());
        assert!(Discrete::new([]).is_none());
    }
}
