//! Data that the samples of an iteration share.
//!
//! An iteration renders one sample of every pixel: iteration `i` has the samples with index `i`. An
//! integrator whose samples [share data](super::IntegratorRow::sharing) computes them before the
//! samples of each iteration, from paths that belong to no pixel: photons, vertices of
//! [light subpaths](light_paths). All samples of the iteration read them through
//! [`Context::shared`]. What is the same in all iterations, such as the radius of the first one, is
//! prepared once for each job. Where later iterations learn from the samples of earlier ones, these
//! are [recorded] while their iteration begins.
//!
//! Invariant: shared data are a function of the scene, the job, its seed and the index of the
//! iteration alone, never of earlier iterations. Pictures therefore have the same bits for any
//! number of threads and any split into waves, a checkpoint needs nothing besides the film, and
//! films of consecutive ranges of samples add up to the film of the whole. A method that shrinks a
//! radius or grows a tree from one iteration to the next computes it from the index.

pub mod light_batch;
pub mod light_paths;
pub mod photon_map;
pub mod recorded;

use std::sync::OnceLock;

use self::light_batch::{LightBatch, LightUnit};
use self::recorded::{CameraBatch, RecordedPaths, RecordedSamples};
use super::context::Context;
pub use super::context::Shared;
use super::settings::Settings;
use crate::math::rng::pcg4d;
use crate::transport::MAX_SURVIVAL;
use crate::transport::contribution::Contribution;
use crate::transport::sampler::{Sampler, SamplerRow};

/// Computes what all iterations of a job need.
pub type PrepareFn = fn(&Resources) -> Box<Shared>;

/// Computes the data of an iteration.
pub type BeginFn = fn(&Iteration) -> Box<Shared>;

/// The functions by which the samples of an integrator share data.
#[derive(Clone, Copy, Debug)]
pub struct Sharing {
    /// Computes what all iterations of a job need, once when the job is opened.
    pub prepare: PrepareFn,
    /// Computes the data of an iteration.
    pub begin: BeginFn,
    /// Upper bound of the bytes that a vertex of a light subpath takes while an iteration begins
    /// and is rendered.
    pub vertex_bytes: usize,
    /// Greatest number of paths whose vertices are in memory at a time; `None` for all of an
    /// iteration.
    pub batch: Option<u64>,
    /// Returns an upper bound of the bytes that do not depend on the number of paths.
    pub fixed_bytes: fn(&Settings) -> u64,
    /// Returns the index of the iteration from which on all share the same data, so that their
    /// samples can be rendered at once; `None` if each has its own.
    pub constant_from: Option<fn(&Settings) -> u64>,
    /// Returns the samples of an iteration that were rendered while its data were computed, where
    /// there are any.
    pub recorded: Option<RecordedFn>,
}

/// Returns the samples that were rendered while an iteration began; `None` if they still have to be.
pub type RecordedFn = fn(&Shared) -> Option<&RecordedSamples>;

/// Size of a job's paths, for bounds of memory.
#[derive(Clone, Copy, Debug)]
pub struct PathSize {
    /// Number of pixels of the picture.
    pub pixels: u64,
    /// Greatest number of edges of a path.
    pub max_depth: u32,
    /// First edge after which Russian roulette may end a path; `None` without it.
    pub rr_start: Option<u32>,
    /// Whether films need the contributions of a sample one by one: see [`Resources::each`].
    pub each: bool,
}

impl Sharing {
    /// Returns an upper bound of the bytes that the data of an iteration take. Where Russian roulette
    /// ends subpaths, it bounds their expected number of vertices: after it starts, at most
    /// `1 / (1 - MAX_SURVIVAL)` follow on average.
    pub fn bytes(&self, settings: &Settings, size: &PathSize) -> u64 {
        let paths = settings.light_paths(size.pixels);
        let paths = paths.min(self.batch.unwrap_or(u64::MAX));
        let after = (1.0 / (1.0 - f64::from(MAX_SURVIVAL))).ceil() as u32;
        let by_roulette = size
            .rr_start
            .map_or(u32::MAX, |start| start.saturating_add(after));
        let vertices = size.max_depth.saturating_sub(1).min(by_roulette) as usize;
        let of_path = light_batch::PATH_BYTES + vertices * self.vertex_bytes;
        // A vertex adds light at most twice, and so does the end of the path.
        let light = (vertices + 1) * 2 * size_of::<Contribution>();
        let of_sample = match self.recorded {
            None => 0,
            Some(_) if size.each => RecordedSamples::BYTES + light,
            Some(_) => RecordedSamples::BYTES,
        };
        let fixed = (self.fixed_bytes)(settings);
        let paths = paths.saturating_mul(of_path as u64);
        let samples = size.pixels.saturating_mul(of_sample as u64);
        fixed.saturating_add(paths).saturating_add(samples)
    }
}

/// Column and row that key the random numbers of paths that belong to no pixel. No picture is that
/// large.
pub const NO_PIXEL: [u32; 2] = [u32::MAX; 2];

/// Word that keys the seeds of training paths.
const TRAINING: u32 = 0x7472_6169;

/// Column and row that key the random numbers of paths from which a job is prepared.
pub const PREPARED: [u32; 2] = [u32::MAX - 1; 2];

/// The threads that a renderer lends to [`BeginFn`].
pub trait Workers: Sync {
    /// Calls `work` once for each index below `count`, on all threads and in any order. While an
    /// iteration [begins](BeginFn) that is no longer wanted, any indices may be left out; its data
    /// are then dropped unread.
    fn for_each(&self, count: usize, work: &(dyn Fn(&Context, usize) + Sync));

    /// Traces light subpaths in the calling thread, with the context of a call of `work`. A renderer
    /// may trace many at a time; vertices have the same bits either way.
    fn trace_light(&self, context: &Context, batch: &LightBatch) -> LightUnit {
        batch.trace_single(context)
    }

    /// Traces camera paths in the calling thread, many at a time. Returns `None` if the renderer
    /// cannot; records have the same bits as those of [`CameraBatch::follow`].
    fn trace_camera(&self, context: &Context, batch: &CameraBatch) -> Option<RecordedPaths> {
        let _ = (context, batch);
        None
    }
}

/// Threads and random numbers for paths that belong to no pixel.
#[derive(Clone, Copy)]
pub struct Resources<'a> {
    /// Seed of the run.
    pub seed: u64,
    /// Generator of random numbers.
    pub sampler: &'static SamplerRow,
    /// Whether films need the contributions of a sample one by one: for layers, or for a time axis.
    pub each: bool,
    /// Threads of the renderer.
    pub workers: &'a dyn Workers,
}

/// An iteration that begins.
#[derive(Clone, Copy)]
pub struct Iteration<'a> {
    /// Index of the iteration: that of its samples.
    pub index: u64,
    /// Threads and random numbers.
    pub resources: Resources<'a>,
    /// Result of [`Sharing::prepare`] for the job.
    pub prepared: &'a Shared,
}

impl Resources<'_> {
    /// Returns the seed of training paths that no earlier number of a sequence may influence. Such
    /// numbers are independent of those of the samples, and of those of other `part`s of training.
    pub fn training_seed(&self, part: u32) -> u64 {
        let words = [self.seed as u32, (self.seed >> 32) as u32, TRAINING, part];
        let [low, high, ..] = pcg4d(words);
        u64::from(high) << 32 | u64::from(low)
    }

    /// Returns the results of `work` for each index below `count`, in the order of the indices. The
    /// calls are distributed over all threads. Fewer results come back from an iteration that is no
    /// longer wanted: see [`Workers::for_each`].
    pub fn map<T: Send + Sync>(
        &self,
        count: usize,
        work: impl Fn(&Context, usize) -> T + Sync,
    ) -> Vec<T> {
        let results: Vec<OnceLock<T>> = (0..count).map(|_| OnceLock::new()).collect();
        self.workers.for_each(count, &|context, index| {
            results[index].get_or_init(|| work(context, index));
        });
        results
            .into_iter()
            .filter_map(OnceLock::into_inner)
            .collect()
    }
}

impl<'a> Iteration<'a> {
    /// Returns the results of `work` for each index below `count`: see [`Resources::map`].
    pub fn map<T: Send + Sync>(
        &self,
        count: usize,
        work: impl Fn(&Context, usize) -> T + Sync,
    ) -> Vec<T> {
        self.resources.map(count, work)
    }

    /// Returns the result of [`Sharing::prepare`].
    ///
    /// # Panics
    /// Panics if it is of another type.
    pub fn prepared<T: 'static>(&self) -> &'a T {
        let data = self.prepared.downcast_ref();
        data.expect("the job was prepared for another integrator")
    }

    /// Returns the random numbers of a path that belongs to no pixel, one of `paths` in each
    /// iteration. All such paths of a run are samples of one sequence, so that Sobol's sequence
    /// stratifies those of an iteration.
    pub fn path_sampler(&self, path: u64, paths: u64) -> Sampler {
        let Resources { seed, sampler, .. } = self.resources;
        sampler.start(seed, NO_PIXEL, self.sample(path, paths))
    }

    /// Returns the index of the sample of a path that belongs to no pixel, one of `paths`.
    fn sample(&self, path: u64, paths: u64) -> u64 {
        self.index.wrapping_mul(paths).wrapping_add(path)
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;

    #[test]
    fn bytes_follow_the_number_of_vertices_that_paths_can_have() {
        let sharing = Sharing {
            prepare: |_| Box::new(()),
            begin: |_| Box::new(()),
            vertex_bytes: 100,
            batch: None,
            fixed_bytes: |_| 0,
            constant_from: None,
            recorded: None,
        };
        let automatic = Settings::new(&BTreeMap::new());
        let given = Settings {
            photons: Some(7),
            ..automatic
        };
        let path = light_batch::PATH_BYTES as u64;
        let size = |max_depth, rr_start| PathSize {
            pixels: 50,
            max_depth,
            rr_start,
            each: false,
        };
        let bytes = |settings, depth, rr| sharing.bytes(settings, &size(depth, rr));
        assert_eq!(bytes(&automatic, 1, None), 50 * path);
        assert_eq!(bytes(&automatic, 9, None), 50 * (path + 800));
        assert_eq!(bytes(&given, 9, None), 7 * (path + 800));
        // Three vertices before roulette, and 20 after it.
        assert_eq!(bytes(&given, 10_000, Some(3)), 7 * (path + 2300));
        assert_eq!(bytes(&given, 4, Some(3)), 7 * (path + 300));
        let batched = Sharing {
            batch: Some(5),
            fixed_bytes: |settings| settings.guiding.tree_bytes(),
            ..sharing
        };
        let fixed = automatic.guiding.tree_bytes();
        let shared = fixed + 5 * (path + 800);
        assert_eq!(batched.bytes(&given, &size(9, None)), shared);
        // Samples of 50 pixels, each added up or as up to 18 contributions.
        let recording = Sharing {
            recorded: Some(|_| None),
            ..batched
        };
        let sample = RecordedSamples::BYTES as u64;
        let summed = recording.bytes(&given, &size(9, None));
        assert_eq!(summed, shared + 50 * sample);
        let each = PathSize {
            each: true,
            ..size(9, None)
        };
        let light = 18 * size_of::<Contribution>() as u64;
        assert_eq!(recording.bytes(&given, &each), summed + 50 * light);
    }
}
