//! Figures of hand-made nights.

mod sweep;

use std::collections::BTreeSet;

use crate::fixture::{self, done, ended, numbers, plan, texts};
use crate::plot::{rasterize, style};
use crate::report::requested;
use crate::report::requested::FigureFiles;
use crate::report::requested::figures::{LONGEST_STEM, unique_stem};
use lumbre_night::experiment::plan::Plan;
use lumbre_night::experiment::spec::{FigureKind, FigureSpec, FigureX};
use lumbre_night::experiment::{CellRef, Event, Outcome};

fn figures(
    plan: &Plan,
    spec: &FigureSpec,
    results: &[Event],
    device: impl Fn(CellRef, &Outcome) -> Option<String>,
) -> Vec<FigureFiles> {
    let night = fixture::night(plan, results);
    requested::figures(&requested::night(&night, device), spec)
}

fn spec(y: &[&str], by: Option<&str>, facet: &[&str]) -> FigureSpec {
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    FigureSpec {
        name: "convergence".to_owned(),
        kind: FigureKind::Convergence {
            x: FigureX::RenderS,
            y: owned(y),
        },
        by: by.map(str::to_owned),
        facet: owned(facet),
        only: Vec::new(),
    }
}

/// Night of two scenes, three depths and two repeats. Errors fall with the square root of time.
fn night() -> (Plan, Vec<Event>) {
    let plan = plan(
        &[
            ("scene", texts(&["box", "lamps & <glass>"])),
            ("depth", numbers(&[2.0, 5.0, 9.0])),
        ],
        2,
    );
    let results = (0..plan.cells.len()).map(|i| done(i, &waves(i))).collect();
    (plan, results)
}

fn waves(cell: usize) -> Vec<(f64, f64)> {
    let wave = |k: i32| {
        let t = 0.013 * 1.7f64.powi(k) * (1.0 + 0.3 * (cell % 5) as f64);
        let wobble = 1.0 + 0.05 * ((k * 7 + cell as i32 * 5) as f64).sin();
        (
            t,
            0.08 * (1.0 + 0.5 * (cell % 6 / 2) as f64) * wobble / t.sqrt() / 3.0,
        )
    };
    (0..14).map(wave).collect()
}

/// Draws the figures of a night on one device.
fn drawn(plan: &Plan, spec: &FigureSpec, results: &[Event]) -> Vec<FigureFiles> {
    figures(plan, spec, results, |_, _| None)
}

fn count(svg: &str, what: &str) -> usize {
    svg.matches(what).count()
}

/// Number of lines of means, without legends, which are horizontal, and without thin curves of runs.
fn drawn_lines(svg: &str) -> usize {
    let is_line = |polyline: &&str| {
        let (points, rest) = polyline.split_once('"').unwrap();
        let heights: Vec<&str> = points
            .split(' ')
            .filter_map(|point| Some(point.split_once(',')?.1))
            .collect();
        let is_legend = heights.len() == 2 && heights[0] == heights[1];
        let tag = rest.split_once("/>").unwrap().0;
        !is_legend && !tag.contains("stroke-width=\"0.5\"")
    };
    let polylines = svg.split("<polyline points=\"").skip(1);
    polylines.filter(is_line).count()
}

#[test]
fn each_facet_has_a_picture_with_a_panel_for_each_metric() {
    let (plan, results) = night();
    let figures = drawn(
        &plan,
        &spec(&["rmse", "ssim"], Some("depth"), &["scene"]),
        &results,
    );
    let stems: Vec<&str> = figures.iter().map(|f| f.stem.as_str()).collect();
    assert_eq!(
        stems,
        ["convergence_scene=box", "convergence_scene=lamps____glass_"]
    );
    let svg = &figures[1].svg;
    assert!(
        svg.contains(">scene = lamps &amp; &lt;glass&gt;</text>"),
        "{svg}"
    );
    for text in [
        "Root mean square error",
        "RMSE (radiance)",
        "1 − structural similarity",
        "1 − SSIM",
        "render time (s)",
    ] {
        assert!(svg.contains(&format!(">{text}")), "{text} is missing");
    }
    // Means of three depths in two panels, with bands.
    assert_eq!(
        (drawn_lines(svg), count(svg, "fill-opacity")),
        (2 * 3, 2 * 3)
    );
    assert!(svg.contains(">mean of 2 repeats; band: range of the two repeats</text>"));
    for depth in [2, 5, 9] {
        let labels = count(svg, &format!(">depth = {depth}</text>"));
        assert_eq!(labels, 2, "each panel has a label at the end of its line");
    }
    assert!(
        svg.contains(
            "plan night 3f9a5b\nrun run06 scene=lamps &amp; &lt;glass&gt;/depth=2/rep=0 seed=106 samples=8192"
        )
    );
}

#[test]
fn curves_have_the_same_style_in_every_figure() {
    let (plan, results) = night();
    let one = spec(&["rmse"], Some("depth"), &["scene"]);
    let (all, some) = (
        drawn(&plan, &one, &results),
        drawn(&plan, &one, &results[8..10]),
    );
    let colour = |svg: &str| {
        let (before, _) = svg.split_once(">depth = 5<").unwrap();
        let fill = before.rfind("fill=\"").unwrap() + 6;
        before[fill..fill + 7].to_owned()
    };
    assert_eq!(some.len(), 1);
    assert_eq!(colour(&all[1].svg), colour(&some[0].svg));
    assert_ne!(colour(&all[1].svg), style::INK);
}

#[test]
fn the_integrator_has_its_long_name() {
    let plan = plan(&[("technique", texts(&["bpt"]))], 1);
    let results = [done(0, &waves(0))];
    let by = &drawn(&plan, &spec(&["psnr"], Some("technique"), &[]), &results)[0];
    assert_eq!(by.stem, "convergence");
    assert!(by.svg.contains(">bpt</text>") && by.svg.contains(">PSNR (dB)</text>"));
    assert!(by.svg.contains("bpt: path tracing"));
    let none = &drawn(&plan, &spec(&["psnr"], None, &[]), &results)[0];
    assert!(none.svg.contains("bpt: path tracing"));
}

#[test]
fn without_by_every_point_has_a_separate_curve() {
    let (plan, results) = night();
    let svg = &drawn(&plan, &spec(&["rmse"], None, &[]), &results)[0].svg;
    assert_eq!(count(svg, ">scene = box, depth = 9</text>"), 1);
    assert_eq!(drawn_lines(svg), 6);
}

/// Builds a night of two depths and three repeats, of which the first depth has finished and one
/// repeat of the second. Errors fall with the square root of time from 0.5, 1, 2 and 3.
fn repeated() -> (Plan, Vec<Event>) {
    let plan = plan(&[("depth", numbers(&[2.0, 5.0]))], 3);
    let falling = |from: f64| -> Vec<(f64, f64)> {
        (0..8)
            .map(|k| (2f64.powi(k), from / 2f64.powi(k).sqrt()))
            .collect()
    };
    let results = [0.5, 1.0, 2.0, 3.0]
        .iter()
        .enumerate()
        .map(|(i, from)| done(i, &falling(*from)))
        .collect();
    (plan, results)
}

#[test]
fn repeats_are_a_mean_with_its_interval() {
    let (plan, results) = repeated();
    let one = spec(&["rmse"], Some("depth"), &[]);
    let figure = drawn(&plan, &one, &results).remove(0);
    let lines: Vec<Vec<&str>> = figure
        .csv
        .lines()
        .map(|line| line.split(',').collect())
        .collect();
    assert_eq!(
        lines[0],
        ["depth", "metric", "x", "mean", "low", "high", "runs"]
    );
    let number = |text: &str| text.parse::<f64>().unwrap();
    // Factors 1/2, 1 and 2: the logarithms have mean 0 and standard deviation ln 2; t = 4.30265 at
    // two degrees.
    let half = 4.302_652_73 * 2f64.ln() / 3f64.sqrt();
    let repeated: Vec<_> = lines[1..].iter().filter(|line| line[0] == "2").collect();
    assert!(repeated.len() > 20 && repeated.iter().all(|line| line[6] == "3"));
    for line in repeated {
        let mean = number(line[3]);
        assert!(
            (mean * number(line[2]).sqrt() - 1.0).abs() < 1e-9,
            "{line:?}"
        );
        assert!(
            ((mean / number(line[4])).ln() - half).abs() < 1e-6,
            "{line:?}"
        );
        assert!(
            ((number(line[5]) / mean).ln() - half).abs() < 1e-6,
            "{line:?}"
        );
    }
    let single: Vec<_> = lines[1..].iter().filter(|line| line[0] == "5").collect();
    assert!(
        single.len() == 8 && single.iter().all(|line| line[4..] == ["", "", "1"]),
        "{single:?}"
    );
}

#[test]
fn duplicates_of_the_a_a_check_are_left_out() {
    let (mut plan, results) = repeated();
    plan.cells[1].double_of = Some(0);
    plan.cells[2].double_of = Some(1);
    let one = spec(&["rmse"], Some("depth"), &[]);
    let figure = drawn(&plan, &one, &results).remove(0);
    assert_eq!(
        figure
            .csv
            .lines()
            .filter(|line| line.starts_with("2,"))
            .count(),
        8,
        "one run of depth 2 is left"
    );
}

#[test]
fn nothing_measured_gives_no_picture() {
    let (plan, _) = night();
    let one = spec(&["rmse"], Some("depth"), &["scene"]);
    assert!(drawn(&plan, &one, &[]).is_empty());
    assert!(drawn(&plan, &one, &[ended(0, Outcome::Interrupted)]).is_empty());
    let mut reference = done(0, &waves(0));
    if let Event::CellFinished { cell, .. } = &mut reference {
        *cell = CellRef::Reference(0);
    }
    assert!(drawn(&plan, &one, &[reference]).is_empty());
}

#[test]
fn values_that_the_axis_does_not_accept_are_skipped() {
    let (plan, _) = night();
    let one = spec(&["rmse", "psnr"], Some("depth"), &["scene"]);
    let broken = [
        (0.0, 0.5),
        (1.0, 0.0),
        (2.0, f64::NAN),
        (4.0, f64::INFINITY),
    ];
    let svg = &drawn(&plan, &one, &[done(0, &broken)])[0].svg;
    assert!(svg.contains("nothing to draw"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // One drawable point is a marker without a line.
    let svg = &drawn(
        &plan,
        &spec(&["rmse"], Some("depth"), &[]),
        &[done(0, &[(1.0, 0.5), (2.0, f64::NAN)])],
    )[0]
    .svg;
    assert!(count(svg, "<circle") > 0 && !svg.contains("NaN"), "{svg}");
    let missing = drawn(&plan, &spec(&["flop"], None, &[]), &[done(0, &waves(0))]);
    assert!(
        missing[0]
            .svg
            .contains("none of this figure's metrics was measured")
    );
}

#[test]
fn stems_stay_unique_and_harmless() {
    let mut taken = BTreeSet::new();
    let facet = |v: &str| vec![("scene".to_owned(), v.to_owned())];
    assert_eq!(unique_stem("a", &facet("x/y"), &mut taken), "a_scene=x_y");
    assert_eq!(unique_stem("a", &facet("x y"), &mut taken), "a_scene=x_y-2");
    assert_eq!(unique_stem("../up", &[], &mut taken), "_.._up");
    assert!(unique_stem("n", &facet(&"long ".repeat(99)), &mut taken).len() <= LONGEST_STEM);
}

#[test]
fn figures_are_drawable_and_deterministic() {
    let (plan, results) = night();
    let one = spec(&["rmse", "ssim", "psnr"], Some("depth"), &["scene"]);
    let (first, second) = (drawn(&plan, &one, &results), drawn(&plan, &one, &results));
    assert_eq!(first, second);
    let png = rasterize(&first[0].svg).unwrap();
    assert_eq!(png, rasterize(&first[0].svg).unwrap());
    let picture = image::load_from_memory(&png).unwrap().to_rgb8();
    let coloured = picture
        .pixels()
        .filter(|p| p.0.iter().max().unwrap() - p.0.iter().min().unwrap() > 60)
        .count();
    assert!(coloured > 2000, "only {coloured} pixels have a colour");
}

/// Returns another device for every second pair of repeats.
fn alternating_device(cell: CellRef, _: &Outcome) -> Option<String> {
    match cell {
        CellRef::Cell(i) => Some(if i / 2 % 2 == 0 { "a lens" } else { "a prism" }.to_owned()),
        CellRef::Reference(_) => None,
    }
}

#[test]
fn times_of_several_devices_never_share_an_axis() {
    let (plan, results) = night();
    let by = spec(&["rmse"], Some("depth"), &["scene"]);
    let stems = |spec: &FigureSpec| -> Vec<String> {
        figures(&plan, spec, &results, alternating_device)
            .into_iter()
            .map(|figure| figure.stem)
            .collect()
    };
    let split = stems(&by);
    assert_eq!(split.len(), 4, "{split:?}");
    assert!(
        split.contains(&"convergence_scene=box_device=a_lens".to_owned()),
        "{split:?}"
    );
    let figure = &figures(&plan, &by, &results, alternating_device)[0];
    assert!(
        figure.svg.contains(">scene = box, device = a lens</text>"),
        "{}",
        figure.svg
    );
    assert_eq!(drawn_lines(&figure.svg), 2, "two of the three depths");
    // Samples and the times of a single device need no separate figures.
    let kind = FigureKind::Convergence {
        x: FigureX::Samples,
        y: vec!["rmse".to_owned()],
    };
    assert_eq!(stems(&FigureSpec { kind, ..by.clone() }).len(), 2);
    let one = |_: CellRef, _: &Outcome| Some("a lens".to_owned());
    assert_eq!(
        figures(&plan, &by, &results, one),
        drawn(&plan, &by, &results)
    );
}

#[test]
fn times_of_swept_backends_share_an_axis() {
    let (mut plan, results) = night();
    let by = spec(&["rmse"], Some("depth"), &["scene"]);
    for (i, cell) in plan
        .cells
        .iter_mut()
        .enumerate()
        .filter(|(i, _)| i / 2 % 2 == 1)
    {
        let backend = format!("vulkan-{}", i / 2 % 2);
        cell.config = std::sync::Arc::new(lumbre_render::Settings {
            backend,
            ..(*cell.config).clone()
        });
    }
    assert_eq!(figures(&plan, &by, &results, alternating_device).len(), 2);
}
