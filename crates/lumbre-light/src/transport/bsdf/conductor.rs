//! A metal with a measured complex index of refraction, smooth or rough.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::interface::Interface;
use super::lobe::{LobeSample, MixtureSample, TransportMode};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::Numbers;
use super::outgoing::InterfaceOutgoing;
use crate::math::real::{Mask, Real, Vector};

/// A metal at a point of a surface, scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct Conductor<V: Vector = Vec3> {
    /// Factor on the reflectance.
    pub tint: V,
    /// Real part of the index by channel, relative to the outside.
    pub eta: V,
    /// Imaginary part of the index by channel, relative to the outside.
    pub k: V,
    /// Microfacets of its surface.
    pub facets: Facets<V::Scalar>,
}

/// Returns the reflectance of unpolarised light at a conductor [Born & Wolf 1999, 14.4]; 1 if `eta`
/// is 0 and `k` is not.
#[inline(always)]
pub fn reflectance<R: Real>(cos: R, eta: R, k: R) -> R {
    let (zero, one, half) = (R::splat(0.0), R::splat(1.0), R::splat(0.5));
    let cos2 = (cos * cos).min(one);
    let sin2 = one - cos2;
    let (eta2, k2) = (eta * eta, k * k);
    let t0 = eta2 - k2 - sin2;
    let a2b2 = (t0 * t0 + R::splat(4.0) * eta2 * k2).sqrt();
    let a = (half * (a2b2 + t0)).max(zero).sqrt();
    let (t1, t2) = (a2b2 + cos2, R::splat(2.0) * a * cos.abs());
    let perpendicular = ratio(t1 - t2, t1 + t2);
    let (t3, t4) = (cos2 * a2b2 + sin2 * sin2, t2 * sin2);
    let parallel = perpendicular * ratio(t3 - t4, t3 + t4);
    half * (perpendicular + parallel)
}

/// Returns the ratio of two amplitudes of [`reflectance`]. Both are zero if index and cosine
/// vanish: everything is reflected at grazing angles.
#[inline(always)]
fn ratio<R: Real>(up: R, down: R) -> R {
    let zero = R::splat(0.0);
    R::select(down.gt(zero), (up / down).max(zero), R::splat(1.0))
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Conductor<V> {
    #[inline(always)]
    fn fresnel(&self, cos: R) -> V {
        let (eta, k) = (self.eta, self.k);
        V::new(
            reflectance(cos, eta.x(), k.x()),
            reflectance(cos, eta.y(), k.y()),
            reflectance(cos, eta.z(), k.z()),
        ) * self.tint
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Interface<R> for Conductor<V> {
    const OPAQUE: bool = true;

    #[inline(always)]
    fn with_facets(
        _: &BsdfClass,
        m: &MaterialConstants<V>,
        base_color: V,
        facets: Facets<R>,
    ) -> Conductor<V> {
        Conductor {
            tint: base_color * m.specular,
            eta: m.eta,
            k: m.k,
            facets,
        }
    }

    #[inline(always)]
    fn body_numbers(&self) -> Vec<R> {
        [self.tint, self.eta, self.k]
            .map(Numbers::<R>::of_vector)
            .concat()
    }

    #[inline(always)]
    fn load_body(_: &BsdfClass, n: &Numbers<R>, facets: Facets<R>) -> Conductor<V> {
        Conductor {
            tint: n.vector(2),
            eta: n.vector(5),
            k: n.vector(8),
            facets,
        }
    }

    #[inline(always)]
    fn facets(&self) -> &Facets<R> {
        &self.facets
    }

    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<V>,
        _: V,
        i: V,
        _: TransportMode,
    ) -> (V, [R; 2]) {
        let (o, zero) = (out.o, R::splat(0.0));
        let black = V::splat(zero);
        let some = o.z().gt(zero) & i.z().gt(zero) & !self.facets.smooth;
        if !some.any() {
            return (black, [zero; 2]);
        }
        let h = (o + i).normalize_or(V::broadcast(Vec3::Z));
        let d = R::splat(0.25) * self.facets.d(h);
        let masking = [out.masking, self.facets.masking_over_cos(i)];
        let f = self.fresnel(o.dot(h)) * (masking[0] * d * masking[1]);
        (
            V::select(some, f, black),
            [
                R::select(some, masking[0] * d, zero),
                R::select(some, masking[1] * d, zero),
            ],
        )
    }

    #[inline(always)]
    fn sample(
        &self,
        out: &InterfaceOutgoing<V>,
        _: R,
        v: [R; 2],
        _: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (o, smooth) = (out.o, self.facets.smooth);
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let (mut valid, mut sample, mut reverse) = (smooth, MixtureSample::black(), zero);
        if smooth.any() {
            let wi = V::new(-o.x(), -o.y(), o.z());
            let weight = self.fresnel(o.z());
            let s = LobeSample {
                wi,
                weight,
                eta: one,
            };
            sample = MixtureSample::new(s, one, R::Mask::splat(true));
        }
        let rough = !smooth;
        if rough.any() {
            let h = self.facets.sample(o, v);
            let wi = mirrored(o, h);
            let up = wi.z().gt(zero) & o.dot(h).gt(zero);
            // Use the half vector of both directions: for narrow lobes the sampled normal has
            // digits that `wi` cannot represent.
            let (f, [pdf_w, back]) = self.evaluate::<true>(out, wi, wi, TransportMode::Radiance);
            let weight = f * (wi.z() / pdf_w);
            let s = LobeSample {
                wi,
                weight,
                eta: one,
            };
            valid = valid | rough & up & pdf_w.gt(zero) & weight.is_finite();
            let s = MixtureSample::new(s, pdf_w, R::Mask::splat(false));
            sample = MixtureSample::select(rough, s, sample);
            reverse = R::select(rough, back, zero);
        }
        (valid, sample, Some(reverse))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reflectance_is_that_of_normal_incidence_of_mirrors_and_of_dielectrics() {
        // ((eta - 1)^2 + k^2) / ((eta + 1)^2 + k^2).
        for (eta, k) in [(0.2f32, 3.9f32), (1.66, 9.2), (2.9, 3.0)] {
            let expected = ((eta - 1.0).powi(2) + k * k) / ((eta + 1.0).powi(2) + k * k);
            assert!(
                (reflectance(1.0, eta, k) - expected).abs() < 1e-5,
                "{eta} {k}"
            );
            assert!((reflectance(0.0, eta, k) - 1.0).abs() < 1e-5);
        }
        for cos in [0.0, 0.1, 0.5, 1.0] {
            assert!((reflectance(cos, 0.0, 1.0) - 1.0).abs() < 1e-5, "{cos}");
            let glass = super::super::fresnel::dielectric(cos, 1.5).reflectance;
            assert!((reflectance(cos, 1.5, 0.0) - glass).abs() < 1e-5, "{cos}");
        }
        assert!(reflectance(0.0, 0.0, 0.0).is_finite());
    }
}
