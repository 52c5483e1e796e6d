//! The list of scenes, filtered by typing.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::settings::SceneFile;
use lumbre_scene_io::load::FORMATS;

/// Depth of folders in which scenes are searched.
const DEPTH: usize = 4;

/// Largest number of scenes in a list.
const MOST: usize = 2000;

/// Largest number of files and folders that are looked at.
const MOST_ENTRIES: usize = 100_000;

/// Extensions of formats that are seldom scenes of their own: meshes that scenes of other formats
/// refer to.
const MESHES: [&str; 1] = ["ply"];

/// The scenes from which one is picked. The folder is searched when they are needed first.
#[derive(Clone, Debug, Default)]
pub struct SceneList {
    /// Scenes that are listed before those of the folder.
    pub built_in: Vec<SceneFile>,
    /// Folder that is searched.
    pub folder: PathBuf,
    found: Option<Vec<SceneFile>>,
}

impl SceneList {
    /// Creates a list of the given scenes and those of a folder.
    pub fn new(built_in: Vec<SceneFile>, folder: PathBuf) -> SceneList {
        SceneList {
            built_in,
            folder,
            found: None,
        }
    }

    /// Returns all scenes.
    pub fn scenes(&mut self) -> Vec<SceneFile> {
        let found = self.found.get_or_insert_with(|| scenes_in(&self.folder));
        self.built_in.iter().chain(found.iter()).cloned().collect()
    }
}

/// The list of scenes while it is shown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Picker {
    /// Scenes, whether the filter lists them or not.
    pub scenes: Vec<SceneFile>,
    /// Text that the names of the listed scenes contain.
    pub filter: String,
    /// Index of the selected scene among the listed ones.
    pub selected: usize,
}

impl Picker {
    /// Returns the scenes whose names contain every word of the filter, whatever the case.
    pub fn listed(&self) -> Vec<&SceneFile> {
        let filter = self.filter.to_lowercase();
        let words: Vec<&str> = filter.split_whitespace().collect();
        self.scenes
            .iter()
            .filter(|scene| {
                let name = scene.name.to_lowercase();
                words.iter().all(|word| name.contains(word))
            })
            .collect()
    }

    /// Returns the selected scene, if any is listed.
    pub fn chosen(&self) -> Option<&SceneFile> {
        self.listed().get(self.selected).copied()
    }

    /// Moves the selection by a number of rows.
    pub fn select(&mut self, by: isize) {
        let last = self.listed().len().saturating_sub(1);
        self.selected = self.selected.saturating_add_signed(by).min(last);
    }

    /// Changes the filter; the first scene is selected.
    pub fn set_filter(&mut self, filter: String) {
        self.filter = filter;
        self.selected = 0;
    }
}

/// Returns the scenes of a folder and of the folders in it, sorted by name. Lua files that call
/// `experiment` are not listed.
fn scenes_in(folder: &Path) -> Vec<SceneFile> {
    let (mut found, mut entries_left) = (Vec::new(), MOST_ENTRIES);
    collect(folder, DEPTH, &mut entries_left, &mut found);
    found.sort();
    let name = |path: &Path| {
        let below = path.strip_prefix(folder).unwrap_or(path);
        below.display().to_string()
    };
    let scene = |path: PathBuf| SceneFile {
        name: name(&path),
        path,
        options: BTreeMap::new(),
        built_in: false,
    };
    found.into_iter().map(scene).collect()
}

fn collect(folder: &Path, depth: usize, entries_left: &mut usize, found: &mut Vec<PathBuf>) {
    let Ok(entries) = fs::read_dir(folder) else {
        return;
    };
    for entry in entries.flatten() {
        if *entries_left == 0 || found.len() >= MOST {
            return;
        }
        *entries_left -= 1;
        let path = entry.path();
        let hidden = entry.file_name().to_string_lossy().starts_with('.');
        if hidden {
            continue;
        }
        if path.is_dir() {
            if depth > 1 {
                collect(&path, depth - 1, entries_left, found);
            }
        } else if is_scene(&path) {
            found.push(path);
        }
    }
}

/// Returns whether a file is a scene by its extension, or a Lua file that is no experiment.
fn is_scene(path: &Path) -> bool {
    let extension = path
        .extension()
        .map(|extension| extension.to_string_lossy().to_ascii_lowercase());
    let Some(extension) = extension else {
        return false;
    };
    match extension.as_str() {
        "lua" => fs::read_to_string(path)
            .is_ok_and(|text| text.contains("scene") && !text.contains("experiment(")),
        // The format of folders has a fixed file name; any other file of this type is data.
        "json" => path.file_name().is_some_and(|name| name == "scene.json"),
        other => {
            let known = FORMATS
                .iter()
                .any(|format| format.extensions.contains(&other));
            known && !MESHES.contains(&other)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_searched_for_scenes_and_typing_filters_them() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| {
            let path = folder.path().join(name);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        };
        write("box/Box.scn", "{}");
        write("hall.lua", "local s = scene {}\nreturn s");
        write("night.lua", "local x = experiment(\"scene\")");
        write("data.json", "{}");
        write("model/duck.glb", "");
        write("model/part.ply", "");
        write("model/.cache/hidden.scn", "");
        let mut list = SceneList::new(Vec::new(), folder.path().to_owned());
        let mut picker = Picker {
            scenes: list.scenes(),
            ..Picker::default()
        };
        let names = |picker: &Picker| {
            let listed = picker.listed().into_iter();
            listed.map(|scene| scene.name.clone()).collect::<Vec<_>>()
        };
        assert_eq!(
            names(&picker),
            ["box/Box.scn", "hall.lua", "model/duck.glb"]
        );
        picker.select(2);
        assert_eq!(picker.chosen().unwrap().name, "model/duck.glb");
        picker.select(5);
        assert_eq!(picker.selected, 2);
        picker.set_filter("BOX".to_owned());
        assert_eq!(names(&picker), ["box/Box.scn"]);
        assert_eq!(
            picker.chosen().unwrap().path,
            folder.path().join("box/Box.scn")
        );
        picker.set_filter("nothing".to_owned());
        assert_eq!(picker.chosen(), None);
    }
}
