//! Everything that the models of interfaces derive from the direction to the previous vertex alone.

use glam::Vec3;

use crate::math::real::{Real, Vector};

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

/// Quantities of plastic that depend on one direction alone.
#[derive(Clone, Copy, Debug)]
pub struct PlasticSide<R = f32> {
    /// Reflectance of the smooth surface.
    pub(super) reflectance: R,
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
            surface: zero,
        }
    }
}
