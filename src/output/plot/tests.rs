//! Figures of hand-made nights.

use super::*;
use crate::experiment::Outcome;
use crate::experiment::spec::TableValue;
use crate::output::fixture::{done, ended, numbers, plan, words};
use crate::value::Value;

fn spec(y: &[&str], by: Option<&str>, facet: &[&str]) -> FigureSpec {
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    FigureSpec {
        name: "convergence".to_owned(),
        kind: FigureKind::Convergence { x: FigureX::RenderS, y: owned(y) },
        by: by.map(str::to_owned),
        facet: owned(facet),
        only: Vec::new(),
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

/// The figures of a night on one device.
fn drawn(plan: &Plan, spec: &FigureSpec, results: &[CellResult]) -> Vec<FigureFiles> {
    figures(plan, spec, results, &Devices::default())
}

fn count(svg: &str, what: &str) -> usize {
    svg.matches(what).count()
}

#[test]
fn one_picture_for_each_facet_with_a_panel_for_each_metric() {
    let (plan, results) = night();
    let figures = drawn(&plan, &spec(&["rmse", "ssim"], Some("depth"), &["scene"]), &results);
    let stems: Vec<&str> = figures.iter().map(|f| f.stem.as_str()).collect();
    assert_eq!(stems, ["convergence_scene=box", "convergence_scene=lamps____glass_"]);
    let svg = &figures[1].svg;
    assert!(svg.contains(">night: scene = lamps &amp; &lt;glass&gt;</text>"), "{svg}");
    for text in
        ["Root mean square error", "RMSE (radiance)", "1 − structural similarity", "1 − SSIM", "render time (s)"]
    {
        assert!(svg.contains(&format!(">{text}</text>")), "{text} is missing");
    }
    // The means of three depths in two panels, with bands, and three samples in the legend.
    assert_eq!((count(svg, "<polyline"), count(svg, "fill-opacity")), (2 * 3 + 3, 2 * 3));
    assert!(svg.contains(">mean of 2 repeats; band: the range of the two</text>"));
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
    let (whole, part) = (drawn(&plan, &one, &results), drawn(&plan, &one, &results[8..10]));
    let colour = |svg: &str| {
        svg.split_once(">depth = 5<")
            .map(|(before, _)| before.rfind("<polyline").map(|i| before[i..].to_owned()))
            .unwrap()
            .unwrap()
    };
    let stroke = |svg: &str| colour(svg).split("stroke=\"").nth(1).unwrap()[..7].to_owned();
    assert_eq!(part.len(), 1);
    assert_eq!(stroke(&whole[1].svg), stroke(&part[0].svg));
}

#[test]
fn the_integrator_has_its_long_name() {
    let plan = plan(&[("technique", words(&["bpt"]))], 1);
    let results = [done(0, &waves(0))];
    let by = &drawn(&plan, &spec(&["psnr"], Some("technique"), &[]), &results)[0];
    assert_eq!(by.stem, "convergence");
    assert!(by.svg.contains(">bpt (backward path tracing)</text>") && by.svg.contains(">PSNR (dB)</text>"));
    let none = &drawn(&plan, &spec(&["psnr"], None, &[]), &results)[0];
    assert!(none.svg.contains(">bpt (backward path tracing)</text>"));
}

#[test]
fn without_by_every_cell_is_a_curve_of_its_own() {
    let (plan, results) = night();
    let svg = &drawn(&plan, &spec(&["rmse"], None, &[]), &results)[0].svg;
    assert_eq!(count(svg, ">scene = box, depth = 9</text>"), 1);
    assert_eq!(count(svg, "<polyline"), 6 + 6);
}

#[test]
fn repeats_are_a_mean_with_its_interval_and_doubles_of_the_control_are_left_out() {
    let mut plan = plan(&[("depth", numbers(&[2.0, 5.0]))], 3);
    let falls = |from: f64| -> Vec<(f64, f64)> { (0..8).map(|k| (2f64.powi(k), from / 2f64.powi(k).sqrt())).collect() };
    let results: Vec<_> = [0.5, 1.0, 2.0, 3.0].iter().enumerate().map(|(i, from)| done(i, &falls(*from))).collect();
    let one = spec(&["rmse"], Some("depth"), &[]);
    let figure = drawn(&plan, &one, &results).remove(0);
    let lines: Vec<Vec<&str>> = figure.csv.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(lines[0], ["depth", "metric", "x", "mean", "low", "high", "runs"]);
    let number = |text: &str| text.parse::<f64>().unwrap();
    // Factors 1/2, 1 and 2: the logarithms have mean 0 and standard deviation ln 2; t = 4.30265 at two degrees.
    let half = 4.302_652_73 * 2f64.ln() / 3f64.sqrt();
    let repeated: Vec<_> = lines[1..].iter().filter(|line| line[0] == "2").collect();
    assert!(repeated.len() > 20 && repeated.iter().all(|line| line[6] == "3"));
    for line in repeated {
        let mean = number(line[3]);
        assert!((mean * number(line[2]).sqrt() - 1.0).abs() < 1e-9, "{line:?}");
        assert!(((mean / number(line[4])).ln() - half).abs() < 1e-6, "{line:?}");
        assert!(((number(line[5]) / mean).ln() - half).abs() < 1e-6, "{line:?}");
    }
    let single: Vec<_> = lines[1..].iter().filter(|line| line[0] == "5").collect();
    assert!(single.len() == 8 && single.iter().all(|line| line[4..] == ["", "", "1"]), "{single:?}");

    plan.cells[1].control = Some(0);
    plan.cells[2].control = Some(1);
    let figure = drawn(&plan, &one, &results).remove(0);
    assert_eq!(figure.csv.lines().filter(|line| line.starts_with("2,")).count(), 8, "one run of depth 2 is left");
}

#[test]
fn nothing_measured_gives_no_picture() {
    let (plan, _) = night();
    let one = spec(&["rmse"], Some("depth"), &["scene"]);
    assert!(drawn(&plan, &one, &[]).is_empty());
    assert!(drawn(&plan, &one, &[ended(0, Outcome::Interrupted)]).is_empty());
    let reference = CellResult { cell: CellRef::Reference(0), ..done(0, &waves(0)) };
    assert!(drawn(&plan, &one, &[reference]).is_empty());
}

#[test]
fn values_without_a_place_are_skipped() {
    let (plan, _) = night();
    let one = spec(&["rmse", "psnr"], Some("depth"), &["scene"]);
    let broken = [(0.0, 0.5), (1.0, 0.0), (2.0, f64::NAN), (4.0, f64::INFINITY)];
    let svg = &drawn(&plan, &one, &[done(0, &broken)])[0].svg;
    assert!(svg.contains("no value can be drawn"));
    assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
    // One drawable point is a marker without a line.
    let svg = &drawn(&plan, &spec(&["rmse"], Some("depth"), &[]), &[done(0, &[(1.0, 0.5), (2.0, f64::NAN)])])[0].svg;
    assert_eq!((count(svg, "<polyline"), count(svg, "<circle")), (1, 2));
    let missing = drawn(&plan, &spec(&["flop"], None, &[]), &[done(0, &waves(0))]);
    assert!(missing[0].svg.contains("none of the figure's metrics is measured"));
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
    let coloured = picture.pixels().filter(|p| p.0.iter().max().unwrap() - p.0.iter().min().unwrap() > 60).count();
    assert!(coloured > 2000, "only {coloured} pixels have a colour");
}

#[test]
fn times_of_several_devices_never_share_an_axis() {
    let (plan, results) = night();
    let by = spec(&["rmse"], Some("depth"), &["scene"]);
    // Every second pair of repeats on another machine, whose processor the script did not choose.
    let name = |r: &CellResult| match r.cell {
        CellRef::Cell(i) => Some(if i / 2 % 2 == 0 { "a lens" } else { "a prism" }.to_owned()),
        CellRef::Reference(_) => None,
    };
    let devices = Devices::new(&plan, &results, name);
    let stems = |spec: &FigureSpec| -> Vec<String> {
        figures(&plan, spec, &results, &devices).into_iter().map(|figure| figure.stem).collect()
    };
    let apart = stems(&by);
    assert_eq!(apart.len(), 4, "{apart:?}");
    assert!(apart.contains(&"convergence_scene=box_device=a_lens".to_owned()), "{apart:?}");
    let figure = &figures(&plan, &by, &results, &devices)[0];
    assert!(figure.svg.contains(">night: scene = box, device = a lens</text>"), "{}", figure.svg);
    assert_eq!(count(&figure.svg, "<polyline"), 2 + 2, "two of the three depths, and their samples in the legend");
    // Samples are the same everywhere, and so are the times of one device.
    let kind = FigureKind::Convergence { x: FigureX::Samples, y: vec!["rmse".to_owned()] };
    assert_eq!(stems(&FigureSpec { kind, ..by.clone() }).len(), 2);
    let one = Devices::new(&plan, &results, |_| Some("a lens".to_owned()));
    assert_eq!(figures(&plan, &by, &results, &one), drawn(&plan, &by, &results));
    // A script that sweeps backends has asked for what their devices differ by.
    let mut asked = plan.clone();
    for (i, cell) in asked.cells.iter_mut().enumerate().filter(|(i, _)| i / 2 % 2 == 1) {
        let backend = format!("vulkan-{}", i / 2 % 2);
        cell.config = std::sync::Arc::new(crate::experiment::CellConfig { backend, ..(*cell.config).clone() });
    }
    assert_eq!(figures(&asked, &by, &results, &Devices::new(&asked, &results, name)).len(), 2);
}

/// The same night over its depths instead.
fn over(axis: &str, y: &[TableValue], by: Option<&str>, facet: &[&str]) -> FigureSpec {
    FigureSpec { kind: FigureKind::Sweep { over: axis.to_owned(), y: y.to_vec() }, ..spec(&[], by, facet) }
}

/// Fields of the lines of a figure's data, without its header.
fn fields(figure: &FigureFiles) -> Vec<Vec<String>> {
    figure.csv.lines().skip(1).map(|line| line.split(',').map(str::to_owned).collect()).collect()
}

#[test]
fn what_runs_have_in_the_end_is_drawn_over_an_axis_with_a_line_for_each_value_of_the_others() {
    let (plan, mut results) = night();
    // Build times of 1, 2 and 3 s at the three depths, and a fifth more in the second repeat.
    for (i, result) in results.iter_mut().enumerate() {
        result.open.accel_build_s = (1 + i % 6 / 2) as f64 * if i % 2 == 0 { 1.0 } else { 1.2 };
    }
    let y = [TableValue::AccelBuildS, TableValue::Metric("rmse".to_owned())];
    let figures = drawn(&plan, &over("depth", &y, Some("scene"), &[]), &results);
    assert_eq!(figures.len(), 1);
    let svg = &figures[0].svg;
    for text in
        ["build (s)", "RMSE (radiance)", "depth", "scene = box", "mean of 2 repeats; band: the range of the two"]
    {
        assert!(svg.contains(&format!(">{text}</text>")), "{text} is missing");
    }
    // Two lines in each of two panels with their bands, and two samples in the legend.
    assert_eq!((count(svg, "<polyline"), count(svg, "fill-opacity")), (2 * 2 + 2, 2 * 2));
    assert!(figures[0].csv.starts_with("scene,depth,metric,x,mean,low,high,runs\n"));
    let lines = fields(&figures[0]);
    assert_eq!(lines.len(), 2 * 2 * 3);
    let first: Vec<&str> = lines[0].iter().map(String::as_str).collect();
    assert_eq!(first, ["box", "2", "accel_build_s", "2", "1.1", "1", "1.2", "2"]);
    assert_eq!(lines[2][1..5], ["9", "accel_build_s", "9", "3.3"].map(str::to_owned));
    // The errors are those after the last wave, and their mean is geometric, as in convergence figures.
    let last = |cell: usize| results[cell].rows.last().unwrap().metrics[0];
    let mean: f64 = lines[6][4].parse().unwrap();
    assert!((mean - (last(0) * last(1)).sqrt()).abs() < 1e-12, "{mean}");
}

#[test]
fn names_have_their_place_and_long_ones_stand_upright() {
    let names = ["none", "a hierarchy with a long name", "another one with a longer name", "short"];
    let plan = plan(&[("accel", words(&names))], 1);
    let results: Vec<_> = (0..4).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let figure = drawn(&plan, &over("accel", &[TableValue::RenderS], None, &[]), &results).remove(0);
    for name in names {
        assert_eq!(count(&figure.svg, &format!(">{name}</text>")), 1, "{name}");
    }
    assert_eq!(count(&figure.svg, "rotate(-90"), 4 + 1, "four names and the vertical axis");
    assert!(figure.svg.contains("bpt (backward path tracing)") && !figure.svg.contains("one thin line"));
    let lines = fields(&figure);
    assert_eq!(lines[1], [names[1], "render_s", names[1], "2", "", "", "1"].map(str::to_owned));
    let short = plan_of_two();
    let results: Vec<_> = (0..2).map(|i| done(i, &[(1.0, 0.5)])).collect();
    let figure = drawn(&short, &over("accel", &[TableValue::RenderS], None, &[]), &results).remove(0);
    assert_eq!(count(&figure.svg, "rotate(-90"), 1);
}

fn plan_of_two() -> Plan {
    plan(&[("accel", words(&["sah", "ploc"]))], 1)
}

#[test]
fn only_what_finished_is_drawn_over_an_axis_and_only_what_was_asked_for() {
    let (plan, mut results) = night();
    results[0].outcome = Outcome::Interrupted;
    results[3].outcome = Outcome::Failed("lost".to_owned());
    let one = over("depth", &[TableValue::Samples], None, &["scene"]);
    let figures = drawn(&plan, &one, &results);
    let runs: Vec<String> = fields(&figures[0]).iter().map(|line| line[7].clone()).collect();
    assert_eq!(runs, ["1", "1", "2"]);
    let only = FigureSpec {
        only: vec![("scene".to_owned(), words(&["box"])), ("depth".to_owned(), numbers(&[5.0, 9.0]))],
        ..one
    };
    let figures = drawn(&plan, &only, &results);
    assert_eq!((figures.len(), figures[0].stem.as_str()), (1, "convergence_scene=box"));
    assert_eq!(fields(&figures[0]).iter().map(|line| line[1].as_str()).collect::<Vec<_>>(), ["5", "9"]);
    // It holds for curves as well.
    let curves = FigureSpec { only: only.only.clone(), ..spec(&["rmse"], Some("depth"), &[]) };
    let figures = drawn(&plan, &curves, &results);
    assert!(!figures[0].svg.contains("depth = 2<") && figures[0].svg.contains("depth = 5<"));
}

#[test]
fn a_threshold_that_a_repeat_never_reached_has_no_point() {
    let plan = plan(&[("depth", numbers(&[2.0, 5.0]))], 2);
    let ends = [0.05, 0.5, 0.05, 0.06];
    let results: Vec<_> = ends.iter().enumerate().map(|(i, e)| done(i, &[(1.0, 0.9), (3.0, *e)])).collect();
    let value = TableValue::TimeTo { column: "rmse".to_owned(), threshold: 0.1 };
    let figure = drawn(&plan, &over("depth", &[value], None, &[]), &results).remove(0);
    let lines: Vec<&str> = figure.csv.lines().skip(1).collect();
    assert_eq!(lines, ["5,\"time_to(rmse, 0.1)\",5,3,3,3,2"]);
    assert!(figure.svg.contains("until a measurement first had RMSE"));
}

#[test]
fn clocks_over_an_axis_are_apart_for_each_device() {
    let (plan, results) = night();
    let name = |r: &CellResult| match r.cell {
        CellRef::Cell(i) => Some(if i % 6 < 2 { "a lens" } else { "a prism" }.to_owned()),
        CellRef::Reference(_) => None,
    };
    let devices = Devices::new(&plan, &results, name);
    let count = |y: TableValue| figures(&plan, &over("depth", &[y], Some("scene"), &[]), &results, &devices).len();
    assert_eq!(count(TableValue::MpathsPerS), 2);
    assert_eq!(count(TableValue::AccelCost), 1);
}

/// Four places: depths, and with each a radius of its own; the first two and the last two have a filter in common. Two techniques.
fn zipped() -> (Plan, Vec<CellResult>) {
    let mut plan = plan(&[("technique", words(&["bpt", "nee"])), ("depth", numbers(&[2.0, 3.0, 4.0, 5.0]))], 1);
    plan.axes.extend(["radius", "filter"].map(str::to_owned));
    for (i, cell) in plan.cells.iter_mut().enumerate() {
        cell.point.push(("radius".to_owned(), Value::number(0.5 * (i % 4) as f64)));
        cell.point.push(("filter".to_owned(), Value::from(["box", "gauss"][i % 4 / 2])));
        let integrator = if i < 4 { "bpt" } else { "nee" }.to_owned();
        cell.config = std::sync::Arc::new(crate::experiment::CellConfig { integrator, ..(*cell.config).clone() });
    }
    let results = (0..plan.cells.len()).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    (plan, results)
}

#[test]
fn axes_that_move_with_the_horizontal_one_tell_no_lines_apart() {
    let (plan, results) = zipped();
    let y = [TableValue::RenderS];
    let of = |spec: FigureSpec| drawn(&plan, &spec, &results);
    let lines = |figure: &FigureFiles| count(&figure.svg, "<polyline");
    let made = of(over("depth", &y, None, &[]));
    // A line and a sample in the legend for each technique, where every place had a line of its own.
    assert_eq!((made.len(), lines(&made[0])), (1, 2 + 2));
    for text in ["radius and filter change with depth", "bpt (backward path tracing)"] {
        assert!(made[0].svg.contains(&format!(">{text}</text>")), "{text}");
    }
    let third: Vec<String> = fields(&made[0])[2].clone();
    assert_eq!(third[..6], ["bpt", "4", "1", "gauss", "render_s", "4"].map(str::to_owned));
    // What has several places for each value tells lines apart when asked to; what has one does not, be it asked.
    let filters = of(over("depth", &y, Some("filter"), &["technique"]));
    assert_eq!((filters.len(), lines(&filters[0])), (2, 2 + 2));
    assert!(filters[0].svg.contains(">radius changes with depth</text>"));
    let radii = of(over("depth", &y, Some("radius"), &["technique"]));
    assert_eq!((radii.len(), lines(&radii[0])), (2, 1 + 1));
    assert_eq!(of(over("depth", &y, None, &["radius"])).len(), 1);
    assert_eq!(of(over("depth", &y, None, &["filter"])).len(), 2);
    // Over the filter, depths and radii differ at one place and are lines.
    assert!(!of(over("filter", &y, None, &["technique"]))[0].svg.contains("change"));
    // In one picture of one technique nothing tells its only line apart from another.
    let one = FigureSpec { only: vec![("technique".to_owned(), words(&["nee"]))], ..over("depth", &y, None, &[]) };
    assert_eq!(lines(&of(one)[0]), 1 + 1);
}

#[test]
fn a_line_over_techniques_is_called_after_none() {
    let (plan, results) = zipped();
    let one = FigureSpec {
        only: vec![("depth".to_owned(), numbers(&[3.0]))],
        ..over("technique", &[TableValue::RenderS], Some("filter"), &[])
    };
    let svg = drawn(&plan, &one, &results).remove(0).svg;
    assert!(svg.contains(">filter has a single value</text>"), "{svg}");
    let mut only = plan;
    only.cells.retain(|cell| cell.point[1].1 == Value::number(3.0));
    let results: Vec<CellResult> = (0..2).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let svg = drawn(&only, &over("technique", &[TableValue::RenderS], None, &[]), &results).remove(0).svg;
    assert_eq!((count(&svg, "<polyline"), svg.contains("path tracing")), (1, false));
    let svg = drawn(&only, &over("depth", &[TableValue::RenderS], None, &[]), &results).remove(0).svg;
    assert!(svg.contains(">depth has a single value</text>"), "{svg}");
}
