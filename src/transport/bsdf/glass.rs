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
        let h = (o + i * eta).normalize_or(Vec3::Z);
        let h = if h.z < 0.0 { -h } else { h };
        let (dot_o, dot_i) = (o.dot(h), i.dot(h));
        if dot_o <= 0.0 || dot_i >= 0.0 {
            return (Vec3::ZERO, 0.0);
        }
        let passes = 1.0 - fresnel::dielectric(dot_o, eta).reflectance;
        let bend = dot_o + eta * dot_i;
        let common = passes * facets.pdf_over_dot(o, h) * dot_o * -dot_i / (bend * bend);
        let scale = match mode {
            Mode::Radiance => 1.0,
            Mode::Importance => eta * eta,
        };
        let masking = facets.masking_over_cos(Vec3::new(i.x, i.y, -i.z));
        (self.tint() * (common * masking * scale), common * eta * eta)
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

/// The direction refracted at `h`, as a unit vector also near the normal.
#[inline]
fn refracted(o: Vec3, h: Vec3, eta: f32) -> Option<Vec3> {
    let along = (h * o.dot(h) - o) / eta;
    let cos2_t = 1.0 - along.length_squared();
    (cos2_t > 0.0).then(|| along - h * cos2_t.sqrt())
}
