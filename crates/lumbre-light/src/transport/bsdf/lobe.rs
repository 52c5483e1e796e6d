//! Types that all lobes share: the transported quantity, and sampled directions.

use glam::Vec3;

use crate::math::real::{Mask, Real, Vector};

/// The transported quantity, which decides the scaling by refraction [Veach 1997, 5.2] and the
/// correction of shading normals [5.3].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransportMode {
    /// Radiance, along camera paths.
    Radiance,
    /// Importance, along light paths.
    Importance,
}

/// A sampled direction of one lobe, in the local frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LobeSample<V: Vector = Vec3> {
    /// The sampled unit direction.
    pub wi: V,
    /// `f |cos| / pdf_w` of this lobe alone.
    pub weight: V,
    /// Index ratio crossed: inside over outside when entering, its inverse when leaving, 1 if
    /// reflected.
    pub eta: V::Scalar,
}

/// A sampled direction of a mixture of lobes, in the local frame; the weight is that of the
/// mixture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MixtureSample<V: Vector = Vec3> {
    /// Direction, weight and index ratio.
    pub sample: LobeSample<V>,
    /// Density of the mixture, or the probability of the choice if `delta`.
    pub pdf_w: V::Scalar,
    /// Whether the lobe is a Dirac lobe.
    pub delta: <V::Scalar as Real>::Mask,
}

impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> MixtureSample<V> {
    /// Combines the fields of a sample.
    #[inline(always)]
    pub(super) fn new(sample: LobeSample<V>, pdf_w: R, delta: R::Mask) -> MixtureSample<V> {
        MixtureSample {
            sample,
            pdf_w,
            delta,
        }
    }

    /// Returns a black sample.
    #[inline(always)]
    pub(super) fn black() -> MixtureSample<V> {
        let zero = R::splat(0.0);
        let (wi, weight) = (V::splat(zero), V::splat(zero));
        MixtureSample::new(
            LobeSample {
                wi,
                weight,
                eta: R::splat(1.0),
            },
            zero,
            R::Mask::splat(true),
        )
    }

    /// Returns `yes` where the mask is set, else `no`.
    #[inline(always)]
    pub(super) fn select(
        mask: R::Mask,
        yes: MixtureSample<V>,
        no: MixtureSample<V>,
    ) -> MixtureSample<V> {
        MixtureSample {
            sample: LobeSample {
                wi: V::select(mask, yes.sample.wi, no.sample.wi),
                weight: V::select(mask, yes.sample.weight, no.sample.weight),
                eta: R::select(mask, yes.sample.eta, no.sample.eta),
            },
            pdf_w: R::select(mask, yes.pdf_w, no.pdf_w),
            delta: mask & yes.delta | !mask & no.delta,
        }
    }
}

/// Mirrors a local direction to the other side of the surface.
#[inline(always)]
pub(super) fn flipped<V: Vector>(w: V) -> V {
    V::new(w.x(), w.y(), -w.z())
}
