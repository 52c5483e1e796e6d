//! The script's functions, called while the plan is made and between waves.

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Function, Lua, Value as LuaValue};

use super::api::builder::{Reference, Stop};
use super::api::stop::rule_of;
use super::api::{experiment, kind, render};
use super::error::ScriptError;
use super::source::Place;
use super::state::{Shared, missing_name};
use super::{Script, strict};
use crate::experiment::spec::{AgreeRequest, HookError, Point, ReferenceRequest, ScriptHooks};
use crate::experiment::{CellConfig, StopRule, WaveRow};
use crate::transport::integrator::{INTEGRATORS, integrator};
use crate::value::Value;
use crate::value::schema::{SchemaError, unknown_name};

/// Makes reading an axis that does not exist, and changing a point, an error.
///
/// # Errors
/// When there is no memory.
pub fn point_metatable(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<mlua::Table> {
    let names: Vec<String> = shared.builder.borrow().axis_names().into_iter().map(str::to_owned).collect();
    let meta = lua.create_table()?;
    let reader = Rc::clone(shared);
    meta.raw_set(
        "__index",
        lua.create_function(move |lua, (_, key): (LuaValue, LuaValue)| -> mlua::Result<()> {
            Err(missing_name(&reader, lua, "p", &key, &names, "axis"))
        })?,
    )?;
    let writer = Rc::clone(shared);
    meta.raw_set(
        "__newindex",
        lua.create_function(move |lua, (_, _, _): (LuaValue, LuaValue, LuaValue)| -> mlua::Result<()> {
            let place = writer.here(lua);
            let problem = "a point of the sweep cannot be changed";
            Err(mlua::Error::external(writer.sources.borrow().field(&place, "p", problem, None)))
        })?,
    )?;
    meta.raw_set("__metatable", false)?;
    Ok(meta)
}

impl Script {
    fn call(&self, what: &'static str, function: &Function, point: &Point) -> Result<LuaValue, ScriptError> {
        self.shared.run(what, self.shared.limits.hook_s, || {
            let table = self.lua.create_table()?;
            for (name, value) in point {
                table.raw_set(name.as_str(), to_lua(&self.lua, value)?)?;
            }
            table.set_metatable(Some(self.points.clone()))?;
            function.call(table)
        })
    }

    /// The render table of a point, and where its function stands.
    fn render_table(&self, point: &Point) -> Result<(BTreeMap<String, Value>, Place), ScriptError> {
        let function = self.shared.builder.borrow().render.as_ref().map(|(f, _)| f.clone());
        let Some(function) = function else { return Err(self.gone("x:render")) };
        let place = self.shared.function_place(&function);
        let returned = self.call("the render function", &function, point)?;
        Ok((self.table_of(&returned, "render", &place)?, place))
    }

    /// The named fields of a table that a function returned.
    fn table_of(&self, value: &LuaValue, path: &str, place: &Place) -> Result<BTreeMap<String, Value>, ScriptError> {
        let read = || match value {
            LuaValue::Table(_) => strict::read(value, path, ""),
            other => Err(SchemaError {
                path: path.to_owned(),
                problem: format!("the function returned {}: expected a table", kind(other)),
                help: None,
                key: String::new(),
            }),
        };
        match read() {
            Ok(Value::Map(map)) => Ok(map),
            Ok(Value::List(items)) if items.is_empty() => Ok(BTreeMap::new()),
            Ok(other) => {
                let problem = format!("the function returned {}: expected named fields", other.kind());
                Err(self.shared.sources.borrow().field(place, path, problem, None))
            }
            Err(e) => Err(self.blame(place, e)),
        }
    }

    fn blame(&self, place: &Place, error: SchemaError) -> ScriptError {
        self.shared.sources.borrow().blame(place, error)
    }

    /// What loading has made sure of is not there.
    fn gone(&self, what: &str) -> ScriptError {
        let place = Place { source: 0, line: 1, last: None };
        self.shared.sources.borrow().field(&place, what, "was never said", None)
    }

    /// What a function that answers a question said: true, or false for false and nil.
    fn answer(&self, value: &LuaValue, path: &str, function: &Function) -> Result<bool, ScriptError> {
        match value {
            LuaValue::Boolean(b) => Ok(*b),
            LuaValue::Nil => Ok(false),
            other => {
                let place = self.shared.function_place(function);
                let problem = format!("the function returned {}: expected true, false or nothing", kind(other));
                Err(self.shared.sources.borrow().field(&place, path, problem, None))
            }
        }
    }

    fn find_image(&self, file: &str, source: String, place: &Place) -> Result<ReferenceRequest, ScriptError> {
        render::find_file(file, &self.shared.folder, "reference.image", "image")
            .map(|file| ReferenceRequest::File { file, source })
            .map_err(|e| self.blame(place, e))
    }

    fn reference_of(&self, point: &Point) -> Result<Option<ReferenceRequest>, ScriptError> {
        let said = self.shared.builder.borrow().reference.clone();
        match said {
            None => Ok(None),
            Some(Reference::Image { file, source, place }) => self.find_image(&file, source, &place).map(Some),
            Some(Reference::ImageOf { file, source }) => {
                let place = self.shared.function_place(&file);
                match self.call("the reference's image function", &file, point)? {
                    LuaValue::String(s) => self.find_image(&s.to_string_lossy(), source, &place).map(Some),
                    other => {
                        let problem = format!("the function returned {}: expected a file", kind(&other));
                        Err(self.shared.sources.borrow().field(&place, "reference.image", problem, None))
                    }
                }
            }
            Some(Reference::Render { from, stop, agree, parts, place }) => {
                let config = self.reference_config(from.as_ref(), point)?;
                let stop = self.rule(&stop, &place, point, true)?;
                let agree = match agree {
                    None => None,
                    Some(agree) if integrator(&agree.with).is_none() => {
                        let known = INTEGRATORS.iter().map(|row| row.name);
                        let mut error = unknown_name("reference.agree.with", &agree.with, "integrator", known);
                        error.key = "with".to_owned();
                        return Err(self.blame(&place, error));
                    }
                    Some(agree) => Some(Box::new(AgreeRequest {
                        config: CellConfig {
                            integrator: agree.with,
                            params: BTreeMap::new(),
                            films: Vec::new(),
                            timing: None,
                            ..config.clone()
                        },
                        stop: agree.stop.unwrap_or_else(|| stop.clone()),
                        rate: agree.rate,
                    })),
                };
                Ok(Some(ReferenceRequest::Render { config: Box::new(config), stop, agree, parts }))
            }
        }
    }

    fn reference_config(&self, from: Option<&Function>, point: &Point) -> Result<CellConfig, ScriptError> {
        const PATH: &str = "reference.from";
        let (own, own_place) = self.render_table(point)?;
        let Some(from) = from else {
            let own = render::merge(&own, &BTreeMap::new());
            return render::cell(&own, &self.shared.folder, "render").map_err(|e| self.blame(&own_place, e));
        };
        let place = self.shared.function_place(from);
        let overrides = self.table_of(&self.call("the reference's from function", from, point)?, PATH, &place)?;
        let merged = render::merge(&own, &overrides);
        render::cell(&merged, &self.shared.folder, PATH).map_err(|e| {
            // A field that the overrides do not say is the render function's.
            let field = e.path.strip_prefix(PATH).and_then(|p| p.strip_prefix('.')).and_then(|p| p.split('.').next());
            let theirs = field.is_none_or(|f| overrides.contains_key(f) || overrides.contains_key(&e.key));
            self.blame(if theirs { &place } else { &own_place }, e)
        })
    }

    fn stop_of(&self, point: &Point) -> Result<StopRule, ScriptError> {
        let Some((stop, place)) = self.shared.builder.borrow().stop.clone() else { return Err(self.gone("x:stop")) };
        self.rule(&stop, &place, point, false)
    }

    /// The rule of a cell or of its reference as plain data, from the function that makes it if it is one; `place` is
    /// where it was handed over.
    fn rule(&self, stop: &Stop, place: &Place, point: &Point, reference: bool) -> Result<StopRule, ScriptError> {
        let function = match stop {
            Stop::Rule(rule) => return rule.lower(&self.shared, place),
            Stop::Function(function) => function,
        };
        let place = self.shared.function_place(function);
        let returned = self.call("the stop function", function, point)?;
        let Some(rule) = rule_of(&returned) else {
            let problem = format!("the function returned {}: expected a stop rule", kind(&returned));
            let path = if reference { "reference.stop" } else { "stop" };
            return Err(self.shared.sources.borrow().field(&place, path, problem, None));
        };
        // Borrowed only now: the function may have tried to say more.
        let builder = self.shared.builder.borrow();
        let columns = builder.columns();
        let cells = experiment::cell_rules(&builder, &columns);
        rule.check(&self.shared, &if reference { experiment::reference_rules(&columns) } else { cells })?;
        rule.lower(&self.shared, &place)
    }

    fn ask(&self, id: usize, columns: &[String], rows: &[WaveRow]) -> Result<bool, ScriptError> {
        let Some(function) = self.shared.predicates.borrow().get(id) else { return Err(self.gone("stop.predicate")) };
        let answer = self.shared.run("a stop predicate", self.shared.limits.hook_s, || {
            self.lua.scope(|scope| {
                let meta = self.lua.create_table()?;
                let known: Vec<String> = rows.last().map(|r| row_fields(columns, r)).unwrap_or_default();
                let reader = Rc::clone(&self.shared);
                meta.raw_set(
                    "__index",
                    self.lua.create_function(move |lua, (_, key): (LuaValue, LuaValue)| -> mlua::Result<()> {
                        Err(missing_name(&reader, lua, "row", &key, &known, "column"))
                    })?,
                )?;
                meta.raw_set("__metatable", false)?;
                // Rows become tables only when they are looked at: a night has tens of thousands.
                let history = self.lua.create_table()?;
                let history_meta = self.lua.create_table()?;
                let (length, row_meta) = (rows.len(), meta.clone());
                let lookup = scope.create_function(move |lua, (table, key): (mlua::Table, LuaValue)| {
                    let index = key.as_integer().and_then(|i| usize::try_from(i).ok()).unwrap_or(0);
                    match index.checked_sub(1).and_then(|i| rows.get(i)) {
                        Some(row) => {
                            let row = row_table(lua, columns, row, &row_meta)?;
                            table.raw_set(index, &row)?;
                            Ok(LuaValue::Table(row))
                        }
                        None => Ok(LuaValue::Nil),
                    }
                })?;
                history_meta.raw_set("__index", lookup)?;
                history_meta.raw_set("__len", self.lua.create_function(move |_, ()| Ok(length))?)?;
                history_meta.raw_set("__metatable", false)?;
                history.set_metatable(Some(history_meta))?;
                let newest = history.get::<LuaValue>(length)?;
                function.call::<LuaValue>((newest, history))
            })
        })?;
        self.answer(&answer, "stop.predicate", &function)
    }
}

/// A plain value as Lua has it.
pub(super) fn to_lua(lua: &Lua, value: &Value) -> mlua::Result<LuaValue> {
    Ok(match value {
        Value::Nil => LuaValue::Nil,
        Value::Bool(b) => LuaValue::Boolean(*b),
        Value::Int(i) => LuaValue::Integer(*i),
        Value::Num(x) => LuaValue::Number(*x),
        Value::Str(s) => LuaValue::String(lua.create_string(s)?),
        Value::List(items) => {
            let items = items.iter().map(|v| to_lua(lua, v)).collect::<mlua::Result<Vec<_>>>()?;
            LuaValue::Table(lua.create_sequence_from(items)?)
        }
        Value::Map(map) => {
            let table = lua.create_table()?;
            for (key, value) in map {
                table.raw_set(key.as_str(), to_lua(lua, value)?)?;
            }
            LuaValue::Table(table)
        }
    })
}

/// The numbers of a measurement that every predicate can read.
fn row_numbers(row: &WaveRow) -> [(&'static str, f64); 8] {
    [
        ("wave", row.wave as f64),
        ("samples", row.samples as f64),
        ("render_s", row.render_s),
        ("wall_s", row.wall_s),
        ("measure_s", row.measure_s),
        ("paths", row.paths as f64),
        ("rays", row.rays as f64),
        ("invalid", row.invalid as f64),
    ]
}

fn row_fields(columns: &[String], row: &WaveRow) -> Vec<String> {
    let metrics = columns.iter().zip(&row.metrics).map(|(name, _)| name.clone());
    row_numbers(row).iter().map(|(name, _)| (*name).to_owned()).chain(metrics).collect()
}

fn row_table(lua: &Lua, columns: &[String], row: &WaveRow, meta: &mlua::Table) -> mlua::Result<mlua::Table> {
    let table = lua.create_table()?;
    for (name, value) in row_numbers(row) {
        table.raw_set(name, to_lua(lua, &Value::number(value))?)?;
    }
    for (name, value) in columns.iter().zip(&row.metrics) {
        table.raw_set(name.as_str(), *value)?;
    }
    table.set_metatable(Some(meta.clone()))?;
    Ok(table)
}

fn hook<T>(result: Result<T, ScriptError>) -> Result<T, HookError> {
    result.map_err(|e| HookError(Box::new(e)))
}

impl ScriptHooks for Script {
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError> {
        let function = self.shared.builder.borrow().skips.get(rule).map(|(_, f)| f.clone());
        hook(function.ok_or_else(|| self.gone("x:skip")).and_then(|function| {
            let answer = self.call("a skip function", &function, point)?;
            self.answer(&answer, "skip", &function)
        }))
    }

    fn render(&self, point: &Point) -> Result<CellConfig, HookError> {
        hook(self.render_table(point).and_then(|(map, place)| {
            render::cell(&map, &self.shared.folder, "render").map_err(|e| self.blame(&place, e))
        }))
    }

    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError> {
        hook(self.reference_of(point))
    }

    fn stop(&self, point: &Point) -> Result<StopRule, HookError> {
        hook(self.stop_of(point))
    }

    fn control(&self, point: &Point) -> Result<Option<bool>, HookError> {
        let said = self.shared.builder.borrow().control.clone();
        let Some(Some(function)) = said else { return Ok(None) };
        hook(
            self.call("the control function", &function, point)
                .and_then(|answer| self.answer(&answer, "control", &function).map(Some)),
        )
    }

    fn predicate(&self, id: usize, columns: &[String], rows: &[WaveRow]) -> Result<bool, HookError> {
        hook(self.ask(id, columns, rows))
    }
}
