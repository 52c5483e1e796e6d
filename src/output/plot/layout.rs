//! Lays out figures: title, panels side by side, legend below.

use super::axis::{Axis, TickLabel};
use super::style::{FAINT, FINE_GRID, FRAME, GRID, INK};
use super::svg::{Anchor, Drawing, Font, text_width, wrap};
use super::{Figure, HorizontalAxis, MetricPanel, PlotCurve};

const MARGIN: f64 = 18.0;
/// Width and height of the plot area of a panel.
const PLOT: (f64, f64) = (400.0, 290.0);
/// Space left of the plot area for tick labels and the axis label.
const LEFT: f64 = 72.0;
/// Space between panels.
const GAP: f64 = 26.0;
/// Space below the plot area for tick labels and the axis label.
const BELOW: f64 = 46.0;

const TITLE: Font = Font::strong(17.0);
const HEADING: Font = Font::strong(13.0);
const LABEL: Font = Font::new(12.5, INK);
const TICK: Font = Font::new(11.5, INK);
const SMALL: Font = Font::new(11.0, FAINT);

/// Length of the line of a legend entry.
const SAMPLE: f64 = 38.0;
/// Space between the line and the text of a legend entry.
const SAMPLE_GAP: f64 = 8.0;
/// Horizontal space between legend entries.
const ENTRY_GAP: f64 = 26.0;
/// Distance between rows of the legend.
const ROW: f64 = 20.0;
/// Minimum distance between markers of one curve.
const MARKER_EVERY: f64 = 46.0;
/// Opacity of the band of repeats.
const BAND: f64 = 0.18;
/// Minimum distance between drawn points of a curve; closer points are skipped.
const SHORTEST_STEP: f64 = 0.35;

/// Draws a figure as an SVG document.
pub fn draw(figure: &Figure) -> String {
    let panels = figure.panels.len().max(1) as f64;
    let width = 2.0 * MARGIN + panels * (LEFT + PLOT.0) + (panels - 1.0) * GAP;
    let mut drawing = Drawing::default();
    let mut y = draw_title(&mut drawing, figure, width);
    // Panels share the horizontal axis and start at the same height.
    let x_axis = horizontal_axis(figure);
    let name_height = x_axis
        .as_ref()
        .map_or(0.0, |axis| axis.rotated_label_extent(PLOT.0, TICK.size));
    let headings: Vec<Vec<(Font, String)>> = figure.panels.iter().map(heading).collect();
    let heading_height =
        headings.iter().map(Vec::len).max().unwrap_or(0) as f64 * (HEADING.size + 3.0);
    for (i, (panel, lines)) in figure.panels.iter().zip(&headings).enumerate() {
        let left = MARGIN + LEFT + i as f64 * (LEFT + PLOT.0 + GAP);
        for (line, (font, text)) in lines.iter().enumerate() {
            let baseline =
                y + heading_height - (lines.len() - 1 - line) as f64 * (HEADING.size + 3.0);
            drawing.text((left, baseline), *font, Anchor::Start, text);
        }
        draw_panel(
            &mut drawing,
            panel,
            (x_axis.as_ref(), name_height),
            &figure.x_label,
            (left, y + heading_height + 9.0),
        );
    }
    if figure.panels.is_empty() {
        drawing.text(
            (MARGIN, y + HEADING.size),
            SMALL,
            Anchor::Start,
            "none of this figure's metrics was measured",
        );
    }
    y += heading_height + 9.0 + PLOT.1 + BELOW + name_height;
    let height = legend(&mut drawing, figure, y + 22.0, width) + MARGIN;
    drawing.finish(width, height, &figure.title, &figure.description)
}

/// Draws title and subtitle and returns the top of the panels.
fn draw_title(drawing: &mut Drawing, figure: &Figure, width: f64) -> f64 {
    let mut y = MARGIN;
    for line in wrap(&figure.title, TITLE.size, width - 2.0 * MARGIN) {
        y += TITLE.size;
        drawing.text((MARGIN, y), TITLE, Anchor::Start, &line);
        y += 5.0;
    }
    for line in wrap(&figure.subtitle, SMALL.size, width - 2.0 * MARGIN)
        .iter()
        .filter(|line| !line.is_empty())
    {
        y += SMALL.size + 2.0;
        drawing.text((MARGIN, y), SMALL, Anchor::Start, line);
    }
    y + 14.0
}

fn horizontal_axis(figure: &Figure) -> Option<Axis> {
    let values = || {
        let curves = figure.panels.iter().flat_map(|p| &p.curves);
        curves.flat_map(|c| &c.points).map(|(x, _)| *x)
    };
    match &figure.across {
        HorizontalAxis::Numbers(scale) => Axis::new(*scale, values()),
        HorizontalAxis::Integers(scale) => Axis::new(*scale, values()).map(|mut axis| {
            axis.keep_integer_ticks();
            axis
        }),
        HorizontalAxis::Names(names) => Axis::named(names),
    }
}

fn heading(panel: &MetricPanel) -> Vec<(Font, String)> {
    let strong = wrap(&panel.heading, HEADING.size, PLOT.0)
        .into_iter()
        .map(|line| (HEADING, line));
    let small = wrap(&panel.details, SMALL.size, PLOT.0)
        .into_iter()
        .filter(|l| !l.is_empty())
        .map(|l| (SMALL, l));
    strong.chain(small).collect()
}

/// Draws a panel with its axes and curves. `name_height` is the height of rotated names below the
/// horizontal axis, 0 if they are not rotated.
fn draw_panel(
    drawing: &mut Drawing,
    panel: &MetricPanel,
    (x_axis, name_height): (Option<&Axis>, f64),
    x_label: &str,
    (left, top): (f64, f64),
) {
    let (width, height) = PLOT;
    let bottom = top + height;
    // Bands do not extend the range: a wide band of few repeats would compress the curves.
    let values = panel.curves.iter().flat_map(|c| &c.points).map(|(_, y)| *y);
    let axes = x_axis.zip(Axis::new(panel.scale, values));
    if let Some((x_axis, y_axis)) = &axes {
        let x = |value: f64| left + width * x_axis.position(value);
        let y = |value: f64| bottom - height * y_axis.position(value);
        for value in &x_axis.minor {
            drawing.line([x(*value), top, x(*value), bottom], FINE_GRID, 0.7);
        }
        for value in &y_axis.minor {
            drawing.line([left, y(*value), left + width, y(*value)], FINE_GRID, 0.7);
        }
        draw_horizontal_ticks(drawing, x_axis, &x, (top, bottom), name_height > 0.0);
        draw_vertical_ticks(drawing, y_axis, &y, (left, left + width));
        drawing.frame([left, top, width, height], FRAME);
        for curve in &panel.curves {
            draw_curve(drawing, curve, &x, &y, (top, bottom));
        }
    } else {
        drawing.frame([left, top, width, height], FRAME);
        let middle = (left + width / 2.0, top + height / 2.0);
        drawing.text(
            middle,
            SMALL,
            Anchor::Middle,
            "no value can be drawn (all are zero, negative or not finite)",
        );
    }
    drawing.text(
        (left + width / 2.0, bottom + 38.0 + name_height),
        LABEL,
        Anchor::Middle,
        x_label,
    );
    drawing.text_upwards(
        (left - LEFT + 14.0, top + height / 2.0),
        LABEL,
        Anchor::Middle,
        &panel.y_label,
    );
}

fn draw_horizontal_ticks(
    drawing: &mut Drawing,
    axis: &Axis,
    x: &impl Fn(f64) -> f64,
    (top, bottom): (f64, f64),
    rotated: bool,
) {
    for (value, label) in &axis.ticks {
        drawing.line([x(*value), top, x(*value), bottom], GRID, 0.8);
        drawing.line([x(*value), bottom, x(*value), bottom + 4.0], FRAME, 0.8);
        match label {
            TickLabel::Plain(text) if rotated => {
                drawing.text_upwards((x(*value) + 4.0, bottom + 8.0), TICK, Anchor::End, text);
            }
            label => drawing.tick_label((x(*value), bottom + 17.0), TICK, Anchor::Middle, label),
        }
    }
}

fn draw_vertical_ticks(
    drawing: &mut Drawing,
    axis: &Axis,
    y: &impl Fn(f64) -> f64,
    (left, right): (f64, f64),
) {
    for (value, label) in &axis.ticks {
        drawing.line([left, y(*value), right, y(*value)], GRID, 0.8);
        drawing.line([left - 4.0, y(*value), left, y(*value)], FRAME, 0.8);
        drawing.tick_label((left - 8.0, y(*value) + 4.0), TICK, Anchor::End, label);
    }
}

fn draw_curve(
    drawing: &mut Drawing,
    curve: &PlotCurve,
    x: &impl Fn(f64) -> f64,
    y: &impl Fn(f64) -> f64,
    (top, bottom): (f64, f64),
) {
    let bound = |upper: bool| {
        let ends = curve.points.iter().zip(&curve.ends);
        ends.map(move |((vx, _), (low, high))| {
            (
                x(*vx),
                y(if upper { *high } else { *low }).clamp(top, bottom),
            )
        })
    };
    let outline: Vec<(f64, f64)> = bound(false)
        .chain(bound(true).collect::<Vec<_>>().into_iter().rev())
        .collect();
    if outline.len() > 3 {
        drawing.area(&outline, curve.style.colour, BAND);
    }
    let distance = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).hypot(a.1 - b.1);
    let mut points: Vec<(f64, f64)> = Vec::new();
    let mut markers: Vec<(f64, f64)> = Vec::new();
    for (index, (vx, vy)) in curve.points.iter().enumerate() {
        let at = (x(*vx), y(*vy));
        let is_last = index + 1 == curve.points.len();
        if is_last
            || points
                .last()
                .is_none_or(|last| distance(*last, at) >= SHORTEST_STEP)
        {
            points.push(at);
        }
        if markers
            .last()
            .is_none_or(|last| distance(*last, at) >= MARKER_EVERY)
        {
            markers.push(at);
        }
    }
    if points.len() > 1 {
        drawing.curve(&points, curve.style, if curve.shared { 0.9 } else { 1.7 });
    }
    for at in markers {
        drawing.marker(at, curve.style);
    }
}

/// Draws the legend from `top` on and returns its bottom. The entries form one row if they fit,
/// otherwise columns.
fn legend(drawing: &mut Drawing, figure: &Figure, top: f64, width: f64) -> f64 {
    let room = width - 2.0 * MARGIN - LEFT;
    let entries: Vec<(Vec<String>, f64)> = figure
        .legend
        .iter()
        .map(|(text, _)| {
            let lines = wrap(text, LABEL.size, room - SAMPLE - SAMPLE_GAP);
            let widest = lines
                .iter()
                .map(|l| text_width(l, LABEL.size))
                .fold(0.0, f64::max);
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
            drawing.text(
                (x + SAMPLE + SAMPLE_GAP, baseline),
                LABEL,
                Anchor::Start,
                line,
            );
            bottom = bottom.max(baseline);
        }
        x += if one_row { *needed } else { column };
    }
    bottom
}
