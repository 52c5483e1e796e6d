//! Plain data exchanged between Lua, JSON and Rust, the schemas that check it, and suggestions of
//! similar names.
//!
//! A script's table, a `.scn` file or a command-line override is represented as a [`Value`] before
//! it is typed. Numbers are normalised (an integral float is an integer) and maps are ordered by
//! key, so equal data hashes equally, however it was written.

pub mod markdown;
mod named;
pub mod schema;
mod serial;
pub mod suggest;

use std::collections::BTreeMap;
use std::fmt;

use serde::Deserialize;

/// A dynamically typed, ordered, comparable value.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Value {
    /// The absence of a value.
    #[default]
    Nil,
    /// The value `true` or `false`.
    Bool(bool),
    /// An integer, or a float with an integral value below 2^53.
    Int(i64),
    /// Any other float.
    Num(f64),
    /// A string of text.
    Str(String),
    /// An ordered list.
    List(Vec<Value>),
    /// A map of named values, ordered by name.
    Map(BTreeMap<String, Value>),
}

/// Implements accessors of values of one type.
macro_rules! accessors {
    ($($(#[$doc:meta])* $name:ident: $Variant:ident($x:ident) -> $out:ty = $value:expr;)*) => {$(
        $(#[$doc])*
        pub fn $name(&self) -> Option<$out> {
            match self {
                Value::$Variant($x) => Some($value),
                _ => None,
            }
        }
    )*};
}

impl Value {
    /// Returns a normalised number: integral values below 2^53 become [`Value::Int`], `-0.0`
    /// becomes `0`.
    pub fn number(x: f64) -> Value {
        if x.fract() == 0.0 && x.abs() < 9_007_199_254_740_992.0 {
            Value::Int(x as i64)
        } else {
            Value::Num(x)
        }
    }

    /// Returns the value as a float if it is a number.
    pub fn as_f64(&self) -> Option<f64> {
        match self {
            Value::Int(i) => Some(*i as f64),
            Value::Num(x) => Some(*x),
            _ => None,
        }
    }

    accessors! {
        /// Returns the value as an integer if it is one.
        as_i64: Int(i) -> i64 = *i;
        /// Returns the value as text if it is a string.
        as_str: Str(s) -> &str = s;
        /// Returns the value as a list if it is one.
        as_list: List(l) -> &[Value] = l;
        /// Returns the value as a map if it is one.
        as_map: Map(m) -> &BTreeMap<String, Value> = m;
    }

    /// Returns the items of a list, or any other value as the only item.
    pub fn one_or_many(&self) -> &[Value] {
        self.as_list().unwrap_or(std::slice::from_ref(self))
    }

    /// Returns the name of the value's type for error messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Value::Nil => "nothing",
            Value::Bool(_) => "a boolean",
            Value::Int(_) => "an integer",
            Value::Num(_) => "a number",
            Value::Str(_) => "a string",
            Value::List(_) => "a list",
            Value::Map(_) => "a table",
        }
    }

    /// Converts from JSON, with numbers normalised.
    pub fn from_json(json: &serde_json::Value) -> Value {
        // Every JSON value is one.
        Value::deserialize(json).unwrap_or_default()
    }

    /// Feeds an unambiguous encoding of the value to a hasher. Run ids depend on it.
    pub fn hash_into(&self, hasher: &mut blake3::Hasher) {
        match self {
            Value::Nil => hash_tagged(hasher, b'0', &[]),
            Value::Bool(b) => hash_tagged(hasher, b'b', &[u8::from(*b)]),
            Value::Int(i) => hash_tagged(hasher, b'i', &i.to_le_bytes()),
            Value::Num(x) => hash_tagged(hasher, b'n', &x.to_bits().to_le_bytes()),
            Value::Str(s) => hash_tagged(hasher, b's', s.as_bytes()),
            Value::List(l) => {
                hash_tagged(hasher, b'l', &(l.len() as u64).to_le_bytes());
                l.iter().for_each(|v| v.hash_into(hasher));
            }
            Value::Map(m) => {
                Value::hash_fields(m.iter().map(|(k, v)| (k.as_str(), v)), hasher);
            }
        }
    }

    /// Does the same for the map of these fields, which are ordered by name.
    pub fn hash_fields<'a>(
        fields: impl ExactSizeIterator<Item = (&'a str, &'a Value)>,
        hasher: &mut blake3::Hasher,
    ) {
        hash_tagged(hasher, b'm', &(fields.len() as u64).to_le_bytes());
        for (k, v) in fields {
            hash_tagged(hasher, b'k', k.as_bytes());
            v.hash_into(hasher);
        }
    }
}

fn hash_tagged(hasher: &mut blake3::Hasher, tag: u8, bytes: &[u8]) {
    hasher.update(&[tag]);
    hasher.update(&(bytes.len() as u64).to_le_bytes());
    hasher.update(bytes);
}

impl fmt::Display for Value {
    /// Writes the short form used in tables, figure legends and readable paths: `0.5`, `bpt`, `[1,
    /// 2]`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Nil => write!(f, "nil"),
            Value::Bool(b) => write!(f, "{b}"),
            Value::Int(i) => write!(f, "{i}"),
            Value::Num(x) => write!(f, "{x}"),
            Value::Str(s) => write!(f, "{s}"),
            Value::List(l) => {
                write!(f, "[")?;
                for (i, v) in l.iter().enumerate() {
                    write!(f, "{}{v}", if i > 0 { ", " } else { "" })?;
                }
                write!(f, "]")
            }
            Value::Map(m) => {
                write!(f, "{{")?;
                for (i, (k, v)) in m.iter().enumerate() {
                    write!(f, "{}{k} = {v}", if i > 0 { ", " } else { "" })?;
                }
                write!(f, "}}")
            }
        }
    }
}

/// Implements conversions of other types to values.
macro_rules! conversions {
    ($($type:ty: $x:ident => $value:expr;)*) => {$(
        impl From<$type> for Value {
            fn from($x: $type) -> Value {
                $value
            }
        }
    )*};
}

conversions! {
    &str: s => Value::Str(s.to_owned());
    i64: n => Value::Int(n);
    u32: n => Value::Int(i64::from(n));
    f64: x => Value::number(x);
}

/// A map of keys and values.
impl<'a> FromIterator<(&'a str, Value)> for Value {
    fn from_iter<I: IntoIterator<Item = (&'a str, Value)>>(fields: I) -> Value {
        let fields = fields.into_iter();
        Value::Map(fields.map(|(key, value)| (key.to_owned(), value)).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn digest(v: &Value) -> blake3::Hash {
        let mut h = blake3::Hasher::new();
        v.hash_into(&mut h);
        h.finalize()
    }

    #[test]
    fn integral_floats_and_integers_are_the_same_number() {
        assert_eq!(Value::number(3.0), Value::Int(3));
        assert_eq!(Value::number(-0.0), Value::Int(0));
        assert_eq!(digest(&Value::number(2.0)), digest(&Value::Int(2)));
        assert_ne!(digest(&Value::number(2.5)), digest(&Value::Int(2)));
    }

    #[test]
    fn nesting_and_text_boundaries_change_the_hash() {
        let a = Value::List(vec!["ab".into(), "c".into()]);
        let b = Value::List(vec!["a".into(), "bc".into()]);
        let c = Value::List(vec![Value::List(vec!["ab".into()]), "c".into()]);
        assert_ne!(digest(&a), digest(&b));
        assert_ne!(digest(&a), digest(&c));
    }

    #[test]
    fn json_round_trip_keeps_numbers_exactly() {
        let v = Value::List(vec![Value::Num(0.1), Value::Int(7), Value::Num(1e300)]);
        let text = serde_json::to_string(&v).unwrap();
        assert_eq!(serde_json::from_str::<Value>(&text).unwrap(), v);
        assert!(text.starts_with("[0.1,7,1e"), "{text}");
        let infinite = serde_json::to_string(&Value::Num(f64::NEG_INFINITY)).unwrap();
        assert_eq!(infinite, "\"-inf\"");
    }
}
