//! Masks, and how far rays start off the triangles of instances.

use glam::{Vec2, Vec3};

use super::*;
use crate::math::rng::{pcg4d, unit};
use crate::scene::compile::{MaskMode, Sharing, compile_sharing};
use crate::scene::desc::{MaterialDesc, TextureDesc, TextureSlot};
use crate::scene::fixtures::{mesh, scene};
use crate::transport::light::Lights;
use crate::transport::ray::offset_origin;

/// Extent of a mesh and distance by which an instance of it is moved, in scene units.
const FAR: f32 = 1e4;

/// Returns two instances of a mesh of a large and a small triangle, the second of which was moved
/// so that the small triangle is at the origin; and the index of the small triangle.
fn moved_back(material: MaterialDesc) -> (CompiledScene, u32) {
    let small = Vec3::X * FAR;
    let shape = mesh(
        &[
            Vec3::NEG_X * FAR,
            Vec3::ZERO,
            Vec3::Y * FAR,
            small,
            small + Vec3::X,
            small + Vec3::Y,
        ],
        &[],
        &[[0, 1, 2], [3, 4, 5]],
    );
    let desc = scene(&[(shape.clone(), Vec3::ZERO), (shape, -small)], material);
    let (scene, _) = compile_sharing(&desc, Sharing::Always).unwrap();
    assert_eq!(
        (scene.triangles.len(), scene.instances.placements.len()),
        (2, 2)
    );
    let is_small = |t: &[Vec3; 3]| t[0].x == FAR;
    let index = scene.triangles.iter().position(is_small).unwrap();
    (scene, index as u32)
}

/// Returns a hit of the small triangle.
fn hit(primitive: u32, instance: u32) -> Hit {
    Hit {
        t: 1.0,
        primitive,
        instance,
        uv: [0.25, 0.25],
    }
}

/// Returns a ray towards the origin.
fn down() -> Ray {
    Ray {
        origin: Vec3::Z,
        dir: Vec3::NEG_Z,
    }
}

/// Rays are intersected in the space of the mesh, where coordinates are rounded to units of `FAR`'s
/// last place.
#[test]
fn rays_leave_moved_instances_by_more_than_the_rounding_of_their_own_space() {
    let (scene, small) = moved_back(MaterialDesc::new("m"));
    let least = FAR * f32::EPSILON;
    for instance in 0..2 {
        let surface = Surface::at(&scene, &down(), &hit(small, instance));
        let step = surface.spawn(Vec3::Z).origin.z - surface.position.z;
        assert!(
            step > least,
            "instance {instance}: {step}, not above {least}"
        );
    }
}

/// The ends of shadow rays likewise.
#[test]
fn shadow_rays_end_before_moved_lights_by_more_than_the_rounding_of_their_space() {
    let glowing = MaterialDesc {
        emission: Vec3::ONE,
        ..MaterialDesc::new("m")
    };
    let (scene, small) = moved_back(glowing);
    let lights = Lights::new(&scene);
    let least = FAR * f32::EPSILON;
    let found = scene
        .emitters
        .iter()
        .zip(0..)
        .filter(|(emitter, _)| emitter.primitive == small);
    let mut count = 0;
    for (emitter, index) in found {
        let extent = lights.with_indices::<f32, 1>([index], true).extent();
        let [corner, ..] = scene.corners(small, emitter.instance);
        let step = offset_origin(corner, Vec3::Z, extent).z - corner.z;
        assert!(step > least, "{emitter:?}: {step}, not above {least}");
        count += 1;
    }
    assert_eq!(count, 2);
}

/// Returns a material with a constant mask.
fn masked(mask_mode: MaskMode, mask: f32) -> MaterialDesc {
    let mut material = MaterialDesc {
        mask_mode,
        ..MaterialDesc::new("m")
    };
    material.set_texture(TextureSlot::Mask, Some(TextureDesc::grey(mask).into()));
    material
}

/// glTF: a surface is opaque where alpha is greater than or equal to the cutoff.
#[test]
fn a_mask_covers_where_it_is_at_least_the_threshold() {
    for (threshold, expected) in [(0.25, 1.0), (0.5, 1.0), (0.50001, 0.0), (0.75, 0.0)] {
        let (scene, _) = moved_back(MaterialDesc {
            mask_threshold: threshold,
            ..masked(MaskMode::Threshold, 0.5)
        });
        let found = coverage(&scene.textures, &scene.materials[0], Uv::same(Vec2::ZERO));
        assert_eq!(found, expected, "{threshold}");
    }
}

/// A ray that crosses two instances of a mesh finds holes in them independently.
#[test]
fn masks_of_instances_accept_a_ray_independently() {
    let (scene, small) = moved_back(masked(MaskMode::Blend, 0.5));
    let rays = 2000;
    // How many rays each instance, and both, let through.
    let (mut first, mut second, mut both) = (0, 0, 0);
    for i in 0..rays {
        let [x, y, z, w] = pcg4d([i, 1, 2, 3]).map(unit);
        let ray = Ray {
            origin: Vec3::new(x, y, 1.0),
            dir: Vec3::new(z - 0.5, w - 0.5, -1.0).normalize_or(Vec3::Z),
        };
        let [a, b] = [0, 1].map(|instance| is_masked_out(&scene, &ray, &hit(small, instance)));
        first += u32::from(a);
        second += u32::from(b);
        both += u32::from(a && b);
    }
    // Five standard deviations of binomial distributions.
    let expected = |count: u32, share: f64| {
        let mean = f64::from(rays) * share;
        (f64::from(count) - mean).abs() < 5.0 * (mean * (1.0 - share)).sqrt()
    };
    assert!(
        expected(first, 0.5) && expected(second, 0.5),
        "{first}, {second} of {rays}"
    );
    assert!(expected(both, 0.25), "{both} of {rays}");
}
