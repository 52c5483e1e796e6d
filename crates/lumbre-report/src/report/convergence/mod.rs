//! Figures of error against render time and against samples: one panel for each facet, one line
//! with a band for each series.
//!
//! The module `panel` collects the data.

pub(super) mod panel;

use super::item::ReportItem;
use super::pgfplots::PgfFigure;
use super::study::Study;
use crate::format;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::{Axis, Scale};
use crate::plot::draw::draw;
use crate::plot::figure::{Figure, Panel};
use crate::plot::sizes::MOST_PANELS;
use crate::provenance::Provenance;
use crate::repeats::BandKind;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::spec::FigureX;
use panel::panel;

/// One figure of a metric: a page of facets, on all devices or on one.
struct FigurePage<'a> {
    x: FigureX,
    /// Index of the metric in the study.
    metric: usize,
    /// Facets shown as panels.
    facets: &'a [usize],
    /// Number from 1, if there are several pages.
    number: Option<usize>,
    /// Index of the only device, if devices have separate figures.
    device: Option<usize>,
}

/// Draws the figures of one metric. There are several if there are more facets than panels fit on a
/// figure, or if a night used several devices: their times never share an axis.
pub fn figures(study: &Study, metric: usize, x: FigureX) -> Vec<ReportItem> {
    let facets: Vec<usize> = (0..study.facets.len()).collect();
    let pages: Vec<&[usize]> = facets.chunks(MOST_PANELS).collect();
    let mut items = Vec::new();
    for device in separate_devices(study, x.row().is_clock) {
        for (i, facets) in pages.iter().enumerate() {
            let page = FigurePage {
                x,
                metric,
                facets,
                number: (pages.len() > 1).then_some(i + 1),
                device,
            };
            items.extend(page.item(study));
        }
    }
    items
}

/// Returns the devices that need separate figures, or a single `None` if one figure shows all.
/// `timed` is whether the figure shows times.
pub(super) fn separate_devices(study: &Study, timed: bool) -> Vec<Option<usize>> {
    if timed && study.nights.len() == 1 && study.devices.len() > 1 {
        (0..study.devices.len()).map(Some).collect()
    } else {
        vec![None]
    }
}

impl FigurePage<'_> {
    /// Draws the figure. Returns `None` if nothing was measured.
    fn item(&self, study: &Study) -> Option<ReportItem> {
        let spec = &study.metrics[self.metric];
        let display = MetricDisplay::for_metric(spec);
        let device = self.device.map(|i| study.devices[i].as_str());
        let mut panels: Vec<Panel> = self
            .facets
            .iter()
            .map(|facet| panel(study, *facet, self.metric, self.x, device))
            .collect();
        let axes = panels.iter_mut().filter_map(|panel| panel.axes.as_mut());
        let (mut across, mut upwards): (Vec<&mut Axis>, Vec<&mut Axis>) =
            axes.map(|(x, y)| (x, y)).unzip();
        Axis::share_format(&mut across);
        Axis::share_format(&mut upwards);
        if panels.iter().all(|panel| panel.axes.is_none()) {
            return None;
        }
        let mut suffix = self
            .device
            .map_or_else(String::new, |i| format!("-device-{}", i + 1));
        suffix += &self.number.map_or_else(String::new, |n| format!("-{n}"));
        let x = self.x.row();
        let x_label = device.map_or_else(
            || x_label(study, self.x),
            |device| format!("{} on {device}", x.label),
        );
        let title = format!("{} against {}", display.label(spec), x.quantity);
        let mut caption = caption(study, spec, &panels, self.x);
        if let Some(device) = device {
            caption += &format!(" Only runs on {device}.");
        }
        let provenance = provenance(study, self.facets);
        let figure = Figure {
            title: title.clone(),
            heading: String::new(),
            notes: String::new(),
            description: provenance.text(),
            x_label,
            panels,
            series: study.entries(),
        };
        let stem = format!("figures/error-{}-{}{suffix}", x.file, spec.column);
        let latex = PgfFigure {
            figure: &figure,
            x_label: x.label,
            scales: [Scale::Log, display.scale],
        };
        let extra = latex.files(&stem, &caption, &provenance);
        let section = format!("Error against {}", x.label);
        let svg = draw(&figure);
        Some(ReportItem {
            extra,
            ..ReportItem::figure(&section, stem, title, caption, svg, provenance)
        })
    }
}

/// Returns the provenance of all runs of some facets.
pub(super) fn provenance(study: &Study, facets: &[usize]) -> Provenance {
    let members = facets
        .iter()
        .flat_map(|f| (0..study.series.len()).map(move |s| (*f, s)));
    Provenance::from_members(members.flat_map(|(f, s)| study.members(f, s)))
}

fn x_label(study: &Study, x: FigureX) -> String {
    let row = x.row();
    match study.devices.as_slice() {
        [device] if row.is_clock => format!("{} on {device}", row.label),
        _ => row.label.to_owned(),
    }
}

fn caption(study: &Study, spec: &MetricSpec, panels: &[Panel], x: FigureX) -> String {
    let mut sentences = vec![
        format!(
            "{} against {}.",
            format::metric_description(spec),
            x.row().caption
        ),
        averaging(spec, panels),
        "Filled markers: ends of runs.".to_owned(),
    ];
    if panels.len() > 1 {
        sentences.push("Each panel has ranges of its own.".to_owned());
    }
    if panels.iter().any(|p| p.floor.is_some()) {
        sentences.push(
            "Grey: below the noise of the reference, where a curve measures the error of the \
             reference."
                .to_owned(),
        );
    }
    if panels
        .iter()
        .flat_map(|p| &p.lines)
        .any(|line| line.floor.is_some())
    {
        sentences.push(
            "Dotted: noise of the reference of each series, below which its curve measures the \
             error of the reference."
                .to_owned(),
        );
    }
    if x.row().is_clock {
        sentences.extend(study.device_sentence("Measured"));
    }
    sentences.extend(study.bias_sentences());
    let mut names: Vec<String> = study
        .series
        .iter()
        .filter_map(|s| Some((&s.label, s.long?)))
        .filter(|(label, long)| label != long)
        .map(|(label, long)| format!("{label}: {long}"))
        .collect();
    names.sort();
    names.dedup();
    if !names.is_empty() {
        sentences.push(names.join("; ") + ".");
    }
    sentences.join(" ")
}

/// Describes what the lines average and what the bands show.
fn averaging(spec: &MetricSpec, panels: &[Panel]) -> String {
    let lines = || {
        panels
            .iter()
            .flat_map(|p| &p.lines)
            .filter(|line| line.band.is_some())
    };
    let (least, most) = lines()
        .map(|line| line.curves.len())
        .fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
    let repeats = if least == most {
        format!("{most} repeats")
    } else {
        format!("{least} to {most} repeats")
    };
    let scale = MetricDisplay::for_metric(spec).scale;
    mean_and_band(scale, panels, &repeats).unwrap_or_else(|| "One run each.".to_owned())
}

/// Describes the mean of some repeats and the widest kind of band of some panels. Returns `None` if
/// there is no band.
pub(super) fn mean_and_band(scale: Scale, panels: &[Panel], repeats: &str) -> Option<String> {
    let lines = panels.iter().flat_map(|panel| &panel.lines);
    let kinds = lines.filter_map(|line| Some(line.band.as_ref()?.kind));
    let band = match kinds.max()? {
        BandKind::Single => return None,
        BandKind::Range => "range of the two repeats",
        BandKind::Confidence => "95 % confidence interval of the mean (Student's t)",
    };
    Some(format!("{} of {repeats}. Band: {band}.", mean_name(scale)))
}

/// Returns the name of the mean on an axis, as the beginning of a sentence.
pub(super) fn mean_name(scale: Scale) -> &'static str {
    if scale == Scale::Log {
        "Geometric mean"
    } else {
        "Mean"
    }
}
