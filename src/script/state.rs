//! A Lua state that can reach nothing outside itself, and what its functions share.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;

use mlua::{HookTriggers, Lua, LuaOptions, StdLib, Value as LuaValue, VmState};

use super::api::builder::Builder;
use super::api::stop::Predicates;
use super::error::{Problem, ScriptError};
use super::limits::{Limits, Watch, pattern_is_quick};
use super::scene::SceneBuilder;
use super::source::{Place, Sources};
use crate::scene::load::Missing;
use crate::value::{Value, suggest};

/// Instructions between two looks at the clock. Few, because one instruction can copy a string of many MiB.
const INSTRUCTIONS: u32 = 200;

/// Longest message of a script's own `error` that is shown, in bytes.
const MAX_MESSAGE: usize = 2000;

/// What a file is read for.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// It describes an experiment.
    Experiment,
    /// It describes a scene.
    Scene {
        /// What the experiment chose of what the scene offers.
        options: BTreeMap<String, Value>,
        /// What becomes of textures that cannot be read, in scenes that it imports.
        missing: Missing,
    },
}

/// What every function of the script room can reach.
#[derive(Debug)]
pub struct Shared {
    /// The limits.
    pub limits: Limits,
    /// The clock.
    pub watch: Watch,
    /// The texts.
    pub sources: RefCell<Sources>,
    /// The folder of the script; modules are found below it.
    pub folder: PathBuf,
    /// Whether the script is still being read: only then may it describe its experiment.
    pub loading: Cell<bool>,
    /// What it is read for.
    pub purpose: Purpose,
    /// What it has said so far of an experiment.
    pub builder: RefCell<Builder>,
    /// What it has said so far of a scene.
    pub scene: RefCell<SceneBuilder>,
    /// The modules that are being loaded, outermost first.
    pub requiring: RefCell<Vec<String>>,
    /// The predicates that stop rules name by number.
    pub predicates: RefCell<Predicates>,
}

impl Shared {
    /// The innermost place in the script's texts on the call stack.
    pub fn caller(&self, lua: &Lua) -> Option<Place> {
        (0..64).map_while(|level| lua.inspect_stack(level, |frame| self.place_of(frame))).flatten().next()
    }

    fn place_of(&self, frame: &mlua::debug::Debug) -> Option<Place> {
        let line = frame.current_line()?;
        let source = self.sources.try_borrow().ok()?.by_chunk(frame.source().source.as_deref()?)?;
        Some(Place { source, line, last: None })
    }

    /// The place of the caller, or the script's first line when there is none (a function called by Lua itself).
    pub fn here(&self, lua: &Lua) -> Place {
        self.caller(lua).unwrap_or(Place { source: 0, line: 1, last: None })
    }

    /// First and last line of a function of the script.
    pub fn function_place(&self, function: &mlua::Function) -> Place {
        let info = function.info();
        let source = info.source.and_then(|chunk| self.sources.borrow().by_chunk(&chunk));
        match (source, info.line_defined, info.last_line_defined) {
            (Some(source), Some(line), last) => Place { source, line: line.max(1), last },
            _ => Place { source: 0, line: 1, last: None },
        }
    }

    /// Runs Lua under a time limit and turns its error into the script's.
    ///
    /// # Errors
    /// Whatever stopped it.
    pub fn run<T>(
        &self,
        what: &'static str,
        seconds: f64,
        f: impl FnOnce() -> mlua::Result<T>,
    ) -> Result<T, ScriptError> {
        self.watch.start(what, seconds);
        let result = f();
        self.watch.stop();
        result.map_err(|e| self.convert(&e))
    }

    /// The script's error that a Lua error is.
    pub fn convert(&self, error: &mlua::Error) -> ScriptError {
        if let Some(expired) = self.watch.expired() {
            return expired;
        }
        if let Some(own) = error.downcast_ref::<ScriptError>() {
            return own.clone();
        }
        let sources = self.sources.borrow();
        let mut root = error;
        let mut tracebacks = String::new();
        while let mlua::Error::CallbackError { traceback, cause } = root {
            tracebacks.insert_str(0, traceback);
            root = cause;
        }
        let (text, is_syntax) = match root {
            mlua::Error::MemoryError(_) => {
                let problem = Problem::Memory { mib: self.limits.memory >> 20 };
                let help =
                    "a script only describes what to render; is there a table or a string that never stops growing?";
                return self.watch.here(problem, help, &sources);
            }
            mlua::Error::SyntaxError { message, .. } => (message.clone(), true),
            mlua::Error::RuntimeError(message) => (message.clone(), false),
            other => (other.to_string(), false),
        };
        let (message, trace) = text.split_once("\nstack traceback:").unwrap_or((&text, ""));
        let (place, message) = match sources.split_message(message) {
            Some((place, message)) => (Some(place), message.to_owned()),
            None => {
                let message = own_words(message, trace);
                (sources.in_traceback(trace).or_else(|| sources.in_traceback(&tracebacks)), message)
            }
        };
        let message = shorten(&message);
        let problem = if is_syntax { Problem::Syntax { message } } else { Problem::Runtime { message } };
        match place {
            Some(place) => sources.error(&place, problem, None),
            None => self.watch.here(problem, "Lua did not say in which line", &sources),
        }
    }
}

/// A message from inside the prelude, where guarded library functions are all called `raw`, without that.
fn own_words(message: &str, trace: &str) -> String {
    let Some((_, message)) = message.strip_prefix("[lumbre]:").and_then(|m| m.split_once(": ")) else {
        return message.to_owned();
    };
    let frame = trace.lines().find_map(|l| l.trim_start().strip_prefix("[lumbre]:")?.split_once("in function "));
    match frame {
        Some((_, name)) => message.replace("'raw'", name.trim()),
        None => message.to_owned(),
    }
}

fn shorten(message: &str) -> String {
    let mut end = message.len().min(MAX_MESSAGE);
    while !message.is_char_boundary(end) {
        end -= 1;
    }
    if end < message.len() { format!("{} ..", &message[..end]) } else { message.to_owned() }
}

/// A new state in which only what the prelude allows is left, watched by `shared`.
///
/// # Errors
/// When the limits leave no room even for the libraries.
pub fn new_state(shared: &Rc<Shared>) -> mlua::Result<Lua> {
    let lua = Lua::new_with(StdLib::STRING | StdLib::TABLE | StdLib::MATH | StdLib::UTF8, LuaOptions::new())?;
    lua.set_memory_limit(shared.limits.memory)?;
    let native = lua.create_table()?;
    let watcher = Rc::clone(shared);
    native.raw_set(
        "within_limits",
        lua.create_function(move |lua, ()| {
            let sources = watcher.sources.borrow();
            watcher.watch.check(watcher.caller(lua), &sources).map_err(mlua::Error::external)
        })?,
    )?;
    native.raw_set(
        "plain_table",
        lua.create_function(|_, first: Option<LuaValue>| match first {
            // A length that a function makes up would let the library loop as often as it says.
            Some(LuaValue::Table(t)) => match t.metatable() {
                Some(meta) if !meta.raw_get::<LuaValue>("__len")?.is_nil() => {
                    Err(mlua::Error::runtime("the table has a length of its own making (__len)"))
                }
                _ => Ok(()),
            },
            _ => Ok(()),
        })?,
    )?;
    native.raw_set(
        "quick_pattern",
        lua.create_function(|_, (text, pattern, plain): (LuaValue, LuaValue, LuaValue)| {
            let (LuaValue::String(text), LuaValue::String(pattern)) = (text, pattern) else { return Ok(()) };
            let plain = !matches!(plain, LuaValue::Nil | LuaValue::Boolean(false));
            if pattern_is_quick(text.as_bytes().len(), &pattern.as_bytes(), plain) {
                Ok(())
            } else {
                Err(mlua::Error::runtime("this pattern could take very long on a text of this length"))
            }
        })?,
    )?;
    native.raw_set(
        "log",
        lua.create_function(|_, text: mlua::LuaString| {
            tracing::info!(target: "script", "{}", shorten(&text.to_string_lossy()));
            Ok(())
        })?,
    )?;
    lua.load(include_str!("prelude.lua")).set_name("=[lumbre]").call::<()>(&native)?;
    let metatables: mlua::Table = native.raw_get("metatables")?;
    let harmless: mlua::Function = lua.globals().raw_get("type")?;
    let watcher = Rc::clone(shared);
    lua.set_hook(HookTriggers::new().every_nth_instruction(INSTRUCTIONS), move |_, frame| {
        let Ok(sources) = watcher.sources.try_borrow() else { return Ok(VmState::Continue) };
        let Err(expired) = watcher.watch.check(watcher.place_of(frame), &sources) else { return Ok(VmState::Continue) };
        disarm(&metatables, &harmless)?;
        Err(mlua::Error::external(expired))
    })?;
    Ok(lua)
}

/// Takes the functions away that would run when variables are closed: an error that leaves the hook closes them
/// while no hook is active, so they could stay there for ever.
fn disarm(metatables: &mlua::Table, harmless: &mlua::Function) -> mlua::Result<()> {
    metatables.for_each(|meta: mlua::Table, _: LuaValue| {
        if meta.raw_get::<LuaValue>("__close")?.is_nil() { Ok(()) } else { meta.raw_set("__close", harmless) }
    })
}

/// Makes reading a name that `table` does not hold an error with the nearest name. `what` is how errors call the
/// table; `known` says more about some names.
///
/// # Errors
/// When there is no memory.
pub fn make_strict(
    lua: &Lua,
    shared: &Rc<Shared>,
    table: &mlua::Table,
    what: &'static str,
    known: &'static [(&'static str, &'static str)],
) -> mlua::Result<()> {
    let shared = Rc::clone(shared);
    let index = lua.create_function(move |lua, (table, key): (mlua::Table, LuaValue)| -> mlua::Result<()> {
        if let Some((name, help)) = known.iter().find(|(name, _)| key.as_string().is_some_and(|k| k == *name)) {
            let place = shared.here(lua);
            let path = if what.is_empty() { (*name).to_owned() } else { format!("{what}.{name}") };
            let help = Some((*help).to_owned());
            return Err(mlua::Error::external(shared.sources.borrow().field(&place, &path, "is not there", help)));
        }
        let mut names: Vec<String> = Vec::new();
        table.for_each(|name: LuaValue, _: LuaValue| {
            if let LuaValue::String(name) = name {
                names.push(name.to_string_lossy());
            }
            Ok(())
        })?;
        names.sort_unstable();
        Err(missing_name(&shared, lua, what, &key, &names, if what.is_empty() { "global" } else { "name" }))
    })?;
    let meta = lua.create_table()?;
    meta.raw_set("__index", index)?;
    meta.raw_set("__metatable", false)?;
    table.set_metatable(Some(meta))
}

/// The error for reading `key` in `table` (empty for the globals), which holds only `names`; `what` is what they are.
pub fn missing_name(
    shared: &Shared,
    lua: &Lua,
    table: &str,
    key: &LuaValue,
    names: &[String],
    what: &str,
) -> mlua::Error {
    let key = match key {
        LuaValue::String(s) => s.to_string_lossy(),
        LuaValue::Integer(i) => i.to_string(),
        other => super::api::kind(other).to_owned(),
    };
    let help = match suggest::nearest(&key, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if table.is_empty() => "it was never set; is it spelt as where it was set?".to_owned(),
        None if names.is_empty() => format!("there is no {what} at all"),
        None => format!("known: {}", names.join(", ")),
    };
    let path = if table.is_empty() { key.clone() } else { format!("{table}.{key}") };
    let place = shared.here(lua);
    let problem = format!("unknown {what} `{key}`");
    mlua::Error::external(shared.sources.borrow().field(&place, &path, problem, Some(help)))
}
