//! Figures over an axis of the sweep.

use super::*;
use crate::fixture::measured;
use lumbre_light::value::Value;
use lumbre_night::experiment::spec::{RunColumn, TableValue};

/// Specification of a figure over an axis of the sweep.
fn over(axis: &str, y: &[TableValue], by: Option<&str>, facet: &[&str]) -> FigureSpec {
    FigureSpec {
        kind: FigureKind::Sweep {
            over: axis.to_owned(),
            y: y.to_vec(),
        },
        ..spec(&[], by, facet)
    }
}

/// Fields of the CSV lines of a figure, without the header.
fn fields(figure: &FigureFiles) -> Vec<Vec<String>> {
    figure
        .csv
        .lines()
        .skip(1)
        .map(|line| line.split(',').map(str::to_owned).collect())
        .collect()
}

#[test]
fn final_values_are_drawn_over_an_axis_with_a_line_for_each_value_of_the_others() {
    let (plan, mut results) = night();
    // Build times of 1, 2 and 3 s at the three depths, 20 % more in the second repeat.
    for (i, result) in results.iter_mut().enumerate() {
        if let Event::CellFinished { open, .. } = result {
            let build_s = (1 + i % 6 / 2) as f64 * if i % 2 == 0 { 1.0 } else { 1.2 };
            open.as_mut().unwrap().accel_build_s = build_s;
        }
    }
    let y = [
        TableValue::Run(RunColumn::AccelBuildS),
        TableValue::Metric("rmse".to_owned()),
    ];
    let figures = drawn(&plan, &over("depth", &y, Some("scene"), &[]), &results);
    assert_eq!(figures.len(), 1);
    let svg = &figures[0].svg;
    for text in [
        "build (s)",
        "RMSE (radiance)",
        "depth",
        "scene = box",
        "mean of 2 repeats; band: range of the two repeats",
    ] {
        assert!(
            svg.contains(&format!(">{text}</text>")),
            "{text} is missing"
        );
    }
    // Two lines with bands in each of two panels.
    assert_eq!(
        (drawn_lines(svg), count(svg, "fill-opacity")),
        (2 * 2, 2 * 2)
    );
    assert!(
        figures[0]
            .csv
            .starts_with("scene,depth,metric,x,mean,low,high,runs\n")
    );
    let lines = fields(&figures[0]);
    assert_eq!(lines.len(), 2 * 2 * 3);
    let first: Vec<&str> = lines[0].iter().map(String::as_str).collect();
    assert_eq!(
        first,
        ["box", "2", "accel_build_s", "2", "1.1", "1", "1.2", "2"]
    );
    assert_eq!(
        lines[2][1..5],
        ["9", "accel_build_s", "9", "3.3"].map(str::to_owned)
    );
    // Errors are those after the last wave. Their mean is geometric, as in convergence figures.
    let last = |cell: usize| waves(cell).last().unwrap().1;
    let mean: f64 = lines[6][4].parse().unwrap();
    assert!((mean - (last(0) * last(1)).sqrt()).abs() < 1e-12, "{mean}");
}

#[test]
fn names_have_evenly_spaced_positions_and_long_ones_are_rotated() {
    let names = [
        "none",
        "a structure with a long name",
        "another one with a longer name",
        "short",
    ];
    let plan = plan(&[("accel", texts(&names))], 1);
    let results: Vec<_> = (0..4).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let figure = drawn(
        &plan,
        &over("accel", &[TableValue::Run(RunColumn::RenderS)], None, &[]),
        &results,
    )
    .remove(0);
    for name in names {
        // The longest ones are shortened.
        let start: String = name.chars().take(12).collect();
        assert_eq!(count(&figure.svg, &format!(">{start}")), 1, "{name}");
    }
    assert_eq!(count(&figure.svg, "rotate(-90"), 4, "four names");
    assert!(figure.svg.contains("bpt: path tracing") && !figure.svg.contains("one thin line"));
    let lines = fields(&figure);
    assert_eq!(
        lines[1],
        [names[1], "render_s", names[1], "2", "", "", "1"].map(str::to_owned)
    );
    let short = plan_of_two();
    let results: Vec<_> = (0..2).map(|i| done(i, &[(1.0, 0.5)])).collect();
    let figure = drawn(
        &short,
        &over("accel", &[TableValue::Run(RunColumn::RenderS)], None, &[]),
        &results,
    )
    .remove(0);
    assert_eq!(count(&figure.svg, "rotate(-90"), 0);
}

fn plan_of_two() -> Plan {
    plan(&[("accel", texts(&["sah", "ploc"]))], 1)
}

#[test]
fn only_finished_and_requested_runs_are_drawn_over_an_axis() {
    let (plan, mut results) = night();
    results[0] = measured(0, Outcome::Interrupted, &waves(0));
    results[3] = measured(3, Outcome::Failed("lost".to_owned()), &waves(3));
    let one = over(
        "depth",
        &[TableValue::Run(RunColumn::Samples)],
        None,
        &["scene"],
    );
    let figures = drawn(&plan, &one, &results);
    let runs: Vec<String> = fields(&figures[0])
        .iter()
        .map(|line| line[7].clone())
        .collect();
    assert_eq!(runs, ["1", "1", "2"]);
    let only = FigureSpec {
        only: vec![
            ("scene".to_owned(), texts(&["box"])),
            ("depth".to_owned(), numbers(&[5.0, 9.0])),
        ],
        ..one
    };
    let figures = drawn(&plan, &only, &results);
    assert_eq!(
        (figures.len(), figures[0].stem.as_str()),
        (1, "convergence_scene=box")
    );
    assert_eq!(
        fields(&figures[0])
            .iter()
            .map(|line| line[1].as_str())
            .collect::<Vec<_>>(),
        ["5", "9"]
    );
    // `only` applies to convergence figures too.
    let curves = FigureSpec {
        only: only.only.clone(),
        ..spec(&["rmse"], Some("depth"), &[])
    };
    let figures = drawn(&plan, &curves, &results);
    assert!(!figures[0].svg.contains("depth = 2<") && figures[0].svg.contains("depth = 5<"));
}

#[test]
fn a_threshold_that_a_repeat_did_not_reach_has_no_point() {
    let plan = plan(&[("depth", numbers(&[2.0, 5.0]))], 2);
    let ends = [0.05, 0.5, 0.05, 0.06];
    let results: Vec<_> = ends
        .iter()
        .enumerate()
        .map(|(i, e)| done(i, &[(1.0, 0.9), (3.0, *e)]))
        .collect();
    let value = TableValue::TimeTo {
        column: "rmse".to_owned(),
        threshold: 0.1,
    };
    let figure = drawn(&plan, &over("depth", &[value], None, &[]), &results).remove(0);
    let lines: Vec<&str> = figure.csv.lines().skip(1).collect();
    // The lower the last error, the earlier the threshold was passed between 1 s and 3 s.
    let time = |end: f64| 3f64.powf((0.9f64 / 0.1).ln() / (0.9 / end).ln());
    let [line] = lines[..] else {
        panic!("{lines:?}")
    };
    let fields: Vec<&str> = line.split(',').collect();
    assert_eq!(fields[..4], ["5", "\"time_to(rmse", " 0.1)\"", "5"]);
    let numbers: Vec<f64> = fields[4..].iter().map(|x| x.parse().unwrap()).collect();
    let (first, second) = (time(0.05), time(0.06));
    for (found, expected) in numbers
        .iter()
        .zip([0.5 * (first + second), first, second, 2.0])
    {
        assert!((found - expected).abs() < 1e-9, "{lines:?}");
    }
    assert!(figure.svg.contains("until RMSE"));
}

#[test]
fn times_over_an_axis_have_separate_figures_for_each_device() {
    let (plan, results) = night();
    let name = |cell: CellRef, _: &Outcome| match cell {
        CellRef::Cell(i) => Some(if i % 6 < 2 { "a lens" } else { "a prism" }.to_owned()),
        CellRef::Reference(_) => None,
    };
    let count = |y: TableValue| {
        figures(
            &plan,
            &over("depth", &[y], Some("scene"), &[]),
            &results,
            name,
        )
        .len()
    };
    assert_eq!(count(TableValue::Run(RunColumn::MpathsPerS)), 2);
    assert_eq!(count(TableValue::Run(RunColumn::AccelCost)), 1);
}

/// Night of two techniques and four depths. Each depth has a different radius; the first two and
/// the last two depths have the same filter.
fn zipped() -> (Plan, Vec<Event>) {
    let mut plan = plan(
        &[
            ("technique", texts(&["bpt", "nee"])),
            ("depth", numbers(&[2.0, 3.0, 4.0, 5.0])),
        ],
        1,
    );
    plan.axes.extend(["radius", "filter"].map(str::to_owned));
    for (i, cell) in plan.cells.iter_mut().enumerate() {
        cell.point
            .push(("radius".to_owned(), Value::number(0.5 * (i % 4) as f64)));
        cell.point.push((
            "filter".to_owned(),
            Value::from(["box", "gauss"][i % 4 / 2]),
        ));
        let integrator = if i < 4 { "bpt" } else { "nee" }.to_owned();
        cell.config = std::sync::Arc::new(lumbre_render::Settings {
            integrator,
            ..(*cell.config).clone()
        });
    }
    let results = (0..plan.cells.len())
        .map(|i| done(i, &[(1.0 + i as f64, 0.5)]))
        .collect();
    (plan, results)
}

#[test]
fn axes_determined_by_the_horizontal_one_distinguish_no_lines() {
    let (plan, results) = zipped();
    let y = [TableValue::Run(RunColumn::RenderS)];
    let draw = |spec: FigureSpec| drawn(&plan, &spec, &results);
    let lines = |figure: &FigureFiles| drawn_lines(&figure.svg);
    let made = draw(over("depth", &y, None, &[]));
    // One line for each technique, not one for each radius.
    assert_eq!((made.len(), lines(&made[0])), (1, 2));
    for text in ["radius and filter change with depth", "bpt: path tracing"] {
        assert!(made[0].svg.contains(text), "{text}");
    }
    let third: Vec<String> = fields(&made[0])[2].clone();
    assert_eq!(
        third[..6],
        ["bpt", "4", "1", "gauss", "render_s", "4"].map(str::to_owned)
    );
    // A requested axis distinguishes lines only if its values have several positions.
    let filters = draw(over("depth", &y, Some("filter"), &["technique"]));
    assert_eq!((filters.len(), lines(&filters[0])), (2, 2));
    assert!(filters[0].svg.contains("radius changes with depth"));
    let radii = draw(over("depth", &y, Some("radius"), &["technique"]));
    assert_eq!((radii.len(), lines(&radii[0])), (2, 1));
    assert_eq!(draw(over("depth", &y, None, &["radius"])).len(), 1);
    assert_eq!(draw(over("depth", &y, None, &["filter"])).len(), 2);
    // Over the filter, depths and radii vary at one position and distinguish lines.
    assert!(
        !draw(over("filter", &y, None, &["technique"]))[0]
            .svg
            .contains("change")
    );
    // One technique gives one line.
    let one = FigureSpec {
        only: vec![("technique".to_owned(), texts(&["nee"]))],
        ..over("depth", &y, None, &[])
    };
    assert_eq!(lines(&draw(one)[0]), 1);
}

#[test]
fn a_line_over_techniques_is_not_named_after_one() {
    let (plan, results) = zipped();
    let one = FigureSpec {
        only: vec![("depth".to_owned(), numbers(&[3.0]))],
        ..over(
            "technique",
            &[TableValue::Run(RunColumn::RenderS)],
            Some("filter"),
            &[],
        )
    };
    let svg = drawn(&plan, &one, &results).remove(0).svg;
    assert!(svg.contains("filter has a single value"), "{svg}");
    let mut only = plan;
    only.cells
        .retain(|cell| cell.point[1].1 == Value::number(3.0));
    let results: Vec<Event> = (0..2).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let svg = drawn(
        &only,
        &over(
            "technique",
            &[TableValue::Run(RunColumn::RenderS)],
            None,
            &[],
        ),
        &results,
    )
    .remove(0)
    .svg;
    assert_eq!(
        (drawn_lines(&svg), svg.contains("path tracing")),
        (1, false)
    );
    let svg = drawn(
        &only,
        &over("depth", &[TableValue::Run(RunColumn::RenderS)], None, &[]),
        &results,
    )
    .remove(0)
    .svg;
    assert!(svg.contains("depth has a single value"), "{svg}");
}

#[test]
fn a_line_connects_the_values_of_its_axis_in_their_order() {
    let plan = plan(&[("depth", numbers(&[9.0, 2.0, 5.0]))], 1);
    let results: Vec<_> = (0..3).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let one = over("depth", &[TableValue::Run(RunColumn::RenderS)], None, &[]);
    let svg = drawn(&plan, &one, &results).remove(0).svg;
    let (_, line) = svg.split_once("<polyline points=\"").unwrap();
    let points = line.split_once('"').unwrap().0.split(' ');
    let x: Vec<f64> = points
        .map(|point| point.split_once(',').unwrap().0.parse().unwrap())
        .collect();
    assert!(x.len() == 3 && x.is_sorted(), "{x:?}");
}
