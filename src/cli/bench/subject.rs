//! Scenes to measure, as given on the command line.

use std::path::PathBuf;

use crate::cli::args::SceneArg;
use crate::cli::scene::builtin::scene_name;
use lumbre_light::scene::SceneDesc;
use lumbre_light::value::Value;
use lumbre_scene_io::edit;
use lumbre_scene_io::load::MissingTextures;

/// Settings that select a view of the scene: the key of scripts, and the value that it changes.
const VIEW: [&str; 2] = ["view", "camera"];

/// A scene to measure.
pub struct Subject {
    /// Name as given on the command line.
    pub name: String,
    /// Name in tables: without folders and file extension.
    pub label: String,
    /// Path of the scene file.
    pub file: PathBuf,
    /// Options of a Lua scene, and `view` to select one of its views.
    settings: Vec<(String, Value)>,
    missing: MissingTextures,
}

impl Subject {
    /// Creates the subject for a built-in scene.
    pub fn built_in(file: PathBuf) -> Subject {
        let name = scene_name(&file);
        Subject {
            label: name.clone(),
            name,
            file,
            settings: Vec::new(),
            missing: MissingTextures::Fail,
        }
    }

    /// Creates the subject for a scene given on the command line.
    ///
    /// # Errors
    /// A message for the user if the file does not exist; checked early, before any measurement.
    pub fn from_arg(arg: &SceneArg, missing: MissingTextures) -> Result<Subject, String> {
        let file = arg.file.clone();
        file.metadata()
            .map_err(|e| format!("cannot read {}: {e}", file.display()))?;
        let settings = arg.settings.clone();
        let values: Vec<String> = settings
            .iter()
            .map(|(_, value)| value.to_string())
            .collect();
        let label = [scene_name(&file)]
            .into_iter()
            .chain(values)
            .collect::<Vec<_>>()
            .join(" ");
        Ok(Subject {
            name: arg.text.clone(),
            label,
            file,
            settings,
            missing,
        })
    }

    /// Loads the scene.
    ///
    /// # Errors
    /// A message for the user if it cannot be loaded or has no such option or view.
    pub fn load(&self) -> Result<SceneDesc, String> {
        let (views, options): (Vec<_>, Vec<_>) = self
            .settings
            .iter()
            .cloned()
            .partition(|(name, _)| VIEW.contains(&name.as_str()));
        let read =
            lumbre_lua::scene::read(&self.file, &options.into_iter().collect(), self.missing);
        let (mut desc, _) = read.map_err(|e| e.to_string())?;
        for (_, view) in &views {
            edit::set(&mut desc, "camera", view).map_err(|e| format!("{}: {e}", self.name))?;
        }
        Ok(desc)
    }
}
