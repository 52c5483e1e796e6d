//! The wavefront renders the same bits as the scalar path for every kind of light.

use glam::{Vec2, Vec3};
use lumbre_light::scene::compile::{MaskMode, Material, Texture};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};

use crate::common::{SceneBuilder, light};
use crate::render::wavefront_fixtures::{
    DISNEY, assert_same_bits, assert_same_film_bits, nee_job, with_bdpt, with_bpt,
    with_guided_bdpt, with_lvc, with_sppm, with_vcm,
};

#[test]
fn every_kind_of_light_has_the_same_bits_in_lanes() {
    let open = || {
        SceneBuilder::new(Vec3::new(0.0, 0.3, 2.5), Vec3::ZERO, 60.0)
            .quad(
                Vec3::new(-1.0, -0.5, -1.0),
                Vec3::Z * 2.0,
                Vec3::X * 2.0,
                Material {
                    roughness: 0.4,
                    ..DISNEY
                },
            )
            .quad(
                Vec3::new(-0.9, -0.4, -0.9),
                Vec3::Z * 0.8,
                Vec3::X * 0.8,
                Material {
                    opacity: 0.3,
                    ..DISNEY
                },
            )
    };
    let glass = Material {
        opacity: 0.0,
        roughness: 0.0,
        ..DISNEY
    };
    let ball = |scene: SceneBuilder| scene.sphere(Vec3::ZERO, 0.4, glass);
    let mut textured = open();
    let picture = textured.texture(Texture::new(
        2,
        2,
        vec![[0.0; 3], [1.0; 3], [4.0; 3], [12.0; 3]],
    ));
    let holes = textured.texture(Texture::new(2, 1, vec![[0.2; 3], [1.0; 3]]));
    let lamp = |at: Vec3, material| {
        let corners = [at, at + Vec3::X * 0.5, at + Vec3::Z * 0.5];
        move |scene: SceneBuilder| scene.triangle(corners, [Vec2::ZERO, Vec2::X, Vec2::Y], material)
    };
    let high = Vec3::new(-0.2, 1.2, -0.2);
    let textured = lamp(
        high,
        Material {
            emission_texture: picture,
            ..light(3.0)
        },
    )(textured);
    let textured = lamp(
        high + Vec3::X * 0.6,
        Material {
            mask_texture: holes,
            ..light(3.0)
        },
    )(textured);
    let textured = lamp(high - Vec3::X * 0.6, light(3.0))(textured);
    let cone = |edge| ConeDesc {
        beam_deg: 10.0,
        cutoff_deg: 40.0,
        edge,
    };
    let sky = Texture::new(
        4,
        2,
        (0..8).map(|i| [i as f32 * 0.2; 3]).collect::<Vec<_>>(),
    );
    let mut painted = ball(open());
    let emission_texture = painted.texture(Texture::new(2, 1, vec![[0.5; 3], [2.0; 3]]));
    let mask_texture = painted.texture(Texture::new(2, 1, vec![[0.2; 3], [1.0; 3]]));
    let scenes = [
        (
            "spots",
            ball(open())
                .spot(
                    Vec3::new(0.5, 1.0, 0.5),
                    Vec3::new(-0.4, -1.0, -0.5),
                    Vec3::splat(3.0),
                    cone(ConeEdge::Linear),
                )
                .spot(
                    Vec3::new(-0.5, 1.0, 0.5),
                    -Vec3::Y,
                    Vec3::splat(2.0),
                    cone(ConeEdge::Smooth),
                )
                .point(Vec3::new(0.5, 1.0, 0.5), Vec3::splat(0.5)),
        ),
        (
            "environment map",
            ball(open()).environment(Some(sky), Vec3::new(0.5, 0.7, 1.0), 20.0),
        ),
        (
            "textured and masked spheres",
            painted
                .sphere(
                    Vec3::new(0.6, 0.8, 0.3),
                    0.2,
                    Material {
                        emission_texture,
                        ..light(9.0)
                    },
                )
                .sphere(
                    Vec3::new(-0.6, 0.8, 0.3),
                    0.2,
                    Material {
                        mask_texture,
                        mask_mode: MaskMode::Blend,
                        ..light(6.0)
                    },
                ),
        ),
        (
            "point",
            ball(open()).point(Vec3::new(0.5, 1.0, 0.5), Vec3::splat(3.0)),
        ),
        (
            "direction",
            ball(open()).directional(Vec3::new(0.2, -1.0, 0.1), Vec3::splat(2.0)),
        ),
        (
            "environment",
            ball(open()).environment(None, Vec3::new(0.5, 0.7, 1.0), 0.0),
        ),
        ("triangles with textures, with masks, and plain", textured),
        (
            "triangle that faces no surface",
            lamp(Vec3::new(0.0, -0.6, 0.0), light(3.0))(ball(open())).sphere(
                Vec3::Y,
                0.1,
                light(1.0),
            ),
        ),
        (
            "sphere",
            ball(open()).sphere(Vec3::new(0.6, 0.8, 0.3), 0.2, light(9.0)),
        ),
        (
            "all of them",
            ball(open().ceiling(0.2, 1.2, light(5.0)))
                .sphere(Vec3::new(-0.6, 0.5, 0.3), 0.1, light(4.0))
                .point(Vec3::new(0.5, 1.0, 0.5), Vec3::ONE)
                .directional(Vec3::new(0.2, -1.0, 0.1), Vec3::ONE)
                .environment(None, Vec3::splat(0.2), 0.0),
        ),
    ];
    for (name, scene) in scenes {
        let scene = scene.build();
        assert_same_bits(name, &scene, nee_job([31, 19], 5), 9);
        assert_same_bits(name, &scene, with_bdpt(nee_job([31, 19], 5)), 5);
        for with in [with_sppm, with_vcm, with_lvc, with_guided_bdpt] {
            assert_same_film_bits(name, &scene, with(nee_job([31, 19], 5)), 2);
        }
        if name == "all of them" {
            assert_same_bits(name, &scene, with_bpt(nee_job([31, 19], 5)), 9);
        }
    }
}
