//! Small scenes of pbrt, and the scenes that they become: values by hand from the file format and
//! the book of version 4, and from the source of version 3.

use std::f32::consts::PI;
use std::io::Write;

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{SceneDesc, ShapeDesc};

use super::samples::picture;
use super::{Folder, lines, mesh_of};

/// The view of the tests: from (0, 0, 5) along -z, right-handed.
pub(super) const VIEW: &str =
    "Scale -1 1 1\nLookAt 0 0 5  0 0 0  0 1 0\nCamera \"perspective\" \"float fov\" 40\n";

pub(super) fn read_files(files: &[(&str, &[u8])]) -> Result<(SceneDesc, String), String> {
    let (desc, notes) = Folder::new(files)
        .load(files[0].0)
        .map_err(|e| e.to_string())?;
    Ok((desc, lines(&notes)))
}

/// Loads a world of version 4 with the view of the tests.
pub(super) fn read(world: &str) -> (SceneDesc, String) {
    let text = format!("{VIEW}WorldBegin\n{world}");
    read_files(&[("a.pbrt", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"))
}

/// Loads a world of version 3 with the view of the tests.
pub(super) fn read_v3(world: &str) -> (SceneDesc, String) {
    let text = format!("{VIEW}Film \"image\"\nWorldBegin\n{world}\nWorldEnd\n");
    read_files(&[("a.pbrt", text.as_bytes())]).unwrap_or_else(|e| panic!("{e}"))
}

pub(super) fn refused(world: &str) -> String {
    let text = format!("{VIEW}WorldBegin\n{world}");
    read_files(&[("a.pbrt", text.as_bytes())]).unwrap_err()
}

/// Returns where a point of the world appears: to the right and up, over its distance.
fn seen(desc: &SceneDesc, p: Vec3) -> Vec2 {
    let c = &desc.camera;
    let forward = (c.target - c.position).normalize_or(Vec3::ZERO);
    let right = forward.cross(c.up).normalize_or(Vec3::ZERO);
    let d = p - c.position;
    Vec2::new(d.dot(right), d.dot(right.cross(forward))) / d.dot(forward)
}

/// Returns the vertices of an entity in the world.
pub(super) fn corners(desc: &SceneDesc, entity: usize) -> Vec<Vec3> {
    let e = &desc.entities[entity];
    let map = e.transform.to_world();
    match &e.shape {
        ShapeDesc::Mesh(mesh) => {
            let world = |p: &Vec3| map.transform_point3(p.as_dvec3()).as_vec3();
            mesh.positions.iter().map(world).collect()
        }
        ShapeDesc::Sphere { .. } => vec![map.translation.as_vec3()],
    }
}

/// A triangle to the right of the axis and above it.
pub(super) const TRIANGLE: &str = "Shape \"trianglemesh\" \"point3 P\" [1 1 0  2 1 0  1 2 0]\n";

#[test]
fn the_picture_is_not_mirrored_whatever_the_handedness_of_the_world() {
    let head = "LookAt 0 0 -5  0 0 0  0 1 0\nCamera \"perspective\"\nWorldBegin\n";
    let text = format!("{head}{TRIANGLE}");
    let (left, notes) = read_files(&[("a.pbrt", text.as_bytes())]).unwrap();
    assert!(
        notes.contains("line 2") && notes.contains("left-handed"),
        "{notes}"
    );
    // In camera space, x to the right: the point (1, 1, 0) is at (1, 1, 5).
    let p = corners(&left, 0)[0];
    assert_eq!(p, Vec3::new(-1.0, 1.0, 0.0));
    assert!(seen(&left, p).distance(Vec2::new(0.2, 0.2)) < 1e-6);
    let (right, notes) = read(TRIANGLE);
    assert!(notes.is_empty(), "{notes}");
    let p = corners(&right, 0)[0];
    assert_eq!(p, Vec3::new(1.0, 1.0, 0.0));
    assert!(seen(&right, p).distance(Vec2::new(0.2, 0.2)) < 1e-6);
}

#[test]
fn the_field_of_view_is_that_of_the_smaller_side() {
    let view = |film: &str, more: &str| {
        let text = format!(
            "Film \"rgb\" {film}\nCamera \"perspective\" \"float fov\" 40 {more}\nWorldBegin\n"
        );
        read_files(&[("a.pbrt", text.as_bytes())]).unwrap()
    };
    let wide = "\"integer xresolution\" 200 \"integer yresolution\" 100";
    let (desc, _) = view(wide, "");
    assert_eq!(desc.resolution, [200, 100]);
    assert!((desc.camera.view_deg() - 40.0).abs() < 1e-4);
    let high = "\"integer xresolution\" 100 \"integer yresolution\" 200";
    let expected = 2.0 * (2.0 * 20f32.to_radians().tan()).atan().to_degrees();
    assert!((view(high, "").0.camera.view_deg() - expected).abs() < 1e-3);
    let (desc, notes) = view(wide, "\"float screenwindow\" [ -1 1 -0.5 0.5 ]");
    let expected = 2.0 * (0.5 * 20f32.to_radians().tan()).atan().to_degrees();
    assert!((desc.camera.view_deg() - expected).abs() < 1e-3 && !notes.contains("square"));
    let (_, notes) = view(wide, "\"float screenwindow\" [ 0 1 -1 1 ]");
    assert!(notes.contains("not square"), "{notes}");
    let (desc, _) = view(wide, "\"float lensradius\" 0.25 \"float focaldistance\" 7");
    assert_eq!(
        (desc.camera.lens_diameter(), desc.camera.focus_distance),
        (0.5, Some(7.0))
    );
}

#[test]
fn transforms_apply_in_order_and_blocks_restore_them() {
    let (desc, notes) = read(
        "AttributeBegin\nTranslate 10 0 0\nRotate 90 0 1 0\nScale 3 3 3\nTranslate 1 0 0\n\
         Shape \"sphere\"\nCoordinateSystem \"there\"\nAttributeEnd\nShape \"sphere\"\n\
         CoordSysTransform \"there\"\nShape \"sphere\"\n\
         Transform [1 0 0 0  0 1 0 0  0 0 1 0  4 5 6 1]\nConcatTransform [2 0 0 0 0 2 0 0 0 0 2 0 1 0 0 1]\n\
         Shape \"sphere\"\nIdentity\nShape \"sphere\"\n",
    );
    assert!(notes.is_empty(), "{notes}");
    // (1, 0, 0) -> (3, 0, 0) -> (0, 0, -3) -> (10, 0, -3).
    let centers: Vec<Vec3> = (0..5).map(|i| corners(&desc, i)[0]).collect();
    let expected = [
        Vec3::new(10.0, 0.0, -3.0),
        Vec3::ZERO,
        Vec3::new(10.0, 0.0, -3.0),
        Vec3::new(5.0, 5.0, 6.0),
        Vec3::ZERO,
    ];
    for (found, expected) in centers.iter().zip(expected) {
        assert!(
            found.distance(expected) < 1e-5,
            "{found} instead of {expected}"
        );
    }
    let (scene, _) = compile(&desc).unwrap();
    assert!((scene.spheres[0].radius - 3.0).abs() < 1e-5);
    // The camera's own coordinate system is at the camera.
    let (desc, _) = read("CoordSysTransform \"camera\"\nTranslate 0 0 5\nShape \"sphere\"\n");
    assert!(
        corners(&desc, 0)[0].length() < 1e-5,
        "{}",
        corners(&desc, 0)[0]
    );
}

#[test]
fn instances_combine_the_transforms_of_both_places() {
    let (desc, notes) = read(
        "AttributeBegin\nTranslate 0 1 0\nObjectBegin \"a\"\nTranslate 1 0 0\n\
         Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\nObjectEnd\nAttributeEnd\n\
         Scale 2 2 2\nObjectInstance \"a\"\nTranslate 0 0 1\nObjectInstance \"a\"\n",
    );
    assert!(notes.is_empty(), "{notes}");
    assert_eq!(desc.entities.len(), 2);
    // At the instance the scale applies to the point moved by both translations.
    assert_eq!(corners(&desc, 0)[1], Vec3::new(4.0, 2.0, 0.0));
    assert_eq!(corners(&desc, 1)[0], Vec3::new(2.0, 2.0, 2.0));
    let (a, b) = (mesh_of(&desc, 0), mesh_of(&desc, 1));
    assert!(std::sync::Arc::ptr_eq(a, b), "instances share their mesh");
    for (world, expected) in [
        (
            "ObjectInstance \"b\"",
            "line 5: ObjectInstance: no object with the name `b` precedes",
        ),
        ("ObjectBegin \"a\"\nObjectBegin \"b\"", "inside of another"),
        (
            "ObjectBegin \"a\"\nObjectInstance \"a\"",
            "inside of a definition",
        ),
        ("AttributeEnd", "without a matching `AttributeBegin`"),
        (
            "AttributeBegin\nObjectEnd",
            "without a matching `ObjectBegin`",
        ),
    ] {
        let e = refused(world);
        assert!(e.contains(expected), "{world}: {e}");
    }
}

/// Returns the normal of the first triangle of a world.
fn front(world: &str, old: bool) -> Vec3 {
    let (desc, _) = if old { read_v3(world) } else { read(world) };
    let (scene, _) = compile(&desc).unwrap();
    let [a, b, c] = scene.triangles[0];
    (b - a).cross(c - a).normalize_or(Vec3::ZERO)
}

#[test]
fn the_front_follows_from_the_corners_or_from_the_normals() {
    let with =
        |more: &str| format!("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0] {more}\n");
    let normals = "\"normal N\" [0 0 -1 0 0 -1 0 0 -1]";
    assert_eq!(front(&with(""), false), Vec3::Z);
    assert_eq!(front(&with(normals), false), Vec3::NEG_Z);
    assert_eq!(
        front(&format!("ReverseOrientation\n{}", with("")), false),
        Vec3::NEG_Z
    );
    assert_eq!(
        front(&format!("ReverseOrientation\n{}", with(normals)), false),
        Vec3::Z
    );
    // Version 3 does not reverse normals, and they determine the front.
    assert_eq!(
        front(&format!("ReverseOrientation\n{}", with(normals)), true),
        Vec3::NEG_Z
    );
    assert_eq!(
        front(&format!("ReverseOrientation\n{}", with("")), true),
        Vec3::NEG_Z
    );
    // A transform that mirrors moves the front with the shape.
    assert_eq!(
        front(&format!("Scale 1 1 -1\n{}", with("")), false),
        Vec3::NEG_Z
    );
    assert_eq!(
        front(&format!("Scale -1 1 1\n{}", with("")), false),
        Vec3::Z
    );
    assert_eq!(front("Shape \"disk\"", false), Vec3::Z);
    let patch = "Shape \"bilinearmesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0 1 1 0]";
    assert_eq!(front(patch, false), Vec3::Z);
}

#[test]
fn shapes_have_the_texture_coordinates_of_pbrt() {
    let png = picture(image::ImageFormat::Png);
    let textured = |world: &str| {
        let text = format!(
            "{VIEW}WorldBegin\nTexture \"t\" \"spectrum\" \"imagemap\" \"string filename\" \
            \"t.png\"\n\
             Material \"diffuse\" \"texture reflectance\" \"t\"\n{world}"
        );
        read_files(&[("a.pbrt", text.as_bytes()), ("t.png", &png)]).unwrap()
    };
    let (desc, notes) = textured("Shape \"sphere\" \"float radius\" 2\n");
    assert!(
        notes.contains("line 7") && notes.contains("becomes a mesh"),
        "{notes}"
    );
    let mesh = mesh_of(&desc, 0);
    // u is the angle about z over 2 pi, v the angle from -z over pi.
    for (p, uv) in mesh.positions.iter().zip(&mesh.uvs) {
        let v = 1.0 - p.z.clamp(-1.0, 1.0).acos() / PI;
        assert!((uv.y - v).abs() < 1e-3, "{p} {uv}");
        if p.truncate().length() > 1e-3 && uv.x < 0.999 {
            let u = p.y.atan2(p.x).rem_euclid(2.0 * PI) / (2.0 * PI);
            let apart = (uv.x - u).abs();
            assert!(!(1e-4..=0.999).contains(&apart), "{p} {uv}");
        }
    }
    assert!((corners(&desc, 0)[0].length() - 2.0).abs() < 1e-5);
    let (desc, _) = textured("Shape \"trianglemesh\" \"point3 P\" [0 0 0 1 0 0 0 1 0]\n");
    let mesh = mesh_of(&desc, 0);
    assert_eq!(mesh.uvs, [Vec2::ZERO, Vec2::X, Vec2::ONE]);
    let (desc, notes) = textured(
        "Shape \"sphere\" \"float zmax\" 0.5 \"float phimax\" 180\nShape \"cylinder\"\nShape \
        \"cone\"\n",
    );
    assert!(notes.contains("the shape `cone` is not supported") && desc.entities.len() == 2);
    let most = corners(&desc, 0).iter().fold(Vec3::MIN, |a, b| a.max(*b));
    assert!((most.z - 0.5).abs() < 1e-6 && most.y > 0.999, "{most}");
}

#[test]
fn meshes_are_read_from_files_also_compressed() {
    let ply = super::samples::ply("binary_little_endian");
    let mut packed = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    packed.write_all(&ply).unwrap();
    let text = format!(
        "{VIEW}WorldBegin\nShape \"plymesh\" \"string filename\" \"m/quad.ply\"\n\
         Shape \"plymesh\" \"string filename\" [\"m/quad.ply.gz\"]\nInclude \"m/i.pbrt\"\n"
    );
    let inner = "Translate 1 0 0\nShape \"plymesh\" \"string filename\" \"m/quad.ply\"\n";
    let (desc, notes) = read_files(&[
        ("a.pbrt", text.as_bytes()),
        ("m/quad.ply", &ply),
        ("m/quad.ply.gz", &packed.finish().unwrap()),
        ("m/i.pbrt", inner.as_bytes()),
    ])
    .unwrap();
    let edges = "header: the element `edge` is not supported; ignored\n";
    assert_eq!(notes, edges.repeat(2));
    let names: Vec<&str> = desc.entities.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["quad", "quad_2", "quad_3"]);
    assert_eq!(corners(&desc, 0), corners(&desc, 1));
    assert_eq!(corners(&desc, 2)[0], Vec3::X);
}

#[test]
fn imported_files_leave_the_state_as_it_was_and_cycles_are_refused() {
    let text = format!("{VIEW}WorldBegin\nImport \"i.pbrt\"\nShape \"sphere\"\n");
    let inner = "Translate 3 0 0\nAttributeBegin\nShape \"sphere\"\n";
    let files: [(&str, &[u8]); 2] = [("a.pbrt", text.as_bytes()), ("i.pbrt", inner.as_bytes())];
    let (desc, _) = read_files(&files).unwrap();
    assert_eq!(
        (corners(&desc, 0)[0], corners(&desc, 1)[0]),
        (Vec3::X * 3.0, Vec3::ZERO)
    );
    let files: [(&str, &[u8]); 2] = [
        ("a.pbrt", b"WorldBegin\nInclude \"b.pbrt\"\n"),
        ("b.pbrt", b"\nInclude \"a.pbrt\""),
    ];
    let e = read_files(&files).unwrap_err();
    assert!(
        e.contains("b.pbrt: line 2: `a.pbrt` includes itself"),
        "{e}"
    );
}

#[test]
fn depth_media_motion_and_filters_are_read_or_noted() {
    let text = "Integrator \"volpath\" \"integer maxdepth\" 7\nPixelFilter \"mitchell\"\nSampler \
    \"sobol\"\n\
                TransformTimes 0 1\nCamera \"perspective\"\nWorldBegin\nMakeNamedMedium \"fog\"\n\
                MediumInterface \"fog\" \"\"\nActiveTransform EndTime\nTranslate 5 0 0\n\
                ActiveTransform All\nShape \"sphere\"\n";
    let (desc, notes) = read_files(&[("a.pbrt", text.as_bytes())]).unwrap();
    assert_eq!((desc.max_depth, corners(&desc, 0)[0]), (8, Vec3::ZERO));
    for (line, what) in [
        (2, "`filter = \"mitchell\"`"),
        (4, "motion"),
        (7, "media"),
        (8, "media"),
        (9, "motion"),
    ] {
        let place = format!("line {line}");
        let is_there = |places: &str| places.split(", ").any(|p| p == place);
        let found = notes
            .lines()
            .any(|n| n.contains(what) && n.split(':').next().is_some_and(is_there));
        assert!(found, "{line} {what}: {notes}");
    }
    for (text, expected) in [
        ("Shape \"sphere\"", "`Shape` precedes `WorldBegin`"),
        ("Camera \"perspective\"", "no `WorldBegin`"),
        ("Frob 1", "line 1: expected a directive, found `Frob`"),
        ("Scale 1 2 x", "expected 3 numbers, found `x`"),
        ("Transform [1 2", "expected a number"),
        ("WorldBegin\nWorldBegin", "begins twice"),
        (
            "WorldBegin\nFilm \"rgb\" \"integer xresolution\" [1 2]",
            "expected one number, found 2",
        ),
        ("Film \"rgb\" \"integer\" 1", "expected a parameter"),
        ("Scale 0 1 1\nCamera \"perspective\"", "not invertible"),
        (
            "WorldBegin\nShape \"trianglemesh\" \"integer indices\" [0 1 2]",
            "names vertex 0",
        ),
        (
            "WorldBegin\nShape \"sphere\" \"float radius\" -1",
            "`radius` must be above 0",
        ),
    ] {
        let e = read_files(&[("a.pbrt", text.as_bytes())]).unwrap_err();
        assert!(e.contains(expected), "{text}: {e}");
    }
}
