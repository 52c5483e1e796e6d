//! The settings of `lumbre render`: a render table as in scripts, planned as an experiment of one
//! cell, so that names, ranges and defaults are those of scripts.

use std::collections::BTreeMap;
use std::path::Path;

use crate::cli::args::{Global, PictureArgs, RenderArgs};
use crate::cli::exit::Failure;
use crate::experiment::outcome::WaveRow;
use crate::experiment::plan::expand;
use crate::experiment::spec::{HookError, MeasureSpec, ReferenceRequest, Snapshots};
use crate::experiment::{
    CellConfig, ExperimentSpec, Overrides, Plan, Point, ScriptHooks, StopRule,
};
use crate::script;
use lumbre_light::value::Value;
use lumbre_metrics::tonemap::Tonemap;

/// Plans the picture.
///
/// # Errors
/// Returns an error if a setting is unknown or out of range, or the scene cannot be read.
pub fn plan(args: &RenderArgs, global: &Global) -> Result<Plan, Failure> {
    let mut table = picture_table(&args.picture);
    table.insert("integrator".to_owned(), args.integrator.as_str().into());
    if let Some(denoise) = &args.denoise {
        table.insert("denoise".to_owned(), denoise.as_str().into());
    }
    let config = script::render_settings(&table, Path::new(".")).map_err(Failure::usage)?;
    let overrides = Overrides {
        backend: global.backend.clone(),
        ..Overrides::default()
    };
    let mut load = |path: &Path, options: &BTreeMap<String, Value>| {
        script::scene::read(path, options, global.missing())
    };
    expand(&experiment(), &OneCell { config }, &overrides, &mut load).map_err(Failure::usage)
}

/// Returns the render table of a picture without the technique: options with a flag of their own,
/// then `KEY=VALUE`. Keys with a dot are paths of values in the scene.
pub fn picture_table(args: &PictureArgs) -> BTreeMap<String, Value> {
    let mut table = BTreeMap::new();
    let mut set = BTreeMap::new();
    let mut insert = |key: &str, value: Value| table.insert(key.to_owned(), value);
    insert(
        "scene",
        Value::Str(args.scene.file.to_string_lossy().into_owned()),
    );
    if let Some(depth) = args.depth {
        insert("max_depth", Value::Int(i64::from(depth)));
    }
    if let Some(size) = args.size {
        let sides = size.map(|side| Value::Int(i64::from(side)));
        insert("resolution", Value::List(sides.into()));
    }
    if let Some(view) = &args.view {
        insert("view", view.as_str().into());
    }
    let options = &args.scene.settings;
    if !options.is_empty() {
        insert(
            "scene_options",
            Value::Map(options.iter().cloned().collect()),
        );
    }
    for (key, value) in &args.settings {
        if key.contains('.') {
            set.insert(key.clone(), value.clone());
        } else {
            insert(key, value.clone());
        }
    }
    if !set.is_empty() {
        insert("set", Value::Map(set));
    }
    table
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
    config: CellConfig,
}

impl ScriptHooks for OneCell {
    fn skip(&self, _: usize, _: &Point) -> Result<bool, HookError> {
        Ok(false)
    }

    fn render(&self, _: &Point) -> Result<CellConfig, HookError> {
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
