//! The clear coat of [Burley 2012]: a GTR1 lobe of an isotropic varnish of index 1.5.
//!
//! Burley adds the lobe to the layers below. Here the layers below are also seen through the coat
//! twice, each time without the part that the coat reflects ([`Clearcoat::transmittance`]), so that
//! a coat never adds energy. By the formulas of Mitsuba they are not darker, and the lobe lacks the
//! division by both cosines that Burley's masking contains.

use std::f32::consts::PI;

use super::fresnel::schlick_weight;
use super::ggx::{Ggx, HalfVector};
use crate::math::real::{Real, Vector};
use crate::math::trig;
use crate::scene::compile::Formulas;

/// Reflectance at normal incidence for the index 1.5.
const F0: f32 = 0.04;

/// GGX alpha used for the coat's masking [Burley 2012].
const MASKING: f32 = 0.25;

/// A clear coat over a material: the GTR1 lobe of [Burley 2012], isotropic, with the index of
/// refraction 1.5.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Clearcoat<R = f32> {
    /// Scale of the lobe: a quarter of the material's parameter `clearcoat`.
    pub strength: R,
    /// Width of the GTR1 lobe.
    pub alpha: R,
    /// Natural logarithm of the squared width. If the strength is zero, any number except zero:
    /// lanes without a coat are evaluated with those that have one.
    pub ln_alpha2: R,
    /// Renderer whose formulas hold.
    pub formulas: Formulas,
}

impl Clearcoat<f32> {
    /// Builds a coat from the parameters `clearcoat` and `clearcoat_gloss`.
    #[inline]
    pub fn new(clearcoat: f32, gloss: f32, formulas: Formulas) -> Clearcoat {
        let alpha: f32 = 0.1 + (0.001 - 0.1) * gloss;
        Clearcoat {
            strength: 0.25 * clearcoat,
            alpha,
            ln_alpha2: if clearcoat > 0.0 {
                (alpha * alpha).ln()
            } else {
                -1.0
            },
            formulas,
        }
    }
}

impl<R: Real> Clearcoat<R> {
    /// Returns the reflectance at a cosine.
    #[inline(always)]
    pub fn reflectance(&self, cos: R) -> R {
        self.strength * (R::splat(F0) + R::splat(1.0 - F0) * schlick_weight(cos))
    }

    /// Returns the transmittance on the way in along one direction and out along another.
    #[inline(always)]
    pub fn transmittance(&self, cos_o: R, cos_i: R) -> R {
        if self.formulas == Formulas::Mitsuba {
            return R::splat(1.0);
        }
        (R::splat(1.0) - self.reflectance(cos_o)) * (R::splat(1.0) - self.reflectance(cos_i))
    }

    /// Returns the density of normals per solid angle: GTR with exponent 1.
    #[inline(always)]
    fn d(&self, h: &HalfVector<R>) -> R {
        let a2 = self.alpha * self.alpha;
        // 1 + (a2 - 1) z^2, without cancellation for z near 1.
        let s = h.across2 + a2 * h.along2;
        (a2 - R::splat(1.0)) / (R::splat(PI) * self.ln_alpha2 * s)
    }

    /// Evaluates the lobe for two directions on the upper side with these cosines; `cos_d` is the
    /// cosine between either of them and their half vector.
    #[inline(always)]
    pub fn eval(&self, cos_o: R, cos_i: R, h: &HalfVector<R>, cos_d: R) -> R {
        let value = R::splat(0.25)
            * self.reflectance(cos_d)
            * self.d(h)
            * masking_over_cos(cos_o)
            * masking_over_cos(cos_i);
        match self.formulas {
            Formulas::Lumbre => value,
            Formulas::Mitsuba => value * (R::splat(4.0) * cos_o * cos_i),
        }
    }

    /// Returns the density per solid angle of reflecting about a normal from [`Clearcoat::sample`].
    #[inline(always)]
    pub fn pdf_w(&self, h: &HalfVector<R>, cos_d: R) -> R {
        self.d(h) * h.along2.sqrt() / (R::splat(4.0) * cos_d).max(R::splat(1e-12))
    }

    /// Samples a normal with density `D cos` [Burley 2012, B.2].
    #[inline(always)]
    pub fn sample(&self, u: [R; 2]) -> R::Vec3 {
        let one = R::splat(1.0);
        let a2 = self.alpha * self.alpha;
        let cos2 = ((one - a2.zip_lanes(one - u[0], f32::powf)) / (one - a2)).clamp(0.0, 1.0);
        let r = (one - cos2).sqrt();
        let (sin, cos) = trig::sin_cos(R::splat(2.0 * PI) * u[1]);
        R::Vec3::new(r * cos, r * sin, cos2.sqrt())
    }
}

/// Returns the coat's masking over a cosine.
#[inline(always)]
fn masking_over_cos<R: Real>(cos: R) -> R {
    let spread2 = R::splat(MASKING * MASKING) * (R::splat(1.0) - cos * cos).max(R::splat(0.0));
    Ggx {
        alpha: [R::splat(MASKING); 2],
    }
    .masking_at(cos, spread2)
}
