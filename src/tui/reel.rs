//! Light by its time, as small pictures: what a film with a time axis shows on the screen. Its size depends on the bins
//! and not on the picture, and is at most 27 MB.

use std::ops::Range;

use crate::experiment::{CellRef, Event};
use crate::film::Image;
use crate::film::time::{TimeAxis, TimeCube};

/// The most frames; where there are more bins, as many as it takes are added up.
pub const FRAMES: u32 = 240;
/// The most pixels along one side of a frame.
const SIDE: u32 = 96;

/// The frames of one run, from the first that light reaches to the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Reel {
    /// The run.
    pub cell: CellRef,
    /// Its bins.
    pub axis: TimeAxis,
    /// Bins that a frame adds up; the last frame may have fewer.
    step: u32,
    /// Frames before the first one, to which no light comes.
    dark: u32,
    frames: Vec<Image>,
    /// Stops at which 97 % of what is lit in any frame stays below white.
    pub stops: f32,
}

impl Reel {
    /// Light by time, reduced; `None` where no light comes within the bins.
    pub fn of(cell: CellRef, cube: &TimeCube) -> Option<Reel> {
        let mut reel = Winding::new(cell, cube.axis, [cube.width, cube.height]);
        let scale = 1.0 / cube.samples.max(1) as f64;
        let slots = cube.axis.slots();
        for row in cube.sum.chunks_exact(slots * cube.width as usize) {
            let bins = row.chunks_exact(slots).flat_map(|pixel| &pixel[1..slots - 1]);
            reel.row(bins.map(|sum| sum.map(|v| (v * scale) as f32)));
        }
        reel.end()
    }

    /// What an event brings of it.
    pub fn heard(event: &Event) -> Option<Reel> {
        match event {
            Event::Times { cell, times } => Reel::of(*cell, times),
            Event::CellFinished { cell, times: Some(times), .. } => Reel::of(*cell, times),
            _ => None,
        }
    }

    /// Number of frames, at least one.
    pub fn count(&self) -> usize {
        self.frames.len()
    }

    /// A frame: the sum of its bins. Beyond the last it is the last.
    pub fn frame(&self, i: usize) -> &Image {
        &self.frames[i.min(self.frames.len() - 1)]
    }

    /// The optical lengths between which light arrives in a frame.
    pub fn span(&self, i: usize) -> [f64; 2] {
        let Range { start, end } = self.bins(i);
        [self.axis.begin(start), self.axis.begin(end)]
    }

    /// The frame that holds an optical length, or the nearest to it.
    pub fn at(&self, length: f64) -> usize {
        let place = self.axis.place(length) / f64::from(self.step) - f64::from(self.dark);
        // What is no number is the first.
        (place.max(0.0) as usize).min(self.frames.len() - 1)
    }

    fn bins(&self, i: usize) -> Range<u32> {
        let frame = self.dark + i.min(self.frames.len() - 1) as u32;
        frame * self.step..((frame + 1) * self.step).min(self.axis.bins)
    }
}

/// A reel in the making, which takes the rows of a picture from top to bottom.
pub struct Winding {
    cell: CellRef,
    axis: TimeAxis,
    source: [u32; 2],
    /// Pixels of the source along both sides of one of ours.
    factor: u32,
    size: [u32; 2],
    step: u32,
    frames: usize,
    /// Sums over pixels, `[y][x][frame]`.
    sums: Vec<[f32; 3]>,
    /// Rows that were taken.
    rows: u32,
}

impl Winding {
    /// For a picture of so many columns and rows.
    pub fn new(cell: CellRef, axis: TimeAxis, [width, height]: [u32; 2]) -> Winding {
        let factor = width.max(height).div_ceil(SIDE).max(1);
        let size = [width.div_ceil(factor), height.div_ceil(factor)];
        let step = axis.bins.div_ceil(FRAMES).max(1);
        let frames = axis.bins.div_ceil(step) as usize;
        let sums = vec![[0.0; 3]; size[0] as usize * size[1] as usize * frames];
        Winding { cell, axis, source: [width, height], factor, size, step, frames, sums, rows: 0 }
    }

    /// Takes the next row: the mean radiance of every bin of every pixel, bins fastest. What is not finite is black.
    pub fn row(&mut self, values: impl Iterator<Item = [f32; 3]>) {
        if self.rows >= self.source[1] {
            return;
        }
        let (bins, step, factor) = (self.axis.bins as usize, self.step as usize, self.factor as usize);
        let first = (self.rows / self.factor) as usize * self.size[0] as usize;
        for (i, value) in values.enumerate().take(bins * self.source[0] as usize) {
            let (x, bin) = (i / bins, i % bins);
            let sum = &mut self.sums[(first + x / factor) * self.frames + bin / step];
            for (s, v) in sum.iter_mut().zip(value) {
                *s += if v.is_finite() { v } else { 0.0 };
            }
        }
        self.rows += 1;
    }

    /// The reel; `None` where no light comes within the bins.
    pub fn end(self) -> Option<Reel> {
        let [width, height] = self.size;
        // Pixels at the right and lower border may stand for fewer of the source's.
        let count = |i: u32, side: u32| ((i + 1) * self.factor).min(side) - i * self.factor;
        let frame = |k: usize| {
            Image::from_fn(width, height, |x, y| {
                let share = 1.0 / (count(x, self.source[0]) * count(y, self.source[1])) as f32;
                self.sums[(y * width + x) as usize * self.frames + k].map(|sum| sum * share)
            })
        };
        let lit = |k: &usize| self.sums.chunks_exact(self.frames).any(|pixel| pixel[*k].iter().any(|v| *v > 0.0));
        let (first, last) = ((0..self.frames).find(lit)?, (0..self.frames).rfind(lit)?);
        let frames: Vec<Image> = (first..=last).map(frame).collect();
        let stops = stops(&frames);
        let Winding { cell, axis, step, .. } = self;
        Some(Reel { cell, axis, step, dark: first as u32, frames, stops })
    }
}

/// Whole quarters of a stop, so that frames do not change their brightness with every wave.
fn stops(frames: &[Image]) -> f32 {
    let pixels = frames.iter().flat_map(|frame| &frame.data);
    let mut lit: Vec<f32> = pixels.map(|v| v[0].max(v[1]).max(v[2])).filter(|v| *v > 0.0).collect();
    if lit.is_empty() {
        return 0.0;
    }
    let at = (lit.len() * 97 / 100).min(lit.len() - 1);
    let (_, white, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
    (-white.log2() * 4.0).round() / 4.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const CELL: CellRef = CellRef::Cell(0);

    /// One sample of `width` x `height` pixels: in bin `b` of pixel (x, y) there is `light(x, y, b)`.
    fn cube(axis: TimeAxis, [width, height]: [u32; 2], light: impl Fn(u32, u32, u32) -> f64) -> TimeCube {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let sum: Vec<[f64; 3]> = pixels
            .flat_map(|(x, y)| {
                let bins = (0..axis.bins).map(|b| light(x, y, b)).collect::<Vec<_>>();
                [7.0].into_iter().chain(bins).chain([7.0]).map(|v| [v, 0.5 * v, 0.0]).collect::<Vec<_>>()
            })
            .collect();
        let square = vec![[0.0; 3]; sum.len()];
        TimeCube { axis, width, height, samples: 1, sum, square }
    }

    #[test]
    fn frames_are_the_bins_where_both_are_few() {
        let axis = TimeAxis { start: 2.0, bin: 0.5, bins: 8 };
        let reel =
            Reel::of(CELL, &cube(axis, [4, 3], |x, y, b| if b == 3 + x { f64::from(1 + y) } else { 0.0 })).unwrap();
        assert_eq!(
            (reel.count(), reel.span(0), reel.span(3)),
            (4, [3.5, 4.0], [5.0, 5.5]),
            "the dark ends are left out"
        );
        assert_eq!((reel.frame(1).at(1, 2), reel.frame(1).at(0, 2)), ([3.0, 1.5, 0.0], [0.0; 3]));
        assert_eq!([0.0, 3.6, 4.2, 99.0, f64::NAN].map(|length| reel.at(length)), [0, 0, 1, 3, 0]);
        assert_eq!((reel.span(99), reel.frame(99)), (reel.span(3), reel.frame(3)));
        assert_eq!(reel.stops, -1.5, "the brightest is 3");
        assert_eq!(Reel::of(CELL, &cube(axis, [4, 3], |_, _, _| 0.0)), None);
    }

    #[test]
    fn much_is_reduced_without_losing_light() {
        let axis = TimeAxis { start: 0.0, bin: 1.0, bins: 500 };
        let light = |x: u32, y: u32, b: u32| f64::from((x * 7 + y * 3 + b) % 11);
        let reel = Reel::of(CELL, &cube(axis, [250, 10], light)).unwrap();
        let first = reel.frame(0);
        assert_eq!(
            (reel.count(), first.width, first.height),
            (167, 84, 4),
            "three bins and three by three pixels each"
        );
        assert_eq!(reel.span(166), [498.0, 500.0]);
        let mean = |xs: Range<u32>, ys: Range<u32>, bins: Range<u32>| {
            let all = ys.flat_map(|y| xs.clone().map(move |x| (x, y)));
            let count = (xs.len() * 3) as f64;
            all.map(|(x, y)| bins.clone().map(|b| light(x, y, b)).sum::<f64>()).sum::<f64>() / count
        };
        assert!((f64::from(first.at(2, 1)[0]) - mean(6..9, 3..6, 0..3)).abs() < 1e-4);
        // The last row stands for one row, the last column for one column.
        let corner = f64::from(reel.frame(1).at(83, 3)[0]);
        let one = (3..6).map(|b| light(249, 9, b)).sum::<f64>();
        assert!((corner - one).abs() < 1e-4, "{corner} {one}");
    }
}
