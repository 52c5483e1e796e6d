//! Decides from a run's settings alone whether it can be rendered with vectors. Every technique that
//! follows paths from the camera can; bidirectional path tracing cannot with some settings, and the
//! scene may rule it out later.
//!
//! The planner applies this to all runs of a night, and warns if they differ.

use std::collections::BTreeMap;

use lumbre_light::transport::integrator::camera_path::CameraPaths;
use lumbre_light::transport::integrator::{
    CameraPathsVisitor, IntegratorRow, Settings, bdpt, visit_camera_paths,
};
use lumbre_light::transport::sampler::{self, SamplerRow};
use lumbre_light::value::Value;

/// Finds out whether an integrator follows paths from the camera.
struct Exists;

impl CameraPathsVisitor for Exists {
    type Output = ();

    fn visit<T: CameraPaths>(self) {}
}

/// Returns why a run with these settings must follow one path after the other in any scene, or
/// `None` if it can be vectorised. The reason completes a sentence, as "with the sampler `sobol`"
/// does. `has_layers` is whether the run has layers.
pub fn scalar_reason(
    integrator: &IntegratorRow,
    params: &BTreeMap<String, Value>,
    sampler: &SamplerRow,
    has_layers: bool,
) -> Option<String> {
    if visit_camera_paths(integrator, Exists).is_some() {
        return None;
    }
    if integrator.name != bdpt::ROW.name {
        return Some(format!("by `{}`", integrator.name));
    }
    if sampler.name != sampler::INDEPENDENT.name {
        return Some(format!(
            "by `{}` with the sampler `{}`",
            integrator.name, sampler.name
        ));
    }
    if has_layers {
        Some(format!("by `{}` with `films`", integrator.name))
    } else if Settings::new(params).all_lights {
        Some(format!("by `{}` with `lights = \"all\"`", integrator.name))
    } else {
        None
    }
}
