//! The scene that a file declares so far.

use std::collections::BTreeMap;

use glam::Vec3;

use crate::source::SourcePlace;
use lumbre_light::scene::Note;
use lumbre_light::scene::desc::{CameraDesc, SceneDesc};
use lumbre_scene_io::names::UniqueNames;

/// Scene under construction while its file runs.
#[derive(Debug)]
pub struct SceneBuilder {
    /// Scene so far.
    pub(super) desc: SceneDesc,
    /// Lua object that the file has to return, and the position of its creation.
    pub(super) head: Option<(mlua::Table, SourcePlace)>,
    /// Position of the call that set the camera.
    pub(super) camera: Option<SourcePlace>,
    /// Declared options, with a description of their values.
    pub(super) options: BTreeMap<String, String>,
    /// Positions where materials were first used, by name.
    pub(super) requested_materials: BTreeMap<String, SourcePlace>,
    pub(super) names: UniqueNames,
    pub(super) notes: Vec<Note>,
}

impl Default for SceneBuilder {
    fn default() -> SceneBuilder {
        let camera = CameraDesc {
            position: Vec3::Z,
            target: Vec3::ZERO,
            ..CameraDesc::default()
        };
        SceneBuilder {
            desc: SceneDesc {
                resolution: [1280, 720],
                max_depth: 8,
                camera,
                ..SceneDesc::default()
            },
            head: None,
            camera: None,
            options: BTreeMap::new(),
            requested_materials: BTreeMap::new(),
            names: UniqueNames::default(),
            notes: Vec::new(),
        }
    }
}
