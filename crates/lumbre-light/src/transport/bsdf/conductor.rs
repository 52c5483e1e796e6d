//! A metal with a measured complex index of refraction, smooth or rough.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::{LobeSample, MixtureSample};

/// A metal at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conductor {
    /// Factor on the reflectance.
    pub tint: Vec3,
    /// Real part of the index by channel, relative to the outside.
    pub eta: Vec3,
    /// Imaginary part of the index by channel, relative to the outside.
    pub k: Vec3,
    /// Its microfacets; `None` if the surface is smooth.
    pub facets: Option<Facets>,
}

/// Returns the reflectance of unpolarised light at a conductor [Born & Wolf 1999, 14.4]; 1 if `eta`
/// is 0 and `k` is not.
#[inline]
pub fn reflectance(cos: f32, eta: f32, k: f32) -> f32 {
    let cos2 = (cos * cos).min(1.0);
    let sin2 = 1.0 - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2b2 = (t0 * t0 + 4.0 * eta2 * k2).sqrt();
    let a = (0.5 * (a2b2 + t0)).max(0.0).sqrt();
    let (t1, t2) = (a2b2 + cos2, 2.0 * a * cos.abs());
    // Both fractions are 0 / 0 if index and cosine vanish: everything is reflected at grazing
    // angles.
    let ratio = |up: f32, down: f32| {
        if down > 0.0 {
            (up / down).max(0.0)
        } else {
            1.0
        }
    };
    let perpendicular = ratio(t1 - t2, t1 + t2);
    let (t3, t4) = (cos2 * a2b2 + sin2 * sin2, t2 * sin2);
    let parallel = perpendicular * ratio(t3 - t4, t3 + t4);
    0.5 * (perpendicular + parallel)
}

impl Conductor {
    #[inline]
    fn fresnel(&self, cos: f32) -> Vec3 {
        let channel = |i: usize| reflectance(cos, self.eta[i], self.k[i]);
        Vec3::new(channel(0), channel(1), channel(2)) * self.tint
    }

    /// Returns the value and the densities of both directions, for two directions on the upper
    /// side.
    #[inline]
    pub fn evaluate(&self, o: Vec3, i: Vec3) -> (Vec3, [f32; 2]) {
        let Some(facets) = &self.facets else {
            return (Vec3::ZERO, [0.0; 2]);
        };
        if o.z <= 0.0 || i.z <= 0.0 {
            return (Vec3::ZERO, [0.0; 2]);
        }
        let h = (o + i).normalize_or(Vec3::Z);
        let d = 0.25 * facets.d(h);
        let masking = [o, i].map(|w| facets.masking_over_cos(w));
        (
            self.fresnel(o.dot(h)) * (masking[0] * d * masking[1]),
            masking.map(|m| m * d),
        )
    }

    /// Samples a reflected direction for `o` on the upper side.
    #[inline]
    pub fn sample(&self, o: Vec3, v: [f32; 2]) -> Option<MixtureSample> {
        let Some(facets) = &self.facets else {
            let wi = Vec3::new(-o.x, -o.y, o.z);
            return Some(MixtureSample::new(
                LobeSample {
                    wi,
                    weight: self.fresnel(o.z),
                    eta: 1.0,
                },
                1.0,
                true,
            ));
        };
        let h = facets.sample(o, v);
        let wi = mirrored(o, h);
        if wi.z <= 0.0 || o.dot(h) <= 0.0 {
            return None;
        }
        // Use the half vector of both directions: for narrow lobes the sampled normal has digits
        // that `wi` cannot represent.
        let (f, [pdf_w, _]) = self.evaluate(o, wi);
        let weight = f * (wi.z / pdf_w);
        (pdf_w > 0.0 && weight.is_finite()).then(|| {
            MixtureSample::new(
                LobeSample {
                    wi,
                    weight,
                    eta: 1.0,
                },
                pdf_w,
                false,
            )
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_is_that_of_normal_incidence_of_mirrors_and_of_dielectrics() {
        // ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
        for (eta, k) in [(0.2f32, 3.9f32), (1.66, 9.2), (2.9, 3.0)] {
            let expected = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
            assert!(
                (reflectance(1.0, eta, k) - expected).abs() < 1e-5,
                "{eta} {k}"
            );
            assert!((reflectance(0.0, eta, k) - 1.0).abs() < 1e-5);
        }
        for cos in [0.0, 0.1, 0.5, 1.0] {
            assert!((reflectance(cos, 0.0, 1.0) - 1.0).abs() < 1e-5, "{cos}");
            let glass = super::super::fresnel::dielectric(cos, 1.5).reflectance;
            assert!((reflectance(cos, 1.5, 0.0) - glass).abs() < 1e-5, "{cos}");
        }
        assert!(reflectance(0.0, 0.0, 0.0).is_finite());
    }
}
