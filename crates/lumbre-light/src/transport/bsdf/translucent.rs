//! A thin diffuse sheet, such as paper, cloth or a leaf: ideal diffuse reflection on the side of the
//! light and ideal diffuse transmission on the other one, the same from both sides. As
//! `diffusetransmission` of pbrt and `difftrans` of Mitsuba 0.6; light is not refracted.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::lobe::{LobeSample, MixtureSample, TransportMode};
use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::Outgoing;
use crate::math::real::{Mask, Real, Vector};
use crate::math::warp;
use crate::transport::surface::ShadingParameters;

/// A translucent sheet at a point, scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Translucent<V: Vector = Vec3> {
    /// Albedo of the reflection.
    pub reflectance: V,
    /// Albedo of the transmission.
    pub transmittance: V,
    /// Probability of sampling the reflection: its share of the sum of both albedos.
    pub reflects: V::Scalar,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Translucent<V> {
    /// Builds a sheet of two albedos.
    #[inline(always)]
    pub fn new(reflectance: V, transmittance: V) -> Translucent<V> {
        let reflected = reflectance.element_sum();
        let sum = reflected + transmittance.element_sum();
        let some = sum.gt(R::splat(0.0));
        Translucent {
            reflectance,
            transmittance,
            reflects: R::select(some, reflected / sum, R::splat(1.0)),
        }
    }

    /// Returns the albedo of the side of `wi` over pi: of the reflection if `wo` is on it, else of
    /// the transmission; black for a direction in the surface.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V) -> V {
        let (zero, sides) = (R::splat(0.0), wo.z() * wi.z());
        let albedo = V::select(sides.gt(zero), self.reflectance, self.transmittance);
        V::select(
            sides.eq(zero),
            V::broadcast(Vec3::ZERO),
            albedo * R::splat(FRAC_1_PI),
        )
    }

    /// Returns the density of [`Translucent::sample`] per solid angle.
    #[inline(always)]
    pub fn pdf_w(&self, wo: V, wi: V) -> R {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let sides = wo.z() * wi.z();
        let side = R::select(sides.gt(zero), self.reflects, one - self.reflects);
        let cosine = warp::cosine_hemisphere_pdf_w(wi.z().abs());
        R::select(sides.eq(zero), zero, side * cosine)
    }

    /// Samples a direction with cosine density on a side that `u` selects; the mask is unset for a
    /// grazing direction of zero weight.
    #[inline(always)]
    pub fn sample(&self, wo: V, u: R, v: [R; 2]) -> (R::Mask, MixtureSample<V>) {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let reflected = u.lt(self.reflects);
        let side = R::select(reflected, self.reflects, one - self.reflects);
        let wi = warp::cosine_hemisphere(v);
        let some = wi.z().gt(zero) & side.gt(zero) & !wo.z().eq(zero);
        let same = wi.z().copysign(wo.z());
        let wi = V::new(wi.x(), wi.y(), R::select(reflected, same, -same));
        let sample = LobeSample {
            wi,
            weight: V::select(reflected, self.reflectance, self.transmittance) / side,
            eta: one,
        };
        (
            some,
            MixtureSample::new(sample, self.pdf_w(wo, wi), R::Mask::splat(false)),
        )
    }

    /// Returns whether anything is reflected or transmitted.
    #[inline(always)]
    pub fn has_density(&self) -> R::Mask {
        let black = V::broadcast(Vec3::ZERO);
        !self.reflectance.same(black) | self.transmits()
    }

    /// Returns whether anything is transmitted.
    #[inline(always)]
    pub fn transmits(&self) -> R::Mask {
        !self.transmittance.same(V::broadcast(Vec3::ZERO))
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LocalBsdf<R> for Translucent<V> {
    #[inline(always)]
    fn new(_: &BsdfClass, _: &MaterialConstants<V>, p: &ShadingParameters<R>) -> Translucent<V> {
        Translucent::new(p.base_color, p.transmittance())
    }

    #[inline(always)]
    fn packed(&self) -> Packed<R> {
        let [r, t] = [self.reflectance, self.transmittance].map(Numbers::<R>::of_vector);
        Packed {
            numbers: Numbers::of(&[&r, &t, &[self.reflects]]),
            smooth: false,
            lobes: [false; 7],
            anisotropic: false,
        }
    }

    #[inline(always)]
    fn load(_: &PackedClass, n: &Numbers<R>) -> Translucent<V> {
        Translucent {
            reflectance: n.vector(0),
            transmittance: n.vector(3),
            reflects: n.get(6),
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
        _: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (some, s) = Translucent::sample(self, out.local, u, v);
        (some, s, None)
    }

    #[inline(always)]
    fn traits(&self) -> Traits<R> {
        let transmits = self.transmits();
        Traits {
            has_density: self.has_density(),
            has_dirac_lobe: R::Mask::splat(false),
            transmits,
            index_inside: R::splat(1.0),
            front_only: false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_and_densities_at_directions_worked_out_by_hand() {
        let (r, t) = (Vec3::new(0.3, 0.2, 0.1), Vec3::new(0.1, 0.2, 0.3));
        let sheet = Translucent::new(r, t);
        assert_eq!(sheet.reflects, 0.5);
        let w = Vec3::new(0.6, 0.0, 0.8);
        for (wo, wi, albedo) in [(Vec3::Z, w, r), (-w, Vec3::Z, t), (-Vec3::Z, -w, r)] {
            let difference = sheet.eval(wo, wi) - albedo * FRAC_1_PI;
            assert!(difference.length() < 1e-7, "{wo} {wi}");
            let density = 0.5 * wi.z.abs() * FRAC_1_PI;
            assert!((sheet.pdf_w(wo, wi) - density).abs() < 1e-7);
        }
        // Light within the surface meets neither side.
        assert_eq!(sheet.eval(Vec3::Z, Vec3::X), Vec3::ZERO);
        assert_eq!(sheet.pdf_w(Vec3::Z, Vec3::X), 0.0);
    }

    #[test]
    fn a_sheet_without_one_of_the_lobes_never_samples_it() {
        let sides = |r: f32, t: f32| {
            let sheet = Translucent::new(Vec3::splat(r), Vec3::splat(t));
            [0.0, 0.5, 0.999_999].map(|u| {
                let (some, s) = sheet.sample(Vec3::Z, u, [0.3, 0.6]);
                assert_eq!(s.sample.weight, Vec3::splat(r + t));
                some.then_some(s.sample.wi.z > 0.0)
            })
        };
        assert_eq!(sides(0.5, 0.0), [Some(true); 3]);
        assert_eq!(sides(0.0, 0.5), [Some(false); 3]);
        assert!(!Translucent::new(Vec3::ZERO, Vec3::ZERO).has_density());
    }
}
