//! Plastic: a diffuse body under a smooth or rough dielectric surface, with all reflections between
//! the two [Weidlich & Wilkie 2007, as simplified by Mitsuba and Tungsten].
//!
//! The transmittance of the surface is computed from the exact Fresnel equations at the macroscopic
//! cosine, even if the surface is rough, as in Tungsten; Mitsuba 3 tabulates the rough
//! transmittance. With the smooth one a rough white plastic reflects up to 1 % more than it
//! receives at some angles, and less at grazing ones; tests bound this.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::{LobeSample, MixtureSample, fresnel};
use crate::math::warp;

/// Plastic at a point of a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plastic {
    /// Albedo of the body.
    pub diffuse: Vec3,
    /// Factor on the surface reflection.
    pub specular: Vec3,
    /// Index of the surface relative to the outside.
    pub ior: f32,
    /// Fraction of the diffuse light from inside that the surface reflects back.
    pub internal: f32,
    /// Whether internally reflected light is tinted by the body's colour at each bounce.
    pub nonlinear: bool,
    /// Microfacets of the surface; `None` if it is smooth.
    pub facets: Option<Facets>,
}

impl Plastic {
    /// Returns the albedo of the body with all internal reflections, over the squared index.
    #[inline]
    fn body(&self) -> Vec3 {
        let recurring = if self.nonlinear {
            self.diffuse * self.internal
        } else {
            Vec3::splat(self.internal)
        };
        self.diffuse / (Vec3::ONE - recurring).max(Vec3::splat(1e-6)) / (self.ior * self.ior)
    }

    /// Returns the probability of sampling the surface reflection, for a cosine of `wo`.
    #[inline]
    fn surface_probability(&self, cos: f32) -> f32 {
        let mean = |c: Vec3| c.element_sum() * (1.0 / 3.0);
        let r = fresnel::dielectric(cos, self.ior).reflectance;
        let (surface, body) = (r * mean(self.specular), (1.0 - r) * mean(self.diffuse));
        if surface + body > 0.0 {
            surface / (surface + body)
        } else {
            0.5
        }
    }

    /// Returns the value and the densities of both directions, for two directions on the upper
    /// side.
    #[inline]
    pub fn evaluate(&self, o: Vec3, i: Vec3) -> (Vec3, [f32; 2]) {
        if o.z <= 0.0 || i.z <= 0.0 {
            return (Vec3::ZERO, [0.0; 2]);
        }
        let transmittance = |cos| 1.0 - fresnel::dielectric(cos, self.ior).reflectance;
        let surface = [o.z, i.z].map(|cos| self.surface_probability(cos));
        let mut f = self.body() * (transmittance(o.z) * transmittance(i.z) * FRAC_1_PI);
        let mut pdf = [
            (1.0 - surface[0]) * warp::cosine_hemisphere_pdf_w(i.z),
            (1.0 - surface[1]) * warp::cosine_hemisphere_pdf_w(o.z),
        ];
        if let Some(facets) = &self.facets {
            let h = (o + i).normalize_or(Vec3::Z);
            let d = 0.25 * facets.d(h);
            let masking = [o, i].map(|w| facets.masking_over_cos(w));
            let r = fresnel::dielectric(o.dot(h).max(0.0), self.ior).reflectance;
            f += self.specular * (r * masking[0] * d * masking[1]);
            pdf[0] += surface[0] * masking[0] * d;
            pdf[1] += surface[1] * masking[1] * d;
        }
        (f, pdf)
    }

    /// Samples a direction of the surface reflection or of the body, for `o` on the upper side.
    #[inline]
    pub fn sample(&self, o: Vec3, u: f32, v: [f32; 2]) -> Option<MixtureSample> {
        let surface = self.surface_probability(o.z);
        let wi = match &self.facets {
            _ if u >= surface => warp::cosine_hemisphere(v),
            None => {
                let wi = Vec3::new(-o.x, -o.y, o.z);
                let weight =
                    self.specular * (fresnel::dielectric(o.z, self.ior).reflectance / surface);
                return Some(MixtureSample::new(
                    LobeSample {
                        wi,
                        weight,
                        eta: 1.0,
                    },
                    surface,
                    true,
                ));
            }
            Some(facets) => mirrored(o, facets.sample(o, v)),
        };
        if wi.z <= 0.0 {
            return None;
        }
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
