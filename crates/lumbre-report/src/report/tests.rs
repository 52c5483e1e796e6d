//! Reports of hand-made nights.

mod means;
mod presentation;
mod sheets;
mod sweep;
mod verdict;

use lumbre_metrics::floor::Floor;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::*;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::night::reference::{
    BiasCheckSummary, Reference, ReferenceOrigin, ReferencePlan,
};
use lumbre_night::experiment::night::run::{Run, RunPlan, RunState};
use lumbre_night::experiment::night::{Machine, Night, NightPlan};
use lumbre_night::experiment::{EndCause, Outcome, WaveRow};
use lumbre_render::OpenStats;

/// Builds a night of two scenes and two techniques with three repeats on one device. Errors fall
/// with the square root of the samples. `nee` has half the error of `bpt` at equal samples and
/// takes twice
/// as long.
fn night(device: &str, speed: f64) -> Night {
    let mut runs = Vec::new();
    for (s, scene) in ["box", "lamps"].iter().enumerate() {
        for (t, technique) in ["bpt", "nee"].iter().enumerate() {
            for repeat in 0..3 {
                let id = format!("{:032x}", runs.len() + 1 + device.len() * 256);
                let run = run(id, (scene, s), (technique, t), repeat, (device, speed));
                runs.push(Arc::new(run));
            }
        }
    }
    let metric = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).unwrap();
    let plan = NightPlan {
        name: "overnight".to_owned(),
        hash: "3f9a5b00".to_owned(),
        seed: 11,
        axes: vec!["scene".to_owned(), "technique".to_owned()],
        metrics: vec![metric("rmse"), metric("ssim")],
        order: "interleave".to_owned(),
        ..NightPlan::default()
    };
    let reference = Reference {
        planned: Arc::new(ReferencePlan {
            id: "f".repeat(32),
            ..ReferencePlan::default()
        }),
        picture: Some(PathBuf::from("ref.exr")),
        origin: ReferenceOrigin::Rendered {
            integrator: "bdpt".to_owned(),
            samples: 4096,
        },
        ..Reference::default()
    };
    Night {
        plan: Arc::new(plan),
        folder: PathBuf::from(format!("/out/{}", device.replace(' ', "_"))),
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
        references: vec![Arc::new(reference)],
        ..Night::default()
    }
}

fn run(
    id: String,
    (scene, s): (&str, usize),
    (technique, t): (&str, usize),
    repeat: u32,
    (device, speed): (&str, f64),
) -> Run {
    let wobble = 1.0 + 0.02 * f64::from(repeat);
    let rows = (0..8u32).map(|k| {
        let samples = 1u64 << k;
        let error =
            0.2 * (1.0 + s as f64) * 0.5f64.powi(t as i32) * wobble / (samples as f64).sqrt();
        WaveRow {
            wave: u64::from(k) + 1,
            samples,
            render_s: 0.01 * samples as f64 * 2f64.powi(t as i32) * wobble / speed,
            wall_s: 0.02 * samples as f64,
            paths: samples * 1000,
            rays: samples * 5000,
            metrics: vec![error, 1.0 - error],
            ..WaveRow::default()
        }
    });
    let folder = PathBuf::from(format!("/out/night/runs/{id}"));
    let plan = RunPlan {
        id,
        path: format!("scene={scene}/technique={technique}/rep={repeat}"),
        point: vec![
            ("scene".to_owned(), Value::from(scene)),
            ("technique".to_owned(), Value::from(technique)),
        ],
        repeat,
        seed: 100 + u64::from(repeat),
        integrator: technique.to_owned(),
        scene: format!("{scene}.scn"),
        max_depth: Some(5),
        resolution: Some([40, 30]),
        reference: Some(0),
        ..RunPlan::default()
    };
    let end = EndCause::other("128 samples per pixel");
    Run {
        planned: Arc::new(plan),
        folder,
        device: Some(device.to_owned()),
        lanes: Some(16),
        lost_share: Some(0.0),
        state: RunState::Ended(Outcome::Done(end)),
        rows: Arc::new(rows.collect()),
        pictures: [16, 64, 128]
            .map(|n| (n, PathBuf::from(format!("{technique}-{repeat}-{n}.exr"))))
            .to_vec(),
        open: Some(OpenStats {
            accel_build_s: 0.0021,
            accel_nodes: 77,
            accel_bytes: 4096,
            accel_cost: 9.5,
            ..OpenStats::default()
        }),
        floors: vec![("rmse".to_owned(), Floor::exact(0.004))],
        ..Run::default()
    }
}

/// Returns what was planned of a run, for changes.
fn planned(run: &mut Arc<Run>) -> &mut RunPlan {
    Arc::make_mut(&mut Arc::make_mut(run).planned)
}

/// The state of a run that was interrupted.
const UNFINISHED: RunState = RunState::Ended(Outcome::Interrupted);

/// Returns made-up pictures: the reference is a gradient, the others have an error that falls with
/// the samples and is in other pixels in each repeat.
fn picture(path: &Path, _: Option<&str>) -> Result<Image, String> {
    let name = path
        .file_stem()
        .and_then(|s| s.to_str())
        .unwrap_or_default();
    let samples: f32 = name
        .rsplit('-')
        .next()
        .and_then(|n| n.parse().ok())
        .unwrap_or(f32::INFINITY);
    let repeat: Option<u32> = name.split('-').nth(1).and_then(|n| n.parse().ok());
    let shift = repeat.unwrap_or(0);
    let error = if name.starts_with("bpt") { 2.0 } else { 1.0 } / samples.sqrt();
    Ok(Image::from_fn(40, 30, |x, y| {
        let sign = if (x * 7 + y * 13 + shift).is_multiple_of(3) {
            1.0
        } else {
            -0.5
        };
        // The left half has larger errors for both techniques.
        let local = if x < 20 { error } else { 0.1 * error };
        [
            0.02 * x as f32 + 0.1 + sign * local,
            0.02 * y as f32 + 0.1,
            0.3,
        ]
    }))
}

fn report(nights: &[Night], options: &ReportOptions) -> Report {
    report_with(nights, options, &picture)
}

/// Makes a report whose pictures a function returns.
fn report_with(nights: &[Night], options: &ReportOptions, pictures: &Pictures) -> Report {
    let study = Study::new(nights, options).unwrap();
    let link = |path: &Path| path.display().to_string();
    let command = |path: &Path| format!("lumbre reproduce {}/final.exr", path.display());
    build(
        &study,
        options,
        &ReportContext {
            pictures,
            bytes: &|path| Err(format!("{} is missing", path.display())),
            problems: &Vec::new,
            link: &link,
            command: &command,
            again: "lumbre report out/latest",
            live: None,
        },
    )
    .unwrap()
}

fn item<'a>(report: &'a Report, stem: &str) -> &'a ReportItem {
    let all = || {
        report
            .items
            .iter()
            .map(|i| i.stem.as_str())
            .collect::<Vec<_>>()
    };
    report
        .items
        .iter()
        .find(|i| i.stem == stem)
        .unwrap_or_else(|| panic!("no {stem} among {:?}", all()))
}

fn text(report: &Report, stem: &str, extension: &str) -> String {
    let files = item(report, stem).files().unwrap();
    let (_, bytes) = files
        .into_iter()
        .find(|(name, _)| *name == format!("{stem}.{extension}"))
        .unwrap();
    String::from_utf8(bytes).unwrap()
}

fn one() -> Report {
    report(&[night("Sample GPU", 1.0)], &ReportOptions::default())
}

/// Returns the data of the page's scripts.
fn page_data(page: &str) -> serde_json::Value {
    let (data, _) = page
        .split_once("id=\"data\">")
        .and_then(|(_, rest)| rest.split_once("</script>"))
        .unwrap();
    serde_json::from_str(data).unwrap()
}

#[test]
fn tables_match_their_snapshots() {
    let made = one();
    insta::assert_snapshot!("fps", text(&made, "tables/fps-absolute", "md"));
    insta::assert_snapshot!("equal-time", text(&made, "tables/equal-time-rmse", "md"));
    insta::assert_snapshot!(
        "equal-error-tex",
        text(&made, "tables/equal-error-rmse", "tex")
    );
    insta::assert_snapshot!("efficiency", text(&made, "tables/efficiency", "md"));
    insta::assert_snapshot!(
        "time-to-csv",
        text(&made, "tables/time-to-ssim-0.95", "csv")
    );
}

#[test]
fn curves_are_drawn_with_bands_noise_floor_ends_and_names() {
    let made = one();
    let svg = text(&made, "figures/error-time-rmse", "svg");
    insta::assert_snapshot!("error-time-rmse", svg);
    assert!(svg.contains("noise of the reference"), "the floor is named");
    assert!(
        svg.contains("render time (s) on Sample GPU"),
        "the device of the times is named"
    );
    assert_eq!(
        svg.matches("fill-opacity=\"0.16\"").count(),
        4,
        "a band for each series of each panel"
    );
    let samples = text(&made, "figures/error-samples-ssim", "svg");
    assert!(samples.contains(">1 − SSIM</text>") && !samples.contains("noise of the reference"));
    let tex = text(&made, "figures/error-time-rmse", "tex");
    assert!(
        tex.contains("{error-time-rmse.dat}") && tex.matches("\\addlegendentry{nee}").count() == 1,
        "{tex}"
    );
    let dat = text(&made, "figures/error-time-rmse", "dat");
    let header = dat.lines().find(|l| !l.starts_with('#')).unwrap();
    assert!(
        header.starts_with("f0s0x f0s0y f0s0l f0s0u f0s1x"),
        "{header}"
    );
    for extension in ["png", "pdf"] {
        let files = item(&made, "figures/error-time-rmse").files().unwrap();
        assert!(
            files
                .iter()
                .any(|(name, bytes)| name.ends_with(extension) && bytes.len() > 1000)
        );
    }
}

#[test]
fn crops_show_the_nearest_stored_pictures_where_series_differ() {
    let made = one();
    let crops = item(&made, "figures/crops-equal-time-box");
    let svg = crops.svg.as_deref().unwrap();
    // bpt ends with 128 samples at 1.28 s, when nee has 64.
    assert!(
        svg.contains(">128 spp, 1.3 s</text>") && svg.contains(">64 spp, 1.3 s</text>"),
        "{}",
        crops.caption
    );
    assert_eq!(
        svg.matches("<image").count(),
        1 + 2 * 3 + 2,
        "reference, two windows of three, two FLIP maps"
    );
    assert!(svg.contains(">FLIP 0."), "the mean of each map is below it");
    assert_eq!(crops.provenance.runs.len(), 2);
    let options = ReportOptions {
        crops: vec![[4, 4, 12, 9], [35, 4, 12, 9]],
        ..ReportOptions::default()
    };
    let requested = report(&[night("Sample GPU", 1.0)], &options);
    assert!(
        requested
            .notes
            .iter()
            .any(|n| n.contains("[35, 4, 12, 9] is not inside of")),
        "{:?}",
        requested.notes
    );
    assert_eq!(
        item(&requested, "figures/crops-equal-time-box")
            .svg
            .as_deref()
            .unwrap()
            .matches("<image")
            .count(),
        6
    );
}

#[test]
fn equal_error_shows_fewer_samples_of_the_better_technique() {
    let svg = item(&one(), "figures/crops-equal-error-box")
        .svg
        .clone()
        .unwrap();
    // The worst final RMSE is 0.01838, of bpt at 128 samples. nee has 0.025 at 16 samples and
    // 0.0125 at 64; the ratio to the former is closer to 1.
    assert!(
        svg.contains(">128 spp, 1.3 s</text>") && svg.contains(">16 spp, 0.32 s</text>"),
        "{svg}"
    );
}

#[test]
fn nights_of_two_devices_are_compared_and_named() {
    let nights = [night("RTX 4070", 1.0), night("RX 7600", 0.44)];
    let made = report(&nights, &ReportOptions::default());
    insta::assert_snapshot!("fps-two-devices", text(&made, "tables/fps-absolute", "tex"));
    insta::assert_snapshot!("fps-relative", text(&made, "tables/fps-relative", "md"));
    let svg = text(&made, "figures/error-time-rmse", "svg");
    for name in [
        "bpt, RTX 4070",
        "nee, RTX 4070",
        "bpt, RX 7600",
        "nee, RX 7600",
    ] {
        assert!(svg.contains(&format!(">{name}</text>")), "{name}");
    }
    let caption = &item(&made, "figures/error-time-rmse").caption;
    assert!(
        caption.contains("Times are from 2 devices: RTX 4070; RX 7600."),
        "{caption}"
    );
}

#[test]
fn devices_of_one_night_have_separate_time_figures() {
    let mut both = night("RTX 4070", 1.0);
    let other = night("RX 7600", 0.44);
    let half = both.runs.len() / 2;
    both.runs.splice(half.., other.runs.into_iter().skip(half));
    let made = report(&[both], &ReportOptions::default());
    let titles: Vec<&str> = made.items.iter().map(|item| item.stem.as_str()).collect();
    assert!(!titles.contains(&"figures/error-time-rmse"), "{titles:?}");
    for (i, (own, others)) in [("RTX 4070", "RX 7600"), ("RX 7600", "RTX 4070")]
        .into_iter()
        .enumerate()
    {
        let figure = item(&made, &format!("figures/error-time-rmse-device-{}", i + 1));
        let svg = figure.svg.as_deref().unwrap();
        assert!(
            svg.contains(&format!("render time (s) on {own}"))
                && !svg.contains(&format!("{others}</text>")),
            "{svg}"
        );
        assert!(
            figure.caption.contains(&format!("Only runs on {own}.")),
            "{}",
            figure.caption
        );
    }
    assert!(
        titles.contains(&"figures/error-samples-rmse"),
        "samples are the same everywhere"
    );
}

#[test]
fn runs_stay_with_their_series_when_those_of_a_device_are_put_together() {
    let mut both = night("RTX 4070", 1.0);
    let other = night("RX 7600", 0.44);
    for (run, of_other) in both.runs.iter_mut().zip(other.runs) {
        if run.repeat == 2 {
            *run = of_other;
        }
    }
    let nights = [both];
    let study = Study::new(&nights, &ReportOptions::default()).unwrap();
    let order: Vec<(&str, Option<&str>)> = study
        .series
        .iter()
        .map(|series| (series.label.as_str(), series.device.as_deref()))
        .collect();
    let [a, b] = ["RTX 4070", "RX 7600"].map(Some);
    assert_eq!(order, [("bpt", a), ("nee", a), ("bpt", b), ("nee", b)]);
    for facet in 0..study.facets.len() {
        for (index, (label, device)) in order.iter().enumerate() {
            let members = study.members(facet, index);
            assert!(!members.is_empty(), "{facet} {label} {device:?}");
            for member in members {
                assert_eq!(member.run.integrator, *label);
                assert_eq!(member.run.device.as_deref(), *device);
            }
        }
    }
}

#[test]
fn nights_may_measure_in_different_orders() {
    let mut other = night("RX 7600", 1.0);
    Arc::make_mut(&mut other.plan).metrics.reverse();
    for run in other.runs.iter_mut().map(Arc::make_mut) {
        for row in Arc::make_mut(&mut run.rows) {
            row.metrics.reverse();
        }
    }
    let nights = [night("RTX 4070", 1.0), other];
    let study = Study::new(&nights, &ReportOptions::default()).unwrap();
    for index in 0..study.series.len() {
        for member in study.members(0, index) {
            let last = member.run.rows.last().unwrap();
            let [rmse, ssim] = [0, 1].map(|metric| member.value(last, metric).unwrap());
            assert!(rmse < 0.1 && ssim > 0.9, "{rmse} {ssim}");
        }
    }
}

#[test]
fn text_of_a_night_does_not_end_the_scripts_of_the_page() {
    let mut named = night("Sample GPU", 1.0);
    for run in named.runs.iter_mut().map(planned) {
        run.point[0].1 = Value::Str("</script><b>".to_owned());
    }
    let page = |night: Night| {
        text(
            &report(&[night], &ReportOptions::default()),
            "index",
            "html",
        )
    };
    let ends = |page: &str| page.matches("</script").count();
    let changed = page(named);
    assert_eq!(ends(&changed), ends(&page(night("Sample GPU", 1.0))));
    assert!(page_data(&changed).to_string().contains("</script><b>"));
}

#[test]
fn runs_of_the_aa_check_are_no_repeats() {
    let mut checked = night("Sample GPU", 1.0);
    let originals = checked.runs.len();
    for mut double in checked.runs.clone() {
        planned(&mut double).double_of = Some(double.repeat);
        checked.runs.push(double);
    }
    let shown = checked.without_doubles();
    assert_eq!(shown.runs.len(), originals);
    assert!(shown.runs.iter().all(|run| run.double_of.is_none()));
}

#[test]
fn times_of_an_unknown_device_cannot_be_compared() {
    let mut nameless = night("RX 7600", 0.44);
    for run in nameless.runs.iter_mut().map(Arc::make_mut) {
        run.device = None;
    }
    let nights = [night("RTX 4070", 1.0), nameless.clone()];
    let error = Study::new(&nights, &ReportOptions::default()).unwrap_err();
    assert!(
        matches!(&error, ReportError::NoDevice { folder } if folder.ends_with("RX_7600")),
        "{error}"
    );
    assert!(
        Study::new(&[nameless], &ReportOptions::default()).is_ok(),
        "a single night compares no times"
    );
}

#[test]
fn metrics_that_nights_define_differently_are_left_out() {
    let mut other = night("RX 7600", 1.0);
    Arc::make_mut(&mut other.plan).metrics[1] = MetricSpec::new(
        "ssim",
        "ssim",
        BTreeMap::from([("range".to_owned(), Value::Int(2))]),
    )
    .unwrap();
    let nights = [night("RTX 4070", 1.0), other];
    let study = Study::new(&nights, &ReportOptions::default()).unwrap();
    assert_eq!(
        study
            .metrics
            .iter()
            .map(|m| m.column.as_str())
            .collect::<Vec<_>>(),
        ["rmse"]
    );
    assert!(
        study.notes[0].contains("`ssim` is left out"),
        "{:?}",
        study.notes
    );
}

#[test]
fn unknown_axes_and_columns_in_options_are_errors() {
    let nights = [night("GPU", 1.0)];
    let by = ReportOptions {
        by: vec!["tecnique".to_owned()],
        ..ReportOptions::default()
    };
    assert!(
        Study::new(&nights, &by)
            .unwrap_err()
            .to_string()
            .contains("the axes are: scene, technique")
    );
    let threshold = ReportOptions {
        thresholds: vec![("mse".to_owned(), 0.1)],
        ..ReportOptions::default()
    };
    let study = Study::new(&nights, &threshold).unwrap();
    assert!(
        tables::all(&study, &threshold, &mut Vec::new())
            .unwrap_err()
            .to_string()
            .contains("the columns are: rmse, ssim")
    );
}

#[test]
fn a_running_night_has_a_report_of_its_measurements() {
    let mut running = night("Sample GPU", 1.0);
    for run in running.runs.iter_mut().skip(7).map(Arc::make_mut) {
        run.state = RunState::Pending;
        (run.rows, run.device) = (Arc::default(), None);
    }
    let last = Arc::make_mut(&mut running.runs[6]);
    (last.state, last.device, last.pictures) = (UNFINISHED, None, Vec::new());
    let made = report(&[running], &ReportOptions::default());
    let fps = text(&made, "tables/fps-absolute", "md");
    assert!(fps.contains("| lamps |") && fps.contains("–"), "{fps}");
    assert!(
        made.notes
            .iter()
            .any(|n| n.contains("6 of 12 runs have not finished")),
        "{:?}",
        made.notes
    );
    let svg = text(&made, "figures/error-time-rmse", "svg");
    assert!(
        svg.contains(">lamps</text>"),
        "the unfinished run's curve is drawn"
    );
}

#[test]
fn a_night_without_references_has_rates_and_a_page() {
    let mut bare = night("Sample GPU", 1.0);
    Arc::make_mut(&mut bare.plan).metrics.clear();
    bare.references.clear();
    for run in &mut bare.runs {
        planned(run).reference = None;
        Arc::make_mut(&mut Arc::make_mut(run).rows)
            .iter_mut()
            .for_each(|row| row.metrics.clear());
    }
    let made = report(&[bare], &ReportOptions::default());
    assert!(text(&made, "tables/fps-absolute", "md").contains("98.1"));
    assert!(
        made.items.iter().all(|i| i.kind != ItemKind::Figure),
        "there is nothing to draw"
    );
    let page = text(&made, "index", "html");
    assert!(page.contains("\"metrics\":[]") && page.contains("\"views\":[]"));
}

#[test]
fn data_is_tidy_and_the_page_is_self_contained() {
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
        let page = page.replace("http://www.w3.org/2000/svg", "");
        assert!(!page.contains(address), "the page loads {address}");
    }
    assert!(
        page.contains("data-runs=\"0 1 2\"") && page.contains("id=\"figures/error-time-rmse\"")
    );
    let data = page_data(&page);
    assert_eq!(data["runs"].as_array().unwrap().len(), 12);
    assert_eq!(data["views"][0]["images"][1]["name"], "bpt");
    let tex = text(&made, "methods", "tex");
    assert!(
        tex.contains("Sample GPU") && tex.contains("experiment seed 11") && tex.contains("RMSE"),
        "{tex}"
    );
    assert!(
        tex.contains("\\texttt{bpt} is path tracing \\cite{kajiya1986}."),
        "{tex}"
    );
    let bib = text(&made, "references", "bib");
    assert!(bib.contains("@inproceedings{kajiya1986,") && !bib.contains("hachisuka"));
}

#[test]
fn names_are_escaped_in_page_tables_and_figures() {
    let mut hostile = night("</script><b>GPU & co", 1.0);
    for run in hostile.runs.iter_mut().map(planned) {
        run.point[0].1 = Value::Str(format!("<img src=x> {{}} \\input_{}", run.scene));
    }
    let made = report(&[hostile], &ReportOptions::default());
    let page = text(&made, "index", "html");
    assert!(!page.contains("<img src=x>") && !page.contains("</script><b>"));
    let tex = text(&made, "tables/fps-absolute", "tex");
    assert!(
        !tex.contains("\\input") && tex.contains("\\textbackslash{}input\\_"),
        "{tex}"
    );
    assert!(made.items.iter().all(|i| i.files().is_ok()));
}

#[test]
fn each_series_is_compared_with_its_own_reference() {
    let mut own = night("Sample GPU", 1.0);
    own.references.push(Arc::new(Reference {
        picture: Some(PathBuf::from("second.exr")),
        ..Reference::clone(&own.references[0])
    }));
    for run in own.runs.iter_mut().filter(|run| run.integrator == "nee") {
        planned(run).reference = Some(1);
        Arc::make_mut(run).floors = vec![("rmse".to_owned(), Floor::exact(0.01))];
    }
    // The reference of nee and its picture are brighter by the same factor, so its error is small.
    let brighter = |path: &Path, group: Option<&str>| {
        let image = picture(path, group)?;
        let name = path.display().to_string();
        let factor = if name.starts_with("second") || name.starts_with("nee") {
            2.0
        } else {
            1.0
        };
        Ok(Image {
            data: image.data.iter().map(|p| p.map(|x| x * factor)).collect(),
            ..image
        })
    };
    let made = report_with(&[own], &ReportOptions::default(), &brighter);
    let caption = &item(&made, "figures/crops-equal-time-box").caption;
    assert!(
        caption.contains("the one shown is that of bpt"),
        "{caption}"
    );
    let svg = text(&made, "figures/error-time-rmse", "svg");
    assert!(
        !svg.contains("noise of the reference"),
        "there is no common floor"
    );
    assert!(
        item(&made, "figures/error-time-rmse")
            .caption
            .contains("Dotted: noise of the reference of each series")
    );
    let page = text(&made, "index", "html");
    let data = page_data(&page);
    let images = data["views"][0]["images"].as_array().unwrap();
    let names: Vec<&str> = images.iter().map(|i| i["name"].as_str().unwrap()).collect();
    assert_eq!(
        names,
        ["reference of bpt", "bpt", "nee", "reference of nee"]
    );
    let truths: Vec<u64> = images
        .iter()
        .map(|i| i["truth"].as_u64().unwrap())
        .collect();
    assert_eq!(truths, [0, 0, 3, 3]);
    assert_eq!(data["runs"][0]["floors"][0], 0.004);
}
