//! Data of the panels of convergence figures: one panel for each facet, one line for each series.

use crate::experiment::WaveRow;
use crate::experiment::spec::FigureX;
use crate::output::plot::axis::{Axis, Scale};
use crate::output::plot::style::{Style, style};
use crate::output::report::metric_display::MetricDisplay;
use crate::output::report::repeats::{Band, MetricCurve, band};
use crate::output::report::study::{Member, Study};

/// Data of one panel.
pub(in crate::output::report) struct FacetPanel {
    pub(in crate::output::report) heading: String,
    /// Horizontal and vertical axis; `None` if nothing can be drawn.
    pub(in crate::output::report) axes: Option<(Axis, Axis)>,
    pub(in crate::output::report) lines: Vec<SeriesLine>,
    /// Drawn noise floor of the reference that all series share, if known.
    pub(in crate::output::report) floor: Option<f64>,
}

/// One series in a panel.
pub(in crate::output::report) struct SeriesLine {
    pub(in crate::output::report) series: usize,
    pub(in crate::output::report) style: Style,
    pub(in crate::output::report) band: Option<Band>,
    /// Curves of the runs; empty for a line of single values.
    pub(super) curves: Vec<MetricCurve>,
    /// End point of each finished run.
    pub(in crate::output::report) stops: Vec<(f64, f64)>,
    /// Drawn noise floor of the series' reference, if series have different references.
    pub(in crate::output::report) floor: Option<f64>,
}

impl SeriesLine {
    /// Creates a line of single values, each with a filled marker.
    pub(in crate::output::report) fn from_band(series: usize, band: Band) -> SeriesLine {
        let stops = band.mean.clone();
        SeriesLine {
            series,
            style: style(series),
            band: Some(band),
            curves: Vec::new(),
            stops,
            floor: None,
        }
    }
}

/// Collects the data of one facet. If `device` is given, only runs on it are included.
pub(super) fn panel(
    study: &Study,
    facet: usize,
    metric: usize,
    x: FigureX,
    device: Option<&str>,
) -> FacetPanel {
    let display = MetricDisplay::for_metric(&study.metrics[metric]);
    let mut lines: Vec<SeriesLine> = (0..study.series.len())
        .filter(|series| device.is_none() || study.series[*series].device.as_deref() == device)
        .filter_map(|series| series_line(study, facet, series, metric, x))
        .collect();
    let highest = lines.iter().filter_map(|l| l.floor).reduce(f64::max);
    let shared_floor = highest.filter(|highest| {
        lines
            .iter()
            .filter_map(|l| l.floor)
            .all(|floor| floor > highest * (1.0 - 1e-9))
    });
    if shared_floor.is_some() {
        lines.iter_mut().for_each(|line| line.floor = None);
    }
    let points = lines.iter().flat_map(|l| &l.curves).flat_map(|c| &c.points);
    let mut x_axis = Axis::new(Scale::Log, points.map(|p| p.0));
    if let (Some(axis), FigureX::Samples) = (&mut x_axis, x) {
        // Numbers of samples are integers.
        axis.ticks.retain(|(value, _)| value.fract() == 0.0);
    }
    let y_values = y_values(&lines, shared_floor, display.scale);
    FacetPanel {
        heading: study.facet_label(facet),
        axes: x_axis.zip(Axis::new(display.scale, y_values)),
        lines,
        floor: shared_floor,
    }
}

/// Collects the line of a series. Returns `None` if nothing was measured.
fn series_line(
    study: &Study,
    facet: usize,
    series: usize,
    metric: usize,
    x: FigureX,
) -> Option<SeriesLine> {
    let display = MetricDisplay::for_metric(&study.metrics[metric]);
    let members = study.members(facet, series);
    let curve = |member: &Member| {
        let point = |row: &WaveRow| {
            let x = if x == FigureX::RenderS {
                row.render_s
            } else {
                row.samples as f64
            };
            Some((x, member.value(row, metric)?))
        };
        MetricCurve::new(display, member.run.rows.iter().filter_map(point))
    };
    let curves: Vec<MetricCurve> = members.iter().map(curve).collect();
    let finished = members.iter().zip(&curves).filter(|(m, _)| m.run.is_done());
    let stops = finished
        .filter_map(|(_, c)| c.points.last().copied())
        .collect();
    let floors = members.iter().filter_map(|member| {
        let mut floors = member.run.floors.iter();
        let (_, floor) = floors.find(|(c, _)| *c == study.metrics[metric].column)?;
        display.drawn_value(*floor)
    });
    let floor = floors.reduce(f64::max);
    let curves: Vec<MetricCurve> = curves
        .into_iter()
        .filter(|c| !c.points.is_empty())
        .collect();
    (!curves.is_empty()).then(|| SeriesLine {
        series,
        style: style(series),
        band: band(&curves),
        curves,
        stops,
        floor,
    })
}

/// Returns the values that the vertical axis covers: all points, and those ends of bands and noise
/// floors that are close to them. A wide band of few repeats would compress the curves.
fn y_values(lines: &[SeriesLine], shared_floor: Option<f64>, scale: Scale) -> Vec<f64> {
    let points = || {
        let curves = lines.iter().flat_map(|l| &l.curves);
        curves.flat_map(|c| &c.points).map(|p| p.1)
    };
    let ends = lines
        .iter()
        .filter_map(|l| l.band.as_ref())
        .flat_map(|b| &b.ends)
        .flat_map(|(a, b)| [*a, *b]);
    match scale {
        Scale::Log => {
            let (low, high) =
                points().fold((f64::INFINITY, 0.0f64), |(a, b), y| (a.min(y), b.max(y)));
            let is_close = |y: &f64| *y > low / 1.6 && *y < high * 1.6;
            let floors = lines.iter().filter_map(|l| l.floor).chain(shared_floor);
            points()
                .chain(ends.filter(is_close))
                .chain(floors.filter(|f| *f > low / 4.0))
                .collect()
        }
        Scale::Linear => points().chain(ends).collect(),
    }
}
