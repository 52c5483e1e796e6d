//! All integrators render the same picture: each against a long run of `bpt`, in blocks of pixels and as a whole.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::{Vec2, Vec3};
use lumbre::film::Film;
use lumbre::math::stats::{normal_two_sided_p, sidak};
use lumbre::scene::CompiledScene;
use lumbre::scene::compile::Material;
use lumbre::transport::integrator::integrator;
use lumbre::value::Value;

use crate::common::{SceneBuilder, WHITE, grey, job, light, render};

/// Side of the film and of a block in pixels.
const SIDE: usize = 12;
const BLOCK: usize = 4;

/// The probability that all comparisons of one scene pass by chance alone is one minus this.
const SIGNIFICANCE: f64 = 0.001;

pub type Params = BTreeMap<String, Value>;

pub fn params(pairs: &[(&str, Value)]) -> Params {
    pairs.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect()
}

/// Every way of rendering a picture that must agree with `bpt`.
pub fn variants() -> Vec<(&'static str, Params)> {
    let mut all = Vec::new();
    for mis in ["power", "balance", "none"] {
        for name in ["nee", "bdpt"] {
            all.push((name, params(&[("mis", mis.into())])));
        }
    }
    all
}

/// Mean and squared standard error of every block and of the whole film, channel by channel.
fn blocks(film: &Film) -> Vec<(f64, f64)> {
    let n = film.samples as f64;
    let cells = SIDE / BLOCK;
    let mut sums = vec![[(0.0, 0.0); 3]; cells * cells + 1];
    for (i, (sum, sum2)) in film.sum.iter().zip(&film.sum2).enumerate() {
        let block = i / SIDE / BLOCK * cells + i % SIDE / BLOCK;
        for c in 0..3 {
            let mean = sum[c] / n;
            let variance = (sum2[c] / n - mean * mean).max(0.0) / (n - 1.0);
            for cell in [block, cells * cells] {
                sums[cell][c].0 += mean;
                sums[cell][c].1 += variance;
            }
        }
    }
    sums.iter()
        .enumerate()
        .flat_map(|(i, cell)| {
            let pixels = if i == cells * cells { (SIDE * SIDE) as f64 } else { (BLOCK * BLOCK) as f64 };
            cell.map(|(mean, variance)| (mean / pixels, variance / (pixels * pixels)))
        })
        .collect()
}

/// Renders `scene` with `bpt` for long and with every variant, and compares.
pub fn agree(scene: &Arc<CompiledScene>, depth: u32, rr_start: Option<u32>, samples: u64) {
    agree_among(scene, depth, rr_start, samples, &variants());
}

/// The same for some variants.
pub fn agree_among(
    scene: &Arc<CompiledScene>,
    depth: u32,
    rr_start: Option<u32>,
    samples: u64,
    variants: &[(&'static str, Params)],
) {
    let with = |name: &str, params: &Params, seed: u64, samples: u64| {
        let mut j = job([SIDE as u32; 2], depth, seed);
        (j.integrator, j.params, j.rr_start) = (integrator(name).unwrap(), params.clone(), rr_start);
        blocks(&render(scene, j, samples))
    };
    let truth = with("bpt", &Params::new(), 1, 8 * samples);
    let whole = truth[truth.len() - 2];
    assert!(whole.0 > 0.0 && whole.1.sqrt() / whole.0 < 0.01, "the reference is too noisy to tell: {whole:?}");
    let level = sidak(SIGNIFICANCE, variants.len() * truth.len());
    let mut failures = Vec::new();
    for (i, (name, params)) in variants.iter().enumerate() {
        let image = with(name, params, 2 + i as u64, samples);
        for (place, (a, b)) in image.iter().zip(&truth).enumerate() {
            // Images without any noise still differ by rounding.
            let sigma = (a.1 + b.1).sqrt().max(1e-5 * b.0.abs());
            let z = (a.0 - b.0) / sigma;
            if a.0 != b.0 && normal_two_sided_p(z) < level {
                failures.push(format!("{name} {params:?}, cell {place}: {} instead of {}, z = {z:.1}", a.0, b.0));
            }
        }
    }
    assert!(failures.is_empty(), "level {level:e}:\n{}", failures.join("\n"));
}

/// A room with a floor, a wall, and lights of very unequal areas: two triangles and a sphere.
pub fn room(eye: Vec3) -> SceneBuilder {
    let big = [Vec3::new(-1.0, 2.0, -1.0), Vec3::new(1.0, 2.0, -1.0), Vec3::new(-1.0, 2.0, 1.0)];
    let small = [Vec3::new(0.5, 1.6, 0.5), Vec3::new(0.9, 1.6, 0.5), Vec3::new(0.5, 1.6, 1.0)];
    let red = Material { base_color: Vec3::new(0.8, 0.3, 0.2), ..WHITE };
    SceneBuilder::new(eye, Vec3::new(0.0, 0.7, 0.0), 50.0)
        .quad(Vec3::new(-2.0, 0.0, 2.0), Vec3::X * 4.0, Vec3::Z * -4.0, grey(0.7))
        .quad(Vec3::new(-2.0, 0.0, -1.5), Vec3::X * 4.0, Vec3::Y * 2.5, red)
        .triangle(big, [Vec2::ZERO; 3], light(2.0))
        .triangle(small, [Vec2::ZERO; 3], light(9.0))
}

pub const EYE: Vec3 = Vec3::new(0.2, 1.2, 3.5);

#[test]
fn diffuse_surfaces_under_unequal_lights() {
    let scene = room(EYE).sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0)).build();
    agree(&scene, 5, None, 1200);
}

#[test]
fn mirror_and_glass_with_caustics() {
    let mirror = Material { metallic: 1.0, base_color: Vec3::new(0.9, 0.8, 0.7), ..WHITE };
    let glass = Material { opacity: 0.0, base_color: Vec3::new(0.9, 1.0, 0.9), ..WHITE };
    let scene = room(EYE)
        .sphere(Vec3::new(-0.6, 0.5, 0.0), 0.45, glass)
        .sphere(Vec3::new(0.6, 0.45, 0.2), 0.4, mirror)
        .sphere(Vec3::new(-0.3, 1.4, -0.4), 0.25, light(6.0))
        .build();
    agree(&scene, 7, None, 2000);
}

#[test]
fn mixed_lobes_with_roulette() {
    let mixed = Material { metallic: 0.3, opacity: 0.4, base_color: Vec3::new(0.9, 0.7, 0.5), ..WHITE };
    let scene = room(EYE)
        .sphere(Vec3::new(-0.5, 0.5, 0.0), 0.5, mixed)
        .sphere(Vec3::new(0.6, 1.0, 0.2), 0.25, light(5.0))
        .build();
    agree(&scene, 8, Some(2), 2000);
}

#[test]
fn thin_lens() {
    let mut scene = Arc::unwrap_or_clone(room(EYE).sphere(Vec3::new(-0.9, 0.9, 0.4), 0.25, light(5.0)).build());
    (scene.camera.aperture, scene.camera.focus_distance) = (0.4, Some(2.5));
    agree(&Arc::new(scene), 4, None, 1200);
}

#[test]
fn emitters_that_reflect() {
    let lamp = Material { emission: Vec3::new(3.0, 2.0, 1.0), ..grey(0.6) };
    let scene = room(EYE)
        .quad(Vec3::new(-1.9, 0.2, -1.0), Vec3::Z * 1.5, Vec3::Y * 1.5, Material { emission: Vec3::ONE, ..grey(0.5) })
        .sphere(Vec3::new(0.5, 0.5, 0.3), 0.4, lamp)
        .build();
    agree(&scene, 6, None, 1200);
}
