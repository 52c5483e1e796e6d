//! Figures over an axis of the sweep: final values of finished runs, with one line for each
//! combination of the other axes. Axes that are determined by the swept one are ignored.

use std::collections::BTreeMap;

use super::axis::{Axis, Scale};
use super::figure::{Line, Panel};
use super::{
    FigureContent, FigureData, MetricPanel, mark_shared, metric_labels, set_axes, subtitle,
};
use crate::experiment::spec::TableValue;
use crate::output::format;
use crate::output::metric_display::MetricDisplay;
use crate::output::quantity::{self, Bound, RunValue};
use crate::output::repeats::{Band, BandKind, Spread};
use lumbre_light::value::Value;

/// Runs of one line.
struct SweepLine {
    style_index: usize,
    /// Indices of values of the swept axis, each with the cells of its repeats.
    positions: Vec<(usize, Vec<usize>)>,
}

/// One point of a line.
struct SweepPoint {
    /// Index of the value on the swept axis.
    position: usize,
    spread: Spread,
    runs: usize,
    /// Index of the first cell.
    cell: usize,
}

/// Values of the swept axis that anything was measured at, in plan order.
struct SweptValues {
    values: Vec<Value>,
    /// Index of every value by its hash.
    indices: BTreeMap<[u8; 32], usize>,
    /// The values as numbers, if all are finite numbers.
    numbers: Option<Vec<f64>>,
}

impl SweptValues {
    fn new(data: &FigureData, over: &str) -> SweptValues {
        let mut values: Vec<Value> = Vec::new();
        let mut indices = BTreeMap::new();
        for (cell, _) in data.cells {
            if let Some(value) = format::axis_value(data.plan, *cell, over) {
                indices.entry(hash([value])).or_insert_with(|| {
                    values.push(value.clone());
                    values.len() - 1
                });
            }
        }
        let numbers = values
            .iter()
            .map(|v| v.as_f64().filter(|x| x.is_finite()))
            .collect();
        SweptValues {
            values,
            indices,
            numbers,
        }
    }

    /// Returns the axis that covers the drawn values.
    fn axis(&self, drawn: &[f64]) -> Option<Axis> {
        let Some(numbers) = &self.numbers else {
            let names: Vec<String> = self.values.iter().map(ToString::to_string).collect();
            return Axis::named(&names);
        };
        let scale = Scale::for_values(numbers.iter().copied());
        let mut axis = Axis::new(scale, drawn.iter().copied())?;
        if numbers.iter().all(|x| x.fract() == 0.0) {
            axis.keep_integer_ticks();
        }
        Some(axis)
    }

    /// Returns the position on the horizontal axis: the number, or the index of a name.
    fn x(&self, position: usize) -> f64 {
        self.numbers
            .as_ref()
            .map_or(position as f64, |numbers| numbers[position])
    }
}

/// Builds the figure of the cells over the axis `over`, and its data as CSV. Axes of `dependent` do
/// not distinguish lines. `remarks` appear below the title.
pub(super) fn figure(
    data: &FigureData,
    over: &str,
    y: &[TableValue],
    dependent: &[String],
    remarks: &[String],
) -> (FigureContent, String) {
    let swept = SweptValues::new(data, over);
    let lines = lines(data, over, dependent, &swept);
    let mut csv = crate::text::csv_line(&super::csv_header(data.plan));
    let mut panels = Vec::new();
    let mut scales = Vec::new();
    for value in y {
        let Some((scale, points)) = line_points(data, value, &lines) else {
            continue;
        };
        for point in points.iter().flatten() {
            csv += &csv_row(data, &swept.values[point.position], value, point);
        }
        let (drawn, runs) = drawn_lines(&swept, &lines, points);
        let [heading, y_label] = match value {
            TableValue::Metric(column) => match format::column(data.plan, column) {
                Some((_, metric)) => metric_labels(column, metric),
                None => continue,
            },
            other => [
                quantity::title(data.plan, other),
                quantity::label(data.plan, other),
            ],
        };
        scales.push(scale);
        panels.push(MetricPanel {
            column: value.name(),
            panel: Panel {
                heading,
                y_label,
                axes: None,
                lines: drawn,
                floor: None,
            },
            runs,
        });
    }
    set_axes(&mut panels, &scales, |drawn| swept.axis(drawn));
    let subtitle = sweep_subtitle(&lines, &panels);
    let remarks: Vec<&str> = remarks
        .iter()
        .map(String::as_str)
        .chain([subtitle.as_str()])
        .filter(|s| !s.is_empty())
        .collect();
    let content = FigureContent {
        notes: remarks.join("; "),
        x_label: over.to_owned(),
        panels,
    };
    (content, csv)
}

/// Describes what the lines average. Empty if every point is a single run.
fn sweep_subtitle(lines: &[SweepLine], panels: &[MetricPanel]) -> String {
    let repeats = lines.iter().flat_map(|line| {
        line.positions
            .iter()
            .map(|(_, cells)| (line.style_index, cells.clone()))
    });
    let text = subtitle(&repeats.collect::<Vec<_>>());
    if !text.starts_with("mean") {
        return String::new();
    }
    let has_line_without_band = panels
        .iter()
        .flat_map(|p| &p.panel.lines)
        .filter_map(|line| line.band.as_ref())
        .any(|band| band.kind == BandKind::Single);
    if has_line_without_band {
        text + "; no band for lines with a single run at any point"
    } else {
        text
    }
}

/// Builds the lines of a panel from the points of every line, with the first cell and the number of
/// runs of each. Lines without points are left out.
fn drawn_lines(
    swept: &SweptValues,
    lines: &[SweepLine],
    points: Vec<Vec<SweepPoint>>,
) -> (Vec<Line>, Vec<(usize, usize)>) {
    let drawn = |(line, points): (&SweepLine, Vec<SweepPoint>)| {
        let kind = BandKind::for_runs(points.iter().map(|point| point.runs).min()?);
        let mut points: Vec<(f64, SweepPoint)> = points
            .into_iter()
            .map(|point| (swept.x(point.position), point))
            .collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let ends = points.iter().map(|(_, point)| point.spread.ends);
        let band = Band {
            ends: if kind == BandKind::Single {
                Vec::new()
            } else {
                ends.collect()
            },
            mean: points
                .iter()
                .map(|(x, point)| (*x, point.spread.mean))
                .collect(),
            kind,
        };
        let runs = points.iter().map(|(_, point)| point.runs).sum();
        let line_of_values = Line::of_values(line.style_index, band);
        Some((line_of_values, (line.positions[0].1[0], runs)))
    };
    let (mut drawn, runs): (Vec<Line>, Vec<_>) = lines.iter().zip(points).filter_map(drawn).unzip();
    mark_shared(&mut drawn);
    (drawn, runs)
}

/// Groups the cells into lines.
fn lines(
    data: &FigureData,
    over: &str,
    dependent: &[String],
    swept: &SweptValues,
) -> Vec<SweepLine> {
    let mut lines: Vec<SweepLine> = Vec::new();
    // Lines by the point that their cells share: without the swept axis and the axes determined by
    // it.
    let mut by_point: BTreeMap<[u8; 32], usize> = BTreeMap::new();
    for (cell, style_index) in data.cells {
        let Some(value) = format::axis_value(data.plan, *cell, over) else {
            continue;
        };
        let position = swept.indices[&hash([value])];
        let point = data.plan.cells[*cell].point.iter();
        let common = point.filter(|(axis, _)| axis != over && !dependent.contains(axis));
        let common = hash(common.map(|(_, value)| value));
        let line = *by_point.entry(common).or_insert_with(|| {
            lines.push(SweepLine {
                style_index: *style_index,
                positions: Vec::new(),
            });
            lines.len() - 1
        });
        // Searched from the end, since repeats of a point follow one another.
        match lines[line]
            .positions
            .iter_mut()
            .rfind(|(known, _)| *known == position)
        {
            Some((_, cells)) => cells.push(*cell),
            None => lines[line].positions.push((position, vec![*cell])),
        }
    }
    lines
}

/// Returns the hash of some values.
fn hash<'a>(values: impl IntoIterator<Item = &'a Value>) -> [u8; 32] {
    let mut hasher = blake3::Hasher::new();
    values
        .into_iter()
        .for_each(|value| value.hash_into(&mut hasher));
    hasher.finalize().into()
}

/// Computes the points of every line and the vertical scale. Returns `None` for a metric that is
/// not measured. A position where any repeat did not reach the threshold has no point, since the
/// mean of the others would be biased.
fn line_points(
    data: &FigureData,
    value: &TableValue,
    lines: &[SweepLine],
) -> Option<(Scale, Vec<Vec<SweepPoint>>)> {
    let display = match value {
        TableValue::Metric(column) => {
            let (_, metric) = format::column(data.plan, column)?;
            Some(MetricDisplay::for_metric(metric))
        }
        _ => None,
    };
    // The inner `None` is a value that cannot be drawn, the outer one a run without the value.
    let drawn = |cell: &usize| {
        let RunValue { number, bound } =
            quantity::run_value(data.plan, value, data.measured[cell])?;
        Some(match display {
            _ if bound != Bound::Exact => None,
            Some(display) => display.drawn_value(number),
            None => Some(number).filter(|x| x.is_finite()),
        })
    };
    let repeats = |(position, cells): &(usize, Vec<usize>)| -> (usize, usize, Vec<f64>) {
        let values: Option<Vec<f64>> = cells.iter().filter_map(drawn).collect();
        (*position, cells[0], values.unwrap_or_default())
    };
    let all: Vec<Vec<_>> = lines
        .iter()
        .map(|line| line.positions.iter().map(repeats).collect())
        .collect();
    let values = all
        .iter()
        .flatten()
        .flat_map(|(_, _, values)| values.iter().copied());
    let scale = display.map_or_else(|| Scale::for_values(values), |display| display.scale);
    let point = |(position, cell, values): &(usize, usize, Vec<f64>)| {
        Some(SweepPoint {
            position: *position,
            spread: Spread::from_values(scale, values)?,
            runs: values.len(),
            cell: *cell,
        })
    };
    let points = all
        .iter()
        .map(|line| line.iter().filter_map(point).collect())
        .collect();
    Some((scale, points))
}

fn csv_row(data: &FigureData, x: &Value, value: &TableValue, point: &SweepPoint) -> String {
    let mut fields = super::axis_fields(data.plan, point.cell);
    let Spread { mean, ends } = point.spread;
    let display = match value {
        TableValue::Metric(column) => {
            format::column(data.plan, column).map(|(_, metric)| MetricDisplay::for_metric(metric))
        }
        _ => None,
    };
    let mean = display.map_or(mean, |display| display.metric_value(mean));
    let (low, high) = display.map_or(ends, |display| display.metric_ends(ends));
    let bound = |bound: f64| {
        if point.runs > 1 {
            format::exact(bound)
        } else {
            String::new()
        }
    };
    fields.extend([
        value.name(),
        x.to_string(),
        format::exact(mean),
        bound(low),
        bound(high),
        point.runs.to_string(),
    ]);
    crate::text::csv_line(&fields)
}
