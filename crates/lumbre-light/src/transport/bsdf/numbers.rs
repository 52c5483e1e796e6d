//! BSDFs as numbers, from which vectors build them.

use super::material::BsdfClass;
use crate::math::real::{Real, Vector};

/// Count of the numbers of a packed BSDF.
pub(super) const NUMBERS: usize = 24;

/// Numbers of a packed BSDF, of one material or in lanes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbers<R>(pub [R; NUMBERS]);

/// A BSDF in the form that vectors load, and what is the same for all that may share lanes with it:
/// see [`PackedClass`].
pub(super) struct Packed<R> {
    /// The BSDF itself.
    pub numbers: Numbers<R>,
    /// Whether the microfacets are Dirac lobes.
    pub smooth: bool,
    /// Presence of the lobes.
    pub lobes: [bool; 7],
    /// Whether the microfacets are anisotropic.
    pub anisotropic: bool,
}

impl<R: Real> Numbers<R> {
    /// Returns the numbers of the groups one after another, followed by zeros.
    #[inline(always)]
    pub fn of(groups: &[&[R]]) -> Numbers<R> {
        let mut numbers = [R::splat(0.0); NUMBERS];
        for (to, from) in numbers.iter_mut().zip(groups.iter().copied().flatten()) {
            *to = *from;
        }
        Numbers(numbers)
    }

    /// Returns the components of a vector.
    #[inline(always)]
    pub fn of_vector(v: R::Vec3) -> [R; 3] {
        [v.x(), v.y(), v.z()]
    }

    /// Returns the number at an index.
    #[inline(always)]
    pub fn get(&self, at: usize) -> R {
        self.0[at]
    }

    /// Returns two numbers from an index on.
    #[inline(always)]
    pub fn pair(&self, at: usize) -> [R; 2] {
        [self.0[at], self.0[at + 1]]
    }

    /// Returns numbers from an index on.
    #[inline(always)]
    pub fn array<const COUNT: usize>(&self, at: usize) -> [R; COUNT] {
        std::array::from_fn(|i| self.0[at + i])
    }

    /// Returns the vector that starts at an index.
    #[inline(always)]
    pub fn vector(&self, at: usize) -> R::Vec3 {
        R::Vec3::new(self.0[at], self.0[at + 1], self.0[at + 2])
    }
}

/// Traits of a material. Materials that are equal in them share lanes; materials that differ in
/// lobes alone may, but those lanes take branches of their own.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PackedClass {
    /// Traits that all lanes must share.
    pub bsdf: BsdfClass,
    /// Whether base colour, roughness, metallic or opacity vary over surfaces: by textures or by
    /// vertex colours.
    pub varies: bool,
    /// Whether any lobe has a density; `true` if that depends on parameters that vary.
    pub has_density: bool,
    /// Whether the microfacets are Dirac lobes; `false` if parameters vary.
    pub(super) smooth: bool,
    /// Presence of the opaque, metallic, refractive, clearcoat, subsurface and sheen lobes, and
    /// whether the refractive one is a Dirac lobe; all `false` if parameters vary.
    pub(super) lobes: [bool; 7],
}
