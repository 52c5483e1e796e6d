//! The folder of an exported scene.

use std::path::{Path, PathBuf};

use crate::names::UniqueNames;
use lumbre_light::scene::SceneError;

/// Output folder: its path and the files written so far.
pub(super) struct OutputFolder {
    pub(super) root: PathBuf,
    pub(super) files: Vec<PathBuf>,
    pub(super) names: UniqueNames,
}

impl OutputFolder {
    /// Creates an output folder without files.
    pub(super) fn new(root: &Path) -> OutputFolder {
        OutputFolder {
            root: root.to_owned(),
            files: Vec::new(),
            names: UniqueNames::default(),
        }
    }

    /// Writes a file under a free name; returns its path relative to the folder.
    pub(super) fn write_unique(
        &mut self,
        folder: &str,
        stem: &str,
        extension: &str,
        bytes: &[u8],
    ) -> Result<String, SceneError> {
        // Some file systems are case-insensitive.
        let stem = self.names.allocate(&format!(
            "{folder}/{}",
            identifier(stem).to_ascii_lowercase()
        ));
        let name = format!("{stem}.{extension}");
        self.write_file(&name, bytes)?;
        Ok(name)
    }

    /// Writes a file at a path relative to the folder; returns its full path.
    pub(super) fn write_file(&mut self, name: &str, bytes: &[u8]) -> Result<PathBuf, SceneError> {
        let path = self.root.join(name);
        let written = path
            .parent()
            .map_or(Ok(()), std::fs::create_dir_all)
            .and_then(|()| std::fs::write(&path, bytes));
        written.map_err(|e| self.unwritable(&path, e))?;
        self.files.push(path.clone());
        Ok(path)
    }

    /// Creates the error for a file that cannot be written.
    pub(super) fn unwritable(&self, file: &Path, reason: impl std::fmt::Display) -> SceneError {
        SceneError::Unwritable {
            file: file.to_owned(),
            reason: reason.to_string(),
        }
    }
}

/// Returns a name that is valid as an id and as part of a file name.
pub(super) fn identifier(name: &str) -> String {
    let plain: String = name
        .chars()
        .map(|c| {
            if c.is_ascii_alphanumeric() || c == '-' {
                c
            } else {
                '_'
            }
        })
        .take(64)
        .collect();
    if plain.trim_matches('_').is_empty() {
        "unnamed".to_owned()
    } else {
        plain
    }
}
