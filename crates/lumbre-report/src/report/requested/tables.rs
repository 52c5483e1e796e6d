//! Tables that a script requests: one number for each combination of row and column, averaged over
//! all other axes and repeats.

use super::caption::caption;
use crate::provenance::Provenance;
use crate::quantity::{self, RunValue};
use crate::report::study::{Member, Study};
use crate::table::ranking::Ranking;
use crate::table::{Digits, Table, TableCell, TableKind};
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::spec::TableSpec;

/// Computes the tables of a specification: one table, or one for each device if the value is a
/// time and the night used several devices. Runs that failed, were interrupted or never started are
/// left out; the caption reports their number.
pub fn tables(night: &Night, spec: &TableSpec) -> Vec<Table> {
    let study = Study::of_night(night, &spec.cols, &spec.rows);
    let mut devices = night.devices();
    if devices.len() < 2 || !spec.value.is_clock() {
        return vec![table(&study, spec, None)];
    }
    devices.sort();
    let of_device = |(i, device): (usize, &String)| {
        let table = table(&study, spec, Some(device));
        let mut rows = table.rows;
        rows.retain(|(_, cells)| cells.iter().any(|cell| cell.runs > 0));
        Table {
            name: format!("{}-device-{}", spec.name, i + 1),
            caption: format!("{} Only runs on {device}.", table.caption),
            rows,
            ..table
        }
    };
    devices.iter().enumerate().map(of_device).collect()
}

/// Computes a table of the runs on one device, or of all.
fn table(study: &Study, spec: &TableSpec, device: Option<&str>) -> Table {
    let is_shown = |m: &Member| device.is_none() || m.run.device.as_deref() == device;
    let row = |facet: usize| {
        let cell = |series: usize| {
            let mut finished = study.finished(facet, series);
            finished.retain(is_shown);
            average(study, spec, &finished)
        };
        let cells = (0..study.series.len()).map(cell).collect();
        (study.facet_values(facet), cells)
    };
    let rows: Vec<(Vec<String>, Vec<TableCell>)> = (0..study.facets.len()).map(row).collect();
    let column = |series: usize| {
        let values = study.series[series].values.iter();
        let pairs = spec.cols.iter().zip(values);
        let pairs = pairs.map(|(axis, value)| format!("{axis} = {}", study.name(value)));
        pairs.collect::<Vec<_>>().join(", ")
    };
    let columns: Vec<String> = if spec.cols.is_empty() {
        vec![quantity::label(&study.metrics, &spec.value)]
    } else {
        (0..study.series.len()).map(column).collect()
    };
    Table {
        name: spec.name.clone(),
        kind: TableKind::Other,
        section: String::new(),
        title: spec.name.clone(),
        caption: caption(study, spec, &rows),
        unit: String::new(),
        label_headers: spec.rows.clone(),
        groups: vec![(String::new(), columns.len())],
        columns,
        rows,
        digits: Digits::Significant(4),
        provenance: Provenance::from_members(study.all().filter(|m| m.run.is_done())),
    }
}

/// Averages the values of some runs. The mean has an interval only if all runs are repeats of one
/// configuration, since otherwise the interval has no meaning.
fn average<'a>(study: &Study, spec: &TableSpec, members: &'a [Member]) -> TableCell {
    let value = |m: &'a Member| Some((&m.run.point, study.run_value(&spec.value, m)?));
    let (points, values): (Vec<_>, Vec<RunValue>) = members.iter().filter_map(value).unzip();
    let mean = TableCell::mean(&values, Ranking::Unranked);
    let are_repeats = points.windows(2).all(|two| two[0] == two[1]);
    TableCell {
        interval: mean.interval.filter(|_| are_repeats),
        ..mean
    }
}
