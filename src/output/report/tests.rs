//! Reports of hand-made nights.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use super::*;
use crate::experiment::WaveRow;
use crate::experiment::evidence::{Machine, Night, Run, State, Truth};
use crate::metrics::MetricSpec;
use crate::value::Value;

/// A night of two scenes and two techniques, three repeats each, on a device of its own. Errors fall as the square root
/// of samples; `nee` has half the error of `bpt` at the same samples and takes 1.6 times as long.
fn night(device: &str, speed: f64) -> Night {
    let mut runs = Vec::new();
    for (s, scene) in ["box", "lamps"].iter().enumerate() {
        for (t, technique) in ["bpt", "nee"].iter().enumerate() {
            for repeat in 0..3u64 {
                let id = format!("{:032x}", runs.len() + 1 + device.len() * 256);
                runs.push(run(id, (scene, s), (technique, t), repeat, (device, speed)));
            }
        }
    }
    let metric = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).unwrap();
    Night {
        folder: PathBuf::from(format!("/out/{}", device.replace(' ', "_"))),
        name: "overnight".to_owned(),
        plan: "3f9a5b00".to_owned(),
        seed: 11,
        axes: vec!["scene".to_owned(), "technique".to_owned()],
        metrics: vec![metric("rmse"), metric("ssim")],
        machine: Some(Machine {
            host: "host".to_owned(),
            os: "linux x86_64".to_owned(),
            cpu: "A Processor".to_owned(),
            cores: 8,
            program: "lumbre 0.1.0".to_owned(),
            date: "2026-11-21T12:00:00Z".to_owned(),
            arguments: vec!["run".to_owned(), "overnight.lua".to_owned()],
        }),
        runs,
        references: vec![Truth {
            id: "f".repeat(32),
            picture: Some(PathBuf::from("ref.exr")),
            words: "bdpt, 4096 samples per pixel".to_owned(),
        }],
        notes: Vec::new(),
    }
}

fn run(
    id: String,
    (scene, s): (&str, usize),
    (technique, t): (&str, usize),
    repeat: u64,
    (device, speed): (&str, f64),
) -> Run {
    let wobble = 1.0 + 0.02 * repeat as f64;
    let rows = (0..8u32).map(|k| {
        let samples = 1u64 << k;
        let error = 0.2 * (1.0 + s as f64) * 0.5f64.powi(t as i32) * wobble / (samples as f64).sqrt();
        WaveRow {
            wave: u64::from(k) + 1,
            samples,
            render_s: 0.01 * samples as f64 * 1.6f64.powi(t as i32) * wobble / speed,
            wall_s: 0.02 * samples as f64,
            paths: samples * 1000,
            rays: samples * 5000,
            metrics: vec![error, 1.0 - error],
            ..WaveRow::default()
        }
    });
    Run {
        path: format!("scene={scene}/technique={technique}/rep={repeat}"),
        folder: PathBuf::from(format!("/out/night/runs/{id}")),
        point: vec![("scene".to_owned(), Value::from(scene)), ("technique".to_owned(), Value::from(technique))],
        repeat,
        seed: 100 + repeat,
        integrator: technique.to_owned(),
        scene: format!("{scene}.scn"),
        resolution: Some([40, 30]),
        device: Some(device.to_owned()),
        peer: None,
        state: State::Done("128 samples per pixel".to_owned()),
        rows: rows.collect(),
        reference: Some(0),
        pictures: [16, 64, 128].map(|n| (n, PathBuf::from(format!("{technique}-{n}.exr")))).to_vec(),
        films: Vec::new(),
        accel: Some((0.0021, 77)),
        accel_size: Some((4096, 9.5)),
        floors: vec![("rmse".to_owned(), 0.004)],
        id,
    }
}

/// Pictures without a disk: the reference is a gradient, others are it with an error that falls with samples.
fn picture(path: &Path) -> Result<Image, String> {
    let name = path.file_stem().and_then(|s| s.to_str()).unwrap_or_default();
    let samples: f32 = name.rsplit('-').next().and_then(|n| n.parse().ok()).unwrap_or(f32::INFINITY);
    let error = if name.starts_with("bpt") { 2.0 } else { 1.0 } / samples.sqrt();
    Ok(Image::from_fn(40, 30, |x, y| {
        let sign = if (x * 7 + y * 13) % 3 == 0 { 1.0 } else { -0.5 };
        // The left half is hard for both.
        let local = if x < 20 { error } else { 0.1 * error };
        [0.02 * x as f32 + 0.1 + sign * local, 0.02 * y as f32 + 0.1, 0.3]
    }))
}

fn report(nights: &[Night], options: &Options) -> Report {
    let study = Study::new(nights, options).unwrap();
    let link = |path: &Path| path.display().to_string();
    let command = |path: &Path| format!("lumbre reproduce {}/final.exr", path.display());
    build(&study, options, &Surroundings { pictures: &picture, link: &link, command: &command }).unwrap()
}

fn item<'a>(report: &'a Report, stem: &str) -> &'a Item {
    let all = || report.items.iter().map(|i| i.stem.as_str()).collect::<Vec<_>>();
    report.items.iter().find(|i| i.stem == stem).unwrap_or_else(|| panic!("no {stem} among {:?}", all()))
}

fn text(report: &Report, stem: &str, extension: &str) -> String {
    let files = item(report, stem).files().unwrap();
    let (_, bytes) = files.into_iter().find(|(name, _)| *name == format!("{stem}.{extension}")).unwrap();
    String::from_utf8(bytes).unwrap()
}

fn one() -> Report {
    report(&[night("Sample GPU", 1.0)], &Options::default())
}

#[test]
fn tables_say_what_their_runs_measured() {
    let made = one();
    insta::assert_snapshot!("fps", text(&made, "tables/fps-absolute", "md"));
    insta::assert_snapshot!("equal-time", text(&made, "tables/equal-time-rmse", "md"));
    insta::assert_snapshot!("equal-error-tex", text(&made, "tables/equal-error-rmse", "tex"));
    insta::assert_snapshot!("efficiency", text(&made, "tables/efficiency", "md"));
    insta::assert_snapshot!("time-to-csv", text(&made, "tables/time-to-ssim-0.95", "csv"));
}

#[test]
fn curves_are_drawn_with_bands_floor_stops_and_names() {
    let made = one();
    let svg = text(&made, "figures/error-time-rmse", "svg");
    insta::assert_snapshot!("error-time-rmse", svg);
    assert!(svg.contains("noise of the reference"), "the floor is named");
    assert!(svg.contains("render time (s) on Sample GPU"), "the clock's device is named");
    assert_eq!(svg.matches("fill-opacity=\"0.16\"").count(), 4, "a band for each series of each panel");
    let samples = text(&made, "figures/error-samples-ssim", "svg");
    assert!(samples.contains(">1 − SSIM</text>") && !samples.contains("noise of the reference"));
    let tex = text(&made, "figures/error-time-rmse", "tex");
    assert!(tex.contains("{error-time-rmse.dat}") && tex.matches("\\addlegendentry{nee}").count() == 1, "{tex}");
    let dat = text(&made, "figures/error-time-rmse", "dat");
    let header = dat.lines().find(|l| !l.starts_with('#')).unwrap();
    assert!(header.starts_with("f0s0x f0s0y f0s0l f0s0u f0s1x"), "{header}");
    for extension in ["png", "pdf"] {
        let files = item(&made, "figures/error-time-rmse").files().unwrap();
        assert!(files.iter().any(|(name, bytes)| name.ends_with(extension) && bytes.len() > 1000));
    }
}

#[test]
fn crops_show_the_nearest_kept_pictures_where_series_differ() {
    let made = one();
    let crops = item(&made, "figures/crops-equal-time-box");
    let svg = crops.svg.as_deref().unwrap();
    // bpt is at 128 samples and 1.28 s; nee at 64 and 1.02 s is nearer to that than at 128 and 2.05 s.
    assert!(svg.contains(">128 spp, 1.3 s</text>") && svg.contains(">64 spp, 1.0 s</text>"), "{}", crops.caption);
    assert_eq!(svg.matches("<image").count(), 1 + 2 * 3 + 2, "reference, two windows of three, two FLIP maps");
    assert!(svg.contains(">FLIP 0."), "the mean of each map is below it");
    assert_eq!(crops.provenance.runs.len(), 2);
    let options = Options { crops: vec![[4, 4, 12, 9], [35, 4, 12, 9]], ..Options::default() };
    let asked = report(&[night("Sample GPU", 1.0)], &options);
    assert!(asked.notes.iter().any(|n| n.contains("[35, 4, 12, 9] is not inside")), "{:?}", asked.notes);
    assert_eq!(item(&asked, "figures/crops-equal-time-box").svg.as_deref().unwrap().matches("<image").count(), 6);
}

#[test]
fn equal_error_shows_fewer_samples_of_the_better_technique() {
    let svg = item(&one(), "figures/crops-equal-error-box").svg.clone().unwrap();
    // The worst final RMSE, 0.01838, is that of bpt at 128 samples; nee has 0.025 at 16 samples and 0.0125 at 64, and by
    // their ratios the former is nearer.
    assert!(svg.contains(">128 spp, 1.3 s</text>") && svg.contains(">16 spp, 0.26 s</text>"), "{svg}");
}

#[test]
fn nights_of_two_devices_stand_side_by_side_and_are_named() {
    let nights = [night("RTX 4070", 1.0), night("RX 7600", 0.44)];
    let made = report(&nights, &Options::default());
    insta::assert_snapshot!("fps-two-devices", text(&made, "tables/fps-absolute", "tex"));
    insta::assert_snapshot!("fps-relative", text(&made, "tables/fps-relative", "md"));
    let svg = text(&made, "figures/error-time-rmse", "svg");
    for name in ["bpt, RTX 4070", "nee, RTX 4070", "bpt, RX 7600", "nee, RX 7600"] {
        assert!(svg.contains(&format!(">{name}</text>")), "{name}");
    }
    let caption = &item(&made, "figures/error-time-rmse").caption;
    assert!(caption.contains("Times are of 2 devices: RTX 4070; RX 7600"), "{caption}");
}

#[test]
fn devices_of_one_night_never_share_a_clock() {
    let mut both = night("RTX 4070", 1.0);
    let other = night("RX 7600", 0.44);
    let half = both.runs.len() / 2;
    both.runs.splice(half.., other.runs.into_iter().skip(half));
    let made = report(&[both], &Options::default());
    let titles: Vec<&str> = made.items.iter().map(|item| item.stem.as_str()).collect();
    assert!(!titles.contains(&"figures/error-time-rmse"), "{titles:?}");
    for (i, (own, others)) in [("RTX 4070", "RX 7600"), ("RX 7600", "RTX 4070")].into_iter().enumerate() {
        let figure = item(&made, &format!("figures/error-time-rmse-device-{}", i + 1));
        let svg = figure.svg.as_deref().unwrap();
        assert!(
            svg.contains(&format!("render time (s) on {own}")) && !svg.contains(&format!("{others}</text>")),
            "{svg}"
        );
        assert!(figure.caption.contains(&format!("Shown are the runs on {own}")), "{}", figure.caption);
    }
    assert!(titles.contains(&"figures/error-samples-rmse"), "samples are the same everywhere");
}

#[test]
fn times_of_a_device_without_a_name_are_refused_beside_others() {
    let mut nameless = night("RX 7600", 0.44);
    nameless.runs.iter_mut().for_each(|run| run.device = None);
    let nights = [night("RTX 4070", 1.0), nameless.clone()];
    let error = Study::new(&nights, &Options::default()).unwrap_err();
    assert!(matches!(&error, ReportError::NoDevice { folder } if folder.ends_with("RX_7600")), "{error}");
    assert!(Study::new(&[nameless], &Options::default()).is_ok(), "alone it misleads nobody");
}

#[test]
fn nights_that_define_a_metric_differently_are_not_compared_by_it() {
    let mut other = night("RX 7600", 1.0);
    other.metrics[1] = MetricSpec::new("ssim", "ssim", BTreeMap::from([("range".to_owned(), Value::Int(2))])).unwrap();
    let nights = [night("RTX 4070", 1.0), other];
    let study = Study::new(&nights, &Options::default()).unwrap();
    assert_eq!(study.metrics.iter().map(|m| m.column.as_str()).collect::<Vec<_>>(), ["rmse"]);
    assert!(study.notes[0].contains("`ssim` is left out"), "{:?}", study.notes);
}

#[test]
fn options_that_name_nothing_are_refused() {
    let nights = [night("GPU", 1.0)];
    let by = Options { by: vec!["tecnique".to_owned()], ..Options::default() };
    assert!(Study::new(&nights, &by).unwrap_err().to_string().contains("axes: scene, technique"));
    let threshold = Options { thresholds: vec![("mse".to_owned(), 0.1)], ..Options::default() };
    let study = Study::new(&nights, &threshold).unwrap();
    assert!(tables::all(&study, &threshold, &mut Vec::new()).unwrap_err().to_string().contains("columns: rmse, ssim"));
}

#[test]
fn a_night_that_is_still_running_has_a_report_of_what_is_there() {
    let mut running = night("Sample GPU", 1.0);
    for run in running.runs.iter_mut().skip(7) {
        run.state = State::Pending;
        (run.rows, run.device) = (Vec::new(), None);
    }
    running.runs[6].state = State::Unfinished;
    (running.runs[6].device, running.runs[6].pictures) = (None, Vec::new());
    let made = report(&[running], &Options::default());
    let fps = text(&made, "tables/fps-absolute", "md");
    assert!(fps.contains("| lamps |") && fps.contains("–"), "{fps}");
    assert!(made.notes.iter().any(|n| n.contains("6 of 12 runs have not finished")), "{:?}", made.notes);
    let svg = text(&made, "figures/error-time-rmse", "svg");
    assert!(svg.contains(">lamps</text>"), "the unfinished run's curve is drawn");
}

#[test]
fn a_night_without_references_has_rates_and_a_page() {
    let mut bare = night("Sample GPU", 1.0);
    (bare.metrics, bare.references) = (Vec::new(), Vec::new());
    for run in &mut bare.runs {
        run.reference = None;
        run.rows.iter_mut().for_each(|row| row.metrics.clear());
    }
    let made = report(&[bare], &Options::default());
    assert!(text(&made, "tables/fps-absolute", "md").contains("98.1"));
    assert!(made.items.iter().all(|i| i.kind != Kind::Figure), "there is nothing to draw");
    let page = text(&made, "index", "html");
    assert!(page.contains("\"metrics\":[]") && page.contains("\"views\":[]"));
}

#[test]
fn data_is_tidy_and_the_page_needs_nothing_else() {
    let made = one();
    let waves = text(&made, "data/waves", "csv");
    assert_eq!(waves.lines().count(), 1 + 12 * 8);
    assert!(waves.starts_with(
        "program,night,plan,run,axis.scene,axis.technique,repeat,seed,integrator,scene,device,wave,samples_per_pixel,\
         render_s,wall_s,paths,rays,metric.rmse,metric.ssim\n"
    ));
    assert!(text(&made, "data/columns", "csv").contains("\nrender_s,s,"));
    let page = text(&made, "index", "html");
    for address in ["http://", "https://", "src=\"/", "@import", "url(h"] {
        let found = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!found.contains(address), "the page asks for {address}");
    }
    assert!(page.contains("data-runs=\"0 1 2\"") && page.contains("id=\"figures/error-time-rmse\""));
    let data = page.split_once("id=\"data\">").and_then(|(_, rest)| rest.split_once("</script>")).unwrap().0;
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    assert_eq!(data["runs"].as_array().unwrap().len(), 12);
    assert_eq!(data["views"][0]["images"][1]["name"], "bpt");
    let tex = text(&made, "methods", "tex");
    assert!(tex.contains("Sample GPU") && tex.contains("Seed 11") && tex.contains("RMSE"), "{tex}");
}

#[test]
fn names_cannot_break_out_of_page_tables_or_figures() {
    let mut hostile = night("</script><b>GPU & co", 1.0);
    for run in &mut hostile.runs {
        run.point[0].1 = Value::Str(format!("<img src=x> {{}} \\input_{}", run.scene));
    }
    let made = report(&[hostile], &Options::default());
    let page = text(&made, "index", "html");
    assert!(!page.contains("<img src=x>") && !page.contains("</script><b>"));
    let tex = text(&made, "tables/fps-absolute", "tex");
    assert!(!tex.contains("\\input") && tex.contains("\\textbackslash{}input\\_"), "{tex}");
    assert!(made.items.iter().all(|i| i.files().is_ok()));
}

#[test]
fn each_series_is_measured_against_the_reference_of_its_own() {
    let mut own = night("Sample GPU", 1.0);
    own.references.push(Truth { picture: Some(PathBuf::from("second.exr")), ..own.references[0].clone() });
    for run in own.runs.iter_mut().filter(|run| run.integrator == "nee") {
        run.reference = Some(1);
        run.floors = vec![("rmse".to_owned(), 0.01)];
    }
    // What nee is measured against is brighter by as much as nee is, so that nothing is wrong with its picture.
    let brighter = |path: &Path| {
        let image = picture(path)?;
        let name = path.display().to_string();
        let factor = if name.starts_with("second") || name.starts_with("nee") { 2.0 } else { 1.0 };
        Ok(Image { data: image.data.iter().map(|p| p.map(|x| x * factor)).collect(), ..image })
    };
    let nights = [own];
    let study = Study::new(&nights, &Options::default()).unwrap();
    let (link, command) = (|_: &Path| String::new(), |_: &Path| String::new());
    let around = Surroundings { pictures: &brighter, link: &link, command: &command };
    let made = build(&study, &Options::default(), &around).unwrap();
    let caption = &item(&made, "figures/crops-equal-time-box").caption;
    assert!(caption.contains("the one shown is that of bpt"), "{caption}");
    let svg = text(&made, "figures/error-time-rmse", "svg");
    assert!(!svg.contains("noise of the reference"), "there is no common floor");
    assert!(item(&made, "figures/error-time-rmse").caption.contains("Dotted: the noise of each series' own reference"));
    let page = text(&made, "index", "html");
    let data = page.split_once("id=\"data\">").and_then(|(_, rest)| rest.split_once("</script>")).unwrap().0;
    let data: serde_json::Value = serde_json::from_str(data).unwrap();
    let images = data["views"][0]["images"].as_array().unwrap();
    let names: Vec<&str> = images.iter().map(|i| i["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["reference", "bpt", "nee", "reference of nee"]);
    let truths: Vec<u64> = images.iter().map(|i| i["truth"].as_u64().unwrap()).collect();
    assert_eq!(truths, [0, 0, 3, 3]);
    assert_eq!(data["runs"][0]["floors"][0], 0.004);
}

/// The night with a third axis: three numbers of bins, whose hierarchies cost less with each. Its repeats become those
/// numbers, and every run stands there twice, the second time a tenth slower to build.
fn swept() -> Night {
    let mut night = night("Sample GPU", 1.0);
    night.axes.push("bins".to_owned());
    let mut runs = Vec::new();
    for run in &night.runs {
        for repeat in 0..2u64 {
            let bins = [2i64, 8, 32][run.repeat as usize];
            let mut one = run.clone();
            one.point.push(("bins".to_owned(), Value::Int(bins)));
            one.id = format!("{:032x}", 0xabc000 + runs.len());
            one.repeat = repeat;
            one.accel = Some((0.001 * bins as f64 * (1.0 + 0.1 * repeat as f64), 70 + bins as u64));
            runs.push(one);
        }
    }
    night.runs = runs;
    night
}

#[test]
fn what_runs_have_in_the_end_is_drawn_over_axes_of_numbers() {
    let made = report(&[swept()], &Options::default());
    let stems: Vec<&str> = made.items.iter().map(|i| i.stem.as_str()).filter(|s| s.contains("/sweep-")).collect();
    let columns = ["rmse", "ssim", "mpaths_s", "accel_build_s", "accel_nodes", "accel_mib", "accel_cost"];
    assert_eq!(stems, columns.map(|column| format!("figures/sweep-bins-{column}")));
    let build = item(&made, "figures/sweep-bins-accel_build_s");
    let svg = build.svg.as_deref().unwrap();
    assert!(
        svg.contains(">build (s)</text>") && svg.contains(">bins</text>") && svg.contains(">lamps</text>"),
        "{svg}"
    );
    // A band and a line for each of two series in each of two panels, and a marker at each of three places.
    assert_eq!(svg.matches("fill-opacity=\"0.16\"").count(), 4);
    assert_eq!(svg.matches("<circle").count(), 2 * 3, "markers of the first series");
    assert_eq!(
        build.caption,
        "Seconds spent building the hierarchy, over bins. Geometric mean of repeats; band: the range of the two. \
         Measured on Sample GPU."
    );
    assert_eq!(build.provenance.runs.len(), 24);
    let dat = text(&made, "figures/sweep-bins-accel_build_s", "dat");
    let first = dat.lines().filter(|l| !l.starts_with('#')).nth(1).unwrap();
    let numbers: Vec<f64> = first.split(' ').take(4).map(|n| n.parse().unwrap()).collect();
    let expected = [2.0, 0.002 * 1.1f64.sqrt(), 0.002, 0.0022];
    assert!(numbers.iter().zip(expected).all(|(a, b)| (a / b - 1.0).abs() < 1e-9), "{numbers:?}");
    let tex = text(&made, "figures/sweep-bins-accel_build_s", "tex");
    assert!(tex.contains("xmode=log, ymode=log, xlabel={bins}, ylabel={build (s)}"), "{tex}");
    assert!(build.files().unwrap().iter().any(|(name, bytes)| name.ends_with("pdf") && bytes.len() > 1000));
    // The errors are the same everywhere: the axis is linear where nothing spans a factor of ten.
    let tex = text(&made, "figures/sweep-bins-accel_nodes", "tex");
    assert!(tex.contains("xmode=log, xlabel={bins}, ylabel={nodes}"), "{tex}");
}

#[test]
fn names_are_drawn_over_when_asked_for_and_stand_upright_where_they_are_long() {
    let options = Options { sweep: vec!["scene".to_owned()], ..Options::default() };
    let mut long = night("Sample GPU", 1.0);
    for run in long.runs.iter_mut().filter(|run| run.scene == "lamps.scn") {
        run.point[0].1 = Value::from("two lamps in a room that is so long that its name cannot stand beside another");
    }
    let made = report(&[long], &options);
    let figure = item(&made, "figures/sweep-scene-rmse");
    let svg = figure.svg.as_deref().unwrap();
    assert!(svg.contains("rotate(-90") && svg.contains(">two lamps in a room"), "{svg}");
    assert!(text(&made, "figures/sweep-scene-rmse", "tex").contains("rotate=90, anchor=east"));
    assert!(figure.files().is_ok(), "a PDF can hold what stands upright");
    let stems: Vec<&str> = made.items.iter().map(|i| i.stem.as_str()).collect();
    assert!(!stems.contains(&"figures/sweep-scene-accel_nodes"), "all scenes have the same hierarchy");
    let unknown = Options { sweep: vec!["scenes".to_owned()], ..Options::default() };
    let nights = [night("Sample GPU", 1.0)];
    let study = Study::new(&nights, &unknown).unwrap();
    assert!(sweep::all(&study, &unknown, &mut Vec::new()).unwrap_err().to_string().contains("axes: scene, technique"));
}

/// The night over bins with two axes more: a number of leaves for each of the bins, and a kind that two of them share.
fn zipped() -> Night {
    let mut night = swept();
    night.axes.extend(["leaves", "kind"].map(str::to_owned));
    for run in &mut night.runs {
        let bins = run.value("bins").unwrap();
        run.point.push(("leaves".to_owned(), Value::from(format!("{bins} leaves").as_str())));
        run.point.push(("kind".to_owned(), Value::from(if bins == "2" { "few" } else { "many" })));
    }
    night
}

#[test]
fn axes_that_move_with_the_one_drawn_over_tell_nothing_apart() {
    let stem = "figures/sweep-bins-accel_build_s";
    let lines = |report: &Report| item(report, stem).svg.as_deref().unwrap().matches("fill-opacity=\"0.16\"").count();
    let made = report(&[zipped()], &Options::default());
    assert_eq!(lines(&made), 4, "as without them");
    let caption = &item(&made, stem).caption;
    assert!(caption.contains(", over bins, with which leaves and kind change. "), "{caption}");
    assert!(!made.notes.iter().any(|note| note.contains("over `")), "{:?}", made.notes);
    let by = |axis: &str| Options { by: vec![axis.to_owned()], ..Options::default() };
    // Two places are a line, and one is none: of the kinds, only one has two.
    let made = report(&[zipped()], &by("kind"));
    assert_eq!(lines(&made), 4 + 4);
    assert_eq!(made.notes, Vec::<String>::new());
    let made = report(&[zipped()], &by("leaves"));
    assert_eq!(lines(&made), 4);
    assert!(made.notes.contains(&"over `bins` nothing is told apart by `leaves`, which changes with it".to_owned()));
    let sweep = |axis: &str| Options { sweep: vec![axis.to_owned()], ..Options::default() };
    let made = report(&[zipped()], &sweep("leaves"));
    assert!(item(&made, "figures/sweep-leaves-rmse").caption.contains(", with which bins and kind change."));
}

#[test]
fn an_axis_that_was_asked_for_in_vain_is_a_note() {
    let options = Options { by: vec!["scene".to_owned()], sweep: vec!["scene".to_owned()], ..Options::default() };
    let mut one = night("Sample GPU", 1.0);
    one.runs.retain(|run| run.scene == "box.scn");
    let made = report(&[one], &options);
    for note in [
        "`scene` has a single value, so there is nothing to compare by it",
        "nothing is drawn over `scene`: it has a single value",
    ] {
        assert!(made.notes.iter().any(|n| n == note), "{note}: {:?}", made.notes);
    }
    let mut unfinished = night("Sample GPU", 1.0);
    unfinished.runs.iter_mut().filter(|run| run.scene == "box.scn").for_each(|run| run.state = State::Unfinished);
    let made = report(&[unfinished], &Options { sweep: vec!["scene".to_owned()], ..Options::default() });
    assert!(made.notes.iter().any(|n| n.starts_with("nothing is drawn over `scene`: no two")), "{:?}", made.notes);
}

#[test]
fn techniques_are_drawn_over_as_one_line() {
    let mut one = night("Sample GPU", 1.0);
    one.runs.retain(|run| run.scene == "box.scn");
    one.runs.iter_mut().for_each(|run| drop(run.point.remove(0)));
    one.axes.remove(0);
    let made = report(&[one], &Options { sweep: vec!["technique".to_owned()], ..Options::default() });
    let svg = item(&made, "figures/sweep-technique-rmse").svg.as_deref().unwrap();
    assert_eq!(svg.matches("fill-opacity=\"0.16\"").count(), 1, "{svg}");
    assert!(!svg.contains(">bpt ("), "{svg}");
}
