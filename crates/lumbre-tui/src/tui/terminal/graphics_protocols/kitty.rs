//! Graphics protocol of kitty: the picture is transmitted once under an id and then shown wherever
//! placeholder characters with this id are printed.
//!
//! Placeholders are text with combining characters for row and column, so they pass through tmux
//! and ratatui's screen diff like any other text. They are specified in
//! <https://sw.kovidgoyal.net/kitty/graphics-protocol/#unicode-placeholders>.

use std::fmt::Write;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ratatui::style::Color;

use super::{Picture, passthrough};

/// Number of bytes of a chunk, which are 4096 bytes in base64.
const CHUNK: usize = 3072;
/// Character for a part of a picture.
const PLACEHOLDER: char = '\u{10eeee}';
/// First id. The high bytes make a collision with another program unlikely.
const FIRST_ID: u32 = 0x4c75_6d00;

/// Combining characters for the numbers from 0 in order, as first character and length of each run
/// of consecutive characters. From kitty's file `rowcolumn-diacritics.txt`.
#[rustfmt::skip]
const DIACRITICS: [(u32, u32); 86] = [
    (0x0305, 1), (0x030d, 2), (0x0310, 1), (0x0312, 1), (0x033d, 3), (0x0346, 1), (0x034a, 3),
    (0x0350, 3), (0x0357, 1), (0x035b, 1), (0x0363, 13), (0x0483, 5), (0x0592, 4), (0x0597, 3),
    (0x059c, 6), (0x05a8, 2), (0x05ab, 2), (0x05af, 1), (0x05c4, 1), (0x0610, 8), (0x0657, 5),
    (0x065d, 2), (0x06d6, 7), (0x06df, 4), (0x06e4, 1), (0x06e7, 2), (0x06eb, 2), (0x0730, 1),
    (0x0732, 2), (0x0735, 2), (0x073a, 1), (0x073d, 1), (0x073f, 3), (0x0743, 1), (0x0745, 1),
    (0x0747, 1), (0x0749, 2), (0x07eb, 7), (0x07f3, 1), (0x0816, 4), (0x081b, 9), (0x0825, 3),
    (0x0829, 5), (0x0951, 1), (0x0953, 2), (0x0f82, 2), (0x0f86, 2), (0x135d, 3), (0x17dd, 1),
    (0x193a, 1), (0x1a17, 1), (0x1a75, 8), (0x1b6b, 1), (0x1b6d, 7), (0x1cd0, 3), (0x1cda, 2),
    (0x1ce0, 1), (0x1dc0, 2), (0x1dc3, 7), (0x1dcb, 2), (0x1dd1, 22), (0x1dfe, 1), (0x20d0, 2),
    (0x20d4, 4), (0x20db, 2), (0x20e1, 1), (0x20e7, 1), (0x20e9, 1), (0x20f0, 1), (0x2cef, 3),
    (0x2de0, 32), (0xa66f, 1), (0xa67c, 2), (0xa6f0, 2), (0xa8e0, 18), (0xaab0, 1), (0xaab2, 2),
    (0xaab7, 2), (0xaabe, 2), (0xaac1, 1), (0xfe20, 7), (0x10a0f, 1), (0x10a38, 1), (0x1d185, 5),
    (0x1d1aa, 4), (0x1d242, 3),
];

/// Returns the id of picture number `number`, which is below 256.
pub(super) fn id(number: u8) -> u32 {
    FIRST_ID + u32::from(number)
}

/// Returns the sequences that transmit a picture as PNG under an id, for display in `cells`
/// character cells, and ask the terminal not to reply. With `tmux`, each is wrapped for tmux.
/// Returns `None` if the picture cannot be encoded.
pub(super) fn transmission(
    picture: &Picture,
    [columns, rows]: [u16; 2],
    id: u32,
    tmux: bool,
) -> Option<String> {
    let bytes = picture.png()?;
    let chunks = bytes.chunks(CHUNK);
    let count = chunks.len();
    let mut out = String::with_capacity(bytes.len() / 3 * 4 + count * 40 + 100);
    let mut sequence = String::new();
    for (number, chunk) in chunks.enumerate() {
        sequence.clear();
        sequence.push_str("\u{1b}_Gq=2,");
        if number == 0 {
            // U=1: a virtual placement, which only placeholders display.
            let _ = write!(sequence, "i={id},a=T,U=1,f=100,t=d,c={columns},r={rows},");
        }
        let _ = write!(sequence, "m={};", u8::from(number + 1 < count));
        STANDARD.encode_string(chunk, &mut sequence);
        sequence.push_str("\u{1b}\\");
        passthrough(&mut out, &sequence, tmux);
    }
    Some(out)
}

/// Returns the foreground colour of placeholders, which contains the lower three bytes of the id.
pub(super) fn color(id: u32) -> Color {
    let [_, r, g, b] = id.to_be_bytes();
    Color::Rgb(r, g, b)
}

/// Appends the placeholder for one cell of a picture. Returns whether there is one: numbers from
/// 297 cannot be expressed, except columns, which continue from the cell on the left.
pub(super) fn placeholder(out: &mut String, id: u32, row: u16, column: u16) -> bool {
    let Some(row) = diacritic(row) else {
        return false;
    };
    out.push(PLACEHOLDER);
    if let Some(column) = diacritic(column) {
        let [high, ..] = id.to_be_bytes();
        out.extend([row, column]);
        out.extend(diacritic(high.into()));
    }
    true
}

/// Combining character for a number, which is below 297.
fn diacritic(number: u16) -> Option<char> {
    let mut rest = u32::from(number);
    for (first, length) in DIACRITICS {
        if rest < length {
            return char::from_u32(first + rest);
        }
        rest -= length;
    }
    None
}
