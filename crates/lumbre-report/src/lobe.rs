//! Figures of a BSDF: its lobe in a plane as a polar plot, the density that it states on the sphere
//! beside that of its samples, and densities of delays beside histograms of draws.

use std::f64::consts::PI;

use super::OutputError;
use super::format::significant;
use super::plot::axis::{Axis, Scale};
use super::plot::style::{FAINT, FRAME, GRID, INK, style};
use super::plot::svg::{Anchor, Drawing, Font};
use super::png;
use lumbre_metrics::map::{Colours, ErrorMap};
use lumbre_render::lobe::fit::{COLUMNS, DelayFit, DirectionFit, ROWS};
use lumbre_render::lobe::{BINS, Lobe, STEPS, angle_of};

/// Content of a figure.
pub struct LobeFigure<'a> {
    /// Heading: the material and the direction from which it is seen.
    pub heading: &'a str,
    /// Description in the file's metadata.
    pub description: &'a str,
    /// Lobe in the plane of the normal and the direction to the viewer.
    pub lobe: &'a Lobe,
    /// Samples of the whole sphere beside the stated density.
    pub directions: &'a DirectionFit,
    /// Delays of the material, if it has any: a name, and samples beside the stated density.
    pub delays: &'a [(String, DelayFit)],
}

const WIDTH: f64 = 760.0;
const MARGIN: f64 = 28.0;
const TOP: f64 = 44.0;
/// Side of the polar plot, and height of the other panels of the first row.
const POLAR: f64 = 280.0;
/// Height of the maps and the histograms.
const PANEL: f64 = 150.0;
const GAP: f64 = 58.0;
const HEADING: Font = Font::strong(14.0);
const NAME: Font = Font::new(11.0, INK);
const SMALL: Font = Font::new(9.0, FAINT);

/// A rectangle: left, top, width, height.
type Area = [f64; 4];

/// Draws a figure as SVG.
///
/// # Errors
/// Returns an error if a map cannot be encoded.
pub fn draw(figure: &LobeFigure<'_>) -> Result<String, OutputError> {
    let mut drawing = Drawing::default();
    drawing.text((MARGIN, 24.0), HEADING, Anchor::Start, figure.heading);
    polar(&mut drawing, [MARGIN, TOP, POLAR, POLAR], figure.lobe);
    let left = MARGIN + POLAR + GAP;
    let right = WIDTH - MARGIN - left;
    slice(
        &mut drawing,
        [left, TOP + 16.0, right, POLAR - 56.0],
        figure.lobe,
    );
    let mut y = TOP + POLAR + GAP;
    let half = (WIDTH - 2.0 * MARGIN - GAP) / 2.0;
    let fit = figure.directions;
    let names = ["stated density", "density of samples"];
    for (i, (name, map)) in names.into_iter().zip([&fit.stated, &fit.drawn]).enumerate() {
        let x = MARGIN + i as f64 * (half + GAP);
        sphere(&mut drawing, [x, y, half, PANEL], name, map, fit)?;
    }
    let note = format!(
        "{} samples, {} % without a density; the density integrates to {}; chi-square test: p = {}",
        fit.samples,
        significant(
            100.0 * f64::from(fit.without_density) / f64::from(fit.samples),
            3
        ),
        significant(fit.mass, 4),
        significant(fit.p_value, 2),
    );
    drawing.text((MARGIN, y + PANEL + 42.0), NAME, Anchor::Start, &note);
    y += PANEL + GAP + 30.0;
    for pair in figure.delays.chunks(2) {
        for (i, (name, fit)) in pair.iter().enumerate() {
            let x = MARGIN + i as f64 * (half + GAP);
            delays(&mut drawing, [x + 20.0, y, half - 20.0, PANEL], name, fit);
        }
        y += PANEL + GAP;
    }
    Ok(drawing.finish(WIDTH, y, figure.heading, figure.description))
}

/// Draws the value times the cosine in the plane of normal and viewer.
fn polar(drawing: &mut Drawing, [x, y, w, h]: Area, lobe: &Lobe) {
    let title = "value times cosine";
    drawing.text((x, y), NAME, Anchor::Start, title);
    let most = lobe.greatest_value();
    let below = if lobe.is_transmissive() { 1.0 } else { 0.0 };
    let radius = ((h - 34.0) / (1.0 + below)).min(w / 2.0 - 14.0);
    let (cx, cy) = (x + w / 2.0, y + 20.0 + radius);
    let at = |angle: f64, r: f64| (cx + radius * r * angle.sin(), cy - radius * r * angle.cos());
    let reach = PI * (0.5 + 0.5 * below);
    for ring in [0.5, 1.0] {
        let arc: Vec<(f64, f64)> = (0..=96)
            .map(|i| at(reach * (f64::from(i) / 48.0 - 1.0), ring))
            .collect();
        for two in arc.windows(2) {
            drawing.line([two[0].0, two[0].1, two[1].0, two[1].1], GRID, 0.8);
        }
    }
    drawing.line([cx - radius, cy, cx + radius, cy], FRAME, 1.0);
    drawing.line([cx, cy, cx, cy - radius], GRID, 0.8);
    let (vx, vy) = at(-f64::from(lobe.angle), 1.0);
    drawing.dashed([cx, cy, vx, vy], FRAME, 1.0, "4 3");
    drawing.text((vx, vy - 5.0), SMALL, Anchor::Middle, "to the viewer");
    drawing.text((cx + radius, cy + 12.0), SMALL, Anchor::End, "90°");
    if most <= 0.0 {
        let text = "Dirac lobes only";
        return drawing.text((cx, cy - radius / 2.0), NAME, Anchor::Middle, text);
    }
    let points: Vec<(f64, f64)> = (0..=STEPS)
        .map(|step| at(f64::from(angle_of(step)), lobe.values[step] / most))
        .collect();
    drawing.area(&points, style(0).colour.text(), 0.15);
    drawing.curve(&points, style(0).solid(), 1.6);
    let scale = format!("outer circle: {} /sr", significant(most, 3));
    drawing.text((x + w, y), SMALL, Anchor::End, &scale);
}

/// Draws the density of samples near the plane as bars, and the stated density as a line.
fn slice(drawing: &mut Drawing, area: Area, lobe: &Lobe) {
    let degrees = |bin: usize| 360.0 * bin as f64 / BINS as f64 - 180.0;
    let bins = if lobe.is_transmissive() || lobe.histogram[..BINS / 4].iter().any(|d| *d > 0.0) {
        0..BINS
    } else {
        BINS / 4..3 * BINS / 4
    };
    let edges: Vec<f64> = (bins.start..=bins.end).map(degrees).collect();
    let name = "samples near the plane (bars), stated density (line)";
    let label = "angle from the normal (degrees), viewer at negative angles";
    let bars = Bars {
        edges: &edges,
        drawn: &lobe.histogram[bins.clone()],
        stated: &lobe.densities[bins],
        label,
        unit: "1/sr",
    };
    bars.draw(drawing, area, name);
}

/// A histogram with the density that it should follow.
struct Bars<'a> {
    edges: &'a [f64],
    drawn: &'a [f64],
    stated: &'a [f64],
    label: &'a str,
    unit: &'a str,
}

impl Bars<'_> {
    fn draw(&self, drawing: &mut Drawing, [x, y, w, h]: Area, name: &str) {
        drawing.text((x, y - 16.0), NAME, Anchor::Start, name);
        let most = self
            .drawn
            .iter()
            .chain(self.stated)
            .copied()
            .fold(0.0, f64::max);
        let ends = [self.edges[0], self.edges[self.edges.len() - 1]];
        let axes = (
            Axis::new(Scale::Linear, ends),
            Axis::new(Scale::Linear, [0.0, most]),
        );
        let (Some(across), Some(up)) = axes else {
            return;
        };
        let to_x = |v: f64| x + across.position(v) * w;
        let to_y = |v: f64| y + h - up.position(v) * h;
        for (value, label) in &up.ticks {
            drawing.line([x, to_y(*value), x + w, to_y(*value)], GRID, 0.6);
            drawing.tick_label((x - 4.0, to_y(*value) + 3.0), SMALL, Anchor::End, label);
        }
        for (value, label) in &across.ticks {
            drawing.tick_label((to_x(*value), y + h + 13.0), SMALL, Anchor::Middle, label);
        }
        let zero = to_y(0.0);
        for (two, density) in self.edges.windows(2).zip(self.drawn) {
            let (left, top) = (to_x(two[0]), to_y(*density));
            let bar = [left + 0.3, top, to_x(two[1]) - left - 0.6, zero - top];
            drawing.fill(bar, "#9ecae1");
        }
        let steps = self.edges.windows(2).zip(self.stated);
        let steps = steps.flat_map(|(two, density)| two.iter().map(|edge| (*edge, *density)));
        let line: Vec<(f64, f64)> = steps.map(|(v, density)| (to_x(v), to_y(density))).collect();
        drawing.curve(&line, style(1).solid(), 1.3);
        drawing.frame([x, y, w, h], FRAME);
        drawing.text(
            (x + w / 2.0, y + h + 28.0),
            SMALL,
            Anchor::Middle,
            self.label,
        );
        drawing.text((x, y - 4.0), SMALL, Anchor::Start, self.unit);
    }
}

/// Draws a map of the sphere: azimuth across, the angle from the normal downwards.
fn sphere(
    drawing: &mut Drawing,
    [x, y, w, h]: Area,
    name: &str,
    map: &[f64],
    fit: &DirectionFit,
) -> Result<(), OutputError> {
    let rows = if fit.is_opaque() { ROWS / 2 } else { ROWS };
    let most = fit.greatest_density();
    let values = map[..rows * COLUMNS].iter().map(|density| *density as f32);
    let map = ErrorMap {
        width: COLUMNS as u32,
        height: rows as u32,
        values: values.collect(),
        colours: Colours::Magma,
        top: None,
    };
    let top = if most > 0.0 { most as f32 } else { 1.0 };
    drawing.image([x, y, w, h], &png::encode_map(&map, [0.0, top], &[])?);
    drawing.frame([x, y, w, h], FRAME);
    drawing.text((x, y - 6.0), NAME, Anchor::Start, name);
    let scale = format!("0 to {} /sr", significant(most, 3));
    drawing.text((x + w, y - 6.0), SMALL, Anchor::End, &scale);
    for (share, text) in [(0.0, "-180°"), (0.5, "0°"), (1.0, "180°")] {
        drawing.text((x + share * w, y + h + 13.0), SMALL, Anchor::Middle, text);
    }
    let most = 180 * rows / ROWS;
    drawing.text((x - 4.0, y + 8.0), SMALL, Anchor::End, "0°");
    drawing.text((x - 4.0, y + h), SMALL, Anchor::End, &format!("{most}°"));
    let label = "azimuth from the mirror direction; downwards: angle from the normal";
    drawing.text((x + w / 2.0, y + h + 26.0), SMALL, Anchor::Middle, label);
    Ok(())
}

/// Draws a histogram of delays and the stated density.
fn delays(drawing: &mut Drawing, area: Area, name: &str, fit: &DelayFit) {
    let [low, high] = fit.range;
    let count = fit.drawn.len();
    let edges: Vec<f64> = (0..=count)
        .map(|bin| low + (high - low) * bin as f64 / count as f64)
        .collect();
    let label = format!(
        "delay (scene units); {} samples, mean {} ({} stated), p = {}",
        fit.samples,
        significant(fit.drawn_mean, 4),
        significant(fit.mean, 4),
        significant(fit.p_value, 2),
    );
    let bars = Bars {
        edges: &edges,
        drawn: &fit.drawn,
        stated: &fit.stated,
        label: &label,
        unit: "density",
    };
    bars.draw(drawing, area, name);
}
