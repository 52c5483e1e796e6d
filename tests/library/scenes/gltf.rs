//! Small glTF documents with every kind of accessor, and third-party assets if they are present.

use glam::{Affine2, Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{
    LightKind, Lookup, MaskMode, Model, SceneDesc, Texels, TextureFilter, TextureSlot, Wrap,
};
use lumbre_scene_io::load::{MissingTextures, Variables, load_on_stage};
use lumbre_scene_io::stage::Stage;
use proptest::prelude::*;

use super::samples::{GLTF as TEXT, gltf_as_glb, gltf_buffer as buffer};
use super::{Folder, lines, mesh_of};

fn folder() -> Folder {
    let folder = Folder::new(&[("a.gltf", TEXT)]);
    folder.write("b.bin", buffer());
    image::RgbaImage::from_pixel(2, 2, image::Rgba([255, 128, 51, 64]))
        .save(folder.path("a t.png"))
        .unwrap();
    folder
}

/// Panics unless the scene is that of the sample document.
fn check(desc: &SceneDesc, notes: &str) {
    assert_eq!(desc.entities.len(), 2);
    let (a, b) = (mesh_of(desc, 0), mesh_of(desc, 1));
    assert!(
        std::sync::Arc::ptr_eq(a, b),
        "the nodes do not share their mesh"
    );
    assert_eq!(
        a.positions,
        [Vec3::ZERO, Vec3::X, Vec3::Y * 2.0],
        "positions, interleaved and sparse"
    );
    assert_eq!(
        a.uvs,
        [
            Vec2::new(0.0, 1.0),
            Vec2::new(1.0, 1.0),
            Vec2::new(0.0, 0.8)
        ],
        "quantised coordinates, v from the bottom"
    );
    let (scene, _) = compile(desc).unwrap();
    assert_eq!(
        scene.triangles[0][1],
        Vec3::new(3.0, 0.0, 0.0),
        "scale of the node, then translation of its parent"
    );
    assert!(
        (scene.triangles[1][1] - Vec3::ZERO).length() < 1e-6,
        "rotation by 180 degrees about y: {}",
        scene.triangles[1][1]
    );
    assert_eq!(
        (desc.camera.position, desc.camera.target),
        (Vec3::Z * 5.0, Vec3::Z * 4.0)
    );
    assert!((desc.camera.view_deg() - 0.7f32.to_degrees()).abs() < 1e-4);
    let lamp = LightKind::Point {
        position: Vec3::Y * 7.0,
        intensity: Vec3::new(4.0, 2.0, 0.0),
    };
    assert_eq!(desc.lights[0].kind, lamp);
    let m = &desc.materials[0];
    assert_eq!(
        (m.name.as_str(), m.ior, m.opacity, m.emission),
        ("skin", 1.8, 0.25, Vec3::X * 3.0)
    );
    assert_eq!(
        (m.mask_mode, m.mask_threshold, m.base_color),
        (MaskMode::Threshold, 0.25, Vec3::splat(0.5))
    );
    let red = |slot| match &m.texture(slot).unwrap().texels {
        Texels::RgbaF32(t) => t[0][0],
        Texels::Rgba8(t) => f32::from(t[0][0]) / 255.0,
    };
    let near = |slot, x: f32| assert!((red(slot) - x).abs() < 1e-6, "{slot:?}: {}", red(slot));
    near(TextureSlot::Mask, 64.0 / 255.0 * 0.5);
    near(TextureSlot::Roughness, 128.0 / 255.0 * 0.5);
    near(TextureSlot::Metallic, 0.2);
    near(TextureSlot::BaseColor, 1.0);
    assert!(notes.contains("KHR_materials_iridescence"), "{notes}");
}

#[test]
fn every_element_of_a_document_is_read() {
    let (desc, notes) = folder().load("a.gltf").unwrap();
    check(&desc, &lines(&notes));
}

/// Uses two triangles of one mesh: one with 16-bit colours with alpha, not interleaved, whose
/// material has its textures on the second set of coordinates, and one without.
#[test]
fn vertex_colours_and_a_second_set_of_coordinates_are_read() {
    let mut bytes = Vec::new();
    for p in [[0.0f32, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]] {
        p.iter().for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    // At 36: colours of 8 bytes each, padded to 12; at 72 two sets of coordinates, interleaved.
    for c in [
        [65_535u16, 0, 0, 65_535],
        [0, 13_107, 0, 65_535],
        [0, 0, 65_535, 32_767],
    ] {
        c.iter()
            .chain(&[7, 7])
            .for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    for [u, v] in [[0.0f32, 0.0], [1.0, 0.0], [0.0, 1.0]] {
        [u, v, 0.5 * u + 0.25, 0.5 * v]
            .iter()
            .for_each(|x| bytes.extend(x.to_le_bytes()));
    }
    let text = r#"{ "asset": { "version": "2.0" }, "scenes": [ { "nodes": [0] } ], "nodes": [ { "mesh": 0 } ],
"meshes": [ { "primitives": [
  { "attributes": { "POSITION": 0, "COLOR_0": 1, "TEXCOORD_0": 2, "TEXCOORD_1": 3 }, "material": 0 },
  { "attributes": { "POSITION": 0, "TEXCOORD_0": 2 }, "material": 1 } ] } ],
"materials": [ { "name": "second", "pbrMetallicRoughness": { "baseColorTexture": { "index": 0, "texCoord": 0,
    "extensions": { "KHR_texture_transform": { "texCoord": 1, "offset": [0.5, 0] } } } },
    "normalTexture": { "index": 0, "texCoord": 0 }, "extensions": { "KHR_materials_volume": { "thicknessFactor": 1 } } },
  { "name": "first" } ],
"textures": [ { "source": 0 } ], "images": [ { "uri": "t.png" } ],
"accessors": [ { "bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3" },
  { "bufferView": 1, "componentType": 5123, "normalized": true, "count": 3, "type": "VEC4" },
  { "bufferView": 2, "componentType": 5126, "count": 3, "type": "VEC2" },
  { "bufferView": 2, "byteOffset": 8, "componentType": 5126, "count": 3, "type": "VEC2" } ],
"bufferViews": [ { "buffer": 0, "byteLength": 36 }, { "buffer": 0, "byteOffset": 36, "byteLength": 36, "byteStride": 12 },
  { "buffer": 0, "byteOffset": 72, "byteLength": 48, "byteStride": 16 } ],
"buffers": [ { "uri": "b.bin", "byteLength": 120 } ] }"#;
    let folder = Folder::new(&[("a.gltf", text)]);
    folder.write("b.bin", &bytes);
    image::RgbImage::from_pixel(1, 1, image::Rgb([128, 128, 255]))
        .save(folder.path("t.png"))
        .unwrap();
    let (desc, notes) = folder.load("a.gltf").unwrap();
    let mesh = mesh_of(&desc, 0);
    let (green, white) = (Vec3::Y * 0.2, Vec3::ONE);
    assert_eq!(
        mesh.colors,
        [Vec3::X, green, Vec3::Z, white, white, white],
        "colours are linear, and white for a primitive without any"
    );
    // The normal map determines the first set; textures on another set have their own transform.
    // All are flipped.
    let first = [Vec2::Y, Vec2::ONE, Vec2::ZERO];
    assert_eq!(mesh.uvs, [first, first].concat());
    assert_eq!(
        mesh.second_uvs[..3],
        [
            Vec2::new(0.25, 1.0),
            Vec2::new(0.75, 1.0),
            Vec2::new(0.25, 0.5)
        ]
    );
    assert_eq!(
        mesh.second_uvs[3..],
        first,
        "a primitive without a second set repeats the first"
    );
    let m = &desc.materials[desc.material_index("second").unwrap()];
    let moved = Lookup {
        second: true,
        map: Some(Affine2::from_translation(Vec2::X * 0.5)),
        ..Lookup::default()
    };
    assert_eq!(
        (
            m.lookup(TextureSlot::Normal),
            m.lookup(TextureSlot::BaseColor)
        ),
        (Lookup::default(), moved)
    );
    let notes = lines(&notes);
    for expected in [
        "COLOR_0: the alpha of vertex colours",
        "`KHR_materials_volume` is not supported",
    ] {
        assert!(notes.contains(expected), "{expected}: {notes}");
    }
    assert!(!notes.contains("Texture"), "{notes}");
    let (scene, _) = compile(&desc).unwrap();
    let row = &scene.materials[scene.attributes[0].material as usize];
    let place = |texture: u32| {
        scene.textures[texture as usize].image_uv(scene.uv_at(0, [0.5, 0.25]), row.tiling)
    };
    assert_eq!(place(row.normal_texture), Vec2::new(0.5, 0.75));
    assert_eq!(
        place(row.base_color_texture),
        Vec2::new(0.5 + 0.5 * 0.5 + 0.25, 1.0 - 0.5 * 0.25)
    );
    assert_eq!(scene.tint_at(0, [0.5, 0.25]), Vec3::new(0.25, 0.1, 0.25));
    for (from, to) in [
        ("\"COLOR_0\": 1", "\"COLOR_0\": 2"),
        ("\"COLOR_0\": 1", "\"COLOR_0\": 9"),
    ] {
        folder.write("a.gltf", text.replacen(from, to, 1));
        assert!(
            folder
                .load("a.gltf")
                .unwrap_err()
                .to_string()
                .contains("COLOR_0")
                || to.ends_with('2')
        );
    }
}

/// Returns the sample document with another list of materials and of textures.
fn with_materials(materials: &str) -> String {
    let (start, end) = (
        TEXT.find("\"materials\"").unwrap(),
        TEXT.find("\"images\"").unwrap(),
    );
    format!("{}{materials}{}", &TEXT[..start], &TEXT[end..])
}

#[test]
fn diffuse_transmission_makes_a_material_translucent() {
    let folder = folder();
    let leaf = r#""materials": [ { "name": "leaf", "pbrMetallicRoughness": { "baseColorFactor": [0.8, 0.4, 0.2, 1] },
"extensions": { "KHR_materials_diffuse_transmission": { "diffuseTransmissionFactor": 0.25,
  "diffuseTransmissionColorFactor": [0.4, 0.8, 0.2], "diffuseTransmissionColorTexture": { "index": 0 } } } } ],
"textures": [ { "source": 0 } ],"#;
    folder.write("a.gltf", with_materials(leaf));
    let (desc, notes) = folder.load("a.gltf").unwrap();
    let m = &desc.materials[0];
    assert_eq!(m.model, Model::Translucent);
    let (reflects, transmits) = (Vec3::new(0.6, 0.3, 0.15), Vec3::new(0.1, 0.2, 0.05));
    assert!(
        (m.base_color - reflects).length() < 1e-6,
        "{}",
        m.base_color
    );
    assert!(
        (m.transmittance - transmits).length() < 1e-6,
        "{}",
        m.transmittance
    );
    assert!(m.texture(TextureSlot::Transmittance).is_some());
    assert!(lines(&notes).contains("4 % of the light"), "{notes:?}");
}

/// Compares the texture transforms of one material with the formulas of the format on the file's
/// own numbers.
#[test]
fn textures_follow_their_own_transform_and_sampler() {
    let folder = folder();
    let lies = |offset: [f32; 2], rotation: f32, scale: [f32; 2]| {
        format!(
            "\"extensions\": {{ \"KHR_texture_transform\": {{ \"offset\": {offset:?}, \"rotation\": {rotation:?}, \"scale\": {scale:?} }} }}"
        )
    };
    let places = [
        ([0.25, 0.5], 0.4, [2.0, 3.0]),
        ([-0.5, 0.125], -1.1, [0.5, 1.5]),
        ([0.0, 0.0], 0.0, [1.0, 1.0]),
    ];
    let [base, rough, emissive] =
        places.map(|(offset, rotation, scale)| lies(offset, rotation, scale));
    let materials = format!(
        "\"materials\": [ {{ \"name\": \"skin\", \"emissiveFactor\": [1, 1, 1], \"emissiveTexture\": {{ \"index\": 2, {emissive} }},
\"pbrMetallicRoughness\": {{ \"baseColorTexture\": {{ \"index\": 0, {base} }}, \"metallicRoughnessTexture\": {{ \"index\": 1, {rough} }} }} }} ],
\"textures\": [ {{ \"source\": 0, \"sampler\": 0 }}, {{ \"source\": 0, \"sampler\": 1 }}, {{ \"source\": 0 }} ],
\"samplers\": [ {{ \"wrapS\": 33071, \"wrapT\": 33648 }}, {{ \"wrapT\": 33071, \"magFilter\": 9728 }} ],"
    );
    let text = with_materials(&materials);
    folder.write("a.gltf", &text);
    let (desc, notes) = folder.load("a.gltf").unwrap();
    let m = &desc.materials[0];
    let wraps = [
        TextureSlot::BaseColor,
        TextureSlot::Metallic,
        TextureSlot::Emission,
    ]
    .map(|slot| m.lookup(slot).wrap);
    assert_eq!(
        wraps,
        [
            [Wrap::Clamp, Wrap::Mirror],
            [Wrap::Repeat, Wrap::Clamp],
            [Wrap::Repeat; 2]
        ]
    );
    let filters = [TextureSlot::BaseColor, TextureSlot::Metallic].map(|slot| m.lookup(slot).filter);
    assert_eq!(filters, [TextureFilter::Bilinear, TextureFilter::Nearest]);
    let notes = lines(&notes);
    assert!(!notes.contains("KHR_texture"), "{notes}");
    let (scene, _) = compile(&desc).unwrap();
    let row = &scene.materials[scene.attributes[0].material as usize];
    let textures = [
        row.base_color_texture,
        row.roughness_texture,
        row.emission_texture,
    ];
    // The quantised coordinates of the file at a point; the formula of the extension gives their
    // expected value.
    let at = Vec2::new(0.5, 0.25 * 0.2);
    for (texture, (offset, rotation, scale)) in textures.into_iter().zip(places) {
        let scaled = at * Vec2::from(scale);
        let (sin, cos) = f32::sin_cos(rotation);
        let turned = Vec2::new(
            cos * scaled.x + sin * scaled.y,
            cos * scaled.y - sin * scaled.x,
        ) + Vec2::from(offset);
        let found =
            scene.textures[texture as usize].image_uv(scene.uv_at(0, [0.5, 0.25]), row.tiling);
        assert!(
            (found - Vec2::new(turned.x, 1.0 - turned.y)).length() < 1e-5,
            "{found} instead of {turned}"
        );
    }
    folder.write(
        "a.gltf",
        text.replace("\"scale\": [2.0, 3.0]", "\"scale\": [0.0, 0.0]"),
    );
    assert!(
        lines(&folder.load("a.gltf").unwrap().1)
            .contains("other textures of the material cannot be mapped differently")
    );
    let third = text
        .replace("\"index\": 1,", "\"index\": 1, \"texCoord\": 1,")
        .replace("\"index\": 2,", "\"index\": 2, \"texCoord\": 2,");
    folder.write("a.gltf", third);
    assert!(
        lines(&folder.load("a.gltf").unwrap().1)
            .contains("emissiveTexture: textures of a material can use at most two")
    );
}

#[test]
fn a_binary_file_gives_the_same_scene_and_every_truncation_is_an_error() {
    let folder = folder();
    let bytes = gltf_as_glb();
    folder.write("b.glb", &bytes);
    let (desc, notes) = folder.load("b.glb").unwrap();
    check(&desc, &lines(&notes));
    for cut in 0..bytes.len() {
        folder.write("b.glb", &bytes[..cut]);
        assert!(
            folder.load("b.glb").is_err(),
            "a file cut at byte {cut} must be an error"
        );
    }
}

#[test]
fn documents_without_lights_or_constant_emitters_get_a_studio() {
    let folder = folder();
    let dark = TEXT.replace(
        r#""extensions": { "KHR_lights_punctual": { "light": 0 } } }"#,
        r#""extras": {} }"#,
    );
    for (text, unlit) in [
        (dark.clone(), false),
        (
            dark.replace(
                "\"alphaMode\"",
                "\"emissiveTexture\": { \"index\": 0 }, \"alphaMode\"",
            ),
            true,
        ),
        (dark.replace("\"emissiveFactor\": [1, 0, 0],", ""), true),
        (TEXT.replace("\"emissiveFactor\": [1, 0, 0],", ""), false),
    ] {
        folder.write("a.gltf", text);
        let file = folder.path("a.gltf");
        let (desc, notes) =
            load_on_stage(&file, MissingTextures::Fail, None, &Variables::new()).unwrap();
        let is_noted = lines(&notes).contains("it stands in a studio");
        assert_eq!((desc.environment.is_some(), is_noted), (unlit, unlit));
        let bare = load_on_stage(
            &file,
            MissingTextures::Fail,
            Some(Stage::Bare),
            &Variables::new(),
        )
        .unwrap();
        assert!(bare.0.environment.is_none() && !lines(&bare.1).contains("studio"));
    }
}

#[test]
fn unsupported_extensions_are_noted_and_refused_if_they_are_required() {
    let folder = folder();
    let asset = "\"asset\": {";
    assert!(TEXT.contains(asset));
    let with = |lists: &str| {
        folder.write(
            "a.gltf",
            TEXT.replacen(asset, &format!("{lists}, {asset}"), 1),
        );
        folder.load("a.gltf")
    };
    let used = "\"extensionsUsed\": [\"KHR_lights_punctual\", \"KHR_texture_basisu\", \"KHR_materials_volume\"]";
    let notes = lines(&with(used).unwrap().1);
    let of_use: Vec<&str> = notes
        .lines()
        .filter(|note| note.contains("extensionsUsed"))
        .collect();
    assert!(
        matches!(of_use[..], [one] if one.ends_with("the extension `KHR_texture_basisu` is not supported")),
        "{notes}"
    );
    let e = with(&used.replace("Used", "Required"))
        .unwrap_err()
        .to_string();
    assert!(
        e.contains(
            "a.gltf: extensionsRequired: the extension `KHR_texture_basisu` is not supported"
        ),
        "{e}"
    );
    assert!(
        with("\"extensionsRequired\": [\"KHR_texture_transform\", \"KHR_materials_volume\", 7]")
            .is_ok()
    );
}

#[test]
fn errors_name_the_invalid_element() {
    let folder = folder();
    for (from, to, expected) in [
        ("\"2.0\"", "\"1.0\"", "asset.version"),
        (
            "\"nodes\": [0, 3, 4]",
            "\"nodes\": [0, 9]",
            "index below 5 of `nodes`",
        ),
        ("\"children\": [1, 2]", "\"children\": [0]", "cycle"),
        (
            "\"count\": 3, \"type\": \"VEC2\"",
            "\"count\": 4000000000, \"type\": \"VEC2\"",
            "accessors[2]",
        ),
        (
            "\"count\": 3, \"type\": \"VEC2\"",
            "\"count\": 18446744073709551615, \"type\": \"VEC2\"",
            "accessors[2]",
        ),
        (
            "\"byteOffset\": 72",
            "\"byteOffset\": 7200",
            "bufferViews[1]",
        ),
        (
            "\"componentType\": 5121",
            "\"componentType\": 1",
            "component type",
        ),
        ("\"type\": \"SCALAR\"", "\"type\": \"MAT4\"", "accessors[3]"),
        ("b.bin", "../../etc/none", "buffers[0]"),
        ("a%20t.png", "none.png", "images[0]"),
        ("a%20t.png", "none.png", "`--lenient`"),
        (
            "\"mesh\": 0, \"scale\"",
            "\"mesh\": -1, \"scale\"",
            "meshes",
        ),
        (
            "\"translation\": [1, 0, 0]",
            "\"translation\": [1e999, 0, 0]",
            "a.gltf",
        ),
    ] {
        folder.write("a.gltf", TEXT.replacen(from, to, 1));
        let e = folder.load("a.gltf").unwrap_err().to_string();
        assert!(e.contains(expected) && e.contains("a.gltf"), "{to}: {e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn no_changed_character_or_byte_panics(at in 0usize..TEXT.len(), to in "[0-9eE.\\-\\[\\]{},:\" ]", byte in 0usize..104) {
        let folder = folder();
        let mut text = TEXT.to_owned();
        text.replace_range(at..=at, &to);
        folder.write("a.gltf", text);
        let mut bytes = buffer();
        bytes[byte] ^= 0x80;
        folder.write("b.bin", bytes);
        if let Ok((desc, _)) = folder.load("a.gltf") {
            let _ = compile(&desc);
        }
    }
}

#[test]
fn third_party_assets_load_and_have_light() {
    let Some(root) = super::third_party::shared("scenes/gltf") else {
        return;
    };
    let mut files = Vec::new();
    for extension in ["gltf", "glb"] {
        files.extend(super::third_party::files_below(&root, extension));
    }
    assert!(files.len() >= 7, "{files:?}");
    for file in files {
        let loaded = load_on_stage(&file, MissingTextures::Fail, None, &Variables::new());
        let (desc, _) = loaded.unwrap_or_else(|e| panic!("{e}"));
        let (scene, _) = compile(&desc).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(!scene.triangles.is_empty(), "{}", file.display());
        assert!(
            scene.environment.is_some() || !scene.emitters.is_empty(),
            "{} has no light",
            file.display()
        );
    }
}
