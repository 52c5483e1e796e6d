//! The settings of `lumbre render`: a render table as in scripts, planned as an experiment of one
//! cell, so that names, ranges and defaults are those of scripts.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cli::args::{Global, PictureArgs, RenderArgs};
use crate::cli::exit::Failure;
use lumbre_light::value::Value;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::outcome::WaveRow;
use lumbre_night::experiment::plan::expand;
use lumbre_night::experiment::spec::{MeasureSpec, ReferenceRequest, Snapshots};
use lumbre_night::experiment::{ExperimentSpec, Overrides, Plan, Point, ScriptHooks, StopRule};
use lumbre_night::paths::extension;
use lumbre_render::Settings;
use lumbre_render::settings::named;
use lumbre_scene_io::load::FORMATS;

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
    let mut options: BTreeMap<String, Value> = args.scene.settings.iter().cloned().collect();
    if let Some(map) = &args.environment {
        let map = map.to_string_lossy().into_owned();
        named::set(&mut table, "environment.map", Value::Str(map));
        if is_model(&args.scene.file) {
            // The stage with an environment alone, which the map then replaces.
            let stage = options.entry("stage".to_owned());
            stage.or_insert_with(|| "white".into());
        }
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

/// Whether files of this name are usually models without lights.
fn is_model(file: &Path) -> bool {
    let extension = extension(file);
    let mut rows = FORMATS.iter();
    rows.any(|row| row.is_model && row.extensions.contains(&extension.as_str()))
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
        seed: 0,
        repeats: 1,
        script_file: "render".into(),
        script_text: String::new(),
        script_hash: [0; 32],
        axes: Vec::new(),
        skips: Vec::new(),
        measure: MeasureSpec {
            every_s: f64::MAX,
            metrics: Vec::new(),
            snapshots: Snapshots::Last,
            captures: false,
            film_files: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        },
        night: Default::default(),
        aa_check: false,
        figures: Vec::new(),
        tables: Vec::new(),
        report: Default::default(),
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
