//! The `.scn` format of the vkraytracing program: JSON with `resolution`, `maxdepth`, `camera`, `materials` and
//! `entities`, beside OBJ meshes and textures.
//!
//! Its conventions, as far as they decide a picture:
//! - Keys are compared without regard to case. Files are named relative to the `.scn`.
//! - `maxdepth` counts path edges. `fov` is vertical and in degrees, +y is up.
//! - A mesh stands at T * S * Rx * Ry * Rz with `rotation` in radians; spheres ignore rotation and scale.
//! - Lights shine on their front side with `emission * color` (and the albedo texture), reflect nothing, and end the
//!   paths that hit them, as in the program that the files were written for.
//! - The front of a mesh is the side of its vertex normals; of a face without normals, the side from which its
//!   corners run clockwise.
//! - Faces without `usemtl` have the mesh's `default_material`, else the scene's material `default_material`, else a
//!   white rough one. An unknown name means the scene's first material. `.mtl` files are not read.
//! - Texture coordinates start at the bottom left; colour textures are decoded from sRGB, data textures are not.
//! - `anisotropic_direction` of an entity replaces that of its material, on meshes too.
//!
//! `antialiasing_radius` belongs to the camera there; here the script's `aa` decides, so it becomes a [`Note`], as
//! does everything else that cannot be honoured. An entity may have a `name`, which is an addition of Lumbre; entities
//! without one are called after the stem of their mesh's file, or `sphere`, with `_2`, `_3` and so on where a name is
//! taken. The camera's `aperture`, `focus_distance`, `f_number`, `focal_length` and
//! `sensor_height`, `lights` and `environment` are additions too: `scenes/README.md` describes them.

mod light;
mod material;
pub(super) mod reader;
mod reads;

pub(super) use self::reads::READS;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::Vec3;
use serde_json::Value as Json;

use self::material::Textures;
use self::reader::{Object, Report, kind, numbers, shorten};
use super::obj::{Front, load_mesh};
use super::{Missing, place as one_place, read};
use crate::scene::desc::{
    CameraDesc, DEFAULT_MATERIAL, EntityDesc, MAX_EDGES, MAX_SIDE, MaterialDesc, MeshDesc, Optics, SceneDesc,
    ShapeDesc, Transform,
};
use crate::scene::names::Names;
use crate::scene::{Note, SceneError};
use crate::value::suggest;

/// Greatest size of a `.scn` file in bytes.
const MAX_SCN_BYTES: u64 = 16 << 20;

/// The resolution of a scene that asks for none.
pub(super) const DEFAULT_RESOLUTION: [u32; 2] = [1280, 720];
/// The number of path edges of a scene that asks for none.
pub(super) const DEFAULT_MAX_DEPTH: u32 = 5;
/// The vertical field of view of a camera that asks for none, in degrees.
const DEFAULT_FOV_DEG: f64 = 45.0;
/// The range of fields of view in degrees.
const FOV_RANGE: [f64; 2] = [0.01, 179.0];

/// The greatest length and f-number of a lens.
const LENGTH_LIMIT: f64 = 1e6;
const CAMERA_KEYS: [&str; 9] = [
    "position",
    "lookat",
    "fov",
    "antialiasing_radius",
    "aperture",
    "focus_distance",
    "f_number",
    "focal_length",
    "sensor_height",
];

/// Whether the first bytes of a file look like a `.scn`.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    head.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

/// Reads a `.scn` file and every mesh and texture that it names.
pub(super) fn load(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let bytes = read(path, MAX_SCN_BYTES)?;
    let mut report = Report { file: path.to_owned(), missing, notes: Vec::new() };
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let json: Json = serde_json::from_slice(text).map_err(|e| {
        let message = e.to_string();
        let problem = message.split(" at line ").next().unwrap_or(&message);
        report.error(format!("line {}, column {}", e.line(), e.column()), format!("no valid JSON: {problem}"))
    })?;
    let desc = scene(&json, &mut report)?;
    Ok((desc, report.notes))
}

fn scene(json: &Json, report: &mut Report) -> Result<SceneDesc, SceneError> {
    let mut root = Object::new("", json, report)?;
    let resolution = match root.take("resolution") {
        Some((place, json)) => resolution(&place, json, report)?,
        None => DEFAULT_RESOLUTION,
    };
    let max_depth = match root.number("maxdepth", report)? {
        Some((place, depth)) => {
            let inside = depth.trunc().clamp(1.0, f64::from(MAX_EDGES));
            if inside != depth {
                report.note(place, format!("{depth} is no number of edges from 1 to {MAX_EDGES}: {inside} is used"));
            }
            inside as u32
        }
        None => DEFAULT_MAX_DEPTH,
    };
    let camera = match root.take("camera") {
        Some((place, json)) => camera(&place, json, report)?,
        None => camera("camera", &Json::Object(Default::default()), report)?,
    };
    let mut materials: Vec<MaterialDesc> = Vec::new();
    let mut names = BTreeSet::new();
    let mut textures = Textures::default();
    for (place, json) in root.list("materials", report)? {
        let material = material::read(&place, json, &mut textures, report)?;
        if names.insert(material.name.clone()) {
            materials.push(material);
        } else {
            report.note(
                format!("{place}.name"),
                format!("a material named `{}` came before: this one is never used", shorten(&material.name)),
            );
        }
    }
    let mut entities = Entities::default();
    for (place, json) in root.list("entities", report)? {
        entities.read(&place, json, report)?;
    }
    let mut names = Names::default();
    let mut lights = Vec::new();
    for (place, json) in root.list("lights", report)? {
        lights.push(light::read(&place, json, &mut names, report)?);
    }
    let environment = match root.take("environment") {
        Some((place, json)) => Some(light::environment(&place, json, &mut textures, report)?),
        None => None,
    };
    let known = ["resolution", "maxdepth", "camera", "materials", "entities", "lights", "environment"];
    root.note_unknown(known, report);
    let desc = SceneDesc {
        views: Vec::new(),
        resolution,
        max_depth,
        camera,
        materials,
        entities: entities.list,
        lights,
        environment,
    };
    Ok(desc.with_default_material(false))
}

fn resolution(place: &str, json: &Json, report: &Report) -> Result<[u32; 2], SceneError> {
    let size = numbers::<2>(place, json, report)?;
    if size.iter().any(|n| n.fract() != 0.0 || *n < 1.0 || *n > f64::from(MAX_SIDE)) {
        let [w, h] = size;
        return Err(report.error(place, format!("expected two whole numbers from 1 to {MAX_SIDE}, found {w} and {h}")));
    }
    Ok(size.map(|n| n as u32))
}

fn camera(place: &str, json: &Json, report: &mut Report) -> Result<CameraDesc, SceneError> {
    let mut object = Object::new(place, json, report)?;
    let position = object.vec3("position", report)?.unwrap_or(Vec3::ZERO);
    let target = object.vec3("lookat", report)?.unwrap_or(Vec3::new(0.0, 0.0, 2.0));
    let (mut fov, mut said_fov) = (DEFAULT_FOV_DEG, false);
    if let Some((at, degrees)) = object.number("fov", report)? {
        said_fov = true;
        fov = degrees.clamp(FOV_RANGE[0], FOV_RANGE[1]);
        if fov != degrees {
            report.note(at, format!("{degrees} is no field of view in degrees: {fov} is used"));
        }
    }
    if let Some((at, _)) = object.take("antialiasing_radius") {
        report.note(at, "the script's `aa` decides the pixel filter: ignored");
    }
    let mut length = |key: &str| match object.number(key, report)? {
        None => Ok(None),
        Some((_, x)) if x > 0.0 && x <= LENGTH_LIMIT => Ok(Some(x as f32)),
        Some((at, x)) => Err(report.error(at, format!("expected a positive number up to {LENGTH_LIMIT:e}, found {x}"))),
    };
    let focus_distance = length("focus_distance")?;
    let optics = Optics {
        f_number: length("f_number")?,
        focal_length: length("focal_length")?,
        sensor_height: length("sensor_height")?,
    };
    let aperture = match object.number("aperture", report)? {
        None => 0.0,
        Some((at, _)) if optics.f_number.is_some() => {
            return Err(report.error(at, "the lens has either a diameter or an `f_number`, not both"));
        }
        Some((_, x)) if (0.0..=LENGTH_LIMIT).contains(&x) => x as f32,
        Some((at, x)) => return Err(report.error(at, format!("expected a diameter of 0 or more, found {x}"))),
    };
    if said_fov && optics.focal_length.is_some() && optics.sensor_height.is_some() {
        return Err(
            report.error(object.at("fov"), "`sensor_height` and `focal_length` decide it: leave one of the three out")
        );
    }
    object.note_unknown(CAMERA_KEYS.iter().copied(), report);
    if position == target {
        return Err(report.error(place, "`position` and `lookat` are the same point: the camera looks nowhere"));
    }
    let camera = CameraDesc { position, target, up: Vec3::Y, fov_deg: fov as f32, aperture, focus_distance, optics };
    if camera.lacks_focal_length() {
        let help = "it says nothing without a `focal_length`, or a `sensor_height`, from which it follows";
        return Err(report.error(object.at("f_number"), help));
    }
    Ok(camera)
}

/// The given name, or the stem where none is given, with a number where it is taken, which is a note.
fn name(names: &mut Names, given: Option<&str>, stem: &str, place: &str, report: &mut Report) -> String {
    let name = names.give(given.unwrap_or(stem));
    if given.is_some_and(|g| g != name) {
        report.note(format!("{place}.name"), format!("taken: it is called `{}`", shorten(&name)));
    }
    name
}

/// The entities read so far, and the meshes that they share.
#[derive(Default)]
struct Entities {
    list: Vec<EntityDesc>,
    names: Names,
    /// By file and default material.
    meshes: BTreeMap<(PathBuf, String), Arc<MeshDesc>>,
}

const ENTITY_TYPES: [&str; 2] = ["mesh", "sphere"];
const ENTITY_KEYS: &[&str] = &[
    "type",
    "name",
    "file",
    "position",
    "rotation",
    "scale",
    "material",
    "default_material",
    "radius",
    "inverted_normal",
    "anisotropic_direction",
];

impl Entities {
    fn read(&mut self, place: &str, json: &Json, report: &mut Report) -> Result<(), SceneError> {
        let mut object = Object::new(place, json, report)?;
        let Some((at, what)) = object.string("type", report)? else {
            return Err(report.error(place, "an entity needs a `type`: mesh or sphere"));
        };
        let transform = Transform {
            translate: object.vec3("position", report)?.unwrap_or(Vec3::ZERO),
            rotate_rad: object.vec3("rotation", report)?.unwrap_or(Vec3::ZERO),
            scale: object.vec3("scale", report)?.unwrap_or(Vec3::ONE),
            ..Transform::default()
        };
        let material = object.string("material", report)?.map(|(_, name)| name.to_owned());
        let given = object.string("name", report)?.map(|(_, name)| name.to_owned());
        let anisotropic_direction = object.vec3("anisotropic_direction", report)?;
        let (entity, stem) = match what {
            "mesh" => {
                let mesh = self.mesh(place, &mut object, report)?;
                let stem = mesh.file.file_stem().map_or_else(|| "mesh".into(), |s| s.to_string_lossy().into_owned());
                let shape = ShapeDesc::Mesh(mesh);
                (EntityDesc { name: String::new(), transform, material, anisotropic_direction, shape }, stem)
            }
            "sphere" => {
                let radius = sphere_radius(place, &mut object, report)?;
                if transform.rotate_rad != Vec3::ZERO || transform.scale != Vec3::ONE {
                    report.note(place, "`rotation` and `scale` do not apply to spheres: ignored");
                }
                let transform = Transform { translate: transform.translate, ..Transform::default() };
                let material = Some(material.unwrap_or_else(|| DEFAULT_MATERIAL.to_owned()));
                let shape = ShapeDesc::Sphere { radius };
                let name = String::new();
                (EntityDesc { name, transform, material, anisotropic_direction, shape }, "sphere".to_owned())
            }
            other => {
                let help = match suggest::nearest(other, ENTITY_TYPES) {
                    Some(near) => format!("did you mean `{near}`?"),
                    None => format!("known: {}", ENTITY_TYPES.join(", ")),
                };
                return Err(report.error(at, format!("unknown type of entity `{}` ({help})", shorten(other))));
            }
        };
        if let Some((at, _)) = object.take("inverted_normal") {
            report.note(at, "it never had an effect in the program that it was written for either: ignored");
        }
        let misplaced: &[&str] = if what == "mesh" { &["radius"] } else { &["file", "default_material"] };
        for key in misplaced {
            if let Some((at, _)) = object.take(key) {
                report.note(at, format!("a {what} has none: ignored"));
            }
        }
        object.note_unknown(ENTITY_KEYS.iter().copied(), report);
        let name = name(&mut self.names, given.as_deref(), &stem, place, report);
        self.list.push(EntityDesc { name, ..entity });
        Ok(())
    }

    fn mesh(&mut self, place: &str, object: &mut Object, report: &mut Report) -> Result<Arc<MeshDesc>, SceneError> {
        let Some((at, file)) = object.string("file", report)? else {
            return Err(report.error(place, "a mesh needs a `file`"));
        };
        let default = object.string("default_material", report)?.map_or(DEFAULT_MATERIAL, |(_, name)| name);
        let path = report.resolve(file);
        let key = (one_place(&path), default.to_owned());
        if let Some(mesh) = self.meshes.get(&key) {
            return Ok(mesh.clone());
        }
        let mesh = load_mesh(&path, default, Front::Clockwise, &mut report.notes);
        let mesh = Arc::new(mesh.map_err(|e| report.named_at(&at, e))?);
        self.meshes.insert(key, mesh.clone());
        Ok(mesh)
    }
}

fn sphere_radius(place: &str, object: &mut Object, report: &Report) -> Result<f32, SceneError> {
    let Some((at, json)) = object.take("radius") else {
        return Err(report.error(place, "a sphere needs a `radius`"));
    };
    match json.as_f64() {
        Some(r) if r as f32 > 0.0 && r <= f64::from(crate::scene::desc::MAX_COORDINATE) => Ok(r as f32),
        _ => Err(report.error(at, format!("expected a positive number, found {}", kind(json)))),
    }
}
