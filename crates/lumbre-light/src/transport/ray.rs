//! Rays, hits, and the trait of ray intersectors.

use glam::Vec3;

use crate::math::real::{Real, Vector, Word};

/// A ray: a half-line; scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray<V = Vec3> {
    /// Start in world space.
    pub origin: V,
    /// Direction; a unit vector.
    pub dir: V,
}

/// The first intersection of a ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in scene units.
    pub t: f32,
    /// Primitive id: triangles first, spheres after them.
    pub primitive: u32,
    /// Instance of a shared mesh that the triangle belongs to, or
    /// [`NONE`](crate::scene::compile::NONE).
    pub instance: u32,
    /// Barycentric weights of the second and third corner; zero for spheres.
    pub uv: [f32; 2],
}

/// The rays of all lanes with their first intersections.
#[derive(Clone, Copy, Debug)]
pub struct RayHits<R: Real = f32, const N: usize = 1> {
    /// Starts of the rays in world space.
    pub origin: R::Vec3,
    /// Directions; unit vectors.
    pub dir: R::Vec3,
    /// Distances along the rays, in scene units.
    pub t: R,
    /// Barycentric weights of the second and third corner.
    pub uv: [R; 2],
    /// Primitive ids, as in [`Hit`]; valid in every lane.
    pub primitives: [u32; N],
    /// Instances, as in [`Hit`].
    pub instances: [u32; N],
}

impl RayHits {
    /// Returns a ray with its hit.
    #[inline]
    pub fn new(ray: &Ray, hit: &Hit) -> RayHits {
        RayHits {
            origin: ray.origin,
            dir: ray.dir,
            t: hit.t,
            uv: hit.uv,
            primitives: [hit.primitive],
            instances: [hit.instance],
        }
    }
}

/// Intersects rays with a compiled scene, masks included.
pub trait Trace {
    /// Returns the nearest hit with `0 < t < t_max`.
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit>;

    /// Returns whether anything is hit with `0 < t < t_max`.
    fn occluded(&self, ray: &Ray, t_max: f32) -> bool;

    /// Appends [`Trace::closest`] of each ray with its `t_max` to `hits`, in order.
    fn closest_each(&self, rays: &[(Ray, f32)], hits: &mut Vec<Option<Hit>>) {
        hits.extend(rays.iter().map(|(ray, t_max)| self.closest(ray, *t_max)));
    }

    /// Appends [`Trace::occluded`] of each ray with its `t_max` to `hidden`, in order.
    fn occluded_each(&self, rays: &[(Ray, f32)], hidden: &mut Vec<bool>) {
        hidden.extend(rays.iter().map(|(ray, t_max)| self.occluded(ray, *t_max)));
    }
}

/// Moves a point off its surface along `n` just far enough that a ray from there does not hit the
/// surface again; scalar or vectorised. `extent` is the greatest absolute coordinate of the
/// primitive, in scene units.
///
/// The step is a fixed number of units in the last place, so it scales with the coordinates; near
/// the origin, where those units vanish, it is a fixed length [Waechter & Binder 2019]. It is never
/// less than [`EXTENT_SCALE`] of the extent: the rounding errors of intersections and of points
/// depend on the corners of a triangle, and those of a wall through the origin are far away. Of
/// scenes that are smaller than the fixed length suits, with extents below [`NEAR_ORIGIN`], the step
/// near the origin is that share of the extent.
#[inline(always)]
pub fn offset_origin<V: Vector>(p: V, n: V, extent: V::Scalar) -> V {
    let splat = V::Scalar::splat;
    let least = splat(EXTENT_SCALE) * extent;
    let small = extent.lt(splat(NEAR_ORIGIN));
    let near = V::Scalar::select(small, splat(NEAR_ORIGIN) * extent, splat(NEAR_ORIGIN));
    let fixed = V::Scalar::select(small, least, splat(FLOAT_SCALE));
    let axis = |p, n| offset_axis(p, n, [near, fixed, least]);
    V::new(axis(p.x(), n.x()), axis(p.y(), n.y()), axis(p.z(), n.z()))
}

/// Absolute coordinate below which the step is a fixed length.
pub(super) const NEAR_ORIGIN: f32 = 1.0 / 32.0;

/// Fixed length of the step near the origin, per unit of the normal.
const FLOAT_SCALE: f32 = 1.0 / 65_536.0;

/// Number of units in the last place of a step, per unit of the normal.
const INT_SCALE: f32 = 256.0;

/// Least length of the step, per unit of the normal and of the primitive's extent. Half of it keeps
/// a million rays off the triangles that they leave, but for slivers
/// (docs/notes/rays.md).
const EXTENT_SCALE: f32 = 1.0 / 2_097_152.0;

#[inline(always)]
fn offset_axis<R: Real>(p: R, n: R, [near, fixed, least]: [R; 3]) -> R {
    let steps = (R::splat(INT_SCALE) * n).truncated();
    let bits = p.bits();
    let negative = bits.sign_mask();
    let moved = bits.add(steps.xor(negative).sub(negative)).bits_to_float();
    let moved = R::select(p.abs().lt(near), p + fixed * n, moved);
    let least = least * n;
    R::select((moved - p).abs().lt(least.abs()), p + least, moved)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_moves_to_the_side_of_the_normal_at_every_scale() {
        for scale in [1e-30, 1e-5, 1e-3, 0.02, 1.0, 37.0, 1e4, 1e6] {
            for p in [Vec3::ONE, -Vec3::ONE, Vec3::new(1.0, -0.5, 0.0)] {
                let n = Vec3::new(0.6, -0.64, 0.48);
                let q = offset_origin(p * scale, n, scale);
                let step = (q - p * scale).dot(n);
                assert!(
                    step > 1e-7 * scale && step < 1e-3 * scale,
                    "scale {scale}: {step}"
                );
            }
        }
    }

    #[test]
    fn offset_from_a_wall_through_the_origin_grows_with_the_extent() {
        for (extent, least) in [(1.0, 1.0 / 65_536.0), (1000.0, 1000.0 / 2_097_152.0)] {
            for p in [Vec3::ZERO, Vec3::new(0.0, 0.05, 400.0)] {
                for n in [Vec3::X, -Vec3::X] {
                    let q = offset_origin(p, n, extent);
                    assert_eq!(q - p, n * least, "{p} {extent}");
                }
            }
        }
    }
}
