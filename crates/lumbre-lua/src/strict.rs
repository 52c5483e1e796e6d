//! Strict conversion of Lua values to plain data.
//!
//! Values without a plain form are errors with their path: functions and other objects where data
//! is expected, NaN, text that is not UTF-8, keys that are neither names nor list indices, lists
//! with holes, tables that are a list and a record at once, tables that contain themselves.
//! Metatables are ignored: only the entries of a table count.

use std::collections::BTreeMap;
use std::ffi::c_void;

use mlua::Value as Lua;

use super::kind::kind;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Table, Ty, unknown_key};

/// Largest number of values in one conversion; a table that occurs twice counts twice.
const MAX_VALUES: usize = 500_000;

/// Largest number of bytes of text in one conversion.
const MAX_TEXT: usize = 16 << 20;

/// Deepest nesting of tables.
const MAX_DEPTH: usize = 24;

/// Table that was checked against a schema; fields of type [`Ty::Object`] remain Lua values.
#[derive(Debug, Default)]
pub struct Fields {
    /// Plain fields, checked against the schema.
    pub values: BTreeMap<String, Value>,
    /// Fields whose schema type is an object.
    pub objects: BTreeMap<String, Lua>,
    /// Fields that are not in the schema, if they are allowed; ordered by name.
    pub extra: Vec<(String, Lua)>,
}

impl Fields {
    /// Returns a number; `None` if it is not given.
    pub fn f64(&self, key: &str) -> Option<f64> {
        self.values.get(key).and_then(Value::as_f64)
    }

    /// Returns a number in single precision; `None` if it is not given.
    pub fn f32(&self, key: &str) -> Option<f32> {
        self.f64(key).map(|x| x as f32)
    }

    /// Returns an integer; `None` if it is not given.
    pub fn i64(&self, key: &str) -> Option<i64> {
        self.values.get(key).and_then(Value::as_i64)
    }

    /// Returns a text; `None` if it is not given.
    pub fn text(&self, key: &str) -> Option<&str> {
        self.values.get(key).and_then(Value::as_str)
    }

    /// Returns whether a field is `true`.
    pub fn is_true(&self, key: &str) -> bool {
        self.values.get(key) == Some(&Value::Bool(true))
    }

    /// Returns a list of numbers; `None` if it is not given.
    pub fn numbers<const N: usize>(&self, key: &str) -> Option<[f32; N]> {
        self.values.get(key).map(numbers)
    }
}

/// Returns the numbers of a list that was checked against its schema.
pub fn numbers<const N: usize>(value: &Value) -> [f32; N] {
    let items = value.as_list().unwrap_or_default();
    std::array::from_fn(|i| items.get(i).and_then(Value::as_f64).unwrap_or_default() as f32)
}

/// State of one conversion.
#[derive(Default)]
struct Reader {
    /// Number of values so far.
    values: usize,
    /// Bytes of text so far.
    text: usize,
    /// Addresses of the tables that enclose the current value.
    inside: Vec<*const c_void>,
}

/// Converts one value. `key` is the last name on `path`, for finding its line.
///
/// # Errors
/// Returns an error for a value that is not plain data, as listed in the module documentation.
pub fn read(value: &Lua, path: &str, key: &str) -> Result<Value, SchemaError> {
    Reader::default().value(value, path, key)
}

/// Returns the entries of a table whose keys are all names, ordered by name.
///
/// # Errors
/// Returns an error for a key that is not a name.
pub fn entries(table: &mlua::Table, path: &str) -> Result<Vec<(String, Lua)>, SchemaError> {
    let key = path.rsplit('.').next().unwrap_or(path);
    match Reader::default().entries(table, path, key)? {
        TableEntries::List(items) if items.is_empty() => Ok(Vec::new()),
        TableEntries::List(_) => Err(SchemaError::new(
            path,
            key,
            "expected a table of named fields, found a list",
        )),
        TableEntries::Record(fields) => Ok(fields),
    }
}

/// Converts a table and checks it against its schema. Keys that are not in the schema are errors
/// unless `extra`.
///
/// # Errors
/// Returns an error for a value that is not plain data or that the schema rejects.
pub fn fields(
    table: &mlua::Table,
    schema: &Table,
    path: &str,
    extra: bool,
) -> Result<Fields, SchemaError> {
    let mut out = Fields::default();
    let mut check = BTreeMap::new();
    for (key, value) in entries(table, path)? {
        match schema.fields.iter().find(|f| f.key == key) {
            Some(field) if matches!(field.ty, Ty::Object(_)) => {
                check.insert(key.clone(), Value::Nil);
                out.objects.insert(key, value);
            }
            Some(_) => {
                let value = read(&value, &format!("{path}.{key}"), &key)?;
                check.insert(key.clone(), value.clone());
                out.values.insert(key, value);
            }
            None if extra => out.extra.push((key, value)),
            None => {
                return Err(unknown_key(
                    &format!("{path}.{key}"),
                    &key,
                    schema.fields.iter().map(|f| f.key),
                ));
            }
        }
    }
    schema.check(path, &check)?;
    Ok(out)
}

/// Entries of a Lua table, which is a list or a record but never both.
enum TableEntries {
    List(Vec<Lua>),
    Record(Vec<(String, Lua)>),
}

impl Reader {
    fn value(&mut self, value: &Lua, path: &str, key: &str) -> Result<Value, SchemaError> {
        match value {
            Lua::Nil => Ok(Value::Nil),
            Lua::Boolean(b) => Ok(Value::Bool(*b)),
            Lua::Integer(i) => Ok(Value::Int(*i)),
            Lua::Number(x) if x.is_nan() => Err(SchemaError::new(
                path,
                key,
                "the number is NaN (0/0, or the square root of a negative number)",
            )),
            Lua::Number(x) => Ok(Value::number(*x)),
            Lua::String(s) => self.text(s, path, key).map(Value::Str),
            Lua::Table(t) => self.table(t, path, key),
            other => Err(SchemaError::new(
                path,
                key,
                format!("expected plain data, found {}", kind(other)),
            )),
        }
    }

    fn text(
        &mut self,
        text: &mlua::LuaString,
        path: &str,
        key: &str,
    ) -> Result<String, SchemaError> {
        let bytes = text.as_bytes();
        self.text += bytes.len();
        if self.text > MAX_TEXT {
            return Err(SchemaError::new(
                path,
                key,
                format!("more than {} MiB of text in one table", MAX_TEXT >> 20),
            ));
        }
        match std::str::from_utf8(&bytes) {
            Ok(s) => Ok(s.to_owned()),
            Err(e) => Err(SchemaError::new(
                path,
                key,
                format!("the text is not UTF-8 (byte {})", e.valid_up_to() + 1),
            )),
        }
    }

    fn table(&mut self, table: &mlua::Table, path: &str, key: &str) -> Result<Value, SchemaError> {
        let identity = table.to_pointer();
        if self.inside.contains(&identity) {
            return Err(SchemaError::new(path, key, "the table contains itself"));
        }
        if self.inside.len() >= MAX_DEPTH {
            return Err(SchemaError::new(
                path,
                key,
                format!("tables are nested more than {MAX_DEPTH} deep"),
            ));
        }
        self.inside.push(identity);
        let value = match self.entries(table, path, key)? {
            TableEntries::List(items) => {
                let item =
                    |(i, v): (usize, &Lua)| self.value(v, &format!("{path}[{}]", i + 1), key);
                Value::List(
                    items
                        .iter()
                        .enumerate()
                        .map(item)
                        .collect::<Result<_, _>>()?,
                )
            }
            TableEntries::Record(fields) => {
                let mut map = BTreeMap::new();
                for (name, value) in fields {
                    let value = self.value(&value, &format!("{path}.{name}"), &name)?;
                    map.insert(name, value);
                }
                Value::Map(map)
            }
        };
        self.inside.pop();
        Ok(value)
    }

    /// Returns the entries of a table and checks that its keys make it a list or a record.
    fn entries(
        &mut self,
        table: &mlua::Table,
        path: &str,
        key: &str,
    ) -> Result<TableEntries, SchemaError> {
        let mut items: BTreeMap<i64, Lua> = BTreeMap::new();
        let mut names: BTreeMap<String, Lua> = BTreeMap::new();
        for pair in table.pairs::<Lua, Lua>() {
            let (k, v) = pair.map_err(|e| SchemaError::new(path, key, e.to_string()))?;
            match k {
                Lua::Integer(i) => {
                    items.insert(i, v);
                }
                Lua::String(s) => {
                    names.insert(self.text(&s, path, key)?, v);
                }
                other => {
                    return Err(SchemaError::new(
                        path,
                        key,
                        format!("keys are names, found {} as a key", kind(&other)),
                    ));
                }
            }
            self.values += 1;
            if self.values > MAX_VALUES {
                return Err(SchemaError::new(
                    path,
                    key,
                    format!("more than {MAX_VALUES} values in one table"),
                ));
            }
        }
        if !items.is_empty() && !names.is_empty() {
            let name = names.keys().next().cloned().unwrap_or_default();
            return Err(SchemaError::new(
                path,
                key,
                format!(
                    "the table is a list and has the named field `{name}` as well; it must be one \
                     or the other"
                ),
            ));
        }
        if items.is_empty() && !names.is_empty() {
            return Ok(TableEntries::Record(names.into_iter().collect()));
        }
        if let Some(hole) = find_hole(items.keys()) {
            return Err(SchemaError::new(path, key, hole));
        }
        Ok(TableEntries::List(items.into_values().collect()))
    }
}

/// Describes the first index that makes a table not a list, if there is one.
fn find_hole<'a>(indices: impl Iterator<Item = &'a i64>) -> Option<String> {
    let (expected, found) = (1i64..).zip(indices).find(|(i, found)| i != *found)?;
    Some(if *found < 1 {
        format!("lists start at 1, found a value at [{found}]")
    } else {
        format!("the list has nothing at [{expected}], but a value at [{found}]")
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn eval(code: &str) -> (mlua::Lua, Lua) {
        let lua = mlua::Lua::new();
        let value: Lua = lua.load(code).eval().unwrap();
        (lua, value)
    }

    fn fails(code: &str) -> SchemaError {
        let (_lua, value) = eval(code);
        read(&value, "a", "a").unwrap_err()
    }

    #[test]
    fn plain_data_keeps_its_shape_and_numbers_are_normal() {
        let (_lua, value) = eval(
            "return { n = 3.0, x = 0.1, list = { 1, 'two', true }, empty = {}, m = { k = -0.0 } }",
        );
        let json = serde_json::to_string(&read(&value, "", "").unwrap()).unwrap();
        assert_eq!(
            json,
            r#"{"empty":[],"list":[1,"two",true],"m":{"k":0},"n":3,"x":0.1}"#
        );
    }

    #[test]
    fn values_that_are_not_data_are_errors_with_their_path() {
        for (code, path, words) in [
            ("return { b = { c = print } }", "a.b.c", "found a function"),
            ("return { b = { 1, 0/0 } }", "a.b[2]", "NaN"),
            (
                "return { 1, 2, k = 3 }",
                "a",
                "list and has the named field `k`",
            ),
            ("return { 1, nil, 3 }", "a", "nothing at [2]"),
            ("return { [0] = 1 }", "a", "start at 1"),
            ("return { [true] = 1 }", "a", "found a boolean as a key"),
            ("return { [1.5] = 1 }", "a", "found a number as a key"),
            ("return { s = '\\xff' }", "a.s", "not UTF-8"),
            (
                "local t = { u = {} }; t.u.t = t; return t",
                "a.u.t",
                "contains itself",
            ),
            (
                "local t = 1; for i = 1, 30 do t = { t } end; return t",
                "",
                "more than 24 deep",
            ),
            (
                "local t = {}; for i = 1, 22 do t = { t, t } end; return t",
                "",
                "more than 500000 values",
            ),
        ] {
            let e = fails(code);
            assert!(e.problem.contains(words), "{code}: {e}");
            assert!(path.is_empty() || e.path == path, "{code}: {}", e.path);
        }
        let e = fails(
            "local s = string.rep('x', 1 << 20); local t = {}; for i = 1, 40 do t[i] = s end; \
             return t",
        );
        assert!(e.problem.contains("16 MiB"), "{e}");
    }

    #[test]
    fn schemas_split_data_from_objects() {
        lumbre_light::table! {
            const SCHEMA = "T", "";
            from: Ty::Object("fun()"), "a function";
            n = "": Ty::int(1, 9), "";
        }
        let table = |code: &str| match eval(code) {
            (lua, Lua::Table(t)) => (lua, t),
            _ => unreachable!("the code returns a table"),
        };
        let (_lua, t) = table("return { from = print, n = 2, rmse = 1 }");
        let f = fields(&t, &SCHEMA, "t", true).unwrap();
        assert_eq!((f.values.len(), f.objects.len(), f.extra.len()), (1, 1, 1));
        let e = fields(&t, &SCHEMA, "t", false).unwrap_err();
        assert_eq!(e.path, "t.rmse");
        let (_lua, t) = table("return { n = 2 }");
        assert!(
            fields(&t, &SCHEMA, "t", false)
                .unwrap_err()
                .problem
                .contains("`from` is missing")
        );
        let (_lua, t) = table("return { from = print, n = 20 }");
        assert_eq!(fields(&t, &SCHEMA, "t", false).unwrap_err().path, "t.n");
    }
}
