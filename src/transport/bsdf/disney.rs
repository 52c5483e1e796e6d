//! The adapted Disney BSDF: a dielectric that is opaque or refractive, a metal, and a clear coat.
//!
//! All work is done with `wo` on the upper side: opaque lobes are the same on both sides of a surface, and the
//! refractive one sees the inverse index from within.
//!
//! In [lanes](crate::math::real) stand surfaces with the same lobes: which parameters are zero, whether microfacets are
//! Dirac lobes, and whether there is a tint is the same in all of them. So branches on parameters are branches there too.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::diffuse::Diffuse;
use super::facets::mirrored;
use super::fresnel;
use super::ggx::{Ggx, Half};
use super::glass::{Passage, refracted};
use super::{LobeSample, Local, Mode};
use crate::math::real::{Mask, Real, Vector};
use crate::math::warp;
use crate::scene::compile::Material;

/// A refractive interface bends rays by about `|ior - 1| alpha`. Where that is less than this many radians, the half
/// vector of a refraction has no digits left in single precision: the interface is treated as smooth, which it looks
/// like, and what it reflects is too little to be seen.
const LEAST_BEND: f32 = 1e-4;

/// A rough lobe is sampled at least this often relative to its weight: its reflectance away from normals that face the
/// viewer can be more than the estimate from the macroscopic cosine says.
const LEAST_ROUGH: f32 = 0.02;

/// The parameters of the BSDF at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Disney<V: Vector = Vec3> {
    /// Base colour.
    pub base_color: V,
    /// (1 - metallic) opacity: weight of the diffuse lobe and of the reflection over it.
    pub opaque: V::Scalar,
    /// Weight of the metal.
    pub metallic: V::Scalar,
    /// (1 - metallic) (1 - opacity): weight of the refractive dielectric.
    pub refractive: V::Scalar,
    /// Index of the inside.
    pub ior: V::Scalar,
    /// Tinted reflectance of the opaque dielectric at normal incidence; `None` is untinted.
    pub tinted_f0: Option<V>,
    /// The diffuse lobe.
    pub diffuse: Diffuse<V>,
    /// The microfacets of all lobes but the coat.
    pub ggx: Ggx<V::Scalar>,
    /// Whether those are Dirac lobes.
    pub smooth: bool,
    /// The coat.
    pub coat: Clearcoat<V::Scalar>,
    /// Made from all others by [`Disney::ready`].
    pub estimate: Estimate<V::Scalar>,
}

/// Probabilities of choosing the lobes; all zero where nothing is reflected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Choice<R = f32> {
    diffuse: R,
    reflection: R,
    glass: R,
    coat: R,
}

/// What a BSDF knows of `wo` alone: made once for all directions that are joined to it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct View<V: Vector = Vec3> {
    /// `wo` in the local frame, mirrored to the upper side.
    o: V,
    /// Whether it was mirrored.
    below: <V::Scalar as Real>::Mask,
    /// The index of the lower side, as seen from there.
    eta: V::Scalar,
    choice: Choice<V::Scalar>,
    /// Masking over the cosine.
    masking: V::Scalar,
}

/// Two directions on the upper side, as far as reflection from one to the other depends on them.
struct Pair<R> {
    /// Cosines with the normal, of `o` and of `i`.
    cos: [R; 2],
    /// Masking over the cosine of `i`.
    masking: R,
    /// Cosine between the half vector and either of them.
    cos_d: R,
    half: Half<R>,
}

/// What lobes are estimated to reflect, but for what depends on the direction: the part of [`Choice`] that is the same
/// for a whole surface. Reflectance is estimated by Schlick's formula for all lobes: close enough to choose by, and free
/// of square roots.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Estimate<R = f32> {
    /// The diffuse lobe.
    pub(crate) diffuse: R,
    /// The reflection seen straight on.
    pub(crate) reflection: R,
    /// How much more of it there is at grazing angles.
    pub(crate) rise: R,
}

/// Reflectance at normal incidence of an index.
#[inline(always)]
pub fn f0_of<R: Real>(ior: R) -> R {
    let one = R::of(1.0);
    let r = (ior - one) / (ior + one);
    r * r
}

impl<R: Real> Choice<R> {
    /// Nothing is reflected.
    #[inline(always)]
    fn none() -> Choice<R> {
        let zero = R::of(0.0);
        Choice { diffuse: zero, reflection: zero, glass: zero, coat: zero }
    }
}

impl Disney<Vec3> {
    /// At a point where textures say this base colour and roughness, with the weights of the opaque dielectric, the metal and
    /// the refractive dielectric.
    #[inline(always)]
    pub fn new(m: &Material, base_color: Vec3, roughness: f32, [opaque, metallic, refractive]: [f32; 3]) -> Disney {
        let hue = |part: f32| if part > 0.0 { Vec3::ONE.lerp(hue_of(base_color), part) } else { Vec3::ONE };
        let tinted_f0 = (m.specular_tint > 0.0).then(|| (hue(m.specular_tint) * f0_of(m.ior)).min(Vec3::ONE));
        let disney = Disney {
            base_color,
            opaque,
            metallic,
            refractive,
            ior: m.ior,
            tinted_f0,
            diffuse: Diffuse {
                base_color,
                roughness,
                subsurface: m.subsurface,
                sheen: if m.sheen > 0.0 { hue(m.sheen_tint) * m.sheen } else { Vec3::ZERO },
            },
            ggx: Ggx::new(roughness, m.anisotropic),
            smooth: roughness < m.smooth_below,
            coat: Clearcoat::new(m.clearcoat, m.clearcoat_gloss),
            estimate: Estimate::default(),
        };
        disney.ready()
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
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Disney<V> {
    /// Reflectance of the opaque dielectric: the full Fresnel equations from outside, tinted at normal incidence and
    /// blending to white as the exact reflectance does (the adaptation of the first document).
    #[inline(always)]
    fn dielectric_reflectance(&self, cos: R) -> V {
        let exact = fresnel::dielectric(cos.abs(), self.ior).reflectance;
        match self.tinted_f0 {
            None => V::all(exact),
            Some(tinted) => {
                let f0 = f0_of(self.ior);
                // The reflectance of a high index dips below that of normal incidence before it rises.
                let blend = (exact - f0) / (R::of(1.0) - f0);
                (tinted + (V::all(R::of(1.0)) - tinted) * blend).map(|x| x.max(R::of(0.0)))
            }
        }
    }

    /// Reflectance of the opaque dielectric and the metal together, by weight.
    #[inline(always)]
    fn opaque_reflectance(&self, cos: R) -> V {
        let mut f = V::all(R::of(0.0));
        if self.has(self.opaque) {
            f = f + self.dielectric_reflectance(cos) * self.opaque;
        }
        if self.has(self.metallic) {
            f = f + fresnel::schlick(self.base_color, cos) * self.metallic;
        }
        f
    }

    /// Whether a lobe of this weight is there.
    #[inline(always)]
    fn has(&self, weight: R) -> bool {
        weight.gt(R::of(0.0)).any()
    }

    /// Whether the refractive lobe is a Dirac lobe.
    #[inline(always)]
    pub(crate) fn smooth_glass(&self) -> bool {
        self.smooth || ((self.ior - R::of(1.0)).abs() * self.ggx.alpha[1]).lt(R::of(LEAST_BEND)).any()
    }

    /// Whether any lobe has a density.
    #[inline(always)]
    pub fn has_density(&self) -> bool {
        self.has(self.opaque)
            || (self.has(self.metallic) && !self.smooth)
            || (self.has(self.refractive) && !self.smooth_glass())
            || self.has(self.coat.strength)
    }

    /// Probabilities in proportion to what each lobe is estimated to reflect.
    #[inline(always)]
    fn choice(&self, cos_o: R) -> Choice<R> {
        let zero = R::of(0.0);
        let Estimate { diffuse, reflection, rise } = self.estimate;
        let reflection = reflection + rise * fresnel::schlick_weight(cos_o);
        let coat = if self.has(self.coat.strength) { self.coat.reflectance(cos_o) } else { zero };
        let total = diffuse + reflection + self.refractive + coat;
        let none = total.le(zero);
        if !(!none).any() {
            return Choice::none();
        }
        let scale = R::select(none, zero, R::of(1.0) / total);
        Choice {
            diffuse: diffuse * scale,
            reflection: reflection * scale,
            glass: self.refractive * scale,
            coat: coat * scale,
        }
    }

    /// What depends on `wo` alone.
    #[inline(always)]
    pub fn view(&self, wo: V) -> View<V> {
        let below = wo.z().lt(R::of(0.0));
        let o = V::new(wo.x(), wo.y(), R::select(below, -wo.z(), wo.z()));
        View {
            o,
            below,
            eta: if below.any() { R::select(below, R::of(1.0) / self.ior, self.ior) } else { self.ior },
            choice: self.choice(o.z()),
            masking: if self.smooth { R::of(0.0) } else { self.ggx.masking_over_cos(o) },
        }
    }

    /// The value for `wo` and `wi` in the local frame.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V, mode: Mode) -> V {
        self.evaluate::<false>(&self.view(wo), wi, mode).0
    }

    /// The density of [`Disney::sample`].
    #[inline(always)]
    pub fn pdf_w(&self, wo: V, wi: V) -> R {
        self.evaluate::<false>(&self.view(wo), wi, Mode::Radiance).1[0]
    }

    /// [`Disney::eval`], [`Disney::pdf_w`] and the same with the directions exchanged, for little more than one of them. Without
    /// `REVERSE` that last density is left out.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(&self, view: &View<V>, wi: V, mode: Mode) -> (V, [R; 2]) {
        let zero = R::of(0.0);
        let i = V::new(wi.x(), wi.y(), R::select(view.below, -wi.z(), wi.z()));
        let seen = view.o.z().gt(zero);
        let (up, down) = (seen & i.z().gt(zero), seen & i.z().lt(zero));
        let (mut f, mut pdf) = (V::all(zero), [zero; 2]);
        if up.any() {
            let (value, pdfs) = self.reflected::<REVERSE>(view, &Pair::new(&self.ggx, view.o, i));
            f = V::select(up, value, f);
            pdf = [R::select(up, pdfs[0], zero), R::select(up, pdfs[1], zero)];
        }
        if down.any() && self.has(self.refractive) {
            let (value, pdf_w) = self.transmitted(view, i, mode);
            let back = if REVERSE { self.pdf_w(wi, view.wo()) } else { zero };
            f = V::select(down, value, f);
            pdf = [R::select(down, pdf_w, pdf[0]), R::select(down, back, pdf[1])];
        }
        (f, pdf)
    }

    /// [`Disney::evaluate`] for directions on one side of a surface that is alike in all directions: what it is is said
    /// by the directions in world space and their cosines with the normal `n`, and no local frame is needed.
    #[inline(always)]
    pub fn evaluate_round<const REVERSE: bool>(&self, view: &View<V>, wo: V, wi: V, n: V, cos_i: R) -> (V, [R; 2]) {
        let sum = wo + wi;
        let cos = [view.o.z(), cos_i.abs()];
        let along = cos[0] + cos[1];
        let across = sum - n * along.copysign(cos_i);
        let alpha2 = self.ggx.alpha[0] * self.ggx.alpha[0];
        let across2 = across.length_squared();
        let (half, cos_d) = Half::of_sum(along, across2, across2 * alpha2, sum.length_squared());
        let masking = self.ggx.masking_at(cos[1], alpha2 * (R::of(1.0) - cos[1] * cos[1]).max(R::of(0.0)));
        self.reflected::<REVERSE>(view, &Pair { cos, masking, cos_d, half })
    }

    /// Whether it is alike in all directions around the normal.
    #[inline(always)]
    pub fn is_round(&self) -> bool {
        !(!self.ggx.alpha[0].eq(self.ggx.alpha[1])).any()
    }

    /// Value and densities of reflection: of `i` given `o` and, with `REVERSE`, of `o` given `i`.
    #[inline(always)]
    fn reflected<const REVERSE: bool>(&self, view: &View<V>, pair: &Pair<R>) -> (V, [R; 2]) {
        let [cos_o, cos_i] = pair.cos;
        let zero = R::of(0.0);
        let from_o = &view.choice;
        let from_i = if REVERSE { self.choice(cos_i) } else { Choice::none() };
        let mut f = V::all(zero);
        let mut pdf = [zero; 2];
        if self.has(self.opaque) {
            f = self.diffuse.eval_at(cos_o, cos_i, pair.cos_d) * self.opaque;
            let (to_i, to_o) = (warp::cosine_hemisphere_pdf_w(cos_i), warp::cosine_hemisphere_pdf_w(cos_o));
            pdf = [from_o.diffuse * to_i, from_i.diffuse * to_o];
        }
        if !self.smooth {
            let d = R::of(0.25) * self.ggx.d_at(&pair.half);
            let seen = [view.masking * d, pair.masking * d];
            let mut reflectance = self.opaque_reflectance(pair.cos_d);
            let mut r = zero;
            if self.has(self.refractive) && !self.smooth_glass() {
                r = fresnel::dielectric(pair.cos_d, view.eta).reflectance;
                reflectance = reflectance + V::all(self.refractive * r);
            }
            f = f + reflectance * (seen[0] * pair.masking);
            pdf[0] = pdf[0] + (from_o.reflection + from_o.glass * r) * seen[0];
            pdf[1] = pdf[1] + (from_i.reflection + from_i.glass * r) * seen[1];
        }
        if self.has(self.coat.strength) {
            let density = self.coat.pdf_w(&pair.half, pair.cos_d);
            f = f * self.coat.passes(cos_o, cos_i) + V::all(self.coat.eval(cos_o, cos_i, &pair.half, pair.cos_d));
            pdf[0] = pdf[0] + from_o.coat * density;
            pdf[1] = pdf[1] + from_i.coat * density;
        }
        (f, if REVERSE { pdf } else { [pdf[0], zero] })
    }

    /// Rough refraction into `i` on the lower side.
    #[inline(always)]
    fn transmitted(&self, view: &View<V>, i: V, mode: Mode) -> (V, R) {
        let zero = R::of(0.0);
        if !self.has(self.refractive) || self.smooth_glass() {
            return (V::all(zero), zero);
        }
        let (o, eta) = (view.o, view.eta);
        let (bent, passage) = Passage::between(o, i, eta);
        if !bent.any() {
            return (V::all(zero), zero);
        }
        let common = passage.spread(passage.passes * view.masking * self.ggx.d(passage.h));
        let masking = self.ggx.masking_over_cos(flipped(i));
        let scale = passage.scale(mode);
        let f = self.tint() * (self.refractive * common * masking * scale * self.coat.passes(o.z(), i.z()));
        let pdf_w = view.choice.glass * common * eta * eta;
        (V::select(bent, f, V::all(zero)), R::select(bent, pdf_w, zero))
    }

    /// What passes through once: entering and leaving carries the base colour [Burley 2015, 5.3].
    #[inline(always)]
    fn tint(&self) -> V {
        self.base_color.map(R::sqrt)
    }

    /// Samples a direction: a lobe by `u`, a direction in it by `v`; the weight is that of the whole mixture. The mask says
    /// where there is one. With `REVERSE` the density of `wo` given that direction comes along, else zero; for Dirac lobes
    /// it is zero.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(&self, view: &View<V>, u: R, v: [R; 2], mode: Mode) -> (R::Mask, Local<V>, R) {
        let zero = R::of(0.0);
        let View { o, eta, choice: c, .. } = *view;
        let (to_reflection, to_glass) = (c.diffuse + c.reflection, c.diffuse + c.reflection + c.glass);
        let mut some = o.z().gt(zero) & to_glass.gt(zero) | o.z().gt(zero) & c.coat.gt(zero);
        let diffuse = some & u.lt(c.diffuse);
        let reflection = some & !u.lt(c.diffuse) & u.lt(to_reflection);
        let rest = some & !u.lt(c.diffuse) & !u.lt(to_reflection);
        let glass = rest & (u.lt(to_glass) | c.coat.le(zero));
        let coat = rest & !glass;
        let mut delta = R::Mask::of(false);
        let mut dirac = Local::none();
        let mut wi = o;
        // Where a direction may lie on the lower side.
        let mut below = R::Mask::of(false);
        if diffuse.any() {
            wi = V::select(diffuse, warp::cosine_hemisphere(v), wi);
        }
        if reflection.any() {
            if self.smooth {
                let weight = self.opaque_reflectance(o.z()) / c.reflection * self.coat.passes(o.z(), o.z());
                let wi = V::new(-o.x(), -o.y(), o.z());
                dirac = Local::new(LobeSample { wi, weight, eta: R::of(1.0) }, c.reflection, R::Mask::of(true));
                delta = reflection;
            } else {
                wi = V::select(reflection, mirrored(o, self.ggx.sample(o, v)), wi);
            }
        }
        if glass.any() {
            let among = ((u - c.diffuse - c.reflection) / c.glass).clamp(0.0, 1.0);
            if self.smooth_glass() {
                let (passes, sample) = self.smooth_refraction(view, among, mode);
                some = some & (passes | !glass);
                dirac = Local::select(glass, sample, dirac);
                delta = delta | glass;
            } else {
                let h = self.ggx.sample(o, v);
                let reflects = among.lt(fresnel::dielectric(o.dot(h).max(zero), eta).reflectance);
                let (bends, through) = refracted(o, h, eta);
                let sampled = V::select(reflects, mirrored(o, h), through);
                let up = sampled.z().gt(zero);
                let usable = reflects & up | !reflects & bends & !up;
                some = some & (usable | !glass);
                wi = V::select(glass, sampled, wi);
                below = glass & !reflects;
            }
        }
        if coat.any() {
            let h = self.coat.sample(v);
            some = some & (o.dot(h).gt(zero) | !coat);
            wi = V::select(coat, mirrored(o, h), wi);
        }
        some = some & (delta | below | wi.z().gt(zero));
        let rough = some & !delta;
        let (mut local, mut reverse) = (dirac, zero);
        if rough.any() {
            let (usable, finished, back) = self.finish::<REVERSE>(view, wi, mode);
            some = some & (usable | !rough);
            (local, reverse) = (Local::select(rough, finished, dirac), R::select(rough, back, zero));
        }
        (some, view.turned(local), reverse)
    }

    /// A sampled direction with the weight and density of the whole mixture; with `REVERSE` also the density of `wo` given
    /// it. The mask says where it is of any use.
    #[inline(always)]
    fn finish<const REVERSE: bool>(&self, view: &View<V>, i: V, mode: Mode) -> (R::Mask, Local<V>, R) {
        let zero = R::of(0.0);
        let up = i.z().gt(zero);
        let (mut f, mut pdf_w, mut reverse) = (V::all(zero), zero, zero);
        if up.any() {
            let (value, pdf) = self.reflected::<REVERSE>(view, &Pair::new(&self.ggx, view.o, i));
            (f, pdf_w, reverse) = (value, pdf[0], pdf[1]);
        }
        let down = !up;
        if down.any() {
            let (value, density) = self.transmitted(view, i, mode);
            (f, pdf_w) = (V::select(up, f, value), R::select(up, pdf_w, density));
            if REVERSE {
                let wi = V::select(view.below, flipped(i), i);
                reverse = R::select(up, reverse, R::select(i.z().lt(zero), self.pdf_w(wi, view.wo()), zero));
            }
        }
        let weight = f * (i.z().abs() / pdf_w);
        let eta = R::select(i.z().lt(zero), view.eta, R::of(1.0));
        let usable = pdf_w.gt(zero) & weight.is_finite();
        (usable, Local::new(LobeSample { wi: i, weight, eta }, pdf_w, R::Mask::of(false)), reverse)
    }

    #[inline(always)]
    fn smooth_refraction(&self, view: &View<V>, u: R, mode: Mode) -> (R::Mask, Local<V>) {
        let (o, glass) = (view.o, view.choice.glass);
        let (some, mut s, probability) = super::dielectric::choose(self.base_color, view.eta, o, u, mode);
        s.weight = s.weight * (self.refractive / glass * self.coat.passes(o.z(), s.wi.z()));
        (some, Local::new(s, glass * probability, R::Mask::of(true)))
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> View<V> {
    /// In the place of one where the surface is of another model.
    #[inline(always)]
    pub fn none() -> View<V> {
        let zero = R::of(0.0);
        View { o: V::all(zero), below: R::Mask::of(false), eta: zero, choice: Choice::none(), masking: zero }
    }

    /// `wo` in the local frame.
    #[inline(always)]
    fn wo(&self) -> V {
        V::select(self.below, flipped(self.o), self.o)
    }

    /// What was sampled with `wo` on the upper side, for the side where it is.
    #[inline(always)]
    fn turned(&self, mut s: Local<V>) -> Local<V> {
        s.sample.wi = V::select(self.below, flipped(s.sample.wi), s.sample.wi);
        s
    }
}

impl<R: Real> Pair<R> {
    /// Two directions in the local frame.
    #[inline(always)]
    fn new(ggx: &Ggx<R>, o: R::Vec3, i: R::Vec3) -> Pair<R> {
        let sum = o + i;
        let (half, cos_d) = ggx.half(sum);
        Pair { cos: [o.z(), i.z()], masking: ggx.masking_over_cos(i), cos_d, half }
    }
}

#[inline(always)]
fn flipped<V: Vector>(w: V) -> V {
    V::new(w.x(), w.y(), -w.z())
}

/// A colour of luminance 1 with the hue of the given one; white for black.
#[inline]
fn hue_of(c: Vec3) -> Vec3 {
    let luminance = c.dot(Vec3::new(0.2126, 0.7152, 0.0722));
    if luminance > 0.0 { c / luminance } else { Vec3::ONE }
}
