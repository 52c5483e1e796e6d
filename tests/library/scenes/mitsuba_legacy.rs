//! Forms of Mitsuba 0.6, and values that Mitsuba 3 changes.

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::compile::Wrap;
use lumbre_light::scene::desc::{SceneDesc, ShapeDesc, Texels, TextureSlot};

use super::{Folder, lines};

/// Loads a scene of a version beside the image `grey.png` of 128 / 255.
fn read(version: &str, inner: &str) -> (SceneDesc, String) {
    let sensor = r#"<sensor type="perspective"><transform name="toWorld">
<lookAt origin="0, 1, 5" target="0, 1, 0" up="0, 1, 0"/></transform></sensor>"#;
    let text = format!("<scene version=\"{version}\">{sensor}{inner}</scene>");
    let folder = Folder::new(&[("a.xml", &text)]);
    let grey = image::GrayImage::from_pixel(2, 2, image::Luma([128]));
    grey.save(folder.path("grey.png")).unwrap();
    let (desc, notes) = folder.load("a.xml").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

/// Loads a rectangle with a texture in its surface.
fn textured(texture: &str) -> (SceneDesc, String) {
    let surface = format!(r#"<bsdf type="diffuse">{texture}</bsdf>"#);
    read(
        "0.6.0",
        &format!(r#"<shape type="rectangle">{surface}</shape>"#),
    )
}

#[test]
fn look_at_is_written_in_three_ways() {
    let (desc, _) = read("0.6.0", "");
    assert_eq!(desc.camera.position, Vec3::new(0.0, 1.0, 5.0));
    assert!((desc.camera.target - desc.camera.position).distance(Vec3::NEG_Z) < 1e-6);
}

#[test]
fn gamma_of_a_bitmap_is_its_decoding() {
    for (gamma, expected) in [("1", 128.0 / 255.0), ("2.2", (128.0f32 / 255.0).powf(2.2))] {
        let (desc, notes) = textured(&format!(
            r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<float name="gamma" value="{gamma}"/></texture>"#
        ));
        let texture = desc.materials[0].texture(TextureSlot::BaseColor).unwrap();
        let Texels::RgbaF32(texels) = &texture.texels else {
            panic!("linear floats expected")
        };
        assert!(
            (texels[0][0] - expected).abs() < 1e-6,
            "{gamma}: {}",
            texels[0][0]
        );
        assert!(!notes.contains("gamma"), "{notes}");
    }
    let (desc, _) = textured(
        r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<float name="gamma" value="-1"/></texture>"#,
    );
    let texture = desc.materials[0].texture(TextureSlot::BaseColor).unwrap();
    assert!(matches!(texture.texels, Texels::Rgba8(_)));
}

#[test]
fn factors_and_offsets_of_texture_coordinates_are_a_transform() {
    let texture = |inner: &str| {
        let (desc, notes) = textured(&format!(
            r#"<texture type="checkerboard" name="reflectance">{inner}</texture>"#
        ));
        assert!(!notes.contains("not supported"), "{notes}");
        let (scene, _) = compile(&desc).unwrap();
        let m = scene.materials[0];
        let map = scene.textures[m.base_color_texture as usize].lookup.map;
        let at = |uv: Vec2| {
            let own = uv * m.tiling.scale + m.tiling.offset;
            map.map_or(own, |map| map.transform_point2(own))
        };
        [Vec2::ZERO, Vec2::ONE, Vec2::new(0.25, 0.5)].map(at)
    };
    let old = r#"<float name="uscale" value="4"/><float name="vscale" value="2"/>
<float name="uoffset" value="0.25"/><float name="voffset" value="0.125"/>"#;
    let new = r#"<transform name="to_uv"><scale x="4" y="2"/><translate x="0.25" y="0.125"/></transform>"#;
    for (old, new) in texture(old).into_iter().zip(texture(new)) {
        assert!(old.distance(new) < 1e-6, "{old} {new}");
    }
    let [a, b, _] = texture(r#"<float name="uscale" value="4"/><float name="vscale" value="4"/>"#);
    assert!((b - a).distance(Vec2::splat(4.0)) < 1e-6, "{a} {b}");
}

#[test]
fn wrap_modes_of_single_coordinates_are_read() {
    let (desc, notes) = textured(
        r#"<texture type="bitmap" name="reflectance"><string name="filename" value="grey.png"/>
<string name="wrapModeU" value="mirror"/><string name="wrapModeV" value="clamp"/></texture>"#,
    );
    let lookup = desc.materials[0].lookup(TextureSlot::BaseColor);
    assert_eq!(lookup.wrap, [Wrap::Mirror, Wrap::Clamp], "{notes}");
}

#[test]
fn a_number_of_an_emitter_is_daylight_in_version_0_6() {
    let light = r#"<shape type="rectangle"><emitter type="area"><spectrum name="radiance" value="2"/></emitter></shape>"#;
    let emission = |version: &str| {
        let (desc, _) = read(version, light);
        let emissive = desc.materials.iter().map(|m| m.emission);
        emissive.fold(Vec3::ZERO, Vec3::max)
    };
    assert_eq!(emission("0.6.0"), Vec3::splat(2.0));
    let equal_energy = Vec3::new(1.2048, 0.9483, 0.9089) * 2.0;
    assert!(emission("3.0.0").distance(equal_energy) < 1e-3);
}

#[test]
fn srgb_colours_are_decoded() {
    let (desc, _) = read(
        "0.6.0",
        r##"<bsdf type="diffuse" id="a"><srgb name="reflectance" value="0.5"/></bsdf>
<bsdf type="diffuse" id="b"><srgb name="reflectance" value="#ff0000"/></bsdf>"##,
    );
    assert!(
        (desc.materials[0].base_color - 0.214_041)
            .abs()
            .max_element()
            < 1e-5
    );
    assert_eq!(desc.materials[1].base_color, Vec3::X);
}

#[test]
fn an_alpha_of_zero_is_raised() {
    let roughness = |alpha: &str| {
        let surface = format!(
            r#"<bsdf type="roughconductor" id="a"><float name="alpha" value="{alpha}"/></bsdf>"#
        );
        read("3.0.0", &surface).0.materials[0].roughness
    };
    assert_eq!(roughness("0"), roughness("1e-4"));
    assert!((roughness("0") - 0.01).abs() < 1e-6);
}

#[test]
fn a_mirrored_sphere_is_inside_out() {
    let fronts = |steps: &str| {
        let shape = format!(
            r#"<shape type="sphere"><transform name="to_world">{steps}</transform></shape>"#
        );
        let (desc, _) = read("3.0.0", &shape);
        match &desc.entities[0].shape {
            ShapeDesc::Sphere { .. } => 1.0,
            ShapeDesc::Mesh(_) => {
                let (scene, _) = compile(&desc).unwrap();
                let outward = |[a, b, c]: &[Vec3; 3]| (*b - *a).cross(*c - *a).dot(*a).signum();
                let sum: f32 = scene.triangles.iter().map(outward).sum();
                sum / scene.triangles.len() as f32
            }
        }
    };
    assert_eq!(fronts(r#"<scale value="2"/>"#), 1.0);
    assert_eq!(fronts(r#"<scale x="-1" y="1" z="1"/>"#), -1.0);
    assert_eq!(fronts(r#"<scale value="-1"/>"#), -1.0);
    assert_eq!(fronts(r#"<scale x="-1" y="-1" z="1"/>"#), 1.0);
}
