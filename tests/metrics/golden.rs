//! Values that `make_golden.py` computed with numpy and scikit-image.

use std::collections::BTreeMap;

use lumbre::film::Image;
use lumbre::metrics::MetricSpec;
use lumbre::value::Value;

struct Pair {
    name: String,
    range: f64,
    image: Image,
    reference: Image,
    expected: BTreeMap<String, f64>,
}

fn pairs() -> Vec<Pair> {
    let text = include_str!("golden.json");
    let golden: serde_json::Value = serde_json::from_str(text).unwrap();
    let (width, height) = (golden["width"].as_u64().unwrap() as u32, golden["height"].as_u64().unwrap() as u32);
    let steps = golden["steps"].as_f64().unwrap();
    let image = |json: &serde_json::Value| {
        let values: Vec<f32> = json.as_array().unwrap().iter().map(|v| (v.as_f64().unwrap() / steps) as f32).collect();
        let data: Vec<[f32; 3]> = values.as_chunks::<3>().0.to_vec();
        assert_eq!(data.len(), (width * height) as usize);
        Image { width, height, data }
    };
    let pair = |p: &serde_json::Value| Pair {
        name: p["name"].as_str().unwrap().to_owned(),
        range: p["range"].as_f64().unwrap(),
        image: image(&p["image"]),
        reference: image(&p["reference"]),
        expected: p["expected"].as_object().unwrap().iter().map(|(k, v)| (k.clone(), v.as_f64().unwrap())).collect(),
    };
    golden["pairs"].as_array().unwrap().iter().map(pair).collect()
}

fn eval(pair: &Pair, metric: &str, options: &[(&str, Value)]) -> f64 {
    let options = options.iter().map(|(k, v)| ((*k).to_owned(), v.clone())).collect();
    MetricSpec::new(metric, metric, options).unwrap().eval(&pair.image, &pair.reference).unwrap()
}

fn tonemap(kind: &str, params: &[(&str, f64)]) -> Value {
    let params = params.iter().map(|(k, v)| ((*k).to_owned(), Value::number(*v)));
    Value::Map(params.chain([("kind".to_owned(), kind.into())]).collect())
}

fn assert_near(pair: &Pair, what: &str, value: f64, tolerance: f64) {
    let expected = pair.expected[what];
    assert!((value - expected).abs() <= tolerance, "{} {what}: {value}, expected {expected}", pair.name);
}

#[test]
fn pixel_errors_equal_numpy() {
    let pairs = pairs();
    assert_eq!(pairs.len(), 3);
    for pair in &pairs {
        let range = Value::number(pair.range);
        let relative = |what: &str, value: f64| assert_near(pair, what, value, 1e-9 * pair.expected[what].abs());
        relative("mse", eval(pair, "mse", &[]));
        relative("rmse", eval(pair, "rmse", &[]));
        relative("mae", eval(pair, "mae", &[]));
        relative("relmse", eval(pair, "relmse", &[]));
        relative("relmse_eps_1", eval(pair, "relmse", &[("eps", Value::Int(1))]));
        relative("psnr", eval(pair, "psnr", &[("range", range)]));
    }
}

#[test]
fn ssim_equals_scikit_image() {
    for pair in &pairs() {
        let range = Value::number(pair.range);
        assert_near(pair, "ssim_uniform", eval(pair, "ssim", &[("range", range.clone())]), 1e-6);
        let gauss = [("range", range), ("window", "gauss".into())];
        assert_near(pair, "ssim_gauss", eval(pair, "ssim", &gauss), 1e-6);
    }
}

#[test]
fn tone_maps_apply_to_both_images_first() {
    for pair in &pairs() {
        let on_srgb = eval(pair, "mse", &[("on", tonemap("srgb", &[]))]);
        assert_near(pair, "mse_on_srgb", on_srgb, 1e-5 * pair.expected["mse_on_srgb"]);
        let on = ("on", tonemap("reinhard", &[("exposure", 0.5)]));
        assert_near(pair, "ssim_uniform_on_reinhard", eval(pair, "ssim", std::slice::from_ref(&on)), 1e-6);
        let gauss = [on, ("window", "gauss".into())];
        assert_near(pair, "ssim_gauss_on_reinhard", eval(pair, "ssim", &gauss), 1e-6);
    }
}
