//! Light over time: curves of pixels and regions.

use super::Movie;
use crate::OutputError;
use crate::plot::axis::{Axis, Scale};
use crate::plot::rasterize;
use crate::plot::style::{FRAME, GRID, INK, style};
use crate::plot::svg::{Anchor, Drawing, Font, text_width};
use lumbre_light::math::luminance::luminance;

/// Mean radiance of a region in every bin.
#[derive(Clone, Debug, PartialEq)]
pub struct TimeCurve {
    /// Name of the region.
    pub name: String,
    /// Mean radiance in linear sRGB of each bin.
    pub values: Vec<[f64; 3]>,
}

impl TimeCurve {
    /// Averages the pixels of columns `x0..x1` and rows `y0..y1`. Parts outside of the picture are
    /// clipped; an empty region gives zeros.
    pub fn region(movie: &Movie, [x0, y0, x1, y1]: [u32; 4], name: &str) -> TimeCurve {
        let mut values = vec![[0.0; 3]; movie.axis.bins as usize];
        let (x1, y1) = (x1.min(movie.width), y1.min(movie.height));
        let pixels = f64::from(x1.saturating_sub(x0)) * f64::from(y1.saturating_sub(y0));
        for y in y0..y1 {
            for x in x0..x1 {
                for (sum, v) in values.iter_mut().zip(movie.pixel(x, y)) {
                    (0..3).for_each(|c| sum[c] += f64::from(v[c]) / pixels);
                }
            }
        }
        TimeCurve {
            name: name.to_owned(),
            values,
        }
    }

    fn luminance(&self, bin: usize) -> f64 {
        luminance(self.values[bin])
    }
}

/// Writes the curves as CSV: the start of each bin as optical length and, if the scale is known, in
/// seconds, then red, green and blue of every curve.
pub fn curves_csv(movie: &Movie, curves: &[TimeCurve]) -> String {
    let mut header = vec!["length".to_owned()];
    header.extend(movie.seconds.map(|_| "seconds".to_owned()));
    header.extend(
        curves
            .iter()
            .flat_map(|curve| ["r", "g", "b"].map(|c| format!("{} {c}", curve.name))),
    );
    let mut text = lumbre_night::text::csv_line(&header);
    for bin in 0..movie.axis.bins {
        let start = movie.axis.bin_start(bin);
        let mut line = vec![start.to_string()];
        line.extend(movie.seconds.map(|s| format!("{:e}", start * s)));
        line.extend(
            curves
                .iter()
                .flat_map(|curve| curve.values[bin as usize].map(|v| v.to_string())),
        );
        text += &lumbre_night::text::csv_line(&line);
    }
    text
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 230.0;
const LEFT: f64 = 54.0;
const TOP: f64 = 26.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;
const SMALL: Font = Font::new(9.0, FRAME);
const NAME: Font = Font::new(9.5, INK);

/// Draws luminance over optical length as SVG and PNG.
///
/// # Errors
/// Returns an error if the SVG cannot be rendered.
pub fn curves_figure(
    movie: &Movie,
    curves: &[TimeCurve],
) -> Result<(String, Vec<u8>), OutputError> {
    let bins = movie.axis.bins as usize;
    let x_axis = Axis::new(Scale::Linear, [movie.axis.start, movie.axis.end()]);
    let peak = curves
        .iter()
        .flat_map(|c| (0..bins).map(|b| c.luminance(b)))
        .fold(0.0, f64::max);
    let y_axis = Axis::new(Scale::Linear, [0.0, peak]);
    let mut drawing = Drawing::default();
    if let (Some(x_axis), Some(y_axis)) = (x_axis, y_axis) {
        draw_grid(&mut drawing, &x_axis, &y_axis);
        let x = |v: f64| LEFT + x_axis.position(v) * (WIDTH - LEFT - RIGHT);
        let y = |v: f64| HEIGHT - BOTTOM - y_axis.position(v) * (HEIGHT - TOP - BOTTOM);
        let mut legend_x = LEFT;
        for (i, curve) in curves.iter().enumerate() {
            let steps = (0..bins).flat_map(|b| {
                let (from, to) = (
                    movie.axis.bin_start(b as u32),
                    movie.axis.bin_start(b as u32 + 1),
                );
                let v = curve.luminance(b);
                [(x(from), y(v)), (x(to), y(v))]
            });
            drawing.curve(&steps.collect::<Vec<_>>(), style(i).solid(), 1.1);
            drawing.line(
                [legend_x, 12.0, legend_x + 14.0, 12.0],
                style(i).colour.text(),
                1.6,
            );
            drawing.text((legend_x + 18.0, 15.0), NAME, Anchor::Start, &curve.name);
            legend_x += 32.0 + text_width(&curve.name, 9.5);
        }
        draw_axis_labels(&mut drawing, movie.seconds);
    }
    let svg = drawing.finish(
        WIDTH,
        HEIGHT,
        "Light over time",
        "mean luminance of each bin",
    );
    let png = rasterize(&svg)?;
    Ok((svg, png))
}

fn draw_grid(drawing: &mut Drawing, x_axis: &Axis, y_axis: &Axis) {
    for (value, label) in &x_axis.ticks {
        let x = LEFT + x_axis.position(*value) * (WIDTH - LEFT - RIGHT);
        drawing.line([x, TOP, x, HEIGHT - BOTTOM], GRID, 0.6);
        drawing.tick_label((x, HEIGHT - BOTTOM + 12.0), SMALL, Anchor::Middle, label);
    }
    for (value, label) in &y_axis.ticks {
        let y = HEIGHT - BOTTOM - y_axis.position(*value) * (HEIGHT - TOP - BOTTOM);
        drawing.line([LEFT, y, WIDTH - RIGHT, y], GRID, 0.6);
        drawing.tick_label((LEFT - 4.0, y + 3.0), SMALL, Anchor::End, label);
    }
    drawing.frame(
        [LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM],
        FRAME,
    );
}

/// Writes the axis labels. `seconds` is the travel time of light over one scene unit, if known.
fn draw_axis_labels(drawing: &mut Drawing, seconds: Option<f64>) {
    let x_label = match seconds {
        Some(s) => format!("optical length (scene units; 1 is {})", super::time_text(s)),
        None => "optical length (scene units)".to_owned(),
    };
    drawing.text(
        ((LEFT + WIDTH - RIGHT) / 2.0, HEIGHT - 10.0),
        SMALL,
        Anchor::Middle,
        &x_label,
    );
    drawing.text_upwards(
        (12.0, (TOP + HEIGHT - BOTTOM) / 2.0),
        SMALL,
        Anchor::Middle,
        "luminance in a bin",
    );
}
