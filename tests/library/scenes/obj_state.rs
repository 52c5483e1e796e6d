//! Statements of OBJ and MTL whose effect lasts: materials, material files, smoothing groups; and
//! coverage.

use glam::Vec3;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{MaskMode, MaterialDesc, SceneDesc, Texels, TextureSlot};

use super::{Folder, lines, mesh_of};

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

/// Loads `m.obj`, the text, beside material files and the image `grey.png` of 51 / 255, whose left
/// half is transparent in `alpha.png`.
fn load(obj: &str, libraries: &[(&str, &str)]) -> (SceneDesc, String) {
    let folder = Folder::new(libraries);
    folder.write("m.obj", obj);
    let grey = image::GrayImage::from_pixel(2, 1, image::Luma([51]));
    grey.save(folder.path("grey.png")).unwrap();
    let alpha = image::RgbaImage::from_fn(2, 1, |x, _| image::Rgba([255, 0, 0, 255 * x as u8]));
    alpha.save(folder.path("alpha.png")).unwrap();
    let (desc, notes) = folder.load("m.obj").unwrap_or_else(|e| panic!("{e}"));
    (desc, lines(&notes))
}

/// Returns the material `m` of an MTL.
fn material(mtl: &str) -> (MaterialDesc, String) {
    let obj = format!("mtllib a.mtl\n{CORNERS}usemtl m\nf 1 2 3\n");
    let (desc, notes) = load(&obj, &[("a.mtl", mtl)]);
    (desc.materials[0].clone(), notes)
}

/// Returns the mean of a material's mask, which is blended.
fn coverage(m: &MaterialDesc) -> f32 {
    assert_eq!(m.mask_mode, MaskMode::Blend);
    let texels: Vec<f32> = match &m.texture(TextureSlot::Mask).unwrap().texels {
        Texels::Rgba8(t) => t.iter().map(|t| f32::from(t[0]) / 255.0).collect(),
        Texels::RgbaF32(t) => t.iter().map(|t| t[0]).collect(),
    };
    texels.iter().sum::<f32>() / texels.len() as f32
}

#[test]
fn a_material_stays_until_the_next_usemtl() {
    let mtl = "newmtl wood\nKe 1 0.5 0.25\nnewmtl tin\n";
    let obj = format!(
        "mtllib a.mtl\n{CORNERS}usemtl wood\ng left\nf 1 2 3\ng right\nf 1 3 4\no next\nf 1 2 4\n\
         usemtl tin\nf 2 3 4\n"
    );
    let (desc, notes) = load(&obj, &[("a.mtl", mtl)]);
    assert_eq!(mesh_of(&desc, 0).slots, ["wood", "tin"]);
    assert_eq!(mesh_of(&desc, 0).triangle_slot, [0, 0, 0, 1]);
    assert_eq!(desc.materials[0].emission, Vec3::new(1.0, 0.5, 0.25));
    assert_eq!(notes, "");
}

#[test]
fn one_statement_names_several_material_files() {
    let files = [
        ("one.mtl", "newmtl a\nKd 1 0 0\n"),
        ("two words.mtl", "newmtl m # the second\nKd 0 1 0\n"),
    ];
    for names in [
        "one.mtl two words.mtl",
        "two words.mtl one.mtl # all",
        "two words.mtl",
    ] {
        let obj = format!("mtllib {names}\n{CORNERS}usemtl m\nf 1 2 3\n");
        let (desc, notes) = load(&obj, &files);
        assert_eq!(desc.materials[0].base_color, Vec3::Y, "{names}");
        assert_eq!(notes, "", "{names}");
    }
    let obj = format!("mtllib gone.mtl my gone.mtl\n{CORNERS}f 1 2 3\n");
    let (_, notes) = load(&obj, &files);
    assert!(
        notes.contains("/gone.mtl") && notes.contains("/my gone.mtl"),
        "{notes}"
    );
}

#[test]
fn comments_follow_statements_of_materials() {
    let (m, notes) =
        material("newmtl m\nKd 0.5 # grey\nd 0.25 # mostly open\nmap_Kd grey.png # here\n");
    assert_eq!(m.base_color, Vec3::splat(0.5));
    assert_eq!(coverage(&m), 0.25);
    assert!(
        m.texture(TextureSlot::BaseColor).is_some() && notes.is_empty(),
        "{notes}"
    );
}

#[test]
fn dissolve_is_coverage_without_refraction() {
    for (mtl, expected) in [
        ("newmtl m\nd 0.5\nillum 2\n", 0.5),
        ("newmtl m\nTr 0.75\n", 0.25),
        ("newmtl m\nTr 0.75\nd 0.5\n", 0.5),
        ("newmtl m\nmap_d grey.png\n", 0.2),
        ("newmtl m\nd 0.5\nmap_d grey.png\n", 0.1),
        ("newmtl m\nmap_d grey.png\nTr 0.5\n", 0.1),
        ("newmtl m\nmap_d alpha.png\n", 0.5),
    ] {
        let (m, notes) = material(mtl);
        assert_eq!((m.opacity, notes.as_str()), (1.0, ""), "{mtl}");
        assert!(
            (coverage(&m) - expected).abs() < 1e-6,
            "{mtl}: {}",
            coverage(&m)
        );
    }
    let (m, _) = material("newmtl m\nd 1\nillum 2\n");
    assert!(m.texture(TextureSlot::Mask).is_none() && m.opacity == 1.0);
    let (glass, _) = material("newmtl m\nd 0.5\nillum 7\n");
    assert!(glass.texture(TextureSlot::Mask).is_none() && glass.opacity == 0.0);
    let (_, notes) = material("newmtl m\nd 0\n");
    assert!(
        notes.contains("material m: ") && notes.contains("invisible"),
        "{notes}"
    );
}

#[test]
fn colours_of_vertices_multiply_the_base_colour() {
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 0 0 1\nv 0 1 0 1 1 1\nf 1 2 3\n";
    let (desc, notes) = load(obj, &[]);
    assert_eq!(mesh_of(&desc, 0).colors, [Vec3::X, Vec3::Z, Vec3::ONE]);
    assert_eq!(notes, "");
    // Flat faces beside others have vertices of their own.
    let obj = "v 0 0 0 1 0 0\nv 1 0 0 1 0 0\nv 0 1 0 1 0 0\nvn 0 0 1\nf 1 2 3\nf 1//1 2//1 3//1\n";
    let (desc, _) = load(obj, &[]);
    assert_eq!(mesh_of(&desc, 0).colors, [Vec3::X; 6]);
}

#[test]
fn normals_of_smoothing_groups_face_the_front_of_every_convention() {
    let roof = "v 0 -1 0\nv 0 1 0\nv -1 1 -1\nv -1 -1 -1\nv 1 -1 -1\nv 1 1 -1\ns 1\nf 1 2 3 4\nf 1 5 6 2\n";
    let scn = r#"{ "materials": [ { "name": "m" } ], "entities": [ { "type": "mesh", "file": "m.obj" } ] }"#;
    let folder = Folder::new(&[("a.scn", scn), ("m.obj", roof)]);
    for (file, up) in [("m.obj", 1.0), ("a.scn", -1.0)] {
        let (desc, _) = folder.load(file).unwrap();
        let (scene, _) = compile(&desc).unwrap();
        let ridge = mesh_of(&desc, 0)
            .positions
            .iter()
            .zip(&mesh_of(&desc, 0).normals)
            .filter(|(p, _)| p.x == 0.0);
        for (_, n) in ridge {
            assert!(n.distance(Vec3::Z * up) < 1e-6, "{file}: {n}");
        }
        for (i, [a, b, c]) in (0..).zip(&scene.triangles) {
            let front = (*b - *a).cross(*c - *a);
            assert!(
                scene.normals.at(i).iter().all(|n| n.dot(front) > 0.0),
                "{file}"
            );
            assert!(front.z * up > 0.0, "{file}");
        }
    }
}

#[test]
fn a_byte_order_mark_and_ends_of_lines_of_old_systems_are_accepted() {
    let mtl = "\u{feff}newmtl wood\rKd 1 0 0\r";
    let obj = format!("\u{feff}mtllib a.mtl\n{CORNERS}usemtl wood\nf 1 2 3\n").replace('\n', "\r");
    let (desc, notes) = load(&obj, &[("a.mtl", mtl)]);
    assert_eq!(desc.materials[0].base_color, Vec3::X);
    assert_eq!(notes, "");
}

#[test]
fn weights_of_vertices_do_not_move_polygons() {
    let (desc, notes) = load("v 0 0 0 1\nv 2 0 0 0.5\nv 0 2 0 1\nf 1 2 3\n", &[]);
    assert_eq!(mesh_of(&desc, 0).positions[1], Vec3::X * 2.0);
    assert!(
        notes.contains("line 2") && notes.contains("weights"),
        "{notes}"
    );
    let (_, notes) = load("v 0 0 0 1\nv 2 0 0 1\nv 0 2 0 1\nf 1 2 3\n", &[]);
    assert_eq!(notes, "");
}

#[test]
fn a_material_that_no_file_has_is_noted() {
    let obj = format!("mtllib a.mtl\n{CORNERS}usemtl Wood\nf 1 2 3\n");
    let (desc, notes) = load(&obj, &[("a.mtl", "newmtl wood\nKd 1 0 0\n")]);
    assert_eq!(
        desc.materials[0].base_color,
        MaterialDesc::new("m").base_color
    );
    assert!(
        notes.contains("usemtl: no material file has `Wood`"),
        "{notes}"
    );
}

#[test]
fn values_that_were_not_set_are_left_alone() {
    let (m, notes) = material("newmtl m\nNi 0\nmap_Kd\nmap_Bump   \n");
    assert_eq!(m.ior, MaterialDesc::new("m").ior);
    assert!(m.textures.is_empty());
    assert!(
        notes.contains("`map_Kd` names no file") && notes.contains("`map_Bump` names no file"),
        "{notes}"
    );
    let (_, notes) = material("newmtl m\nNs -1\n");
    assert!(notes.contains("-1 of `Ns` is outside 0 to"), "{notes}");
}

#[test]
fn meshlab_writes_coverage_as_tr() {
    let (m, notes) = material("# Converted by Meshlab Group\nnewmtl m\nTr 1.0\n");
    assert!(m.texture(TextureSlot::Mask).is_none(), "{notes}");
    let (m, _) = material("# Converted by Meshlab Group\nnewmtl m\nTr 0.75\n");
    assert_eq!(coverage(&m), 0.75);
}

#[test]
fn a_channel_of_a_map_is_selected() {
    for (channel, expected) in [("r", 1.0), ("g", 0.0), ("m", 0.5)] {
        let (m, notes) = material(&format!("newmtl m\nmap_d -imfchan {channel} alpha.png\n"));
        assert_eq!((coverage(&m), notes.as_str()), (expected, ""), "{channel}");
    }
    let (_, notes) = material("newmtl m\nmap_Kd -imfchan g alpha.png\n");
    assert!(notes.contains("`-imfchan`"), "{notes}");
    let (_, notes) = material("newmtl m\nmap_d -imfchan z alpha.png\n");
    assert!(notes.contains("the channel `z`"), "{notes}");
}
