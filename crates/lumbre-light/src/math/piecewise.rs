//! Piecewise linear probability densities of one real variable.

use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// A piecewise linear density that integrates to 1. Clones share the knots.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Piecewise {
    knots: Arc<[Knot]>,
}

/// A point of the density, with the cumulative probability up to it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
struct Knot {
    x: f64,
    density: f64,
    cdf: f64,
}

impl Piecewise {
    /// Builds the density from at least two pairs of position and unnormalised density. Positions
    /// must not decrease, and the integral must be positive. Two pairs at one position make a step.
    pub fn new(pairs: &[[f32; 2]]) -> Piecewise {
        let pairs: Vec<[f64; 2]> = pairs.iter().map(|p| p.map(f64::from)).collect();
        let area = |a: [f64; 2], b: [f64; 2]| 0.5 * (a[1] + b[1]) * (b[0] - a[0]);
        let total: f64 = pairs.windows(2).map(|w| area(w[0], w[1])).sum();
        let mut cdf = 0.0;
        let mut knots = Vec::with_capacity(pairs.len());
        for (i, pair) in pairs.iter().enumerate() {
            if i > 0 {
                cdf += area(pairs[i - 1], *pair) / total;
            }
            knots.push(Knot {
                x: pair[0],
                density: pair[1] / total,
                cdf,
            });
        }
        Piecewise {
            knots: knots.into(),
        }
    }

    /// Returns the position at which the cumulative distribution function reaches `u`.
    pub fn sample(&self, u: f32) -> f32 {
        let u = f64::from(u);
        let next = self
            .knots
            .partition_point(|k| k.cdf <= u)
            .clamp(1, self.knots.len() - 1);
        let (a, b) = (self.knots[next - 1], self.knots[next]);
        let (h, rest) = (b.x - a.x, (u - a.cdf).max(0.0));
        if h <= 0.0 || rest <= 0.0 {
            return a.x as f32;
        }
        // The root of a.density t + (b.density - a.density) t^2 / 2h = rest, in the form without
        // cancellation.
        let slope = (b.density - a.density) / h;
        let root = (a.density * a.density + 2.0 * slope * rest).max(0.0).sqrt();
        (a.x + (2.0 * rest / (a.density + root)).min(h)) as f32
    }

    /// Returns the pairs of position and normalised density.
    pub fn pairs(&self) -> impl Iterator<Item = [f64; 2]> {
        self.knots.iter().map(|k| [k.x, k.density])
    }

    /// Returns position, normalised density and cumulative probability of each knot.
    pub fn knots(&self) -> impl Iterator<Item = [f64; 3]> {
        self.knots.iter().map(|k| [k.x, k.density, k.cdf])
    }

    /// Returns the knots before and after a position, or `None` outside the knots.
    fn segment(&self, x: f64) -> Option<(Knot, Knot)> {
        let next = self.knots.partition_point(|k| k.x <= x);
        (next >= 1 && next < self.knots.len()).then(|| (self.knots[next - 1], self.knots[next]))
    }

    /// Returns the density at a position; 0 outside the knots.
    pub fn density(&self, x: f64) -> f64 {
        self.segment(x).map_or(0.0, |(a, b)| {
            a.density + (b.density - a.density) * (x - a.x) / (b.x - a.x)
        })
    }

    /// Returns the probability of at most `x`.
    pub fn cdf(&self, x: f64) -> f64 {
        match self.segment(x) {
            Some((a, _)) => a.cdf + 0.5 * (a.density + self.density(x)) * (x - a.x),
            None => f64::from(u8::from(self.knots.last().is_some_and(|k| x >= k.x))),
        }
    }

    /// Returns the mean.
    pub fn mean(&self) -> f64 {
        let moment = |a: &Knot, b: &Knot| {
            let h = b.x - a.x;
            h * (a.density * (2.0 * a.x + b.x) + b.density * (a.x + 2.0 * b.x)) / 6.0
        };
        self.knots.windows(2).map(|w| moment(&w[0], &w[1])).sum()
    }
}
