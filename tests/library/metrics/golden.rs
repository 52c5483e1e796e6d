//! Values that `make_golden.py` computed with numpy, scikit-image and the authors' FLIP.

use std::collections::BTreeMap;

use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;

struct Pair {
    name: String,
    range: f64,
    image: Image,
    reference: Image,
    expected: BTreeMap<String, f64>,
    maps: BTreeMap<String, Vec<f64>>,
}

fn pairs() -> Vec<Pair> {
    let text = include_str!("golden.json");
    let golden: serde_json::Value = serde_json::from_str(text).unwrap();
    let (width, height) = (
        golden["width"].as_u64().unwrap() as u32,
        golden["height"].as_u64().unwrap() as u32,
    );
    let steps = golden["steps"].as_f64().unwrap();
    let image = |json: &serde_json::Value| {
        let values: Vec<f32> = json
            .as_array()
            .unwrap()
            .iter()
            .map(|v| (v.as_f64().unwrap() / steps) as f32)
            .collect();
        let data: Vec<[f32; 3]> = values.as_chunks::<3>().0.to_vec();
        assert_eq!(data.len(), (width * height) as usize);
        Image::from_pixels(width, height, data)
    };
    let pair = |p: &serde_json::Value| Pair {
        name: p["name"].as_str().unwrap().to_owned(),
        range: p["range"].as_f64().unwrap(),
        image: image(&p["image"]),
        reference: image(&p["reference"]),
        expected: numbers(&p["expected"]),
        maps: maps(&p["expected"]),
    };
    golden["pairs"]
        .as_array()
        .unwrap()
        .iter()
        .map(pair)
        .collect()
}

fn numbers(json: &serde_json::Value) -> BTreeMap<String, f64> {
    json.as_object()
        .unwrap()
        .iter()
        .filter_map(|(k, v)| Some((k.clone(), v.as_f64()?)))
        .collect()
}

fn maps(json: &serde_json::Value) -> BTreeMap<String, Vec<f64>> {
    let list = |v: &serde_json::Value| {
        v.as_array()
            .map(|a| a.iter().map(|x| x.as_f64().unwrap()).collect())
    };
    json.as_object()
        .unwrap()
        .iter()
        .filter_map(|(k, v)| Some((k.clone(), list(v)?)))
        .collect()
}

fn spec(metric: &str, options: &[(&str, Value)]) -> MetricSpec {
    let options = options
        .iter()
        .map(|(k, v)| ((*k).to_owned(), v.clone()))
        .collect();
    MetricSpec::new(metric, metric, options).unwrap()
}

fn eval(pair: &Pair, metric: &str, options: &[(&str, Value)]) -> f64 {
    spec(metric, options)
        .eval(&pair.image, &pair.reference)
        .unwrap()
}

fn tonemap(kind: &str, params: &[(&str, f64)]) -> Value {
    let params = params
        .iter()
        .map(|(k, v)| ((*k).to_owned(), Value::number(*v)));
    Value::Map(params.chain([("kind".to_owned(), kind.into())]).collect())
}

fn assert_near(pair: &Pair, what: &str, value: f64, tolerance: f64) {
    let expected = pair.expected[what];
    assert!(
        (value - expected).abs() <= tolerance,
        "{} {what}: {value}, expected {expected}",
        pair.name
    );
}

#[test]
fn pixel_errors_equal_numpy() {
    let pairs = pairs();
    assert_eq!(pairs.len(), 3);
    for pair in &pairs {
        let range = Value::number(pair.range);
        let relative = |what: &str, value: f64| {
            assert_near(pair, what, value, 1e-9 * pair.expected[what].abs())
        };
        relative("mse", eval(pair, "mse", &[]));
        relative("rmse", eval(pair, "rmse", &[]));
        relative("mae", eval(pair, "mae", &[]));
        relative("relmse", eval(pair, "relmse", &[]));
        relative(
            "relmse_eps_1",
            eval(pair, "relmse", &[("eps", Value::Int(1))]),
        );
        relative("mape", eval(pair, "mape", &[]));
        relative("mape_eps_1", eval(pair, "mape", &[("eps", Value::Int(1))]));
        relative("smape", eval(pair, "smape", &[]));
        relative("psnr", eval(pair, "psnr", &[("range", range)]));
    }
}

#[test]
fn trimmed_errors_equal_numpy() {
    for pair in &pairs() {
        let trimmed = |worst: f64| {
            let options = [("worst", Value::number(worst))];
            eval(pair, "relmse_trimmed", &options)
        };
        // Errors of pixels are single numbers of single precision.
        let near = |what: &str, value: f64| {
            assert_near(pair, what, value, 1e-6 * pair.expected[what].abs())
        };
        near("relmse_trimmed", eval(pair, "relmse_trimmed", &[]));
        near("relmse_trimmed_percent", trimmed(0.01));
        near("relmse_trimmed_half", trimmed(0.5));
        near("relmse", trimmed(0.0));
        assert!(trimmed(0.5) < trimmed(0.01) && trimmed(0.01) < trimmed(0.0));
    }
}

#[test]
fn ssim_equals_scikit_image() {
    for pair in &pairs() {
        let range = Value::number(pair.range);
        assert_near(
            pair,
            "ssim_uniform",
            eval(pair, "ssim", &[("range", range.clone())]),
            1e-6,
        );
        let gauss = [("range", range), ("window", "gauss".into())];
        assert_near(pair, "ssim_gauss", eval(pair, "ssim", &gauss), 1e-6);
    }
}

#[test]
fn tone_maps_apply_to_both_images_before_the_metric() {
    for pair in &pairs() {
        let on_srgb = eval(pair, "mse", &[("on", tonemap("srgb", &[]))]);
        assert_near(
            pair,
            "mse_on_srgb",
            on_srgb,
            1e-5 * pair.expected["mse_on_srgb"],
        );
        let on = ("on", tonemap("reinhard", &[("exposure", 0.5)]));
        assert_near(
            pair,
            "ssim_uniform_on_reinhard",
            eval(pair, "ssim", std::slice::from_ref(&on)),
            1e-6,
        );
        let gauss = [on, ("window", "gauss".into())];
        assert_near(
            pair,
            "ssim_gauss_on_reinhard",
            eval(pair, "ssim", &gauss),
            1e-6,
        );
    }
}

#[test]
fn bias_and_fireflies_equal_numpy() {
    let mut counted = 0.0;
    for pair in &pairs() {
        assert_near(pair, "bias", eval(pair, "bias", &[]), 1e-12 * pair.range);
        let relative =
            |what: &str, value: f64| assert_near(pair, what, value, 1e-9 * pair.expected[what]);
        relative("bias_se", eval(pair, "bias_se", &[]));
        relative(
            "bias_se_block_3",
            eval(pair, "bias_se", &[("block", Value::Int(3))]),
        );
        assert_near(pair, "fireflies", eval(pair, "fireflies", &[]), 0.0);
        let dim = [("deviations", Value::Int(1)), ("excess", Value::Num(0.1))];
        assert_near(pair, "fireflies_dim", eval(pair, "fireflies", &dim), 0.0);
        counted += pair.expected["fireflies"] + pair.expected["fireflies_dim"];
    }
    assert!(
        counted > 20.0,
        "too few fireflies in the pictures: {counted}"
    );
}

/// The authors' program computes in single precision throughout, so a mean agrees to a few units of
/// 1e-6. The formula of a single pixel contains `x^0.7` and a root, which are steep at 0: there a
/// rounding error of 1e-7 in a filter becomes 1e-4.
const FLIP_MEAN: f64 = 1e-5;
const FLIP_PIXEL: f64 = 2e-4;

#[test]
fn flip_equals_the_authors_program() {
    for pair in &pairs() {
        assert_near(pair, "flip", eval(pair, "flip", &[]), FLIP_MEAN);
        assert_near(
            pair,
            "flip_ppd_20",
            eval(pair, "flip", &[("ppd", Value::Int(20))]),
            FLIP_MEAN,
        );
        assert_near(
            pair,
            "flip_ppd_150",
            eval(pair, "flip", &[("ppd", Value::Int(150))]),
            FLIP_MEAN,
        );
        let on = ("on", tonemap("srgb", &[("exposure", -1.0)]));
        assert_near(pair, "flip_on_srgb", eval(pair, "flip", &[on]), FLIP_MEAN);
    }
}

#[test]
fn hdr_flip_equals_the_authors_program() {
    for pair in &pairs() {
        assert_near(pair, "hdr_flip", eval(pair, "hdr_flip", &[]), FLIP_MEAN);
        let reinhard = [("tonemapper", "reinhard".into())];
        assert_near(
            pair,
            "hdr_flip_reinhard",
            eval(pair, "hdr_flip", &reinhard),
            FLIP_MEAN,
        );
        let hable = [
            ("tonemapper", "hable".into()),
            ("start", Value::Int(-3)),
            ("stop", Value::Int(2)),
            ("exposures", Value::Int(4)),
            ("ppd", Value::Int(30)),
        ];
        assert_near(
            pair,
            "hdr_flip_hable",
            eval(pair, "hdr_flip", &hable),
            FLIP_MEAN,
        );
        let settled = spec("hdr_flip", &[]).settled(&pair.reference);
        for (key, tolerance) in [("start", 1e-5), ("stop", 1e-5), ("exposures", 0.0)] {
            assert_near(
                pair,
                &format!("hdr_flip_{key}"),
                settled[key].as_f64().unwrap(),
                tolerance,
            );
        }
    }
}

#[test]
fn flip_maps_equal_the_authors_program() {
    for pair in &pairs() {
        for metric in ["flip", "hdr_flip"] {
            let map = spec(metric, &[])
                .error_map(&pair.image, &pair.reference)
                .unwrap();
            let expected = &pair.maps[&format!("{metric}_map")];
            assert_eq!(map.values.len(), expected.len());
            for (i, (value, expected)) in map.values.iter().zip(expected).enumerate() {
                let near = (f64::from(*value) - expected).abs() <= FLIP_PIXEL;
                assert!(
                    near,
                    "{} {metric} pixel {i}: {value}, expected {expected}",
                    pair.name
                );
            }
        }
    }
}
