//! Recording of single samples, event by event: rays, hits and contributions.
//!
//! Integrators and backends share three interfaces only, nearest hits, shadow rays and
//! contributions, so these are recorded: on every backend the same events in the same order. The
//! vertices of a path are where its rays end.

use glam::{DVec3, Vec3};

use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::contribution::Contribution;
use lumbre_light::transport::ray::{Hit, Ray};

/// Maximum number of events of one sample that devices record.
pub const MAX_PATH_EVENTS: usize = 256;

/// Event of a sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PathEvent {
    /// A nearest-hit query.
    Closest {
        /// Ray that was traced.
        ray: Ray,
        /// Distance up to which it was traced, in scene units; usually infinite.
        t_max: f32,
        /// Nearest hit within `t_max`, if any.
        hit: Option<Hit>,
    },
    /// An occlusion query.
    Shadow {
        /// Ray that was traced.
        ray: Ray,
        /// Distance of the light, in scene units; infinite for lights outside the scene.
        t_max: f32,
        /// Whether the ray is occluded within `t_max`.
        blocked: bool,
    },
    /// Contribution to a pixel.
    Light(Contribution),
}

impl PathEvent {
    /// Moves the event by a vector, as from the space of a compiled scene to that of its description.
    pub fn move_by(&mut self, vector: DVec3) {
        if let PathEvent::Closest { ray, .. } | PathEvent::Shadow { ray, .. } = self {
            ray.origin = (ray.origin.as_dvec3() + vector).as_vec3();
        }
    }

    /// Returns where a nearest-hit ray ended, if it hit anything.
    pub fn vertex(&self) -> Option<Vec3> {
        match self {
            PathEvent::Closest {
                ray,
                hit: Some(hit),
                ..
            } => Some(ray.origin + ray.dir * hit.t),
            _ => None,
        }
    }

    /// Formats the event as one line. `pixel` is the pixel of the sample.
    pub fn line(&self, scene: &CompiledScene, pixel: [u32; 2]) -> String {
        let point = |v: Vec3| format!("({}, {}, {})", v.x, v.y, v.z);
        match self {
            PathEvent::Closest { ray, hit: None, .. } => {
                format!(
                    "ray    {} -> {}: nothing",
                    point(ray.origin),
                    point(ray.dir)
                )
            }
            PathEvent::Closest {
                ray,
                hit: Some(hit),
                ..
            } => {
                let vertex = point(ray.origin + ray.dir * hit.t);
                format!(
                    "ray    {} -> vertex {vertex}: {}, t {}",
                    point(ray.origin),
                    scene.primitive_name(hit.primitive, hit.instance),
                    hit.t
                )
            }
            PathEvent::Shadow {
                ray,
                t_max,
                blocked,
            } => {
                let end = if t_max.is_finite() {
                    point(ray.origin + ray.dir * *t_max)
                } else {
                    "outside".to_owned()
                };
                format!(
                    "shadow {} -> {end}: {}",
                    point(ray.origin),
                    if *blocked { "blocked" } else { "free" }
                )
            }
            PathEvent::Light(c) => {
                let target = if c.pixel == pixel {
                    String::new()
                } else {
                    format!(" for pixel {},{}", c.pixel[0], c.pixel[1])
                };
                format!(
                    "light  s {} t {}: {} of {}{target}",
                    c.s,
                    c.t,
                    point(c.value),
                    point(c.unweighted)
                )
            }
        }
    }
}

/// Identifies a sample by its pixel and index.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleAt {
    /// Column and row of the pixel.
    pub pixel: [u32; 2],
    /// Index of the sample, from 0.
    pub sample: u64,
}
