//! What one sample does, step by step: its rays, what they met, and the light that it brought.
//!
//! Integrators and backends agree on three seams only, nearest hits, shadow rays and contributions, so these are what is
//! recorded: on every backend the same steps in the same order, and the vertices of paths are where rays end.

use glam::Vec3;

use crate::transport::contribution::Contribution;
use crate::transport::ray::{Hit, Ray};

/// The most steps of one sample that devices record.
pub const MOST_STEPS: usize = 256;

/// One step of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Step {
    /// A ray, and the nearest that it met within `t_max`.
    Closest {
        /// The ray.
        ray: Ray,
        /// How far it was followed, in scene units; infinite as a rule.
        t_max: f32,
        /// What it met.
        hit: Option<Hit>,
    },
    /// A ray that was to meet nothing within `t_max`.
    Shadow {
        /// The ray.
        ray: Ray,
        /// Where the light is, in scene units; infinite for light from outside.
        t_max: f32,
        /// Whether something lies between.
        blocked: bool,
    },
    /// Light for a pixel.
    Light(Contribution),
}

impl Step {
    /// Where a ray that met something ended.
    pub fn vertex(&self) -> Option<Vec3> {
        match self {
            Step::Closest { ray, hit: Some(hit), .. } => Some(ray.origin + ray.dir * hit.t),
            _ => None,
        }
    }
}

/// A sample: its pixel and its number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleAt {
    /// Column and row.
    pub pixel: [u32; 2],
    /// Index of the sample, from 0.
    pub sample: u64,
}
