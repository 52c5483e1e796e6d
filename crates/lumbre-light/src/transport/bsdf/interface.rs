//! The models of one interface: metals with a measured index, plastic, and glass, with microfacets
//! of either distribution.
//!
//! They correspond to those of Mitsuba 3 and Tungsten (`conductor`, `plastic`, `dielectric`, their
//! rough forms, and `thindielectric`), so that scenes written for those renderers look the same.
//! Metal and plastic are the same on both sides; all computations place `wo` on the upper side.

use glam::Vec3;

use super::conductor::Conductor;
use super::facets::Facets;
use super::glass::Glass;
use super::plastic::Plastic;
use super::{MixtureSample, TransportMode};
use crate::scene::compile::{Material, Model};

/// The BSDF of a material with one interface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum InterfaceBsdf {
    /// A smooth or rough metal.
    Conductor(Conductor),
    /// A diffuse body under a dielectric surface.
    Plastic(Plastic),
    /// Smooth, rough or thin glass.
    Glass(Glass),
}

#[inline]
fn flipped(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

impl InterfaceBsdf {
    /// Builds the BSDF of a material whose textures give this base colour and roughness; `None` for
    /// the models `disney` and `lambert`.
    #[inline]
    pub fn new(m: &Material, base_color: Vec3, roughness: f32) -> Option<InterfaceBsdf> {
        let p = &m.interface;
        let facets = (roughness >= m.smooth_below)
            .then(|| Facets::new(p.distribution, roughness, m.anisotropic));
        match m.model {
            Model::Disney | Model::Lambert => None,
            Model::Conductor => Some(InterfaceBsdf::Conductor(Conductor {
                tint: base_color * p.specular,
                eta: p.eta,
                k: p.k,
                facets,
            })),
            Model::Plastic => Some(InterfaceBsdf::Plastic(Plastic {
                diffuse: base_color,
                specular: p.specular,
                ior: m.ior,
                internal: p.internal_reflectance,
                nonlinear: p.nonlinear,
                facets,
            })),
            Model::Dielectric => Some(InterfaceBsdf::Glass(Glass {
                base_color,
                specular: p.specular,
                ior: m.ior,
                thin: p.thin,
                facets: facets.filter(|_| !p.thin && m.ior != 1.0),
            })),
        }
    }

    /// Evaluates the lobes that have a density.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> Vec3 {
        self.evaluate(wo, wi, mode).0
    }

    /// Returns the density of [`InterfaceBsdf::sample`] without Dirac lobes.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = if wo.z >= 0.0 {
            (wo, wi)
        } else {
            (flipped(wo), flipped(wi))
        };
        match self {
            InterfaceBsdf::Conductor(c) => c.evaluate(o, i).1[0],
            InterfaceBsdf::Plastic(p) => p.evaluate(o, i).1[0],
            InterfaceBsdf::Glass(g) => {
                g.density(o, i, self.eta_below(wo), TransportMode::Radiance)
                    .1
            }
        }
    }

    /// Returns the value, and the densities of `wi` given `wo` and of `wo` given `wi`.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: TransportMode) -> (Vec3, [f32; 2]) {
        let (o, i) = if wo.z >= 0.0 {
            (wo, wi)
        } else {
            (flipped(wo), flipped(wi))
        };
        match self {
            InterfaceBsdf::Conductor(c) => c.evaluate(o, i),
            InterfaceBsdf::Plastic(p) => p.evaluate(o, i),
            InterfaceBsdf::Glass(g) => {
                let (f, pdf_w) = g.density(o, i, self.eta_below(wo), mode);
                (f, [pdf_w, self.pdf_w(wi, wo)])
            }
        }
    }

    /// Returns whether any lobe has a density.
    #[inline]
    pub fn has_density(&self) -> bool {
        match self {
            InterfaceBsdf::Conductor(c) => c.facets.is_some(),
            InterfaceBsdf::Plastic(p) => p.facets.is_some() || p.diffuse != Vec3::ZERO,
            InterfaceBsdf::Glass(g) => g.has_density(),
        }
    }

    /// Samples a direction: `u` selects the lobe, `v` the direction within it.
    #[inline]
    pub fn sample(
        &self,
        wo: Vec3,
        u: f32,
        v: [f32; 2],
        mode: TransportMode,
    ) -> Option<MixtureSample> {
        let o = if wo.z >= 0.0 { wo } else { flipped(wo) };
        if o.z <= 0.0 {
            return None;
        }
        let mut s = match self {
            InterfaceBsdf::Conductor(c) => c.sample(o, v)?,
            InterfaceBsdf::Plastic(p) => p.sample(o, u, v)?,
            InterfaceBsdf::Glass(g) => g.sample(o, self.eta_below(wo), u, v, mode)?,
        };
        if wo.z < 0.0 {
            s.sample.wi = flipped(s.sample.wi);
        }
        Some(s)
    }

    /// Returns the index of the inside relative to the outside; 1 if light does not enter.
    #[inline]
    pub fn index_inside(&self) -> f32 {
        match self {
            InterfaceBsdf::Glass(g) if !g.thin => g.ior,
            _ => 1.0,
        }
    }

    /// Returns the index of the side opposite to `wo` relative to the side of `wo`.
    #[inline]
    fn eta_below(&self, wo: Vec3) -> f32 {
        match self {
            InterfaceBsdf::Glass(g) if wo.z < 0.0 => 1.0 / g.ior,
            InterfaceBsdf::Glass(g) => g.ior,
            InterfaceBsdf::Conductor(_) | InterfaceBsdf::Plastic(_) => 1.0,
        }
    }
}
