//! The BSDF of a surface in its local frame, which the file of each model implements.

use super::lobe::{MixtureSample, TransportMode};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::outgoing::{DisneyOutgoing, InterfaceOutgoing, Outgoing};
use crate::math::Frame;
use crate::math::real::Real;
use crate::transport::surface::ShadingParameters;

/// A BSDF in the local frame, whose z axis is the shading normal; scalar or vectorised. Values are
/// without the cosine, densities per solid angle.
pub(super) trait LocalBsdf<R: Real>: Copy {
    /// Builds the BSDF of materials of one class at points with these parameters.
    fn new(class: &BsdfClass, m: &MaterialConstants<R::Vec3>, p: &ShadingParameters<R>) -> Self;

    /// Returns the BSDF in the form from which [`LocalBsdf::load`] builds it.
    fn packed(&self) -> Packed<R>;

    /// Builds the BSDFs of [`LocalBsdf::packed`], of materials of one class.
    fn load(class: &PackedClass, n: &Numbers<R>) -> Self;

    /// Computes what depends on `wo` alone.
    #[inline(always)]
    fn outgoing(&self, _: R::Vec3) -> (DisneyOutgoing<R::Vec3>, InterfaceOutgoing<R::Vec3>) {
        (DisneyOutgoing::none(), InterfaceOutgoing::none())
    }

    /// Returns the value and the density of `wi` given `wo`, both without Dirac lobes.
    fn value(&self, wo: R::Vec3, wi: R::Vec3, mode: TransportMode) -> (R::Vec3, R);

    /// Returns the value, the density of `wi` and, with `REVERSE`, the density of `out.wo` given
    /// `wi`, in the lanes of `wanted`. `wi` is in world space and has the cosine `cos_i` with the
    /// normal of `frame`.
    #[inline(always)]
    fn evaluate<const REVERSE: bool>(
        &self,
        frame: &Frame<R::Vec3>,
        out: &Outgoing<R>,
        (wi, _cos_i): (R::Vec3, R),
        mode: TransportMode,
        _wanted: R::Mask,
    ) -> (R::Vec3, [R; 2]) {
        let (o, i) = (out.local, frame.to_local(wi));
        let (f, pdf_w) = self.value(o, i, mode);
        let reverse = if REVERSE {
            self.value(i, o, mode).1
        } else {
            R::splat(0.0)
        };
        (f, [pdf_w, reverse])
    }

    /// Samples a direction in the local frame: `u` selects the lobe, `v` the direction within it.
    /// The mask is set where there is one. With `REVERSE`, also returns the density of `out.wo`
    /// given the direction, zero for Dirac lobes, if that comes for free.
    fn sample<const REVERSE: bool>(
        &self,
        out: &Outgoing<R>,
        u: R,
        v: [R; 2],
        mode: TransportMode,
    ) -> (R::Mask, MixtureSample<R::Vec3>, Option<R>);

    /// Returns what is true of its lobes.
    fn traits(&self) -> Traits<R>;
}

/// Traits of the lobes of a BSDF, scalar or vectorised.
#[derive(Clone, Copy, Debug)]
pub(super) struct Traits<R: Real> {
    /// Lanes in which any lobe has a density.
    pub has_density: R::Mask,
    /// Lanes in which any lobe is a Dirac lobe.
    pub has_dirac_lobe: R::Mask,
    /// Lanes in which any lobe transmits light.
    pub transmits: R::Mask,
    /// Index of the inside relative to the outside; 1 if light does not enter.
    pub index_inside: R,
    /// Whether all lobes of a one-sided material are missing at its back.
    pub front_only: bool,
}
