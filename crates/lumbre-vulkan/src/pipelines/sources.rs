//! Sources of shader modules: the SPIR-V in the program, or a folder of modified GLSL, which is
//! compiled when a run is opened.

use std::path::PathBuf;
use std::sync::Arc;

use lumbre_render::shaders::{ShaderFolder, Shaders};

use super::committed;
use super::modules::Recipe;

/// Environment variable that names the folder of shaders of runs whose render table has no
/// `shaders`.
pub const FOLDER_VARIABLE: &str = "LUMBRE_SHADERS";

/// Source of shader modules.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Sources {
    /// The SPIR-V in the program.
    Embedded,
    /// A folder laid out like `shaders/`; missing files are taken from the texts in the program.
    /// Needs the feature `shader-dev`.
    Folder(PathBuf),
    /// Modules by file name that replace those of the program: each with the bytes of its SPIR-V.
    Replaced(Arc<[(&'static str, &'static [u8])]>),
}

/// Reason why a shader cannot be used.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShaderError {
    /// The folder of modified shaders cannot be compiled.
    #[error(
        "this program was built without the compiler of shaders, which a folder of shaders needs; \
         build it with `--features shader-dev` and a C++ compiler, or leave out `shaders` and unset \
         {FOLDER_VARIABLE}"
    )]
    NoCompiler,
    /// The files of a folder are no longer those that the plan was made for.
    #[error(
        "the shaders in {} have changed since the plan was made; run the command again, which \
         plans with the files as they are", .0.display()
    )]
    Changed(PathBuf),
    /// The program has no module of this name.
    #[error("the program has no shader module `{0}`; make it with `cargo shaders`")]
    NoModule(String),
    /// The file does not exist.
    #[error("the shader `{0}` does not exist, neither in the folder of shaders nor in the program")]
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

/// Whether this program contains the compiler of shaders, which is the feature `shader-dev` of this
/// crate. A build of the whole workspace has it, because `xtask` needs it.
pub const HAS_COMPILER: bool = cfg!(feature = "shader-dev");

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

    /// Returns the words of a module.
    ///
    /// # Errors
    /// Returns an error if the program does not have it or, of a folder, it cannot be compiled.
    pub fn module(&self, recipe: &Recipe) -> Result<Vec<u32>, ShaderError> {
        let replaced = match self {
            Sources::Embedded => None,
            #[cfg(feature = "shader-dev")]
            Sources::Folder(_) => return super::glsl::make(self, recipe),
            #[cfg(not(feature = "shader-dev"))]
            Sources::Folder(_) => return Err(ShaderError::NoCompiler),
            Sources::Replaced(modules) => modules.iter().find(|(file, _)| *file == recipe.file),
        };
        replaced
            .map(|(_, bytes)| words(bytes))
            .or_else(|| committed::module(&recipe.file).map(|bytes| words(&bytes)))
            .ok_or_else(|| ShaderError::NoModule(recipe.file.clone()))
    }
}

/// Returns the words of a SPIR-V file.
pub fn words(bytes: &[u8]) -> Vec<u32> {
    let words = bytes.as_chunks::<4>().0.iter();
    words.map(|word| u32::from_le_bytes(*word)).collect()
}

#[cfg(not(feature = "shader-dev"))]
impl Sources {
    /// Returns `None`: shaders cannot be modified.
    ///
    /// # Errors
    /// Returns an error if a folder is selected.
    pub fn edited(&self) -> Result<Option<String>, ShaderError> {
        match self {
            Sources::Folder(_) => Err(ShaderError::NoCompiler),
            Sources::Embedded | Sources::Replaced(_) => Ok(None),
        }
    }

    /// Returns whether there is a shader of this integrator.
    pub fn has_integrator(&self, name: &str) -> bool {
        let of = |file: &str| file.split('.').next() == Some(name);
        committed::files().any(of)
    }
}
