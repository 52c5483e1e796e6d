//! Sandboxed Lua states, and [`Shared`], the data that all functions of one state use.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::rc::Rc;

use mlua::{HookTriggers, Lua, LuaOptions, StdLib, Value as LuaValue, VmState};

use super::api::builder::Builder;
use super::api::rule::Predicates;
use super::error::{Problem, ScriptError};
use super::kind::kind;
use super::limits::{Limits, Watchdog, pattern_is_quick};
use super::scene::SceneBuilder;
use super::source::{SourcePlace, Sources};
use lumbre_light::value::{Value, suggest};
use lumbre_scene_io::load::MissingTextures;

/// Lua instructions between two checks of the time limit. The number is small because a single
/// instruction can copy a string of many MiB.
const INSTRUCTIONS: u32 = 200;

/// Longest error message or log line of a script that is printed, in bytes.
const MAX_MESSAGE: usize = 2000;

/// Purpose for which a Lua file runs.
#[derive(Clone, Debug)]
pub enum Purpose {
    /// The file describes an experiment.
    Experiment,
    /// The file describes a scene.
    Scene {
        /// Options of the scene that the experiment sets, by name.
        options: BTreeMap<String, Value>,
        /// Treatment of textures that cannot be read, in scenes that the file imports.
        missing: MissingTextures,
    },
}

/// Data that every function of one Lua state uses.
#[derive(Debug)]
pub struct Shared {
    /// Time and memory limits.
    pub limits: Limits,
    /// Time limit of the running call.
    pub watchdog: Watchdog,
    /// Source texts of the script and its modules.
    pub sources: RefCell<Sources>,
    /// Folder of the script; modules are searched below it.
    pub folder: PathBuf,
    /// Whether the script is still loading; only then may it declare its experiment.
    pub loading: Cell<bool>,
    /// Purpose for which the file runs.
    pub purpose: Purpose,
    /// Declarations of the experiment so far.
    pub builder: RefCell<Builder>,
    /// Declarations of the scene so far.
    pub scene: RefCell<SceneBuilder>,
    /// Names of the modules that are being loaded, outermost first.
    pub requiring: RefCell<Vec<String>>,
    /// Predicate functions of stop rules, which refer to them by number.
    pub predicates: RefCell<Predicates>,
}

impl Shared {
    /// Returns the innermost position on the call stack that lies in the script's texts.
    pub fn caller(&self, lua: &Lua) -> Option<SourcePlace> {
        (0..64)
            .map_while(|level| lua.inspect_stack(level, |frame| self.place_of(frame)))
            .flatten()
            .next()
    }

    /// Returns the position of a stack frame if it lies in the script's texts.
    fn place_of(&self, frame: &mlua::debug::Debug) -> Option<SourcePlace> {
        let line = frame.current_line()?;
        let source = self
            .sources
            .try_borrow()
            .ok()?
            .by_chunk(frame.source().source.as_deref()?)?;
        Some(SourcePlace {
            source,
            line,
            last: None,
        })
    }

    /// Returns the position of the caller, or the first line of the script if no caller is on the
    /// stack, as for a function that Lua itself calls.
    pub fn call_site(&self, lua: &Lua) -> SourcePlace {
        self.caller(lua).unwrap_or(SourcePlace {
            source: 0,
            line: 1,
            last: None,
        })
    }

    /// Returns the first and last line of a function of the script.
    pub fn function_place(&self, function: &mlua::Function) -> SourcePlace {
        let info = function.info();
        let source = info
            .source
            .and_then(|chunk| self.sources.borrow().by_chunk(&chunk));
        match (source, info.line_defined, info.last_line_defined) {
            (Some(source), Some(line), last) => SourcePlace {
                source,
                line: line.max(1),
                last,
            },
            _ => SourcePlace {
                source: 0,
                line: 1,
                last: None,
            },
        }
    }

    /// Runs `f` under a time limit of `seconds`; `what` names the activity in errors.
    ///
    /// # Errors
    /// Returns the error of `f`, or that of the limit that passed.
    pub fn run<T>(
        &self,
        what: &'static str,
        seconds: f64,
        f: impl FnOnce() -> mlua::Result<T>,
    ) -> Result<T, ScriptError> {
        self.watchdog.start(what, seconds);
        let result = f();
        self.watchdog.stop();
        result.map_err(|e| self.convert(&e))
    }

    /// Converts a Lua error to a script error. A passed time limit takes precedence; an error
    /// raised by this module is returned unchanged.
    pub fn convert(&self, error: &mlua::Error) -> ScriptError {
        if let Some(expired) = self.watchdog.expired() {
            return expired;
        }
        if let Some(own) = error.downcast_ref::<ScriptError>() {
            return own.clone();
        }
        self.convert_lua_error(error)
    }

    /// Converts an error raised by Lua: finds its position in the message or in the tracebacks.
    fn convert_lua_error(&self, error: &mlua::Error) -> ScriptError {
        let sources = self.sources.borrow();
        let mut root = error;
        let mut tracebacks = String::new();
        while let mlua::Error::CallbackError { traceback, cause } = root {
            tracebacks.insert_str(0, traceback);
            root = cause;
        }
        let (text, is_syntax) = match root {
            mlua::Error::MemoryError(_) => {
                let problem = Problem::Memory {
                    mib: self.limits.memory >> 20,
                };
                let help = "look for a table or a string that grows without end: a script only \
                            describes what to render";
                return self.watchdog.error_at_last_place(problem, help, &sources);
            }
            mlua::Error::SyntaxError { message, .. } => (message.clone(), true),
            mlua::Error::RuntimeError(message) => (message.clone(), false),
            other => (other.to_string(), false),
        };
        let (message, trace) = text.split_once("\nstack traceback:").unwrap_or((&text, ""));
        let (place, message) = match sources.split_message(message) {
            Some((place, message)) => (Some(place), message.to_owned()),
            None => {
                let message = user_message(message, trace);
                (
                    sources
                        .in_traceback(trace)
                        .or_else(|| sources.in_traceback(&tracebacks)),
                    message,
                )
            }
        };
        let message = shorten(&message);
        let problem = if is_syntax {
            Problem::Syntax { message }
        } else {
            Problem::Runtime { message }
        };
        match place {
            Some(place) => sources.error(&place, problem, None),
            None => self.watchdog.error_at_last_place(
                problem,
                "Lua did not report a line number",
                &sources,
            ),
        }
    }
}

/// Returns a Lua message for users. Messages from inside the prelude name guarded library functions
/// `raw`; this replaces the name by that of the library function and drops the position in the
/// prelude.
fn user_message(message: &str, trace: &str) -> String {
    let Some((_, message)) = message
        .strip_prefix("[lumbre]:")
        .and_then(|m| m.split_once(": "))
    else {
        return message.to_owned();
    };
    let frame = trace.lines().find_map(|l| {
        l.trim_start()
            .strip_prefix("[lumbre]:")?
            .split_once("in function ")
    });
    match frame {
        Some((_, name)) => message.replace("'raw'", name.trim()),
        None => message.to_owned(),
    }
}

/// Truncates a message to [`MAX_MESSAGE`] bytes.
fn shorten(message: &str) -> String {
    let mut end = message.len().min(MAX_MESSAGE);
    while !message.is_char_boundary(end) {
        end -= 1;
    }
    if end < message.len() {
        format!("{} ..", &message[..end])
    } else {
        message.to_owned()
    }
}

/// Creates a Lua state that contains only the globals that the prelude allows, under the limits of
/// `shared`.
///
/// # Errors
/// Returns an error if the memory limit is too small for the libraries.
pub fn new_state(shared: &Rc<Shared>) -> mlua::Result<Lua> {
    let lua = Lua::new_with(
        StdLib::STRING | StdLib::TABLE | StdLib::MATH | StdLib::UTF8,
        LuaOptions::new(),
    )?;
    lua.set_memory_limit(shared.limits.memory)?;
    let native = native_functions(&lua, shared)?;
    lua.load(include_str!("prelude.lua"))
        .set_name("=[lumbre]")
        .call::<()>(&native)?;
    let metatables: mlua::Table = native.raw_get("metatables")?;
    let harmless: mlua::Function = lua.globals().raw_get("type")?;
    let watcher = Rc::clone(shared);
    lua.set_hook(
        HookTriggers::new().every_nth_instruction(INSTRUCTIONS),
        move |_, frame| {
            let Ok(sources) = watcher.sources.try_borrow() else {
                return Ok(VmState::Continue);
            };
            let Err(expired) = watcher.watchdog.check(watcher.place_of(frame), &sources) else {
                return Ok(VmState::Continue);
            };
            disarm(&metatables, &harmless)?;
            Err(mlua::Error::external(expired))
        },
    )?;
    Ok(lua)
}

/// Creates the table of native functions that the prelude uses.
fn native_functions(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<mlua::Table> {
    let native = lua.create_table()?;
    let watcher = Rc::clone(shared);
    native.raw_set(
        "within_limits",
        lua.create_function(move |lua, ()| {
            let sources = watcher.sources.borrow();
            watcher
                .watchdog
                .check(watcher.caller(lua), &sources)
                .map_err(mlua::Error::external)
        })?,
    )?;
    native.raw_set(
        "plain_table",
        lua.create_function(|_, first: Option<LuaValue>| match first {
            // With a `__len` metamethod a table could make a library function loop any number of
            // times.
            Some(LuaValue::Table(t)) => match t.metatable() {
                Some(meta) if !meta.raw_get::<LuaValue>("__len")?.is_nil() => Err(
                    mlua::Error::runtime("tables with a __len metamethod are not supported here"),
                ),
                _ => Ok(()),
            },
            _ => Ok(()),
        })?,
    )?;
    native.raw_set(
        "quick_pattern",
        lua.create_function(
            |_, (text, pattern, plain): (LuaValue, LuaValue, LuaValue)| {
                let (LuaValue::String(text), LuaValue::String(pattern)) = (text, pattern) else {
                    return Ok(());
                };
                let plain = !matches!(plain, LuaValue::Nil | LuaValue::Boolean(false));
                if pattern_is_quick(text.as_bytes().len(), &pattern.as_bytes(), plain) {
                    Ok(())
                } else {
                    Err(mlua::Error::runtime(
                        "this pattern could take very long on a text of this length",
                    ))
                }
            },
        )?,
    )?;
    native.raw_set(
        "log",
        lua.create_function(|_, text: mlua::LuaString| {
            tracing::info!(target: "script", "{}", shorten(&text.to_string_lossy()));
            Ok(())
        })?,
    )?;
    Ok(native)
}

/// Replaces every `__close` metamethod by a harmless function. An error raised by the hook closes
/// variables while no hook is active, so a `__close` metamethod could otherwise run for ever.
fn disarm(metatables: &mlua::Table, harmless: &mlua::Function) -> mlua::Result<()> {
    metatables.for_each(|meta: mlua::Table, _: LuaValue| {
        if meta.raw_get::<LuaValue>("__close")?.is_nil() {
            Ok(())
        } else {
            meta.raw_set("__close", harmless)
        }
    })
}

/// Makes reading an undefined name of `table` an error that suggests the most similar name. `what`
/// names the table in errors and is empty for the globals; `removed` explains names that scripts
/// may expect but that do not exist here.
///
/// # Errors
/// Returns an error if the memory limit is exceeded.
pub fn make_strict(
    lua: &Lua,
    shared: &Rc<Shared>,
    table: &mlua::Table,
    what: &'static str,
    removed: &'static [(&'static str, &'static str)],
) -> mlua::Result<()> {
    let shared = Rc::clone(shared);
    let index = lua.create_function(
        move |lua, (table, key): (mlua::Table, LuaValue)| -> mlua::Result<()> {
            if let Some((name, help)) = removed
                .iter()
                .find(|(name, _)| key.as_string().is_some_and(|k| k == *name))
            {
                return Err(removed_name(&shared, lua, what, name, help));
            }
            let mut names: Vec<String> = Vec::new();
            table.for_each(|name: LuaValue, _: LuaValue| {
                if let LuaValue::String(name) = name {
                    names.push(name.to_string_lossy());
                }
                Ok(())
            })?;
            names.sort_unstable();
            Err(missing_name(
                &shared,
                lua,
                what,
                &key,
                &names,
                if what.is_empty() { "global" } else { "name" },
            ))
        },
    )?;
    let meta = lua.create_table()?;
    meta.raw_set("__index", index)?;
    meta.raw_set("__metatable", false)?;
    table.set_metatable(Some(meta))
}

/// Returns the error for reading a name of Lua's own libraries that scripts cannot use.
fn removed_name(shared: &Shared, lua: &Lua, table: &str, name: &str, help: &str) -> mlua::Error {
    let place = shared.call_site(lua);
    let path = if table.is_empty() {
        name.to_owned()
    } else {
        format!("{table}.{name}")
    };
    let problem = "is not available in scripts";
    let help = Some(help.to_owned());
    mlua::Error::external(shared.sources.borrow().field(&place, &path, problem, help))
}

/// Returns the error for reading the undefined `key` of `table` (empty for the globals), which
/// contains only `names`; `what` is the kind of the names.
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
        other => kind(other),
    };
    let help = match suggest::nearest(&key, names.iter().map(String::as_str)) {
        Some(near) => format!("did you mean `{near}`?"),
        None if table.is_empty() => "no global has this name: check the spelling".to_owned(),
        None if names.is_empty() => format!("there is no {what}"),
        None => format!("known: {}", names.join(", ")),
    };
    let path = if table.is_empty() {
        key.clone()
    } else {
        format!("{table}.{key}")
    };
    let place = shared.call_site(lua);
    let problem = format!("unknown {what} `{key}`");
    mlua::Error::external(
        shared
            .sources
            .borrow()
            .field(&place, &path, problem, Some(help)),
    )
}
