//! The BSDF: a mixture of lobes chosen by the material's parameters.
//!
//! | weight | lobe |
//! |---|---|
//! | (1 - metallic) opacity | [`lambert`]: ideal diffuse reflection |
//! | metallic | [`mirror`]: ideal specular reflection off a metal |
//! | (1 - metallic) (1 - opacity) | [`dielectric`]: ideal specular reflection and refraction |
//!
//! Directions are in the local frame whose z axis is the shading normal on the front side.

pub mod dielectric;
pub mod fresnel;
pub mod lambert;
pub mod mirror;

use glam::Vec3;

use super::surface::Surface;
use crate::math::Frame;
use crate::scene::compile::Texture;

/// What is transported: it decides how refraction scales [Veach 1997, 5.2].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    /// Radiance, along camera paths.
    Radiance,
    /// Importance, along light paths.
    Importance,
}

/// A sampled direction in a lobe's local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeSample {
    /// The direction.
    pub wi: Vec3,
    /// `f |cos| / pdf_w` of this lobe alone.
    pub weight: Vec3,
    /// Index ratio crossed: inside over outside when entering, its inverse when leaving, 1 when reflected.
    pub eta: f32,
}

/// A sampled direction in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BsdfSample {
    /// Where the path goes on; a unit vector.
    pub wi: Vec3,
    /// `f |cos| / pdf_w`: what the path's throughput is multiplied by.
    pub weight: Vec3,
    /// Density per solid angle, or the probability of the choice where `delta`.
    pub pdf_w: f32,
    /// Whether the direction has no density because its lobe is a Dirac.
    pub delta: bool,
    /// Index ratio crossed; 1 without refraction.
    pub eta: f32,
}

/// The BSDF at a point of a surface.
#[derive(Clone, Copy, Debug)]
pub struct Bsdf {
    frame: Frame,
    n_geometric: Vec3,
    base_color: Vec3,
    ior: f32,
    /// Probabilities of Lambert, mirror and dielectric; they are also the mixture's weights.
    mix: [f32; 3],
}

impl Bsdf {
    /// The BSDF of a surface.
    #[inline]
    pub fn new(surface: &Surface, textures: &[Texture]) -> Bsdf {
        let m = surface.material;
        let dielectric = 1.0 - m.metallic;
        Bsdf {
            frame: Frame::from_normal(surface.n_shading),
            n_geometric: surface.n_geometric,
            base_color: surface.base_color(textures),
            ior: m.ior,
            mix: [dielectric * m.opacity, m.metallic, dielectric * (1.0 - m.opacity)],
        }
    }

    /// Value `f` without cosine, of the lobes that have one: Dirac lobes evaluate to zero.
    pub fn eval(&self, wo: Vec3, wi: Vec3, _mode: Mode) -> Vec3 {
        match self.local_pair(wo, wi) {
            Some((o, i)) => lambert::eval(self.base_color, o, i) * self.mix[0],
            None => Vec3::ZERO,
        }
    }

    /// Density per solid angle with which [`Bsdf::sample`] returns `wi`, Dirac lobes left out.
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        self.local_pair(wo, wi).map_or(0.0, |(o, i)| lambert::pdf_w(o, i) * self.mix[0])
    }

    /// Whether any lobe has a density, so that a connection to a light can carry something.
    pub fn has_density(&self) -> bool {
        self.mix[0] > 0.0
    }

    /// Samples a direction; `None` where nothing is reflected. `u` chooses the lobe and, in the dielectric, between
    /// reflection and refraction; `v` chooses within a lobe that has a density.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: Mode) -> Option<BsdfSample> {
        let local_wo = self.frame.to_local(wo);
        let [diffuse, metal, glass] = self.mix;
        let (sample, pdf_w, delta) = if u < diffuse {
            let s = lambert::sample(self.base_color, local_wo, v)?;
            (s, diffuse * lambert::pdf_w(local_wo, s.wi), false)
        } else if u < diffuse + metal || glass <= 0.0 {
            (mirror::sample(self.base_color, local_wo), metal, true)
        } else {
            let rest = ((u - diffuse - metal) / glass).clamp(0.0, 1.0);
            let (s, probability) = dielectric::sample(self.base_color, self.ior, local_wo, rest, mode)?;
            (s, glass * probability, true)
        };
        let wi = self.frame.to_world(sample.wi);
        // A shading normal can lift a direction through the real surface: such light does not exist.
        let refracted = sample.wi.z * local_wo.z < 0.0;
        let crosses = wi.dot(self.n_geometric) * wo.dot(self.n_geometric) < 0.0;
        (crosses == refracted && pdf_w > 0.0).then_some(BsdfSample {
            wi,
            weight: sample.weight,
            pdf_w,
            delta,
            eta: sample.eta,
        })
    }

    /// Both directions in the local frame, if the real surface allows light to be reflected between them.
    fn local_pair(&self, wo: Vec3, wi: Vec3) -> Option<(Vec3, Vec3)> {
        let same_side = wo.dot(self.n_geometric) * wi.dot(self.n_geometric) > 0.0;
        same_side.then(|| (self.frame.to_local(wo), self.frame.to_local(wi)))
    }
}
