//! `scene {..}` and the methods of what it returns.

use std::collections::BTreeMap;
use std::rc::Rc;
use std::sync::Arc;

use glam::{Affine3A, Vec3};
use mlua::{Lua, Value as LuaValue};

use super::shapes::ShapeObject;
use super::{SceneBuilder, material, numbers, part, scene_error, texture};
use crate::scene::desc::light::CUTOFF_RANGE;
use crate::scene::desc::{
    CameraDesc, ConeDesc, ConeEdge, EntityDesc, EnvironmentDesc, EnvironmentSource, LightDesc, LightKind, MaterialDesc,
    MeshDesc, Optics, ShapeDesc, mesh_hash,
};
use crate::scene::{load, shape};
use crate::script::api::{self, ApiFn, Args, Param, kind};
use crate::script::error::{Problem, ScriptError};
use crate::script::state::{Purpose, Shared};
use crate::script::strict::{self, Fields};
use crate::value::Value;
use crate::value::schema::{Field, SchemaError, Table, Ty};

const POINT: Ty = Ty::Nums { len: 3, min: -1e9, max: 1e9 };
const LIGHT: Ty = Ty::Nums { len: 3, min: 0.0, max: 1e12 };

const SCENE: Table = Table {
    name: "SceneOptions",
    doc: "What a scene says of itself; experiments may change both.",
    fields: &[
        Field::optional(
            "resolution",
            Ty::Nums { len: 2, min: 1.0, max: 16_384.0 },
            "{ 1280, 720 }",
            "width and height in pixels",
        ),
        Field::optional(
            "max_depth",
            Ty::Int { min: 1, max: 10_000 },
            "8",
            "greatest number of path edges: 2 = direct light",
        ),
    ],
};

const CAMERA: Table = Table {
    name: "SceneCamera",
    doc: "A camera. Lens and sensor may be said as photographers do, in scene units.",
    fields: &[
        Field::required("position", POINT, "centre of the lens"),
        Field::required("target", POINT, "a point on the optical axis"),
        Field::optional("up", POINT, "{ 0, 1, 0 }", "the direction that is up in the picture"),
        Field::optional("fov", Ty::Num { min: 0.01, max: 179.0 }, "45", "vertical field of view in degrees"),
        Field::optional("aperture", Ty::Num { min: 0.0, max: 1e9 }, "0", "diameter of the lens; 0 is a pinhole"),
        Field::optional(
            "focus_distance",
            Ty::Num { min: 1e-9, max: 1e9 },
            "that of target",
            "distance to the plane in focus",
        ),
        Field::optional(
            "f_number",
            Ty::Num { min: 1e-3, max: 1e6 },
            "none",
            "focal length over the diameter of the lens",
        ),
        Field::optional("focal_length", Ty::Num { min: 1e-9, max: 1e6 }, "none", "focal length"),
        Field::optional("sensor_height", Ty::Num { min: 1e-9, max: 1e6 }, "none", "height of the sensor"),
    ],
};

const POINT_LIGHT: Table = Table {
    name: "SceneLight",
    doc: "A light without a surface: a point with an intensity, a direction with an irradiance, or a spot, which is a point with a direction.",
    fields: &[
        Field::optional("name", Ty::Str, "light_1, ..", "the name by which sweeps reach it: lights.NAME.intensity"),
        Field::optional("position", POINT, "", "place of a point light or spot"),
        Field::optional("intensity", LIGHT, "", "radiant intensity of a point light, or of a spot along its axis"),
        Field::optional("direction", POINT, "", "direction in which parallel light travels, or axis of a spot"),
        Field::optional("irradiance", LIGHT, "", "irradiance of parallel light on a surface that faces it"),
        Field::optional(
            "cutoff",
            Ty::Num { min: CUTOFF_RANGE[0], max: CUTOFF_RANGE[1] },
            "20",
            "angle from the axis in degrees from which on a spot does not shine",
        ),
        Field::optional(
            "beam",
            Ty::Num { min: 0.0, max: CUTOFF_RANGE[1] },
            "three quarters of cutoff",
            "angle from the axis in degrees up to which a spot has its whole intensity; it falls off linearly from there",
        ),
    ],
};

const ENVIRONMENT: Table = Table {
    name: "SceneEnvironment",
    doc: "Light from all around: one colour or an equirectangular map.",
    fields: &[
        Field::optional("color", LIGHT, "", "the same radiance from everywhere"),
        Field::optional(
            "map",
            Ty::Object("string|Texture"),
            "",
            "an equirectangular picture with +y on top and +z in the middle",
        ),
        Field::optional(
            "rotation",
            Ty::Num { min: -1e6, max: 1e6 },
            "0",
            "turn about +y in degrees, counter-clockwise from above",
        ),
        Field::optional("scale", Ty::Num { min: 0.0, max: 1e12 }, "1", "factor on the radiance"),
    ],
};

const IMPORT: Table = Table {
    name: "Import",
    doc: "How another scene file is taken in.",
    fields: &[
        Field::optional("prefix", Ty::Str, "none", "goes before the names of its materials and entities"),
        Field::optional("material", Ty::Str, "its own", "one material of this scene for all of it"),
        Field::optional("place", Ty::Object("Place"), "as it is", "where it stands"),
        Field::optional("lights", Ty::Bool, "false", "whether its lights and environment come too"),
        Field::optional(
            "project",
            Ty::Word(&["none", "plane"]),
            "none",
            "texture coordinates for its meshes that bring none: `plane` takes x and y, over the mesh's larger extent",
        ),
    ],
};

/// The option tables, for the annotations.
pub const TABLES: &[&Table] = &[&SCENE, &CAMERA, &POINT_LIGHT, &ENVIRONMENT, &IMPORT];

/// The constructor of scenes.
pub const GLOBALS: &[ApiFn] = &[ApiFn {
    name: "scene",
    params: &[Param { name: "options?", ty: "SceneOptions", doc: "Resolution and depth." }],
    returns: "Scene",
    doc: "Begins the description of a scene, in a file of its own that ends with returning it.",
    call: scene,
}];

/// The methods of a scene.
pub const METHODS: &[ApiFn] = &[
    ApiFn {
        name: "s:option",
        params: &[
            Param { name: "name", ty: "string", doc: "Its name in `scene_options` of a render table." },
            Param {
                name: "values",
                ty: "any",
                doc: "A list of words or numbers, the default first; or only a default.",
            },
        ],
        returns: "any",
        doc: "Declares something that experiments may choose, and gives what was chosen.",
        call: option,
    },
    ApiFn {
        name: "s:camera",
        params: &[Param { name: "options", ty: "SceneCamera", doc: "Where it stands and what it sees." }],
        returns: "",
        doc: "Says from where the scene is seen, unless a `view` is chosen.",
        call: camera,
    },
    ApiFn {
        name: "s:view",
        params: &[
            Param { name: "name", ty: "string", doc: "Its name, as `view = NAME` in a render table." },
            Param { name: "options", ty: "SceneCamera", doc: "Where it stands and what it sees." },
        ],
        returns: "",
        doc: "Adds another camera under a name. The first is the scene's camera if s:camera says none.",
        call: view,
    },
    ApiFn {
        name: "s:material",
        params: &[
            Param { name: "name", ty: "string", doc: "The name by which parts and sweeps reach it." },
            Param { name: "options", ty: "SceneMaterial", doc: "Parameters and textures." },
        ],
        returns: "",
        doc: "Declares a material.",
        call: material::material,
    },
    ApiFn {
        name: "s:add",
        params: &[Param { name: "part", ty: "Part", doc: "What, where, and of which material." }],
        returns: "",
        doc: "Adds a shape or a group.",
        call: add,
    },
    ApiFn {
        name: "s:light",
        params: &[Param { name: "options", ty: "SceneLight", doc: "Where it is and how bright." }],
        returns: "",
        doc: "Adds a light without a surface. Surfaces shine by the emission of their material.",
        call: light,
    },
    ApiFn {
        name: "s:environment",
        params: &[Param { name: "options", ty: "SceneEnvironment", doc: "Its colours." }],
        returns: "",
        doc: "Says what light comes from outside.",
        call: environment,
    },
    ApiFn {
        name: "s:import",
        params: &[
            Param {
                name: "file",
                ty: "string",
                doc: "A scene file of any known format, relative to this one's folder.",
            },
            Param { name: "options?", ty: "Import", doc: "Names, materials and place." },
        ],
        returns: "",
        doc: "Takes in the entities and materials of another scene file. A material that is declared before under the same \
              name takes the place of the file's.",
        call: import,
    },
];

fn scene(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    if matches!(shared.purpose, Purpose::Experiment) {
        let help = "scenes have files of their own: scene = \"FILE.lua\" in what x:render returns".to_owned();
        return Err(shared.sources.borrow().error(&args.place, Problem::IsScene, Some(help)));
    }
    if let Some((_, place)) = &shared.scene.borrow().head {
        return Err(args.error(
            shared,
            format!("a file describes one scene; the first is in line {}", place.line),
            None,
        ));
    }
    let fields = match args.get(0) {
        LuaValue::Nil => Fields::default(),
        LuaValue::Table(t) => strict::fields(&t, &SCENE, "scene", false).map_err(|e| args.blame(shared, e))?,
        _ => return Err(args.wrong(shared, 0, "options", "a table such as { resolution = { 1280, 720 } }")),
    };
    let object = api::method_object(lua, shared, METHODS, "s").map_err(|e| shared.convert(&e))?;
    let mut builder = shared.scene.borrow_mut();
    if let Some(value) = fields.values.get("resolution") {
        builder.desc.resolution = numbers::<2>(value).map(|n| n as u32);
    }
    if let Some(depth) = fields.values.get("max_depth").and_then(Value::as_i64) {
        builder.desc.max_depth = depth as u32;
    }
    builder.head = Some((object.clone(), args.place.clone()));
    Ok(LuaValue::Table(object))
}

fn option(shared: &Rc<Shared>, lua: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let name = args.text(shared, 0, "name")?;
    let values = strict::read(&args.get(1), "values", "").map_err(|e| args.blame(shared, e))?;
    let choices: &[Value] = values.as_list().unwrap_or(std::slice::from_ref(&values));
    let plain = |v: &Value| matches!(v, Value::Bool(_) | Value::Int(_) | Value::Num(_) | Value::Str(_));
    let Some(default) = choices.first().filter(|_| choices.iter().all(plain)) else {
        return Err(args.wrong(shared, 1, "values", "words, numbers or booleans, the default first"));
    };
    let is_list = values.as_list().is_some();
    let words = if is_list {
        let all: Vec<String> = choices.iter().map(Value::to_string).collect();
        format!("one of {}", all.join(", "))
    } else {
        format!("{} such as {default}", default.kind())
    };
    if shared.scene.borrow_mut().known.insert(name.clone(), words.clone()).is_some() {
        return Err(args.error(shared, format!("`{name}` is declared twice"), None));
    }
    let Purpose::Scene { options, .. } = &shared.purpose else { return Ok(LuaValue::Nil) };
    let chosen = options.get(&name).unwrap_or(default);
    let numeric = |v: &Value| v.as_f64().is_some();
    let fits = if is_list {
        choices.contains(chosen)
    } else {
        std::mem::discriminant(chosen) == std::mem::discriminant(default) || (numeric(chosen) && numeric(default))
    };
    if !fits {
        let problem = format!("scene_options.{name} is {chosen}: expected {words}");
        return Err(args.error(shared, problem, None));
    }
    crate::script::hooks::to_lua(lua, chosen).map_err(|e| shared.convert(&e))
}

fn read_camera(shared: &Shared, args: &Args, index: usize) -> Result<CameraDesc, ScriptError> {
    let table = args.table(shared, index, "options")?;
    let fields = strict::fields(&table, &CAMERA, "camera", false).map_err(|e| args.blame(shared, e))?;
    let point = |key: &str, default: Vec3| fields.values.get(key).map_or(default, |v| Vec3::from(numbers::<3>(v)));
    let number = |key: &str| fields.values.get(key).and_then(Value::as_f64).map(|x| x as f32);
    let camera = CameraDesc {
        position: point("position", Vec3::Z),
        target: point("target", Vec3::ZERO),
        up: point("up", Vec3::Y),
        fov_deg: number("fov").unwrap_or(45.0),
        aperture: number("aperture").unwrap_or(0.0),
        focus_distance: number("focus_distance"),
        optics: Optics {
            f_number: number("f_number"),
            focal_length: number("focal_length"),
            sensor_height: number("sensor_height"),
        },
    };
    let twice = [
        ("aperture", "f_number", number("aperture").is_some() && camera.optics.f_number.is_some()),
        (
            "fov",
            "sensor_height and focal_length",
            number("fov").is_some() && camera.optics.focal_length.is_some() && camera.optics.sensor_height.is_some(),
        ),
    ];
    if let Some((a, b, _)) = twice.into_iter().find(|(_, _, both)| *both) {
        return Err(args.error(shared, format!("`{a}` and `{b}` say the same thing: leave one out"), None));
    }
    if camera.lacks_focal_length() {
        let help = Some("or a sensor_height, from which it follows".to_owned());
        return Err(args.error(shared, "an f_number says nothing without a focal_length", help));
    }
    Ok(camera)
}

fn camera(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let camera = read_camera(shared, args, 0)?;
    let mut builder = shared.scene.borrow_mut();
    if let Some(place) = &builder.camera {
        let problem = format!("the camera is said in line {} already", place.line);
        return Err(args.error(shared, problem, Some("s:view adds more, under names".to_owned())));
    }
    builder.desc.camera = camera;
    builder.camera = Some(args.place.clone());
    Ok(LuaValue::Nil)
}

fn view(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let name = args.text(shared, 0, "name")?;
    let camera = read_camera(shared, args, 1)?;
    let mut builder = shared.scene.borrow_mut();
    if builder.desc.views.iter().any(|(known, _)| *known == name) {
        return Err(args.error(shared, format!("there is a view `{name}` already"), None));
    }
    if builder.camera.is_none() {
        builder.desc.camera = camera.clone();
        builder.camera = Some(args.place.clone());
    }
    builder.desc.views.push((name, camera));
    Ok(LuaValue::Nil)
}

fn add(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "part")?;
    let part = part::read(shared, args, &table, "part")?;
    let mut builder = shared.scene.borrow_mut();
    for leaf in part.leaves() {
        let Some(material) = leaf.material.clone() else {
            let of = if leaf.names.is_empty() { String::new() } else { format!(" of `{}`", leaf.names.join("/")) };
            let help = Some("material = NAME, here or in the group".to_owned());
            return Err(args.error(shared, format!("a shape{of} has no material"), help));
        };
        builder.wanted.entry(material.clone()).or_insert_with(|| args.place.clone());
        let name = part::name(&mut builder.names, &leaf);
        let shape = match leaf.shape {
            ShapeObject::Mesh(mesh) => ShapeDesc::Mesh(mesh),
            ShapeObject::Sphere(radius) => ShapeDesc::Sphere { radius },
        };
        let mut transform = leaf.transform;
        let shape = match shape {
            // A sphere's own scale is its radius: edits of spheres know no other.
            ShapeDesc::Sphere { radius } => {
                let scale = transform.scale.x.abs();
                (transform.scale, transform.rotate_rad) = (Vec3::ONE, Vec3::ZERO);
                ShapeDesc::Sphere { radius: radius * scale }
            }
            mesh => mesh,
        };
        if matches!(shape, ShapeDesc::Sphere { .. }) && transform.sphere_scale().is_none() {
            let help = Some("shape.ball makes one of triangles, which can be stretched".to_owned());
            return Err(args.error(shared, format!("the true sphere `{name}` is stretched by its group"), help));
        }
        let anisotropic_direction = leaf.anisotropic_direction;
        builder.desc.entities.push(EntityDesc {
            name,
            transform,
            material: Some(material),
            anisotropic_direction,
            shape,
        });
    }
    Ok(LuaValue::Nil)
}

fn light(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "options")?;
    let fields = strict::fields(&table, &POINT_LIGHT, "light", false).map_err(|e| args.blame(shared, e))?;
    let vector = |key: &str| fields.values.get(key).map(|v| Vec3::from(numbers::<3>(v)));
    let angle = |key: &str| fields.values.get(key).and_then(Value::as_f64).map(|x| x as f32);
    let angles = (angle("cutoff"), angle("beam"));
    let kind = match (vector("position"), vector("intensity"), vector("direction"), vector("irradiance")) {
        (Some(position), Some(intensity), Some(direction), None) => {
            let cutoff_deg = angles.0.unwrap_or(20.0);
            let cone = ConeDesc { beam_deg: angles.1.unwrap_or(0.75 * cutoff_deg), cutoff_deg, edge: ConeEdge::Linear };
            if !cone.is_possible() {
                return Err(args.error(shared, "the `beam` of a spot is at most its `cutoff`", None));
            }
            LightKind::Spot { position, direction, intensity, cone }
        }
        _ if angles != (None, None) => {
            let problem = "`cutoff` and `beam` belong to a spot: expected `position`, `direction` and `intensity`";
            return Err(args.error(shared, problem, None));
        }
        (Some(position), Some(intensity), None, None) => LightKind::Point { position, intensity },
        (None, None, Some(direction), Some(irradiance)) => LightKind::Directional { direction, irradiance },
        _ => {
            let problem =
                "expected `position` and `intensity` (and `direction` for a spot), or `direction` and `irradiance`";
            return Err(args.error(shared, problem, None));
        }
    };
    let mut builder = shared.scene.borrow_mut();
    let given = fields.values.get("name").and_then(Value::as_str).map(str::to_owned);
    let name = given.unwrap_or_else(|| format!("light_{}", builder.desc.lights.len() + 1));
    if builder.desc.lights.iter().any(|l| l.name == name) {
        return Err(args.error(shared, format!("there is a light `{name}` already"), None));
    }
    builder.desc.lights.push(LightDesc { name, kind });
    Ok(LuaValue::Nil)
}

fn environment(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 1)?;
    let table = args.table(shared, 0, "options")?;
    let fields = strict::fields(&table, &ENVIRONMENT, "environment", false).map_err(|e| args.blame(shared, e))?;
    let source = match (fields.values.get("color"), fields.objects.get("map")) {
        (Some(color), None) => EnvironmentSource::Color(Vec3::from(numbers::<3>(color))),
        (None, Some(map)) => match texture::of(shared, args, map)? {
            Some(map) => EnvironmentSource::Map(map.texture),
            None => {
                let (path, key) = ("environment.map".to_owned(), "map".to_owned());
                let problem = format!("expected a texture or the name of an image, found {}", kind(map));
                return Err(args.blame(shared, SchemaError { path, problem, help: None, key }));
            }
        },
        _ => return Err(args.error(shared, "expected either a `color` or a `map`", None)),
    };
    let number = |key: &str, default: f32| fields.values.get(key).and_then(Value::as_f64).map_or(default, |x| x as f32);
    let mut builder = shared.scene.borrow_mut();
    if builder.desc.environment.is_some() {
        return Err(args.error(shared, "a scene has one environment, and it is said already", None));
    }
    let (rotation_deg, scale) = (number("rotation", 0.0), number("scale", 1.0));
    builder.desc.environment = Some(EnvironmentDesc { source, rotation_deg, scale });
    Ok(LuaValue::Nil)
}

fn import(shared: &Rc<Shared>, _: &Lua, args: &Args) -> Result<LuaValue, ScriptError> {
    args.at_most(shared, 2)?;
    let name = args.text(shared, 0, "file")?;
    let fields = match args.get(1) {
        LuaValue::Nil => Fields::default(),
        LuaValue::Table(t) => strict::fields(&t, &IMPORT, "import", false).map_err(|e| args.blame(shared, e))?,
        _ => return Err(args.wrong(shared, 1, "options", "a table such as { prefix = \"sponza/\" }")),
    };
    let frame = match fields.objects.get("place") {
        None => Affine3A::IDENTITY,
        Some(LuaValue::Table(t)) => part::frame(shared, args, t, "import.place")?,
        Some(other) => return Err(args.error(shared, format!("place: expected a table, found {}", kind(other)), None)),
    };
    let Purpose::Scene { missing, .. } = shared.purpose else { return Ok(LuaValue::Nil) };
    let path = shared.folder.join(&name);
    let read = shared.watch.excused(|| load::load_with(&path, missing));
    let (other, mut notes) = read.map_err(|e| scene_error(shared, args, &e))?;
    let text = |key: &str| fields.values.get(key).and_then(Value::as_str);
    let prefix = text("prefix").unwrap_or_default();
    let mut builder = shared.scene.borrow_mut();
    notes.retain(|note| note.message != load::DARK_MESH);
    builder.notes.append(&mut notes);
    if let Some(material) = text("material") {
        builder.wanted.entry(material.to_owned()).or_insert_with(|| args.place.clone());
    }
    let renamed = adopt_materials(&mut builder, other.materials, prefix, text("material"));
    let first = renamed.values().next().cloned();
    for mut entity in other.entities {
        entity.transform.frame = frame * entity.transform.frame;
        if let (Some("plane"), ShapeDesc::Mesh(mesh)) = (text("project"), &entity.shape)
            && mesh.uvs.is_empty()
        {
            entity.shape = ShapeDesc::Mesh(Arc::new(shape::projected(mesh)));
        }
        entity.material = match (text("material"), &entity.material, &entity.shape) {
            (Some(material), _, _) => Some(material.to_owned()),
            (None, Some(own), _) => renamed.get(own).cloned().or_else(|| first.clone()),
            (None, None, ShapeDesc::Sphere { .. }) => first.clone(),
            (None, None, ShapeDesc::Mesh(mesh)) => {
                let slot = |s: &String| renamed.get(s).or(first.as_ref()).unwrap_or(s).clone();
                let slots: Vec<String> = mesh.slots.iter().map(slot).collect();
                if slots != mesh.slots {
                    let mut named = MeshDesc { slots, ..(**mesh).clone() };
                    named.content_hash = mesh_hash(&named);
                    entity.shape = ShapeDesc::Mesh(Arc::new(named));
                }
                None
            }
        };
        entity.name = builder.names.give(&format!("{prefix}{}", entity.name));
        builder.desc.entities.push(entity);
    }
    if fields.values.get("lights") == Some(&Value::Bool(true)) {
        builder
            .desc
            .lights
            .extend(other.lights.into_iter().map(|l| LightDesc { name: format!("{prefix}{}", l.name), ..l }));
        builder.desc.environment = other.environment.or(builder.desc.environment.take());
    }
    Ok(LuaValue::Nil)
}

/// Adds another scene's materials, and says what each is called now. What this scene has under the same name takes the
/// place of the file's, and `instead` that of all.
fn adopt_materials(
    builder: &mut SceneBuilder,
    materials: Vec<MaterialDesc>,
    prefix: &str,
    instead: Option<&str>,
) -> BTreeMap<String, String> {
    let mut renamed = BTreeMap::new();
    for material in materials {
        if instead.is_some() {
            break;
        }
        let name = format!("{prefix}{}", material.name);
        renamed.insert(material.name.clone(), name.clone());
        if builder.desc.material_row(&name).is_none() {
            builder.desc.materials.push(MaterialDesc { name, ..material });
        }
    }
    renamed
}
