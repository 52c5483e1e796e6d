//! The state of the screen: settings, selection, overlay and messages.

use super::camera::focus_distance;
use super::parameters::{self, INTEGRATOR, MAX_DEPTH, Parameter};
use super::picker::{Picker, SceneList};
use super::settings::{SceneFacts, SceneFile, Settings};
use crate::metrics::tonemap::Tonemap;
use lumbre_light::value::Value;

/// Content that covers the screen.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Overlay {
    /// The screen is not covered.
    #[default]
    None,
    /// The list of keys.
    Help,
    /// The list of scenes.
    Picker(Picker),
    /// A line in which the value of the selected parameter is typed.
    Edit(String),
}

/// A message at the bottom of the screen.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Text in one line.
    pub text: String,
    /// Whether something failed.
    pub failed: bool,
}

/// State of the screen.
#[derive(Clone, Debug, Default)]
pub struct State {
    /// Scenes of the picker.
    pub scenes: SceneList,
    /// The scene; `None` until one is picked.
    pub scene: Option<SceneFile>,
    /// Camera, views and depth of the scene; `None` until it is loaded.
    pub facts: Option<SceneFacts>,
    /// Settings of the picture.
    pub settings: Settings,
    /// Whether rendering is paused.
    pub paused: bool,
    /// Width and height of the picture in pixels.
    pub resolution: [u32; 2],
    /// Index of the selected parameter.
    pub row: usize,
    /// Content that covers the screen.
    pub overlay: Overlay,
    /// Whether the panel is hidden.
    pub panel_hidden: bool,
    /// Index of the film of a layer that is shown, from 1; 0 is the picture.
    pub layer: usize,
    /// Pixel under the cursor.
    pub cursor: Option<[u32; 2]>,
    /// Message that was shown last.
    pub message: Option<Message>,
}

impl State {
    /// Returns the parameters of the panel.
    pub fn parameters(&self) -> Vec<Parameter> {
        let views = self.facts.iter().flat_map(|facts| &facts.views);
        let views: Vec<String> = views.map(|(name, _)| name.clone()).collect();
        let tonemap = self.settings.tonemap();
        parameters::parameters(self.settings.technique(), &views, tonemap.name())
    }

    /// Returns the selected parameter.
    pub fn selected(&self) -> Option<Parameter> {
        let mut parameters = self.parameters();
        let row = self.row.min(parameters.len().checked_sub(1)?);
        Some(parameters.swap_remove(row))
    }

    /// Shows the list of scenes.
    pub fn open_picker(&mut self) {
        self.overlay = Overlay::Picker(Picker {
            scenes: self.scenes.scenes(),
            ..Picker::default()
        });
    }

    /// Selects the row of a path.
    pub fn select(&mut self, path: &str) {
        let index = self.parameters().iter().position(|row| row.path == path);
        self.row = index.unwrap_or(self.row);
    }

    /// Returns the value that a parameter has without being set, if it is known: that of the scene,
    /// or the default.
    pub fn default_of(&self, parameter: &Parameter) -> Option<Value> {
        if let Some(value) = self.scene_value(&parameter.path) {
            return Some(value);
        }
        if parameter.path == INTEGRATOR {
            return None;
        }
        let text = parameter.field.default;
        let first = parameter.names.iter().any(|name| name == text);
        match text.parse::<f64>() {
            Ok(number) => Some(Value::number(number)),
            Err(_) if first => Some(text.into()),
            Err(_) => None,
        }
    }

    /// Returns the value of the scene for a path.
    fn scene_value(&self, path: &str) -> Option<Value> {
        let facts = self.facts.as_ref()?;
        if path == MAX_DEPTH {
            return Some(Value::Int(i64::from(facts.max_depth)));
        }
        let mut plain = self.settings.clone();
        plain.put(path, None);
        let camera = plain.camera(facts).ok()?;
        let number = |x: f32| Some(Value::number(parameters::rounded(f64::from(x))));
        let point = |p: glam::Vec3| {
            let items = p
                .to_array()
                .map(|x| Value::number(parameters::rounded(f64::from(x))));
            Some(Value::List(items.into()))
        };
        match path.strip_prefix("camera.")? {
            "position" => point(camera.position),
            "target" => point(camera.target),
            "up" => point(camera.up),
            "fov" => number(camera.view_deg()),
            "aperture" => number(camera.lens_diameter()),
            "focus_distance" => number(focus_distance(&camera)),
            "f_number" => camera.optics.f_number.and_then(number),
            "focal_length" => camera.optics.focal_length.and_then(number),
            "sensor_height" => camera.optics.sensor_height.and_then(number),
            _ => None,
        }
    }

    /// Returns the tone map of the screen.
    pub fn tonemap(&self) -> Tonemap {
        self.settings.tonemap()
    }

    /// Shows a message.
    pub fn say(&mut self, text: impl Into<String>) {
        self.message = Some(Message {
            text: text.into(),
            failed: false,
        });
    }

    /// Shows an error message.
    pub fn fail(&mut self, text: impl Into<String>) {
        self.message = Some(Message {
            text: text.into(),
            failed: true,
        });
    }
}
