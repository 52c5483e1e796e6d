//! Rays, hits, and the seam to whatever intersects them.

use glam::Vec3;

/// A half-line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts, in world space.
    pub origin: Vec3,
    /// Where it goes; a unit vector.
    pub dir: Vec3,
}

/// What a ray met first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance in scene units.
    pub t: f32,
    /// Primitive id: triangles first, spheres after them.
    pub primitive: u32,
    /// The copy of a shared mesh whose triangle it is, or [`NONE`](crate::scene::compile::NONE).
    pub instance: u32,
    /// Barycentric weights of the second and third corner; zero for spheres.
    pub uv: [f32; 2],
}

/// Whatever intersects rays with a compiled scene, masks included.
pub trait Trace {
    /// The nearest hit with `0 < t < t_max`.
    fn closest(&self, ray: &Ray, t_max: f32) -> Option<Hit>;

    /// Whether anything is hit with `0 < t < t_max`.
    fn occluded(&self, ray: &Ray, t_max: f32) -> bool;
}

/// A point moved off its surface along `n` just far enough that a ray from there does not meet the surface again.
///
/// The step is a fixed number of units in the last place, so it scales with the coordinates; near the origin, where
/// those units vanish, it is a fixed length [Waechter & Binder 2019].
#[inline]
pub fn offset_origin(p: Vec3, n: Vec3) -> Vec3 {
    const NEAR_ORIGIN: f32 = 1.0 / 32.0;
    const FLOAT_SCALE: f32 = 1.0 / 65_536.0;
    const INT_SCALE: f32 = 256.0;
    let axis = |p: f32, n: f32| {
        let steps = (INT_SCALE * n) as i32;
        let moved = f32::from_bits((p.to_bits() as i32).wrapping_add(if p < 0.0 { -steps } else { steps }) as u32);
        if p.abs() < NEAR_ORIGIN { p + FLOAT_SCALE * n } else { moved }
    };
    Vec3::new(axis(p.x, n.x), axis(p.y, n.y), axis(p.z, n.z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offset_moves_to_the_side_of_the_normal_at_every_scale() {
        for scale in [1e-3, 0.02, 1.0, 37.0, 1e4, 1e6] {
            for p in [Vec3::ONE, -Vec3::ONE, Vec3::new(1.0, -0.5, 0.25)] {
                let n = Vec3::new(0.6, -0.64, 0.48);
                let q = offset_origin(p * scale, n);
                let step = (q - p * scale).dot(n);
                assert!(step > 0.0 && step < 1e-3 * scale.max(0.1), "scale {scale}: {step}");
            }
        }
    }
}
