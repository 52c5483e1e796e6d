//! The BSDF: a mixture of lobes selected by the material's parameters.
//!
//! | weight | lobes of the model `disney` ([`disney`]) | of the model `lambert` ([`ideal`]) |
//! |---|---|---|
//! | (1 - metallic) opacity | [`diffuse`], sheen, [`ggx`] reflection above | [`lambert`] |
//! | metallic | [`ggx`] reflection with Schlick's reflectance | [`mirror`] |
//! | (1 - metallic) (1 - opacity) | [`ggx`] reflection and refraction | [`dielectric`] |
//! | clearcoat / 4, over all of these | [`clearcoat`] | |
//!
//! Reflection of dielectrics is exact Fresnel in the model `disney`.
//!
//! The models `conductor`, `plastic` and `dielectric` are single interfaces with microfacets of
//! either distribution, as in other renderers ([`interface`]).
//!
//! Below the roughness `smooth_below`, microfacet lobes are Dirac lobes.
//!
//! Directions are in the local frame whose z axis is the shading normal on the front side, and
//! whose x axis is the direction in which anisotropic highlights are stretched. Opaque surfaces are
//! two-sided.
//!
//! # Differences from the sources
//! The model is that of sections 2.1.3 and 4.8 of S0, with the clear coat that only
//! S1 has. The values of the opaque lobes are unchanged. Corrected, relative to the
//! program of S0:
//! - Microfacets are sampled with the density of visible normals, by which values are divided. The
//!   program samples another density, which darkens rough surfaces at grazing angles by up to a
//!   quarter.
//! - Glass chooses between reflection and refraction by the exact Fresnel reflectance of the
//!   microfacet. The program uses Schlick's formula for the macroscopic surface, which is off by up
//!   to 0.66 near the critical angle.
//! - Refraction has the signed sum `o . h + eta i . h` in its denominator [Walter et al. 2007],
//!   needed where values are used without the density that would cancel it, and scales radiance by
//!   the squared ratio of indices.
//! - Lobes below `smooth_below` are Dirac lobes instead of very narrow ones.
//! - A clear coat attenuates the layers below by its own reflectance ([`clearcoat`]).
//! - Light paths are corrected for shading normals ([`Bsdf::eval`]).
//!
//! Not corrected: the diffuse lobe reflects more than it receives ([`diffuse`]), and rough
//! microfacets lose the light of multiple reflections. A white metal of roughness 1 reflects `1 -
//! ln 2 = 0.31` of the light at normal incidence; white glass of that roughness and index 1.5
//! reflects and transmits 0.89 from outside and 0.42 from inside.

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
mod lobe;
pub mod mirror;
pub mod plastic;

pub use lobe::{LobeSample, MixtureSample, TransportMode};

use glam::Vec3;

use self::disney::Disney;
use self::ideal::Ideal;
use self::interface::InterfaceBsdf;
use super::surface::{Surface, lookup_scalar};
use crate::math::Frame;
use crate::math::real::{Real, Vector};
use crate::scene::compile::{Model, Texture};

/// A sampled direction in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Direction in which the path continues; a unit vector.
    pub wi: Vec3,
    /// `f |cos| / pdf_w`, the factor on the path's throughput.
    pub weight: Vec3,
    /// Density per solid angle, or the probability of the choice if `delta`.
    pub pdf_w: f32,
    /// Whether the direction has no density because its lobe is a Dirac lobe.
    pub delta: bool,
    /// Index ratio crossed; 1 without refraction.
    pub eta: f32,
}

/// A BSDF value with the densities of both directions of the path; Dirac lobes are left out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfValue<V: Vector = Vec3> {
    /// Value as returned by [`Bsdf::eval`].
    pub f: V,
    /// Density per solid angle of `wi` given `wo`, as returned by [`Bsdf::pdf_w`].
    pub pdf_w: V::Scalar,
    /// Density per solid angle of `wo` given `wi`.
    pub reverse_pdf_w: V::Scalar,
}

impl BsdfValue {
    /// The value of directions between which no light passes.
    const NONE: BsdfValue = BsdfValue {
        f: Vec3::ZERO,
        pdf_w: 0.0,
        reverse_pdf_w: 0.0,
    };
}

/// The BSDF at a point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    frame: Frame,
    n_geometric: Vec3,
    /// Whether the shading normal equals the geometric normal.
    flat: bool,
    /// Whether light may arrive from below the geometric surface: see
    /// [`super::surface::TerminatorOffset`].
    terminator: bool,
    model: BsdfModel,
}

/// The direction to the previous vertex with everything that the BSDF derives from it alone,
/// computed once for all directions that are combined with it.
#[derive(Clone, Copy, Debug)]
pub struct Outgoing {
    /// The unit direction.
    pub wo: Vec3,
    /// The direction in the local frame.
    local: Vec3,
    /// Whether the geometric and the shading normal agree on its side.
    same_side: bool,
    /// Derived quantities of the model `disney`.
    disney: disney::DisneyOutgoing,
}

#[derive(Clone, Copy, Debug)]
enum BsdfModel {
    Ideal(Ideal),
    Disney(Disney),
    Interface(InterfaceBsdf),
}

impl Bsdf {
    /// Builds the BSDF of a surface.
    #[inline]
    pub fn new(surface: &Surface, textures: &[Texture]) -> Bsdf {
        let m = surface.material;
        let scalar = |texture, value| lookup_scalar(textures, texture, surface.uv, m.tiling, value);
        let base_color = surface.base_color(textures);
        let metallic = scalar(m.metallic_texture, m.metallic);
        let opacity = scalar(m.opacity_texture, m.opacity);
        let dielectric = 1.0 - metallic;
        let [opaque, refractive] = [dielectric * opacity, dielectric * (1.0 - opacity)];
        let model = match m.model {
            Model::Conductor | Model::Plastic | Model::Dielectric => {
                let roughness = scalar(m.roughness_texture, m.roughness);
                match InterfaceBsdf::new(m, base_color, roughness) {
                    Some(interface) => BsdfModel::Interface(interface),
                    None => BsdfModel::Ideal(Ideal {
                        base_color,
                        ior: m.ior,
                        mix: [1.0, 0.0, 0.0],
                    }),
                }
            }
            Model::Lambert => BsdfModel::Ideal(Ideal {
                base_color,
                ior: m.ior,
                mix: [opaque, metallic, refractive],
            }),
            Model::Disney => {
                let roughness = scalar(m.roughness_texture, m.roughness);
                BsdfModel::Disney(Disney::new(
                    m,
                    base_color,
                    roughness,
                    [opaque, metallic, refractive],
                ))
            }
        };
        let n_geometric = surface.n_geometric;
        let flat = surface.n_shading == n_geometric;
        Bsdf {
            frame: frame(surface),
            n_geometric,
            flat,
            terminator: surface.terminator.is_some(),
            model,
        }
    }

    /// Computes everything that depends on `wo` alone.
    #[inline]
    pub fn outgoing(&self, wo: Vec3) -> Outgoing {
        let local = self.frame.to_local(wo);
        let disney = match &self.model {
            BsdfModel::Disney(k) => k.outgoing(local),
            BsdfModel::Ideal(_) | BsdfModel::Interface(_) => disney::DisneyOutgoing::default(),
        };
        Outgoing {
            wo,
            local,
            same_side: self.same_side(wo, local.z),
            disney,
        }
    }

    /// Returns the value `f` without cosine, of the lobes that have a density: Dirac lobes evaluate
    /// to zero.
    ///
    /// For [`TransportMode::Importance`], `wo` is the direction the light came from, and the value
    /// includes the correction of shading normals [Veach 1997, 5.3]: in both modes it is multiplied
    /// by the cosine of `wi` with the shading normal.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Vec3 {
        let Some((o, i)) = self.local_pair(wo, wi, mode) else {
            return Vec3::ZERO;
        };
        let f = match &self.model {
            BsdfModel::Ideal(k) => k.eval(o, i),
            BsdfModel::Disney(k) => k.eval(o, i, mode),
            BsdfModel::Interface(k) => k.eval(o, i, mode),
        };
        match mode {
            TransportMode::Radiance => f,
            TransportMode::Importance => f * self.adjoint(wo, wi, o.z, i.z),
        }
    }

    /// Returns the density per solid angle with which [`Bsdf::sample`] returns `wi`, without Dirac
    /// lobes.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.local_pair(wo, wi, TransportMode::Radiance)
            .map_or(0.0, |(o, i)| match &self.model {
                BsdfModel::Ideal(k) => k.pdf_w(o, i),
                BsdfModel::Disney(k) => k.pdf_w(o, i),
                BsdfModel::Interface(k) => k.pdf_w(o, i),
            })
    }

    /// Returns value and both densities at once, which is much cheaper than one by one.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> BsdfValue {
        self.values::<true>(&self.outgoing(wo), wi, mode)
    }

    /// Returns value and both densities for one of many directions `wi`.
    #[inline]
    pub fn evaluate_from(&self, out: &Outgoing, wi: Vec3, mode: TransportMode) -> BsdfValue {
        self.values::<true>(out, wi, mode)
    }

    /// Returns the value and the density of `wi` given `out`. Cheaper than [`Bsdf::evaluate_from`],
    /// for integrators that do not need the reverse density.
    #[inline]
    pub fn evaluate_forward(&self, out: &Outgoing, wi: Vec3, mode: TransportMode) -> (Vec3, f32) {
        let value = self.values::<false>(out, wi, mode);
        (value.f, value.pdf_w)
    }

    /// Implements [`Bsdf::evaluate`]; without `REVERSE` the reverse density is zero.
    #[inline]
    fn values<const REVERSE: bool>(
        &self,
        out: &Outgoing,
        wi: Vec3,
        mode: TransportMode,
    ) -> BsdfValue {
        let o = out.local;
        let cos_i = wi.dot(self.frame.n);
        let (f, [pdf_w, reverse_pdf_w]) = match &self.model {
            BsdfModel::Ideal(k) => {
                let i = self.frame.to_local(wi);
                (
                    k.eval(o, i),
                    [k.pdf_w(o, i), if REVERSE { k.pdf_w(i, o) } else { 0.0 }],
                )
            }
            BsdfModel::Disney(k) if k.is_isotropic() && o.z * cos_i > 0.0 => {
                k.evaluate_isotropic::<REVERSE>(&out.disney, out.wo, wi, self.frame.n, cos_i)
            }
            BsdfModel::Disney(k) => {
                k.evaluate::<REVERSE>(&out.disney, self.frame.to_local(wi), mode)
            }
            BsdfModel::Interface(k) => k.evaluate(o, self.frame.to_local(wi), mode),
        };
        if self.flat {
            let passes = out.same_side && cos_i != 0.0;
            let value = BsdfValue {
                f,
                pdf_w,
                reverse_pdf_w: if REVERSE { reverse_pdf_w } else { 0.0 },
            };
            return if passes { value } else { BsdfValue::NONE };
        }
        let f = match mode {
            TransportMode::Radiance => f,
            TransportMode::Importance => f * self.adjoint(out.wo, wi, o.z, cos_i),
        };
        let allowed = |mode| out.same_side && self.allows_incident(wi, cos_i, o.z, mode);
        let reversible = || {
            self.same_side(wi, cos_i)
                && self.allows_incident(out.wo, o.z, cos_i, TransportMode::Radiance)
        };
        BsdfValue {
            f: if allowed(mode) { f } else { Vec3::ZERO },
            pdf_w: if allowed(TransportMode::Radiance) {
                pdf_w
            } else {
                0.0
            },
            reverse_pdf_w: if REVERSE && reversible() {
                reverse_pdf_w
            } else {
                0.0
            },
        }
    }

    /// Returns the index of the medium on the side of `wi` over that on the side of `wo`: 1 if both
    /// are on the same side, or if the surface has no inside.
    #[inline]
    pub fn index_ratio(&self, wo: Vec3, wi: Vec3) -> f32 {
        let cos = [wo.dot(self.frame.n), wi.dot(self.frame.n)];
        if cos[0] * cos[1] >= 0.0 {
            return 1.0;
        }
        let inside = match &self.model {
            BsdfModel::Ideal(k) => k.ior,
            BsdfModel::Disney(k) => k.ior,
            BsdfModel::Interface(k) => k.index_inside(),
        };
        index_ratio(cos, inside)
    }

    /// Returns whether any lobe has a density, so that a connection to a light can contribute.
    #[inline]
    pub fn has_density(&self) -> bool {
        match &self.model {
            BsdfModel::Ideal(k) => k.mix[0] > 0.0,
            BsdfModel::Disney(k) => k.has_density(),
            BsdfModel::Interface(k) => k.has_density(),
        }
    }

    /// Samples a direction; `None` if nothing is reflected. `u` selects the lobe and, in the
    /// dielectric, between reflection and refraction; `v` selects the direction within a lobe that
    /// has a density.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: TransportMode) -> Option<BsdfSample> {
        self.sample_from(&self.outgoing(wo), u, v, mode)
    }

    /// Samples a direction for a precomputed `out`.
    #[inline]
    pub fn sample_from(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<BsdfSample> {
        self.samples::<false>(out, u, v, mode)
            .map(|(sample, _)| sample)
    }

    /// Samples a direction and returns it with the density of `wo` given the direction, zero for a
    /// Dirac lobe. Cheaper than evaluating that density separately.
    #[inline]
    pub fn sample_with_reverse(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<(BsdfSample, f32)> {
        self.samples::<true>(out, u, v, mode)
    }

    /// Implements [`Bsdf::sample_with_reverse`]; without `REVERSE` the reverse density is zero.
    #[inline]
    fn samples<const REVERSE: bool>(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<(BsdfSample, f32)> {
        if !out.same_side {
            return None;
        }
        let o = out.local;
        let (local, reverse) = self.sample_local::<REVERSE>(out, u, v, mode)?;
        let MixtureSample {
            sample,
            pdf_w,
            delta,
        } = local;
        let i = sample.wi.z;
        let wi = self.frame.to_world(sample.wi);
        if pdf_w <= 0.0 || !self.allows_incident(wi, i, o.z, mode) {
            return None;
        }
        let weight = match mode {
            TransportMode::Radiance => sample.weight,
            TransportMode::Importance => sample.weight * self.adjoint(out.wo, wi, o.z, i),
        };
        let reversible = REVERSE
            && self.same_side(wi, i)
            && self.allows_incident(out.wo, o.z, i, TransportMode::Radiance);
        let reverse = if reversible { reverse } else { 0.0 };
        Some((
            BsdfSample {
                wi,
                weight,
                pdf_w,
                delta,
                eta: sample.eta,
            },
            reverse,
        ))
    }

    /// Samples the model in the local frame, with the reverse density if `REVERSE`.
    #[inline]
    fn sample_local<const REVERSE: bool>(
        &self,
        out: &Outgoing,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<(MixtureSample, f32)> {
        let o = out.local;
        match &self.model {
            BsdfModel::Ideal(k) => {
                let s = k.sample(o, u, v, mode)?;
                let reverse = if REVERSE && !s.delta {
                    k.pdf_w(s.sample.wi, o)
                } else {
                    0.0
                };
                Some((s, reverse))
            }
            BsdfModel::Disney(k) => {
                let (some, s, reverse) = k.sample::<REVERSE>(&out.disney, u, v, mode);
                some.then_some((s, reverse))
            }
            BsdfModel::Interface(k) => {
                let s = k.sample(o, u, v, mode)?;
                let reverse = if REVERSE && !s.delta {
                    k.evaluate(o, s.sample.wi, mode).1[1]
                } else {
                    0.0
                };
                Some((s, reverse))
            }
        }
    }

    /// Returns whether a direction, with cosine `cos` to the shading normal, is on the same side of
    /// the geometric surface and of the surface that the shading normal suggests. Directions on
    /// different sides are black: light would leak through, or the inside be taken for the outside.
    #[inline]
    fn same_side(&self, w: Vec3, cos: f32) -> bool {
        if self.flat {
            cos != 0.0
        } else {
            w.dot(self.n_geometric) * cos > 0.0
        }
    }

    /// Returns whether light may pass between `wi` and an allowed outgoing direction, given their
    /// cosines with the shading normal. A surface with a terminator offset also reflects light that
    /// arrives from below the geometric surface.
    #[inline]
    fn allows_incident(&self, wi: Vec3, cos_i: f32, cos_o: f32, mode: TransportMode) -> bool {
        self.same_side(wi, cos_i)
            || (self.terminator && mode == TransportMode::Radiance && cos_o * cos_i > 0.0)
    }

    /// Returns both directions in the local frame if the geometric surface allows light between
    /// them.
    #[inline]
    fn local_pair(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Option<(Vec3, Vec3)> {
        let (o, i) = (self.frame.to_local(wo), self.frame.to_local(wi));
        (self.same_side(wo, o.z) && self.allows_incident(wi, i.z, o.z, mode)).then_some((o, i))
    }

    /// Returns the factor [`adjoint`] of this surface.
    #[inline]
    fn adjoint(&self, wo: Vec3, wi: Vec3, cos_o: f32, cos_i: f32) -> f32 {
        if self.flat {
            1.0
        } else {
            adjoint(self.n_geometric, [wo, wi], [cos_o, cos_i])
        }
    }
}

/// Returns [`Bsdf::index_ratio`] for directions with these cosines to the shading normal, on a
/// surface with the index `inside`; scalar or vectorised.
#[inline(always)]
pub fn index_ratio<R: Real>([cos_o, cos_i]: [R; 2], inside: R) -> R {
    let (zero, one) = (R::splat(0.0), R::splat(1.0));
    let across = R::select(cos_o.gt(zero), inside, one / inside);
    R::select((cos_o * cos_i).ge(zero), one, across)
}

/// Returns `|wo . n_s| |wi . n_g| / (|wo . n_g| |wi . n_s|)` for the geometric normal `n` and the
/// cosines with the shading normal `n_s`. Light arrives on the geometric surface, but camera paths
/// weight it by the cosine with the shading normal [Veach 1997, equation 5.19].
#[inline(always)]
pub fn adjoint<R: Real<Vec3 = V>, V: Vector<Scalar = R>>(
    n: V,
    [wo, wi]: [V; 2],
    [cos_o, cos_i]: [R; 2],
) -> R {
    let factor = (cos_o * wi.dot(n)) / (wo.dot(n) * cos_i);
    R::select(factor.is_finite(), factor.abs(), R::splat(0.0))
}

/// Builds the local frame: its x axis is the direction of anisotropy, if there is one.
#[inline]
fn frame(surface: &Surface) -> Frame {
    let n = surface.n_shading;
    if surface.tangent != Vec3::ZERO {
        let across = n.cross(surface.tangent);
        if let Some(t) = across.try_normalize() {
            return Frame {
                s: t.cross(n),
                t,
                n,
            };
        }
    }
    Frame::from_normal(n)
}
