//! The diffuse lobe of [Burley 2012] with retro-reflection at grazing angles, its flatter variant
//! for subsurface scattering, and the sheen of cloth.
//!
//! The lobe does not conserve energy. It was fitted to measured materials, is not reduced by what
//! the specular reflection above it takes, and brightens towards grazing angles. A white dielectric
//! of index 1.5 and roughness 1 reflects 1.05 of the light at normal incidence, 1.18 at a cosine of
//! 0.3 and 1.42 at 0.1; with index 2.5, 1.09, 1.24 and 1.50. The subsurface variant reaches 1.65.
//! Sheen and specular tint are divided by the colour's luminance, so saturated blues are scaled by
//! up to 14: with a full, fully tinted blue sheen the blue channel reaches 2.7. A grey of 0.6 stays
//! below one except at grazing angles. The values are those of the sources and agree with other
//! renderers, so they are kept; tests bound them. In closed scenes of such white surfaces, radiance
//! grows with path depth: bound `max_depth`.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::fresnel::schlick_weight;
use crate::math::real::{Mask, Real, Vector};

/// The parameters of the diffuse lobe at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Diffuse<V: Vector = Vec3> {
    /// Base colour (albedo).
    pub base_color: V,
    /// Perceptual roughness, 0..=1.
    pub roughness: V::Scalar,
    /// Weight of the flatter variant.
    pub subsurface: V::Scalar,
    /// Colour of the sheen, times its strength.
    pub sheen: V,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Diffuse<V> {
    /// Evaluates the lobe for two directions on the upper side: equations 4.15 to 4.17 of S0, and
    /// sheen.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V) -> V {
        // The half vector's cosine with either direction: |wo + wi| = 2 cos.
        self.eval_at(wo.z(), wi.z(), R::splat(0.5) * (wo + wi).length())
    }

    /// Evaluates the lobe for directions with these cosines; `cos_d` is the cosine between either
    /// of them and their half vector.
    #[inline(always)]
    pub fn eval_at(&self, cos_o: R, cos_i: R, cos_d: R) -> V {
        let one = R::splat(1.0);
        let (l, v) = (schlick_weight(cos_i), schlick_weight(cos_o));
        let cos2_d = cos_d * cos_d;
        let ss90 = self.roughness * cos2_d;
        let fd90 = R::splat(0.5) + R::splat(2.0) * ss90;
        let mut value = (one + (fd90 - one) * l) * (one + (fd90 - one) * v);
        if self.subsurface.gt(R::splat(0.0)).any() {
            let fss = (one + (ss90 - one) * l) * (one + (ss90 - one) * v);
            let flat = R::splat(1.25)
                * (fss * (one / (cos_i + cos_o).max(R::splat(1e-6)) - R::splat(0.5))
                    + R::splat(0.5));
            value = value + (flat - value) * self.subsurface;
        }
        let mut f = self.base_color * (value * R::splat(FRAC_1_PI));
        if (!self.sheen.same(V::broadcast(Vec3::ZERO))).any() {
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
        let lobe = |roughness, subsurface| Diffuse {
            base_color: Vec3::ONE,
            roughness,
            subsurface,
            sheen: Vec3::ZERO,
        };
        // At normal incidence and exit both Fresnel weights vanish.
        let f = lobe(0.7, 0.0).eval(Vec3::Z, Vec3::Z).x;
        assert!((f - FRAC_1_PI).abs() < 1e-7);
        // Value of f_ss there: 1.25 (1 / 2 - 1 / 2 + 1 / 2).
        let f = lobe(0.7, 1.0).eval(Vec3::Z, Vec3::Z).x;
        assert!((f - 0.625 * FRAC_1_PI).abs() < 1e-7);
        // Straight back at cos 0.5 with roughness 1: F_D90 = 2.5, (1 - 0.5)^5 = 1/32, f pi = (1 +
        // 1.5 / 32)^2.
        let w = Vec3::new(0.75f32.sqrt(), 0.0, 0.5);
        let f = lobe(1.0, 0.0).eval(w, w).x;
        assert!((f - (1.0f32 + 1.5 / 32.0).powi(2) * FRAC_1_PI).abs() < 1e-6);
        // Towards the mirrored side: cos_d = 0.5, F_D90 = 1, no correction at all.
        let f = lobe(1.0, 0.0).eval(w, Vec3::new(-w.x, 0.0, 0.5)).x;
        assert!((f - FRAC_1_PI).abs() < 1e-6);
        // Straight back with roughness 1: F_ss90 = 1 and f_ss pi = 1.25 (1 (1 - 1/2) + 1/2) = 1.25.
        let f = lobe(1.0, 1.0).eval(w, w).x;
        assert!((f - 1.25 * FRAC_1_PI).abs() < 1e-6);
        // Sheen alone: (1 - cos_d)^5 with cos_d = 0.5.
        let sheen = Diffuse {
            base_color: Vec3::ZERO,
            sheen: Vec3::new(1.0, 0.5, 0.0),
            ..lobe(1.0, 0.0)
        };
        let f = sheen.eval(w, Vec3::new(-w.x, 0.0, 0.5));
        assert!((f - Vec3::new(1.0, 0.5, 0.0) / 32.0).length() < 1e-6);
    }
}
