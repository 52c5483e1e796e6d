//! Tests of the picture pane.

use ratatui::Terminal;
use ratatui::backend::TestBackend;
use ratatui::layout::Rect;
use ratatui::style::Color;
use std::sync::Arc;

use super::night::{self, NightBuilder};
use crate::tui::model::night::NightModel;
use crate::tui::panes::picture;
use crate::tui::preview::box_average;
use crate::tui::terminal::terminal_caps::{Colors, Graphics, TerminalCaps};
use crate::tui::view::View;
use lumbre_light::film::Image;
use lumbre_night::experiment::{CellRef, Event};

/// Draws the inside of a picture pane of `columns` x `rows` from `image`.
fn drawn(
    image: Image,
    caps: TerminalCaps,
    exposure: f32,
    columns: u16,
    rows: u16,
) -> ratatui::buffer::Buffer {
    let mut model: NightModel = NightBuilder::new(night::plan()).model().0;
    let wave = Event::Wave {
        cell: CellRef::Cell(0),
        row: night::row(0),
        measure_s: 0.0,
        image: Some(Arc::new(image)),
        noise: None,
        pow2: true,
    };
    model.receive(&wave, 1.0);
    let mut terminal = Terminal::new(TestBackend::new(columns + 2, rows + 2)).unwrap();
    let view = View {
        exposure,
        ..View::new(caps)
    };
    terminal
        .draw(|frame| picture::draw(frame, frame.area(), &model, &view))
        .unwrap();
    let buffer = terminal.backend().buffer().clone();
    let mut inside = ratatui::buffer::Buffer::empty(Rect::new(0, 0, columns, rows));
    for y in 0..rows {
        for x in 0..columns {
            inside[(x, y)] = buffer[(x + 1, y + 1)].clone();
        }
    }
    inside
}

const TRUE: TerminalCaps = TerminalCaps {
    colors: Colors::True,
    ascii: false,
};
const INDEXED: TerminalCaps = TerminalCaps {
    colors: Colors::Ansi256,
    ascii: false,
};

/// Returns an image that is red above and green below.
fn flag(width: u32, height: u32) -> Image {
    Image::from_fn(width, height, |_, y| {
        if y < height / 2 {
            [1.0, 0.0, 0.0]
        } else {
            [0.0, 1.0, 0.0]
        }
    })
}

#[test]
fn a_character_cell_shows_two_pixels() {
    let b = drawn(flag(2, 2), TRUE, 0.0, 2, 1);
    for x in 0..2 {
        assert_eq!(
            (b[(x, 0)].symbol(), b[(x, 0)].fg, b[(x, 0)].bg),
            ("▀", Color::Rgb(255, 0, 0), Color::Rgb(0, 255, 0))
        );
    }
    let b = drawn(flag(2, 2), INDEXED, 0.0, 2, 1);
    assert_eq!(
        (b[(0, 0)].fg, b[(0, 0)].bg),
        (Color::Indexed(196), Color::Indexed(46))
    );
}

#[test]
fn the_aspect_ratio_is_preserved_and_the_picture_centred() {
    let ink = |b: &ratatui::buffer::Buffer| -> Vec<(u16, u16)> {
        let area = b.area;
        let cells = (0..area.height).flat_map(|y| (0..area.width).map(move |x| (x, y)));
        cells.filter(|p| b[*p].symbol() == "▀").collect()
    };
    // A square image in a pane of 20 columns and 6 rows takes 12 columns and 6 rows.
    let square = ink(&drawn(flag(64, 64), TRUE, 0.0, 20, 6));
    assert_eq!((square.len(), square[0], square[71]), (72, (4, 0), (15, 5)));
    // An image twice as wide as high takes 20 columns and 5 rows.
    let wide = ink(&drawn(flag(128, 64), TRUE, 0.0, 20, 6));
    assert_eq!(wide.len(), 100);
    // An image one pixel high fits a pane of any size.
    assert_eq!(ink(&drawn(flag(64, 1), TRUE, 0.0, 20, 6)).len(), 20);
}

#[test]
fn pixels_are_averaged_before_tone_mapping() {
    // Half black and half white radiance is 0.5, whose sRGB code is 188, not 128.
    let checker = Image::from_fn(
        8,
        8,
        |x, y| if (x + y) % 2 == 0 { [1.0; 3] } else { [0.0; 3] },
    );
    let b = drawn(checker.clone(), TRUE, 0.0, 2, 1);
    assert_eq!(b[(0, 0)].fg, Color::Rgb(188, 188, 188));
    // One more stop reaches white.
    assert_eq!(
        drawn(checker, TRUE, 1.0, 2, 1)[(0, 0)].fg,
        Color::Rgb(255, 255, 255)
    );
}

#[test]
fn reducing_preserves_the_mean_at_any_size() {
    let image = night::picture(4);
    let mean = image.mean();
    for (w, h) in [(64, 64), (7, 5), (63, 64), (1, 1), (100, 90)] {
        let reduced = box_average(&image, w, h);
        let m = reduced.mean();
        assert!(
            (0..3).all(|c| (m[c] - mean[c]).abs() < 1e-4 * mean[c]),
            "{w}x{h}: {m:?} is not {mean:?}"
        );
    }
    let broken = Image::from_fn(2, 1, |x, _| if x == 0 { [f32::NAN; 3] } else { [1.0; 3] });
    assert_eq!(box_average(&broken, 1, 1).data, [[0.5; 3]]);
}

#[test]
fn without_colours_or_half_blocks_pictures_use_characters_or_spaces() {
    let shades = drawn(
        flag(2, 2),
        TerminalCaps {
            colors: Colors::None,
            ascii: true,
        },
        0.0,
        4,
        2,
    );
    assert!(
        shades
            .content
            .iter()
            .all(|c| c.symbol().is_ascii() && c.fg == Color::Reset && c.bg == Color::Reset)
    );
    assert_ne!(shades[(0, 0)].symbol(), shades[(0, 1)].symbol());
    let spaces = drawn(
        flag(2, 2),
        TerminalCaps {
            colors: Colors::True,
            ascii: true,
        },
        0.0,
        4,
        2,
    );
    assert_eq!(
        (spaces[(0, 0)].symbol(), spaces[(0, 0)].bg),
        (" ", Color::Rgb(255, 0, 0))
    );
    assert_eq!(spaces[(0, 1)].bg, Color::Rgb(0, 255, 0));
}

#[test]
fn graphics_terminals_receive_every_pixel() {
    let mut model: NightModel = NightBuilder::new(night::plan()).model().0;
    let wave = Event::Wave {
        cell: CellRef::Cell(0),
        row: night::row(0),
        measure_s: 0.0,
        image: Some(night::picture(16)),
        noise: None,
        pow2: true,
    };
    model.receive(&wave, 1.0);
    let first = |graphics| {
        let mut terminal = Terminal::new(TestBackend::new(22, 12)).unwrap();
        let view = View {
            graphics: (graphics, [8, 16]),
            ..View::new(TRUE)
        };
        terminal
            .draw(|frame| picture::draw(frame, frame.area(), &model, &view))
            .unwrap();
        let buffer = terminal.backend().buffer();
        // A square image takes 20 columns and 10 rows, the whole inside.
        (
            buffer[(1, 1)].symbol().to_owned(),
            buffer
                .content
                .iter()
                .any(|cell| cell.symbol() == "\u{2580}"),
        )
    };
    for (graphics, begins) in [
        (Graphics::Kitty { tmux: false }, "\u{1b}_G"),
        (Graphics::Sixel { tmux: false }, "\u{1b}P"),
        (Graphics::Iterm2 { tmux: false }, "\u{1b}]1337;File="),
        (Graphics::Sixel { tmux: true }, "\u{1b}Ptmux;"),
    ] {
        let (symbol, blocks) = first(graphics);
        let head: String = symbol.chars().take(200).collect();
        assert!(symbol.contains(begins) && !blocks, "{graphics:?}: {head:?}");
    }
    assert!(first(Graphics::Blocks).1);
}
