//! Light over time: the curve of a pixel or a region.

use super::Movie;
use crate::output::OutputError;
use crate::output::plot::axis::{Axis, Scale};
use crate::output::plot::rasterize;
use crate::output::plot::style::{FRAME, GRID, INK, style};
use crate::output::plot::svg::{Anchor, Drawing, Font};

/// The mean light of a region in every bin.
#[derive(Clone, Debug, PartialEq)]
pub struct Curve {
    /// What it is of.
    pub name: String,
    /// Mean radiance by bin.
    pub values: Vec<[f64; 3]>,
}

impl Curve {
    /// Of the pixels from column and row `[0]`, `[1]` up to before `[2]`, `[3]`; what lies beyond the picture is cut off, and
    /// of nothing it is zero.
    pub fn region(movie: &Movie, [x0, y0, x1, y1]: [u32; 4], name: &str) -> Curve {
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
        Curve { name: name.to_owned(), values }
    }

    fn luminance(&self, bin: usize) -> f64 {
        let [r, g, b] = self.values[bin];
        0.2126 * r + 0.7152 * g + 0.0722 * b
    }
}

/// The curves as text: where a bin begins, in optical length and, where it is known, in seconds, then red, green and blue
/// of every curve.
pub fn csv(movie: &Movie, curves: &[Curve]) -> String {
    let mut header = vec!["length".to_owned()];
    header.extend(movie.seconds.map(|_| "seconds".to_owned()));
    header.extend(curves.iter().flat_map(|curve| ["r", "g", "b"].map(|c| format!("{} {c}", curve.name))));
    let mut text = crate::output::labels::csv_line(&header);
    for bin in 0..movie.axis.bins {
        let begin = movie.axis.begin(bin);
        let mut line = vec![begin.to_string()];
        line.extend(movie.seconds.map(|s| format!("{:e}", begin * s)));
        line.extend(curves.iter().flat_map(|curve| curve.values[bin as usize].map(|v| v.to_string())));
        text += &crate::output::labels::csv_line(&line);
    }
    text
}

const WIDTH: f64 = 460.0;
const HEIGHT: f64 = 230.0;
const LEFT: f64 = 54.0;
const TOP: f64 = 26.0;
const RIGHT: f64 = 12.0;
const BOTTOM: f64 = 40.0;

/// Luminance over optical length as SVG and PNG.
///
/// # Errors
/// Those of the renderer of SVG.
pub fn figure(movie: &Movie, curves: &[Curve]) -> Result<(String, Vec<u8>), OutputError> {
    let bins = movie.axis.bins as usize;
    let across = Axis::new(Scale::Linear, [movie.axis.start, movie.axis.end()]);
    let greatest = curves.iter().flat_map(|c| (0..bins).map(|b| c.luminance(b))).fold(0.0, f64::max);
    let up = Axis::new(Scale::Linear, [0.0, greatest]);
    let mut drawing = Drawing::default();
    let (small, name) = (Font::new(9.0, FRAME), Font::new(9.5, INK));
    if let (Some(across), Some(up)) = (across, up) {
        let x = |v: f64| LEFT + across.place(v) * (WIDTH - LEFT - RIGHT);
        let y = |v: f64| HEIGHT - BOTTOM - up.place(v) * (HEIGHT - TOP - BOTTOM);
        for (value, label) in &across.ticks {
            drawing.line([x(*value), TOP, x(*value), HEIGHT - BOTTOM], GRID, 0.6);
            drawing.tick_label((x(*value), HEIGHT - BOTTOM + 12.0), small, Anchor::Middle, label);
        }
        for (value, label) in &up.ticks {
            drawing.line([LEFT, y(*value), WIDTH - RIGHT, y(*value)], GRID, 0.6);
            drawing.tick_label((LEFT - 4.0, y(*value) + 3.0), small, Anchor::End, label);
        }
        drawing.frame([LEFT, TOP, WIDTH - LEFT - RIGHT, HEIGHT - TOP - BOTTOM], FRAME);
        let mut at = LEFT;
        for (i, curve) in curves.iter().enumerate() {
            let steps = (0..bins).flat_map(|b| {
                let (from, to) = (movie.axis.begin(b as u32), movie.axis.begin(b as u32 + 1));
                let v = curve.luminance(b);
                [(x(from), y(v)), (x(to), y(v))]
            });
            drawing.curve(&steps.collect::<Vec<_>>(), style(i).solid(), 1.1);
            drawing.line([at, 12.0, at + 14.0, 12.0], style(i).colour, 1.6);
            drawing.text((at + 18.0, 15.0), name, Anchor::Start, &curve.name);
            at += 32.0 + crate::output::plot::svg::text_width(&curve.name, 9.5);
        }
        let unit = match movie.seconds {
            Some(s) => format!("optical length (scene units; 1 is {})", super::time_words(s)),
            None => "optical length (scene units)".to_owned(),
        };
        drawing.text(((LEFT + WIDTH - RIGHT) / 2.0, HEIGHT - 10.0), small, Anchor::Middle, &unit);
        drawing.text_upwards((12.0, (TOP + HEIGHT - BOTTOM) / 2.0), small, Anchor::Middle, "luminance in a bin");
    }
    let svg = drawing.finish(WIDTH, HEIGHT, "Light over time", "mean luminance of each bin");
    let png = rasterize(&svg)?;
    Ok((svg, png))
}
