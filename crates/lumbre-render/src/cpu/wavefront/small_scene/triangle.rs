//! Watertight triangle test of one ray per lane; the vectorised counterpart of
//! `bvh::intersect::triangle`, with the same bits. Corners are sheared once per group of rays, also
//! if triangles share them.

use super::nearest::Candidates;
use lumbre_light::math::real::{Mask, Real, Vector};
use lumbre_light::math::simd::{Lanes, active_lanes};

/// Per-ray setup of the triangle test; the vectorised counterpart of `ShearedRay`.
pub(super) struct ShearedRays<R: Real> {
    origin: R::Vec3,
    /// Lanes in which x is the largest component of the direction, and lanes in which y is.
    dominant: [R::Mask; 2],
    /// Lanes in which the two other axes are swapped.
    swapped: R::Mask,
    shear: [R; 3],
}

/// Number of corners up to which sheared corners are stored on the stack. Zeroing this array costs
/// less than allocating aligned memory for every few hundred rays: `nee` is 1.05 times as fast
/// (docs/notes/cpu.md).
const STACK_CORNERS: usize = 32;

/// Buffer of the sheared corners of a group of rays.
pub(super) struct CornerBuffer<R> {
    stack: [[R; 3]; STACK_CORNERS],
    heap: Vec<[R; 3]>,
}

impl<R: Real> CornerBuffer<R> {
    /// Creates a buffer; the part on the stack is zeroed.
    #[inline(always)]
    pub(super) fn new() -> CornerBuffer<R> {
        CornerBuffer {
            stack: [[R::splat(0.0); 3]; STACK_CORNERS],
            heap: Vec::new(),
        }
    }

    /// Returns space for `corners` corners.
    #[inline(always)]
    pub(super) fn for_corners(&mut self, corners: usize) -> &mut [[R; 3]] {
        if corners > STACK_CORNERS {
            self.heap.resize(corners, [R::splat(0.0); 3]);
            return &mut self.heap;
        }
        &mut self.stack[..corners]
    }
}

impl<R: Real> ShearedRays<R> {
    /// Computes the setup of rays with these origins and directions.
    #[inline(always)]
    pub(super) fn new(origin: R::Vec3, dir: R::Vec3) -> ShearedRays<R> {
        let (x, y, z) = (dir.x().abs(), dir.y().abs(), dir.z().abs());
        let along_x = x.ge(y) & x.ge(z);
        let dominant = [along_x, !along_x & y.ge(z)];
        let none = R::Mask::splat(false);
        let [kx, ky, kz] = permuted::<R>(dir, dominant, none);
        let swapped = kz.lt(R::splat(0.0));
        let (kx, ky) = (R::select(swapped, ky, kx), R::select(swapped, kx, ky));
        let inverse = R::splat(1.0) / kz;
        ShearedRays {
            origin,
            dominant,
            swapped,
            shear: [kx * inverse, ky * inverse, inverse],
        }
    }

    /// Returns a corner relative to the ray origins, sheared and scaled along the rays.
    #[inline(always)]
    pub(super) fn corner(&self, corner: R::Vec3) -> [R; 3] {
        let [x, y, z] = permuted::<R>(corner - self.origin, self.dominant, self.swapped);
        [
            x - z * self.shear[0],
            y - z * self.shear[1],
            z * self.shear[2],
        ]
    }

    /// Intersects the rays with a triangle, given by its sheared corners. There is no early exit if
    /// all lanes miss: usually some hit, and a mispredicted branch costs more than the rest of the
    /// test.
    #[inline(always)]
    pub(super) fn triangle<const N: usize>(&self, corners: [&[R; 3]; 3]) -> Candidates<R>
    where
        R: Lanes<N>,
    {
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
        let t = (u * a[2] + v * b[2] + w * c[2]) / det;
        Candidates {
            t: R::select(!outside & t.gt(zero), t, R::splat(f32::INFINITY)),
            v,
            w,
            divisor: det,
        }
    }
}

/// Returns the components permuted so that the largest component of the ray's direction is last.
/// The other two are swapped where `swapped` is set.
#[inline(always)]
fn permuted<R: Real>(v: R::Vec3, [along_x, along_y]: [R::Mask; 2], swapped: R::Mask) -> [R; 3] {
    let (x, y, z) = (v.x(), v.y(), v.z());
    let last = R::select(along_x, x, R::select(along_y, y, z));
    let first = R::select(along_x, y, R::select(along_y, z, x));
    let second = R::select(along_x, z, R::select(along_y, x, y));
    [
        R::select(swapped, second, first),
        R::select(swapped, first, second),
        last,
    ]
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

/// Returns the sheared corners of a triangle.
#[inline(always)]
pub(super) fn corners_of<R>(sheared: &[[R; 3]], [a, b, c]: [u8; 3]) -> [&[R; 3]; 3] {
    [
        &sheared[usize::from(a)],
        &sheared[usize::from(b)],
        &sheared[usize::from(c)],
    ]
}
