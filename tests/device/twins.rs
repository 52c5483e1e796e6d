//! The table of GLSL twins and their Rust originals.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre::render::Job;
use lumbre::scene::CompiledScene;
use lumbre::scene::compile::Texture;

use super::parity::{Near, Twin};
use crate::common::{SceneBuilder, WHITE, grey, job, light};

const SAME: Near = Near::Bits;

/// A scene with one of everything.
pub fn plain() -> (Arc<CompiledScene>, Job) {
    let texture = Texture { width: 2, height: 1, texels: vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]] };
    let sky = Texture { width: 2, height: 2, texels: vec![[1.0; 3], [0.5; 3], [0.25, 0.0, 0.75], [2.0; 3]] };
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 3.0), Vec3::ZERO, 60.0);
    let index = builder.texture(texture);
    let mut textured = grey(0.5);
    textured.base_color_texture = index;
    let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE];
    let scene = builder
        .triangle([Vec3::ZERO, Vec3::X, Vec3::Y], uvs, textured)
        .quad(Vec3::new(-1.0, 2.0, -1.0), Vec3::X, Vec3::Z, light(3.0))
        .sphere(Vec3::new(1.0, 2.0, 3.0), 0.5, WHITE)
        .point(Vec3::Y, Vec3::ONE)
        .directional(-Vec3::Y, Vec3::ONE)
        .environment(Some(sky), Vec3::splat(0.5), 30.0)
        .build();
    (scene, job([64, 36], 5, 7 | 1 << 40))
}

/// Every twin.
pub const TWINS: &[Twin] = &[Twin {
    name: "scene",
    text: include_str!("parity/scene.comp"),
    scene: plain,
    in_words: 1,
    inputs: || vec![0],
    original: |scene, job, row| {
        row.word();
        for c in &scene.triangles[2] {
            row.push_floats(c.to_array());
        }
        let a = &scene.attributes[1];
        row.push_floats(a.normals[2].to_array());
        row.push_floats(a.uvs[2].to_array());
        row.push(a.material);
        row.push(a.emitter);
        row.push_floats(scene.spheres[0].center.to_array());
        row.push_floats([scene.spheres[0].radius]);
        row.push(scene.spheres[0].emitter);
        let last = scene.materials.last().unwrap();
        row.push_floats(last.base_color.to_array());
        row.push_floats([last.ior, last.tiling.scale]);
        row.push(last.normal_texture);
        row.push(u32::from(last.emitter_reflects));
        row.push_floats(scene.textures[0].texels[1]);
        row.push_floats(scene.environment.as_ref().unwrap().map.as_ref().unwrap().texels[2]);
        row.push_floats([scene.emitters[1].area]);
        row.push_floats(scene.points[0].position.to_array());
        row.push_floats(scene.directionals[0].direction.to_array());
        for n in [scene.triangles.len(), scene.spheres.len(), 5] {
            row.push(n as u32);
        }
        row.push(job.resolution[0]);
        row.push(job.seed as u32);
        row.push((job.seed >> 32) as u32);
    },
    near: &[SAME; 47],
    strays: 0.0,
    why: "what was uploaded is read back as it was",
}];
