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

use glam::Vec3;

pub use lights::{ENVIRONMENT_PARAMS, EnvironmentParam, LIGHT_PARAMS, LightParam};

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

/// A setting of the scene as a whole.
#[derive(Debug)]
pub struct SceneParam {
    /// Complete path of the setting.
    pub path: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit, in a sentence.
    pub doc: &'static str,
    /// Stores a value that has been checked against `ty`.
    set_checked: fn(&mut SceneDesc, &Value),
}

/// Settings of the scene itself: camera, resolution and path length.
pub const SCENE_PARAMS: &[SceneParam] = &[
    SceneParam {
        path: "camera.kind",
        ty: Ty::Word(&CAMERA_KIND_NAMES),
        doc: "How the camera maps the scene to its picture: perspective, orthographic (parallel \
              rays), or spherical (all directions, longitude over latitude).",
        set_checked: |s, v| {
            s.camera.kind = v
                .as_str()
                .and_then(CameraKind::from_name)
                .unwrap_or_default();
        },
    },
    SceneParam {
        path: "camera.view_height",
        ty: Ty::Num {
            min: VIEW_HEIGHT_RANGE[0],
            max: VIEW_HEIGHT_RANGE[1],
        },
        doc: "Height of the picture of an orthographic camera in scene units; has no effect on \
              other kinds.",
        set_checked: |s, v| s.camera.view_height = scalar(v),
    },
    SceneParam {
        path: "camera.window",
        ty: WINDOW,
        doc: "Part of the view that the picture shows: left, right, upper and lower edge, in \
              fractions of the whole from its upper left corner. A left edge beyond the right one \
              mirrors the picture.",
        set_checked: |s, v| {
            s.camera.window = ViewWindow::from_array(std::array::from_fn(|i| item(v, i) as f32));
        },
    },
    SceneParam {
        path: "camera.fov",
        ty: Ty::Num {
            min: 0.01,
            max: 179.0,
        },
        doc: "Vertical field of view of a perspective camera in degrees; has no effect if both \
              sensor_height and focal_length are set.",
        set_checked: |s, v| s.camera.optics = s.camera.optics.with_fov_deg(scalar(v)),
    },
    SceneParam {
        path: "camera.aperture",
        ty: Ty::Num { min: 0.0, max: 1e6 },
        doc: "Diameter of the lens in scene units; 0 is a pinhole. Replaces the scene's f_number.",
        set_checked: |s, v| s.camera.optics = s.camera.optics.with_aperture(scalar(v)),
    },
    SceneParam {
        path: "camera.f_number",
        ty: Ty::Num {
            min: 1e-3,
            max: 1e6,
        },
        doc: "Focal length divided by lens diameter. Replaces the scene's aperture.",
        set_checked: |s, v| s.camera.optics = s.camera.optics.with_f_number(Some(scalar(v))),
    },
    SceneParam {
        path: "camera.focal_length",
        ty: Ty::Num {
            min: 1e-9,
            max: 1e6,
        },
        doc: "Focal length in scene units: the distance between lens and sensor.",
        set_checked: |s, v| s.camera.optics = s.camera.optics.with_focal_length(Some(scalar(v))),
    },
    SceneParam {
        path: "camera.sensor_height",
        ty: Ty::Num {
            min: 1e-9,
            max: 1e6,
        },
        doc: "Height of the sensor in scene units.",
        set_checked: |s, v| s.camera.optics = s.camera.optics.with_sensor_height(Some(scalar(v))),
    },
    SceneParam {
        path: "camera.focus_distance",
        ty: Ty::Num {
            min: 1e-6,
            max: COORDINATE,
        },
        doc: "Distance from the lens to the focal plane along the axis, in scene units.",
        set_checked: |s, v| s.camera.focus_distance = Some(scalar(v)),
    },
    SceneParam {
        path: "camera.position",
        ty: POINT,
        doc: "Centre of projection, or of the lens.",
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
        doc: "Direction that points up in the image.",
        set_checked: |s, v| s.camera.up = vector(v),
    },
    SceneParam {
        path: "resolution",
        ty: Ty::Nums {
            len: 2,
            min: 1.0,
            max: MAX_SIDE as f64,
        },
        doc: "Width and height in pixels, whole numbers.",
        set_checked: |s, v| s.resolution = [item(v, 0) as u32, item(v, 1) as u32],
    },
    SceneParam {
        path: "max_depth",
        ty: Ty::Int {
            min: 1,
            max: MAX_EDGES as i64,
        },
        doc: "Greatest number of path edges; 1 is emission only, 2 direct light.",
        set_checked: |s, v| s.max_depth = v.as_i64().unwrap_or(1) as u32,
    },
];

/// A setting of one entity.
#[derive(Debug)]
pub struct EntityParam {
    /// Last component of the path: `entities.NAME.<name>`.
    pub name: &'static str,
    /// Type and range.
    pub ty: Ty,
    /// Meaning and unit, in a sentence.
    pub doc: &'static str,
    /// Returns whether the setting applies to a shape.
    applies: fn(&ShapeDesc) -> bool,
    /// Stores a value that has been checked against `ty`.
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
        ty: Ty::Nums {
            len: 3,
            min: -1e6,
            max: 1e6,
        },
        doc: "Rotation of a mesh about x, y and z in degrees, z first.",
        applies: |s| matches!(s, ShapeDesc::Mesh(_)),
        set_checked: |e, v| {
            e.transform.rotate_rad =
                Vec3::from_array([0, 1, 2].map(|i| item(v, i).to_radians() as f32));
        },
    },
    EntityParam {
        name: "scale",
        ty: Ty::Nums {
            len: 3,
            min: -1e6,
            max: 1e6,
        },
        doc: "Scale of a mesh along x, y and z, applied after its rotation.",
        applies: |s| matches!(s, ShapeDesc::Mesh(_)),
        set_checked: |e, v| e.transform.scale = vector(v),
    },
    EntityParam {
        name: "radius",
        ty: Ty::Num {
            min: 1e-9,
            max: 1e9,
        },
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
        ty: Ty::Nums {
            len: 3,
            min: -1e6,
            max: 1e6,
        },
        doc: "Direction of anisotropy in world space; replaces the material's on this entity.",
        applies: |_| true,
        set_checked: |e, v| e.anisotropic_direction = Some(vector(v)),
    },
];

fn item(v: &Value, i: usize) -> f64 {
    v.as_list()
        .and_then(|l| l.get(i))
        .and_then(Value::as_f64)
        .unwrap_or_default()
}

fn scalar(v: &Value) -> f32 {
    v.as_f64().unwrap_or_default() as f32
}

fn vector(v: &Value) -> Vec3 {
    Vec3::from_array([0, 1, 2].map(|i| item(v, i) as f32))
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
    if let Some(row) = SCENE_PARAMS.iter().find(|row| row.path == path) {
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
                .filter_map(|row| row.path.strip_prefix("camera."));
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
        let mut e = SchemaError::new(format!("camera.{key}"), key, text.to_owned());
        e.help = Some(help.to_owned());
        Err(e)
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
        .map(|row| row.path.split('.').next().unwrap_or(row.path))
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
    let known = || {
        ENTITY_PARAMS
            .iter()
            .filter(|row| (row.applies)(shape))
            .map(|row| row.name)
    };
    let Some(row) = ENTITY_PARAMS.iter().find(|row| row.name == param) else {
        return Err(unknown_name(path, param, "entity parameter", known()));
    };
    if !(row.applies)(shape) {
        let what = if matches!(shape, ShapeDesc::Mesh(_)) {
            "a mesh"
        } else {
            "a sphere"
        };
        let mut e = SchemaError::new(
            path,
            param,
            format!("`{name}` is {what}, which has no `{param}`"),
        );
        e.help = Some(format!("known: {}", known().collect::<Vec<_>>().join(", ")));
        return Err(e);
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
    let mut paths: Vec<String> = SCENE_PARAMS.iter().map(|row| row.path.to_owned()).collect();
    let materials =
        std::iter::once(ALL_MATERIALS).chain(desc.materials.iter().map(|m| m.name.as_str()));
    paths.extend(
        materials.flat_map(|m| material_params().map(move |name| format!("materials.{m}.{name}"))),
    );
    for e in &desc.entities {
        let rows = ENTITY_PARAMS.iter().filter(|row| (row.applies)(&e.shape));
        paths.extend(rows.map(|row| format!("entities.{}.{}", e.name, row.name)));
    }
    paths.extend(lights::paths(desc));
    paths
}
