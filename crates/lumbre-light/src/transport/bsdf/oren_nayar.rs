//! A rough diffuse surface of Lambertian V-shaped grooves, whose facets have slopes with a Gaussian
//! distribution: the qualitative model of [Oren and Nayar 1994], equation 30, without
//! interreflection between the facets. The same on both sides.
//!
//! The qualitative model is reciprocal, but does not conserve energy exactly: at a roughness of 0.1,
//! a white surface reflects 1.012 of the light at grazing angles. Rougher surfaces lose light, since
//! interreflection is missing: at a roughness of 0.5, 0.67 is reflected at normal incidence.

use std::f32::consts::{FRAC_1_PI, FRAC_PI_2};

use glam::Vec3;

use super::lambert;
use super::lobe::{LobeSample, MixtureSample, TransportMode};
use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::Outgoing;
use crate::math::real::{Mask, Real, Vector};
use crate::transport::surface::ShadingParameters;

/// A rough diffuse surface at a point, scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrenNayar<V: Vector = Vec3> {
    /// Albedo of the facets.
    pub base_color: V,
    /// Factor on the Lambertian part.
    pub a: V::Scalar,
    /// Factor on the part that brightens towards the light.
    pub b: V::Scalar,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> OrenNayar<V> {
    /// Builds a surface of an albedo and a roughness from 0 to 1: the standard deviation of the
    /// slope angle of the facets, as a fraction of a right angle.
    #[inline(always)]
    pub fn new(base_color: V, roughness: R) -> OrenNayar<V> {
        let sigma = roughness * R::splat(FRAC_PI_2);
        let sigma2 = sigma * sigma;
        OrenNayar {
            base_color,
            a: R::splat(1.0) - R::splat(0.5) * sigma2 / (sigma2 + R::splat(0.33)),
            b: R::splat(0.45) * sigma2 / (sigma2 + R::splat(0.09)),
        }
    }

    /// Returns the value over that of a Lambertian surface, for directions on the same side.
    ///
    /// With the greater angle alpha and the smaller one beta, and the difference phi of the
    /// azimuths, `sin alpha tan beta cos phi` is the product of the horizontal parts of both
    /// directions over the greater cosine.
    #[inline(always)]
    fn factor(&self, wo: V, wi: V) -> R {
        let across = wo.x() * wi.x() + wo.y() * wi.y();
        let greater = wo.z().abs().max(wi.z().abs());
        self.a + self.b * across.max(R::splat(0.0)) / greater
    }

    /// Returns the value; black for directions on different sides.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V) -> V {
        V::select(
            (wo.z() * wi.z()).gt(R::splat(0.0)),
            self.base_color * (self.factor(wo, wi) * R::splat(FRAC_1_PI)),
            V::broadcast(Vec3::ZERO),
        )
    }

    /// Samples a direction on the side of `wo` with cosine density; the mask is unset for a grazing
    /// direction of zero weight.
    #[inline(always)]
    pub fn sample(&self, wo: V, v: [R; 2]) -> (R::Mask, MixtureSample<V>) {
        let (some, s) = lambert::sample(self.base_color, wo, v);
        let sample = LobeSample {
            weight: s.weight * self.factor(wo, s.wi),
            ..s
        };
        let pdf_w = lambert::pdf_w(wo, s.wi);
        (
            some,
            MixtureSample::new(sample, pdf_w, R::Mask::splat(false)),
        )
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LocalBsdf<R> for OrenNayar<V> {
    #[inline(always)]
    fn new(_: &BsdfClass, _: &MaterialConstants<V>, p: &ShadingParameters<R>) -> OrenNayar<V> {
        OrenNayar::new(p.base_color, p.roughness)
    }

    #[inline(always)]
    fn packed(&self) -> Packed<R> {
        let color = Numbers::<R>::of_vector(self.base_color);
        Packed {
            numbers: Numbers::of(&[&color, &[self.a, self.b]]),
            smooth: false,
            lobes: [false; 7],
            anisotropic: false,
        }
    }

    #[inline(always)]
    fn load(_: &PackedClass, n: &Numbers<R>) -> OrenNayar<V> {
        OrenNayar {
            base_color: n.vector(0),
            a: n.get(3),
            b: n.get(4),
        }
    }

    #[inline(always)]
    fn value(&self, wo: V, wi: V, _: TransportMode) -> (V, R) {
        (self.eval(wo, wi), lambert::pdf_w(wo, wi))
    }

    #[inline(always)]
    fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        _: R,
        v: [R; 2],
        _: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (some, s) = OrenNayar::sample(self, out.local, v);
        (some, s, None)
    }

    #[inline(always)]
    fn traits(&self) -> Traits<R> {
        Traits {
            has_density: R::Mask::splat(true),
            has_dirac_lobe: R::Mask::splat(false),
            transmits: R::Mask::splat(false),
            index_inside: R::splat(1.0),
            front_only: true,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_at_directions_worked_out_by_hand() {
        let color = Vec3::new(0.8, 0.5, 0.2);
        let w = Vec3::new(0.6, 0.0, 0.8);
        // Lambertian without roughness.
        let smooth = OrenNayar::new(color, 0.0);
        assert_eq!((smooth.a, smooth.b), (1.0, 0.0));
        assert_eq!(smooth.eval(w, Vec3::Z), color * FRAC_1_PI);
        // A standard deviation of 20 degrees: sigma^2 = 0.121847.
        let rough = OrenNayar::new(color, 20.0 / 90.0);
        assert!((rough.a - 0.865_166).abs() < 1e-5, "{}", rough.a);
        assert!((rough.b - 0.258_831).abs() < 1e-5, "{}", rough.b);
        // Straight back: sin alpha tan beta = 0.6 * 0.75. Forwards and along the normal: none.
        let back = color * ((rough.a + rough.b * 0.45) * FRAC_1_PI);
        let plain = color * (rough.a * FRAC_1_PI);
        let mirrored = Vec3::new(-0.6, 0.0, 0.8);
        for (wo, wi, expected) in [
            (w, w, back),
            (-w, -w, back),
            (w, mirrored, plain),
            (Vec3::Z, w, plain),
            (w, -w, Vec3::ZERO),
            // Greater angle of the direction with cosine 0.28, at the same azimuth.
            (
                w,
                Vec3::new(0.96, 0.0, 0.28),
                color * ((rough.a + rough.b * 0.96 * 0.75) * FRAC_1_PI),
            ),
        ] {
            let found = rough.eval(wo, wi);
            assert!((found - expected).length() < 1e-6, "{wo} {wi}: {found}");
            assert_eq!(rough.eval(wi, wo), found);
        }
    }
}
