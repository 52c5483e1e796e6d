//! The clear coat of [Burley 2012]: a GTR1 lobe of an isotropic varnish of index 1.5.
//!
//! Burley adds it to what lies below; here what lies below is also seen through the coat twice, each time without the
//! part that the coat reflects ([`Clearcoat::passes`]), so that a coat never adds energy.

use std::f32::consts::PI;

use super::fresnel::schlick_weight;
use super::ggx::{Ggx, Half};
use crate::math::elementary;
use crate::math::real::{Real, Vector};

/// Reflectance at normal incidence of index 1.5.
const F0: f32 = 0.04;

/// The coat's masking is that of a GGX surface of this alpha [Burley 2012].
const MASKING: f32 = 0.25;

/// A clear coat.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat<R = f32> {
    /// Part of a full coat: a quarter of the material's parameter.
    pub strength: R,
    /// Width of the GTR1 lobe.
    pub alpha: R,
}

impl Clearcoat<f32> {
    /// From the parameters `clearcoat` and `clearcoat_gloss`.
    #[inline]
    pub fn new(clearcoat: f32, gloss: f32) -> Clearcoat {
        Clearcoat { strength: 0.25 * clearcoat, alpha: 0.1 + (0.001 - 0.1) * gloss }
    }
}

impl<R: Real> Clearcoat<R> {
    /// Reflected part at a cosine.
    #[inline(always)]
    pub fn reflectance(&self, cos: R) -> R {
        self.strength * (R::of(F0) + R::of(1.0 - F0) * schlick_weight(cos))
    }

    /// What the coat lets through on the way in along one direction or out along another.
    #[inline(always)]
    pub fn passes(&self, cos_o: R, cos_i: R) -> R {
        (R::of(1.0) - self.reflectance(cos_o)) * (R::of(1.0) - self.reflectance(cos_i))
    }

    /// Density of normals: GTR with exponent 1, per solid angle.
    #[inline(always)]
    fn d(&self, h: &Half<R>) -> R {
        let a2 = self.alpha * self.alpha;
        // 1 + (a2 - 1) z^2, without the cancellation where z is near 1.
        let s = h.across2 + a2 * h.along2;
        (a2 - R::of(1.0)) / (R::of(PI) * a2.each(f32::ln) * s)
    }

    /// The value for two directions on the upper side with these cosines; `cos_d` is that between either of them and
    /// their half vector.
    #[inline(always)]
    pub fn eval(&self, cos_o: R, cos_i: R, h: &Half<R>, cos_d: R) -> R {
        R::of(0.25) * self.reflectance(cos_d) * self.d(h) * masking_over_cos(cos_o) * masking_over_cos(cos_i)
    }

    /// Density per solid angle of reflecting about a normal from [`Clearcoat::sample`].
    #[inline(always)]
    pub fn pdf_w(&self, h: &Half<R>, cos_d: R) -> R {
        self.d(h) * h.along2.sqrt() / (R::of(4.0) * cos_d).max(R::of(1e-12))
    }

    /// A normal with density `D cos` [Burley 2012, B.2].
    #[inline(always)]
    pub fn sample(&self, u: [R; 2]) -> R::Vec3 {
        let one = R::of(1.0);
        let a2 = self.alpha * self.alpha;
        let cos2 = ((one - a2.each_with(one - u[0], f32::powf)) / (one - a2)).clamp(0.0, 1.0);
        let r = (one - cos2).sqrt();
        let (sin, cos) = elementary::sin_cos(R::of(2.0 * PI) * u[1]);
        R::Vec3::new(r * cos, r * sin, cos2.sqrt())
    }
}

/// The coat's masking over a cosine.
#[inline(always)]
fn masking_over_cos<R: Real>(cos: R) -> R {
    let spread2 = R::of(MASKING * MASKING) * (R::of(1.0) - cos * cos).max(R::of(0.0));
    Ggx { alpha: [R::of(MASKING); 2] }.masking_at(cos, spread2)
}
