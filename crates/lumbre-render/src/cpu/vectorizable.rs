//! Decides from a run's settings alone whether it can use the vectorised integrators. The scene may
//! rule them out later.
//!
//! The planner applies this to all runs of a night: if one of them cannot be vectorised, none is,
//! so that their times can be compared.

use std::collections::BTreeMap;

use lumbre_light::transport::integrator::{IntegratorRow, Settings, bdpt, bpt, nee};
use lumbre_light::transport::sampler::{self, SamplerRow};
use lumbre_light::value::Value;

/// Integrators that have a vectorised implementation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VectorIntegrator {
    Nee,
    Bpt,
    Bdpt,
}

impl VectorIntegrator {
    /// Returns the vectorised implementation of an integrator, if there is one.
    pub fn from_row(integrator: &IntegratorRow) -> Option<VectorIntegrator> {
        let implementations = [
            (nee::ROW.name, VectorIntegrator::Nee),
            (bpt::ROW.name, VectorIntegrator::Bpt),
            (bdpt::ROW.name, VectorIntegrator::Bdpt),
        ];
        implementations
            .into_iter()
            .find_map(|(name, vectorised)| (name == integrator.name).then_some(vectorised))
    }
}

/// Returns why a run with these settings must use the scalar path in any scene, or `None` if it can
/// be vectorised. The reason completes a sentence, as "with the sampler `sobol`" does. `has_layers`
/// is whether the run has layers.
pub fn scalar_reason(
    integrator: &IntegratorRow,
    params: &BTreeMap<String, Value>,
    sampler: &SamplerRow,
    has_layers: bool,
) -> Option<String> {
    if VectorIntegrator::from_row(integrator).is_none() {
        return Some(format!("by `{}`", integrator.name));
    }
    if sampler.name != sampler::INDEPENDENT.name {
        return Some(format!("with the sampler `{}`", sampler.name));
    }
    if has_layers {
        Some("with `films`".to_owned())
    } else if Settings::new(params).all_lights {
        Some("with `lights = \"all\"`".to_owned())
    } else {
        None
    }
}
