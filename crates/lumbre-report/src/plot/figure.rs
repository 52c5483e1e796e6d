//! Figures of curves as data, from which every format is written: [`draw`](super::draw::draw)
//! writes SVG, from which PNG and PDF follow, and reports write pgfplots.

use super::axis::{Axis, Scale};
use super::style::Style;
use crate::repeats::{Band, MetricCurve};

/// A figure: panels with curves of the same series.
pub struct Figure {
    /// Title of the document, which is not drawn.
    pub title: String,
    /// Text above the panels; empty in reports, whose captions say it.
    pub heading: String,
    /// Text below the panels; empty in reports.
    pub notes: String,
    /// Provenance, which is embedded in the file.
    pub description: String,
    /// Label of the horizontal axis of all panels.
    pub x_label: String,
    /// Panels, in rows from left to right.
    pub panels: Vec<Panel>,
    /// Series, by the index that lines have.
    pub series: Vec<SeriesEntry>,
}

/// A series as figures show it.
#[derive(Clone, Debug, PartialEq)]
pub struct SeriesEntry {
    /// Text at the ends of its lines, or in the legend; may be empty.
    pub label: String,
    /// Style of its lines.
    pub style: Style,
}

/// A panel of a figure.
pub struct Panel {
    /// Text above the panel; may be empty.
    pub heading: String,
    /// Label of the vertical axis.
    pub y_label: String,
    /// Horizontal and vertical axis; `None` if nothing can be drawn.
    pub axes: Option<(Axis, Axis)>,
    /// Lines, the first one at the back.
    pub lines: Vec<Line>,
    /// Drawn noise floor of the reference that all series share, if known.
    pub floor: Option<f64>,
}

/// A line of a panel: repeats of one configuration, or the values of a series over an axis.
pub struct Line {
    /// Index of its series.
    pub series: usize,
    /// Mean of its runs where all have values.
    pub band: Option<Band>,
    /// Curves of the runs; empty for a line of single values.
    pub curves: Vec<MetricCurve>,
    /// End point of each finished run, or all points of a line of single values.
    pub stops: Vec<(f64, f64)>,
    /// Drawn noise floor of the series' reference, if series have different references.
    pub floor: Option<f64>,
    /// Whether other lines of the panel belong to the same series. It is drawn thin then.
    pub thin: bool,
}

impl Line {
    /// Creates a line of single values, each with a filled marker.
    pub fn of_values(series: usize, band: Band) -> Line {
        let stops = band.mean.clone();
        Line {
            series,
            band: Some(band),
            curves: Vec::new(),
            stops,
            floor: None,
            thin: false,
        }
    }

    /// Returns the points of the line: its mean, or its first run where runs do not overlap.
    pub fn points(&self) -> &[(f64, f64)] {
        match (&self.band, self.curves.first()) {
            (Some(band), _) => &band.mean,
            (None, Some(curve)) => &curve.points,
            (None, None) => &[],
        }
    }
}

impl Figure {
    /// Returns the entry of a line's series.
    pub fn entry(&self, line: &Line) -> &SeriesEntry {
        &self.series[line.series]
    }
}

/// Returns the values that a vertical axis covers: all points, and those ends of bands and noise
/// floors that are close to them. A wide band of few repeats would compress the curves.
pub fn covered(lines: &[Line], floor: Option<f64>, scale: Scale) -> Vec<f64> {
    let of_line = |line: &Line| -> Vec<f64> {
        let runs = line.curves.iter().flat_map(|curve| &curve.points);
        let values = line.points().iter().filter(|_| line.curves.is_empty());
        runs.chain(values).map(|(_, y)| *y).collect()
    };
    let points: Vec<f64> = lines.iter().flat_map(of_line).collect();
    let bands = lines.iter().filter_map(|line| line.band.as_ref());
    let ends = bands
        .flat_map(|band| &band.ends)
        .flat_map(|(a, b)| [*a, *b]);
    let (low, high) = points
        .iter()
        .fold((f64::INFINITY, 0.0f64), |(a, b), y| (a.min(*y), b.max(*y)));
    let is_close = |y: &f64| scale == Scale::Linear || (*y > low / 1.6 && *y < high * 1.6);
    let floors = lines.iter().filter_map(|line| line.floor).chain(floor);
    let floors = floors.filter(|floor| scale == Scale::Log && *floor > low / 4.0);
    let beside = ends.filter(is_close).chain(floors);
    points.iter().copied().chain(beside).collect()
}
