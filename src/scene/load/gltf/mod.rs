//! glTF 2.0: `.gltf` with its buffers and images beside it or in it, and `.glb`.
//!
//! Read are nodes with their transforms, meshes shared between them, the first perspective camera of the default scene,
//! point and directional lights (`KHR_lights_punctual`), and materials ([`material`]). Intensities are taken as radiance
//! is here, without photometric factors. Texture coordinates start at the top left in the file and at the bottom left
//! here. Triangles without normals are flat, as the format says. A document without lamps gets white light from
//! everywhere, since viewers bring their own; pictures that shine are no lamps. Surfaces are two-sided whatever `doubleSided` says.

mod document;
mod material;
mod reads;

pub(super) use self::reads::READS;

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::rc::Rc;
use std::sync::Arc;

use glam::{DAffine3, DMat3, DMat4, DQuat, DVec3, Mat3A, Vec2, Vec3, Vec3A};
use serde_json::Value as Json;

use self::document::{Document, GLB_MAGIC};
use self::material::{Coordinates, Materials};
use super::{Missing, bare, scn};
use crate::scene::desc::{
    CameraDesc, ConeDesc, ConeEdge, DEFAULT_MATERIAL, EntityDesc, EnvironmentDesc, EnvironmentSource, LightDesc,
    LightKind, MaterialDesc, MeshDesc, Optics, SceneDesc, ShapeDesc, TextureSlot, Transform, mesh_hash,
};
use crate::scene::names::Names;
use crate::scene::shape::Shape;
use crate::scene::{Note, SceneError};

/// How deep nodes may lie in one another.
const MAX_DEPTH: usize = 256;
/// Extensions that are read, or refused where they stand; those of materials are noted with their material.
const EXTENSIONS: &[&str] =
    &["KHR_lights_punctual", "KHR_texture_transform", "KHR_mesh_quantization", "KHR_draco_mesh_compression"];
/// How extensions of materials begin.
const OF_MATERIALS: &str = "KHR_materials_";
/// How many corners of meshes the camera of a scene without one looks at, before it takes the boxes around them.
const MAX_FRAMED: usize = 1 << 24;

/// Whether the first bytes of a file are those of a .glb, or of a JSON that names its `asset`.
pub(super) fn sniff(head: &[u8]) -> bool {
    head.starts_with(GLB_MAGIC) || head.windows(7).any(|w| w == b"\"asset\"")
}

/// Reads a document and everything that it names.
pub(super) fn load(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let document = Document::read(path)?;
    if !document.json["asset"]["version"].as_str().is_some_and(|v| v.starts_with("2.")) {
        return Err(document.error("asset.version", "expected version 2.x"));
    }
    let mut notes = Vec::new();
    let mut builder = Builder {
        document: &document,
        materials: Vec::new(),
        rows: BTreeMap::new(),
        meshes: BTreeMap::new(),
        entities: Vec::new(),
        lights: Vec::new(),
        places: Vec::new(),
        camera: None,
        reached: BTreeSet::new(),
        names: Names::default(),
        notes: Vec::new(),
    };
    builder.extensions()?;
    builder.read_materials(missing, &mut notes)?;
    builder.scene()?;
    let camera = builder.camera.take().unwrap_or_else(|| bare::framing_camera(builder.bounds()));
    // Pictures that shine are signs and screens, which are shown by the light of a viewer.
    let is_lamp = |m: &MaterialDesc| m.emission != Vec3::ZERO && m.texture(TextureSlot::Emission).is_none();
    let dark = builder.lights.is_empty() && !builder.materials.iter().any(is_lamp);
    if dark {
        let message = "it has no lamps: it stands in white light of radiance 1 from everywhere (`environment`)";
        builder.note("scene", message);
    }
    let white = EnvironmentDesc { source: EnvironmentSource::Color(Vec3::ONE), rotation_deg: 0.0, scale: 1.0 };
    let desc = SceneDesc {
        views: Vec::new(),
        resolution: scn::DEFAULT_RESOLUTION,
        max_depth: scn::DEFAULT_MAX_DEPTH,
        camera,
        materials: builder.materials,
        entities: builder.entities,
        lights: builder.lights,
        environment: dark.then_some(white),
    };
    notes.append(&mut builder.notes);
    Ok((desc.with_default_material(true), notes))
}

struct Builder<'a> {
    document: &'a Document,
    materials: Vec<MaterialDesc>,
    /// Name and texture coordinates by index of a material.
    rows: BTreeMap<usize, (String, Coordinates)>,
    meshes: BTreeMap<usize, Option<Arc<MeshDesc>>>,
    entities: Vec<EntityDesc>,
    /// Where each entity stands, in double precision.
    places: Vec<DAffine3>,
    lights: Vec<LightDesc>,
    camera: Option<CameraDesc>,
    /// Nodes that were read: each has one parent, or none.
    reached: BTreeSet<usize>,
    names: Names,
    notes: Vec<Note>,
}

impl Builder<'_> {
    fn note(&mut self, place: &str, message: impl Into<String>) {
        let (file, place, message) = (self.document.path.clone(), place.to_owned(), message.into());
        self.notes.push(Note { file, place, message });
    }

    /// A name of its own: the one that is given, or the stem and a number.
    fn name(&mut self, given: &Json, stem: &str) -> String {
        self.names.give(given.as_str().filter(|n| !n.is_empty()).unwrap_or(stem))
    }

    /// Names the extensions that the document says it uses and that are not read, and refuses those that it cannot do
    /// without, since what would be shown is something else. What a surface looks like is near enough for a note.
    fn extensions(&mut self) -> Result<(), SceneError> {
        let document = self.document;
        let unread = |key: &str| -> BTreeSet<String> {
            let names = document.json[key].as_array().into_iter().flatten().filter_map(Json::as_str);
            let names = names.filter(|name| !EXTENSIONS.contains(name) && !name.starts_with(OF_MATERIALS));
            names.map(|name| name.chars().take(48).collect()).collect()
        };
        if let Some(name) = unread("extensionsRequired").first() {
            let problem = format!("the extension `{name}` is not read, and the file says that it must be");
            return Err(document.error("extensionsRequired", problem));
        }
        for name in unread("extensionsUsed") {
            self.note("extensionsUsed", format!("the extension `{name}` is not read"));
        }
        Ok(())
    }

    fn read_materials(&mut self, missing: Missing, notes: &mut Vec<Note>) -> Result<(), SceneError> {
        let document = self.document;
        let mut reader = Materials::new(document, missing, notes);
        for i in 0..document.count("materials") {
            let name = self.name(&document.at("materials", i)["name"], "material");
            let read = reader.read(i, name.clone())?;
            self.rows.insert(i, (name, read.wanted));
            self.materials.push(read.desc);
        }
        Ok(())
    }

    fn scene(&mut self) -> Result<(), SceneError> {
        let document = self.document;
        for (list, what) in [("animations", "animations"), ("skins", "skins")] {
            if document.count(list) > 0 {
                self.note(list, format!("{what} are not read: everything stands as its nodes say"));
            }
        }
        let roots: Vec<Json> = match document.count("scenes") {
            0 => {
                let children = (0..document.count("nodes")).flat_map(|i| list(&document.at("nodes", i)["children"]));
                let inner: BTreeSet<u64> = children.filter_map(|c| c.as_u64()).collect();
                (0..document.count("nodes") as u64).filter(|i| !inner.contains(i)).map(Json::from).collect()
            }
            _ => {
                let which = document.json.get("scene").cloned().unwrap_or(Json::from(0));
                list(&document.named("scene", "scenes", &which)?.1["nodes"])
            }
        };
        roots.iter().try_for_each(|root| self.node(root, DAffine3::IDENTITY, 0))
    }

    fn node(&mut self, index: &Json, around: DAffine3, depth: usize) -> Result<(), SceneError> {
        let document = self.document;
        let (i, node) = document.named("nodes", "nodes", index)?;
        let place = format!("nodes[{i}]");
        if depth > MAX_DEPTH || !self.reached.insert(i) {
            let problem = format!("nodes lie in a circle, more than {MAX_DEPTH} deep, or have two parents");
            return Err(document.error(&place, problem));
        }
        let world = around * transform(node);
        if !world.is_finite() {
            return Err(document.error(&place, "its transform must be finite"));
        }
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
        list(&node["children"]).iter().try_for_each(|child| self.node(child, world, depth + 1))
    }

    fn entity(&mut self, place: &str, node: &Json, world: DAffine3) -> Result<(), SceneError> {
        let (i, mesh) = self.document.named(place, "meshes", &node["mesh"])?;
        let shape = match self.meshes.get(&i) {
            Some(known) => known.clone(),
            None => {
                let read = self.mesh(i, mesh)?.map(Arc::new);
                self.meshes.insert(i, read.clone());
                read
            }
        };
        let Some(shape) = shape else { return Ok(()) };
        let given = if node["name"].is_string() { &node["name"] } else { &mesh["name"] };
        let name = self.name(given, "mesh");
        let frame = glam::Affine3A {
            matrix3: Mat3A::from(world.matrix3.as_mat3()),
            translation: Vec3A::from(world.translation.as_vec3()),
        };
        self.places.push(world);
        self.entities.push(EntityDesc {
            name,
            transform: Transform::framed(frame),
            material: None,
            anisotropic_direction: None,
            shape: ShapeDesc::Mesh(shape),
        });
        Ok(())
    }

    /// The box around all meshes in their places.
    fn bounds(&self) -> Option<[Vec3; 2]> {
        let (mut bounds, mut framed) = (None, 0);
        // Bounds of meshes in their own space, by address.
        let mut boxes: BTreeMap<*const MeshDesc, [Vec3; 2]> = BTreeMap::new();
        for (entity, world) in self.entities.iter().zip(&self.places) {
            let ShapeDesc::Mesh(mesh) = &entity.shape else { continue };
            framed += mesh.positions.len();
            let mut widen = |p: Vec3| {
                let p = world.transform_point3(p.as_dvec3()).as_vec3();
                bounds = Some(bare::joined(bounds, p, p));
            };
            if framed <= MAX_FRAMED {
                mesh.positions.iter().copied().for_each(widen);
                continue;
            }
            // Copies without end of one mesh.
            let Some(first) = mesh.positions.first() else { continue };
            let [low, high] = *boxes.entry(Arc::as_ptr(mesh)).or_insert_with(|| {
                mesh.positions.iter().fold([*first; 2], |[low, high], p| [low.min(*p), high.max(*p)])
            });
            (0..8).for_each(|i| widen(Vec3::select(glam::BVec3::new(i & 1 > 0, i & 2 > 0, i & 4 > 0), low, high)));
        }
        bounds
    }

    /// All primitives of a mesh as one; `None` where none is made of triangles.
    fn mesh(&mut self, i: usize, mesh: &Json) -> Result<Option<MeshDesc>, SceneError> {
        let mut whole = Shape::default();
        let (mut slots, mut triangle_slot): (Vec<String>, Vec<u32>) = (Vec::new(), Vec::new());
        for (k, primitive) in list(&mesh["primitives"]).iter().enumerate() {
            let Some((part, slot)) = self.primitive(&format!("meshes[{i}].primitives[{k}]"), primitive)? else {
                continue;
            };
            let row = slots.iter().position(|s| *s == slot).unwrap_or(slots.len());
            if row == slots.len() {
                slots.push(slot);
            }
            triangle_slot.resize(triangle_slot.len() + part.triangles.len(), row as u32);
            whole.merge(part);
        }
        if whole.triangles.is_empty() {
            return Ok(None);
        }
        let mut mesh = MeshDesc { slots, triangle_slot, ..whole.into_mesh(self.document.path.clone(), "") };
        mesh.content_hash = mesh_hash(&mesh);
        Ok(Some(mesh))
    }

    /// The triangles of a primitive and the name of their material; `None`, with a note, where it has no triangles.
    fn primitive(&mut self, place: &str, primitive: &Json) -> Result<Option<(Shape, String)>, SceneError> {
        let document = self.document;
        let mode = primitive["mode"].as_u64().unwrap_or(4);
        if !(4..=6).contains(&mode) {
            self.note(place, "points and lines are not surfaces: left out");
            return Ok(None);
        }
        if primitive["extensions"]["KHR_draco_mesh_compression"].is_object() {
            return Err(document.error(place, "meshes compressed with Draco are not read"));
        }
        let attributes = &primitive["attributes"];
        for (key, what) in [("COLOR_1", "second colours of vertices"), ("JOINTS_0", "joints")] {
            if !attributes[key].is_null() {
                self.note(place, format!("{what} are not read"));
            }
        }
        if primitive["targets"].is_array() {
            self.note(place, "morph targets are not read");
        }
        let (slot, wanted) = match &primitive["material"] {
            Json::Null => (DEFAULT_MATERIAL.to_owned(), Coordinates::default()),
            index => self.rows[&document.named(place, "materials", index)?.0].clone(),
        };
        let at = |key: &str| format!("{place}.attributes.{key}");
        let vectors = |key: &str, n: usize| match &attributes[key] {
            Json::Null => Ok(Rc::default()),
            index => document.numbers(&at(key), index, n),
        };
        let positions = vectors("POSITION", 3)?;
        let normals = vectors("NORMAL", 3)?;
        let uvs = vectors(&format!("TEXCOORD_{}", wanted.first), 2)?;
        let second = match wanted.second {
            Some(set) => vectors(&format!("TEXCOORD_{set}"), 2)?,
            None => Rc::default(),
        };
        let width = match &attributes["COLOR_0"] {
            Json::Null => 3,
            index => match document.named(&at("COLOR_0"), "accessors", index)?.1["type"].as_str() {
                Some("VEC4") => 4,
                _ => 3,
            },
        };
        let colors = vectors("COLOR_0", width)?;
        let count = positions.len() / 3;
        let counts = [normals.len() / 3, uvs.len() / 2, second.len() / 2, colors.len() / width];
        if counts.into_iter().any(|n| n != 0 && n != count) {
            return Err(document.error(place, "its attributes have different numbers of elements"));
        }
        let indices = match &primitive["indices"] {
            Json::Null => None,
            index => Some(document.numbers(&format!("{place}.indices"), index, 1)?),
        };
        // Primitives often share vertices of which each has a few.
        let corners = indices.as_ref().map_or(count, |indices| indices.len());
        let numbers = positions.len() + normals.len() + uvs.len() + second.len() + colors.len();
        let each = (numbers / count.max(1)).max(8);
        document.spend(place, (each * corners.min(count)) as u64 + corners as u64)?;
        let mut indices: Vec<u32> = match indices {
            None => (0..count as u32).collect(),
            Some(indices) => indices.iter().map(|x| *x as u32).collect(),
        };
        if let Some(i) = indices.iter().find(|i| **i as usize >= count) {
            return Err(document.error(place, format!("a corner is vertex {i} of {count}")));
        }
        let used: Vec<u32> = if indices.len() < count {
            let mut used = indices.clone();
            used.sort_unstable();
            used.dedup();
            indices.iter_mut().for_each(|i| *i = used.partition_point(|u| *u < *i) as u32);
            used
        } else {
            (0..count as u32).collect()
        };
        let vec3s = |numbers: &[f64]| -> Vec<Vec3> { picked::<3>(numbers, &used).iter().map(|c| vec3(c)).collect() };
        // Ours start at the bottom left.
        let uv = |[x, y]: &[f64; 2], map: glam::Affine2| {
            let p = map.transform_point2(Vec2::new(*x as f32, *y as f32));
            Vec2::new(p.x, 1.0 - p.y)
        };
        let uvs = picked::<2>(&uvs, &used).iter().map(|p| uv(p, wanted.map)).collect();
        let second_uvs = picked::<2>(&second, &used).iter().map(|p| uv(p, glam::Affine2::IDENTITY)).collect();
        let colors: Vec<Vec3> = match width {
            4 => {
                let colors = picked::<4>(&colors, &used);
                if colors.iter().any(|c| c[3] < 1.0) {
                    self.note(&at("COLOR_0"), "the alpha of colours of vertices is not read");
                }
                colors.iter().map(|c| vec3(c)).collect()
            }
            _ => vec3s(&colors),
        };
        let triangles: Vec<[u32; 3]> = match mode {
            4 => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
            5 => strip(&indices),
            _ => indices.windows(2).skip(1).map(|t| [indices[0], t[0], t[1]]).collect(),
        };
        let mut part = Shape {
            positions: vec3s(&positions),
            normals: vec3s(&normals),
            uvs,
            second_uvs,
            colors: colors.into_iter().map(|c| c.clamp(Vec3::ZERO, Vec3::ONE)).collect(),
            triangles,
        };
        if part.normals.is_empty() {
            part.facet();
        }
        part.normals.iter_mut().for_each(|n| *n = n.normalize_or(Vec3::Y));
        Ok(Some((part, slot)))
    }

    fn camera(&mut self, place: &str, node: &Json, world: DAffine3) -> Result<(), SceneError> {
        let (i, camera) = self.document.named(place, "cameras", &node["camera"])?;
        let fov = camera["perspective"]["yfov"].as_f64().map(f64::to_degrees).filter(|d| (0.01..179.0).contains(d));
        let (Some(fov), None) = (fov, &self.camera) else {
            self.note(&format!("cameras[{i}]"), "the first perspective camera is used: this one is left out");
            return Ok(());
        };
        let axis = |v: DVec3| world.transform_vector3(v).normalize_or(v).as_vec3();
        let position = world.translation.as_vec3();
        self.camera = Some(CameraDesc {
            position,
            target: position + axis(DVec3::NEG_Z),
            up: axis(DVec3::Y),
            fov_deg: fov as f32,
            aperture: 0.0,
            focus_distance: None,
            optics: Optics::default(),
        });
        Ok(())
    }

    fn light(&mut self, place: &str, index: &Json, world: DAffine3) -> Result<(), SceneError> {
        let lights = &self.document.json["extensions"]["KHR_lights_punctual"]["lights"];
        let Some(light) = index.as_u64().and_then(|i| lights.get(i as usize)).cloned() else {
            return Err(self.document.error(place, format!("there is no light {index:.20}")));
        };
        let channel = |i: usize| light["color"][i].as_f64().unwrap_or(1.0);
        let strength = light["intensity"].as_f64().unwrap_or(1.0);
        let color = (DVec3::new(channel(0), channel(1), channel(2)) * strength).as_vec3();
        if !(color.is_finite() && color.min_element() >= 0.0 && color.max_element() <= 1e9) {
            return Err(self.document.error(place, "a light must shine with 0 to 1e9"));
        }
        let kind = match light["type"].as_str() {
            Some("point") => LightKind::Point { position: world.translation.as_vec3(), intensity: color },
            Some("directional") => {
                let direction = world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z).as_vec3();
                LightKind::Directional { direction, irradiance: color }
            }
            Some("spot") => {
                let angle =
                    |key: &str, default: f64| light["spot"][key].as_f64().unwrap_or(default).to_degrees() as f32;
                let cutoff_deg = angle("outerConeAngle", std::f64::consts::FRAC_PI_4);
                let cone = ConeDesc { beam_deg: angle("innerConeAngle", 0.0), cutoff_deg, edge: ConeEdge::Smooth };
                if !cone.is_possible() {
                    return Err(self.document.error(place, "the angles of its spot are no cone"));
                }
                let direction = world.transform_vector3(DVec3::NEG_Z).normalize_or(DVec3::NEG_Z).as_vec3();
                LightKind::Spot { position: world.translation.as_vec3(), direction, intensity: color, cone }
            }
            _ => {
                self.note(place, "a light of an unknown type is left out");
                return Ok(());
            }
        };
        let name = self.name(&light["name"], "light");
        self.lights.push(LightDesc { name, kind });
        Ok(())
    }
}

fn list(v: &Json) -> Vec<Json> {
    v.as_array().cloned().unwrap_or_default()
}

fn vec3(c: &[f64]) -> Vec3 {
    DVec3::new(c[0], c[1], c[2]).as_vec3()
}

/// The place of a node around that of its parent.
fn transform(node: &Json) -> DAffine3 {
    let number = |v: &Json, i: usize, default: f64| v[i].as_f64().unwrap_or(default);
    if node["matrix"].is_array() {
        let unit = DMat4::IDENTITY.to_cols_array();
        let m = DMat4::from_cols_array(&std::array::from_fn(|i| number(&node["matrix"], i, unit[i])));
        return DAffine3::from_mat3_translation(DMat3::from_mat4(m), m.w_axis.truncate());
    }
    let triple = |key: &str, default: f64| {
        let v = &node[key];
        DVec3::new(number(v, 0, default), number(v, 1, default), number(v, 2, default))
    };
    let r = &node["rotation"];
    let rotation = DQuat::from_xyzw(number(r, 0, 0.0), number(r, 1, 0.0), number(r, 2, 0.0), number(r, 3, 1.0));
    let rotation = if rotation.length_squared() > 0.0 { rotation.normalize() } else { DQuat::IDENTITY };
    DAffine3::from_scale_rotation_translation(triple("scale", 1.0), rotation, triple("translation", 0.0))
}

/// Every second triangle of a strip runs the other way round.
fn strip(indices: &[u32]) -> Vec<[u32; 3]> {
    let turned = |(i, t): (usize, &[u32])| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[1], t[0], t[2]] };
    indices.windows(3).enumerate().map(turned).collect()
}

/// The elements of these numbers, each of `N`.
fn picked<const N: usize>(numbers: &[f64], which: &[u32]) -> Vec<[f64; N]> {
    let element = |i: &u32| numbers.get(N * *i as usize..).and_then(|rest| rest.first_chunk()).copied();
    which.iter().filter_map(element).collect()
}
