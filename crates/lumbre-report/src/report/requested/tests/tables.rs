//! Tables of hand-made nights.

use crate::fixture::{self, done, ended, measured, numbers, plan, texts};
use crate::quantity::Bound;
use crate::report::requested;
use crate::table::{Interval, Table, TableCell};
use lumbre_night::experiment::plan::Plan;
use lumbre_night::experiment::spec::{RunColumn, TableSpec, TableValue};
use lumbre_night::experiment::{CellRef, Event, Outcome};

fn tables(
    plan: &Plan,
    spec: &TableSpec,
    results: &[Event],
    device: impl Fn(CellRef, &Outcome) -> Option<String>,
) -> Vec<Table> {
    let night = fixture::night(plan, results);
    requested::tables(&requested::night(&night, device), spec)
}

fn build(plan: &Plan, spec: &TableSpec, results: &[Event]) -> Table {
    tables(plan, spec, results, |_, _| None).remove(0)
}

fn spec(value: TableValue, rows: &[&str], cols: &[&str]) -> TableSpec {
    let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
    TableSpec {
        name: "table".to_owned(),
        value,
        rows: owned(rows),
        cols: owned(cols),
        formats: Vec::new(),
    }
}

fn night() -> Plan {
    plan(
        &[
            ("technique", texts(&["bpt"])),
            ("depth", numbers(&[3.0, 5.0])),
            ("radius", numbers(&[0.5, 1.0])),
        ],
        2,
    )
}

#[test]
fn other_axes_and_repeats_are_averaged_and_counted() {
    let errors = [0.1, 0.2, 0.3, 0.4, 0.01, 0.02, 0.03, 0.04];
    let results: Vec<_> = errors
        .iter()
        .enumerate()
        .map(|(i, e)| done(i, &[(1.0, 0.9), (2.0, *e)]))
        .collect();
    let table = build(
        &night(),
        &spec(
            TableValue::Metric("rmse".to_owned()),
            &["depth"],
            &["technique"],
        ),
        &results,
    );
    assert_eq!(
        table.to_text(),
        "table: RMSE (root mean square error) in radiance after the last wave, mean of 4 runs (over radius,\n\
         repeats). bpt: path tracing.\n\
         \n\
         | depth | technique = bpt |\n\
         |-------|----------------:|\n\
         | 3     |          0.2500 |\n\
         | 5     |         0.02500 |\n"
    );
    assert_eq!(
        table.to_wide_csv(),
        "depth,technique = bpt,runs: technique = bpt\n3,0.25,4\n5,0.025,4\n"
    );
}

#[test]
fn times_of_several_devices_have_separate_tables() {
    let plan = night();
    let results: Vec<_> = (0..7).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
    let name = |cell: CellRef, _: &Outcome| match cell {
        CellRef::Cell(i) => Some(if i < 4 { "a lens" } else { "a prism" }.to_owned()),
        CellRef::Reference(_) => None,
    };
    let both = tables(
        &plan,
        &spec(TableValue::Run(RunColumn::RenderS), &["depth"], &[]),
        &results,
        name,
    );
    let names: Vec<&str> = both.iter().map(|table| table.name.as_str()).collect();
    assert_eq!(names, ["table-device-1", "table-device-2"]);
    assert_eq!(
        both[0].to_wide_csv().lines().skip(1).collect::<Vec<_>>(),
        ["3,2.5,4"]
    );
    assert_eq!(
        both[1].to_wide_csv().lines().skip(1).collect::<Vec<_>>(),
        ["5,6,3"]
    );
    assert!(
        both[1].caption.ends_with("Only runs on a prism."),
        "{}",
        both[1].caption
    );
    assert!(
        both[1].caption.contains("1 of 8") || both[1].caption.contains("1 run"),
        "{}",
        both[1].caption
    );
    // Errors are the same wherever they were computed.
    let errors = spec(TableValue::Metric("rmse".to_owned()), &["depth"], &[]);
    assert_eq!(
        tables(&plan, &errors, &results, name),
        [build(&plan, &errors, &results)]
    );
}

#[test]
fn means_of_repeats_have_an_interval_and_a_a_duplicates_are_left_out() {
    let mut plan = plan(&[("depth", numbers(&[3.0, 5.0]))], 3);
    let errors = [1.0, 2.0, 3.0, 0.5];
    let results: Vec<_> = errors
        .iter()
        .enumerate()
        .map(|(i, e)| done(i, &[(1.0, *e)]))
        .collect();
    let spec = spec(TableValue::Metric("rmse".to_owned()), &["depth"], &[]);
    let table = build(&plan, &spec, &results);
    // Standard deviation 1, three values, t = 4.30265.
    let Some(Interval::Half(half)) = table.rows[0].1[0].interval else {
        panic!("an interval was expected")
    };
    assert!((half - 4.302_652_73 / 3f64.sqrt()).abs() < 1e-6, "{half}");
    assert_eq!(table.rows[1].1[0].interval, None, "one run");
    assert!(
        table.to_text().contains("| 3     |       2.0 ± 2.5 |"),
        "{}",
        table.to_text()
    );
    assert!(table.to_wide_csv().starts_with(
        "depth,RMSE (radiance),runs: RMSE (radiance),±95 %: RMSE (radiance)\n3,2,3,2.48"
    ));
    plan.cells[2].double_of = Some(0);
    let table = build(&plan, &spec, &results);
    assert_eq!(
        (table.rows[0].1[0].runs, table.rows[0].1[0].value),
        (2, Some(1.5))
    );
    assert!(
        table.caption.contains("2 runs have not finished"),
        "{}",
        table.caption
    );
}

#[test]
fn gaps_show_as_dashes_and_unfinished_runs_are_left_out() {
    let results = [
        done(0, &[(1.0, 0.25)]),
        done(1, &[(1.0, 0.75)]),
        measured(2, Outcome::Failed("lost".to_owned()), &[(1.0, 0.5)]),
        ended(3, Outcome::Interrupted),
    ];
    let table = build(
        &night(),
        &spec(
            TableValue::Metric("rmse".to_owned()),
            &["depth"],
            &["radius"],
        ),
        &results,
    );
    assert_eq!(table.columns, ["radius = 0.5", "radius = 1"]);
    let first = &table.rows[0].1[0];
    assert_eq!(
        (first.value, first.runs, first.interval.is_some()),
        (Some(0.5), 2, true)
    );
    assert_eq!(table.rows[0].1[1], TableCell::default());
    let markdown = table.to_text();
    assert!(
        markdown.contains("| 5     |            – |          – |"),
        "{markdown}"
    );
    assert!(
        markdown.contains("mean of 2 runs (over repeats).\n±: half-width")
            && markdown.contains("6 runs have\nnot finished"),
        "{markdown}"
    );
    assert_eq!(table.to_wide_csv().lines().nth(2), Some("5,,0,,,0,"));
}

#[test]
fn time_to_follows_the_direction_of_the_metric() {
    let waves = [(1.0, 0.5), (2.0, 0.2), (4.0, 0.05)];
    let results: Vec<_> = (0..8).map(|i| done(i, &waves)).collect();
    let time_to = |column: &str, threshold: f64| {
        let value = TableValue::TimeTo {
            column: column.to_owned(),
            threshold,
        };
        build(&night(), &spec(value, &[], &[]), &results)
    };
    let value_and_bound = |table: &Table| {
        let cell = &table.rows[0].1[0];
        (cell.value, cell.bound)
    };
    let table = time_to("rmse", 0.2);
    assert_eq!(
        table.rows[0].1[0],
        TableCell {
            value: Some(2.0),
            runs: 8,
            ..TableCell::default()
        }
    );
    assert!(table.caption.contains("≤ 0.2"), "{}", table.caption);
    // ssim is 1 - rmse / 2 here: 0.75, 0.9, 0.975
    // Two thirds of the way from 0.9 to 0.975, in logarithms of the time from 2 s to 4 s.
    let Some(between) = time_to("ssim", 0.95).rows[0].1[0].value else {
        panic!("a time was expected")
    };
    assert!(
        (between - 2.0 * 2f64.powf(2.0 / 3.0)).abs() < 1e-9,
        "{between}"
    );
    let at_once = time_to("rmse", 0.6);
    assert_eq!(value_and_bound(&at_once), (Some(1.0), Bound::Upper));
    assert!(
        at_once.to_text().contains("≤ 1 |") && at_once.caption.contains("`≤ t`"),
        "{}",
        at_once.to_text()
    );
    let never = time_to("ssim", 0.99);
    assert_eq!(value_and_bound(&never), (Some(4.0), Bound::Lower));
    assert!(never.to_text().contains("> 4 |"), "{}", never.to_text());
    assert!(
        never.caption.contains("≥ 0.99") && never.caption.contains("`> t`"),
        "{}",
        never.caption
    );
    assert_eq!(never.to_wide_csv().lines().nth(1), Some(",8"));
}

#[test]
fn of_runs_that_did_not_cross_the_threshold_the_median_is_shown() {
    let value = TableValue::TimeTo {
        column: "rmse".to_owned(),
        threshold: 0.1,
    };
    let results = [done(0, &[(1.0, 0.05)]), done(1, &[(3.0, 0.5)])];
    let table = build(&night(), &spec(value, &["depth"], &[]), &results);
    assert_eq!(
        table.rows[0].1[0],
        TableCell {
            value: Some(1.0),
            bound: Bound::Upper,
            runs: 2,
            ..TableCell::default()
        }
    );
}

#[test]
fn other_values_and_nan() {
    let results = [done(0, &[(1.0, 0.5), (4.0, f64::NAN)])];
    let value = |v: TableValue| build(&night(), &spec(v, &[], &[]), &results).rows[0].1[0].value;
    assert_eq!(value(TableValue::Run(RunColumn::Samples)), Some(2.0));
    assert_eq!(value(TableValue::Run(RunColumn::RenderS)), Some(4.0));
    assert_eq!(value(TableValue::Run(RunColumn::MpathsPerS)), Some(1.0));
    let Some(fps) = value(TableValue::Run(RunColumn::Fps)) else {
        panic!()
    };
    let Some(samples) = value(TableValue::Run(RunColumn::Samples)) else {
        panic!()
    };
    let Some(seconds) = value(TableValue::Run(RunColumn::RenderS)) else {
        panic!()
    };
    assert!((fps - samples / seconds).abs() < 1e-9 * fps, "{fps}");
    assert_eq!(value(TableValue::Run(RunColumn::MraysPerS)), Some(4.0));
    assert_eq!(value(TableValue::Run(RunColumn::AccelBuildS)), Some(0.25));
    assert_eq!(value(TableValue::Run(RunColumn::AccelNodes)), Some(100.0));
    assert_eq!(value(TableValue::Run(RunColumn::AccelMib)), Some(3.0));
    assert_eq!(value(TableValue::Run(RunColumn::AccelCost)), Some(12.5));
    assert!(matches!(value(TableValue::Metric("rmse".to_owned())), Some(x) if x.is_nan()));
    assert_eq!(value(TableValue::Metric("nothing".to_owned())), None);
}

#[test]
fn bars_in_names_do_not_break_the_table() {
    let plan = plan(&[("scene", texts(&["a|b"]))], 1);
    let table = build(
        &plan,
        &spec(TableValue::Run(RunColumn::Samples), &["scene"], &[]),
        &[done(0, &[(1.0, 0.5)])],
    );
    assert!(
        table
            .to_text()
            .ends_with("| a\\|b  |                 1 |\n"),
        "{}",
        table.to_text()
    );
}
