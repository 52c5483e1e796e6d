//! The models of one interface: metals with a measured index, plastic, and glass, with microfacets
//! of either distribution.
//!
//! They correspond to those of Mitsuba 3 and Tungsten (`conductor`, `plastic`, `dielectric`, their
//! rough forms, and `thindielectric`), so that scenes written for those renderers look the same.
//! Metal and plastic are the same on both sides; all computations place `wo` on the upper side.

use glam::Vec3;

use super::conductor::Conductor;
use super::facets::Facets;
use super::ggx::Ggx;
use super::glass::Glass;
use super::interface_outgoing::{InterfaceOutgoing, PlasticSide};
use super::lobe::flipped;
use super::material::{BsdfClass, MaterialConstants};
use super::plastic::Plastic;
use super::{MixtureSample, TransportMode};
use crate::math::real::{Mask, Real, Vector};
use crate::scene::compile::Model;

/// The BSDF of a material with one interface, scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub enum InterfaceBsdf<V: Vector = Vec3> {
    /// A smooth or rough metal.
    Conductor(Conductor<V>),
    /// A diffuse body under a dielectric surface.
    Plastic(Plastic<V>),
    /// Smooth, rough or thin glass.
    Glass(Glass<V>),
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> InterfaceBsdf<V> {
    /// Builds the BSDF of materials whose textures give this base colour and roughness; `None` for
    /// the other models.
    #[inline(always)]
    pub fn new(
        class: &BsdfClass,
        m: &MaterialConstants<V>,
        base_color: V,
        roughness: R,
    ) -> Option<InterfaceBsdf<V>> {
        let facets = Facets {
            distribution: class.distribution,
            alpha: Ggx::new(roughness, m.aspect).alpha,
            smooth: !roughness.ge(m.smooth_below),
        };
        match class.model {
            Model::Disney | Model::Lambert | Model::Translucent => None,
            Model::Conductor => Some(InterfaceBsdf::Conductor(Conductor {
                tint: base_color * m.specular,
                eta: m.eta,
                k: m.k,
                facets,
            })),
            Model::Plastic => Some(InterfaceBsdf::Plastic(Plastic::new(
                base_color,
                m.specular,
                m.ior,
                (m.internal_reflectance, class.nonlinear),
                facets,
            ))),
            Model::Dielectric => {
                let equal = m.ior.eq(R::splat(1.0)) | R::Mask::splat(class.thin);
                let smooth = facets.smooth | equal;
                Some(InterfaceBsdf::Glass(Glass {
                    base_color,
                    specular: m.specular,
                    ior: m.ior,
                    thin: class.thin,
                    facets: Facets { smooth, ..facets },
                }))
            }
        }
    }

    /// Returns the microfacets.
    #[inline(always)]
    pub(super) fn facets(&self) -> &Facets<R> {
        match self {
            InterfaceBsdf::Conductor(c) => &c.facets,
            InterfaceBsdf::Plastic(p) => &p.facets,
            InterfaceBsdf::Glass(g) => &g.facets,
        }
    }

    /// Computes everything that depends on `wo` alone.
    #[inline(always)]
    pub fn outgoing(&self, wo: V) -> InterfaceOutgoing<V> {
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let below = wo.z().lt(zero);
        let o = V::select(below, flipped(wo), wo);
        let facets = self.facets();
        InterfaceOutgoing {
            o,
            below,
            eta: match self {
                InterfaceBsdf::Glass(g) => R::select(below, one / g.ior, g.ior),
                InterfaceBsdf::Conductor(_) | InterfaceBsdf::Plastic(_) => one,
            },
            masking: if (!facets.smooth).any() {
                facets.masking_over_cos(o)
            } else {
                zero
            },
            plastic: match self {
                InterfaceBsdf::Plastic(p) => p.side(o.z()),
                InterfaceBsdf::Conductor(_) | InterfaceBsdf::Glass(_) => PlasticSide::none(),
            },
        }
    }

    /// Evaluates the lobes that have a density.
    #[inline(always)]
    pub fn eval(&self, wo: V, wi: V, mode: TransportMode) -> V {
        self.evaluate::<false>(&self.outgoing(wo), wi, mode).0
    }

    /// Returns the density of [`InterfaceBsdf::sample`] without Dirac lobes.
    #[inline(always)]
    pub fn pdf_w(&self, wo: V, wi: V) -> R {
        self.evaluate::<false>(&self.outgoing(wo), wi, TransportMode::Radiance)
            .1[0]
    }

    /// Returns the value, the density of `wi` given `wo` and, with `REVERSE`, that of `wo` given
    /// `wi`.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<V>,
        wi: V,
        mode: TransportMode,
    ) -> (V, [R; 2]) {
        let i = V::select(out.below, flipped(wi), wi);
        match self {
            InterfaceBsdf::Conductor(c) => c.evaluate(out, i),
            InterfaceBsdf::Plastic(p) => p.evaluate(out, i),
            InterfaceBsdf::Glass(g) => {
                let (f, pdf_w) = g.density(out, i, mode);
                let reverse = if REVERSE {
                    self.pdf_w(wi, out.wo())
                } else {
                    R::splat(0.0)
                };
                (f, [pdf_w, reverse])
            }
        }
    }

    /// Returns whether any lobe has a density.
    #[inline(always)]
    pub fn has_density(&self) -> R::Mask {
        match self {
            InterfaceBsdf::Plastic(p) => p.has_density(),
            InterfaceBsdf::Conductor(_) | InterfaceBsdf::Glass(_) => !self.facets().smooth,
        }
    }

    /// Samples a direction: `u` selects the lobe, `v` the direction within it. The mask is set
    /// where there is a sample. With `REVERSE` also returns the density of `wo` given the
    /// direction, else an undefined number; it is zero for Dirac lobes.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<V>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, R) {
        let zero = R::splat(0.0);
        let (some, mut s, mut reverse) = match self {
            InterfaceBsdf::Conductor(c) => c.sample(out, v),
            InterfaceBsdf::Plastic(p) => p.sample(out, u, v),
            InterfaceBsdf::Glass(g) => {
                let (some, s) = g.sample(out, u, v, mode);
                (some, s, zero)
            }
        };
        s.sample.wi = V::select(out.below, flipped(s.sample.wi), s.sample.wi);
        if let InterfaceBsdf::Glass(_) = self
            && REVERSE
            && (!s.delta).any()
        {
            reverse = R::select(s.delta, zero, self.pdf_w(s.sample.wi, out.wo()));
        }
        (some & out.o.z().gt(zero), s, reverse)
    }

    /// Returns the index of the inside relative to the outside; 1 if light does not enter.
    #[inline(always)]
    pub fn index_inside(&self) -> R {
        match self {
            InterfaceBsdf::Glass(g) if !g.thin => g.ior,
            _ => R::splat(1.0),
        }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> InterfaceOutgoing<V> {
    /// Returns a placeholder for surfaces of another model.
    #[inline(always)]
    pub fn none() -> InterfaceOutgoing<V> {
        let zero = R::splat(0.0);
        InterfaceOutgoing {
            o: V::splat(zero),
            below: R::Mask::splat(false),
            eta: zero,
            masking: zero,
            plastic: PlasticSide::none(),
        }
    }

    /// Returns `wo` in the local frame.
    #[inline(always)]
    fn wo(&self) -> V {
        V::select(self.below, flipped(self.o), self.o)
    }
}
