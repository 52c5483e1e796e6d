//! Compares vectorised with scalar hits, bit by bit.

use std::path::PathBuf;

use glam::Vec2;

use super::*;
use crate::cpu::bvh::simd::Isa;
use crate::hierarchy::AccelSpec;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::scene::compile::{MaskMode, Normals, Sphere, TriangleAttributes};
use lumbre_light::scene::desc::{
    Lookup, MaterialDesc, SceneDesc, Texels, TextureDesc, TextureSlot, texture_hash,
};

/// Returns a scene without shapes and with three materials: one without a mask, one with a
/// thresholded mask, and one with a blended mask.
fn materials() -> CompiledScene {
    let texels = Texels::RgbaF32([0.1, 0.9, 0.7, 0.3, 1.0, 0.0].map(|v| [v; 4]).to_vec());
    let content_hash = texture_hash(3, 2, &texels);
    let mask = Arc::new(TextureDesc {
        file: PathBuf::new(),
        width: 3,
        height: 2,
        texels,
        content_hash,
    });
    let material = |mask_mode: Option<MaskMode>| {
        let mut material = MaterialDesc::new("m");
        if let Some(mode) = mask_mode {
            material.mask_mode = mode;
            material.set_mapped_texture(TextureSlot::Mask, Arc::clone(&mask), Lookup::default());
        }
        material
    };
    let scene = SceneDesc {
        resolution: [1, 1],
        max_depth: 1,
        materials: [None, Some(MaskMode::Threshold), Some(MaskMode::Blend)]
            .map(material)
            .into_iter()
            .collect(),
        ..SceneDesc::default()
    };
    lumbre_light::scene::compile(&scene).unwrap().0
}

/// In half of the scenes all points lie on a coarse grid, so that rays hit edges and corners
/// exactly; in the others they are random. Some triangles coincide, are degenerate, or are slivers.
/// In a third of the scenes no primitive has a mask, and in another third all have.
#[test]
fn vectorized_and_scalar_hits_are_equal() {
    let materials = materials();
    for width in [Width::eight(), Width::sixteen()].into_iter().flatten() {
        compare(width, &materials);
    }
}

fn compare(width: Width, materials: &CompiledScene) {
    let mut i = 0;
    let mut next = || {
        i += 1;
        unit(pcg4d([i, 5, 1, 77])[0])
    };
    let (mut hits, mut edge_hits, mut coincident_hits) = (0, 0, 0);
    let [
        mut masked_out,
        mut masked_hits,
        mut mixed_ties,
        mut masked_sphere_hits,
    ] = [0; 4];
    for scene in 0..90 {
        let grid = scene % 2 == 0;
        let mut point = |grid: bool| {
            let p = Vec3::new(next(), next(), next()) * 4.0 - 2.0;
            if grid { p.round() } else { p }
        };
        let mut triangles: Vec<[Vec3; 3]> = (0..11).map(|_| [0; 3].map(|_| point(grid))).collect();
        triangles.extend([triangles[2], triangles[3], [triangles[4][0]; 3]]);
        let centers = [0; 4].map(|_| point(grid));
        let mut rays: Vec<(Ray, f32)> = Vec::new();
        for k in 0..101 {
            let (origin, to) = (point(grid && k % 3 != 0), point(grid && k % 3 != 1));
            let dir = if k % 5 == 0 {
                Vec3::AXES[k % 3] * (1.0 - (k % 2) as f32 * 2.0)
            } else {
                to - origin
            };
            rays.push((
                Ray {
                    origin,
                    dir: dir.normalize_or(Vec3::X),
                },
                [f32::INFINITY, 1.5][k % 2],
            ));
        }
        for bad in [f32::NAN, f32::INFINITY] {
            rays.push((
                Ray {
                    origin: Vec3::splat(bad),
                    dir: Vec3::X,
                },
                1.0,
            ));
            rays.push((
                Ray {
                    origin: Vec3::ZERO,
                    dir: Vec3::new(bad, 0.0, 1.0),
                },
                1.0,
            ));
        }
        let mut material = || match scene % 3 {
            0 => 0,
            1 => 1 + (next() * 2.0) as u32,
            _ => (next() * 3.0) as u32,
        };
        let attributes = triangles.iter().map(|_| TriangleAttributes {
            material: material(),
            emitter: NONE,
        });
        let attributes = attributes.collect();
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::new(0.4, 1.3)];
        let uvs = vec![uvs; triangles.len()];
        let mut normals = Normals::default();
        triangles.iter().for_each(|_| normals.push([Vec3::Z; 3]));
        let radii = [0.5, 1.0, 0.7, 1.4];
        let spheres = [0, 1, 2, 3].map(|i| Sphere {
            center: centers[i],
            radius: radii[i],
            material: material(),
            emitter: NONE,
        });
        let scene = CompiledScene {
            triangles,
            attributes,
            normals,
            uvs,
            spheres: spheres.into(),
            ..materials.clone()
        };
        let unmasked = CompiledScene {
            materials: vec![scene.materials[0]; 3],
            ..scene.clone()
        };
        let scene = Arc::new(scene);
        let built = |scene| Accel::build_as(scene, &AccelSpec::default(), Isa::Portable).unwrap();
        let (accel, unmasked) = (built(Arc::clone(&scene)), built(Arc::new(unmasked)));
        let small = SmallScene::new_if_small(&accel, width).unwrap();
        let (mut nearest, mut occluded) = (Vec::new(), Vec::new());
        small.closest(&rays, &mut nearest);
        small.occluded(&rays, &mut occluded);
        assert_eq!([nearest.len(), occluded.len()], [rays.len(); 2]);
        for (((ray, t_max), nearest), occluded) in rays.iter().zip(nearest).zip(occluded) {
            let expected = accel.closest(ray, *t_max);
            let bits = |hit: Hit| {
                (
                    [hit.t, hit.uv[0], hit.uv[1]].map(f32::to_bits),
                    hit.primitive,
                    hit.instance,
                )
            };
            assert_eq!(nearest.map(bits), expected.map(bits), "{ray:?}");
            assert_eq!(occluded, expected.is_some(), "{ray:?}");
            masked_out += usize::from(unmasked.closest(ray, *t_max) != expected);
            let Some(hit) = expected else { continue };
            hits += 1;
            let masked = |primitive: u32| scene.material_of(primitive, NONE) > 0;
            masked_hits += usize::from(masked(hit.primitive));
            if hit.primitive < 14 {
                edge_hits += usize::from(hit.uv.contains(&0.0));
                let coincident = [2, 3].contains(&hit.primitive);
                coincident_hits += usize::from(coincident);
                mixed_ties +=
                    usize::from(coincident && masked(hit.primitive) && !masked(hit.primitive + 9));
            } else {
                masked_sphere_hits += usize::from(masked(hit.primitive));
            }
        }
    }
    assert!(
        hits > 1000 && edge_hits > 100 && coincident_hits > 20,
        "{hits} {edge_hits} {coincident_hits}"
    );
    assert!(
        masked_out > 200 && masked_hits > 500 && mixed_ties > 10 && masked_sphere_hits > 100,
        "{masked_out} {masked_hits} {mixed_ties} {masked_sphere_hits}"
    );
}
