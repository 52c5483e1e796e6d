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
/// surface again.
///
/// The step is a fixed number of units in the last place, so it scales with the coordinates; near
/// the origin, where those units vanish, it is a fixed length [Waechter & Binder 2019].
#[inline]
pub fn offset_origin(p: Vec3, n: Vec3) -> Vec3 {
    #[cfg(target_arch = "x86_64")]
    return offset_by_vectors(p, n);
    #[cfg(not(target_arch = "x86_64"))]
    offset_by_axis(p, n)
}

/// Absolute coordinate below which the step is a fixed length.
const NEAR_ORIGIN: f32 = 1.0 / 32.0;

/// Fixed length of the step near the origin, per unit of the normal.
const FLOAT_SCALE: f32 = 1.0 / 65_536.0;

/// Number of units in the last place of a step, per unit of the normal.
const INT_SCALE: f32 = 256.0;

/// Computes [`offset_origin`] one axis after the other; scalar or vectorised.
#[inline(always)]
pub fn offset_by_axis<V: Vector>(p: V, n: V) -> V {
    V::new(
        offset_axis(p.x(), n.x()),
        offset_axis(p.y(), n.y()),
        offset_axis(p.z(), n.z()),
    )
}

#[inline(always)]
fn offset_axis<R: Real>(p: R, n: R) -> R {
    let steps = (R::splat(INT_SCALE) * n).truncated();
    let bits = p.bits();
    let negative = bits.sign_mask();
    let moved = bits.add(steps.xor(negative).sub(negative)).bits_to_float();
    R::select(
        p.abs().lt(R::splat(NEAR_ORIGIN)),
        p + R::splat(FLOAT_SCALE) * n,
        moved,
    )
}

/// Computes [`offset_origin`] for all axes at once, bit-identically. Both ends of every shadow ray
/// are offset, and a range-checked cast costs more than all of this.
#[cfg(target_arch = "x86_64")]
#[expect(unsafe_code, reason = "vector instructions that glam does not expose")]
#[inline]
fn offset_by_vectors(p: Vec3, n: Vec3) -> Vec3 {
    use std::arch::x86_64::*;

    use glam::Vec4;

    let (p4, n4) = (p.extend(0.0), n.extend(0.0));
    // SAFETY: every x86-64 processor has SSE2.
    let moved = Vec4::from(unsafe {
        let steps = _mm_cvttps_epi32((n4 * INT_SCALE).into());
        let bits = _mm_castps_si128(p4.into());
        let negative = _mm_srai_epi32::<31>(bits);
        let steps = _mm_sub_epi32(_mm_xor_si128(steps, negative), negative);
        _mm_castsi128_ps(_mm_add_epi32(bits, steps))
    });
    let near = p4.abs().cmplt(Vec4::splat(NEAR_ORIGIN));
    Vec4::select(near, p4 + n4 * FLOAT_SCALE, moved).truncate()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[cfg(target_arch = "x86_64")]
    fn offsets_have_the_same_bits_with_vectors() {
        let mut points = vec![
            Vec3::ZERO,
            -Vec3::ZERO,
            Vec3::new(1.0 / 32.0, -1.0 / 32.0, 0.031_249),
        ];
        points.extend((0..2000u32).map(|i| {
            let w = crate::math::rng::pcg4d([i, 1, 2, 3])
                .map(|w| crate::math::rng::unit(w) * 2.0 - 1.0);
            Vec3::new(w[0], w[1], w[2]) * 10f32.powi(i as i32 % 9 - 4)
        }));
        for (i, p) in points.into_iter().enumerate() {
            let u = crate::math::rng::pcg4d([i as u32, 4, 5, 6]).map(crate::math::rng::unit);
            let n = crate::math::warp::uniform_sphere([u[0], u[1]]);
            for n in [n, -n, Vec3::X, -Vec3::Z, Vec3::ZERO] {
                let bits = |v: Vec3| v.to_array().map(f32::to_bits);
                assert_eq!(
                    bits(offset_by_vectors(p, n)),
                    bits(offset_by_axis(p, n)),
                    "{p} {n}"
                );
            }
        }
    }

    #[test]
    fn offset_moves_to_the_side_of_the_normal_at_every_scale() {
        for scale in [1e-3, 0.02, 1.0, 37.0, 1e4, 1e6] {
            for p in [Vec3::ONE, -Vec3::ONE, Vec3::new(1.0, -0.5, 0.25)] {
                let n = Vec3::new(0.6, -0.64, 0.48);
                let q = offset_origin(p * scale, n);
                let step = (q - p * scale).dot(n);
                assert!(
                    step > 0.0 && step < 1e-3 * scale.max(0.1),
                    "scale {scale}: {step}"
                );
            }
        }
    }
}
