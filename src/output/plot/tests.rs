//! Figures of hand-made nights.

use super::*;
use crate::experiment::Outcome;
use crate::output::fixture::{done, ended, numbers, plan, words};

fn spec(y: &[&str], by: Option<&str>, facet: &[&str]) -> FigureSpec {
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    FigureSpec {
        name: "convergence".to_owned(),
        x: FigureX::RenderS,
        y: owned(y),
        by: by.map(str::to_owned),
        facet: owned(facet),
    }
}

/// A night of two scenes, three depths and two repeats whose errors fall as the square root of time.
fn night() -> (Plan, Vec<CellResult>) {
    let plan = plan(&[("scene", words(&["box", "lamps & <glass>"])), ("depth", numbers(&[2.0, 5.0, 9.0]))], 2);
    let results = (0..plan.cells.len()).map(|i| done(i, &waves(i))).collect();
    (plan, results)
}

fn waves(cell: usize) -> Vec<(f64, f64)> {
    let wave = |k: i32| {
        let t = 0.013 * 1.7f64.powi(k) * (1.0 + 0.3 * (cell % 5) as f64);
        let wobble = 1.0 + 0.05 * ((k * 7 + cell as i32 * 5) as f64).sin();
        (t, 0.08 * (1.0 + 0.5 * (cell % 6 / 2) as f64) * wobble / t.sqrt() / 3.0)
    };
    (0..14).map(wave).collect()
}

fn count(svg: &str, what: &str) -> usize {
    svg.matches(what).count()
}

#[test]
fn one_picture_for_each_facet_with_a_panel_for_each_metric() {
    let (plan, results) = night();
    let figures = figures(&plan, &spec(&["rmse", "ssim"], Some("depth"), &["scene"]), &results);
    let stems: Vec<&str> = figures.iter().map(|(stem, _)| stem.as_str()).collect();
    assert_eq!(stems, ["convergence_scene=box", "convergence_scene=lamps____glass_"]);
    let svg = &figures[1].1;
    assert!(svg.contains(">night: scene = lamps &amp; &lt;glass&gt;</text>"), "{svg}");
    for text in
        ["Root mean square error", "RMSE (radiance)", "1 − structural similarity", "1 − SSIM", "render time (s)"]
    {
        assert!(svg.contains(&format!(">{text}</text>")), "{text} is missing");
    }
    // Two repeats of three depths in two panels, and three samples in the legend.
    assert_eq!(count(svg, "<polyline"), 2 * 3 * 2 + 3);
    for depth in [2, 5, 9] {
        assert_eq!(count(svg, &format!(">depth = {depth}</text>")), 1);
    }
    assert!(
        svg.contains(
            "plan night 3f9a5b\nrun run06 scene=lamps &amp; &lt;glass&gt;/depth=2/rep=0 seed=106 samples=8192"
        )
    );
}

#[test]
fn curves_look_the_same_in_every_figure() {
    let (plan, results) = night();
    let one = spec(&["rmse"], Some("depth"), &["scene"]);
    let (whole, part) = (figures(&plan, &one, &results), figures(&plan, &one, &results[8..10]));
    let colour = |svg: &str| {
        svg.split_once(">depth = 5<")
            .map(|(before, _)| before.rfind("<polyline").map(|i| before[i..].to_owned()))
            .unwrap()
            .unwrap()
    };
    let stroke = |svg: &str| colour(svg).split("stroke=\"").nth(1).unwrap()[..7].to_owned();
    assert_eq!(part.len(), 1);
    assert_eq!(stroke(&whole[1].1), stroke(&part[0].1));
}

#[test]
fn the_integrator_has_its_long_name() {
    let plan = plan(&[("technique", words(&["bpt"]))], 1);
    let results = [done(0, &waves(0))];
    let by = &figures(&plan, &spec(&["psnr"], Some("technique"), &[]), &results)[0];
    assert_eq!(by.0, "convergence");
    assert!(by.1.contains(">bpt (backward path tracing)</text>") && by.1.contains(">PSNR (dB)</text>"));
    let none = &figures(&plan, &spec(&["psnr"], None, &[]), &results)[0];
    assert!(none.1.contains(">bpt (backward path tracing)</text>"));
}

#[test]
fn without_by_every_cell_is_a_curve_of_its_own() {
    let (plan, results) = night();
    let svg = &figures(&plan, &spec(&["rmse"], None, &[]), &results)[0].1;
    assert_eq!(count(svg, ">scene = box, depth = 9</text>"), 1);
    assert_eq!(count(svg, "<polyline"), 12 + 6);
}

#[test]
fn nothing_measured_gives_no_picture() {
    let (plan, _) = night();
    let one = spec(&["rmse"], Some("depth"), &["scene"]);
    assert!(figures(&plan, &one, &[]).is_empty());
    assert!(figures(&plan, &one, &[ended(0, Outcome::Interrupted)]).is_empty());
    let reference = CellResult { cell: CellRef::Reference(0), ..done(0, &waves(0)) };
    assert!(figures(&plan, &one, &[reference]).is_empty());
}

#[test]
fn values_without_a_place_are_skipped() {
    let (plan, _) = night();
    let one = spec(&["rmse", "psnr"], Some("depth"), &["scene"]);
    let broken = [(0.0, 0.5), (1.0, 0.0), (2.0, f64::NAN), (4.0, f64::INFINITY)];
    let svg = &figures(&plan, &one, &[done(0, &broken)])[0].1;
    assert!(svg.contains("no value can be drawn"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // One drawable point is a marker without a line.
    let svg = &figures(&plan, &spec(&["rmse"], Some("depth"), &[]), &[done(0, &[(1.0, 0.5), (2.0, f64::NAN)])])[0].1;
    assert_eq!((count(svg, "<polyline"), count(svg, "<circle")), (1, 2));
    let missing = figures(&plan, &spec(&["flop"], None, &[]), &[done(0, &waves(0))]);
    assert!(missing[0].1.contains("none of the figure's metrics is measured"));
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
    let (first, second) = (figures(&plan, &one, &results), figures(&plan, &one, &results));
    assert_eq!(first, second);
    let png = rasterize(&first[0].1).unwrap();
    assert_eq!(png, rasterize(&first[0].1).unwrap());
    let picture = image::load_from_memory(&png).unwrap().to_rgb8();
    let coloured = picture.pixels().filter(|p| p.0.iter().max().unwrap() - p.0.iter().min().unwrap() > 60).count();
    assert!(coloured > 2000, "only {coloured} pixels have a colour");
}
