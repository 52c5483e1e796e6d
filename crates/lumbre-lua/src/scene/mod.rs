//! Scenes written in Lua: a file that calls `scene {..}`, adds shapes, materials and lights to the
//! returned object, and returns it.
//!
//! The file runs in the same sandbox as an experiment, once for each set of options, and yields a
//! [`SceneDesc`] like any other loader. Meshes come from [`lumbre_light::scene::shape`]; a shape that is
//! added several times is one mesh with several instances. File names are relative to the folder of
//! the scene file.

mod builder;
mod chance;
mod import;
mod lighting;
mod material;
mod object;
mod part;
mod schema;
mod shape_object;
mod shape_schema;
mod shapes;
mod texture;

use std::collections::BTreeMap;
use std::path::Path;

use mlua::Value as LuaValue;

pub use builder::SceneBuilder;
pub use chance::SCATTER;
pub use material::MATERIAL_OPTIONS;
pub use object::METHODS;
pub use part::{PART, PLACE};
pub use schema::TABLES as OBJECT_TABLES;
pub use shape_schema::TABLES as SHAPE_TABLES;
pub use texture::{LAY, PAINT};

use super::api::ApiFn;
use super::error::{Problem, ScriptError};
use super::kind::kind;
use super::source::SourcePlace;
use super::state::{Purpose, Shared};
use super::{ExecutedFile, Limits, locate, source};
use lumbre_light::scene::desc::SceneDesc;
use lumbre_light::scene::{Note, SceneError};
use lumbre_light::value::Value;
use lumbre_light::value::schema::unknown_name;
use lumbre_scene_io::load::{MissingTextures, Variables, load_on_stage};
use lumbre_scene_io::stage::{OPTION, STAGES, Stage};

/// Functions that describe scenes, besides the methods of the scene itself.
pub const FUNCTIONS: &[&[ApiFn]] = &[
    object::GLOBALS,
    shapes::GLOBALS,
    part::GLOBALS,
    texture::GLOBALS,
    chance::GLOBALS,
];

/// Returns whether a file has the extension of Lua files.
pub fn is_lua(file: &Path) -> bool {
    file.extension()
        .is_some_and(|e| e.eq_ignore_ascii_case("lua"))
}

/// Loads a scene file of any format, including Lua, with values for its options. Files of other
/// formats have the option `stage`; variables of Mitsuba's files are options, too.
///
/// # Errors
/// Returns the first error in the file, or an error for an unknown option or value.
pub fn read(
    path: &Path,
    options: &BTreeMap<String, Value>,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    if is_lua(path) {
        let loaded = load(path, options, missing);
        let loaded = loaded.map_err(|e| SceneError::Script(e.to_string()))?;
        return Ok((loaded.scene, loaded.notes));
    }
    let invalid = |problem| SceneError::malformed(path, "scene_options", problem);
    let stage = options
        .get(OPTION)
        .map(stage)
        .transpose()
        .map_err(invalid)?;
    let others = options.iter().filter(|(name, _)| *name != OPTION);
    let variables = others
        .map(|(name, value)| Ok((name.clone(), variable(name, value)?)))
        .collect::<Result<Variables, String>>()
        .map_err(invalid)?;
    load_on_stage(path, missing, stage, &variables).map_err(|error| match error {
        SceneError::UnknownFormat { file, help, known } => SceneError::UnknownFormat {
            file,
            help,
            known: format!(".lua, {known}"),
        },
        other => other,
    })
}

/// Returns the stage with a name.
fn stage(value: &Value) -> Result<Stage, String> {
    let named = STAGES.iter().find(|(name, _)| value.as_str() == Some(name));
    let names: Vec<String> = STAGES.iter().map(|(name, _)| format!("`{name}`")).collect();
    match named {
        Some((_, stage)) => Ok(*stage),
        None => Err(format!(
            "`stage` is {}, found `{value}`",
            names.join(" or ")
        )),
    }
}

/// Returns the text that stands for a value in a file.
fn variable(name: &str, value: &Value) -> Result<String, String> {
    match value {
        Value::Bool(_) | Value::Int(_) | Value::Num(_) => Ok(value.to_string()),
        Value::Str(text) => Ok(text.clone()),
        Value::Nil | Value::List(_) | Value::Map(_) => Err(format!(
            "`{name}` is {}: expected a number, a text, true or false",
            value.kind()
        )),
    }
}

/// A scene with its notes and the options that its file declares.
#[derive(Debug)]
pub struct LoadedScene {
    /// The scene with the given options.
    pub scene: SceneDesc,
    /// Notes on what could not be represented.
    pub notes: Vec<Note>,
    /// Options that the file declares, with a description of their values.
    pub options: BTreeMap<String, String>,
}

/// Runs a scene file in Lua with the given options.
///
/// # Errors
/// Returns the first error in the file, or an error for an undeclared option or an invalid value.
pub fn load(
    path: &Path,
    options: &BTreeMap<String, Value>,
    missing: MissingTextures,
) -> Result<LoadedScene, ScriptError> {
    let text = source::read(path)?;
    let purpose = Purpose::Scene {
        options: options.clone(),
        missing,
    };
    let ExecutedFile {
        shared,
        returned,
        lua: _lua,
    } = super::run_file(path, &text, Limits::default(), purpose)?;
    finish(&shared, &returned, options, &text)
}

/// Returns whether loading failed because the file describes a scene instead of an experiment.
pub fn is_scene(error: &ScriptError) -> bool {
    *error.problem() == Problem::IsScene
}

/// Checks that the file returned its scene and that its declarations are consistent, and returns
/// the scene.
fn finish(
    shared: &Shared,
    returned: &LuaValue,
    options: &BTreeMap<String, Value>,
    text: &str,
) -> Result<LoadedScene, ScriptError> {
    let mut builder = shared.scene.borrow_mut();
    let sources = shared.sources.borrow();
    let (_, place) = match (&builder.head, returned) {
        (Some(head), LuaValue::Table(t)) if *t == head.0 => head,
        (head, _) => {
            let help = match head {
                Some(_) => "return the value that scene {..} returned: end with `return s`",
                None => "begin with: local s = scene { resolution = { 1280, 720 } }",
            };
            let place = SourcePlace {
                source: 0,
                line: locate::last_line(text),
                last: None,
            };
            let problem = Problem::NoScene {
                found: kind(returned),
            };
            return Err(sources.error(&place, problem, Some(help.to_owned())));
        }
    };
    if let Some(unknown) = options
        .keys()
        .find(|key| !builder.options.contains_key(*key))
    {
        let path = format!("scene_options.{unknown}");
        let error = unknown_name(
            &path,
            unknown,
            "option of this scene",
            builder.options.keys().map(String::as_str),
        );
        return Err(sources.field(place, &error.path, error.problem, error.help));
    }
    if builder.camera.is_none() {
        let help = "add s:camera { position = {..}, target = {..}, fov = 45 }".to_owned();
        return Err(sources.field(place, "scene", "the scene has no camera", Some(help)));
    }
    for (name, place) in &builder.requested_materials {
        if builder.desc.material_index(name).is_none() {
            let known = builder.desc.materials.iter().map(|m| m.name.as_str());
            let error = unknown_name("material", name, "material", known);
            return Err(sources.field(place, "material", error.problem, error.help));
        }
    }
    let SceneBuilder {
        desc: scene,
        notes,
        options,
        ..
    } = std::mem::take(&mut *builder);
    Ok(LoadedScene {
        scene,
        notes,
        options,
    })
}
