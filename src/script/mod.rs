//! Scripts: Lua in, plain data out.
//!
//! A script runs once, in a sandbox, and returns its experiment; nothing renders meanwhile. [`load`] turns it into a
//! [`Spec`] and keeps the Lua state, so that the functions it gave (`render`, `skip`, predicates ..) can be asked for
//! each point of the sweep and between waves, as [`ScriptHooks`](crate::experiment::spec::ScriptHooks).
//!
//! Everything is read strictly: an unknown key, a wrong type, a value out of range or a missing file is one
//! [`ScriptError`] with the line, the path to the field and the nearest known name. The tables that check are the
//! tables from which [`docgen`] writes the editor annotations.
//!
//! The sandbox has no files, no clock, no processes and no randomness; `require` reaches only below the script's
//! folder; memory and time are limited ([`Limits`]). Iteration by `pairs` has a fixed order, because a plan must be
//! the same every time.

mod api;
pub mod docgen;
mod error;
mod hooks;
mod limits;
mod locate;
mod require;
pub mod scene;
mod source;
mod state;
mod strict;

use std::cell::{Cell, RefCell};
use std::path::{Path, PathBuf};
use std::rc::Rc;

use mlua::chunk::ChunkMode;
use mlua::{Lua, Value as LuaValue};

pub use error::{Problem, ScriptError};
pub use limits::Limits;

use crate::experiment::Spec;
use api::builder::Builder;
use state::{Purpose, Shared};

/// A script that was read: its experiment, and its functions.
///
/// It belongs to the thread that loaded it.
#[derive(Debug)]
pub struct Script {
    /// What it says.
    pub spec: Spec,
    shared: Rc<Shared>,
    /// Metatable of the points that its functions get.
    points: mlua::Table,
    lua: Lua,
}

impl Script {
    /// The files of the modules that it requires.
    pub fn modules(&self) -> Vec<PathBuf> {
        self.shared.sources.borrow().modules().map(Path::to_owned).collect()
    }
}

/// Reads a script under the default [`Limits`].
///
/// # Errors
/// Whatever is wrong with it; see [`Problem`].
pub fn load(path: &Path) -> Result<Script, ScriptError> {
    load_with(path, Limits::default())
}

/// Reads a script under the given limits.
///
/// # Errors
/// Whatever is wrong with it; see [`Problem`].
pub fn load_with(path: &Path, limits: Limits) -> Result<Script, ScriptError> {
    load_text(path, source::read(path)?, limits)
}

/// Reads a script whose text was kept elsewhere, as if it still stood in its file: what lies beside that is found.
///
/// # Errors
/// Whatever is wrong with it; see [`Problem`].
pub fn load_text(path: &Path, text: String, limits: Limits) -> Result<Script, ScriptError> {
    let Read { shared, lua, returned } = read(path, &text, limits, Purpose::Experiment)?;
    let spec = finish(&shared, &returned, path, text)?;
    let points = hooks::point_metatable(&lua, &shared).map_err(|e| shared.convert(&e))?;
    Ok(Script { spec, shared, points, lua })
}

/// A file that has run, with what it returned.
struct Read {
    shared: Rc<Shared>,
    lua: Lua,
    returned: LuaValue,
}

/// Runs a file for a purpose, in a state of its own.
fn read(path: &Path, text: &str, limits: Limits, purpose: Purpose) -> Result<Read, ScriptError> {
    let what = match purpose {
        Purpose::Experiment => "loading the script",
        Purpose::Scene { .. } => "loading the scene",
    };
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let mut sources = source::Sources::default();
    sources.add(&name, path, text.to_owned());
    let shared = Rc::new(Shared {
        limits,
        watch: limits::Watch::default(),
        sources: RefCell::new(sources),
        folder: folder_of(path),
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
    let returned = shared
        .run(what, limits.load_s, || lua.load(text).set_name(chunk).set_mode(ChunkMode::Text).call::<LuaValue>(()))?;
    shared.loading.set(false);
    Ok(Read { shared, lua, returned })
}

/// The folder of a script, from which its modules and files are found.
fn folder_of(path: &Path) -> PathBuf {
    match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent.to_owned(),
        _ => PathBuf::from("."),
    }
}

/// Checks that the script returned its experiment and that its parts fit together, and makes the spec.
fn finish(shared: &Shared, returned: &LuaValue, path: &Path, script_text: String) -> Result<Spec, ScriptError> {
    let builder = shared.builder.borrow();
    let head = match (&builder.head, returned) {
        (Some(head), LuaValue::Table(t)) if *t == head.object => head,
        _ => {
            let help = match builder.head {
                Some(_) => "x is what experiment(..) gave",
                None => "begin with: local x = experiment(\"name\", { seed = 1 })",
            };
            let line = locate::last_line(&script_text);
            let place = source::Place { source: 0, line, last: None };
            let problem = Problem::NoExperiment { found: api::kind(returned).to_owned() };
            return Err(shared.sources.borrow().error(&place, problem, Some(help.to_owned())));
        }
    };
    api::experiment::check(&builder, head, shared)?;
    Ok(Spec {
        name: head.name.clone(),
        seed: head.seed,
        repeats: head.repeats,
        script_file: path.to_owned(),
        script_text,
        script_hash: shared.sources.borrow().hash(),
        axes: builder.axes.clone(),
        skips: builder.skips.iter().map(|(reason, _)| reason.clone()).collect(),
        measure: builder.measure.as_ref().map_or_else(api::measure::nothing, |(m, _)| m.clone()),
        night: builder.night.clone(),
        control: builder.control.is_some(),
        figures: builder.figures.iter().map(|(f, _)| f.clone()).collect(),
        tables: builder.tables.iter().map(|(t, _)| t.clone()).collect(),
    })
}
