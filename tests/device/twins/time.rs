//! Profiles in time, the time axis, and the optical lengths that lights and samplers need.

use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre_light::film::time::TimeFilter;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::{DelayParam, Texture, Uv, UvMap};
use lumbre_light::transport::delay;
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::time_settings::Timing;
use lumbre_render::Job;

use super::{CLOSE, RandomInputs, SAME};
use crate::harness::{add_delays, timing};
use crate::parity::{Near, Twin};

const START: f64 = 1.0;
const BIN: f64 = 0.3;
const BINS: u32 = 20;
const SIGMA: f64 = 0.75;

/// Returns a scene with every profile, one of them with textures.
fn scene() -> (Arc<CompiledScene>, Job) {
    let (mut scene, job) = super::plain();
    let scene_mut = Arc::make_mut(&mut scene);
    let texels = vec![[0.1; 3], [0.9; 3], [0.4; 3], [0.6; 3]];
    scene_mut.textures.push(Texture::new(2, 2, texels));
    let texture = scene_mut.textures.len() as u32 - 1;
    add_delays(scene_mut);
    let mut textured = scene_mut.delays.profiles[2].clone();
    textured.params = [
        DelayParam {
            value: 0.5,
            offset: 1.0,
            texture,
        },
        DelayParam {
            value: 0.4,
            offset: 0.2,
            texture,
        },
    ];
    textured.tiling = UvMap {
        scale: 2.0,
        offset: Vec2::new(0.25, 0.5),
    };
    scene_mut.delays.profiles.push(textured);
    let timing = Timing {
        filter: TimeFilter::Gauss(SIGMA),
        ..timing(START, BIN, BINS)
    };
    (scene, job.with(|settings| settings.timing = Some(timing)))
}

/// Returns the part of the filter about `place` below `x`, summed from the shares of the slots.
fn below(x: u32, place: f64) -> f64 {
    let axis = timing(START, BIN, BINS).axis;
    let mut sum = 0.0;
    TimeFilter::Gauss(SIGMA).spread(&axis, place, |slot, share| {
        if slot as u32 <= x {
            sum += share;
        }
    });
    sum
}

/// Tolerance of a filter's share, from a fit of the error function to 1.2e-7 in single precision.
const SHARE: Near = Near::Float {
    absolute: 1e-6,
    relative: 0.0,
};
/// Tolerance of a delay, with the error of an arc sine near the ends.
const DELAY: Near = Near::Float {
    absolute: 3e-6,
    relative: 3e-6,
};

/// Delays, time slots, and shares of the time filter.
pub const DELAYS: Twin = Twin {
    name: "delay",
    kernel: kernel!(Generation "delay.rgen"),
    scene,
    in_words: 12,
    inputs: || {
        RandomInputs::rows(3000, |d, i| {
            let u = match i % 16 {
                0 => 0.0,
                1 => 0.999_999_94,
                2 => 0.5,
                3 => 5.960_464_5e-8,
                _ => d.unit(),
            };
            let optical = [
                d.between(-2.0, 12.0),
                START as f32,
                1.5 + 0.5 * (i % 7) as f32,
            ];
            let optical = optical[[0, 0, 0, 0, 0, 1, 2, 2][i as usize % 8]];
            let uv = [d.between(-2.0, 2.0), d.between(-2.0, 2.0)];
            d.put([u, optical]);
            d.put(uv);
            d.put_word(i % 5);
            let slot = d.word() % BINS;
            d.put([slot as f32]);
            let (from, wi) = (d.vector(3.0), d.direction());
            d.put(from.to_array());
            d.put(wi.to_array());
        })
    },
    original: |scene, job, row| {
        let [u, optical]: [f32; 2] = row.floats();
        let uv = Vec2::from_array(row.floats());
        let index = row.word();
        let profile = delay::profile_at(
            &scene.delays.profiles[index as usize],
            &scene.textures,
            Uv::same(uv),
        );
        row.push_floats([profile.sample(u)]);
        let axis = job.settings.timing.as_ref().unwrap().axis;
        let place = axis.bin_position(f64::from(optical));
        row.push(axis.slot(place) as u32);
        let x = row.float();
        row.push_floats([below(x as u32, place) as f32]);
        row.push_floats([(-u).ln_1p(), (2.0 * u - 1.0).asin()]);
        let [from, wi]: [Vec3; 2] = [(); 2].map(|()| Vec3::from_array(row.floats()));
        row.push_floats([Lights::new(scene).front_distance(from, wi)]);
        let mut auxiliary = job
            .sampler
            .start(job.seed, [index, 3], u64::from(index))
            .auxiliary();
        row.push_floats([auxiliary.next_1d()]);
    },
    near: &[DELAY, SAME, SHARE, CLOSE, CLOSE, CLOSE, SAME],
    max_outliers: 0.0,
    why: "profiles are sampled in single precision, in Rust in double precision; slots are \
          computed in double precision on both sides",
};
