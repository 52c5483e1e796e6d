//! `set "materials.egg.roughness" = v`: the only door for sweeps into a scene.
//!
//! Tables say everything that can be set: [`SCENE_PARAMS`], [`ENTITY_PARAMS`], [`LIGHT_PARAMS`],
//! [`ENVIRONMENT_PARAMS`] and the material table ([`MATERIAL_PARAMS`]). Names of materials, entities and lights may hold
//! dots: the last part of a path is the parameter. Textures are set by slot ([`TextureSlot::name`]) to a file, or to an
//! empty text for none.

mod lights;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;

pub use lights::{ENVIRONMENT_PARAMS, EnvironmentParam, LIGHT_PARAMS, LightParam};

use super::desc::material::MaterialParam;
use super::desc::{
    EntityDesc, MATERIAL_PARAMS, MAX_COORDINATE, MAX_EDGES, MAX_SIDE, SceneDesc, ShapeDesc, TextureSlot,
};
use super::load;
use crate::value::Value;
use crate::value::schema::{SchemaError, Ty, unknown_key, unknown_name};

/// The name that stands for every material that emits nothing.
pub const ALL_MATERIALS: &str = "*";

const COORDINATE: f64 = MAX_COORDINATE as f64;
const POINT: Ty = Ty::Nums { len: 3, min: -COORDINATE, max: COORDINATE };

/// A setting of the scene as a whole.
#[derive(Debug)]
pub struct SceneParam {
    /// The whole path.
    pub path: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit in a sentence.
    pub doc: &'static str,
    /// Writes the setting; the value has been checked against `ty`.
    set_checked: fn(&mut SceneDesc, &Value),
}

/// Every setting that is no material's and no entity's.
pub const SCENE_PARAMS: &[SceneParam] = &[
    SceneParam {
        path: "camera.fov",
        ty: Ty::Num { min: 0.01, max: 179.0 },
        doc: "Vertical field of view in degrees; sensor_height and focal_length together decide it instead.",
        set_checked: |s, v| s.camera.fov_deg = scalar(v),
    },
    SceneParam {
        path: "camera.aperture",
        ty: Ty::Num { min: 0.0, max: 1e6 },
        doc: "Diameter of the lens in scene units; 0 is a pinhole. Replaces an f_number of the scene.",
        set_checked: |s, v| (s.camera.aperture, s.camera.optics.f_number) = (scalar(v), None),
    },
    SceneParam {
        path: "camera.f_number",
        ty: Ty::Num { min: 1e-3, max: 1e6 },
        doc: "Focal length over the diameter of the lens, which replaces an aperture of the scene.",
        set_checked: |s, v| s.camera.optics.f_number = Some(scalar(v)),
    },
    SceneParam {
        path: "camera.focal_length",
        ty: Ty::Num { min: 1e-9, max: 1e6 },
        doc: "Focal length in scene units, at which the sensor stands behind the lens.",
        set_checked: |s, v| s.camera.optics.focal_length = Some(scalar(v)),
    },
    SceneParam {
        path: "camera.sensor_height",
        ty: Ty::Num { min: 1e-9, max: 1e6 },
        doc: "Height of the sensor in scene units.",
        set_checked: |s, v| s.camera.optics.sensor_height = Some(scalar(v)),
    },
    SceneParam {
        path: "camera.focus_distance",
        ty: Ty::Num { min: 1e-6, max: COORDINATE },
        doc: "Distance from the lens to the plane in focus along the axis, in scene units.",
        set_checked: |s, v| s.camera.focus_distance = Some(scalar(v)),
    },
    SceneParam {
        path: "camera.position",
        ty: POINT,
        doc: "Centre of projection or of the lens.",
        set_checked: |s, v| s.camera.position = vector(v),
    },
    SceneParam {
        path: "camera.target",
        ty: POINT,
        doc: "A point on the optical axis.",
        set_checked: |s, v| s.camera.target = vector(v),
    },
    SceneParam {
        path: "camera.up",
        ty: POINT,
        doc: "The direction that is up in the picture.",
        set_checked: |s, v| s.camera.up = vector(v),
    },
    SceneParam {
        path: "resolution",
        ty: Ty::Nums { len: 2, min: 1.0, max: MAX_SIDE as f64 },
        doc: "Width and height in whole pixels.",
        set_checked: |s, v| s.resolution = [item(v, 0) as u32, item(v, 1) as u32],
    },
    SceneParam {
        path: "max_depth",
        ty: Ty::Int { min: 1, max: MAX_EDGES as i64 },
        doc: "Greatest number of path edges; 1 is emission only, 2 direct light.",
        set_checked: |s, v| s.max_depth = v.as_i64().unwrap_or(1) as u32,
    },
];

/// A setting of one entity.
#[derive(Debug)]
pub struct EntityParam {
    /// The last part of the path: `entities.NAME.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit in a sentence.
    pub doc: &'static str,
    /// Whether the setting means anything for a shape.
    applies: fn(&ShapeDesc) -> bool,
    /// Writes the setting; the value has been checked against `ty`.
    set_checked: fn(&mut EntityDesc, &Value),
}

/// Every setting of an entity.
pub const ENTITY_PARAMS: &[EntityParam] = &[
    EntityParam {
        name: "position",
        ty: POINT,
        doc: "Translation of a mesh, centre of a sphere, in scene units.",
        applies: |_| true,
        set_checked: |e, v| e.transform.translate = vector(v),
    },
    EntityParam {
        name: "rotation_deg",
        ty: Ty::Nums { len: 3, min: -1e6, max: 1e6 },
        doc: "Rotation of a mesh about x, y and z in degrees, z first.",
        applies: |s| matches!(s, ShapeDesc::Mesh(_)),
        set_checked: |e, v| {
            e.transform.rotate_rad = Vec3::from_array([0, 1, 2].map(|i| item(v, i).to_radians() as f32));
        },
    },
    EntityParam {
        name: "scale",
        ty: Ty::Nums { len: 3, min: -1e6, max: 1e6 },
        doc: "Scale of a mesh along x, y and z, after its rotation.",
        applies: |s| matches!(s, ShapeDesc::Mesh(_)),
        set_checked: |e, v| e.transform.scale = vector(v),
    },
    EntityParam {
        name: "radius",
        ty: Ty::Num { min: 1e-9, max: 1e9 },
        doc: "Radius of a sphere in scene units.",
        applies: |s| matches!(s, ShapeDesc::Sphere { .. }),
        set_checked: |e, v| e.shape = ShapeDesc::Sphere { radius: scalar(v) },
    },
    EntityParam {
        name: "material",
        ty: Ty::Str,
        doc: "Name of the material of the whole entity.",
        applies: |_| true,
        set_checked: |e, v| e.material = v.as_str().map(str::to_owned),
    },
    EntityParam {
        name: "anisotropic_direction",
        ty: Ty::Nums { len: 3, min: -1e6, max: 1e6 },
        doc: "Replaces the material's direction of anisotropy on this entity; world space.",
        applies: |_| true,
        set_checked: |e, v| e.anisotropic_direction = Some(vector(v)),
    },
];

fn item(v: &Value, i: usize) -> f64 {
    v.as_list().and_then(|l| l.get(i)).and_then(Value::as_f64).unwrap_or_default()
}

fn scalar(v: &Value) -> f32 {
    v.as_f64().unwrap_or_default() as f32
}

fn vector(v: &Value) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| item(v, i) as f32))
}

/// Sets one value by its path: one of [`SCENE_PARAMS`], `materials.NAME.PARAM`, `materials.*.PARAM` (every material
/// that emits nothing), `entities.NAME.PARAM`, `lights.NAME.PARAM`, `environment.PARAM`, or `camera` to the name of a view. `PARAM` of a material is also
/// a texture slot, whose value is a file relative to the current folder.
///
/// # Errors
/// A path that names nothing in the scene, with the nearest name; a value of the wrong kind or out of range; a texture
/// that cannot be read.
pub fn set(desc: &mut SceneDesc, path: &str, value: &Value) -> Result<(), SchemaError> {
    if let Some(row) = SCENE_PARAMS.iter().find(|row| row.path == path) {
        let key = path.rsplit('.').next().unwrap_or(path);
        row.ty.check(path, key, value)?;
        if path == "resolution" && value.as_list().is_some_and(|l| l.iter().any(|n| n.as_i64().is_none())) {
            return Err(problem(path, key, format!("expected whole numbers of pixels, found {value}")));
        }
        (row.set_checked)(desc, value);
        return Ok(());
    }
    let (head, rest) = path.split_once('.').unwrap_or((path, ""));
    match head {
        "materials" => set_material(desc, path, rest, value),
        "entities" => set_entity(desc, path, rest, value),
        "lights" => lights::set_light(desc, path, rest, value),
        "environment" => lights::set_environment(desc, path, rest, value),
        "camera" if rest.is_empty() => set_view(desc, path, value),
        "camera" => {
            let known = SCENE_PARAMS.iter().filter_map(|row| row.path.strip_prefix("camera."));
            Err(unknown_key(path, rest, known))
        }
        _ => Err(unknown_name(path, head, "setting", heads())),
    }
}

/// Puts a named view in the place of the camera.
fn set_view(desc: &mut SceneDesc, path: &str, value: &Value) -> Result<(), SchemaError> {
    Ty::Str.check(path, path, value)?;
    let name = value.as_str().unwrap_or_default();
    match desc.views.iter().find(|(known, _)| known == name) {
        Some((_, camera)) => {
            desc.camera = camera.clone();
            Ok(())
        }
        None if desc.views.is_empty() => {
            Err(problem(path, name, format!("the scene has no views, and so no `{name}`")))
        }
        None => Err(unknown_name(path, name, "view", desc.views.iter().map(|(known, _)| known.as_str()))),
    }
}

/// Makes all changes of a sweep, in the order of their paths, and looks whether the camera that they make contradicts
/// itself.
///
/// # Errors
/// Those of [`set`]; an aperture and an f-number in the same changes; a field of view where sensor and focal length decide
/// it; an f-number without a focal length.
pub fn apply(desc: &mut SceneDesc, changes: &BTreeMap<String, Value>) -> Result<(), SchemaError> {
    changes.iter().try_for_each(|(path, value)| set(desc, path, value))?;
    let optics = desc.camera.optics;
    let said = |key: &str| changes.contains_key(&format!("camera.{key}"));
    let fail = |key: &str, text: &str, help: &str| {
        let mut e = problem(&format!("camera.{key}"), key, text.to_owned());
        e.help = Some(help.to_owned());
        Err(e)
    };
    if said("aperture") && said("f_number") {
        return fail("f_number", "there is an `aperture` as well", "the lens has either a diameter or an f-number");
    }
    if said("fov") && optics.focal_length.is_some() && optics.sensor_height.is_some() {
        return fail("fov", "`sensor_height` and `focal_length` decide it", "change one of them instead");
    }
    if said("f_number") && desc.camera.lacks_focal_length() {
        return fail(
            "f_number",
            "it says nothing without a `focal_length`",
            "or a `sensor_height`, from which it follows",
        );
    }
    Ok(())
}

/// The first parts of all paths, each once.
fn heads() -> Vec<&'static str> {
    let mut heads: Vec<&str> = SCENE_PARAMS.iter().map(|row| row.path.split('.').next().unwrap_or(row.path)).collect();
    heads.dedup();
    heads.extend(["materials", "entities", "lights", "environment"]);
    heads
}

fn problem(path: &str, key: &str, problem: String) -> SchemaError {
    SchemaError { path: path.to_owned(), problem, help: None, key: key.to_owned() }
}

/// `NAME.PARAM`, split at the last dot.
fn name_and_param<'a>(path: &str, rest: &'a str, what: &str) -> Result<(&'a str, &'a str), SchemaError> {
    rest.rsplit_once('.').ok_or_else(|| {
        let key = path.rsplit('.').next().unwrap_or(path);
        problem(path, key, format!("expected `{what}.NAME.PARAMETER`"))
    })
}

/// The names of everything that a material has.
fn material_params() -> impl Iterator<Item = &'static str> + Clone {
    MATERIAL_PARAMS.iter().map(|row| row.name).chain(TextureSlot::ALL.into_iter().map(TextureSlot::name))
}

fn set_material(desc: &mut SceneDesc, path: &str, rest: &str, value: &Value) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "materials")?;
    let change = match (MATERIAL_PARAMS.iter().find(|row| row.name == param), TextureSlot::from_name(param)) {
        (Some(row), _) => {
            row.ty.check(path, param, value)?;
            Change::Param(row)
        }
        (None, Some(slot)) => {
            Ty::Str.check(path, param, value)?;
            Change::Texture(slot)
        }
        (None, None) => return Err(unknown_name(path, param, "material parameter", material_params())),
    };
    let rows: Vec<usize> = if name == ALL_MATERIALS {
        (0..desc.materials.len()).filter(|i| desc.materials[*i].emission == Vec3::ZERO).collect()
    } else {
        let unknown = || unknown_name(path, name, "material", desc.materials.iter().map(|m| m.name.as_str()));
        vec![desc.material_row(name).ok_or_else(unknown)?]
    };
    match change {
        Change::Param(row) => rows.into_iter().try_for_each(|i| row.set(&mut desc.materials[i], path, value)),
        Change::Texture(slot) => {
            let file = value.as_str().unwrap_or_default();
            let texture = if file.is_empty() {
                None
            } else {
                // What a texture's file could not have said exactly is noted where a scene names it, not here.
                let read = load::texture(Path::new(file), &mut Vec::new());
                Some(Arc::new(read.map_err(|e| problem(path, param, e.to_string()))?))
            };
            rows.into_iter().for_each(|i| desc.materials[i].set_texture(slot, texture.clone()));
            Ok(())
        }
    }
}

/// What an edit of a material changes.
enum Change {
    Param(&'static MaterialParam),
    Texture(TextureSlot),
}

fn set_entity(desc: &mut SceneDesc, path: &str, rest: &str, value: &Value) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "entities")?;
    let Some(i) = desc.entities.iter().position(|e| e.name == name) else {
        return Err(unknown_name(path, name, "entity", desc.entities.iter().map(|e| e.name.as_str())));
    };
    let shape = &desc.entities[i].shape;
    let known = || ENTITY_PARAMS.iter().filter(|row| (row.applies)(shape)).map(|row| row.name);
    let Some(row) = ENTITY_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_name(path, param, "entity parameter", known()));
    };
    if !(row.applies)(shape) {
        let what = if matches!(shape, ShapeDesc::Mesh(_)) { "a mesh" } else { "a sphere" };
        let mut e = problem(path, param, format!("`{name}` is {what}, which has no `{param}`"));
        e.help = Some(format!("known: {}", known().collect::<Vec<_>>().join(", ")));
        return Err(e);
    }
    row.ty.check(path, param, value)?;
    if row.name == "material"
        && let Some(material) = value.as_str()
        && desc.material_row(material).is_none()
    {
        return Err(unknown_name(path, material, "material", desc.materials.iter().map(|m| m.name.as_str())));
    }
    (row.set_checked)(&mut desc.entities[i], value);
    Ok(())
}

/// Every path that [`set`] takes for this scene.
pub fn paths(desc: &SceneDesc) -> Vec<String> {
    let mut paths: Vec<String> = SCENE_PARAMS.iter().map(|row| row.path.to_owned()).collect();
    let materials = std::iter::once(ALL_MATERIALS).chain(desc.materials.iter().map(|m| m.name.as_str()));
    paths.extend(materials.flat_map(|m| material_params().map(move |name| format!("materials.{m}.{name}"))));
    for e in &desc.entities {
        let rows = ENTITY_PARAMS.iter().filter(|row| (row.applies)(&e.shape));
        paths.extend(rows.map(|row| format!("entities.{}.{}", e.name, row.name)));
    }
    paths.extend(lights::paths(desc));
    paths
}
