//! The models with one interface: metals of a measured index, plastic, and glass with microfacets of either distribution.
//!
//! They are those of Mitsuba 3 and Tungsten (`conductor`, `plastic`, `dielectric`, their rough forms, and
//! `thindielectric`), so that scenes which were written for those look as they should. Metal and plastic are the same on
//! both sides; all work is done with `wo` on the upper side.

use glam::Vec3;

use super::conductor::Conductor;
use super::facets::Facets;
use super::glass::Glass;
use super::plastic::Plastic;
use super::{Local, Mode};
use crate::scene::compile::{Material, Model};

/// One of the three.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Interface {
    /// Metal.
    Conductor(Conductor),
    /// A diffuse body under a dielectric surface.
    Plastic(Plastic),
    /// Glass.
    Glass(Glass),
}

#[inline]
fn flipped(w: Vec3) -> Vec3 {
    Vec3::new(w.x, w.y, -w.z)
}

impl Interface {
    /// The interface of a material whose textures say this base colour and roughness; `None` for the other models.
    #[inline]
    pub fn new(m: &Material, base_color: Vec3, roughness: f32) -> Option<Interface> {
        let p = &m.interface;
        let facets = (roughness >= m.smooth_below).then(|| Facets::new(p.distribution, roughness, m.anisotropic));
        match m.model {
            Model::Disney | Model::Lambert => None,
            Model::Conductor => {
                Some(Interface::Conductor(Conductor { tint: base_color * p.specular, eta: p.eta, k: p.k, facets }))
            }
            Model::Plastic => Some(Interface::Plastic(Plastic {
                diffuse: base_color,
                specular: p.specular,
                ior: m.ior,
                internal: p.internal_reflectance,
                nonlinear: p.nonlinear,
                facets,
            })),
            Model::Dielectric => Some(Interface::Glass(Glass {
                base_color,
                specular: p.specular,
                ior: m.ior,
                thin: p.thin,
                facets: facets.filter(|_| !p.thin && m.ior != 1.0),
            })),
        }
    }

    /// Value of the lobes that have a density.
    #[inline]
    pub fn eval(&self, wo: Vec3, wi: Vec3, mode: Mode) -> Vec3 {
        self.evaluate(wo, wi, mode).0
    }

    /// Density of [`Interface::sample`], Dirac lobes left out.
    #[inline]
    pub fn pdf_w(&self, wo: Vec3, wi: Vec3) -> f32 {
        let (o, i) = if wo.z >= 0.0 { (wo, wi) } else { (flipped(wo), flipped(wi)) };
        match self {
            Interface::Conductor(c) => c.evaluate(o, i).1[0],
            Interface::Plastic(p) => p.evaluate(o, i).1[0],
            Interface::Glass(g) => g.density(o, i, self.eta_below(wo), Mode::Radiance).1,
        }
    }

    /// Value, and densities of `wi` given `wo` and of `wo` given `wi`.
    #[inline]
    pub fn evaluate(&self, wo: Vec3, wi: Vec3, mode: Mode) -> (Vec3, [f32; 2]) {
        let (o, i) = if wo.z >= 0.0 { (wo, wi) } else { (flipped(wo), flipped(wi)) };
        match self {
            Interface::Conductor(c) => c.evaluate(o, i),
            Interface::Plastic(p) => p.evaluate(o, i),
            Interface::Glass(g) => {
                let (f, pdf_w) = g.density(o, i, self.eta_below(wo), mode);
                (f, [pdf_w, self.pdf_w(wi, wo)])
            }
        }
    }

    /// Whether any lobe has a density.
    #[inline]
    pub fn has_density(&self) -> bool {
        match self {
            Interface::Conductor(c) => c.facets.is_some(),
            Interface::Plastic(p) => p.facets.is_some() || p.diffuse != Vec3::ZERO,
            Interface::Glass(g) => g.has_density(),
        }
    }

    /// A direction: its lobe by `u`, within the lobe by `v`.
    #[inline]
    pub fn sample(&self, wo: Vec3, u: f32, v: [f32; 2], mode: Mode) -> Option<Local> {
        let o = if wo.z >= 0.0 { wo } else { flipped(wo) };
        if o.z <= 0.0 {
            return None;
        }
        let mut s = match self {
            Interface::Conductor(c) => c.sample(o, v)?,
            Interface::Plastic(p) => p.sample(o, u, v)?,
            Interface::Glass(g) => g.sample(o, self.eta_below(wo), u, v, mode)?,
        };
        if wo.z < 0.0 {
            s.sample.wi = flipped(s.sample.wi);
        }
        Some(s)
    }

    /// Index of the inside relative to the outside; 1 where nothing gets in.
    #[inline]
    pub fn index_inside(&self) -> f32 {
        match self {
            Interface::Glass(g) if !g.thin => g.ior,
            _ => 1.0,
        }
    }

    /// Index of the side that `wo` does not lie on, relative to the side that it does.
    #[inline]
    fn eta_below(&self, wo: Vec3) -> f32 {
        match self {
            Interface::Glass(g) if wo.z < 0.0 => 1.0 / g.ior,
            Interface::Glass(g) => g.ior,
            Interface::Conductor(_) | Interface::Plastic(_) => 1.0,
        }
    }
}
