//! The BSDFs, a row each.

use super::conductor::Conductor;
use super::disney::Disney;
use super::glass::Glass;
use super::ideal::Ideal;
use super::interface::OneInterface;
use super::lobe::{MixtureSample, TransportMode};
use super::local::{LocalBsdf, Traits};
use super::material::{BsdfClass, MaterialConstants};
use super::numbers::{Numbers, Packed, PackedClass};
use super::oren_nayar::OrenNayar;
use super::outgoing::{DisneyOutgoing, InterfaceOutgoing, Outgoing};
use super::plastic::Plastic;
use super::translucent::Translucent;
use crate::math::Frame;
use crate::math::real::{Real, Vector};
use crate::scene::compile::Model;
use crate::transport::surface::ShadingParameters;

/// Declares [`BsdfModel`] from a row for each model: its name, and the type of its BSDF.
macro_rules! bsdfs {
    ($($Model:ident => $Bsdf:ty,)+) => {
        /// The BSDF of one of the models; all lanes have the same.
        #[derive(Clone, Copy, Debug)]
        pub(super) enum BsdfModel<V: Vector> {
            $($Model($Bsdf),)+
        }

        impl<R: Real<Vec3 = V>, V: Vector<Scalar = R>> LocalBsdf<R> for BsdfModel<V> {
            #[inline(always)]
            fn new(class: &BsdfClass, m: &MaterialConstants<V>, p: &ShadingParameters<R>) -> Self {
                match class.model {
                    $(Model::$Model => BsdfModel::$Model(LocalBsdf::new(class, m, p)),)+
                }
            }

            fn packed(&self) -> Packed<R> {
                match self {
                    $(BsdfModel::$Model(k) => k.packed(),)+
                }
            }

            #[inline(always)]
            fn load(class: &PackedClass, n: &Numbers<R>) -> Self {
                match class.bsdf.model {
                    $(Model::$Model => BsdfModel::$Model(LocalBsdf::load(class, n)),)+
                }
            }

            #[inline(always)]
            fn outgoing(&self, local: V) -> (DisneyOutgoing<V>, InterfaceOutgoing<V>) {
                match self {
                    $(BsdfModel::$Model(k) => LocalBsdf::outgoing(k, local),)+
                }
            }

            #[inline(always)]
            fn value(&self, wo: V, wi: V, mode: TransportMode) -> (V, R) {
                match self {
                    $(BsdfModel::$Model(k) => LocalBsdf::value(k, wo, wi, mode),)+
                }
            }

            #[inline(always)]
            fn evaluate<const REVERSE: bool>(
                &self,
                frame: &Frame<V>,
                out: &Outgoing<R>,
                incident: (V, R),
                mode: TransportMode,
                wanted: R::Mask,
            ) -> (V, [R; 2]) {
                match self {
                    $(BsdfModel::$Model(k) => {
                        LocalBsdf::evaluate::<REVERSE>(k, frame, out, incident, mode, wanted)
                    })+
                }
            }

            #[inline(always)]
            fn sample<const REVERSE: bool>(
                &self,
                out: &Outgoing<R>,
                u: R,
                v: [R; 2],
                mode: TransportMode,
            ) -> (R::Mask, MixtureSample<V>, Option<R>) {
                match self {
                    $(BsdfModel::$Model(k) => LocalBsdf::sample::<REVERSE>(k, out, u, v, mode),)+
                }
            }

            #[inline(always)]
            fn traits(&self) -> Traits<R> {
                match self {
                    $(BsdfModel::$Model(k) => k.traits(),)+
                }
            }
        }
    };
}

bsdfs! {
    Disney => Disney<V>,
    Lambert => Ideal<V>,
    Conductor => OneInterface<Conductor<V>>,
    Plastic => OneInterface<Plastic<V>>,
    Dielectric => OneInterface<Glass<V>>,
    Translucent => Translucent<V>,
    OrenNayar => OrenNayar<V>,
}
