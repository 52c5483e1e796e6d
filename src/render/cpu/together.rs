//! Which runs can have many paths shaded at once, as far as that is known before their scene is: the planner asks it of all
//! runs of a night, so that none has lanes where another cannot.

use std::collections::BTreeMap;

use crate::transport::integrator::{IntegratorRow, Settings, bdpt, bpt, nee};
use crate::transport::sampler::{self, SamplerRow};
use crate::value::Value;

/// The integrators whose paths can go together.
pub(super) const INTEGRATORS: [&str; 3] = [nee::ROW.name, bpt::ROW.name, bdpt::ROW.name];

/// Why the paths of such a run go one by one, whatever its scene, in words that end a sentence; `None` where they need not.
pub fn alone(
    integrator: &IntegratorRow,
    params: &BTreeMap<String, Value>,
    sampler: &SamplerRow,
    layered: bool,
    timed: bool,
) -> Option<String> {
    if !INTEGRATORS.contains(&integrator.name) {
        return Some(format!("by `{}`", integrator.name));
    }
    if sampler.name != sampler::INDEPENDENT.name {
        return Some(format!("with the sampler `{}`", sampler.name));
    }
    match () {
        () if layered => Some("with `films`".to_owned()),
        () if timed => Some("with a time axis".to_owned()),
        () if Settings::new(params).all_lights => Some("with `lights = \"all\"`".to_owned()),
        () => None,
    }
}
