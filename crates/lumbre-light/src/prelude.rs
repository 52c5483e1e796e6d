//! Items that a technique of another crate usually imports: `use lumbre_light::prelude::*`.

pub use glam::Vec3;

pub use crate::math::real::{Double, Mask, Real, Vector};
pub use crate::math::simd::Lanes;
pub use crate::transport::arrival::{Arrival, HitState};
pub use crate::transport::bsdf::{Bsdf, BsdfSample, Outgoing, TransportMode};
pub use crate::transport::contribution::Contribution;
pub use crate::transport::integrator::camera_path::{
    self, CameraPaths, Path, PathLight, PathSink, ShadowRay, edge_counts, unoccluded,
};
pub use crate::transport::integrator::{Context, IntegratorRow};
pub use crate::transport::light::DirectSample;
pub use crate::transport::path_time::OpticalLength;
pub use crate::transport::ray::Ray;
pub use crate::transport::sampler::Sampler;
pub use crate::transport::surface::Surface;
pub use crate::value::schema::{Field, Table, Ty};
