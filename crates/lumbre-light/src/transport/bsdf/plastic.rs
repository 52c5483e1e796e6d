//! Plastic: a diffuse body under a smooth or rough dielectric surface, with all reflections between
//! the two [Weidlich & Wilkie 2007, as simplified by Mitsuba and Tungsten].
//!
//! The transmittance of the surface is computed from the exact Fresnel equations at the macroscopic
//! cosine, even if the surface is rough, as in Tungsten. With it a rough white plastic reflects up
//! to 1 % more than it receives at some angles, and less at grazing ones; tests bound this. The
//! formulas of Mitsuba take the transmittance of the microfacets instead, whose losses a white body
//! has, too.

use std::f32::consts::FRAC_1_PI;

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::interface::Interface;
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::Numbers;
use super::outgoing::{InterfaceOutgoing, PlasticSide};
use super::{LobeSample, MixtureSample, TransportMode, fresnel};
use crate::math::real::{Mask, Real, Vector};
use crate::math::warp;
use crate::scene::compile::{KNOTS, transmittance_at};

/// Plastic at a point of a surface, scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub struct Plastic<V: Vector = Vec3> {
    /// Albedo of the body.
    pub diffuse: V,
    /// Albedo of the body with all internal reflections, over the squared index.
    pub body: V,
    /// Factor on the surface reflection.
    pub specular: V,
    /// Index of the surface relative to the outside.
    pub ior: V::Scalar,
    /// Transmittance of the microfacets, as
    /// [`Transmittance`](crate::scene::compile::Transmittance); `None` if it is that of a smooth
    /// surface.
    pub transmittance: Option<[V::Scalar; KNOTS]>,
    /// Microfacets of the surface.
    pub facets: Facets<V::Scalar>,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Plastic<V> {
    /// Builds plastic. `internal` is the fraction of the diffuse light from inside that the surface
    /// reflects back; `nonlinear` if internally reflected light is tinted by the body's colour at
    /// each bounce.
    #[inline(always)]
    pub fn new(
        diffuse: V,
        specular: V,
        ior: R,
        (internal, nonlinear): (R, bool),
        facets: Facets<R>,
    ) -> Plastic<V> {
        let one = R::splat(1.0);
        let recurring = if nonlinear {
            diffuse * internal
        } else {
            V::splat(internal)
        };
        let rest = (V::splat(one) - recurring).at_least(R::splat(1e-6));
        let body = V::new(
            diffuse.x() / rest.x(),
            diffuse.y() / rest.y(),
            diffuse.z() / rest.z(),
        ) / (ior * ior);
        Plastic {
            diffuse,
            body,
            specular,
            ior,
            transmittance: None,
            facets,
        }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Interface<R> for Plastic<V> {
    const OPAQUE: bool = true;

    #[inline(always)]
    fn with_facets(
        class: &BsdfClass,
        m: &MaterialConstants<V>,
        base_color: V,
        facets: Facets<R>,
    ) -> Plastic<V> {
        let internal = (m.internal_reflectance, class.nonlinear);
        Plastic {
            transmittance: class.rough_body.then_some(m.transmittance),
            ..Plastic::new(base_color, m.specular, m.ior, internal, facets)
        }
    }

    #[inline(always)]
    fn body_numbers(&self) -> Vec<R> {
        let [specular, diffuse, body] =
            [self.specular, self.diffuse, self.body].map(Numbers::<R>::of_vector);
        let transmittance = self.transmittance.as_ref().map_or(&[][..], |t| t);
        [&specular[..], &[self.ior], &diffuse, &body, transmittance].concat()
    }

    #[inline(always)]
    fn load_body(class: &BsdfClass, n: &Numbers<R>, facets: Facets<R>) -> Plastic<V> {
        Plastic {
            specular: n.vector(2),
            ior: n.get(5),
            diffuse: n.vector(6),
            body: n.vector(9),
            transmittance: class.rough_body.then(|| n.array(12)),
            facets,
        }
    }

    #[inline(always)]
    fn facets(&self) -> &Facets<R> {
        &self.facets
    }

    #[inline(always)]
    fn side(&self, cos: R) -> PlasticSide<R> {
        let r = fresnel::dielectric(cos, self.ior).reflectance;
        let third = R::splat(1.0 / 3.0);
        let surface = r * (self.specular.element_sum() * third);
        let body = (R::splat(1.0) - r) * (self.diffuse.element_sum() * third);
        let some = (surface + body).gt(R::splat(0.0));
        PlasticSide {
            reflectance: r,
            through: match &self.transmittance {
                Some(transmittance) => transmittance_at(transmittance, cos),
                None => R::splat(1.0) - r,
            },
            surface: R::select(some, surface / (surface + body), R::splat(0.5)),
        }
    }

    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<V>,
        _: V,
        i: V,
        _: TransportMode,
    ) -> (V, [R; 2]) {
        let (o, zero, one) = (out.o, R::splat(0.0), R::splat(1.0));
        let black = V::splat(zero);
        let some = o.z().gt(zero) & i.z().gt(zero);
        if !some.any() {
            return (black, [zero; 2]);
        }
        let sides = [out.plastic, self.side(i.z())];
        let [through_o, through_i] = sides.map(|side| side.through);
        let surface = [sides[0].surface, sides[1].surface];
        let mut f = self.body * (through_o * through_i * R::splat(FRAC_1_PI));
        let mut pdf = [
            (one - surface[0]) * warp::cosine_hemisphere_pdf_w(i.z()),
            (one - surface[1]) * warp::cosine_hemisphere_pdf_w(o.z()),
        ];
        let rough = some & !self.facets.smooth;
        if rough.any() {
            let h = (o + i).normalize_or(V::broadcast(Vec3::Z));
            let d = R::splat(0.25) * self.facets.d(h);
            let masking = [out.masking, self.facets.masking_over_cos(i)];
            let r = fresnel::dielectric(o.dot(h).max(zero), self.ior).reflectance;
            let reflected = f + self.specular * (r * masking[0] * d * masking[1]);
            f = V::select(rough, reflected, f);
            let back = pdf[1] + surface[1] * masking[1] * d;
            pdf = [
                R::select(rough, pdf[0] + surface[0] * masking[0] * d, pdf[0]),
                R::select(rough, back, pdf[1]),
            ];
        }
        (
            V::select(some, f, black),
            [R::select(some, pdf[0], zero), R::select(some, pdf[1], zero)],
        )
    }

    #[inline(always)]
    fn sample(
        &self,
        out: &InterfaceOutgoing<V>,
        u: R,
        v: [R; 2],
        _: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (o, zero, one) = (out.o, R::splat(0.0), R::splat(1.0));
        let PlasticSide {
            reflectance,
            surface,
            ..
        } = out.plastic;
        let to_body = u.ge(surface);
        let to_mirror = !to_body & self.facets.smooth;
        let to_facets = !(to_body | to_mirror);
        let (mut valid, mut sample, mut reverse) = (to_mirror, MixtureSample::black(), zero);
        if to_mirror.any() {
            let s = LobeSample {
                wi: V::new(-o.x(), -o.y(), o.z()),
                weight: self.specular * (reflectance / surface),
                eta: one,
            };
            sample = MixtureSample::new(s, surface, R::Mask::splat(true));
        }
        let mut wi = o;
        if to_body.any() {
            wi = warp::cosine_hemisphere(v);
        }
        if to_facets.any() {
            wi = V::select(to_facets, mirrored(o, self.facets.sample(o, v)), wi);
        }
        let rough = !to_mirror;
        if rough.any() {
            let (f, [pdf_w, back]) = self.evaluate::<true>(out, wi, wi, TransportMode::Radiance);
            let weight = f * (wi.z() / pdf_w);
            let usable = wi.z().gt(zero) & pdf_w.gt(zero) & weight.is_finite();
            valid = valid | rough & usable;
            let s = LobeSample {
                wi,
                weight,
                eta: one,
            };
            let s = MixtureSample::new(s, pdf_w, R::Mask::splat(false));
            sample = MixtureSample::select(rough, s, sample);
            reverse = R::select(rough, back, zero);
        }
        (valid, sample, Some(reverse))
    }

    #[inline(always)]
    fn any_density(&self) -> R::Mask {
        !self.facets.smooth | !self.diffuse.same(V::broadcast(Vec3::ZERO))
    }
}
