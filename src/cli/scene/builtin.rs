//! Built-in scenes, compiled into the program so that they are available on every machine.

use std::path::{Path, PathBuf};

/// One file of a scene.
struct SceneFile {
    /// Path below the folder of the scenes.
    path: &'static str,
    /// Content of the file.
    bytes: &'static [u8],
}

/// Embeds files of the folder `scenes` in the program.
macro_rules! scene_files {
    ($($path:literal),* $(,)?) => {
        &[$(SceneFile { path: $path, bytes: include_bytes!(concat!("../../../scenes/", $path)) }),*]
    };
}

/// All files of the built-in scenes: first the scene files, then meshes and textures, then scenes
/// in Lua, which only the benchmark renders.
const SCENE_FILES: &[SceneFile] = scene_files![
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
    "atrium.lua",
    "bedroom.lua",
    "cornell.lua",
    "veach_lamps.lua",
];

/// Built-in scenes in a temporary folder, which is removed when this is dropped.
pub struct BuiltIn {
    folder: tempfile::TempDir,
}

impl BuiltIn {
    /// Writes the scenes to a temporary folder.
    ///
    /// # Errors
    /// Returns a message if the folder cannot be written.
    pub fn unpack() -> Result<BuiltIn, String> {
        let failed = |e: std::io::Error| format!("cannot unpack the built-in scenes: {e}");
        let folder = tempfile::tempdir().map_err(failed)?;
        for file in SCENE_FILES {
            let path = folder.path().join(file.path);
            std::fs::create_dir_all(path.parent().unwrap_or(folder.path())).map_err(failed)?;
            std::fs::write(path, file.bytes).map_err(failed)?;
        }
        Ok(BuiltIn { folder })
    }

    /// Returns the path of a file of the scenes.
    pub fn file(&self, path: &str) -> PathBuf {
        self.folder.path().join(path)
    }

    /// Returns the paths of the scene files that are not in Lua.
    pub fn scenes(&self) -> Vec<PathBuf> {
        let scenes = SCENE_FILES
            .iter()
            .map(|file| file.path)
            .filter(|path| path.ends_with(".scn"));
        scenes.map(|path| self.folder.path().join(path)).collect()
    }
}

/// Returns the name of a scene: its file name without folder and extension.
pub fn scene_name(path: &Path) -> String {
    path.file_stem().map_or_else(
        || path.display().to_string(),
        |s| s.to_string_lossy().into_owned(),
    )
}

#[cfg(test)]
mod tests {
    use crate::cli::scene::builtin::*;
    use lumbre_light::scene::compile;
    use lumbre_scene_io::load;

    #[test]
    fn every_built_in_scene_is_embedded_and_complete() {
        let built_in = BuiltIn::unpack().unwrap();
        let names: Vec<String> = built_in.scenes().iter().map(|p| scene_name(p)).collect();
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes");
        for entry in std::fs::read_dir(root)
            .unwrap()
            .flatten()
            .filter(|e| e.path().is_dir())
        {
            let name = entry.file_name().to_string_lossy().into_owned();
            let has_lights = entry.path().join(format!("{name}.scn")).is_file();
            assert!(
                !has_lights || names.contains(&name),
                "{name} is not built in"
            );
        }
        for scene in built_in.scenes() {
            let (desc, notes) = load::load(&scene).unwrap();
            assert_eq!(notes, [], "{}", scene.display());
            assert!(!compile(&desc).unwrap().0.emitters.is_empty());
        }
    }
}
