//! Lights of every kind.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{MaskMode, Material, Texture, Uv};
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::light::{LightId, LightPoint, Lights};
use lumbre_render::Job;

use super::{RandomInputs, SAME};
use crate::common::{SceneBuilder, WHITE, grey, job};
use crate::parity::{Near, Row, Twin};

/// Returns a scene with lights of every kind, including textured and masked ones, and an
/// environment with or without a map.
fn lit(map: bool) -> (Arc<CompiledScene>, Job) {
    let mut d = RandomInputs {
        count: 1 << 21,
        words: Vec::new(),
    };
    let mut texture = |width: u32, height: u32| {
        let texels: Vec<[f32; 3]> = (0..width * height)
            .map(|_| std::array::from_fn(|_| d.unit()))
            .collect();
        Texture::new(width, height, texels)
    };
    let (sky, pattern, by_direction) = (texture(9, 5), texture(4, 4), texture(5, 3));
    let slide = texture(3, 4);
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 60.0);
    let index = builder.texture(pattern);
    let emitting = Material {
        emission: Vec3::new(4.0, 2.0, 1.0),
        emission_texture: index,
        ..WHITE
    };
    let masked = Material {
        mask_texture: index,
        mask_mode: MaskMode::Blend,
        ..emitting
    };
    let bright = Material {
        emission: Vec3::splat(900.0),
        ..emitting
    };
    let scene = builder
        .quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X, Vec3::Z, emitting)
        .triangle(
            [Vec3::ZERO, Vec3::X, Vec3::Y],
            [Vec2::ZERO, Vec2::X, Vec2::ONE],
            masked,
        )
        .quad(
            Vec3::new(-3.0, -2.0, -3.0),
            Vec3::Z * 6.0,
            Vec3::X * 6.0,
            grey(0.5),
        )
        .sphere(Vec3::new(1.0, 2.0, 3.0), 0.5, emitting)
        .sphere(Vec3::new(-1.0, -1.0, 0.0), 0.01, bright)
        .point(Vec3::Y, Vec3::ONE)
        .point(Vec3::new(2.0, -1.0, 1.0), Vec3::new(0.0, 5.0, 1.0))
        .spot(
            Vec3::new(0.5, 1.5, -0.5),
            Vec3::new(0.2, -1.0, 0.4),
            Vec3::ONE,
            cone(ConeEdge::Linear),
        )
        .spot(
            Vec3::new(-0.5, 1.0, 0.5),
            Vec3::new(-0.2, -1.0, 0.1),
            Vec3::ONE,
            cone(ConeEdge::Smooth),
        )
        .goniometric(Vec3::new(1.5, 0.5, 0.5), Vec3::ONE, by_direction, 70.0)
        .projector(
            [
                Vec3::new(0.5, 1.0, 0.5),
                Vec3::new(0.1, -1.0, 0.2),
                Vec3::ONE,
            ],
            cone(ConeEdge::Linear),
            slide.clone(),
            true,
        )
        .projector(
            [
                Vec3::new(-0.5, 1.0, -0.5),
                Vec3::new(-0.1, -1.0, 0.3),
                Vec3::ONE,
            ],
            cone(ConeEdge::Smooth),
            slide,
            false,
        )
        .directional(Vec3::new(0.3, -1.0, 0.2), Vec3::ONE)
        .environment(map.then_some(sky), Vec3::new(0.5, 0.6, 0.7), 30.0);
    (scene.build(), job([64, 36], 5, 7))
}

fn cone(edge: ConeEdge) -> ConeDesc {
    ConeDesc {
        beam_deg: 25.0,
        cutoff_deg: 70.0,
        edge,
    }
}

fn put_point(lights: &Lights, point: Option<LightPoint>, row: &mut Row) {
    let none = LightPoint {
        lights: [LightId::Point(0)],
        position: Vec3::ZERO,
        normal: Vec3::ZERO,
        extent: 0.0,
        uv: Uv::zero(),
    };
    let index = point
        .and_then(|p| lights.indices().find(|i| lights.id(*i) == p.light()))
        .unwrap_or(0);
    let point = point.unwrap_or(none);
    row.push(index);
    row.push_floats(point.position.to_array());
    row.push_floats(point.normal.to_array());
    row.push_floats(point.uv.first);
}

fn inputs() -> Vec<u32> {
    RandomInputs::rows(4000, |d, i| {
        let from = d.vector([0.5, 3.0, 30.0][i as usize % 3]);
        let u = match i % 8 {
            0 => [0.0, 0.0],
            1 => [0.999_999_94, 0.999_999_94],
            _ => [d.unit(), d.unit()],
        };
        let (choice, v, dir) = (d.unit(), [d.unit(), d.unit()], d.direction());
        d.put(from.to_array());
        d.put([choice]);
        d.put(u);
        d.put(v);
        d.put(dir.to_array());
    })
}

fn original(scene: &CompiledScene, _: &Job, row: &mut Row) {
    let from = Vec3::from_array(row.floats());
    let [choice] = row.floats();
    let (u, v): ([f32; 2], [f32; 2]) = (row.floats(), row.floats());
    let dir = Vec3::from_array(row.floats());
    let lights = Lights::new(scene);
    let d = lights.sample_direct(scene, from, choice, u);
    row.push(u32::from(d.is_some()));
    row.push_floats(d.map_or(Vec3::ZERO, |d| d.wi).to_array());
    row.push_floats([d.map_or(0.0, |d| d.distance)]);
    row.push_floats(d.map_or(Vec3::ZERO, |d| d.radiance).to_array());
    row.push_floats([d.map_or(0.0, |d| d.pdf_w)]);
    row.push(u32::from(d.is_some_and(|d| d.delta)));
    put_point(&lights, d.map(|d| d.point), row);
    let again = d.map_or(0.0, |d| match d.point.light() {
        LightId::Emitter(i) => lights.pdf_direct_w(from, i, d.point.position, d.point.normal),
        _ => 0.0,
    });
    row.push_floats([again]);
    let e = lights
        .sample_emission(scene, choice, u, v)
        .expect("all lights emit");
    row.push(1);
    row.push_floats(e.dir.to_array());
    row.push_floats(e.radiance.to_array());
    row.push_floats([e.pdf_a, e.pdf_w, e.cos]);
    put_point(&lights, Some(e.point), row);
    let pdf = lights.pdf_emission_at(&e.point, e.dir);
    row.push_floats([pdf.pdf_a, pdf.pdf_w]);
    row.push_floats(lights.emitted(scene, &e.point, e.dir).to_array());
    row.push_floats(lights.environment(dir).to_array());
    row.push_floats([lights.pdf_environment_w(dir)]);
}

const NEAR: [Near; 48] = {
    let mut near = [Near::Float {
        absolute: 2e-5,
        relative: 1e-4,
    }; 48];
    // Positions outside the scene are a dozen units away, and up to a hundred from the receiving
    // point.
    let places = [11, 12, 13, 31, 32, 33];
    let mut i = 0;
    while i < places.len() {
        near[places[i]] = Near::Float {
            absolute: 1e-3,
            relative: 1e-5,
        };
        i += 1;
    }
    let integers = [0, 9, 10, 20, 30];
    let mut i = 0;
    while i < integers.len() {
        near[integers[i]] = SAME;
        i += 1;
    }
    near
};

/// Lights with an environment map.
pub const LIGHT: Twin = Twin {
    name: "light",
    kernel: kernel!(Generation "light.rgen"),
    scene: || lit(true),
    in_words: 11,
    inputs,
    original,
    near: &NEAR,
    max_outliers: 0.02,
    why: "densities per solid angle are quotients of lengths of a few units, steep where a light \
          is seen from its edge; a direction on the border of two cells of the map may belong to \
          either",
};

/// Lights with a constant environment.
pub const LIGHT_PLAIN: Twin = Twin {
    scene: || lit(false),
    ..LIGHT
};
