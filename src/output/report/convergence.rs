//! Error against render time and against samples: a panel for each facet, a band for each series.

use super::crops::shorten;
use super::curve::{Band, BandKind, Curve, band};
use super::item::{Item, Kind, Provenance};
use super::pgfplots::Drawn;
use super::study::{Shown, Study};
use crate::experiment::spec::FigureX;
use crate::metrics::MetricSpec;
use crate::output::labels;
use crate::output::plot::axis::{Axis, Label, Scale};
use crate::output::plot::style::{FAINT, FRAME, INK, Style, style};
use crate::output::plot::svg::{Anchor, Drawing, Font, text_width, wrap};

/// Width of a figure over both columns of a page and over one, in points [ACM's two-column format].
pub const FULL: f64 = 506.0;
/// The width of one column.
pub const COLUMN: f64 = 241.0;
/// How much larger than on paper figures are shown on screens.
pub const SCREEN: f64 = 1.6;

/// Most panels of one figure, and of one row.
pub(super) const MOST_PANELS: usize = 6;
pub(super) const MOST_COLUMNS: usize = 3;

const PLOT_HEIGHT: f64 = 118.0;
const LEFT: f64 = 31.0;
const GAP: f64 = 12.0;
const HEAD: f64 = 24.0;
const FOOT: f64 = 31.0;
/// Room that direct labels may take to the right of a panel; longer ones go into a legend.
const WIDEST_LABEL: f64 = 44.0;
/// Most room that upright names below an axis may take; longer ones are cut.
const LONGEST_NAME: f64 = 88.0;
/// Least distance between the middles of labels of a horizontal axis.
const LABEL_ROOM: f64 = 19.0;

const HEADING: Font = Font::strong(8.5);
const LABEL: Font = Font::new(7.6, INK);
const TICK: Font = Font::new(7.0, INK);
const SMALL: Font = Font::new(7.2, FAINT);
const LIGHT_GRID: &str = "#e4e4e4";
const FLOOR: &str = "#d9d9d9";

/// One panel's data.
pub(super) struct Panel {
    pub(super) heading: String,
    pub(super) axes: Option<(Axis, Axis)>,
    pub(super) lines: Vec<Line>,
    /// The noise floor as drawn of the reference that all series share, where it is known.
    pub(super) floor: Option<f64>,
}

/// One series in a panel.
pub(super) struct Line {
    pub(super) series: usize,
    pub(super) style: Style,
    pub(super) band: Option<Band>,
    curves: Vec<Curve>,
    /// Where each run that finished stopped.
    pub(super) stops: Vec<(f64, f64)>,
    /// The noise floor as drawn of the series' own reference, where series have several.
    pub(super) floor: Option<f64>,
}

impl Line {
    /// A series of single values, each with its marker.
    pub(super) fn of(series: usize, band: Band) -> Line {
        let stops = band.mean.clone();
        Line { series, style: style(series), band: Some(band), curves: Vec::new(), stops, floor: None }
    }
}

/// The figures of one metric against one x: one, or several if there are more than six facets.
pub fn figures(study: &Study, metric: usize, x: FigureX) -> Vec<Item> {
    let spec = &study.metrics[metric];
    let word = if x == FigureX::RenderS { "time" } else { "samples" };
    let pages: Vec<Vec<usize>> =
        (0..study.facets.len()).collect::<Vec<_>>().chunks(MOST_PANELS).map(<[usize]>::to_vec).collect();
    // Times of several devices of one night never share an axis: each device has figures of its own.
    let apart = x == FigureX::RenderS && study.nights.len() == 1 && study.devices.len() > 1;
    let clocks: Vec<Option<usize>> = if apart { (0..study.devices.len()).map(Some).collect() } else { vec![None] };
    let page = |clock: Option<usize>, number: usize, facets: &Vec<usize>| {
        let device = clock.map(|i| study.devices[i].as_str());
        let panels: Vec<Panel> = facets.iter().map(|facet| panel(study, *facet, metric, x, device)).collect();
        if panels.iter().all(|panel| panel.axes.is_none()) {
            return None;
        }
        let mut suffix = clock.map_or_else(String::new, |i| format!("-device-{}", i + 1));
        if pages.len() > 1 {
            suffix += &format!("-{}", number + 1);
        }
        let shown = Shown::of(spec);
        let y_label = labels::with_unit(&shown.label(spec), &spec.unit());
        let x_label = device.map_or_else(|| x_label(study, x), |device| format!("render time (s) on {device}"));
        let title = format!("{} against {}", shown.label(spec), if word == "time" { "render time" } else { "samples" });
        let mut caption = caption(study, spec, &panels, x);
        if let Some(device) = device {
            caption += &format!(" Shown are the runs on {device}.");
        }
        let provenance = provenance(study, facets);
        let svg = draw(study, &panels, &y_label, &x_label, &title, &provenance.text());
        let stem = format!("figures/error-{word}-{}{suffix}", spec.column);
        let x_name = if x == FigureX::Samples { "samples per pixel" } else { "render time (s)" };
        let scales = [Scale::Log, shown.scale];
        let drawn = Drawn { study, panels: &panels, y_label: &y_label, x_label: x_name, scales };
        let extra = drawn.files(&stem, &caption, &provenance);
        Some(Item { kind: Kind::Figure, stem, title, caption, svg: Some(svg), grid: None, extra, provenance })
    };
    let numbered = |clock| pages.iter().enumerate().map(move |(number, facets)| (clock, number, facets));
    let all = clocks.into_iter().flat_map(numbered);
    all.filter_map(|(clock, number, facets)| page(clock, number, facets)).collect()
}

pub(super) fn provenance(study: &Study, facets: &[usize]) -> Provenance {
    let members = facets.iter().flat_map(|f| (0..study.series.len()).map(move |s| (*f, s)));
    Provenance::of(members.flat_map(|(f, s)| study.members(f, s)))
}

fn x_label(study: &Study, x: FigureX) -> String {
    match x {
        FigureX::Samples => "samples per pixel".to_owned(),
        FigureX::RenderS if study.devices.len() == 1 => format!("render time (s) on {}", study.devices[0]),
        FigureX::RenderS => "render time (s)".to_owned(),
    }
}

/// The data of one facet; with a device, only of the runs on it.
fn panel(study: &Study, facet: usize, metric: usize, x: FigureX, device: Option<&str>) -> Panel {
    let shown = Shown::of(&study.metrics[metric]);
    let mut lines: Vec<Line> = Vec::new();
    for series in 0..study.series.len() {
        if device.is_some() && study.series[series].device.as_deref() != device {
            continue;
        }
        let members = study.members(facet, series);
        let curve = |member: &super::study::Member| {
            let point = |row: &crate::experiment::WaveRow| {
                let at = if x == FigureX::RenderS { row.render_s } else { row.samples as f64 };
                Some((at, member.value(row, metric)?))
            };
            Curve::new(shown, member.run.rows.iter().filter_map(point))
        };
        let curves: Vec<Curve> = members.iter().map(curve).collect();
        let stopped = members.iter().zip(&curves).filter(|(m, _)| m.run.done());
        let stops = stopped.filter_map(|(_, c)| c.points.last().copied()).collect();
        let floors = members.iter().filter_map(|member| {
            let own = member.run.floors.iter().find(|(c, _)| *c == study.metrics[metric].column);
            own.and_then(|(_, value)| shown.value(*value))
        });
        let floor = floors.reduce(f64::max);
        let curves: Vec<Curve> = curves.into_iter().filter(|c| !c.points.is_empty()).collect();
        if !curves.is_empty() {
            lines.push(Line { series, style: style(series), band: band(&curves), curves, stops, floor });
        }
    }
    let shared = lines.iter().filter_map(|l| l.floor).reduce(f64::max);
    let floor = shared.filter(|most| lines.iter().filter_map(|l| l.floor).all(|own| own > most * (1.0 - 1e-9)));
    if floor.is_some() {
        lines.iter_mut().for_each(|line| line.floor = None);
    }
    let points = || lines.iter().flat_map(|l| &l.curves).flat_map(|c| &c.points);
    let ends = lines.iter().filter_map(|l| l.band.as_ref()).flat_map(|b| &b.ends).flat_map(|(a, b)| [*a, *b]);
    // A band that reaches far below its curve, as that of few wild repeats, must not squeeze the curves.
    let (low, high) = points().map(|p| p.1).fold((f64::INFINITY, 0.0f64), |(a, b), y| (a.min(y), b.max(y)));
    let near = |y: &f64| *y > low / 1.6 && *y < high * 1.6;
    let floors = lines.iter().filter_map(|l| l.floor).chain(floor);
    let y_values: Vec<f64> = match shown.scale {
        Scale::Log => points().map(|p| p.1).chain(ends.filter(near)).chain(floors.filter(|f| *f > low / 4.0)).collect(),
        Scale::Linear => points().map(|p| p.1).chain(ends).collect(),
    };
    let mut x_axis = Axis::new(Scale::Log, points().map(|p| p.0));
    if let (Some(axis), FigureX::Samples) = (&mut x_axis, x) {
        // There are no parts of samples.
        axis.ticks.retain(|(value, _)| value.fract() == 0.0);
    }
    let axes = x_axis.zip(Axis::new(shown.scale, y_values));
    Panel { heading: study.facet_label(facet), axes, lines, floor }
}

/// The picture of these panels.
pub(super) fn draw(
    study: &Study,
    panels: &[Panel],
    y_label: &str,
    x_label: &str,
    title: &str,
    description: &str,
) -> String {
    let columns = panels.len().min(MOST_COLUMNS);
    let rows = panels.len().div_ceil(columns);
    let widest = study.series.iter().map(|s| text_width(&s.full(), LABEL.size)).fold(0.0, f64::max);
    let direct = widest <= WIDEST_LABEL && study.series.len() <= 8;
    let right = if direct { widest + 9.0 } else { 6.0 };
    let width = if columns == 1 { COLUMN } else { FULL };
    let plot = (width - columns as f64 * (LEFT + right) - (columns - 1) as f64 * GAP) / columns as f64;
    let upright = |panel: &Panel| panel.axes.as_ref().map_or(0.0, |(x, _)| x.upright(plot, TICK.size));
    let upright = panels.iter().map(upright).fold(0.0, f64::max).min(LONGEST_NAME);
    let foot = FOOT + upright;
    let mut drawing = Drawing::default();
    let headings = panels.iter().any(|p| !p.heading.is_empty());
    let head = if headings { HEAD } else { HEAD - 10.0 };
    for (i, panel) in panels.iter().enumerate() {
        let left = LEFT + (i % columns) as f64 * (LEFT + plot + right + GAP);
        let top = head + (i / columns) as f64 * (head + PLOT_HEIGHT + foot);
        if headings {
            let room = plot + right;
            let line = wrap(&panel.heading, HEADING.size, room).swap_remove(0);
            drawing.text((left, top - 14.0), HEADING, Anchor::Start, &line);
        }
        drawing.text((left, top - 4.5), SMALL, Anchor::Start, y_label);
        draw_panel(&mut drawing, study, panel, [left, top, plot, PLOT_HEIGHT], (direct, upright > 0.0));
        if i + columns >= panels.len() {
            drawing.text((left + plot / 2.0, top + PLOT_HEIGHT + 22.0 + upright), LABEL, Anchor::Middle, x_label);
        }
    }
    let mut height = rows as f64 * (head + PLOT_HEIGHT + foot);
    if !direct {
        height = legend(&mut drawing, study, panels, height + 8.0, width);
    }
    drawing.finish_scaled(width, height + 2.0, SCREEN, title, description)
}

fn draw_panel(
    drawing: &mut Drawing,
    study: &Study,
    panel: &Panel,
    [left, top, width, height]: [f64; 4],
    (direct, upright): (bool, bool),
) {
    let bottom = top + height;
    let Some((x_axis, y_axis)) = &panel.axes else {
        drawing.frame([left, top, width, height], FRAME);
        drawing.text((left + width / 2.0, top + height / 2.0), SMALL, Anchor::Middle, "nothing measured yet");
        return;
    };
    let x = |value: f64| left + width * x_axis.place(value);
    let y = |value: f64| (bottom - height * y_axis.place(value)).clamp(top, bottom);
    let all = vec![true; x_axis.ticks.len()];
    for ((value, label), named) in x_axis.ticks.iter().zip(if upright { all } else { labelled(x_axis, &x) }) {
        drawing.line([x(*value), top, x(*value), bottom], LIGHT_GRID, 0.5);
        drawing.line([x(*value), bottom, x(*value), bottom + 2.5], FRAME, 0.6);
        match label {
            Label::Plain(text) if upright => {
                let text = shorten(text, TICK.size, LONGEST_NAME);
                drawing.text_upwards((x(*value) + 2.4, bottom + 5.0), TICK, Anchor::End, &text);
            }
            label if named => drawing.tick_label((x(*value), bottom + 10.5), TICK, Anchor::Middle, label),
            _ => {}
        }
    }
    for (value, label) in &y_axis.ticks {
        drawing.line([left, y(*value), left + width, y(*value)], LIGHT_GRID, 0.5);
        drawing.line([left - 2.5, y(*value), left, y(*value)], FRAME, 0.6);
        drawing.tick_label((left - 4.5, y(*value) + 2.4), TICK, Anchor::End, label);
    }
    if let Some(floor) = panel.floor.filter(|f| y_axis.place(*f) > 0.0) {
        let at = y(floor);
        drawing.area(&[(left, at), (left + width, at), (left + width, bottom), (left, bottom)], FLOOR, 0.55);
        drawing.dashed([left, at, left + width, at], FAINT, 0.7, "1.2 1.8");
        let baseline = if at + 8.5 < bottom - 2.0 { at + 8.5 } else { at - 2.5 };
        drawing.text((left + 3.0, baseline), SMALL, Anchor::Start, "noise of the reference");
    }
    for line in &panel.lines {
        let Some(floor) = line.floor.filter(|f| y_axis.place(*f) > 0.0) else { continue };
        drawing.dashed([left, y(floor), left + width, y(floor)], line.style.colour, 0.7, "1.2 1.8");
    }
    for line in &panel.lines {
        let Some(band) = line.band.as_ref().filter(|b| !b.ends.is_empty()) else { continue };
        let upper = band.mean.iter().zip(&band.ends).map(|((vx, _), (_, high))| (x(*vx), y(*high)));
        let lower = band.mean.iter().zip(&band.ends).rev().map(|((vx, _), (low, _))| (x(*vx), y(*low)));
        drawing.area(&upper.chain(lower).collect::<Vec<_>>(), line.style.colour, 0.16);
    }
    for line in &panel.lines {
        if let Some(band) = &line.band {
            let points: Vec<(f64, f64)> = band.mean.iter().map(|(vx, vy)| (x(*vx), y(*vy))).collect();
            drawing.curve(&points, line.style, 1.2);
            // Single values have filled markers, at every one of them.
            let mut place = if line.curves.is_empty() { f64::INFINITY } else { f64::NEG_INFINITY };
            let offset = 6.0 * line.series as f64;
            for at in points.iter().filter(|p| p.0 > left + offset + 4.0) {
                if at.0 - place >= 34.0 && left + width - at.0 > 7.0 {
                    drawing.marker_of(*at, line.style, 0.56, "#ffffff", line.style.colour);
                    place = at.0;
                }
            }
        }
        // What each run measured before and beyond the places that all of them reached.
        let mean = line.band.as_ref().map_or(&[][..], |band| &band.mean);
        let [first, common] = [mean.first(), mean.last()].map(|end| end.map_or(0.0, |(vx, _)| *vx));
        for curve in &line.curves {
            let before = curve.points.iter().filter(|(vx, _)| *vx < first).copied();
            let to = curve.at(first).map(|vy| (first, vy));
            let points: Vec<(f64, f64)> = before.chain(to).map(|(vx, vy)| (x(vx), y(vy))).collect();
            if points.len() > 1 {
                drawing.curve(&points, line.style, 0.5);
            }
            let from = curve.at(common).map(|vy| (common, vy));
            let rest = curve.points.iter().filter(|(vx, _)| *vx > common).copied();
            let points: Vec<(f64, f64)> = from.into_iter().chain(rest).map(|(vx, vy)| (x(vx), y(vy))).collect();
            if points.len() > 1 {
                drawing.curve(&points, line.style, 0.5);
            }
        }
        for (vx, vy) in &line.stops {
            drawing.marker_of((x(*vx), y(*vy)), line.style, 0.62, line.style.colour, "#ffffff");
        }
    }
    drawing.line([left, top, left, bottom], FRAME, 0.6);
    drawing.line([left, bottom, left + width, bottom], FRAME, 0.6);
    if direct {
        direct_labels(drawing, study, panel, (left + width, top, bottom), &x, &y);
    }
}

/// Which ticks of a horizontal axis bear labels: all, or powers of ten alone, or every so many, whichever first keeps
/// them apart.
pub(super) fn labelled(axis: &Axis, x: &impl Fn(f64) -> f64) -> Vec<bool> {
    let power = |i: usize| {
        let exponent = axis.ticks[i].0.log10();
        !axis.named && (exponent - exponent.round()).abs() < 1e-9
    };
    let count = axis.ticks.len();
    let apart = |keep: &dyn Fn(usize) -> bool| {
        let kept: Vec<f64> = (0..count).filter(|i| keep(*i)).map(|i| x(axis.ticks[i].0)).collect();
        kept.len() >= count.min(2) && kept.windows(2).all(|pair| pair[1] - pair[0] >= LABEL_ROOM)
    };
    if !apart(&|_| true) && apart(&power) {
        return (0..count).map(power).collect();
    }
    let every = (1..=count).find(|n| apart(&|i: usize| i.is_multiple_of(*n))).unwrap_or(1);
    (0..count).map(|i| i.is_multiple_of(every)).collect()
}

/// The name of every series at its right end, moved apart where two would overlap.
fn direct_labels(
    drawing: &mut Drawing,
    study: &Study,
    panel: &Panel,
    (right, top, bottom): (f64, f64, f64),
    x: &impl Fn(f64) -> f64,
    y: &impl Fn(f64) -> f64,
) {
    let step = LABEL.size + 1.4;
    let mut ends: Vec<(&Line, f64, f64)> = Vec::new();
    for line in &panel.lines {
        let points = line.band.as_ref().map_or_else(|| &line.curves[0].points, |band| &band.mean);
        ends.extend(points.last().map(|(vx, vy)| (line, x(*vx), y(*vy))));
    }
    ends.sort_by(|a, b| a.2.total_cmp(&b.2));
    let mut places: Vec<f64> = ends.iter().map(|e| e.2.max(top + step / 2.0)).collect();
    for i in 1..places.len() {
        places[i] = places[i].max(places[i - 1] + step);
    }
    if let Some(last) = places.last_mut() {
        *last = last.min(bottom - 2.0);
    }
    for i in (1..places.len()).rev() {
        places[i - 1] = places[i - 1].min(places[i] - step);
    }
    for ((line, from, at), place) in ends.iter().zip(places) {
        if (place - at).abs() > 2.5 || right - from > 6.0 {
            drawing.dashed([from + 3.5, *at, right + 4.0, place], line.style.colour, 0.4, "0.7 1.3");
        }
        let font = Font { size: LABEL.size, fill: line.style.colour, strong: true };
        drawing.text((right + 5.5, place + 2.5), font, Anchor::Start, &study.series[line.series].full());
    }
}

/// A legend below the panels, in columns; returns where it ends.
fn legend(drawing: &mut Drawing, study: &Study, panels: &[Panel], top: f64, width: f64) -> f64 {
    let used = |s: &usize| panels.iter().any(|p| p.lines.iter().any(|l| l.series == *s));
    let used: Vec<usize> = (0..study.series.len()).filter(used).collect();
    let entry = |s: usize| text_width(&study.series[s].full(), LABEL.size) + 26.0;
    let column = used.iter().map(|s| entry(*s)).fold(40.0, f64::max) + 10.0;
    let columns = (((width - LEFT) / column) as usize).max(1);
    for (i, series) in used.iter().enumerate() {
        let (at, baseline) = (LEFT + (i % columns) as f64 * column, top + (i / columns) as f64 * 11.0);
        let look = style(*series);
        drawing.curve(&[(at, baseline - 2.5), (at + 20.0, baseline - 2.5)], look, 1.2);
        drawing.marker_of((at + 10.0, baseline - 2.5), look, 0.56, "#ffffff", look.colour);
        drawing.text((at + 24.0, baseline), LABEL, Anchor::Start, &study.series[*series].full());
    }
    top + used.len().div_ceil(columns) as f64 * 11.0
}

fn caption(study: &Study, spec: &MetricSpec, panels: &[Panel], x: FigureX) -> String {
    let options = spec.describe_options();
    let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
    let mut sentences = vec![format!(
        "{}{options} against {}.",
        labels::metric_title(spec),
        if x == FigureX::RenderS { "seconds inside the renderer" } else { "samples per pixel" }
    )];
    let bands = || panels.iter().flat_map(|p| &p.lines).filter_map(|l| Some((l.band.as_ref()?, l.curves.len())));
    let runs = bands().map(|(_, n)| n).fold((usize::MAX, 0), |(a, b), n| (a.min(n), b.max(n)));
    let mean = if Shown::of(spec).scale == Scale::Log { "Geometric mean" } else { "Mean" };
    let counted = if runs.0 == runs.1 { runs.1.to_string() } else { format!("{} to {}", runs.0, runs.1) };
    match bands().map(|(band, _)| band.kind).max() {
        Some(BandKind::Confidence) => sentences
            .push(format!("{mean} of {counted} repeats; band: 95 % confidence interval of the mean by Student's t.")),
        Some(BandKind::Range) => {
            sentences.push(format!("{mean} of {counted} repeats; band: the range of the two."));
        }
        _ => sentences.push("One run each.".to_owned()),
    }
    sentences.push("Filled markers: where a run stopped.".to_owned());
    if panels.iter().any(|p| p.floor.is_some()) {
        sentences.push("Grey: below the noise of the reference, where curves measure the reference.".to_owned());
    }
    if panels.iter().flat_map(|p| &p.lines).any(|line| line.floor.is_some()) {
        sentences.push(
            "Dotted: the noise of each series' own reference, below which its curve measures the reference.".to_owned(),
        );
    }
    if x == FigureX::RenderS {
        let clock = study.clock();
        if !clock.is_empty() {
            sentences.push(format!("Measured {clock}.").replace("Measured times", "Times"));
        }
    }
    let named = study.series.iter().filter_map(|s| s.long.map(|long| (s.label.clone(), long)));
    let mut long: Vec<String> = named.map(|(short, long)| format!("{short}: {long}")).collect();
    long.dedup();
    long.sort();
    long.dedup();
    if !long.is_empty() {
        sentences.push(long.join("; ") + ".");
    }
    sentences.join(" ")
}
