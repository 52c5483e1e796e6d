//! A render table as a script gives it.

use std::collections::BTreeMap;
use std::path::Path;

use lumbre_light::value::Value;

/// A render table as a script gives it.
pub struct Given<'a> {
    /// Keys and values.
    pub map: &'a BTreeMap<String, Value>,
    /// Folder of the script, in which files are searched after the current folder.
    pub folder: &'a Path,
    /// Path of the table, with which paths of errors begin.
    pub path: &'a str,
}

impl Given<'_> {
    /// Returns the path of a key.
    pub fn at(&self, key: &str) -> String {
        format!("{}.{key}", self.path)
    }

    /// Returns the text of a key.
    pub fn text(&self, key: &str) -> Option<&str> {
        self.map.get(key).and_then(Value::as_str)
    }

    /// Returns the table of a key.
    pub fn table(&self, key: &str) -> Option<&BTreeMap<String, Value>> {
        self.map.get(key).and_then(Value::as_map)
    }

    /// Returns a number of a nested table.
    pub(super) fn nested(&self, key: &str, field: &str) -> Option<&Value> {
        self.table(key)?.get(field)
    }
}
