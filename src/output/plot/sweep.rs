//! Figures over an axis of the sweep: what finished runs have in the end, a line for each combination of the other axes but
//! those that follow from it.

use super::axis::Scale;
use super::style::style;
use super::{Across, Curve, Figure, Gathered, Panel, panel, subtitle};
use crate::experiment::spec::{Point, TableValue};
use crate::output::labels;
use crate::output::quantity::{self, Sample};
use crate::output::report::curve::{BandKind, Spread};
use crate::output::report::study::Shown;
use crate::value::Value;

/// The runs of one line: at each place on the horizontal axis the cells of its repeats.
struct Line {
    look: usize,
    /// What they have in common: their point without the horizontal axis and what is bound to it.
    rest: Point,
    places: Vec<(usize, Vec<usize>)>,
}

/// One point of a line.
struct Mark {
    place: usize,
    spread: Spread,
    runs: usize,
    /// The first cell.
    cell: usize,
}

/// The picture of these cells over the values of an axis, and its data as comma-separated values. Axes of `bound` tell no
/// lines apart; `remarks` stand below the title.
pub(super) fn figure(
    night: &Gathered,
    over: &str,
    y: &[TableValue],
    bound: &[String],
    remarks: &[String],
) -> (Figure, String) {
    let values = values(night, over);
    let lines = lines(night, over, bound, &values);
    let numbers: Option<Vec<f64>> = values.iter().map(|v| v.as_f64().filter(|x| x.is_finite())).collect();
    let across = match &numbers {
        Some(numbers) => {
            let scale = Scale::fitting(numbers.iter().copied());
            let whole = numbers.iter().all(|x| x.fract() == 0.0);
            if whole { Across::Whole(scale) } else { Across::Numbers(scale) }
        }
        None => Across::Names(values.iter().map(ToString::to_string).collect()),
    };
    let at = |place: usize| numbers.as_ref().map_or(place as f64, |numbers| numbers[place]);

    let mut header = night.plan.axes.clone();
    header.extend(["metric", "x", "mean", "low", "high", "runs"].map(str::to_owned));
    let mut csv = labels::csv_line(&header);
    let mut panels = Vec::new();
    for value in y {
        let Some((scale, marks)) = marks(night, value, &lines) else { continue };
        let mut curves = Vec::new();
        for (line, marks) in lines.iter().zip(marks) {
            for mark in &marks {
                csv += &row(night, &values[mark.place], value, mark);
            }
            let shared = lines.iter().filter(|other| other.look == line.look).count() > 1;
            let kind = BandKind::of(marks.iter().map(|mark| mark.runs).min().unwrap_or(0));
            let mut marks: Vec<(f64, Mark)> = marks.into_iter().map(|mark| (at(mark.place), mark)).collect();
            marks.sort_by(|a, b| a.0.total_cmp(&b.0));
            let ends = marks.iter().map(|(_, mark)| mark.spread.ends);
            curves.push(Curve {
                style: style(line.look),
                shared,
                ends: if kind == BandKind::Single { Vec::new() } else { ends.collect() },
                points: marks.iter().map(|(x, mark)| (*x, mark.spread.mean)).collect(),
                kind,
                cell: line.places[0].1[0],
                runs: marks.iter().map(|(_, mark)| mark.runs).sum(),
            });
        }
        panels.push(match value {
            TableValue::Metric(column) => match labels::column(night.plan, column) {
                Some((_, metric)) => panel(column, metric, curves),
                None => continue,
            },
            other => Panel {
                column: other.word(),
                heading: quantity::title(night.plan, other),
                details: String::new(),
                y_label: quantity::label(night.plan, other),
                scale,
                curves,
            },
        });
    }
    let repeats = lines.iter().flat_map(|line| line.places.iter().map(|(_, cells)| (line.look, cells.clone())));
    let subtitle = match subtitle(&repeats.collect::<Vec<_>>()) {
        text if text.starts_with("mean")
            && panels.iter().flat_map(|p| &p.curves).any(|c| c.kind == BandKind::Single) =>
        {
            text + "; none where a line has a single run at some place"
        }
        text if text.starts_with("mean") => text,
        // One run at each point is no line of its own.
        _ => String::new(),
    };
    let said: Vec<&str> =
        remarks.iter().map(String::as_str).chain([subtitle.as_str()]).filter(|s| !s.is_empty()).collect();
    (night.figure(panels, said.join("; "), over.to_owned(), across), csv)
}

/// The values of the horizontal axis that anything was measured at, in the order of the plan.
fn values(night: &Gathered, over: &str) -> Vec<Value> {
    let mut values: Vec<Value> = Vec::new();
    for (cell, _) in night.cells {
        if let Some(value) = labels::axis_value(night.plan, *cell, over).filter(|value| !values.contains(value)) {
            values.push(value.clone());
        }
    }
    values
}

fn lines(night: &Gathered, over: &str, bound: &[String], values: &[Value]) -> Vec<Line> {
    let mut lines: Vec<Line> = Vec::new();
    for (cell, look) in night.cells {
        let point = &night.plan.cells[*cell].point;
        let rest: Point = point.iter().filter(|(axis, _)| axis != over && !bound.contains(axis)).cloned().collect();
        let own = labels::axis_value(night.plan, *cell, over);
        let Some(place) = values.iter().position(|value| Some(value) == own) else { continue };
        let line = lines.iter().position(|line| line.rest == rest).unwrap_or_else(|| {
            lines.push(Line { look: *look, rest, places: Vec::new() });
            lines.len() - 1
        });
        match lines[line].places.iter_mut().find(|(known, _)| *known == place) {
            Some((_, cells)) => cells.push(*cell),
            None => lines[line].places.push((place, vec![*cell])),
        }
    }
    lines
}

/// The points of every line, and the scale on which they are drawn; `None` for a metric that is not measured. Where a
/// repeat never reached a threshold there is no point, since no mean would be honest.
fn marks(night: &Gathered, value: &TableValue, lines: &[Line]) -> Option<(Scale, Vec<Vec<Mark>>)> {
    let shown = match value {
        TableValue::Metric(column) => Some(Shown::of(labels::column(night.plan, column)?.1)),
        _ => None,
    };
    let read = |cell: &usize| match quantity::sample(night.plan, value, night.measured[cell])? {
        Sample::Value(x) => Some(shown.map_or(Some(x).filter(|x| x.is_finite()), |shown| shown.value(x))),
        Sample::NeverIn(_) => Some(None),
    };
    let read = |(place, cells): &(usize, Vec<usize>)| -> (usize, usize, Vec<f64>) {
        let all: Option<Vec<f64>> = cells.iter().filter_map(read).collect();
        (*place, cells[0], all.unwrap_or_default())
    };
    let all: Vec<Vec<_>> = lines.iter().map(|line| line.places.iter().map(read).collect()).collect();
    let drawn = all.iter().flatten().flat_map(|(_, _, values)| values.iter().copied());
    let scale = shown.map_or_else(|| Scale::fitting(drawn), |shown| shown.scale);
    let mark = |(place, cell, values): &(usize, usize, Vec<f64>)| {
        Some(Mark { place: *place, spread: Spread::of(scale, values)?, runs: values.len(), cell: *cell })
    };
    Some((scale, all.iter().map(|line| line.iter().filter_map(mark).collect()).collect()))
}

fn row(night: &Gathered, x: &Value, value: &TableValue, mark: &Mark) -> String {
    let axis =
        |axis: &String| labels::axis_value(night.plan, mark.cell, axis).map(ToString::to_string).unwrap_or_default();
    let mut fields: Vec<String> = night.plan.axes.iter().map(axis).collect();
    let Spread { mean, ends: (low, high) } = mark.spread;
    let end = |end: f64| if mark.runs > 1 { labels::exact(end) } else { String::new() };
    fields.extend([value.word(), x.to_string(), labels::exact(mean), end(low), end(high), mark.runs.to_string()]);
    labels::csv_line(&fields)
}
