//! Exports all measurements as tidy CSV: one observation per line, one variable per column, units
//! in the column names.

use super::item::ReportItem;
use super::study::{Member, Study};
use crate::format::exact;
use crate::provenance::Provenance;
use lumbre_night::columns::{
    Column, DATA_ACCEL, DATA_AFTER, DATA_BEFORE, DATA_COLUMNS, DATA_COUNTS, DATA_STATE, DATA_WAVE,
    names,
};
use lumbre_night::text::csv_line;
use lumbre_night::text::program;

/// Builds `data/runs.csv` with one line for each run, `data/waves.csv` with one line for each
/// measurement of each run, and `data/columns.csv` with meaning and unit of every column.
///
/// The first two begin with the same columns: program, night, plan, run, the axes (`axis.<name>`),
/// repeat, seed, integrator, scene and device.
pub fn all(study: &Study) -> Vec<ReportItem> {
    let axes = study.axes();
    let provenance = Provenance::from_members(study.all());
    let item = |stem: &str, title: &str, caption: &str, csv: String| {
        let files = vec![("csv", csv.into_bytes())];
        ReportItem::data(stem, title, caption.to_owned(), files, provenance.clone())
    };
    vec![
        item(
            "data/runs",
            "All runs",
            "One line for each run of every plan, finished or not.",
            runs(study, &axes),
        ),
        item(
            "data/waves",
            "All measurements",
            "One line for each measurement of each run.",
            waves(study, &axes),
        ),
        item(
            "data/columns",
            "Columns of the data",
            "Meaning and unit of every column.",
            columns(study, &axes),
        ),
    ]
}

fn header(axes: &[String], rest: &[String]) -> String {
    let mut header = names(&DATA_BEFORE).to_vec();
    header.extend(axes.iter().map(|axis| format!("axis.{axis}")));
    header.extend(names(&DATA_AFTER));
    header.extend_from_slice(rest);
    csv_line(&header)
}

fn keys(m: &Member, axes: &[String]) -> Vec<String> {
    let mut fields = vec![
        program().to_owned(),
        m.night.plan.name.clone(),
        m.night.plan.hash.clone(),
        m.run.id.clone(),
    ];
    fields.extend(
        axes.iter()
            .map(|axis| m.run.axis_value(axis).unwrap_or_default()),
    );
    fields.extend([
        m.run.repeat.to_string(),
        m.run.seed.to_string(),
        m.run.integrator.clone(),
        m.run.scene.clone(),
    ]);
    fields.push(m.run.device.clone().unwrap_or_default());
    fields
}

fn values(m: &Member, row: &lumbre_night::experiment::WaveRow, metrics: usize) -> Vec<String> {
    let mut fields = vec![
        row.samples.to_string(),
        exact(row.render_s),
        exact(row.wall_s),
    ];
    fields.extend([row.paths.to_string(), row.rays.to_string()]);
    fields.extend((0..metrics).map(|i| m.value(row, i).map(exact).unwrap_or_default()));
    fields
}

fn metric_names(study: &Study) -> impl Iterator<Item = String> {
    study.metrics.iter().map(|m| format!("metric.{}", m.column))
}

fn runs(study: &Study, axes: &[String]) -> String {
    let mut rest = names(&DATA_STATE).to_vec();
    rest.extend(names(&DATA_COUNTS));
    rest.extend(metric_names(study));
    rest.extend(names(&DATA_ACCEL));
    let mut text = header(axes, &rest);
    for m in study.all() {
        let mut fields = keys(&m, axes);
        fields.extend([m.run.state.name(), m.run.end_clause()].map(str::to_owned));
        match m.run.rows.last() {
            Some(row) => fields.extend(values(&m, row, study.metrics.len())),
            None => fields.resize(
                fields.len() + DATA_COUNTS.len() + study.metrics.len(),
                String::new(),
            ),
        }
        fields.push(m.run.lanes.map(|n| n.to_string()).unwrap_or_default());
        let accel = m.run.open.as_ref().map(|open| {
            [
                exact(open.accel_build_s),
                open.accel_nodes.to_string(),
                open.accel_bytes.to_string(),
                exact(open.accel_cost),
            ]
        });
        fields.extend(accel.unwrap_or_default());
        text += &csv_line(&fields);
    }
    text
}

fn waves(study: &Study, axes: &[String]) -> String {
    let mut rest = names(&DATA_WAVE).to_vec();
    rest.extend(names(&DATA_COUNTS));
    rest.extend(metric_names(study));
    let mut text = header(axes, &rest);
    for m in study.all() {
        let own = keys(&m, axes);
        for row in m.run.rows.iter() {
            let mut fields = own.clone();
            fields.push(row.wave.to_string());
            fields.extend(values(&m, row, study.metrics.len()));
            text += &csv_line(&fields);
        }
    }
    text
}

/// Returns the lines of `columns.csv` that describe columns.
fn describe<'a>(columns: impl IntoIterator<Item = &'a Column>) -> String {
    let line = |column: &Column| csv_line(&[column.name, column.unit, column.doc]);
    columns.into_iter().map(line).collect()
}

fn columns(study: &Study, axes: &[String]) -> String {
    let mut text = csv_line(&names(&DATA_COLUMNS)) + &describe(&DATA_BEFORE);
    for axis in axes {
        let name = format!("axis.{axis}");
        text += &csv_line(&[name.as_str(), "", "value of the axis of the sweep"]);
    }
    let of_runs: [&[Column]; 4] = [&DATA_AFTER, &DATA_STATE, &DATA_WAVE, &DATA_COUNTS];
    text += &describe(of_runs.concat().iter());
    for metric in &study.metrics {
        let options = metric.describe_options();
        let options = if options.is_empty() {
            String::new()
        } else {
            format!(" with {options}")
        };
        text += &csv_line(&[
            format!("metric.{}", metric.column),
            metric.unit(),
            format!("{}{options}", metric.row.doc),
        ]);
    }
    text + &describe(&DATA_ACCEL)
}
