//! Instances of glTF: `EXT_mesh_gpu_instancing`.

use std::sync::Arc;

use super::gltf_motion::{Builder, assert_near, assert_refused, load};
use super::{Folder, lines, mesh_of};

/// Returns a document of a triangle with three instances, at two of which it is turned by 90 degrees
/// about z, below a node at (10, 0, 0). `extra` are further attributes.
fn folder(extra: &str) -> Folder {
    let mut b = Builder::default();
    let mesh = b.floats("VEC3", &[0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0]);
    let at = b.floats("VEC3", &[1.0, 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 3.0]);
    // Normalised bytes: no rotation, and one of 90 degrees twice, as q and as -q.
    let turn = [0, 0, 0, 127u8, 0, 0, 90, 90, 0, 0, 166, 166];
    let turn = b.packed(&turn, 5120, "VEC4", 3);
    let scale = b.floats("VEC3", &[1.0, 1.0, 1.0, 2.0, 1.0, 1.0, 1.0, -1.0, 1.0]);
    b.folder(&format!(
        r#""extensionsRequired": ["EXT_mesh_gpu_instancing"], "scenes": [ {{ "nodes": [0] }} ],
"nodes": [ {{ "translation": [10, 0, 0], "children": [1] }}, {{ "name": "leaf", "mesh": 0, "extensions": {{ "EXT_mesh_gpu_instancing":
  {{ "attributes": {{ "TRANSLATION": {at}, "ROTATION": {turn}, "SCALE": {scale}{extra} }} }} }} }} ],
"meshes": [ {{ "primitives": [ {{ "attributes": {{ "POSITION": {mesh} }} }} ] }} ]"#
    ))
}

#[test]
fn instances_share_a_mesh_at_their_places() {
    let folder = folder(r#", "_ID": 0, "COLOR_0": 0"#);
    let (desc, notes) = load(&folder, &[]).unwrap();
    let names: Vec<&str> = desc.entities.iter().map(|e| e.name.as_str()).collect();
    assert_eq!(names, ["leaf", "leaf_2", "leaf_3"]);
    let corner = |i: usize, p: [f64; 3]| {
        assert!(Arc::ptr_eq(mesh_of(&desc, i), mesh_of(&desc, 0)));
        let world = desc.entities[i].transform.to_world();
        world.transform_point3(p.into()).as_vec3()
    };
    let [x, y] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
    assert_near(
        &[corner(0, x), corner(0, y)],
        &[[12.0, 0.0, 0.0], [11.0, 1.0, 0.0]],
    );
    assert_near(
        &[corner(1, x), corner(1, y)],
        &[[10.0, 4.0, 0.0], [9.0, 2.0, 0.0]],
    );
    assert_near(
        &[corner(2, x), corner(2, y)],
        &[[10.0, 1.0, 3.0], [11.0, 0.0, 3.0]],
    );
    let notes = lines(&notes);
    assert!(
        notes.contains("nodes[1].EXT_mesh_gpu_instancing: the attribute `COLOR_0`"),
        "{notes}"
    );
    assert!(!notes.contains("_ID"), "{notes}");
}

#[test]
fn invalid_instances_are_errors_with_their_place() {
    let folder = folder("");
    let edits = [
        (
            r#""TRANSLATION": 1"#,
            r#""TRANSLATION": 2"#,
            "accessors[2]: expected elements of 3",
        ),
        (
            r#""TRANSLATION": 1"#,
            r#""TRANSLATION": -1"#,
            "expected an index",
        ),
        (
            r#""count": 3, "type": "VEC4""#,
            r#""count": 2, "type": "VEC4""#,
            "found [3, 2, 3]",
        ),
        (
            r#""count": 3, "type": "VEC4""#,
            r#""count": 1000000000, "type": "VEC4""#,
            "accessors[2]",
        ),
        (
            r#""TRANSLATION": 1, "ROTATION": 2, "SCALE": 3"#,
            "",
            "equal length, found []",
        ),
    ];
    assert_refused(&folder, "a.gltf", &edits);
}
