//! The models of one interface: metals with a measured index, plastic, and glass, with microfacets
//! of either distribution.
//!
//! They correspond to those of Mitsuba 3 and Tungsten (`conductor`, `plastic`, `dielectric`, their
//! rough forms, and `thindielectric`), so that scenes written for those renderers look the same.
//! Metal and plastic are the same on both sides; all computations place `wo` on the upper side.

use super::facets::Facets;
use super::ggx::Ggx;
use super::lobe::{MixtureSample, TransportMode, flipped};
use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::{DisneyOutgoing, InterfaceOutgoing, Outgoing, PlasticSide};
use crate::math::Frame;
use crate::math::real::{Mask, Real, Vector};
use crate::transport::surface::ShadingParameters;

/// The BSDF of a material with one interface, scalar or vectorised.
pub(super) trait Interface<R: Real>: Copy {
    /// Whether no light is transmitted.
    const OPAQUE: bool;

    /// Builds the BSDF of materials whose textures give this base colour and microfacets.
    fn with_facets(
        class: &BsdfClass,
        m: &MaterialConstants<R::Vec3>,
        base_color: R::Vec3,
        facets: Facets<R>,
    ) -> Self;

    /// Returns everything but the microfacets as numbers.
    fn body_numbers(&self) -> Vec<R>;

    /// Builds the BSDFs of [`Interface::body_numbers`], which start with the third.
    fn load_body(class: &BsdfClass, n: &Numbers<R>, facets: Facets<R>) -> Self;

    /// Returns the microfacets.
    fn facets(&self) -> &Facets<R>;

    /// Returns the index of the lower side relative to the upper one, if `wo` was `below`; 1 if
    /// light does not enter.
    #[inline(always)]
    fn eta(&self, _below: R::Mask) -> R {
        R::splat(1.0)
    }

    /// Computes what plastic derives from one direction, for its cosine.
    #[inline(always)]
    fn side(&self, _cos: R) -> PlasticSide<R> {
        PlasticSide::none()
    }

    /// Returns the value, the density of `wi` given `wo` and, with `REVERSE`, that of `wo` given
    /// `wi`; `i` is `wi` mirrored as `wo` was.
    fn evaluate<const REVERSE: bool>(
        &self,
        out: &InterfaceOutgoing<R::Vec3>,
        wi: R::Vec3,
        i: R::Vec3,
        mode: TransportMode,
    ) -> (R::Vec3, [R; 2]);

    /// Samples a direction for `out.o`, with its reverse density if that comes for free. The mask
    /// is set where there is one.
    fn sample(
        &self,
        out: &InterfaceOutgoing<R::Vec3>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<R::Vec3>, Option<R>);

    /// Returns whether any lobe has a density.
    #[inline(always)]
    fn any_density(&self) -> R::Mask {
        !self.facets().smooth
    }

    /// Returns the index of the inside relative to the outside; 1 if light does not enter.
    #[inline(always)]
    fn index_inside(&self) -> R {
        R::splat(1.0)
    }
}

/// A model of one interface as a BSDF.
#[derive(Clone, Copy, Debug)]
pub(super) struct OneInterface<K>(K);

impl<R: Real, K: Interface<R>> LocalBsdf<R> for OneInterface<K> {
    #[inline(always)]
    fn new(class: &BsdfClass, m: &MaterialConstants<R::Vec3>, p: &ShadingParameters<R>) -> Self {
        let facets = Facets {
            distribution: class.distribution,
            alpha: Ggx::new(p.roughness, m.aspect).alpha,
            smooth: !p.roughness.ge(m.smooth_below),
        };
        OneInterface(K::with_facets(class, m, p.base_color, facets))
    }

    #[inline(always)]
    fn packed(&self) -> Packed<R> {
        let facets = self.0.facets();
        let [x, y] = facets.alpha;
        Packed {
            numbers: Numbers::of(&[&facets.alpha, &self.0.body_numbers()]),
            smooth: facets.smooth.any(),
            lobes: [false; 7],
            anisotropic: (!x.eq(y)).any(),
        }
    }

    #[inline(always)]
    fn load(class: &PackedClass, n: &Numbers<R>) -> Self {
        let facets = Facets {
            distribution: class.bsdf.distribution,
            alpha: n.pair(0),
            smooth: R::Mask::splat(class.smooth),
        };
        OneInterface(K::load_body(&class.bsdf, n, facets))
    }

    #[inline(always)]
    fn outgoing(&self, wo: R::Vec3) -> (DisneyOutgoing<R::Vec3>, InterfaceOutgoing<R::Vec3>) {
        (DisneyOutgoing::none(), outgoing(&self.0, wo))
    }

    #[inline(always)]
    fn value(&self, wo: R::Vec3, wi: R::Vec3, mode: TransportMode) -> (R::Vec3, R) {
        let (f, [pdf_w, _]) = evaluate::<R, K, false>(&self.0, &outgoing(&self.0, wo), wi, mode);
        (f, pdf_w)
    }

    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        frame: &Frame<R::Vec3>,
        out: &Outgoing<R>,
        (wi, _): (R::Vec3, R),
        mode: TransportMode,
        _: R::Mask,
    ) -> (R::Vec3, [R; 2]) {
        evaluate::<R, K, REVERSE>(&self.0, &out.interface, frame.to_local(wi), mode)
    }

    #[inline(always)]
    fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<R::Vec3>, Option<R>) {
        let out = &out.interface;
        let (some, mut s, reverse) = self.0.sample(out, u, v, mode);
        s.sample.wi = R::Vec3::select(out.below, flipped(s.sample.wi), s.sample.wi);
        (some & out.o.z().gt(R::splat(0.0)), s, reverse)
    }

    #[inline(always)]
    fn traits(&self) -> Traits<R> {
        Traits {
            has_density: self.0.any_density(),
            has_dirac_lobe: self.0.facets().smooth,
            transmits: R::Mask::splat(!K::OPAQUE),
            index_inside: self.0.index_inside(),
            front_only: K::OPAQUE,
        }
    }
}

/// Computes everything that depends on `wo` alone.
#[inline(always)]
fn outgoing<R: Real, K: Interface<R>>(interface: &K, wo: R::Vec3) -> InterfaceOutgoing<R::Vec3> {
    let zero = R::splat(0.0);
    let below = wo.z().lt(zero);
    let o = R::Vec3::select(below, flipped(wo), wo);
    let facets = interface.facets();
    InterfaceOutgoing {
        o,
        below,
        eta: interface.eta(below),
        masking: if (!facets.smooth).any() {
            facets.masking_over_cos(o)
        } else {
            zero
        },
        plastic: interface.side(o.z()),
    }
}

/// Returns the density of `wi` given `wo`, without Dirac lobes.
#[inline(always)]
pub(super) fn pdf_w<R: Real, K: Interface<R>>(interface: &K, wo: R::Vec3, wi: R::Vec3) -> R {
    let out = outgoing(interface, wo);
    evaluate::<R, K, false>(interface, &out, wi, TransportMode::Radiance).1[0]
}

/// Returns [`Interface::evaluate`] for `wi` in the local frame.
#[inline(always)]
fn evaluate<R: Real, K: Interface<R>, const REVERSE: bool>(
    interface: &K,
    out: &InterfaceOutgoing<R::Vec3>,
    wi: R::Vec3,
    mode: TransportMode,
) -> (R::Vec3, [R; 2]) {
    let i = R::Vec3::select(out.below, flipped(wi), wi);
    interface.evaluate::<REVERSE>(out, wi, i, mode)
}
