//! FLIP compared with values of the authors' program, which `make_golden.py` made, on larger
//! generated pictures at several viewing distances.

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
    Image::from_pixels(WIDTH, HEIGHT, data)
}

#[test]
fn ldr_flip_equals_the_authors_program_at_several_distances() {
    let golden: serde_json::Value = serde_json::from_str(include_str!("golden.json")).unwrap();
    let rows = golden["patches"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    let reference = picture(1, 0.05);
    for row in rows {
        let [noise, ppd, expected] =
            ["noise", "ppd", "mean"].map(|name| row[name].as_f64().unwrap());
        let image = picture(2, noise as f32);
        let sum = |bytes: &[u8]| bytes.iter().map(|v| u64::from(*v)).sum::<u64>();
        assert_eq!(
            row["pixels_sum"],
            sum(&image) + sum(&reference),
            "these are not the pictures that the authors' program was given"
        );
        let options = BTreeMap::from([("ppd".to_owned(), Value::number(ppd))]);
        let spec = MetricSpec::new("flip", "flip", options).unwrap();
        let ours = spec
            .error_map(&linear(&image), &linear(&reference))
            .unwrap()
            .values;
        // Rounding in single precision, magnified by a root and a power below one, as in
        // `golden.rs`.
        let theirs = row["map"].as_array().unwrap();
        assert!(theirs.len() > 100);
        for (a, b) in ours.iter().step_by(97).zip(theirs) {
            let error = (f64::from(*a) - b.as_f64().unwrap()).abs();
            assert!(error < 2e-4, "noise {noise}, {ppd} ppd: {error}");
        }
        let mean = ours.iter().map(|v| f64::from(*v)).sum::<f64>() / ours.len() as f64;
        assert!((mean - expected).abs() < 1e-5, "{mean} {expected}");
        assert!(mean > 0.01, "the images are nearly equal");
    }
}
