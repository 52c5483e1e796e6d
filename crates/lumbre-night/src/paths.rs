//! Paths: the folder and the extension of a file, and a file name that several rooms know.

use std::path::{Path, PathBuf};

pub use lumbre_render::settings::find::folder_of;

/// Name of the copy of the script in the folder of a night.
pub const SCRIPT_COPY: &str = "experiment.lua";

/// Returns the extension of a file in lower case; empty if it has none.
pub fn extension(file: &Path) -> String {
    let extension = file.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
}

/// Returns the last part of a path; empty if it has none.
pub fn name(path: &Path) -> String {
    let name = path.file_name().unwrap_or_default();
    name.to_string_lossy().into_owned()
}

/// Returns the files below a folder, at any depth. Links are left out.
pub fn files_below(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut pending = vec![folder.to_owned()];
    while let Some(next) = pending.pop() {
        for entry in std::fs::read_dir(next).into_iter().flatten().flatten() {
            match entry.file_type() {
                Ok(kind) if kind.is_dir() => pending.push(entry.path()),
                Ok(kind) if kind.is_file() => files.push(entry.path()),
                _ => {}
            }
        }
    }
    files
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bare_name_lies_in_the_current_folder() {
        assert_eq!(folder_of(Path::new("a.lua")), Path::new("."));
        assert_eq!(folder_of(Path::new("b/a.lua")), Path::new("b"));
        assert_eq!(folder_of(Path::new("/")), Path::new("."));
        assert_eq!(extension(Path::new("b.x/A.EXR")), "exr");
        assert_eq!(extension(Path::new("b.x/a")), "");
    }
}
