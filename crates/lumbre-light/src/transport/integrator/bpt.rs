//! Path tracing: a path starts at the camera, continues by BSDF sampling (or, for a comparison, in
//! uniform directions), and finds light only by hitting an emitter [Kajiya 1986]. Slow if lights are small, but simple enough to serve
//! as the reference for all other integrators.

use super::camera_path::{self, Arrival, CameraPaths, Path, PathSink};
use super::directions::SurfaceDirections;
use super::{Context, IntegratorRow, nee, settings};
use crate::math::simd::Lanes;
use crate::value::schema::Table;

/// The table entry of this integrator.
pub const ROW: IntegratorRow = IntegratorRow {
    name: "bpt",
    long_name: "path tracing",
    revision: 4,
    doc: "Paths start at the camera and find light only by hitting it [Kajiya 1986].",
    params: Table {
        name: "BptParams",
        doc: "Parameters of `bpt`.",
        fields: &[settings::DIRECTIONS],
    },
    splats: false,
    bias: None,
    sharing: None,
    sample: camera_path::sample::<Bpt>,
};

/// Path tracing that finds light by chance.
pub struct Bpt;

impl CameraPaths for Bpt {
    #[inline(always)]
    fn scatter<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        arrival: &Arrival<R, N>,
        path: &mut Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) -> R::Mask {
        nee::scatter::<R, N, SurfaceDirections<R>, false>(context, edge, arrival, path, lanes, sink)
    }

    #[inline(always)]
    fn escape<R: Lanes<N>, const N: usize>(
        context: &Context,
        edge: u32,
        path: &Path<R>,
        lanes: R::Mask,
        sink: &mut impl PathSink<R>,
    ) {
        nee::escape::<R, N, false>(context, edge, path, lanes, sink);
    }
}
