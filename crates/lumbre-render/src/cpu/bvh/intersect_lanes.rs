//! One ray per lane: loading, and the watertight triangle test; the vectorised counterpart of
//! [`intersect::triangle`](super::intersect::triangle), with the same bits.

use lumbre_light::math::real::{Mask, Real};
use lumbre_light::math::simd::{F32x8, Lanes, active_lanes};
use lumbre_light::transport::ray::Ray;

/// Candidate hit in each lane; `t` is infinite without one. The barycentric weights are `v /
/// divisor` and `w / divisor`. They are divided only for the nearest hit, since few candidates
/// become one.
#[derive(Clone, Copy)]
pub struct Candidates<R: Real> {
    /// Distance to the triangle.
    pub t: R,
    /// Weight of the second corner, times `divisor`.
    pub v: R,
    /// Weight of the third corner, times `divisor`.
    pub w: R,
    /// Sum of the three undivided weights.
    pub divisor: R,
}

/// Intersects rays with a triangle, given by its corners in the sheared space of each ray. Rays
/// that travel `TOGETHER` often all miss, and are not tested further then; of others usually some hit,
/// and a mispredicted branch costs more than the rest of the test.
#[inline(always)]
pub fn intersect_sheared<R: Lanes<N>, const N: usize, const TOGETHER: bool>(
    corners: [&[R; 3]; 3],
) -> Candidates<R> {
    let zero = R::splat(0.0);
    let [a, b, c] = corners;
    let (a, b, c) = (*a, *b, *c);
    let (mut u, mut v, mut w) = (edge(c, b), edge(a, c), edge(b, a));
    let on_edge = Real::eq(u, zero) | Real::eq(v, zero) | Real::eq(w, zero);
    if on_edge.any() {
        let mut edges = [u.store(), v.store(), w.store()];
        let sheared = [
            [a[0].store(), a[1].store()],
            [b[0].store(), b[1].store()],
            [c[0].store(), c[1].store()],
        ];
        recompute_in_f64(&mut edges, &sheared, on_edge.bits());
        (u, v, w) = (R::load(&edges[0]), R::load(&edges[1]), R::load(&edges[2]));
    }
    let outside = u.min(v).min(w).lt(zero) & u.max(v).max(w).gt(zero);
    let det = u + v + w;
    if TOGETHER && !(!outside).any() {
        return Candidates {
            t: R::splat(f32::INFINITY),
            v,
            w,
            divisor: det,
        };
    }
    let t = (u * a[2] + v * b[2] + w * c[2]) / det;
    Candidates {
        t: R::select(!outside & t.gt(zero), t, R::splat(f32::INFINITY)),
        v,
        w,
        divisor: det,
    }
}

/// Returns twice the signed area of the triangle between the ray and an edge, as seen along the
/// ray.
#[inline(always)]
fn edge<R: Real>(p: [R; 3], q: [R; 3]) -> R {
    p[0] * q[1] - p[1] * q[0]
}

/// Recomputes the edge functions of the given lanes in double precision.
#[cold]
#[inline(never)]
fn recompute_in_f64<const N: usize>(
    edges: &mut [[f32; N]; 3],
    [a, b, c]: &[[[f32; N]; 2]; 3],
    lanes: u32,
) {
    for lane in active_lanes(lanes) {
        let edge = |p: &[[f32; N]; 2], q: &[[f32; N]; 2]| {
            let lane_of = |row: &[f32; N]| f64::from(row[lane]);
            (lane_of(&p[0]) * lane_of(&q[1]) - lane_of(&p[1]) * lane_of(&q[0])) as f32
        };
        (edges[0][lane], edges[1][lane], edges[2][lane]) = (edge(c, b), edge(a, c), edge(b, a));
    }
}

/// Loads up to one ray per lane: the components of the origins, of the directions, and the greatest
/// distances. Lanes without a ray are zero.
#[inline(always)]
pub(in crate::cpu) fn load_rays<R: Lanes<N>, const N: usize>(
    rays: &[(Ray, f32)],
) -> ([R; 3], [R; 3], R) {
    let mut rows = [F32x8::default(); N];
    for (row, (Ray { origin: o, dir: d }, t_max)) in rows.iter_mut().zip(rays) {
        *row = F32x8([o.x, o.y, o.z, d.x, d.y, d.z, *t_max, 0.0]);
    }
    let [ox, oy, oz, dx, dy, dz, t_max, _] = R::transpose_load(rows.each_ref());
    ([ox, oy, oz], [dx, dy, dz], t_max)
}
