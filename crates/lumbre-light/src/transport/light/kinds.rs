//! Dispatch over the kinds of lights, generated from their table.

use glam::Vec3;

use super::source::{EmittingLanes, LightFacts, LightSource, PowerContext};
use super::table::{Place, SourceKind, lights};
use super::{LightId, SelectedLights};
use crate::math::real::{Mask, Vector};
use crate::math::simd::Lanes;
use crate::scene::{CompiledScene, compile};
use crate::transport::vertex::least_extent;

/// Declares the functions that ask for properties of a kind.
macro_rules! facts {
    ($($(#[$doc:meta])* $Kind:ident $(($index:ty))? in $list:ident: $Source:ty, $place:ident;)+) => {
        impl LightId {
            /// Returns the properties of the light; `None` if the scene lacks it.
            pub(super) fn facts(
                self,
                scene: &CompiledScene,
                context: &PowerContext,
            ) -> Option<LightFacts> {
                let (kind, own) = self.parts();
                let mut facts = match kind {
                    $(SourceKind::$Kind => {
                        let light: &$Source = scene.$list.as_slice().get(own as usize)?;
                        light.facts(scene, context)
                    })+
                };
                let [.., extent, number] = &mut facts.rows[1].0;
                *extent = extent.max(least_extent(scene));
                *number = kind.number();
                Some(facts)
            }
        }

        impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
            /// Returns the lanes whose lights have such points.
            #[inline(always)]
            pub(super) fn are_at(&self, fits: impl Fn(Place) -> bool) -> R::Mask {
                let mut lanes = R::Mask::splat(false);
                $(if fits(Place::$place) {
                    lanes = lanes | self.are(SourceKind::$Kind);
                })+
                lanes
            }
        }
    };
}

/// Declares the functions of [`EmittingLanes`] for all kinds without a surface. Each kind is
/// evaluated if any lane of `wanted` has one. Results are zero in lanes without such a light.
macro_rules! emitting_lanes {
    (
        $(#[$surface_doc:meta])* Emitter $index_type:tt in $surfaces:ident: $Surface:ty, Surface;
        $($(#[$doc:meta])* $Kind:ident $(($index:ty))? in $list:ident: $Source:ty, $place:ident;)+
    ) => {
        impl<R: Lanes<N>, const N: usize> SelectedLights<'_, R, N> {
            /// Samples directions of emission: see [`EmittingLanes::sample`].
            #[inline(always)]
            pub(super) fn sample_dirs(&self, v: [R; 2], wanted: R::Mask) -> ([R::Vec3; 2], R) {
                let mut sample = ([R::Vec3::broadcast(Vec3::ZERO); 2], R::splat(0.0));
                $(let lanes = wanted & self.are(SourceKind::$Kind);
                if lanes.any() {
                    let ([dir, emitted], pdf_w) = <$Source>::sample(self, v, lanes);
                    let dir = R::Vec3::select(lanes, dir, sample.0[0]);
                    let emitted = R::Vec3::select(lanes, emitted, sample.0[1]);
                    sample = ([dir, emitted], R::select(lanes, pdf_w, sample.1));
                })+
                sample
            }

            /// Returns the densities of directions of emission: see [`EmittingLanes::pdf_w`].
            #[inline(always)]
            pub(super) fn pdf_dirs(&self, dir: R::Vec3, wanted: R::Mask) -> R {
                let mut pdf_w = R::splat(0.0);
                $(let lanes = wanted & self.are(SourceKind::$Kind);
                if lanes.any() {
                    pdf_w = R::select(lanes, <$Source>::pdf_w(self, dir, lanes), pdf_w);
                })+
                pdf_w
            }

            /// Returns the emission in the unit directions `dir`: see [`EmittingLanes::emitted`].
            #[inline(always)]
            pub(super) fn emitted_into(&self, dir: R::Vec3, wanted: R::Mask) -> R::Vec3 {
                let mut emitted = R::Vec3::broadcast(Vec3::ZERO);
                $(let lanes = wanted & self.are(SourceKind::$Kind);
                if lanes.any() {
                    emitted = R::Vec3::select(lanes, <$Source>::emitted(self, dir, lanes), emitted);
                })+
                emitted
            }
        }
    };
}

lights!(facts);
lights!(emitting_lanes);
