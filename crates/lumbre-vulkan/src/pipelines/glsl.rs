//! Compiles GLSL to SPIR-V by the reference compiler, a program on PATH. Needs no device.
//!
//! Names in `#include` lines are paths from the root of the shader folder, wherever they appear,
//! and some come from the program. The compiler knows neither, so it reads numbered files in a
//! temporary folder: their `#include` lines name numbers, and `#line` names the path for messages.

use std::collections::BTreeMap;
use std::ffi::{OsStr, OsString};
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use lumbre_render::external;

use super::recipe::Recipe;
use super::shrink::{is_whole, shrink};
use super::sources::{ShaderError, Sources, words};

/// Names of the compiler in order of preference, with the arguments that ask for SPIR-V 1.5.
const PROGRAMS: [(&str, &[&str]); 3] = [
    ("glslangValidator", &["--target-env", "vulkan1.2"]),
    ("glslang", &["--target-env", "vulkan1.2"]),
    ("glslc", &["--target-env=vulkan1.2"]),
];

/// Time after which a compiler is ended. The largest module takes half a second.
const TIME_LIMIT: Duration = Duration::from_secs(30);

/// Greatest size of all texts that a module includes, in bytes.
const MAX_BYTES: usize = 64 << 20;

/// Greatest number of lines of messages that are quoted.
const MAX_LINES: usize = 20;

/// Parts of the lines that end the compiler's messages.
const SUMMARIES: [&str; 4] = [
    "compilation errors.",
    "errors generated.",
    "error generated.",
    "SPIR-V is not generated",
];

/// Modules that this process has made, by the hash of everything that they are made from: runs of a
/// night and tests need the same ones again.
static MADE: Mutex<BTreeMap<[u8; 32], Vec<u32>>> = Mutex::new(BTreeMap::new());

/// Number of modules that are kept, of less than 1 MB each.
const MAX_MADE: usize = 64;

/// Compiler of shaders, an installed program.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Compiler {
    /// Path of the program.
    pub program: PathBuf,
    arguments: &'static [&'static str],
}

impl Compiler {
    /// Returns the compiler on PATH.
    ///
    /// # Errors
    /// Returns an error if none is installed.
    pub fn find() -> Result<Compiler, ShaderError> {
        let path = std::env::var_os("PATH").unwrap_or_default();
        Compiler::in_folders(&path).ok_or(ShaderError::NoCompiler)
    }

    /// Returns the compiler in a list of folders like PATH. Relative folders are not searched.
    fn in_folders(path: &OsStr) -> Option<Compiler> {
        PROGRAMS.iter().find_map(|(name, arguments)| {
            let file = format!("{name}{}", std::env::consts::EXE_SUFFIX);
            let program = std::env::split_paths(path)
                .filter(|folder| folder.is_absolute())
                .map(|folder| folder.join(&file))
                .find(|file| file.is_file())?;
            Some(Compiler { program, arguments })
        })
    }

    /// Returns the first line in which it states its version.
    ///
    /// # Errors
    /// Returns a message if it cannot be run.
    pub fn version(&self) -> Result<String, String> {
        let words = [self.program.as_os_str(), OsStr::new("--version")];
        let (_, lines) = external::output(&words, TIME_LIMIT)?;
        Ok(lines.into_iter().next().unwrap_or_default())
    }

    /// Makes a module: compiles it, unless it was made before, and removes what drivers do not need.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Compiler::compile`].
    pub fn make(&self, sources: &Sources, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
        let texts = texts(sources, recipe)?;
        let key = format!("{self:?} {:?} {texts:?}", recipe.defines);
        let key = *blake3::hash(key.as_bytes()).as_bytes();
        let made = || MADE.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(module) = made().get(&key) {
            return Ok(module.clone());
        }
        let module = shrink(&self.compile_texts(&texts, &recipe.defines, TIME_LIMIT)?);
        let mut made = made();
        if made.len() >= MAX_MADE {
            made.clear();
        }
        made.insert(key, module.clone());
        Ok(module)
    }

    /// Compiles a module with debug names; its stage is given by the extension of its entry (`comp`,
    /// `rgen`, `rchit`, `rahit`, `rint`, `rmiss`).
    ///
    /// # Errors
    /// Returns an error if a file is missing, cannot be read or does not compile, or if the compiler
    /// fails.
    pub fn compile(&self, sources: &Sources, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
        self.compile_texts(&texts(sources, recipe)?, &recipe.defines, TIME_LIMIT)
    }

    /// Compiles the result of [`texts`].
    fn compile_texts(
        &self,
        texts: &[(String, String)],
        defines: &[&str],
        limit: Duration,
    ) -> Result<Vec<u32>, ShaderError> {
        let name = texts[0].0.as_str();
        let failed = |problem: String| ShaderError::Compiler {
            program: self.program.clone(),
            entry: name.to_owned(),
            problem,
        };
        let unwritten = |e: std::io::Error| failed(format!("its input cannot be written: {e}"));
        let folder = tempfile::tempdir().map_err(unwritten)?;
        let stage = Path::new(name).extension().unwrap_or_default();
        let entry = folder.path().join("0").with_extension(stage);
        for (i, (path, text)) in texts.iter().enumerate() {
            let written = match i {
                0 => std::fs::write(&entry, text),
                _ => {
                    let text = format!("#line 1 \"{path}\"\n{text}");
                    std::fs::write(folder.path().join(file_name(i)), text)
                }
            };
            written.map_err(unwritten)?;
        }
        let module = folder.path().join("module.spv");
        let mut command = vec![OsString::from(&self.program)];
        command.extend(self.arguments.iter().map(OsString::from));
        command.extend(defines.iter().map(|name| format!("-D{name}").into()));
        let mut include = OsString::from("-I");
        include.push(folder.path());
        command.extend([include, "-o".into()]);
        command.extend([module.clone(), entry.clone()].map(OsString::from));
        let (status, lines) = external::output(&command, limit).map_err(failed)?;
        let log = problems(&lines, &entry.display().to_string(), name);
        let failed_with = |problem: String| {
            let separator = if log.is_empty() { "" } else { ": " };
            failed(format!("{problem}{separator}{log}"))
        };
        if status.success() {
            let made = std::fs::read(&module).map(|bytes| words(&bytes));
            return match made {
                Ok(words) if is_whole(&words) => Ok(words),
                _ => Err(failed_with("it wrote no module".to_owned())),
            };
        }
        match status.code() {
            Some(_) if !log.is_empty() => Err(ShaderError::Invalid {
                entry: name.to_owned(),
                log,
            }),
            _ => Err(failed_with(format!("it ended with {status}"))),
        }
    }
}

/// Returns path and text of everything that a module is compiled from, the entry first. `#include`
/// lines name the files of positions in the result.
fn texts(sources: &Sources, recipe: &Recipe) -> Result<Vec<(String, String)>, ShaderError> {
    let entry = match &recipe.text {
        Some(text) => text.clone(),
        None => sources.text(&recipe.entry)?.1,
    };
    let mut texts = vec![(recipe.entry.clone(), entry)];
    let (mut positions, mut bytes, mut next) = (BTreeMap::new(), 0, 0);
    while next < texts.len() {
        let mut numbered = String::new();
        for line in without_comments(&texts[next].1).lines() {
            let Some((name, rest)) = included(line) else {
                numbered.extend([line, "\n"]);
                continue;
            };
            if !positions.contains_key(name) {
                let mut generated = recipe.generated.iter();
                let found = match generated.find(|(path, _)| path == name) {
                    Some(found) => Ok(found.clone()),
                    None => sources.text(name),
                };
                match found {
                    Ok(found) => {
                        bytes += found.1.len();
                        if bytes > MAX_BYTES {
                            let log = format!("it includes more than {MAX_BYTES} bytes");
                            let entry = recipe.entry.clone();
                            return Err(ShaderError::Invalid { entry, log });
                        }
                        positions.insert(name.to_owned(), texts.len());
                        texts.push(found);
                    }
                    // The compiler reports it, unless the line is in a part that is left out.
                    Err(ShaderError::Missing(_)) => {}
                    Err(error) => return Err(error),
                }
            }
            let named = match positions.get(name) {
                Some(at) => file_name(*at),
                None => ShaderError::Missing(name.replace('"', "'")).to_string(),
            };
            numbered.push_str(&format!("#include \"{named}\"{rest}\n"));
        }
        texts[next].1 = numbered;
        next += 1;
    }
    Ok(texts)
}

/// Returns the name of the file of an included text by its position.
fn file_name(at: usize) -> String {
    format!("{at}.text")
}

/// Returns the name in an `#include` line, and what follows it.
fn included(line: &str) -> Option<(&str, &str)> {
    let directive = line.trim_start().strip_prefix('#')?.trim_start();
    let name = directive.strip_prefix("include")?.trim_start();
    match name.strip_prefix('"') {
        Some(name) => name.split_once('"'),
        None => name.strip_prefix('<')?.split_once('>'),
    }
}

/// Returns a text in which comments are spaces and continued lines are joined, with all other lines
/// where they were, so that every `#include` has a line of its own, as the compiler will see it.
fn without_comments(text: &str) -> String {
    let (mut joined, mut breaks) = (String::new(), 0);
    for line in text.replace("\r\n", "\n").replace('\r', "\n").lines() {
        breaks += 1;
        let continued = line.strip_suffix('\\');
        joined.push_str(continued.unwrap_or(line));
        if continued.is_none() {
            joined.extend(std::iter::repeat_n('\n', std::mem::take(&mut breaks)));
        }
    }
    let (mut plain, mut rest) = (String::new(), joined.as_str());
    while let Some(at) = rest.find(['/', '"']) {
        let (code, tail) = rest.split_at(at);
        plain.push_str(code);
        let (is_comment, end) = match tail.as_bytes() {
            [b'/', b'/', ..] => (true, tail.find('\n')),
            [b'/', b'*', ..] => {
                let end = tail[2..].find("*/").map(|end| end + 4);
                // The compiler reports a comment that does not end.
                (end.is_some(), end)
            }
            [b'"', ..] => (false, tail[1..].find(['"', '\n']).map(|end| end + 2)),
            _ => (false, Some(1)),
        };
        let (part, after) = tail.split_at(end.unwrap_or(tail.len()));
        if is_comment {
            plain.push(' ');
            plain.extend(part.matches('\n'));
        } else {
            plain.push_str(part);
        }
        rest = after;
    }
    plain + rest
}

/// Returns the messages about the texts in the output of a compiler that read the entry from a file.
fn problems(lines: &[String], file: &str, entry: &str) -> String {
    let ends = |line: &&String| SUMMARIES.iter().any(|summary| line.contains(summary));
    let told = lines.iter().take_while(|line| !ends(line));
    told.map(|line| line.replace(file, entry))
        .filter(|line| line != entry)
        .map(|line| {
            line.replacen(": error: ", ": ", 1)
                .replacen("ERROR: ", "", 1)
        })
        .take(MAX_LINES)
        .collect::<Vec<_>>()
        .join("\n")
}

#[cfg(test)]
#[path = "glsl_tests.rs"]
mod tests;
