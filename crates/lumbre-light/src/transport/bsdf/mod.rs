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
//! The model `translucent` reflects and transmits diffusely ([`translucent`]), and `oren_nayar` is
//! rough and diffuse ([`oren_nayar`]).
//!
//! The models `conductor`, `plastic` and `dielectric` are single interfaces with microfacets of
//! either distribution, as in other renderers ([`interface`]).
//!
//! Below the roughness `smooth_below`, microfacet lobes are Dirac lobes.
//!
//! Directions are in the local frame whose z axis is the shading normal on the front side, and
//! whose x axis is the direction in which anisotropic highlights are stretched. Opaque lobes are the
//! same on both sides, unless the material is `one_sided`: then they are missing at the back.
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
mod local;
pub mod material;
pub mod mirror;
mod model;
mod numbers;
pub mod oren_nayar;
mod outgoing;
mod packed;
pub mod plastic;
mod scalar;
pub mod translucent;

pub use lobe::{LobeSample, MixtureSample, TransportMode};
pub use material::{BsdfClass, MaterialConstants};
pub use numbers::PackedClass;
pub use outgoing::Outgoing;
pub use packed::PackedBsdf;

use glam::Vec3;

use self::lobe::flipped;
use self::local::LocalBsdf;
use self::model::BsdfModel;
use super::surface::ShadingParameters;
use crate::math::Frame;
use crate::math::real::{Mask, Outlined, Real, Vector};

/// A sampled direction in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample<R: Real = f32> {
    /// Direction in which the path continues; a unit vector.
    pub wi: R::Vec3,
    /// `f |cos| / pdf_w`, the factor on the path's throughput.
    pub weight: R::Vec3,
    /// Density per solid angle, or the probability of the choice if `delta`.
    pub pdf_w: R,
    /// Whether the direction has no density because its lobe is a Dirac lobe.
    pub delta: R::Mask,
    /// Index ratio crossed; 1 without refraction.
    pub eta: R,
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

/// Orientation of a surface at a point, from which a BSDF is built.
#[derive(Clone, Copy, Debug)]
pub struct Orientation<R: Real = f32> {
    /// Unit normal of the primitive's front side.
    pub n_geometric: R::Vec3,
    /// Unit shading normal on the same side.
    pub n_shading: R::Vec3,
    /// Direction in which highlights are stretched: neither normalised nor orthogonal to the
    /// normal, zero without one. `None` if no lane has one.
    pub tangent: Option<R::Vec3>,
    /// Whether light may arrive from below the geometric surface: see
    /// [`super::surface::TerminatorOffset`].
    pub terminator: R::Mask,
}

/// The BSDF at a point of a surface; scalar, or in every lane of a vector for surfaces of one
/// [class](BsdfClass).
#[derive(Clone, Copy, Debug)]
pub struct Bsdf<R: Real = f32> {
    frame: Frame<R::Vec3>,
    n_geometric: R::Vec3,
    /// Whether the shading normal equals the geometric normal.
    flat: R::Mask,
    terminator: R::Mask,
    /// Whether all lobes are missing at the back.
    front_only: bool,
    model: BsdfModel<R::Vec3>,
}

impl<R: Real> Bsdf<R> {
    /// Builds the BSDF of materials of one class at points with these parameters.
    #[inline(always)]
    pub fn with_parameters(
        at: &Orientation<R>,
        class: &BsdfClass,
        constants: &MaterialConstants<R::Vec3>,
        parameters: &ShadingParameters<R>,
    ) -> Bsdf<R> {
        let model = BsdfModel::new(class, constants, parameters);
        Bsdf::with_model(at, class.one_sided, model)
    }

    /// Builds the BSDF of a model. If `one_sided`, its opaque lobes are missing at the back.
    #[inline(always)]
    fn with_model(at: &Orientation<R>, one_sided: bool, model: BsdfModel<R::Vec3>) -> Bsdf<R> {
        Bsdf {
            frame: at.frame(),
            n_geometric: at.n_geometric,
            flat: at.n_shading.same(at.n_geometric),
            terminator: at.terminator,
            front_only: one_sided && model.traits().front_only,
            model,
        }
    }

    /// Computes everything that depends on `wo` alone.
    #[inline(always)]
    pub fn outgoing(&self, wo: R::Vec3) -> Outgoing<R> {
        let local = self.frame.to_local(wo);
        let (disney, interface) = self.model.outgoing(local);
        Outgoing {
            wo,
            local,
            same_side: self.same_side(wo, local.z()),
            disney,
            interface,
        }
    }

    /// Returns the value `f` without cosine, of the lobes that have a density: Dirac lobes evaluate
    /// to zero. Also returns the density of `wi` and, with `REVERSE`, that of `out.wo` given `wi`,
    /// else zero. Lanes outside `wanted` are zero.
    ///
    /// For [`TransportMode::Importance`], `out.wo` is the direction the light came from, and the
    /// value includes the correction of shading normals [Veach 1997, 5.3]: in both modes it is
    /// multiplied by the cosine of `wi` with the shading normal.
    #[inline(always)]
    pub fn values<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        wi: R::Vec3,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> BsdfValue<R::Vec3> {
        R::outline(Evaluation::<R, REVERSE> {
            bsdf: self,
            out,
            wi,
            mode,
            wanted,
        })
    }

    /// Computes the result of [`Bsdf::values`].
    #[inline(always)]
    fn evaluate_lobes<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        wi: R::Vec3,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> BsdfValue<R::Vec3> {
        let zero = R::splat(0.0);
        let (cos_o, cos_i) = (out.local.z(), wi.dot(self.frame.n));
        let (mut f, [pdf_w, reverse]) =
            self.model
                .evaluate::<REVERSE>(&self.frame, out, (wi, cos_i), mode, wanted);
        if mode == TransportMode::Importance {
            f = f * self.adjoint([out.wo, wi], [cos_o, cos_i]);
        }
        let same = self.same_side(wi, cos_i);
        let both = wanted & out.same_side & same;
        let (mut passes, mut reversible) = (both, both);
        if self.terminator.any() {
            let above = wanted & self.terminator & (cos_o * cos_i).gt(zero);
            passes = both | above & out.same_side;
            reversible = both | above & same;
        }
        let lit = match mode {
            TransportMode::Radiance => passes,
            TransportMode::Importance => both,
        };
        BsdfValue {
            f: R::Vec3::select(lit, f, R::Vec3::splat(zero)),
            pdf_w: R::select(passes, pdf_w, zero),
            reverse_pdf_w: if REVERSE {
                R::select(reversible, reverse, zero)
            } else {
                zero
            },
        }
    }

    /// Samples a direction: `u` selects the lobe and, in the dielectric, between reflection and
    /// refraction; `v` selects the direction within a lobe that has a density. The mask is set
    /// where there is a sample; nothing is reflected elsewhere. Also returns the density of
    /// `out.wo` given the direction, zero for a Dirac lobe or without `REVERSE`.
    #[inline(always)]
    pub fn samples<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, BsdfSample<R>, R) {
        R::outline(Sampling::<R, REVERSE> {
            bsdf: self,
            out,
            u,
            v,
            mode,
        })
    }

    /// Computes the result of [`Bsdf::samples`].
    #[inline(always)]
    fn sample_lobes<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, BsdfSample<R>, R) {
        let zero = R::splat(0.0);
        let (some, local, reverse) = self.model.sample::<REVERSE>(out, u, v, mode);
        let reverse = match reverse {
            Some(reverse) => reverse,
            None if REVERSE && (!local.delta).any() => {
                let (_, reverse) = self.model.value(local.sample.wi, out.local, mode);
                R::select(local.delta, zero, reverse)
            }
            None => zero,
        };
        let MixtureSample {
            sample,
            pdf_w,
            delta,
        } = local;
        let (cos_o, cos_i) = (out.local.z(), sample.wi.z());
        let wi = self.frame.to_world(sample.wi);
        let same = self.same_side(wi, cos_i);
        let both = out.same_side & same;
        let (mut passes, mut reversible) = (both, both);
        if self.terminator.any() {
            let above = self.terminator & (cos_o * cos_i).gt(zero);
            reversible = both | above & same;
            if mode == TransportMode::Radiance {
                passes = both | above & out.same_side;
            }
        }
        let weight = match mode {
            TransportMode::Radiance => sample.weight,
            TransportMode::Importance => sample.weight * self.adjoint([out.wo, wi], [cos_o, cos_i]),
        };
        let reverse = if REVERSE {
            R::select(reversible, reverse, zero)
        } else {
            zero
        };
        let sample = BsdfSample {
            wi,
            weight,
            pdf_w,
            delta,
            eta: sample.eta,
        };
        (some & passes & pdf_w.gt(zero), sample, reverse)
    }

    /// Returns the index of the medium on the side of `wi` over that on the side of `wo`: 1 if both
    /// are on the same side, or if the surface has no inside.
    #[inline(always)]
    pub fn index_ratio(&self, wo: R::Vec3, wi: R::Vec3) -> R {
        let cos = [wo.dot(self.frame.n), wi.dot(self.frame.n)];
        if (cos[0] * cos[1]).lt(R::splat(0.0)).any() {
            index_ratio(cos, self.model.traits().index_inside)
        } else {
            R::splat(1.0)
        }
    }

    /// Returns whether any lobe has a density, so that a connection to a light can contribute.
    #[inline(always)]
    pub fn has_density(&self) -> R::Mask {
        self.model.traits().has_density
    }

    /// Returns whether any lobe is a Dirac lobe.
    #[inline(always)]
    pub fn has_dirac_lobe(&self) -> R::Mask {
        self.model.traits().has_dirac_lobe
    }

    /// Returns whether any lobe transmits light.
    #[inline(always)]
    pub fn transmits(&self) -> R::Mask {
        self.model.traits().transmits
    }

    /// Returns whether a direction, with cosine `cos` to the shading normal, is on the same side of
    /// the geometric surface and of the surface that the shading normal suggests. Directions on
    /// different sides are black: light would leak through, or the inside be taken for the outside.
    /// So is the back of a surface whose lobes are all missing there.
    ///
    /// A surface with a terminator offset also reflects radiance that arrives from below the
    /// geometric surface and above the one that the shading normal suggests.
    #[inline(always)]
    fn same_side(&self, w: R::Vec3, cos: R) -> R::Mask {
        let zero = R::splat(0.0);
        let same =
            self.flat & !cos.eq(zero) | !self.flat & (w.dot(self.n_geometric) * cos).gt(zero);
        if self.front_only {
            same & cos.gt(zero)
        } else {
            same
        }
    }

    /// Returns the factor [`adjoint`] of this surface for directions with these cosines to the
    /// shading normal.
    #[inline(always)]
    fn adjoint(&self, directions: [R::Vec3; 2], cos: [R; 2]) -> R {
        let one = R::splat(1.0);
        if (!self.flat).any() {
            R::select(self.flat, one, adjoint(self.n_geometric, directions, cos))
        } else {
            one
        }
    }
}

/// Outlined computation of [`Bsdf::values`].
struct Evaluation<'a, R: Real, const REVERSE: bool> {
    bsdf: &'a Bsdf<R>,
    out: &'a Outgoing<R>,
    wi: R::Vec3,
    mode: TransportMode,
    wanted: R::Mask,
}

impl<R: Real, const REVERSE: bool> Outlined for Evaluation<'_, R, REVERSE> {
    type Output = BsdfValue<R::Vec3>;

    #[inline(always)]
    fn run(self) -> BsdfValue<R::Vec3> {
        let Evaluation {
            bsdf,
            out,
            wi,
            mode,
            wanted,
        } = self;
        bsdf.evaluate_lobes::<REVERSE>(out, wi, mode, wanted)
    }
}

/// Outlined computation of [`Bsdf::samples`].
struct Sampling<'a, R: Real, const REVERSE: bool> {
    bsdf: &'a Bsdf<R>,
    out: &'a Outgoing<R>,
    u: R,
    v: [R; 2],
    mode: TransportMode,
}

impl<R: Real, const REVERSE: bool> Outlined for Sampling<'_, R, REVERSE> {
    type Output = (R::Mask, BsdfSample<R>, R);

    #[inline(always)]
    fn run(self) -> (R::Mask, BsdfSample<R>, R) {
        let Sampling {
            bsdf,
            out,
            u,
            v,
            mode,
        } = self;
        bsdf.sample_lobes::<REVERSE>(out, u, v, mode)
    }
}

impl<R: Real> Orientation<R> {
    /// Builds the local frame: its x axis is the direction of anisotropy, if there is one.
    #[inline(always)]
    fn frame(&self) -> Frame<R::Vec3> {
        let n = self.n_shading;
        let Some(tangent) = self.tangent else {
            return Frame::from_normal(n);
        };
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let across = n.cross(tangent);
        let scale = one / across.length();
        let usable = scale.is_finite() & scale.gt(zero) & !tangent.same(R::Vec3::splat(zero));
        let any = Frame::from_normal(n);
        let t = across * scale;
        Frame {
            s: R::Vec3::select(usable, t.cross(n), any.s),
            t: R::Vec3::select(usable, t, any.t),
            n,
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
