//! Settings of a picture: a render table as scripts write it, flattened to paths, with the tone
//! map, the limits and the seed.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;

use glam::Vec3;

use super::parameters::{
    EXPOSURE, INTEGRATOR, LIMIT_SAMPLES, LIMIT_TIME, MAX_DEPTH, SEED, TONEMAP,
};
use lumbre_light::scene::desc::{CameraDesc, SceneDesc};
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow, integrator};
use lumbre_light::value::Value;
use lumbre_lua::RENDER;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::plan::identity;
use lumbre_scene_io::edit;

/// Technique at the start, if the command line names none.
const FIRST_TECHNIQUE: &str = "nee";

/// A scene file with values for its options.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFile {
    /// Name in the picker and on the screen.
    pub name: String,
    /// Path of the file.
    pub path: PathBuf,
    /// Values for the options of a Lua scene.
    pub options: BTreeMap<String, Value>,
    /// Whether the scene is built into the program, so that its files exist only while it runs.
    pub built_in: bool,
}

/// Camera, views and depth of a loaded scene.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneFacts {
    /// Camera of the scene.
    pub camera: CameraDesc,
    /// Other cameras by name.
    pub views: Vec<(String, CameraDesc)>,
    /// Greatest number of path edges that the scene requests.
    pub max_depth: u32,
}

impl SceneFacts {
    /// Returns the facts of a scene.
    pub fn new(scene: &SceneDesc) -> SceneFacts {
        SceneFacts {
            camera: scene.camera.clone(),
            views: scene.views.clone(),
            max_depth: scene.max_depth,
        }
    }

    /// Returns the camera after the changes of a cell's configuration that concern it: `camera`,
    /// the name of a view, and paths that begin with `camera.`.
    ///
    /// # Errors
    /// Returns a message if a view is unknown or a value is out of range.
    pub fn camera_with(&self, changes: &BTreeMap<String, Value>) -> Result<CameraDesc, String> {
        let mut scene = SceneDesc {
            resolution: [1, 1],
            max_depth: 1,
            camera: self.camera.clone(),
            views: self.views.clone(),
            ..SceneDesc::default()
        };
        edit::apply(&mut scene, changes).map_err(|e| e.to_string())?;
        Ok(scene.camera)
    }
}

/// Returns whether a change of a scene concerns only its camera.
pub fn is_camera_change(path: &str) -> bool {
    path == "camera" || path.starts_with("camera.")
}

/// Settings by path. Parameters of other techniques than the chosen one keep their values, but are
/// not used.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Settings {
    values: BTreeMap<String, Value>,
    /// Changes of values in the scene by path, as in the key `set` of a render table.
    pub set: BTreeMap<String, Value>,
}

impl Settings {
    /// Creates settings from keys of a render table, paths of values in the scene, and settings of
    /// the session such as `display.exposure` and `limit.samples`, as the command line gives them.
    pub fn new(given: &[(String, Value)]) -> Settings {
        let mut settings = Settings::default();
        settings.put(INTEGRATOR, Some(FIRST_TECHNIQUE.into()));
        for (key, value) in given {
            let head = key.split('.').next().unwrap_or(key);
            let nested = RENDER.fields.iter().any(|field| field.key == head)
                || ["display", "limit"].contains(&head);
            if key.contains('.') && !nested {
                settings.set.insert(key.clone(), value.clone());
            } else {
                settings.put(key, Some(value.clone()));
            }
        }
        settings
    }

    /// Returns the value of a path, if it is not the default.
    pub fn get(&self, path: &str) -> Option<&Value> {
        self.values.get(path)
    }

    /// Sets the value of a path; `None` restores the default. A new view replaces all changes of
    /// the camera.
    pub fn put(&mut self, path: &str, value: Option<Value>) {
        if path == "view" {
            self.reset_camera();
        }
        match value {
            Some(value) => self.values.insert(path.to_owned(), value),
            None => self.values.remove(path),
        };
    }

    /// Removes all changes of the camera.
    pub fn reset_camera(&mut self) {
        self.values.retain(|path, _| !path.starts_with("camera."));
    }

    /// Returns the chosen technique.
    pub fn technique(&self) -> &'static IntegratorRow {
        let name = self.get(INTEGRATOR).and_then(Value::as_str);
        name.and_then(integrator).unwrap_or(&INTEGRATORS[0])
    }

    /// Returns the seed of the experiment.
    pub fn seed(&self) -> u64 {
        let seed = self.get(SEED).and_then(Value::as_i64);
        seed.and_then(|seed| u64::try_from(seed).ok()).unwrap_or(0)
    }

    /// Returns the seed of the random numbers: that of the first repeat of an experiment with the
    /// seed [`Settings::seed`].
    pub fn random_seed(&self) -> u64 {
        identity::cell_seed(self.seed(), 0)
    }

    /// Returns the limits.
    pub fn limits(&self) -> Limits {
        let samples = self.get(LIMIT_SAMPLES).and_then(Value::as_i64);
        Limits {
            samples: samples.and_then(|n| u64::try_from(n).ok()),
            seconds: self.get(LIMIT_TIME).and_then(Value::as_f64),
        }
    }

    /// Returns the tone map.
    pub fn tonemap(&self) -> Tonemap {
        let fields = self.values.iter().filter_map(|(path, value)| {
            Some((path.strip_prefix("display.")?.to_owned(), value.clone()))
        });
        let mut fields: BTreeMap<String, Value> = fields.collect();
        fields.entry("kind".to_owned()).or_insert("srgb".into());
        let read = |fields| Tonemap::from_value("display", &Value::Map(fields));
        // A gamma that was set stays when a tone map without one is chosen.
        read(fields.clone())
            .or_else(|_| {
                fields.retain(|key, _| {
                    *key == TONEMAP["display.".len()..] || *key == EXPOSURE["display.".len()..]
                });
                read(fields)
            })
            .unwrap_or(Tonemap::Srgb { exposure: 0.0 })
    }

    /// Returns the camera of a scene with these settings.
    ///
    /// # Errors
    /// Returns a message if a value is out of range.
    pub fn camera(&self, scene: &SceneFacts) -> Result<CameraDesc, String> {
        let mut changes: BTreeMap<String, Value> = self
            .values
            .iter()
            .filter(|(path, _)| path.starts_with("camera."))
            .map(|(path, value)| (path.clone(), value.clone()))
            .collect();
        if let Some(view) = self.get("view") {
            changes.insert("camera".to_owned(), view.clone());
        }
        scene.camera_with(&changes)
    }

    /// Changes the camera of a scene to `next`.
    ///
    /// # Errors
    /// Returns a message if the current settings of the camera are out of range.
    pub fn set_camera(&mut self, scene: &SceneFacts, next: &CameraDesc) -> Result<(), String> {
        let now = self.camera(scene)?;
        let point = |p: Vec3| Value::List(p.to_array().map(short_decimal).into());
        let points = [
            ("camera.position", now.position, next.position),
            ("camera.target", now.target, next.target),
            ("camera.up", now.up, next.up),
        ];
        for (path, before, after) in points {
            if before != after {
                self.put(path, Some(point(after)));
            }
        }
        if let Some(distance) = next
            .focus_distance
            .filter(|_| now.focus_distance != next.focus_distance)
        {
            self.put("camera.focus_distance", Some(short_decimal(distance)));
        }
        if now.view_height != next.view_height {
            self.put("camera.view_height", Some(short_decimal(next.view_height)));
        }
        Ok(())
    }

    /// Returns the render table without scene and resolution: keys of all techniques and those of
    /// the chosen one.
    pub fn render_table(&self) -> BTreeMap<String, Value> {
        let own = self.technique().params.fields;
        let mut table: BTreeMap<String, Value> = BTreeMap::new();
        for (path, value) in &self.values {
            let (head, rest) = path.split_once('.').unwrap_or((path, ""));
            let known = RENDER
                .fields
                .iter()
                .chain(own)
                .any(|field| field.key == head);
            if !known {
                continue;
            }
            if rest.is_empty() {
                table.insert(head.to_owned(), value.clone());
            } else if let Value::Map(fields) = table
                .entry(head.to_owned())
                .or_insert_with(|| Value::Map(BTreeMap::new()))
            {
                fields.insert(rest.to_owned(), value.clone());
            }
        }
        if !self.set.is_empty() {
            table.insert("set".to_owned(), Value::Map(self.set.clone()));
        }
        table
    }

    /// Returns the settings that decide what the camera sees: the view and all changes of the
    /// camera.
    pub fn view(&self) -> Vec<(&str, &Value)> {
        let shows = |path: &str| path == "view" || path.starts_with("camera.");
        let values = self.values.iter().filter(|(path, _)| shows(path));
        values.map(|(path, value)| (path.as_str(), value)).collect()
    }

    /// Returns the values that differ from those of other settings, by path; `None` is the default.
    pub fn changes_from<'a>(&'a self, other: &'a Settings) -> Vec<(&'a str, Option<&'a Value>)> {
        let paths: BTreeSet<&str> = self
            .values
            .keys()
            .chain(other.values.keys())
            .map(String::as_str)
            .collect();
        paths
            .into_iter()
            .map(|path| (path, self.get(path)))
            .filter(|(path, value)| other.get(path) != *value)
            .collect()
    }

    /// Returns the whole render table of a picture of a scene.
    pub fn request_table(
        &self,
        scene: &SceneFile,
        resolution: [u32; 2],
    ) -> BTreeMap<String, Value> {
        let mut table = self.render_table();
        let path = scene.path.to_string_lossy().into_owned();
        table.insert("scene".to_owned(), Value::Str(path));
        if !scene.options.is_empty() {
            table.insert(
                "scene_options".to_owned(),
                Value::Map(scene.options.clone()),
            );
        }
        let sides = resolution.map(|side| Value::Int(i64::from(side)));
        table.insert("resolution".to_owned(), Value::List(sides.into()));
        table
    }

    /// Returns the greatest number of path edges.
    pub fn max_depth(&self, scene: Option<&SceneFacts>) -> u32 {
        let own = self.get(MAX_DEPTH).and_then(Value::as_i64);
        own.and_then(|depth| u32::try_from(depth).ok())
            .or(scene.map(|scene| scene.max_depth))
            .unwrap_or(1)
    }
}

/// When rendering stops.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Limits {
    /// Largest number of samples per pixel.
    pub samples: Option<u64>,
    /// Longest render time in seconds.
    pub seconds: Option<f64>,
}

/// Returns the shortest decimal that denotes this number, with at most six significant digits.
fn short_decimal(x: f32) -> Value {
    Value::number(format!("{x:.5e}").parse().unwrap_or(f64::from(x)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facts() -> SceneFacts {
        let camera = CameraDesc::default();
        let side = CameraDesc {
            position: Vec3::X,
            ..camera.clone()
        };
        SceneFacts {
            camera,
            views: vec![("side".to_owned(), side)],
            max_depth: 7,
        }
    }

    #[test]
    fn the_render_table_has_the_parameters_of_the_chosen_technique_alone() {
        let mut settings = Settings::new(&[("aa.radius".to_owned(), Value::Num(1.5))]);
        settings.put("mis", Some("balance".into()));
        settings.put("display.exposure", Some(Value::Int(1)));
        settings.put("limit.samples", Some(Value::Int(4)));
        let table = |settings: &Settings| Value::Map(settings.render_table()).to_string();
        assert_eq!(
            table(&settings),
            "{aa = {radius = 1.5}, integrator = nee, mis = balance}"
        );
        settings.put(INTEGRATOR, Some("bpt".into()));
        assert_eq!(table(&settings), "{aa = {radius = 1.5}, integrator = bpt}");
        settings.put(INTEGRATOR, Some("bdpt".into()));
        assert!(table(&settings).contains("mis = balance"));
        assert_eq!(settings.limits().samples, Some(4));
    }

    #[test]
    fn paths_in_the_scene_are_changes_of_the_scene() {
        let settings = Settings::new(&[
            ("materials.egg.ior".to_owned(), Value::Num(1.3)),
            ("camera.fov".to_owned(), Value::Int(30)),
        ]);
        assert_eq!(
            Value::Map(settings.render_table()).to_string(),
            "{camera = {fov = 30}, integrator = nee, set = {materials.egg.ior = 1.3}}"
        );
    }

    #[test]
    fn a_camera_that_was_set_is_read_back() {
        let mut settings = Settings::new(&[]);
        let next = CameraDesc {
            position: Vec3::new(0.25, 1.0, 3.0),
            focus_distance: Some(2.5),
            ..CameraDesc::default()
        };
        settings.set_camera(&facts(), &next).unwrap();
        assert_eq!(settings.camera(&facts()), Ok(next));
        settings.put("view", Some("side".into()));
        assert_eq!(settings.camera(&facts()).unwrap().position, Vec3::X);
        settings.put("view", None);
        settings.reset_camera();
        assert_eq!(settings.camera(&facts()), Ok(facts().camera));
    }

    #[test]
    fn a_tone_map_without_gamma_ignores_the_one_that_was_set() {
        let mut settings = Settings::new(&[]);
        settings.put(TONEMAP, Some("reinhard".into()));
        settings.put("display.gamma", Some(Value::Num(1.8)));
        settings.put(EXPOSURE, Some(Value::Int(2)));
        let reinhard = Tonemap::Reinhard {
            exposure: 2.0,
            gamma: 1.8,
        };
        assert_eq!(settings.tonemap(), reinhard);
        settings.put(TONEMAP, Some("srgb".into()));
        assert_eq!(settings.tonemap(), Tonemap::Srgb { exposure: 2.0 });
    }
}
