//! Ideal specular reflection and refraction at a smooth dielectric.

use super::{LobeSample, TransportMode, fresnel};
use crate::math::real::{Real, Vector};

/// Samples reflection or refraction with the Fresnel reflectance as the probability of the former;
/// returns the sample and the probability of the event. The mask is unset where refraction was
/// chosen but has no direction.
///
/// Refracted light is tinted by the square root of the base colour, so that a path which enters and
/// leaves a body carries the base colour once [Burley 2015, 5.3]. Reflected light is not tinted.
#[inline(always)]
pub fn sample<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    base_color: V,
    ior: R,
    wo: V,
    u: R,
    mode: TransportMode,
) -> (R::Mask, LobeSample<V>, R) {
    let one = R::splat(1.0);
    let fresnel = fresnel::dielectric(wo.z(), ior);
    let reflects = u.lt(fresnel.reflectance);
    // Use the tangential part rather than the cosine, which has few digits of it near the normal.
    let along = V::new(-wo.x(), -wo.y(), R::splat(0.0)) / fresnel.eta;
    let cos2_t = one - along.length_squared();
    let refracted = V::new(along.x(), along.y(), cos2_t.sqrt().copysign(-wo.z()));
    let scale = match mode {
        TransportMode::Radiance => one / (fresnel.eta * fresnel.eta),
        TransportMode::Importance => one,
    };
    let sample = LobeSample {
        wi: V::select(reflects, V::new(-wo.x(), -wo.y(), wo.z()), refracted),
        weight: V::select(reflects, V::splat(one), base_color.sqrt() * scale),
        eta: R::select(reflects, one, fresnel.eta),
    };
    let probability = R::select(reflects, fresnel.reflectance, one - fresnel.reflectance);
    (reflects | cos2_t.gt(R::splat(0.0)), sample, probability)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;

    /// Returns the sample and its probability, if refraction has a direction.
    fn sample(
        base_color: Vec3,
        ior: f32,
        wo: Vec3,
        u: f32,
        mode: TransportMode,
    ) -> Option<(LobeSample, f32)> {
        let (some, sample, probability) = super::sample(base_color, ior, wo, u, mode);
        some.then_some((sample, probability))
    }

    #[test]
    fn refraction_obeys_snell_and_keeps_unit_length() {
        for ior in [1.5f32, 2.5, 0.8] {
            for (x, z) in [(0.0f32, 1.0f32), (0.6, 0.8), (0.3, -0.953_939_2)] {
                let wo = Vec3::new(x, 0.0, z);
                if let Some((s, p)) = sample(Vec3::ONE, ior, wo, 0.999_999, TransportMode::Radiance)
                {
                    if s.eta == 1.0 {
                        continue;
                    }
                    assert!((s.wi.length() - 1.0).abs() < 1e-5);
                    assert!(s.wi.z * wo.z < 0.0 && p > 0.0);
                    let (n_o, n_i) = if z > 0.0 { (1.0, ior) } else { (ior, 1.0) };
                    assert!((n_o * wo.x + n_i * s.wi.x).abs() < 1e-5, "{ior} {x} {z}");
                }
            }
        }
    }

    #[test]
    fn radiance_scales_and_importance_does_not_and_a_round_trip_carries_the_base_colour() {
        let wo = Vec3::new(0.0, 0.0, 1.0);
        let base = Vec3::new(0.25, 1.0, 0.04);
        let (enter, _) = sample(base, 2.0, wo, 0.9, TransportMode::Radiance).unwrap();
        assert!((enter.weight - Vec3::new(0.5, 1.0, 0.2) / 4.0).length() < 1e-6);
        let (leave, _) = sample(base, 2.0, -wo, 0.9, TransportMode::Radiance).unwrap();
        assert!((enter.weight * leave.weight - base).length() < 1e-6);
        let (light, _) = sample(base, 2.0, wo, 0.9, TransportMode::Importance).unwrap();
        assert!((light.weight - Vec3::new(0.5, 1.0, 0.2)).length() < 1e-6);
    }

    #[test]
    fn total_internal_reflection_reflects() {
        let wo = Vec3::new(0.8, 0.0, -0.6);
        let (s, p) = sample(Vec3::ONE, 1.5, wo, 0.999_999, TransportMode::Radiance).unwrap();
        assert_eq!((s.wi, p, s.eta), (Vec3::new(-0.8, 0.0, -0.6), 1.0, 1.0));
    }
}
