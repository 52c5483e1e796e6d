//! Animations, skins and morph targets of glTF. Expected values are computed by hand.

use glam::{Vec3, Vec4};
use lumbre_light::scene::{Note, SceneDesc, SceneError, compile};
use lumbre_scene_io::load::{MissingTextures, Variables, load_on_stage};
use lumbre_scene_io::stage::Stage;

use super::{Folder, lines, mesh_of};

/// A document under construction: its accessors and their bytes.
#[derive(Default)]
pub struct Builder {
    accessors: Vec<String>,
    views: Vec<String>,
    bytes: Vec<u8>,
}

impl Builder {
    /// Adds an accessor of bytes with a component type and an element type, and returns its index.
    pub fn packed(&mut self, bytes: &[u8], component: u32, ty: &str, count: usize) -> usize {
        let (at, length) = (self.bytes.len(), bytes.len());
        self.bytes.extend(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.views.push(format!(
            r#"{{ "buffer": 0, "byteOffset": {at}, "byteLength": {length} }}"#
        ));
        let view = self.accessors.len();
        self.accessors.push(format!(
            r#"{{ "bufferView": {view}, "componentType": {component}, "count": {count}, "type": "{ty}", "normalized": {} }}"#,
            component == 5120
        ));
        view
    }

    /// Adds an accessor of floats and returns its index.
    pub fn floats(&mut self, ty: &str, values: &[f32]) -> usize {
        let widths = [
            ("SCALAR", 1),
            ("VEC2", 2),
            ("VEC3", 3),
            ("VEC4", 4),
            ("MAT4", 16),
        ];
        let width = widths.iter().find(|w| w.0 == ty).unwrap().1;
        let bytes: Vec<u8> = values.iter().flat_map(|x| x.to_le_bytes()).collect();
        self.packed(&bytes, 5126, ty, values.len() / width)
    }

    /// Returns a folder with the document as `a.gltf`. `rest` is the JSON of all other properties.
    pub fn folder(&self, rest: &str) -> Folder {
        let text = format!(
            r#"{{ "asset": {{ "version": "2.0" }}, "accessors": [ {} ], "bufferViews": [ {} ],
"buffers": [ {{ "uri": "b.bin", "byteLength": {} }} ], {rest} }}"#,
            self.accessors.join(",\n"),
            self.views.join(",\n"),
            self.bytes.len(),
        );
        let folder = Folder::new(&[("a.gltf", text)]);
        folder.write("b.bin", &self.bytes);
        folder
    }
}

/// Loads `a.gltf` with scene options.
pub fn load(
    folder: &Folder,
    options: &[(&str, &str)],
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    let own = |(name, value): &(&str, &str)| ((*name).to_owned(), (*value).to_owned());
    let options: Variables = options.iter().map(own).collect();
    let file = folder.path("a.gltf");
    load_on_stage(&file, MissingTextures::Fail, Some(Stage::Bare), &options)
}

/// Panics unless each edit of `a.gltf`, one text for another once, makes its loading fail with an
/// expected message and the place of all of them.
pub fn assert_refused(folder: &Folder, place: &str, edits: &[(&str, &str, &str)]) {
    let text = std::fs::read_to_string(folder.path("a.gltf")).unwrap();
    for (from, to, expected) in edits {
        assert!(text.contains(from), "{from}");
        folder.write("a.gltf", text.replacen(from, to, 1));
        let e = load(folder, &[]).unwrap_err().to_string();
        assert!(e.contains(expected) && e.contains(place), "{to}: {e}");
    }
}

fn at_time(folder: &Folder, time: &str) -> SceneDesc {
    load(folder, &[("time", time)]).unwrap().0
}

/// Panics unless vectors differ by less than 1e-6.
pub fn assert_near(found: &[Vec3], expected: &[[f32; 3]]) {
    assert_eq!(found.len(), expected.len());
    for (found, expected) in found.iter().zip(expected) {
        let distance = found.distance(Vec3::from(*expected));
        assert!(distance < 1e-6, "{found} instead of {expected:?}");
    }
}

const TRIANGLE: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];

/// Returns where an entity's transform takes the origin and the point (1, 0, 0).
fn frame(desc: &SceneDesc) -> [Vec3; 2] {
    let world = desc.entities[0].transform.to_world();
    [Vec3::ZERO, Vec3::X].map(|p| world.transform_point3(p.as_dvec3()).as_vec3())
}

/// A channel: times, interpolation, values, their type, and the path that they move.
type Channel<'a> = (&'a [f32], &'a str, &'a [f32], &'a str, &'a str);

/// Returns a document whose node 0 has a mesh and is animated by samplers of paths: `input`,
/// `output`, `interpolation` and `path`.
fn animated(channels: &[Channel<'_>]) -> Folder {
    let mut b = Builder::default();
    let mesh = b.floats("VEC3", &TRIANGLE);
    let mut samplers = Vec::new();
    let mut targets = Vec::new();
    for (k, (times, ty, values, interpolation, path)) in channels.iter().enumerate() {
        let (input, output) = (b.floats("SCALAR", times), b.floats(ty, values));
        samplers.push(format!(
            r#"{{ "input": {input}, "output": {output}, "interpolation": "{interpolation}" }}"#
        ));
        targets.push(format!(
            r#"{{ "sampler": {k}, "target": {{ "node": 0, "path": "{path}" }} }}"#
        ));
    }
    let (samplers, targets) = (samplers.join(","), targets.join(","));
    b.folder(&format!(
        r#""nodes": [ {{ "mesh": 0, "translation": [7, 0, 0] }} ],
"meshes": [ {{ "primitives": [ {{ "attributes": {{ "POSITION": {mesh} }} }} ] }} ],
"animations": [ {{ "name": "idle", "samplers": [], "channels": [] }},
  {{ "name": "run", "samplers": [ {samplers} ], "channels": [ {targets} ] }} ]"#
    ))
}

fn running(folder: &Folder, time: &str) -> [Vec3; 2] {
    frame(
        &load(folder, &[("time", time), ("animation", "run")])
            .unwrap()
            .0,
    )
}

#[test]
fn every_interpolation_holds_at_its_ends_and_between() {
    let folder = animated(&[(
        &[1.0, 2.0, 4.0],
        "VEC3",
        &[0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 2.0, 4.0, 0.0],
        "LINEAR",
        "translation",
    )]);
    for (time, expected) in [
        ("-3", [0.0, 0.0, 0.0]),
        ("1.5", [1.0, 0.0, 0.0]),
        ("2", [2.0, 0.0, 0.0]),
        ("3", [2.0, 2.0, 0.0]),
        ("1e30", [2.0, 4.0, 0.0]),
    ] {
        assert_near(&running(&folder, time)[..1], &[expected]);
    }
    let folder = animated(&[(
        &[0.0, 1.0],
        "VEC3",
        &[1.0, 1.0, 1.0, 3.0, 1.0, 1.0],
        "STEP",
        "scale",
    )]);
    for (time, x) in [("0.99", 8.0), ("1", 10.0)] {
        assert_near(&running(&folder, time)[1..], &[[x, 0.0, 0.0]]);
    }
    // A quarter of a turn by 120 degrees about z; the second quaternion is that of the long way.
    let (sin, cos) = f32::sin_cos(60f32.to_radians());
    for sign in [1.0, -1.0] {
        let turn = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, sign * sin, sign * cos];
        let folder = animated(&[(&[0.0, 4.0], "VEC4", &turn, "LINEAR", "rotation")]);
        let turned = running(&folder, "1");
        assert_near(&[turned[1] - turned[0]], &[[0.866_025_4, 0.5, 0.0]]);
    }
    // Tangents, values, tangents; the basis at u = 1/4 is 27/32, 9/64, 5/32, -3/64.
    let spline = [
        [9.0, 9.0, 9.0],
        [1.0, 0.0, 0.0],
        [1.0, 2.0, 0.0],
        [-1.0, 0.0, 4.0],
        [3.0, 0.0, 0.0],
        [9.0, 9.0, 9.0],
    ];
    let folder = animated(&[(
        &[0.0, 2.0],
        "VEC3",
        spline.as_flattened(),
        "CUBICSPLINE",
        "translation",
    )]);
    for (time, expected) in [
        ("0", [1.0, 0.0, 0.0]),
        ("0.5", [1.6875, 0.5625, -0.375]),
        ("2", [3.0, 0.0, 0.0]),
    ] {
        assert_near(&running(&folder, time)[..1], &[expected]);
    }
}

#[test]
fn options_select_an_animation_or_are_errors() {
    let folder = animated(&[(&[0.0], "VEC3", &[5.0, 0.0, 0.0], "LINEAR", "translation")]);
    let x = |options: &[(&str, &str)]| frame(&load(&folder, options).unwrap().0)[0].x;
    assert_eq!(x(&[]), 7.0);
    assert_eq!(x(&[("time", "0")]), 7.0, "the first animation does nothing");
    for index in ["1", "1.0"] {
        assert_eq!(x(&[("time", "0"), ("animation", index)]), 5.0);
    }
    let notes = lines(&load(&folder, &[]).unwrap().1);
    assert!(notes.contains("the scene option `time` selects"), "{notes}");
    for (options, expected) in [
        (
            &[("time", "nan")][..],
            "scene_options.time: expected a time in seconds",
        ),
        (&[("time", "soon")], "found `soon`"),
        (&[("animation", "run")], "needs a `time`"),
        (
            &[("time", "0"), ("animation", "walk")],
            "no animation `walk`; the file has 2: idle, run",
        ),
        (&[("time", "0"), ("animation", "2")], "no animation `2`"),
        (&[("time", "0"), ("animation", "0.5")], "no animation `0.5`"),
        (&[("tiem", "0")], "did you mean `time`"),
    ] {
        let e = load(&folder, options).unwrap_err().to_string();
        assert!(e.contains(expected) && e.contains("a.gltf"), "{e}");
    }
}

/// Returns a document of a bar with two joints, the second at (0, 1, 0), which turns by 90 degrees
/// about z within 1 s and is stretched along x.
fn bar() -> Folder {
    let mut b = Builder::default();
    let positions = [0.0, 0.0, 0.0, 0.0, 2.0, 0.0, 1.0, 0.0, 0.0];
    let s = 0.5f32.sqrt();
    let position = b.floats("VEC3", &positions);
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0, s, s, 0.0, 0.0, 0.0, 1.0]);
    let tangent = b.floats(
        "VEC4",
        &[1.0, 0.0, 0.0, 1.0, s, -s, 0.0, -1.0, 1.0, 0.0, 0.0, 1.0],
    );
    let joints = b.packed(&[0, 1, 0, 0, 0, 1, 0, 0, 0, 1, 0, 0], 5121, "VEC4", 3);
    // The weights of the last vertex do not add up to 1, and the first has an unused joint.
    let weights = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.25, 0.25, 0.0, 0.0];
    let weights = b.floats("VEC4", &weights);
    let mut inverse = [0.0; 32];
    for i in 0..4 {
        (inverse[5 * i], inverse[16 + 5 * i]) = (1.0, 1.0);
    }
    inverse[16 + 13] = -1.0;
    let inverse = b.floats("MAT4", &inverse);
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let turn = b.floats("VEC4", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, s, s]);
    let zero = b.floats("SCALAR", &[0.0]);
    let stretch = b.floats("VEC3", &[2.0, 1.0, 1.0]);
    b.folder(&format!(
        r#""scenes": [ {{ "nodes": [0, 1] }} ],
"nodes": [ {{ "mesh": 0, "skin": 0, "translation": [100, 0, 0] }}, {{ "children": [2] }}, {{ "translation": [0, 1, 0] }} ],
"skins": [ {{ "joints": [1, 2], "inverseBindMatrices": {inverse} }} ],
"materials": [ {{ "extensions": {{ "KHR_materials_anisotropy": {{ "anisotropyStrength": 0.5 }} }} }} ],
"meshes": [ {{ "primitives": [ {{ "material": 0, "attributes": {{ "POSITION": {position}, "NORMAL": {normal}, "TANGENT": {tangent},
  "JOINTS_0": {joints}, "WEIGHTS_0": {weights} }} }} ] }} ],
"animations": [
  {{ "samplers": [ {{ "input": {times}, "output": {turn} }} ],
     "channels": [ {{ "sampler": 0, "target": {{ "node": 2, "path": "rotation" }} }} ] }},
  {{ "samplers": [ {{ "input": {zero}, "output": {stretch} }} ],
     "channels": [ {{ "sampler": 0, "target": {{ "node": 2, "path": "scale" }} }} ] }} ]"#
    ))
}

#[test]
fn a_skin_moves_vertices_normals_and_tangents() {
    let folder = bar();
    let rest = [[0.0, 0.0, 0.0], [0.0, 2.0, 0.0], [1.0, 0.0, 0.0]];
    let desc = load(&folder, &[]).unwrap().0;
    assert_near(&mesh_of(&desc, 0).positions, &rest);
    assert_near(&frame(&desc)[..1], &[[0.0; 3]]);
    // The joint takes (x, y) to (1 - y, 1 + x), so (0, 2) to (-1, 1), and (1, 0) to (1, 2), half of
    // which the last vertex follows.
    let desc = at_time(&folder, "1");
    let mesh = mesh_of(&desc, 0);
    assert_near(
        &mesh.positions,
        &[[0.0, 0.0, 0.0], [-1.0, 1.0, 0.0], [1.0, 1.0, 0.0]],
    );
    let s = 0.5f32.sqrt();
    assert_near(&mesh.normals[1..2], &[[-s, s, 0.0]]);
    assert!(mesh.tangents[1].distance(Vec4::new(s, s, 0.0, -1.0)) < 1e-6);
    // Stretched by 2 along x: a normal (1, 1) becomes (1/2, 1), and a tangent (1, -1) (2, -1).
    let desc = load(&folder, &[("time", "0"), ("animation", "1")])
        .unwrap()
        .0;
    let mesh = mesh_of(&desc, 0);
    let (one, two) = (0.2f32.sqrt(), 0.8f32.sqrt());
    assert_near(&mesh.normals[1..2], &[[one, two, 0.0]]);
    assert!(mesh.tangents[1].distance(Vec4::new(two, -one, 0.0, -1.0)) < 1e-6);
    compile(&desc).unwrap();
}

#[test]
fn a_skin_in_its_bind_pose_changes_nothing() {
    let folder = bar();
    let text = std::fs::read_to_string(folder.path("a.gltf")).unwrap();
    let skinned = load(&folder, &[]).unwrap().0;
    let bare = text.replace(r#""skin": 0, "translation": [100, 0, 0]"#, r#""extras": 0"#);
    folder.write("a.gltf", bare);
    let bare = load(&folder, &[]).unwrap().0;
    assert_eq!(mesh_of(&skinned, 0), mesh_of(&bare, 0));
    assert_eq!(skinned.entities[0].transform, bare.entities[0].transform);
}

#[test]
fn morph_targets_displace_vertices_by_weights_of_the_node_or_the_mesh() {
    let mut b = Builder::default();
    let position = b.floats("VEC3", &TRIANGLE);
    let normal = b.floats("VEC3", &[0.0, 0.0, 1.0].repeat(3));
    let up = b.floats("VEC3", &[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]);
    let tilt = b.floats("VEC3", &[1.0, 0.0, 0.0].repeat(3));
    let times = b.floats("SCALAR", &[0.0, 1.0]);
    let weights = b.floats("SCALAR", &[0.0, 1.0, 1.0, 0.0]);
    let rest = format!(
        r#""scenes": [ {{ "nodes": [0, 1, 2] }} ],
"nodes": [ {{ "mesh": 0, "weights": [0.5, 0] }}, {{ "mesh": 0 }}, {{ "mesh": 0, "weights": [0, 0] }} ],
"meshes": [ {{ "weights": [0, 1], "primitives": [ {{ "attributes": {{ "POSITION": {position}, "NORMAL": {normal} }},
  "targets": [ {{ "POSITION": {up} }}, {{ "NORMAL": {tilt}, "TEXCOORD_0": 0 }} ] }} ] }} ],
"animations": [ {{ "samplers": [ {{ "input": {times}, "output": {weights} }} ],
  "channels": [ {{ "sampler": 0, "target": {{ "node": 2, "path": "weights" }} }} ] }} ]"#
    );
    let folder = b.folder(&rest);
    let (desc, notes) = load(&folder, &[]).unwrap();
    let s = 0.5f32.sqrt();
    let mesh = |i| mesh_of(&desc, i);
    assert_near(&mesh(0).positions[2..], &[[0.0, 1.0, 1.0]]);
    assert_near(&mesh(0).normals[2..], &[[0.0, 0.0, 1.0]]);
    assert_near(&mesh(1).positions[2..], &[[0.0, 1.0, 0.0]]);
    assert_near(&mesh(1).normals[2..], &[[s, 0.0, s]]);
    assert_near(
        &mesh(2).positions,
        &[[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]],
    );
    assert!(lines(&notes).contains("targets[1]: morphing of `TEXCOORD_0` is not supported"));
    let desc = at_time(&folder, "0.25");
    let mesh = mesh_of(&desc, 2);
    assert_near(&mesh.positions[2..], &[[0.0, 1.0, 0.5]]);
    let along = Vec3::new(0.75, 0.0, 1.0).normalize_or(Vec3::X);
    assert_near(&mesh.normals[2..], &[along.to_array()]);
    // The same weights give one mesh.
    folder.write(
        "a.gltf",
        std::fs::read_to_string(folder.path("a.gltf"))
            .unwrap()
            .replace("[0.5, 0]", "[0, 1]"),
    );
    let desc = load(&folder, &[]).unwrap().0;
    assert!(std::sync::Arc::ptr_eq(mesh_of(&desc, 0), mesh_of(&desc, 1)));
}

#[test]
fn invalid_motion_is_an_error_or_a_note_with_its_place() {
    let folder = bar();
    let text = std::fs::read_to_string(folder.path("a.gltf")).unwrap();
    let bytes = std::fs::read(folder.path("b.bin")).unwrap();
    let attempt = |from: &str, to: &str| {
        assert!(text.contains(from), "{from}");
        folder.write("a.gltf", text.replacen(from, to, 1));
        match load(&folder, &[("time", "0.5")]) {
            Ok((desc, notes)) => {
                let _ = compile(&desc);
                lines(&notes)
            }
            Err(e) => e.to_string(),
        }
    };
    for (from, to, expected) in [
        (
            r#""joints": [1, 2]"#,
            r#""joints": [1]"#,
            "JOINTS_0: vertex 1 has joint 1 of 1",
        ),
        (
            r#""joints": [1, 2]"#,
            r#""joints": [1, 9]"#,
            "skins[0]: expected an index below 3",
        ),
        (
            r#""joints": [1, 2]"#,
            r#""joints": [1, 2, 0]"#,
            "skins[0]: 3 joints have fewer inverse",
        ),
        (
            r#""nodes": [0, 1]"#,
            r#""nodes": [0, 2]"#,
            "joint nodes[1] is not in the scene",
        ),
        (
            r#""skin": 0"#,
            r#""skin": 5"#,
            "nodes[0]: expected an index below 1 of `skins`",
        ),
        (
            r#""JOINTS_0""#,
            r#""JOINTS_9""#,
            "its mesh has no `JOINTS_0`; the skin is ignored",
        ),
        (
            r#""WEIGHTS_0""#,
            r#""WEIGHTS_9""#,
            "JOINTS_0: expected an index",
        ),
        (
            r#""WEIGHTS_0": 4"#,
            r#""WEIGHTS_0": 7"#,
            "joints or weights are not those of 3 vertices",
        ),
        (r#""children": [2]"#, r#""children": [1]"#, "cycle"),
        (
            r#""output": 7"#,
            r#""output": 3"#,
            "12 numbers are not 1 x 4 for 2 times",
        ),
        (
            r#""input": 6"#,
            r#""input": 4"#,
            "expected elements of 1 numbers",
        ),
        (
            r#""input": 6"#,
            r#""input": 60"#,
            "channels[0]: expected an index",
        ),
        (
            r#""sampler": 0"#,
            r#""sampler": 1"#,
            "channels[0]: there is no such sampler",
        ),
        (
            r#""output": 7"#,
            r#""output": 7, "interpolation": "BEZIER""#,
            "unknown interpolation `BEZIER`",
        ),
        (
            r#""path": "rotation""#,
            r#""path": "pointer""#,
            "`KHR_animation_pointer` is not supported",
        ),
        (
            r#""path": "rotation""#,
            r#""path": "colour""#,
            "its path `colour` is unknown",
        ),
        (
            r#""path": "rotation""#,
            r#""path": "weights""#,
            "its node has no mesh",
        ),
        (r#""node": 2"#, r#""extras": 2"#, "its target is no node"),
        (
            r#""translation": [0, 1, 0]"#,
            r#""matrix": [1]"#,
            "has a `matrix`, which cannot be animated",
        ),
    ] {
        let found = attempt(from, to);
        assert!(found.contains(expected), "{to}: {found}");
    }
    // Times of the rotation that do not increase or are no numbers, and a vertex without weights.
    let place = |accessor: usize| {
        let view = text.split("\"byteOffset\": ").nth(accessor + 1).unwrap();
        view.split(',').next().unwrap().parse::<usize>().unwrap()
    };
    for (at, value, expected) in [
        (place(6), 2.0f32, "times must increase"),
        (
            place(6),
            f32::NAN,
            "accessors[6]: the numbers must be finite",
        ),
        (
            place(4),
            0.0,
            "1 vertices without weights of joints are not moved",
        ),
        (
            place(5) + 80,
            f32::MAX,
            "primitives[0]: its morph targets or joints move a vertex",
        ),
    ] {
        let mut bytes = bytes.clone();
        bytes[at..at + 4].copy_from_slice(&value.to_le_bytes());
        folder.write("b.bin", bytes);
        folder.write("a.gltf", &text);
        let found = match load(&folder, &[("time", "0.5")]) {
            Ok((desc, notes)) => compile(&desc)
                .err()
                .map_or(lines(&notes), |e| e.to_string()),
            Err(e) => e.to_string(),
        };
        assert!(found.contains(expected), "{value}: {found}");
    }
}
