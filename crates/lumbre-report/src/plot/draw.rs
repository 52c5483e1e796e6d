//! Draws figures of curves as SVG.

use std::collections::BTreeSet;

use super::axis::Axis;
use super::figure::{Figure, Line, Panel};
use super::style::{FAINT, FRAME, INK, Style};
use super::svg::{Anchor, Drawing, Font, TickLabel, shorten, text_width, wrap};
use crate::plot::sizes::{COLUMN, FULL, SCREEN, columns};

const PLOT_HEIGHT: f64 = 118.0;
/// Space left of a plot for tick labels.
const LEFT: f64 = 31.0;
/// Space between panels.
const GAP: f64 = 12.0;
/// Space above a plot for the heading and the axis label.
const HEAD: f64 = 24.0;
/// Space below a plot for tick labels and the axis label.
const FOOT: f64 = 31.0;
/// Space below the heading of a figure.
const HEADING_GAP: f64 = 5.0;
/// Maximum width of series labels right of a panel; wider labels are moved to a legend.
const WIDEST_LABEL: f64 = 46.0;
/// Width of bold letters over that of normal ones.
const BOLD: f64 = 1.06;
/// Maximum height of rotated names below an axis; longer names are shortened.
const LONGEST_NAME: f64 = 88.0;
/// Minimum distance between the centres of labels on a horizontal axis.
const LABEL_ROOM: f64 = 19.0;

const HEADING: Font = Font::strong(8.5);
/// Distance between the lines of a heading.
const HEADING_LINE: f64 = HEADING.size + 2.0;
const LABEL: Font = Font::new(7.6, INK);
const TICK: Font = Font::new(7.0, INK);
const SMALL: Font = Font::new(7.2, FAINT);
const LIGHT_GRID: &str = "#e4e4e4";
/// Fill colour below the noise floor.
const FLOOR: &str = "#d9d9d9";
/// Dash pattern of noise floors.
const FLOOR_DASH: &str = "1.2 1.8";

/// Plot area of a panel and its mapping from values to coordinates.
struct PlotArea<'a> {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    width: f64,
    height: f64,
    x_axis: &'a Axis,
    y_axis: &'a Axis,
}

impl PlotArea<'_> {
    fn x(&self, value: f64) -> f64 {
        self.left + self.width * self.x_axis.position(value)
    }

    /// Returns the vertical coordinate, clamped to the plot area.
    fn y(&self, value: f64) -> f64 {
        (self.bottom - self.height * self.y_axis.position(value)).clamp(self.top, self.bottom)
    }

    fn point(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (self.x(x), self.y(y))
    }
}

/// Draws the panels in [`columns`].
pub fn draw(figure: &Figure) -> String {
    let panels = &figure.panels;
    let columns = columns(panels.len());
    let rows = panels.len().div_ceil(columns);
    let widest = figure
        .series
        .iter()
        .map(|entry| BOLD * text_width(&entry.label, LABEL.size))
        .fold(0.0, f64::max);
    let direct = widest <= WIDEST_LABEL && figure.series.len() <= 8;
    let right = if direct { widest + 9.0 } else { 6.0 };
    let width = if columns == 1 { COLUMN } else { FULL };
    let plot =
        (width - columns as f64 * (LEFT + right) - (columns - 1) as f64 * GAP) / columns as f64;
    let name_height = panels
        .iter()
        .filter_map(|panel| panel.axes.as_ref())
        .map(|(x, _)| x.rotated_label_extent(plot, TICK.size))
        .fold(0.0, f64::max)
        .min(LONGEST_NAME);
    let foot = FOOT + name_height;
    let mut drawing = Drawing::default();
    let mut first = draw_lines(&mut drawing, HEADING, &figure.heading, [0.0, width]);
    if first > 0.0 {
        first += HEADING_GAP;
    }
    let has_headings = panels.iter().any(|p| !p.heading.is_empty());
    let lines_of = |panel: &Panel| wrap(&panel.heading, HEADING.size, plot + right);
    let (head, headings) = if has_headings {
        let headings: Vec<Vec<String>> = panels.iter().map(lines_of).collect();
        let most = headings.iter().map(Vec::len).max().unwrap_or(1);
        (HEAD + HEADING_LINE * (most - 1) as f64, headings)
    } else {
        (HEAD - 10.0, vec![Vec::new(); panels.len()])
    };
    for (i, (panel, heading)) in panels.iter().zip(&headings).enumerate() {
        let left = LEFT + (i % columns) as f64 * (LEFT + plot + right + GAP);
        let top = first + head + (i / columns) as f64 * (head + PLOT_HEIGHT + foot);
        draw_head(&mut drawing, heading, &panel.y_label, [left, top]);
        draw_panel(
            &mut drawing,
            figure,
            panel,
            [left, top, plot, PLOT_HEIGHT],
            (direct, name_height > 0.0),
        );
        if i + columns >= panels.len() {
            drawing.text(
                (left + plot / 2.0, top + PLOT_HEIGHT + 22.0 + name_height),
                LABEL,
                Anchor::Middle,
                &figure.x_label,
            );
        }
    }
    let mut height = first + rows as f64 * (head + PLOT_HEIGHT + foot);
    if panels.is_empty() {
        let text = "none of this figure's metrics was measured";
        height = draw_lines(&mut drawing, SMALL, text, [height, width]);
    }
    if !direct {
        height = legend(&mut drawing, figure, height + 8.0, width);
    }
    height = draw_lines(&mut drawing, SMALL, &figure.notes, [height, width]);
    drawing.finish_scaled(
        width,
        height + 2.0,
        SCREEN,
        &figure.title,
        &figure.description,
    )
}

/// Writes text in lines below `top` and returns the bottom, which is `top` for an empty text.
fn draw_lines(drawing: &mut Drawing, font: Font, text: &str, [top, width]: [f64; 2]) -> f64 {
    let mut bottom = top;
    for line in wrap(text, font.size, width) {
        if !line.is_empty() {
            bottom += font.size + 2.0;
            drawing.text((0.0, bottom), font, Anchor::Start, &line);
        }
    }
    bottom
}

/// Draws the lines of a panel's heading and the label of its vertical axis above its left top corner.
fn draw_head(drawing: &mut Drawing, heading: &[String], y_label: &str, [left, top]: [f64; 2]) {
    for (i, line) in heading.iter().rev().enumerate() {
        let bottom = top - 14.0 - HEADING_LINE * i as f64;
        drawing.text((left, bottom), HEADING, Anchor::Start, line);
    }
    drawing.text((left, top - 4.5), SMALL, Anchor::Start, y_label);
}

/// Draws one panel. `direct` is whether series are labelled at their right ends, `rotated` whether
/// names on the horizontal axis are rotated.
fn draw_panel(
    drawing: &mut Drawing,
    figure: &Figure,
    panel: &Panel,
    [left, top, width, height]: [f64; 4],
    (direct, rotated): (bool, bool),
) {
    let Some((x_axis, y_axis)) = &panel.axes else {
        drawing.frame([left, top, width, height], FRAME);
        drawing.text(
            (left + width / 2.0, top + height / 2.0),
            SMALL,
            Anchor::Middle,
            "nothing to draw: no value is positive and finite",
        );
        return;
    };
    let area = PlotArea {
        left,
        right: left + width,
        top,
        bottom: top + height,
        width,
        height,
        x_axis,
        y_axis,
    };
    draw_grid(drawing, &area, rotated);
    draw_floors(drawing, &area, figure, panel);
    let style = |line: &Line| figure.entry(line).style;
    for line in &panel.lines {
        draw_band(drawing, &area, line, style(line));
    }
    for line in &panel.lines {
        draw_line(drawing, &area, line, style(line));
    }
    drawing.line([left, top, left, area.bottom], FRAME, 0.6);
    drawing.line([left, area.bottom, area.right, area.bottom], FRAME, 0.6);
    if direct {
        direct_labels(drawing, figure, panel, &area);
    }
}

/// Draws grid lines, ticks and tick labels.
fn draw_grid(drawing: &mut Drawing, area: &PlotArea, rotated: bool) {
    let bottom = area.bottom;
    let has_label = if rotated {
        vec![true; area.x_axis.ticks.len()]
    } else {
        labelled_ticks(area.x_axis, &|value| area.x(value))
    };
    for ((value, label), has_label) in area.x_axis.ticks.iter().zip(has_label) {
        let x = area.x(*value);
        drawing.line([x, area.top, x, bottom], LIGHT_GRID, 0.5);
        drawing.line([x, bottom, x, bottom + 2.5], FRAME, 0.6);
        match label {
            TickLabel::Plain(text) if rotated => {
                let text = shorten(text, TICK.size, LONGEST_NAME);
                drawing.text_upwards((x + 2.4, bottom + 5.0), TICK, Anchor::End, &text);
            }
            label if has_label => {
                drawing.tick_label((x, bottom + 10.5), TICK, Anchor::Middle, label)
            }
            _ => {}
        }
    }
    for (value, label) in &area.y_axis.ticks {
        let y = area.y(*value);
        drawing.line([area.left, y, area.right, y], LIGHT_GRID, 0.5);
        drawing.line([area.left - 2.5, y, area.left, y], FRAME, 0.6);
        drawing.tick_label((area.left - 4.5, y + 2.4), TICK, Anchor::End, label);
    }
}

/// Draws the noise floor that all series share, and those of single series.
fn draw_floors(drawing: &mut Drawing, area: &PlotArea, figure: &Figure, panel: &Panel) {
    let &PlotArea {
        left,
        right,
        bottom,
        ..
    } = area;
    let is_inside = |floor: &f64| area.y_axis.position(*floor) > 0.0;
    if let Some(floor) = panel.floor.filter(is_inside) {
        let y = area.y(floor);
        drawing.area(
            &[(left, y), (right, y), (right, bottom), (left, bottom)],
            FLOOR,
            0.55,
        );
        drawing.dashed([left, y, right, y], FAINT, 0.7, FLOOR_DASH);
        let baseline = if y + 8.5 < bottom - 2.0 {
            y + 8.5
        } else {
            y - 2.5
        };
        drawing.text(
            (left + 3.0, baseline),
            SMALL,
            Anchor::Start,
            "noise of the reference",
        );
    }
    for line in &panel.lines {
        if let Some(floor) = line.floor.filter(is_inside) {
            let y = area.y(floor);
            let style = figure.entry(line).style;
            drawing.dashed([left, y, right, y], style.colour.text(), 0.7, FLOOR_DASH);
        }
    }
}

/// Fills the band of a line.
fn draw_band(drawing: &mut Drawing, area: &PlotArea, line: &Line, style: Style) {
    let Some(band) = line.band.as_ref().filter(|b| !b.ends.is_empty()) else {
        return;
    };
    let ends = || band.mean.iter().zip(&band.ends);
    let upper = ends().map(|((x, _), (_, high))| area.point((*x, *high)));
    let lower = ends()
        .rev()
        .map(|((x, _), (low, _))| area.point((*x, *low)));
    drawing.area(
        &upper.chain(lower).collect::<Vec<_>>(),
        style.colour.text(),
        0.16,
    );
}

/// Draws the mean of a line, thin curves of the runs outside of the common range, and a filled
/// marker where each run stopped.
fn draw_line(drawing: &mut Drawing, area: &PlotArea, line: &Line, style: Style) {
    let colour = style.colour.text();
    if let Some(band) = &line.band {
        let points: Vec<(f64, f64)> = band.mean.iter().map(|p| area.point(*p)).collect();
        drawing.curve(&points, style, if line.thin { 0.7 } else { 1.2 });
        // Lines of single values have a filled marker at every value instead.
        let mut last = if line.curves.is_empty() {
            f64::INFINITY
        } else {
            f64::NEG_INFINITY
        };
        let offset = 6.0 * line.series as f64;
        for at in points.iter().filter(|p| p.0 > area.left + offset + 4.0) {
            if at.0 - last >= 34.0 && area.right - at.0 > 7.0 {
                drawing.sized_marker(*at, style, 0.56, "#ffffff", colour);
                last = at.0;
            }
        }
    }
    let mean = line.band.as_ref().map_or(&[][..], |band| &band.mean);
    let [first, last] = [mean.first(), mean.last()].map(|end| end.map_or(0.0, |(x, _)| *x));
    for curve in &line.curves {
        let before = curve.points.iter().filter(|(x, _)| *x < first).copied();
        let start = curve.at(first).map(|y| (first, y));
        let before: Vec<(f64, f64)> = before.chain(start).map(|p| area.point(p)).collect();
        let end = curve.at(last).map(|y| (last, y));
        let after = curve.points.iter().filter(|(x, _)| *x > last).copied();
        let after: Vec<(f64, f64)> = end
            .into_iter()
            .chain(after)
            .map(|p| area.point(p))
            .collect();
        for points in [before, after] {
            if points.len() > 1 {
                drawing.curve(&points, style, 0.5);
            }
        }
    }
    for stop in &line.stops {
        drawing.sized_marker(area.point(*stop), style, 0.62, colour, "#ffffff");
    }
}

/// Returns which ticks of a horizontal axis have labels. Tries all ticks, then powers of ten, then
/// every n-th tick, until the labels do not overlap.
pub fn labelled_ticks(axis: &Axis, x: &impl Fn(f64) -> f64) -> Vec<bool> {
    let is_power = |i: usize| {
        let exponent = axis.ticks[i].0.log10();
        !axis.named && (exponent - exponent.round()).abs() < 1e-9
    };
    let count = axis.ticks.len();
    let fits = |is_labelled: &dyn Fn(usize) -> bool| {
        let labels: Vec<f64> = (0..count)
            .filter(|i| is_labelled(*i))
            .map(|i| x(axis.ticks[i].0))
            .collect();
        labels.len() >= count.min(2)
            && labels
                .windows(2)
                .all(|pair| pair[1] - pair[0] >= LABEL_ROOM)
    };
    if !fits(&|_| true) && fits(&is_power) {
        return (0..count).map(is_power).collect();
    }
    let every = (1..=count)
        .find(|n| fits(&|i: usize| i.is_multiple_of(*n)))
        .unwrap_or(1);
    (0..count).map(|i| i.is_multiple_of(every)).collect()
}

/// Writes the label of every series at its right end, moved vertically so that labels do not
/// overlap.
fn direct_labels(drawing: &mut Drawing, figure: &Figure, panel: &Panel, area: &PlotArea) {
    let step = LABEL.size + 1.4;
    let mut ends: Vec<(&Line, (f64, f64))> = Vec::new();
    for line in &panel.lines {
        let is_labelled = ends.iter().any(|(other, _)| other.series == line.series);
        if !is_labelled && !figure.entry(line).label.is_empty() {
            ends.extend(line.points().last().map(|end| (line, area.point(*end))));
        }
    }
    ends.sort_by(|a, b| a.1.1.total_cmp(&b.1.1));
    let mut labels: Vec<f64> = ends
        .iter()
        .map(|(_, end)| end.1.max(area.top + step / 2.0))
        .collect();
    for i in 1..labels.len() {
        labels[i] = labels[i].max(labels[i - 1] + step);
    }
    if let Some(last) = labels.last_mut() {
        *last = last.min(area.bottom - 2.0);
    }
    for i in (1..labels.len()).rev() {
        labels[i - 1] = labels[i - 1].min(labels[i] - step);
    }
    for ((line, (x, y)), label) in ends.iter().zip(labels) {
        let entry = figure.entry(line);
        let colour = entry.style.colour.text();
        if (label - y).abs() > 2.5 || area.right - x > 6.0 {
            drawing.dashed(
                [x + 3.5, *y, area.right + 4.0, label],
                colour,
                0.4,
                "0.7 1.3",
            );
        }
        let font = Font {
            size: LABEL.size,
            fill: colour,
            strong: true,
        };
        drawing.text(
            (area.right + 5.5, label + 2.5),
            font,
            Anchor::Start,
            &entry.label,
        );
    }
}

/// Draws a legend in columns below the panels and returns its bottom.
fn legend(drawing: &mut Drawing, figure: &Figure, top: f64, width: f64) -> f64 {
    let lines = figure.panels.iter().flat_map(|panel| &panel.lines);
    let mut drawn: BTreeSet<usize> = lines.map(|line| line.series).collect();
    drawn.retain(|series| !figure.series[*series].label.is_empty());
    let label = |s: usize| shorten(&figure.series[s].label, LABEL.size, width - LEFT - 26.0);
    let entry_width = |s: usize| text_width(&label(s), LABEL.size) + 26.0;
    let column = drawn.iter().map(|s| entry_width(*s)).fold(40.0, f64::max) + 10.0;
    let columns = (((width - LEFT) / column) as usize).max(1);
    for (i, series) in drawn.iter().enumerate() {
        let (x, baseline) = (
            LEFT + (i % columns) as f64 * column,
            top + (i / columns) as f64 * 11.0,
        );
        let y = baseline - 2.5;
        let style = figure.series[*series].style;
        drawing.curve(&[(x, y), (x + 20.0, y)], style, 1.2);
        drawing.sized_marker((x + 10.0, y), style, 0.56, "#ffffff", style.colour.text());
        drawing.text((x + 24.0, baseline), LABEL, Anchor::Start, &label(*series));
    }
    top + drawn.len().div_ceil(columns) as f64 * 11.0
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plot::axis::Scale;

    #[test]
    fn headings_wider_than_their_panel_are_drawn_whole() {
        let axis = || Axis::new(Scale::Linear, [0.0, 1.0]);
        let panel = |heading: &str| Panel {
            heading: heading.to_owned(),
            y_label: "1 - SSIM".to_owned(),
            axes: axis().zip(axis()),
            lines: Vec::new(),
            floor: None,
        };
        let figure = |headings: &[&str]| Figure {
            title: String::new(),
            heading: String::new(),
            notes: String::new(),
            description: String::new(),
            x_label: "samples".to_owned(),
            panels: headings.iter().map(|heading| panel(heading)).collect(),
            series: Vec::new(),
        };
        let long =
            "Structural similarity, range 1, window uniform, on display values in sRGB, exposure 0";
        let [short, both] = [&["RMSE", "RMSE"], &["RMSE", long]].map(|h| draw(&figure(h)));
        for word in long.split(' ') {
            assert!(both.contains(word), "{word} is not drawn");
        }
        let height = |svg: &str| -> f64 {
            let (_, rest) = svg.split_once("height=\"").unwrap();
            rest.split_once('"').unwrap().0.parse().unwrap()
        };
        assert!(height(&both) > height(&short) + HEADING_LINE);
    }
}
