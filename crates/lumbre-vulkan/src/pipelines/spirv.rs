//! Compiles GLSL to SPIR-V in the process itself, on demand, from sources embedded in the program
//! or from a folder of modified ones. Needs no device.
//!
//! Names in `#include` lines are paths from the root of the shader folder, wherever they appear.

use std::path::{Path, PathBuf};

use glslang::include::{IncludeHandler, IncludeResult, IncludeType};
use glslang::{
    Compiler, CompilerOptions, ShaderInput, ShaderMessage, ShaderSource, ShaderStage,
    SourceLanguage, SpirvVersion, Target, VulkanVersion,
};

/// Embeds the listed files of `shaders/`.
macro_rules! embed {
    ($($path:literal),* $(,)?) => {
        /// Embedded sources: path below `shaders/`, text.
        pub const EMBEDDED: &[(&str, &str)] =
            &[$(($path, include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $path)))),*];
    };
}

embed![
    "instance_transform.glsl",
    "entry/compute.comp",
    "entry/generation.rgen",
    "entry/mask.rahit",
    "entry/miss.rmiss",
    "entry/query.comp",
    "entry/samples.glsl",
    "entry/sphere.rchit",
    "entry/sphere.rint",
    "entry/triangle.rchit",
    "film/film.glsl",
    "film/layers.glsl",
    "film/paths.glsl",
    "film/splat.glsl",
    "film/sums.glsl",
    "film/time.glsl",
    "gen/layout.glsl",
    "math/distribution.glsl",
    "math/trig.glsl",
    "math/frame.glsl",
    "math/piecewise.glsl",
    "math/rng.glsl",
    "math/warp.glsl",
    "scene.glsl",
    "trace/bvh.glsl",
    "trace/instances.glsl",
    "trace/intersect.glsl",
    "trace/payload.glsl",
    "trace/pipeline.glsl",
    "trace/query.glsl",
    "transport/bsdf/beckmann.glsl",
    "transport/bsdf/clearcoat.glsl",
    "transport/bsdf/conductor.glsl",
    "transport/bsdf/dielectric.glsl",
    "transport/bsdf/diffuse.glsl",
    "transport/bsdf/disney.glsl",
    "transport/bsdf/facets.glsl",
    "transport/bsdf/fresnel.glsl",
    "transport/bsdf/ggx.glsl",
    "transport/bsdf/glass.glsl",
    "transport/bsdf/ideal.glsl",
    "transport/bsdf/interface.glsl",
    "transport/bsdf/lambert.glsl",
    "transport/bsdf/lobe.glsl",
    "transport/bsdf/mirror.glsl",
    "transport/bsdf/mod.glsl",
    "transport/bsdf/plastic.glsl",
    "transport/camera/filter.glsl",
    "transport/camera/lens.glsl",
    "transport/contribution.glsl",
    "transport/delay/profile.glsl",
    "transport/path_time.glsl",
    "transport/integrator/bdpt/connect.glsl",
    "transport/integrator/bdpt/mod.glsl",
    "transport/integrator/bdpt/subpath.glsl",
    "transport/integrator/bdpt/weights.glsl",
    "transport/integrator/bpt.glsl",
    "transport/integrator/nee.glsl",
    "transport/integrator/settings.glsl",
    "transport/light/area.glsl",
    "transport/light/bounds.glsl",
    "transport/light/directional.glsl",
    "transport/light/environment.glsl",
    "transport/light/mod.glsl",
    "transport/light/point.glsl",
    "transport/light/sphere.glsl",
    "transport/light/types.glsl",
    "transport/mis.glsl",
    "transport/mod.glsl",
    "transport/ray.glsl",
    "transport/sampler/independent.glsl",
    "transport/sampler/mod.glsl",
    "transport/sampler/sobol.glsl",
    "transport/surface.glsl",
    "transport/vertex.glsl",
];

/// Environment variable that names a folder of modified shaders; its contents are part of the
/// identity of runs.
pub const FOLDER_VARIABLE: &str = "LUMBRE_SHADERS";

/// Source of shaders.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sources {
    /// The sources embedded in the program.
    Embedded,
    /// A folder laid out like `shaders/`; missing files are taken from the embedded sources.
    Folder(PathBuf),
}

/// Reason why a shader cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShaderError {
    /// The file does not exist.
    #[error("the shader `{0}` does not exist, neither in {FOLDER_VARIABLE} nor in the program")]
    Missing(String),
    /// A file of the folder cannot be read.
    #[error("the shader {file} cannot be read: {problem}")]
    Unreadable {
        /// Path of the file.
        file: String,
        /// Message of the operating system.
        problem: String,
    },
    /// The text does not compile.
    #[error("the shader `{entry}` does not compile:\n{log}")]
    Invalid {
        /// File that was compiled; the log names included ones.
        entry: String,
        /// Compiler messages, `file:line: message` each.
        log: String,
    },
}

impl Sources {
    /// Returns the sources that [`FOLDER_VARIABLE`] selects.
    pub fn from_env() -> Sources {
        let folder = std::env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty());
        folder.map_or(Sources::Embedded, |folder| Sources::Folder(folder.into()))
    }

    /// Returns a hash of the shaders that differ from the embedded ones, or `None` if none does.
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
        if !EMBEDDED.iter().any(|(name, _)| folder.join(name).is_file()) {
            return Err(unreadable(
                "it contains none of the files of the program's shaders/ folder",
            ));
        }
        let (mut hasher, mut any) = (blake3::Hasher::new(), false);
        for (name, embedded) in EMBEDDED {
            let text = self.text(name)?;
            if text != *embedded {
                any = true;
                hasher
                    .update(name.as_bytes())
                    .update(&[0])
                    .update(text.as_bytes())
                    .update(&[0]);
            }
        }
        Ok(any.then(|| hasher.finalize().to_hex().to_string()))
    }

    /// Returns the text of a shader by its path below the root.
    ///
    /// # Errors
    /// Returns an error if it does not exist or cannot be read.
    pub fn text(&self, path: &str) -> Result<String, ShaderError> {
        if let Sources::Folder(folder) = self {
            let file = folder.join(path);
            match std::fs::read_to_string(&file) {
                Ok(text) => return Ok(text),
                Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
                Err(e) => {
                    let (file, problem) = (file.display().to_string(), e.to_string());
                    return Err(ShaderError::Unreadable { file, problem });
                }
            }
        }
        let embedded = EMBEDDED.iter().find(|(name, _)| *name == path);
        embedded
            .map(|(_, text)| (*text).to_owned())
            .ok_or_else(|| ShaderError::Missing(path.to_owned()))
    }

    /// Returns whether there is a shader of this path.
    pub fn has(&self, path: &str) -> bool {
        self.text(path).is_ok()
    }

    /// Compiles a shader; its stage is given by its extension (`comp`, `rgen`, `rchit`, `rahit`,
    /// `rint`, `rmiss`).
    ///
    /// `defines` are set before its first line; `generated` are texts that it may include as if
    /// they were files.
    ///
    /// # Errors
    /// Returns an error if a file is missing, cannot be read, or does not compile.
    pub fn compile(
        &self,
        path: &str,
        defines: &[(&str, String)],
        generated: &[(&str, String)],
    ) -> Result<Vec<u32>, ShaderError> {
        compile(self, path, &self.text(path)?, defines, generated)
    }
}

/// Compiles a text as if it were a file called `path`; it may include files of `sources`.
///
/// # Errors
/// Returns an error if an included file is missing or cannot be read, or the text does not compile.
pub fn compile(
    sources: &Sources,
    path: &str,
    text: &str,
    defines: &[(&str, String)],
    generated: &[(&str, String)],
) -> Result<Vec<u32>, ShaderError> {
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
    if text.contains('\0') {
        return Err(invalid("it contains a zero byte".to_owned()));
    }
    let source = ShaderSource::from(text);
    let mut include = Include {
        sources,
        generated,
        failed: None,
    };
    let defines: Vec<(&str, Option<&str>)> = defines
        .iter()
        .map(|(name, value)| (*name, Some(value.as_str())))
        .collect();
    let compiled = ShaderInput::new(&source, stage, &options, Some(&defines), Some(&mut include))
        .and_then(|input| compiler.create_shader(input))
        .and_then(|shader| shader.compile());
    match (compiled, include.failed) {
        (_, Some(failed)) => Err(failed),
        (Ok(words), None) => Ok(words),
        (Err(error), None) => Err(invalid(extract_problems(&error.to_string(), path))),
    }
}

/// Returns whether SPIR-V needs double precision: OpCapability Float64.
pub fn uses_doubles(words: &[u32]) -> bool {
    let mut rest = words.get(5..).unwrap_or_default();
    while let [first, second, ..] = rest
        && first & 0xffff == 17
    {
        if *second == 10 {
            return true;
        }
        rest = &rest[2..];
    }
    false
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
    generated: &'a [(&'a str, String)],
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
            Ok(data) => Some(IncludeResult {
                name: header.to_owned(),
                data,
            }),
            Err(error) => {
                self.failed.get_or_insert(error);
                None
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::pipelines::spirv::*;

    const HEAD: &str = "#version 460\n#extension GL_GOOGLE_include_directive : require\n";

    #[test]
    fn every_file_of_the_folder_is_embedded() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("shaders");
        let (mut open, mut found) = (vec![root.clone()], BTreeSet::new());
        while let Some(folder) = open.pop() {
            for path in std::fs::read_dir(folder)
                .unwrap()
                .map(|e| e.unwrap().path())
            {
                if path.is_dir() {
                    open.push(path);
                } else {
                    found.insert(
                        path.strip_prefix(&root)
                            .unwrap()
                            .to_string_lossy()
                            .replace('\\', "/"),
                    );
                }
            }
        }
        let embedded: BTreeSet<String> = EMBEDDED
            .iter()
            .map(|(name, _)| (*name).to_owned())
            .collect();
        assert_eq!(
            embedded, found,
            "the list in crates/lumbre-vulkan/src/pipelines/spirv.rs and the folder shaders/ differ"
        );
    }

    #[test]
    fn errors_name_file_and_line_also_in_headers() {
        let dir = tempfile::tempdir().unwrap();
        std::fs::write(
            dir.path().join("scene.glsl"),
            "int fine;\nint broken = nothing;\n",
        )
        .unwrap();
        let sources = Sources::Folder(dir.path().to_owned());
        let text = format!("{HEAD}#include \"scene.glsl\"\nvoid main() {{}}\n");
        let error = compile(&sources, "entry/a.comp", &text, &[], &[])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("scene.glsl:2") && error.contains("nothing"),
            "{error}"
        );
        let text = format!("{HEAD}void main() {{ nonsense(); }}\n");
        let error = compile(&Sources::Embedded, "entry/a.comp", &text, &[], &[])
            .unwrap_err()
            .to_string();
        assert!(
            error.contains("entry/a.comp:3") && error.contains("nonsense"),
            "{error}"
        );
    }

    #[test]
    fn a_missing_header_is_named() {
        let text = format!("{HEAD}#include \"transport/nowhere.glsl\"\nvoid main() {{}}\n");
        let error = compile(&Sources::Embedded, "a.comp", &text, &[], &[]).unwrap_err();
        assert_eq!(
            error,
            ShaderError::Missing("transport/nowhere.glsl".to_owned())
        );
    }

    #[test]
    fn a_folder_is_hashed_by_its_differences() {
        let dir = tempfile::tempdir().unwrap();
        let sources = Sources::Folder(dir.path().to_owned());
        assert_eq!(Sources::Embedded.edited(), Ok(None));
        assert!(
            sources
                .edited()
                .unwrap_err()
                .to_string()
                .contains("none of the files")
        );
        let gone = Sources::Folder(dir.path().join("nowhere"))
            .edited()
            .unwrap_err()
            .to_string();
        assert!(
            gone.contains("nowhere") && gone.contains("no such folder"),
            "{gone}"
        );
        let embedded = Sources::Embedded.text("scene.glsl").unwrap();
        std::fs::write(dir.path().join("scene.glsl"), &embedded).unwrap();
        assert_eq!(
            sources.edited(),
            Ok(None),
            "an identical copy is not a modification"
        );
        std::fs::write(dir.path().join("scene.glsl"), format!("{embedded}// mine")).unwrap();
        let first = sources.edited().unwrap();
        std::fs::write(dir.path().join("scene.glsl"), format!("{embedded}// yours")).unwrap();
        assert!(first.is_some() && sources.edited().unwrap() != first);
    }

    #[test]
    fn doubles_are_detected() {
        let words = |ty: &str| {
            let text = format!(
                "{HEAD}layout(binding = 0) buffer B {{ {ty} x; }}; void main() {{ x = x * x; }}\n"
            );
            compile(&Sources::Embedded, "a.comp", &text, &[], &[]).unwrap()
        };
        assert!(uses_doubles(&words("double")) && !uses_doubles(&words("float")));
    }

    #[test]
    fn defines_reach_the_text() {
        let text = format!("{HEAD}void main() {{ int x = WIDTH; }}\n");
        assert!(compile(&Sources::Embedded, "a.comp", &text, &[], &[]).is_err());
        assert!(
            compile(
                &Sources::Embedded,
                "a.comp",
                &text,
                &[("WIDTH", "8".to_owned())],
                &[]
            )
            .is_ok()
        );
    }
}
