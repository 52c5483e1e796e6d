//! Scenes written in Lua: a file that calls `scene {..}`, adds to what it gets, and returns it.
//!
//! It runs in the same sandbox as an experiment, once for each set of options, and leaves a
//! [`SceneDesc`] like any loader. Meshes come from [`crate::scene::shape`]; a shape that is added in many places is one
//! mesh. Files that it names lie relative to its own folder.

mod chance;
mod material;
mod object;
mod part;
mod shapes;
mod texture;

use std::collections::BTreeMap;
use std::path::Path;

use glam::Vec3;
use mlua::{Lua, UserData, Value as LuaValue};

pub use chance::SCATTER;
pub use material::MATERIAL_OPTIONS;
pub use object::{METHODS, TABLES as OBJECT_TABLES};
pub use part::{PART, PLACE};
pub use shapes::TABLES as SHAPE_TABLES;
pub use texture::{LAY, PAINT};

use super::api::{self, ApiFn};
use super::error::{Problem, ScriptError};
use super::source::Place;
use super::state::{Purpose, Shared};
use super::{Limits, Read, locate, source};
use crate::scene::desc::{CameraDesc, SceneDesc};
use crate::scene::load::{Missing, load_with};
use crate::scene::names::Names;
use crate::scene::{Note, SceneError};
use crate::value::Value;
use crate::value::schema::unknown_name;

/// The functions that describe scenes, beside the methods of the scene itself.
pub const FUNCTIONS: &[&[ApiFn]] =
    &[object::GLOBALS, shapes::GLOBALS, part::GLOBALS, texture::GLOBALS, chance::GLOBALS];

/// The kinds of values that scenes are made of, for messages.
pub fn kind(value: &mlua::AnyUserData) -> Option<&'static str> {
    let kinds: [(bool, &'static str); 4] = [
        (value.is::<shapes::ShapeObject>(), "a shape"),
        (value.is::<part::GroupObject>(), "a group"),
        (value.is::<texture::TextureObject>(), "a texture"),
        (value.is::<chance::RandomObject>(), "a source of random numbers"),
    ];
    kinds.into_iter().find(|(is, _)| *is).map(|(_, name)| name)
}

/// A scene while its file runs.
#[derive(Debug)]
pub struct SceneBuilder {
    desc: SceneDesc,
    /// The object that the file has to return, and where it was made.
    head: Option<(mlua::Table, Place)>,
    camera: Option<Place>,
    /// Options that the file knows, with the values they may have.
    known: BTreeMap<String, String>,
    /// Where materials were first asked for by name.
    wanted: BTreeMap<String, Place>,
    names: Names,
    notes: Vec<Note>,
}

impl Default for SceneBuilder {
    fn default() -> SceneBuilder {
        let camera = CameraDesc { position: Vec3::Z, target: Vec3::ZERO, ..CameraDesc::default() };
        SceneBuilder {
            desc: SceneDesc {
                resolution: [1280, 720],
                max_depth: 8,
                camera,
                views: Vec::new(),
                materials: Vec::new(),
                entities: Vec::new(),
                lights: Vec::new(),
                environment: None,
            },
            head: None,
            camera: None,
            known: BTreeMap::new(),
            wanted: BTreeMap::new(),
            names: Names::default(),
            notes: Vec::new(),
        }
    }
}

/// Whether a file is written in Lua, by its extension.
pub fn is_lua(file: &Path) -> bool {
    file.extension().is_some_and(|e| e.eq_ignore_ascii_case("lua"))
}

/// Reads a scene file of any format, Lua included, with the options that were chosen for it.
///
/// # Errors
/// Whatever is wrong with the file; options for a format that has none.
pub fn read(
    path: &Path,
    options: &BTreeMap<String, Value>,
    missing: Missing,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    if is_lua(path) {
        return load(path, options, missing).map_err(|e| SceneError::Script(e.to_string()));
    }
    if let Some(option) = options.keys().next() {
        let problem = format!("only scenes written in Lua have options, and this one is asked for `{option}`");
        return Err(SceneError::Malformed { file: path.to_owned(), place: "scene_options".to_owned(), problem });
    }
    load_with(path, missing)
}

/// Runs a scene file with the given options.
///
/// # Errors
/// Whatever is wrong with it, as for a script; an option that it does not know, or a value that the option cannot have.
pub fn load(
    path: &Path,
    options: &BTreeMap<String, Value>,
    missing: Missing,
) -> Result<(SceneDesc, Vec<Note>), ScriptError> {
    let text = source::read(path)?;
    let purpose = Purpose::Scene { options: options.clone(), missing };
    let Read { shared, returned, lua: _lua } = super::read(path, &text, Limits::default(), purpose)?;
    finish(&shared, &returned, options, &text)
}

/// Whether what is wrong with a script is that it describes a scene.
pub fn is_scene(error: &ScriptError) -> bool {
    *error.problem() == Problem::IsScene
}

fn finish(
    shared: &Shared,
    returned: &LuaValue,
    options: &BTreeMap<String, Value>,
    text: &str,
) -> Result<(SceneDesc, Vec<Note>), ScriptError> {
    let mut builder = shared.scene.borrow_mut();
    let sources = shared.sources.borrow();
    let (_, place) = match (&builder.head, returned) {
        (Some(head), LuaValue::Table(t)) if *t == head.0 => head,
        (head, _) => {
            let help = match head {
                Some(_) => "s is what scene {..} gave: end with `return s`",
                None => "begin with: local s = scene { resolution = { 1280, 720 } }",
            };
            let place = Place { source: 0, line: locate::last_line(text), last: None };
            let problem = Problem::NoScene { found: api::kind(returned).to_owned() };
            return Err(sources.error(&place, problem, Some(help.to_owned())));
        }
    };
    if let Some(unknown) = options.keys().find(|key| !builder.known.contains_key(*key)) {
        let path = format!("scene_options.{unknown}");
        let error = unknown_name(&path, unknown, "option of this scene", builder.known.keys().map(String::as_str));
        return Err(sources.field(place, &error.path, error.problem, error.help));
    }
    if builder.camera.is_none() {
        let help = "add s:camera { position = {..}, target = {..}, fov = 45 }".to_owned();
        return Err(sources.field(place, "scene", "it never says from where it is seen", Some(help)));
    }
    for (name, place) in &builder.wanted {
        if builder.desc.material_row(name).is_none() {
            let known = builder.desc.materials.iter().map(|m| m.name.as_str());
            let error = unknown_name("material", name, "material", known);
            return Err(sources.field(place, "material", error.problem, error.help));
        }
    }
    let SceneBuilder { desc, notes, .. } = std::mem::take(&mut *builder);
    Ok((desc, notes))
}

/// A scene error inside a scene file, at the line of the call.
fn scene_error(shared: &Shared, args: &api::Args, error: &SceneError) -> ScriptError {
    args.error(shared, error.to_string(), None)
}

/// A new object of Lua.
fn object<T: UserData + 'static>(shared: &Shared, lua: &Lua, value: T) -> Result<LuaValue, ScriptError> {
    Ok(LuaValue::UserData(lua.create_userdata(value).map_err(|e| shared.convert(&e))?))
}

/// The numbers of a checked list.
fn numbers<const N: usize>(value: &Value) -> [f32; N] {
    let item = |i: usize| value.as_list().and_then(|l| l.get(i)).and_then(Value::as_f64).unwrap_or_default();
    std::array::from_fn(|i| item(i) as f32)
}
