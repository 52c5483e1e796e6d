//! The ideal surface: Lambert, mirror and smooth dielectric, the limits of the Disney lobes that cost least.

use glam::Vec3;

use super::{LobeSample, Local, Mode, dielectric, lambert, mirror};

/// An ideal surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ideal {
    /// Base colour.
    pub base_color: Vec3,
    /// Index of the inside.
    pub ior: f32,
    /// Probabilities of Lambert, mirror and dielectric; they are also the mixture's weights.
    pub mix: [f32; 3],
}

impl Ideal {
    /// The value of the diffuse part.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        lambert::eval(self.base_color, wo, wi) * self.mix[0]
    }

    /// The density of the diffuse part.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        lambert::pdf_w(wo, wi) * self.mix[0]
    }

    /// A direction of one lobe; the weight of one lobe of this mixture is the lobe's own.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: Mode) -> Option<Local> {
        let [diffuse, metal, glass] = self.mix;
        if u < diffuse {
            let (some, s) = lambert::sample(self.base_color, wo, v);
            return some.then(|| Local::new(s, diffuse * lambert::pdf_w(wo, s.wi), false));
        }
        if u < diffuse + metal || glass <= 0.0 {
            return Some(Local::new(mirror::sample(self.base_color, wo), metal, true));
        }
        let rest = ((u - diffuse - metal) / glass).clamp(0.0, 1.0);
        let (s, probability): (LobeSample, f32) = dielectric::sample(self.base_color, self.ior, wo, rest, mode)?;
        Some(Local::new(s, glass * probability, true))
    }
}
