//! Sixel graphics: bands of six rows, one pass over each band per colour, run lengths.

use std::fmt::Write;

use super::Picture;
use super::palette::{self, Indexed};

/// Number of rows in a band.
const BAND: usize = 6;
/// Length from which a run is shorter as a repeat count than as repeated characters.
const SHORTEST_RUN: usize = 4;

/// Returns the control string of a picture, from `ESC P` to `ESC \`.
pub(super) fn encode(picture: &Picture) -> String {
    let Indexed { palette, indices } = palette::reduce(picture);
    let width = picture.width as usize;
    let mut out = String::with_capacity(picture.rgb.len());
    // Square pixels, in the first parameter and in the raster attributes: terminals differ in which
    // of them they read. 1: pixels without a colour stay as they are.
    out.push_str("\u{1b}P9;1;0q");
    push(
        &mut out,
        format_args!("\"1;1;{};{}", picture.width, picture.height),
    );
    for (index, [r, g, b]) in palette.iter().enumerate() {
        push(&mut out, format_args!("#{index};2;{r};{g};{b}"));
    }
    // Six bits for each colour and column of a band.
    let mut bits = vec![0u8; palette.len() * width];
    let mut used = vec![false; palette.len()];
    for (number, band) in indices.chunks(BAND * width).enumerate() {
        if number > 0 {
            out.push('-');
        }
        for (row, indices) in band.chunks(width).enumerate() {
            for (x, index) in indices.iter().enumerate() {
                let index = usize::from(*index);
                bits[index * width + x] |= 1 << row;
                used[index] = true;
            }
        }
        let mut first = true;
        for (index, used) in used.iter_mut().enumerate().filter(|(_, used)| **used) {
            if !first {
                out.push('$');
            }
            push(&mut out, format_args!("#{index}"));
            let bits = &mut bits[index * width..][..width];
            runs(&mut out, bits);
            bits.fill(0);
            (*used, first) = (false, false);
        }
    }
    out.push_str("\u{1b}\\");
    out
}

/// Writes the columns of one colour in a band; empty columns at the end are left out.
fn runs(out: &mut String, bits: &[u8]) {
    let end = bits
        .iter()
        .rposition(|b| *b != 0)
        .map_or(0, |last| last + 1);
    for run in bits[..end].chunk_by(|a, b| a == b) {
        let symbol = char::from(b'?' + run[0]);
        if run.len() < SHORTEST_RUN {
            out.extend(std::iter::repeat_n(symbol, run.len()));
        } else {
            push(out, format_args!("!{}{symbol}", run.len()));
        }
    }
}

/// Appends formatted text, which cannot fail for a `String`.
fn push(out: &mut String, text: std::fmt::Arguments) {
    let _ = out.write_fmt(text);
}
