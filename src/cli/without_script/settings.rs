//! The settings of `lumbre render`: a render table as in scripts, planned as an experiment of one
//! cell, so that names, ranges and defaults are those of scripts.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cli::args::{Global, PictureArgs, RenderArgs};
use crate::cli::exit::Failure;
use lumbre_light::value::Value;
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::outcome::WaveRow;
use lumbre_night::experiment::plan::expand;
use lumbre_night::experiment::spec::{MeasureSpec, ReferenceRequest};
use lumbre_night::experiment::{ExperimentSpec, Overrides, Plan, Point, ScriptHooks, StopRule};
use lumbre_render::Settings;
use lumbre_render::settings::ENVIRONMENT_MAP;
use lumbre_render::settings::named;

/// Key of the technique in render tables.
const INTEGRATOR: &str = "integrator";

/// Technique of a picture, unless another one is given.
const DEFAULT_INTEGRATOR: &str = "nee";

/// Plans the picture.
///
/// # Errors
/// Returns an error if a setting is unknown or out of range, or the scene cannot be read.
pub fn plan(args: &RenderArgs, global: &Global) -> Result<Plan, Failure> {
    let mut table = picture_table(&args.picture)?;
    if let Some(denoise) = &args.denoise {
        insert(&mut table, "denoise", denoise.as_str().into())?;
    }
    let technique = match (&args.integrator, table.remove(INTEGRATOR)) {
        (Some(_), Some(_)) => return Err(twice(INTEGRATOR)),
        (Some(name), None) => name.clone(),
        (None, Some(given)) => given.to_string(),
        (None, None) => DEFAULT_INTEGRATOR.to_owned(),
    };
    let config = checked_settings(table, &technique)?;
    let overrides = Overrides {
        backend: global.backend.clone(),
        ..Overrides::default()
    };
    let mut load = |path: &Path, options: &BTreeMap<String, Value>| {
        lumbre_lua::scene::read(path, options, global.missing())
    };
    expand(&experiment(), &OneCell { config }, &overrides, &mut load).map_err(Failure::usage)
}

/// Converts a render table with a technique.
///
/// # Errors
/// Returns an error for a setting that is unknown or out of range, or names a missing file.
pub fn checked_settings(
    mut table: BTreeMap<String, Value>,
    technique: &str,
) -> Result<Settings, Failure> {
    table.insert(INTEGRATOR.to_owned(), technique.into());
    lumbre_lua::render_settings(&table, Path::new(".")).map_err(|mut error| {
        // The command line has no table `render`.
        if let Some(path) = error.path.strip_prefix("render.") {
            error.path = path.to_owned();
        }
        Failure::usage(error)
    })
}

/// Returns the render table of a picture: options with a flag of their own, then `KEY=VALUE`.
///
/// # Errors
/// Returns an error if a setting is given twice.
pub fn picture_table(args: &PictureArgs) -> Result<BTreeMap<String, Value>, Failure> {
    let mut table = BTreeMap::new();
    let scene = args.scene.file.to_string_lossy().into_owned();
    insert(&mut table, "scene", Value::Str(scene))?;
    if let Some(depth) = args.depth {
        insert(&mut table, "max_depth", Value::Int(i64::from(depth)))?;
    }
    if let Some(size) = args.size {
        let sides = size.map(|side| Value::Int(i64::from(side)));
        insert(&mut table, "resolution", Value::List(sides.into()))?;
    }
    if let Some(view) = &args.view {
        insert(&mut table, "view", view.as_str().into())?;
    }
    let options: BTreeMap<String, Value> = args.scene.settings.iter().cloned().collect();
    if let Some(map) = &args.environment {
        let map = map.to_string_lossy().into_owned();
        named::set(&mut table, ENVIRONMENT_MAP, Value::Str(map));
    }
    if !options.is_empty() {
        insert(&mut table, "scene_options", Value::Map(options))?;
    }
    for (index, (key, value)) in args.settings.iter().enumerate() {
        let is_twice = args.settings[..index].iter().any(|(other, _)| other == key);
        if is_twice || table.contains_key(key) {
            return Err(twice(key));
        }
        named::set(&mut table, key, value.clone());
    }
    Ok(table)
}

/// Adds a setting to a table.
///
/// # Errors
/// Returns an error if the table has it.
fn insert(table: &mut BTreeMap<String, Value>, key: &str, value: Value) -> Result<(), Failure> {
    match table.insert(key.to_owned(), value) {
        None => Ok(()),
        Some(_) => Err(twice(key)),
    }
}

/// Returns the error for a setting that is given twice.
fn twice(key: &str) -> Failure {
    Failure::usage(format!(
        "`{key}` is given twice: give it once, by its option or as {key}=VALUE"
    ))
}

/// Returns an experiment without axes, metrics and results.
fn experiment() -> ExperimentSpec {
    ExperimentSpec {
        name: "render".to_owned(),
        repeats: 1,
        script_file: "render".into(),
        measure: MeasureSpec {
            every_s: f64::MAX,
            ..MeasureSpec::default()
        },
        ..ExperimentSpec::default()
    }
}

/// Hooks of an experiment of one cell.
struct OneCell {
    config: Settings,
}

impl ScriptHooks for OneCell {
    fn skip(&self, _: usize, _: &Point) -> Result<bool, HookError> {
        Ok(false)
    }

    fn render(&self, _: &Point) -> Result<Settings, HookError> {
        Ok(self.config.clone())
    }

    fn reference(&self, _: &Point) -> Result<Option<ReferenceRequest>, HookError> {
        Ok(None)
    }

    fn stop(&self, _: &Point) -> Result<StopRule, HookError> {
        // Not used: the limits of the command line apply.
        Ok(StopRule::Samples(1))
    }

    fn predicate(&self, _: usize, _: &[String], _: &[WaveRow]) -> Result<bool, HookError> {
        Ok(false)
    }
}
