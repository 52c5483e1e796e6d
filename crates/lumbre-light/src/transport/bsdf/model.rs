//! The BSDF of a surface in its local frame, of any model.

use super::disney::{Disney, DisneyOutgoing};
use super::ideal::Ideal;
use super::interface::InterfaceBsdf;
use super::interface_outgoing::InterfaceOutgoing;
use super::material::{BsdfClass, MaterialConstants};
use super::translucent::Translucent;
use super::{MixtureSample, TransportMode};
use crate::math::Frame;
use crate::math::real::{Mask, Real, Vector};
use crate::scene::compile::Model;
use crate::transport::surface::ShadingParameters;

/// The direction to the previous vertex with everything that the BSDF derives from it alone,
/// computed once for all directions that are combined with it.
#[derive(Clone, Copy, Debug)]
pub struct Outgoing<R: Real = f32> {
    /// The unit direction.
    pub wo: R::Vec3,
    /// The direction in the local frame.
    pub(super) local: R::Vec3,
    /// Whether the geometric and the shading normal agree on its side; otherwise the BSDF is black.
    pub same_side: R::Mask,
    /// Derived quantities of the model `disney`.
    pub(super) disney: DisneyOutgoing<R::Vec3>,
    /// Derived quantities of the models of interfaces.
    pub(super) interface: InterfaceOutgoing<R::Vec3>,
}

/// The BSDF of one of the models; all lanes have the same.
#[derive(Clone, Copy, Debug)]
pub(super) enum BsdfModel<V: Vector> {
    Ideal(Ideal<V>),
    Translucent(Translucent<V>),
    Disney(Disney<V>),
    Interface(InterfaceBsdf<V>),
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> BsdfModel<V> {
    /// Builds the BSDF of materials of one class at points with these parameters.
    #[inline(always)]
    pub fn new(
        class: &BsdfClass,
        m: &MaterialConstants<V>,
        p: &ShadingParameters<R>,
    ) -> BsdfModel<V> {
        if class.model == Model::Translucent {
            return BsdfModel::Translucent(Translucent::new(p.base_color, p.transmittance()));
        }
        let (zero, one) = (R::splat(0.0), R::splat(1.0));
        let dielectric = one - p.metallic;
        let mix = [
            dielectric * p.opacity,
            p.metallic,
            dielectric * (one - p.opacity),
        ];
        if class.model == Model::Disney {
            let (color, roughness) = (p.base_color, p.roughness);
            return BsdfModel::Disney(Disney::new(m, class, color, roughness, mix));
        }
        match InterfaceBsdf::new(class, m, p.base_color, p.roughness) {
            Some(interface) => BsdfModel::Interface(interface),
            None => BsdfModel::Ideal(Ideal {
                base_color: p.base_color,
                ior: m.ior,
                one_sided: class.one_sided,
                mix: if class.model == Model::Lambert {
                    mix
                } else {
                    [one, zero, zero]
                },
            }),
        }
    }

    /// Computes what depends on `wo` alone, for its direction in the local frame.
    #[inline(always)]
    pub fn outgoing(&self, local: V) -> (DisneyOutgoing<V>, InterfaceOutgoing<V>) {
        match self {
            BsdfModel::Ideal(_) | BsdfModel::Translucent(_) => {
                (DisneyOutgoing::none(), InterfaceOutgoing::none())
            }
            BsdfModel::Disney(k) => (k.outgoing(local), InterfaceOutgoing::none()),
            BsdfModel::Interface(k) => (DisneyOutgoing::none(), k.outgoing(local)),
        }
    }

    /// Evaluates the lobes for two directions in the local frame.
    #[inline(always)]
    pub fn eval(&self, o: V, i: V, mode: TransportMode) -> V {
        match self {
            BsdfModel::Ideal(k) => k.eval(o, i),
            BsdfModel::Translucent(k) => k.eval(o, i),
            BsdfModel::Disney(k) => k.eval(o, i, mode),
            BsdfModel::Interface(k) => k.eval(o, i, mode),
        }
    }

    /// Returns the density of `i` given `o`, in the local frame.
    #[inline(always)]
    pub fn pdf_w(&self, o: V, i: V) -> R {
        match self {
            BsdfModel::Ideal(k) => k.pdf_w(o, i),
            BsdfModel::Translucent(k) => k.pdf_w(o, i),
            BsdfModel::Disney(k) => k.pdf_w(o, i),
            BsdfModel::Interface(k) => k.pdf_w(o, i),
        }
    }

    /// Returns the value, the density of `wi` and, with `REVERSE`, the density of `out.wo` given
    /// `wi`, in the lanes of `wanted`. `wi` is in world space and has the cosine `cos_i` with the
    /// normal of `frame`.
    #[inline(always)]
    pub fn evaluate<const REVERSE: bool>(
        &self,
        frame: &Frame<V>,
        out: &Outgoing<R>,
        (wi, cos_i): (V, R),
        mode: TransportMode,
        wanted: R::Mask,
    ) -> (V, [R; 2]) {
        match self {
            BsdfModel::Ideal(_) | BsdfModel::Translucent(_) => {
                let (o, i) = (out.local, frame.to_local(wi));
                let reverse = if REVERSE {
                    self.pdf_w(i, o)
                } else {
                    R::splat(0.0)
                };
                (self.eval(o, i, mode), [self.pdf_w(o, i), reverse])
            }
            BsdfModel::Disney(k) => {
                let directions = [out.wo, wi];
                k.evaluate_in::<REVERSE>(frame, &out.disney, directions, cos_i, mode, wanted)
            }
            BsdfModel::Interface(k) => {
                k.evaluate::<REVERSE>(&out.interface, frame.to_local(wi), mode)
            }
        }
    }

    /// Samples a direction in the local frame; the mask is set where there is one. With `REVERSE`
    /// also returns the density of `out.wo` given the direction, else an undefined number.
    #[inline(always)]
    pub fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<V>, R) {
        match self {
            BsdfModel::Ideal(k) => {
                let (some, s) = k.sample(out.local, u, v, mode);
                let zero = R::splat(0.0);
                let reverse = if REVERSE && (!s.delta).any() {
                    R::select(s.delta, zero, k.pdf_w(s.sample.wi, out.local))
                } else {
                    zero
                };
                (some, s, reverse)
            }
            BsdfModel::Translucent(k) => {
                let (some, s) = k.sample(out.local, u, v);
                let reverse = if REVERSE {
                    k.pdf_w(s.sample.wi, out.local)
                } else {
                    R::splat(0.0)
                };
                (some, s, reverse)
            }
            BsdfModel::Disney(k) => k.sample::<REVERSE>(&out.disney, u, v, mode),
            BsdfModel::Interface(k) => k.sample::<REVERSE>(&out.interface, u, v, mode),
        }
    }

    /// Returns whether this is a metal or plastic, whose lobes are all opaque.
    #[inline(always)]
    pub fn is_opaque_interface(&self) -> bool {
        use InterfaceBsdf::{Conductor, Plastic};
        matches!(self, BsdfModel::Interface(Conductor(_) | Plastic(_)))
    }

    /// Returns the index of the inside relative to the outside.
    #[inline(always)]
    pub fn index_inside(&self) -> R {
        match self {
            BsdfModel::Ideal(k) => k.ior,
            BsdfModel::Translucent(_) => R::splat(1.0),
            BsdfModel::Disney(k) => k.ior,
            BsdfModel::Interface(k) => k.index_inside(),
        }
    }

    /// Returns where any lobe has a density.
    #[inline(always)]
    pub fn has_density(&self) -> R::Mask {
        match self {
            BsdfModel::Ideal(k) => k.mix[0].gt(R::splat(0.0)),
            BsdfModel::Translucent(k) => k.has_density(),
            BsdfModel::Disney(k) => k.has_density(),
            BsdfModel::Interface(k) => k.has_density(),
        }
    }

    /// Returns where any lobe is a Dirac lobe.
    #[inline(always)]
    pub fn has_dirac_lobe(&self) -> R::Mask {
        let zero = R::splat(0.0);
        match self {
            BsdfModel::Ideal(k) => k.mix[1].gt(zero) | k.mix[2].gt(zero),
            BsdfModel::Translucent(_) => R::Mask::splat(false),
            BsdfModel::Disney(k) => {
                k.smooth & (k.opaque.gt(zero) | k.metallic.gt(zero))
                    | k.refractive.gt(zero) & k.smooth_glass()
            }
            BsdfModel::Interface(k) => k.facets().smooth,
        }
    }

    /// Returns where any lobe transmits light.
    #[inline(always)]
    pub fn transmits(&self) -> R::Mask {
        let zero = R::splat(0.0);
        match self {
            BsdfModel::Ideal(k) => k.mix[2].gt(zero),
            BsdfModel::Translucent(k) => k.transmits(),
            BsdfModel::Disney(k) => k.refractive.gt(zero),
            BsdfModel::Interface(k) => R::Mask::splat(matches!(k, InterfaceBsdf::Glass(_))),
        }
    }
}
