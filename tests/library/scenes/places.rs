//! Scenes whose files place them a million times their size from the origin, in text or in double
//! precision: compiled, they are the scene at the origin.

use glam::{DVec3, Vec3};

use lumbre_light::scene::compile;
use lumbre_light::scene::desc::{ShapeDesc, content_hash};
use lumbre_light::value::Value;
use lumbre_scene_io::edit;
use lumbre_scene_io::export;

use super::{Folder, SceneDesc, load};

/// A place that single precision does not hold.
const FAR: DVec3 = DVec3::new(1_234_567.891, -765_432.109, 4_321_098.765);

/// Corners of a triangle, centre of a ball, position and target of a camera, a light.
const POINTS: [[f64; 3]; 7] = [
    [0.1, 0.2, 0.0],
    [1.3, 0.0, 0.1],
    [0.0, 1.1, -0.3],
    [0.45, 0.35, 0.85],
    [0.3, 0.7, 4.1],
    [0.25, 0.5, 0.05],
    [1.7, 2.3, 1.9],
];

/// Returns a text with `@0` to `@6` replaced by the points at a place, with the separator `by`.
fn at(place: DVec3, by: &str, text: &str) -> String {
    let points = POINTS.into_iter().enumerate();
    points.fold(text.to_owned(), |text, (i, p)| {
        let p = (DVec3::from_array(p) + place).to_array();
        text.replace(&format!("@{i}"), &p.map(|x| format!("{x:.4}")).join(by))
    })
}

const OBJ: &str = "v @0\nv @1\nv @2\nf 1 2 3\n";

/// Returns a PLY file in text, or with binary doubles.
fn ply(place: DVec3, binary: bool) -> Vec<u8> {
    let (encoding, ty) = if binary {
        ("binary_little_endian", "double")
    } else {
        ("ascii", "float")
    };
    let properties = ["x", "y", "z"]
        .map(|axis| format!("property {ty} {axis}\n"))
        .concat();
    let header = format!(
        "ply\nformat {encoding} 1.0\nelement vertex 3\n{properties}element face 1\n\
         property list uchar int vertex_indices\nend_header\n"
    );
    let mut bytes = header.into_bytes();
    if !binary {
        bytes.extend(at(place, " ", "@0\n@1\n@2\n3 0 1 2\n").into_bytes());
        return bytes;
    }
    for p in &POINTS[..3] {
        let p = (DVec3::from_array(*p) + place).to_array();
        bytes.extend(p.iter().flat_map(|x| x.to_le_bytes()));
    }
    bytes.push(3);
    bytes.extend([0i32, 1, 2].iter().flat_map(|i| i.to_le_bytes()));
    bytes
}

/// Returns the loaded scene of a format at a place.
fn scene(format: &str, place: DVec3) -> SceneDesc {
    let xml = "<scene version=\"3.0.0\"><sensor type=\"perspective\"><transform name=\"to_world\">\
        <lookat origin=\"@4\" target=\"@5\" up=\"0,1,0\"/></transform></sensor>\
        <shape type=\"obj\"><string name=\"filename\" value=\"a.obj\"/><bsdf type=\"diffuse\"/></shape>\
        <shape type=\"sphere\"><point name=\"center\" value=\"@3\"/><float name=\"radius\" value=\"0.2\"/>\
        </shape><emitter type=\"point\"><point name=\"position\" value=\"@6\"/></emitter></scene>";
    let pbrt = "LookAt @4 @5 0 1 0\nCamera \"perspective\"\nWorldBegin\n\
        LightSource \"point\" \"point3 from\" [ @6 ]\n\
        Shape \"trianglemesh\" \"integer indices\" [ 0 1 2 ] \"point3 P\" [ @0 @1 @2 ]\n\
        AttributeBegin\nTranslate @3\nShape \"sphere\" \"float radius\" 0.2\nAttributeEnd\n";
    let scn = "{\"camera\": {\"position\": [@4], \"lookat\": [@5]}, \"entities\": [\
        {\"type\": \"mesh\", \"file\": \"a.obj\"}, {\"type\": \"sphere\", \"radius\": 0.2, \
        \"position\": [@3]}], \"lights\": [{\"type\": \"point\", \"position\": [@6], \
        \"intensity\": [1, 1, 1]}]}";
    let (name, text) = match format {
        "mitsuba" => ("a.xml", at(place, ",", xml).into_bytes()),
        "pbrt" => ("a.pbrt", at(place, " ", pbrt).into_bytes()),
        "scn" => ("a.scn", at(place, ",", scn).into_bytes()),
        "ply" => ("a.ply", ply(place, false)),
        "doubles" => ("a.ply", ply(place, true)),
        _ => ("a.obj", at(place, " ", OBJ).into_bytes()),
    };
    let obj = at(place, " ", OBJ).into_bytes();
    let mut files = vec![(name, text)];
    if name != "a.obj" {
        files.push(("a.obj", obj));
    }
    Folder::new(&files).load(name).unwrap().0
}

/// Returns the points of a compiled scene relative to the first corner: triangles and balls, and
/// unless the camera is that of a mesh file, the camera and the lights.
fn relative_points(desc: &SceneDesc, whole: bool) -> Vec<Vec3> {
    let (scene, notes) = compile(desc).unwrap();
    assert!(!format!("{notes:?}").contains("too coarse"), "{notes:?}");
    let mut points: Vec<Vec3> = scene.triangles.iter().flatten().copied().collect();
    points.extend(scene.spheres.iter().map(|s| s.center));
    if whole {
        points.extend([scene.camera.position, scene.camera.target]);
        points.extend(scene.points.iter().map(|light| light.position));
        assert_eq!(points.len(), 7);
    }
    let first = points[0];
    points.into_iter().map(|p| p - first).collect()
}

#[test]
fn scenes_far_from_the_origin_are_those_at_the_origin() {
    for format in ["mitsuba", "pbrt", "scn", "obj", "ply", "doubles"] {
        let whole = ["mitsuba", "pbrt", "scn"].contains(&format);
        let near = relative_points(&scene(format, DVec3::ZERO), whole);
        let far = relative_points(&scene(format, FAR), whole);
        // The target is one unit before the camera, or farther away.
        for (i, (near, far)) in near.iter().zip(&far).enumerate().filter(|(i, _)| *i != 5) {
            assert!(
                (*near - *far).length() < 1e-5,
                "{format} {i}: {far}, not {near}"
            );
        }
    }
}

#[test]
fn small_moves_of_a_scene_far_away_have_other_hashes() {
    let desc = scene("mitsuba", FAR);
    let hash = content_hash(&desc);
    let list = |p: DVec3| Value::List(p.to_array().map(Value::Num).to_vec());
    let [position, _] = desc.camera.places();
    let light = format!("lights.{}.position", desc.lights[0].name);
    let light_at = desc.lights[0].position().unwrap();
    for (path, place) in [("camera.position", position), (light.as_str(), light_at)] {
        let mut moved = desc.clone();
        edit::set(&mut moved, path, &list(place)).unwrap();
        assert_eq!(content_hash(&moved), hash, "{path}");
        edit::set(&mut moved, path, &list(place + DVec3::splat(1e-3))).unwrap();
        assert_ne!(content_hash(&moved), hash, "{path}");
    }
    let mut moved = desc.clone();
    moved.entities[1].transform.frame.translation.x += 1e-3;
    assert_ne!(content_hash(&moved), hash);
}

#[test]
fn exports_of_scenes_far_away_are_moved_to_the_origin() {
    let desc = scene("scn", FAR);
    let near = relative_points(&desc, true);
    let folder = Folder::new(&[("a.txt", "")]);
    for (write, name) in [
        (export::mitsuba as fn(&_, &_) -> _, "scene.xml"),
        (export::pbrt, "scene.pbrt"),
    ] {
        let written = write(&desc, folder.0.path()).unwrap();
        let notes = format!("{:?}", written.notes);
        assert!(notes.contains("it is moved by (-12"), "{notes}");
        let (read, _) = load(&folder.0.path().join(name)).unwrap();
        let farthest = |e: &lumbre_light::scene::desc::EntityDesc| match &e.shape {
            ShapeDesc::Mesh(mesh) => mesh.positions[0].length(),
            ShapeDesc::Sphere { .. } => e.to_world().translation.length() as f32,
        };
        assert!(read.entities.iter().all(|e| farthest(e) < 10.0));
        let found = relative_points(&read, true);
        for (i, (a, b)) in near.iter().zip(&found).enumerate().filter(|(i, _)| *i != 5) {
            let mirrored = (a.abs() - b.abs()).length();
            assert!(mirrored < 1e-4, "{name} {i}: {b}, not {a}");
        }
    }
}
