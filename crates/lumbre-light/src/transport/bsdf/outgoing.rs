//! The direction to the previous vertex, with everything that BSDFs derive from it alone.

use glam::Vec3;

use super::lobe::{MixtureSample, flipped};
use crate::math::real::{Mask, Real, Vector};

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

/// Quantities of the BSDF that depend on `wo` alone, computed once for all directions that are
/// combined with it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DisneyOutgoing<V: Vector = Vec3> {
    /// The direction `wo` in the local frame, mirrored to the upper side.
    pub(super) o: V,
    /// Whether `wo` was mirrored.
    pub(super) below: <V::Scalar as Real>::Mask,
    /// Index of the lower side relative to the upper one, as seen from `o`.
    pub(super) eta: V::Scalar,
    pub(super) choice: LobeProbabilities<V::Scalar>,
    /// Masking of `o` over its cosine.
    pub(super) masking: V::Scalar,
}

/// Sampling probabilities of the lobes; all zero if nothing is reflected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct LobeProbabilities<R = f32> {
    pub(super) diffuse: R,
    pub(super) reflection: R,
    pub(super) glass: R,
    pub(super) coat: R,
}

impl<R: Real> LobeProbabilities<R> {
    /// Returns probabilities of zero: nothing is reflected.
    #[inline(always)]
    pub fn none() -> LobeProbabilities<R> {
        let zero = R::splat(0.0);
        LobeProbabilities {
            diffuse: zero,
            reflection: zero,
            glass: zero,
            coat: zero,
        }
    }
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> DisneyOutgoing<V> {
    /// Returns a placeholder for surfaces of another model.
    #[inline(always)]
    pub fn none() -> DisneyOutgoing<V> {
        let zero = R::splat(0.0);
        DisneyOutgoing {
            o: V::splat(zero),
            below: R::Mask::splat(false),
            eta: zero,
            choice: LobeProbabilities::none(),
            masking: zero,
        }
    }

    /// Returns `wo` in the local frame.
    #[inline(always)]
    pub fn wo(&self) -> V {
        V::select(self.below, flipped(self.o), self.o)
    }

    /// Mirrors a direction sampled for `o` back to the side of `wo`.
    #[inline(always)]
    pub fn onto_side_of_wo(&self, mut s: MixtureSample<V>) -> MixtureSample<V> {
        s.sample.wi = V::select(self.below, flipped(s.sample.wi), s.sample.wi);
        s
    }
}

/// Quantities of the BSDF that depend on `wo` alone, computed once for all directions that are
/// combined with it.
#[derive(Clone, Copy, Debug)]
pub struct InterfaceOutgoing<V: Vector = Vec3> {
    /// The direction `wo` in the local frame, mirrored to the upper side.
    pub(super) o: V,
    /// Whether `wo` was mirrored.
    pub(super) below: <V::Scalar as Real>::Mask,
    /// Index of the lower side relative to the upper one, as seen from `o`; 1 if light does not
    /// enter.
    pub(super) eta: V::Scalar,
    /// Masking of `o` by the microfacets over its cosine.
    pub(super) masking: V::Scalar,
    /// Quantities of plastic.
    pub(super) plastic: PlasticSide<V::Scalar>,
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
    pub fn wo(&self) -> V {
        V::select(self.below, flipped(self.o), self.o)
    }
}

/// Quantities of plastic that depend on one direction alone.
#[derive(Clone, Copy, Debug)]
pub struct PlasticSide<R = f32> {
    /// Reflectance of the smooth surface.
    pub(super) reflectance: R,
    /// Transmittance of the surface on the way to the body or back.
    pub(super) through: R,
    /// Probability of sampling the surface reflection.
    pub(super) surface: R,
}

impl<R: Real> PlasticSide<R> {
    /// Returns a placeholder for surfaces of another model.
    #[inline(always)]
    pub fn none() -> PlasticSide<R> {
        let zero = R::splat(0.0);
        PlasticSide {
            reflectance: zero,
            through: zero,
            surface: zero,
        }
    }
}
