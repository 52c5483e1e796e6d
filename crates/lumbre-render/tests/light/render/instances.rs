//! Instances of shared meshes, compared with the same scene with separate triangles for each.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine3A, DVec3, Mat3, Quat, Vec2, Vec3};
use lumbre_light::film::Film;
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{NONE, Sharing, compile_sharing};
use lumbre_light::scene::desc::place::double;
use lumbre_light::scene::desc::{
    CameraDesc, EntityDesc, EnvironmentDesc, EnvironmentSource, MaterialDesc, MeshDesc, SceneDesc,
    ShapeDesc, TextureDesc, TextureSlot, Transform, mesh_hash,
};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::surface::Surface;
use lumbre_render::Job;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_render::cpu::bvh::simd::Isa;
use lumbre_render::hierarchy::{AccelSpec, Builder};

use crate::common::{named_job, render};
use crate::render::intersection::{numbers, point};

fn mesh(
    positions: Vec<Vec3>,
    normals: Vec<Vec3>,
    triangles: Vec<[u32; 3]>,
    slots: &[&str],
) -> Arc<MeshDesc> {
    let mut m = MeshDesc {
        file: PathBuf::from("m.obj"),
        uvs: positions.iter().map(|p| Vec2::new(p.x, p.y)).collect(),
        colors: positions.iter().map(|p| p.abs().fract()).collect(),
        positions,
        normals,
        triangle_slot: (0..triangles.len() as u32)
            .map(|i| i % slots.len() as u32)
            .collect(),
        triangles,
        slots: slots.iter().map(|s| (*s).to_owned()).collect(),
        ..MeshDesc::default()
    };
    m.content_hash = mesh_hash(&m);
    Arc::new(m)
}

/// Returns triangles of all sizes, with unrelated normals or none.
pub fn soup(seed: u32, count: u32, normals: bool, slots: &[&str]) -> Arc<MeshDesc> {
    let mut next = numbers(seed);
    let mut positions = Vec::new();
    for i in 0..count {
        let size = if i % 3 == 0 { 1.0 } else { 0.15 };
        let a = point(&mut next);
        positions.extend([a, a + point(&mut next) * size, a + point(&mut next) * size]);
    }
    let normals = if normals {
        positions
            .iter()
            .map(|_| uniform_sphere([next(), next()]))
            .collect()
    } else {
        vec![]
    };
    mesh(
        positions,
        normals,
        (0..count).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect(),
        slots,
    )
}

/// Returns a random transform: rotated, scaled non-uniformly, and every third time mirrored and
/// sheared.
pub fn random_transform(
    next: &mut impl FnMut() -> f32,
    i: u32,
    spread: f32,
    size: f32,
) -> Transform {
    let turn = Quat::from_axis_angle(uniform_sphere([next(), next()]), 6.0 * next());
    let mut scale = Vec3::new(0.5 + next(), 0.5 + next(), 0.5 + next()) * size;
    let mut shear = Mat3::IDENTITY;
    if i.is_multiple_of(3) {
        scale.x = -scale.x;
        shear = Mat3::from_cols(Vec3::X, Vec3::new(0.3, 1.0, 0.0), Vec3::Z);
    }
    let linear = Mat3::from_quat(turn) * shear * Mat3::from_diagonal(scale);
    let frame = Affine3A::from_mat3_translation(linear, point(next) * spread);
    Transform::framed(double(frame))
}

pub fn entity(
    name: String,
    shape: ShapeDesc,
    transform: Transform,
    material: Option<&str>,
) -> EntityDesc {
    EntityDesc {
        name,
        transform,
        material: material.map(str::to_owned),
        anisotropic_direction: None,
        shape,
    }
}

pub fn desc(materials: Vec<MaterialDesc>, entities: Vec<EntityDesc>) -> SceneDesc {
    SceneDesc {
        resolution: [32, 24],
        max_depth: 4,
        camera: CameraDesc::pinhole(Vec3::new(0.0, 1.0, 9.0), Vec3::ZERO, 45.0),
        materials: materials.into(),
        entities: entities.into(),
        ..SceneDesc::default()
    }
}

/// Returns instances of three soups among other triangles and spheres, some of everything emitting.
fn mixed_scene(seed: u32, count: u32) -> SceneDesc {
    let mut next = numbers(seed);
    let materials = vec![
        MaterialDesc {
            base_color: Vec3::new(0.7, 0.5, 0.3),
            roughness: 0.4,
            ..MaterialDesc::new("a")
        },
        MaterialDesc {
            base_color: Vec3::splat(0.6),
            shadow_terminator: true,
            ..MaterialDesc::new("b")
        },
        MaterialDesc {
            emission: Vec3::new(4.0, 5.0, 6.0),
            ..MaterialDesc::new("lamp")
        },
    ];
    let meshes = [
        soup(seed + 1, 40, true, &["a", "b"]),
        soup(seed + 2, 9, false, &["a", "lamp"]),
        soup(seed + 3, 90, true, &["b"]),
    ];
    let mut entities = Vec::new();
    for i in 0..count {
        let own = [None, Some("a"), Some("lamp"), None][(i / 3) as usize % 4];
        let shape = ShapeDesc::Mesh(Arc::clone(&meshes[i as usize % 3]));
        entities.push(entity(
            format!("copy {i}"),
            shape,
            random_transform(&mut next, i, 3.0, 0.4),
            own,
        ));
    }
    let single = ShapeDesc::Mesh(soup(seed + 4, 30, false, &["a", "b"]));
    entities.insert(
        1,
        entity("single".to_owned(), single, Transform::default(), None),
    );
    for i in 0..5 {
        let moved = Transform {
            translate: (point(&mut next) * 3.0).as_dvec3(),
            ..Transform::default()
        };
        entities.push(entity(
            format!("ball {i}"),
            ShapeDesc::Sphere { radius: 0.3 },
            moved,
            Some(["b", "lamp"][i % 2]),
        ));
    }
    desc(materials, entities)
}

/// Compiles a scene with every possible mesh shared.
pub fn compile_shared(desc: &SceneDesc) -> Arc<CompiledScene> {
    Arc::new(compile_sharing(desc, Sharing::Always).unwrap().0)
}

/// Returns the scene with separate triangles for each instance.
pub fn flattened_scene(scene: &CompiledScene) -> Arc<CompiledScene> {
    Arc::new(scene.flattened(usize::MAX).unwrap())
}

/// Returns the id of a hit's primitive in the flattened scene.
fn flat_primitive(scene: &CompiledScene, flat: &CompiledScene, hit: &Hit) -> u32 {
    let sphere = (hit.primitive as usize).checked_sub(scene.triangles.len());
    sphere.map_or_else(
        || scene.unique_id(hit.primitive, hit.instance),
        |i| (flat.triangles.len() + i) as u32,
    )
}

#[test]
fn hits_on_instances_equal_hits_on_flattened_triangles() {
    let (mut hits, mut on_instances, mut disagreements) = (0, 0, 0);
    for seed in [10, 20, 30] {
        let scene = compile_shared(&mixed_scene(seed, 60));
        assert!(
            scene.instances.placements.len() > 40 && scene.instances.meshes.len() >= 5,
            "mirrored and emitting instances have meshes of their own"
        );
        let flat = flattened_scene(&scene);
        let none = AccelSpec {
            builder: Builder::None,
            ..AccelSpec::default()
        };
        let brute = Accel::build_as(Arc::clone(&flat), &none, Isa::detect()).unwrap();
        let accels: Vec<Accel> = Isa::available()
            .iter()
            .map(|isa| Accel::build_as(Arc::clone(&scene), &AccelSpec::default(), *isa).unwrap())
            .collect();
        let mut next = numbers(100 + seed);
        for i in 0..8000 {
            let axis = [Vec3::X, -Vec3::Y, Vec3::Z][i % 3];
            let dir = if i % 10 == 0 {
                axis
            } else {
                uniform_sphere([next(), next()])
            };
            let ray = Ray {
                origin: point(&mut next) * 4.0,
                dir,
            };
            let (ours, truth) = (
                accels[0].closest(&ray, f32::INFINITY),
                brute.closest(&ray, f32::INFINITY),
            );
            for accel in &accels[1..] {
                assert_eq!(
                    accel.closest(&ray, f32::INFINITY),
                    ours,
                    "hits differ between instruction sets"
                );
            }
            assert_eq!(accels[0].occluded(&ray, f32::INFINITY), ours.is_some());
            let (Some(a), Some(b)) = (ours, truth) else {
                disagreements += usize::from(ours.is_some() != truth.is_some());
                continue;
            };
            assert!(
                !accels[0].occluded(&ray, a.t),
                "the ray is occluded before its nearest hit"
            );
            hits += 1;
            on_instances += usize::from(a.instance != NONE);
            if flat_primitive(&scene, &flat, &a) != b.primitive {
                disagreements += 1;
                continue;
            }
            same_surface(&scene, &flat, &ray, &a, &b);
        }
    }
    assert!(hits > 3000 && on_instances > 2500, "{hits} {on_instances}");
    // Rounding decides whether rays that graze an edge hit.
    assert!(disagreements <= 6, "{disagreements} of 24000 rays");
}

/// Compares the surfaces of two hits up to rounding: the barycentric weights of a hit come from
/// another space.
fn same_surface(scene: &CompiledScene, flat: &CompiledScene, ray: &Ray, a: &Hit, b: &Hit) {
    assert!((a.t - b.t).abs() <= 2e-5 * b.t.max(1.0), "{a:?} {b:?}");
    let (s, f) = (Surface::at(scene, ray, a), Surface::at(flat, ray, b));
    assert!(
        s.position.distance(f.position) < 1e-4,
        "{} {}",
        s.position,
        f.position
    );
    assert!(
        s.n_geometric.distance(f.n_geometric) < 1e-5,
        "{} {}",
        s.n_geometric,
        f.n_geometric
    );
    assert!(
        s.n_shading.distance(f.n_shading) < 1e-2,
        "{} {}",
        s.n_shading,
        f.n_shading
    );
    assert!(
        Vec2::from_array(s.uv.first).distance(Vec2::from_array(f.uv.first)) < 2e-3,
        "{:?} {:?}",
        s.uv,
        f.uv
    );
    assert_eq!(s.materials, f.materials);
    assert_eq!(
        s.emitter, f.emitter,
        "the surfaces belong to different lights"
    );
    assert_eq!(s.terminator.is_some(), f.terminator.is_some());
    // Equal barycentric weights give equal bits.
    let exact = Surface::at(scene, ray, &Hit { uv: b.uv, ..*a });
    assert!(
        exact.position == f.position && exact.n_geometric == f.n_geometric,
        "corners differ from those of the flattened scene"
    );
    assert!(
        exact.n_shading.distance(f.n_shading) < 1e-6,
        "{} {}",
        exact.n_shading,
        f.n_shading
    );
}

#[test]
fn rays_that_leave_an_instance_do_not_hit_the_surface_that_they_left() {
    // The instances are large and rotated, and their surfaces lie close to a coordinate plane,
    // where the fewest digits remain.
    let quad = |z: f32| {
        vec![
            Vec3::new(-1.0, -1.0, z),
            Vec3::new(1.0, -1.0, z),
            Vec3::new(1.0, 1.0, z),
            Vec3::new(-1.0, 1.0, z),
        ]
    };
    let turn = Quat::from_rotation_x(0.7) * Quat::from_rotation_y(0.3);
    // The mesh is tilted in its own space, and its instances are rotated back.
    let tilted: Vec<Vec3> = quad(0.0).into_iter().map(|p| turn * p).collect();
    let sheet = mesh(tilted, vec![], vec![[0, 1, 2], [0, 2, 3]], &["m"]);
    let at = |height: f32| {
        let back = Affine3A::from_scale_rotation_translation(
            Vec3::splat(500.0),
            turn.inverse(),
            Vec3::new(0.0, 0.0, height),
        );
        entity(
            format!("sheet {height}"),
            ShapeDesc::Mesh(Arc::clone(&sheet)),
            Transform::framed(double(back)),
            None,
        )
    };
    let scene = compile_shared(&desc(
        vec![MaterialDesc::new("m")],
        vec![at(0.05), at(-200.0)],
    ));
    assert_eq!(scene.instances.placements.len(), 2);
    let accel = Accel::build(Arc::clone(&scene)).unwrap();
    let mut next = numbers(4);
    for _ in 0..4000 {
        let eye = Vec3::new(
            400.0 * (next() - 0.5),
            400.0 * (next() - 0.5),
            1.0 + 100.0 * next(),
        );
        let to = Vec3::new(600.0 * (next() - 0.5), 600.0 * (next() - 0.5), 0.05);
        let ray = Ray {
            origin: eye,
            dir: (to - eye).normalize_or_zero(),
        };
        let hit = accel.closest(&ray, f32::INFINITY).unwrap();
        let surface = Surface::at(&scene, &ray, &hit);
        let up = if surface.n_geometric.z < 0.0 {
            -surface.n_geometric
        } else {
            surface.n_geometric
        };
        let mut dir = uniform_sphere([next(), next()]);
        dir.z = dir.z.abs().max(1e-3);
        let away = Ray {
            origin: surface.end().off_surface(up),
            dir: dir.normalize_or_zero(),
        };
        assert!(!accel.occluded(&away, f32::INFINITY), "{away:?}");
        let down = Ray {
            origin: surface.end().off_surface(-up),
            dir: Vec3::NEG_Z,
        };
        let below = accel.closest(&down, f32::INFINITY).unwrap();
        assert!((below.t - 200.05).abs() < 0.1, "{below:?}");
    }
}

fn scene_job(name: &str, scene: &CompiledScene, seed: u64) -> Job {
    named_job(name, scene.resolution, 4, seed)
}

/// Returns the root mean square difference of two pictures, over the mean of the first.
fn difference(a: &Film, b: &Film) -> f64 {
    let square: f64 = a
        .sum
        .iter()
        .zip(&b.sum)
        .flat_map(|(a, b)| (0..3).map(move |c| (a[c] - b[c]).powi(2)))
        .sum();
    let mean: f64 = a.sum.iter().flatten().sum();
    let count = 3.0 * a.sum.len() as f64;
    (square / count).sqrt() / (mean / count)
}

#[test]
fn pictures_of_instances_equal_those_of_the_flattened_scene() {
    let lit = SceneDesc {
        environment: Some(EnvironmentDesc::new(EnvironmentSource::Color(Vec3::splat(
            0.2,
        )))),
        ..mixed_scene(50, 60)
    };
    let scene = compile_shared(&lit);
    let flat = flattened_scene(&scene);
    assert_eq!(scene.bounds, flat.bounds);
    assert_eq!(
        scene.bounds_and_radius(),
        flat.bounds_and_radius(),
        "the disks differ on which light from outside starts"
    );
    for name in ["bpt", "nee", "bdpt"] {
        let (a, b) = (
            render(&scene, scene_job(name, &scene, 3), 4),
            render(&flat, scene_job(name, &flat, 3), 4),
        );
        assert!(a.sum.iter().flatten().sum::<f64>() > 0.0);
        // One path in some hundreds diverges by rounding.
        let other = a
            .sum
            .iter()
            .zip(&b.sum)
            .filter(|(a, b)| (0..3).any(|c| (a[c] - b[c]).abs() > 1e-2 * b[c].abs().max(1e-3)))
            .count();
        assert!(
            other <= a.sum.len() / 40,
            "{name}: {other} of {} pixels differ by {}",
            a.sum.len(),
            difference(&a, &b)
        );
    }
}

#[test]
fn builders_without_instances_render_the_flattened_scene() {
    let scene = compile_shared(&mixed_scene(51, 12));
    let flat = flattened_scene(&scene);
    assert!(!scene.instances.placements.is_empty() && flat.instances.placements.is_empty());
    for builder in [Builder::None, Builder::Cwbvh] {
        let job = |scene: &CompiledScene| {
            scene_job("nee", scene, 3).with(|settings| {
                settings.accel = AccelSpec {
                    builder,
                    ..AccelSpec::default()
                }
            })
        };
        let (a, b) = (render(&scene, job(&scene), 2), render(&flat, job(&flat), 2));
        assert!(a.sum.iter().flatten().sum::<f64>() > 0.0);
        assert_eq!(a.sum, b.sum, "{builder:?}");
    }
}

#[test]
fn a_mask_makes_holes_in_the_instances_of_its_material_alone() {
    let corners = vec![
        Vec3::new(-1.0, -1.0, 0.0),
        Vec3::new(1.0, -1.0, 0.0),
        Vec3::new(0.0, 1.0, 0.0),
    ];
    let triangle = mesh(corners, vec![], vec![[0, 1, 2]], &["a"]);
    let mut hole = MaterialDesc::new("hole");
    hole.set_texture(TextureSlot::Mask, Some(TextureDesc::grey(0.0).into()));
    let names = ["solid", "hole", "solid", "hole"];
    let each = |(i, name): (usize, &str)| {
        let transform = Transform {
            translate: 10.0 * i as f64 * DVec3::X,
            ..Transform::default()
        };
        let shape = ShapeDesc::Mesh(Arc::clone(&triangle));
        entity(format!("{i}"), shape, transform, Some(name))
    };
    let entities = names.into_iter().enumerate().map(each).collect();
    let scene = compile_shared(&desc(vec![MaterialDesc::new("solid"), hole], entities));
    assert_eq!(scene.instances.placements.len(), 4);
    let accel = Accel::build(scene).unwrap();
    for (i, name) in names.into_iter().enumerate() {
        let ray = Ray {
            origin: Vec3::new(10.0 * i as f32, 0.0, 5.0),
            dir: Vec3::NEG_Z,
        };
        let hit = accel.closest(&ray, f32::INFINITY);
        assert_eq!(hit.is_some(), name == "solid", "{i}");
    }
}

#[test]
fn lights_of_instances_have_their_area_in_world_space() {
    let scene = compile_shared(&mixed_scene(70, 40));
    let (unshared, _) = compile_sharing(&mixed_scene(70, 40), Sharing::Never).unwrap();
    let flat = flattened_scene(&scene);
    assert!(unshared.instances.placements.is_empty() && unshared.emitters.len() > 50);
    let sum = |s: &CompiledScene| s.emitters.iter().map(|e| f64::from(e.area)).sum::<f64>();
    assert_eq!(
        (scene.emitters.len(), flat.emitters.len()),
        (unshared.emitters.len(), unshared.emitters.len())
    );
    assert!((sum(&scene) - sum(&unshared)).abs() < 1e-9 * sum(&unshared));
    for (i, e) in scene.emitters.iter().enumerate() {
        assert_eq!(
            scene.emitter_of(e.primitive, e.instance),
            i as u32,
            "a light and its triangle must refer to each other"
        );
        assert_eq!(flat.emitter_of(flat.emitters[i].primitive, NONE), i as u32);
        let Some(attributes) = flat.attributes.get(flat.emitters[i].primitive as usize) else {
            continue;
        };
        assert_eq!(
            attributes.material,
            scene.material_of(e.primitive, e.instance)
        );
        let [a, b, c] = scene.corners(e.primitive, e.instance);
        let area = (b - a).cross(c - a).length() / 2.0;
        assert!(
            (area - e.area).abs() <= 1e-4 * e.area + 1e-7,
            "{area} {}",
            e.area
        );
    }
    // The triangles are the same in another order.
    let corners = |s: &CompiledScene| {
        let mut all: Vec<[u32; 9]> = s
            .triangles
            .iter()
            .map(|t| std::array::from_fn(|i| t[i / 3][i % 3].to_bits()))
            .collect();
        all.sort_unstable();
        all
    };
    assert_eq!(corners(&flat), corners(&unshared));
    assert_eq!(flat.bounds, unshared.bounds);
}
