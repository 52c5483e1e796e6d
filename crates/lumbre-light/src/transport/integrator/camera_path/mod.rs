//! Techniques that follow paths from the camera and add light at their vertices.
//!
//! A technique is a type with two functions, generic over the width of vectors: what happens at the
//! surfaces that edges hit, and what happens where they leave the scene ([`CameraPaths`]). It does
//! not determine how many paths are traced at a time: [`sample`] follows one path after the other,
//! and the renderer of the CPU follows thousands, sorted by class of surface between two steps.
//!
//! Light is passed to a [`PathSink`]: at once, or on condition that a shadow ray is not blocked,
//! which the sink traces when it likes.

mod single;
mod state;
mod walk;

pub use single::{follow, needs_ray, sample, unoccluded};
pub use state::{
    Path, PathRecord, PathState, SPECULAR, SamplerRecord, SamplerState, TerminatorRecord,
    TerminatorState, TimeRecord, TimeState,
};
pub use walk::edge_counts;

use super::Context;
use crate::math::real::{Real, Vector};
use crate::math::simd::Lanes;
pub use crate::transport::arrival::Arrival;
use crate::transport::vertex::EdgeEnd;

/// A technique that follows paths from the camera.
pub trait CameraPaths: Send + Sync + 'static {
    /// Handles the hits of edge number `edge`, counted from 1: adds light to `sink`, samples the
    /// next edge, and returns the lanes of `lanes` whose path continues. All hits are on surfaces
    /// of one class.
    ///
    /// The number of edges is at most [`Context::max_depth`]: at the last one, paths end.
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask;

    /// Handles paths whose edge number `edge` left the scene: adds light to `sink`.
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    );
}

/// Light that paths found.
#[derive(Clone, Copy)]
pub struct PathLight<R: Real> {
    /// Radiance, already divided by the density with which the path was found.
    pub unweighted: R::Vec3,
    /// Weight of multiple importance sampling.
    pub weight: R,
    /// Number of vertices generated from the light; 0 if the path hit the light by chance.
    pub s: u32,
    /// Number of vertices generated from the camera, including the one on the lens.
    pub t: u32,
    /// Optical length of the path; 0 without a time axis.
    pub length: R::Double,
}

impl<R: Real> PathLight<R> {
    /// Returns the radiance times the weight.
    #[inline(always)]
    pub fn value(&self) -> R::Vec3 {
        self.unweighted * self.weight
    }
}

/// Rays between two points, or into a direction, along which light arrives if nothing is hit.
#[derive(Clone, Copy)]
pub struct ShadowRay<R: Real> {
    /// Start in world space.
    pub origin: R::Vec3,
    /// Unit direction of the ray.
    pub dir: R::Vec3,
    /// Length in scene units, possibly infinite. Points coincide if it is 0, and see each other.
    pub distance: R,
}

impl<R: Real> ShadowRay<R> {
    /// Returns the rays between two points. In the lanes of `infinite` rays go from the first point
    /// in the unit direction `wi`.
    ///
    /// Both ends are moved off their surfaces towards each other, so that neither surface hides the
    /// other point.
    #[inline(always)]
    pub fn between(
        from: EdgeEnd<R>,
        at: EdgeEnd<R>,
        wi: R::Vec3,
        infinite: R::Mask,
    ) -> ShadowRay<R> {
        let edge = at.position - from.position;
        let origin = from.off_surface(R::Vec3::select(infinite, wi, edge));
        let target = at.off_surface(-edge);
        let edge = target - origin;
        let distance = edge.length();
        ShadowRay {
            origin,
            dir: R::Vec3::select(infinite, wi, edge / distance),
            distance: R::select(infinite, R::splat(f32::INFINITY), distance),
        }
    }
}

/// Receives the light that a step finds for the samples' own pixels.
pub trait PathSink<R: Real> {
    /// Adds light in the given lanes.
    fn add(&mut self, lanes: R::Mask, light: &PathLight<R>);

    /// Adds light in the given lanes, unless its ray hits something.
    fn add_unless_occluded(&mut self, lanes: R::Mask, ray: &ShadowRay<R>, light: &PathLight<R>);
}
