//! Materials of glTF in other models: unlit, and of diffuse and specular colours; pictures in WebP.

use glam::Vec3;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{MaskMode, MaterialDesc, Texels, TextureDesc, TextureSlot};
use lumbre_scene_io::load::{MissingTextures, Variables, load_on_stage};

use super::gltf_motion::Builder;
use super::{Folder, lines};

/// Picture of 2 x 1 texels, (200, 100, 50, 128) and (20, 20, 20, 255), written by libwebp.
const WEBP: &[u8] = &[
    82, 73, 70, 70, 34, 0, 0, 0, 87, 69, 66, 80, 86, 80, 56, 76, 22, 0, 0, 0, 47, 1, 0, 0, 16, 15,
    112, 10, 168, 83, 208, 158, 194, 227, 129, 255, 129, 135, 140, 232, 127, 0,
];

/// Returns a document of a triangle with a material. `rest` are further properties.
fn folder(material: &str, rest: &str) -> Folder {
    let mut b = Builder::default();
    let mesh = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let folder = b.folder(&format!(
        r#""nodes": [ {{ "mesh": 0 }} ], "materials": [ {{ "name": "m", {material} }} ],
"meshes": [ {{ "primitives": [ {{ "material": 0, "attributes": {{ "POSITION": {mesh}, "COLOR_0": {mesh} }} }} ] }} ],
"textures": [ {{ "source": 0 }}, {{ "source": 1 }}, {{ "source": 1, "extensions": {{ "EXT_texture_webp": {{ "source": 2 }} }} }} ],
"images": [ {{ "uri": "diffuse.png" }}, {{ "uri": "gloss.png" }}, {{ "uri": "w.webp" }} ]{rest}"#
    ));
    let image = |name: &str, texels: &[[u8; 4]]| {
        let bytes = texels.as_flattened().to_vec();
        let image = image::RgbaImage::from_raw(texels.len() as u32, 1, bytes).unwrap();
        image.save(folder.path(name)).unwrap();
    };
    image("diffuse.png", &[[200, 100, 50, 128], [20, 20, 20, 255]]);
    image("gloss.png", &[[180, 120, 60, 51]]);
    folder.write("w.webp", WEBP);
    folder
}

/// Returns the material of a document with it, and the notes.
fn read(material: &str) -> (MaterialDesc, String) {
    let (desc, notes) = folder(material, "").load("a.gltf").unwrap();
    compile(&desc).unwrap();
    (desc.materials[0].clone(), lines(&notes))
}

/// Returns the texels of a float image.
fn floats(image: Option<&std::sync::Arc<TextureDesc>>) -> Vec<[f32; 4]> {
    match image.map(|image| &image.texels) {
        Some(Texels::RgbaF32(texels)) => texels.clone(),
        other => panic!("floats expected, not {other:?}"),
    }
}

fn assert_close(found: &[f32], expected: &[f32]) {
    let far = found
        .iter()
        .zip(expected)
        .any(|(f, e)| (f - e).abs() > 2e-5);
    assert!(
        !far && found.len() == expected.len(),
        "{found:?} instead of {expected:?}"
    );
}

fn specular_glossiness(properties: &str) -> String {
    format!(r#""extensions": {{ "KHR_materials_pbrSpecularGlossiness": {{ {properties} }} }}"#)
}

/// Expected values are those of Khronos' `three.pbrUtilities.js` in double precision.
#[test]
fn diffuse_and_specular_colours_become_base_colour_and_metallic() {
    for (properties, expected) in [
        (
            r#""diffuseFactor": [0.5, 0.25, 0.125, 1], "specularFactor": [0.02, 0.02, 0.02], "glossinessFactor": 0.75"#,
            [0.510_416_7, 0.255_208_3, 0.127_604_2, 0.0, 0.25],
        ),
        (
            r#""diffuseFactor": [0.1, 0.1, 0.05, 1], "specularFactor": [0.9, 0.6, 0.3], "glossinessFactor": 0.25"#,
            [0.907_128_4, 0.611_457, 0.305_444_1, 0.985_571_4, 0.75],
        ),
        (
            r#""diffuseFactor": [0.4, 0.3, 0.2, 1], "specularFactor": [0.3, 0.3, 0.3]"#,
            [0.603_381_3, 0.490_826, 0.378_270_8, 0.543_614_4, 0.0],
        ),
    ] {
        let (m, notes) = read(&specular_glossiness(properties));
        let [r, g, b] = m.base_color.to_array();
        assert_close(&[r, g, b, m.metallic, m.roughness], &expected);
        assert!(!notes.contains("SpecularGlossiness"), "{notes}");
    }
}

#[test]
fn textures_of_diffuse_and_specular_colours_are_converted_per_texel() {
    let factors = r#""diffuseFactor": [0.5, 0.5, 0.5, 0.5], "specularFactor": [1, 0.5, 1], "glossinessFactor": 0.5,"#;
    let both = format!(
        r#"{factors} "diffuseTexture": {{ "index": 0 }}, "specularGlossinessTexture": {{ "index": 1 }}"#
    );
    let (m, notes) = read(&format!(
        r#""alphaMode": "BLEND", {}"#,
        specular_glossiness(&both)
    ));
    let base = floats(m.texture(TextureSlot::BaseColor));
    assert_close(
        &base[0],
        &[0.606_222_6, 0.122_631_4, 0.040_500_7, 128.0 / 255.0],
    );
    assert_close(&base[1], &[0.456_604_9, 0.096_846, 0.048_490_3, 1.0]);
    assert_eq!((m.base_color, m.mask_mode), (Vec3::ONE, MaskMode::Blend));
    assert_close(
        &floats(m.texture(TextureSlot::Mask))[0][..1],
        &[64.0 / 255.0],
    );
    // The picture of glossiness has one texel, and so has that of metallic.
    let first = |slot| floats(m.texture(slot))[0][0];
    assert_close(
        &[first(TextureSlot::Roughness), first(TextureSlot::Metallic)],
        &[0.9, 0.726_912_9],
    );
    assert!(!notes.contains("mapped differently"), "{notes}");
    // A texture of one kind alone, the other factor constant.
    let (m, _) = read(&specular_glossiness(&format!(
        r#"{factors} "specularGlossinessTexture": {{ "index": 1 }}"#
    )));
    assert_close(
        &floats(m.texture(TextureSlot::BaseColor))[0],
        &[0.611_304_8, 0.445_57, 0.423_293_3, 1.0],
    );
    assert_close(
        &floats(m.texture(TextureSlot::Metallic))[0][..1],
        &[0.457_198_6],
    );
    let moved = both.replacen(
        r#""index": 0"#,
        r#""index": 0, "extensions": { "KHR_texture_transform": { "offset": [0.5, 0] } }"#,
        1,
    );
    let (m, notes) = read(&specular_glossiness(&moved));
    assert!(notes.contains("mapped differently"), "{notes}");
    let base = floats(m.texture(TextureSlot::BaseColor));
    assert_close(
        &base[0],
        &[0.606_222_6, 0.122_631_4, 0.040_500_7, 128.0 / 255.0],
    );
}

#[test]
fn an_unlit_surface_emits_its_base_colour_and_reflects_nothing() {
    let material = r#""emissiveFactor": [1, 1, 1], "alphaMode": "MASK", "pbrMetallicRoughness": { "baseColorFactor": [0.5, 0.25, 1, 0.5]TEXTURE },
"extensions": { "KHR_materials_unlit": {}, "KHR_materials_transmission": { "transmissionFactor": 1 } }"#;
    for texture in ["", r#", "baseColorTexture": { "index": 0 }"#] {
        let folder = folder(
            &material.replace("TEXTURE", texture),
            r#", "extensionsRequired": ["KHR_materials_unlit"]"#,
        );
        let file = folder.path("a.gltf");
        let (desc, notes) =
            load_on_stage(&file, MissingTextures::Fail, None, &Variables::new()).unwrap();
        let notes = lines(&notes);
        for expected in [
            "unlit surface emits",
            "vertex colours of an unlit",
            "stands in a studio",
        ] {
            assert!(notes.contains(expected), "{expected}: {notes}");
        }
        let m = &desc.materials[0];
        assert_eq!(
            (m.emission, m.emitter_reflects, m.opacity),
            (Vec3::new(0.5, 0.25, 1.0), false, 1.0)
        );
        assert!(m.texture(TextureSlot::Emission).is_some());
        let opaque = if texture.is_empty() {
            0.5
        } else {
            64.0 / 255.0
        };
        assert_close(&floats(m.texture(TextureSlot::Mask))[0][..1], &[opaque]);
        let compiled = &compile(&desc).unwrap().0.materials[0];
        assert!(!compiled.emitter_reflects);
    }
    let (m, _) = read(&material.replace("[0.5, 0.25, 1, 0.5]TEXTURE", "[0, 0, 0, 1]"));
    assert!(m.emission.max_element() < 1e-5 && m.emission != Vec3::ZERO && !m.emitter_reflects);
}

#[test]
fn a_picture_in_webp_is_read_instead_of_its_substitute() {
    let (m, notes) = read(r#""pbrMetallicRoughness": { "baseColorTexture": { "index": 2 } }"#);
    let Texels::Rgba8(texels) = &m.texture(TextureSlot::BaseColor).unwrap().texels else {
        panic!("eight bits expected")
    };
    assert_eq!(texels[..], [[200, 100, 50, 128], [20, 20, 20, 255]]);
    assert!(!notes.contains("webp"), "{notes}");
}
