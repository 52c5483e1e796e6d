//! The `.scn` format of the vkraytracing program: JSON with `resolution`, `maxdepth`, `camera`,
//! `materials` and `entities`, beside OBJ meshes and textures.
//!
//! Conventions that affect the image:
//! - Keys are case-insensitive. Paths are relative to the `.scn`.
//! - `maxdepth` counts path edges. `fov` is vertical and in degrees, +y is up.
//! - The transform of a mesh is T * S * Rx * Ry * Rz with `rotation` in radians; spheres ignore
//!   rotation and scale.
//! - Emitters emit `emission * color` (times the albedo texture) on their front side, do not
//!   reflect, and end the paths that hit them, as in the original program.
//! - The front of a mesh is the side of its vertex normals; of a face without normals, the side
//!   from which its vertices run clockwise.
//! - Faces without `usemtl` use the mesh's `default_material`, else the scene's material
//!   `default_material`, else a white rough one. An unknown name selects the scene's first
//!   material. `.mtl` files are not read.
//! - Texture coordinates start at the bottom left; colour textures are decoded from sRGB, data
//!   textures are not.
//! - `anisotropic_direction` of an entity replaces that of its material, for meshes too.
//!
//! `antialiasing_radius` is a key of the camera in the original format; here the script's `aa` sets
//! the filter, so the key becomes a [`Note`], like everything else that is not supported. Additions
//! of Lumbre: an entity may have a `name` (entities without one are named after their mesh's file,
//! or `sphere`, with a suffix `_2`, `_3` and so on if the name is taken); `aperture`,
//! `focus_distance`, `f_number`, `focal_length` and `sensor_height` of the camera; `lights` and
//! `environment`. `scenes/README.md` describes them.

mod light;
mod material;
pub(super) mod reader;
mod supported;

pub(super) use self::supported::SUPPORTED;

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::{DVec3, Vec3};
use serde_json::Value as Json;

use self::material::TextureFiles;
use self::reader::{Diagnostics, JsonObject, describe, numbers, truncated};
use super::default_scene::{DEFAULT_MAX_DEPTH, DEFAULT_RESOLUTION};
use super::obj::{Front, Smoothing, load_mesh};
use super::{MissingTextures, canonical, read_file};
use crate::names::UniqueNames;
use lumbre_light::scene::desc::{
    CameraDesc, DEFAULT_MATERIAL, EntityDesc, MAX_EDGES, MAX_SIDE, MaterialDesc, MeshDesc, Optics,
    SceneDesc, ShapeDesc, Transform,
};
use lumbre_light::scene::{Note, SceneError};
use lumbre_light::value::suggest;

/// Greatest size of a `.scn` file in bytes.
const MAX_SCN_BYTES: u64 = 16 << 20;

/// Default vertical field of view in degrees.
const DEFAULT_FOV_DEG: f64 = 45.0;
/// Least and greatest field of view in degrees.
const FOV_RANGE: [f64; 2] = [0.01, 179.0];

/// Greatest length and f-number of a lens.
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

/// Returns whether the first bytes of a file look like a `.scn`.
pub(super) fn sniff(head: &[u8]) -> bool {
    let head = head.strip_prefix(b"\xef\xbb\xbf").unwrap_or(head);
    head.iter().find(|b| !b.is_ascii_whitespace()) == Some(&b'{')
}

/// Loads a `.scn` file and every mesh and texture that it refers to.
pub(super) fn load(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let bytes = read_file(path, MAX_SCN_BYTES)?;
    let mut diagnostics = Diagnostics {
        file: path.to_owned(),
        missing,
        notes: Vec::new(),
    };
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(&bytes);
    let json: Json = serde_json::from_slice(text).map_err(|e| {
        let message = e.to_string();
        let problem = message.split(" at line ").next().unwrap_or(&message);
        diagnostics.error(
            format!("line {}, column {}", e.line(), e.column()),
            format!("invalid JSON: {problem}"),
        )
    })?;
    let desc = scene(&json, &mut diagnostics)?;
    Ok((desc, diagnostics.notes))
}

/// Reads the document.
fn scene(json: &Json, diagnostics: &mut Diagnostics) -> Result<SceneDesc, SceneError> {
    let mut root = JsonObject::new("", json, diagnostics)?;
    let resolution = match root.get("resolution") {
        Some((place, json)) => resolution(&place, json, diagnostics)?,
        None => DEFAULT_RESOLUTION,
    };
    let max_depth = max_depth(&mut root, diagnostics)?;
    let camera = match root.get("camera") {
        Some((place, json)) => camera(&place, json, diagnostics)?,
        None => camera("camera", &Json::Object(Default::default()), diagnostics)?,
    };
    let mut textures = TextureFiles::default();
    let materials = materials(&mut root, &mut textures, diagnostics)?;
    let mut entities = EntityReader::default();
    for (place, json) in root.list("entities", diagnostics)? {
        entities.read(&place, json, diagnostics)?;
    }
    let mut names = UniqueNames::default();
    let mut lights = Vec::new();
    for (place, json) in root.list("lights", diagnostics)? {
        let light = light::read(&place, json, &mut names, &mut textures, diagnostics)?;
        lights.push(light);
    }
    let environment = match root.get("environment") {
        Some((place, json)) => Some(light::environment(
            &place,
            json,
            &mut textures,
            diagnostics,
        )?),
        None => None,
    };
    let known = [
        "resolution",
        "maxdepth",
        "camera",
        "materials",
        "entities",
        "lights",
        "environment",
    ];
    root.note_unknown(known, diagnostics);
    let desc = SceneDesc {
        views: Vec::new(),
        resolution,
        max_depth,
        camera,
        materials: materials.into(),
        entities: entities.list.into(),
        lights,
        environment,
    };
    Ok(desc.with_default_material(false))
}

/// Reads the greatest number of path edges.
fn max_depth(root: &mut JsonObject, diagnostics: &mut Diagnostics) -> Result<u32, SceneError> {
    let Some((place, depth)) = root.number("maxdepth", diagnostics)? else {
        return Ok(DEFAULT_MAX_DEPTH);
    };
    let inside = depth.trunc().clamp(1.0, f64::from(MAX_EDGES));
    if inside != depth {
        diagnostics.note(
            place,
            format!(
                "{depth} is not a whole number of edges from 1 to {MAX_EDGES}; {inside} is used"
            ),
        );
    }
    Ok(inside as u32)
}

/// Reads the materials; of several with one name, the first is used.
fn materials(
    root: &mut JsonObject,
    textures: &mut TextureFiles,
    diagnostics: &mut Diagnostics,
) -> Result<Vec<MaterialDesc>, SceneError> {
    let mut materials: Vec<MaterialDesc> = Vec::new();
    let mut names = BTreeSet::new();
    for (place, json) in root.list("materials", diagnostics)? {
        let material = material::read(&place, json, textures, diagnostics)?;
        if names.insert(material.name.clone()) {
            materials.push(material);
        } else {
            diagnostics.note(
                format!("{place}.name"),
                format!(
                    "a material named `{}` is already defined; this one is ignored",
                    truncated(&material.name)
                ),
            );
        }
    }
    Ok(materials)
}

/// Reads the width and height of the image in pixels.
fn resolution(place: &str, json: &Json, diagnostics: &Diagnostics) -> Result<[u32; 2], SceneError> {
    let size = numbers::<2>(place, json, diagnostics)?;
    if size
        .iter()
        .any(|n| n.fract() != 0.0 || *n < 1.0 || *n > f64::from(MAX_SIDE))
    {
        let [w, h] = size;
        return Err(diagnostics.error(
            place,
            format!("expected two whole numbers from 1 to {MAX_SIDE}, found {w} and {h}"),
        ));
    }
    Ok(size.map(|n| n as u32))
}

/// Reads the camera.
fn camera(
    place: &str,
    json: &Json,
    diagnostics: &mut Diagnostics,
) -> Result<CameraDesc, SceneError> {
    let mut object = JsonObject::new(place, json, diagnostics)?;
    let position = object
        .point("position", diagnostics)?
        .unwrap_or(DVec3::ZERO);
    let target = object
        .point("lookat", diagnostics)?
        .unwrap_or(DVec3::new(0.0, 0.0, 2.0));
    let fov = object.number("fov", diagnostics)?;
    let has_fov = fov.is_some();
    let mut fov_deg = DEFAULT_FOV_DEG;
    if let Some((at, degrees)) = fov {
        let [least, greatest] = FOV_RANGE;
        fov_deg = degrees.clamp(least, greatest);
        if fov_deg != degrees {
            diagnostics.note(
                at,
                format!("{degrees} is outside {least} to {greatest} degrees; {fov_deg} is used"),
            );
        }
    }
    if let Some((at, _)) = object.get("antialiasing_radius") {
        diagnostics.note(at, "the pixel filter is set by the script's `aa`; ignored");
    }
    let (focus_distance, optics) = lens(&mut object, diagnostics)?;
    if has_fov && optics.determine_view() {
        return Err(diagnostics.error(
            object.key_path("fov"),
            "the field of view is already determined by `sensor_height` and `focal_length`; remove \
             one of the three",
        ));
    }
    object.note_unknown(CAMERA_KEYS.iter().copied(), diagnostics);
    if position == target {
        return Err(diagnostics.error(
            place,
            "`position` and `lookat` are the same point, so there is no view direction",
        ));
    }
    let camera = CameraDesc {
        up: Vec3::Y,
        focus_distance,
        optics: optics.with_fov_deg(fov_deg as f32),
        ..CameraDesc::default().placed(position, target)
    };
    if camera.lacks_focal_length() {
        return Err(diagnostics.error(
            object.key_path("f_number"),
            "an f-number has no effect without a `focal_length`; set `focal_length` or \
             `sensor_height`, or give the lens diameter as `aperture`",
        ));
    }
    Ok(camera)
}

/// Reads the lens: aperture, focus distance and photographic parameters.
fn lens(
    camera: &mut JsonObject,
    diagnostics: &Diagnostics,
) -> Result<(Option<f32>, Optics), SceneError> {
    let mut length = |key: &str| match camera.number(key, diagnostics)? {
        None => Ok(None),
        Some((_, x)) if x > 0.0 && x <= LENGTH_LIMIT => Ok(Some(x as f32)),
        Some((at, x)) => Err(diagnostics.error(
            at,
            format!("expected a positive number up to {LENGTH_LIMIT:e}, found {x}"),
        )),
    };
    let focus_distance = length("focus_distance")?;
    let optics = Optics::default()
        .with_f_number(length("f_number")?)
        .with_focal_length(length("focal_length")?)
        .with_sensor_height(length("sensor_height")?);
    let optics = match camera.number("aperture", diagnostics)? {
        None => optics,
        Some((at, _)) if optics.f_number().is_some() => {
            return Err(diagnostics.error(
                at,
                "`aperture` and `f_number` exclude each other; give only one of them",
            ));
        }
        Some((_, x)) if (0.0..=LENGTH_LIMIT).contains(&x) => optics.with_aperture(x as f32),
        Some((at, x)) => {
            return Err(
                diagnostics.error(at, format!("expected a diameter of 0 or more, found {x}"))
            );
        }
    };
    Ok((focus_distance, optics))
}

/// Returns the message for an unknown value of a `type` key, with a suggestion.
fn unknown_type(what: &str, found: &str, known: &[&str]) -> String {
    let help = match suggest::nearest(found, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("known: {}", known.join(", ")),
    };
    format!("unknown {what} type `{}` ({help})", truncated(found))
}

/// Returns a unique name: the given one or the stem, with a number if it is taken. A changed given
/// name is noted.
fn unique_name(
    names: &mut UniqueNames,
    given: Option<&str>,
    stem: &str,
    place: &str,
    diagnostics: &mut Diagnostics,
) -> String {
    let name = names.allocate(given.unwrap_or(stem));
    if given.is_some_and(|g| g != name) {
        diagnostics.note(
            format!("{place}.name"),
            format!(
                "the name is taken; this one is called `{}`",
                truncated(&name)
            ),
        );
    }
    name
}

/// Reader of entities: the entities read so far, and the meshes that they share.
#[derive(Default)]
struct EntityReader {
    list: Vec<EntityDesc>,
    names: UniqueNames,
    /// Meshes by canonical path and default material.
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

impl EntityReader {
    /// Reads an entity.
    fn read(
        &mut self,
        place: &str,
        json: &Json,
        diagnostics: &mut Diagnostics,
    ) -> Result<(), SceneError> {
        let mut object = JsonObject::new(place, json, diagnostics)?;
        let Some((at, what)) = object.string("type", diagnostics)? else {
            return Err(diagnostics.error(place, "an entity needs a `type`: mesh or sphere"));
        };
        let mut transform = transform(&mut object, diagnostics)?;
        let mut material = object
            .string("material", diagnostics)?
            .map(|(_, name)| name.to_owned());
        let given = object
            .string("name", diagnostics)?
            .map(|(_, name)| name.to_owned());
        let anisotropic_direction = object.vec3("anisotropic_direction", diagnostics)?;
        let (shape, stem) = match what {
            "mesh" => {
                let mesh = self.mesh(place, &mut object, diagnostics)?;
                let stem = mesh
                    .file
                    .file_stem()
                    .map_or_else(|| "mesh".into(), |s| s.to_string_lossy().into_owned());
                (ShapeDesc::Mesh(mesh), stem)
            }
            "sphere" => {
                let radius = sphere_radius(place, &mut object, diagnostics)?;
                if transform.rotate_rad != Vec3::ZERO || transform.scale != Vec3::ONE {
                    diagnostics.note(
                        place,
                        "`rotation` and `scale` do not apply to spheres; ignored",
                    );
                }
                transform = Transform {
                    translate: transform.translate,
                    ..Transform::default()
                };
                material.get_or_insert_with(|| DEFAULT_MATERIAL.to_owned());
                (ShapeDesc::Sphere { radius }, "sphere".to_owned())
            }
            other => {
                let problem = unknown_type("entity", other, &ENTITY_TYPES);
                return Err(diagnostics.error(at, problem));
            }
        };
        note_unused(what, &mut object, diagnostics);
        object.note_unknown(ENTITY_KEYS.iter().copied(), diagnostics);
        let name = unique_name(&mut self.names, given.as_deref(), &stem, place, diagnostics);
        self.list.push(EntityDesc {
            name,
            transform,
            material,
            anisotropic_direction,
            shape,
        });
        Ok(())
    }

    /// Loads the mesh of an entity, once per file and default material.
    fn mesh(
        &mut self,
        place: &str,
        object: &mut JsonObject,
        diagnostics: &mut Diagnostics,
    ) -> Result<Arc<MeshDesc>, SceneError> {
        let Some((at, file)) = object.string("file", diagnostics)? else {
            return Err(diagnostics.error(place, "a mesh needs a `file`"));
        };
        let default = object
            .string("default_material", diagnostics)?
            .map_or(DEFAULT_MATERIAL, |(_, name)| name);
        let path = diagnostics.resolve(file);
        let key = (canonical(&path), default.to_owned());
        if let Some(mesh) = self.meshes.get(&key) {
            return Ok(mesh.clone());
        }
        let conventions = (Front::Clockwise, Smoothing::Groups);
        let mesh = load_mesh(&path, default, conventions, &mut diagnostics.notes);
        let mesh = Arc::new(mesh.map_err(|e| diagnostics.at_reference(&at, e))?);
        self.meshes.insert(key, mesh.clone());
        Ok(mesh)
    }
}

/// Reads the transform of an entity.
fn transform(object: &mut JsonObject, diagnostics: &Diagnostics) -> Result<Transform, SceneError> {
    Ok(Transform {
        translate: object
            .point("position", diagnostics)?
            .unwrap_or(DVec3::ZERO),
        rotate_rad: object.vec3("rotation", diagnostics)?.unwrap_or(Vec3::ZERO),
        scale: object.vec3("scale", diagnostics)?.unwrap_or(Vec3::ONE),
        ..Transform::default()
    })
}

/// Notes the keys of an entity that have no effect.
fn note_unused(what: &str, object: &mut JsonObject, diagnostics: &mut Diagnostics) {
    if let Some((at, _)) = object.get("inverted_normal") {
        diagnostics.note(
            at,
            "`inverted_normal` has no effect, as in the original program; ignored",
        );
    }
    let inapplicable: &[&str] = if what == "mesh" {
        &["radius"]
    } else {
        &["file", "default_material"]
    };
    for key in inapplicable {
        if let Some((at, _)) = object.get(key) {
            diagnostics.note(at, format!("a {what} has no `{key}`; ignored"));
        }
    }
}

/// Reads the radius of a sphere.
fn sphere_radius(
    place: &str,
    object: &mut JsonObject,
    diagnostics: &Diagnostics,
) -> Result<f32, SceneError> {
    let Some((at, json)) = object.get("radius") else {
        return Err(diagnostics.error(place, "a sphere needs a `radius`"));
    };
    match json.as_f64() {
        Some(r) if r as f32 > 0.0 && r <= f64::from(lumbre_light::scene::desc::MAX_COORDINATE) => {
            Ok(r as f32)
        }
        _ => Err(diagnostics.error(
            at,
            format!("expected a positive number, found {}", describe(json)),
        )),
    }
}
