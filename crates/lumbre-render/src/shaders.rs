//! Choice of the shaders of a run: those of the program, or those of a folder, which backends of
//! devices compile when the run is opened.

use std::path::PathBuf;

/// Word of render tables for the shaders of the program.
pub const BUILT_IN: &str = "built-in";

/// Choice of the shaders of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum Shaders {
    /// Those of the folder that the environment names, or else those of the program.
    #[default]
    Unset,
    /// Those of the program.
    BuiltIn,
    /// Those of a folder.
    Folder(ShaderFolder),
}

/// A folder of shaders, laid out like that of the program. Files that it lacks are the program's.
#[derive(Clone, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub struct ShaderFolder {
    /// Path of the folder.
    pub path: PathBuf,
    /// Hash of the files that differ from those of the program, in hexadecimal; empty before a
    /// backend has read the folder.
    pub hash: String,
}

impl Shaders {
    /// Returns the folder, if there is one.
    pub fn folder(&self) -> Option<&ShaderFolder> {
        match self {
            Shaders::Folder(folder) => Some(folder),
            Shaders::Unset | Shaders::BuiltIn => None,
        }
    }

    /// Resolves the choice for a backend that has no shaders.
    ///
    /// # Errors
    /// Returns the reason why a folder cannot be used.
    pub fn without_device(&self) -> Result<Shaders, String> {
        match self {
            Shaders::Folder(_) => Err(
                "it has no shaders that a folder could replace; leave out `shaders`, or set \
                 `backend` to one of Vulkan"
                    .to_owned(),
            ),
            Shaders::Unset | Shaders::BuiltIn => Ok(Shaders::BuiltIn),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_refused_where_there_are_no_shaders() {
        let folder = Shaders::Folder(ShaderFolder {
            path: "mine".into(),
            hash: String::new(),
        });
        assert!(folder.folder().is_some());
        assert!(folder.without_device().unwrap_err().contains("`shaders`"));
        for own in [Shaders::BuiltIn, Shaders::Unset] {
            assert_eq!(
                (own.folder(), own.without_device()),
                (None, Ok(Shaders::BuiltIn))
            );
        }
    }
}
