//! Defaults of glTF, and what its extensions mean where others are absent.

use glam::{Vec3, Vec4};
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{MaterialDesc, Model, SceneDesc, Texels, TextureSlot};
use lumbre_scene_io::load::{MissingTextures, load_with};

use super::{Folder, lines, mesh_of};

/// Returns a folder with a document of one triangle with normals, texture coordinates and tangents,
/// and the image `t.png`, whose channels are 0, 128 and 255.
fn folder(node: &str, primitive: &str, rest: &str) -> Folder {
    let mut bytes = Vec::new();
    let mut push = |x: f32| bytes.extend(x.to_le_bytes());
    // Texture coordinates start at the top left: u grows to the right, and v downwards.
    for (p, uv) in [
        ([-1.0, -1.0], [0.0, 1.0]),
        ([1.0, -1.0], [1.0, 1.0]),
        ([1.0, 1.0], [1.0, 0.0]),
    ] {
        let placed = [p[0], p[1], 0.0, 0.0, 0.0, 1.0];
        let tangent = [-2.0, 0.0, 0.0, -1.0];
        placed
            .into_iter()
            .chain(uv)
            .chain(tangent)
            .for_each(&mut push);
    }
    let view = |offset: u32, ty: &str| {
        format!(
            r#"{{ "bufferView": 0, "byteOffset": {offset}, "componentType": 5126, "count": 3, "type": "{ty}" }}"#
        )
    };
    let accessors = [
        view(0, "VEC3"),
        view(12, "VEC3"),
        view(24, "VEC2"),
        view(32, "VEC4"),
    ]
    .join(", ");
    let text = format!(
        r#"{{ "asset": {{ "version": "2.0" }}, "scenes": [ {{ "nodes": [0] }} ], "nodes": [ {{ "mesh": 0{node} }} ],
"meshes": [ {{ "primitives": [ {{ "attributes": {{ "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2, "TANGENT": 3 }}{primitive} }} ] }} ],
"accessors": [ {accessors} ], "bufferViews": [ {{ "buffer": 0, "byteLength": 144, "byteStride": 48 }} ],
"buffers": [ {{ "uri": "b.bin", "byteLength": 144 }} ], "images": [ {{ "uri": "t.png" }} ]{rest} }}"#
    );
    let folder = Folder::new(&[("a.gltf", text)]);
    folder.write("b.bin", bytes);
    image::RgbImage::from_pixel(1, 1, image::Rgb([0, 128, 255]))
        .save(folder.path("t.png"))
        .unwrap();
    folder
}

/// Loads a document whose only material has this JSON.
fn read(material: &str) -> (SceneDesc, String) {
    let rest = format!(
        r#", "textures": [ {{ "source": 0 }} ], "materials": [ {{ "name": "m", {material} }} ]"#
    );
    let folder = folder("", r#", "material": 0"#, &rest);
    let (desc, notes) = folder.load("a.gltf").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

/// Returns the material of the only face, and the notes.
fn material(json: &str) -> (SceneDesc, MaterialDesc, String) {
    let (desc, notes) = read(json);
    let mesh = mesh_of(&desc, 0);
    let m = desc.materials[desc.material_index(&mesh.slots[0]).unwrap()].clone();
    (desc, m, notes)
}

/// Returns the first texel of the texture in a slot.
fn texel(m: &MaterialDesc, slot: TextureSlot) -> [f32; 4] {
    match &m.texture(slot).unwrap().texels {
        Texels::RgbaF32(t) => t[0],
        Texels::Rgba8(_) => panic!("floats expected"),
    }
}

#[test]
fn a_primitive_without_material_has_that_of_an_empty_object() {
    let rest = r#", "materials": [ { "name": "default_material" } ]"#;
    let (desc, notes) = folder("", "", rest).load("a.gltf").unwrap();
    let mesh = mesh_of(&desc, 0);
    let [empty, default] = &desc.materials[..] else {
        panic!("{:?}", desc.materials)
    };
    assert_eq!(mesh.slots[0], default.name);
    assert_ne!(empty.name, default.name);
    let renamed = MaterialDesc {
        name: empty.name.clone(),
        ..default.clone()
    };
    assert_eq!(
        (&renamed, renamed.metallic),
        (empty, 1.0),
        "{}",
        lines(&notes)
    );
}

const DIELECTRIC: &str = r#""pbrMetallicRoughness": { "metallicFactor": 0, "roughnessFactor": 0, "baseColorFactor": [0.5, 1, 1, 1] }"#;

#[test]
fn transmission_without_volume_is_a_thin_pane() {
    let whole = r#""extensions": { "KHR_materials_transmission": { "transmissionFactor": 1 } }"#;
    let (_, m, notes) = material(&format!("{DIELECTRIC}, {whole}"));
    assert_eq!(
        (m.model, m.thin, m.ior, notes.as_str()),
        (Model::Dielectric, true, 1.5, "")
    );
    // A pane is tinted by the square root.
    assert_eq!(m.base_color, Vec3::new(0.25, 1.0, 1.0));
    for volume in [r#"{}"#, r#"{ "thicknessFactor": 0 }"#] {
        let both = format!(
            r#""extensions": {{ "KHR_materials_volume": {volume}, "KHR_materials_transmission": {{ "transmissionFactor": 1 }} }}"#
        );
        assert!(
            material(&format!("{DIELECTRIC}, {both}")).1.thin,
            "{volume}"
        );
    }
    let solid = r#""extensions": { "KHR_materials_volume": { "thicknessFactor": 1 },
"KHR_materials_transmission": { "transmissionFactor": 1 } }"#;
    let (_, m, _) = material(&format!("{DIELECTRIC}, {solid}"));
    assert_eq!((m.model, m.opacity, m.thin), (Model::Disney, 0.0, false));
    let rough = r#""pbrMetallicRoughness": { "metallicFactor": 0 }"#;
    let (_, m, notes) = material(&format!("{rough}, {whole}"));
    assert!(m.thin && notes.contains("smooth thin wall"), "{notes}");
}

#[test]
fn partial_transmission_mixes_a_pane_with_an_opaque_surface() {
    let parts = |json: &str| {
        let (desc, m, _) = material(json);
        let parts: Vec<MaterialDesc> = m
            .parts
            .iter()
            .map(|name| desc.materials[desc.material_index(name).unwrap()].clone())
            .collect();
        assert_eq!((parts[0].model, parts[0].opacity), (Model::Disney, 1.0));
        assert_eq!((parts[1].model, parts[1].thin), (Model::Dielectric, true));
        compile(&desc).unwrap();
        m
    };
    let half = r#""extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5 } }"#;
    assert_eq!(parts(&format!("{DIELECTRIC}, {half}")).weights, [0.5, 0.5]);
    let metal = r#""pbrMetallicRoughness": { "metallicFactor": 0.5 }"#;
    assert_eq!(parts(&format!("{metal}, {half}")).weights, [0.75, 0.25]);
    // The red channel of the image is 0, the blue one 1.
    let textured = r#""extensions": { "KHR_materials_transmission": { "transmissionFactor": 0.5,
"transmissionTexture": { "index": 0 } } }"#;
    let m = parts(&format!("{DIELECTRIC}, {textured}"));
    assert_eq!(texel(&m, TextureSlot::Weights)[0], 0.0);
    let rough = r#""pbrMetallicRoughness": { "metallicFactor": 0.25, "metallicRoughnessTexture": { "index": 0 } }"#;
    let m = parts(&format!("{rough}, {half}"));
    assert_eq!(texel(&m, TextureSlot::Weights)[0], 0.375);
}

#[test]
fn tangents_of_the_file_are_those_of_its_normal_map() {
    let normal = r#""normalTexture": { "index": 0 }"#;
    let rest =
        format!(r#", "textures": [ {{ "source": 0 }} ], "materials": [ {{ {normal} }}, {{}} ]"#);
    for (node, expected) in [
        ("", Vec4::new(-1.0, 0.0, 0.0, -1.0)),
        (r#", "scale": [-1, 1, 1]"#, Vec4::new(1.0, 0.0, 0.0, 1.0)),
        (r#", "scale": [2, 3, 1]"#, Vec4::new(-1.0, 0.0, 0.0, -1.0)),
    ] {
        let folder = folder(node, r#", "material": 0"#, &rest);
        let (scene, _) = compile(&folder.load("a.gltf").unwrap().0).unwrap();
        assert_eq!(scene.tangents, [[expected; 3]], "{node}");
    }
    let plain = folder("", r#", "material": 1"#, &rest);
    let (desc, _) = plain.load("a.gltf").unwrap();
    let mesh = mesh_of(&desc, 0);
    assert!(mesh.tangents.is_empty());
}

#[test]
fn a_texture_whose_image_only_an_extension_gives_is_named() {
    let document = |texture: &str| {
        let rest = format!(
            r#", "textures": [ {texture} ], "materials": [ {{ "emissiveFactor": [1, 0.5, 0.25],
"pbrMetallicRoughness": {{ "baseColorTexture": {{ "index": 0 }} }} }} ]"#
        );
        folder("", r#", "material": 0"#, &rest)
    };
    for extension in ["KHR_texture_basisu", "MSFT_texture_dds"] {
        let given = format!(r#"{{ "extensions": {{ "{extension}": {{ "source": 0 }} }} }}"#);
        let folder = document(&given);
        let error = folder.load("a.gltf").unwrap_err().to_string();
        assert!(
            error.contains(extension) && error.contains("--lenient"),
            "{error}"
        );
        let (desc, notes) = load_with(&folder.path("a.gltf"), MissingTextures::Note).unwrap();
        assert!(lines(&notes).contains(extension), "{}", lines(&notes));
        assert_eq!(desc.materials[0].emission, Vec3::new(1.0, 0.5, 0.25));
        let both =
            format!(r#"{{ "source": 0, "extensions": {{ "{extension}": {{ "source": 0 }} }} }}"#);
        let (desc, _) = document(&both).load("a.gltf").unwrap();
        assert!(desc.materials[0].texture(TextureSlot::BaseColor).is_some());
    }
    let (desc, notes) = document("{}").load("a.gltf").unwrap();
    assert!(lines(&notes).contains("has no image"), "{}", lines(&notes));
    assert!(desc.materials[0].textures.is_empty());
}

#[test]
fn extensions_that_no_material_carries_and_ranges_of_lights_are_noted() {
    let used = r#", "extensionsUsed": [ "KHR_materials_variants", "KHR_materials_ior", "KHR_materials_mine", "KHR_lights_punctual" ],
"extensions": { "KHR_lights_punctual": { "lights": [ { "type": "point", "range": 4 } ] } },
"materials": [ { "name": "m", "extensions": { "KHR_materials_mine": {} } } ]"#;
    let light = r#", "extensions": { "KHR_lights_punctual": { "light": 0 } }"#;
    let (_, notes) = folder(light, r#", "material": 0"#, used)
        .load("a.gltf")
        .unwrap();
    let notes = lines(&notes);
    let of = |name: &str| notes.matches(&format!("`{name}` is not supported")).count();
    assert_eq!(of("KHR_materials_variants"), 1, "{notes}");
    assert_eq!(
        (of("KHR_materials_ior"), of("KHR_materials_mine")),
        (0, 1),
        "{notes}"
    );
    assert!(notes.contains("`range` of a light"), "{notes}");
}

#[test]
fn a_texture_of_the_colour_of_highlights_is_noted() {
    let (_, _, notes) = material(
        r#""extensions": { "KHR_materials_specular": { "specularColorTexture": { "index": 0 } } }"#,
    );
    assert!(notes.contains("`KHR_materials_specular`"), "{notes}");
}
