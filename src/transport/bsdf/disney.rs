//! The adapted Disney BSDF: a dielectric that is opaque or refractive, a metal, and a clear coat.
//!
//! All work is done with `wo` on the upper side: opaque lobes are the same on both sides of a surface, and the
//! refractive one sees the inverse index from within.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::diffuse::Diffuse;
use super::fresnel;
use super::ggx::Ggx;
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

/// Probabilities of choosing the lobes.
struct Choice {
    diffuse: f32,
    reflection: f32,
    glass: f32,
    coat: f32,
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

    /// Probabilities in proportion to what each lobe is estimated to reflect; `None` where nothing does.
    #[inline]
    fn choice(&self, cos_o: f32) -> Option<Choice> {
        let Estimate { diffuse, reflection, rise } = self.estimate;
        let reflection = reflection + rise * fresnel::schlick_weight(cos_o);
        let coat = self.coat.reflectance(cos_o);
        let total = diffuse + reflection + self.refractive + coat;
        (total > 0.0).then(|| {
            let scale = 1.0 / total;
            Choice {
                diffuse: diffuse * scale,
                reflection: reflection * scale,
                glass: self.refractive * scale,
                coat: coat * scale,
            }
        })
    }

    /// The value for `wo` and `wi` in the local frame.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: Mode) -> Vec3 {
        let (o, i, ior) = self.upper(wo, wi);
        self.density(o, i, ior, mode, None).0
    }

    /// The density of [`Disney::sample`].
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i, ior) = self.upper(wo, wi);
        let Some(choice) = self.choice(o.z) else { return 0.0 };
        self.density(o, i, ior, Mode::Radiance, Some(&choice)).1
    }

    /// [`Disney::eval`], [`Disney::pdf_w`] and the same with the directions exchanged, for little more than one of them. Without
    /// `REVERSE` that last density is left out.
    #[inline]
    pub fn evaluate<const REVERSE: bool>(&self, wo: Vec3, wi: Vec3, mode: Mode) -> (Vec3, [f32; 2]) {
        let (o, i, eta) = self.upper(wo, wi);
        if o.z > 0.0 && i.z > 0.0 {
            let choices = [self.choice(o.z), if REVERSE { self.choice(i.z) } else { None }];
            return self.reflected(o, i, eta, choices.each_ref().map(Option::as_ref));
        }
        if self.refractive <= 0.0 {
            return (Vec3::ZERO, [0.0; 2]);
        }
        let (f, pdf_w) = self.density(o, i, eta, mode, self.choice(o.z).as_ref());
        (f, [pdf_w, if REVERSE { self.pdf_w(wi, wo) } else { 0.0 }])
    }

    /// Both directions mirrored so that `wo` is on the upper side, and the index of the lower one.
    #[inline]
    fn upper(&self, wo: Vec3, wi: Vec3) -> (Vec3, Vec3, f32) {
        if wo.z >= 0.0 {
            (wo, wi, self.ior)
        } else {
            (Vec3::new(wo.x, wo.y, -wo.z), Vec3::new(wi.x, wi.y, -wi.z), 1.0 / self.ior)
        }
    }

    /// Value and, given the probabilities of the lobes, density, of all lobes that have one.
    #[inline]
    fn density(&self, o: Vec3, i: Vec3, eta: f32, mode: Mode, choice: Option<&Choice>) -> (Vec3, f32) {
        if o.z <= 0.0 || i.z == 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        if i.z > 0.0 {
            let (f, [pdf_w, _]) = self.reflected(o, i, eta, [choice, None]);
            (f, pdf_w)
        } else {
            self.transmitted(o, i, eta, mode, choice)
        }
    }

    /// Value and densities of reflection: of `i` given `o` and of `o` given `i`, each where the probabilities of the lobes
    /// seen from there are given, and else zero.
    #[inline(always)]
    fn reflected(&self, o: Vec3, i: Vec3, eta: f32, choices: [Option<&Choice>; 2]) -> (Vec3, [f32; 2]) {
        let mut f = Vec3::ZERO;
        let mut pdf = [0.0; 2];
        let mut add = |densities: [f32; 2], probability: fn(&Choice, f32) -> f32, r: f32| {
            for (k, choice) in choices.iter().enumerate() {
                if let Some(c) = choice {
                    pdf[k] += probability(c, r) * densities[k];
                }
            }
        };
        if self.opaque > 0.0 {
            f += self.diffuse.eval(o, i) * self.opaque;
            add([i.z, o.z].map(warp::cosine_hemisphere_pdf_w), |c, _| c.diffuse, 0.0);
        }
        let h = (o + i).normalize_or(Vec3::Z);
        let cos = o.dot(h);
        if !self.smooth {
            let d = 0.25 * self.ggx.d(h);
            let seen = [o, i].map(|w| self.ggx.masking_over_cos(w));
            let mut reflectance = self.opaque_reflectance(cos);
            let mut r = 0.0;
            if self.refractive > 0.0 && !self.smooth_glass() {
                r = fresnel::dielectric(cos, eta).reflectance;
                reflectance += Vec3::splat(self.refractive * r);
            }
            f += reflectance * (seen[0] * d * seen[1]);
            add(seen.map(|masking| masking * d), |c, r| c.reflection + c.glass * r, r);
        }
        if self.coat.strength > 0.0 {
            f = f * self.coat.passes(o.z, i.z) + Vec3::splat(self.coat.eval(o, i, h));
            add([self.coat.pdf_w(o, h); 2], |c, _| c.coat, 0.0);
        }
        (f, pdf)
    }

    /// Rough refraction [Walter et al. 2007, equations 17 and 21]; `eta` is the index of the side of `i` over that of
    /// the side of `o`. Radiance is compressed into `1 / eta^2` of the solid angle that importance is.
    #[inline]
    fn transmitted(&self, o: Vec3, i: Vec3, eta: f32, mode: Mode, choice: Option<&Choice>) -> (Vec3, f32) {
        if self.refractive <= 0.0 || self.smooth_glass() {
            return (Vec3::ZERO, 0.0);
        }
        let h = (o + i * eta).normalize_or(Vec3::Z);
        let h = if h.z < 0.0 { -h } else { h };
        let (dot_o, dot_i) = (o.dot(h), i.dot(h));
        if dot_o <= 0.0 || dot_i >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let passes = 1.0 - fresnel::dielectric(dot_o, eta).reflectance;
        let bend = dot_o + eta * dot_i;
        let common = passes * self.ggx.pdf_over_dot(o, h) * dot_o * -dot_i / (bend * bend);
        let scale = match mode {
            Mode::Radiance => 1.0,
            Mode::Importance => eta * eta,
        };
        let masking = self.ggx.masking_over_cos(Vec3::new(i.x, i.y, -i.z));
        let f = self.tint() * (self.refractive * common * masking * scale * self.coat.passes(o.z, i.z));
        (f, choice.map_or(0.0, |c| c.glass * common * eta * eta))
    }

    /// What passes through once: entering and leaving carries the base colour [Burley 2015, 5.3].
    #[inline]
    fn tint(&self) -> Vec3 {
        self.base_color.map(f32::sqrt)
    }

    /// Samples a direction: a lobe by `u`, a direction in it by `v`; the weight is that of the whole mixture. With
    /// `REVERSE` the density of `wo` given that direction comes along, else zero; for Dirac lobes it is zero.
    #[inline]
    pub fn sample<const REVERSE: bool>(&self, wo: Vec3, u: f32, v: [f32; 2], mode: Mode) -> Option<(Local, f32)> {
        let (o, _, eta) = self.upper(wo, wo);
        if o.z <= 0.0 {
            return None;
        }
        let c = self.choice(o.z)?;
        let (mut s, mut reverse) = if u < c.diffuse {
            self.finish::<REVERSE>(o, warp::cosine_hemisphere(v), eta, mode, &c)?
        } else if u < c.diffuse + c.reflection {
            if self.smooth {
                let wi = Vec3::new(-o.x, -o.y, o.z);
                let weight = self.opaque_reflectance(o.z) / c.reflection * self.coat.passes(o.z, o.z);
                (Local::new(LobeSample { wi, weight, eta: 1.0 }, c.reflection, true), 0.0)
            } else {
                let wi = mirrored(o, self.ggx.sample(o, v));
                if wi.z <= 0.0 {
                    return None;
                }
                self.finish::<REVERSE>(o, wi, eta, mode, &c)?
            }
        } else if u < c.diffuse + c.reflection + c.glass || c.coat <= 0.0 {
            let rest = ((u - c.diffuse - c.reflection) / c.glass).clamp(0.0, 1.0);
            if self.smooth_glass() {
                (self.smooth_refraction(o, rest, eta, mode, &c)?, 0.0)
            } else {
                let h = self.ggx.sample(o, v);
                let reflectance = fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
                let wi = if rest < reflectance { mirrored(o, h) } else { refracted(o, h, eta)? };
                if (wi.z > 0.0) != (rest < reflectance) {
                    return None;
                }
                self.finish::<REVERSE>(o, wi, eta, mode, &c)?
            }
        } else {
            let h = self.coat.sample(v);
            if o.dot(h) <= 0.0 {
                return None;
            }
            let wi = mirrored(o, h);
            if wi.z <= 0.0 {
                return None;
            }
            self.finish::<REVERSE>(o, wi, eta, mode, &c)?
        };
        if wo.z < 0.0 {
            s.sample.wi.z = -s.sample.wi.z;
        }
        if REVERSE && !s.delta && s.sample.wi.z * wo.z < 0.0 {
            reverse = self.pdf_w(s.sample.wi, wo);
        }
        Some((s, reverse))
    }

    /// A sampled direction with the weight and density of the whole mixture; with `REVERSE` also the density of `o` given
    /// it, where it is reflected.
    #[inline]
    fn finish<const REVERSE: bool>(
        &self,
        o: Vec3,
        i: Vec3,
        eta: f32,
        mode: Mode,
        choice: &Choice,
    ) -> Option<(Local, f32)> {
        let (f, [pdf_w, reverse]) = if REVERSE && i.z > 0.0 {
            self.reflected(o, i, eta, [Some(choice), self.choice(i.z).as_ref()])
        } else {
            let (f, pdf_w) = self.density(o, i, eta, mode, Some(choice));
            (f, [pdf_w, 0.0])
        };
        let weight = f * (i.z.abs() / pdf_w);
        let eta = if i.z < 0.0 { eta } else { 1.0 };
        let local = || (Local::new(LobeSample { wi: i, weight, eta }, pdf_w, false), reverse);
        (pdf_w > 0.0 && weight.is_finite()).then(local)
    }

    #[inline]
    fn smooth_refraction(&self, o: Vec3, u: f32, eta: f32, mode: Mode, choice: &Choice) -> Option<Local> {
        let (mut s, probability) = super::dielectric::sample(self.base_color, eta, o, u, mode)?;
        s.weight *= self.refractive / choice.glass * self.coat.passes(o.z, s.wi.z);
        Some(Local::new(s, choice.glass * probability, true))
    }
}

#[inline]
fn mirrored(o: Vec3, h: Vec3) -> Vec3 {
    h * (2.0 * o.dot(h)) - o
}

/// The direction refracted at `h`. Its tangential part is taken from the vectors rather than from their cosine, which has
/// no digits left for it near the normal: what is returned is a unit vector even where rays are bent strongly.
#[inline]
fn refracted(o: Vec3, h: Vec3, eta: f32) -> Option<Vec3> {
    let along = (h * o.dot(h) - o) / eta;
    let cos2_t = 1.0 - along.length_squared();
    (cos2_t > 0.0).then(|| along - h * cos2_t.sqrt())
}
