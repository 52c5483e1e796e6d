//! Compiles GLSL to SPIR-V in the process itself. Needs no device; only with the feature
//! `shader-dev`.
//!
//! Names in `#include` lines are paths from the root of the shader folder, wherever they appear.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};

use super::modules::Recipe;
use super::shrink::shrink;
use super::sources::{ShaderError, Sources};
use super::texts::TEXTS;
use lumbre_light::scene::load::files;

/// Endings of the files that are shaders. Other files of a folder are not read.
const ENDINGS: [&str; 7] = ["glsl", "comp", "rgen", "rchit", "rahit", "rint", "rmiss"];

/// Greatest number of files and folders in a folder of shaders.
const MAX_ENTRIES: usize = 10_000;

/// Greatest depth of folders in a folder of shaders.
const MAX_DEPTH: usize = 16;

impl Sources {
    /// Returns a hash of the shaders that differ from those of the program, or `None` if none does.
    /// Shaders that the program does not have count too, since others may include them.
    ///
    /// # Errors
    /// Returns an error if the folder does not exist, one of its files cannot be read, none of them
    /// is a shader of this program, or there are too many.
    pub fn edited(&self) -> Result<Option<String>, ShaderError> {
        let Sources::Folder(folder) = self else {
            return Ok(None);
        };
        let unreadable = |problem: &str| ShaderError::Unreadable {
            file: format!("folder {}", folder.display()),
            problem: problem.to_owned(),
        };
        if !folder.is_dir() {
            return Err(unreadable("no such folder"));
        }
        if !TEXTS.iter().any(|(name, _)| folder.join(name).is_file()) {
            return Err(unreadable(
                "it contains none of the files of the program's shaders/ folder",
            ));
        }
        let mut found = BTreeSet::new();
        list(folder, "", &mut found, &mut 0).map_err(|problem| unreadable(&problem))?;
        let embedded = TEXTS.iter().map(|(name, text)| (*name, Some(*text)));
        let known: BTreeSet<&str> = TEXTS.iter().map(|(name, _)| *name).collect();
        let further = found.iter().map(String::as_str);
        let further = further.filter(|name| !known.contains(name));
        let (mut hasher, mut any) = (blake3::Hasher::new(), false);
        for (name, embedded) in embedded.chain(further.map(|name| (name, None))) {
            let (_, text) = self.text(name)?;
            if Some(text.as_str()) != embedded {
                any = true;
                for part in [name.as_bytes(), &[0], text.as_bytes(), &[0]] {
                    hasher.update(part);
                }
            }
        }
        Ok(any.then(|| hasher.finalize().to_hex().to_string()))
    }

    /// Returns whether there is a shader of this integrator.
    pub fn has_integrator(&self, name: &str) -> bool {
        self.text(&format!("transport/integrator/{name}")).is_ok()
    }

    /// Returns path and text of a shader by its path below the root; a path without an extension is
    /// that of `PATH.glsl` or `PATH/mod.glsl`.
    ///
    /// # Errors
    /// Returns an error if it does not exist or cannot be read.
    fn text(&self, path: &str) -> Result<(String, String), ShaderError> {
        let candidates = if Path::new(path).extension().is_some() {
            vec![path.to_owned()]
        } else {
            vec![format!("{path}.glsl"), format!("{path}/mod.glsl")]
        };
        for candidate in candidates {
            if let Some(text) = self.file(&candidate)? {
                return Ok((candidate, text));
            }
        }
        Err(ShaderError::Missing(path.to_owned()))
    }

    /// Returns the text of a file of the folder or, if it has none, of the program.
    fn file(&self, path: &str) -> Result<Option<String>, ShaderError> {
        if let Sources::Folder(folder) = self
            && is_shader(path)
        {
            let file = folder.join(path);
            let unreadable = |problem: String| ShaderError::Unreadable {
                file: file.display().to_string(),
                problem,
            };
            if file.exists() {
                files::check(&file).map_err(unreadable)?;
                let text = std::fs::read_to_string(&file);
                return text.map(Some).map_err(|e| unreadable(e.to_string()));
            }
        }
        let embedded = TEXTS.iter().find(|(name, _)| *name == path);
        Ok(embedded.map(|(_, text)| (*text).to_owned()))
    }
}

/// Returns whether a path is that of a shader below the root of a folder.
fn is_shader(path: &str) -> bool {
    let path = Path::new(path);
    let ending = path.extension().and_then(|ending| ending.to_str());
    let mut parts = path.components();
    parts.all(|part| matches!(part, Component::Normal(_)))
        && ending.is_some_and(|ending| ENDINGS.contains(&ending))
}

/// Adds the paths of the shaders in a folder, each after `prefix`, with slashes between the folders.
/// `entries` counts what was looked at. The error is the reason why the folder cannot be listed.
fn list(
    folder: &Path,
    prefix: &str,
    found: &mut BTreeSet<String>,
    entries: &mut usize,
) -> Result<(), String> {
    for entry in std::fs::read_dir(folder).map_err(|e| e.to_string())? {
        let path = entry.map_err(|e| e.to_string())?.path();
        *entries += 1;
        let depth = prefix.matches('/').count();
        if *entries > MAX_ENTRIES || depth > MAX_DEPTH {
            return Err(format!(
                "it has more than {MAX_ENTRIES} files, or folders deeper than {MAX_DEPTH}"
            ));
        }
        let Some(name) = path.file_name().and_then(|name| name.to_str()) else {
            continue;
        };
        let below = format!("{prefix}{name}");
        if path.is_dir() {
            list(&path, &format!("{below}/"), found, entries)?;
        } else if is_shader(&below) {
            found.insert(below);
        }
    }
    Ok(())
}

/// Makes a module: compiles it and removes what drivers do not need.
///
/// # Errors
/// Returns an error if a file is missing, cannot be read, or does not compile.
pub fn make(sources: &Sources, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
    Ok(shrink(&compile(sources, recipe)?))
}

/// Compiles a module with debug names; its stage is given by the extension of its entry (`comp`,
/// `rgen`, `rchit`, `rahit`, `rint`, `rmiss`).
///
/// # Errors
/// Returns an error if a file is missing, cannot be read, or does not compile.
pub fn compile(sources: &Sources, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
    let path = recipe.entry.as_str();
    let invalid = |log: String| ShaderError::Invalid {
        entry: path.to_owned(),
        log,
    };
    let stage = stage_of(path)
        .ok_or_else(|| invalid("its file extension is not that of a shader stage".to_owned()))?;
    let compiler = Compiler::acquire()
        .ok_or_else(|| invalid("the GLSL compiler cannot be started".to_owned()))?;
    let options = CompilerOptions {
        source_language: SourceLanguage::GLSL,
        target: Target::Vulkan {
            version: VulkanVersion::Vulkan1_2,
            spirv_version: SpirvVersion::SPIRV1_5,
        },
        messages: ShaderMessage::DEFAULT,
        version_profile: None,
    };
    let text = match &recipe.text {
        Some(text) => text.clone(),
        None => sources.text(path)?.1,
    };
    if text.contains('\0') {
        return Err(invalid("it contains a zero byte".to_owned()));
    }
    let source = ShaderSource::from(text.as_str());
    let mut include = Include {
        sources,
        generated: &recipe.generated,
        failed: None,
    };
    let defines: Vec<(&str, Option<&str>)> =
        recipe.defines.iter().map(|name| (*name, None)).collect();
    let compiled = ShaderInput::new(&source, stage, &options, Some(&defines), Some(&mut include))
        .and_then(|input| compiler.create_shader(input))
        .and_then(|shader| shader.compile());
    match (compiled, include.failed) {
        (_, Some(failed)) => Err(failed),
        (Ok(words), None) => Ok(words),
        (Err(error), None) => Err(invalid(extract_problems(&error.to_string(), path))),
    }
}

fn stage_of(path: &str) -> Option<ShaderStage> {
    match Path::new(path).extension()?.to_str()? {
        "comp" => Some(ShaderStage::Compute),
        "rgen" => Some(ShaderStage::RayGeneration),
        "rchit" => Some(ShaderStage::ClosestHit),
        "rahit" => Some(ShaderStage::AnyHit),
        "rint" => Some(ShaderStage::Intersect),
        "rmiss" => Some(ShaderStage::Miss),
        _ => None,
    }
}

/// Extracts the errors and warnings of a compiler log. The compiler calls the first text `0`.
fn extract_problems(log: &str, path: &str) -> String {
    let problem = |line: &&str| line.starts_with("ERROR:") || line.starts_with("WARNING:");
    let lines: Vec<String> = log
        .lines()
        .map(|l| l.strip_prefix("Log:").unwrap_or(l))
        .filter(problem)
        .filter(|l| !l.contains("compilation errors"))
        .map(|l| {
            l.trim_start_matches("ERROR: ").replacen(
                "0:",
                &format!("{path}:"),
                usize::from(l.contains(": 0:")),
            )
        })
        .collect();
    if lines.is_empty() {
        log.to_owned()
    } else {
        lines.join("\n")
    }
}

/// Resolves `#include` lines.
struct Include<'a> {
    sources: &'a Sources,
    generated: &'a [(String, String)],
    failed: Option<ShaderError>,
}

impl IncludeHandler for Include<'_> {
    fn include(
        &mut self,
        _: IncludeType,
        header: &str,
        _: &str,
        _: usize,
    ) -> Option<IncludeResult> {
        if let Some((_, data)) = self.generated.iter().find(|(name, _)| *name == header) {
            return Some(IncludeResult {
                name: header.to_owned(),
                data: data.clone(),
            });
        }
        match self.sources.text(header) {
            Ok((name, data)) => Some(IncludeResult { name, data }),
            Err(error) => {
                self.failed.get_or_insert(error);
                None
            }
        }
    }
}

#[cfg(test)]
#[path = "glsl_tests.rs"]
mod tests;
