//! The clear coat of [Burley 2012]: a GTR1 lobe of an isotropic varnish of index 1.5.
//!
//! Burley adds it to what lies below; here what lies below is also seen through the coat twice, each time without the
//! part that the coat reflects ([`Clearcoat::passes`]), so that a coat never adds energy.

use std::f32::consts::PI;

use glam::Vec3;

use super::fresnel::schlick_weight;
use super::ggx::{Ggx, Half};
use crate::math::elementary;

/// Reflectance at normal incidence of index 1.5.
const F0: f32 = 0.04;

/// The coat's masking is that of a GGX surface of this alpha [Burley 2012].
const MASKING: Ggx = Ggx { alpha: [0.25, 0.25] };

/// A clear coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat {
    /// Part of a full coat: a quarter of the material's parameter.
    pub strength: f32,
    /// Width of the GTR1 lobe.
    pub alpha: f32,
}

impl Clearcoat {
    /// From the parameters `clearcoat` and `clearcoat_gloss`.
    #[inline]
    pub fn new(clearcoat: f32, gloss: f32) -> Clearcoat {
        Clearcoat { strength: 0.25 * clearcoat, alpha: 0.1 + (0.001 - 0.1) * gloss }
    }

    /// Reflected part at a cosine.
    #[inline]
    pub fn reflectance(&self, cos: f32) -> f32 {
        self.strength * (F0 + (1.0 - F0) * schlick_weight(cos))
    }

    /// What the coat lets through on the way in along one direction or out along another.
    #[inline]
    pub fn passes(&self, cos_o: f32, cos_i: f32) -> f32 {
        (1.0 - self.reflectance(cos_o)) * (1.0 - self.reflectance(cos_i))
    }

    /// Density of normals: GTR with exponent 1, per solid angle.
    #[inline]
    fn d(&self, h: &Half) -> f32 {
        let a2 = self.alpha * self.alpha;
        // 1 + (a2 - 1) z^2, without the cancellation where z is near 1.
        let s = h.across2 + a2 * h.along2;
        (a2 - 1.0) / (PI * a2.ln() * s)
    }

    /// The value for two directions on the upper side with these cosines; `cos_d` is that between either of them and
    /// their half vector.
    #[inline]
    pub fn eval(&self, cos_o: f32, cos_i: f32, h: &Half, cos_d: f32) -> f32 {
        let masking =
            |cos: f32| MASKING.masking_at(cos, MASKING.alpha[0] * MASKING.alpha[1] * (1.0 - cos * cos).max(0.0));
        0.25 * self.reflectance(cos_d) * self.d(h) * masking(cos_o) * masking(cos_i)
    }

    /// Density per solid angle of reflecting about a normal from [`Clearcoat::sample`].
    #[inline]
    pub fn pdf_w(&self, h: &Half, cos_d: f32) -> f32 {
        self.d(h) * h.along2.sqrt() / (4.0 * cos_d).max(1e-12)
    }

    /// A normal with density `D cos` [Burley 2012, B.2].
    #[inline]
    pub fn sample(&self, u: [f32; 2]) -> Vec3 {
        let a2 = self.alpha * self.alpha;
        let cos2 = ((1.0 - a2.powf(1.0 - u[0])) / (1.0 - a2)).clamp(0.0, 1.0);
        let r = (1.0 - cos2).sqrt();
        let (sin, cos) = elementary::sin_cos(2.0 * PI * u[1]);
        Vec3::new(r * cos, r * sin, cos2.sqrt())
    }
}
