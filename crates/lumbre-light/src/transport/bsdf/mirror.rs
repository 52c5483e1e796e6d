//! Ideal specular reflection off a metal, on both sides of a surface.

use glam::Vec3;

use super::LobeSample;
use super::fresnel;

/// Returns the mirrored direction, weighted by Schlick's reflectance.
#[inline]
pub fn sample(f0: Vec3, wo: Vec3) -> LobeSample {
    LobeSample {
        wi: Vec3::new(-wo.x, -wo.y, wo.z),
        weight: fresnel::schlick(f0, wo.z),
        eta: 1.0,
    }
}
