//! Bins of a Cornell box compared with a render by mitransient.

use std::io::Read;
use std::path::Path;
use std::sync::Arc;

use glam::{Mat4, Vec3};
use lumbre_light::math::stats::sidak;
use lumbre_light::math::t_test::two_sided_p;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::compile::Material;
use lumbre_render::{Job, Renderer};
use serde_json::Value as Json;

use crate::common::{SceneBuilder, WHITE, shared};
use crate::common::{render_waves, timed_job, timing};

/// Returns the values of an array of `f16` or `f32` in a NumPy archive (`.npz`).
fn array(archive: &[u8], name: &str) -> Vec<f64> {
    // The central directory lists every file; its entries begin with this
    // signature.
    let word = |at: usize, n: usize| {
        archive[at..at + n]
            .iter()
            .rev()
            .fold(0usize, |sum, b| sum << 8 | usize::from(*b))
    };
    let mut at = (0..archive.len() - 4)
        .find(|i| &archive[*i..i + 4] == b"PK\x01\x02")
        .expect("the archive has no central directory");
    loop {
        assert_eq!(
            &archive[at..at + 4],
            b"PK\x01\x02",
            "{name} is not in the archive"
        );
        let (packed, names) = (word(at + 20, 4), [28, 30, 32].map(|i| word(at + i, 2)));
        let local = word(at + 42, 4);
        if &archive[at + 46..at + 46 + names[0]] == name.as_bytes() {
            let first = local + 30 + word(local + 26, 2) + word(local + 28, 2);
            let mut bytes = Vec::new();
            flate2::read::DeflateDecoder::new(&archive[first..first + packed])
                .read_to_end(&mut bytes)
                .unwrap();
            let header = 10 + usize::from(bytes[8]) + 256 * usize::from(bytes[9]);
            let single = String::from_utf8_lossy(&bytes[10..header]).contains("<f4");
            let values = &bytes[header..];
            return if single {
                values
                    .chunks_exact(4)
                    .map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap())))
                    .collect()
            } else {
                values
                    .chunks_exact(2)
                    .map(|b| half(u16::from_le_bytes([b[0], b[1]])))
                    .collect()
            };
        }
        at += 46 + names.iter().sum::<usize>();
    }
}

/// Returns the value of a half-precision number that is not negative.
fn half(bits: u16) -> f64 {
    let (exponent, fraction) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    if exponent == 0 {
        fraction * 2f64.powi(-24)
    } else {
        (1.0 + fraction / 1024.0) * 2f64.powi(exponent - 15)
    }
}

/// Returns the scene that the JSON beside the arrays describes.
fn scene(json: &Json) -> Arc<CompiledScene> {
    let color = |json: &Json| Vec3::from_array([0, 1, 2].map(|i| json[i].as_f64().unwrap() as f32));
    let fov = json["fov_degrees"].as_f64().unwrap() as f32;
    let mut builder = SceneBuilder::new(Vec3::new(0.0, 0.0, 3.9), Vec3::ZERO, fov);
    for (name, shape) in json["shapes"].as_object().unwrap() {
        let rows = [0, 1, 2, 3]
            .map(|r| [0, 1, 2, 3].map(|c| shape["to_world"][r][c].as_f64().unwrap() as f32));
        let to_world = Mat4::from_cols_array_2d(&rows).transpose();
        let at = |x: f32, y: f32, z: f32| to_world.transform_point3(Vec3::new(x, y, z));
        let mut material = Material {
            base_color: color(&json["diffuse_reflectance"][shape["bsdf"].as_str().unwrap()]),
            ..WHITE
        };
        let quad =
            |builder: SceneBuilder, [a, b, c]: [Vec3; 3], m| builder.quad(a, b - a, c - a, m);
        if shape["type"] == "rectangle" {
            if name == "light" {
                material.emission = color(&json["area_light_radiance"]["light"]);
                // In mitransient the back of an emitter is black.
                let lift = Vec3::Y * 2e-4;
                let back = [
                    at(-1.0, -1.0, 0.0) + lift,
                    at(-1.0, 1.0, 0.0) + lift,
                    at(1.0, -1.0, 0.0) + lift,
                ];
                builder = quad(
                    builder,
                    back,
                    Material {
                        base_color: Vec3::ZERO,
                        ..WHITE
                    },
                );
            }
            builder = quad(
                builder,
                [at(-1.0, -1.0, 0.0), at(1.0, -1.0, 0.0), at(-1.0, 1.0, 0.0)],
                material,
            );
            continue;
        }
        for (n, a) in [(Vec3::X, Vec3::Y), (Vec3::Y, Vec3::Z), (Vec3::Z, Vec3::X)] {
            for n in [n, -n] {
                let b = n.cross(a);
                let corners =
                    [n - a - b, n + a - b, n - a + b].map(|p| to_world.transform_point3(p));
                builder = quad(builder, corners, material);
            }
        }
    }
    builder.build()
}

/// Returns sums over blocks of pixels and groups of bins, by channel.
fn regions(value: impl Fn(u32, u32, u32, usize) -> f64) -> Vec<f64> {
    const BLOCK: u32 = 8;
    const GROUP: u32 = 10;
    let mut sums = vec![0.0; (32 / BLOCK * (32 / BLOCK) * (300 / GROUP) * 3) as usize];
    for y in 0..32 {
        for x in 0..32 {
            for bin in 0..300 {
                for c in 0..3 {
                    let region =
                        (y / BLOCK * (32 / BLOCK) + x / BLOCK) * (300 / GROUP) + bin / GROUP;
                    sums[region as usize * 3 + c] += value(x, y, bin, c);
                }
            }
        }
    }
    sums
}

#[test]
fn every_region_of_the_cornell_box_agrees_with_mitransient() {
    let Some(shared) = shared() else {
        crate::common::skipped("the shared references are not beside this checkout");
        return;
    };
    let stem = shared.join("references/mitransient_cornell_32x32x300");
    let read = |path: &Path| std::fs::read(path).unwrap();
    let json: Json = serde_json::from_slice(&read(&stem.with_extension("json"))).unwrap();
    let archive = read(&stem.with_extension("npz"));
    let (mean, error) = (
        array(&archive, "transient.npy"),
        array(&archive, "stderr.npy"),
    );
    let at =
        |x: u32, y: u32, bin: u32, c: usize| ((y * 32 + x) as usize * 300 + bin as usize) * 3 + c;
    let truth = regions(|x, y, bin, c| mean[at(x, y, bin, c)]);
    let truth_variance = regions(|x, y, bin, c| error[at(x, y, bin, c)].powi(2));
    let axis = timing(
        json["start_opl"].as_f64().unwrap(),
        json["bin_width_opl"].as_f64().unwrap(),
        300,
    );
    let scene = scene(&json);
    // The scatter of a region's sums is measured with independent runs, for any correlation of
    // its bins.
    for (name, samples, runs) in [("nee", 24, 24u64), ("bdpt", 12, 16)] {
        let found: Vec<Vec<f64>> = (0..runs)
            .map(|seed| {
                let job = Job {
                    ..timed_job(name, axis.clone(), [32, 32], 8, 500 + seed)
                };
                let cube = render_waves(&scene, job, &[samples]).times().unwrap();
                regions(|x, y, bin, c| f64::from(cube.mean(x, y, bin as usize + 1)[c]))
            })
            .collect();
        let n = runs as f64;
        let mut tests = Vec::new();
        for region in 0..truth.len() {
            let values = || found.iter().map(|run| run[region]);
            let own = values().sum::<f64>() / n;
            let variance = values().map(|v| (v - own).powi(2)).sum::<f64>() / (n - 1.0) / n;
            // Regions that light reaches too rarely for a normal sum are left out.
            if values().filter(|v| *v > 0.0).count() < runs as usize * 3 / 4 {
                continue;
            }
            let t = (own - truth[region]) / (variance + truth_variance[region]).sqrt();
            tests.push((two_sided_p(t, n - 1.0), region, own, truth[region]));
        }
        assert!(
            tests.len() > 700,
            "{name}: only {} regions have enough light",
            tests.len()
        );
        let alpha = sidak(1e-3, 2 * tests.len());
        let worst: Vec<_> = tests.iter().filter(|test| test.0 < alpha).collect();
        assert!(worst.is_empty(), "{name}: {worst:?}");
        // The total light on the time axis agrees to 1 %.
        let total = |sums: &[f64]| sums.iter().sum::<f64>();
        let own = found.iter().map(|run| total(run)).sum::<f64>() / n;
        assert!(
            (own / total(&truth) - 1.0).abs() < 0.01,
            "{name}: {own} and {}",
            total(&truth)
        );
    }
}
