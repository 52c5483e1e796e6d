//! Typed access to JSON objects: case-insensitive keys, key paths in every error, and a record of
//! the keys that were read, so that the others can be noted.

use std::path::{Path, PathBuf};

use glam::{DVec3, Vec3};
use serde_json::Value as Json;

use crate::load::MissingTextures;
use crate::load::beside;
use lumbre_light::scene::desc::MAX_COORDINATE;
use lumbre_light::scene::{Note, SceneError};
use lumbre_light::value::suggest;

/// Collector of the notes of one file, and constructor of its errors.
pub(in crate::load) struct Diagnostics {
    /// File that is being read.
    pub file: PathBuf,
    /// Policy for textures that cannot be read.
    pub missing: MissingTextures,
    /// Notes collected so far.
    pub notes: Vec<Note>,
}

impl Diagnostics {
    /// Adds a note about a key path.
    pub fn note(&mut self, place: impl Into<String>, message: impl Into<String>) {
        self.notes
            .push(Note::new(self.file.clone(), place, message));
    }

    /// Creates an error about a key path.
    pub fn error(&self, place: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::malformed(self.file.clone(), place, problem)
    }

    /// Returns the path of a file that this one refers to; both `/` and `\` separate folders.
    pub fn resolve(&self, name: &str) -> PathBuf {
        beside(self.file.parent().unwrap_or(Path::new("")), name)
    }

    /// Adds the place that refers to a file to an error about that file.
    pub fn at_reference(&self, place: &str, error: SceneError) -> SceneError {
        match error {
            SceneError::Unreadable { file, reason } => {
                self.error(place, format!("cannot read {}: {reason}", file.display()))
            }
            SceneError::Malformed {
                file,
                place: inner,
                problem,
            } => SceneError::malformed(
                file,
                inner,
                format!("{problem} (referenced in {}: {place})", self.file.display()),
            ),
            other => other,
        }
    }
}

/// A JSON object that is being read.
pub(in crate::load) struct JsonObject<'a> {
    /// Key path of the object; empty for the whole document.
    path: String,
    /// Lower-case key, key as written, value, and whether the key was read.
    entries: Vec<(String, &'a str, &'a Json, bool)>,
}

impl<'a> JsonObject<'a> {
    /// Wraps a JSON value, which must be an object.
    pub fn new(
        path: &str,
        json: &'a Json,
        diagnostics: &mut Diagnostics,
    ) -> Result<JsonObject<'a>, SceneError> {
        let Json::Object(map) = json else {
            let place = if path.is_empty() { "document" } else { path };
            return Err(diagnostics.error(
                place,
                format!("expected an object, found {}", describe(json)),
            ));
        };
        let mut object = JsonObject {
            path: path.to_owned(),
            entries: Vec::new(),
        };
        let mut entry_by_key = std::collections::BTreeMap::new();
        for (key, value) in map {
            let folded = key.to_lowercase();
            match entry_by_key.get(&folded) {
                Some(&i) => {
                    diagnostics.note(
                        object.key_path(key),
                        "the key is given twice in different case; the last one is used",
                    );
                    object.entries[i] = (folded, key.as_str(), value, false);
                }
                None => {
                    entry_by_key.insert(folded.clone(), object.entries.len());
                    object.entries.push((folded, key.as_str(), value, false));
                }
            }
        }
        Ok(object)
    }

    /// Returns the key path of a key.
    pub fn key_path(&self, key: &str) -> String {
        if self.path.is_empty() {
            truncated(key)
        } else {
            format!("{}.{}", self.path, truncated(key))
        }
    }

    /// Returns the value of a key with its key path, and marks the key as read.
    pub fn get(&mut self, key: &str) -> Option<(String, &'a Json)> {
        let entry = self.entries.iter_mut().find(|e| e.0 == key)?;
        entry.3 = true;
        let (written, value) = (entry.1, entry.2);
        Some((self.key_path(written), value))
    }

    /// Notes every key that was not read, with a suggestion from `known`.
    pub fn note_unknown<'k>(
        &self,
        known: impl IntoIterator<Item = &'k str> + Clone,
        diagnostics: &mut Diagnostics,
    ) {
        for (_, key, _, _) in self.entries.iter().filter(|e| !e.3) {
            let near = match suggest::nearest(&truncated(key), known.clone()) {
                Some(near) => format!(" (did you mean `{near}`?)"),
                None => String::new(),
            };
            diagnostics.note(self.key_path(key), format!("unknown key, ignored{near}"));
        }
    }

    /// Returns the items of a list with their key paths; none if the key is absent.
    pub fn list(
        &mut self,
        key: &str,
        diagnostics: &Diagnostics,
    ) -> Result<Vec<(String, &'a Json)>, SceneError> {
        match self.get(key) {
            None => Ok(Vec::new()),
            Some((path, Json::Array(items))) => Ok(items
                .iter()
                .enumerate()
                .map(|(i, v)| (format!("{path}[{i}]"), v))
                .collect()),
            Some((path, other)) => {
                Err(diagnostics.error(path, format!("expected a list, found {}", describe(other))))
            }
        }
    }

    /// Returns a string with its key path, if the key is present.
    pub fn string(
        &mut self,
        key: &str,
        diagnostics: &Diagnostics,
    ) -> Result<Option<(String, &'a str)>, SceneError> {
        match self.get(key) {
            None => Ok(None),
            Some((path, Json::String(s))) => Ok(Some((path, s))),
            Some((path, other)) => Err(diagnostics.error(
                path,
                format!("expected a string, found {}", describe(other)),
            )),
        }
    }

    /// Returns a number with its key path, if the key is present.
    pub fn number(
        &mut self,
        key: &str,
        diagnostics: &Diagnostics,
    ) -> Result<Option<(String, f64)>, SceneError> {
        self.get(key)
            .map(|(path, json)| Ok((path.clone(), number(&path, json, diagnostics)?)))
            .transpose()
    }

    /// Returns a point or direction with coordinates in range, if the key is present.
    pub fn vec3(
        &mut self,
        key: &str,
        diagnostics: &Diagnostics,
    ) -> Result<Option<Vec3>, SceneError> {
        Ok(self.point(key, diagnostics)?.map(|p| p.as_vec3()))
    }

    /// Returns what [`JsonObject::vec3`] returns, in double precision.
    pub fn point(
        &mut self,
        key: &str,
        diagnostics: &Diagnostics,
    ) -> Result<Option<DVec3>, SceneError> {
        let Some((path, json)) = self.get(key) else {
            return Ok(None);
        };
        let [x, y, z] = numbers::<3>(&path, json, diagnostics)?;
        if [x, y, z]
            .iter()
            .any(|c| c.abs() > f64::from(MAX_COORDINATE))
        {
            return Err(diagnostics.error(
                path,
                format!(
                    "({x}, {y}, {z}) is out of range; the greatest magnitude is {MAX_COORDINATE:e}"
                ),
            ));
        }
        Ok(Some(DVec3::new(x, y, z)))
    }
}

/// Returns a finite number.
pub(in crate::load) fn number(
    path: &str,
    json: &Json,
    diagnostics: &Diagnostics,
) -> Result<f64, SceneError> {
    match json.as_f64() {
        Some(x) if x.is_finite() => Ok(x),
        _ => Err(diagnostics.error(path, format!("expected a number, found {}", describe(json)))),
    }
}

/// Returns a list of exactly `N` finite numbers.
pub(in crate::load) fn numbers<const N: usize>(
    path: &str,
    json: &Json,
    diagnostics: &Diagnostics,
) -> Result<[f64; N], SceneError> {
    let Json::Array(items) = json else {
        return Err(diagnostics.error(
            path,
            format!("expected {N} numbers, found {}", describe(json)),
        ));
    };
    if items.len() != N {
        return Err(diagnostics.error(
            path,
            format!("expected {N} numbers, found {} items", items.len()),
        ));
    }
    let mut out = [0.0; N];
    for (i, (x, item)) in out.iter_mut().zip(items).enumerate() {
        *x = number(&format!("{path}[{i}]"), item, diagnostics)?;
    }
    Ok(out)
}

/// Returns the type of a JSON value and its beginning, for messages.
pub(in crate::load) fn describe(json: &Json) -> String {
    match json {
        Json::Null => "null".to_owned(),
        Json::Bool(b) => format!("the boolean {b}"),
        Json::Number(n) => format!("the number {}", truncated(&n.to_string())),
        Json::String(s) => format!("the string \"{}\"", truncated(s)),
        Json::Array(_) => "a list".to_owned(),
        Json::Object(_) => "an object".to_owned(),
    }
}

/// Returns the beginning of a text of any length, for messages.
pub(in crate::load) fn truncated(text: &str) -> String {
    const MAX_CHARS: usize = 60;
    match text.char_indices().nth(MAX_CHARS) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
