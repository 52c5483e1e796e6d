//! Schemas of tables: the single source for validation, for editor annotations and for
//! documentation.

use std::collections::BTreeMap;
use std::fmt;

use super::{Value, suggest};

/// The type of a field, with its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Ty {
    /// The value `true` or `false`.
    Bool,
    /// An integer in `min..=max`.
    Int {
        /// Smallest allowed value.
        min: i64,
        /// Largest allowed value.
        max: i64,
    },
    /// A finite number in `min..=max`.
    Num {
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// A string with any content.
    Str,
    /// One of the given names.
    Word(&'static [&'static str]),
    /// One of the given names, or a name that the script declares; the script module checks it.
    WordOrDeclared(&'static [&'static str]),
    /// A duration: a number of seconds, or text such as `"500ms"`, `"30s"`, `"5min"`, `"8h"`.
    Duration,
    /// Exactly `len` finite numbers in `min..=max`.
    Nums {
        /// Number of items.
        len: usize,
        /// Smallest allowed value.
        min: f64,
        /// Largest allowed value.
        max: f64,
    },
    /// A list whose items have the given type.
    List(&'static Ty),
    /// One item of the given type, or a list of them.
    OneOrMany(&'static Ty),
    /// The name `auto`, or a value of the given type.
    OrAuto(&'static Ty),
    /// A nested table with its own schema.
    Table(&'static Table),
    /// A function or another script object that the script module validates; the text is its LuaLS
    /// type.
    Object(&'static str),
    /// Any value; the text is its LuaLS type.
    Any(&'static str),
}

impl Ty {
    /// Returns the type of integers in `min..=max`.
    pub const fn int(min: i64, max: i64) -> Ty {
        Ty::Int { min, max }
    }

    /// Returns the type of finite numbers in `min..=max`.
    pub const fn num(min: f64, max: f64) -> Ty {
        Ty::Num { min, max }
    }

    /// Returns the type of lists of `len` finite numbers in `min..=max`.
    pub const fn nums(len: usize, min: f64, max: f64) -> Ty {
        Ty::Nums { len, min, max }
    }
}

/// The name accepted by [`Ty::OrAuto`].
pub const AUTO: &str = "auto";

/// One field of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Key in the table.
    pub key: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Whether omitting the field is an error.
    pub required: bool,
    /// Default as text; empty if there is none.
    pub default: &'static str,
    /// One sentence for users: meaning, unit, source.
    pub doc: &'static str,
}

impl Field {
    /// Creates a required field.
    pub const fn required(key: &'static str, ty: Ty, doc: &'static str) -> Field {
        Field {
            key,
            ty,
            required: true,
            default: "",
            doc,
        }
    }

    /// Creates an optional field with its default as text.
    pub const fn optional(
        key: &'static str,
        ty: Ty,
        default: &'static str,
        doc: &'static str,
    ) -> Field {
        Field {
            key,
            ty,
            required: false,
            default,
            doc,
        }
    }
}

/// A table schema.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Table {
    /// Class name in the editor annotations.
    pub name: &'static str,
    /// One sentence for users.
    pub doc: &'static str,
    /// Fields in the order of the documentation.
    pub fields: &'static [Field],
}

/// Declares one field: `KEY: TYPE, "DOC"` is required, `KEY = "DEFAULT": TYPE, "DOC"` is not.
#[macro_export]
macro_rules! field {
    ($key:ident: $ty:expr, $doc:expr) => {
        $crate::value::schema::Field::required(stringify!($key), $ty, $doc)
    };
    ($key:ident = $default:literal: $ty:expr, $doc:expr) => {
        $crate::value::schema::Field::optional(stringify!($key), $ty, $default, $doc)
    };
}

/// Declares the schema of a table, with one row per field as in [`field!`](crate::field).
///
/// ```
/// use lumbre_light::value::schema::Ty;
///
/// lumbre_light::table! {
///     /// Options of a box.
///     const BOX = "Box", "Box centred at the origin.";
///     size: Ty::nums(3, 0.0, 1e9), "edge lengths along x, y and z";
///     bevel = "0": Ty::num(0.0, 1e9), "radius of rounded edges";
/// }
/// assert_eq!(BOX.fields[1].default, "0");
/// ```
#[macro_export]
macro_rules! table {
    ($(#[$meta:meta])* $visible:vis const $NAME:ident = $name:literal, $doc:literal;
     $($key:ident $(= $default:literal)?: $ty:expr, $field_doc:expr;)*) => {
        $(#[$meta])*
        $visible const $NAME: $crate::value::schema::Table = $crate::value::schema::Table {
            name: $name,
            doc: $doc,
            fields: &[$($crate::field!($key $(= $default)?: $ty, $field_doc)),*],
        };
    };
}

/// A violation of a schema.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{path}: {problem}{}", help.as_ref().map(|h| format!(" ({h})")).unwrap_or_default())]
pub struct SchemaError {
    /// Path to the field, such as `render.aa.radius`.
    pub path: String,
    /// The actual value and the expected one.
    pub problem: String,
    /// A similar name, or the list of valid ones.
    pub help: Option<String>,
    /// Last key of the path as written, for finding its line in a script.
    pub key: String,
}

impl SchemaError {
    /// Creates an error about the field at `path`. `key` is the last name on the path, or empty if
    /// the whole table is wrong.
    pub fn new(
        path: impl Into<String>,
        key: impl Into<String>,
        problem: impl Into<String>,
    ) -> SchemaError {
        SchemaError {
            path: path.into(),
            problem: problem.into(),
            help: None,
            key: key.into(),
        }
    }

    /// Adds the remedy.
    pub fn with_help(self, help: impl Into<String>) -> SchemaError {
        SchemaError {
            help: Some(help.into()),
            ..self
        }
    }
}

impl Table {
    /// Checks a map against this table, recursively; returns the first problem in key order.
    ///
    /// # Errors
    /// Returns an error for an unknown key, a missing required key, a wrong type or a value out of
    /// range.
    pub fn check(&self, path: &str, map: &BTreeMap<String, Value>) -> Result<(), SchemaError> {
        for (key, value) in map {
            let at = join(path, key);
            let Some(field) = self.fields.iter().find(|f| f.key == key) else {
                return Err(unknown_key(&at, key, self.fields.iter().map(|f| f.key)));
            };
            field.ty.check(&at, key, value)?;
        }
        match self
            .fields
            .iter()
            .find(|f| f.required && !map.contains_key(f.key))
        {
            Some(f) => Err(SchemaError::new(
                path,
                "",
                format!("`{}` is missing: {}", f.key, f.doc),
            )),
            None => Ok(()),
        }
    }
}

impl Table {
    /// Returns a map with one enumerated field at a value that is not its default, for each such
    /// field and value.
    pub fn variants(&self) -> Vec<BTreeMap<String, Value>> {
        let enumerated = self.fields.iter().filter_map(|field| match field.ty {
            Ty::Word(words) => Some((field, words)),
            _ => None,
        });
        let variants = enumerated.flat_map(|(field, words)| {
            let others = words.iter().filter(|word| **word != field.default);
            others.map(|word| BTreeMap::from([(field.key.to_owned(), Value::from(*word))]))
        });
        variants.collect()
    }
}

/// Returns the error for an unknown key, with the most similar name or the list of valid ones.
pub fn unknown_key<'a>(
    path: &str,
    key: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> SchemaError {
    unknown_name(path, key, "key", known)
}

/// Returns the error for an unknown name (of a metric, an integrator, a material), with the most
/// similar name or the list of valid ones.
pub fn unknown_name<'a>(
    path: &str,
    name: &str,
    what: &str,
    known: impl IntoIterator<Item = &'a str>,
) -> SchemaError {
    let known: Vec<&str> = known.into_iter().collect();
    let help = match suggest::nearest(name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("known: {}", known.join(", ")),
    };
    SchemaError::new(path, name, format!("unknown {what} `{name}`")).with_help(help)
}

fn join(path: &str, key: &str) -> String {
    if path.is_empty() {
        key.to_owned()
    } else {
        format!("{path}.{key}")
    }
}

impl Table {
    /// Describes the keys, for messages.
    fn keys(&self) -> String {
        let keys: Vec<&str> = self.fields.iter().map(|field| field.key).collect();
        format!("its keys are {}", keys.join(", "))
    }
}

impl Ty {
    /// Describes a value of another type.
    fn mismatch(&self, value: &Value) -> String {
        let expected = self.describe();
        format!("expected {expected}, found {} `{value}`", value.kind())
    }

    /// Checks one value; `key` is the last name on the path, for finding its line.
    ///
    /// # Errors
    /// Returns an error for a wrong type or a value out of range.
    pub fn check(&self, path: &str, key: &str, value: &Value) -> Result<(), SchemaError> {
        let fail = |problem: String| Err(SchemaError::new(path, key, problem));
        let out_of_range = |x: &dyn fmt::Display| {
            fail(format!("{x} is out of range: expected {}", self.describe()))
        };
        match (self, value) {
            (Ty::Any(_) | Ty::Object(_), _)
            | (Ty::Bool, Value::Bool(_))
            | (Ty::Str | Ty::WordOrDeclared(_), Value::Str(_)) => Ok(()),
            (Ty::Int { min, max }, Value::Int(i)) if (min..=max).contains(&i) => Ok(()),
            (Ty::Int { .. }, Value::Int(i)) => out_of_range(&i),
            (Ty::Num { min, max }, Value::Int(_) | Value::Num(_)) => {
                let x = value.as_f64().unwrap_or(f64::NAN);
                if x.is_finite() && (min..=max).contains(&&x) {
                    return Ok(());
                }
                out_of_range(&x)
            }
            (Ty::Word(names), Value::Str(s)) => check_name(path, key, s, names),
            (Ty::Duration, Value::Int(_) | Value::Num(_) | Value::Str(_)) => {
                if duration_s(value).is_some() {
                    return Ok(());
                }
                let expected = self.describe();
                fail(format!("`{value}` is not a duration: expected {expected}"))
            }
            (Ty::Nums { len, .. }, Value::List(items)) if items.len() != *len => fail(format!(
                "expected {}, found {} items",
                self.describe(),
                items.len()
            )),
            (Ty::Nums { min, max, .. }, Value::List(items)) => {
                let item = Ty::Num {
                    min: *min,
                    max: *max,
                };
                item.check_all(path, key, items)
            }
            (Ty::List(item) | Ty::OneOrMany(item), Value::List(items)) => {
                item.check_all(path, key, items)
            }
            (Ty::OneOrMany(item), _) => item.check(path, key, value),
            (Ty::OrAuto(_), Value::Str(word)) if word == AUTO => Ok(()),
            (Ty::OrAuto(item), Value::Int(_) | Value::Num(_)) => item.check(path, key, value),
            (Ty::Table(table), Value::Map(map)) => table.check(path, map),
            // An empty Lua table is a list; it is also a table without entries.
            (Ty::Table(table), Value::List(items)) if items.is_empty() => {
                table.check(path, &BTreeMap::new())
            }
            (Ty::Table(table), _) => {
                Err(SchemaError::new(path, key, self.mismatch(value)).with_help(table.keys()))
            }
            _ => fail(self.mismatch(value)),
        }
    }

    /// Checks every item of a list against this type.
    fn check_all(&self, path: &str, key: &str, items: &[Value]) -> Result<(), SchemaError> {
        items
            .iter()
            .enumerate()
            .try_for_each(|(i, v)| self.check(&format!("{path}[{}]", i + 1), key, v))
    }

    /// Returns a description of the expected value.
    pub fn describe(&self) -> String {
        match self {
            Ty::Bool => "true or false".to_owned(),
            Ty::Int { min, max } => format!(
                "an integer{}",
                range(*min as f64, *max as f64, *max == i64::MAX)
            ),
            Ty::Num { min, max } => format!("a number{}", range(*min, *max, *max >= f64::MAX)),
            Ty::Str => "a string".to_owned(),
            Ty::Word(words) => format!("one of {}", words.join(", ")),
            Ty::WordOrDeclared(words) => {
                format!("one of {}, or a declared name", words.join(", "))
            }
            Ty::Duration => {
                "a duration in seconds or as text such as \"500ms\", \"30s\", \"5min\", \"8h\""
                    .to_owned()
            }
            Ty::Nums { len, min, max } => {
                format!("{len} numbers{}", range(*min, *max, *max >= f64::MAX))
            }
            Ty::List(item) => format!("a list, each item {}", item.describe()),
            Ty::OneOrMany(item) => format!("{} or a list of such", item.describe()),
            Ty::OrAuto(item) => format!("{} or \"{AUTO}\"", item.describe()),
            Ty::Table(t) => format!("a table ({})", t.name),
            Ty::Object(name) | Ty::Any(name) => (*name).to_owned(),
        }
    }
}

/// Checks a string against a list of valid names.
fn check_name(path: &str, key: &str, name: &str, names: &[&str]) -> Result<(), SchemaError> {
    if names.contains(&name) {
        return Ok(());
    }
    let mut e = unknown_name(path, name, "value", names.iter().copied());
    let known = names.join(", ");
    e.help = Some(match suggest::nearest(name, names.iter().copied()) {
        Some(near) => format!("did you mean `{near}`? known: {known}"),
        None => format!("known: {known}"),
    });
    e.key = key.to_owned();
    Err(e)
}

/// Describes a range; `open` is whether it has no upper bound.
fn range(min: f64, max: f64, open: bool) -> String {
    match (min <= f64::MIN, open) {
        (true, true) => String::new(),
        (false, true) => format!(" of at least {min}"),
        (true, false) => format!(" of at most {max}"),
        (false, false) => format!(" between {min} and {max}"),
    }
}

/// Returns the seconds of a duration: a non-negative number of seconds, or text with a unit of
/// `ms`, `s`, `min` or `h`.
pub fn duration_s(value: &Value) -> Option<f64> {
    let seconds = match value {
        Value::Str(text) => {
            let text = text.trim();
            let digits = text
                .find(|c: char| c.is_ascii_alphabetic())
                .unwrap_or(text.len());
            let number: f64 = text[..digits].trim().parse().ok()?;
            let unit = match &text[digits..] {
                "ms" => 1e-3,
                "s" | "" => 1.0,
                "min" | "m" => 60.0,
                "h" => 3600.0,
                _ => return None,
            };
            number * unit
        }
        _ => value.as_f64()?,
    };
    (seconds.is_finite() && seconds >= 0.0).then_some(seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    const INNER: Table = Table {
        name: "Inner",
        doc: "",
        fields: &[Field {
            key: "radius",
            ty: Ty::Num { min: 0.0, max: 4.0 },
            required: false,
            default: "0.5",
            doc: "",
        }],
    };
    const OUTER: Table = Table {
        name: "Outer",
        doc: "",
        fields: &[
            Field {
                key: "scene",
                ty: Ty::Str,
                required: true,
                default: "",
                doc: "the scene",
            },
            Field {
                key: "aa",
                ty: Ty::Table(&INNER),
                required: false,
                default: "",
                doc: "",
            },
            Field {
                key: "kind",
                ty: Ty::Word(&["box", "gauss"]),
                required: false,
                default: "",
                doc: "",
            },
        ],
    };

    fn map(pairs: &[(&str, Value)]) -> BTreeMap<String, Value> {
        pairs
            .iter()
            .map(|(k, v)| ((*k).to_owned(), v.clone()))
            .collect()
    }

    #[test]
    fn errors_carry_path_and_nearest_name() {
        let aa = Value::Map(map(&[("raduis", Value::Num(0.5))]));
        let e = OUTER
            .check("render", &map(&[("scene", "a".into()), ("aa", aa)]))
            .unwrap_err();
        assert_eq!(e.path, "render.aa.raduis");
        assert_eq!(e.help.as_deref(), Some("did you mean `radius`?"));
        let aa = Value::Map(map(&[("radius", Value::Int(9))]));
        let e = OUTER
            .check("render", &map(&[("scene", "a".into()), ("aa", aa)]))
            .unwrap_err();
        assert!(e.problem.contains("between 0 and 4"), "{e}");
        let e = OUTER.check("render", &map(&[])).unwrap_err();
        assert!(e.problem.contains("`scene` is missing"), "{e}");
        let e = OUTER
            .check(
                "render",
                &map(&[("scene", "a".into()), ("kind", "gaus".into())]),
            )
            .unwrap_err();
        assert!(e.help.unwrap().contains("gauss"));
        let e = OUTER
            .check(
                "render",
                &map(&[("scene", "a".into()), ("aa", "gauss".into())]),
            )
            .unwrap_err();
        assert!(e.to_string().ends_with("(its keys are radius)"), "{e}");
    }

    #[test]
    fn durations_have_units() {
        assert_eq!(duration_s(&"500ms".into()), Some(0.5));
        assert_eq!(duration_s(&"5min".into()), Some(300.0));
        assert_eq!(duration_s(&Value::Num(1.5)), Some(1.5));
        assert_eq!(duration_s(&"8 parsecs".into()), None);
        assert_eq!(duration_s(&Value::Int(-1)), None);
    }
}
