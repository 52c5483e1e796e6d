//! The diffuse lobe of [Burley 2012]: retro-reflection at grazing angles, a flatter variant for scattering below the
//! surface, and the sheen of cloth.
//!
//! It does not conserve energy. It was fitted to measured materials, takes nothing off for what the reflection over it
//! takes, and brightens towards grazing angles: a white dielectric of index 1.5 and roughness 1 sends back 1.05 of the
//! light that falls on it straight, 1.18 at a cosine of 0.3 and 1.42 at 0.1; of index 2.5, 1.09, 1.24 and 1.50. The
//! subsurface variant reaches 1.65. Sheen and specular tint are divided by the colour's luminance, so that saturated
//! blues count up to 14 times: with a full, fully tinted blue sheen the blue channel reaches 2.7. A grey of 0.6 stays
//! below one but at grazing angles. The values are those of the sources and agree with other renderers', so they are
//! kept; the tests hold how far they go. In closed scenes of such whites paths grow with depth: bound it.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::fresnel::schlick_weight;
use crate::math::real::{Mask, Real, Vector};

/// What the lobe needs of a material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse<V: Vector = Vec3> {
    /// Base colour.
    pub base_color: V,
    /// Perceptual roughness.
    pub roughness: V::Scalar,
    /// Part of the flatter variant.
    pub subsurface: V::Scalar,
    /// Colour and strength of the sheen.
    pub sheen: V,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Diffuse<V> {
    /// The value for two directions on the upper side (equations 4.15 to 4.17 of the first document, and sheen).
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V) -> V {
        // The half vector's cosine with either direction, from their own: |wo + wi| = 2 cos.
        self.eval_at(wo.z(), wi.z(), R::of(0.5) * (wo + wi).length())
    }

    /// The same for directions with these cosines, `cos_d` the one between either of them and their half vector.
    #[inline(always)]
    pub fn eval_at(&self, cos_o: R, cos_i: R, cos_d: R) -> V {
        let one = R::of(1.0);
        let (l, v) = (schlick_weight(cos_i), schlick_weight(cos_o));
        let cos2_d = cos_d * cos_d;
        let ss90 = self.roughness * cos2_d;
        let fd90 = R::of(0.5) + R::of(2.0) * ss90;
        let mut value = (one + (fd90 - one) * l) * (one + (fd90 - one) * v);
        if self.subsurface.gt(R::of(0.0)).any() {
            let fss = (one + (ss90 - one) * l) * (one + (ss90 - one) * v);
            let flat = R::of(1.25) * (fss * (one / (cos_i + cos_o).max(R::of(1e-6)) - R::of(0.5)) + R::of(0.5));
            value = value + (flat - value) * self.subsurface;
        }
        let mut f = self.base_color * (value * R::of(FRAC_1_PI));
        if (!self.sheen.same(V::of(Vec3::ZERO))).any() {
            f = f + self.sheen * schlick_weight(cos_d);
        }
        f
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equations_4_15_to_4_17_at_points_worked_out_by_hand() {
        let lobe = |roughness, subsurface| Diffuse { base_color: Vec3::ONE, roughness, subsurface, sheen: Vec3::ZERO };
        // Normal incidence and exit: both Fresnel weights vanish.
        let f = lobe(0.7, 0.0).eval(Vec3::Z, Vec3::Z).x;
        assert!((f - FRAC_1_PI).abs() < 1e-7);
        // f_ss there: 1.25 (1 / 2 - 1 / 2 + 1 / 2).
        let f = lobe(0.7, 1.0).eval(Vec3::Z, Vec3::Z).x;
        assert!((f - 0.625 * FRAC_1_PI).abs() < 1e-7);
        // Straight back at cos 0.5 with roughness 1: F_D90 = 2.5, (1 - 0.5)^5 = 1/32, f pi = (1 + 1.5 / 32)^2.
        let w = Vec3::new(0.75f32.sqrt(), 0.0, 0.5);
        let f = lobe(1.0, 0.0).eval(w, w).x;
        assert!((f - (1.0f32 + 1.5 / 32.0).powi(2) * FRAC_1_PI).abs() < 1e-6);
        // To the mirrored side: cos_d = 0.5, F_D90 = 1, no correction at all.
        let f = lobe(1.0, 0.0).eval(w, Vec3::new(-w.x, 0.0, 0.5)).x;
        assert!((f - FRAC_1_PI).abs() < 1e-6);
        // F_ss90 = 1 straight back with roughness 1: f_ss pi = 1.25 (1 (1 - 1/2) + 1/2) = 1.25.
        let f = lobe(1.0, 1.0).eval(w, w).x;
        assert!((f - 1.25 * FRAC_1_PI).abs() < 1e-6);
        // Sheen alone: (1 - cos_d)^5 with cos_d = 0.5.
        let sheen = Diffuse { base_color: Vec3::ZERO, sheen: Vec3::new(1.0, 0.5, 0.0), ..lobe(1.0, 0.0) };
        let f = sheen.eval(w, Vec3::new(-w.x, 0.0, 0.5));
        assert!((f - Vec3::new(1.0, 0.5, 0.0) / 32.0).length() < 1e-6);
    }
}
