//! Typed reading of JSON objects: keys without regard to case, key paths in every error, and a memory of what was
//! read so that the rest can be noted.

use std::path::{Path, PathBuf};

use glam::Vec3;
use serde_json::Value as Json;

use crate::scene::desc::MAX_COORDINATE;
use crate::scene::load::Missing;
use crate::scene::{Note, SceneError};
use crate::value::suggest;

/// Where errors and notes of one file go.
pub(in crate::scene::load) struct Report {
    /// The file that is read.
    pub file: PathBuf,
    /// What becomes of textures that cannot be read.
    pub missing: Missing,
    /// What could not be honoured so far.
    pub notes: Vec<Note>,
}

impl Report {
    pub fn note(&mut self, place: impl Into<String>, message: impl Into<String>) {
        self.notes.push(Note { file: self.file.clone(), place: place.into(), message: message.into() });
    }

    pub fn error(&self, place: impl Into<String>, problem: impl Into<String>) -> SceneError {
        SceneError::Malformed { file: self.file.clone(), place: place.into(), problem: problem.into() }
    }

    /// The place on disk of a file that this one names; `/` and `\` both separate folders.
    pub fn resolve(&self, name: &str) -> PathBuf {
        self.file.parent().unwrap_or(Path::new("")).join(name.replace('\\', "/"))
    }

    /// Says of an error in a named file where the file was named.
    pub fn named_at(&self, place: &str, error: SceneError) -> SceneError {
        match error {
            SceneError::Unreadable { file, reason } => {
                self.error(place, format!("cannot read {}: {reason}", file.display()))
            }
            SceneError::Malformed { file, place: inner, problem } => SceneError::Malformed {
                file,
                place: inner,
                problem: format!("{problem} (named in {}: {place})", self.file.display()),
            },
            other => other,
        }
    }
}

/// One JSON object being read.
pub(in crate::scene::load) struct Object<'a> {
    /// The key path of the object, empty for the whole document.
    path: String,
    /// Lower-case key, key as written, value, whether it has been asked for.
    entries: Vec<(String, &'a str, &'a Json, bool)>,
}

impl<'a> Object<'a> {
    /// Wraps a JSON value that must be an object.
    pub fn new(path: &str, json: &'a Json, report: &mut Report) -> Result<Object<'a>, SceneError> {
        let Json::Object(map) = json else {
            let place = if path.is_empty() { "document" } else { path };
            return Err(report.error(place, format!("expected an object, found {}", kind(json))));
        };
        let mut object = Object { path: path.to_owned(), entries: Vec::new() };
        let mut row_of = std::collections::BTreeMap::new();
        for (key, value) in map {
            let folded = key.to_lowercase();
            match row_of.get(&folded) {
                Some(&row) => {
                    report.note(object.at(key), "said twice in different case: the last one counts");
                    object.entries[row] = (folded, key.as_str(), value, false);
                }
                None => {
                    row_of.insert(folded.clone(), object.entries.len());
                    object.entries.push((folded, key.as_str(), value, false));
                }
            }
        }
        Ok(object)
    }

    /// The key path of a key.
    pub fn at(&self, key: &str) -> String {
        if self.path.is_empty() { shorten(key) } else { format!("{}.{}", self.path, shorten(key)) }
    }

    /// The value of a key, with its key path; from now on the key counts as known.
    pub fn take(&mut self, key: &str) -> Option<(String, &'a Json)> {
        let entry = self.entries.iter_mut().find(|e| e.0 == key)?;
        entry.3 = true;
        let (written, value) = (entry.1, entry.2);
        Some((self.at(written), value))
    }

    /// Notes every key that nobody asked for; `known` are the keys to suggest.
    pub fn note_unknown<'k>(&self, known: impl IntoIterator<Item = &'k str> + Clone, report: &mut Report) {
        for (_, key, _, _) in self.entries.iter().filter(|e| !e.3) {
            let near = match suggest::nearest(&shorten(key), known.clone()) {
                Some(near) => format!(" (did you mean `{near}`?)"),
                None => String::new(),
            };
            report.note(self.at(key), format!("unknown key: ignored{near}"));
        }
    }

    /// The items of a list, each with its key path; nothing if the key is absent.
    pub fn list(&mut self, key: &str, report: &Report) -> Result<Vec<(String, &'a Json)>, SceneError> {
        match self.take(key) {
            None => Ok(Vec::new()),
            Some((path, Json::Array(items))) => {
                Ok(items.iter().enumerate().map(|(i, v)| (format!("{path}[{i}]"), v)).collect())
            }
            Some((path, other)) => Err(report.error(path, format!("expected a list, found {}", kind(other)))),
        }
    }

    /// A text, if the key is there.
    pub fn string(&mut self, key: &str, report: &Report) -> Result<Option<(String, &'a str)>, SceneError> {
        match self.take(key) {
            None => Ok(None),
            Some((path, Json::String(s))) => Ok(Some((path, s))),
            Some((path, other)) => Err(report.error(path, format!("expected a string, found {}", kind(other)))),
        }
    }

    /// A number, if the key is there.
    pub fn number(&mut self, key: &str, report: &Report) -> Result<Option<(String, f64)>, SceneError> {
        self.take(key).map(|(path, json)| Ok((path.clone(), number(&path, json, report)?))).transpose()
    }

    /// A point or direction with every coordinate in range, if the key is there.
    pub fn vec3(&mut self, key: &str, report: &Report) -> Result<Option<Vec3>, SceneError> {
        let Some((path, json)) = self.take(key) else { return Ok(None) };
        let [x, y, z] = numbers::<3>(&path, json, report)?;
        if [x, y, z].iter().any(|c| c.abs() > f64::from(MAX_COORDINATE)) {
            return Err(report.error(path, format!("({x}, {y}, {z}) lies beyond {MAX_COORDINATE:e}")));
        }
        Ok(Some(Vec3::new(x as f32, y as f32, z as f32)))
    }
}

/// A finite number.
pub(in crate::scene::load) fn number(path: &str, json: &Json, report: &Report) -> Result<f64, SceneError> {
    match json.as_f64() {
        Some(x) if x.is_finite() => Ok(x),
        _ => Err(report.error(path, format!("expected a number, found {}", kind(json)))),
    }
}

/// A list of exactly `N` finite numbers.
pub(in crate::scene::load) fn numbers<const N: usize>(
    path: &str,
    json: &Json,
    report: &Report,
) -> Result<[f64; N], SceneError> {
    let Json::Array(items) = json else {
        return Err(report.error(path, format!("expected {N} numbers, found {}", kind(json))));
    };
    if items.len() != N {
        return Err(report.error(path, format!("expected {N} numbers, found {} items", items.len())));
    }
    let mut out = [0.0; N];
    for (i, (x, item)) in out.iter_mut().zip(items).enumerate() {
        *x = number(&format!("{path}[{i}]"), item, report)?;
    }
    Ok(out)
}

/// What a JSON value is, with its beginning, for messages.
pub(in crate::scene::load) fn kind(json: &Json) -> String {
    match json {
        Json::Null => "null".to_owned(),
        Json::Bool(b) => format!("the boolean {b}"),
        Json::Number(n) => format!("the number {}", shorten(&n.to_string())),
        Json::String(s) => format!("the string \"{}\"", shorten(s)),
        Json::Array(_) => "a list".to_owned(),
        Json::Object(_) => "an object".to_owned(),
    }
}

/// The beginning of a text that may be of any length.
pub(in crate::scene::load) fn shorten(text: &str) -> String {
    const SHOWN: usize = 60;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text.to_owned(),
    }
}
