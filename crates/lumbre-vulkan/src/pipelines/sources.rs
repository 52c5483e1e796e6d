//! Sources of shader modules: the SPIR-V in the program, or a folder of modified GLSL, which is
//! compiled when a run is opened.

use std::collections::BTreeSet;
use std::path::{Component, Path, PathBuf};
use std::sync::Arc;

use lumbre_render::shaders::{ShaderFolder, Shaders};
use lumbre_scene_io::load::files;

pub use super::shader_error::{FOLDER_VARIABLE, ShaderError};

/// Texts of the shaders: path below `shaders/`, text; sorted. They complete folders of modified
/// shaders, and the check for stale modules hashes them.
pub static TEXTS: &[(&str, &str)] = include!(concat!(env!("OUT_DIR"), "/texts.rs"));

/// Source of shader modules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sources {
    /// The SPIR-V in the program.
    Embedded,
    /// A folder laid out like `shaders/`; missing files are taken from the texts in the program.
    /// Needs a [compiler](super::glsl::Compiler).
    Folder(PathBuf),
    /// Modules by file name that replace those of the program: each with the bytes of its SPIR-V.
    Replaced(Arc<[(&'static str, &'static [u8])]>),
}

/// Endings of the files that are shaders. Other files of a folder are not read.
const ENDINGS: [&str; 7] = ["glsl", "comp", "rgen", "rchit", "rahit", "rint", "rmiss"];

/// Greatest number of files and folders in a folder of shaders.
const MAX_ENTRIES: usize = 10_000;

/// Greatest depth of folders in a folder of shaders.
const MAX_DEPTH: usize = 16;

/// Greatest size of a shader in bytes.
const MAX_BYTES: u64 = 16 << 20;

impl Sources {
    /// Returns the sources that a run selects, or else [`FOLDER_VARIABLE`].
    pub fn selected(shaders: &Shaders) -> Sources {
        match shaders {
            Shaders::Folder(folder) => Sources::Folder(folder.path.clone()),
            Shaders::BuiltIn => Sources::Embedded,
            Shaders::Unset => {
                let folder = std::env::var_os(FOLDER_VARIABLE).filter(|folder| !folder.is_empty());
                folder.map_or(Sources::Embedded, |folder| Sources::Folder(folder.into()))
            }
        }
    }

    /// Returns the sources of a run, whose plan may have resolved them.
    ///
    /// # Errors
    /// Returns an error if the files of a folder cannot be read, or are not those of the plan.
    pub fn of(shaders: &Shaders) -> Result<Sources, ShaderError> {
        let sources = Sources::selected(shaders);
        match shaders.folder() {
            Some(planned) if !planned.hash.is_empty() => match sources.resolved()? {
                Shaders::Folder(found) if found == *planned => Ok(sources),
                _ => Err(ShaderError::Changed(planned.path.clone())),
            },
            _ => Ok(sources),
        }
    }

    /// Returns the choice that selects these sources on every machine: the folder with the hash of
    /// its differences, or the shaders of the program if nothing differs.
    ///
    /// # Errors
    /// Returns an error in the cases of [`Sources::edited`].
    pub fn resolved(&self) -> Result<Shaders, ShaderError> {
        Ok(match (self, self.edited()?) {
            (Sources::Folder(path), Some(hash)) => Shaders::Folder(ShaderFolder {
                path: path.clone(),
                hash,
            }),
            _ => Shaders::BuiltIn,
        })
    }

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
    pub(super) fn text(&self, path: &str) -> Result<(String, String), ShaderError> {
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
            if let Ok(found) = file.metadata() {
                files::check(&file).map_err(unreadable)?;
                if !found.is_file() || found.len() > MAX_BYTES {
                    return Err(unreadable("it is no file of at most 16 MiB".to_owned()));
                }
                let text = std::fs::read_to_string(&file);
                return text.map(Some).map_err(|e| unreadable(e.to_string()));
            }
        }
        let embedded = TEXTS.iter().find(|(name, _)| *name == path);
        Ok(embedded.map(|(_, text)| (*text).to_owned()))
    }
}

/// Returns the words of a SPIR-V file.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    let words = bytes.as_chunks::<4>().0.iter();
    words.map(|word| u32::from_le_bytes(*word)).collect()
}

/// Returns whether a path is that of a shader below the root of a folder.
pub(super) fn is_shader(path: &str) -> bool {
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
