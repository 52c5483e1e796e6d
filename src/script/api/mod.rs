//! The functions that scripts call. Each is one row of a table: its name, its parameters and its documentation stand
//! beside the Rust function that does it, and the editor annotations are written from the same rows.

pub mod axis;
pub mod builder;
pub mod experiment;
pub mod measure;
pub mod night;
pub mod render;
pub mod report;
pub mod stop;

use std::rc::Rc;

use mlua::{Lua, MultiValue, Value as LuaValue};

use super::error::ScriptError;
use super::source::Place;
use super::state::{Shared, make_strict};
use super::{require, scene, strict};
use crate::value::Value;
use crate::value::schema::SchemaError;

/// One parameter of a function, for the editor annotations.
#[derive(Clone, Copy, Debug)]
pub struct Param {
    /// Its name; a trailing `?` means that it may be left out, `...` takes any number.
    pub name: &'static str,
    /// Its LuaLS type.
    pub ty: &'static str,
    /// One sentence for people.
    pub doc: &'static str,
}

/// One function of the script's world.
pub struct ApiFn {
    /// Its name: `range`, `stop.time`, or `x:axis` for a method of the experiment.
    pub name: &'static str,
    /// Its parameters.
    pub params: &'static [Param],
    /// The LuaLS type of what it returns; empty for nothing.
    pub returns: &'static str,
    /// What it does.
    pub doc: &'static str,
    /// Does it.
    pub call: fn(&Rc<Shared>, &Lua, &Args) -> Result<LuaValue, ScriptError>,
}

/// The tables of functions, in the order of the annotations.
pub const FUNCTIONS: &[&[ApiFn]] = &[experiment::GLOBALS, axis::GLOBALS, report::GLOBALS, stop::RULES, GLOBALS];

/// What belongs to no other file.
const GLOBALS: &[ApiFn] = &[ApiFn {
    name: "require",
    params: require::PARAMS,
    returns: "any",
    doc: "Loads a module from below the script's own folder, once.",
    call: require::require,
}];

/// Names that scripts of other programs use and that are left out here, with the reason.
const LEFT_OUT: &[(&str, &str)] = &[
    ("os", "scripts run in a sandbox without `os`: a plan must not depend on the clock or the machine"),
    ("io", "scripts run in a sandbox without files: `x:measure`, `x:figure` and `x:table` say what is written"),
    ("debug", "scripts run in a sandbox without `debug`"),
    ("package", "scripts run in a sandbox: `require` finds modules below the script's own folder"),
    ("load", "scripts run in a sandbox: `require` is the only way to load code"),
    ("loadfile", "scripts run in a sandbox: `require` is the only way to load code"),
    ("dofile", "scripts run in a sandbox: `require` is the only way to load code"),
    ("coroutine", "scripts run in a sandbox without coroutines"),
    ("collectgarbage", "scripts run in a sandbox without `collectgarbage`"),
];

/// The same for the functions of `math`.
const LEFT_OUT_OF_MATH: &[(&str, &str)] = &[
    ("random", "a plan must be the same every time: use the experiment's seed and `repeats`"),
    ("randomseed", "a plan must be the same every time: use the experiment's seed and `repeats`"),
];

/// What a person would call the kind of a Lua value.
pub fn kind(value: &LuaValue) -> &'static str {
    match value {
        LuaValue::Nil => "nothing",
        LuaValue::Boolean(_) => "a boolean",
        LuaValue::Integer(_) => "an integer",
        LuaValue::Number(_) => "a number",
        LuaValue::String(_) => "a string",
        LuaValue::Table(_) => "a table",
        LuaValue::Function(_) => "a function",
        LuaValue::UserData(u) if u.is::<stop::RuleObject>() => "a stop rule",
        LuaValue::UserData(u) if u.is::<measure::MetricObject>() => "a metric",
        LuaValue::UserData(u) if u.is::<report::TimeToObject>() => "a time_to value",
        LuaValue::UserData(u) => scene::kind(u).unwrap_or("a Lua object"),
        _ => "a Lua object",
    }
}

/// The arguments of one call.
pub struct Args {
    /// The function's name as written in its row.
    name: &'static str,
    /// The arguments, without the experiment in front of a method's.
    values: Vec<LuaValue>,
    /// Where the call is.
    pub place: Place,
}

impl Args {
    /// An error about this call.
    pub fn error(&self, shared: &Shared, problem: impl Into<String>, help: Option<String>) -> ScriptError {
        shared.sources.borrow().field(&self.place, self.name, problem, help)
    }

    /// An error about a field in one of the arguments, at the line of its key if that can be found.
    pub fn blame(&self, shared: &Shared, error: SchemaError) -> ScriptError {
        shared.sources.borrow().blame(&self.place, error)
    }

    /// How many arguments there are.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Argument `i` (from 0), or nil.
    pub fn get(&self, i: usize) -> LuaValue {
        self.values.get(i).cloned().unwrap_or(LuaValue::Nil)
    }

    /// Rejects more than `n` arguments.
    ///
    /// # Errors
    /// When there are more.
    pub fn at_most(&self, shared: &Shared, n: usize) -> Result<(), ScriptError> {
        match self.values.len() {
            found if found > n => {
                Err(self.error(shared, format!("expected at most {n} arguments, found {found}"), None))
            }
            _ => Ok(()),
        }
    }

    /// The error for argument `i`, called `what`, that is not `expected`.
    pub fn wrong(&self, shared: &Shared, i: usize, what: &str, expected: &str) -> ScriptError {
        let found = kind(&self.get(i));
        self.error(shared, format!("argument {} ({what}): expected {expected}, found {found}", i + 1), None)
    }

    /// Argument `i` as text.
    ///
    /// # Errors
    /// When it is something else.
    pub fn text(&self, shared: &Shared, i: usize, what: &str) -> Result<String, ScriptError> {
        match self.get(i) {
            LuaValue::String(s) if s.to_str().is_ok() => Ok(s.to_string_lossy()),
            _ => Err(self.wrong(shared, i, what, "a string")),
        }
    }

    /// Argument `i` as a finite number.
    ///
    /// # Errors
    /// When it is something else.
    pub fn number(&self, shared: &Shared, i: usize, what: &str) -> Result<f64, ScriptError> {
        match self.get(i) {
            LuaValue::Integer(n) => Ok(n as f64),
            LuaValue::Number(x) if x.is_finite() => Ok(x),
            LuaValue::Number(x) => {
                Err(self.error(shared, format!("argument {} ({what}) is {x}: expected a finite number", i + 1), None))
            }
            _ => Err(self.wrong(shared, i, what, "a number")),
        }
    }

    /// Argument `i` as an integer in a range.
    ///
    /// # Errors
    /// When it is something else.
    pub fn integer(&self, shared: &Shared, i: usize, what: &str, min: i64, max: i64) -> Result<i64, ScriptError> {
        let x = self.number(shared, i, what)?;
        match Value::number(x) {
            Value::Int(n) if (min..=max).contains(&n) => Ok(n),
            _ => {
                let problem =
                    format!("argument {} ({what}) is {x}: expected an integer between {min} and {max}", i + 1);
                Err(self.error(shared, problem, None))
            }
        }
    }

    /// Argument `i` as a function.
    ///
    /// # Errors
    /// When it is something else.
    pub fn function(&self, shared: &Shared, i: usize, what: &str) -> Result<mlua::Function, ScriptError> {
        match self.get(i) {
            LuaValue::Function(f) => Ok(f),
            _ => Err(self.wrong(shared, i, what, "a function")),
        }
    }

    /// Argument `i` as a table.
    ///
    /// # Errors
    /// When it is something else.
    pub fn table(&self, shared: &Shared, i: usize, what: &str) -> Result<mlua::Table, ScriptError> {
        match self.get(i) {
            LuaValue::Table(t) => Ok(t),
            _ => Err(self.wrong(shared, i, what, "a table")),
        }
    }

    /// Argument `i` as a list of plain data; errors call it `path`.
    ///
    /// # Errors
    /// When it is something else.
    pub fn list(&self, shared: &Shared, i: usize, what: &str, path: &str) -> Result<Vec<Value>, ScriptError> {
        let table = LuaValue::Table(self.table(shared, i, what)?);
        match strict::read(&table, path, "").map_err(|e| self.blame(shared, e))? {
            Value::List(items) => Ok(items),
            other => Err(self.error(
                shared,
                format!("argument {} ({what}) is {}: expected a list", i + 1, other.kind()),
                None,
            )),
        }
    }
}

/// A function of the script room as a function of Lua.
fn bind(lua: &Lua, shared: &Rc<Shared>, row: &'static ApiFn) -> mlua::Result<mlua::Function> {
    let shared = Rc::clone(shared);
    lua.create_function(move |lua, values: MultiValue| {
        let args = Args { name: row.name, values: values.into_iter().collect(), place: shared.here(lua) };
        (row.call)(&shared, lua, &args).map_err(mlua::Error::external)
    })
}

/// Puts everything that a script may call into its state, and makes misspelt names errors.
///
/// # Errors
/// When there is no memory.
pub fn register(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<()> {
    let globals = lua.globals();
    for row in FUNCTIONS.iter().chain(scene::FUNCTIONS).copied().flatten() {
        let function = bind(lua, shared, row)?;
        match row.name.split_once('.') {
            None => globals.raw_set(row.name, function)?,
            Some((space, name)) => {
                let table = match globals.raw_get::<LuaValue>(space)? {
                    LuaValue::Table(t) => t,
                    _ => lua.create_table()?,
                };
                table.raw_set(name, function)?;
                globals.raw_set(space, table)?;
            }
        }
    }
    measure::register(lua, shared)?;
    for (space, known) in [
        ("stop", &[] as &[_]),
        ("metric", &[]),
        ("tonemap", &[]),
        ("shape", &[]),
        ("texture", &[]),
        ("math", LEFT_OUT_OF_MATH),
        ("string", &[]),
        ("table", &[]),
        ("utf8", &[]),
    ] {
        make_strict(lua, shared, &globals.raw_get(space)?, space, known)?;
    }
    make_strict(lua, shared, &globals, "", LEFT_OUT)
}

/// The experiment or the scene as Lua sees it: a table of methods that knows only them. `me` is what the names of their
/// rows call it.
///
/// # Errors
/// When there is no memory.
pub fn method_object(
    lua: &Lua,
    shared: &Rc<Shared>,
    rows: impl IntoIterator<Item = &'static ApiFn>,
    me: &'static str,
) -> mlua::Result<mlua::Table> {
    let object = lua.create_table()?;
    let identity = object.to_pointer() as usize;
    for row in rows {
        let name = row.name.split_once(':').map_or(row.name, |(_, name)| name);
        let shared = Rc::clone(shared);
        let method = lua.create_function(move |lua, values: MultiValue| {
            let mut values: Vec<LuaValue> = values.into_iter().collect();
            let place = shared.here(lua);
            let is_self = matches!(values.first(), Some(LuaValue::Table(t)) if t.to_pointer() as usize == identity);
            if is_self {
                values.remove(0);
            }
            let args = Args { name: row.name, values, place };
            if !is_self {
                let help = format!("write `{}(..)` with a colon", row.name);
                return Err(mlua::Error::external(args.error(
                    &shared,
                    format!("called without its `{me}`"),
                    Some(help),
                )));
            }
            if !shared.loading.get() {
                let help = format!("{me}:.. may only be called while the script is read");
                let problem = "everything is already described: the plan is being made";
                return Err(mlua::Error::external(args.error(&shared, problem, Some(help))));
            }
            (row.call)(&shared, lua, &args).map_err(mlua::Error::external)
        })?;
        object.raw_set(name, method)?;
    }
    make_strict(lua, shared, &object, me, &[])?;
    Ok(object)
}
