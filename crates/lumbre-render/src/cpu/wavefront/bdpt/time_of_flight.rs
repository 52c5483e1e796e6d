//! Time of flight of vectorised paths, for films with a time axis; the counterpart of
//! [`lumbre_light::transport::path_time`] for scalar paths.
//!
//! The last vertex and the optical length so far are in the path's record, and whether an edge
//! counts depends only on its number. Scenes with delays at surfaces use the scalar path, so that
//! emission is the only delay here.

use super::camera_rays::CameraRecord;
use lumbre_light::math::simd::{Lanes, map_array};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::integrator::Context;
use lumbre_light::transport::path_time::AuxRng;

/// Emission delays of the samples of a tile, as optical lengths. The list is empty if all are 0.
#[derive(Default)]
pub(super) struct EmissionDelays(Vec<f32>);

impl EmissionDelays {
    /// Samples the emission delays of the samples with these initial records.
    pub fn sample(&mut self, context: &Context, records: &[CameraRecord]) {
        self.0.clear();
        if context
            .timing
            .is_some_and(|timing| timing.emission != Profile::NONE)
        {
            let delay =
                |record: &CameraRecord| AuxRng::new::<true>(&record.sampler()).emission(context);
            self.0.extend(records.iter().map(delay));
        }
    }

    /// Returns the emission delay of one path.
    #[inline]
    pub fn for_path(&self, path: usize) -> f32 {
        self.0.get(path).copied().unwrap_or(0.0)
    }

    /// Returns the emission delays of the paths in all lanes.
    #[inline(always)]
    pub fn for_lanes<R: Lanes<N>, const N: usize>(&self, paths: [usize; N]) -> R {
        if self.0.is_empty() {
            R::splat(0.0)
        } else {
            R::load(&map_array(paths, |i| self.0[i]))
        }
    }
}

/// Returns whether edge number `edge` of a camera path is part of its optical length. Edge 1 starts
/// at the camera, and counts only if the timing settings include it.
#[inline]
pub(super) fn edge_counts(context: &Context, edge: u32) -> bool {
    edge > 1 || context.timing.is_some_and(|t| t.camera)
}
