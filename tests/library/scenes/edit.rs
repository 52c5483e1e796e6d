//! Edits by path, and their effect on the identity of a scene.

use std::collections::BTreeMap;

use glam::Vec3;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::{
    CameraKind, EnvironmentDesc, EnvironmentSampling, EnvironmentSource, MATERIAL_PARAMS,
    ShapeDesc, TextureSlot, content_hash,
};
use lumbre_light::value::Value;
use lumbre_light::value::schema::Ty;
use lumbre_scene_io::edit::{apply, paths, set};
use lumbre_scene_io::load::load;

use super::{Folder, QUAD, builtin_path};

fn scene() -> SceneDesc {
    let text = r#"{ "camera": { "position": [0, 0, 5], "f_number": 4, "focal_length": 0.05 },
        "materials": [ { "name": "egg", "opacity": 0 }, { "name": "wall.left" }, { "name": "lamp", "emission": [5, 5, 5] } ],
        "entities": [ { "type": "mesh", "file": "table.v2.obj", "material": "wall.left" },
                      { "type": "sphere", "radius": 1, "material": "egg" } ] }"#;
    Folder::new(&[("a.scn", text), ("table.v2.obj", QUAD)])
        .load("a.scn")
        .unwrap()
        .0
}

fn nums(xs: &[f64]) -> Value {
    Value::List(xs.iter().map(|x| Value::number(*x)).collect())
}

#[test]
fn edits_set_the_value_at_their_path() {
    let mut s = scene();
    set(&mut s, "materials.egg.ior", &Value::Num(1.33)).unwrap();
    set(
        &mut s,
        "materials.wall.left.base_color",
        &nums(&[0.1, 0.2, 0.3]),
    )
    .unwrap();
    set(&mut s, "camera.fov", &Value::Int(30)).unwrap();
    set(&mut s, "camera.focus_distance", &Value::Num(2.5)).unwrap();
    set(&mut s, "camera.up", &nums(&[0.0, 0.0, 1.0])).unwrap();
    set(&mut s, "resolution", &nums(&[64.0, 32.0])).unwrap();
    set(&mut s, "max_depth", &Value::Int(9)).unwrap();
    set(
        &mut s,
        "entities.table.v2.rotation_deg",
        &nums(&[0.0, 180.0, 0.0]),
    )
    .unwrap();
    set(&mut s, "entities.table.v2.material", &"egg".into()).unwrap();
    set(&mut s, "entities.sphere.radius", &Value::Num(0.25)).unwrap();
    assert_eq!(
        (s.materials[0].ior, s.materials[1].base_color.z),
        (1.33, 0.3)
    );
    assert_eq!(
        (s.camera.view_deg(), s.camera.focus_distance, s.camera.up.z),
        (30.0, Some(2.5), 1.0)
    );
    assert_eq!((s.resolution, s.max_depth), ([64, 32], 9));
    assert_eq!(s.entities[0].transform.rotate_rad.y, std::f32::consts::PI);
    assert_eq!(s.entities[0].material.as_deref(), Some("egg"));
    assert_eq!(s.entities[1].shape, ShapeDesc::Sphere { radius: 0.25 });
}

#[test]
fn a_star_selects_every_material_that_does_not_emit() {
    let mut s = scene();
    set(&mut s, "materials.*.metallic", &Value::Int(1)).unwrap();
    assert_eq!(
        s.materials.iter().map(|m| m.metallic).collect::<Vec<_>>(),
        [1.0, 1.0, 0.0]
    );
    let e = set(&mut s, "materials.*.metalic", &Value::Int(1))
        .unwrap_err()
        .to_string();
    assert!(e.contains("did you mean `metallic`?"), "{e}");
    assert!(set(&mut s, "materials.*.metallic", &Value::Int(2)).is_err());
}

/// The choices of filter and normals count for the identity only where they differ from the default.
#[test]
fn switches_of_studies_change_the_hash_only_away_from_their_defaults() {
    let before = content_hash(&scene());
    for (param, default, other) in [
        ("texture_filter", "given", "nearest"),
        ("shading_normals", "smooth", "flat"),
    ] {
        let path = format!("materials.*.{param}");
        let mut s = scene();
        set(&mut s, &path, &default.into()).unwrap();
        assert_eq!(content_hash(&s), before, "{param}");
        set(&mut s, &path, &other.into()).unwrap();
        assert_ne!(content_hash(&s), before, "{param}");
        let e = set(&mut s, &path, &"smoth".into()).unwrap_err().to_string();
        assert!(e.contains(default), "{e}");
    }
    let mut s = scene();
    let missing = set(&mut s, "environment.sampling", &"uniform".into());
    assert!(missing.unwrap_err().to_string().contains("no environment"));
    s.environment = Some(EnvironmentDesc {
        sampling: EnvironmentSampling::Luminance,
        ..EnvironmentDesc::new(EnvironmentSource::Color(Vec3::ONE))
    });
    let before = content_hash(&s);
    set(&mut s, "environment.sampling", &"luminance".into()).unwrap();
    assert_eq!(content_hash(&s), before);
    set(&mut s, "environment.sampling", &"uniform".into()).unwrap();
    assert_ne!(content_hash(&s), before);
}

#[test]
fn failed_edits_suggest_the_nearest_name_and_change_nothing() {
    let cases = [
        (
            "material.egg.ior",
            Value::Int(1),
            "unknown setting `material`",
            "did you mean `materials`?",
        ),
        (
            "camera.fow",
            Value::Int(1),
            "unknown key `fow`",
            "did you mean `fov`?",
        ),
        ("camera", Value::Int(1), "expected a string", ""),
        ("camera", "left".into(), "the scene has no views", ""),
        (
            "materials.eg.ior",
            Value::Int(1),
            "unknown material `eg`",
            "did you mean `egg`?",
        ),
        (
            "materials.egg.rougness",
            Value::Int(1),
            "unknown material parameter",
            "did you mean `roughness`?",
        ),
        (
            "materials.egg",
            Value::Int(1),
            "expected `materials.NAME.PARAMETER`",
            "",
        ),
        (
            "entities.spere.radius",
            Value::Int(1),
            "unknown entity `spere`",
            "did you mean `sphere`?",
        ),
        (
            "entities.sphere.raduis",
            Value::Int(1),
            "unknown entity parameter",
            "did you mean `radius`?",
        ),
        (
            "entities.sphere.scale",
            nums(&[1.0; 3]),
            "`sphere` is a sphere, which has no `scale`",
            "known: position, radius",
        ),
        (
            "entities.table.v2.radius",
            Value::Int(1),
            "`table.v2` is a mesh, which has no `radius`",
            "rotation_deg",
        ),
        (
            "entities.sphere.material",
            "eggs".into(),
            "unknown material `eggs`",
            "did you mean `egg`?",
        ),
        (
            "materials.egg.opacity",
            Value::Num(1.5),
            "1.5 is out of range",
            "",
        ),
        (
            "materials.egg.opacity",
            "all".into(),
            "expected a number",
            "",
        ),
        (
            "materials.egg.emission",
            nums(&[1.0, 2.0]),
            "found 2 items",
            "",
        ),
        (
            "materials.egg.ior",
            Value::Num(f64::NAN),
            "out of range",
            "",
        ),
        (
            "resolution",
            nums(&[1.5, 2.0]),
            "expected whole numbers of pixels",
            "",
        ),
        ("resolution", nums(&[0.0, 2.0]), "out of range", ""),
        ("max_depth", Value::Int(0), "out of range", ""),
        (
            "camera.position",
            nums(&[1e30, 0.0, 0.0]),
            "out of range",
            "",
        ),
        (
            "",
            Value::Int(1),
            "unknown setting ``",
            "known: camera, resolution, max_depth, materials, entities",
        ),
    ];
    for (path, value, problem, help) in cases {
        let before = scene();
        let mut s = before.clone();
        let e = set(&mut s, path, &value).unwrap_err();
        let text = e.to_string();
        assert!(
            text.contains(problem) && text.contains(help),
            "{path}: {text}"
        );
        assert!(e.path.starts_with(path), "{path}: {}", e.path);
        assert_eq!(s, before, "{path}");
    }
}

#[test]
fn later_lens_parameters_replace_earlier_ones_and_conflicts_in_one_edit_are_errors() {
    let changes = |pairs: &[(&str, f64)]| -> BTreeMap<String, Value> {
        pairs
            .iter()
            .map(|(key, x)| (format!("camera.{key}"), Value::number(*x)))
            .collect()
    };
    let plain = || Folder::new(&[("a.scn", "{}")]).load("a.scn").unwrap().0;
    let mut s = plain();
    apply(
        &mut s,
        &changes(&[
            ("f_number", 2.0),
            ("focal_length", 0.05),
            ("sensor_height", 0.024),
        ]),
    )
    .unwrap();
    assert!((s.camera.view_deg() - 26.99).abs() < 0.01 && s.camera.lens_diameter() == 0.025);
    // A later edit replaces an earlier one, in both directions.
    apply(&mut s, &changes(&[("aperture", 0.5)])).unwrap();
    assert_eq!(s.camera.lens_diameter(), 0.5);
    apply(&mut s, &changes(&[("f_number", 4.0)])).unwrap();
    assert_eq!(s.camera.lens_diameter(), 0.0125);
    // The same lens by other parameters is the same scene.
    let mut same = plain();
    apply(
        &mut same,
        &changes(&[
            ("aperture", 0.0125),
            ("fov", f64::from(s.camera.view_deg())),
        ]),
    )
    .unwrap();
    assert_eq!(content_hash(&s), content_hash(&same));
    // A sensor and a field of view determine a focal length.
    let mut zoom = plain();
    apply(
        &mut zoom,
        &changes(&[("f_number", 1.0), ("sensor_height", 0.1), ("fov", 90.0)]),
    )
    .unwrap();
    assert!((zoom.camera.lens_diameter() - 0.05).abs() < 1e-6);
    let refused: [(&[(&str, f64)], &str); 4] = [
        (
            &[("aperture", 0.1), ("f_number", 2.0), ("focal_length", 0.05)],
            "camera.f_number: `aperture` is set as well",
        ),
        (
            &[
                ("fov", 40.0),
                ("focal_length", 0.05),
                ("sensor_height", 0.024),
            ],
            "camera.fov: the field of view is already determined by `sensor_height` and",
        ),
        (
            &[("f_number", 2.0)],
            "camera.f_number: an f-number has no effect without a `focal_length`",
        ),
        (
            &[("f_number", 0.0), ("focal_length", 0.05)],
            "camera.f_number: 0 is out of range",
        ),
    ];
    for (pairs, text) in refused {
        let e = apply(&mut plain(), &changes(pairs))
            .unwrap_err()
            .to_string();
        assert!(e.starts_with(text), "{pairs:?}: {e}");
    }
}

/// Returns a value for a path that differs from its default.
fn other_value(path: &str) -> Value {
    let last = path.rsplit('.').next().unwrap();
    if TextureSlot::from_name(last).is_some() {
        return builtin_path("material_ball/checks.png")
            .to_str()
            .unwrap()
            .into();
    }
    if let Some(row) = MATERIAL_PARAMS
        .iter()
        .find(|row| path.starts_with("materials.") && row.name == last)
    {
        return match row.ty {
            Ty::Nums { len, .. } => nums(&[0.25, 0.75, 0.125][..len]),
            Ty::Word(words) => words[1].into(),
            Ty::Bool => Value::Bool(true),
            Ty::List(Ty::Str) => Value::List(vec!["lamp".into()]),
            Ty::List(_) => nums(&[0.25, 0.75]),
            _ => Value::Num(0.375),
        };
    }
    match last {
        "resolution" => nums(&[12.0, 34.0]),
        "max_depth" => Value::Int(17),
        "material" => "lamp".into(),
        "kind" => "orthographic".into(),
        "window" => nums(&[0.25, 0.75, 0.5, 1.0]),
        "fov" | "aperture" | "f_number" | "focal_length" | "sensor_height" | "focus_distance"
        | "radius" | "view_height" => Value::Num(0.375),
        _ => nums(&[0.25, 0.75, 0.125]),
    }
}

#[test]
fn every_path_can_be_set_and_gives_a_distinct_hash() {
    let base = content_hash(&scene());
    let mut seen = BTreeMap::from([(base, "nothing".to_owned())]);
    let all = paths(&scene());
    assert_eq!(
        all.len(),
        14 + 4 * (MATERIAL_PARAMS.len() + TextureSlot::ALL.len()) + 5 + 4
    );
    for path in all {
        let mut s = scene();
        if path == "camera.view_height" {
            // Only orthographic cameras have one.
            s.camera.kind = CameraKind::Orthographic;
        }
        set(&mut s, &path, &other_value(&path)).unwrap_or_else(|e| panic!("{e}"));
        if let Some(other) = seen.insert(content_hash(&s), path.clone()) {
            panic!("{path} and {other} have the same hash");
        }
        set(&mut s, &path, &other_value(&path)).unwrap();
        assert!(
            seen.contains_key(&content_hash(&s)),
            "setting the same value again changes the hash"
        );
    }
}

#[test]
fn the_hash_does_not_depend_on_folders_and_names_of_files() {
    let original = builtin_path("cornell/cornell.scn");
    let text = std::fs::read_to_string(&original).unwrap();
    let folder = Folder::new(&[("moved.scn", &text.replace("room.obj", "chamber.obj"))]);
    for (from, to) in [
        ("room", "chamber"),
        ("short_block", "short_block"),
        ("tall_block", "tall_block"),
    ] {
        std::fs::copy(
            builtin_path(&format!("cornell/{from}.obj")),
            folder.path(&format!("{to}.obj")),
        )
        .unwrap();
    }
    let (here, there) = (
        load(&original).unwrap().0,
        folder.load("moved.scn").unwrap().0,
    );
    assert_ne!(here.entities[0].name, there.entities[0].name);
    assert_eq!(content_hash(&here), content_hash(&there));
    let obj = std::fs::read_to_string(folder.path("chamber.obj")).unwrap();
    folder.write("chamber.obj", obj.replacen("v 0.5528", "v 0.5529", 1));
    assert_ne!(
        content_hash(&here),
        content_hash(&folder.load("moved.scn").unwrap().0)
    );
}
