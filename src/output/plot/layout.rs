//! Places a figure's parts: title, panels side by side, legend below.

use super::axis::{Axis, Label};
use super::style::{FAINT, FINE_GRID, FRAME, GRID, INK};
use super::svg::{Anchor, Drawing, Font, text_width, wrap};
use super::{Across, Curve, Figure, Panel};

const MARGIN: f64 = 18.0;
/// Width and height of the area in which curves are drawn.
const PLOT: (f64, f64) = (400.0, 290.0);
/// Room left of that area for tick labels and the axis label.
const LEFT: f64 = 72.0;
/// Room between panels.
const GAP: f64 = 26.0;
/// Room below that area for tick labels and the axis label.
const BELOW: f64 = 46.0;

const TITLE: Font = Font::strong(17.0);
const HEADING: Font = Font::strong(13.0);
const LABEL: Font = Font::new(12.5, INK);
const TICK: Font = Font::new(11.5, INK);
const SMALL: Font = Font::new(11.0, FAINT);

/// Length of the sample of a curve in the legend.
const SAMPLE: f64 = 38.0;
/// Room between that and its text.
const SAMPLE_GAP: f64 = 8.0;
/// Room between entries of the legend in a row.
const ENTRY_GAP: f64 = 26.0;
/// Distance between rows of the legend.
const ROW: f64 = 20.0;
/// Least distance between markers of one curve.
const MARKER_EVERY: f64 = 46.0;
/// Opacity of the band of repeats.
const BAND: f64 = 0.18;
/// Points closer than this to the last one drawn add nothing.
const SHORTEST_STEP: f64 = 0.35;

/// The figure as an SVG document.
pub fn draw(figure: &Figure) -> String {
    let panels = figure.panels.len().max(1) as f64;
    let width = 2.0 * MARGIN + panels * (LEFT + PLOT.0) + (panels - 1.0) * GAP;
    let mut drawing = Drawing::default();
    let mut y = MARGIN;
    for line in wrap(&figure.title, TITLE.size, width - 2.0 * MARGIN) {
        y += TITLE.size;
        drawing.text((MARGIN, y), TITLE, Anchor::Start, &line);
        y += 5.0;
    }
    for line in wrap(&figure.subtitle, SMALL.size, width - 2.0 * MARGIN).iter().filter(|line| !line.is_empty()) {
        y += SMALL.size + 2.0;
        drawing.text((MARGIN, y), SMALL, Anchor::Start, line);
    }
    y += 14.0;

    // Panels share the horizontal axis and start at the same height.
    let all = || figure.panels.iter().flat_map(|p| &p.curves).flat_map(|c| &c.points);
    let x_axis = match &figure.across {
        Across::Numbers(scale) => Axis::new(*scale, all().map(|(x, _)| *x)),
        Across::Whole(scale) => Axis::new(*scale, all().map(|(x, _)| *x)).map(|mut axis| {
            axis.whole();
            axis
        }),
        Across::Names(names) => Axis::named(names),
    };
    let upright = x_axis.as_ref().map_or(0.0, |axis| axis.upright(PLOT.0, TICK.size));
    let heads: Vec<Vec<(Font, String)>> = figure.panels.iter().map(heading).collect();
    let head = heads.iter().map(Vec::len).max().unwrap_or(0) as f64 * (HEADING.size + 3.0);
    for (i, (panel, lines)) in figure.panels.iter().zip(&heads).enumerate() {
        let left = MARGIN + LEFT + i as f64 * (LEFT + PLOT.0 + GAP);
        for (line, (font, text)) in lines.iter().enumerate() {
            let baseline = y + head - (lines.len() - 1 - line) as f64 * (HEADING.size + 3.0);
            drawing.text((left, baseline), *font, Anchor::Start, text);
        }
        draw_panel(&mut drawing, panel, (x_axis.as_ref(), upright), &figure.x_label, (left, y + head + 9.0));
    }
    if figure.panels.is_empty() {
        drawing.text((MARGIN, y + HEADING.size), SMALL, Anchor::Start, "none of the figure's metrics is measured");
    }
    y += head + 9.0 + PLOT.1 + BELOW + upright;
    let height = legend(&mut drawing, figure, y + 22.0, width) + MARGIN;
    drawing.finish(width, height, &figure.title, &figure.description)
}

fn heading(panel: &Panel) -> Vec<(Font, String)> {
    let strong = wrap(&panel.heading, HEADING.size, PLOT.0).into_iter().map(|line| (HEADING, line));
    let small = wrap(&panel.details, SMALL.size, PLOT.0).into_iter().filter(|l| !l.is_empty()).map(|l| (SMALL, l));
    strong.chain(small).collect()
}

fn draw_panel(
    drawing: &mut Drawing,
    panel: &Panel,
    (x_axis, upright): (Option<&Axis>, f64),
    x_label: &str,
    (left, top): (f64, f64),
) {
    let (width, height) = PLOT;
    let bottom = top + height;
    // A band that reaches far below its curve, as that of few wild repeats, must not squeeze the curves.
    let values = panel.curves.iter().flat_map(|c| &c.points).map(|(_, y)| *y);
    let axes = x_axis.zip(Axis::new(panel.scale, values));
    if let Some((x_axis, y_axis)) = &axes {
        let x = |value: f64| left + width * x_axis.place(value);
        let y = |value: f64| bottom - height * y_axis.place(value);
        x_axis.minor.iter().for_each(|v| drawing.line([x(*v), top, x(*v), bottom], FINE_GRID, 0.7));
        y_axis.minor.iter().for_each(|v| drawing.line([left, y(*v), left + width, y(*v)], FINE_GRID, 0.7));
        for (value, label) in &x_axis.ticks {
            drawing.line([x(*value), top, x(*value), bottom], GRID, 0.8);
            drawing.line([x(*value), bottom, x(*value), bottom + 4.0], FRAME, 0.8);
            match label {
                Label::Plain(text) if upright > 0.0 => {
                    drawing.text_upwards((x(*value) + 4.0, bottom + 8.0), TICK, Anchor::End, text);
                }
                label => drawing.tick_label((x(*value), bottom + 17.0), TICK, Anchor::Middle, label),
            }
        }
        for (value, label) in &y_axis.ticks {
            drawing.line([left, y(*value), left + width, y(*value)], GRID, 0.8);
            drawing.line([left - 4.0, y(*value), left, y(*value)], FRAME, 0.8);
            drawing.tick_label((left - 8.0, y(*value) + 4.0), TICK, Anchor::End, label);
        }
        drawing.frame([left, top, width, height], FRAME);
        for curve in &panel.curves {
            draw_curve(drawing, curve, &x, &y, (top, bottom));
        }
    } else {
        drawing.frame([left, top, width, height], FRAME);
        let middle = (left + width / 2.0, top + height / 2.0);
        drawing.text(middle, SMALL, Anchor::Middle, "no value can be drawn: none is finite and positive");
    }
    drawing.text((left + width / 2.0, bottom + 38.0 + upright), LABEL, Anchor::Middle, x_label);
    drawing.text_upwards((left - LEFT + 14.0, top + height / 2.0), LABEL, Anchor::Middle, &panel.y_label);
}

fn draw_curve(
    drawing: &mut Drawing,
    curve: &Curve,
    x: &impl Fn(f64) -> f64,
    y: &impl Fn(f64) -> f64,
    (top, bottom): (f64, f64),
) {
    let end = |high: bool| {
        let ends = curve.points.iter().zip(&curve.ends);
        ends.map(move |((vx, _), (low, up))| (x(*vx), y(if high { *up } else { *low }).clamp(top, bottom)))
    };
    let outline: Vec<(f64, f64)> = end(false).chain(end(true).collect::<Vec<_>>().into_iter().rev()).collect();
    if outline.len() > 3 {
        drawing.area(&outline, curve.style.colour, BAND);
    }
    let distance = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).hypot(a.1 - b.1);
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut markers: Vec<(f64, f64)> = Vec::new();
    for (index, (vx, vy)) in curve.points.iter().enumerate() {
        let at = (x(*vx), y(*vy));
        let end = index + 1 == curve.points.len();
        if end || points.last().is_none_or(|last| distance(*last, at) >= SHORTEST_STEP) {
            points.push(at);
        }
        if markers.last().is_none_or(|last| distance(*last, at) >= MARKER_EVERY) {
            markers.push(at);
        }
    }
    if points.len() > 1 {
        drawing.curve(&points, curve.style, if curve.shared { 0.9 } else { 1.7 });
    }
    markers.into_iter().for_each(|at| drawing.marker(at, curve.style));
}

/// Draws the legend's entries from `top` on, in one row or else in columns, and returns where it ends.
fn legend(drawing: &mut Drawing, figure: &Figure, top: f64, width: f64) -> f64 {
    let room = width - 2.0 * MARGIN - LEFT;
    let entries: Vec<(Vec<String>, f64)> = figure
        .legend
        .iter()
        .map(|(text, _)| {
            let lines = wrap(text, LABEL.size, room - SAMPLE - SAMPLE_GAP);
            let widest = lines.iter().map(|l| text_width(l, LABEL.size)).fold(0.0, f64::max);
            (lines, SAMPLE + SAMPLE_GAP + widest + ENTRY_GAP)
        })
        .collect();
    let one_row = entries.iter().map(|(_, w)| w).sum::<f64>() <= room + ENTRY_GAP;
    let column = entries.iter().map(|(_, w)| *w).fold(1.0, f64::max);
    let columns = (((room + ENTRY_GAP) / column).floor() as usize).max(1);
    let (mut x, mut y, mut bottom) = (MARGIN + LEFT, top, top);
    for (i, ((lines, needed), (_, style))) in entries.iter().zip(&figure.legend).enumerate() {
        if !one_row && i > 0 && i % columns == 0 {
            (x, y) = (MARGIN + LEFT, bottom + ROW);
        }
        drawing.curve(&[(x, y - 4.0), (x + SAMPLE, y - 4.0)], *style, 1.7);
        drawing.marker((x + SAMPLE / 2.0, y - 4.0), *style);
        for (j, line) in lines.iter().enumerate() {
            let baseline = y + j as f64 * (LABEL.size + 3.0);
            drawing.text((x + SAMPLE + SAMPLE_GAP, baseline), LABEL, Anchor::Start, line);
            bottom = bottom.max(baseline);
        }
        x += if one_row { *needed } else { column };
    }
    bottom
}
