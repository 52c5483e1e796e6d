//! Glass: a dielectric that is smooth, rough with either distribution of microfacets [Walter et al. 2007], or a thin pane.

use glam::Vec3;

use super::facets::{Facets, mirrored};
use super::{LobeSample, Local, Mode, fresnel};

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
        let Some(passage) = Passage::between(o, i, eta) else { return (Vec3::ZERO, 0.0) };
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
        let wi = if reflects { mirrored(o, h) } else { refracted(o, h, eta)? };
        if (wi.z > 0.0) != reflects {
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
pub struct Passage {
    /// The normal of the facet, on the upper side.
    pub h: Vec3,
    /// The part that is not reflected.
    pub passes: f32,
    /// Cosines of `o` and `i` with it, and the index of the lower side relative to the upper one.
    dot: [f32; 2],
    eta: f32,
}

impl Passage {
    /// The one facet that bends `o` into `i`, if any does; `eta` is the index of the lower side relative to the upper one.
    #[inline]
    pub fn between(o: Vec3, i: Vec3, eta: f32) -> Option<Passage> {
        let h = (o + i * eta).normalize_or(Vec3::Z);
        let h = if h.z < 0.0 { -h } else { h };
        let dot = [o.dot(h), i.dot(h)];
        if dot[0] <= 0.0 || dot[1] >= 0.0 {
            return None;
        }
        Some(Passage { h, passes: 1.0 - fresnel::dielectric(dot[0], eta).reflectance, dot, eta })
    }

    /// A density over facets, over the cosine of `o`, as one over directions of `i`, but for `eta^2`.
    #[inline]
    pub fn spread(&self, density: f32) -> f32 {
        let [dot_o, dot_i] = self.dot;
        let bend = dot_o + self.eta * dot_i;
        density * dot_o * -dot_i / (bend * bend)
    }

    /// Radiance is compressed into `1 / eta^2` of the solid angle that importance is.
    #[inline]
    pub fn scale(&self, mode: Mode) -> f32 {
        match mode {
            Mode::Radiance => 1.0,
            Mode::Importance => self.eta * self.eta,
        }
    }
}

/// The direction refracted at `h`. Its tangential part is taken from the vectors rather than from their cosine, which has
/// no digits left for it near the normal: what is returned is a unit vector even where rays are bent strongly.
#[inline]
pub fn refracted(o: Vec3, h: Vec3, eta: f32) -> Option<Vec3> {
    let along = (h * o.dot(h) - o) / eta;
    let cos2_t = 1.0 - along.length_squared();
    (cos2_t > 0.0).then(|| along - h * cos2_t.sqrt())
}
