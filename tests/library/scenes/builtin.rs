//! The scenes in `scenes/`: they load without a note, and their lights and cameras face the right
//! way.

use glam::Vec3;
use lumbre_light::scene::compile::NONE;
use lumbre_light::scene::{CompiledScene, SceneDesc, compile};
use lumbre_scene_io::load::load;

use super::builtin_path;

/// Files of the built-in scenes.
const SCENES: [&str; 7] = [
    "cornell/cornell.scn",
    "cornell_spheres/cornell_spheres.scn",
    "veach_lamps/veach_lamps.scn",
    "material_ball/material_ball.scn",
    "masked_leaves/masked_leaves.scn",
    "lamp_row/lamp_row.scn",
    "edges/edges.scn",
];

/// Loads and compiles a built-in scene. Panics if there are notes.
fn builtin(name: &str) -> (SceneDesc, CompiledScene) {
    let (desc, notes) = load(&builtin_path(name)).unwrap_or_else(|e| panic!("{e}"));
    assert!(notes.is_empty(), "{name}: {notes:?}");
    let (scene, notes) = compile(&desc).unwrap();
    assert!(notes.is_empty(), "{name}: {notes:?}");
    (desc, scene)
}

fn front(scene: &CompiledScene, primitive: u32) -> Vec3 {
    let [a, b, c] = scene.triangles[primitive as usize];
    (b - a).cross(c - a).normalize_or(Vec3::ZERO)
}

/// Returns the distance to a triangle along a ray, from either side.
fn hit(triangle: &[Vec3; 3], origin: Vec3, direction: Vec3) -> Option<f32> {
    let [a, b, c] = *triangle;
    let (e1, e2) = (b - a, c - a);
    let p = direction.cross(e2);
    let det = e1.dot(p);
    let s = origin - a;
    let q = s.cross(e1);
    let (u, v, t) = (s.dot(p) / det, direction.dot(q) / det, e2.dot(q) / det);
    (det.abs() > 1e-12 && u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4).then_some(t)
}

/// Returns the nearest triangle along a ray.
fn nearest(scene: &CompiledScene, origin: Vec3, direction: Vec3) -> Option<(usize, f32)> {
    let hits = scene
        .triangles
        .iter()
        .enumerate()
        .filter_map(|(i, t)| Some((i, hit(t, origin, direction)?)));
    hits.min_by(|a, b| a.1.total_cmp(&b.1))
}

#[test]
fn every_builtin_scene_is_listed_and_loads_without_notes() {
    let mut found = Vec::new();
    for folder in std::fs::read_dir(builtin_path(""))
        .unwrap()
        .map(|e| e.unwrap().path())
        .filter(|p| p.is_dir())
    {
        for file in std::fs::read_dir(folder)
            .unwrap()
            .map(|e| e.unwrap().path())
        {
            let size = file.metadata().unwrap().len();
            assert!(size < 60_000, "{} has {size} bytes", file.display());
            if file.extension().is_some_and(|e| e == "scn") {
                found.push(file);
            }
        }
    }
    assert_eq!(found.len(), SCENES.len());
    let readme = std::fs::read_to_string(builtin_path("README.md")).unwrap();
    for name in SCENES {
        let (_, scene) = builtin(name);
        assert!(!scene.emitters.is_empty() && found.iter().any(|f| f.ends_with(name)));
        assert!(
            readme.contains(name),
            "scenes/README.md does not describe {name}"
        );
    }
}

#[test]
fn lights_of_the_cornell_boxes_fill_the_hole_in_the_ceiling_and_face_down() {
    for (name, triangles, spheres) in [
        (SCENES[0], 2 + 8 + 2 + 2 + 2 + 2 + 20, 0),
        (SCENES[1], 18, 2),
    ] {
        let (_, scene) = builtin(name);
        assert_eq!(
            (
                scene.triangles.len(),
                scene.spheres.len(),
                scene.emitters.len()
            ),
            (triangles, spheres, 2)
        );
        let area: f32 = scene.emitters.iter().map(|e| e.area).sum();
        assert!((area - 0.13 * 0.105).abs() < 1e-6);
        for e in &scene.emitters {
            assert!((front(&scene, e.primitive) - Vec3::NEG_Y).length() < 1e-6);
        }
        let down: f32 = (0..scene.triangles.len() as u32)
            .filter(|i| front(&scene, *i).y < -0.999)
            .map(|i| {
                let [a, b, c] = scene.triangles[i as usize];
                (b - a).cross(c - a).length() / 2.0
            })
            .sum();
        assert!(
            (down - 0.556 * 0.5592).abs() < 1e-5,
            "ceiling and light have a gap or an overlap: {down}"
        );
    }
}

#[test]
fn every_surface_of_the_cornell_room_faces_inwards_and_the_camera_looks_in() {
    let (desc, scene) = builtin(SCENES[0]);
    let center = Vec3::new(0.278, 0.27, 0.05);
    for i in 0..18u32 {
        let [a, ..] = scene.triangles[i as usize];
        assert!(front(&scene, i).dot(center - a) > 0.0, "triangle {i}");
    }
    let fov = 2.0 * (12.5f32 / 35.0).atan().to_degrees();
    assert!((desc.camera.view_deg() - fov).abs() < 1e-3);
    let axis = (desc.camera.target - desc.camera.position).normalize_or(Vec3::Z);
    let (seen, _) = nearest(&scene, desc.camera.position, axis).unwrap();
    assert!(front(&scene, seen as u32).dot(axis) < 0.0);
    assert_eq!(scene.bounds[0], Vec3::ZERO);
    assert!((scene.bounds[1] - Vec3::new(0.556, 0.5488, 0.5592)).length() < 1e-6);
}

#[test]
fn the_blocks_of_the_cornell_box_face_outwards() {
    let (desc, scene) = builtin(SCENES[0]);
    assert_eq!(
        desc.entities
            .iter()
            .map(|e| e.name.as_str())
            .collect::<Vec<_>>(),
        ["room", "short_block", "tall_block"]
    );
    for (first, height) in [(18, 0.165), (28, 0.33)] {
        let block: Vec<u32> = (first..first + 10).collect();
        let corners = || block.iter().flat_map(|i| scene.triangles[*i as usize]);
        let center = corners().sum::<Vec3>() / corners().count() as f32;
        assert!(
            block
                .iter()
                .all(|i| front(&scene, *i).dot(scene.triangles[*i as usize][0] - center) > 0.0)
        );
        assert_eq!(corners().map(|p| p.y).fold(0.0, f32::max), height);
    }
}

#[test]
fn the_veach_lamps_are_hidden_from_the_camera_and_light_the_room() {
    let (desc, scene) = builtin(SCENES[2]);
    let camera = desc.camera.position;
    let center = (scene.bounds[0] + scene.bounds[1]) / 2.0;
    let row = |name: &str| desc.material_index(name).unwrap() as u32;
    for (lamp, axis) in [
        ("floor_light", Vec3::Y),
        ("spot_light", Vec3::new(-1.2, -0.8, 0.5)),
    ] {
        let light: Vec<u32> = scene
            .emitters
            .iter()
            .map(|e| e.primitive)
            .filter(|p| scene.material_of(*p, NONE) == row(lamp))
            .collect();
        assert!(!light.is_empty());
        for &p in &light {
            let normal = front(&scene, p);
            assert!(
                (normal - axis.normalize_or(Vec3::Y)).length() < 1e-3,
                "{lamp} does not face along its axis: {normal}"
            );
            let middle = scene.triangles[p as usize].iter().sum::<Vec3>() / 3.0;
            let (seen, t) =
                nearest(&scene, camera, (middle - camera).normalize_or(Vec3::Z)).unwrap();
            assert!(
                t < (middle - camera).length() - 1e-3
                    || front(&scene, seen as u32).dot(middle - camera) > 0.0
            );
            assert_ne!(seen, p as usize, "the camera sees {lamp}");
            let (first, _) = nearest(&scene, middle, normal).unwrap();
            let far = scene.material_of(first as u32, NONE);
            assert!(
                far == row("ceiling") || far == row("egg"),
                "{lamp} is blocked by {}",
                desc.materials[far as usize].name
            );
        }
    }
    assert!(
        scene.emitters.len() > 20,
        "too few emitting triangles for two discs"
    );
    for i in 0..12u32 {
        assert!(
            front(&scene, i).dot(center - scene.triangles[i as usize][0]) > 0.0,
            "triangle {i} of the room does not face inwards"
        );
    }
    for i in 0..scene.triangles.len() {
        if scene.attributes[i].material == row("egg") {
            let [a, b, c] = scene.triangles[i];
            assert!(
                front(&scene, i as u32).dot((a + b + c) / 3.0 - Vec3::new(0.1, 0.9, -0.1)) > 0.0
            );
        }
    }
    let (seen, _) = nearest(
        &scene,
        camera,
        (Vec3::new(0.1, 0.88, -0.1) - camera).normalize_or(Vec3::Z),
    )
    .unwrap();
    assert_eq!(
        scene.material_of(seen as u32, NONE),
        row("egg"),
        "the camera does not see the egg"
    );
}

#[test]
fn the_studio_faces_its_ball_and_the_mask_of_the_leaves_has_many_levels() {
    let (desc, scene) = builtin(SCENES[3]);
    let ball = &scene.spheres[0];
    assert_eq!(desc.materials[ball.material as usize].name, "ball");
    let mut lit = 0;
    for i in 0..scene.triangles.len() as u32 {
        let [a, ..] = scene.triangles[i as usize];
        let inwards = front(&scene, i).dot(ball.center - a) > 0.0;
        // All triangles face the ball, except the pedestal below it.
        let base = desc.materials[scene.material_of(i, NONE) as usize].name == "base";
        assert!(base || inwards, "triangle {i}");
        let axis = Vec3::new(0.0, a.y, 0.0);
        assert!(
            !base || front(&scene, i).dot(a - axis) > -1e-6 || front(&scene, i).y > 0.0,
            "triangle {i}"
        );
        lit += usize::from(scene.attributes[i as usize].emitter != u32::MAX);
    }
    assert_eq!(lit, 4);
    let to_ball = (ball.center - desc.camera.position).normalize_or(Vec3::Z);
    let (_, t) = nearest(&scene, desc.camera.position, to_ball).unwrap();
    assert!(
        t > (ball.center - desc.camera.position).length(),
        "a triangle hides the ball from the camera"
    );
    let (desc, scene) = builtin(SCENES[4]);
    let leaf = scene.materials[desc.material_index("leaf").unwrap()];
    let mask = &scene.textures[leaf.mask_texture as usize];
    let share = |low: f32| {
        mask.texels.iter().filter(|t| t[0] >= low).count() as f32 / mask.texels.len() as f32
    };
    // Every threshold of the study keeps a different share.
    let shares = [0.1, 0.3, 0.5, 0.7, 0.9].map(share);
    assert!(
        shares.windows(2).all(|w| w[0] > w[1] + 0.02) && shares[0] < 0.8 && shares[4] > 0.02,
        "{shares:?}"
    );
}
