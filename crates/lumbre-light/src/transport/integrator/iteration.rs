//! Data that the samples of an iteration share.
//!
//! An iteration renders one sample of every pixel: iteration `i` has the samples with index `i`. An
//! integrator with a function [`IntegratorRow::begin`](super::IntegratorRow::begin) computes data
//! before the samples of each iteration, from paths that belong to no pixel: photons, vertices of
//! light subpaths. All samples of the iteration read them through [`Context::shared`].
//!
//! Invariant: shared data are a function of the scene, the job, its seed and the index of the
//! iteration alone, never of earlier iterations. Pictures therefore have the same bits for any
//! number of threads and any split into waves, a checkpoint needs nothing besides the film, and
//! films of consecutive ranges of samples add up to the film of the whole. A method that shrinks a
//! radius or grows a tree from one iteration to the next computes it from the index.

use std::any::Any;
use std::sync::OnceLock;

use super::Context;
use crate::transport::sampler::{Sampler, SamplerRow};

/// Data that all samples of an iteration read; integrators recover the type by
/// [`Context::shared`].
pub type Shared = dyn Any + Send + Sync;

/// Computes the data of an iteration.
pub type BeginFn = fn(&Iteration) -> Box<Shared>;

/// Column and row that key the random numbers of paths that belong to no pixel. No picture is that
/// large.
const NO_PIXEL: [u32; 2] = [u32::MAX; 2];

/// The threads that a renderer lends to [`BeginFn`].
pub trait Workers: Sync {
    /// Calls `work` once for each index below `count`, on all threads and in any order.
    fn for_each(&self, count: usize, work: &(dyn Fn(&Context, usize) + Sync));
}

/// An iteration that begins.
#[derive(Clone, Copy)]
pub struct Iteration<'a> {
    /// Index of the iteration: that of its samples.
    pub index: u64,
    /// Seed of the run.
    pub seed: u64,
    /// Generator of random numbers.
    pub sampler: &'static SamplerRow,
    /// Threads of the renderer.
    pub workers: &'a dyn Workers,
}

impl Iteration<'_> {
    /// Returns the results of `work` for each index below `count`, in the order of the indices. The
    /// calls are distributed over all threads.
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

    /// Returns the random numbers of a path that belongs to no pixel, one of `paths` in each
    /// iteration. All such paths of a run are samples of one sequence, so that Sobol's sequence
    /// stratifies those of an iteration.
    pub fn path_sampler(&self, path: u64, paths: u64) -> Sampler {
        let sample = self.index.wrapping_mul(paths).wrapping_add(path);
        self.sampler.start(self.seed, NO_PIXEL, sample)
    }
}

impl<'a> Context<'a> {
    /// Returns the data that the integrator computed for this iteration.
    ///
    /// # Panics
    /// Panics if the renderer did not begin the iteration, or if the data are of another type.
    pub fn shared<T: 'static>(&self) -> &'a T {
        let data = self.shared.and_then(|shared| shared.downcast_ref());
        data.expect("the data of the iteration were not computed")
    }
}
