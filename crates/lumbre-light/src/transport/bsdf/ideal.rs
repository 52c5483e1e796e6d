//! The ideal surface: Lambert, mirror and smooth dielectric, the cheap limits of the Disney lobes.

use glam::Vec3;

use super::{LobeSample, MixtureSample, TransportMode, dielectric, lambert, mirror};

/// An ideal surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ideal {
    /// Base colour of all lobes.
    pub base_color: Vec3,
    /// Index of the inside relative to the outside.
    pub ior: f32,
    /// Probabilities of Lambert, mirror and dielectric; also the weights of the mixture.
    pub mix: [f32; 3],
}

impl Ideal {
    /// Evaluates the diffuse part.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3) -> Vec3 {
        lambert::eval(self.base_color, wo, wi) * self.mix[0]
    }

    /// Returns the density of the diffuse part.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        lambert::pdf_w(wo, wi) * self.mix[0]
    }

    /// Samples a direction of one lobe. Its weight equals that of the mixture, since probabilities
    /// and weights coincide.
    #[inline]
    pub fn sample(
        &self,
        wo: Vec3,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<MixtureSample> {
        let [diffuse, metal, glass] = self.mix;
        if u < diffuse {
            let (some, s) = lambert::sample(self.base_color, wo, v);
            return some.then(|| MixtureSample::new(s, diffuse * lambert::pdf_w(wo, s.wi), false));
        }
        if u < diffuse + metal || glass <= 0.0 {
            return Some(MixtureSample::new(
                mirror::sample(self.base_color, wo),
                metal,
                true,
            ));
        }
        let rest = ((u - diffuse - metal) / glass).clamp(0.0, 1.0);
        let (s, probability): (LobeSample, f32) =
            dielectric::sample(self.base_color, self.ior, wo, rest, mode)?;
        Some(MixtureSample::new(s, glass * probability, true))
    }
}
