//! glTF 2.0: `.gltf` with external or embedded buffers and images, and `.glb`.
//!
//! Supported are nodes with their transforms, meshes shared between them, animations, skins, morph
//! targets and instances, compressed data, the first perspective camera of the default scene, point,
//! spot and directional lights (`KHR_lights_punctual`), and materials ([`material`]). Intensities are
//! used as radiometric values, without photometric factors. Texture coordinates start at the top left
//! in the file and at the bottom left here. Triangles without normals are flat, as the format
//! specifies. Surfaces are two-sided whatever `doubleSided` says.

mod animation;
mod deform;
mod document;
mod draco;
mod entity;
mod material;
mod mesh;
mod meshopt;
mod supported;

pub(super) use self::supported::SUPPORTED;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3};
use serde_json::Value as Json;

use self::deform::DeformationKey;
use self::document::{Document, GLB_MAGIC};
use self::material::{MaterialReader, UvSets};
use super::{MissingTextures, Variables, default_scene};
use crate::names::UniqueNames;
use lumbre_light::scene::desc::{
    CameraDesc, CameraKind, ConeDesc, ConeEdge, DEFAULT_MATERIAL, EntityDesc, LightDesc, LightKind,
    MaterialDesc, MeshDesc, Optics, SceneDesc, VIEW_HEIGHT_RANGE,
};
use lumbre_light::scene::{Note, SceneError};

/// Greatest nesting depth of nodes.
const MAX_DEPTH: usize = 256;
/// Extensions that are supported. Unsupported material extensions are noted with their material.
const EXTENSIONS: &[&str] = &[
    "EXT_mesh_gpu_instancing",
    "EXT_texture_webp",
    meshopt::EXTENSIONS[0],
    meshopt::EXTENSIONS[1],
    "KHR_lights_punctual",
    "KHR_texture_transform",
    "KHR_mesh_quantization",
    "KHR_draco_mesh_compression",
];
/// Prefix of the names of material extensions.
const MATERIAL_EXTENSION_PREFIX: &str = "KHR_materials_";

/// Returns whether the first bytes of a file are those of a .glb, or of a JSON with an `asset`.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(GLB_MAGIC) || head.windows(7).any(|w| w == b"\"asset\"")
}

/// Loads a document and everything that it refers to.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    load_with_variables(path, missing, &Variables::new())
}

/// Loads a document at the time of an animation that the scene options `time` and `animation` select.
pub(super) fn load_with_variables(
    path: &Path,
    missing: MissingTextures,
    options: &Variables,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let mut document = Document::read(path)?;
    if !document.json["asset"]["version"]
        .as_str()
        .is_some_and(|v| v.starts_with("2."))
    {
        return Err(document.error("asset.version", "expected version 2.x"));
    }
    let mut notes = Vec::new();
    animation::apply(&mut document, options, &mut notes)?;
    let mut loader = GltfLoader {
        document: &document,
        materials: Vec::new(),
        materials_by_index: BTreeMap::new(),
        default_material: None,
        meshes: BTreeMap::new(),
        entities: Vec::new(),
        lights: Vec::new(),
        camera: None,
        worlds: BTreeMap::new(),
        skins: BTreeMap::new(),
        names: UniqueNames::default(),
        notes: Vec::new(),
    };
    loader.check_extensions()?;
    loader.read_materials(missing, &mut notes)?;
    loader.load_scene()?;
    let camera = loader
        .camera
        .take()
        .unwrap_or_else(|| default_scene::framing_camera(default_scene::bounds(&loader.entities)));
    let desc = SceneDesc {
        resolution: default_scene::DEFAULT_RESOLUTION,
        max_depth: default_scene::DEFAULT_MAX_DEPTH,
        camera,
        materials: loader.materials.into(),
        entities: loader.entities.into(),
        lights: loader.lights,
        ..SceneDesc::default()
    };
    notes.append(&mut loader.notes);
    Ok((desc, notes))
}

/// State while a document is loaded.
struct GltfLoader<'a> {
    document: &'a Document,
    materials: Vec<MaterialDesc>,
    /// Name and texture coordinate sets of each material, by its index in the document.
    materials_by_index: BTreeMap<usize, (String, UvSets)>,
    /// Name of the material of primitives without one.
    default_material: Option<String>,
    /// Meshes by index and deformation.
    meshes: BTreeMap<(usize, DeformationKey), Option<Arc<MeshDesc>>>,
    entities: Vec<EntityDesc>,
    lights: Vec<LightDesc>,
    camera: Option<CameraDesc>,
    /// World transforms of the nodes of the scene; a node may have at most one parent.
    worlds: BTreeMap<usize, DAffine3>,
    /// Maps of the joints of skins, by index; `None` for one that is ignored.
    skins: BTreeMap<usize, Option<Rc<Vec<DAffine3>>>>,
    names: UniqueNames,
    notes: Vec<Note>,
}

impl GltfLoader<'_> {
    fn note(&mut self, place: &str, message: impl Into<String>) {
        let (file, place, message) = (self.document.path.clone(), place.to_owned(), message.into());
        self.notes.push(Note::new(file, place, message));
    }

    /// Returns a unique name: the given one, or the stem with a number.
    fn name(&mut self, given: &Json, stem: &str) -> String {
        self.names
            .allocate(given.as_str().filter(|n| !n.is_empty()).unwrap_or(stem))
    }

    /// Notes unsupported extensions that the document uses, and refuses those that it requires.
    /// Materials are exempt: their unsupported extensions are only noted.
    fn check_extensions(&mut self) -> Result<(), SceneError> {
        let document = self.document;
        let unsupported = |key: &str| {
            let names = document.json[key].as_array().into_iter().flatten();
            let names = names.filter_map(Json::as_str);
            names.filter(|name| !EXTENSIONS.contains(name))
        };
        let is_of_materials = |name: &&str| name.starts_with(MATERIAL_EXTENSION_PREFIX);
        let required = unsupported("extensionsRequired").filter(|name| !is_of_materials(name));
        if let Some(name) = required.map(shown).min() {
            let problem =
                format!("the extension `{name}` is not supported, but the file requires it");
            return Err(document.error("extensionsRequired", problem));
        }
        // Unknown extensions of materials are noted with a material that has them, if any.
        let materials = (0..document.count("materials")).map(|i| document.at("materials", i));
        let carried: Vec<&Json> = materials.map(|m| &m["extensions"]).collect();
        let is_noted = |name: &&str| {
            material::SUPPORTED_EXTENSIONS.contains(name)
                || material::OTHER_EXTENSIONS.contains(name)
                || carried.iter().any(|of_one| of_one[*name].is_object())
        };
        let used = unsupported("extensionsUsed");
        let used = used.filter(|name| !(is_of_materials(name) && is_noted(name)));
        let used: BTreeSet<String> = used.map(shown).collect();
        for name in used {
            self.note(
                "extensionsUsed",
                format!("the extension `{name}` is not supported"),
            );
        }
        Ok(())
    }

    fn read_materials(
        &mut self,
        missing: MissingTextures,
        notes: &mut Vec<Note>,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let mut reader = MaterialReader::new(document, missing, notes);
        for i in 0..document.count("materials") {
            let name = self.name(&document.at("materials", i)["name"], "material");
            let loaded = reader.read(i, name.clone(), &mut self.names)?;
            self.materials_by_index.insert(i, (name, loaded.uv_sets));
            self.materials.extend(loaded.parts);
            self.materials.push(loaded.desc);
        }
        Ok(())
    }

    /// Returns the name of the material of primitives without one: that of an empty object, a rough
    /// white metal.
    fn default_material(&mut self) -> String {
        if let Some(name) = &self.default_material {
            return name.clone();
        }
        let name = self.names.allocate(DEFAULT_MATERIAL);
        self.materials.push(MaterialDesc {
            metallic: 1.0,
            ..MaterialDesc::new(&name)
        });
        self.default_material = Some(name.clone());
        name
    }

    /// Loads the nodes of the default scene, or all root nodes if the document has no scenes.
    fn load_scene(&mut self) -> Result<(), SceneError> {
        let document = self.document;
        let roots: Vec<Json> = match document.count("scenes") {
            0 => {
                let children = (0..document.count("nodes"))
                    .flat_map(|i| list(&document.at("nodes", i)["children"]));
                let inner: BTreeSet<u64> = children.filter_map(|c| c.as_u64()).collect();
                (0..document.count("nodes") as u64)
                    .filter(|i| !inner.contains(i))
                    .map(Json::from)
                    .collect()
            }
            _ => {
                let which = document.json.get("scene").cloned().unwrap_or(Json::from(0));
                list(&document.resolve("scene", "scenes", &which)?.1["nodes"]).to_vec()
            }
        };
        let mut order = Vec::new();
        for root in &roots {
            self.place(root, DAffine3::IDENTITY, 0, &mut order)?;
        }
        order.into_iter().try_for_each(|i| self.node(i))
    }

    /// Computes the world transforms of a node and its children, and appends their indices to
    /// `order`. `parent` is the world transform of its parent.
    fn place(
        &mut self,
        index: &Json,
        parent: DAffine3,
        depth: usize,
        order: &mut Vec<usize>,
    ) -> Result<(), SceneError> {
        let document = self.document;
        let (i, node) = document.resolve("nodes", "nodes", index)?;
        let place = format!("nodes[{i}]");
        let world = parent * node_transform(node);
        if depth > MAX_DEPTH || self.worlds.insert(i, world).is_some() {
            let problem = format!(
                "nodes form a cycle, are nested more than {MAX_DEPTH} deep, or have two parents"
            );
            return Err(document.error(&place, problem));
        }
        if !world.is_finite() {
            return Err(document.error(&place, "the transform must be finite"));
        }
        order.push(i);
        list(&node["children"])
            .iter()
            .try_for_each(|child| self.place(child, world, depth + 1, order))
    }

    /// Loads the mesh, the camera and the light of a node that has been placed.
    fn node(&mut self, i: usize) -> Result<(), SceneError> {
        let (node, place) = (self.document.at("nodes", i), format!("nodes[{i}]"));
        let world = self.worlds[&i];
        if !node["mesh"].is_null() {
            self.entity(&place, node, world)?;
        }
        if !node["camera"].is_null() {
            self.camera(&place, node, world)?;
        }
        let light = &node["extensions"]["KHR_lights_punctual"]["light"];
        if !light.is_null() {
            self.light(&place, light, world)?;
        }
        Ok(())
    }

    /// Reads the camera of a node, unless there is one already.
    fn camera(&mut self, place: &str, node: &Json, world: DAffine3) -> Result<(), SceneError> {
        let (i, camera) = self.document.resolve(place, "cameras", &node["camera"])?;
        let view = match camera["type"].as_str() {
            Some("orthographic") => self.parallel_view(i, &camera["orthographic"]),
            _ => perspective_view(&camera["perspective"]),
        };
        let (Some(view), None) = (view, &self.camera) else {
            let reason = if self.camera.is_some() {
                "only the first camera is used; this one is ignored"
            } else {
                "its view is missing or out of range; this camera is ignored"
            };
            self.note(&format!("cameras[{i}]"), reason);
            return Ok(());
        };
        let axis = |v: DVec3| world.transform_vector3(v).normalize_or(v).as_vec3();
        let (position, forward) = (world.translation, axis(DVec3::NEG_Z));
        // Near the origin the target is a sum in single precision.
        let near = || (position.as_vec3() + forward).as_dvec3();
        let target = default_scene::distant_target(position, forward.as_dvec3());
        self.camera = Some(CameraDesc {
            up: axis(DVec3::Y),
            ..view.placed(position, target.unwrap_or_else(near))
        });
        Ok(())
    }

    /// Reads the view of the orthographic camera number `i`; `None` if it is out of range. Its
    /// magnifications are half the extents of the picture.
    fn parallel_view(&mut self, i: usize, view: &Json) -> Option<CameraDesc> {
        let [x, y] = ["xmag", "ymag"].map(|key| view[key].as_f64().map(f64::abs));
        let (x, y) = (x?, y?);
        let [least, most] = VIEW_HEIGHT_RANGE;
        if !(least..=most).contains(&(2.0 * y)) {
            return None;
        }
        let [width, height] = default_scene::DEFAULT_RESOLUTION.map(f64::from);
        if (x / y * height / width - 1.0).abs() > 2e-3 {
            self.note(
                &format!("cameras[{i}]"),
                "`xmag` over `ymag` differs from width over height of the picture; `ymag` is used",
            );
        }
        Some(CameraDesc {
            kind: CameraKind::Orthographic,
            view_height: (2.0 * y) as f32,
            ..CameraDesc::default()
        })
    }

    /// Adds the light of a node.
    fn light(&mut self, place: &str, index: &Json, world: DAffine3) -> Result<(), SceneError> {
        let lights = &self.document.json["extensions"]["KHR_lights_punctual"]["lights"];
        let Some(light) = index.as_u64().and_then(|i| lights.get(i as usize)).cloned() else {
            return Err(self
                .document
                .error(place, format!("there is no light {index:.20}")));
        };
        let channel = |i: usize| light["color"][i].as_f64().unwrap_or(1.0);
        let strength = light["intensity"].as_f64().unwrap_or(1.0);
        let color = (DVec3::new(channel(0), channel(1), channel(2)) * strength).as_vec3();
        if !(color.is_finite() && color.min_element() >= 0.0 && color.max_element() <= 1e9) {
            return Err(self.document.error(
                place,
                "the colour times the intensity of a light must be between 0 and 1e9",
            ));
        }
        if light["range"].is_number() {
            self.note(
                place,
                "the `range` of a light has no effect: light never ends",
            );
        }
        let direction = || {
            world
                .transform_vector3(DVec3::NEG_Z)
                .normalize_or(DVec3::NEG_Z)
                .as_vec3()
        };
        let kind = match light["type"].as_str() {
            Some("point") => LightKind::Point {
                position: world.translation.as_vec3(),
                intensity: color,
            },
            Some("directional") => LightKind::Directional {
                direction: direction(),
                irradiance: color,
            },
            Some("spot") => LightKind::Spot {
                position: world.translation.as_vec3(),
                direction: direction(),
                intensity: color,
                cone: spot_cone(&light["spot"])
                    .map_err(|problem| self.document.error(place, problem))?,
                image: None,
            },
            _ => {
                self.note(place, "a light of an unknown type is ignored");
                return Ok(());
            }
        };
        let name = self.name(&light["name"], "light");
        self.lights
            .push(LightDesc::placed(name, kind, world.translation));
        Ok(())
    }
}

/// Returns the cone of a spot light.
fn spot_cone(spot: &Json) -> Result<ConeDesc, String> {
    let angle = |key: &str, default: f64| spot[key].as_f64().unwrap_or(default).to_degrees() as f32;
    let cone = ConeDesc {
        beam_deg: angle("innerConeAngle", 0.0),
        cutoff_deg: angle("outerConeAngle", std::f64::consts::FRAC_PI_4),
        edge: ConeEdge::Smooth,
    };
    if cone.is_possible() {
        Ok(cone)
    } else {
        Err(format!(
            "cone angles of {} and {} degrees are out of range; expected 0 <= inner <= outer < 180",
            cone.beam_deg, cone.cutoff_deg
        ))
    }
}

/// Returns the elements of a list, or none for anything else.
fn list(v: &Json) -> &[Json] {
    v.as_array().map_or(&[], Vec::as_slice)
}

/// Reads the view of a perspective camera; `None` if it is missing or out of range.
fn perspective_view(view: &Json) -> Option<CameraDesc> {
    let degrees = view["yfov"].as_f64()?.to_degrees();
    (0.01..179.0).contains(&degrees).then_some(CameraDesc {
        optics: Optics::pinhole(degrees as f32),
        ..CameraDesc::default()
    })
}

/// Returns the transform of a node relative to its parent.
fn node_transform(node: &Json) -> DAffine3 {
    let number = |v: &Json, i: usize, default: f64| v[i].as_f64().unwrap_or(default);
    if node["matrix"].is_array() {
        let unit = DMat4::IDENTITY.to_cols_array();
        let m = DMat4::from_cols_array(&std::array::from_fn(|i| {
            number(&node["matrix"], i, unit[i])
        }));
        return DAffine3::from_mat3_translation(DMat3::from_mat4(m), m.w_axis.truncate());
    }
    let triple = |key: &str, default: f64| {
        let v = &node[key];
        DVec3::new(
            number(v, 0, default),
            number(v, 1, default),
            number(v, 2, default),
        )
    };
    let rotation = unit_quaternion(|i| number(&node["rotation"], i, DQuat::IDENTITY.to_array()[i]));
    DAffine3::from_scale_rotation_translation(
        triple("scale", 1.0),
        rotation,
        triple("translation", 0.0),
    )
}

/// Returns the rotation of a quaternion of any length, or none for one of length zero.
fn unit_quaternion(component: impl Fn(usize) -> f64) -> DQuat {
    let q = DQuat::from_array(std::array::from_fn(component));
    if q.length_squared() > 0.0 {
        q.normalize()
    } else {
        DQuat::IDENTITY
    }
}

/// Returns the beginning of a name, for messages.
fn shown(name: &str) -> String {
    name.chars().take(48).collect()
}
