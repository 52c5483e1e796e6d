//! The state of the screen: settings, selection, overlay and messages.

use std::sync::Arc;

use super::camera::focus_distance;
use super::comparison::{Arrangement, Comparison, seed_value};
use super::inspect::{Inspector, Target};
use super::measure::Difference;
use super::parameters::{self, INTEGRATOR, MAX_DEPTH, Parameter, SEED};
use super::picker::{Picker, SceneList};
use super::reference::{Curves, Mismatch, Reference, SettingCurve, label};
use super::session::{SLOTS, Slot};
use super::settings::{SceneFacts, SceneFile, Settings};
use crate::tui::modes::ChartX;
use lumbre_light::value::Value;
use lumbre_metrics::METRICS;
use lumbre_metrics::tonemap::Tonemap;

/// Content that covers the screen.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Overlay {
    /// The screen is not covered.
    #[default]
    None,
    /// The list of keys, from a row on.
    Help(usize),
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
    /// Settings of the picture that the panel edits.
    pub settings: Settings,
    /// Slot of the picture that the panel edits.
    pub side: Slot,
    /// The comparison with other settings, if there is one.
    pub comparison: Option<Comparison>,
    /// Index of the metric of comparisons and curves in [`METRICS`].
    pub metric: usize,
    /// Newest difference of the compared pictures.
    pub difference: Option<Difference>,
    /// The frozen picture, if there is one.
    pub reference: Option<Arc<Reference>>,
    /// Noise floors of the reference by metric; empty until they are known.
    pub floors: Vec<Option<f64>>,
    /// Errors against the reference.
    pub curves: Curves,
    /// Horizontal axis of the curves.
    pub chart_x: ChartX,
    /// Numbers of the newest requests, by slot.
    pub requests: [u64; SLOTS],
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
    /// The inspector of the pixel under the cursor, if it is open.
    pub inspector: Option<Inspector>,
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

    /// Returns the settings of a slot, if it has a picture.
    pub fn settings_of(&self, slot: Slot) -> Option<&Settings> {
        match &self.comparison {
            _ if slot == self.side => Some(&self.settings),
            Some(comparison) => Some(&comparison.other),
            None => None,
        }
    }

    /// Returns the slots whose pictures are visible at the moment.
    pub fn visible(&self) -> Vec<Slot> {
        match &self.comparison {
            None => vec![self.side],
            Some(comparison) if comparison.arrangement == Arrangement::Flicker => {
                vec![comparison.visible]
            }
            Some(_) => Slot::ALL.into(),
        }
    }

    /// Starts a comparison, in which the panel edits the new side, or edits the other side of the
    /// one in progress. Returns whether a picture is new.
    pub fn compare(&mut self) -> bool {
        self.side = self.side.other();
        match &mut self.comparison {
            Some(comparison) => {
                std::mem::swap(&mut self.settings, &mut comparison.other);
                false
            }
            None => {
                let (comparison, edited) = Comparison::begin(self.settings.clone(), self.side);
                (self.comparison, self.settings) = (Some(comparison), edited);
                self.difference = None;
                true
            }
        }
    }

    /// Selects the metric a number of rows further.
    pub fn select_metric(&mut self, by: isize) {
        let count = METRICS.len() as isize;
        self.metric = (self.metric as isize + by).rem_euclid(count) as usize;
    }

    /// Makes a picture the reference of all following ones. Their seeds become different from its
    /// own. Returns the slots whose pictures are rendered anew for it.
    pub fn freeze(&mut self, reference: Reference) -> Vec<Slot> {
        let taken = reference.settings.seed();
        let seeds = Slot::ALL.map(|slot| self.settings_of(slot).map_or(0, Settings::seed));
        let free = seeds.into_iter().fold(taken, u64::max) + 1;
        self.reference = Some(Arc::new(reference));
        self.floors.clear();
        self.curves = Curves::default();
        let mut changed = Vec::new();
        if self.settings.seed() == taken {
            self.settings.put(SEED, Some(seed_value(free)));
            changed.push(self.side);
        }
        if let Some(comparison) = &mut self.comparison
            && comparison.other.seed() == taken
        {
            comparison.other.put(SEED, Some(seed_value(free + 1)));
            changed.push(self.side.other());
        }
        changed
    }

    /// Returns why the picture of a slot is not measured against the reference, if so.
    pub fn mismatch(&self, slot: Slot) -> Option<Mismatch> {
        let (reference, scene) = (self.reference.as_ref()?, self.scene.as_ref()?);
        reference.mismatch(scene, self.settings_of(slot)?, self.resolution)
    }

    /// Starts the curve of the newest request of a slot, if its picture is measured.
    pub fn begin_curve(&mut self, slot: Slot) {
        let (Some(reference), Some(settings)) = (&self.reference, self.settings_of(slot)) else {
            return;
        };
        if self.mismatch(slot).is_none() {
            let label = label(settings, &reference.settings);
            self.curves.begin(slot, self.requests[slot.index()], label);
        }
    }

    /// Opens or closes the inspector. Without a cursor it starts in the middle of the picture.
    pub fn toggle_inspector(&mut self) {
        self.inspector = match self.inspector {
            Some(_) => None,
            None => Some(Inspector::default()),
        };
        let middle = self.resolution.map(|side| side / 2);
        self.cursor.get_or_insert(middle);
    }

    /// Moves the cursor by columns and rows of pixels.
    pub fn move_cursor(&mut self, by: [i64; 2]) {
        if let Some(pixel) = &mut self.cursor {
            *pixel = [0, 1].map(|i| {
                let last = i64::from(self.resolution[i].max(1)) - 1;
                (i64::from(pixel[i]) + by[i]).clamp(0, last) as u32
            });
        }
    }

    /// Returns what the inspector asks about.
    pub fn target(&self) -> Option<Target> {
        Some(Target {
            slot: self.side,
            request: self.requests[self.side.index()],
            pixel: self.cursor?,
            sample: self.inspector.as_ref()?.sample,
        })
    }

    /// Returns the curve of the picture in a slot.
    pub fn curve(&self, slot: Slot) -> Option<&SettingCurve> {
        self.curves.of(slot, self.requests[slot.index()])
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
            "kind" => Some(camera.kind.name().into()),
            "window" => {
                let edges = camera
                    .window
                    .to_array()
                    .map(|x| Value::number(f64::from(x)));
                Some(Value::List(edges.into()))
            }
            "view_height" => number(camera.view_height),
            "fov" => number(camera.view_deg()),
            "aperture" => number(camera.lens_diameter()),
            "focus_distance" => number(focus_distance(&camera)),
            "f_number" => camera.optics.f_number().and_then(number),
            "focal_length" => camera.optics.focal_length().and_then(number),
            "sensor_height" => camera.optics.sensor_height().and_then(number),
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
