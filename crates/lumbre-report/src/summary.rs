//! Writes `summary.csv`, `repeats.csv` and `aa-check.csv`, the tables of results of a night.

use super::format::exact;
use lumbre_light::math::t_test::mean_and_interval;
use lumbre_metrics::floor::Floor;
use lumbre_night::columns::{
    AA_CHECK, CONTROL_OF, REPEATED, REPEATED_MEANS, RUN_IDS, SUMMARY_AFTER, SUMMARY_BEFORE, names,
};
use lumbre_night::experiment::aa_check::Finding;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::noise_floor::net_columns;
use lumbre_night::experiment::plan::Plan;
use lumbre_night::experiment::{Night, Outcome, Point, WaveRow};
use lumbre_night::text::csv_line;

/// Metrics with additional columns in `summary.csv`, as indices into the plan's metrics.
struct ReferenceNoise {
    /// Metrics with a known noise floor of the reference (`<column>_floor`).
    floor: Vec<usize>,
    /// Metrics from which the error of the reference can be subtracted (`<column>_net`).
    net: Vec<usize>,
}

impl ReferenceNoise {
    fn new(plan: &Plan, night: &Night) -> ReferenceNoise {
        let metrics = plan.measure.metrics.iter();
        let known =
            metrics.map(|metric| night.runs.iter().find_map(|run| run.floor(&metric.column)));
        let known: Vec<Option<Floor>> = known.collect();
        ReferenceNoise {
            floor: (0..known.len()).filter(|i| known[*i].is_some()).collect(),
            net: net_columns(plan, &known)
                .into_iter()
                .map(|(i, _)| i)
                .collect(),
        }
    }
}

/// Writes `summary.csv`: one line for each cell, in plan order, whether it finished or not. The
/// [schema](lumbre_night::columns) has the columns. Values that were not measured are empty.
pub fn csv(plan: &Plan, night: &Night) -> String {
    let noise = ReferenceNoise::new(plan, night);
    let mut text = csv_line(&header(plan, &noise));
    for (index, run) in night.runs.iter().enumerate() {
        let mut fields = vec![index.to_string(), run.id.clone()];
        fields.extend(identity_fields(plan, run));
        fields.extend(status_fields(run.state.outcome()));
        fields.extend(measured_fields(plan, run, &noise));
        text += &csv_line(&fields);
    }
    text
}

/// Returns the axis values, the repeat and, with an A/A check, the repeat that the run duplicates.
fn identity_fields(plan: &Plan, run: &Run) -> Vec<String> {
    let axis_value = |axis: &String| run.axis_value(axis).unwrap_or_default();
    let mut fields: Vec<String> = plan.axes.iter().map(axis_value).collect();
    fields.push(run.repeat.to_string());
    if has_doubles(plan) {
        fields.push(run.double_of.map(|r| r.to_string()).unwrap_or_default());
    }
    fields
}

/// Returns the status of a cell and its reason.
fn status_fields(outcome: Option<&Outcome>) -> [String; 2] {
    let (status, reason) = match outcome {
        Some(Outcome::Done(cause)) => ("done", cause.clause.clone()),
        Some(Outcome::Cached(folder)) => ("cached", folder.display().to_string()),
        Some(Outcome::Failed(reason)) => ("failed", reason.clone()),
        Some(Outcome::Interrupted) => ("interrupted", String::new()),
        None => ("not reached", String::new()),
    };
    [status.to_owned(), reason]
}

/// Returns the values of the last wave; empty fields if nothing was measured.
fn measured_fields(plan: &Plan, run: &Run, noise: &ReferenceNoise) -> Vec<String> {
    let metrics = &plan.measure.metrics;
    let ended = run.state.outcome();
    let Some(row) = ended.and_then(|_| run.rows.last()) else {
        let count = 5 + metrics.len() + noise.floor.len() + noise.net.len();
        return vec![String::new(); count];
    };
    let optional = |x: Option<f64>| x.map(exact).unwrap_or_default();
    let mut fields = vec![row.samples.to_string()];
    fields.extend([row.render_s, row.wall_s, row.mpaths_per_s()].map(exact));
    fields.push(row.invalid.to_string());
    fields.extend((0..metrics.len()).map(|m| optional(row.metrics.get(m).copied())));
    let floor = |m: usize| run.floor(&metrics[m].column);
    fields.extend(
        noise
            .floor
            .iter()
            .map(|m| optional(floor(*m).map(|f| f.value))),
    );
    let net = |m: usize| metrics[m].net(*row.metrics.get(m)?, floor(m)?.value);
    fields.extend(noise.net.iter().map(|m| optional(net(*m))));
    fields
}

/// Returns whether any cell is a duplicate run of the A/A check.
fn has_doubles(plan: &Plan) -> bool {
    plan.cells.iter().any(|cell| cell.double_of.is_some())
}

fn header(plan: &Plan, noise: &ReferenceNoise) -> Vec<String> {
    let (before, after) = (names(&SUMMARY_BEFORE), names(&SUMMARY_AFTER));
    let mut header = before.to_vec();
    let taken = |name: &String| before.contains(name) || after.contains(name);
    header.extend(plan.axes.iter().map(|a| {
        if taken(a) {
            format!("axis.{a}")
        } else {
            a.clone()
        }
    }));
    header.extend(after.clone());
    if has_doubles(plan) {
        let status = header
            .iter()
            .position(|name| name == "status")
            .unwrap_or(header.len());
        header.insert(status, CONTROL_OF.name.to_owned());
    }
    for metric in &plan.measure.metrics {
        let column = &metric.column;
        let name = if header.contains(column) {
            format!("metric.{column}")
        } else {
            column.clone()
        };
        header.push(name);
    }
    for (metrics, suffix) in [(&noise.floor, "floor"), (&noise.net, "net")] {
        for metric in metrics.iter().map(|i| &plan.measure.metrics[*i]) {
            let name = format!("{}_{suffix}", metric.column);
            header.push(if header.contains(&name) {
                format!("{suffix}.{name}")
            } else {
                name
            });
        }
    }
    header
}

/// Writes `repeats.csv`: for each point of the sweep, means over its finished repeats. Returns an
/// empty text if no cell was repeated.
///
/// The means are those of samples per pixel, render time, speed and the final value of every
/// metric. Each has the bounds of its 95 % confidence interval by Student's t (`<column>_low`,
/// `<column>_high`; empty for a single run).
pub fn repeats_csv(night: &Night) -> String {
    let mut points: Vec<(&Point, Vec<(&Run, &WaveRow)>)> = Vec::new();
    for run in &night.runs {
        if points.last().is_none_or(|(point, _)| **point != run.point) {
            points.push((&run.point, Vec::new()));
        }
        let row = run.rows.last().filter(|_| run.is_done());
        if let (Some(row), Some((_, rows))) = (row, points.last_mut()) {
            rows.push((run, row));
        }
    }
    if points.iter().all(|(_, rows)| rows.len() < 2) {
        return String::new();
    }
    let mut header: Vec<String> = night.plan.axes.clone();
    header.push(REPEATED.name.to_owned());
    let columns = night
        .plan
        .metrics
        .iter()
        .map(|metric| metric.column.clone());
    for column in names(&REPEATED_MEANS).into_iter().chain(columns) {
        header.extend(["", "_low", "_high"].map(|end| format!("{column}{end}")));
    }
    header.push(RUN_IDS.name.to_owned());
    let mut text = csv_line(&header);
    for (point, rows) in &points {
        let mut fields: Vec<String> = point.iter().map(|(_, value)| value.to_string()).collect();
        fields.push(rows.len().to_string());
        let rows_alone = || rows.iter().map(|(_, row)| *row);
        let numbers = |row: &WaveRow| [row.samples as f64, row.render_s, row.mpaths_per_s()];
        let counts = (0..3).map(|i| {
            rows_alone()
                .map(|row| numbers(row)[i])
                .collect::<Vec<f64>>()
        });
        let metrics = (0..night.plan.metrics.len()).map(|i| {
            rows_alone()
                .filter_map(|row| row.metrics.get(i).copied())
                .collect::<Vec<f64>>()
        });
        for values in counts.chain(metrics) {
            fields.extend(mean_fields(&values));
        }
        let ids: Vec<&str> = rows.iter().map(|(run, _)| run.id.as_str()).collect();
        fields.push(ids.join(" "));
        text += &csv_line(&fields);
    }
    text
}

/// Returns the mean of values and the bounds of its 95 % confidence interval.
fn mean_fields(values: &[f64]) -> [String; 3] {
    if values.is_empty() {
        return Default::default();
    }
    let (mean, half) = mean_and_interval(values);
    let bound = |sign: f64| {
        half.map(|half| exact(mean + sign * half))
            .unwrap_or_default()
    };
    [exact(mean), bound(-1.0), bound(1.0)]
}

/// Writes `aa-check.csv`: one line for each [`Finding`] of the A/A check.
pub fn aa_check_csv(findings: &[Finding]) -> String {
    let mut text = csv_line(&names(&AA_CHECK));
    for finding in findings {
        let optional = |x: Option<f64>| x.map(exact).unwrap_or_default();
        text += &csv_line(&[
            finding.technique.clone(),
            finding.measure.clone(),
            finding.pairs.to_string(),
            exact(finding.ratio),
            optional(finding.interval.map(|i| i[0])),
            optional(finding.interval.map(|i| i[1])),
            optional(finding.p),
            optional(finding.single),
            finding.alarm.to_string(),
        ]);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::super::fixture;
    use super::*;
    use lumbre_night::experiment::Event;

    fn repeats_csv(plan: &Plan, events: &[Event]) -> String {
        super::repeats_csv(&fixture::night(plan, events).without_doubles())
    }

    fn csv(plan: &Plan, events: &[Event]) -> String {
        super::csv(plan, &fixture::night(plan, events))
    }

    #[test]
    fn every_cell_has_a_line() {
        let plan = fixture::plan(
            &[
                ("scene", fixture::texts(&["a, b", "c"])),
                ("depth", fixture::numbers(&[2.0, 5.0])),
            ],
            1,
        );
        let failed = Outcome::Failed("device said \"no\"".to_owned());
        let partial = fixture::measured(2, failed, &[(0.5, f64::NAN)]);
        let results = [
            fixture::done(0, &[(0.5, 0.25), (1.0, 0.125)]),
            fixture::ended(1, Outcome::Cached("runs/x".into())),
            partial,
        ];
        assert_eq!(
            csv(&plan, &results),
            "cell,run,scene,depth,repeat,status,reason,samples_per_pixel,render_s,wall_s,mpaths_per_s,invalid_samples,rmse,ssim,psnr\n\
             0,run00,\"a, b\",2,0,done,64 samples,2,1,1.5,4,0,0.125,0.9375,35\n\
             1,run01,\"a, b\",5,0,cached,runs/x,,,,,,,,\n\
             2,run02,c,2,0,failed,\"device said \"\"no\"\"\",1,0.5,0.75,4,0,nan,nan,nan\n\
             3,run03,c,5,0,not reached,,,,,,,,,\n"
        );
    }

    #[test]
    fn repeats_have_their_mean_and_interval() {
        let mut plan = fixture::plan(&[("depth", fixture::numbers(&[2.0, 5.0]))], 3);
        plan.measure.metrics.truncate(1);
        let results: Vec<_> = [1.0, 2.0, 3.0, 0.5]
            .iter()
            .enumerate()
            .map(|(i, e)| fixture::done(i, &[(1.0, *e)]))
            .collect();
        let text = repeats_csv(&plan, &results);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(
            lines[0][..5],
            [
                "depth",
                "runs",
                "samples_per_pixel",
                "samples_per_pixel_low",
                "samples_per_pixel_high"
            ]
        );
        assert_eq!(lines[0][11..], ["rmse", "rmse_low", "rmse_high", "run_ids"]);
        assert_eq!(lines[1][14], "run00 run01 run02");
        let half = 4.302_652_73 / 3f64.sqrt();
        let [mean, low, high] = [11, 12, 13].map(|i: usize| lines[1][i].parse::<f64>().unwrap());
        assert!(mean == 2.0 && (low - 2.0 + half).abs() < 1e-6 && (high - 2.0 - half).abs() < 1e-6);
        assert_eq!(lines[2][11..14], ["0.5", "", ""], "one run has no interval");
        assert_eq!(repeats_csv(&plan, &results[..1]), "", "nothing is repeated");
        plan.cells[1].double_of = Some(0);
        assert_eq!(
            repeats_csv(&plan, &results).lines().nth(1).unwrap()[..4],
            *"2,2,"
        );
        assert!(csv(&plan, &results).starts_with("cell,run,depth,repeat,control_of,status,"));
        assert!(
            csv(&plan, &results)
                .lines()
                .nth(2)
                .unwrap()
                .starts_with("1,run01,2,1,0,done,")
        );
    }

    #[test]
    fn names_that_clash_are_prefixed() {
        let mut plan = fixture::plan(
            &[
                ("repeat", fixture::numbers(&[1.0])),
                ("rmse", fixture::numbers(&[1.0])),
            ],
            1,
        );
        plan.measure.metrics.truncate(1);
        let text = csv(&plan, &[]);
        let header: Vec<&str> = text.lines().next().unwrap().split(',').collect();
        assert_eq!(header[2..5], ["axis.repeat", "rmse", "repeat"]);
        assert_eq!(header.last(), Some(&"metric.rmse"));
    }

    #[test]
    fn a_plan_without_cells_is_a_header() {
        let mut plan = fixture::plan(&[("depth", fixture::numbers(&[2.0]))], 1);
        plan.cells.clear();
        assert_eq!(csv(&plan, &[]).lines().count(), 1);
    }
}
