//! PreviewCache of time-resolved films for the screen.
//!
//! Memory depends on the number of bins and not on the resolution of the film; it is at most
//! 27 MB.

use std::ops::Range;

use lumbre_light::film::Image;
use lumbre_light::film::time::{TimeAxis, TimeCube};
use lumbre_night::experiment::{CellRef, Event};

/// Largest number of frames. If there are more bins, each frame sums several of them.
pub const FRAMES: u32 = 240;
/// Longest side of a frame in pixels.
const SIDE: u32 = 96;

/// Frames of one run, from the first to the last that receives light.
#[derive(Clone, Debug, PartialEq)]
pub struct TimePreview {
    /// Run to which the film belongs.
    pub cell: CellRef,
    /// Time bins of the film.
    pub axis: TimeAxis,
    /// Number of bins per frame; the last frame may have fewer.
    step: u32,
    /// Number of leading frames without light, which are not stored.
    unlit: u32,
    frames: Vec<Image>,
    /// Exposure in stops at which 97 % of the lit pixels of all frames stay below white.
    pub stops: f32,
}

impl TimePreview {
    /// Reduces a time-resolved film; `None` if no light arrives within its bins.
    pub fn from_cube(cell: CellRef, cube: &TimeCube) -> Option<TimePreview> {
        let mut builder = TimePreviewBuilder::new(cell, cube.axis, [cube.width, cube.height]);
        let scale = 1.0 / cube.samples.max(1) as f64;
        let slots = cube.axis.slots();
        for row in cube.sum.chunks_exact(slots * cube.width as usize) {
            let bins = row
                .chunks_exact(slots)
                .flat_map(|pixel| &pixel[1..slots - 1]);
            builder.add_row(bins.map(|sum| sum.map(|v| (v * scale) as f32)));
        }
        builder.finish()
    }

    /// Reduces the time-resolved film of an event; `None` if the event has none.
    pub fn from_event(event: &Event) -> Option<TimePreview> {
        match event {
            Event::Times { cell, times } => TimePreview::from_cube(*cell, times),
            Event::CellFinished {
                cell,
                times: Some(times),
                ..
            } => TimePreview::from_cube(*cell, times),
            _ => None,
        }
    }

    /// Number of frames, at least one.
    pub fn frame_count(&self) -> usize {
        self.frames.len()
    }

    /// Returns a frame, which is the sum of its bins; the last one if `i` is out of range.
    pub fn frame(&self, i: usize) -> &Image {
        &self.frames[i.min(self.frames.len() - 1)]
    }

    /// Range of optical lengths of a frame, in scene units.
    pub fn length_range(&self, i: usize) -> [f64; 2] {
        let Range { start, end } = self.bins(i);
        [self.axis.bin_start(start), self.axis.bin_start(end)]
    }

    /// Index of the frame that contains an optical length, or of the nearest one.
    pub fn frame_at(&self, length: f64) -> usize {
        let frame = self.axis.bin_position(length) / f64::from(self.step) - f64::from(self.unlit);
        // NaN maps to the first frame.
        (frame.max(0.0) as usize).min(self.frames.len() - 1)
    }

    fn bins(&self, i: usize) -> Range<u32> {
        let frame = self.unlit + i.min(self.frames.len() - 1) as u32;
        frame * self.step..((frame + 1) * self.step).min(self.axis.bins)
    }
}

/// Builder of a [`TimePreview`] that receives the rows of a film from top to bottom.
pub struct TimePreviewBuilder {
    cell: CellRef,
    axis: TimeAxis,
    source: [u32; 2],
    /// Film pixels along each side of a preview pixel.
    factor: u32,
    size: [u32; 2],
    step: u32,
    frames: usize,
    /// Sums over pixels, `[y][x][frame]`.
    sums: Vec<[f32; 3]>,
    /// Number of film rows received.
    rows: u32,
}

impl TimePreviewBuilder {
    /// Creates a builder for a film of `width` x `height` pixels.
    pub fn new(cell: CellRef, axis: TimeAxis, [width, height]: [u32; 2]) -> TimePreviewBuilder {
        let factor = width.max(height).div_ceil(SIDE).max(1);
        let size = [width.div_ceil(factor), height.div_ceil(factor)];
        let step = axis.bins.div_ceil(FRAMES).max(1);
        let frames = axis.bins.div_ceil(step) as usize;
        let sums = vec![[0.0; 3]; size[0] as usize * size[1] as usize * frames];
        TimePreviewBuilder {
            cell,
            axis,
            source: [width, height],
            factor,
            size,
            step,
            frames,
            sums,
            rows: 0,
        }
    }

    /// Adds the next row: the mean radiance of every bin of every pixel, bins fastest. Values that
    /// are not finite count as black.
    pub fn add_row(&mut self, values: impl Iterator<Item = [f32; 3]>) {
        if self.rows >= self.source[1] {
            return;
        }
        let (bins, step, factor) = (
            self.axis.bins as usize,
            self.step as usize,
            self.factor as usize,
        );
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

    /// Returns the preview; `None` if no light arrives within the bins.
    pub fn finish(self) -> Option<TimePreview> {
        let [width, height] = self.size;
        // Preview pixels at the right and lower border may cover fewer film pixels.
        let count = |i: u32, side: u32| ((i + 1) * self.factor).min(side) - i * self.factor;
        let frame = |k: usize| {
            Image::from_fn(width, height, |x, y| {
                let share = 1.0 / (count(x, self.source[0]) * count(y, self.source[1])) as f32;
                self.sums[(y * width + x) as usize * self.frames + k].map(|sum| sum * share)
            })
        };
        let lit = |k: &usize| {
            self.sums
                .chunks_exact(self.frames)
                .any(|pixel| pixel[*k].iter().any(|v| *v > 0.0))
        };
        let (first, last) = ((0..self.frames).find(lit)?, (0..self.frames).rfind(lit)?);
        let frames: Vec<Image> = (first..=last).map(frame).collect();
        let stops = stops(&frames);
        let TimePreviewBuilder {
            cell, axis, step, ..
        } = self;
        Some(TimePreview {
            cell,
            axis,
            step,
            unlit: first as u32,
            frames,
            stops,
        })
    }
}

/// Exposure of the frames in quarter stops, so that it does not change with every wave.
fn stops(frames: &[Image]) -> f32 {
    let pixels = frames.iter().flat_map(|frame| &frame.data);
    let mut lit: Vec<f32> = pixels
        .map(|v| v[0].max(v[1]).max(v[2]))
        .filter(|v| *v > 0.0)
        .collect();
    if lit.is_empty() {
        return 0.0;
    }
    let at = (lit.len() * 97 / 100).min(lit.len() - 1);
    let (_, white, _) = lit.select_nth_unstable_by(at, f32::total_cmp);
    (-white.log2() * 4.0).round() / 4.0
}

#[cfg(test)]
mod tests {
    use crate::tui::model::time_preview::*;

    const CELL: CellRef = CellRef::Cell(0);

    /// A film with one sample per pixel whose bin `b` of pixel (x, y) contains `light(x, y, b)`.
    fn cube(
        axis: TimeAxis,
        [width, height]: [u32; 2],
        light: impl Fn(u32, u32, u32) -> f64,
    ) -> TimeCube {
        let pixels = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        let sum: Vec<[f64; 3]> = pixels
            .flat_map(|(x, y)| {
                let bins = (0..axis.bins).map(|b| light(x, y, b)).collect::<Vec<_>>();
                [7.0]
                    .into_iter()
                    .chain(bins)
                    .chain([7.0])
                    .map(|v| [v, 0.5 * v, 0.0])
                    .collect::<Vec<_>>()
            })
            .collect();
        let square = vec![[0.0; 3]; sum.len()];
        TimeCube {
            axis,
            width,
            height,
            samples: 1,
            sum,
            square,
        }
    }

    #[test]
    fn small_films_have_one_frame_per_bin() {
        let axis = TimeAxis {
            start: 2.0,
            bin: 0.5,
            bins: 8,
        };
        let time_preview = TimePreview::from_cube(
            CELL,
            &cube(axis, [4, 3], |x, y, b| {
                if b == 3 + x { f64::from(1 + y) } else { 0.0 }
            }),
        )
        .unwrap();
        assert_eq!(
            (
                time_preview.frame_count(),
                time_preview.length_range(0),
                time_preview.length_range(3)
            ),
            (4, [3.5, 4.0], [5.0, 5.5]),
            "the dark ends are left out"
        );
        assert_eq!(
            (
                time_preview.frame(1).at(1, 2),
                time_preview.frame(1).at(0, 2)
            ),
            ([3.0, 1.5, 0.0], [0.0; 3])
        );
        assert_eq!(
            [0.0, 3.6, 4.2, 99.0, f64::NAN].map(|length| time_preview.frame_at(length)),
            [0, 0, 1, 3, 0]
        );
        assert_eq!(
            (time_preview.length_range(99), time_preview.frame(99)),
            (time_preview.length_range(3), time_preview.frame(3))
        );
        assert_eq!(time_preview.stops, -1.5, "the brightest is 3");
        assert_eq!(
            TimePreview::from_cube(CELL, &cube(axis, [4, 3], |_, _, _| 0.0)),
            None
        );
    }

    #[test]
    fn reducing_large_films_preserves_light() {
        let axis = TimeAxis {
            start: 0.0,
            bin: 1.0,
            bins: 500,
        };
        let light = |x: u32, y: u32, b: u32| f64::from((x * 7 + y * 3 + b) % 11);
        let time_preview = TimePreview::from_cube(CELL, &cube(axis, [250, 10], light)).unwrap();
        let first = time_preview.frame(0);
        assert_eq!(
            (time_preview.frame_count(), first.width, first.height),
            (167, 84, 4),
            "three bins and three by three pixels each"
        );
        assert_eq!(time_preview.length_range(166), [498.0, 500.0]);
        let mean = |xs: Range<u32>, ys: Range<u32>, bins: Range<u32>| {
            let all = ys.flat_map(|y| xs.clone().map(move |x| (x, y)));
            let count = (xs.len() * 3) as f64;
            all.map(|(x, y)| bins.clone().map(|b| light(x, y, b)).sum::<f64>())
                .sum::<f64>()
                / count
        };
        assert!((f64::from(first.at(2, 1)[0]) - mean(6..9, 3..6, 0..3)).abs() < 1e-4);
        // The last row and the last column cover a single row and column of the film.
        let corner = f64::from(time_preview.frame(1).at(83, 3)[0]);
        let one = (3..6).map(|b| light(249, 9, b)).sum::<f64>();
        assert!((corner - one).abs() < 1e-4, "{corner} {one}");
    }
}
