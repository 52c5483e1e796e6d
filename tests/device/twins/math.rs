//! Twins of `crates/lumbre-light/src/math`, of the small functions of `crates/lumbre-light/src/transport`, and of the samplers.

use glam::Vec3;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::math::{Frame, distribution::AliasTable, warp};
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::mis::Heuristic;
use lumbre_light::transport::ray::offset_origin;
use lumbre_light::transport::sampler::{INDEPENDENT, SOBOL, sampler};
use lumbre_light::transport::vertex::area_factor;

use super::{CLOSE, RandomInputs, SAME};
use crate::parity::{Near, Twin};

/// Tolerances: words that are compared bit by bit, then floats.
const NEAR: [Near; 39] = {
    let mut near = [CLOSE; 39];
    let mut i = 0;
    while i < 7 {
        near[i] = SAME;
        i += 1;
    }
    // Angles up to a few thousand radians have the rounding error of a float of their size.
    near[33] = Near::Float {
        absolute: 1e-6,
        relative: 0.0,
    };
    near[34] = Near::Float {
        absolute: 1e-6,
        relative: 0.0,
    };
    // The height above the rim of the disk is the square root of a rounded difference from one.
    near[16] = Near::Float {
        absolute: 4e-4,
        relative: 2e-6,
    };
    near
};

/// Returns the lights of a scene and their number.
fn choice(scene: &CompiledScene) -> (Lights, u32) {
    let lights = Lights::new(scene);
    let count = lights.count() as u32;
    (lights, count)
}

/// Hashes, random numbers, warps, frames and measures.
pub const MATH: Twin = Twin {
    name: "math",
    kernel: kernel!(Generation "math.rgen"),
    scene: super::plain,
    in_words: 18,
    inputs: || {
        RandomInputs::rows(4000, |d, i| {
            (0..4).for_each(|_| {
                let w = d.word();
                d.put_word(w);
            });
            let u = match i % 8 {
                0 => [0.0, 0.0],
                1 => [0.5, 0.5],
                2 => [0.0, 0.999_999_94],
                _ => [d.unit(), d.unit()],
            };
            let scale = [1e-3, 1.0, 7.0, 300.0][d.word() as usize % 4];
            let (p, n, q) = (d.vector(scale), d.direction(), d.vector(scale));
            let pair = [
                d.between(-9.0, 9.0).exp2(),
                if i.is_multiple_of(9) {
                    0.0
                } else {
                    d.between(-60.0, 60.0).exp2()
                },
            ];
            d.put(u);
            d.put(p.to_array());
            d.put(n.to_array());
            d.put(q.to_array());
            d.put(pair);
            d.put_word(i % 3);
        })
    },
    original: |scene, _, row| {
        let words = [row.word(), row.word(), row.word(), row.word()];
        let u: [f32; 2] = row.floats();
        let [p, n, q]: [Vec3; 3] = [(); 3].map(|()| Vec3::from_array(row.floats()));
        let [own, other]: [f32; 2] = row.floats();
        let h = [Heuristic::Power, Heuristic::Balance, Heuristic::Uniform][row.word() as usize];
        let hashed = pcg4d(words);
        row.push_words(hashed);
        row.push_floats([unit(hashed[0])]);
        let (lights, count) = choice(scene);
        let table = AliasTable::new((0..count).map(|i| f64::from(lights.pdf_choice(lights.id(i)))))
            .unwrap();
        let (item, probability) = table.sample(u[0]);
        row.push(item as u32);
        row.push_floats([probability]);
        row.push_floats(offset_origin(p, n, q.x.abs()).to_array());
        row.push_floats(warp::uniform_triangle(u));
        row.push_floats(warp::concentric_disk(u).to_array());
        row.push_floats(warp::cosine_hemisphere(u).to_array());
        row.push_floats([warp::cosine_hemisphere_pdf_w(n.z)]);
        row.push_floats(warp::uniform_sphere(u).to_array());
        let f = Frame::from_normal(n);
        for v in [f.s, f.t, f.to_local(p), f.to_world(p)] {
            row.push_floats(v.to_array());
        }
        let (sin, cos) = p.x.sin_cos();
        row.push_floats([sin, cos, p.y.atan2(p.z), n.x.acos()]);
        row.push_floats([area_factor(p, q, n), h.weight(own, other)]);
    },
    near: &NEAR,
    max_outliers: 0.001,
    why: "hashes and choices have the same bits, the rest differs by a few roundings; a vector \
          that is nearly orthogonal to an axis of the frame loses digits to cancellation",
};

const SEEDS: [[u32; 2]; 3] = [[7, 0], [0, 256], [0xffff_ffff, 0x8000_0001]];

/// All samplers.
pub const SAMPLER: Twin = Twin {
    name: "sampler",
    kernel: kernel!(Generation "sampler.rgen"),
    scene: super::plain,
    in_words: 6,
    inputs: || {
        RandomInputs::rows(3000, |d, i| {
            SEEDS[i as usize % 3]
                .into_iter()
                .for_each(|w| d.put_word(w));
            let big = if i.is_multiple_of(5) { 1 << 20 } else { 2000 };
            for _ in 0..2 {
                let w = d.word() % big;
                d.put_word(w);
            }
            let low = [i, d.word()][i as usize % 2];
            d.put_word(low);
            d.put_word([0, 0, 3, 0x0102_0304][i as usize % 4]);
        })
    },
    original: |_, job, row| {
        let words: Vec<u32> = (0..6).map(|_| row.word()).collect();
        let wide = |i: usize| u64::from(words[i]) | u64::from(words[i + 1]) << 32;
        let (seed, pixel, index) = (wide(0), [words[2], words[3]], wide(4));
        let mut independent = INDEPENDENT.start(seed, pixel, index);
        let mut sobol = SOBOL.start(seed, pixel, index);
        let zsobol = sampler("zsobol16").unwrap();
        let mut zsobol = zsobol.start(seed, pixel, index);
        for i in 0..14 {
            if i % 7 == 1 || i % 7 > 4 {
                row.push_floats(sobol.next_2d());
                row.push_floats(zsobol.next_2d());
            } else {
                row.push_floats([sobol.next_1d()]);
                row.push_floats([zsobol.next_1d()]);
            }
            row.push_floats([independent.next_1d()]);
        }
        let mut either = job.sampler.start(job.seed, pixel, index);
        row.push_floats([either.next_1d()]);
        row.push_floats(either.next_2d());
    },
    near: &[SAME; 57],
    max_outliers: 0.0,
    why: "all steps use integers except the last, which is exact",
};
