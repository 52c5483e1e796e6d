//! The table of GLSL twins and their Rust originals, with a file for every module.
//!
//! Floats differ because devices may fuse a product and a sum, divide and take roots to a few units
//! in the last place, and because a few formulas are evaluated in another order. The difference
//! grows where a function is steep: each entry states how much and why.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::warp::uniform_sphere;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Texture;
use lumbre_render::Job;

use super::parity::{Near, Twin};
use crate::common::{SceneBuilder, WHITE, grey, job, light};

mod camera;
mod integrator;
mod light;
mod math;
mod surface;
mod time;

/// Tolerance of words that must have the same bits.
const SAME: Near = Near::Bits;

/// Returns a scene with one of each kind of primitive, light and texture.
pub fn plain() -> (Arc<CompiledScene>, Job) {
    let texture = Texture::new(2, 1, vec![[0.1, 0.2, 0.3], [0.4, 0.5, 0.6]]);
    let sky = Texture::new(2, 2, vec![[1.0; 3], [0.5; 3], [0.25, 0.0, 0.75], [2.0; 3]]);
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

/// Uploaded scene data.
const SCENE: Twin = Twin {
    name: "scene",
    kernel: kernel!(Generation "scene.rgen"),
    scene: plain,
    in_words: 1,
    inputs: || vec![0],
    original: |scene, job, row| {
        row.word();
        for c in &scene.triangles[2] {
            row.push_floats(c.to_array());
        }
        let a = &scene.attributes[1];
        row.push_floats(scene.normals.at(1)[2].to_array());
        row.push_floats(scene.uvs[1][2].to_array());
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
        row.push_floats(scene.textures[0].texels.at(1));
        row.push_floats(
            scene
                .environment
                .as_ref()
                .unwrap()
                .map
                .as_ref()
                .unwrap()
                .texels
                .at(2),
        );
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
    max_outliers: 0.0,
    why: "uploaded data is read back unchanged",
};

/// Tolerance of a few roundings: integers have the same bits, floats nearly so.
const CLOSE: Near = Near::Float {
    absolute: 2e-6,
    relative: 2e-6,
};

/// The table of all twins.
pub const TWINS: &[&Twin] = &[
    &SCENE,
    &math::MATH,
    &math::SAMPLER,
    &surface::SURFACE,
    &surface::BSDF,
    &surface::BSDF_SAMPLE,
    &light::LIGHT,
    &light::LIGHT_PLAIN,
    &camera::FILTER,
    &camera::CAMERA,
    &camera::OFF_AXIS,
    &camera::ORTHOGRAPHIC,
    &camera::SPHERICAL,
    &time::DELAYS,
    &integrator::BPT,
    &integrator::BPT_OPEN,
    &integrator::NEE,
    &integrator::NEE_OPEN,
    &integrator::NEE_TERMINATOR,
    &integrator::BDPT,
    &integrator::BDPT_OPEN,
    &integrator::BDPT_TERMINATOR,
];

/// Generator of random inputs.
pub struct RandomInputs {
    count: u32,
    words: Vec<u32>,
}

impl RandomInputs {
    /// Returns `rows` rows of inputs: `row` is called for each and appends its words.
    pub fn rows(rows: u32, mut row: impl FnMut(&mut RandomInputs, u32)) -> Vec<u32> {
        let mut inputs = RandomInputs {
            count: 0,
            words: Vec::new(),
        };
        (0..rows).for_each(|i| row(&mut inputs, i));
        inputs.words
    }

    /// Returns a random word.
    pub fn word(&mut self) -> u32 {
        self.count += 1;
        pcg4d([self.count, 11, 22, 33])[0]
    }

    /// Returns a number in `[0, 1)` with the distribution of a sampler's.
    pub fn unit(&mut self) -> f32 {
        unit(self.word())
    }

    /// Returns a number between `low` and `high`.
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.unit()
    }

    /// Returns a parameter in 0..=1, often at one of the ends.
    pub fn part(&mut self) -> f32 {
        match self.word() % 4 {
            0 => 0.0,
            1 => 1.0,
            _ => self.unit(),
        }
    }

    /// Returns a unit vector, sometimes along an axis or close to it.
    pub fn direction(&mut self) -> Vec3 {
        let w = uniform_sphere([self.unit(), self.unit()]);
        match self.word() % 12 {
            0 => {
                [Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z][self.word() as usize % 6]
            }
            1 => Vec3::new(w.x * 1e-3, w.y * 1e-3, w.z.signum()).normalize_or(Vec3::Z),
            _ => w,
        }
    }

    /// Returns a vector in a cube about the origin.
    pub fn vector(&mut self, half: f32) -> Vec3 {
        Vec3::from_array(std::array::from_fn(|_| self.between(-half, half)))
    }

    /// Appends a word.
    pub fn put_word(&mut self, word: u32) {
        self.words.push(word);
    }

    /// Appends floats.
    pub fn put(&mut self, floats: impl IntoIterator<Item = f32>) {
        self.words.extend(floats.into_iter().map(f32::to_bits));
    }
}
