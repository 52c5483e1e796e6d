//! The slow judge of `bdpt`: for a whole path, the density of every strategy as the product that defines it, and the
//! weights that follow. It shares with what it judges the densities of single events, and nothing of how they are put
//! together.

mod path;
mod split;

pub use path::{Path, Scatter};
pub use split::fast_weights;

use super::Context;
use super::bdpt::{self, Found, subpath::Subpaths};
use crate::math::rng::pcg4d;
use crate::transport::sampler::Sampler;

/// What [`check`] found. All errors are relative, and zero is perfect.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OracleReport {
    /// Paths that were compared.
    pub paths: u64,
    /// Paths through Dirac events among them; their contribution cannot be compared.
    pub dirac_paths: u64,
    /// How often each strategy was compared, by `[s][t]`.
    pub strategies: Vec<Vec<u64>>,
    /// The greatest difference between the weight that `bdpt` used and that of the definition.
    pub worst_weight: f64,
    /// Paths whose weight differs by more than [`TOLERANCE`]. Where all strategies count alike, a density that rounding
    /// makes zero changes their number, and with it the weight.
    pub rough_weights: u64,
    /// The greatest difference between one and the sum of the fast weights of all strategies of one path.
    pub worst_sum: f64,
    /// The greatest difference between the density that divides what a strategy found, and that of the definition.
    pub worst_density: f64,
    /// Paths whose density differs by more than [`TOLERANCE`]. Some must: a ray starts a little off its surface, so the
    /// direction of a short edge that grazes a surface is not quite that from point to point, and strategies disagree
    /// about which of the two a cosine is taken of.
    pub rough_densities: u64,
    /// Paths whose density differs by more than [`COARSE`].
    pub coarse_densities: u64,
}

impl OracleReport {
    /// Whether everything is as exact as single precision allows: all weights and sums within [`TOLERANCE`], all
    /// densities within [`COARSE`], and of them no more than one in a hundred beyond [`TOLERANCE`].
    pub fn is_exact(&self) -> bool {
        self.paths > 0
            && self.worst_weight <= TOLERANCE
            && self.worst_sum <= TOLERANCE
            && self.worst_density <= COARSE
            && self.rough_densities * 100 <= self.paths
    }
}

/// The relative error that weights may have. Grazing angles alone come near it: the cosine between an edge and a surface
/// has an absolute error of about 1e-7.
pub const TOLERANCE: f64 = 1e-3;

/// The relative error that a density may have at worst.
pub const COARSE: f64 = 0.25;

/// Compares `samples` samples of `bdpt`, spread at random over the picture, with the definition. The parameters of the
/// context decide the heuristic; with a filter other than a box of one pixel the densities of strategies with one camera
/// vertex differ by the filter, and [`OracleReport::worst_density`] shows it.
pub fn check(context: &Context, samples: u64, seed: u64) -> OracleReport {
    let mut report = OracleReport::default();
    let mut subpaths = Subpaths::default();
    let [width, height] = context.camera.resolution();
    for sample in 0..samples {
        let [x, y, ..] = pcg4d([sample as u32, (sample >> 32) as u32, seed as u32, (seed >> 32) as u32]);
        let pixel = [x % width, y % height];
        let mut sampler = Sampler::new(seed, pixel, sample);
        bdpt::each(context, pixel, &mut sampler, &mut subpaths, &mut |found| report.judge(context, &found));
    }
    report
}

impl OracleReport {
    fn judge(&mut self, context: &Context, found: &Found) {
        let Some(path) = Path::new(found) else { return };
        let h = context.settings.heuristic();
        let (s, t) = (found.contribution.s as usize, found.contribution.t as usize);
        let weight = if context.settings.raw() { f64::NAN } else { path.weights(context, h)[s] };
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
                let said = found.contribution.unweighted.as_dvec3() * p;
                (said - carried).abs().max_element() / carried.abs().max_element()
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

/// The greater of two errors; what is not a number is the worst.
fn worst(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}
