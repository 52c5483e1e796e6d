//! Paths: the folder and the extension of a file, and a file name that several rooms know.

use std::path::Path;

pub use lumbre_render::settings::find::folder_of;

/// Name of the copy of the script in the folder of a night.
pub const SCRIPT_COPY: &str = "experiment.lua";

/// Returns the extension of a file in lower case; empty if it has none.
pub fn extension(file: &Path) -> String {
    let extension = file.extension().unwrap_or_default();
    extension.to_string_lossy().to_lowercase()
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
