//! A slow reference for the MIS weights of `bdpt`: computes the density of every strategy of a path
//! as the product that defines it, and the weights that follow. It shares with `bdpt` only the
//! densities of single events.

mod path;
mod split;

pub use path::{Path, ScatterVertex};
pub use split::fast_weights;

use super::Context;
use super::bdpt::single::{ConnectedPath, Subpaths, for_each_path};
use crate::math::rng::pcg4d;
use crate::transport::sampler::Sampler;

/// The results of [`check`]. All errors are relative; zero is exact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OracleReport {
    /// Number of paths that were compared.
    pub paths: u64,
    /// Number of paths through Dirac events among them; their contribution cannot be compared.
    pub dirac_paths: u64,
    /// Number of comparisons of each strategy, `[s][t]`.
    pub strategies: Vec<Vec<u64>>,
    /// Largest error of the weight that `bdpt` used.
    pub worst_weight: f64,
    /// Number of paths whose weight has an error above [`TOLERANCE`]. With the uniform heuristic, a
    /// density that rounding makes zero changes the number of strategies, and with it the weight.
    pub rough_weights: u64,
    /// Largest difference from one of the sum of the fast weights of all strategies of a path.
    pub worst_sum: f64,
    /// Largest error of the density that a strategy divides by.
    pub worst_density: f64,
    /// Number of paths whose density has an error above [`TOLERANCE`]. Some are unavoidable: a ray
    /// starts a little off its surface, so the direction of a short edge that grazes a surface is
    /// not exactly that between the points, and strategies differ in which of the two a cosine is
    /// computed from.
    pub rough_densities: u64,
    /// Number of paths whose density has an error above [`COARSE`].
    pub coarse_densities: u64,
}

impl OracleReport {
    /// Returns whether everything is as exact as single precision allows: all weights and sums
    /// within [`TOLERANCE`], all densities within [`COARSE`], and at most one in a hundred
    /// densities beyond [`TOLERANCE`].
    pub fn is_exact(&self) -> bool {
        self.paths > 0
            && self.worst_weight <= TOLERANCE
            && self.worst_sum <= TOLERANCE
            && self.worst_density <= COARSE
            && self.rough_densities * 100 <= self.paths
    }
}

/// Maximum relative error of weights. Only grazing angles come near it: the cosine between an edge
/// and a surface has an absolute error of about 1e-7.
pub const TOLERANCE: f64 = 1e-3;

/// Maximum relative error of a density.
pub const COARSE: f64 = 0.25;

/// Compares `samples` samples of `bdpt`, distributed randomly over the picture, with the
/// definition. The parameters of the context select the heuristic. With a filter other than a box
/// of one pixel the densities of strategies with one camera vertex differ by the filter, which
/// appears in [`OracleReport::worst_density`].
pub fn check(context: &Context, samples: u64, seed: u64) -> OracleReport {
    let mut report = OracleReport::default();
    let mut subpaths = Subpaths::default();
    let [width, height] = context.camera.resolution();
    for sample in 0..samples {
        let [x, y, ..] = pcg4d([
            sample as u32,
            (sample >> 32) as u32,
            seed as u32,
            (seed >> 32) as u32,
        ]);
        let pixel = [x % width, y % height];
        let mut sampler = Sampler::new(seed, pixel, sample);
        for_each_path(context, pixel, &mut sampler, &mut subpaths, &mut |found| {
            report.compare(context, &found)
        });
    }
    report
}

impl OracleReport {
    /// Compares one path with the definition and updates the report.
    fn compare(&mut self, context: &Context, found: &ConnectedPath) {
        let Some(path) = Path::new(context, found) else {
            return;
        };
        let h = context.settings.heuristic();
        let (s, t) = (found.contribution.s as usize, found.contribution.t as usize);
        let weight = if context.settings.unweighted() {
            f64::NAN
        } else {
            path.weights(context, h)[s]
        };
        let weight_error = (found.weight / weight - 1.0).abs();
        let sum_error = (fast_weights(context, h, &path).iter().sum::<f64>() - 1.0).abs();
        self.paths += 1;
        let density_error = match path.contribution(context) {
            None => {
                self.dirac_paths += 1;
                0.0
            }
            Some(carried) => {
                let p = path.densities(context)[s];
                let estimated = found.contribution.unweighted.as_dvec3() * p;
                (estimated - carried).abs().max_element() / carried.abs().max_element()
            }
        };
        self.rough_weights += u64::from(weight_error.is_nan() || weight_error > TOLERANCE);
        self.rough_densities += u64::from(density_error.is_nan() || density_error > TOLERANCE);
        self.coarse_densities += u64::from(density_error.is_nan() || density_error > COARSE);
        self.worst_weight = worst(self.worst_weight, weight_error);
        self.worst_sum = worst(self.worst_sum, sum_error);
        self.worst_density = worst(self.worst_density, density_error);
        if self.strategies.len() <= s {
            self.strategies.resize(s + 1, Vec::new());
        }
        let row = &mut self.strategies[s];
        if row.len() <= t {
            row.resize(t + 1, 0);
        }
        row[t] += 1;
    }
}

/// Returns the greater of two errors; NaN counts as infinite.
fn worst(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}
