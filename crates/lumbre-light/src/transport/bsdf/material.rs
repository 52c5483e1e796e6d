//! Materials in the form that BSDFs are built from: their class, the parameters that no texture
//! changes, and those that textures may change.

use glam::Vec3;

use super::clearcoat::Clearcoat;
use super::ggx;
use crate::math::real::Vector;
use crate::scene::compile::{Distribution, Formulas, KNOTS, Material, Model};

/// Traits of a material that are the same in all lanes of a vector, so that code may branch on
/// them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BsdfClass {
    /// Scattering model of the material.
    pub model: Model,
    /// Distribution of the microfacets of the models `conductor`, `plastic` and `dielectric`.
    pub distribution: Distribution,
    /// Whether glass is a thin pane.
    pub thin: bool,
    /// Renderer whose formulas hold where renderers differ.
    pub formulas: Formulas,
    /// Whether light passes the interface of plastic as its microfacets let it.
    pub rough_body: bool,
    /// Whether light that plastic reflects internally is coloured at each reflection.
    pub nonlinear: bool,
    /// Whether opaque lobes reflect on the front side only.
    pub one_sided: bool,
    /// Whether highlights may be anisotropic.
    pub anisotropic: bool,
    /// Whether the reflectance of the Disney model's dielectric at normal incidence is tinted.
    pub tinted: bool,
}

/// Parameters of a material that no texture changes; scalar or vectorised.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MaterialConstants<V: Vector = Vec3> {
    /// Index of the inside relative to the outside.
    pub ior: V::Scalar,
    /// Aspect of the microfacets: see [`ggx::aspect`].
    pub aspect: V::Scalar,
    /// Roughness below which microfacet lobes are Dirac lobes.
    pub smooth_below: V::Scalar,
    /// Share of the flatter, subsurface-like diffuse lobe.
    pub subsurface: V::Scalar,
    /// Share of the hue in the dielectric's reflectance at normal incidence.
    pub specular_tint: V::Scalar,
    /// Strength of the sheen.
    pub sheen: V::Scalar,
    /// Share of the hue in the sheen.
    pub sheen_tint: V::Scalar,
    /// The clear coat.
    pub coat: Clearcoat<V::Scalar>,
    /// Factor on the reflection at an interface.
    pub specular: V,
    /// Real part of a metal's index by channel.
    pub eta: V,
    /// Imaginary part of a metal's index by channel.
    pub k: V,
    /// Fraction of diffuse light that the inside of plastic's interface reflects back.
    pub internal_reflectance: V::Scalar,
    /// Transmittance of plastic's interface by its microfacets, as
    /// [`Transmittance`](crate::scene::compile::Transmittance); of `rough_body` alone.
    pub transmittance: [V::Scalar; KNOTS],
}

impl BsdfClass {
    /// Returns the class of a material.
    #[inline]
    pub fn of(m: &Material) -> BsdfClass {
        BsdfClass {
            model: m.model,
            distribution: m.interface.distribution,
            thin: m.interface.thin,
            formulas: m.formulas,
            rough_body: m.interface.transmittance.is_some(),
            nonlinear: m.interface.nonlinear,
            one_sided: m.one_sided,
            anisotropic: m.anisotropic != 0.0,
            tinted: m.specular_tint > 0.0,
        }
    }
}

impl MaterialConstants {
    /// Returns the constants of a material.
    #[inline]
    pub fn new(m: &Material) -> MaterialConstants {
        let p = &m.interface;
        MaterialConstants {
            ior: m.ior,
            aspect: ggx::aspect(m.anisotropic),
            smooth_below: m.smooth_below,
            subsurface: m.subsurface,
            specular_tint: m.specular_tint,
            sheen: m.sheen,
            sheen_tint: m.sheen_tint,
            coat: Clearcoat::new(m.clearcoat, m.clearcoat_gloss, m.formulas),
            specular: p.specular,
            eta: p.eta,
            k: p.k,
            internal_reflectance: p.internal_reflectance,
            transmittance: p.transmittance.unwrap_or_default(),
        }
    }
}
