//! Scenes written in Lua.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::scene::desc::{
    EnvironmentSource, LightKind, Lookup, ShapeDesc, TextureFilter, TextureSlot, Wrap, content_hash,
};
use lumbre_light::scene::{SceneDesc, compile};
use lumbre_light::value::Value;
use lumbre_lua::scene;
use lumbre_scene_io::edit;
use lumbre_scene_io::load::MissingTextures;

use crate::script::Folder;

const HEAD: &str = "local s = scene { resolution = { 64, 32 }, max_depth = 3 }
s:camera { position = { 0, 1, 5 }, target = { 0, 1, 0 } }
s:material(\"clay\", { base_color = { 0.5, 0.4, 0.3 }, roughness = 0.8 })
";

fn options(pairs: &[(&str, Value)]) -> BTreeMap<String, Value> {
    pairs
        .iter()
        .map(|(k, v)| ((*k).to_owned(), v.clone()))
        .collect()
}

fn read(folder: &Folder, chosen: &[(&str, Value)]) -> Result<SceneDesc, String> {
    scene::read(
        &folder.path("scene.lua"),
        &options(chosen),
        MissingTextures::Fail,
    )
    .map(|(s, _)| s)
    .map_err(|e| e.to_string())
}

fn folder(body: &str) -> Folder {
    let folder = Folder::new("");
    folder.put("scene.lua", format!("{HEAD}{body}\nreturn s\n"));
    folder
}

fn made(body: &str) -> SceneDesc {
    read(&folder(body), &[]).unwrap()
}

fn refused(body: &str) -> String {
    read(&folder(body), &[]).unwrap_err()
}

#[test]
fn a_scene_script_is_converted_to_a_scene() {
    let s = made(
        "s:material(\"glaze\", { from = \"clay\", clearcoat = 1, base_color = { 0.1, 0.2, 0.9 } })
s:add { shape = shape.box { size = { 1, 2, 3 } }, material = \"clay\", at = { 0, 1, 0 }, rotate = 90, scale = 2 }
s:add { name = \"ball\", shape = shape.sphere { radius = 0.5 }, material = \"glaze\", at = { 2, 0.5, 0 } }
s:light { position = { 0, 4, 0 }, intensity = { 10, 10, 10 } }
s:light { name = \"sun\", direction = { 0, -1, 0 }, irradiance = { 1, 1, 1 } }
s:environment { color = { 0.1, 0.1, 0.2 }, scale = 2 }",
    );
    assert_eq!(
        (s.resolution, s.max_depth, s.camera.position),
        ([64, 32], 3, Vec3::new(0.0, 1.0, 5.0))
    );
    let glaze = &s.materials[s.material_index("glaze").unwrap()];
    assert_eq!(
        (glaze.clearcoat, glaze.roughness, glaze.base_color.z),
        (1.0, 0.8, 0.9),
        "`glaze` must inherit and override parameters"
    );
    assert_eq!(
        s.entities
            .iter()
            .map(|e| e.name.as_str())
            .collect::<Vec<_>>(),
        ["clay_1", "ball"]
    );
    assert_eq!(
        s.lights.iter().map(|l| l.name.as_str()).collect::<Vec<_>>(),
        ["light_1", "sun"]
    );
    assert_eq!(
        s.environment.as_ref().unwrap().source,
        EnvironmentSource::Color(Vec3::new(0.1, 0.1, 0.2))
    );
    let (c, notes) = compile(&s).unwrap();
    assert!(notes.is_empty(), "{notes:?}");
    assert_eq!((c.triangles.len(), c.spheres.len()), (12, 1));
    // The box of 1 x 2 x 3, scaled by 2 and rotated by 90 degrees about y, is 6 x 4 x 2 about (0,
    // 1, 0).
    let high = c
        .triangles
        .iter()
        .flatten()
        .fold(Vec3::MIN, |a, p| a.max(*p));
    assert!((high - Vec3::new(3.0, 3.0, 1.0)).length() < 1e-5, "{high}");
}

#[test]
fn places_far_from_the_origin_are_in_double_precision() {
    let relative = |x: f64| {
        let body = format!(
            "s:camera {{ position = {{ {}, 1, 5 }}, target = {{ {x}, 1, 0 }} }}
s:add {{ shape = shape.sphere {{ radius = 0.2 }}, material = \"clay\", at = {{ {}, 1, 0 }} }}
s:light {{ position = {{ {}, 3, 0 }}, intensity = {{ 1, 1, 1 }} }}",
            x + 0.01,
            x + 0.02,
            x - 0.03,
        );
        let folder = Folder::new("");
        let head = HEAD.lines().filter(|line| !line.starts_with("s:camera"));
        let head: Vec<&str> = head.collect();
        folder.put(
            "scene.lua",
            format!("{}\n{body}\nreturn s\n", head.join("\n")),
        );
        let (scene, _) = compile(&read(&folder, &[]).unwrap()).unwrap();
        let ball = scene.spheres[0].center;
        [
            scene.camera.position - ball,
            scene.points[0].position - ball,
        ]
    };
    for (near, far) in relative(0.25).into_iter().zip(relative(3_000_000.1)) {
        assert!((near - far).length() < 1e-5, "{far}, not {near}");
    }
}

#[test]
fn goniometric_lights_need_a_position_and_an_intensity_and_nothing_else() {
    let map = "map = texture.paint { size = { 4, 2 }, linear = true, color = function(u, v) return \
               u end }";
    let s = made(&format!(
        "s:light {{ position = {{ 0, 4, 0 }}, intensity = {{ 10, 9, 8 }}, {map}, rotation = 30 }}"
    ));
    let LightKind::Goniometric {
        intensity,
        map: image,
        rotation_deg,
        ..
    } = &s.lights[0].kind
    else {
        panic!("{:?}", s.lights)
    };
    assert_eq!(
        (*intensity, *rotation_deg),
        (Vec3::new(10.0, 9.0, 8.0), 30.0)
    );
    assert_eq!((image.width, image.height), (4, 2));
    for (options, part) in [
        (
            format!("position = {{ 0, 4, 0 }}, {map}"),
            "needs `position` and `intensity`",
        ),
        (
            format!("position = {{ 0, 4, 0 }}, intensity = {{ 1, 1, 1 }}, beam = 3, {map}"),
            "has no `beam`",
        ),
        (
            "position = { 0, 4, 0 }, intensity = { 1, 1, 1 }, rotation = 3".to_owned(),
            "lights with a `map`",
        ),
        (
            "position = { 0, 4, 0 }, intensity = { 1, 1, 1 }, map = 3".to_owned(),
            "light.map",
        ),
    ] {
        let e = refused(&format!("s:light {{ {options} }}"));
        assert!(e.contains(part), "{options}: {e}");
    }
}

#[test]
fn groups_nest_share_meshes_and_pass_their_material_to_members() {
    let s = made(
        "local leg = shape.cylinder { radius = 0.1, height = 1 }
local legs = group { { shape = leg, at = { -1, 0, 0 } }, { shape = leg, at = { 1, 0, 0 }, name = \"right\" } }
local table_ = group { { shape = legs, at = { 0, 0, -1 } }, { shape = legs, at = { 0, 0, 1 }, name = \"front\", rotate = 180 } }
s:add { shape = table_, material = \"clay\", name = \"table\", at = { 0, 0, 10 }, rotate = { 0, 90, 0 } }",
    );
    let names: Vec<&str> = s.entities.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(
        names,
        ["table", "table/right", "table/front", "table/front/right"]
    );
    let meshes: Vec<_> = s
        .entities
        .iter()
        .map(|e| {
            if let ShapeDesc::Mesh(m) = &e.shape {
                m
            } else {
                panic!()
            }
        })
        .collect();
    assert!(
        meshes.iter().all(|m| Arc::ptr_eq(m, meshes[0])),
        "four legs must share one mesh"
    );
    // A rotation by 90 degrees about y maps x to -z and z to x.
    let places: Vec<Vec3> = s
        .entities
        .iter()
        .map(|e| e.transform.to_world().translation.as_vec3().round())
        .collect();
    let expected = [
        [-1.0, 0.0, 11.0],
        [-1.0, 0.0, 9.0],
        [1.0, 0.0, 9.0],
        [1.0, 0.0, 11.0],
    ]
    .map(Vec3::from);
    assert_eq!(places, expected);
    let mut moved = s.clone();
    edit::set(
        &mut moved,
        "entities.table/right.position",
        &Value::List([2, 0, 0].map(Value::Int).to_vec()),
    )
    .unwrap();
    assert_eq!(
        moved.entities[1]
            .transform
            .to_world()
            .translation
            .as_vec3()
            .round(),
        Vec3::new(-1.0, 0.0, 8.0)
    );
}

#[test]
fn vertex_colours_survive_joining_and_must_lie_between_0_and_1() {
    let painted = "shape.mesh { positions = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 } }, triangles = { { 1, 2, 3 } },
  colors = { { 1, 0, 0 }, { 0, 0.5, 0 }, { 0, 0, 1 } } }";
    let s = made(&format!(
        "local ball = shape.ball {{ radius = 1, splits = 1 }}
s:add {{ shape = shape.join({{ {{ shape = ball }}, {{ shape = {painted} }} }}), material = \"clay\" }}"
    ));
    let (c, _) = compile(&s).unwrap();
    let last = c.triangles.len() as u32 - 1;
    assert_eq!(
        (c.tint_at(0, [0.2, 0.2]), c.tint_at(last, [0.5, 0.25])),
        (Vec3::ONE, Vec3::new(0.25, 0.25, 0.25))
    );
    let e = refused(&format!(
        "s:add {{ shape = {}, material = \"clay\" }}",
        painted.replace("0.5", "1.5")
    ));
    assert!(e.contains("colour 2 is outside the range 0 to 1"), "{e}");
    let e = refused(&format!(
        "s:add {{ shape = {}, material = \"clay\" }}",
        painted.replace("{ 0, 0.5, 0 }, ", "")
    ));
    assert!(e.contains("3 positions but 2 colors"), "{e}");
}

#[test]
fn non_uniform_scales_apply_before_rotations() {
    let s = made(
        "s:add { shape = shape.box { size = { 1, 1, 1 } }, material = \"clay\", scale = { 4, 1, 1 }, rotate = 90 }",
    );
    let (c, _) = compile(&s).unwrap();
    let high = c
        .triangles
        .iter()
        .flatten()
        .fold(Vec3::MIN, |a, p| a.max(*p));
    assert!((high - Vec3::new(0.5, 0.5, 2.0)).length() < 1e-5, "{high}");
}

#[test]
fn options_select_values_and_have_defaults() {
    let f = folder(
        "local light = s:option(\"light\", { \"sun\", \"lamps\" })
local count = s:option(\"count\", 3)
for i = 1, count do s:light { name = light .. i, position = { i, 1, 0 }, intensity = { 1, 1, 1 } } end",
    );
    let names = |chosen: &[(&str, Value)]| {
        read(&f, chosen).map(|s| s.lights.iter().map(|l| l.name.clone()).collect::<Vec<_>>())
    };
    assert_eq!(names(&[]).unwrap(), ["sun1", "sun2", "sun3"]);
    assert_eq!(
        names(&[("light", "lamps".into()), ("count", Value::Int(1))]).unwrap(),
        ["lamps1"]
    );
    let e = names(&[("light", "moon".into())]).unwrap_err();
    assert!(
        e.contains("scene.lua:4") && e.contains("one of sun, lamps"),
        "{e}"
    );
    let e = names(&[("ligth", "sun".into())]).unwrap_err();
    assert!(
        e.contains("scene_options.ligth") && e.contains("did you mean `light`?"),
        "{e}"
    );
    assert!(
        names(&[("count", "many".into())])
            .unwrap_err()
            .contains("such as 3")
    );
}

#[test]
fn views_replace_the_camera() {
    let mut s = made(
        "s:view(\"above\", { position = { 0, 9, 0 }, target = { 0, 0, 0 }, up = { 0, 0, -1 }, fov = 60 })",
    );
    let before = content_hash(&s);
    edit::set(&mut s, "camera", &"above".into()).unwrap();
    assert_eq!(
        (s.camera.position, s.camera.view_deg()),
        (Vec3::new(0.0, 9.0, 0.0), 60.0)
    );
    assert_ne!(content_hash(&s), before);
    let e = edit::set(&mut s, "camera", &"abvoe".into())
        .unwrap_err()
        .to_string();
    assert!(e.contains("did you mean `above`?"), "{e}");
}

#[test]
fn painted_textures_are_evaluated_at_the_texel_centres() {
    let s = made(
        "local t = texture.paint { size = { 4, 2 }, color = function(u, v) return u, v, 0 end }
s:material(\"painted\", { base_color_texture = t })
s:environment { map = texture.paint { size = { 8, 4 }, linear = true, color = function(u, v) return 40 * v end } }
s:add { shape = shape.grid { size = { 2, 2 } }, material = \"painted\" }",
    );
    let texture = s.materials[s.material_index("painted").unwrap()]
        .texture(TextureSlot::BaseColor)
        .unwrap();
    let lumbre_light::scene::desc::Texels::Rgba8(texels) = &texture.texels else {
        panic!("painted colours must be stored as bytes")
    };
    assert_eq!(
        (texels[0], texels[7]),
        ([32, 191, 0, 255], [223, 64, 0, 255]),
        "top left and bottom right"
    );
    let EnvironmentSource::Map(map) = &s.environment.unwrap().source.clone() else {
        panic!()
    };
    let lumbre_light::scene::desc::Texels::RgbaF32(texels) = &map.texels else {
        panic!("an environment map must be stored as floats")
    };
    assert_eq!(texels[0][0], 35.0);
}

#[test]
fn lay_sets_wrap_and_transform_of_a_texture_and_its_set_of_coordinates() {
    let s = made(
        "local t = texture.paint { size = { 2, 2 }, color = function(u, v) return u end }
s:material(\"m\", { base_color_texture = t, mask_texture = texture.lay(t, { wrap = { \"mirror\", \"clamp\" }, filter = \"nearest\", scale = { 2, 3 },
  rotation = 90, offset = { 1, 0 }, second = true }), roughness_texture = texture.lay(texture.lay(t, { wrap = \"clamp\" }), {}) })
s:add { shape = shape.mesh { positions = { { 0, 0, 0 }, { 1, 0, 0 }, { 0, 1, 0 } }, triangles = { { 1, 2, 3 } },
  uvs = { { 0, 0 }, { 1, 0 }, { 0, 1 } }, second_uvs = { { 0, 0 }, { 0.5, 0 }, { 0, 0.5 } } }, material = \"m\" }",
    );
    let m = &s.materials[s.material_index("m").unwrap()];
    assert!(
        m.lookup(TextureSlot::BaseColor).is_plain() && m.lookup(TextureSlot::Roughness).is_plain()
    );
    let Lookup {
        wrap,
        filter,
        second,
        map,
    } = m.lookup(TextureSlot::Mask);
    assert_eq!(filter, TextureFilter::Nearest);
    assert_eq!((wrap, second), ([Wrap::Mirror, Wrap::Clamp], true));
    let found = map.unwrap().transform_point2(Vec2::new(1.0, 1.0));
    assert!(
        (found - Vec2::new(1.0 - 3.0, 2.0)).length() < 1e-6,
        "scaled, rotated counter-clockwise, translated: {found}"
    );
    let (c, _) = compile(&s).unwrap();
    let uv = c.uv_at(0, [0.5, 0.25]);
    assert_eq!((uv.first, uv.second), ([0.5, 0.25], [0.25, 0.125]));
}

#[test]
fn channels_of_one_texture_are_several_parameters() {
    let s = made(
        "local t = texture.paint { size = { 2, 1 }, color = function(u) return u, 0.2, 1 end }
s:material(\"m\", { roughness_texture = texture.channel(t, \"red\"), metallic_texture = texture.channel(texture.lay(t, { wrap = \"clamp\" }), \"green\"), opacity_texture = texture.channel(t, \"blue\") })
s:add { shape = shape.sphere { radius = 1 }, material = \"m\" }",
    );
    let m = &s.materials[s.material_index("m").unwrap()];
    let bytes = |slot: TextureSlot| match &m.texture(slot).unwrap().texels {
        lumbre_light::scene::desc::Texels::Rgba8(texels) => texels.to_vec(),
        other => panic!("{other:?}"),
    };
    let grey = |v: u8| [v, v, v, 255];
    assert_eq!(bytes(TextureSlot::Roughness), [grey(64), grey(191)]);
    assert_eq!(bytes(TextureSlot::Metallic), [grey(51); 2]);
    assert_eq!(bytes(TextureSlot::Opacity), [grey(255); 2]);
    assert_eq!(m.lookup(TextureSlot::Metallic).wrap, [Wrap::Clamp; 2]);
}

#[test]
fn imported_scenes_keep_their_materials() {
    let f = folder("s:import(\"two.obj\", { prefix = \"two/\", place = { at = { 0, 5, 0 } } })");
    f.put(
        "two.obj",
        "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\nusemtl clay\nf 3 2 1\n",
    );
    f.put("two.mtl", "newmtl red\nKd 1 0 0\nnewmtl clay\nKd 0 1 0\n");
    let s = read(&f, &[]).unwrap();
    let names: Vec<&str> = s.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(names[0], "clay");
    assert!(
        names.contains(&"two/red") && names.contains(&"two/clay"),
        "{names:?}"
    );
    let (c, _) = compile(&s).unwrap();
    let colors: Vec<Vec3> = c
        .attributes
        .iter()
        .map(|a| c.materials[a.material as usize].base_color)
        .collect();
    assert_eq!(colors, [Vec3::X, Vec3::Y]);
    let own = folder("s:material(\"red\", { base_color = { 0, 0, 1 } })\ns:import(\"two.obj\")");
    own.put(
        "two.obj",
        "mtllib two.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl red\nf 1 2 3\n",
    );
    own.put("two.mtl", "newmtl red\nKd 1 0 0\n");
    let s = read(&own, &[]).unwrap();
    let names: Vec<&str> = s.materials.iter().map(|m| m.name.as_str()).collect();
    assert_eq!(
        (names, s.materials[1].base_color),
        (vec!["clay", "red"], Vec3::Z),
        "materials of the importing script must take precedence"
    );
    assert!(c.triangles.iter().flatten().all(|p| p.y >= 5.0));
    let whole = folder("s:import(\"two.obj\", { material = \"clay\" })");
    whole.put("two.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n");
    let s = read(&whole, &[]).unwrap();
    assert_eq!(
        (s.materials.len(), s.entities[0].material.as_deref()),
        (1, Some("clay"))
    );
}

#[test]
fn meshes_without_texture_coordinates_can_have_them_projected() {
    let uvs = |options: &str, corners: &str| {
        let f = folder(&format!("s:import(\"m.obj\", {{ {options} }})"));
        f.put(
            "m.obj",
            format!("v -1 2 0\nv 3 2 5\nv -1 4 9\nvt 0.5 0.5\nf {corners}\n"),
        );
        let s = read(&f, &[]).unwrap();
        let (c, _) = compile(&s).unwrap();
        [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]
            .map(|corner| Vec2::from_array(c.uv_at(0, corner).first))
    };
    assert_eq!(
        uvs("project = \"plane\"", "1 2 3"),
        [Vec2::ZERO, Vec2::X, Vec2::new(0.0, 0.5)]
    );
    assert_eq!(
        uvs("project = \"plane\"", "1/1 2/1 3/1"),
        [Vec2::splat(0.5); 3],
        "coordinates of the file must be kept"
    );
    assert_eq!(uvs("", "1 2 3"), [Vec2::ZERO; 3]);
    let error = read(&folder("s:import(\"m.obj\", { project = \"plan\" })"), &[])
        .unwrap_err()
        .to_string();
    assert!(error.contains("none, plane"), "{error}");
}

#[test]
fn random_functions_are_reproducible_and_scatter_is_even() {
    let body = "local r = random(7)
for _, at in ipairs(scatter { size = { 10, 10 }, count = 200, seed = 3 }) do
  s:add { shape = shape.sphere { radius = 0.1 }, material = \"clay\", at = { at[1], noise(at[1], at[3]), at[3] }, scale = r:between(0.5, 1) }
end";
    let s = made(body);
    assert_eq!(content_hash(&s), content_hash(&made(body)));
    let mut cells = [0; 25];
    for e in &s.entities {
        let at = e.transform.translate;
        cells[((at.x + 5.0) / 2.0) as usize * 5 + ((at.z + 5.0) / 2.0) as usize] += 1;
    }
    assert!(
        cells.iter().all(|n| (5..=11).contains(n)),
        "each cell must hold about eight: {cells:?}"
    );
}

#[test]
fn errors_in_scenes_have_their_line_and_a_hint() {
    let cases = [
        (
            "s:add { shape = shape.box { size = { 1, 1, 1 } }, material = \"caly\" }",
            "did you mean `clay`?",
        ),
        (
            "s:add { shape = shape.box { size = { 1, 1 } }, material = \"clay\" }",
            "expected 3 numbers",
        ),
        (
            "s:add { shape = shape.cilinder { radius = 1, height = 1 }, material = \"clay\" }",
            "did you mean `cylinder`?",
        ),
        (
            "s:add { shape = shape.sphere { radius = 1 } }",
            "no material",
        ),
        (
            "s:add { shape = shape.sphere { radius = 1 }, material = \"clay\", scale = { 1, 2, 1 } }",
            "shape.ball",
        ),
        (
            "s:add { shape = 3, material = \"clay\" }",
            "expected a shape or a group, found an integer",
        ),
        (
            "s:material(\"x\", { rougness = 1 })",
            "did you mean `roughness`?",
        ),
        ("s:material(\"x\", { roughness = 2 })", "out of range"),
        (
            "s:material(\"clay\", {})",
            "a material `clay` already exists",
        ),
        (
            "s:camera { position = { 0, 0, 0 }, target = { 1, 0, 0 } }",
            "line 2",
        ),
        (
            "s:material(\"x\", { base_color_texture = \"none.png\" })",
            "none.png",
        ),
        ("s:import(\"none.obj\")", "none.obj"),
        (
            "local x = experiment(\"t\")",
            "a scene file cannot create an experiment",
        ),
        (
            "texture.paint { size = { 2, 2 }, color = function() return 1, 2 end }",
            "expected one or three",
        ),
        ("texture.lay(3, {})", "a texture or the name of an image"),
        ("texture.lay(\"none.png\", {})", "none.png"),
        (
            "texture.channel(texture.paint { size = { 1, 1 }, color = function() return 1 end }, \"x\")",
            "expected one of red, green, blue, alpha, found `x`",
        ),
        (
            "texture.lay(texture.paint { size = { 1, 1 }, color = function() return 1 end }, { wrap = \"clmap\" })",
            "`clamp`",
        ),
        (
            "shape.extrude { outline = { { 0, 0 }, { 1, 1 } }, depth = 1 }",
            "expected at least 3",
        ),
    ];
    for (body, expected) in cases {
        let e = refused(body);
        assert!(
            e.contains("scene.lua:4:") && e.contains(expected),
            "{body}: {e}"
        );
    }
    let nothing = Folder::new("");
    nothing.put("scene.lua", "local s = scene {}\nreturn 1\n");
    assert!(
        read(&nothing, &[])
            .unwrap_err()
            .contains("a scene ends with `return s`")
    );
    nothing.put("scene.lua", "return scene {}\n");
    assert!(read(&nothing, &[]).unwrap_err().contains("s:camera"));
}

#[test]
fn a_scene_that_is_run_as_an_experiment_is_reported() {
    let f = folder("");
    let e = lumbre_lua::load(&f.path("scene.lua")).unwrap_err();
    assert!(scene::is_scene(&e), "{e}");
    assert!(e.to_string().contains("scene = \"FILE.lua\""), "{e}");
}

#[test]
fn every_scene_of_the_project_loads_without_notes_and_is_in_the_gallery() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let page = std::fs::read_to_string(root.join("docs/gallery.md")).unwrap();
    let script = std::fs::read_to_string(root.join("scripts/scenes.lua")).unwrap();
    let mut scenes: Vec<_> = std::fs::read_dir(root.join("scenes"))
        .unwrap()
        .map(|e| e.unwrap().path())
        .collect();
    scenes.retain(|p| scene::is_lua(p));
    assert!(!scenes.is_empty());
    for file in scenes {
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(
            text.starts_with("-- "),
            "{} must begin with a comment",
            file.display()
        );
        let (desc, notes) = scene::read(&file, &BTreeMap::new(), MissingTextures::Fail)
            .unwrap_or_else(|e| panic!("{e}"));
        let (compiled, more) = compile(&desc).unwrap();
        assert!(!file.ends_with("bedroom.lua") || compiled.triangles.len() >= 200_000);
        assert!(
            notes.is_empty() && more.is_empty(),
            "{}: {notes:?} {more:?}",
            file.display()
        );
        let stem = file.file_stem().unwrap().to_str().unwrap();
        let section = page
            .split("\n## ")
            .find(|section| section.starts_with(&format!("{stem}.lua\n")))
            .unwrap_or_else(|| panic!("{stem} is not on the page"));
        let picture = section
            .split_once(&format!("![{stem}]("))
            .and_then(|(_, rest)| rest.split(')').next())
            .unwrap_or_else(|| panic!("{stem} has no picture"));
        assert!(root.join("docs").join(picture).is_file(), "{picture}");
        assert!(script.contains(&format!("  {stem} = {{")), "{stem}");
        assert!(desc.views.len() >= 2, "{stem}");
        let views = desc.views.iter().map(|(view, _)| view.as_str());
        let options = text
            .split(":option(\"")
            .skip(1)
            .filter_map(|rest| rest.split('"').next());
        for word in views.chain(options) {
            assert!(section.contains(&format!("`{word}`")), "{stem}: {word}");
        }
    }
}

#[test]
fn the_scene_in_the_documentation_loads() {
    let readme =
        std::fs::read_to_string(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/README.md")).unwrap();
    let text = readme
        .split("```lua\n")
        .nth(1)
        .and_then(|rest| rest.split("```").next())
        .unwrap();
    let f = Folder::new("");
    f.put("scene.lua", text);
    for light in ["lamp", "sky"] {
        let desc = read(&f, &[("light", light.into())]).unwrap();
        let (_, notes) = compile(&desc).unwrap();
        assert!(notes.is_empty() && desc.views.len() == 2, "{notes:?}");
    }
}
