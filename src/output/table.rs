//! Tables over axes: one number for each combination of row and column, averaged over everything else.

use std::collections::{BTreeMap, BTreeSet};

use super::devices::Devices;
use super::labels::{self, csv_line, exact, significant};
use super::quantity::{self, Sample};
use crate::experiment::plan::Plan;
use crate::experiment::spec::TableSpec;
use crate::experiment::{CellRef, CellResult, Outcome};
use crate::math::student::mean_and_interval;

/// Longest line of a Markdown caption in characters.
const CAPTION_WIDTH: usize = 100;

/// A computed table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableData {
    /// Its name, which is its file's.
    pub name: String,
    /// What the numbers are, with long names, units, and how many runs each one averages.
    pub caption: String,
    /// Names of the axes that make the rows: the headers of the label columns.
    pub row_axes: Vec<String>,
    /// Headers of the value columns.
    pub columns: Vec<String>,
    /// The rows, in the order of the plan.
    pub rows: Vec<TableRow>,
}

/// One row of a table.
#[derive(Clone, Debug, PartialEq)]
pub struct TableRow {
    /// Values of the row's axes.
    pub labels: Vec<String>,
    /// One cell for each value column.
    pub cells: Vec<TableCell>,
}

/// One number of a table and how many runs are behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TableCell {
    /// The number.
    pub entry: Entry,
    /// Finished runs that were averaged.
    pub runs: usize,
    /// Half the width of the 95 % confidence interval of the mean, by Student's t, where the runs are repeats of one
    /// another: of runs that differ in more, a mean has no such meaning.
    pub half: Option<f64>,
}

/// What stands in a cell of a table.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Entry {
    /// No finished run has this value.
    Empty,
    /// The mean over the runs.
    Mean(f64),
    /// At least one run never reached the threshold. The mean over the runs of the seconds that each took or spent:
    /// a lower bound of the mean time.
    MoreThan(f64),
}

/// Labels of a row and of a column.
type Place = (Vec<String>, Vec<String>);

/// The tables of a specification: one, or, of a clock's readings on several devices, one for each of them, since times of
/// different devices are not compared unasked.
pub fn tables(plan: &Plan, spec: &TableSpec, results: &[CellResult], devices: &Devices) -> Vec<TableData> {
    if !(devices.several() && spec.value.is_clock()) {
        return vec![build(plan, spec, results)];
    }
    let missing = unfinished(plan, results);
    let on = |(i, device): (usize, &str)| {
        let own = |r: &&CellResult| matches!(r.cell, CellRef::Cell(cell) if devices.of(cell) == device);
        let table = of_some(plan, spec, results.iter().filter(own), missing);
        let rows: Vec<TableRow> = table.rows.into_iter().filter(|row| row.cells.iter().any(|c| c.runs > 0)).collect();
        let name = format!("{}-device-{}", spec.name, i + 1);
        TableData { name, caption: format!("{} Only what was rendered on {device}.", table.caption), rows, ..table }
    };
    devices.all().into_iter().enumerate().map(on).collect()
}

/// Computes a table. Runs that failed, were interrupted or never reached are left out, and the caption says how many.
pub fn build(plan: &Plan, spec: &TableSpec, results: &[CellResult]) -> TableData {
    of_some(plan, spec, results.iter(), unfinished(plan, results))
}

/// Whether a result is one that tables show.
pub(super) fn is_finished(plan: &Plan, result: &CellResult) -> bool {
    let ours = |cell: usize| plan.cells.get(cell).is_some_and(|c| c.control.is_none());
    matches!(result.cell, CellRef::Cell(cell) if ours(cell))
        && matches!(result.outcome, Outcome::Done(_) | Outcome::Cached(_))
}

/// How many runs of a plan tables have to leave out.
fn unfinished(plan: &Plan, results: &[CellResult]) -> usize {
    let wanted = plan.cells.iter().filter(|cell| cell.control.is_none()).count();
    wanted.saturating_sub(results.iter().filter(|result| is_finished(plan, result)).count())
}

/// A table of some results of a night in which so many runs are missing.
fn of_some<'a>(
    plan: &Plan,
    spec: &TableSpec,
    results: impl Iterator<Item = &'a CellResult>,
    missing: usize,
) -> TableData {
    let keys = |axes: &[String], cell: usize| -> Vec<String> {
        let value = |axis: &String| labels::axis_value(plan, cell, axis).map_or("–".to_owned(), ToString::to_string);
        axes.iter().map(value).collect()
    };
    let distinct = |axes: &[String]| -> Vec<Vec<String>> {
        let mut seen = BTreeSet::new();
        (0..plan.cells.len()).map(|cell| keys(axes, cell)).filter(|key| seen.insert(key.clone())).collect()
    };
    let (row_keys, col_keys) = (distinct(&spec.rows), distinct(&spec.cols));

    let mut samples: BTreeMap<Place, Vec<(usize, Sample)>> = BTreeMap::new();
    for result in results.filter(|result| is_finished(plan, result)) {
        let CellRef::Cell(cell) = result.cell else { continue };
        if let Some(sample) = quantity::sample(plan, &spec.value, result) {
            samples.entry((keys(&spec.rows, cell), keys(&spec.cols, cell))).or_default().push((cell, sample));
        }
    }

    let row = |labels: &Vec<String>| {
        let cell =
            |col: &Vec<String>| average(plan, samples.get(&(labels.clone(), col.clone())).map_or(&[], Vec::as_slice));
        TableRow { labels: labels.clone(), cells: col_keys.iter().map(cell).collect() }
    };
    let rows: Vec<TableRow> = row_keys.iter().map(row).collect();
    let column = |values: &Vec<String>| {
        let pairs: Vec<String> = spec.cols.iter().zip(values).map(|(axis, v)| format!("{axis} = {v}")).collect();
        if pairs.is_empty() { quantity::label(plan, &spec.value) } else { pairs.join(", ") }
    };
    TableData {
        name: spec.name.clone(),
        caption: caption(plan, spec, &rows, missing),
        row_axes: spec.rows.clone(),
        columns: col_keys.iter().map(column).collect(),
        rows,
    }
}

fn average(plan: &Plan, samples: &[(usize, Sample)]) -> TableCell {
    let runs = samples.len();
    let values: Vec<f64> = samples.iter().map(|(_, Sample::Value(x) | Sample::NeverIn(x))| *x).collect();
    let mean = values.iter().sum::<f64>() / runs.max(1) as f64;
    let never = samples.iter().any(|(_, s)| matches!(s, Sample::NeverIn(_)));
    let alike = samples.windows(2).all(|two| plan.cells[two[0].0].point == plan.cells[two[1].0].point);
    let half = mean_and_interval(&values).1.filter(|half| alike && !never && half.is_finite());
    let entry = match (runs, never) {
        (0, _) => Entry::Empty,
        (_, true) => Entry::MoreThan(mean),
        (_, false) => Entry::Mean(mean),
    };
    TableCell { entry, runs, half }
}

fn caption(plan: &Plan, spec: &TableSpec, rows: &[TableRow], unfinished: usize) -> String {
    let mut sentences = vec![format!("{}, {}.", quantity::title(plan, &spec.value), averaged(plan, spec, rows))];
    let entries = || rows.iter().flat_map(|r| &r.cells).map(|c| c.entry);
    if rows.iter().flat_map(|r| &r.cells).any(|c| c.half.is_some()) {
        sentences.push("±: half the 95 % confidence interval of the mean over repeats, by Student's t.".to_owned());
    }
    if entries().any(|e| matches!(e, Entry::MoreThan(_))) {
        sentences.push("`> t`: not reached within t seconds.".to_owned());
    }
    if unfinished > 0 {
        sentences.push(match unfinished {
            1 => "1 run has not finished and is left out.".to_owned(),
            n => format!("{n} runs have not finished and are left out."),
        });
    }
    sentences.extend(plan.absent().iter().map(|(reason, count)| match count {
        1 => format!("1 point is left out: {reason}."),
        _ => format!("{count} points are left out: {reason}."),
    }));
    sentences.extend(long_names(plan, spec));
    sentences.join(" ")
}

/// `mean of 4 runs (over radius, repeats)`.
fn averaged(plan: &Plan, spec: &TableSpec, rows: &[TableRow]) -> String {
    let runs = || rows.iter().flat_map(|r| &r.cells).map(|c| c.runs).filter(|n| *n > 0);
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let varies = |axis: &&String| {
        let values = (0..plan.cells.len()).map(|cell| labels::axis_value(plan, cell, axis).map(ToString::to_string));
        values.collect::<BTreeSet<_>>().len() > 1
    };
    let shown = |axis: &&String| spec.rows.contains(axis) || spec.cols.contains(axis);
    let mut over: Vec<&str> = plan.axes.iter().filter(|a| !shown(a)).filter(varies).map(String::as_str).collect();
    if plan.cells.iter().any(|c| c.repeat > 0) {
        over.push("repeats");
    }
    let over = if over.is_empty() || most < 2 { String::new() } else { format!(" (over {})", over.join(", ")) };
    match (least, most) {
        (_, 0) => "no finished run yet".to_owned(),
        (_, 1) => "one run each".to_owned(),
        _ if least == most => format!("mean of {most} runs{over}"),
        _ => format!("mean of {least} to {most} runs{over}"),
    }
}

/// `bpt: backward path tracing.` for every integrator that the table's labels name.
fn long_names(plan: &Plan, spec: &TableSpec) -> Option<String> {
    let axis = spec.rows.iter().chain(&spec.cols).find(|axis| labels::is_integrator_axis(plan, axis))?;
    let mut seen = BTreeSet::new();
    let values = (0..plan.cells.len()).filter_map(|cell| labels::axis_value(plan, cell, axis)?.as_str());
    let named = values
        .filter(|name| seen.insert(*name))
        .filter_map(|name| labels::integrator_long_name(name).map(|long| format!("{name}: {long}")));
    let named: Vec<String> = named.collect();
    (!named.is_empty()).then(|| named.join("; ") + ".")
}

impl TableData {
    /// Markdown with the caption above, padded so that it also reads well where it is not rendered. Four significant
    /// digits; an en dash stands where there is no value, `> t` where a threshold was not reached in t seconds.
    pub fn to_markdown(&self) -> String {
        let escaped = |s: &String| s.replace('|', "\\|").replace(['\n', '\r'], " ");
        let header: Vec<String> = self.row_axes.iter().chain(&self.columns).map(escaped).collect();
        let body = self.rows.iter().map(|row| {
            let numbers = row.cells.iter().map(markdown_entry);
            row.labels.iter().map(escaped).chain(numbers).collect::<Vec<_>>()
        });
        let body: Vec<Vec<String>> = body.collect();
        let width = |i: usize| {
            let texts = std::iter::once(&header).chain(&body).filter_map(|row| row.get(i));
            texts.map(|s| s.chars().count()).max().unwrap_or(0).max(3)
        };
        let widths: Vec<usize> = (0..header.len()).map(width).collect();
        let labels = self.row_axes.len();
        let line = |row: &Vec<String>| {
            let cell = |(i, text): (usize, &String)| {
                let pad = " ".repeat(widths[i].saturating_sub(text.chars().count()));
                if i < labels { format!(" {text}{pad} ") } else { format!(" {pad}{text} ") }
            };
            format!("|{}|\n", row.iter().enumerate().map(cell).collect::<Vec<_>>().join("|"))
        };
        let rule = |(i, w): (usize, &usize)| {
            if i < labels { "-".repeat(w + 2) } else { format!("{}:", "-".repeat(w + 1)) }
        };
        let rule: Vec<String> = widths.iter().enumerate().map(rule).collect();
        let table: String = body.iter().map(line).collect();
        let caption = wrap(&format!("{}: {}", self.name, self.caption), CAPTION_WIDTH);
        format!("{caption}\n\n{}|{}|\n{table}", line(&header), rule.join("|"))
    }

    /// Comma-separated values in full precision: the label columns, then for each value column the value and the number
    /// of runs behind it; where any is a mean of repeats, also half the width of its 95 % confidence interval. What has no
    /// value, or was never reached, is empty.
    pub fn to_csv(&self) -> String {
        let intervals = self.rows.iter().flat_map(|r| &r.cells).any(|c| c.half.is_some());
        let fields = |parts: [String; 3]| parts.into_iter().take(if intervals { 3 } else { 2 });
        let mut header = self.row_axes.clone();
        let named = self.columns.iter().map(|c| [c.clone(), format!("runs: {c}"), format!("±95 %: {c}")]);
        header.extend(named.flat_map(fields));
        let mut text = csv_line(&header);
        for row in &self.rows {
            let mut line = row.labels.clone();
            line.extend(row.cells.iter().flat_map(|cell| {
                let value = if let Entry::Mean(x) = cell.entry { exact(x) } else { String::new() };
                fields([value, cell.runs.to_string(), cell.half.map(exact).unwrap_or_default()])
            }));
            text += &csv_line(&line);
        }
        text
    }
}

fn markdown_entry(cell: &TableCell) -> String {
    let number = |x: f64| if x.fract() == 0.0 && x.abs() < 1e9 { x.to_string() } else { significant(x, 4) };
    match cell.entry {
        Entry::Empty => "–".to_owned(),
        Entry::Mean(x) => match cell.half {
            Some(half) => format!("{} ± {}", number(x), significant(half, 2)),
            None => number(x),
        },
        Entry::MoreThan(x) => format!("> {}", number(x)),
    }
}

/// Breaks text at spaces into lines of at most `width` characters where words allow.
fn wrap(text: &str, width: usize) -> String {
    let mut lines: Vec<String> = vec![String::new()];
    for word in text.split(' ') {
        let last = lines.len() - 1;
        if lines[last].is_empty() {
            lines[last] += word;
        } else if lines[last].chars().count() + 1 + word.chars().count() <= width {
            lines[last] += " ";
            lines[last] += word;
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::super::fixture::{done, ended, numbers, plan, words};
    use super::*;
    use crate::experiment::spec::TableValue;

    fn spec(value: TableValue, rows: &[&str], cols: &[&str]) -> TableSpec {
        let owned = |names: &[&str]| names.iter().map(|n| (*n).to_owned()).collect();
        TableSpec { name: "table".to_owned(), value, rows: owned(rows), cols: owned(cols), formats: Vec::new() }
    }

    fn night() -> Plan {
        plan(&[("technique", words(&["bpt"])), ("depth", numbers(&[3.0, 5.0])), ("radius", numbers(&[0.5, 1.0]))], 2)
    }

    #[test]
    fn other_axes_and_repeats_are_averaged_and_counted() {
        let errors = [0.1, 0.2, 0.3, 0.4, 0.01, 0.02, 0.03, 0.04];
        let results: Vec<_> = errors.iter().enumerate().map(|(i, e)| done(i, &[(1.0, 0.9), (2.0, *e)])).collect();
        let table = build(&night(), &spec(TableValue::Metric("rmse".to_owned()), &["depth"], &["technique"]), &results);
        assert_eq!(
            table.to_markdown(),
            "table: RMSE (root mean square error) in radiance after the last wave, mean of 4 runs (over radius,\n\
             repeats). bpt: backward path tracing.\n\
             \n\
             | depth | technique = bpt |\n\
             |-------|----------------:|\n\
             | 3     |          0.2500 |\n\
             | 5     |         0.02500 |\n"
        );
        assert_eq!(table.to_csv(), "depth,technique = bpt,runs: technique = bpt\n3,0.25,4\n5,0.025,4\n");
    }

    #[test]
    fn clocks_of_several_devices_have_tables_of_their_own() {
        let plan = night();
        let results: Vec<_> = (0..7).map(|i| done(i, &[(1.0 + i as f64, 0.5)])).collect();
        let name = |r: &CellResult| match r.cell {
            CellRef::Cell(i) => Some(if i < 4 { "a lens" } else { "a prism" }.to_owned()),
            CellRef::Reference(_) => None,
        };
        let devices = Devices::new(&plan, &results, name);
        let both = tables(&plan, &spec(TableValue::RenderS, &["depth"], &[]), &results, &devices);
        let names: Vec<&str> = both.iter().map(|table| table.name.as_str()).collect();
        assert_eq!(names, ["table-device-1", "table-device-2"]);
        assert_eq!(both[0].to_csv().lines().skip(1).collect::<Vec<_>>(), ["3,2.5,4"]);
        assert_eq!(both[1].to_csv().lines().skip(1).collect::<Vec<_>>(), ["5,6,3"]);
        assert!(both[1].caption.ends_with("Only what was rendered on a prism."), "{}", both[1].caption);
        assert!(both[1].caption.contains("1 of 8") || both[1].caption.contains("1 run"), "{}", both[1].caption);
        // Errors are the same wherever they were computed.
        let errors = spec(TableValue::Metric("rmse".to_owned()), &["depth"], &[]);
        assert_eq!(tables(&plan, &errors, &results, &devices), [build(&plan, &errors, &results)]);
    }

    #[test]
    fn means_of_repeats_have_an_interval_and_doubles_of_the_control_are_left_out() {
        let mut plan = plan(&[("depth", numbers(&[3.0, 5.0]))], 3);
        let errors = [1.0, 2.0, 3.0, 0.5];
        let results: Vec<_> = errors.iter().enumerate().map(|(i, e)| done(i, &[(1.0, *e)])).collect();
        let spec = spec(TableValue::Metric("rmse".to_owned()), &["depth"], &[]);
        let table = build(&plan, &spec, &results);
        // Standard deviation 1, three values, t = 4.30265.
        let half = table.rows[0].cells[0].half.unwrap();
        assert!((half - 4.302_652_73 / 3f64.sqrt()).abs() < 1e-6, "{half}");
        assert_eq!(table.rows[1].cells[0].half, None, "one run");
        assert!(table.to_markdown().contains("| 3     |         2 ± 2.5 |"), "{}", table.to_markdown());
        assert!(
            table
                .to_csv()
                .starts_with("depth,RMSE (radiance),runs: RMSE (radiance),±95 %: RMSE (radiance)\n3,2,3,2.48")
        );
        plan.cells[2].control = Some(0);
        let table = build(&plan, &spec, &results);
        assert_eq!((table.rows[0].cells[0].runs, table.rows[0].cells[0].entry), (2, Entry::Mean(1.5)));
        assert!(table.caption.contains("2 runs have not finished"), "{}", table.caption);
    }

    #[test]
    fn gaps_show_as_dashes_and_unfinished_runs_are_left_out() {
        let mut broken = done(2, &[(1.0, 0.5)]);
        broken.outcome = Outcome::Failed("lost".to_owned());
        let results = [done(0, &[(1.0, 0.25)]), done(1, &[(1.0, 0.75)]), broken, ended(3, Outcome::Interrupted)];
        let table = build(&night(), &spec(TableValue::Metric("rmse".to_owned()), &["depth"], &["radius"]), &results);
        assert_eq!(table.columns, ["radius = 0.5", "radius = 1"]);
        let first = table.rows[0].cells[0];
        assert_eq!((first.entry, first.runs, first.half.is_some()), (Entry::Mean(0.5), 2, true));
        assert_eq!(table.rows[0].cells[1], TableCell { entry: Entry::Empty, runs: 0, half: None });
        let markdown = table.to_markdown();
        assert!(markdown.contains("| 5     |            – |          – |"), "{markdown}");
        assert!(
            markdown.contains("mean of 2 runs (over repeats).\n±: half")
                && markdown.contains("6 runs have not\nfinished"),
            "{markdown}"
        );
        assert_eq!(table.to_csv().lines().nth(2), Some("5,,0,,,0,"));
    }

    #[test]
    fn time_to_follows_the_direction_of_the_metric() {
        let waves = [(1.0, 0.5), (2.0, 0.2), (4.0, 0.05)];
        let results: Vec<_> = (0..8).map(|i| done(i, &waves)).collect();
        let time_to = |column: &str, threshold: f64| {
            let value = TableValue::TimeTo { column: column.to_owned(), threshold };
            build(&night(), &spec(value, &[], &[]), &results)
        };
        let table = time_to("rmse", 0.2);
        assert_eq!(table.rows[0].cells[0], TableCell { entry: Entry::Mean(2.0), runs: 8, half: None });
        assert!(table.caption.contains("≤ 0.2"), "{}", table.caption);
        // ssim is 1 - rmse / 2 here: 0.75, 0.9, 0.975
        assert_eq!(time_to("ssim", 0.95).rows[0].cells[0].entry, Entry::Mean(4.0));
        let never = time_to("ssim", 0.99);
        assert_eq!(never.rows[0].cells[0].entry, Entry::MoreThan(4.0));
        assert!(never.to_markdown().contains("> 4 |"), "{}", never.to_markdown());
        assert!(never.caption.contains("≥ 0.99") && never.caption.contains("`> t`"), "{}", never.caption);
        assert_eq!(never.to_csv().lines().nth(1), Some(",8"));
    }

    #[test]
    fn a_mean_with_a_run_that_never_arrived_is_a_lower_bound() {
        let value = TableValue::TimeTo { column: "rmse".to_owned(), threshold: 0.1 };
        let results = [done(0, &[(1.0, 0.05)]), done(1, &[(3.0, 0.5)])];
        let table = build(&night(), &spec(value, &["depth"], &[]), &results);
        assert_eq!(table.rows[0].cells[0], TableCell { entry: Entry::MoreThan(2.0), runs: 2, half: None });
    }

    #[test]
    fn other_values_and_nan() {
        let results = [done(0, &[(1.0, 0.5), (4.0, f64::NAN)])];
        let value = |v: TableValue| build(&night(), &spec(v, &[], &[]), &results).rows[0].cells[0].entry;
        assert_eq!(value(TableValue::Samples), Entry::Mean(2.0));
        assert_eq!(value(TableValue::RenderS), Entry::Mean(4.0));
        assert_eq!(value(TableValue::MpathsPerS), Entry::Mean(1.0));
        let Entry::Mean(fps) = value(TableValue::Fps) else { panic!() };
        let Entry::Mean(samples) = value(TableValue::Samples) else { panic!() };
        let Entry::Mean(seconds) = value(TableValue::RenderS) else { panic!() };
        assert!((fps - samples / seconds).abs() < 1e-9 * fps, "{fps}");
        assert_eq!(value(TableValue::MraysPerS), Entry::Mean(4.0));
        assert_eq!(value(TableValue::AccelBuildS), Entry::Mean(0.25));
        assert_eq!(value(TableValue::AccelNodes), Entry::Mean(100.0));
        assert_eq!(value(TableValue::AccelMib), Entry::Mean(3.0));
        assert_eq!(value(TableValue::AccelCost), Entry::Mean(12.5));
        assert!(matches!(value(TableValue::Metric("rmse".to_owned())), Entry::Mean(x) if x.is_nan()));
        assert_eq!(value(TableValue::Metric("nothing".to_owned())), Entry::Empty);
    }

    #[test]
    fn bars_in_names_do_not_break_the_table() {
        let plan = plan(&[("scene", words(&["a|b"]))], 1);
        let table = build(&plan, &spec(TableValue::Samples, &["scene"], &[]), &[done(0, &[(1.0, 0.5)])]);
        assert!(table.to_markdown().ends_with("| a\\|b  |                 1 |\n"), "{}", table.to_markdown());
    }
}
