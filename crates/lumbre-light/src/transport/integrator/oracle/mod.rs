//! A slow reference for the MIS weights of `bdpt`, `guided_bdpt`, `vcm` and `lvc`: computes the
//! density of every strategy of a path as the product that defines it, and the weights that follow.
//! It shares with them only the densities of single events.

mod guide;
mod path;
mod split;

pub use guide::Guide;
pub use path::{ByStrategy, Path, ScatterVertex};
pub use split::fast_weights;

use super::Context;
use super::bdpt::directions::{BsdfDirections, SubpathDirections};
use super::bdpt::draw::LightVertexCache;
use super::bdpt::single::{self, ConnectedPath, SharedVertex, Subpaths};
use super::bdpt::weights::StrategyCounts;
use super::guided::bidirectional::{self, GuidedDirections};
use super::iteration::light_paths::LightPaths;
use super::iteration::{Iteration, Resources, Shared, Sharing, Workers};
use super::lvc;
use super::vcm::{self, shared::SharedVertices};
use crate::math::rng::pcg4d;
use crate::math::stats::median;
use crate::transport::mis::Heuristic;
use crate::transport::sampler::{INDEPENDENT, Sampler};

/// Parameters of the weights, besides the path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rule<'a> {
    /// Heuristic of the weights.
    pub heuristic: Heuristic,
    /// Numbers of samples of the strategies.
    pub counts: StrategyCounts,
    /// Tree by which camera subpaths are guided, if there is one.
    pub guide: Option<Guide<'a>>,
}

/// The results of [`check`]. All errors are relative; zero is exact.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OracleReport {
    /// Number of paths that were compared.
    pub paths: u64,
    /// Number of paths through Dirac events among them; their contribution cannot be compared.
    pub dirac_paths: u64,
    /// Number of comparisons of each strategy, `[s][t]`.
    pub strategies: Vec<Vec<u64>>,
    /// Largest error of the weight that a connection used.
    pub worst_weight: f64,
    /// Number of paths whose weight has an error above [`TOLERANCE`]. With the uniform heuristic, a
    /// density that rounding makes zero changes the number of strategies, and with it the weight.
    pub rough_weights: u64,
    /// Largest difference from one of the sum of the fast weights of all strategies of a connected
    /// path.
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
    /// Number of paths found by merging, for each number of edges of their light subpath. They count
    /// in `paths`, and not in the other numbers above.
    pub merges: Vec<u64>,
    /// Number of paths found by merging whose fast weights differ from one in their sum by more
    /// than [`TOLERANCE`]. Two vertices are taken for one there, and one of their two directions can
    /// cross a horizon of the surface.
    pub rough_merged_sums: u64,
    /// Largest error of the weight of merging, for any vertex of any connected path.
    pub worst_merge_weight: f64,
    /// Number of such weights with an error above [`TOLERANCE`].
    pub rough_merge_weights: u64,
    /// Errors of the weight that merging used for each path that it found. They are of the order of
    /// the radius over the length of an edge, since two vertices are taken for one.
    pub merged_weights: Vec<f64>,
    /// Errors of the density that merging divides by, likewise.
    pub merged_densities: Vec<f64>,
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
            && self.worst_merge_weight <= TOLERANCE
    }

    /// Returns the medians of [`OracleReport::merged_weights`] and
    /// [`OracleReport::merged_densities`]; 0 without any.
    pub fn median_merge_errors(&self) -> [f64; 2] {
        [&self.merged_weights, &self.merged_densities].map(|errors| {
            if errors.is_empty() {
                0.0
            } else {
                median(errors.clone())
            }
        })
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
    check_single(context, (BsdfDirections, None), samples, seed)
}

/// Compares `samples` samples of `guided_bdpt` with the definition, as [`check`] does for `bdpt`.
/// `lend` calls a function with the context, which has no shared data.
pub fn check_guided_bdpt(
    lend: impl Fn(&mut dyn FnMut(&Context)) + Sync,
    samples: u64,
    seed: u64,
) -> OracleReport {
    let shared = first_iteration(&lend, bidirectional::ROW.sharing, seed);
    let mut report = OracleReport::default();
    lend(&mut |context| {
        let context = &Context {
            shared: shared.as_deref(),
            ..*context
        };
        let guide = Some(Guide::new(context));
        report = check_single(context, (GuidedDirections, guide), samples, seed);
    });
    report
}

/// Compares samples that trace both subpaths of their own, of which those of the camera continue in
/// the given directions, with the definition by the guide.
fn check_single(
    context: &Context,
    (directions, guide): (impl SubpathDirections, Option<Guide>),
    samples: u64,
    seed: u64,
) -> OracleReport {
    let mut report = OracleReport::default();
    let mut subpaths = Subpaths::default();
    let rule = Rule {
        heuristic: context.settings.heuristic(),
        counts: StrategyCounts::ONE_EACH,
        guide,
    };
    for_each_sample(context, samples, seed, |pixel, sampler| {
        let visit = &mut |found: ConnectedPath| report.compare(context, &rule, None, &found);
        single::for_each_path(context, directions, pixel, sampler, &mut subpaths, visit);
    });
    report
}

/// Compares `samples` samples of an iteration of `vcm` with the definition, as [`check`] does for
/// `bdpt`. `lend` calls a function with the context, which has no shared data.
pub fn check_vcm(
    lend: impl Fn(&mut dyn FnMut(&Context)) + Sync,
    samples: u64,
    seed: u64,
) -> OracleReport {
    let shared = first_iteration(&lend, vcm::ROW.sharing, seed);
    let mut report = OracleReport::default();
    let mut buffers = vcm::Buffers::default();
    lend(&mut |context| {
        let context = &Context {
            shared: shared.as_deref(),
            ..*context
        };
        let SharedVertices { paths, counts, .. } = context.shared();
        let rule = Rule {
            heuristic: context.settings.heuristic(),
            counts: *counts,
            guide: None,
        };
        for_each_sample(context, samples, seed, |pixel, sampler| {
            vcm::for_each_path(context, pixel, sampler, &mut buffers, &mut |found| {
                report.compare(context, &rule, Some(paths), &found);
            });
        });
    });
    report
}

/// Compares `samples` samples of an iteration of `lvc` with the definition, as [`check_vcm`] does
/// for `vcm`.
pub fn check_lvc(
    lend: impl Fn(&mut dyn FnMut(&Context)) + Sync,
    samples: u64,
    seed: u64,
) -> OracleReport {
    let shared = first_iteration(&lend, lvc::ROW.sharing, seed);
    let mut report = OracleReport::default();
    let mut buffers = lvc::Buffers::default();
    lend(&mut |context| {
        let context = &Context {
            shared: shared.as_deref(),
            ..*context
        };
        let LightVertexCache { paths, counts, .. } = context.shared();
        let rule = Rule {
            heuristic: context.settings.heuristic(),
            counts: *counts,
            guide: None,
        };
        for_each_sample(context, samples, seed, |pixel, sampler| {
            lvc::for_each_path(context, pixel, sampler, &mut buffers, &mut |found| {
                report.compare(context, &rule, Some(paths), &found);
            });
        });
    });
    report
}

/// Returns the data that the samples of the first iteration share, computed in one thread.
fn first_iteration(
    lend: &(impl Fn(&mut dyn FnMut(&Context)) + Sync),
    sharing: Option<Sharing>,
    seed: u64,
) -> Option<Box<Shared>> {
    let Sharing { prepare, begin, .. } = sharing?;
    let resources = Resources {
        seed,
        sampler: INDEPENDENT,
        each: false,
        workers: &OneThread(lend),
    };
    Some(begin(&Iteration {
        index: 0,
        resources,
        prepared: &*prepare(&resources),
    }))
}

/// The calling thread, with the function that lends a context.
struct OneThread<'a, F>(&'a F);

impl<F: Fn(&mut dyn FnMut(&Context)) + Sync> Workers for OneThread<'_, F> {
    fn for_each(&self, count: usize, work: &(dyn Fn(&Context, usize) + Sync)) {
        (self.0)(&mut |context| (0..count).for_each(|index| work(context, index)));
    }
}

/// Visits pixels and samplers of samples, distributed randomly over the picture.
fn for_each_sample(
    context: &Context,
    samples: u64,
    seed: u64,
    mut visit: impl FnMut([u32; 2], &mut Sampler),
) {
    let [width, height] = context.camera.resolution();
    for sample in 0..samples {
        let [x, y, ..] = pcg4d([
            sample as u32,
            (sample >> 32) as u32,
            seed as u32,
            (seed >> 32) as u32,
        ]);
        let pixel = [x % width, y % height];
        visit(pixel, &mut Sampler::new(seed, pixel, sample));
    }
}

impl OracleReport {
    /// Compares one path with the definition and updates the report.
    fn compare(
        &mut self,
        context: &Context,
        rule: &Rule,
        shared: Option<&LightPaths>,
        found: &ConnectedPath,
    ) {
        let Some(path) = Path::new(context, shared, found) else {
            return;
        };
        let expected = path.weights(context, rule);
        let fast = fast_weights(context, rule, &path);
        self.paths += 1;
        let sum_error = (fast.sum() - 1.0).abs();
        if matches!(found.shared, Some(SharedVertex::Merged(_))) {
            self.rough_merged_sums += u64::from(sum_error.is_nan() || sum_error > TOLERANCE);
            self.compare_merged(context, rule, found, (&path, &expected));
            return;
        }
        self.worst_sum = worst(self.worst_sum, sum_error);
        for (fast, expected) in fast.merges.iter().zip(&expected.merges) {
            if *expected > 0.0 || *fast > 0.0 {
                let error = (fast / expected - 1.0).abs();
                self.worst_merge_weight = worst(self.worst_merge_weight, error);
                self.rough_merge_weights += u64::from(error.is_nan() || error > TOLERANCE);
            }
        }
        let (s, t) = (found.contribution.s as usize, found.contribution.t as usize);
        let weight = if context.settings.unweighted() {
            f64::NAN
        } else {
            expected.connections[s]
        };
        let weight_error = (found.weight / weight - 1.0).abs();
        let density_error = match path.contribution(context) {
            None => {
                self.dirac_paths += 1;
                0.0
            }
            Some(carried) => {
                // The estimate is divided by the number of samples, which drawing replaces by the
                // actual one.
                let actual = found.samples / rule.counts.of(s as u32, t as u32);
                let p = path.densities(context, rule).connections[s] * actual;
                let estimated = found.contribution.unweighted.as_dvec3() * p;
                (estimated - carried).abs().max_element() / carried.abs().max_element()
            }
        };
        self.rough_weights += u64::from(weight_error.is_nan() || weight_error > TOLERANCE);
        self.rough_densities += u64::from(density_error.is_nan() || density_error > TOLERANCE);
        self.coarse_densities += u64::from(density_error.is_nan() || density_error > COARSE);
        self.worst_weight = worst(self.worst_weight, weight_error);
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

    /// Compares the weight and the density of a path that merging found with those of the path
    /// through the vertex of the camera subpath.
    fn compare_merged(
        &mut self,
        context: &Context,
        rule: &Rule,
        found: &ConnectedPath,
        (path, expected): (&Path, &ByStrategy),
    ) {
        let s = found.contribution.s as usize;
        if self.merges.len() <= s {
            self.merges.resize(s + 1, 0);
        }
        self.merges[s] += 1;
        self.merged_weights
            .push((found.weight / expected.merges[s] - 1.0).abs());
        if let Some(carried) = path.contribution(context) {
            let p = path.densities(context, rule).merges[s];
            let estimated = found.contribution.unweighted.as_dvec3() * p;
            let error = (estimated - carried).abs().max_element() / carried.abs().max_element();
            self.merged_densities.push(error);
        } else {
            self.dirac_paths += 1;
        }
    }
}

/// Returns the greater of two errors; NaN counts as infinite.
fn worst(a: f64, b: f64) -> f64 {
    if b.is_nan() { f64::INFINITY } else { a.max(b) }
}
