//! Loads vertices and samplers of subpaths into lanes.

use crate::cpu::wavefront::bdpt::vertices::Vertices;
use crate::cpu::wavefront::bdpt::{TileContext, TileSubpaths, VertexRecord};
use lumbre_light::math::real::{Real, Vector};
use lumbre_light::math::simd::{Lanes, map_array};
use lumbre_light::transport::integrator::bdpt::weights::{MisEndpoint, MisPartials};
use lumbre_light::transport::path_time::OpticalLength;
use lumbre_light::transport::surface::SurfacePoint;

/// Vertices in all lanes, with the throughput and MIS terms of their paths.
pub(super) struct LoadedVertices<R: Real> {
    pub vertices: Vertices<R>,
    pub throughput: R::Vec3,
    pub endpoint: MisEndpoint<R>,
}

/// Loads surface points, directions to the previous vertices, throughputs, and MIS terms.
#[inline(always)]
pub(super) fn load_records<R: Lanes<N>, const N: usize>(
    records: [&VertexRecord; N],
) -> (SurfacePoint<R::Vec3>, R::Vec3, R::Vec3, MisEndpoint<R>) {
    let a = R::transpose_load(map_array(records, |record| &record.rows[0]));
    let b = R::transpose_load(map_array(records, |record| &record.rows[1]));
    let last = R::load(&map_array(records, |record| record.rows[2].0[0]));
    let (d_vcm, d_vc) = (
        map_array(records, |record| record.partials[0]),
        map_array(records, |record| record.partials[1]),
    );
    let point = SurfacePoint {
        position: R::Vec3::new(a[0], a[1], a[2]),
        n_geometric: R::Vec3::new(a[3], a[4], a[5]),
        n_shading: R::Vec3::new(b[0], b[1], b[2]),
    };
    let partials = MisPartials {
        d_vcm: R::load_doubles(&d_vcm),
        d_vc: R::load_doubles(&d_vc),
    };
    (
        point,
        R::Vec3::new(b[3], b[4], b[5]),
        R::Vec3::new(b[6], b[7], last),
        MisEndpoint {
            partials,
            back: a[6],
        },
    )
}

/// Loads the optical lengths of paths at these vertices.
#[inline(always)]
pub(super) fn optical_lengths<R: Lanes<N>, const N: usize>(
    records: [&VertexRecord; N],
) -> OpticalLength<R> {
    let [_, path, delays, index, ..] =
        R::transpose_load(map_array(records, |record| &record.rows[2]));
    OpticalLength {
        path,
        delays,
        delay: R::splat(0.0),
        index,
    }
}

/// Loads vertices on surfaces of one class. `visible` is unset outside `active`.
#[inline(always)]
pub(super) fn load_vertices<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    records: [&VertexRecord; N],
    active: R::Mask,
) -> LoadedVertices<R> {
    let (point, wo, throughput, endpoint) = load_records::<R, N>(records);
    let bsdfs = map_array(records, |record| &tile.table.bsdfs[record.material()]);
    LoadedVertices {
        vertices: Vertices::<R>::new(point, wo, bsdfs, &tile.table.traits(class), active),
        throughput,
        endpoint,
    }
}

/// Loads the sampler keys of paths.
#[inline(always)]
pub fn sampler_keys<R: Lanes<N>, const N: usize>(
    paths: &TileSubpaths,
    ids: [u32; N],
) -> [R::Word; 4] {
    let [.., a, b, c, d] =
        R::transpose_load(map_array(ids, |path| &paths.states[path as usize].rows[2]));
    [a.bits(), b.bits(), c.bits(), d.bits()]
}

/// Loads one integer per lane.
#[inline(always)]
pub fn load_words<R: Lanes<N>, const N: usize>(ids: [u32; N]) -> R::Word {
    R::load(&map_array(ids, f32::from_bits)).bits()
}
