//! `scene {..}` and the methods of scenes for options, cameras and shapes.

use glam::{DVec3, Vec3};
use mlua::Value as LuaValue;

use super::schema::{CAMERA, SCENE};
use super::shape_object::ShapeObject;
use super::{import, lighting, material, part};
use crate::api::{ApiFn, Args, functions, method_object};
use crate::error::{Problem, ScriptError};
use crate::state::Purpose;
use crate::strict;
use lumbre_light::scene::desc::{
    CameraDesc, CameraKind, EntityDesc, Optics, ShapeDesc, ViewWindow,
};
use lumbre_light::value::Value;

functions! {
    /// Constructor of scenes.
    pub const GLOBALS;
    "scene" -> "Scene" = scene,
        "Creates a scene. A scene file creates exactly one, calls its methods, and returns it." {
        "options?": "SceneOptions", "Resolution and path depth.";
    }
}

functions! {
    /// Methods of a scene.
    pub const METHODS;
    "s:option" -> "any" = option,
        "Declares an option that experiments can set, and returns its value." {
        "name": "string", "Name of the option in `scene_options` of a render table.";
        "values": "any",
            "List of the accepted strings, numbers or booleans, the default first; or only a \
             default, which accepts every value of its kind.";
    }
    "s:camera" = camera, "Sets the camera, which is used unless a render table chooses a `view`." {
        "options": "SceneCamera", "Position, lens and sensor of the camera.";
    }
    "s:view" = view,
        "Adds a named camera. The first view is the scene's camera if s:camera is not called." {
        "name": "string", "Name of the view, for `view = NAME` in a render table.";
        "options": "SceneCamera", "Position, lens and sensor of the camera.";
    }
    "s:material" = material::material, "Adds a material." {
        "name": "string", "Name of the material, for parts and for changes with `set`.";
        "options": "SceneMaterial", "Parameters and textures.";
    }
    "s:add" = add, "Adds a shape or a group to the scene." {
        "part": "Part", "Shape or group with placement and material.";
    }
    "s:light" = lighting::light,
        "Adds a point, directional or spot light. Surfaces emit light through the `emission` of \
         their material." {
        "options": "SceneLight", "Position or direction, and intensity.";
    }
    "s:environment" = lighting::environment,
        "Sets the light from the environment. A scene has at most one." {
        "options": "SceneEnvironment", "Colour or map, rotation and scale.";
    }
    "s:import" = import::import,
        "Takes in the entities and materials of another scene file. A material that is declared \
         before under the same name takes the place of the file's." {
        "file": "string", "Scene file of any known format, relative to the folder of this file.";
        "options?": "Import", "Names, materials, placement and lights.";
    }
}

fn scene(args: &Args) -> Result<LuaValue, ScriptError> {
    if matches!(args.shared.purpose, Purpose::Experiment) {
        let help = "`lumbre render` renders a scene; an experiment names the scene file in its \
                    render table: scene = \"FILE.lua\""
            .to_owned();
        return Err(args
            .shared
            .sources
            .borrow()
            .error(&args.place, Problem::IsScene, Some(help)));
    }
    if let Some((_, place)) = &args.shared.scene.borrow().head {
        return Err(args.error(
            format!(
                "a file creates one scene; the first is in line {}",
                place.line
            ),
            None,
        ));
    }
    let fields = args.options(0, &SCENE, "scene", "{ resolution = { 1280, 720 } }")?;
    let object = method_object(&args.lua, &args.shared, METHODS, "s")
        .map_err(|e| args.shared.convert(&e))?;
    let mut builder = args.shared.scene.borrow_mut();
    if let Some(resolution) = fields.numbers("resolution") {
        builder.desc.resolution = resolution.map(|n| n as u32);
    }
    if let Some(depth) = fields.i64("max_depth") {
        builder.desc.max_depth = depth as u32;
    }
    builder.head = Some((object.clone(), args.place.clone()));
    Ok(LuaValue::Table(object))
}

fn option(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "name")?;
    let values = strict::read(&args.get(1), "values", "").map_err(|e| args.locate_error(e))?;
    let choices: &[Value] = values.as_list().unwrap_or(std::slice::from_ref(&values));
    let plain = |v: &Value| {
        matches!(
            v,
            Value::Bool(_) | Value::Int(_) | Value::Num(_) | Value::Str(_)
        )
    };
    let Some(default) = choices.first().filter(|_| choices.iter().all(plain)) else {
        return Err(args.wrong(
            1,
            "values",
            "strings, numbers or booleans, the default first",
        ));
    };
    let is_list = values.as_list().is_some();
    let accepted = if is_list {
        let all: Vec<String> = choices.iter().map(Value::to_string).collect();
        format!("one of {}", all.join(", "))
    } else {
        format!("{} such as {default}", default.kind())
    };
    if args
        .shared
        .scene
        .borrow_mut()
        .options
        .insert(name.clone(), accepted.clone())
        .is_some()
    {
        return Err(args.error(format!("`{name}` is declared twice"), None));
    }
    let Purpose::Scene { options, .. } = &args.shared.purpose else {
        return Ok(LuaValue::Nil);
    };
    let chosen = options.get(&name).unwrap_or(default);
    let numeric = |v: &Value| v.as_f64().is_some();
    let fits = if is_list {
        choices.contains(chosen)
    } else {
        std::mem::discriminant(chosen) == std::mem::discriminant(default)
            || (numeric(chosen) && numeric(default))
    };
    if !fits {
        let problem = format!("scene_options.{name} is {chosen}: expected {accepted}");
        return Err(args.error(problem, None));
    }
    crate::hooks::to_lua(&args.lua, chosen).map_err(|e| args.shared.convert(&e))
}

/// Converts argument `index`, the options of a camera.
fn read_camera(args: &Args, index: usize) -> Result<CameraDesc, ScriptError> {
    let fields = args.fields(index, "options", &CAMERA, "camera")?;
    let place = |key: &str| part::place(&fields, key);
    let number = |key: &str| fields.f32(key);
    let defaults = CameraDesc::default();
    let kind = fields.text("kind");
    let camera = CameraDesc {
        kind: kind.and_then(CameraKind::from_name).unwrap_or_default(),
        up: fields.numbers("up").map_or(Vec3::Y, Vec3::from_array),
        view_height: number("view_height").unwrap_or(defaults.view_height),
        window: fields
            .numbers("window")
            .map_or(defaults.window, ViewWindow::from_array),
        focus_distance: number("focus_distance"),
        optics: Optics::pinhole(number("fov").unwrap_or(defaults.view_deg()))
            .with_aperture(number("aperture").unwrap_or(0.0))
            .with_f_number(number("f_number"))
            .with_focal_length(number("focal_length"))
            .with_sensor_height(number("sensor_height")),
        ..defaults
    };
    let position = place("position").unwrap_or(DVec3::Z);
    let camera = camera.placed(position, place("target").unwrap_or(DVec3::ZERO));
    let conflicts = [
        (
            "aperture",
            "f_number",
            number("aperture").is_some() && camera.optics.f_number().is_some(),
        ),
        (
            "fov",
            "sensor_height and focal_length",
            number("fov").is_some() && camera.optics.determine_view(),
        ),
    ];
    if let Some((a, b, _)) = conflicts.into_iter().find(|(_, _, both)| *both) {
        return Err(args.error(
            format!("`{a}` and `{b}` determine the same quantity: remove one of them"),
            None,
        ));
    }
    if camera.lacks_focal_length() {
        let help = Some("add one of them, or give the lens diameter as `aperture`".to_owned());
        return Err(args.error("`f_number` needs `focal_length` or `sensor_height`", help));
    }
    if let Some([problem, help]) = camera.lens_problem() {
        return Err(args.error(problem, Some(help)));
    }
    if let Some(problem) = camera.window_problem() {
        return Err(args.error(problem, None));
    }
    Ok(camera)
}

fn camera(args: &Args) -> Result<LuaValue, ScriptError> {
    let camera = read_camera(args, 0)?;
    let mut builder = args.shared.scene.borrow_mut();
    if let Some(place) = &builder.camera {
        let problem = format!("the camera is already set in line {}", place.line);
        return Err(args.error(problem, Some("add further cameras with s:view".to_owned())));
    }
    builder.desc.camera = camera;
    builder.camera = Some(args.place.clone());
    Ok(LuaValue::Nil)
}

fn view(args: &Args) -> Result<LuaValue, ScriptError> {
    let name = args.text(0, "name")?;
    let camera = read_camera(args, 1)?;
    let mut builder = args.shared.scene.borrow_mut();
    if builder.desc.views.iter().any(|(known, _)| *known == name) {
        return Err(args.error(format!("a view `{name}` already exists"), None));
    }
    if builder.camera.is_none() {
        builder.desc.camera = camera.clone();
        builder.camera = Some(args.place.clone());
    }
    builder.desc.views.push((name, camera));
    Ok(LuaValue::Nil)
}

fn add(args: &Args) -> Result<LuaValue, ScriptError> {
    let table = args.table(0, "part")?;
    let part = part::read(args, &table, "part")?;
    let mut builder = args.shared.scene.borrow_mut();
    for leaf in part.leaves() {
        let Some(material) = leaf.material.clone() else {
            let owner = if leaf.names.is_empty() {
                String::new()
            } else {
                format!(" of `{}`", leaf.names.join("/"))
            };
            let help = Some("set material = NAME in the part or in its group".to_owned());
            return Err(args.error(format!("a shape{owner} has no material"), help));
        };
        builder
            .requested_materials
            .entry(material.clone())
            .or_insert_with(|| args.place.clone());
        let name = part::name(&mut builder.names, &leaf);
        let shape = match leaf.shape {
            ShapeObject::Mesh(mesh) => ShapeDesc::Mesh(mesh),
            ShapeObject::Sphere(radius) => ShapeDesc::Sphere { radius },
        };
        let mut transform = leaf.transform;
        let shape = match shape {
            // The scale of a sphere is part of its radius, the only size that edits of spheres
            // accept.
            ShapeDesc::Sphere { radius } => {
                let scale = transform.scale.x.abs();
                (transform.scale, transform.rotate_rad) = (Vec3::ONE, Vec3::ZERO);
                ShapeDesc::Sphere {
                    radius: radius * scale,
                }
            }
            mesh => mesh,
        };
        if matches!(shape, ShapeDesc::Sphere { .. }) && transform.sphere_scale().is_none() {
            let help = Some("use shape.ball, a mesh that can be stretched".to_owned());
            return Err(args.error(
                format!("the analytic sphere `{name}` is scaled non-uniformly by its group"),
                help,
            ));
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
