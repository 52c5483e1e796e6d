//! Tables of sampling rates and acceleration structures.

use super::{empty_table, fill_table, with_devices};
use crate::quantity::RunValue;
use crate::report::study::Study;
use crate::table::ranking::Ranking;
use crate::table::{Digits, Table, TableCell};
use lumbre_render::OpenStats;

/// Heading of the tables of speed.
pub(super) const SPEED: &str = "Speed and efficiency";

/// Builds the table of samples per pixel and second [S0, table 5.2].
pub(super) fn sampling_rates(study: &Study) -> Table {
    let caption = "Samples per pixel per second of render time (FPS: a frame is one sample of \
                   every pixel). Geometric mean over repeats.";
    let table = empty_table(
        study,
        SPEED,
        "fps-absolute",
        "Sampling rate",
        with_devices(study, caption),
        "1/s",
        Digits::Significant(4),
    );
    fill_table(study, table, Ranking::HigherRate, |_, m| {
        m.run.samples_per_s().map(RunValue::exact)
    })
}

/// Columns of ratios.
struct RatioColumns {
    caption: String,
    /// Heading and number of columns of each group.
    groups: Vec<(String, usize)>,
    labels: Vec<String>,
    /// Indices of the series in numerator and denominator of each column.
    ratios: Vec<(usize, usize)>,
}

/// Builds the table of relative sampling rates [S0, table 5.3]: devices relative to the first one
/// or, with a single device, series relative to the first one. Returns `None` if there is only one
/// series.
pub(super) fn relative_rates(study: &Study) -> Option<Table> {
    let columns = if study.groups().len() > 1 {
        device_ratios(study)
    } else if study.series.len() > 1 {
        series_ratios(study)
    } else {
        return None;
    };
    let mut table = empty_table(
        study,
        SPEED,
        "fps-relative",
        "Relative sampling rate",
        with_devices(study, &columns.caption),
        "1",
        Digits::Percent,
    );
    (table.groups, table.columns) = (columns.groups, columns.labels);
    for (labels, cells) in sampling_rates(study).rows {
        let ratio = |(a, b): &(usize, usize)| {
            let (a, b) = (&cells[*a], &cells[*b]);
            TableCell {
                value: a.value.zip(b.value).map(|(a, b)| a / b),
                runs: a.runs.min(b.runs),
                run_ids: [a.run_ids.clone(), b.run_ids.clone()].concat(),
                ..TableCell::default()
            }
        };
        let cells = columns.ratios.iter().map(ratio).collect();
        table.rows.push((labels, cells));
    }
    Some(table)
}

/// Returns ratios of each device to the first one, for techniques that both have.
fn device_ratios(study: &Study) -> RatioColumns {
    let groups = study.groups();
    let base = &groups[0];
    let find = |label: &str, group: &str| {
        study
            .series
            .iter()
            .position(|s| s.label == label && s.group == group)
    };
    let mut columns = RatioColumns {
        caption: format!(
            "Sampling rate of each device relative to that of {base} with the same technique."
        ),
        groups: Vec::new(),
        labels: Vec::new(),
        ratios: Vec::new(),
    };
    for group in &groups[1..] {
        let shared: Vec<(&str, usize, usize)> = study
            .series
            .iter()
            .filter(|s| s.group == *group)
            .filter_map(|s| {
                let numerator = find(&s.label, group)?;
                Some((s.label.as_str(), numerator, find(&s.label, base)?))
            })
            .collect();
        if shared.is_empty() {
            continue;
        }
        columns
            .groups
            .push((format!("{group} / {base}"), shared.len()));
        columns
            .labels
            .extend(shared.iter().map(|(label, ..)| (*label).to_owned()));
        columns
            .ratios
            .extend(shared.iter().map(|(_, a, b)| (*a, *b)));
    }
    columns
}

/// Returns ratios of each series to the first one.
fn series_ratios(study: &Study) -> RatioColumns {
    RatioColumns {
        caption: format!(
            "Sampling rate relative to that of {}.",
            study.series[0].label
        ),
        groups: vec![(String::new(), study.series.len())],
        labels: study.series.iter().map(|s| s.label.clone()).collect(),
        ratios: (0..study.series.len()).map(|s| (s, 0)).collect(),
    }
}

/// Builds the table of acceleration structures [S1, tables 4.2 and 5.1]: nodes, build time, and
/// the rate at which rays were traced. The rate counts all time inside the renderer, including
/// shading.
pub(super) fn acceleration_structures(study: &Study) -> Option<Table> {
    let caption = "Number of nodes, build time in milliseconds (minimum over runs), and million \
                   rays per second of render time, including shading (geometric mean over repeats; ×÷: \
                   factor of its 95 % confidence interval).";
    let mut table = empty_table(
        study,
        SPEED,
        "bvh",
        "Acceleration structures",
        with_devices(study, caption),
        "",
        Digits::Significant(4),
    );
    let groups = study.groups();
    let (mut heads, mut columns) = (Vec::new(), Vec::new());
    for group in &groups {
        let labels: Vec<&str> = study
            .series
            .iter()
            .filter(|s| s.group == *group)
            .map(|s| s.label.as_str())
            .collect();
        heads.push((group.clone(), labels.len() + 2));
        columns.extend(["nodes", "build (ms)"].map(str::to_owned));
        columns.extend(labels.iter().map(|label| format!("{label} (Mrays/s)")));
    }
    (table.groups, table.columns) = (heads, columns);
    for facet in 0..study.facets.len() {
        let cells = groups
            .iter()
            .flat_map(|group| structure_cells(study, facet, group))
            .collect();
        table.rows.push((study.facet_values(facet), cells));
    }
    Some(table)
}

/// Returns nodes, build time and ray rates of one group of series in a facet.
fn structure_cells(study: &Study, facet: usize, group: &str) -> Vec<TableCell> {
    let series = || (0..study.series.len()).filter(|s| study.series[*s].group == *group);
    let built: Vec<&OpenStats> = series()
        .flat_map(|s| study.members(facet, s))
        .filter_map(|m| m.run.open.as_ref())
        .filter(|open| open.accel_nodes > 0)
        .collect();
    let cell = |value: Option<f64>| TableCell {
        value,
        runs: built.len(),
        ..TableCell::default()
    };
    let mut cells = vec![
        cell(
            built
                .iter()
                .map(|open| open.accel_nodes as f64)
                .reduce(f64::max),
        ),
        cell(
            built
                .iter()
                .map(|open| open.accel_build_s * 1e3)
                .reduce(f64::min),
        ),
    ];
    for series in series() {
        let finished = study.finished(facet, series);
        let (run_ids, rates): (Vec<String>, Vec<RunValue>) = finished
            .iter()
            .filter_map(|m| Some((m.run.id.clone(), RunValue::exact(m.run.mrays_per_s()?))))
            .unzip();
        cells.push(TableCell {
            run_ids,
            ..TableCell::mean(&rates, Ranking::HigherRate)
        });
    }
    cells
}
