//! Ideal specular reflection off a metal, on both sides of a surface.

use super::LobeSample;
use super::fresnel;
use crate::math::real::{Real, Vector};

/// Returns the mirrored direction, weighted by Schlick's reflectance.
#[inline(always)]
pub fn sample<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(f0: V, wo: V) -> LobeSample<V> {
    LobeSample {
        wi: V::new(-wo.x(), -wo.y(), wo.z()),
        weight: fresnel::schlick(f0, wo.z()),
        eta: R::splat(1.0),
    }
}
