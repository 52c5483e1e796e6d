//! The clocks of paths in lanes, where a film has a time axis: what [`Flight`](crate::transport::flight::Flight) counts for a
//! path by itself.
//!
//! Where a path went on is in its record, as is the optical length so far, and whether an edge counts depends on its number
//! alone. Scenes with delays go alone: no light is later than it was emitted.

use super::Record;
use crate::math::lanes::{Lanes, each};
use crate::transport::delay::Profile;
use crate::transport::flight::Chance;
use crate::transport::integrator::Context;
use crate::transport::sampler::Sampler;

/// When the light of each sample of a tile was emitted; nothing where that is 0 for all.
#[derive(Default)]
pub(super) struct Emitted(Vec<f32>);

impl Emitted {
    /// For the samples that begin with these records.
    pub fn begin(&mut self, context: &Context, records: &[Record]) {
        self.0.clear();
        if context.timing.is_some_and(|timing| timing.emission != Profile::NONE) {
            let of = |record: &Record| Chance::new::<true>(&Sampler::Independent(record.numbers())).emission(context);
            self.0.extend(records.iter().map(of));
        }
    }

    /// That of one sample.
    #[inline]
    pub fn of(&self, path: usize) -> f32 {
        self.0.get(path).copied().unwrap_or(0.0)
    }

    /// Those of these samples.
    #[inline(always)]
    pub fn of_lanes<R: Lanes<N>, const N: usize>(&self, paths: [usize; N]) -> R {
        if self.0.is_empty() { R::of(0.0) } else { R::load(&each(paths, |i| self.0[i])) }
    }
}

/// Whether edge number `edge` of a path from the camera counts.
#[inline]
pub(super) fn counts(context: &Context, edge: u32) -> bool {
    edge > 1 || context.timing.is_some_and(|t| t.camera)
}
