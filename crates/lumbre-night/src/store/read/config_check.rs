//! Compares the configuration of a run with its id, its folder and its plan. `config.json` is not in
//! the manifest of a run, since another plan may rewrite it; the id is its checksum.

use std::path::Path;

use crate::experiment::RunId;
use crate::experiment::plan::identity_check::{self, ClaimedSettings};
use crate::store::schema::StoredFile;
use crate::store::schema::plan::PlanFile;
use crate::store::schema::run::ConfigFile;

/// Checks that a configuration belongs to the run in this folder, and that everything in it that
/// decides the picture is what the id was made of.
///
/// # Errors
/// Description of the first difference.
pub(super) fn check(folder: &Path, config: &ConfigFile) -> Result<(), String> {
    let wrong = |what: &str| Err(format!("{} does not agree: {what}", ConfigFile::NAME));
    let real = std::fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
    if real
        .file_name()
        .is_none_or(|name| name != config.run.as_str())
    {
        return wrong("its run is not that of the folder");
    }
    let above = real.ancestors().skip(1);
    let plan = above
        .map(PlanFile::read)
        .find(|plan| !matches!(plan, Err(e) if e.is_missing()));
    if let (Some(of_run), Some(Ok(plan))) = (&config.plan, plan)
        && *of_run != plan.hash
    {
        return wrong("its plan is not that of the night");
    }
    if config.render.is_some() && config.settings().is_none() {
        return wrong("this version does not know a filter, layer or time axis in it");
    }
    let claimed = ClaimedSettings {
        config: config.settings().cloned(),
        seed: config.seed,
        seeds: config.seeds,
        shard_samples: config.shard_samples,
        reference: config.reference.as_deref(),
        is_cell: config.path.is_some(),
    };
    let id = RunId(config.run.clone());
    identity_check::check(&config.identity, &id, &claimed).or_else(|what| wrong(&what))
}
