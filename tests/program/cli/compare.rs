//! Tests of `lumbre metric` and `lumbre diff`.

use std::path::PathBuf;

use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_report::{exr, png};
use serde_json::Value as Json;

use super::workplace::Workplace;

/// Returns a soft gradient with one channel of the pixel at 5,3 raised.
fn picture(raised: f32) -> Image {
    Image::from_fn(24, 16, |x, y| {
        let g = 0.1 + x as f32 / 40.0;
        [g, 0.5 * g, if (x, y) == (5, 3) { g + raised } else { g }]
    })
}

/// Returns a workplace with `a.exr`, `b.exr`, and the latter as `b.png`, as `b.hdr` and cropped to
/// 24x15 pixels.
fn place() -> Workplace {
    let place = Workplace::new();
    let write = |name: &str, bytes: Vec<u8>| std::fs::write(place.path(name), bytes).unwrap();
    let reference = picture(0.0);
    write("a.exr", exr::encode(&picture(0.25), &[]).unwrap());
    write("b.exr", exr::encode(&reference, &[]).unwrap());
    write(
        "b.png",
        png::encode(&reference, Tonemap::Srgb { exposure: 0.0 }, &[]).unwrap(),
    );
    let texels: Vec<image::Rgb<f32>> = reference.data.iter().map(|p| image::Rgb(*p)).collect();
    let file = std::fs::File::create(place.path("b.hdr")).unwrap();
    image::codecs::hdr::HdrEncoder::new(file)
        .encode(&texels, 24, 16)
        .unwrap();
    let cut = Image::from_pixels(24, 15, reference.data[..24 * 15].to_vec());
    write("cut.exr", exr::encode(&cut, &[]).unwrap());
    place
}

fn json(text: &str) -> Json {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("{e}: {text}"))
}

#[test]
fn every_metric_is_printed_unless_some_are_named() {
    let place = place();
    let page = place.succeed(&["metric", "a.exr", "b.exr"]).stdout;
    for row in lumbre_metrics::METRICS {
        assert!(
            page.lines()
                .any(|l| l.split_whitespace().next() == Some(row.name)),
            "{} is missing: {page}",
            row.name
        );
    }
    assert!(
        page.contains("ppd 67.0206") && page.contains("exposures 2"),
        "{page}"
    );
    let report = json(
        &place
            .succeed(&["metric", "a.exr", "b.exr", "--metric", "mse", "--json"])
            .stdout,
    );
    let metrics = report["metrics"].as_array().unwrap();
    // One channel of one pixel of 384 is off by 0.25.
    let expected = 0.25 * 0.25 / (3.0 * 384.0);
    assert!(
        (metrics[0]["value"].as_f64().unwrap() / expected - 1.0).abs() < 1e-5,
        "{report}"
    );
    assert_eq!(
        (metrics.len(), &metrics[0]["better"], &metrics[0]["unit"]),
        (1, &"lower".into(), &"radiance²".into())
    );
    assert_eq!(
        (&report["image"]["width"], &report["reference"]["file"]),
        (&24.into(), &"b.exr".into())
    );
}

#[test]
fn json_output_contains_the_options_of_each_metric() {
    let place = place();
    let args = [
        "metric",
        "a.exr",
        "b.exr",
        "--json",
        "--metric",
        "flip:ppd=30,on=srgb",
        "--metric",
        "hdr_flip",
    ];
    let report = json(&place.succeed(&args).stdout);
    let [flip, hdr] = [&report["metrics"][0], &report["metrics"][1]];
    assert_eq!(
        (&flip["options"]["ppd"], &flip["options"]["on"]["kind"]),
        (&30.into(), &"srgb".into())
    );
    assert_eq!(
        (&hdr["options"]["start"], &hdr["options"]["tonemapper"]),
        (&"auto".into(), &"aces".into())
    );
    assert!(
        hdr["settled"]["start"].as_f64().unwrap() < hdr["settled"]["stop"].as_f64().unwrap(),
        "{hdr}"
    );
}

#[test]
fn other_formats_store_the_same_picture_within_their_precision() {
    let place = place();
    for (file, format, tolerance) in [
        ("b.exr", "exr", 0.0),
        ("b.hdr", "hdr", 3e-3),
        ("b.png", "png", 3e-3),
    ] {
        let report = json(
            &place
                .succeed(&["metric", file, "b.exr", "--metric", "mae", "--json"])
                .stdout,
        );
        assert_eq!(report["image"]["format"], format);
        let error = report["metrics"][0]["value"].as_f64().unwrap();
        assert!(
            error <= tolerance && (error > 0.0) == (tolerance > 0.0),
            "{file}: {error}"
        );
    }
}

#[test]
fn diff_reports_the_position_and_writes_the_map_of_a_difference() {
    let place = place();
    let page = place
        .succeed(&[
            "diff",
            "a.exr",
            "b.exr",
            "--metric",
            "mae",
            "--out",
            "maps/map.png",
        ])
        .stdout;
    assert!(
        page.contains("1 of 384 differ") && page.contains("at 5,3") && page.contains("magma"),
        "{page}"
    );
    let map = image::open(place.path("maps/map.png")).unwrap().to_rgb8();
    assert_eq!(
        (
            map.dimensions(),
            map.get_pixel(0, 0).0,
            map.get_pixel(5, 3).0
        ),
        ((24, 16), [0, 0, 4], [252, 253, 191])
    );

    let args = [
        "diff", "a.exr", "b.exr", "--metric", "bias", "--out", "map.exr", "--json", "--max", "0.5",
    ];
    let report = json(&place.succeed(&args).stdout);
    assert_eq!(
        (&report["identical"], &report["map"]["differing_pixels"]),
        (&false.into(), &1.into())
    );
    assert_eq!(
        (&report["map"]["worst"]["x"], &report["map"]["worst"]["y"]),
        (&5.into(), &3.into())
    );
    assert_eq!(report["map"]["scale"], serde_json::json!([-0.5, 0.5]));
    let (map, meta) = exr::decode(&std::fs::read(place.path("map.exr")).unwrap()).unwrap();
    assert!((map.at(5, 3)[1] - 0.25 / 3.0).abs() < 1e-6 && map.at(4, 3) == [0.0; 3]);
    assert!(
        meta.contains(&("metric".to_owned(), "bias".to_owned())),
        "{meta:?}"
    );
}

#[test]
fn identical_pictures_are_reported_as_identical() {
    let place = place();
    let page = place.succeed(&["diff", "b.exr", "b.exr"]).stdout;
    assert!(
        page.contains("identical") && !page.contains("worst"),
        "{page}"
    );
    let report = json(&place.succeed(&["diff", "b.exr", "b.exr", "--json"]).stdout);
    assert_eq!(
        (&report["identical"], &report["measured"]["metric"]),
        (&true.into(), &"flip".into())
    );
    assert_eq!(report["measured"]["value"].as_f64(), Some(0.0));
}

#[test]
fn invalid_pictures_metrics_and_options_are_refused_with_status_2() {
    let place = place();
    place.write("text.png", "no picture");
    let missing = PathBuf::from("nowhere").join("x.exr").display().to_string();
    for verb in ["metric", "diff"] {
        for (args, expected) in [
            (
                ["a.exr", "cut.exr"],
                &["a.exr has 24x16", "cut.exr has 24x15"][..],
            ),
            (["a.exr", &missing], &[missing.as_str()]),
            (["text.png", "b.exr"], &["text.png", "EXR, HDR, PNG"]),
            ([".", "b.exr"], &["not a regular file"]),
        ] {
            let error = place.fail(2, &[verb, args[0], args[1]]);
            assert!(
                expected.iter().all(|words| error.contains(words)),
                "{verb} {args:?}: {error}"
            );
        }
        let error = place.fail(2, &[verb, "a.exr", "b.exr", "--metric", "filp"]);
        assert!(error.contains("did you mean `flip`?"), "{error}");
        let error = place.fail(2, &[verb, "a.exr", "b.exr", "--metric", "bias_se:block=24"]);
        assert!(error.contains("needs at least 25x25"), "{error}");
    }
    let error = place.fail(2, &["diff", "a.exr", "b.exr", "--metric", "psnr"]);
    assert!(
        error.contains("no value of single pixels") && error.contains("flip"),
        "{error}"
    );
    let error = place.fail(2, &["diff", "a.exr", "b.exr", "--out", "map.jpg"]);
    assert!(error.contains(".png") && error.contains(".exr"), "{error}");
    assert!(
        place
            .fail(2, &["diff", "a.exr", "b.exr", "--max", "0"])
            .contains("above 0")
    );
}

#[test]
fn a_metric_that_needs_a_larger_picture_is_omitted_and_the_others_are_printed() {
    let place = place();
    let tiny = exr::encode(&Image::from_fn(5, 5, |x, _| [x as f32; 3]), &[]).unwrap();
    std::fs::write(place.path("tiny.exr"), tiny).unwrap();
    let output = place.succeed(&["metric", "tiny.exr", "tiny.exr"]);
    assert!(
        output.stderr.contains("omitted: `ssim` needs at least 7x7"),
        "{}",
        output.stderr
    );
    assert!(
        output.stdout.contains("mse") && !output.stdout.contains("ssim"),
        "{}",
        output.stdout
    );
}

#[test]
fn non_finite_pixels_are_reported_and_make_every_metric_nan() {
    let place = place();
    let mut broken = picture(0.0);
    broken.data[26] = [1.0, f32::NAN, 1.0];
    std::fs::write(place.path("nan.exr"), exr::encode(&broken, &[]).unwrap()).unwrap();
    let output = place.succeed(&["metric", "nan.exr", "b.exr", "-q", "--json"]);
    assert!(
        output
            .stderr
            .contains("nan.exr: 1 pixel not finite, the first at 2,1"),
        "{}",
        output.stderr
    );
    let report = json(&output.stdout);
    assert!(
        report["metrics"]
            .as_array()
            .unwrap()
            .iter()
            .all(|m| m["value"] == "NaN"),
        "{report}"
    );
}

/// Returns a grey picture with noise of this standard error, equal for equal seeds, in which the
/// left half is brighter by a factor.
fn noisy(seed: u32, error: f32, factor: f32) -> Image {
    Image::from_fn(64, 64, |x, y| {
        let key = |salt| lumbre_light::math::rng::pcg4d([x, y, seed, salt])[0];
        let uniform = |salt| key(salt) as f32 / u32::MAX as f32 - 0.5;
        // The sum of twelve uniform numbers has variance one.
        let normal: f32 = (0..12).map(uniform).sum();
        let mean = if x < 32 { 0.5 * factor } else { 0.5 };
        [mean + error * normal; 3]
    })
}

#[test]
fn limits_of_a_difference_decide_the_exit_code_and_are_written_for_other_tests() {
    let place = Workplace::new();
    let write = |name: &str, image: &Image| {
        std::fs::write(place.path(name), exr::encode(image, &[]).unwrap()).unwrap();
    };
    write("a.exr", &noisy(1, 0.02, 1.0));
    write("b.exr", &noisy(2, 0.02, 1.0));
    write("biased.exr", &noisy(2, 0.02, 1.05));
    write("error.exr", &Image::from_fn(64, 64, |_, _| [0.02; 3]));
    let noise = ["--stderr", "error.exr", "--stderr", "error.exr"];
    let diff = |image: &str, limits: &[&str]| {
        let mut args = vec!["diff", image, "b.exr", "--junit", "result.xml"];
        args.extend(limits.iter().flat_map(|limit| ["--fail", limit]));
        args.extend(noise);
        place.run(&args)
    };
    // 4096 pixels of mean 0.5 with errors of 0.02 in both: the ratio is known to 0.09 %.
    let same = diff("a.exr", &["ztest=1e-3", "detects=0.006", "rmse=0.1"]);
    assert_eq!(same.status, 0, "{}", same.stdout);
    let xml = place.read("result.xml");
    assert!(
        xml.contains("tests=\"3\" failures=\"0\"") && xml.contains("<system-out>a bias of"),
        "{xml}"
    );
    let coarse = diff("a.exr", &["detects=0.001"]);
    assert_eq!(coarse.status, 5, "{}", coarse.stdout);
    // Equal seeds: the left half differs by the factor alone, and the error is half as great.
    let biased = diff("biased.exr", &["ztest=1e-3", "rmse=0.1", "ssim=0.9999"]);
    assert_eq!(biased.status, 5, "{}", biased.stdout);
    let xml = place.read("result.xml");
    assert!(xml.contains("tests=\"3\" failures=\"2\""), "{xml}");
    assert!(
        xml.contains("name=\"ztest=1e-3\">\n    <failure message=\"") && xml.contains("differ"),
        "{xml}"
    );
    // The standard errors beside a reference are found; as variances they would hide 1 %.
    write("ref.exr", &noisy(1, 0.02, 1.01));
    write("noise.exr", &Image::from_fn(64, 64, |_, _| [0.02; 3]));
    write("exact.exr", &noisy(1, 0.0, 1.0));
    let stored = ["diff", "ref.exr", "exact.exr", "--fail", "ztest=1e-3"];
    let found = place.run(&stored);
    assert_eq!(found.status, 5, "{}", found.stdout);
    assert!(
        found.stderr.contains("exact.exr counts as exact"),
        "{}",
        found.stderr
    );
    // A pixel that is not finite is no pixel that agrees.
    let mut broken = noisy(1, 0.02, 1.0);
    broken.data[64 * 3 + 5][1] = f32::NAN;
    write("broken.exr", &broken);
    let found = diff("broken.exr", &["ztest=1e-3"]);
    assert_eq!(found.status, 5, "{}", found.stdout);
    assert!(
        found
            .stdout
            .contains("1 pixel not finite, the first at 5,3"),
        "{}",
        found.stdout
    );
    for (args, part) in [
        (
            vec!["diff", "a.exr", "b.exr", "--fail", "ztest=1e-3"],
            "--stderr",
        ),
        (
            vec!["diff", "a.exr", "b.exr", "--fail", "ztest=2"],
            "expected ztest=RATE",
        ),
        (vec!["diff", "a.exr", "b.exr", "--fail", "rmsee=2"], "rmse"),
    ] {
        let error = place.fail(2, &args);
        assert!(error.contains(part), "{args:?}: {error}");
    }
}
