//! The per-pixel difference of FLIP between two pictures on a display [Andersson et al. 2020].

use std::ops::Range;

use rayon::prelude::*;

use super::filters::{Filters, Kernel};
use crate::colour::{from_opponent, hunt_lab, hyab, largest_distance, opponent};
use lumbre_light::film::Image;

/// Exponent of the colour distance.
const COLOUR_POWER: f32 = 0.7;
/// Fraction of the largest distance that maps to [`KNEE_VALUE`].
const KNEE: f32 = 0.4;
/// Value at the knee; larger differences share the remaining range.
const KNEE_VALUE: f32 = 0.95;

/// Number of values that are filtered together, so that they stay in registers.
const LANES: usize = 16;
/// Number of planes after filtering along rows: Y, Cx, Cz twice, and the smoothed, edge and point
/// responses of the achromatic channel.
const PLANES: usize = 7;
/// Fewest rows per task; a task also filters twice the filter radius of neighbouring rows.
const SHORTEST_BAND: usize = 32;

/// Features of one pixel that FLIP compares: its filtered colour in CIELAB after Hunt's adjustment,
/// and the strength of edges and points.
#[derive(Clone, Copy, Default)]
struct Seen {
    lab: [f32; 3],
    detail: [f32; 2],
}

/// Features of every pixel of a reference, 20 bytes per pixel.
pub struct Target {
    ppd: f64,
    seen: Vec<Seen>,
}

impl Target {
    /// Computes the features of a reference at `ppd` pixels per degree. `shown` maps a pixel to the
    /// linear light in 0..=1 that a display emits. Pixels beyond the border repeat the border. NaN
    /// spreads as far as the filters reach.
    pub fn new(
        reference: &Image,
        ppd: f64,
        shown: &(impl Fn([f32; 3]) -> [f32; 3] + Sync),
    ) -> Target {
        let mut seen = vec![Seen::default(); reference.data.len()];
        look(reference, ppd, shown, &mut seen, |_, seen| seen);
        Target { ppd, seen }
    }

    /// Returns the difference in 0..=1 at every pixel of an image of the reference's size, in row
    /// order.
    pub fn difference(
        &self,
        image: &Image,
        shown: &(impl Fn([f32; 3]) -> [f32; 3] + Sync),
    ) -> Vec<f32> {
        let most = largest_distance().powf(COLOUR_POWER);
        let mut out = vec![0.0; self.seen.len()];
        look(image, self.ppd, shown, &mut out, |i, seen| {
            distance(&seen, &self.seen[i], most)
        });
        out
    }
}

/// Fills `out` in row order with `of(index, features)` of every pixel.
fn look<T: Send>(
    image: &Image,
    ppd: f64,
    shown: &(impl Fn([f32; 3]) -> [f32; 3] + Sync),
    out: &mut [T],
    of: impl Fn(usize, Seen) -> T + Sync,
) {
    let (width, height) = (image.width as usize, image.height as usize);
    let filters = Filters::new(ppd);
    let threads = rayon::current_num_threads().max(1);
    let band = height.div_ceil(2 * threads).max(SHORTEST_BAND);
    out.par_chunks_mut((band * width).max(1))
        .enumerate()
        .for_each(|(i, rows)| {
            let first = i * band;
            let mut side = Side::new(image, &filters);
            let mut features = Features::new(width);
            for (y, row) in (first..).zip(rows.chunks_exact_mut(width)) {
                side.advance(y, shown);
                features.compute(&side, y);
                for (x, place) in row.iter_mut().enumerate() {
                    *place = of(y * width + x, features.seen(x));
                }
            }
        });
}

/// Ring buffer of the most recent rows of one image, filtered along rows.
struct Side<'a> {
    image: &'a Image,
    filters: &'a Filters,
    radius: usize,
    stride: usize,
    /// Y, Cx and Cz of one row, with its border repeated.
    padded: [Vec<f32>; 3],
    /// Filtered rows; row `y` is stored at `y % rows.len()`.
    rows: Vec<[Vec<f32>; PLANES]>,
    /// Range of the rows that have been filtered.
    done: Range<usize>,
}

impl<'a> Side<'a> {
    fn new(image: &'a Image, filters: &'a Filters) -> Side<'a> {
        let radius = filters.radius();
        let stride = (image.width as usize).next_multiple_of(LANES);
        Side {
            image,
            filters,
            radius,
            stride,
            padded: std::array::from_fn(|_| vec![0.0; stride + 2 * radius]),
            rows: (0..2 * radius + 1)
                .map(|_| std::array::from_fn(|_| vec![0.0; stride]))
                .collect(),
            done: 0..0,
        }
    }

    /// Filters all rows that row `y` depends on and that are missing.
    fn advance(&mut self, y: usize, shown: &impl Fn([f32; 3]) -> [f32; 3]) {
        let last = (y + self.radius + 1).min(self.image.height as usize);
        if self.done.is_empty() {
            let first = y.saturating_sub(self.radius);
            self.done = first..first;
        }
        for row in self.done.end..last {
            self.filter_row(row, shown);
        }
        self.done.end = last;
    }

    fn filter_row(&mut self, y: usize, shown: &impl Fn([f32; 3]) -> [f32; 3]) {
        let width = self.image.width as usize;
        let [py, px, pz] = &mut self.padded;
        for (i, pixel) in self.image.data[y * width..(y + 1) * width]
            .iter()
            .enumerate()
        {
            [
                py[self.radius + i],
                px[self.radius + i],
                pz[self.radius + i],
            ] = opponent(shown(*pixel));
        }
        for plane in [&mut *py, &mut *px, &mut *pz] {
            let (left, right) = (plane[self.radius], plane[self.radius + width - 1]);
            plane[..self.radius].fill(left);
            plane[self.radius + width..].fill(right);
        }
        let f = self.filters;
        let slot = y % self.rows.len();
        let [oy, ox, oz0, oz1, smooth, edge, point] = &mut self.rows[slot];
        along_row(py, self.radius, &f.y, oy);
        along_row(px, self.radius, &f.cx, ox);
        along_row(pz, self.radius, &f.cz[0], oz0);
        along_row(pz, self.radius, &f.cz[1], oz1);
        along_row(py, self.radius, &f.smooth, smooth);
        along_row(py, self.radius, &f.edge, edge);
        along_row(py, self.radius, &f.point, point);
    }

    /// Returns the rows around row `y` for a filter of this radius, with border rows repeated.
    fn around(&self, y: usize, plane: usize, radius: usize) -> Vec<&[f32]> {
        let last = self.image.height as usize - 1;
        let row = |i: usize| (y + i).saturating_sub(radius).min(last) % self.rows.len();
        (0..2 * radius + 1)
            .map(|i| self.rows[row(i)][plane].as_slice())
            .collect()
    }
}

/// Filtered features of one row of an image.
struct Features {
    /// Y, Cx and Cz after the contrast sensitivity filters.
    colour: [Vec<f32>; 3],
    /// Squared lengths of the edge and point responses.
    detail: [Vec<f32>; 2],
    scratch: [Vec<f32>; 2],
}

impl Features {
    fn new(width: usize) -> Features {
        let plane = || vec![0.0; width.next_multiple_of(LANES)];
        Features {
            colour: std::array::from_fn(|_| plane()),
            detail: std::array::from_fn(|_| plane()),
            scratch: std::array::from_fn(|_| plane()),
        }
    }

    /// Filters along columns for row `y`.
    fn compute(&mut self, side: &Side, y: usize) {
        let f = side.filters;
        let columns = |plane: usize, kernel: &Kernel, out: &mut Vec<f32>| {
            along_columns(&side.around(y, plane, kernel.radius()), kernel, out);
        };
        let [oy, ox, oz] = &mut self.colour;
        let [a, b] = &mut self.scratch;
        columns(0, &f.y, oy);
        columns(1, &f.cx, ox);
        columns(2, &f.cz[0], oz);
        columns(3, &f.cz[1], a);
        oz.iter_mut()
            .zip(a.iter())
            .for_each(|(z, second)| *z += second);
        for (out, plane, kernel) in [(0, 5, &f.edge), (1, 6, &f.point)] {
            columns(plane, &f.smooth, a);
            columns(4, kernel, b);
            let sums = self.detail[out].iter_mut().zip(a.iter().zip(b.iter()));
            sums.for_each(|(length, (x, y))| *length = x * x + y * y);
        }
        debug_assert!(self.colour.iter().all(|plane| plane.len() == side.stride));
    }

    fn seen(&self, x: usize) -> Seen {
        let colour = from_opponent([0, 1, 2].map(|c| self.colour[c][x])).map(|v| v.clamp(0.0, 1.0));
        Seen {
            lab: hunt_lab(colour),
            detail: [0, 1].map(|d| self.detail[d][x].sqrt()),
        }
    }
}

/// Filters a row; `padded` reaches `radius` values further to the left and at least as many to the
/// right.
fn along_row(padded: &[f32], radius: usize, kernel: &Kernel, out: &mut [f32]) {
    let start = radius - kernel.radius();
    for (i, chunk) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let mut sum = [0.0; LANES];
        for (values, w) in padded[start + i * LANES..]
            .windows(LANES)
            .zip(kernel.weights())
        {
            for (s, v) in sum.iter_mut().zip(values) {
                *s += w * v;
            }
        }
        *chunk = sum;
    }
}

/// Weighted sum of rows.
fn along_columns(rows: &[&[f32]], kernel: &Kernel, out: &mut [f32]) {
    for (i, chunk) in out.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
        let mut sum = [0.0; LANES];
        for (row, w) in rows.iter().zip(kernel.weights()) {
            for (s, v) in sum.iter_mut().zip(&row[i * LANES..(i + 1) * LANES]) {
                *s += w * v;
            }
        }
        *chunk = sum;
    }
}

/// FLIP of one pixel; `most` is the largest colour distance, raised to [`COLOUR_POWER`].
fn distance(image: &Seen, reference: &Seen, most: f32) -> f32 {
    let knee = KNEE * most;
    let distance = hyab(image.lab, reference.lab).powf(COLOUR_POWER);
    let colour = if distance < knee {
        distance * (KNEE_VALUE / knee)
    } else {
        KNEE_VALUE + (distance - knee) / (most - knee) * (1.0 - KNEE_VALUE)
    };
    let [edge, point] = [0, 1].map(|d| (image.detail[d] - reference.detail[d]).abs());
    let feature = (std::f32::consts::FRAC_1_SQRT_2 * edge.max(point)).sqrt();
    colour.powf(1.0 - feature)
}
