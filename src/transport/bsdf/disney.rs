//! The adapted Disney BSDF: a dielectric that is opaque or refractive, a metal, and a clear coat.
//!
//! All work is done with `wo` on the upper side: opaque lobes are the same on both sides of a surface, and the
//! refractive one sees the inverse index from within.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::diffuse::Diffuse;
use super::facets::mirrored;
use super::fresnel;
use super::ggx::{Ggx, Half};
use super::glass::{Passage, refracted};
use super::{LobeSample, Local, Mode};
use crate::math::warp;

/// A refractive interface bends rays by about `|ior - 1| alpha`. Where that is less than this many radians, the half
/// vector of a refraction has no digits left in single precision: the interface is treated as smooth, which it looks
/// like, and what it reflects is too little to be seen.
const LEAST_BEND: f32 = 1e-4;

/// A rough lobe is sampled at least this often relative to its weight: its reflectance away from normals that face the
/// viewer can be more than the estimate from the macroscopic cosine says.
const LEAST_ROUGH: f32 = 0.02;

/// The parameters of the BSDF at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disney {
    /// Base colour.
    pub base_color: Vec3,
    /// (1 - metallic) opacity: weight of the diffuse lobe and of the reflection over it.
    pub opaque: f32,
    /// Weight of the metal.
    pub metallic: f32,
    /// (1 - metallic) (1 - opacity): weight of the refractive dielectric.
    pub refractive: f32,
    /// Index of the inside.
    pub ior: f32,
    /// Tinted reflectance of the opaque dielectric at normal incidence; `None` is untinted.
    pub tinted_f0: Option<Vec3>,
    /// The diffuse lobe.
    pub diffuse: Diffuse,
    /// The microfacets of all lobes but the coat.
    pub ggx: Ggx,
    /// Whether those are Dirac lobes.
    pub smooth: bool,
    /// The coat.
    pub coat: Clearcoat,
    /// Made from all others by [`Disney::ready`].
    pub estimate: Estimate,
}

/// Probabilities of choosing the lobes; all zero where nothing is reflected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Choice {
    diffuse: f32,
    reflection: f32,
    glass: f32,
    coat: f32,
}

/// What a BSDF knows of `wo` alone: made once for all directions that are joined to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View {
    /// `wo` in the local frame, mirrored to the upper side.
    o: Vec3,
    /// Whether it was mirrored.
    below: bool,
    /// The index of the lower side, as seen from there.
    eta: f32,
    choice: Choice,
    /// Masking over the cosine.
    masking: f32,
}

/// Two directions on the upper side, as far as reflection from one to the other depends on them.
struct Pair {
    /// Cosines with the normal, of `o` and of `i`.
    cos: [f32; 2],
    /// Masking over the cosine of `i`.
    masking: f32,
    /// Cosine between the half vector and either of them.
    cos_d: f32,
    half: Half,
}

/// What lobes are estimated to reflect, but for what depends on the direction: the part of [`Choice`] that is the same
/// for a whole surface. Reflectance is estimated by Schlick's formula for all lobes: close enough to choose by, and free
/// of square roots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate {
    /// The diffuse lobe.
    diffuse: f32,
    /// The reflection seen straight on.
    reflection: f32,
    /// How much more of it there is at grazing angles.
    rise: f32,
}

/// Reflectance at normal incidence of an index.
#[inline]
pub fn f0_of(ior: f32) -> f32 {
    let r = (ior - 1.0) / (ior + 1.0);
    r * r
}

impl Disney {
    /// Reflectance of the opaque dielectric: the full Fresnel equations from outside, tinted at normal incidence and
    /// blending to white as the exact reflectance does (the adaptation of the first document).
    #[inline]
    fn dielectric_reflectance(&self, cos: f32) -> Vec3 {
        let exact = fresnel::dielectric(cos.abs(), self.ior).reflectance;
        match self.tinted_f0 {
            None => Vec3::splat(exact),
            Some(tinted) => {
                let f0 = f0_of(self.ior);
                // The reflectance of a high index dips below that of normal incidence before it rises.
                let blend = (exact - f0) / (1.0 - f0);
                (tinted + (Vec3::ONE - tinted) * blend).max(Vec3::ZERO)
            }
        }
    }

    /// Reflectance of the opaque dielectric and the metal together, by weight.
    #[inline]
    fn opaque_reflectance(&self, cos: f32) -> Vec3 {
        let mut f = Vec3::ZERO;
        if self.opaque > 0.0 {
            f += self.dielectric_reflectance(cos) * self.opaque;
        }
        if self.metallic > 0.0 {
            f += fresnel::schlick(self.base_color, cos) * self.metallic;
        }
        f
    }

    /// Whether the refractive lobe is a Dirac lobe.
    #[inline]
    fn smooth_glass(&self) -> bool {
        self.smooth || (self.ior - 1.0).abs() * self.ggx.alpha[1] < LEAST_BEND
    }

    /// Whether any lobe has a density.
    #[inline]
    pub fn has_density(&self) -> bool {
        self.opaque > 0.0
            || (self.metallic > 0.0 && !self.smooth)
            || (self.refractive > 0.0 && !self.smooth_glass())
            || self.coat.strength > 0.0
    }

    /// With [`Disney::estimate`] made for the other parameters, which all must be there.
    #[inline]
    pub fn ready(self) -> Disney {
        let mean = |c: Vec3| c.element_sum() * (1.0 / 3.0);
        let (f0, color) = (f0_of(self.ior), mean(self.base_color));
        let rough = if self.smooth { 0.0 } else { LEAST_ROUGH * (self.opaque + self.metallic) };
        let estimate = Estimate {
            diffuse: self.opaque * (color + 0.25 * mean(self.diffuse.sheen)),
            reflection: self.opaque * f0 + self.metallic * color + rough,
            rise: self.opaque * (1.0 - f0) + self.metallic * (1.0 - color),
        };
        Disney { estimate, ..self }
    }

    /// Probabilities in proportion to what each lobe is estimated to reflect.
    #[inline]
    fn choice(&self, cos_o: f32) -> Choice {
        let Estimate { diffuse, reflection, rise } = self.estimate;
        let reflection = reflection + rise * fresnel::schlick_weight(cos_o);
        let coat = if self.coat.strength > 0.0 { self.coat.reflectance(cos_o) } else { 0.0 };
        let total = diffuse + reflection + self.refractive + coat;
        if total <= 0.0 {
            return Choice::default();
        }
        let scale = 1.0 / total;
        Choice {
            diffuse: diffuse * scale,
            reflection: reflection * scale,
            glass: self.refractive * scale,
            coat: coat * scale,
        }
    }

    /// What depends on `wo` alone.
    #[inline]
    pub fn view(&self, wo: Vec3) -> View {
        let below = wo.z < 0.0;
        let o = if below { flipped(wo) } else { wo };
        View {
            o,
            below,
            eta: if below { 1.0 / self.ior } else { self.ior },
            choice: self.choice(o.z),
            masking: if self.smooth { 0.0 } else { self.ggx.masking_over_cos(o) },
        }
    }

    /// The value for `wo` and `wi` in the local frame.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: Mode) -> Vec3 {
        self.evaluate::<false>(&self.view(wo), wi, mode).0
    }

    /// The density of [`Disney::sample`].
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.evaluate::<false>(&self.view(wo), wi, Mode::Radiance).1[0]
    }

    /// [`Disney::eval`], [`Disney::pdf_w`] and the same with the directions exchanged, for little more than one of them. Without
    /// `REVERSE` that last density is left out.
    #[inline]
    pub fn evaluate<const REVERSE: bool>(&self, view: &View, wi: Vec3, mode: Mode) -> (Vec3, [f32; 2]) {
        let i = if view.below { flipped(wi) } else { wi };
        if view.o.z <= 0.0 || i.z == 0.0 {
            return (Vec3::ZERO, [0.0; 2]);
        }
        if i.z > 0.0 {
            return self.reflected::<REVERSE>(view, &Pair::new(&self.ggx, view.o, i));
        }
        if self.refractive <= 0.0 {
            return (Vec3::ZERO, [0.0; 2]);
        }
        let (f, pdf_w) = self.transmitted(view, i, mode);
        (f, [pdf_w, if REVERSE { self.pdf_w(wi, view.wo()) } else { 0.0 }])
    }

    /// [`Disney::evaluate`] for directions on one side of a surface that is alike in all directions: what it is is said
    /// by the directions in world space and their cosines with the normal `n`, and no local frame is needed.
    #[inline]
    pub fn evaluate_round<const REVERSE: bool>(
        &self,
        view: &View,
        wo: Vec3,
        wi: Vec3,
        n: Vec3,
        cos_i: f32,
    ) -> (Vec3, [f32; 2]) {
        let sum = wo + wi;
        let cos = [view.o.z, cos_i.abs()];
        let along = cos[0] + cos[1];
        let across = sum - n * along.copysign(cos_i);
        let alpha2 = self.ggx.alpha[0] * self.ggx.alpha[0];
        let across2 = across.length_squared();
        let (half, cos_d) = Half::of_sum(along, across2, across2 * alpha2, sum.length_squared());
        let masking = self.ggx.masking_at(cos[1], alpha2 * (1.0 - cos[1] * cos[1]).max(0.0));
        self.reflected::<REVERSE>(view, &Pair { cos, masking, cos_d, half })
    }

    /// Whether it is alike in all directions around the normal.
    #[inline]
    pub fn is_round(&self) -> bool {
        self.ggx.alpha[0] == self.ggx.alpha[1]
    }

    /// Value and densities of reflection: of `i` given `o` and, with `REVERSE`, of `o` given `i`.
    #[inline(always)]
    fn reflected<const REVERSE: bool>(&self, view: &View, pair: &Pair) -> (Vec3, [f32; 2]) {
        let [cos_o, cos_i] = pair.cos;
        let from_o = &view.choice;
        let from_i = if REVERSE { self.choice(cos_i) } else { Choice::default() };
        let mut f = Vec3::ZERO;
        let mut pdf = [0.0; 2];
        if self.opaque > 0.0 {
            f = self.diffuse.eval_at(cos_o, cos_i, pair.cos_d) * self.opaque;
            let [to_i, to_o] = [cos_i, cos_o].map(warp::cosine_hemisphere_pdf_w);
            pdf = [from_o.diffuse * to_i, from_i.diffuse * to_o];
        }
        if !self.smooth {
            let d = 0.25 * self.ggx.d_at(&pair.half);
            let seen = [view.masking * d, pair.masking * d];
            let mut reflectance = self.opaque_reflectance(pair.cos_d);
            let mut r = 0.0;
            if self.refractive > 0.0 && !self.smooth_glass() {
                r = fresnel::dielectric(pair.cos_d, view.eta).reflectance;
                reflectance += Vec3::splat(self.refractive * r);
            }
            f += reflectance * (seen[0] * pair.masking);
            pdf[0] += (from_o.reflection + from_o.glass * r) * seen[0];
            pdf[1] += (from_i.reflection + from_i.glass * r) * seen[1];
        }
        if self.coat.strength > 0.0 {
            let density = self.coat.pdf_w(&pair.half, pair.cos_d);
            f = f * self.coat.passes(cos_o, cos_i) + Vec3::splat(self.coat.eval(cos_o, cos_i, &pair.half, pair.cos_d));
            pdf[0] += from_o.coat * density;
            pdf[1] += from_i.coat * density;
        }
        (f, if REVERSE { pdf } else { [pdf[0], 0.0] })
    }

    /// Rough refraction into `i` on the lower side.
    #[inline]
    fn transmitted(&self, view: &View, i: Vec3, mode: Mode) -> (Vec3, f32) {
        if self.refractive <= 0.0 || self.smooth_glass() {
            return (Vec3::ZERO, 0.0);
        }
        let (o, eta) = (view.o, view.eta);
        let Some(passage) = Passage::between(o, i, eta) else { return (Vec3::ZERO, 0.0) };
        let common = passage.spread(passage.passes * view.masking * self.ggx.d(passage.h));
        let masking = self.ggx.masking_over_cos(flipped(i));
        let scale = passage.scale(mode);
        let f = self.tint() * (self.refractive * common * masking * scale * self.coat.passes(o.z, i.z));
        (f, view.choice.glass * common * eta * eta)
    }

    /// What passes through once: entering and leaving carries the base colour [Burley 2015, 5.3].
    #[inline]
    fn tint(&self) -> Vec3 {
        self.base_color.map(f32::sqrt)
    }

    /// Samples a direction: a lobe by `u`, a direction in it by `v`; the weight is that of the whole mixture. With
    /// `REVERSE` the density of `wo` given that direction comes along, else zero; for Dirac lobes it is zero.
    #[inline]
    pub fn sample<const REVERSE: bool>(&self, view: &View, u: f32, v: [f32; 2], mode: Mode) -> Option<(Local, f32)> {
        let View { o, eta, choice: c, .. } = *view;
        if o.z <= 0.0 || c == Choice::default() {
            return None;
        }
        let wi = if u < c.diffuse {
            warp::cosine_hemisphere(v)
        } else if u < c.diffuse + c.reflection {
            if self.smooth {
                let wi = Vec3::new(-o.x, -o.y, o.z);
                let weight = self.opaque_reflectance(o.z) / c.reflection * self.coat.passes(o.z, o.z);
                return Some(view.turned(Local::new(LobeSample { wi, weight, eta: 1.0 }, c.reflection, true), 0.0));
            }
            mirrored(o, self.ggx.sample(o, v))
        } else if u < c.diffuse + c.reflection + c.glass || c.coat <= 0.0 {
            let rest = ((u - c.diffuse - c.reflection) / c.glass).clamp(0.0, 1.0);
            if self.smooth_glass() {
                return Some(view.turned(self.smooth_refraction(view, rest, mode)?, 0.0));
            }
            let h = self.ggx.sample(o, v);
            let reflects = rest < fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
            let wi = if reflects { mirrored(o, h) } else { refracted(o, h, eta)? };
            if (wi.z > 0.0) != reflects {
                return None;
            }
            return self.finish::<REVERSE>(view, wi, mode);
        } else {
            let h = self.coat.sample(v);
            if o.dot(h) <= 0.0 {
                return None;
            }
            mirrored(o, h)
        };
        if wi.z <= 0.0 { None } else { self.finish::<REVERSE>(view, wi, mode) }
    }

    /// A sampled direction with the weight and density of the whole mixture; with `REVERSE` also the density of `wo` given
    /// it.
    #[inline]
    fn finish<const REVERSE: bool>(&self, view: &View, i: Vec3, mode: Mode) -> Option<(Local, f32)> {
        let (f, [pdf_w, reverse]) = if i.z > 0.0 {
            self.reflected::<REVERSE>(view, &Pair::new(&self.ggx, view.o, i))
        } else {
            let (f, pdf_w) = self.transmitted(view, i, mode);
            let back = || self.pdf_w(if view.below { flipped(i) } else { i }, view.wo());
            (f, [pdf_w, if REVERSE && i.z < 0.0 { back() } else { 0.0 }])
        };
        let weight = f * (i.z.abs() / pdf_w);
        let eta = if i.z < 0.0 { view.eta } else { 1.0 };
        let local = || view.turned(Local::new(LobeSample { wi: i, weight, eta }, pdf_w, false), reverse);
        (pdf_w > 0.0 && weight.is_finite()).then(local)
    }

    #[inline]
    fn smooth_refraction(&self, view: &View, u: f32, mode: Mode) -> Option<Local> {
        let (o, glass) = (view.o, view.choice.glass);
        let (mut s, probability) = super::dielectric::sample(self.base_color, view.eta, o, u, mode)?;
        s.weight *= self.refractive / glass * self.coat.passes(o.z, s.wi.z);
        Some(Local::new(s, glass * probability, true))
    }
}

impl View {
    /// `wo` in the local frame.
    #[inline]
    fn wo(&self) -> Vec3 {
        if self.below { flipped(self.o) } else { self.o }
    }

    /// What was sampled with `wo` on the upper side, for the side where it is.
    #[inline]
    fn turned(&self, mut s: Local, reverse: f32) -> (Local, f32) {
        if self.below {
            s.sample.wi.z = -s.sample.wi.z;
        }
        (s, reverse)
    }
}

impl Pair {
    /// Two directions in the local frame.
    #[inline]
    fn new(ggx: &Ggx, o: Vec3, i: Vec3) -> Pair {
        let sum = o + i;
        let (half, cos_d) = ggx.half(sum);
        Pair { cos: [o.z, i.z], masking: ggx.masking_over_cos(i), cos_d, half }
    }
}

#[inline]
fn flipped(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}
