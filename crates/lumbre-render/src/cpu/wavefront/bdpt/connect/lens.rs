//! Connections of light vertices to the lens (`t = 1`): projection through the lens, and evaluation
//! at surfaces (`s >= 2`). First vertices (`s = 1`) use the projection in
//! [`ray_generation`](super::super::ray_generation).

use glam::Vec3;

use super::load::{load_vertices, load_words, optical_lengths, sampler_keys};
use super::{LensConnection, ShadowQueue, Target};
use crate::cpu::wavefront::bdpt::shadow_rays::shadow_rays;
use crate::cpu::wavefront::bdpt::{TileContext, TileSubpaths};
use lumbre_light::math::real::{Mask, Real, Vector, Word};
use lumbre_light::math::simd::{Lanes, active_lanes, map_array, padded};
use lumbre_light::transport::bsdf::TransportMode;
use lumbre_light::transport::camera::FilterSpec;
use lumbre_light::transport::camera::lens::Projection;
use lumbre_light::transport::integrator::bdpt::weights::others_t1;
use lumbre_light::transport::sampler::independent;
use lumbre_light::transport::surface::SurfacePoint;
use lumbre_light::transport::vertex::area_factor;

/// Projection of the points in all lanes through the lens onto the film.
pub struct LensProjection<R: Real, const N: usize> {
    pub at: Projection<R::Vec3>,
    /// Pixels that receive the contributions.
    pub pixels: [[u32; 2]; N],
    /// Whether the point is in front of the camera and a pixel receives it.
    pub inside: R::Mask,
    /// Importance of the lens point, as in `CameraConnection::importance`.
    pub importance: R,
}

impl<const TIMED: bool> TileContext<'_, TIMED> {
    /// Returns emission delay plus optical length of the edge to the lens. The edge has length
    /// `distance`, and counts only if the timing settings include it.
    #[inline(always)]
    pub fn lens_path_lengths<R: Lanes<N>, const N: usize>(
        &self,
        ids: [u32; N],
        distance: R,
    ) -> R::Double {
        let emission_delays: R = self
            .emission_delays
            .for_lanes(map_array(ids, |path| path as usize));
        let timing = self.context.timing.filter(|timing| timing.camera);
        let last = timing.map_or(R::splat(0.0), |timing| R::splat(timing.medium) * distance);
        emission_delays.double() + last.double()
    }

    /// Returns the four random numbers that select lens point and pixel, after `taken` numbers were
    /// drawn; zeros if neither needs any.
    #[inline(always)]
    pub fn lens_numbers<R: Lanes<N>, const N: usize>(
        &self,
        paths: &TileSubpaths,
        ids: [u32; N],
        taken: [u32; N],
    ) -> [R; 4] {
        let camera = self.context.camera;
        if !camera.has_lens() && camera.filter() == FilterSpec::PIXEL {
            return [R::splat(0.0); 4];
        }
        let (key, taken) = (sampler_keys::<R, N>(paths, ids), load_words::<R, N>(taken));
        let [a, b, c] = independent::next_three(key, taken);
        let [d, ..] = independent::next_three(key, taken.add(R::Word::splat(3)));
        [a, b, c, d]
    }

    /// Projects the points in the lanes of `wanted` through the lens, and selects the pixels that
    /// receive them.
    #[inline(always)]
    pub fn project_to_film<R: Lanes<N>, const N: usize>(
        &self,
        position: R::Vec3,
        [a, b, c, d]: [R; 4],
        wanted: R::Mask,
    ) -> LensProjection<R, N> {
        let zero = R::splat(0.0);
        let at = self.context.camera.project(position, [a, b]);
        let ahead = wanted & at.ahead;
        let camera = self.context.camera;
        let (mut pixels, mut weights) = ([[0; 2]; N], [0.0; N]);
        if camera.filter() == FilterSpec::PIXEL {
            // Selects the pixel that contains the raster position, as `FilterSpec::choose` does.
            let [width, height] = camera.resolution();
            let (width, height) = (R::splat(width as f32), R::splat(height as f32));
            let [x, y] = at.raster;
            let inside = ahead & x.ge(zero) & x.lt(width) & y.ge(zero) & y.lt(height);
            let [x, y] = [
                x.truncated().bits_to_float().store(),
                y.truncated().bits_to_float().store(),
            ];
            for i in active_lanes(inside.bits()) {
                (pixels[i], weights[i]) = ([x[i].to_bits(), y[i].to_bits()], 1.0);
            }
        } else {
            let inputs =
                R::transpose_store([at.raster[0], at.raster[1], c, d, zero, zero, zero, zero]);
            for i in active_lanes(ahead.bits()) {
                let [x, y, u, v, ..] = inputs[i].0;
                if let Some((pixel, weight)) = camera.choose_pixel([x, y], [u, v]) {
                    (pixels[i], weights[i]) = (pixel, weight);
                }
            }
        }
        let weight = R::load(&weights);
        let importance = weight * at.pdf_w / (at.distance * at.distance);
        LensProjection {
            at,
            pixels,
            inside: ahead & weight.gt(zero),
            importance,
        }
    }
}

/// Evaluates connections of light vertices on surfaces to the lens (`s >= 2`) and appends the
/// contributions to `queue`.
#[inline(always)]
pub(super) fn connect_t1<R: Lanes<N>, const N: usize, const TIMED: bool>(
    tile: &TileContext<TIMED>,
    class: usize,
    group: &[LensConnection],
    light: &TileSubpaths,
    queue: &mut ShadowQueue,
) {
    let connections: [LensConnection; N] = padded(group);
    let active = R::Mask::first(group.len());
    let records = map_array(connections, |c| &light.vertices[c.y as usize]);
    let y = load_vertices::<R, N, TIMED>(tile, class, records, active);
    let SurfacePoint {
        position,
        n_geometric,
        n_shading,
    } = y.vertices.point;
    let numbers = tile.lens_numbers::<R, N>(
        light,
        map_array(connections, |c| c.path),
        map_array(connections, |c| c.taken),
    );
    let LensProjection {
        at,
        pixels,
        inside,
        importance,
    } = tile.project_to_film::<R, N>(position, numbers, y.vertices.visible);
    if !inside.any() {
        return;
    }
    let at_y = y
        .vertices
        .evaluate::<true>(-at.dir, TransportMode::Importance, inside);
    let unweighted = y.throughput * at_y.f * at.dir.dot(n_shading).abs() * importance;
    let lit = inside & !unweighted.same(R::Vec3::broadcast(Vec3::ZERO));
    if !lit.any() {
        return;
    }
    let lens_factor = area_factor(at.lens, position, n_geometric);
    let others = others_t1(tile.h, &y.endpoint, &at_y, [at.pdf_w, lens_factor]);
    let values = tile.mis_weighted::<R, N>(unweighted, others, lit);
    let no_normal = R::Vec3::broadcast(Vec3::ZERO);
    let rays = shadow_rays::<R, N>(
        [position, n_geometric],
        [at.lens, no_normal],
        at.dir,
        R::Mask::splat(false),
    );
    if TIMED {
        let medium = R::splat(tile.context.medium());
        let before =
            optical_lengths::<R, N>(records).from_light(y.vertices.index_ratio(-at.dir), medium);
        let lengths = R::store_doubles(
            tile.lens_path_lengths::<R, N>(map_array(connections, |c| c.path), at.distance)
                + before,
        );
        queue
            .lengths
            .extend(active_lanes(lit.bits()).map(|i| lengths[i]));
    }
    for i in active_lanes(lit.bits()) {
        queue.push(
            &rays[i],
            &values[i],
            Target::Splat(connections[i].path, pixels[i]),
        );
    }
}
