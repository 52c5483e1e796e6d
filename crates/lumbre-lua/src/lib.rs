//! Lua scripts: converts a script of an experiment or of a scene to plain data.
//!
//! A script runs once, in a sandbox, and returns its experiment; nothing is rendered meanwhile.
//! [`load`] converts it to an [`ExperimentSpec`] and retains the Lua state, so that the script's
//! functions (`render`, `skip`, predicates) can be called for each point of the sweep and between
//! waves, through [`ScriptHooks`](lumbre_night::experiment::spec::ScriptHooks). [`scene`] loads scenes
//! written in Lua.
//!
//! Validation is strict: an unknown key, a wrong type, a value out of range or a missing file is
//! one [`ScriptError`] with the line, the path to the field and the most similar name. The tables
//! that validate are also the source of the editor annotations ([`docgen`]) and of the reference
//! page ([`mod@reference`]).
//!
//! The sandbox has no files, clock, processes or random numbers; `require` reads only below the
//! script's folder; memory and time are limited ([`Limits`]). Iteration with `pairs` has a fixed
//! order, so that a plan is the same in every process.

mod api;
pub mod docgen;
mod error;
mod hooks;
mod kind;
mod limits;
mod literal;
mod locate;
mod plan_error;
pub mod reference;
mod require;
pub mod scene;
mod source;
mod state;
mod strict;

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use mlua::chunk::ChunkMode;
use mlua::{Lua, Value as LuaValue};

pub use api::render_schema::RENDER;
pub use error::{Problem, ScriptError};
pub use limits::Limits;
pub use literal::literal;
pub use reference::reference;

use api::builder::{Builder, Externals};
use kind::kind;
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;
use lumbre_night::experiment::ExperimentSpec;
use lumbre_night::experiment::spec::Presentation;
use lumbre_night::paths::folder_of;
use lumbre_render::Settings;
use state::{Purpose, Shared};

/// Checks a render table as scripts return it, and converts it. Relative files are searched in the
/// current folder, then in `folder`.
///
/// # Errors
/// Returns an error for the first field that is unknown, missing, of a wrong type, out of range, or
/// that names a missing file.
pub fn render_settings(
    table: &BTreeMap<String, Value>,
    folder: &Path,
) -> Result<Settings, SchemaError> {
    api::render::settings(table, folder, &Externals::new(), "render")
}

/// Loaded script: its experiment, and the Lua state with its functions.
///
/// It can be used only on the thread that loaded it.
#[derive(Debug)]
pub struct Script {
    /// The experiment that the script describes.
    pub spec: ExperimentSpec,
    shared: Rc<Shared>,
    /// Metatable of the points that are passed to the script's functions.
    points: mlua::Table,
    lua: Lua,
}

impl Script {
    /// Returns the files of the modules that the script requires.
    pub fn modules(&self) -> Vec<PathBuf> {
        self.shared
            .sources
            .borrow()
            .modules()
            .map(Path::to_owned)
            .collect()
    }
}

/// Loads a script under the default [`Limits`].
///
/// # Errors
/// Returns the first error in the script; [`Problem`] lists them.
pub fn load(path: &Path) -> Result<Script, ScriptError> {
    load_with(path, Limits::default())
}

/// Loads a script under the given limits.
///
/// # Errors
/// Returns the first error in the script; [`Problem`] lists them.
pub fn load_with(path: &Path, limits: Limits) -> Result<Script, ScriptError> {
    load_text(path, source::read(path)?, limits)
}

/// Loads a script from `text` as if it were the content of the file at `path`: modules and other
/// files are searched beside that path.
///
/// # Errors
/// Returns the first error in the script; [`Problem`] lists them.
pub fn load_text(path: &Path, text: String, limits: Limits) -> Result<Script, ScriptError> {
    let ExecutedFile {
        shared,
        lua,
        returned,
    } = run_file(path, &text, limits, Purpose::Experiment)?;
    let spec = finish(&shared, &returned, path, text)?;
    let points = hooks::point_metatable(&lua, &shared).map_err(|e| shared.convert(&e))?;
    Ok(Script {
        spec,
        shared,
        points,
        lua,
    })
}

/// Lua file that has run, with the value that it returned.
struct ExecutedFile {
    shared: Rc<Shared>,
    lua: Lua,
    returned: LuaValue,
}

/// Runs a file in a new Lua state.
fn run_file(
    path: &Path,
    text: &str,
    limits: Limits,
    purpose: Purpose,
) -> Result<ExecutedFile, ScriptError> {
    let activity = match purpose {
        Purpose::Experiment => "loading the script",
        Purpose::Scene { .. } => "loading the scene",
    };
    let name = path
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    let mut sources = source::Sources::default();
    sources.add(&name, path, text.to_owned());
    let shared = Rc::new(Shared {
        limits,
        watchdog: limits::Watchdog::default(),
        sources: RefCell::new(sources),
        folder: folder_of(path).to_owned(),
        loading: Cell::new(true),
        purpose,
        builder: RefCell::new(Builder::default()),
        scene: RefCell::default(),
        requiring: RefCell::default(),
        predicates: RefCell::default(),
    });
    let lua = state::new_state(&shared).map_err(|e| shared.convert(&e))?;
    api::register(&lua, &shared).map_err(|e| shared.convert(&e))?;
    let chunk = format!("@{}", shared.sources.borrow().get(0).chunk);
    let returned = shared.run(activity, limits.load_s, || {
        lua.load(text)
            .set_name(chunk)
            .set_mode(ChunkMode::Text)
            .call::<LuaValue>(())
    })?;
    shared.loading.set(false);
    Ok(ExecutedFile {
        shared,
        lua,
        returned,
    })
}

/// Checks that the script returned its experiment and that its declarations are consistent, and
/// returns the spec.
fn finish(
    shared: &Shared,
    returned: &LuaValue,
    path: &Path,
    script_text: String,
) -> Result<ExperimentSpec, ScriptError> {
    let builder = shared.builder.borrow();
    let head = match (&builder.head, returned) {
        (Some(head), LuaValue::Table(t)) if *t == head.object => head,
        _ => {
            let help = match builder.head {
                Some(_) => "return the value that experiment(..) returned",
                None => "begin with: local x = experiment(\"name\", { seed = 1 })",
            };
            let line = locate::last_line(&script_text);
            let place = source::SourcePlace {
                source: 0,
                line,
                last: None,
            };
            let problem = Problem::NoExperiment {
                found: kind(returned),
            };
            return Err(shared
                .sources
                .borrow()
                .error(&place, problem, Some(help.to_owned())));
        }
    };
    api::experiment::check(&builder, head, shared)?;
    Ok(ExperimentSpec {
        name: head.name.clone(),
        seed: head.seed,
        repeats: head.repeats,
        script_file: path.to_owned(),
        script_text,
        script_hash: shared.sources.borrow().hash(),
        axes: builder.axes.clone(),
        skips: builder
            .skips
            .iter()
            .map(|(reason, _)| reason.clone())
            .collect(),
        measure: builder
            .measure
            .as_ref()
            .map_or_else(Default::default, |(m, _)| m.clone()),
        night: builder.night.clone(),
        aa_check: builder.aa_check.is_some(),
        figures: builder.figures.iter().map(|(f, _)| f.clone()).collect(),
        tables: builder.tables.iter().map(|(t, _)| t.clone()).collect(),
        sheets: builder.sheets.iter().map(|(s, _)| s.clone()).collect(),
        report: {
            let report = builder.report.as_ref().map(|(report, _)| report.clone());
            let report = report.unwrap_or_default();
            Presentation {
                display: report.display.or(builder.display),
                notes: builder.notes.clone(),
                ..report
            }
        },
    })
}
