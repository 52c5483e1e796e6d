//! The adapted Disney BSDF: a dielectric that is opaque or refractive, a metal, and a clear coat.
//!
//! All computations place `wo` on the upper side: opaque lobes are the same on both sides of a
//! surface, or missing at the back of a one-sided one, and the refractive one sees the inverse index
//! from inside.
//!
//! With [vector types](crate::math::real), all lanes hold surfaces of one
//! [class](super::material::BsdfClass): whether reflectance is tinted is the same in every lane.
//! Lobes may be missing in some lanes, where their weight is zero.

mod parameters;
mod sampling;
#[cfg(test)]
mod tests;

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::diffuse::Diffuse;
use super::fresnel;
use super::ggx::{Ggx, HalfVector};
use super::glass::Refraction;
use super::lobe::{MixtureSample, TransportMode, flipped};
use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::{DisneyOutgoing, InterfaceOutgoing, LobeProbabilities, Outgoing};
use crate::math::real::{Mask, Real, Vector};
use crate::math::{Frame, warp};
use crate::scene::compile::Formulas;
use crate::transport::surface::ShadingParameters;

/// A refractive interface bends rays by about `|ior - 1| alpha`. Below this many radians the half
/// vector of a refraction has no significant digits in single precision, and the interface is
/// treated as smooth: it looks smooth, and its reflection is too weak to be seen.
const MIN_BEND: f32 = 1e-4;

/// The parameters of the Disney BSDF at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disney<V: Vector = Vec3> {
    /// Base colour of all lobes.
    pub base_color: V,
    /// (1 - metallic) opacity: weight of the diffuse lobe and of the specular reflection over it.
    pub opaque: V::Scalar,
    /// Weight of the metal.
    pub metallic: V::Scalar,
    /// (1 - metallic) (1 - opacity): weight of the refractive dielectric.
    pub refractive: V::Scalar,
    /// Index of the inside relative to the outside.
    pub ior: V::Scalar,
    /// Tinted reflectance of the opaque dielectric at normal incidence; `None` if untinted.
    pub tinted_f0: Option<V>,
    /// Share of the tint in `tinted_f0`, by the formulas of Mitsuba; `None` by those of this
    /// renderer.
    pub schlick_share: Option<V::Scalar>,
    /// The diffuse lobe.
    pub diffuse: Diffuse<V>,
    /// The microfacets of all lobes except the coat.
    pub ggx: Ggx<V::Scalar>,
    /// Whether the microfacets may be anisotropic; otherwise both widths are equal in every lane.
    pub anisotropic: bool,
    /// Whether the opaque lobes and the coat are missing at the back.
    pub one_sided: bool,
    /// Whether the microfacets are Dirac lobes.
    pub smooth: <V::Scalar as Real>::Mask,
    /// The clear coat.
    pub coat: Clearcoat<V::Scalar>,
    /// Derived from all other parameters.
    pub estimate: LobeEstimate<V::Scalar>,
}

/// The geometry of two directions on the upper side that reflection between them depends on.
struct DirectionPair<R> {
    /// Cosines of `o` and `i` with the normal.
    cos: [R; 2],
    /// Masking of `i` over its cosine.
    masking: R,
    /// Cosine between the half vector and either direction.
    cos_d: R,
    half: HalfVector<R>,
}

/// Estimated reflectance of the lobes: the part of [`LobeProbabilities`] that is the same for a
/// whole surface. All lobes are estimated by Schlick's formula, which is accurate enough to choose
/// by and needs no square roots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LobeEstimate<R = f32> {
    /// Estimate for the diffuse lobe.
    pub diffuse: R,
    /// Estimate for the reflection at normal incidence.
    pub reflection: R,
    /// Increase of the reflection towards grazing angles.
    pub rise: R,
}

/// Returns the reflectance at normal incidence of an index.
#[inline(always)]
pub fn f0_of<R: Real>(ior: R) -> R {
    let one = R::splat(1.0);
    let r = (ior - one) / (ior + one);
    r * r
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Disney<V> {
    /// Returns the reflectance of the opaque dielectric: the exact Fresnel equations from outside,
    /// tinted at normal incidence and blending to white as the exact reflectance does (the
    /// adaptation of S0). By the formulas of Mitsuba, the tinted share blends to white by Schlick's
    /// formula instead.
    #[inline(always)]
    fn dielectric_reflectance(&self, cos: R) -> V {
        let exact = fresnel::dielectric(cos.abs(), self.ior).reflectance;
        match self.tinted_f0 {
            None => V::splat(exact),
            Some(tinted) => {
                let f0 = f0_of(self.ior);
                if let Some(share) = self.schlick_share {
                    let white = fresnel::schlick_weight(cos.abs());
                    let rest = R::splat(1.0) - white;
                    let plain = (R::splat(1.0) - share) * (exact - f0 * rest);
                    return tinted * rest + V::splat(plain + share * white);
                }
                // The reflectance of a high index dips below its value at normal incidence before
                // it rises.
                let blend = (exact - f0) / (R::splat(1.0) - f0);
                (tinted + (V::splat(R::splat(1.0)) - tinted) * blend).at_least(R::splat(0.0))
            }
        }
    }

    /// Returns the weighted sum of the reflectances of the opaque dielectric and the metal.
    #[inline(always)]
    fn opaque_reflectance(&self, cos: R) -> V {
        let mut f = V::splat(R::splat(0.0));
        if self.has(self.opaque) {
            f = f + self.dielectric_reflectance(cos) * self.opaque;
        }
        if self.has(self.metallic) {
            f = f + fresnel::schlick(self.base_color, cos) * self.metallic;
        }
        f
    }

    /// Returns the BSDF without the lobes that are missing where `wo` is `below` the surface;
    /// `None` if none is.
    #[inline(always)]
    fn at_back(&self, below: R::Mask) -> Option<Disney<V>> {
        if !(self.one_sided && below.any()) {
            return None;
        }
        let at_front = |weight: R| R::select(below, R::splat(0.0), weight);
        Some(Disney {
            opaque: at_front(self.opaque),
            metallic: at_front(self.metallic),
            coat: Clearcoat {
                strength: at_front(self.coat.strength),
                ..self.coat
            },
            estimate: LobeEstimate {
                diffuse: at_front(self.estimate.diffuse),
                reflection: at_front(self.estimate.reflection),
                rise: at_front(self.estimate.rise),
            },
            ..*self
        })
    }

    /// Returns whether a lobe of this weight is present.
    #[inline(always)]
    fn has(&self, weight: R) -> bool {
        weight.gt(R::splat(0.0)).any()
    }

    /// Returns where the refractive lobe is a Dirac lobe.
    #[inline(always)]
    pub fn smooth_glass(&self) -> R::Mask {
        let bend = (self.ior - R::splat(1.0)).abs() * self.ggx.alpha[1];
        self.smooth | bend.lt(R::splat(MIN_BEND))
    }

    /// Returns where the refractive lobe has a density.
    #[inline(always)]
    fn rough_glass(&self) -> R::Mask {
        self.refractive.gt(R::splat(0.0)) & !self.smooth_glass()
    }

    /// Returns where any lobe has a density.
    #[inline(always)]
    pub fn has_density(&self) -> R::Mask {
        let zero = R::splat(0.0);
        self.opaque.gt(zero)
            | self.metallic.gt(zero) & !self.smooth
            | self.rough_glass()
            | self.coat.strength.gt(zero)
    }

    /// Returns sampling probabilities in proportion to the estimated reflectance of each lobe.
    #[inline(always)]
    fn lobe_probabilities(&self, cos_o: R) -> LobeProbabilities<R> {
        let zero = R::splat(0.0);
        let LobeEstimate {
            diffuse,
            reflection,
            rise,
        } = self.estimate;
        let reflection = reflection + rise * fresnel::schlick_weight(cos_o);
        let coat = if self.has(self.coat.strength) {
            self.coat.reflectance(cos_o)
        } else {
            zero
        };
        let total = diffuse + reflection + self.refractive + coat;
        let none = total.le(zero);
        if !(!none).any() {
            return LobeProbabilities::none();
        }
        let scale = R::select(none, zero, R::splat(1.0) / total);
        LobeProbabilities {
            diffuse: diffuse * scale,
            reflection: reflection * scale,
            glass: self.refractive * scale,
            coat: coat * scale,
        }
    }

    /// Computes everything that depends on `wo` alone.
    #[inline(always)]
    pub fn outgoing(&self, wo: V) -> DisneyOutgoing<V> {
        let below = wo.z().lt(R::splat(0.0));
        let o = V::new(wo.x(), wo.y(), R::select(below, -wo.z(), wo.z()));
        DisneyOutgoing {
            o,
            below,
            eta: if below.any() {
                R::select(below, R::splat(1.0) / self.ior, self.ior)
            } else {
                self.ior
            },
            choice: match self.at_back(below) {
                Some(side) => side.lobe_probabilities(o.z()),
                None => self.lobe_probabilities(o.z()),
            },
            masking: if (!self.smooth).any() {
                self.ggx.masking_over_cos(o)
            } else {
                R::splat(0.0)
            },
        }
    }

    /// Evaluates the BSDF for `wo` and `wi` in the local frame.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V, mode: TransportMode) -> V {
        self.evaluate::<false>(&self.outgoing(wo), wi, mode).0
    }

    /// Returns the density of [`Disney::sample`].
    #[inline(always)]
    pub fn pdf_w(&self, wo: V, wi: V) -> R {
        self.evaluate::<false>(&self.outgoing(wo), wi, TransportMode::Radiance)
            .1[0]
    }

    /// Returns [`Disney::eval`] and [`Disney::pdf_w`] and, with `REVERSE`, the density with the
    /// directions exchanged, else zero. Costs little more than one of them.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        out: &DisneyOutgoing<V>,
        wi: V,
        mode: TransportMode,
    ) -> (V, [R; 2]) {
        let zero = R::splat(0.0);
        let i = V::new(wi.x(), wi.y(), R::select(out.below, -wi.z(), wi.z()));
        let upper = out.o.z().gt(zero);
        let (up, down) = (upper & i.z().gt(zero), upper & i.z().lt(zero));
        let (mut f, mut pdf) = (V::splat(zero), [zero; 2]);
        if up.any() {
            let (value, pdfs) =
                self.reflected::<REVERSE>(out, &DirectionPair::new(&self.ggx, out.o, i));
            f = V::select(up, value, f);
            pdf = [R::select(up, pdfs[0], zero), R::select(up, pdfs[1], zero)];
        }
        if down.any() && self.has(self.refractive) {
            let (value, pdf_w) = self.transmitted(out, i, mode);
            let back = if REVERSE {
                self.pdf_w(wi, out.wo())
            } else {
                zero
            };
            f = V::select(down, value, f);
            pdf = [
                R::select(down, pdf_w, pdf[0]),
                R::select(down, back, pdf[1]),
            ];
        }
        (f, pdf)
    }

    /// Returns [`Disney::evaluate`] for two directions on the same side of an isotropic surface,
    /// computed from the directions in world space and their cosines with the normal `n`, without a
    /// local frame.
    #[inline(always)]
    fn evaluate_isotropic<const REVERSE: bool>(
        &self,
        out: &DisneyOutgoing<V>,
        wo: V,
        wi: V,
        n: V,
        cos_i: R,
    ) -> (V, [R; 2]) {
        let sum = wo + wi;
        let cos = [out.o.z(), cos_i.abs()];
        let along = cos[0] + cos[1];
        let across = sum - n * along.copysign(cos_i);
        let alpha2 = self.ggx.alpha[0] * self.ggx.alpha[0];
        let across2 = across.length_squared();
        let (half, cos_d) =
            HalfVector::from_sum(along, across2, across2 * alpha2, sum.length_squared());
        let masking = self.ggx.masking_at(
            cos[1],
            alpha2 * (R::splat(1.0) - cos[1] * cos[1]).max(R::splat(0.0)),
        );
        self.reflected::<REVERSE>(
            out,
            &DirectionPair {
                cos,
                masking,
                cos_d,
                half,
            },
        )
    }

    /// Evaluates the BSDF for directions in world space, of which `wi` has the cosine `cos_i` with
    /// the normal of `frame`, in the lanes of `wanted`. Otherwise like [`Disney::evaluate`].
    #[inline(always)]
    pub fn evaluate_in<const REVERSE: bool>(
        &self,
        frame: &Frame<V>,
        out: &DisneyOutgoing<V>,
        [wo, wi]: [V; 2],
        cos_i: R,
        mode: TransportMode,
        wanted: R::Mask,
    ) -> (V, [R; 2]) {
        let zero = R::splat(0.0);
        let upper_i = R::select(out.below, -cos_i, cos_i);
        let same = (out.o.z() * upper_i).gt(zero);
        let mut direct = same;
        if self.anisotropic {
            direct = same & self.ggx.alpha[0].eq(self.ggx.alpha[1]);
        }
        let (mut f, mut pdf) = (V::splat(zero), [zero; 2]);
        if direct.any() {
            let (value, pdfs) = self.evaluate_isotropic::<REVERSE>(out, wo, wi, frame.n, cos_i);
            f = V::select(direct, value, f);
            pdf = [
                R::select(direct, pdfs[0], zero),
                R::select(direct, pdfs[1], zero),
            ];
        }
        let rest = wanted & !direct;
        if rest.any() && (self.anisotropic || self.has(self.refractive)) {
            let (value, pdfs) = self.evaluate::<REVERSE>(out, frame.to_local(wi), mode);
            f = V::select(direct, f, value);
            pdf = [
                R::select(direct, pdf[0], pdfs[0]),
                R::select(direct, pdf[1], pdfs[1]),
            ];
        }
        (f, pdf)
    }

    /// Returns value and densities of reflection: of `i` given `o` and, with `REVERSE`, of `o`
    /// given `i`.
    #[inline(always)]
    fn reflected<const REVERSE: bool>(
        &self,
        out: &DisneyOutgoing<V>,
        pair: &DirectionPair<R>,
    ) -> (V, [R; 2]) {
        let [cos_o, cos_i] = pair.cos;
        let zero = R::splat(0.0);
        let back = self.at_back(out.below);
        let side = back.as_ref().unwrap_or(self);
        let from_o = &out.choice;
        let from_i = if REVERSE {
            side.lobe_probabilities(cos_i)
        } else {
            LobeProbabilities::none()
        };
        let mut f = V::splat(zero);
        let mut pdf = [zero; 2];
        if side.has(side.opaque) {
            f = side.diffuse.eval_at(cos_o, cos_i, pair.cos_d) * side.opaque;
            let (to_i, to_o) = (
                warp::cosine_hemisphere_pdf_w(cos_i),
                warp::cosine_hemisphere_pdf_w(cos_o),
            );
            pdf = [from_o.diffuse * to_i, from_i.diffuse * to_o];
        }
        let rough = !side.smooth;
        if rough.any() {
            let d = R::splat(0.25) * side.ggx.d_at(&pair.half);
            let masking = [out.masking * d, pair.masking * d];
            let mut reflectance = side.opaque_reflectance(pair.cos_d);
            let mut r = zero;
            let glass = side.rough_glass();
            if glass.any() {
                let exact = fresnel::dielectric(pair.cos_d, out.eta).reflectance;
                r = R::select(glass, exact, zero);
                reflectance = reflectance + V::splat(side.refractive * r);
            }
            let value = f + reflectance * (masking[0] * pair.masking);
            let to_i = pdf[0] + (from_o.reflection + from_o.glass * r) * masking[0];
            let to_o = pdf[1] + (from_i.reflection + from_i.glass * r) * masking[1];
            f = V::select(rough, value, f);
            pdf = [
                R::select(rough, to_i, pdf[0]),
                R::select(rough, to_o, pdf[1]),
            ];
        }
        if side.has(side.coat.strength) {
            let density = side.coat.pdf_w(&pair.half, pair.cos_d);
            f = f * side.coat.transmittance(cos_o, cos_i)
                + V::splat(side.coat.eval(cos_o, cos_i, &pair.half, pair.cos_d));
            pdf[0] = pdf[0] + from_o.coat * density;
            pdf[1] = pdf[1] + from_i.coat * density;
        }
        (f, if REVERSE { pdf } else { [pdf[0], zero] })
    }

    /// Returns value and density of rough refraction into `i` on the lower side.
    #[inline(always)]
    fn transmitted(&self, out: &DisneyOutgoing<V>, i: V, mode: TransportMode) -> (V, R) {
        let zero = R::splat(0.0);
        let glass = self.rough_glass();
        if !glass.any() {
            return (V::splat(zero), zero);
        }
        let (o, eta) = (out.o, out.eta);
        let (bent, refraction) = Refraction::between(o, i, eta);
        let bent = glass & bent;
        if !bent.any() {
            return (V::splat(zero), zero);
        }
        let common = refraction
            .direction_density(refraction.transmittance * out.masking * self.ggx.d(refraction.h));
        let masking = self.ggx.masking_over_cos(flipped(i));
        let scale = refraction.scale(mode);
        let f = self.tint()
            * (self.refractive * common * masking * scale * self.coat.transmittance(o.z(), i.z()));
        let pdf_w = out.choice.glass * common * eta * eta;
        (
            V::select(bent, f, V::splat(zero)),
            R::select(bent, pdf_w, zero),
        )
    }

    /// Returns the factor on light that passes once: entering and leaving together give the base
    /// colour [Burley 2015, 5.3].
    #[inline(always)]
    fn tint(&self) -> V {
        self.base_color.sqrt()
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LocalBsdf<R> for Disney<V> {
    #[inline(always)]
    fn new(class: &BsdfClass, m: &MaterialConstants<V>, p: &ShadingParameters<R>) -> Disney<V> {
        Disney::with_weights(class, m, p.base_color, p.roughness, p.mix())
    }

    #[inline(always)]
    fn packed(&self) -> Packed<R> {
        let LobeEstimate {
            diffuse,
            reflection,
            rise,
        } = self.estimate;
        let black = V::broadcast(Vec3::ZERO);
        let tinted_f0 = self.tinted_f0.unwrap_or(black);
        let [color, sheen, f0] =
            [self.base_color, self.diffuse.sheen, tinted_f0].map(Numbers::<R>::of_vector);
        let some = |weight: R| weight.gt(R::splat(0.0)).any();
        let [x, y] = self.ggx.alpha;
        Packed {
            numbers: Numbers::of(&[
                &color,
                &[self.opaque, self.metallic, self.refractive],
                &[self.ior, self.diffuse.roughness, self.diffuse.subsurface],
                &sheen,
                &self.ggx.alpha,
                &f0,
                &[self.coat.strength, self.coat.alpha, self.coat.ln_alpha2],
                &[diffuse, reflection, rise],
                &[self.schlick_share.unwrap_or(R::splat(0.0))],
            ]),
            smooth: self.smooth.any(),
            lobes: [
                some(self.opaque),
                some(self.metallic),
                some(self.refractive),
                some(self.coat.strength),
                some(self.diffuse.subsurface),
                (!self.diffuse.sheen.same(black)).any(),
                self.smooth_glass().any(),
            ],
            anisotropic: (!x.eq(y)).any(),
        }
    }

    #[inline(always)]
    fn load(class: &PackedClass, n: &Numbers<R>) -> Disney<V> {
        let base_color = n.vector(0);
        let BsdfClass {
            anisotropic,
            tinted,
            one_sided,
            formulas,
            ..
        } = class.bsdf;
        Disney {
            base_color,
            opaque: n.get(3),
            metallic: n.get(4),
            refractive: n.get(5),
            ior: n.get(6),
            diffuse: Diffuse {
                base_color,
                roughness: n.get(7),
                subsurface: n.get(8),
                sheen: n.vector(9),
            },
            ggx: Ggx {
                alpha: [n.get(12), n.get(if anisotropic { 13 } else { 12 })],
            },
            anisotropic,
            one_sided,
            smooth: R::Mask::splat(class.smooth),
            tinted_f0: tinted.then(|| n.vector(14)),
            schlick_share: (formulas == Formulas::Mitsuba).then(|| n.get(23)),
            coat: Clearcoat {
                strength: n.get(17),
                alpha: n.get(18),
                ln_alpha2: n.get(19),
                formulas,
            },
            estimate: LobeEstimate {
                diffuse: n.get(20),
                reflection: n.get(21),
                rise: n.get(22),
            },
        }
    }

    #[inline(always)]
    fn outgoing(&self, wo: V) -> (DisneyOutgoing<V>, InterfaceOutgoing<V>) {
        (Disney::outgoing(self, wo), InterfaceOutgoing::none())
    }

    #[inline(always)]
    fn value(&self, wo: V, wi: V, mode: TransportMode) -> (V, R) {
        let (f, [pdf_w, _]) =
            Disney::evaluate::<false>(self, &Disney::outgoing(self, wo), wi, mode);
        (f, pdf_w)
    }

    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        frame: &Frame<V>,
        out: &Outgoing<R>,
        (wi, cos_i): (V, R),
        mode: TransportMode,
        wanted: R::Mask,
    ) -> (V, [R; 2]) {
        let directions = [out.wo, wi];
        self.evaluate_in::<REVERSE>(frame, &out.disney, directions, cos_i, mode, wanted)
    }

    #[inline(always)]
    fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, Option<R>) {
        let (some, s, reverse) = Disney::sample::<REVERSE>(self, &out.disney, u, v, mode);
        (some, s, Some(reverse))
    }

    #[inline(always)]
    fn traits(&self) -> Traits<R> {
        let zero = R::splat(0.0);
        let (opaque, metallic) = (self.opaque.gt(zero), self.metallic.gt(zero));
        let refractive = self.refractive.gt(zero);
        Traits {
            has_density: self.has_density(),
            has_dirac_lobe: self.smooth & (opaque | metallic) | refractive & self.smooth_glass(),
            transmits: refractive,
            index_inside: self.ior,
            front_only: false,
        }
    }
}

impl<R: Real> DirectionPair<R> {
    /// Computes the geometry of two directions in the local frame.
    #[inline(always)]
    fn new(ggx: &Ggx<R>, o: R::Vec3, i: R::Vec3) -> DirectionPair<R> {
        let sum = o + i;
        let (half, cos_d) = ggx.half(sum);
        DirectionPair {
            cos: [o.z(), i.z()],
            masking: ggx.masking_over_cos(i),
            cos_d,
            half,
        }
    }
}
