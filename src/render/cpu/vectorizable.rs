//! Whether a run can use the vectorised integrators, judged from its settings alone.
//!
//! The planner applies this to all runs of a night, so that no technique gets SIMD if another
//! cannot.

use std::collections::BTreeMap;

use crate::transport::integrator::{IntegratorRow, Settings, bdpt, bpt, nee};
use crate::transport::sampler::{self, SamplerRow};
use crate::value::Value;

/// Integrators that have a vectorised implementation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum VectorIntegrator {
    Nee,
    Bpt,
    Bdpt,
}

impl VectorIntegrator {
    /// Returns the vectorised integrator for a table row, if there is one.
    pub fn from_row(integrator: &IntegratorRow) -> Option<VectorIntegrator> {
        let kinds = [
            (nee::ROW.name, VectorIntegrator::Nee),
            (bpt::ROW.name, VectorIntegrator::Bpt),
            (bdpt::ROW.name, VectorIntegrator::Bdpt),
        ];
        kinds
            .into_iter()
            .find_map(|(name, kind)| (name == integrator.name).then_some(kind))
    }
}

/// Returns why runs with these settings must use the scalar path for any scene, as words that end a
/// sentence, or `None` if they can be vectorised. `layered` is whether the run has layers.
pub fn scalar_reason(
    integrator: &IntegratorRow,
    params: &BTreeMap<String, Value>,
    sampler: &SamplerRow,
    layered: bool,
) -> Option<String> {
    if VectorIntegrator::from_row(integrator).is_none() {
        return Some(format!("by `{}`", integrator.name));
    }
    if sampler.name != sampler::INDEPENDENT.name {
        return Some(format!("with the sampler `{}`", sampler.name));
    }
    if layered {
        Some("with `films`".to_owned())
    } else if Settings::new(params).all_lights {
        Some("with `lights = \"all\"`".to_owned())
    } else {
        None
    }
}
