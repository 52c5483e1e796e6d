//! Palettes of up to 256 colours for sixel, and dithering to them.
//!
//! The palette comes from repeated cuts of the colour histogram at the plane that most reduces the
//! sum of squared errors, as in Wu, "Efficient statistical computations for optimal color
//! quantization" (Graphics Gems II, 1991). Floyd-Steinberg dithering then distributes the remaining
//! error.

use std::collections::HashMap;
use std::ops::{Add, AddAssign, Range, Sub};

use super::Picture;

/// Largest number of colours of a palette.
const COLOURS: usize = 256;
/// Number of bits for each channel in the histogram and in the table of nearest colours.
const BITS: u32 = 6;
/// Number of histogram intervals for each channel.
const LEVELS: usize = 1 << BITS;
/// Fraction of an error that is passed on. The rest is dropped, since the error of a colour that
/// the palette cannot reach by mixing would otherwise accumulate over a whole area.
const DIFFUSION: f32 = 0.875;

/// A picture with a palette.
pub(super) struct Indexed {
    /// Red, green and blue of each colour, in percent as in sixel.
    pub palette: Vec<[u8; 3]>,
    /// Index into `palette` for each pixel in row order.
    pub indices: Vec<u8>,
}

/// Reduces a picture to at most 256 colours. A picture that has no more is not dithered.
pub(super) fn reduce(picture: &Picture) -> Indexed {
    if let Some(exact) = few_colours(picture) {
        return exact;
    }
    let mut palette: Vec<[u8; 3]> = quantized(picture)
        .into_iter()
        .map(|rgb| rgb.map(percent))
        .collect();
    palette.sort_unstable();
    palette.dedup();
    let indices = dithered(picture, &palette);
    Indexed { palette, indices }
}

/// Converts a channel to percent.
fn percent(byte: u8) -> u8 {
    ((u32::from(byte) * 100 + 127) / 255) as u8
}

/// Converts percent to a channel between 0 and 255.
fn channel(percent: u8) -> f32 {
    f32::from(percent) * 2.55
}

/// Returns the picture with its own colours, or `None` if it has more than 256.
fn few_colours(picture: &Picture) -> Option<Indexed> {
    let mut known: HashMap<[u8; 3], u8> = HashMap::new();
    let mut palette = Vec::new();
    let mut indices = Vec::with_capacity(picture.rgb.len());
    let mut last: Option<([u8; 3], u8)> = None;
    for rgb in &picture.rgb {
        let index = match last {
            Some((same, index)) if same == *rgb => index,
            _ => match known.get(rgb) {
                Some(index) => *index,
                None => {
                    let index = u8::try_from(palette.len()).ok()?;
                    palette.push(rgb.map(percent));
                    known.insert(*rgb, index);
                    index
                }
            },
        };
        last = Some((*rgb, index));
        indices.push(index);
    }
    Some(Indexed { palette, indices })
}

/// Number of pixels and sum of their colours.
#[derive(Clone, Copy, Default)]
struct Moments {
    sum: [f64; 3],
    count: f64,
}

impl Moments {
    /// Returns the mean colour.
    fn mean(&self) -> [f64; 3] {
        self.sum.map(|s| s / self.count.max(1.0))
    }

    /// Squared length of the sum over the number of pixels. The squared error of replacing the
    /// pixels by their mean is the sum of their squares minus this.
    fn explained(&self) -> f64 {
        self.sum.iter().map(|s| s * s).sum::<f64>() / self.count.max(1.0)
    }
}

impl AddAssign for Moments {
    fn add_assign(&mut self, other: Moments) {
        *self = *self + other;
    }
}

impl Add for Moments {
    type Output = Moments;

    fn add(self, other: Moments) -> Moments {
        Moments {
            sum: std::array::from_fn(|c| self.sum[c] + other.sum[c]),
            count: self.count + other.count,
        }
    }
}

impl Sub for Moments {
    type Output = Moments;

    fn sub(self, other: Moments) -> Moments {
        Moments {
            sum: std::array::from_fn(|c| self.sum[c] - other.sum[c]),
            count: self.count - other.count,
        }
    }
}

/// A non-empty bin of the histogram.
struct Bin {
    /// Interval on each channel.
    at: [u8; 3],
    moments: Moments,
}

/// A box of the histogram and its best cut.
struct ColorBox {
    bins: Range<usize>,
    moments: Moments,
    /// Reduction of the squared error by the best cut; 0 if the box has one bin.
    gain: f64,
    /// Channel of the best cut.
    axis: usize,
    /// First interval above the best cut.
    limit: u8,
}

/// Bin of a colour in tables over the three channels.
fn slot(rgb: [u8; 3]) -> usize {
    rgb.iter()
        .fold(0, |slot, c| slot << BITS | usize::from(c >> (8 - BITS)))
}

/// Returns the non-empty bins of a picture's histogram.
fn histogram(picture: &Picture) -> Vec<Bin> {
    let mut table = vec![([0u64; 3], 0u64); LEVELS.pow(3)];
    for rgb in &picture.rgb {
        let (sum, count) = &mut table[slot(*rgb)];
        for (sum, value) in sum.iter_mut().zip(rgb) {
            *sum += u64::from(*value);
        }
        *count += 1;
    }
    let interval = |slot: usize, shift: u32| (slot >> (shift * BITS)) as u8 & (LEVELS - 1) as u8;
    table
        .iter()
        .enumerate()
        .filter(|(_, (_, count))| *count > 0)
        .map(|(slot, (sum, count))| Bin {
            at: [interval(slot, 2), interval(slot, 1), interval(slot, 0)],
            moments: Moments {
                sum: sum.map(|s| s as f64),
                count: *count as f64,
            },
        })
        .collect()
}

/// Finds the best cut of the bins in `range`.
fn best_cut(bins: &[Bin], range: Range<usize>) -> ColorBox {
    let mut best = ColorBox {
        bins: range.clone(),
        moments: Moments::default(),
        gain: 0.0,
        axis: 0,
        limit: 0,
    };
    for bin in &bins[range.clone()] {
        best.moments += bin.moments;
    }
    for axis in 0..3 {
        let mut slices = [Moments::default(); LEVELS];
        for bin in &bins[range.clone()] {
            slices[usize::from(bin.at[axis])] += bin.moments;
        }
        let mut low = Moments::default();
        for (interval, slice) in slices.iter().enumerate() {
            low += *slice;
            let high = best.moments - low;
            if low.count == 0.0 || high.count == 0.0 {
                continue;
            }
            let gain = low.explained() + high.explained() - best.moments.explained();
            if gain > best.gain {
                best.gain = gain;
                best.axis = axis;
                best.limit = interval as u8 + 1;
            }
        }
    }
    best
}

/// Returns up to 256 colours that represent the picture with small squared error.
fn quantized(picture: &Picture) -> Vec<[u8; 3]> {
    let mut bins = histogram(picture);
    let all = 0..bins.len();
    let mut boxes = vec![best_cut(&bins, all)];
    while boxes.len() < COLOURS {
        let most = boxes
            .iter()
            .enumerate()
            .max_by(|(_, a), (_, b)| a.gain.total_cmp(&b.gain));
        let Some((index, _)) = most.filter(|(_, most)| most.gain > 0.0) else {
            break;
        };
        let cut = boxes.swap_remove(index);
        let above = |bin: &Bin| bin.at[cut.axis] >= cut.limit;
        let part = &mut bins[cut.bins.clone()];
        part.sort_unstable_by_key(above);
        let middle = cut.bins.start + part.partition_point(|bin| !above(bin));
        boxes.push(best_cut(&bins, cut.bins.start..middle));
        boxes.push(best_cut(&bins, middle..cut.bins.end));
    }
    boxes
        .iter()
        .map(|b| b.moments.mean().map(|v| v.round() as u8))
        .collect()
}

/// Table of the nearest colours of a palette, filled on demand.
struct Nearest<'p> {
    palette: &'p [[f32; 3]],
    /// Index for each bin; `u16::MAX` if not yet known.
    table: Vec<u16>,
}

impl Nearest<'_> {
    /// Index of the colour nearest to the centre of the colour's bin.
    fn index(&mut self, rgb: [f32; 3]) -> u8 {
        let bytes = rgb.map(|v| v as u8);
        let slot = slot(bytes);
        if self.table[slot] == u16::MAX {
            const WIDTH: u8 = 1 << (8 - BITS);
            let centre = bytes.map(|v| f32::from(v / WIDTH * WIDTH) + f32::from(WIDTH - 1) / 2.0);
            let mut nearest = (f32::INFINITY, 0);
            for (i, colour) in self.palette.iter().enumerate() {
                let [r, g, b]: [f32; 3] = std::array::from_fn(|c| colour[c] - centre[c]);
                let distance = r * r + g * g + b * b;
                if distance < nearest.0 {
                    nearest = (distance, i);
                }
            }
            self.table[slot] = nearest.1 as u16;
        }
        self.table[slot] as u8
    }
}

/// Maps each pixel to a colour of the palette by Floyd-Steinberg dithering in alternating
/// directions.
fn dithered(picture: &Picture, palette: &[[u8; 3]]) -> Vec<u8> {
    let palette: Vec<[f32; 3]> = palette.iter().map(|rgb| rgb.map(channel)).collect();
    let mut nearest = Nearest {
        palette: &palette,
        table: vec![u16::MAX; LEVELS.pow(3)],
    };
    let width = picture.width as usize;
    let mut indices = vec![0; picture.rgb.len()];
    // Errors of this row and the next, with one more pixel at both ends.
    let mut errors = vec![[0.0f32; 3]; width + 2];
    let mut next = errors.clone();
    let rows = picture
        .rgb
        .chunks_exact(width)
        .zip(indices.chunks_exact_mut(width));
    for (y, (pixels, indices)) in rows.enumerate() {
        for step in 0..width {
            let forward = y % 2 == 0;
            let x = if forward { step } else { width - 1 - step };
            let (ahead, behind) = if forward { (x + 2, x) } else { (x, x + 2) };
            let wanted: [f32; 3] = std::array::from_fn(|c| {
                (f32::from(pixels[x][c]) + errors[x + 1][c]).clamp(0.0, 255.0)
            });
            indices[x] = nearest.index(wanted);
            let shown = palette[usize::from(indices[x])];
            for c in 0..3 {
                let error = (wanted[c] - shown[c]) * (DIFFUSION / 16.0);
                errors[ahead][c] += error * 7.0;
                next[behind][c] += error * 3.0;
                next[x + 1][c] += error * 5.0;
                next[ahead][c] += error;
            }
        }
        std::mem::swap(&mut errors, &mut next);
        next.fill([0.0; 3]);
    }
    indices
}
