//! What is measured: a scene, as it was asked for.

use std::path::PathBuf;

use crate::cli::args::SceneArg;
use crate::cli::builtin::short;
use crate::scene::load::Missing;
use crate::scene::{SceneDesc, edit};
use crate::script;
use crate::value::Value;

/// What names the view of a scene besides its options, as in scripts.
const CAMERA: &str = "camera";

/// A scene that is measured.
pub struct Subject {
    /// What was typed.
    pub name: String,
    /// What tables call it: the same without folders and the file's kind.
    pub label: String,
    /// Where it is.
    pub file: PathBuf,
    /// Options of a scene in Lua, and `camera` for one of its views.
    settings: Vec<(String, Value)>,
    missing: Missing,
}

impl Subject {
    /// A scene of this program, as it is.
    pub fn built_in(file: PathBuf) -> Subject {
        let name = short(&file);
        Subject { label: name.clone(), name, file, settings: Vec::new(), missing: Missing::Refused }
    }

    /// A scene that was asked for.
    ///
    /// # Errors
    /// When there is no such file, with a message for people: nobody wants to hear of a mistyped name after the other scenes.
    pub fn asked(arg: &SceneArg, missing: Missing) -> Result<Subject, String> {
        let file = arg.file.clone();
        file.metadata().map_err(|e| format!("cannot read {}: {e}", file.display()))?;
        let settings = arg.settings.clone();
        let values: Vec<String> = settings.iter().map(|(_, value)| value.to_string()).collect();
        let label = [short(&file)].into_iter().chain(values).collect::<Vec<_>>().join(" ");
        Ok(Subject { name: arg.text.clone(), label, file, settings, missing })
    }

    /// The scene.
    ///
    /// # Errors
    /// When it cannot be loaded or has no such option or view, with a message for people.
    pub fn load(&self) -> Result<SceneDesc, String> {
        let (views, options): (Vec<_>, Vec<_>) = self.settings.iter().cloned().partition(|(name, _)| name == CAMERA);
        let read = script::scene::read(&self.file, &options.into_iter().collect(), self.missing);
        let (mut desc, _) = read.map_err(|e| e.to_string())?;
        for (path, view) in &views {
            edit::set(&mut desc, path, view).map_err(|e| format!("{}: {e}", self.name))?;
        }
        Ok(desc)
    }
}
