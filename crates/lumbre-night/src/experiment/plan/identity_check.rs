//! Compares the settings with which a run would be rendered again with the identity of the run, so
//! that a picture is never judged by settings that it was not rendered with.

use std::collections::BTreeMap;

use super::{RunId, identity};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::sampler;
use lumbre_light::value::Value;
use lumbre_render::Settings;
use lumbre_render::settings::LIBRARY;

/// Settings that a stored configuration claims for a run.
#[derive(Debug, Default)]
pub struct ClaimedSettings<'a> {
    /// Settings of the renderer; `None` for references that are image files.
    pub config: Option<Settings>,
    /// Seed, if it is a cell.
    pub seed: Option<u64>,
    /// Seeds of the halves, if it is a rendered reference.
    pub seeds: Option<[u64; 2]>,
    /// Samples per pixel of a shard, if it is rendered in shards.
    pub shard_samples: Option<u64>,
    /// Id of the reference that it is measured against.
    pub reference: Option<&'a str>,
    /// Whether it is a cell, whose time is measured.
    pub is_cell: bool,
}

/// Checks that an identity has this id, and that the settings are those of the identity. The hash of
/// the scene is compared where the scene is loaded. Revisions of techniques and the content of their
/// libraries are not compared: a run of an earlier revision may be rendered again. Nor are the
/// settings of techniques that this program does not know, since it cannot render them.
///
/// # Errors
/// Description of the first difference.
pub fn check(identity: &Value, id: &RunId, claimed: &ClaimedSettings) -> Result<(), String> {
    if identity::run_id(identity) != *id {
        return Err("its identity does not have the id of the run".to_owned());
    }
    let (Some(config), Some(fields)) = (&claimed.config, identity.as_map()) else {
        return Ok(());
    };
    if integrator(&config.integrator).is_none() {
        return Ok(());
    }
    if sampler(&config.sampler).is_none() {
        return Err(format!("this version has no sampler `{}`", config.sampler));
    }
    let mut expected = identity::picture(config, &[0; 32]);
    if let Some(seed) = claimed.seed {
        expected.insert(identity::SEED.to_owned(), identity::seed_value(seed));
    }
    if let Some(seeds) = claimed.seeds {
        expected = identity::stem(expected, seeds, claimed.shard_samples);
    }
    expected.insert(
        "reference".to_owned(),
        claimed.reference.map_or(Value::Nil, Value::from),
    );
    let keys = fields.keys().chain(expected.keys());
    for key in keys.filter(|key| is_setting(key, claimed.is_cell)) {
        let [wanted, found] = [fields, &expected].map(|map| map.get(key).unwrap_or(&Value::Nil));
        let is_auto = key == "backend" && wanted.as_str() == Some("auto");
        if !is_auto && without_versions(wanted) != without_versions(found) {
            return Err(format!(
                "{key} is {found}, but the run's id was made with {wanted}"
            ));
        }
    }
    Ok(())
}

/// Whether a field of an identity is compared. The others are the scene's hash, rules and
/// measurements, which decide no pixel of a given number of samples, versions of what rendered the
/// run, and the hierarchy of references, whose times are not compared.
fn is_setting(key: &str, is_cell: bool) -> bool {
    let other = [
        "format", "scene", "stop", "measure", "peer", "shaders", "delays",
    ];
    !other.contains(&key) && (is_cell || key != "accel")
}

/// Returns a value without the revision, and the hash of a library, that it may have.
fn without_versions(value: &Value) -> Value {
    match value {
        Value::Map(map) => {
            let is_version = |key: &str| key == "revision" || key == LIBRARY;
            let fields = map.iter().filter(|(key, _)| !is_version(key));
            let fields = fields.map(|(key, value)| (key.clone(), value.clone()));
            Value::Map(fields.collect::<BTreeMap<String, Value>>())
        }
        other => other.clone(),
    }
}
