//! The BSDF: a mixture of lobes chosen by the material's parameters.
//!
//! | weight | lobes of the model `disney` ([`disney`]) | of the model `lambert` ([`ideal`]) |
//! |---|---|---|
//! | (1 - metallic) opacity | [`diffuse`] with sheen, and a [`ggx`] reflection over it with exact Fresnel | [`lambert`] |
//! | metallic | [`ggx`] reflection with Schlick's reflectance | [`mirror`] |
//! | (1 - metallic) (1 - opacity) | [`ggx`] reflection and refraction with exact Fresnel | [`dielectric`] |
//! | clearcoat / 4, over all of these | [`clearcoat`] | |
//!
//! The models `conductor`, `plastic` and `dielectric` are single interfaces with microfacets of either distribution, as
//! other renderers have them ([`interface`]).
//!
//! Below the roughness `smooth_below` the lobes of microfacets are Dirac lobes.
//!
//! Directions are in the local frame whose z axis is the shading normal on the front side, and whose x axis is the
//! direction in which anisotropic highlights are stretched. Opaque surfaces are two-sided.
//!
//! # Where this is not what the sources do
//! The model is that of sections 2.1.3 and 4.8 of the first document, with the clear coat that only the second has. The
//! values of its opaque lobes are kept. Corrected, against the program of the first document:
//! - microfacets are drawn with the density that is divided by, that of visible normals; there it is another one, which
//!   darkens rough surfaces at grazing angles by up to a quarter;
//! - glass chooses between reflection and refraction by the exact Fresnel reflectance of the microfacet, not by
//!   Schlick's of the surface, which near the critical angle is off by up to 0.66;
//! - refraction has the signed sum `o . h + eta i . h` in its denominator [Walter et al. 2007], needed where values are
//!   used without the density that would cancel it, and scales radiance by the squared ratio of indices;
//! - lobes below `smooth_below` are Dirac lobes instead of very narrow ones;
//! - a clear coat takes from what lies below it what it reflects ([`clearcoat`]);
//! - light paths correct for shading normals ([`Bsdf::eval`]).
//!
//! Not corrected: the diffuse lobe gives more than it gets ([`diffuse`]), and rough microfacets lose what they reflect
//! onto each other: a white metal of roughness 1 reflects `1 - ln 2 = 0.31` of the light that falls on it straight,
//! white glass of that roughness and index 1.5 0.89 from outside and 0.42 from inside.

pub mod beckmann;
pub mod clearcoat;
pub mod conductor;
pub mod dielectric;
pub mod diffuse;
pub mod disney;
pub mod facets;
pub mod fresnel;
pub mod ggx;
pub mod glass;
pub mod ideal;
pub mod interface;
pub mod lambert;
pub mod mirror;
pub mod plastic;

use glam::Vec3;

use self::disney::Disney;
use self::ideal::Ideal;
use self::interface::Interface;
use super::surface::{Surface, lookup_scalar};
use crate::math::Frame;
use crate::math::real::{Mask, Real, Vector};
use crate::scene::compile::{Model, Texture};

/// What is transported: it decides how refraction scales [Veach 1997, 5.2] and what a shading normal does [5.3].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Radiance, along camera paths.
    Radiance,
    /// Importance, along light paths.
    Importance,
}

/// A sampled direction in a lobe's local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeSample<V: Vector = Vec3> {
    /// The direction.
    pub wi: V,
    /// `f |cos| / pdf_w` of this lobe alone.
    pub weight: V,
    /// Index ratio crossed: inside over outside when entering, its inverse when leaving, 1 when reflected.
    pub eta: V::Scalar,
}

/// A sampled direction of a mixture in the local frame; the weight is that of the mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Local<V: Vector = Vec3> {
    /// Direction, weight and index ratio.
    pub sample: LobeSample<V>,
    /// Density of the mixture, or the probability of the choice where `delta`.
    pub pdf_w: V::Scalar,
    /// Whether the lobe is a Dirac.
    pub delta: <V::Scalar as Real>::Mask,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Local<V> {
    #[inline(always)]
    fn new(sample: LobeSample<V>, pdf_w: R, delta: R::Mask) -> Local<V> {
        Local { sample, pdf_w, delta }
    }

    /// Nothing, black.
    #[inline(always)]
    fn none() -> Local<V> {
        let zero = R::of(0.0);
        let (wi, weight) = (V::all(zero), V::all(zero));
        Local::new(LobeSample { wi, weight, eta: R::of(1.0) }, zero, R::Mask::of(true))
    }

    /// `yes` where the mask is set, else `no`.
    #[inline(always)]
    fn select(mask: R::Mask, yes: Local<V>, no: Local<V>) -> Local<V> {
        Local {
            sample: LobeSample {
                wi: V::select(mask, yes.sample.wi, no.sample.wi),
                weight: V::select(mask, yes.sample.weight, no.sample.weight),
                eta: R::select(mask, yes.sample.eta, no.sample.eta),
            },
            pdf_w: R::select(mask, yes.pdf_w, no.pdf_w),
            delta: mask & yes.delta | !mask & no.delta,
        }
    }
}

/// A sampled direction in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the path goes on; a unit vector.
    pub wi: Vec3,
    /// `f |cos| / pdf_w`: what the path's throughput is multiplied by.
    pub weight: Vec3,
    /// Density per solid angle, or the probability of the choice where `delta`.
    pub pdf_w: f32,
    /// Whether the direction has no density because its lobe is a Dirac.
    pub delta: bool,
    /// Index ratio crossed; 1 without refraction.
    pub eta: f32,
}

/// A value with the densities of both directions in which a path may run through it; Dirac lobes are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfValue<V: Vector = Vec3> {
    /// As [`Bsdf::eval`].
    pub f: V,
    /// Density per solid angle of `wi` given `wo`, as [`Bsdf::pdf_w`].
    pub pdf_w: V::Scalar,
    /// Density per solid angle of `wo` given `wi`.
    pub reverse_pdf_w: V::Scalar,
}

impl BsdfValue {
    /// Where no light passes.
    const NONE: BsdfValue = BsdfValue { f: Vec3::ZERO, pdf_w: 0.0, reverse_pdf_w: 0.0 };
}

/// The BSDF at a point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    frame: Frame,
    n_geometric: Vec3,
    /// Whether the shading normal is that of the real surface.
    flat: bool,
    /// Whether light may arrive below the real surface: see [`super::surface::Overhang`].
    overhang: bool,
    kind: Kind,
}

/// One direction of a BSDF, the one to where the path came from, with all that depends on it alone: made once, and used
/// for every direction that is joined to it.
#[derive(Clone, Copy, Debug)]
pub struct Outgoing {
    /// The unit direction.
    pub wo: Vec3,
    /// The same in the local frame.
    local: Vec3,
    /// Whether the real surface allows it.
    agrees: bool,
    /// For the model `disney`.
    view: disney::View,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    Ideal(Ideal),
    Disney(Disney),
    Interface(Interface),
}

impl Bsdf {
    /// The BSDF of a surface.
    #[inline]
    pub fn new(surface: &Surface, textures: &[Texture]) -> Bsdf {
        let m = surface.material;
        let scalar = |texture, value| lookup_scalar(textures, texture, surface.uv, m.tiling, value);
        let base_color = surface.base_color(textures);
        let metallic = scalar(m.metallic_texture, m.metallic);
        let opacity = scalar(m.opacity_texture, m.opacity);
        let dielectric = 1.0 - metallic;
        let [opaque, refractive] = [dielectric * opacity, dielectric * (1.0 - opacity)];
        let kind = match m.model {
            Model::Conductor | Model::Plastic | Model::Dielectric => {
                let roughness = scalar(m.roughness_texture, m.roughness);
                match Interface::new(m, base_color, roughness) {
                    Some(interface) => Kind::Interface(interface),
                    None => Kind::Ideal(Ideal { base_color, ior: m.ior, mix: [1.0, 0.0, 0.0] }),
                }
            }
            Model::Lambert => Kind::Ideal(Ideal { base_color, ior: m.ior, mix: [opaque, metallic, refractive] }),
            Model::Disney => {
                let roughness = scalar(m.roughness_texture, m.roughness);
                Kind::Disney(Disney::new(m, base_color, roughness, [opaque, metallic, refractive]))
            }
        };
        let n_geometric = surface.n_geometric;
        let flat = surface.n_shading == n_geometric;
        Bsdf { frame: frame(surface), n_geometric, flat, overhang: surface.overhang.is_some(), kind }
    }

    /// What depends on `wo` alone.
    #[inline]
    pub fn outgoing(&self, wo: Vec3) -> Outgoing {
        let local = self.frame.to_local(wo);
        let view = match &self.kind {
            Kind::Disney(k) => k.view(local),
            Kind::Ideal(_) | Kind::Interface(_) => disney::View::default(),
        };
        Outgoing { wo, local, agrees: self.agrees(wo, local.z), view }
    }

    /// Value `f` without cosine, of the lobes that have one: Dirac lobes evaluate to zero.
    ///
    /// For [`Mode::Importance`], where `wo` is where the light came from, it includes the correction of shading normals
    /// [Veach 1997, 5.3], so that both modes are multiplied by the cosine of `wi` with the shading normal.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: Mode) -> Vec3 {
        let Some((o, i)) = self.local_pair(wo, wi, mode) else { return Vec3::ZERO };
        let f = match &self.kind {
            Kind::Ideal(k) => k.eval(o, i),
            Kind::Disney(k) => k.eval(o, i, mode),
            Kind::Interface(k) => k.eval(o, i, mode),
        };
        match mode {
            Mode::Radiance => f,
            Mode::Importance => f * self.adjoint(wo, wi, o.z, i.z),
        }
    }

    /// Density per solid angle with which [`Bsdf::sample`] returns `wi`, Dirac lobes left out.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.local_pair(wo, wi, Mode::Radiance).map_or(0.0, |(o, i)| match &self.kind {
            Kind::Ideal(k) => k.pdf_w(o, i),
            Kind::Disney(k) => k.pdf_w(o, i),
            Kind::Interface(k) => k.pdf_w(o, i),
        })
    }

    /// Value and both densities at once: much cheaper than one by one.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: Mode) -> BsdfValue {
        self.values::<true>(&self.outgoing(wo), wi, mode)
    }

    /// The same for many directions `wi`.
    #[inline]
    pub fn evaluate_from(&self, out: &Outgoing, wi: Vec3, mode: Mode) -> BsdfValue {
        self.values::<true>(out, wi, mode)
    }

    /// Value and density of `wi` given the other direction; cheaper still, for integrators that have no use for the density
    /// of the way back.
    #[inline]
    pub fn evaluate_forward(&self, out: &Outgoing, wi: Vec3, mode: Mode) -> (Vec3, f32) {
        let value = self.values::<false>(out, wi, mode);
        (value.f, value.pdf_w)
    }

    /// [`Bsdf::evaluate`]; without `REVERSE` the reverse density is zero.
    #[inline]
    fn values<const REVERSE: bool>(&self, out: &Outgoing, wi: Vec3, mode: Mode) -> BsdfValue {
        let o = out.local;
        let cos_i = wi.dot(self.frame.n);
        let (f, [pdf_w, reverse_pdf_w]) = match &self.kind {
            Kind::Ideal(k) => {
                let i = self.frame.to_local(wi);
                (k.eval(o, i), [k.pdf_w(o, i), if REVERSE { k.pdf_w(i, o) } else { 0.0 }])
            }
            Kind::Disney(k) if k.is_round() && o.z * cos_i > 0.0 => {
                k.evaluate_round::<REVERSE>(&out.view, out.wo, wi, self.frame.n, cos_i)
            }
            Kind::Disney(k) => k.evaluate::<REVERSE>(&out.view, self.frame.to_local(wi), mode),
            Kind::Interface(k) => k.evaluate(o, self.frame.to_local(wi), mode),
        };
        if self.flat {
            let lets_through = out.agrees && cos_i != 0.0;
            let value = BsdfValue { f, pdf_w, reverse_pdf_w: if REVERSE { reverse_pdf_w } else { 0.0 } };
            return if lets_through { value } else { BsdfValue::NONE };
        }
        let f = match mode {
            Mode::Radiance => f,
            Mode::Importance => f * self.adjoint(out.wo, wi, o.z, cos_i),
        };
        let lets_in = |mode| out.agrees && self.lets_in(wi, cos_i, o.z, mode);
        let returns = || self.agrees(wi, cos_i) && self.lets_in(out.wo, o.z, cos_i, Mode::Radiance);
        BsdfValue {
            f: if lets_in(mode) { f } else { Vec3::ZERO },
            pdf_w: if lets_in(Mode::Radiance) { pdf_w } else { 0.0 },
            reverse_pdf_w: if REVERSE && returns() { reverse_pdf_w } else { 0.0 },
        }
    }

    /// Ratio of the index of the medium on the side of `wi` to that on the side of `wo`: 1 where both are on one side, and
    /// where there is no inside.
    #[inline]
    pub fn index_ratio(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = [wo.dot(self.frame.n), wi.dot(self.frame.n)];
        if cos[0] * cos[1] >= 0.0 {
            return 1.0;
        }
        let inside = match &self.kind {
            Kind::Ideal(k) => k.ior,
            Kind::Disney(k) => k.ior,
            Kind::Interface(k) => k.index_inside(),
        };
        index_ratio(cos, inside)
    }

    /// Whether any lobe has a density, so that a connection to a light can carry something.
    #[inline]
    pub fn has_density(&self) -> bool {
        match &self.kind {
            Kind::Ideal(k) => k.mix[0] > 0.0,
            Kind::Disney(k) => k.has_density(),
            Kind::Interface(k) => k.has_density(),
        }
    }

    /// Samples a direction; `None` where nothing is reflected. `u` chooses the lobe and, in the dielectric, between
    /// reflection and refraction; `v` chooses within a lobe that has a density.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: Mode) -> Option<BsdfSample> {
        self.sample_from(&self.outgoing(wo), u, v, mode)
    }

    /// The same where more than that is asked of one direction.
    #[inline]
    pub fn sample_from(&self, out: &Outgoing, u: f32, v: [f32; 2], mode: Mode) -> Option<BsdfSample> {
        self.samples::<false>(out, u, v, mode).map(|(sample, _)| sample)
    }

    /// The same, with the density of `wo` given the direction; zero for a Dirac lobe. Cheaper than asking for it by itself.
    #[inline]
    pub fn sample_with_reverse(&self, out: &Outgoing, u: f32, v: [f32; 2], mode: Mode) -> Option<(BsdfSample, f32)> {
        self.samples::<true>(out, u, v, mode)
    }

    /// [`Bsdf::sample_with_reverse`]; without `REVERSE` the reverse density is zero.
    #[inline]
    fn samples<const REVERSE: bool>(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: Mode,
    ) -> Option<(BsdfSample, f32)> {
        if !out.agrees {
            return None;
        }
        let o = out.local;
        let (Local { sample, pdf_w, delta }, reverse) = match &self.kind {
            Kind::Ideal(k) => {
                let s = k.sample(o, u, v, mode)?;
                let reverse = if REVERSE && !s.delta { k.pdf_w(s.sample.wi, o) } else { 0.0 };
                (s, reverse)
            }
            Kind::Disney(k) => {
                let (some, s, reverse) = k.sample::<REVERSE>(&out.view, u, v, mode);
                some.then_some((s, reverse))?
            }
            Kind::Interface(k) => {
                let s = k.sample(o, u, v, mode)?;
                let reverse = if REVERSE && !s.delta { k.evaluate(o, s.sample.wi, mode).1[1] } else { 0.0 };
                (s, reverse)
            }
        };
        let i = sample.wi.z;
        let wi = self.frame.to_world(sample.wi);
        if pdf_w <= 0.0 || !self.lets_in(wi, i, o.z, mode) {
            return None;
        }
        let weight = match mode {
            Mode::Radiance => sample.weight,
            Mode::Importance => sample.weight * self.adjoint(out.wo, wi, o.z, i),
        };
        let returns = REVERSE && self.agrees(wi, i) && self.lets_in(out.wo, o.z, i, Mode::Radiance);
        let reverse = if returns { reverse } else { 0.0 };
        Some((BsdfSample { wi, weight, pdf_w, delta, eta: sample.eta }, reverse))
    }

    /// Whether a direction, of cosine `cos` with the shading normal, is on the same side of the real surface and of the one
    /// that the shading normal suggests. Where it is not, light would leak through or an inside be taken for an outside:
    /// such directions are black.
    #[inline]
    fn agrees(&self, w: Vec3, cos: f32) -> bool {
        if self.flat { cos != 0.0 } else { w.dot(self.n_geometric) * cos > 0.0 }
    }

    /// Whether light may pass between `wi` and a direction that is allowed, of these cosines with the shading normal: where
    /// the surface has an overhang, light that arrives from below the real surface is reflected as well.
    #[inline]
    fn lets_in(&self, wi: Vec3, cos_i: f32, cos_o: f32, mode: Mode) -> bool {
        self.agrees(wi, cos_i) || (self.overhang && mode == Mode::Radiance && cos_o * cos_i > 0.0)
    }

    /// Both directions in the local frame, if the real surface allows light between them.
    #[inline]
    fn local_pair(&self, wo: Vec3, wi: Vec3, mode: Mode) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        (self.agrees(wo, o.z) && self.lets_in(wi, i.z, o.z, mode)).then_some((o, i))
    }

    /// [`adjoint`] of this surface.
    #[inline]
    fn adjoint(&self, wo: Vec3, wi: Vec3, cos_o: f32, cos_i: f32) -> f32 {
        if self.flat { 1.0 } else { adjoint(self.n_geometric, [wo, wi], [cos_o, cos_i]) }
    }
}

/// [`Bsdf::index_ratio`] of directions with these cosines with the shading normal, on a surface with this index inside; for
/// any number of surfaces.
#[inline(always)]
pub fn index_ratio<R: Real>([cos_o, cos_i]: [R; 2], inside: R) -> R {
    let (zero, one) = (R::of(0.0), R::of(1.0));
    let across = R::select(cos_o.gt(zero), inside, one / inside);
    R::select((cos_o * cos_i).ge(zero), one, across)
}

/// |wo . n_s| |wi . n_g| / (|wo . n_g| |wi . n_s|), where the cosines are those with the shading normal n_s: light arrives on
/// the real surface, but a camera path weighs it with the shading normal's cosine [Veach 1997, equation 5.19].
#[inline(always)]
pub fn adjoint<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(n: V, [wo, wi]: [V; 2], [cos_o, cos_i]: [R; 2]) -> R {
    let factor = (cos_o * wi.dot(n)) / (wo.dot(n) * cos_i);
    R::select(factor.is_finite(), factor.abs(), R::of(0.0))
}

/// The local frame: its x axis along the direction of anisotropy, where there is one.
#[inline]
fn frame(surface: &Surface) -> Frame {
    let n = surface.n_shading;
    if surface.tangent != Vec3::ZERO {
        let across = n.cross(surface.tangent);
        if let Some(t) = across.try_normalize() {
            return Frame { s: t.cross(n), t, n };
        }
    }
    Frame::from_normal(n)
}
