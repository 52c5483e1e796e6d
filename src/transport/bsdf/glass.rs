//! Glass: a dielectric that is smooth, rough with either distribution of microfacets [Walter et al. 2007], or a thin pane.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::{LobeSample, Local, Mode, fresnel};
use crate::math::real::{Real, Vector};

/// Glass at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Glass {
    /// Square of the factor on what passes once, as in [`super::dielectric`].
    pub base_color: Vec3,
    /// Factor on what is reflected.
    pub specular: Vec3,
    /// Index of the inside relative to the outside.
    pub ior: f32,
    /// Whether it is a pane without an inside: what passes is not bent, and reflections between its faces are summed.
    pub thin: bool,
    /// Its microfacets, or `None` where it is smooth; a thin pane is always smooth.
    pub facets: Option<Facets>,
}

impl Glass {
    #[inline]
    fn tint(&self) -> Vec3 {
        self.base_color.map(f32::sqrt)
    }

    /// Whether directions have a density.
    #[inline]
    pub fn has_density(&self) -> bool {
        self.facets.is_some() && !self.thin
    }

    /// Value and density of `i` given `o`, for `o` on the upper side; `eta` is the index of the lower side relative to it.
    #[inline]
    pub fn density(&self, o: Vec3, i: Vec3, eta: f32, mode: Mode) -> (Vec3, f32) {
        let Some(facets) = self.facets.as_ref().filter(|_| !self.thin && o.z > 0.0 && i.z != 0.0) else {
            return (Vec3::ZERO, 0.0);
        };
        if i.z > 0.0 {
            let h = (o + i).normalize_or(Vec3::Z);
            let r = fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
            let common = 0.25 * r * facets.pdf_over_dot(o, h);
            return (self.specular * (common * facets.masking_over_cos(i)), common);
        }
        let (bent, passage) = Passage::between(o, i, eta);
        if !bent {
            return (Vec3::ZERO, 0.0);
        }
        let common = passage.spread(passage.passes * facets.pdf_over_dot(o, passage.h));
        let masking = facets.masking_over_cos(Vec3::new(i.x, i.y, -i.z));
        (self.tint() * (common * masking * passage.scale(mode)), common * eta * eta)
    }

    /// A direction for `o` on the upper side.
    #[inline]
    pub fn sample(&self, o: Vec3, eta: f32, u: f32, v: [f32; 2], mode: Mode) -> Option<Local> {
        if self.thin {
            return Some(self.through_pane(o, u));
        }
        let Some(facets) = &self.facets else {
            let (mut s, probability) = super::dielectric::sample(self.base_color, eta, o, u, mode)?;
            if s.eta == 1.0 {
                s.weight *= self.specular;
            }
            return Some(Local::new(s, probability, true));
        };
        let h = facets.sample(o, v);
        let r = fresnel::dielectric(o.dot(h).max(0.0), eta).reflectance;
        let reflects = u < r;
        let (bends, through) = refracted(o, h, eta);
        let wi = if reflects { mirrored(o, h) } else { through };
        if !(reflects || bends) || (wi.z > 0.0) != reflects {
            return None;
        }
        let (f, pdf_w) = self.density(o, wi, eta, mode);
        let weight = f * (wi.z.abs() / pdf_w);
        let eta = if reflects { 1.0 } else { eta };
        (pdf_w > 0.0 && weight.is_finite()).then(|| Local::new(LobeSample { wi, weight, eta }, pdf_w, false))
    }

    /// Reflected by either face after any number of reflections inside: `R + T^2 R + T^2 R^3 + ... = 2 R / (1 + R)`.
    #[inline]
    fn through_pane(&self, o: Vec3, u: f32) -> Local {
        let once = fresnel::dielectric(o.z, self.ior.max(1.0 / self.ior)).reflectance;
        let r = 2.0 * once / (1.0 + once);
        if u < r {
            let wi = Vec3::new(-o.x, -o.y, o.z);
            return Local::new(LobeSample { wi, weight: self.specular, eta: 1.0 }, r, true);
        }
        Local::new(LobeSample { wi: -o, weight: self.tint(), eta: 1.0 }, 1.0 - r, true)
    }
}

/// Light that passes a facet, from `o` on the upper side to `i` on the lower one [Walter et al. 2007, equations 17 and 21].
/// Every rough refractive lobe is made of it.
#[derive(Clone, Copy, Debug)]
pub struct Passage<V: Vector = Vec3> {
    /// The normal of the facet, on the upper side.
    pub h: V,
    /// The part that is not reflected.
    pub passes: V::Scalar,
    /// Cosines of `o` and `i` with it, and the index of the lower side relative to the upper one.
    dot: [V::Scalar; 2],
    eta: V::Scalar,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> Passage<V> {
    /// The one facet that bends `o` into `i`, and whether any does; `eta` is the index of the lower side relative to the upper one.
    #[inline(always)]
    pub fn between(o: V, i: V, eta: R) -> (R::Mask, Passage<V>) {
        let zero = R::of(0.0);
        let h = (o + i * eta).normalize_or(V::of(Vec3::Z));
        let h = V::select(h.z().lt(zero), -h, h);
        let dot = [o.dot(h), i.dot(h)];
        let passes = R::of(1.0) - fresnel::dielectric(dot[0], eta).reflectance;
        (!(dot[0].le(zero) | dot[1].ge(zero)), Passage { h, passes, dot, eta })
    }

    /// A density over facets, over the cosine of `o`, as one over directions of `i`, but for `eta^2`.
    #[inline(always)]
    pub fn spread(&self, density: R) -> R {
        let [dot_o, dot_i] = self.dot;
        let bend = dot_o + self.eta * dot_i;
        density * dot_o * -dot_i / (bend * bend)
    }

    /// Radiance is compressed into `1 / eta^2` of the solid angle that importance is.
    #[inline(always)]
    pub fn scale(&self, mode: Mode) -> R {
        match mode {
            Mode::Radiance => R::of(1.0),
            Mode::Importance => self.eta * self.eta,
        }
    }
}

/// The direction refracted at `h`, and whether there is one. Its tangential part is taken from the vectors rather than from their cosine, which has
/// no digits left for it near the normal: what is returned is a unit vector even where rays are bent strongly.
#[inline(always)]
pub fn refracted<R: Real, V: Vector<Scalar = R>>(o: V, h: V, eta: R) -> (R::Mask, V) {
    let along = (h * o.dot(h) - o) / eta;
    let cos2_t = R::of(1.0) - along.length_squared();
    (cos2_t.gt(R::of(0.0)), along - h * cos2_t.sqrt())
}
