//! Figures that a script requests: error against render time or samples, and final values over an
//! axis of the sweep, with a panel for each quantity and a picture for each combination of facet
//! values.
//!
//! Curves of interrupted and failed cells show the measurements up to that point. Repeats of a cell
//! are drawn as their mean with its confidence interval, over the range that all of them cover.

use std::collections::{BTreeMap, BTreeSet};

use super::roles::AxisRoles;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::{Axis, Scale};
use crate::plot::draw;
use crate::plot::figure::{Figure, Line, Panel, SeriesEntry, covered};
use crate::repeats::BandKind;
use crate::report::convergence::panel::{line_of_repeats, x_axis};
use crate::report::series::BIASED;
use crate::report::study::{Member, Study, distinct};
use crate::report::sweep::{SweepAxis, scale, sweep_band, sweep_points};
use crate::{format, quantity};
use lumbre_metrics::MetricSpec;
use lumbre_night::columns::{FIGURE, names};
use lumbre_night::experiment::night::run::Run;
use lumbre_night::experiment::night::{Night, NightPlan};
use lumbre_night::experiment::spec::{FigureKind, FigureSpec, FigureX, TableValue};
use lumbre_night::text::csv_line;

/// Name of the additional facet of figures of several devices.
const DEVICE: &str = "device";

/// Maximum length of a file stem in bytes, so that all file systems accept it with its extension.
pub(super) const LONGEST_STEM: usize = 120;

/// Files of one figure.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureFiles {
    /// Unique file name without extension, of letters, digits, `-`, `_`, `=` and `.`.
    pub stem: String,
    /// Name of the figure, with the values of its facet.
    pub title: String,
    /// Picture as SVG.
    pub svg: String,
    /// Data of the picture as CSV, with the columns:
    /// - one for each axis, with the cell's values;
    /// - `metric`: the quantity drawn;
    /// - `x`: position in the unit of the horizontal axis, or the value of the swept axis;
    /// - `mean`: the value. Over repeats the mean, which is geometric on a logarithmic axis; where
    ///   the distance from the best value is drawn, as of SSIM, the best value without the mean
    ///   distance;
    /// - `low`, `high`: 95 % confidence interval of the mean for three or more repeats, range for
    ///   two, empty for one;
    /// - `runs`: number of runs.
    pub csv: String,
}

/// Draws the figures of a specification: one for each combination of facet values with any
/// measurement, in plan order.
///
/// Errors have a logarithmic axis. A metric with a best value of 1, such as SSIM, is drawn as
/// 1 − value, bias without its sign. PSNR has a linear axis. Values that the axis does not accept
/// (zero, negative or NaN) are left out. Curves with the same value of `by` have the same style in
/// all figures of the specification. Over an axis of the sweep, values other than metrics have a
/// logarithmic axis if they span more than a factor of ten. Axes that are determined by the swept
/// axis, such as axes zipped with it, do not distinguish lines and are named below the title.
///
/// Times of several devices never share an axis. If the night has several, each has separate
/// figures, as if the device were an additional facet.
pub fn figures(night: &Night, spec: &FigureSpec) -> Vec<FigureFiles> {
    let roles = AxisRoles::new(night, spec);
    let study = Study::of_night(night, &roles.by, &roles.facet);
    let split_devices = spec.is_timed() && night.devices().len() > 1;
    let is_sweep = matches!(spec.kind, FigureKind::Sweep { .. });
    let is_drawn =
        |run: &Run| spec.shows(&run.point) && !run.rows.is_empty() && (run.is_done() || !is_sweep);
    let mut indices: BTreeMap<(usize, Option<&str>), usize> = BTreeMap::new();
    let mut pictures: Vec<PictureOfFacet> = Vec::new();
    for (member, (_, facet, series)) in study.all().zip(study.run_positions()) {
        if !is_drawn(member.run) {
            continue;
        }
        let device = member.run.device.as_deref().unwrap_or("unknown");
        let device = split_devices.then_some(device);
        let index = *indices.entry((facet, device)).or_insert(pictures.len());
        if index == pictures.len() {
            let axes = study.facet_axes.iter().cloned();
            let values = axes.zip(study.facets[facet].iter().cloned());
            let device = device.map(|device| (DEVICE.to_owned(), device.to_owned()));
            pictures.push(PictureOfFacet {
                study: &study,
                facet: values.chain(device).collect(),
                members: Vec::new(),
            });
        }
        pictures[index].members.push((series, member));
    }
    let is_compared = |picture: &PictureOfFacet| {
        let mut series = picture.members.iter().map(|(series, _)| series);
        series.any(|series| *series != picture.members[0].0)
    };
    // Pictures in which nothing is compared are left out, unless all are of this kind.
    if !is_sweep && !split_devices && pictures.iter().any(is_compared) {
        pictures.retain(is_compared);
    }
    let mut taken = BTreeSet::new();
    let files = |picture: &PictureOfFacet| {
        let content = match &spec.kind {
            FigureKind::Convergence { x, y } => picture.convergence(*x, y),
            FigureKind::Sweep { over, y } => picture.sweep(over, y, &roles),
        };
        FigureFiles {
            stem: unique_stem(&spec.name, &picture.facet, &mut taken),
            title: after_name(&spec.name, &picture.facet_text()),
            csv: content.csv.clone(),
            svg: draw::draw(&picture.figure(content)),
        }
    };
    pictures.iter().map(files).collect()
}

/// Data of a figure, before it is drawn.
struct FigureContent {
    /// Notes on what lines average, and on axes; may be empty.
    notes: String,
    x_label: String,
    panels: Vec<Panel>,
    csv: String,
}

/// Lines of a panel with their members.
type Lines<'a> = Vec<(usize, Vec<Member<'a>>)>;

/// Runs of one picture.
struct PictureOfFacet<'a> {
    study: &'a Study<'a>,
    /// Axes and values of the facet.
    facet: Vec<(String, String)>,
    /// Series and run, in plan order.
    members: Vec<(usize, Member<'a>)>,
}

impl<'a> PictureOfFacet<'a> {
    /// Draws the metric columns `y` against `x`, with one line for each point of the sweep.
    fn convergence(&self, x: FigureX, y: &[String]) -> FigureContent {
        let groups = self.lines(|_| true);
        let mut csv = self.csv_header();
        let (mut panels, mut scales) = (Vec::new(), Vec::new());
        for name in y {
            let Some((index, metric)) = format::column(&self.study.metrics, name) else {
                continue;
            };
            let display = MetricDisplay::for_metric(metric);
            let mut lines = Vec::new();
            for (series, members) in &groups {
                let line = line_of_repeats(self.study, *series, members, index, x);
                let Some(line) = line.map(|line| Line {
                    floor: None,
                    ..line
                }) else {
                    continue;
                };
                let band = line.band.as_ref().filter(|b| b.kind != BandKind::Single);
                for (i, (x, mean)) in line.points().iter().enumerate() {
                    let ends = band.and_then(|band| band.ends.get(i).copied());
                    csv += &csv_row(
                        (self.study, &members[0], name),
                        format::exact(*x),
                        Some(display),
                        (*mean, ends, members.len()),
                    );
                }
                lines.push(line);
            }
            scales.push(display.scale);
            panels.push(panel(metric_labels(name, metric), lines));
        }
        set_axes(&mut panels, &scales, |values| x_axis(x, values.into_iter()));
        let counts: Vec<(usize, usize)> = groups.iter().map(|(s, m)| (*s, m.len())).collect();
        FigureContent {
            notes: averaging(&counts),
            x_label: x.row().label.to_owned(),
            panels,
            csv,
        }
    }

    /// Draws final values over the axis `over`, with one line for each combination of the other
    /// axes that are not dependent.
    fn sweep(&self, over: &str, y: &[TableValue], roles: &AxisRoles) -> FigureContent {
        let study = self.study;
        let members = self.members.iter();
        let values = distinct(members.filter_map(|(_, m)| m.run.axis_value(over)));
        let axis = SweepAxis::new(over, values, Vec::new());
        let groups = self.lines(|name| name != over && !roles.dependent.iter().any(|d| d == name));
        let mut csv = self.csv_header();
        let (mut panels, mut scales) = (Vec::new(), Vec::new());
        for value in y {
            let (labels, display) = match value {
                TableValue::Metric(name) => match format::column(&study.metrics, name) {
                    Some((_, metric)) => (
                        metric_labels(name, metric),
                        Some(MetricDisplay::for_metric(metric)),
                    ),
                    None => continue,
                },
                other => {
                    let metrics = &study.metrics;
                    let heading = quantity::title(metrics, other);
                    ([heading, quantity::label(metrics, other)], None)
                }
            };
            let scale = scale(study, value, self.members.iter().map(|(_, member)| *member));
            let mut lines = Vec::new();
            for (series, members) in &groups {
                let mut points = sweep_points(study, &axis, value, members, scale);
                let mut firsts = BTreeMap::new();
                for member in members {
                    firsts.entry(axis.index(member.run)).or_insert(member);
                }
                for point in &points {
                    let text = &axis.values[point.value];
                    let first = firsts[&Some(point.value)];
                    let ends = (point.runs > 1).then_some(point.spread.ends);
                    csv += &csv_row(
                        (study, first, &value.name()),
                        text.clone(),
                        display,
                        (point.spread.mean, ends, point.runs),
                    );
                }
                let band = sweep_band(&axis, &mut points);
                lines.extend(band.map(|band| Line::of_values(*series, band)));
            }
            scales.push(scale);
            panels.push(panel(labels, lines));
        }
        set_axes(&mut panels, &scales, |_| axis.axis());
        let mut notes = roles.remarks.clone();
        notes.extend(sweep_averaging(&axis, &groups, &panels));
        FigureContent {
            notes: notes.join("; "),
            x_label: over.to_owned(),
            panels,
            csv,
        }
    }

    /// Groups the runs whose values agree on the axes that `distinguishes` accepts.
    fn lines(&self, distinguishes: impl Fn(&str) -> bool) -> Lines<'a> {
        let mut lines: Lines = Vec::new();
        let mut indices: BTreeMap<Vec<String>, usize> = BTreeMap::new();
        for (series, member) in &self.members {
            let point = member.run.point.iter();
            let values = point.filter(|(axis, _)| distinguishes(axis));
            let key = values.map(|(_, value)| value.to_string()).collect();
            let index = *indices.entry(key).or_insert(lines.len());
            if index == lines.len() {
                lines.push((*series, Vec::new()));
            }
            lines[index].1.push(*member);
        }
        lines
    }

    fn csv_header(&self) -> String {
        let mut header = self.study.axes();
        header.extend(names(&FIGURE));
        csv_line(&header)
    }

    /// Builds the figure, with title, provenance and series.
    fn figure(&self, content: FigureContent) -> Figure {
        let facet = self.facet_text();
        let title = after_name(&self.study.nights[0].plan.name, &facet);
        let mut notes = vec![content.notes];
        let entries = (0..self.study.series.len()).map(|index| {
            let (label, long) = self.label(index);
            notes.extend(long.map(|long| format!("{label}: {long}")));
            SeriesEntry {
                label: if self.is_denoised(index) && !label.is_empty() {
                    label + BIASED
                } else {
                    label
                },
                style: self.study.series[index].style,
            }
        });
        let series = entries.collect();
        notes.extend(self.study.biased_references());
        notes.retain(|note| !note.is_empty());
        Figure {
            title,
            heading: facet,
            notes: notes.join("; "),
            description: self.description(),
            x_label: content.x_label,
            panels: content.panels,
            series,
        }
    }

    /// Returns the values of the facet, such as `scene = box, depth = 5`.
    fn facet_text(&self) -> String {
        let pair =
            |(axis, value): &(String, String)| format!("{axis} = {}", self.study.name(value));
        let facet: Vec<String> = self.facet.iter().map(pair).collect();
        facet.join(", ")
    }

    /// Lists program, plan and runs for the picture's metadata.
    fn description(&self) -> String {
        let NightPlan { name, hash, .. } = &*self.study.nights[0].plan;
        let mut text = format!("{}\nplan {name} {hash}", lumbre_night::text::program());
        for (_, Member { run, .. }) in &self.members {
            let samples = run.rows.last().map_or(0, |row| row.samples);
            text += &format!(
                "\nrun {} {} seed={} samples={samples}",
                run.id, run.path, run.seed
            );
        }
        text
    }

    fn of_series(&self, index: usize) -> impl Iterator<Item = &Run> {
        let members = self.members.iter();
        members.filter_map(move |(series, m)| (*series == index).then_some(m.run))
    }

    /// Returns whether all pictures of a series are denoised, which makes them biased.
    fn is_denoised(&self, index: usize) -> bool {
        self.of_series(index).all(|run| run.denoise.is_some())
    }

    /// Returns the label of a series, such as `depth = 5` or `bpt`, and the long name of its
    /// integrator if that is all that the label says. If no axis distinguishes series, it is the
    /// integrator, or empty if there are several. A series that is not drawn has no label.
    fn label(&self, index: usize) -> (String, Option<&'static str>) {
        let mut runs = self.of_series(index);
        let Some(first) = runs.next() else {
            return Default::default();
        };
        let series = &self.study.series[index];
        let (label, long) = if !series.values.is_empty() {
            let label = series.label.strip_suffix(BIASED).unwrap_or(&series.label);
            (label.to_owned(), series.long)
        } else if runs.all(|run| run.integrator == first.integrator) {
            let long = format::integrator_long_name(&first.integrator);
            (self.study.name(&first.integrator), long)
        } else {
            return Default::default();
        };
        let long = long.filter(|long| *long != label);
        (label, long)
    }
}

/// Returns a name with the values of a facet, if there are any.
fn after_name(name: &str, facet: &str) -> String {
    match facet {
        "" => name.to_owned(),
        facet => format!("{name}: {facet}"),
    }
}

/// Creates a panel without axes.
fn panel([heading, y_label]: [String; 2], mut lines: Vec<Line>) -> Panel {
    mark_shared(&mut lines);
    Panel {
        heading,
        y_label,
        axes: None,
        lines,
        floor: None,
    }
}

/// Returns the heading of a panel of a metric column, and the label of its axis.
fn metric_labels(column: &str, metric: &MetricSpec) -> [String; 2] {
    let (display, row) = (MetricDisplay::for_metric(metric), metric.row);
    let named = (column != row.name).then(|| format!("column {column}"));
    let (heading, label) = match display.complement() {
        Some(best) => (
            format!("{best} − {}", row.long_name),
            format!("{best} − {}", row.label),
        ),
        None if display.is_magnitude() => (
            format!("{} (absolute value)", capitalised(row.long_name)),
            format!("|{}|", row.label),
        ),
        None => (capitalised(row.long_name), row.label.to_owned()),
    };
    let details = [named.unwrap_or_default(), metric.describe_options()];
    let parts = [heading].into_iter().chain(details);
    let parts: Vec<String> = parts.filter(|part| !part.is_empty()).collect();
    [parts.join(", "), format::with_unit(&label, &metric.unit())]
}

fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters
        .next()
        .map(|first| first.to_uppercase().chain(letters).collect())
        .unwrap_or_default()
}

/// Marks the lines that share a series with another line as thin.
fn mark_shared(lines: &mut [Line]) {
    let mut counts: BTreeMap<usize, usize> = BTreeMap::new();
    for line in lines.iter() {
        *counts.entry(line.series).or_default() += 1;
    }
    for line in lines {
        line.thin = counts[&line.series] > 1;
    }
}

/// Describes what each line averages. Takes the series and the number of runs of each line.
fn averaging(lines: &[(usize, usize)]) -> String {
    let runs = || lines.iter().map(|(_, runs)| *runs);
    let (least, most) = (runs().min().unwrap_or(0), runs().max().unwrap_or(0));
    let count = if least == most {
        most.to_string()
    } else {
        format!("{least} to {most}")
    };
    match most {
        0 | 1 if lines.windows(2).any(|two| two[0].0 == two[1].0) => {
            "one thin line per run".to_owned()
        }
        0 | 1 => String::new(),
        2 => format!("mean of {count} repeats; band: range of the two repeats"),
        _ => format!(
            "mean of {count} repeats; band: 95 % confidence interval of the mean \
             (of two repeats: their range)"
        ),
    }
}

/// Describes what the points of lines over an axis average, unless each is a single run.
fn sweep_averaging(over: &SweepAxis, groups: &Lines, panels: &[Panel]) -> Option<String> {
    let repeats = |(series, members): &(usize, Vec<Member>)| {
        let mut counts = vec![0; over.values.len()];
        for index in members.iter().filter_map(|m| over.index(m.run)) {
            counts[index] += 1;
        }
        let counts = counts.into_iter().filter(|count| *count > 0);
        let series = *series;
        counts.map(move |count| (series, count)).collect::<Vec<_>>()
    };
    let text = averaging(&groups.iter().flat_map(repeats).collect::<Vec<_>>());
    let lines = panels.iter().flat_map(|panel| &panel.lines);
    let mut bands = lines.filter_map(|line| line.band.as_ref());
    let missing = if bands.any(|band| band.kind == BandKind::Single) {
        "; no band for lines with a single run at any point"
    } else {
        ""
    };
    text.starts_with("mean").then(|| text + missing)
}

/// Gives all panels the horizontal axis that covers them all, and each its vertical axis.
fn set_axes(panels: &mut [Panel], scales: &[Scale], x_axis: impl Fn(Vec<f64>) -> Option<Axis>) {
    let lines = panels.iter().flat_map(|panel| &panel.lines);
    let points = lines.flat_map(|line| {
        let curves = line.curves.iter().flat_map(|curve| &curve.points);
        curves.chain(line.points())
    });
    let x_axis = x_axis(points.map(|(x, _)| *x).collect());
    for (panel, scale) in panels.iter_mut().zip(scales) {
        let values = covered(&panel.lines, None, *scale);
        panel.axes = x_axis.clone().zip(Axis::new(*scale, values));
    }
}

/// Writes a point of a column as CSV, in values of its metric: the axis values of the first run,
/// the position, and the mean with its ends and its number of runs.
fn csv_row(
    (study, first, column): (&Study, &Member, &str),
    x: String,
    display: Option<MetricDisplay>,
    (mean, ends, runs): (f64, Option<(f64, f64)>, usize),
) -> String {
    let axes = study.axes();
    let values = axes.iter().map(|axis| first.run.axis_value(axis));
    let mut fields: Vec<String> = values.map(Option::unwrap_or_default).collect();
    let ends = ends.map(|ends| display.map_or(ends, |display| display.metric_ends(ends)));
    let bound = |bound: Option<f64>| bound.map(format::exact).unwrap_or_default();
    fields.extend([
        column.to_owned(),
        x,
        format::exact(display.map_or(mean, |display| display.metric_value(mean))),
        bound(ends.map(|ends| ends.0)),
        bound(ends.map(|ends| ends.1)),
        runs.to_string(),
    ]);
    csv_line(&fields)
}

/// Returns a stem such as `convergence_scene=box_depth=5`, reduced to characters that are safe in
/// file names and different from all stems in `taken`.
pub(super) fn unique_stem(
    name: &str,
    facet: &[(String, String)],
    taken: &mut BTreeSet<String>,
) -> String {
    let parts = std::iter::once(name.to_owned())
        .chain(facet.iter().map(|(axis, value)| format!("{axis}={value}")));
    let safe = |c: char| {
        if c.is_ascii_alphanumeric() || "-_=.".contains(c) {
            c
        } else {
            '_'
        }
    };
    let mut stem: String = parts
        .collect::<Vec<_>>()
        .join("_")
        .chars()
        .map(safe)
        .take(LONGEST_STEM)
        .collect();
    if stem.is_empty() || stem.starts_with('.') {
        stem.insert(0, '_');
    }
    let mut unique = stem.clone();
    let mut number = 2;
    // Some file systems ignore case, so stems must differ in more than case.
    while !taken.insert(unique.to_lowercase()) {
        unique = format!("{stem}-{number}");
        number += 1;
    }
    unique
}
