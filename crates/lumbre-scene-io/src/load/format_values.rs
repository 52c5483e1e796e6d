//! Values in small files of several formats, computed by hand from the formats' specifications.

use std::f32::consts::PI;
use std::path::Path;

use glam::{Vec2, Vec3};

use super::load;
use lumbre_light::scene::desc::{
    LightKind, MaterialDesc, SceneDesc, Texels, TextureDesc, TextureSlot,
};

/// Loads the first of several files in a folder of their own.
fn read(files: &[(&str, &[u8])]) -> SceneDesc {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in files {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    let (desc, _) = load(&dir.path().join(files[0].0)).unwrap_or_else(|e| panic!("{e}"));
    desc
}

/// Returns the bytes of a picture of one row, in the format that the name's extension says.
fn picture(name: &str, texels: &[[f32; 3]]) -> Vec<u8> {
    let row = image::Rgb32FImage::from_fn(texels.len() as u32, 1, |x, _| {
        image::Rgb(texels[x as usize])
    });
    let format = image::ImageFormat::from_path(Path::new(name)).unwrap();
    let row = match format {
        image::ImageFormat::Png => image::DynamicImage::from(row).into_rgb8().into(),
        _ => image::DynamicImage::from(row),
    };
    let mut bytes = std::io::Cursor::new(Vec::new());
    row.write_to(&mut bytes, format).unwrap();
    bytes.into_inner()
}

/// Returns the material with a name.
fn material<'a>(desc: &'a SceneDesc, name: &str) -> &'a MaterialDesc {
    &desc.materials[desc.material_index(name).unwrap()]
}

/// Returns the colours of the float texels of a slot.
fn floats(m: &MaterialDesc, slot: TextureSlot) -> Vec<Vec3> {
    match &m.texture(slot).unwrap().texels {
        Texels::RgbaF32(texels) => texels.iter().map(|t| Vec3::from_slice(t)).collect(),
        Texels::Rgba8(_) => panic!("floats expected"),
    }
}

const PBRT_VIEW: &str = "LookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\"\nWorldBegin\n";

/// The flux of a spot light is the integral of its intensity: over the cone in which it is constant,
/// and over the edge, in which it falls from 1 to 0 with a mean of 1/2 over the cosine.
#[test]
fn the_power_of_a_pbrt_spot_light_is_the_integral_of_its_intensity() {
    let world = "LightSource \"spot\" \"float coneangle\" 60 \"float conedeltaangle\" 60 \
                 \"float power\" 10\n";
    let desc = read(&[("a.pbrt", format!("{PBRT_VIEW}{world}").as_bytes())]);
    let [LightKind::Spot { intensity, .. }] = desc
        .lights
        .iter()
        .map(|l| l.kind.clone())
        .collect::<Vec<_>>()[..]
    else {
        panic!("a spot light expected")
    };
    // Cosines from 1/2 to 1 with a mean of 1/2: a solid angle of pi / 2.
    let expected = 10.0 / (0.5 * PI);
    assert!(
        (intensity / expected - 1.0).abs().max_element() < 1e-5,
        "{intensity}"
    );
}

/// A mix is `(1 - amount) tex1 + amount tex2`, whichever of them is an image.
#[test]
fn a_pbrt_mix_weights_its_second_texture_by_the_amount() {
    let red = picture("t.png", &[[1.0, 0.0, 0.0]]);
    let (plain, image) = (Vec3::new(0.2, 0.4, 0.8), Vec3::X);
    for (textures, expected) in [
        (
            "\"rgb tex1\" [0.2 0.4 0.8] \"texture tex2\" \"i\"",
            0.75 * plain + 0.25 * image,
        ),
        (
            "\"texture tex1\" \"i\" \"rgb tex2\" [0.2 0.4 0.8]",
            0.75 * image + 0.25 * plain,
        ),
    ] {
        let world = format!(
            "{PBRT_VIEW}Texture \"i\" \"spectrum\" \"imagemap\" \"string filename\" \"t.png\"\n\
             Texture \"m\" \"spectrum\" \"mix\" {textures} \"float amount\" 0.25\n\
             Material \"diffuse\" \"texture reflectance\" \"m\"\nShape \"sphere\"\n"
        );
        let desc = read(&[("a.pbrt", world.as_bytes()), ("t.png", &red)]);
        let name = desc.entities[0].material.clone().unwrap();
        let [texel] = floats(material(&desc, &name), TextureSlot::BaseColor)[..] else {
            panic!("one texel expected")
        };
        assert!(
            (texel - expected).abs().max_element() < 1e-6,
            "{textures}: {texel}"
        );
    }
}

/// Returns a scene of Mitsuba with a sensor and some XML.
fn mitsuba(sensor: &str, inner: &str) -> String {
    format!(
        "<scene version=\"0.6.0\"><sensor type=\"perspective\">{sensor}<film type=\"hdrfilm\">\
         <integer name=\"width\" value=\"40\"/><integer name=\"height\" value=\"30\"/></film>\
         </sensor>{inner}</scene>"
    )
}

/// The sides of a picture of 40 x 30 pixels and its diagonal are 4, 3 and 5 units long.
#[test]
fn each_axis_of_a_mitsuba_field_of_view_has_its_length() {
    for (axis, half_height) in [
        ("x", 0.75f32),
        ("y", 1.0),
        ("diagonal", 0.6),
        ("smaller", 1.0),
        ("larger", 0.75),
    ] {
        let sensor = format!(
            "<float name=\"fov\" value=\"90\"/><string name=\"fovAxis\" value=\"{axis}\"/>"
        );
        let desc = read(&[("a.xml", mitsuba(&sensor, "").as_bytes())]);
        let expected = 2.0 * half_height.atan().to_degrees();
        let found = desc.camera.view_deg();
        assert!(
            (found - expected).abs() < 1e-3,
            "{axis}: {found}, expected {expected}"
        );
    }
}

/// `gamma` decodes 8-bit texels; floats are linear already.
#[test]
fn the_gamma_of_a_mitsuba_bitmap_decodes_bytes_alone() {
    for (file, texel, decoded) in [
        ("t.png", [0.6, 0.2, 1.0], [0.36, 0.04, 1.0]),
        ("t.hdr", [4.0, 1.0, 0.25], [4.0, 1.0, 0.25]),
    ] {
        let xml = mitsuba(
            "",
            &format!(
                "<shape type=\"rectangle\"><bsdf type=\"diffuse\" id=\"s\">\
                 <texture type=\"bitmap\" name=\"reflectance\">\
                 <string name=\"filename\" value=\"{file}\"/>\
                 <float name=\"gamma\" value=\"2\"/></texture></bsdf></shape>"
            ),
        );
        let desc = read(&[("a.xml", xml.as_bytes()), (file, &picture(file, &[texel]))]);
        let [found] = floats(material(&desc, "s"), TextureSlot::BaseColor)[..] else {
            panic!("one texel expected")
        };
        let off = (found - Vec3::from(decoded)).abs().max_element();
        assert!(off < 1e-6, "{file}: {found}, expected {decoded:?}");
    }
}

/// KHR_materials_transmission: the transmitted share is the factor times the red channel. Solid
/// glass has it as what its opacity leaves, a thin wall as the weight of a pane.
#[test]
fn the_transmission_of_gltf_is_the_factor_times_the_texture() {
    let volume = r#", "KHR_materials_volume": { "thicknessFactor": 1 }"#;
    for (extension, slot, expected) in [
        (volume, TextureSlot::Opacity, [0.5, 1.0, 0.7]),
        ("", TextureSlot::Weights, [0.5, 0.0, 0.3]),
    ] {
        let text = format!(
            r#"{{ "asset": {{ "version": "2.0" }}, "scene": 0, "scenes": [ {{ "nodes": [0] }} ],
"nodes": [ {{ "mesh": 0 }} ], "meshes": [ {{ "primitives": [
  {{ "attributes": {{ "POSITION": 0, "TEXCOORD_0": 1 }}, "material": 0 }} ] }} ],
"materials": [ {{ "name": "pane", "pbrMetallicRoughness": {{ "metallicFactor": 0 }},
  "extensions": {{ "KHR_materials_transmission": {{ "transmissionFactor": 0.5,
    "transmissionTexture": {{ "index": 0 }} }}{extension} }} }} ],
"textures": [ {{ "source": 0 }} ], "images": [ {{ "uri": "t.png" }} ],
"accessors": [ {{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" }},
  {{ "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC2" }} ],
"bufferViews": [ {{ "buffer": 0, "byteOffset": 0, "byteLength": 36 }} ],
"buffers": [ {{ "uri": "b.bin", "byteLength": 36 }} ] }}"#
        );
        let corners = [0.0f32, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
        let reds = [1.0, 0.0, 0.6].map(|red| [red, 1.0 - red, 0.0]);
        let desc = read(&[
            ("a.gltf", text.as_bytes()),
            ("b.bin", &corners.map(f32::to_le_bytes).concat()),
            ("t.png", &picture("t.png", &reds)),
        ]);
        let found: Vec<f32> = floats(material(&desc, "pane"), slot)
            .iter()
            .map(|t| t.x)
            .collect();
        for (found_at, expected_at) in found.iter().zip(expected) {
            assert!((found_at - expected_at).abs() < 1e-6, "{slot:?}: {found:?}");
        }
    }
}

/// Loads a square with the material `m` of these statements.
fn with_mtl(statements: &str) -> SceneDesc {
    let obj = "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl m\nf 1 2 3\n";
    let mtl = format!("newmtl m\n{statements}\n");
    read(&[
        ("a.obj", obj.as_bytes()),
        ("m.mtl", mtl.as_bytes()),
        ("t.png", &picture("t.png", &[[1.0; 3]])),
    ])
}

/// `d` is the statement of the format, `Tr` one of other programs: if both are given, `d` counts.
#[test]
fn the_dissolve_of_an_mtl_precedes_its_transparency() {
    let mask = |value| TextureDesc::grey(value).content_hash;
    for (statements, expected) in [
        ("d 0.25", 0.25),
        ("Tr 0.25", 0.75),
        ("d 0.25\nTr 0.5", 0.25),
        ("Tr 0.5\nd 0.25", 0.25),
    ] {
        let desc = with_mtl(statements);
        let found = material(&desc, "m")
            .texture(TextureSlot::Mask)
            .unwrap()
            .content_hash;
        assert_eq!(found, mask(expected), "{statements}");
    }
}

/// The second and third number of `-o` are optional, and 0 by default.
#[test]
fn an_offset_of_one_number_moves_an_mtl_map_along_u_alone() {
    for (options, expected) in [
        ("-o 0.25", Vec2::new(0.25, 0.0)),
        ("-o 0.25 0.5", Vec2::new(0.25, 0.5)),
    ] {
        let desc = with_mtl(&format!("map_Kd {options} t.png"));
        assert_eq!(material(&desc, "m").uv_offset, expected, "{options}");
    }
}
