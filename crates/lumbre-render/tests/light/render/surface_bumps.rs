//! Bump maps: shading normals from the slopes of a height texture, compared with closed forms.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{Affine2, Vec2, Vec3};
use lumbre_light::scene::compile::{Material, NONE, Texture};
use lumbre_light::scene::desc::{
    Formulas, Lookup, MaterialDesc, Texels, TextureDesc, TextureSlot, texture_hash,
};
use lumbre_light::transport::ray::{Hit, Ray};
use lumbre_light::transport::surface::Surface;

use crate::common::{SceneBuilder, WHITE};
use crate::render::surface::{SQUARE, at, mesh, mesh_with_second_uvs, normal_map};

/// Returns a bump map of floats.
fn heights(width: u32, values: Vec<f32>) -> Arc<TextureDesc> {
    let texels = Texels::RgbaF32(values.iter().map(|h| [*h, *h, *h, 1.0]).collect());
    let height = values.len() as u32 / width;
    let content_hash = texture_hash(width, height, &texels);
    Arc::new(TextureDesc {
        file: PathBuf::from("h.exr"),
        width,
        height,
        texels,
        content_hash,
    })
}

/// Returns a material with a bump map.
fn bump_mapped(map: Arc<TextureDesc>, bump_height: f32) -> MaterialDesc {
    let mut m = MaterialDesc {
        bump_height,
        ..MaterialDesc::new("m")
    };
    m.set_texture(TextureSlot::Bump, Some(map));
    m
}

/// Returns heights that grow by 1 per repeat in u and by `rise` per repeat in v, except for the
/// jump where the map repeats.
fn ramp(rise: f32) -> Arc<TextureDesc> {
    let at = |i: u32| ((i % 8) as f32 + 0.5) / 8.0 + rise * (1.0 - ((i / 8) as f32 + 0.5) / 8.0);
    heights(8, (0..64).map(at).collect())
}

#[test]
fn bumps_have_the_world_space_slopes_of_heights_for_any_linear_coordinates() {
    // A height of 0.3 x + 0.2 y in world space. With linear coordinates u = p . a and v = p . b it
    // is a ramp of u and v, whose slopes solve the equation below.
    let slope = Vec2::new(0.3, 0.2);
    let expected = Vec3::new(-slope.x, -slope.y, 1.0).normalize_or(Vec3::Z);
    for (a, b) in [
        (Vec2::new(0.4, 0.0), Vec2::new(0.0, 0.4)),
        (Vec2::new(0.1, 0.0), Vec2::new(0.0, 0.9)),
        (Vec2::new(0.3, 0.1), Vec2::new(0.35, -0.2)),
        (Vec2::new(-0.2, 0.3), Vec2::new(0.3, 0.25)),
    ] {
        // slope = height (a + rise b).
        let det = a.perp_dot(b);
        let (along_a, along_b) = (slope.perp_dot(b) / det, a.perp_dot(slope) / det);
        let uvs = SQUARE.map(|p| {
            Vec2::new(0.5, 0.5)
                + Vec2::new((p.truncate() - 0.5).dot(a), (p.truncate() - 0.5).dot(b))
        });
        for (tiling, map) in [
            (1.0, ramp(along_b / along_a)),
            (0.5, ramp(along_b / along_a)),
        ] {
            let m = bump_mapped(map, along_a / tiling);
            let scene = mesh(
                &SQUARE,
                &[],
                &uvs,
                MaterialDesc {
                    tiling,
                    uv_offset: Vec2::splat(0.5 - 0.5 * tiling),
                    ..m
                },
            );
            for primitive in [0, 1] {
                for uv in [[0.3, 0.3], [0.4, 0.2]] {
                    let n = at(&scene, primitive, uv).n_shading;
                    assert!(
                        (n - expected).length() < 1e-5,
                        "{a} {b} {tiling}: {n} instead of {expected}"
                    );
                }
            }
        }
        // The same heights on the second set of coordinates, with a transform for this slot only.
        let map =
            Affine2::from_scale_angle_translation(Vec2::new(0.8, 1.3), 0.4, Vec2::new(0.2, -0.1));
        let lookup = Lookup {
            second: true,
            map: Some(map),
            ..Lookup::default()
        };
        let mut m = bump_mapped(ramp(along_b / along_a), along_a);
        m.set_lookup(TextureSlot::Bump, lookup);
        let before = uvs.map(|uv| map.inverse().transform_point2(uv));
        let scene = mesh_with_second_uvs(&SQUARE, &[], &[Vec2::ZERO; 4], &before, m);
        for primitive in [0, 1] {
            let n = at(&scene, primitive, [0.3, 0.3]).n_shading;
            assert!(
                (n - expected).length() < 1e-5,
                "{a} {b}: {n} instead of {expected}"
            );
        }
    }
}

#[test]
fn bumps_of_a_scaled_entity_have_world_space_slopes() {
    let uvs = [
        Vec2::splat(0.2),
        Vec2::new(0.8, 0.2),
        Vec2::splat(0.8),
        Vec2::new(0.2, 0.8),
    ];
    let flat = |scale: Vec3| SQUARE.map(|p| p * scale);
    let n = at(
        &mesh(
            &flat(Vec3::new(4.0, 1.0, 1.0)),
            &[],
            &uvs,
            bump_mapped(ramp(1.0), 0.5),
        ),
        0,
        [0.3, 0.3],
    )
    .n_shading;
    // The height changes by 0.3 (0.6 of a repeat) over 4 units along x and over 1 unit along y.
    let expected = Vec3::new(-0.3 / 4.0, -0.3, 1.0).normalize_or(Vec3::Z);
    assert!((n - expected).length() < 1e-5, "{n} instead of {expected}");
}

#[test]
fn bumps_of_a_sphere_follow_its_longitude_and_latitude() {
    let radius = 2.0;
    for (rise, height) in [(0.0, 0.7), (1.0, 0.4), (-0.5, -0.3)] {
        let mut builder = SceneBuilder::new(Vec3::Z * 9.0, Vec3::ZERO, 40.0);
        let map = builder.texture(Texture::decode(&ramp(rise), false));
        let m = Material {
            bump_texture: map,
            bump_height: height,
            ..WHITE
        };
        let scene = builder.sphere(Vec3::ZERO, radius, m).build();
        let n = Vec3::new(0.48, 0.36, 0.8);
        let ray = Ray {
            origin: n * 5.0,
            dir: -n,
        };
        let s = Surface::at(
            &scene,
            &ray,
            &Hit {
                t: 3.0,
                primitive: 0,
                instance: NONE,
                uv: [0.0; 2],
            },
        );
        // One repeat around the circle of latitude, one repeat from pole to pole.
        let around = std::f32::consts::TAU * radius * n.x.hypot(n.z);
        let east = Vec3::new(n.z, 0.0, -n.x).normalize_or(Vec3::X);
        let slope = east * (height / around)
            + n.cross(east) * (height * rise / (std::f32::consts::PI * radius));
        let expected = (n - slope).normalize_or(n);
        assert!(
            (s.n_shading - expected).length() < 1e-5,
            "{} instead of {expected}",
            s.n_shading
        );
    }
}

#[test]
fn slopes_of_bump_and_normal_maps_add_and_flat_maps_have_no_effect() {
    let uvs = [
        Vec2::splat(0.2),
        Vec2::new(0.8, 0.2),
        Vec2::splat(0.8),
        Vec2::new(0.2, 0.8),
    ];
    let mut both = bump_mapped(ramp(0.5), 0.5);
    both.set_texture(
        TextureSlot::Normal,
        Some(normal_map(Vec3::new(0.48, -0.36, 0.8))),
    );
    let n = at(&mesh(&SQUARE, &[], &uvs, both.clone()), 0, [0.3, 0.3]).n_shading;
    let expected = Vec3::new(0.6 - 0.3, -0.45 - 0.15, 1.0).normalize_or(Vec3::Z);
    assert!((n - expected).length() < 1e-5, "{n} instead of {expected}");
    for even in [
        bump_mapped(heights(4, vec![7.0; 16]), 3.0),
        bump_mapped(ramp(0.5), 0.0),
        bump_mapped(heights(1, vec![4.0]), 1.0),
    ] {
        assert!(
            (at(&mesh(&SQUARE, &[], &uvs, even), 0, [0.3, 0.3]).n_shading - Vec3::Z).length()
                < 1e-6
        );
    }
    assert_eq!(
        mesh(&SQUARE, &[], &uvs, bump_mapped(ramp(0.5), 0.0)).materials[0].bump_texture,
        NONE
    );
}

#[test]
fn bumps_never_turn_a_normal_behind_its_triangle_and_need_coordinates_with_area() {
    let uvs = [
        Vec2::splat(0.2),
        Vec2::new(0.8, 0.2),
        Vec2::splat(0.8),
        Vec2::new(0.2, 0.8),
    ];
    let tilted = Vec3::new(0.9, 0.1, 0.3).normalize_or(Vec3::Z);
    for height in [1e-3, 1.0, 1e3, 1e6] {
        for normals in [vec![], vec![tilted; 4]] {
            let scene = mesh(&SQUARE, &normals, &uvs, bump_mapped(ramp(-2.0), height));
            let s = at(&scene, 0, [0.2, 0.3]);
            assert!(
                s.n_shading.dot(s.n_geometric) > 0.0 && (s.n_shading.length() - 1.0).abs() < 1e-5,
                "{height}"
            );
        }
    }
    for uvs in [vec![], vec![Vec2::splat(0.3); 4]] {
        assert_eq!(
            at(
                &mesh(&SQUARE, &[], &uvs, bump_mapped(ramp(1.0), 1.0)),
                0,
                [0.2, 0.3]
            )
            .n_shading,
            Vec3::Z
        );
    }
}

/// The step of heights from 0 to 1 lies between the middles of two texels. At x = 0.4, a quarter of a
/// texel behind the first, a difference over one texel has 0.6 of its slope, and the derivative all.
#[test]
fn slopes_are_differences_over_a_texel_or_derivatives_by_the_formulas_of_mitsuba() {
    let uvs = SQUARE.map(Vec3::truncate);
    let step = heights(4, vec![0.0, 0.0, 1.0, 1.0]);
    for (formulas, at_04, at_03) in [(Formulas::Lumbre, 2.4, 0.8), (Formulas::Mitsuba, 4.0, 0.0)] {
        let m = MaterialDesc {
            formulas,
            ..bump_mapped(Arc::clone(&step), 0.1)
        };
        let scene = mesh(&SQUARE, &[], &uvs, m);
        for (barycentric, slope) in [([0.2, 0.2], at_04), ([0.15, 0.15], at_03)] {
            let n = at(&scene, 0, barycentric).n_shading;
            let expected = Vec3::new(-0.1 * slope, 0.0, 1.0).normalize_or(Vec3::Z);
            assert!(
                (n - expected).length() < 1e-5,
                "{formulas:?}: {n}, not {expected}"
            );
        }
    }
}
