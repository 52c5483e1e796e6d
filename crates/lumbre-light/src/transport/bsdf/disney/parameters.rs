//! Parameters of the Disney BSDF from those of materials: tints, and the estimate by which lobes are
//! chosen.

use glam::Vec3;

use super::super::diffuse::Diffuse;
use super::super::ggx::Ggx;
use super::super::material::{BsdfClass, MaterialConstants};
use super::{Disney, LobeEstimate, f0_of};
use crate::math::luminance::WEIGHTS_F32;
use crate::math::real::{Mask, Real, Vector};
use crate::scene::compile::Formulas;

/// Minimum sampling probability of a rough lobe relative to its weight: its reflectance at normals
/// that do not face the viewer can exceed the estimate from the macroscopic cosine.
const MIN_ROUGH: f32 = 0.02;

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Disney<V> {
    /// Builds the BSDF at points whose textures give this base colour and roughness, with the
    /// weights of the opaque dielectric, the metal and the refractive dielectric. The class is
    /// anisotropic unless both widths of the microfacets are equal.
    #[inline(always)]
    pub fn with_weights(
        class: &BsdfClass,
        m: &MaterialConstants<V>,
        base_color: V,
        roughness: R,
        [opaque, metallic, refractive]: [R; 3],
    ) -> Disney<V> {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let white = V::splat(one);
        let tinted_f0 = if m.specular_tint.gt(zero).any() {
            Some((tinted(base_color, m.specular_tint) * f0_of(m.ior)).at_most(one))
        } else {
            None
        };
        let sheen = if m.sheen.gt(zero).any() {
            let color = if m.sheen_tint.gt(zero).any() {
                tinted(base_color, m.sheen_tint)
            } else {
                white
            };
            color * m.sheen
        } else {
            V::splat(zero)
        };
        let disney = Disney {
            base_color,
            opaque,
            metallic,
            refractive,
            ior: m.ior,
            tinted_f0,
            schlick_share: (class.formulas == Formulas::Mitsuba).then_some(m.specular_tint),
            diffuse: Diffuse {
                base_color,
                roughness,
                subsurface: m.subsurface,
                sheen,
            },
            ggx: Ggx::new(roughness, m.aspect),
            anisotropic: class.anisotropic,
            one_sided: class.one_sided,
            smooth: roughness.lt(m.smooth_below),
            coat: m.coat,
            estimate: LobeEstimate::none(),
        };
        disney.with_estimate()
    }

    /// Returns the BSDF with [`Disney::estimate`] computed from the other parameters.
    #[inline(always)]
    fn with_estimate(self) -> Disney<V> {
        let (zero, one, third) = (R::splat(0.0), R::splat(1.0), R::splat(1.0 / 3.0));
        let (f0, color) = (f0_of(self.ior), self.base_color.element_sum() * third);
        let sheen = self.diffuse.sheen.element_sum() * third;
        let rough = R::select(
            self.smooth,
            zero,
            R::splat(MIN_ROUGH) * (self.opaque + self.metallic),
        );
        let estimate = LobeEstimate {
            diffuse: self.opaque * (color + R::splat(0.25) * sheen),
            reflection: self.opaque * f0 + self.metallic * color + rough,
            rise: self.opaque * (one - f0) + self.metallic * (one - color),
        };
        Disney { estimate, ..self }
    }
}

impl<R: Real> LobeEstimate<R> {
    /// Returns the estimate of a surface that reflects nothing.
    #[inline(always)]
    fn none() -> LobeEstimate<R> {
        let zero = R::splat(0.0);
        LobeEstimate {
            diffuse: zero,
            reflection: zero,
            rise: zero,
        }
    }
}

/// Returns the blend from white to a colour of luminance 1 with the hue of `color`; `amount` is that
/// of the hue.
#[inline(always)]
fn tinted<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(color: V, amount: R) -> V {
    let one = R::splat(1.0);
    V::splat(one) * (one - amount) + hue_of(color) * amount
}

/// Returns a colour of luminance 1 with the hue of `c`; white for black.
#[inline(always)]
fn hue_of<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(c: V) -> V {
    let luminance = c.dot(V::broadcast(Vec3::from_array(WEIGHTS_F32)));
    V::select(
        luminance.gt(R::splat(0.0)),
        c / luminance,
        V::splat(R::splat(1.0)),
    )
}
