//! Textures from files to slots: by `.scn`, by `.mtl`, by edits, and missing files.

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{
    Lookup, MATERIAL_PARAMS, MaskMode, MaterialDesc, SceneDesc, Texels, TextureSlot, Wrap,
};
use lumbre_light::value::Value;
use lumbre_scene_io::edit::set;
use lumbre_scene_io::load::{MissingTextures, load_with};

use super::{Folder, QUAD, lines};

/// Returns a folder with a texture of one texel, different for every slot, named after the slot.
fn folder(files: &[(&str, &str)]) -> Folder {
    let folder = Folder::new(files);
    for (i, slot) in TextureSlot::ALL.into_iter().enumerate() {
        let texel = image::Rgb([10 * i as u8 + 5, 100, 200]);
        image::RgbImage::from_pixel(1, 1, texel)
            .save(folder.path(&format!("{}.png", slot.name())))
            .unwrap();
    }
    folder
}

/// Returns the red channel of the texture in a slot, as stored.
fn stored(m: &MaterialDesc, slot: TextureSlot) -> Option<u8> {
    m.texture(slot).map(|t| match &t.texels {
        Texels::Rgba8(texels) => texels[0][0],
        Texels::RgbaF32(_) => panic!("eight bits expected"),
    })
}

fn assert_all_slots_are_filled(m: &MaterialDesc) {
    for (i, slot) in TextureSlot::ALL.into_iter().enumerate() {
        assert_eq!(stored(m, slot), Some(10 * i as u8 + 5), "{slot:?}");
    }
}

#[test]
fn every_slot_has_a_key_in_scn() {
    let keys = MATERIAL_PARAMS
        .iter()
        .filter_map(|row| Some((row.scn_texture_key, row.texture?)));
    let texts: Vec<String> = keys
        .map(|(key, slot)| format!("\"{key}\": \"{}.png\"", slot.name()))
        .collect();
    let text = format!(
        "{{ \"materials\": [ {{ \"name\": \"m\", {} }} ] }}",
        texts.join(", ")
    );
    let (desc, notes) = folder(&[("a.scn", &text)]).load("a.scn").unwrap();
    assert!(notes.is_empty(), "{}", lines(&notes));
    assert_all_slots_are_filled(&desc.materials[0]);
}

#[test]
fn every_slot_can_be_set_by_path_and_emptied() {
    let folder = folder(&[(
        "a.scn",
        r#"{ "materials": [ { "name": "m" }, { "name": "n" } ] }"#,
    )]);
    let mut desc = folder.load("a.scn").unwrap().0;
    let untouched = desc.clone();
    let paths = TextureSlot::ALL.map(|slot| format!("materials.m.{}", slot.name()));
    for (path, slot) in paths.iter().zip(TextureSlot::ALL) {
        let file = folder.path(&format!("{}.png", slot.name()));
        set(
            &mut desc,
            path,
            &Value::Str(file.to_string_lossy().into_owned()),
        )
        .unwrap();
    }
    assert_all_slots_are_filled(&desc.materials[0]);
    assert!(desc.materials[1].textures.is_empty());
    for path in &paths {
        set(&mut desc, path, &"".into()).unwrap();
    }
    assert_eq!(desc, untouched);
    let e = set(&mut desc, "materials.m.normal_texture", &"gone.png".into())
        .unwrap_err()
        .to_string();
    assert!(
        e.contains("materials.m.normal_texture") && e.contains("gone.png"),
        "{e}"
    );
    let e = set(&mut desc, "materials.m.normal_textur", &"gone.png".into())
        .unwrap_err()
        .to_string();
    assert!(e.contains("did you mean `normal_texture`?"), "{e}");
    assert!(set(&mut desc, "materials.m.mask_texture", &Value::Int(1)).is_err());
    assert_eq!(desc, untouched);
}

#[test]
fn a_missing_texture_is_an_error_that_names_material_and_file_or_a_note() {
    let text = r#"{ "materials": [ { "name": "oak", "roughness": 0.25, "roughnesstexture": "gone.png" } ],
        "entities": [ { "type": "sphere", "radius": 1, "material": "oak" } ] }"#;
    let folder = Folder::new(&[("a.scn", text)]);
    let e = folder.load("a.scn").unwrap_err().to_string();
    for part in [
        "a.scn: materials[0].roughnesstexture",
        "material `oak`",
        "gone.png",
        "(pass `--lenient` to use the material's constant value instead)",
    ] {
        assert!(e.contains(part), "{part} in {e}");
    }
    let e = obj("newmtl a\nmap_Kd gone.png\n")
        .load("m.obj")
        .unwrap_err()
        .to_string();
    assert!(
        e.contains("m.mtl: line 2: texture of the material `a`") && e.contains("`--lenient`"),
        "{e}"
    );
    let (desc, notes) = load_with(&folder.path("a.scn"), MissingTextures::Note).unwrap();
    let all = lines(&notes);
    for part in [
        "materials[0].roughnesstexture: ",
        "material `oak`",
        "gone.png",
        "the material's constant value is used",
    ] {
        assert!(all.contains(part), "{part} in {all}");
    }
    assert_eq!(
        (
            desc.materials[0].roughness,
            desc.materials[0].textures.len()
        ),
        (0.25, 0)
    );
    assert!(compile(&desc).is_ok());
    // A damaged file counts as missing; a mesh or an environment cannot be left out.
    folder.write("gone.png", b"\x89PNG\r\n\x1a\n");
    assert!(
        folder
            .load("a.scn")
            .unwrap_err()
            .to_string()
            .contains("material `oak`")
    );
    assert_eq!(
        load_with(&folder.path("a.scn"), MissingTextures::Note)
            .unwrap()
            .1
            .len(),
        1
    );
    for text in [
        r#"{ "entities": [ { "type": "mesh", "file": "gone.obj" } ] }"#,
        r#"{ "environment": { "file": "g.hdr" } }"#,
    ] {
        folder.write("b.scn", text);
        assert!(
            load_with(&folder.path("b.scn"), MissingTextures::Note).is_err(),
            "{text}"
        );
    }
}

fn obj(mtl: &str) -> Folder {
    let text = format!("mtllib m.mtl\nusemtl a\n{QUAD}usemtl b\nf 1//1 2//1 3//1\n");
    folder(&[("m.obj", &text), ("m.mtl", mtl)])
}

fn materials(mtl: &str) -> (SceneDesc, String) {
    let (desc, notes) = obj(mtl).load("m.obj").unwrap();
    (desc, lines(&notes))
}

#[test]
fn mtl_materials_are_read_by_name() {
    let (desc, notes) = materials(
        "# two\nnewmtl b\nKd 0.1 0.2 0.3\nKe 5\nNi 1.33\nd 0.25\nPr 0.5\nPm 0.75\nPs 0.1\nPc 0.2\nPcr 0.25\naniso 0.3\nillum 2\n\
         newmtl a\n\tKa 1 1 1\n\tKs 1 1 1\n\tNs 6\n\tillum 7\n\tmap_Kd -s 2 2 2 -o 0.5 0.25 base_color_texture.png\n\
         \tmap_Ke emission_texture.png\nmap_d mask_texture.png\nmap_Pr roughness_texture.png\nmap_Pm metallic_texture.png\n\
         norm normal_texture.png\n",
    );
    assert!(notes.is_empty(), "{notes}");
    let [a, b] = &desc.materials[..] else {
        panic!("{:?}", desc.materials)
    };
    assert_eq!((a.name.as_str(), b.name.as_str()), ("a", "b"));
    assert_eq!(
        (b.base_color, b.emission),
        (Vec3::new(0.1, 0.2, 0.3), Vec3::splat(5.0))
    );
    assert_eq!(
        (b.ior, b.opacity, b.roughness, b.metallic, b.sheen),
        (1.33, 1.0, 0.5, 0.75, 0.1)
    );
    assert_eq!(
        (b.clearcoat, b.clearcoat_gloss, b.anisotropic),
        (0.2, 0.75, 0.3)
    );
    assert_eq!(
        (a.opacity, a.tiling, a.uv_offset, a.emission),
        (0.0, 2.0, Vec2::new(0.5, 0.25), Vec3::ONE)
    );
    // An exponent of 6 is an alpha of one half.
    assert!(
        (a.roughness - 0.5f32.sqrt()).abs() < 1e-6,
        "{}",
        a.roughness
    );
    assert!(a.emitter_reflects && b.emitter_reflects);
    let filled = TextureSlot::ALL
        .into_iter()
        .filter(|slot| a.texture(*slot).is_some())
        .count();
    assert_eq!((filled, stored(a, TextureSlot::Normal)), (6, Some(75)));
    let coverage = |m: &MaterialDesc| match &m.texture(TextureSlot::Mask).unwrap().texels {
        Texels::RgbaF32(texels) => texels[0][0],
        Texels::Rgba8(_) => panic!("floats expected"),
    };
    // The luminance of the map, whose texel is (25, 100, 200), and `d`.
    let luminance = (0.2126 * 25.0 + 0.7152 * 100.0 + 0.0722 * 200.0) / 255.0;
    assert!((coverage(a) - luminance).abs() < 1e-5, "{}", coverage(a));
    assert_eq!((coverage(b), b.mask_mode), (0.25, MaskMode::Blend));
    assert!(compile(&desc).is_ok());
}

#[test]
fn bump_maps_of_an_mtl_are_heights_or_normals_by_their_colours() {
    let folder = obj(
        "newmtl a\nmap_bump -bm 0.25 heights.png\nnewmtl b\nbump -bm 2 normals.png\nmap_bump -bm 2 normals.png\n\
                      newmtl c\nbump heights.png\n",
    );
    image::GrayImage::from_pixel(2, 2, image::Luma([90]))
        .save(folder.path("heights.png"))
        .unwrap();
    image::RgbImage::from_pixel(2, 2, image::Rgb([120, 140, 250]))
        .save(folder.path("normals.png"))
        .unwrap();
    let (desc, notes) = folder.load("m.obj").unwrap();
    let of = |name: &str| &desc.materials[desc.material_index(name).unwrap()];
    let (a, b) = (of("a"), of("b"));
    assert_eq!(
        (
            a.bump_height,
            stored(a, TextureSlot::Bump),
            stored(a, TextureSlot::Normal)
        ),
        (0.25, Some(90), None)
    );
    assert_eq!(
        (
            b.normal_strength,
            stored(b, TextureSlot::Normal),
            stored(b, TextureSlot::Bump)
        ),
        (2.0, Some(120), None)
    );
    let notes = lines(&notes);
    assert_eq!(
        notes
            .matches("the bump map of `b` contains normals")
            .count(),
        1,
        "{notes}"
    );
    assert!(
        notes.contains("the bump map of `c` has no `-bm`, so its height is 1 scene unit")
            && !notes.contains("bump map of `a`"),
        "{notes}"
    );
}

#[test]
fn maps_of_an_mtl_follow_their_own_options() {
    let (desc, notes) = materials(
        "newmtl a\nmap_Kd -s 2 2 1 -o 0.5 0 base_color_texture.png\nmap_Pr -s 1 3 -o 0 0.25 -clamp on roughness_texture.png\n\
         norm -clamp off normal_texture.png\nnewmtl b\nmap_Kd -s 4 1 1 base_color_texture.png\nmap_Pm -s 0 0 metallic_texture.png\n",
    );
    assert_eq!(notes, "");
    let [a, b] = &desc.materials[..] else {
        panic!("{:?}", desc.materials)
    };
    assert_eq!(
        (a.tiling, a.uv_offset, b.tiling),
        (2.0, Vec2::new(0.5, 0.0), 1.0)
    );
    assert_eq!(a.lookup(TextureSlot::Roughness).wrap, [Wrap::Clamp; 2]);
    assert_eq!(a.lookup(TextureSlot::BaseColor), Lookup::default());
    let place = |m: &MaterialDesc, slot, uv: Vec2| {
        let uv = uv * m.tiling + m.uv_offset;
        m.lookup(slot)
            .map
            .map_or(uv, |map| map.transform_point2(uv))
    };
    for uv in [Vec2::ZERO, Vec2::new(0.3, -1.7), Vec2::ONE] {
        for (m, slot, expected) in [
            (
                a,
                TextureSlot::Roughness,
                uv * Vec2::new(1.0, 3.0) + Vec2::new(0.0, 0.25),
            ),
            (a, TextureSlot::Normal, uv),
            (b, TextureSlot::BaseColor, uv * Vec2::new(4.0, 1.0)),
            (b, TextureSlot::Metallic, Vec2::ZERO),
        ] {
            assert!(
                (place(m, slot, uv) - expected).length() < 1e-6,
                "{slot:?} {uv}"
            );
        }
    }
    let (_, notes) = materials(
        "newmtl a\nmap_Kd -s 0 0 base_color_texture.png\nmap_Pm metallic_texture.png\nnewmtl b\n",
    );
    assert!(
        notes.contains("line 3: the map of the material's first texture is not invertible"),
        "{notes}"
    );
}

#[test]
fn unsupported_mtl_statements_are_noted_and_invalid_ones_are_errors() {
    let (desc, notes) = materials(
        "newmtl a\ndisp -bm 0.5 h.png\ndisp h.png\nNi 0.001\nKd 2 0 0\nmap_Kd -s 1 2 1 -clamp on base_color_texture.png\n",
    );
    for part in [
        "line 2: statements `disp` are not supported",
        "line 4: 0.001 of `Ni` is outside 0.01 to 100; 0.01 is used",
        "line 5: 2 of `Kd` is outside 0 to 1",
        "usemtl: no material file has `b`",
    ] {
        assert!(notes.contains(part), "{part} in\n{notes}");
    }
    assert_eq!(notes.lines().count(), 4, "{notes}");
    assert_eq!(desc.materials[0].base_color, Vec3::X);
    assert_eq!(desc.materials[0].ior, 0.01);
    assert_eq!(desc.materials[1], MaterialDesc::new("b"));
    for (mtl, problem) in [
        (
            "Kd 1 1 1\n",
            "line 1: this line precedes the first `newmtl`",
        ),
        ("newmtl a\nKd 1 1\n", "line 2: expected 3 numbers"),
        ("newmtl a\nNi nan\n", "line 2: NaN"),
        ("newmtl a\nNs high\n", "line 2: `high` is not a number"),
        (
            "newmtl a\nmap_Kd gone.png\n",
            "line 2: texture of the material `a`: cannot read",
        ),
    ] {
        let e = obj(mtl).load("m.obj").unwrap_err().to_string();
        assert!(
            e.contains("m.mtl") && e.contains(problem),
            "{problem} in {e}"
        );
    }
    let folder = obj("newmtl a\nKd 0.5 0.5 0.5\nmap_Kd gone.png\n");
    let (desc, notes) = load_with(&folder.path("m.obj"), MissingTextures::Note).unwrap();
    assert!(lines(&notes).contains("material `a`") && desc.materials[0].textures.is_empty());
}
