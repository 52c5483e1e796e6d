//! Data of the panels of convergence figures: one panel for each facet, one line for each series.

use crate::format;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::{Axis, Scale};
use crate::plot::figure::{Line, Panel, covered};
use crate::repeats::{MetricCurve, band};
use crate::report::study::{Member, Study};
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::spec::FigureX;

/// Collects the data of one facet. If `device` is given, only runs on it are included.
pub(super) fn panel(
    study: &Study,
    facet: usize,
    metric: usize,
    x: FigureX,
    device: Option<&str>,
) -> Panel {
    let display = MetricDisplay::for_metric(&study.metrics[metric]);
    let mut lines: Vec<Line> = (0..study.series.len())
        .filter(|series| device.is_none() || study.series[*series].device.as_deref() == device)
        .filter_map(|series| {
            let members = study.members(facet, series);
            line_of_repeats(study, series, &members, metric, x)
        })
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
    let x_axis = x_axis(x, points.map(|p| p.0));
    let y_values = covered(&lines, shared_floor, display.scale);
    let spec = &study.metrics[metric];
    Panel {
        heading: study.facet_label(facet),
        y_label: format::with_unit(&display.label(spec), &spec.unit()),
        axes: x_axis.zip(Axis::new(display.scale, y_values)),
        lines,
        floor: shared_floor,
    }
}

/// Returns the horizontal axis that covers some values.
pub(in crate::report) fn x_axis(x: FigureX, values: impl Iterator<Item = f64>) -> Option<Axis> {
    let mut axis = Axis::new(Scale::Log, values)?;
    if x.row().is_whole {
        axis.ticks.retain(|(value, _)| value.fract() == 0.0);
    }
    Some(axis)
}

/// Collects the line of some repeats of a series. Returns `None` if nothing was measured.
pub(in crate::report) fn line_of_repeats(
    study: &Study,
    series: usize,
    members: &[Member],
    metric: usize,
    x: FigureX,
) -> Option<Line> {
    let display = MetricDisplay::for_metric(&study.metrics[metric]);
    let curve = |member: &Member| {
        let point = |row: &WaveRow| Some(((x.row().value)(row), member.value(row, metric)?));
        MetricCurve::new(display, member.run.rows.iter().filter_map(point))
    };
    let curves: Vec<MetricCurve> = members.iter().map(curve).collect();
    let finished = members.iter().zip(&curves).filter(|(m, _)| m.run.is_done());
    let stops = finished
        .filter_map(|(_, c)| c.points.last().copied())
        .collect();
    let floors = members.iter().filter_map(|member| {
        let floor = member.run.floor(&study.metrics[metric].column)?;
        display.drawn_value(floor.value)
    });
    let floor = floors.reduce(f64::max);
    let curves: Vec<MetricCurve> = curves
        .into_iter()
        .filter(|c| !c.points.is_empty())
        .collect();
    (!curves.is_empty()).then(|| Line {
        series,
        thin: false,
        band: band(&curves),
        curves,
        stops,
        floor,
    })
}
