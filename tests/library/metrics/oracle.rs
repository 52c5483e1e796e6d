//! FLIP compared with the authors' program on generated pictures.

use std::collections::BTreeMap;

use lumbre_light::film::Image;
use lumbre_light::math::rng::{pcg4d, unit};
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::srgb_light;

const WIDTH: u32 = 150;
const HEIGHT: u32 = 101;

/// Returns 8-bit sRGB values: patches of several sizes, and noise.
fn picture(seed: u32, noise: f32) -> Vec<u8> {
    let pixels = (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y)));
    let values = pixels.flat_map(|(x, y)| {
        (0..3).map(move |c| {
            let patch = |side: u32| unit(pcg4d([x / side, y / side, c, side])[0]);
            let grain = unit(pcg4d([x, y, c, seed])[1]) - 0.5;
            let value = 0.5 * patch(31) + 0.35 * patch(7) + 0.15 * patch(2) + noise * grain;
            (255.0 * value.clamp(0.0, 1.0)).round() as u8
        })
    });
    values.collect()
}

fn linear(bytes: &[u8]) -> Image {
    let data = bytes
        .as_chunks::<3>()
        .0
        .iter()
        .map(|p| p.map(|v| srgb_light(f32::from(v) / 255.0)))
        .collect();
    Image {
        width: WIDTH,
        height: HEIGHT,
        data,
    }
}

#[test]
fn ldr_flip_equals_the_authors_program_at_several_distances() {
    let reference = picture(1, 0.05);
    for (noise, ppd) in [(0.1, 67.0206f32), (0.6, 67.0206), (0.6, 25.0), (2.0, 110.0)] {
        let image = picture(2, noise);
        let of = |bytes: &[u8]| nv_flip::FlipImageRgb8::with_data(WIDTH, HEIGHT, bytes);
        let theirs = nv_flip::flip(of(&reference), of(&image), ppd).to_vec();
        let options = BTreeMap::from([("ppd".to_owned(), Value::number(f64::from(ppd)))]);
        let spec = MetricSpec::new("flip", "flip", options).unwrap();
        let ours = spec
            .error_map(&linear(&image), &linear(&reference))
            .unwrap()
            .values;
        // Rounding in single precision, magnified by a root and a power below one, as in
        // `golden.rs`.
        let worst = ours
            .iter()
            .zip(&theirs)
            .map(|(a, b)| (a - b).abs())
            .fold(0.0, f32::max);
        assert!(worst < 2e-4, "noise {noise}, {ppd} ppd: {worst}");
        let mean = |of: &[f32]| of.iter().map(|v| f64::from(*v)).sum::<f64>() / of.len() as f64;
        assert!(
            (mean(&ours) - mean(&theirs)).abs() < 1e-5,
            "{} {}",
            mean(&ours),
            mean(&theirs)
        );
        assert!(mean(&ours) > 0.01, "the images are nearly equal");
    }
}
