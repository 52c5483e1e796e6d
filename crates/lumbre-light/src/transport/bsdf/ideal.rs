//! The ideal surface: Lambert, mirror and smooth dielectric, the cheap limits of the Disney lobes.

use glam::Vec3;

use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::Outgoing;
use super::{MixtureSample, TransportMode, dielectric, lambert, mirror};
use crate::math::real::{Mask, Real, Vector};
use crate::transport::surface::ShadingParameters;

/// An ideal surface, scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ideal<V: Vector = Vec3> {
    /// Base colour of all lobes.
    pub base_color: V,
    /// Index of the inside relative to the outside.
    pub ior: V::Scalar,
    /// Probabilities of Lambert, mirror and dielectric; also the weights of the mixture.
    pub mix: [V::Scalar; 3],
    /// Whether Lambert and mirror are missing at the back.
    pub one_sided: bool,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Ideal<V> {
    /// Evaluates the diffuse part.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V) -> V {
        lambert::eval(self.base_color, wo, wi) * self.mix_at(wo)[0]
    }

    /// Returns the density of the diffuse part.
    #[inline(always)]
    pub fn pdf_w(&self, wo: V, wi: V) -> R {
        lambert::pdf_w(wo, wi) * self.mix_at(wo)[0]
    }

    /// Returns the probabilities of the lobes for light that leaves towards `wo`.
    #[inline(always)]
    fn mix_at(&self, wo: V) -> [R; 3] {
        let [diffuse, metal, glass] = self.mix;
        if !self.one_sided {
            return self.mix;
        }
        let at_front = |weight: R| R::select(wo.z().lt(R::splat(0.0)), R::splat(0.0), weight);
        [at_front(diffuse), at_front(metal), glass]
    }

    /// Samples a direction of one lobe; the mask is set where there is one. Its weight equals that
    /// of the mixture, since probabilities and weights coincide.
    #[inline(always)]
    pub fn sample(
        &self,
        wo: V,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>) {
        let [diffuse, metal, glass] = self.mix_at(wo);
        let (to_diffuse, no_glass) = (u.lt(diffuse), glass.le(R::splat(0.0)));
        let to_metal = !to_diffuse & (u.lt(diffuse + metal) | no_glass);
        let to_glass = !(to_diffuse | to_metal);
        let (mut valid, mut sample) = (!to_glass, MixtureSample::black());
        if to_diffuse.any() {
            let (some, s) = lambert::sample(self.base_color, wo, v);
            valid = valid & (some | !to_diffuse);
            let pdf_w = diffuse * lambert::pdf_w(wo, s.wi);
            sample = MixtureSample::new(s, pdf_w, R::Mask::splat(false));
        }
        if to_metal.any() {
            let s = mirror::sample(self.base_color, wo);
            let s = MixtureSample::new(s, metal, R::Mask::splat(true));
            sample = MixtureSample::select(to_metal, s, sample);
        }
        if to_glass.any() {
            let rest = ((u - diffuse - metal) / glass).clamp(0.0, 1.0);
            let (some, s, probability) =
                dielectric::sample(self.base_color, self.ior, wo, rest, mode);
            valid = valid | to_glass & some;
            let s = MixtureSample::new(s, glass * probability, R::Mask::splat(true));
            sample = MixtureSample::select(to_glass, s, sample);
        }
        if self.one_sided {
            // At the back, only the refractive share of the light is not absorbed.
            let behind = wo.z().lt(R::splat(0.0));
            valid = valid & (!behind | u.lt(glass));
        }
        (valid, sample)
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LocalBsdf<R> for Ideal<V> {
    #[inline(always)]
    fn new(class: &BsdfClass, m: &MaterialConstants<V>, p: &ShadingParameters<R>) -> Ideal<V> {
        Ideal {
            base_color: p.base_color,
            ior: m.ior,
            mix: p.mix(),
            one_sided: class.one_sided,
        }
    }

    #[inline(always)]
    fn packed(&self) -> Packed<R> {
        let color = Numbers::<R>::of_vector(self.base_color);
        let [a, b, c] = self.mix.map(|weight| weight.gt(R::splat(0.0)).any());
        Packed {
            numbers: Numbers::of(&[&color, &self.mix, &[self.ior]]),
            smooth: false,
            lobes: [a, b, c, false, false, false, false],
            anisotropic: false,
        }
    }

    #[inline(always)]
    fn load(class: &PackedClass, n: &Numbers<R>) -> Ideal<V> {
        Ideal {
            base_color: n.vector(0),
            mix: [n.get(3), n.get(4), n.get(5)],
            ior: n.get(6),
            one_sided: class.bsdf.one_sided,
        }
    }

    #[inline(always)]
    fn value(&self, wo: V, wi: V, _: TransportMode) -> (V, R) {
        (self.eval(wo, wi), self.pdf_w(wo, wi))
    }

    #[inline(always)]
    fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (some, s) = Ideal::sample(self, out.local, u, v, mode);
        (some, s, None)
    }

    #[inline(always)]
    fn traits(&self) -> Traits<R> {
        let (zero, [diffuse, metal, glass]) = (R::splat(0.0), self.mix);
        Traits {
            has_density: diffuse.gt(zero),
            has_dirac_lobe: metal.gt(zero) | glass.gt(zero),
            transmits: glass.gt(zero),
            index_inside: self.ior,
            front_only: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_one_sided_surface_absorbs_at_its_back_what_no_glass_transmits() {
        let surface = |one_sided| Ideal::<Vec3> {
            base_color: Vec3::ONE,
            ior: 1.5,
            mix: [0.5, 0.25, 0.25],
            one_sided,
        };
        let drawn = |one_sided, wo| {
            let choices = (0..100).map(|i| (i as f32 + 0.5) / 100.0);
            let valid = choices.filter(|u| {
                let mode = TransportMode::Radiance;
                surface(one_sided).sample(wo, *u, [0.3, 0.6], mode).0
            });
            valid.count()
        };
        let (front, back) = (Vec3::new(0.6, 0.0, 0.8), Vec3::new(0.6, 0.0, -0.8));
        assert_eq!(drawn(true, front), 100);
        assert_eq!(drawn(false, back), 100);
        assert_eq!(drawn(true, back), 25, "the share of the glass");
    }
}
