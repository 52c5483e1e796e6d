//! Corners of triangles in the sheared space of one ray per lane, for
//! [`intersect_sheared`](crate::cpu::bvh::intersect_lanes::intersect_sheared). They are sheared once
//! per group of rays, also if triangles share them.

use lumbre_light::math::real::{Mask, Real, Vector};

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

/// Returns the sheared corners of a triangle.
#[inline(always)]
pub(super) fn corners_of<R>(sheared: &[[R; 3]], [a, b, c]: [u8; 3]) -> [&[R; 3]; 3] {
    [
        &sheared[usize::from(a)],
        &sheared[usize::from(b)],
        &sheared[usize::from(c)],
    ]
}
