//! All integrators render the same picture of mapped, masked and smoothed surfaces.

use std::sync::Arc;

use glam::{Vec2, Vec3, Vec4};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{
    DirectionalLight, MaskMode, Material, Model, NONE, Texture, UvMap,
};
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::ray::Ray;
use lumbre_light::transport::surface::Surface;
use lumbre_render::cpu::bvh::accel::Accel;

use crate::common::{SceneBuilder, WHITE, grey, job, light, render};
use crate::render::agreement::{EYE, agree_with_bpt, room};

/// Returns a normal map: normals tilted by up to 45 degrees in every direction.
fn bumps() -> Texture {
    let n = |i: u32, side: u32| {
        let (x, y) = (
            (i % side) as f32 / side as f32,
            (i / side) as f32 / side as f32,
        );
        let tilt = Vec3::new(
            (x * std::f32::consts::TAU).sin(),
            (y * std::f32::consts::TAU).cos(),
            1.0,
        );
        (tilt.normalize_or(Vec3::Z) * 0.5 + 0.5).to_array()
    };
    Texture::new(8, 8, (0..64).map(|i| n(i, 8)).collect::<Vec<_>>())
}

/// Returns the room with a floor of another material, whose tangents are those of its texture
/// coordinates.
fn room_with_floor(builder: SceneBuilder, floor: Material) -> Arc<CompiledScene> {
    let mut scene = Arc::unwrap_or_clone(builder.build());
    scene.tangents = vec![[Vec4::ZERO; 3]; scene.triangles.len()];
    for i in 0..2 {
        scene.tangents[i] = [Vec4::new(1.0, 0.0, 0.0, 1.0); 3];
        scene.materials[scene.attributes[i].material as usize] = floor;
    }
    Arc::new(scene)
}

/// Compares the integrators in the room with a floor that uses a map of bumps, given its index.
fn agree_on_a_mapped_floor(with_map: impl Fn(u32) -> Material) {
    for model in [Model::Lambert, Model::Disney] {
        let mut builder = room(EYE).sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0));
        let map = builder.texture(bumps());
        let tiling = UvMap {
            scale: 5.0,
            offset: Vec2::new(0.1, 0.2),
        };
        let floor = Material {
            tiling,
            model,
            roughness: 0.4,
            ..with_map(map)
        };
        agree_with_bpt(&room_with_floor(builder, floor), 5, None, 600);
    }
}

#[test]
fn integrators_agree_on_a_normal_mapped_floor() {
    agree_on_a_mapped_floor(|map| Material {
        normal_texture: map,
        ..grey(0.7)
    });
}

#[test]
fn integrators_agree_on_a_bump_mapped_floor() {
    agree_on_a_mapped_floor(|map| Material {
        bump_texture: map,
        bump_height: 0.3,
        ..grey(0.7)
    });
}

/// Returns a leaf of four by four texels from transparent to opaque.
fn leaf() -> Texture {
    Texture::new(
        4,
        4,
        (0..16)
            .map(|i| [(i * 7 % 16) as f32 / 15.0; 3])
            .collect::<Vec<_>>(),
    )
}

#[test]
fn integrators_agree_on_masked_leaves() {
    for mask_mode in [MaskMode::Threshold, MaskMode::Blend] {
        let mut builder = room(EYE);
        let mask_texture = builder.texture(leaf());
        let leaf = Material {
            mask_texture,
            mask_mode,
            base_color: Vec3::new(0.2, 0.7, 0.2),
            ..WHITE
        };
        let lamp = Material {
            mask_texture,
            mask_mode,
            ..light(6.0)
        };
        let scene = builder
            .quad(
                Vec3::new(-1.0, 0.5, 0.6),
                Vec3::X * 1.2,
                Vec3::new(0.0, 0.9, -0.5),
                leaf,
            )
            .quad(
                Vec3::new(0.1, 0.9, -0.3),
                Vec3::new(1.0, 0.3, 0.4),
                Vec3::new(0.0, 0.4, 0.8),
                leaf,
            )
            .quad(
                Vec3::new(-1.8, 0.4, -1.0),
                Vec3::Z * 1.2,
                Vec3::Y * 1.2,
                lamp,
            )
            .build();
        agree_with_bpt(&scene, 5, None, 600);
    }
}

#[test]
fn integrators_agree_on_light_through_paper() {
    // A lamp in a paper box, whose texture transmits more in some places, and a sheet that also
    // shades the room, with normals of a map.
    let mut builder = room(EYE);
    let (veins, map) = (builder.texture(leaf()), builder.texture(bumps()));
    let paper = Material {
        model: Model::Translucent,
        base_color: Vec3::new(0.3, 0.25, 0.2),
        transmittance: Vec3::new(0.5, 0.6, 0.7),
        transmittance_texture: veins,
        ..WHITE
    };
    let sheet = Material {
        normal_texture: map,
        normal_strength: 0.5,
        transmittance_texture: NONE,
        ..paper
    };
    let (low, side) = (Vec3::new(-0.4, 0.5, -0.4), 0.8);
    let [x, y, z] = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| axis * side);
    let faces = [
        (low, x, y),
        (low, y, z),
        (low, z, x),
        (low + z, y, x),
        (low + x, z, y),
    ];
    for (corner, a, b) in faces {
        builder = builder.quad(corner, a, b, paper);
    }
    let scene = builder
        .quad(
            Vec3::new(-1.2, 0.1, 0.6),
            Vec3::X * 0.7,
            Vec3::new(0.0, 0.8, -0.3),
            sheet,
        )
        .sphere(Vec3::new(0.0, 0.9, 0.0), 0.15, light(14.0))
        .build();
    let mut scene = Arc::unwrap_or_clone(scene);
    scene.tangents = vec![[Vec4::new(1.0, 0.0, 0.0, 1.0); 3]; scene.triangles.len()];
    agree_with_bpt(&Arc::new(scene), 6, None, 600);
}

/// Returns the scene with a coarse ball of `slices` slices and half as many stacks, with smooth
/// normals.
fn coarse_ball(
    slices: usize,
    mut builder: SceneBuilder,
    center: Vec3,
    radius: f32,
    material: Material,
) -> Arc<CompiledScene> {
    let first = builder.triangle_count();
    let point = |i: usize, j: usize| {
        let angle = |i: usize| i as f32 / slices as f32 * std::f32::consts::TAU;
        let (a, b) = (angle(i), angle(j));
        Vec3::new(b.sin() * a.sin(), b.cos(), b.sin() * a.cos())
    };
    let mut normals = Vec::new();
    for i in 0..slices {
        for j in 0..slices / 2 {
            let [a, b, c, d] = [
                point(i, j),
                point(i, j + 1),
                point(i + 1, j + 1),
                point(i + 1, j),
            ];
            for corners in [[a, b, c], [a, c, d]] {
                if (corners[1] - corners[0])
                    .cross(corners[2] - corners[0])
                    .length()
                    > 1e-3
                {
                    builder = builder.triangle(
                        corners.map(|p| center + p * radius),
                        [Vec2::ZERO; 3],
                        material,
                    );
                    normals.push(corners);
                }
            }
        }
    }
    let mut scene = Arc::unwrap_or_clone(builder.build());
    scene.normals.make_smooth()[first..].copy_from_slice(&normals);
    Arc::new(scene)
}

#[test]
fn integrators_agree_on_the_terminator_offset_of_a_coarse_ball() {
    // The second material is metal; the third also has the Dirac lobe of a mirror.
    let gold = Material {
        model: Model::Disney,
        metallic: 1.0,
        roughness: 0.4,
        ..WHITE
    };
    for material in [
        grey(0.8),
        gold,
        Material {
            metallic: 0.5,
            ..grey(0.8)
        },
    ] {
        let builder = room(EYE);
        let material = Material {
            shadow_terminator: true,
            ..material
        };
        agree_with_bpt(
            &coarse_ball(8, builder, Vec3::new(0.1, 0.7, 0.3), 0.6, material),
            5,
            None,
            600,
        );
    }
}

#[test]
fn integrators_agree_on_the_terminator_offset_of_a_ball_lit_from_behind() {
    let mut builder = SceneBuilder::new(Vec3::Z * 3.0, Vec3::ZERO, 20.0).quad(
        Vec3::new(-3.0, -3.0, -2.6),
        Vec3::X * 6.0,
        Vec3::Y * 6.0,
        grey(0.8),
    );
    builder = builder
        .quad(
            Vec3::new(-1.6, -2.0, -2.5),
            Vec3::Y * 4.0,
            Vec3::Z * 2.3,
            light(3.0),
        )
        .quad(
            Vec3::new(1.6, -2.0, -2.5),
            Vec3::Z * 2.3,
            Vec3::Y * 4.0,
            light(3.0),
        );
    let material = Material {
        shadow_terminator: true,
        ..grey(0.8)
    };
    agree_with_bpt(
        &coarse_ball(6, builder, Vec3::ZERO, 0.6, material),
        4,
        None,
        1000,
    );
}

/// Renders a coarse ball of albedo 0.8 in directional light from the left, with or without the
/// offset at shadow terminators. For the pixels at whose centre the shading normal faces the light,
/// returns the sum of their radiance, the sum expected for these normals, and how many are black.
fn terminator(shadow_terminator: bool) -> (f64, f64, usize) {
    let material = Material {
        shadow_terminator,
        ..grey(0.8)
    };
    let builder = SceneBuilder::new(Vec3::Z * 30.0, Vec3::ZERO, 4.2);
    let mut scene = Arc::unwrap_or_clone(coarse_ball(16, builder, Vec3::ZERO, 1.0, material));
    let direction = Vec3::new(1.0, -0.2, -0.1).normalize_or(Vec3::X);
    scene.directionals.push(DirectionalLight {
        direction,
        irradiance: Vec3::splat(std::f32::consts::PI),
    });
    let scene = Arc::new(scene);
    let side = 64;
    let mut j = job([side, side], 2, 1);
    (j.integrator, j.settings.filter.radius) = (integrator("nee").unwrap(), 0.0);
    let film = render(&scene, j, 1);
    let accel = Accel::build(Arc::clone(&scene)).unwrap();
    let (mut found, mut expected, mut black) = (0.0, 0.0, 0);
    for (i, sum) in film.sum.iter().enumerate() {
        let at =
            |k: usize| ((k as f32 + 0.5) / side as f32 * 2.0 - 1.0) * 2.1f32.to_radians().tan();
        let dir = Vec3::new(at(i % side as usize), -at(i / side as usize), -1.0)
            .normalize_or(Vec3::NEG_Z);
        let ray = Ray {
            origin: Vec3::Z * 30.0,
            dir,
        };
        let Some(hit) = accel.closest(&ray, f32::INFINITY) else {
            continue;
        };
        let surface = Surface::at(&scene, &ray, &hit);
        let cos = -surface.n_shading.dot(direction);
        // A point seen from behind its shading normal is black with or without the offset.
        if cos > 0.0 && surface.n_shading.dot(dir) < 0.0 {
            found += sum[0];
            expected += 0.8 * f64::from(cos);
            black += usize::from(sum[0] == 0.0);
        }
    }
    (found, expected, black)
}

#[test]
fn the_terminator_offset_lights_every_point_whose_shading_normal_faces_the_light() {
    let (found, expected, black) = terminator(true);
    assert!(
        (found / expected - 1.0).abs() < 1e-4 && black == 0,
        "{found} instead of {expected}, black: {black}"
    );
    let (less, same, black) = terminator(false);
    assert_eq!(same, expected);
    assert!(
        less < 0.995 * expected && black > 50,
        "{less} of {expected}, black: {black}"
    );
}
