//! Which runs can have many paths shaded at once, as far as that is known before their scene is: the planner asks it of all
//! runs of a night, so that none has lanes where another cannot.

use std::collections::BTreeMap;

use crate::transport::integrator::{IntegratorRow, Settings, bdpt, bpt, nee};
use crate::transport::sampler::{self, SamplerRow};
use crate::value::Value;

/// The integrators whose paths can go together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Nee,
    Bpt,
    Bdpt,
}

impl Kind {
    /// Which of them this is.
    pub fn of(integrator: &IntegratorRow) -> Option<Kind> {
        let kinds = [(nee::ROW.name, Kind::Nee), (bpt::ROW.name, Kind::Bpt), (bdpt::ROW.name, Kind::Bdpt)];
        kinds.into_iter().find_map(|(name, kind)| (name == integrator.name).then_some(kind))
    }
}

/// Why the paths of such a run go one by one, whatever its scene, in words that end a sentence; `None` where they need not.
pub fn alone(
    integrator: &IntegratorRow,
    params: &BTreeMap<String, Value>,
    sampler: &SamplerRow,
    layered: bool,
) -> Option<String> {
    if Kind::of(integrator).is_none() {
        return Some(format!("by `{}`", integrator.name));
    }
    if sampler.name != sampler::INDEPENDENT.name {
        return Some(format!("with the sampler `{}`", sampler.name));
    }
    match () {
        () if layered => Some("with `films`".to_owned()),
        () if Settings::new(params).all_lights => Some("with `lights = \"all\"`".to_owned()),
        () => None,
    }
}
