//! Delays and composed materials in scene files and scripts.

use std::fs;

use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{DelayKind, SceneDesc, TextureSlot};
use lumbre_lua::scene;
use lumbre_scene_io::load;
use lumbre_scene_io::load::MissingTextures;

/// The material of thesis S2, figure B.3, inside a further delay, and the objects that use it.
const XML: &str = r#"<scene version="3.0.0">
  <sensor type="perspective"><float name="fov" value="40"/>
    <transform name="to_world"><lookat origin="0,0,4" target="0,0,0" up="0,1,0"/></transform>
    <film type="hdrfilm"><integer name="width" value="8"/><integer name="height" value="8"/></film></sensor>
  <bsdf type="Composed" id="Chlorophyll">
    <float name="weight" value="0.3"/>
    <bsdf type="Separable" id="bsdf-1">
      <bsdf type="diffuse"><rgb name="reflectance" value="0.1, 0.8, 0.1"/></bsdf>
      <TemporalProfile type="ConstantTP" name="tp"><float name="delay" value="0"/></TemporalProfile>
    </bsdf>
    <bsdf type="Separable" id="bsdf-2">
      <bsdf type="diffuse"><rgb name="reflectance" value="0.9, 0.1, 0.1"/></bsdf>
      <TemporalProfile type="ConstantTP" name="tp"><float name="delay" value="3"/></TemporalProfile>
    </bsdf>
  </bsdf>
  <bsdf type="twosided" id="late"><bsdf type="Separable">
    <ref id="Chlorophyll"/>
    <TemporalProfile type="PosEpanTP" name="tp"><float name="mean" value="2"/><float name="sigma" value="0.5"/></TemporalProfile>
  </bsdf></bsdf>
  <shape type="sphere"><ref id="late"/></shape>
  <shape type="sphere"><point name="center" x="3" y="0" z="0"/><bsdf type="diffuse"/>
    <emitter type="area"><rgb name="radiance" value="5,5,5"/></emitter></shape>
</scene>"#;

#[test]
fn mitsuba_files_define_delays_and_composed_materials_as_in_the_thesis() {
    let folder = tempfile::tempdir().unwrap();
    let read = |text: &str| {
        let file = folder.path().join("scene.xml");
        fs::write(&file, text).unwrap();
        load::load(&file)
    };
    let (desc, notes) = read(XML).unwrap();
    let unexpected: Vec<String> = notes
        .iter()
        .map(ToString::to_string)
        .filter(|n| !n.contains("both sides"))
        .collect();
    assert!(unexpected.is_empty(), "{unexpected:?}");
    let of = |name: &str| desc.materials.iter().find(|m| m.name == name).unwrap();
    let whole = of("Chlorophyll");
    assert_eq!(whole.parts, ["bsdf-1", "bsdf-2"]);
    assert!(whole.weights == [0.3, 0.7] && of("bsdf-2").delay.constant == [3.0, 0.0]);
    assert_eq!(of("bsdf-1").delay.kind, DelayKind::Constant);
    let late = of("late");
    assert_eq!(
        (late.delay.kind, late.delay.mean, late.delay.width),
        (DelayKind::Epanechnikov, [2.0, 0.0], [0.5, 0.0])
    );
    assert_eq!(
        (late.parts.as_slice(), late.weights.as_slice()),
        (["Chlorophyll".to_owned()].as_slice(), [1.0].as_slice())
    );
    let (scene, _) = compile(&desc).unwrap();
    let row = desc.material_index("late").unwrap() as u32;
    let parts = scene.delays.components(row);
    assert!(parts.len() == 2 && parts.iter().all(|p| scene.delays.profiles(p).len() == 2));

    for (from, to, expected) in [
        (
            "ConstantTP\" name=\"tp\"><float name=\"delay\" value=\"3\"",
            "SlowTP\" name=\"tp\"><float name=\"delay\" value=\"3\"",
            "ConstantTP",
        ),
        ("name=\"mean\"", "name=\"middle\"", "needs `mean`"),
    ] {
        let error = read(&XML.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
    let (wrong, _) = read(&XML.replace(
        "name=\"sigma\" value=\"0.5\"",
        "name=\"sigma\" value=\"2.5\"",
    ))
    .unwrap();
    let error = compile(&wrong).unwrap_err().to_string();
    assert!(
        error.contains("materials.late.delay_mean") && error.contains("below the width"),
        "{error}"
    );
}

/// Returns a Lua scene of a ball with the material `m`, which `body` defines.
fn lua(body: &str) -> Result<SceneDesc, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("scene.lua");
    let head = "local s = scene { resolution = { 8, 8 } }\n\
        s:camera { position = { 0, 0, 4 }, target = { 0, 0, 0 }, fov = 40 }\n";
    let ball = r#"s:add { name = "ball", shape = shape.sphere { radius = 1 }, material = "m" }"#;
    fs::write(&file, format!("{head}{body}\n{ball}\nreturn s\n")).unwrap();
    scene::read(&file, &Default::default(), MissingTextures::Fail)
        .map(|(desc, _)| desc)
        .map_err(|e| e.to_string())
}

#[test]
fn lua_scenes_define_delays_and_composed_materials_by_keys() {
    let desc = lua(r#"
        local ramp = texture.paint { size = { 4, 4 }, color = function(u) return u end }
        s:material("a", { delay = "exponential", delay_rate = 3, delay_rate_texture = ramp, delay_rate_offset = 0.5 })
        s:material("b", { delay = "table", delay_table = { 0, 1, 2, 0 } })
        s:material("m", { parts = { "a", "b" }, weights = { 0.25, 0.75 } })"#)
    .unwrap();
    let (scene, _) = compile(&desc).unwrap();
    let row = desc.material_index("m").unwrap() as u32;
    let [a, b] = [0, 1].map(|i| &scene.delays.profiles(&scene.delays.components(row)[i])[0]);
    assert_eq!(
        (a.kind, a.params[0].value, a.params[0].offset),
        (DelayKind::Exponential, 3.0, 0.5)
    );
    let texture = desc.materials[0].texture(TextureSlot::DelayRate).unwrap();
    assert_eq!(texture.width, 4);
    // Texels of data are not decoded: u of the last column is 7/8.
    let texel = scene.textures[a.params[0].texture as usize].texels.at(3)[0];
    assert!((texel - 0.875).abs() < 3e-3, "{texel}");
    assert!((b.table.as_ref().unwrap().mean() - 2.0 / 3.0).abs() < 1e-6);
    // Without an offset the rate is zero where the texture is black.
    let black = lua(r#"
        local half = texture.paint { size = { 2, 1 }, color = function(u) return u > 0.5 and 1 or 0 end }
        s:material("m", { delay = "exponential", delay_rate = 3, delay_rate_texture = half })"#);
    let error = compile(&black.unwrap()).unwrap_err().to_string();
    assert!(
        error.contains("materials.m.delay_rate") && error.contains("positive"),
        "{error}"
    );
    let error = lua(r#"s:material("m", { delay = "slow" })"#).unwrap_err();
    assert!(
        error.contains("slow") && error.contains("exponential"),
        "{error}"
    );
}
