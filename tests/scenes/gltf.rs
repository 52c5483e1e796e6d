//! glTF: a small document of our own with every kind of accessor, and the assets of others where they are.

use glam::{Vec2, Vec3};
use lumbre::scene::compile;
use lumbre::scene::desc::{LightKind, MaskMode, SceneDesc, ShapeDesc, Texels, TextureSlot};
use lumbre::scene::load::load;
use proptest::prelude::*;

use super::samples::{GLTF as TEXT, gltf_as_glb, gltf_buffer as buffer};
use super::{Folder, lines};

fn folder() -> Folder {
    let folder = Folder::new(&[("a.gltf", TEXT)]);
    folder.write("b.bin", buffer());
    image::RgbaImage::from_pixel(2, 2, image::Rgba([255, 128, 51, 64])).save(folder.path("a t.png")).unwrap();
    folder
}

fn check(desc: &SceneDesc, notes: &str) {
    assert_eq!(desc.entities.len(), 2);
    let (ShapeDesc::Mesh(a), ShapeDesc::Mesh(b)) = (&desc.entities[0].shape, &desc.entities[1].shape) else { panic!() };
    assert!(std::sync::Arc::ptr_eq(a, b), "nodes share their mesh");
    assert_eq!(a.positions, [Vec3::ZERO, Vec3::X, Vec3::Y * 2.0], "interleaved and sparse");
    assert_eq!(a.uvs, [Vec2::new(0.0, 1.0), Vec2::new(1.0, 1.0), Vec2::new(0.0, 0.8)], "quantised, from the bottom");
    let (scene, _) = compile(desc).unwrap();
    assert_eq!(scene.triangles[0][1], Vec3::new(3.0, 0.0, 0.0), "scale, then the parent's translation");
    assert!((scene.triangles[1][1] - Vec3::ZERO).length() < 1e-6, "half a turn about y: {}", scene.triangles[1][1]);
    assert_eq!((desc.camera.position, desc.camera.target), (Vec3::Z * 5.0, Vec3::Z * 4.0));
    assert!((desc.camera.fov_deg - 0.7f32.to_degrees()).abs() < 1e-4);
    let lamp = LightKind::Point { position: Vec3::Y * 7.0, intensity: Vec3::new(4.0, 2.0, 0.0) };
    assert_eq!(desc.lights[0].kind, lamp);
    let m = &desc.materials[0];
    assert_eq!((m.name.as_str(), m.ior, m.opacity, m.emission), ("skin", 1.8, 0.25, Vec3::X * 3.0));
    assert_eq!((m.mask_mode, m.mask_threshold, m.base_color), (MaskMode::Threshold, 0.25, Vec3::splat(0.5)));
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
fn every_part_of_a_document_arrives() {
    let (desc, notes) = folder().load("a.gltf").unwrap();
    check(&desc, &lines(&notes));
}

#[test]
fn a_binary_file_says_the_same() {
    let folder = folder();
    let bytes = gltf_as_glb();
    folder.write("b.glb", &bytes);
    let (desc, notes) = folder.load("b.glb").unwrap();
    check(&desc, &lines(&notes));
    for cut in 0..bytes.len() {
        folder.write("b.glb", &bytes[..cut]);
        assert!(folder.load("b.glb").is_err(), "half a file is an error: {cut}");
    }
}

#[test]
fn faults_name_what_is_wrong() {
    let folder = folder();
    for (from, to, expected) in [
        ("\"2.0\"", "\"1.0\"", "asset.version"),
        ("\"nodes\": [0, 3, 4]", "\"nodes\": [0, 9]", "index below 5 of `nodes`"),
        ("\"children\": [1, 2]", "\"children\": [0]", "circle"),
        ("\"count\": 3, \"type\": \"VEC2\"", "\"count\": 4000000000, \"type\": \"VEC2\"", "accessors[2]"),
        ("\"count\": 3, \"type\": \"VEC2\"", "\"count\": 18446744073709551615, \"type\": \"VEC2\"", "accessors[2]"),
        ("\"byteOffset\": 72", "\"byteOffset\": 7200", "bufferViews[1]"),
        ("\"componentType\": 5121", "\"componentType\": 1", "component type"),
        ("\"type\": \"SCALAR\"", "\"type\": \"MAT4\"", "accessors[3]"),
        ("b.bin", "../../etc/none", "buffers[0]"),
        ("a%20t.png", "none.png", "images[0]"),
        ("\"mesh\": 0, \"scale\"", "\"mesh\": -1, \"scale\"", "meshes"),
        ("\"translation\": [1, 0, 0]", "\"translation\": [1e999, 0, 0]", "a.gltf"),
    ] {
        folder.write("a.gltf", TEXT.replacen(from, to, 1));
        let e = folder.load("a.gltf").unwrap_err().to_string();
        assert!(e.contains(expected) && e.contains("a.gltf"), "{to}: {e}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 256, ..ProptestConfig::default() })]

    #[test]
    fn changed_numbers_and_bytes_are_survived(at in 0usize..TEXT.len(), to in "[0-9eE.\\-\\[\\]{},:\" ]", byte in 0usize..104) {
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
fn the_assets_of_others_load() {
    let Some(root) = super::third_party::shared("scenes/gltf") else { return };
    let mut files = Vec::new();
    for extension in ["gltf", "glb"] {
        super::third_party::files_below(&root, extension, &mut files);
    }
    assert!(files.len() >= 7, "{files:?}");
    for file in files {
        let (desc, _) = load(&file).unwrap_or_else(|e| panic!("{e}"));
        let (scene, _) = compile(&desc).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
        assert!(!scene.triangles.is_empty(), "{}", file.display());
        assert!(scene.environment.is_some() || !scene.emitters.is_empty(), "{} is dark", file.display());
    }
}
