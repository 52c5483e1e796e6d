//! Functions as table rows, and the arguments of one call.

use std::rc::Rc;

use mlua::{Lua, MultiValue, UserData, Value as LuaValue};

use crate::error::ScriptError;
use crate::kind::kind;
use crate::source::SourcePlace;
use crate::state::{Shared, make_strict};
use crate::strict::{self, Fields};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Table};

/// Parameter of a function, for the annotations and the reference page.
#[derive(Clone, Copy, Debug)]
pub struct Param {
    /// Name of the parameter. A trailing `?` marks an optional one, `...` any number of arguments.
    pub name: &'static str,
    /// LuaLS type of the parameter.
    pub ty: &'static str,
    /// Meaning, unit and range in one sentence.
    pub doc: &'static str,
}

/// Function that scripts can call.
pub struct ApiFn {
    /// Name of the function: `range`, `stop.time`, or `x:axis` for a method of the experiment.
    pub name: &'static str,
    /// Parameters in order.
    pub params: &'static [Param],
    /// LuaLS type of the returned value; empty if it returns nothing.
    pub returns: &'static str,
    /// Description in one or two sentences.
    pub doc: &'static str,
    /// Implementation of the function.
    pub call: fn(&Args) -> Result<LuaValue, ScriptError>,
}

/// Declares a table of functions, with one row per function and parameter. A function that returns
/// nothing has no `->`.
///
/// ```text
/// "NAME" -> "RETURNED TYPE" = IMPLEMENTATION, "DOC" {
///     "PARAMETER": "TYPE", "DOC";
/// }
/// ```
macro_rules! functions {
    ($(#[$meta:meta])* $visible:vis const $ROWS:ident;
     $($name:literal $(-> $returns:literal)? = $call:expr, $doc:literal {
         $($param:literal: $ty:literal, $param_doc:literal;)*
     })*) => {
        $(#[$meta])*
        $visible const $ROWS: &[ApiFn] = &[$(ApiFn {
            name: $name,
            params: &[$($crate::api::Param { name: $param, ty: $ty, doc: $param_doc }),*],
            returns: concat!("" $(, $returns)?),
            doc: $doc,
            call: $call,
        }),*];
    };
}
pub(crate) use functions;

/// Arguments of one call, and the state of the script that makes it.
pub struct Args {
    /// State of the script.
    pub shared: Rc<Shared>,
    /// Lua state of the script.
    pub lua: Lua,
    /// Name of the function, as in its table row.
    pub name: &'static str,
    /// Arguments of the call, without the receiver of a method.
    values: Vec<LuaValue>,
    /// Position of the call.
    pub place: SourcePlace,
}

impl ApiFn {
    /// Calls the function. More arguments than parameters are an error, unless the last parameter
    /// is `...`.
    fn call(&self, args: &Args) -> mlua::Result<LuaValue> {
        let (found, most) = (args.len(), self.params.len());
        let has_rest = self.params.last().is_some_and(|param| param.name == "...");
        let result = if found > most && !has_rest {
            Err(args.error(
                format!("expected at most {most} arguments, found {found}"),
                None,
            ))
        } else {
            (self.call)(args)
        };
        result.map_err(mlua::Error::external)
    }
}

impl Args {
    /// Rejects a second call of a method that may be called once.
    pub(super) fn only_once(&self, before: Option<&SourcePlace>) -> Result<(), ScriptError> {
        match before {
            Some(place) => Err(self.error(
                format!("called twice: the first call is in line {}", place.line),
                None,
            )),
            None => Ok(()),
        }
    }

    /// Returns an error about this call.
    pub fn error(&self, problem: impl Into<String>, help: Option<String>) -> ScriptError {
        self.shared
            .sources
            .borrow()
            .field(&self.place, self.name, problem, help)
    }

    /// Converts an error about a field of an argument to a script error at the line of its key, if
    /// that can be found.
    pub fn locate_error(&self, error: SchemaError) -> ScriptError {
        self.shared
            .sources
            .borrow()
            .locate_error(&self.place, error)
    }

    /// Returns the number of arguments.
    pub fn len(&self) -> usize {
        self.values.len()
    }

    /// Returns argument `i` (from 0), or nil if there is none.
    pub fn get(&self, i: usize) -> LuaValue {
        self.values.get(i).cloned().unwrap_or(LuaValue::Nil)
    }

    /// Returns the error for argument `i`, the parameter `what`, that is not `expected`.
    pub fn wrong(&self, i: usize, what: &str, expected: &str) -> ScriptError {
        let found = kind(&self.get(i));
        self.error(
            format!(
                "argument {} ({what}): expected {expected}, found {found}",
                i + 1
            ),
            None,
        )
    }

    /// Returns argument `i` as text.
    ///
    /// # Errors
    /// Returns an error if it is not a string in UTF-8.
    pub fn text(&self, i: usize, what: &str) -> Result<String, ScriptError> {
        match self.get(i) {
            LuaValue::String(s) if s.to_str().is_ok() => Ok(s.to_string_lossy()),
            _ => Err(self.wrong(i, what, "a string")),
        }
    }

    /// Returns argument `i` as a finite number.
    ///
    /// # Errors
    /// Returns an error if it is not a finite number.
    pub fn number(&self, i: usize, what: &str) -> Result<f64, ScriptError> {
        match self.get(i) {
            LuaValue::Integer(n) => Ok(n as f64),
            LuaValue::Number(x) if x.is_finite() => Ok(x),
            LuaValue::Number(x) => Err(self.error(
                format!(
                    "argument {} ({what}) is {x}: expected a finite number",
                    i + 1
                ),
                None,
            )),
            _ => Err(self.wrong(i, what, "a number")),
        }
    }

    /// Returns argument `i` as an integer in `min..=max`.
    ///
    /// # Errors
    /// Returns an error if it is not an integer or is out of range.
    pub fn integer(&self, i: usize, what: &str, min: i64, max: i64) -> Result<i64, ScriptError> {
        let x = self.number(i, what)?;
        match Value::number(x) {
            Value::Int(n) if (min..=max).contains(&n) => Ok(n),
            _ => {
                let problem = format!(
                    "argument {} ({what}) is {x}: expected an integer between {min} and {max}",
                    i + 1
                );
                Err(self.error(problem, None))
            }
        }
    }

    /// Returns argument `i` as a function.
    ///
    /// # Errors
    /// Returns an error if it is not a function.
    pub fn function(&self, i: usize, what: &str) -> Result<mlua::Function, ScriptError> {
        match self.get(i) {
            LuaValue::Function(f) => Ok(f),
            _ => Err(self.wrong(i, what, "a function")),
        }
    }

    /// Returns argument `i` as a table.
    ///
    /// # Errors
    /// Returns an error if it is not a table.
    pub fn table(&self, i: usize, what: &str) -> Result<mlua::Table, ScriptError> {
        match self.get(i) {
            LuaValue::Table(t) => Ok(t),
            _ => Err(self.wrong(i, what, "a table")),
        }
    }

    /// Returns argument `i`, a table, checked against its schema; `path` names it in errors.
    ///
    /// # Errors
    /// Returns an error if it is not a table or the schema rejects it.
    pub fn fields(
        &self,
        i: usize,
        what: &str,
        schema: &Table,
        path: &str,
    ) -> Result<Fields, ScriptError> {
        let table = self.table(i, what)?;
        strict::fields(&table, schema, path, false).map_err(|e| self.locate_error(e))
    }

    /// Returns the last argument `i`, an optional table of options, checked against its schema;
    /// `path` names it in errors, and `example` is a table as it is written in scripts.
    ///
    /// # Errors
    /// Returns an error if it is neither nil nor a table, or the schema rejects it.
    pub fn options(
        &self,
        i: usize,
        schema: &Table,
        path: &str,
        example: &str,
    ) -> Result<Fields, ScriptError> {
        match self.get(i) {
            LuaValue::Nil => Ok(Fields::default()),
            LuaValue::Table(_) => self.fields(i, "options", schema, path),
            _ => Err(self.wrong(i, "options", &format!("a table such as {example}"))),
        }
    }

    /// Creates the Lua object of a value.
    ///
    /// # Errors
    /// Returns an error if the memory limit is exceeded.
    pub fn object(&self, value: impl UserData + 'static) -> Result<LuaValue, ScriptError> {
        let object = self.lua.create_userdata(value);
        let object = object.map_err(|e| self.shared.convert(&e))?;
        Ok(LuaValue::UserData(object))
    }

    /// Returns argument `i` as a list of plain data; `path` names it in errors.
    ///
    /// # Errors
    /// Returns an error if it is not a list of plain data.
    pub fn list(&self, i: usize, what: &str, path: &str) -> Result<Vec<Value>, ScriptError> {
        let table = LuaValue::Table(self.table(i, what)?);
        match strict::read(&table, path, "").map_err(|e| self.locate_error(e))? {
            Value::List(items) => Ok(items),
            other => Err(self.error(
                format!(
                    "argument {} ({what}) is {}: expected a list",
                    i + 1,
                    other.kind()
                ),
                None,
            )),
        }
    }
}

/// Creates the Lua function of a table row.
pub fn bind(lua: &Lua, shared: &Rc<Shared>, row: &'static ApiFn) -> mlua::Result<mlua::Function> {
    let shared = Rc::clone(shared);
    lua.create_function(move |lua, values: MultiValue| {
        let args = Args {
            shared: Rc::clone(&shared),
            lua: lua.clone(),
            name: row.name,
            values: values.into_iter().collect(),
            place: shared.call_site(lua),
        };
        row.call(&args)
    })
}

/// Creates the Lua object of an experiment or a scene: a table of methods in which reading any
/// other name is an error. `receiver` is the variable in the names of the rows, `x` or `s`.
///
/// # Errors
/// Returns an error if the memory limit is exceeded.
pub fn method_object(
    lua: &Lua,
    shared: &Rc<Shared>,
    rows: impl IntoIterator<Item = &'static ApiFn>,
    receiver: &'static str,
) -> mlua::Result<mlua::Table> {
    let object = lua.create_table()?;
    let identity = object.to_pointer() as usize;
    for row in rows {
        let name = row.name.split_once(':').map_or(row.name, |(_, name)| name);
        let shared = Rc::clone(shared);
        let method = lua.create_function(move |lua, values: MultiValue| {
            let mut values: Vec<LuaValue> = values.into_iter().collect();
            let place = shared.call_site(lua);
            let is_self = matches!(values.first(), Some(LuaValue::Table(t)) if t.to_pointer() as usize == identity);
            if is_self {
                values.remove(0);
            }
            let (shared, lua) = (Rc::clone(&shared), lua.clone());
            let args = Args { shared, lua, name: row.name, values, place };
            if !is_self {
                let help = format!("write `{}(..)` with a colon", row.name);
                return Err(mlua::Error::external(args.error(
                    format!("called without its `{receiver}`"),
                    Some(help),
                )));
            }
            if !args.shared.loading.get() {
                let help = format!("call methods of `{receiver}` only while the script is loaded");
                let problem = "the experiment is already complete: its plan is being made";
                return Err(mlua::Error::external(args.error(problem, Some(help))));
            }
            row.call(&args)
        })?;
        object.raw_set(name, method)?;
    }
    make_strict(lua, shared, &object, receiver, &[])?;
    Ok(object)
}
