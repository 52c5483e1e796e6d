//! Edits of a scene by path, such as `set = { ["materials.egg.roughness"] = v }`: the only way in
//! which sweeps change a scene.
//!
//! Tables list every setting: [`SCENE_PARAMS`], [`ENTITY_PARAMS`], [`LIGHT_PARAMS`],
//! [`ENVIRONMENT_PARAMS`] and the material parameters ([`MATERIAL_PARAMS`]). Names of materials,
//! entities and lights may contain dots: the last component of a path is the parameter. A texture
//! is set by its slot ([`TextureSlot::name`]) to a file, or to an empty string to remove it.

mod lights;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use glam::{DVec3, Vec3};

pub use lights::{ENVIRONMENT_PARAMS, LIGHT_PARAMS};

use crate::load;
use lumbre_light::scene::desc::material::MaterialParam;
use lumbre_light::scene::desc::{
    CAMERA_KIND_NAMES, CameraKind, EntityDesc, MATERIAL_PARAMS, MAX_COORDINATE, MAX_EDGES,
    MAX_SIDE, MAX_WINDOW_EDGE, SceneDesc, ShapeDesc, TextureSlot, VIEW_HEIGHT_RANGE, ViewWindow,
};
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty, unknown_key, unknown_name};

/// Name that selects every material without emission.
pub const ALL_MATERIALS: &str = "*";

const COORDINATE: f64 = MAX_COORDINATE as f64;

/// Type of the edges of a camera's window.
pub const WINDOW: Ty = Ty::Nums {
    len: 4,
    min: -MAX_WINDOW_EDGE,
    max: MAX_WINDOW_EDGE,
};
const POINT: Ty = Ty::Nums {
    len: 3,
    min: -COORDINATE,
    max: COORDINATE,
};

/// A setting of a scene, an entity, a light or the environment.
#[derive(Debug)]
pub struct Param<T: 'static> {
    /// Path of a setting of the scene, last component of the path of any other.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit, in a sentence.
    pub doc: &'static str,
    /// Stores a value that has been checked against `ty`, if the object has the setting.
    set_checked: fn(&mut T, &Value),
}

/// Declares settings by one row each: `"NAME": TYPE, "DOC", SETTER;`.
macro_rules! params {
    ($(#[$meta:meta])* pub const $ROWS:ident: $T:ty;
     $($name:literal: $ty:expr, $doc:literal, $set:expr;)*) => {
        $(#[$meta])*
        pub const $ROWS: &[Param<$T>] = &[$(Param {
            name: $name,
            ty: $ty,
            doc: $doc,
            set_checked: $set,
        }),*];
    };
}
use params;

params! {
    /// Settings of the scene itself: camera, resolution and path length.
    pub const SCENE_PARAMS: SceneDesc;
    "camera.kind": Ty::Word(&CAMERA_KIND_NAMES),
        "How the camera maps the scene to its picture: perspective, orthographic (parallel rays), \
         or spherical (all directions, longitude over latitude).",
        |s, v| s.camera.kind = v.as_str().and_then(CameraKind::from_name).unwrap_or_default();
    "camera.view_height": Ty::num(VIEW_HEIGHT_RANGE[0], VIEW_HEIGHT_RANGE[1]),
        "Height of the picture of an orthographic camera in scene units; has no effect on other \
         kinds.",
        |s, v| s.camera.view_height = scalar(v);
    "camera.window": WINDOW,
        "Part of the view that the picture shows: left, right, upper and lower edge, in fractions \
         of the whole from its upper left corner. A left edge beyond the right one mirrors the \
         picture.",
        |s, v| s.camera.window = ViewWindow::from_array(numbers(v));
    "camera.fov": Ty::num(0.01, 179.0),
        "Vertical field of view of a perspective camera in degrees; has no effect if both \
         sensor_height and focal_length are set.",
        |s, v| s.camera.optics = s.camera.optics.with_fov_deg(scalar(v));
    "camera.aperture": Ty::num(0.0, 1e6),
        "Diameter of the lens in scene units; 0 is a pinhole. Replaces the scene's f_number.",
        |s, v| s.camera.optics = s.camera.optics.with_aperture(scalar(v));
    "camera.f_number": Ty::num(1e-3, 1e6),
        "Focal length divided by lens diameter. Replaces the scene's aperture.",
        |s, v| s.camera.optics = s.camera.optics.with_f_number(Some(scalar(v)));
    "camera.focal_length": Ty::num(1e-9, 1e6),
        "Focal length in scene units: the distance between lens and sensor.",
        |s, v| s.camera.optics = s.camera.optics.with_focal_length(Some(scalar(v)));
    "camera.sensor_height": Ty::num(1e-9, 1e6), "Height of the sensor in scene units.",
        |s, v| s.camera.optics = s.camera.optics.with_sensor_height(Some(scalar(v)));
    "camera.focus_distance": Ty::num(1e-6, COORDINATE),
        "Distance from the lens to the focal plane along the axis, in scene units.",
        |s, v| s.camera.focus_distance = Some(scalar(v));
    "camera.position": POINT, "Centre of projection, or of the lens.",
        |s, v| {
            let [_, target] = s.camera.places();
            s.camera = s.camera.clone().placed(point(v), target);
        };
    "camera.target": POINT, "A point on the optical axis.",
        |s, v| {
            let [position, _] = s.camera.places();
            s.camera = s.camera.clone().placed(position, point(v));
        };
    "camera.up": POINT, "Direction that points up in the image.", |s, v| s.camera.up = vector(v);
    "resolution": Ty::nums(2, 1.0, MAX_SIDE as f64),
        "Width and height in pixels, whole numbers.",
        |s, v| s.resolution = numbers(v).map(|n| n as u32);
    "max_depth": Ty::int(1, MAX_EDGES as i64),
        "Greatest number of path edges; 1 is emission only, 2 direct light.",
        |s, v| s.max_depth = v.as_i64().unwrap_or(1) as u32;
}

params! {
    /// Settings of an entity.
    pub const ENTITY_PARAMS: EntityDesc;
    "position": POINT, "Translation of a mesh, centre of a sphere, in scene units.",
        |e, v| e.transform.translate = point(v);
    "rotation_deg": Ty::nums(3, -1e6, 1e6),
        "Rotation of a mesh about x, y and z in degrees, z first.",
        |e, v| {
            let radians = [0, 1, 2].map(|i| item(v, i).to_radians() as f32);
            e.transform.rotate_rad = Vec3::from_array(radians);
        };
    "scale": Ty::nums(3, -1e6, 1e6),
        "Scale of a mesh along x, y and z, applied after its rotation.",
        |e, v| e.transform.scale = vector(v);
    "radius": Ty::num(1e-9, 1e9), "Radius of a sphere in scene units.",
        |e, v| e.shape = ShapeDesc::Sphere { radius: scalar(v) };
    "material": Ty::Str, "Name of the material of the whole entity.",
        |e, v| e.material = v.as_str().map(str::to_owned);
    "anisotropic_direction": Ty::nums(3, -1e6, 1e6),
        "Direction of anisotropy in world space; replaces the material's on this entity.",
        |e, v| e.anisotropic_direction = Some(vector(v));
}

/// Returns the names of the settings that an entity of this shape has.
fn entity_settings(shape: &ShapeDesc) -> impl Iterator<Item = &'static str> {
    let others: &[&str] = match shape {
        ShapeDesc::Mesh(_) => &["radius"],
        ShapeDesc::Sphere { .. } => &["rotation_deg", "scale"],
    };
    let names = ENTITY_PARAMS.iter().map(|row| row.name);
    names.filter(|name| !others.contains(name))
}

fn item(v: &Value, i: usize) -> f64 {
    v.as_list()
        .and_then(|l| l.get(i))
        .and_then(Value::as_f64)
        .unwrap_or_default()
}

fn scalar(v: &Value) -> f32 {
    v.as_f64().unwrap_or_default() as f32
}

fn numbers<const N: usize>(v: &Value) -> [f32; N] {
    std::array::from_fn(|i| item(v, i) as f32)
}

fn point(v: &Value) -> DVec3 {
    DVec3::new(item(v, 0), item(v, 1), item(v, 2))
}

fn vector(v: &Value) -> Vec3 {
    Vec3::from_array(numbers(v))
}

/// Sets one value by its path: one of [`SCENE_PARAMS`], `materials.NAME.PARAM`, `materials.*.PARAM`
/// (every material without emission), `entities.NAME.PARAM`, `lights.NAME.PARAM`,
/// `environment.PARAM`, or `camera` with the name of a view as value. `PARAM` of a material may
/// also be a texture slot, whose value is a file relative to the current folder.
///
/// # Errors
/// Fails if the path names nothing in the scene (the error suggests the nearest name), if the value
/// has the wrong type or is out of range, or if a texture cannot be read.
pub fn set(desc: &mut SceneDesc, path: &str, value: &Value) -> Result<(), SchemaError> {
    if let Some(row) = SCENE_PARAMS.iter().find(|row| row.name == path) {
        let key = path.rsplit('.').next().unwrap_or(path);
        row.ty.check(path, key, value)?;
        if path == "resolution"
            && value
                .as_list()
                .is_some_and(|l| l.iter().any(|n| n.as_i64().is_none()))
        {
            return Err(SchemaError::new(
                path,
                key,
                format!("expected whole numbers of pixels, found {value}"),
            ));
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
            let known = SCENE_PARAMS
                .iter()
                .filter_map(|row| row.name.strip_prefix("camera."));
            Err(unknown_key(path, rest, known))
        }
        _ => Err(unknown_name(path, head, "setting", heads())),
    }
}

/// Replaces the camera by a named view.
fn set_view(desc: &mut SceneDesc, path: &str, value: &Value) -> Result<(), SchemaError> {
    Ty::Str.check(path, path, value)?;
    let name = value.as_str().unwrap_or_default();
    match desc.views.iter().find(|(known, _)| known == name) {
        Some((_, camera)) => {
            desc.camera = camera.clone();
            Ok(())
        }
        None if desc.views.is_empty() => Err(SchemaError::new(
            path,
            name,
            format!("the scene has no views, so there is no view `{name}`"),
        )),
        None => Err(unknown_name(
            path,
            name,
            "view",
            desc.views.iter().map(|(known, _)| known.as_str()),
        )),
    }
}

/// Applies all changes of a sweep in the order of their paths, then checks that the resulting
/// camera is consistent.
///
/// # Errors
/// Fails like [`set`], and if the changes set both an aperture and an f-number, a field of view
/// although sensor height and focal length determine it, an f-number without a focal length, or a
/// lens on a camera without one.
pub fn apply(desc: &mut SceneDesc, changes: &BTreeMap<String, Value>) -> Result<(), SchemaError> {
    changes
        .iter()
        .try_for_each(|(path, value)| set(desc, path, value))?;
    let optics = desc.camera.optics;
    let changed = |key: &str| changes.contains_key(&format!("camera.{key}"));
    let fail = |key: &str, text: &str, help: &str| {
        Err(SchemaError::new(format!("camera.{key}"), key, text).with_help(help))
    };
    if changed("aperture") && changed("f_number") {
        return fail(
            "f_number",
            "`aperture` is set as well",
            "set either the lens diameter (`aperture`) or the f-number",
        );
    }
    if changed("fov") && optics.determine_view() {
        return fail(
            "fov",
            "the field of view is already determined by `sensor_height` and `focal_length`",
            "change one of these instead",
        );
    }
    if let Some([problem, help]) = desc.camera.lens_problem() {
        return fail("kind", &problem, &help);
    }
    if let Some(problem) = desc.camera.window_problem() {
        return fail("window", &problem, "the whole view is `{ 0, 1, 0, 1 }`");
    }
    if changed("f_number") && desc.camera.lacks_focal_length() {
        return fail(
            "f_number",
            "an f-number has no effect without a `focal_length`",
            "set `focal_length` or `sensor_height`, or give the lens diameter as `aperture`",
        );
    }
    Ok(())
}

/// Returns the first components of all paths, each once.
fn heads() -> Vec<&'static str> {
    let mut heads: Vec<&str> = SCENE_PARAMS
        .iter()
        .map(|row| row.name.split('.').next().unwrap_or(row.name))
        .collect();
    heads.dedup();
    heads.extend(["materials", "entities", "lights", "environment"]);
    heads
}

/// Splits `NAME.PARAM` at the last dot.
fn name_and_param<'a>(
    path: &str,
    rest: &'a str,
    what: &str,
) -> Result<(&'a str, &'a str), SchemaError> {
    rest.rsplit_once('.').ok_or_else(|| {
        let key = path.rsplit('.').next().unwrap_or(path);
        SchemaError::new(path, key, format!("expected `{what}.NAME.PARAMETER`"))
    })
}

/// Creates the error for a parameter that other objects of the same kind have.
fn has_no(
    path: &str,
    name: &str,
    what: &str,
    param: &str,
    known: impl Iterator<Item = &'static str>,
) -> SchemaError {
    let known = known.collect::<Vec<_>>().join(", ");
    SchemaError::new(
        path,
        param,
        format!("`{name}` is {what}, which has no `{param}`"),
    )
    .with_help(format!("known: {known}"))
}

/// Returns the names of all parameters and texture slots of a material.
fn material_params() -> impl Iterator<Item = &'static str> + Clone {
    MATERIAL_PARAMS
        .iter()
        .map(|row| row.name)
        .chain(TextureSlot::ALL.into_iter().map(TextureSlot::name))
}

fn set_material(
    desc: &mut SceneDesc,
    path: &str,
    rest: &str,
    value: &Value,
) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "materials")?;
    let change = material_change(path, param, value)?;
    let indices = material_indices(desc, path, name)?;
    match change {
        Change::Param(row) => indices
            .into_iter()
            .try_for_each(|i| row.set(&mut desc.materials[i], path, value)),
        Change::Texture(slot) => {
            let file = value.as_str().unwrap_or_default();
            let texture = if file.is_empty() {
                None
            } else {
                // Notes about a texture's file are reported where a scene names it, not here.
                let read = load::texture(Path::new(file), &mut Vec::new());
                Some(Arc::new(
                    read.map_err(|e| SchemaError::new(path, param, e.to_string()))?,
                ))
            };
            indices
                .into_iter()
                .for_each(|i| desc.materials[i].set_texture(slot, texture.clone()));
            Ok(())
        }
    }
}

/// Returns the setting that `materials.NAME.<param>` refers to, after checking the type of its
/// value.
fn material_change(path: &str, param: &str, value: &Value) -> Result<Change, SchemaError> {
    if let Some(row) = MATERIAL_PARAMS.iter().find(|row| row.name == param) {
        row.ty.check(path, param, value)?;
        Ok(Change::Param(row))
    } else if let Some(slot) = TextureSlot::from_name(param) {
        Ty::Str.check(path, param, value)?;
        Ok(Change::Texture(slot))
    } else {
        Err(unknown_name(
            path,
            param,
            "material parameter",
            material_params(),
        ))
    }
}

/// Returns the indices of the materials that `name` selects.
fn material_indices(desc: &SceneDesc, path: &str, name: &str) -> Result<Vec<usize>, SchemaError> {
    if name == ALL_MATERIALS {
        return Ok((0..desc.materials.len())
            .filter(|i| desc.materials[*i].emission == Vec3::ZERO)
            .collect());
    }
    let unknown = || {
        unknown_name(
            path,
            name,
            "material",
            desc.materials.iter().map(|m| m.name.as_str()),
        )
    };
    Ok(vec![desc.material_index(name).ok_or_else(unknown)?])
}

/// The setting of a material that an edit changes.
enum Change {
    Param(&'static MaterialParam),
    Texture(TextureSlot),
}

fn set_entity(
    desc: &mut SceneDesc,
    path: &str,
    rest: &str,
    value: &Value,
) -> Result<(), SchemaError> {
    let (name, param) = name_and_param(path, rest, "entities")?;
    let Some(i) = desc.entities.iter().position(|e| e.name == name) else {
        return Err(unknown_name(
            path,
            name,
            "entity",
            desc.entities.iter().map(|e| e.name.as_str()),
        ));
    };
    let shape = &desc.entities[i].shape;
    let known = || entity_settings(shape);
    let Some(row) = ENTITY_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_name(path, param, "entity parameter", known()));
    };
    if !known().any(|name| name == param) {
        let what = match shape {
            ShapeDesc::Mesh(_) => "a mesh",
            ShapeDesc::Sphere { .. } => "a sphere",
        };
        return Err(has_no(path, name, what, param, known()));
    }
    row.ty.check(path, param, value)?;
    if row.name == "material"
        && let Some(material) = value.as_str()
        && desc.material_index(material).is_none()
    {
        return Err(unknown_name(
            path,
            material,
            "material",
            desc.materials.iter().map(|m| m.name.as_str()),
        ));
    }
    (row.set_checked)(&mut desc.entities[i], value);
    Ok(())
}

/// Returns every path that [`set`] accepts for this scene.
pub fn paths(desc: &SceneDesc) -> Vec<String> {
    let mut paths: Vec<String> = SCENE_PARAMS.iter().map(|row| row.name.to_owned()).collect();
    let materials =
        std::iter::once(ALL_MATERIALS).chain(desc.materials.iter().map(|m| m.name.as_str()));
    paths.extend(
        materials.flat_map(|m| material_params().map(move |name| format!("materials.{m}.{name}"))),
    );
    for e in &desc.entities {
        let names = entity_settings(&e.shape);
        paths.extend(names.map(|param| format!("entities.{}.{param}", e.name)));
    }
    paths.extend(lights::paths(desc));
    paths
}
