//! Corner cases of OBJ files, through to compiled triangles.

use glam::{Vec2, Vec3};
use lumbre_light::scene::{CompiledScene, compile};

use super::{Folder, lines};

/// Loads an OBJ named by a `.scn`. Returns the compiled scene, and all notes but the one that the
/// picture will be black.
fn through_scn(obj: &str) -> (CompiledScene, String) {
    let folder = Folder::new(&[
        (
            "a.scn",
            r#"{ "materials": [ { "name": "m" } ], "entities": [ { "type": "mesh", "file": "m.obj" } ] }"#,
        ),
        ("m.obj", obj),
    ]);
    let (desc, mut notes) = folder.load("a.scn").unwrap();
    let (scene, compiled) = compile(&desc).unwrap();
    notes.extend(
        compiled
            .into_iter()
            .filter(|n| !n.message.contains("black")),
    );
    (scene, lines(&notes))
}

fn front(scene: &CompiledScene, i: usize) -> Vec3 {
    let [a, b, c] = scene.triangles[i];
    (b - a).cross(c - a).normalize_or(Vec3::ZERO)
}

const CORNERS: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\n";

#[test]
fn negative_indices_crlf_continuations_and_a_missing_mtl_are_accepted() {
    let text =
        format!("mtllib gone.mtl\n{CORNERS}vt 0 0\nvt 1 0.5\nf -4/-2 -3/-1 \\\n-2/-1 -1/-2\n");
    for text in [text.clone(), text.replace('\n', "\r\n")] {
        let (scene, notes) = through_scn(&text);
        assert_eq!(notes, "");
        assert_eq!(scene.triangles.len(), 2);
        let uvs: Vec<Vec2> = scene.uvs.iter().flatten().copied().collect();
        assert!(uvs.contains(&Vec2::new(1.0, 0.5)) && uvs.contains(&Vec2::ZERO));
    }
}

#[test]
fn faces_without_normals_face_against_their_winding() {
    let (scene, notes) = through_scn(&format!("{CORNERS}f 1 2 3\n"));
    assert_eq!(front(&scene, 0), Vec3::NEG_Z);
    assert_eq!(scene.normals.at(0), [Vec3::NEG_Z; 3]);
    assert_eq!(notes, "");
}

#[test]
fn faces_with_normals_face_the_side_of_their_normals() {
    let (scene, _) = through_scn(&format!(
        "{CORNERS}vn 0 0 1\nvn 0 0 -1\nf 1//1 2//1 3//1\nf 1//2 2//2 3//2\n"
    ));
    assert_eq!((front(&scene, 0), front(&scene, 1)), (Vec3::Z, Vec3::NEG_Z));
    assert_eq!(scene.normals.at(1), [Vec3::NEG_Z; 3]);
}

#[test]
fn large_polygons_are_triangulated_and_keep_their_area() {
    let n = 40;
    let mut text = String::new();
    for i in 0..n {
        let a = std::f64::consts::TAU * f64::from(i) / f64::from(n);
        text += &format!("v {} {} 0\n", a.cos(), a.sin());
    }
    text += "f";
    (1..=n).for_each(|i| text += &format!(" {i}"));
    let (scene, notes) = through_scn(&text);
    assert_eq!((scene.triangles.len(), notes.as_str()), (38, ""));
    let area: f32 = scene
        .triangles
        .iter()
        .map(|[a, b, c]| (*b - *a).cross(*c - *a).length() / 2.0)
        .sum();
    let exact = f64::from(n) / 2.0 * (std::f64::consts::TAU / f64::from(n)).sin();
    assert!((f64::from(area) - exact).abs() < 1e-5);
}

#[test]
fn empty_meshes_and_degenerate_faces_are_noted() {
    let (scene, notes) = through_scn("");
    assert_eq!(scene.primitive_count(), 0);
    assert!(
        notes.contains("whole file: the mesh has no faces"),
        "{notes}"
    );
    let (scene, notes) = through_scn(&format!("{CORNERS}f 1 1 2\nf 1 2 2\nf 1 2 3\nf 1 2\n"));
    assert_eq!(scene.triangles.len(), 1);
    assert!(
        notes.contains("entities.m: triangles without area: 2 left out"),
        "{notes}"
    );
    assert!(
        notes.contains("line 8: faces with fewer than three vertices are left out: 1"),
        "{notes}"
    );
}

#[test]
fn the_default_camera_of_a_mesh_shows_all_of_it() {
    let folder = Folder::new(&[("thing.obj", &format!("{CORNERS}f 1 2 3 4\n"))]);
    let (desc, notes) = folder.load("thing.obj").unwrap();
    assert_eq!(lines(&notes), "");
    let (scene, notes) = compile(&desc).unwrap();
    assert!(lines(&notes).contains("nothing emits light"));
    assert_eq!(
        front(&scene, 0),
        Vec3::Z,
        "without a scene, counter-clockwise faces must face the viewer"
    );
    let half = (desc.camera.view_deg() / 2.0).to_radians().tan();
    for p in scene.triangles.iter().flatten() {
        let seen = *p - desc.camera.position;
        assert!(seen.z < 0.0 && seen.x.abs().max(seen.y.abs()) < half * -seen.z);
    }
}

#[test]
fn faces_with_and_without_normals_do_not_share_vertices() {
    let text = format!(
        "{CORNERS}vn 0 0 1\nusemtl m\nf 1//1 2//1 3//1\nf 1 3 4\nusemtl m\nf 1//1 3//1 4//1\n"
    );
    let (scene, notes) = through_scn(&text);
    assert_eq!(notes, "");
    assert_eq!(scene.triangles.len(), 3);
    assert_eq!([0, 1, 2].map(|i| front(&scene, i).z), [1.0, -1.0, 1.0]);
}
