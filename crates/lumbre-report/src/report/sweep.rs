//! Figures of final values over an axis of the sweep: errors, rates, and properties of
//! acceleration structures.

use std::collections::BTreeMap;

use super::ReportError;
use super::convergence::{mean_and_band, mean_name, provenance, separate_devices};
use super::item::ReportItem;
use super::pgfplots::PgfFigure;
use super::study::{Member, ReportOptions, Study};
use crate::dependent_axes;
use crate::format;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::{Axis, Scale};
use crate::plot::draw::draw;
use crate::plot::figure::{Figure, Line, Panel, covered};
use crate::plot::sizes::MOST_PANELS;
use crate::quantity::{self, Bound, RunValue};
use crate::repeats::{Band, BandKind, Spread};
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::spec::{RunColumn, TableValue};

/// Minimum number of different numbers on an axis for a figure that was not requested.
const FEWEST: usize = 3;

/// Returns axis label and description of a quantity.
fn describe(study: &Study, quantity: &TableValue) -> (String, String) {
    match metric(study, quantity) {
        Some(spec) => {
            let label = MetricDisplay::for_metric(spec).label(spec);
            let description = format::metric_description(spec);
            (
                format::with_unit(&label, &spec.unit()),
                format!("{description} at the end of each run"),
            )
        }
        None => (
            quantity::label(&study.metrics, quantity),
            quantity::title(&study.metrics, quantity),
        ),
    }
}

/// Returns the metric whose final value a quantity is.
fn metric<'a>(study: &'a Study, quantity: &TableValue) -> Option<&'a MetricSpec> {
    match quantity {
        TableValue::Metric(column) => Some(format::column(&study.metrics, column)?.1),
        _ => None,
    }
}

/// The swept axis with its values.
pub(super) struct SweepAxis<'a> {
    name: &'a str,
    pub(super) values: Vec<String>,
    /// Index of every value.
    indices: BTreeMap<String, usize>,
    /// Values as numbers, if all are finite numbers. Otherwise each value is drawn at its index.
    numbers: Option<Vec<f64>>,
    /// Axes that are determined by this one. They do not distinguish lines.
    dependent: Vec<String>,
}

impl<'a> SweepAxis<'a> {
    pub(super) fn new(name: &'a str, values: Vec<String>, dependent: Vec<String>) -> SweepAxis<'a> {
        let numbers = values
            .iter()
            .map(|v| v.parse().ok().filter(|x: &f64| x.is_finite()))
            .collect();
        let indices = values.iter().cloned().zip(0..).collect();
        SweepAxis {
            name,
            values,
            indices,
            numbers,
            dependent,
        }
    }

    /// Returns the index of a run's value; `None` if it is not on the axis.
    pub(super) fn index(&self, run: &Run) -> Option<usize> {
        self.indices.get(&run.axis_value(self.name)?).copied()
    }

    /// Returns the position of a value on the drawn axis.
    fn x(&self, index: usize) -> f64 {
        self.numbers
            .as_ref()
            .map_or(index as f64, |numbers| numbers[index])
    }

    fn scale(&self) -> Scale {
        self.numbers.as_ref().map_or(Scale::Linear, |numbers| {
            Scale::for_values(numbers.iter().copied())
        })
    }

    pub(super) fn axis(&self) -> Option<Axis> {
        let Some(numbers) = &self.numbers else {
            return Axis::named(&self.values);
        };
        let mut axis = Axis::new(self.scale(), numbers.iter().copied());
        if let Some(axis) = axis
            .as_mut()
            .filter(|_| numbers.iter().all(|x| x.fract() == 0.0))
        {
            axis.keep_integer_ticks();
        }
        axis
    }
}

/// Draws the figures over every requested axis, or over all axes with enough different numbers if
/// none is requested. Acceleration structures are drawn if they vary along the axis. A note
/// explains why a requested axis has no figures.
///
/// # Errors
/// Returns an error if a requested axis does not exist.
pub fn all(
    study: &Study,
    options: &ReportOptions,
    notes: &mut Vec<String>,
) -> Result<Vec<ReportItem>, ReportError> {
    let axes = study.axes();
    if let Some(missing) = options.sweep.iter().find(|axis| !axes.contains(axis)) {
        return Err(ReportError::NoAxis {
            axis: missing.clone(),
            known: axes.join(", "),
        });
    }
    let mut items = Vec::new();
    for name in &axes {
        let requested = options.sweep.contains(name);
        if !requested && !options.sweep.is_empty() {
            continue;
        }
        let dependent = axes
            .iter()
            .filter(|axis| *axis != name && study.values(axis).len() > 1)
            .filter(|axis| study.is_determined_by(axis, name));
        let axis = SweepAxis::new(name, study.values(name), dependent.cloned().collect());
        if requested && axis.values.len() < 2 {
            notes.push(format!(
                "nothing is drawn over `{name}`: it has a single value"
            ));
            continue;
        }
        if !requested && (axis.numbers.is_none() || axis.values.len() < FEWEST) {
            continue;
        }
        let figures = axis_figures(study, options, &axis, notes);
        if requested && figures.is_empty() {
            notes.push(format!(
                "nothing is drawn over `{name}`: no line has finished runs at two of its values"
            ));
        }
        items.extend(figures);
    }
    Ok(items)
}

/// Draws the figures over one axis.
fn axis_figures(
    study: &Study,
    options: &ReportOptions,
    over: &SweepAxis,
    notes: &mut Vec<String>,
) -> Vec<ReportItem> {
    // A requested axis distinguishes lines unless it and the swept axis determine each other.
    let mut independent = |axes: &[String], requested: bool| -> Vec<String> {
        let mut axes: Vec<String> = axes
            .iter()
            .filter(|axis| *axis != over.name)
            .cloned()
            .collect();
        axes.retain(|axis| {
            let dependent = over.dependent.contains(axis)
                && (!requested || study.is_determined_by(over.name, axis));
            if dependent && requested {
                notes.push(format!(
                    "over `{}`, lines are not distinguished by `{axis}`, which changes with it",
                    over.name
                ));
            }
            !dependent
        });
        axes
    };
    let mut by = independent(&study.by, !options.by.is_empty());
    let mut facet = independent(&study.facet_axes, options.facet.is_some());
    if by.is_empty() {
        by.extend(facet.pop());
    }
    let regrouped = study.regrouped(by, facet);
    let metrics = study.metrics.iter();
    let mut quantities: Vec<TableValue> = metrics
        .map(|spec| TableValue::Metric(spec.column.clone()))
        .collect();
    quantities.push(TableValue::Run(RunColumn::MpathsPerS));
    if structures_vary(&regrouped) {
        let values = [
            RunColumn::AccelBuildS,
            RunColumn::AccelNodes,
            RunColumn::AccelMib,
            RunColumn::AccelCost,
        ];
        quantities.extend(values.map(TableValue::Run));
    }
    quantities
        .iter()
        .flat_map(|quantity| figures(&regrouped, over, quantity))
        .collect()
}

/// Returns whether the acceleration structures of any series vary within a facet.
fn structures_vary(study: &Study) -> bool {
    let size = |m: Member| {
        let open = m.run.open.as_ref()?;
        Some((open.accel_nodes, open.accel_bytes))
    };
    let varies = |(facet, series)| {
        let mut all = study.members(facet, series).into_iter().filter_map(size);
        let first = all.next();
        all.any(|other| Some(other) != first)
    };
    (0..study.facets.len())
        .any(|facet| (0..study.series.len()).any(|series| varies((facet, series))))
}

/// Draws the figures of one quantity: pages of panels, and for times separate figures for each
/// device of a night.
fn figures(study: &Study, over: &SweepAxis, quantity: &TableValue) -> Vec<ReportItem> {
    let timed = quantity.is_clock();
    let scale = scale(study, quantity, study.all());
    let mut items = Vec::new();
    for device_index in separate_devices(study, timed) {
        let device = device_index.map(|i| study.devices[i].as_str());
        let panels: Vec<(usize, Panel)> = (0..study.facets.len())
            .filter_map(|facet| {
                let panel = panel(study, over, quantity, (facet, scale), device)?;
                Some((facet, panel))
            })
            .collect();
        let pages = panels.len().div_ceil(MOST_PANELS);
        let mut panels = panels.into_iter();
        for page in 0..pages {
            let (facets, panels): (Vec<usize>, Vec<Panel>) =
                panels.by_ref().take(MOST_PANELS).unzip();
            let mut suffix =
                device_index.map_or_else(String::new, |i| format!("-device-{}", i + 1));
            if pages > 1 {
                suffix += &format!("-{}", page + 1);
            }
            items.push(item(
                study,
                over,
                quantity,
                &facets,
                panels,
                (scale, &suffix),
                device,
            ));
        }
    }
    items
}

fn item(
    study: &Study,
    over: &SweepAxis,
    quantity: &TableValue,
    facets: &[usize],
    panels: Vec<Panel>,
    (scale, suffix): (Scale, &str),
    device: Option<&str>,
) -> ReportItem {
    let (column, (label, description)) = (quantity.name(), describe(study, quantity));
    let title = format!("{label} over {}", over.name);
    let mut caption = format!("{description}, over {}.", over.name);
    if let Some(change) = dependent_axes::change_phrase(&over.dependent) {
        caption += &format!(" With it, {change}.");
    }
    caption += &averaging(study, &panels, scale);
    let on_device = match device {
        Some(device) => Some(format!("Only runs on {device}.")),
        None => study
            .device_sentence("Measured")
            .filter(|_| quantity.is_clock()),
    };
    for sentence in on_device.into_iter().chain(study.bias_sentences()) {
        caption += &format!(" {sentence}");
    }
    let provenance = provenance(study, facets);
    let figure = Figure {
        title: title.clone(),
        heading: String::new(),
        notes: String::new(),
        description: provenance.text(),
        x_label: over.name.to_owned(),
        panels,
        series: study.entries(),
    };
    let stem = format!("figures/sweep-{}-{column}{suffix}", over.name);
    let latex = PgfFigure {
        figure: &figure,
        x_label: over.name,
        scales: [over.scale(), scale],
    };
    let extra = latex.files(&stem, &caption, &provenance);
    let section = format!("Final values over {}", over.name);
    let svg = draw(&figure);
    ReportItem {
        extra,
        ..ReportItem::figure(&section, stem, title, caption, svg, provenance)
    }
}

/// Describes what the lines average and what the bands show, with a leading space.
fn averaging(study: &Study, panels: &[Panel], scale: Scale) -> String {
    let repeated = study.all().any(|m| m.run.repeat > 0);
    let mut text = match mean_and_band(scale, panels, "repeats") {
        Some(text) => format!(" {text}"),
        None if repeated => format!(" {} of repeats.", mean_name(scale)),
        None => " One run each.".to_owned(),
    };
    let mut lines = panels.iter().flat_map(|panel| &panel.lines);
    let is_single = |line: &Line| {
        line.band
            .as_ref()
            .is_some_and(|b| b.kind == BandKind::Single)
    };
    if repeated && lines.any(is_single) {
        text += " Lines with a single run at any point have no band.";
    }
    text
}

/// Returns the drawn value of a finished run; `None` if it has none that the axis accepts, or only a
/// bound.
fn drawn_value(study: &Study, quantity: &TableValue, member: &Member) -> Option<f64> {
    let value = study.run_value(quantity, member);
    let RunValue { number, .. } = value.filter(|value| value.bound == Bound::Exact)?;
    match metric(study, quantity) {
        Some(spec) => MetricDisplay::for_metric(spec).drawn_value(number),
        None => Some(number).filter(|x| x.is_finite()),
    }
}

/// Returns the values that were measured independently. Runs of a night share hierarchies, so build
/// times that are equal to the bit are one measurement.
fn measurements(quantity: &TableValue, mut values: Vec<f64>) -> Vec<f64> {
    if let TableValue::Run(RunColumn::AccelBuildS) = quantity {
        values.sort_by(f64::total_cmp);
        values.dedup();
    }
    values
}

/// Returns the scale of the vertical axis of some runs.
pub(super) fn scale<'a>(
    study: &Study,
    quantity: &TableValue,
    members: impl Iterator<Item = Member<'a>>,
) -> Scale {
    match metric(study, quantity) {
        Some(spec) => MetricDisplay::for_metric(spec).scale,
        None => {
            let finished = members.filter(|m| m.run.is_done());
            Scale::for_values(finished.filter_map(|m| drawn_value(study, quantity, &m)))
        }
    }
}

/// Collects the panel of one facet. Returns `None` if no line has two points.
fn panel(
    study: &Study,
    over: &SweepAxis,
    quantity: &TableValue,
    (facet, scale): (usize, Scale),
    device: Option<&str>,
) -> Option<Panel> {
    let lines: Vec<Line> = (0..study.series.len())
        .filter(|series| device.is_none() || study.series[*series].device.as_deref() == device)
        .filter_map(|series| {
            let members = study.members(facet, series);
            let mut points = sweep_points(study, over, quantity, &members, scale);
            let band = sweep_band(over, &mut points)?;
            Some(Line::of_values(series, band))
        })
        .collect();
    let bands = || lines.iter().filter_map(|line| line.band.as_ref());
    if bands().map(|band| band.mean.len()).max().unwrap_or(0) < 2 {
        return None;
    }
    let axes = over
        .axis()
        .zip(Axis::new(scale, covered(&lines, None, scale)));
    Some(Panel {
        heading: study.facet_label(facet),
        y_label: describe(study, quantity).0,
        axes,
        lines,
        floor: None,
    })
}

/// A point of a line.
pub(super) struct SweepPoint {
    /// Index of the value on the swept axis.
    pub(super) value: usize,
    pub(super) spread: Spread,
    /// Number of measurements.
    pub(super) runs: usize,
}

/// Averages the repeats of a line at each value of the axis. A value where any repeat has no
/// drawable value has no point, since the mean of the others would be biased.
pub(super) fn sweep_points(
    study: &Study,
    over: &SweepAxis,
    quantity: &TableValue,
    members: &[Member],
    scale: Scale,
) -> Vec<SweepPoint> {
    let mut finals: Vec<Option<Vec<f64>>> = vec![Some(Vec::new()); over.values.len()];
    for member in members.iter().filter(|m| m.run.is_done()) {
        let Some(index) = over.index(member.run) else {
            continue;
        };
        let drawn = drawn_value(study, quantity, member);
        finals[index] = finals[index].take().zip(drawn).map(|(mut values, drawn)| {
            values.push(drawn);
            values
        });
    }
    let point = |(value, finals): (usize, Option<Vec<f64>>)| {
        let values = measurements(quantity, finals?);
        Some(SweepPoint {
            value,
            spread: Spread::from_values(scale, &values)?,
            runs: values.len(),
        })
    };
    finals.into_iter().enumerate().filter_map(point).collect()
}

/// Sorts the points of a line along the axis and returns its band, or `None` if there are no points.
pub(super) fn sweep_band(over: &SweepAxis, points: &mut [SweepPoint]) -> Option<Band> {
    points.sort_by(|a, b| over.x(a.value).total_cmp(&over.x(b.value)));
    // A line with a single run at any point has no band, since its mean there would look exact.
    let kind = BandKind::for_runs(points.iter().map(|point| point.runs).min()?);
    let ends = points.iter().map(|point| point.spread.ends);
    let mean = |point: &SweepPoint| (over.x(point.value), point.spread.mean);
    Some(Band {
        mean: points.iter().map(mean).collect(),
        ends: ends.filter(|_| kind != BandKind::Single).collect(),
        kind,
    })
}
