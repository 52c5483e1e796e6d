//! The scenes that this project brings, inside the program, so that they are there wherever it runs.

use std::path::{Path, PathBuf};

/// One file of a scene.
struct Part {
    /// Its path below the folder of scenes.
    path: &'static str,
    bytes: &'static [u8],
}

macro_rules! parts {
    ($($path:literal),* $(,)?) => {
        &[$(Part { path: $path, bytes: include_bytes!(concat!("../../scenes/", $path)) }),*]
    };
}

/// Every file, each scene's own first.
const PARTS: &[Part] = parts![
    "cornell/cornell.scn",
    "cornell_spheres/cornell_spheres.scn",
    "edges/edges.scn",
    "lamp_row/lamp_row.scn",
    "masked_leaves/masked_leaves.scn",
    "material_ball/material_ball.scn",
    "veach_lamps/veach_lamps.scn",
    "cornell/room.obj",
    "cornell/short_block.obj",
    "cornell/tall_block.obj",
    "edges/edges.obj",
    "lamp_row/ground.obj",
    "lamp_row/sky.obj",
    "masked_leaves/leaf.png",
    "masked_leaves/leaves.obj",
    "masked_leaves/stage.obj",
    "material_ball/base.obj",
    "material_ball/checks.png",
    "material_ball/studio.obj",
    "veach_lamps/egg.obj",
    "veach_lamps/floor_lamp.obj",
    "veach_lamps/room.obj",
    "veach_lamps/spot_lamp.obj",
    "veach_lamps/table.obj",
];

/// The built-in scenes as files, which are removed with this value.
pub struct BuiltIn {
    folder: tempfile::TempDir,
}

impl BuiltIn {
    /// Writes them to a temporary folder.
    ///
    /// # Errors
    /// When it cannot be written, with a message for people.
    pub fn unpack() -> Result<BuiltIn, String> {
        let failed = |e: std::io::Error| format!("cannot unpack the built-in scenes: {e}");
        let folder = tempfile::tempdir().map_err(failed)?;
        for part in PARTS {
            let file = folder.path().join(part.path);
            std::fs::create_dir_all(file.parent().unwrap_or(folder.path())).map_err(failed)?;
            std::fs::write(file, part.bytes).map_err(failed)?;
        }
        Ok(BuiltIn { folder })
    }

    /// The scenes' files.
    pub fn scenes(&self) -> Vec<PathBuf> {
        let scenes = PARTS.iter().map(|part| part.path).filter(|path| path.ends_with(".scn"));
        scenes.map(|path| self.folder.path().join(path)).collect()
    }
}

/// The name of a scene: its file's, without folder and extension.
pub fn short(path: &Path) -> String {
    path.file_stem().map_or_else(|| path.display().to_string(), |s| s.to_string_lossy().into_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::{compile, load};

    #[test]
    fn every_built_in_scene_is_inside_and_whole() {
        let built_in = BuiltIn::unpack().unwrap();
        let names: Vec<String> = built_in.scenes().iter().map(|p| short(p)).collect();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        for entry in std::fs::read_dir(root).unwrap().flatten().filter(|e| e.path().is_dir()) {
            let name = entry.file_name().to_string_lossy().into_owned();
            let has_lights = entry.path().join(format!("{name}.scn")).is_file();
            assert!(!has_lights || names.contains(&name), "{name} is not built in");
        }
        for scene in built_in.scenes() {
            let (desc, notes) = load::load(&scene).unwrap();
            assert_eq!(notes, [], "{}", scene.display());
            assert!(!compile(&desc).unwrap().0.emitters.is_empty());
        }
    }
}
