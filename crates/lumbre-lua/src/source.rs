//! Source texts of a script and of the modules that it requires. [`Sources`] maps positions
//! reported by Lua and paths of fields to lines of these texts, for error messages.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::error::{Highlight, Problem, ScriptError};
use super::locate;
use lumbre_light::value::schema::SchemaError;
use lumbre_scene_io::load::files;

/// Largest accepted size of a script or module, in bytes.
pub const MAX_BYTES: u64 = 4 << 20;

/// Longest chunk name, in bytes. Lua truncates longer names in its messages, which would make them
/// ambiguous.
const MAX_CHUNK_NAME: usize = 48;

/// Position in a source text: a call or a function.
#[derive(Clone, Debug, PartialEq)]
pub struct SourcePlace {
    /// Index of the text in [`Sources`].
    pub source: usize,
    /// Line of a call, or first line of a function, from 1.
    pub line: usize,
    /// Last line of a function; `None` for a call.
    pub last: Option<usize>,
}

/// Source text of the script or of one module.
#[derive(Debug)]
pub struct Source {
    /// Chunk name, which identifies the text in messages of Lua.
    pub chunk: String,
    /// File that contains the text.
    pub file: PathBuf,
    /// The text itself.
    pub text: Arc<str>,
}

/// All source texts of one script; the script itself is the first.
#[derive(Debug, Default)]
pub struct Sources {
    texts: Vec<Source>,
}

/// Reads a Lua source file. Reads at most as many bytes as the file's metadata states, since
/// special files of length zero can block or never end.
///
/// # Errors
/// Returns an error if the file is unreadable, not a regular file, larger than [`MAX_BYTES`],
/// bytecode, or not UTF-8.
pub fn read(file: &Path) -> Result<String, ScriptError> {
    let fail = |problem, help: Option<&str>| {
        Err(ScriptError::new(
            file,
            problem,
            help.map(str::to_owned),
            None,
        ))
    };
    let unreadable = |e: std::io::Error| {
        ScriptError::new(
            file,
            Problem::Unreadable {
                reason: e.to_string(),
            },
            None,
            None,
        )
    };
    if let Err(reason) = files::check(file) {
        return fail(Problem::Unreadable { reason }, None);
    }
    let metadata = std::fs::metadata(file).map_err(unreadable)?;
    if !metadata.is_file() {
        return fail(
            Problem::Unreadable {
                reason: "it is not a regular file".to_owned(),
            },
            None,
        );
    }
    files::record(file);
    let length = metadata.len();
    if length > MAX_BYTES {
        let problem = Problem::TooLarge {
            bytes: length,
            limit: MAX_BYTES,
        };
        return fail(problem, Some("is this file a script?"));
    }
    let mut bytes = Vec::new();
    std::fs::File::open(file)
        .map_err(unreadable)?
        .take(length)
        .read_to_end(&mut bytes)
        .map_err(unreadable)?;
    if bytes.first() == Some(&0x1b) {
        let found = "it is compiled Lua bytecode".to_owned();
        return fail(
            Problem::NotText { found },
            Some("use the `.lua` source instead"),
        );
    }
    match String::from_utf8(bytes) {
        Ok(text) => Ok(text
            .strip_prefix('\u{feff}')
            .map(str::to_owned)
            .unwrap_or(text)),
        Err(e) => {
            let at = e.utf8_error().valid_up_to();
            let line = 1 + e.as_bytes()[..at].iter().filter(|b| **b == b'\n').count();
            let found = format!("byte {} in line {line} is not UTF-8", at + 1);
            fail(Problem::NotText { found }, Some("save it as UTF-8"))
        }
    }
}

impl Sources {
    /// Adds a text and returns its index. `name` becomes the chunk name, shortened or numbered to
    /// be unique.
    pub fn add(&mut self, name: &str, file: &Path, text: String) -> usize {
        let index = self.texts.len();
        let is_taken = |chunk: &str| self.texts.iter().any(|s| s.chunk == chunk);
        let short: String = name.chars().filter(|c| !c.is_control()).collect();
        let chunk = if short.is_empty() || short.len() > MAX_CHUNK_NAME || is_taken(&short) {
            let mut tail = short.len().saturating_sub(MAX_CHUNK_NAME - 12);
            while !short.is_char_boundary(tail) {
                tail += 1;
            }
            format!("{index}~{}", &short[tail..])
        } else {
            short
        };
        self.texts.push(Source {
            chunk,
            file: file.to_owned(),
            text: text.into(),
        });
        index
    }

    /// Returns the files of the required modules.
    pub fn modules(&self) -> impl Iterator<Item = &Path> {
        self.texts
            .iter()
            .skip(1)
            .map(|source| source.file.as_path())
    }

    /// Returns the number of texts.
    pub fn count(&self) -> usize {
        self.texts.len()
    }

    /// Returns the text at `index`. Panics if [`Sources::add`] did not return that index.
    pub fn get(&self, index: usize) -> &Source {
        &self.texts[index]
    }

    /// Returns the index of the text with this chunk name, with or without Lua's leading `@`.
    pub fn by_chunk(&self, chunk: &str) -> Option<usize> {
        let chunk = chunk.strip_prefix('@').unwrap_or(chunk);
        self.texts.iter().position(|s| s.chunk == chunk)
    }

    /// Splits a Lua message of the form `chunk:line: message`. Returns `None` if the chunk is not
    /// one of these texts.
    pub fn split_message<'m>(&self, message: &'m str) -> Option<(SourcePlace, &'m str)> {
        self.texts.iter().enumerate().find_map(|(source, s)| {
            let rest = message.strip_prefix(s.chunk.as_str())?.strip_prefix(':')?;
            let (line, rest) = rest.split_once(':')?;
            Some((
                SourcePlace {
                    source,
                    line: line.parse().ok()?,
                    last: None,
                },
                rest.trim_start(),
            ))
        })
    }

    /// Returns the innermost position of a Lua traceback that lies in these texts.
    pub fn in_traceback(&self, traceback: &str) -> Option<SourcePlace> {
        traceback.lines().find_map(|line| {
            self.split_message(line.trim_start())
                .map(|(place, _)| place)
        })
    }

    /// Returns an error that marks the line of `place`.
    pub fn error(
        &self,
        place: &SourcePlace,
        problem: Problem,
        help: Option<String>,
    ) -> ScriptError {
        let source = self.get(place.source);
        let span = locate::line_span(&source.text, place.line);
        self.error_at(source, span, place.line, problem, help)
    }

    /// Returns an error about a field or an argument that marks the line of `place`.
    pub fn field(
        &self,
        place: &SourcePlace,
        path: &str,
        problem: impl Into<String>,
        help: Option<String>,
    ) -> ScriptError {
        self.error(
            place,
            Problem::Field {
                path: path.to_owned(),
                problem: problem.into(),
            },
            help,
        )
    }

    /// Converts a schema error to a script error that marks the key of the field. If the key cannot
    /// be found from `place`, the line of `place` is marked.
    pub fn locate_error(&self, place: &SourcePlace, error: SchemaError) -> ScriptError {
        let source = self.get(place.source);
        let text = source.text.as_ref();
        let steps = keys_of(&error);
        let keys: Vec<&str> = steps.iter().map(String::as_str).collect();
        let missing = error.key.is_empty();
        let mut span = if missing && keys.len() <= 1 {
            place
                .last
                .and_then(|last| locate::find_returned_table(text, place.line, last))
        } else {
            locate::find_key(text, place.line, place.last, &keys)
        };
        if missing && span.is_none() {
            span = place
                .last
                .and_then(|last| locate::find_returned_table(text, place.line, last));
        }
        let problem = Problem::Field {
            path: error.path,
            problem: error.problem,
        };
        match span {
            Some(span) => self.error_at(
                source,
                span,
                locate::line_of(text, span.0),
                problem,
                error.help,
            ),
            None => self.error(place, problem, error.help),
        }
    }

    /// Returns an error that marks the byte range `span` of `source`, which begins in line `line`.
    fn error_at(
        &self,
        source: &Source,
        span: (usize, usize),
        line: usize,
        problem: Problem,
        help: Option<String>,
    ) -> ScriptError {
        let highlight = Highlight {
            text: Arc::clone(&source.text),
            span: span.0..span.0 + span.1,
            line,
        };
        ScriptError::new(&source.file, problem, help, Some(highlight))
    }

    /// Returns the blake3 hash of the script's text and of every module with its name, in the order
    /// of the names. The script's own name is left out, so renaming the script does not change the
    /// hash.
    pub fn hash(&self) -> [u8; 32] {
        let mut order: Vec<(&str, &str)> = self
            .texts
            .iter()
            .map(|s| (s.chunk.as_str(), s.text.as_ref()))
            .collect();
        if let Some(script) = order.first_mut() {
            script.0 = "";
        }
        order.sort_unstable();
        let mut hasher = blake3::Hasher::new();
        for (name, text) in order {
            for part in [name.as_bytes(), text.as_bytes()] {
                hasher.update(&(part.len() as u64).to_le_bytes());
                hasher.update(part);
            }
        }
        *hasher.finalize().as_bytes()
    }
}

/// Returns the keys on an error's path, outermost first, without list indices. The last key may
/// contain dots.
fn keys_of(error: &SchemaError) -> Vec<String> {
    let parents = match error.path.strip_suffix(error.key.as_str()) {
        Some(parents) if !error.key.is_empty() => parents,
        _ => error.path.as_str(),
    };
    let mut keys: Vec<String> = parents
        .split('.')
        .map(|step| step.split('[').next().unwrap_or(step).to_owned())
        .filter(|step| !step.is_empty())
        .collect();
    if !error.key.is_empty() && keys.last() != Some(&error.key) {
        keys.push(error.key.clone());
    }
    keys
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sources() -> Sources {
        let mut sources = Sources::default();
        sources.add(
            "a.lua",
            Path::new("dir/a.lua"),
            "x = 1\ny = { aa = { bad = 2 } }\n".to_owned(),
        );
        sources
    }

    #[test]
    fn messages_are_split_only_for_known_texts() {
        let s = sources();
        let (place, rest) = s.split_message("a.lua:2: attempt: to fly").unwrap();
        assert_eq!((place.line, rest), (2, "attempt: to fly"));
        assert_eq!(s.split_message("b.lua:2: no"), None);
        assert_eq!(
            s.in_traceback("stack traceback:\n\t[C]: in ?\n\ta.lua:1: in main chunk")
                .unwrap()
                .line,
            1
        );
    }

    #[test]
    fn fields_are_found_by_their_path() {
        let s = sources();
        let place = SourcePlace {
            source: 0,
            line: 2,
            last: None,
        };
        let error = SchemaError::new("y.aa.bad", "bad", "unknown");
        let e = s.locate_error(&place, error);
        assert_eq!((e.line(), e.pointed_at()), (Some(2), Some("bad")));
        assert_eq!(e.to_string(), "dir/a.lua:2: y.aa.bad: unknown");
    }

    #[test]
    fn keys_with_dots_stay_whole() {
        let error = SchemaError::new("render.set.materials.egg.ior", "materials.egg.ior", "");
        assert_eq!(keys_of(&error), ["render", "set", "materials.egg.ior"]);
    }

    #[test]
    fn long_and_equal_names_stay_apart() {
        let mut s = sources();
        let long = format!("{}.lua", "é".repeat(80));
        let (a, b) = (
            s.add(&long, Path::new("l"), String::new()),
            s.add("a.lua", Path::new("other/a.lua"), String::new()),
        );
        assert!(s.get(a).chunk.len() <= MAX_CHUNK_NAME);
        assert_ne!(s.get(b).chunk, "a.lua");
        assert_eq!(s.by_chunk(&format!("@{}", s.get(a).chunk)), Some(a));
    }
}
