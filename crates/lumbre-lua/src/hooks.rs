//! Calls of the script's functions while the plan is made and between waves: the implementation of
//! [`ScriptHooks`].

use std::collections::BTreeMap;
use std::rc::Rc;

use mlua::{Function, Lua, Value as LuaValue};

use super::api::builder::{Reference, RenderedReference, Stop};
use super::api::render;
use super::api::stop_rule::{cell_rules, reference_rules, rule_from_value};
use super::error::ScriptError;
use super::kind::kind;
use super::source::SourcePlace;
use super::state::{Shared, missing_name};
use super::{Script, strict};
use lumbre_light::transport::integrator::{UNBIASED_REFERENCE, bias_of};
use lumbre_light::value::Value;
use lumbre_light::value::schema::SchemaError;
use lumbre_night::experiment::hook_error::HookError;
use lumbre_night::experiment::spec::{BiasCheckRequest, Point, ReferenceRequest, ScriptHooks};
use lumbre_night::experiment::{StopRule, WaveRow};
use lumbre_render::Settings;
use lumbre_render::settings::find::find_file;
use lumbre_render::settings::named;

/// Creates the metatable of points. Reading an axis that does not exist, and changing a point, are
/// errors.
///
/// # Errors
/// Returns an error if the memory limit is exceeded.
pub fn point_metatable(lua: &Lua, shared: &Rc<Shared>) -> mlua::Result<mlua::Table> {
    let names: Vec<String> = shared
        .builder
        .borrow()
        .axis_names()
        .into_iter()
        .map(str::to_owned)
        .collect();
    let meta = lua.create_table()?;
    let reader = Rc::clone(shared);
    meta.raw_set(
        "__index",
        lua.create_function(
            move |lua, (_, key): (LuaValue, LuaValue)| -> mlua::Result<()> {
                Err(missing_name(&reader, lua, "p", &key, &names, "axis"))
            },
        )?,
    )?;
    let writer = Rc::clone(shared);
    meta.raw_set(
        "__newindex",
        lua.create_function(
            move |lua, (_, _, _): (LuaValue, LuaValue, LuaValue)| -> mlua::Result<()> {
                let place = writer.call_site(lua);
                let problem = "a point of the sweep cannot be changed";
                Err(mlua::Error::external(
                    writer.sources.borrow().field(&place, "p", problem, None),
                ))
            },
        )?,
    )?;
    meta.raw_set("__metatable", false)?;
    Ok(meta)
}

impl Script {
    /// Calls a function of the script with a point; `what` names the function in errors.
    fn call(
        &self,
        what: &'static str,
        function: &Function,
        point: &Point,
    ) -> Result<LuaValue, ScriptError> {
        self.shared.run(what, self.shared.limits.hook_s, || {
            let table = self.lua.create_table()?;
            for (name, value) in point {
                table.raw_set(name.as_str(), to_lua(&self.lua, value)?)?;
            }
            table.set_metatable(Some(self.points.clone()))?;
            function.call(table)
        })
    }

    /// Returns the render table of a point, with those settings of the command line that `is_for` it,
    /// and the position of the render function.
    fn render_table(
        &self,
        point: &Point,
        is_for: impl Fn(&str) -> bool,
    ) -> Result<(BTreeMap<String, Value>, SourcePlace), ScriptError> {
        let function = self
            .shared
            .builder
            .borrow()
            .render
            .as_ref()
            .map(|(f, _)| f.clone());
        let Some(function) = function else {
            return Err(self.missing_declaration("x:render"));
        };
        let place = self.shared.function_place(&function);
        let returned = self.call("the render function", &function, point)?;
        let mut table = self.returned_fields(&returned, "render", &place)?;
        self.override_settings(&mut table, point, is_for);
        Ok((table, place))
    }

    /// Writes those settings of the command line into a render table that `is_for` it.
    fn override_settings(
        &self,
        table: &mut BTreeMap<String, Value>,
        point: &Point,
        is_for: impl Fn(&str) -> bool,
    ) {
        let builder = self.shared.builder.borrow();
        let axes = builder.axis_names();
        for (name, value) in point {
            if !axes.contains(&name.as_str()) && is_for(name) {
                named::set(table, name, value.clone());
            }
        }
    }

    /// Converts the table that a function returned to its named fields.
    fn returned_fields(
        &self,
        value: &LuaValue,
        path: &str,
        place: &SourcePlace,
    ) -> Result<BTreeMap<String, Value>, ScriptError> {
        let read = || match value {
            LuaValue::Table(_) => strict::read(value, path, ""),
            other => Err(SchemaError::new(
                path,
                "",
                format!("the function returned {}: expected a table", kind(other)),
            )),
        };
        match read() {
            Ok(Value::Map(map)) => Ok(map),
            Ok(Value::List(items)) if items.is_empty() => Ok(BTreeMap::new()),
            Ok(other) => {
                let problem = format!(
                    "the function returned {}: expected named fields",
                    other.kind()
                );
                Err(self
                    .shared
                    .sources
                    .borrow()
                    .field(place, path, problem, None))
            }
            Err(e) => Err(self.locate_error(place, e)),
        }
    }

    fn locate_error(&self, place: &SourcePlace, error: SchemaError) -> ScriptError {
        self.shared.sources.borrow().locate_error(place, error)
    }

    /// Returns the error for a declaration that is missing. Loading checks the declarations, so
    /// this indicates a bug.
    fn missing_declaration(&self, what: &str) -> ScriptError {
        let place = SourcePlace {
            source: 0,
            line: 1,
            last: None,
        };
        self.shared
            .sources
            .borrow()
            .field(&place, what, "is not declared in the script", None)
    }

    /// Converts the result of a function that returns a boolean; nil counts as false.
    fn returned_bool(
        &self,
        value: &LuaValue,
        path: &str,
        function: &Function,
    ) -> Result<bool, ScriptError> {
        match value {
            LuaValue::Boolean(b) => Ok(*b),
            LuaValue::Nil => Ok(false),
            other => {
                let place = self.shared.function_place(function);
                let problem = format!(
                    "the function returned {}: expected true, false or nothing",
                    kind(other)
                );
                Err(self
                    .shared
                    .sources
                    .borrow()
                    .field(&place, path, problem, None))
            }
        }
    }

    /// Returns the request for a reference image at `file`.
    fn find_image(
        &self,
        file: &str,
        source: String,
        place: &SourcePlace,
    ) -> Result<ReferenceRequest, ScriptError> {
        find_file(file, &self.shared.folder, "reference.image", "image")
            .map(|file| ReferenceRequest::File { file, source })
            .map_err(|e| self.locate_error(place, e))
    }

    /// Returns the reference of a point, or `None` if the script has none.
    fn reference_request(&self, point: &Point) -> Result<Option<ReferenceRequest>, ScriptError> {
        let reference = self.shared.builder.borrow().reference.clone();
        match reference {
            None => Ok(None),
            Some(Reference::Image {
                file,
                source,
                place,
            }) => self.find_image(&file, source, &place).map(Some),
            Some(Reference::ImageFunction { file, source }) => {
                let place = self.shared.function_place(&file);
                match self.call("the reference's image function", &file, point)? {
                    LuaValue::String(s) => self
                        .find_image(&s.to_string_lossy(), source, &place)
                        .map(Some),
                    other => {
                        let problem =
                            format!("the function returned {}: expected a file", kind(&other));
                        Err(self.shared.sources.borrow().field(
                            &place,
                            "reference.image",
                            problem,
                            None,
                        ))
                    }
                }
            }
            Some(Reference::Render(render)) => self.render_request(&render, point).map(Some),
        }
    }

    /// Returns the request for a rendered reference of a point.
    fn render_request(
        &self,
        reference: &RenderedReference,
        point: &Point,
    ) -> Result<ReferenceRequest, ScriptError> {
        let place = &reference.place;
        let (table, config) = self.reference_config(reference.from.as_ref(), point)?;
        let stop = self.rule(&reference.stop, place, point, true)?;
        let bias_check = match &reference.bias_check {
            None => None,
            Some(check) => Some(Box::new(BiasCheckRequest {
                config: self.second_config(&table, &check.changes, place)?,
                stop: check.stop.clone().unwrap_or_else(|| stop.clone()),
                rate: check.rate,
            })),
        };
        Ok(ReferenceRequest::Render {
            config: Box::new(config),
            stop,
            bias_check,
            shards: reference.shards,
        })
    }

    /// Converts a render table to the settings of a cell. Error paths begin with `path`.
    fn settings(
        &self,
        table: &BTreeMap<String, Value>,
        path: &str,
    ) -> Result<Settings, SchemaError> {
        let externals = &self.shared.builder.borrow().externals;
        render::settings(table, &self.shared.folder, externals, path)
    }

    /// Returns the configuration of the second picture of a bias check: the reference's render
    /// table, without its integrator's own parameters, with the changes of `agree.with`.
    fn second_config(
        &self,
        reference: &BTreeMap<String, Value>,
        changes: &BTreeMap<String, Value>,
        place: &SourcePlace,
    ) -> Result<Settings, ScriptError> {
        const PATH: &str = "reference.agree.with";
        let mut common = reference.clone();
        common.retain(|key, _| render::is_setting(key));
        if let Some(Value::Str(name)) = changes.get("integrator") {
            let externals = &self.shared.builder.borrow().externals;
            render::check_integrator(name, externals, PATH).map_err(|mut error| {
                error.key = "with".to_owned();
                self.locate_error(place, error)
            })?;
        }
        self.settings(&render::merge(&common, changes), PATH)
            .map_err(|e| self.locate_error(place, e))
    }

    /// Returns the render table of a rendered reference, which is the cell's with the overrides of
    /// `from`, and its configuration.
    fn reference_config(
        &self,
        from: Option<&Function>,
        point: &Point,
    ) -> Result<(BTreeMap<String, Value>, Settings), ScriptError> {
        const PATH: &str = "reference.from";
        let (own, own_place) = self.render_table(point, named::is_inherited)?;
        let Some(from) = from else {
            let own = unbiased(render::merge(&own, &BTreeMap::new()));
            let config = self.settings(&own, "render");
            let config = config.map_err(|e| self.locate_error(&own_place, e))?;
            return Ok((own, config));
        };
        let place = self.shared.function_place(from);
        let overrides = self.returned_fields(
            &self.call("the reference's from function", from, point)?,
            PATH,
            &place,
        )?;
        let own = match overrides.contains_key("integrator") {
            true => own,
            false => unbiased(own),
        };
        let mut merged = render::merge(&own, &overrides);
        // Cell and reference show the same, whatever the script's function says.
        self.override_settings(&mut merged, point, named::is_inherited);
        let config = self.settings(&merged, PATH).map_err(|e| {
            // A field that is not in the overrides comes from the render function.
            let field = e
                .path
                .strip_prefix(PATH)
                .and_then(|p| p.strip_prefix('.'))
                .and_then(|p| p.split('.').next());
            let is_override =
                field.is_none_or(|f| overrides.contains_key(f) || overrides.contains_key(&e.key));
            self.locate_error(if is_override { &place } else { &own_place }, e)
        })?;
        Ok((merged, config))
    }

    /// Returns the stop rule of a cell.
    fn stop_rule(&self, point: &Point) -> Result<StopRule, ScriptError> {
        let Some((stop, place)) = self.shared.builder.borrow().stop.clone() else {
            return Err(self.missing_declaration("x:stop"));
        };
        self.rule(&stop, &place, point, false)
    }

    /// Converts the stop rule of a cell or of its reference to plain data. If `stop` is a function,
    /// it is called with the point. `place` is the position of the declaration.
    fn rule(
        &self,
        stop: &Stop,
        place: &SourcePlace,
        point: &Point,
        reference: bool,
    ) -> Result<StopRule, ScriptError> {
        let function = match stop {
            Stop::Rule(rule) => return rule.lower(&self.shared, place),
            Stop::Function(function) => function,
        };
        let place = self.shared.function_place(function);
        let returned = self.call("the stop function", function, point)?;
        let Some(rule) = rule_from_value(&returned) else {
            let problem = format!(
                "the function returned {}: expected a stop rule",
                kind(&returned)
            );
            let path = if reference { "reference.stop" } else { "stop" };
            return Err(self
                .shared
                .sources
                .borrow()
                .field(&place, path, problem, None));
        };
        // Borrowed only after the call, since the function may call methods of the experiment.
        let builder = self.shared.builder.borrow();
        let columns = builder.columns();
        let cells = cell_rules(&builder, &columns);
        rule.check(
            &self.shared,
            &if reference {
                reference_rules(&columns)
            } else {
                cells
            },
        )?;
        rule.lower(&self.shared, &place)
    }

    /// Calls the stop predicate `id` with the newest row and all rows so far.
    fn evaluate_predicate(
        &self,
        id: usize,
        columns: &[String],
        rows: &[WaveRow],
    ) -> Result<bool, ScriptError> {
        let Some(function) = self.shared.predicates.borrow().get(id) else {
            return Err(self.missing_declaration("stop.predicate"));
        };
        let answer = self
            .shared
            .run("a stop predicate", self.shared.limits.hook_s, || {
                self.lua.scope(|scope| {
                    let meta = self.lua.create_table()?;
                    let known: Vec<String> = rows
                        .last()
                        .map(|r| row_fields(columns, r))
                        .unwrap_or_default();
                    let reader = Rc::clone(&self.shared);
                    meta.raw_set(
                        "__index",
                        self.lua.create_function(
                            move |lua, (_, key): (LuaValue, LuaValue)| -> mlua::Result<()> {
                                Err(missing_name(&reader, lua, "row", &key, &known, "column"))
                            },
                        )?,
                    )?;
                    meta.raw_set("__metatable", false)?;
                    let history = self.history_table(scope, columns, rows, &meta)?;
                    let newest = history.get::<LuaValue>(rows.len())?;
                    function.call::<LuaValue>((newest, history))
                })
            })?;
        self.returned_bool(&answer, "stop.predicate", &function)
    }
}

impl Script {
    /// Creates the table of all rows that predicates receive. Rows become tables only when the
    /// script reads them, since a run can have tens of thousands.
    fn history_table<'scope, 'env>(
        &'env self,
        scope: &'scope mlua::Scope<'scope, 'env>,
        columns: &'env [String],
        rows: &'env [WaveRow],
        row_meta: &mlua::Table,
    ) -> mlua::Result<mlua::Table> {
        let history = self.lua.create_table()?;
        let meta = self.lua.create_table()?;
        let (length, row_meta) = (rows.len(), row_meta.clone());
        let lookup = scope.create_function(move |lua, (table, key): (mlua::Table, LuaValue)| {
            let index = key
                .as_integer()
                .and_then(|i| usize::try_from(i).ok())
                .unwrap_or(0);
            match index.checked_sub(1).and_then(|i| rows.get(i)) {
                Some(row) => {
                    let row = row_table(lua, columns, row, &row_meta)?;
                    table.raw_set(index, &row)?;
                    Ok(LuaValue::Table(row))
                }
                None => Ok(LuaValue::Nil),
            }
        })?;
        meta.raw_set("__index", lookup)?;
        meta.raw_set("__len", self.lua.create_function(move |_, ()| Ok(length))?)?;
        meta.raw_set("__metatable", false)?;
        history.set_metatable(Some(meta))?;
        Ok(history)
    }
}

/// Converts a plain value to a Lua value.
pub(super) fn to_lua(lua: &Lua, value: &Value) -> mlua::Result<LuaValue> {
    Ok(match value {
        Value::Nil => LuaValue::Nil,
        Value::Bool(b) => LuaValue::Boolean(*b),
        Value::Int(i) => LuaValue::Integer(*i),
        Value::Num(x) => LuaValue::Number(*x),
        Value::Str(s) => LuaValue::String(lua.create_string(s)?),
        Value::List(items) => {
            let items = items
                .iter()
                .map(|v| to_lua(lua, v))
                .collect::<mlua::Result<Vec<_>>>()?;
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

/// Returns the columns of a measurement that exist in every experiment.
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

/// Returns the names of all columns of a measurement, including metrics.
fn row_fields(columns: &[String], row: &WaveRow) -> Vec<String> {
    let metrics = columns
        .iter()
        .zip(&row.metrics)
        .map(|(name, _)| name.clone());
    row_numbers(row)
        .iter()
        .map(|(name, _)| (*name).to_owned())
        .chain(metrics)
        .collect()
}

/// Converts a measurement to the table that predicates receive.
fn row_table(
    lua: &Lua,
    columns: &[String],
    row: &WaveRow,
    meta: &mlua::Table,
) -> mlua::Result<mlua::Table> {
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

/// Converts a script error to the error type of [`ScriptHooks`].
fn hook_result<T>(result: Result<T, ScriptError>) -> Result<T, HookError> {
    result.map_err(|e| HookError(Box::new(e)))
}

impl ScriptHooks for Script {
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError> {
        let function = self
            .shared
            .builder
            .borrow()
            .skips
            .get(rule)
            .map(|(_, f)| f.clone());
        hook_result(
            function
                .ok_or_else(|| self.missing_declaration("x:skip"))
                .and_then(|function| {
                    let answer = self.call("a skip function", &function, point)?;
                    self.returned_bool(&answer, "skip", &function)
                }),
        )
    }

    fn render(&self, point: &Point) -> Result<Settings, HookError> {
        hook_result(self.render_table(point, |_| true).and_then(|(map, place)| {
            self.settings(&map, "render")
                .map_err(|e| self.locate_error(&place, e))
        }))
    }

    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError> {
        hook_result(self.reference_request(point))
    }

    fn stop(&self, point: &Point) -> Result<StopRule, HookError> {
        hook_result(self.stop_rule(point))
    }

    fn aa_check(&self, point: &Point) -> Result<Option<bool>, HookError> {
        let selection = self.shared.builder.borrow().aa_check.clone();
        let Some(Some(function)) = selection else {
            return Ok(None);
        };
        hook_result(
            self.call("the control function", &function, point)
                .and_then(|answer| self.returned_bool(&answer, "control", &function).map(Some)),
        )
    }

    fn predicate(
        &self,
        id: usize,
        columns: &[String],
        rows: &[WaveRow],
    ) -> Result<bool, HookError> {
        hook_result(self.evaluate_predicate(id, columns, rows))
    }
}

/// Replaces a biased integrator of a cell by an unbiased one, for a reference for which the script
/// names none, and removes its parameters: a biased technique must not judge itself.
fn unbiased(mut table: BTreeMap<String, Value>) -> BTreeMap<String, Value> {
    let name = table.get("integrator").and_then(Value::as_str);
    if name.and_then(bias_of).is_some() {
        table.retain(|key, _| render::is_setting(key));
        table.insert("integrator".to_owned(), UNBIASED_REFERENCE.into());
    }
    table
}
