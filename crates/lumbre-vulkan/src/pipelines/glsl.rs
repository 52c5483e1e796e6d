//! Compiles GLSL to SPIR-V in the process itself. Needs no device; only with the feature
//! `shader-dev`.
//!
//! Names in `#include` lines are paths from the root of the shader folder, wherever they appear.

use std::path::Path;

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};

use super::modules::Recipe;
use super::shrink::shrink;
use super::sources::{FOLDER_VARIABLE, ShaderError, Sources};
use super::texts::TEXTS;

impl Sources {
    /// Returns a hash of the shaders that differ from those of the program, or `None` if none does.
    ///
    /// # Errors
    /// Returns an error if the folder does not exist, one of its files cannot be read, or none of
    /// them is a shader of this program.
    pub fn edited(&self) -> Result<Option<String>, ShaderError> {
        let Sources::Folder(folder) = self else {
            return Ok(None);
        };
        let unreadable = |problem: &str| ShaderError::Unreadable {
            file: format!("folder {} in {FOLDER_VARIABLE}", folder.display()),
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
        let (mut hasher, mut any) = (blake3::Hasher::new(), false);
        for (name, embedded) in TEXTS {
            let (_, text) = self.text(name)?;
            if text != *embedded {
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
        if let Sources::Folder(folder) = self {
            let file = folder.join(path);
            match std::fs::read_to_string(&file) {
                Ok(text) => return Ok(Some(text)),
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
                Err(e) => {
                    let (file, problem) = (file.display().to_string(), e.to_string());
                    return Err(ShaderError::Unreadable { file, problem });
                }
            }
        }
        let embedded = TEXTS.iter().find(|(name, _)| *name == path);
        Ok(embedded.map(|(_, text)| (*text).to_owned()))
    }
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
