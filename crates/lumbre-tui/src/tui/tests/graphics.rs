//! Tests of the graphics protocols: what is sent is decoded and compared with the picture.

use std::cell::Cell as Shared;
use std::collections::BTreeSet;
use std::io::{self, Write};
use std::rc::Rc;
use std::sync::Arc;
use std::time::Duration;

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use ratatui::backend::CrosstermBackend;
use ratatui::buffer::{Buffer, Cell, CellDiffOption};
use ratatui::layout::Rect;
use ratatui::style::Color;
use ratatui::widgets::Widget;
use ratatui::{Terminal, TerminalOptions, Viewport};

use crate::tui::modes::PictureMode;
use crate::tui::preview::PreviewContent;
use crate::tui::terminal::graphics_protocols::{EncodedPicture, GraphicsCache, Picture};
use crate::tui::terminal::terminal_caps::Graphics;
use lumbre_light::film::Image;

const PLACEHOLDER: char = '\u{10eeee}';

fn picture(width: u32, height: u32, rgb: impl Fn(u32, u32) -> [u8; 3]) -> Picture {
    let at = |i: u32| rgb(i % width, i / width);
    Picture {
        width,
        height,
        rgb: (0..width * height).map(at).collect(),
    }
}

/// Returns a picture with many colours and smooth gradients, dark at the top left.
fn gradients(width: u32, height: u32) -> Picture {
    picture(width, height, |x, y| {
        let (x, y) = (x as f32 / width as f32, y as f32 / height as f32);
        [x, y, x * y].map(|v| (v * 255.0).round() as u8)
    })
}

/// Returns a picture with up to 251 colours in no order.
fn noise(width: u32, height: u32) -> Picture {
    picture(width, height, |x, y| {
        let n = (x * 7919 + y * 104_729 + x * x * y) % 251;
        [n as u8, 255 - n as u8, (n * n % 256) as u8]
    })
}

/// Draws a picture into `area` of a buffer of 40 x 20 cells with `#`.
fn drawn(encoded: &EncodedPicture, area: Rect) -> Buffer {
    let mut buffer = Buffer::filled(Rect::new(0, 0, 40, 20), Cell::new("#"));
    encoded.render(area, &mut buffer);
    buffer
}

/// Returns the first symbol of a picture drawn in `cells`.
fn first_symbol(graphics: Graphics, cells: [u16; 2], picture: &Picture) -> String {
    let encoded = EncodedPicture::new(graphics, cells, picture, 0).unwrap();
    let area = Rect::new(3, 2, cells[0], cells[1]);
    drawn(&encoded, area)[(3, 2)].symbol().to_owned()
}

/// Returns the control sequences that tmux passes on, and the text outside of them.
fn through_tmux(mut sent: &str) -> (String, String) {
    let (mut passed, mut text) = (String::new(), String::new());
    while let Some(start) = sent.find("\u{1b}Ptmux;") {
        text.push_str(&sent[..start]);
        sent = &sent[start + "\u{1b}Ptmux;".len()..];
        loop {
            let escape = sent.find('\u{1b}').expect("an end");
            passed.push_str(&sent[..escape]);
            let end = sent[escape + 1..].starts_with('\\');
            assert!(end || sent[escape + 1..].starts_with('\u{1b}'));
            sent = &sent[escape + 2..];
            if end {
                break;
            }
            passed.push('\u{1b}');
        }
    }
    text.push_str(sent);
    (passed, text)
}

/// Follows the cursor over the sequences that erase cells and returns the cells erased, the
/// position at the end, and the rest.
fn erased(mut sent: &str) -> (BTreeSet<(u16, u16)>, (u16, u16), &str) {
    let (mut cells, row) = (BTreeSet::new(), Shared::new(0));
    while let Some(rest) = sent.strip_prefix("\u{1b}[") {
        let digits = rest.find(|c: char| !c.is_ascii_digit()).unwrap();
        let number: u16 = rest[..digits].parse().unwrap();
        match &rest[digits..=digits] {
            "X" => cells.extend((0..number).map(|x| (x, row.get()))),
            "A" => row.set(row.get() - number),
            "B" => row.set(row.get() + number),
            other => panic!("unknown sequence {other}"),
        }
        sent = &rest[digits + 1..];
    }
    (cells, (0, row.get()), sent)
}

/// Decodes a sixel control string. Pixels that are not set are `None`.
fn sixel(sent: &str) -> (usize, usize, Vec<Option<[u8; 3]>>) {
    let body = sent.strip_prefix("\u{1b}P9;1;0q\"1;1;").unwrap();
    let body = body.strip_suffix("\u{1b}\\").unwrap().as_bytes();
    let at = Shared::new(0);
    let number = || {
        let mut value = 0;
        while let Some(digit) = body.get(at.get()).filter(|c| c.is_ascii_digit()) {
            value = value * 10 + usize::from(digit - b'0');
            at.set(at.get() + 1);
        }
        value
    };
    let expect = |byte: u8| {
        assert_eq!(char::from(body[at.get()]), char::from(byte));
        at.set(at.get() + 1);
    };
    let width = number();
    expect(b';');
    let height = number();
    let mut pixels = vec![None; width * height];
    let (mut palette, mut colour, mut x, mut y) = (Vec::new(), 0, 0, 0);
    while let Some(byte) = body.get(at.get()).copied() {
        at.set(at.get() + 1);
        match byte {
            b'#' => {
                colour = number();
                if body[at.get()] == b';' {
                    assert_eq!(colour, palette.len());
                    expect(b';');
                    assert_eq!(number(), 2);
                    palette.push([(); 3].map(|()| {
                        expect(b';');
                        (number() as f32 * 2.55).round() as u8
                    }));
                }
            }
            b'$' => x = 0,
            b'-' => (x, y) = (0, y + 6),
            _ => {
                let mut symbol = byte;
                let mut count = 1;
                if byte == b'!' {
                    count = number();
                    symbol = body[at.get()];
                    at.set(at.get() + 1);
                }
                let bits = symbol - b'?';
                assert!(bits < 64);
                for x in x..x + count {
                    for row in (0..6).filter(|row| bits >> row & 1 == 1) {
                        assert!(x < width && y + row < height, "outside of the picture");
                        let pixel = &mut pixels[(y + row) * width + x];
                        assert!(pixel.is_none(), "two colours for one pixel");
                        *pixel = Some(palette[colour]);
                    }
                }
                x += count;
            }
        }
    }
    assert!(palette.len() <= 256);
    (width, height, pixels)
}

/// Decodes a sixel control string that sets every pixel.
fn complete_sixel(sent: &str) -> Picture {
    let (width, height, pixels) = sixel(sent);
    Picture {
        width: width as u32,
        height: height as u32,
        rgb: pixels.into_iter().map(Option::unwrap).collect(),
    }
}

/// Decodes kitty's transmission and returns the keys of the first sequence, the PNG file, and the
/// text behind the sequences.
fn kitty(mut sent: &str) -> (Vec<String>, Vec<u8>, &str) {
    let (mut keys, mut data, mut more) = (Vec::new(), Vec::new(), true);
    while let Some(rest) = sent.strip_prefix("\u{1b}_G") {
        assert!(more, "a sequence after the last");
        let (sequence, after) = rest.split_once("\u{1b}\\").unwrap();
        let (names, payload) = sequence.split_once(';').unwrap();
        assert!(payload.len() <= 4096);
        let mut names: Vec<String> = names.split(',').map(str::to_owned).collect();
        more = names.pop().unwrap() == "m=1";
        assert!(!more || payload.len().is_multiple_of(4));
        assert_eq!(names.remove(0), "q=2");
        if data.is_empty() {
            keys = names;
        } else {
            assert!(names.is_empty(), "{names:?} in a later sequence");
        }
        data.extend(STANDARD.decode(payload).unwrap());
        sent = after;
    }
    assert!(!more);
    (keys, data, sent)
}

/// Largest difference between the averages of two pictures over blocks of `size` x `size` pixels.
fn block_difference(a: &Picture, b: &Picture, size: usize) -> f32 {
    assert_eq!((a.width, a.height), (b.width, b.height));
    let (width, height) = (a.width as usize, a.height as usize);
    let mean = |of: &Picture, x0: usize, y0: usize, channel: usize| {
        let pixels = (y0..y0 + size).flat_map(|y| (x0..x0 + size).map(move |x| y * width + x));
        let sum: f32 = pixels.map(|i| f32::from(of.rgb[i][channel])).sum();
        sum / (size * size) as f32
    };
    let mut largest = 0.0f32;
    for y in (0..=height - size).step_by(size) {
        for x in (0..=width - size).step_by(size) {
            for channel in 0..3 {
                largest = largest.max((mean(a, x, y, channel) - mean(b, x, y, channel)).abs());
            }
        }
    }
    largest
}

#[test]
fn sixel_reproduces_few_colours_to_half_a_percent() {
    for (width, height) in [(1, 1), (7, 3), (5, 6), (16, 13), (64, 31)] {
        let noise = noise(width, height);
        let sent = first_symbol(Graphics::Sixel { tmux: false }, [4, 2], &noise);
        let shown = complete_sixel(erased(&sent).2);
        // Half a per cent is 1.3 codes.
        assert!(block_difference(&noise, &shown, 1) <= 2.0);
    }
}

#[test]
fn sixel_dithers_many_colours() {
    let gradients = gradients(160, 100);
    let sent = first_symbol(Graphics::Sixel { tmux: false }, [20, 6], &gradients);
    let shown = complete_sixel(erased(&sent).2);
    let worst = [1, 4, 20].map(|size| block_difference(&gradients, &shown, size));
    assert!(worst[0] <= 28.0, "{worst:?}");
    assert!(worst[1] <= 10.0, "{worst:?}");
    assert!(worst[2] <= 2.5, "{worst:?}");
}

#[test]
fn sixel_preserves_dark_gradients_and_small_bright_areas() {
    let dark = picture(128, 96, |x, y| {
        if (60..64).contains(&x) && (40..44).contains(&y) {
            [255, 40, 200]
        } else {
            [(x / 8) as u8, (y / 6) as u8, ((x + y) / 14) as u8]
        }
    });
    let sent = first_symbol(Graphics::Sixel { tmux: false }, [16, 6], &dark);
    let shown = complete_sixel(erased(&sent).2);
    assert!(block_difference(&dark, &shown, 4) <= 4.0);
}

#[test]
fn sixel_shortens_runs() {
    let flat = picture(800, 600, |_, _| [10, 20, 30]);
    let sent = first_symbol(Graphics::Sixel { tmux: false }, [20, 6], &flat);
    assert!(sent.len() < 1500, "{} bytes", sent.len());
}

#[test]
fn iterm2_receives_a_png_for_the_cells() {
    let gradients = gradients(90, 50);
    let sent = first_symbol(Graphics::Iterm2 { tmux: false }, [9, 4], &gradients);
    let sequence = erased(&sent).2.strip_prefix("\u{1b}]1337;File=").unwrap();
    let (keys, data) = sequence
        .strip_suffix('\u{7}')
        .unwrap()
        .split_once(':')
        .unwrap();
    let file = STANDARD.decode(data).unwrap();
    assert_eq!(
        keys.split(';').collect::<Vec<_>>(),
        [
            "inline=1",
            &format!("size={}", file.len()),
            "width=9",
            "height=4",
            "preserveAspectRatio=0",
            "doNotMoveCursor=1"
        ]
    );
    assert_is_png_of(file, &gradients);
}

/// Checks that a PNG file has the pixels of a picture.
fn assert_is_png_of(file: Vec<u8>, picture: &Picture) {
    let mut reader = png::Decoder::new(io::Cursor::new(file))
        .read_info()
        .unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    assert_eq!(
        (info.width, info.height, info.color_type),
        (picture.width, picture.height, png::ColorType::Rgb)
    );
    assert_eq!(bytes, picture.rgb.as_flattened());
}

#[test]
fn kitty_receives_a_png_in_chunks() {
    // One chunk, and many.
    for (width, height) in [(1, 1), (25, 41), (90, 70)] {
        let noise = noise(width, height);
        let sent = first_symbol(Graphics::Kitty { tmux: false }, [9, 4], &noise);
        let (keys, data, text) = kitty(&sent);
        assert_eq!(keys.join(","), "i=1282764032,a=T,U=1,f=100,t=d,c=9,r=4");
        assert_is_png_of(data, &noise);
        assert!(text.starts_with(PLACEHOLDER));
    }
}

#[test]
fn kitty_placeholders_number_rows_and_columns() {
    let gradients = gradients(8, 8);
    let encoded =
        EncodedPicture::new(Graphics::Kitty { tmux: false }, [310, 3], &gradients, 2).unwrap();
    let area = Rect::new(0, 0, 310, 3);
    let mut buffer = Buffer::empty(area);
    encoded.render(area, &mut buffer);
    let symbol = |x: u16, y: u16| -> Vec<char> {
        let sent = buffer[(x, y)].symbol();
        let text = if sent.starts_with('\u{1b}') {
            kitty(sent).2
        } else {
            sent
        };
        text.chars().collect()
    };
    // Values of kitty's table; 76 is the highest byte of the id.
    let known = [
        (0, '\u{305}'),
        (1, '\u{30d}'),
        (2, '\u{30e}'),
        (76, '\u{6df}'),
        (296, '\u{1d244}'),
    ];
    for (x, column) in known {
        for (y, row) in [(0, '\u{305}'), (1, '\u{30d}'), (2, '\u{30e}')] {
            assert_eq!(symbol(x, y), [PLACEHOLDER, row, column, known[3].1]);
        }
    }
    let columns: BTreeSet<char> = (0..297).map(|x| symbol(x, 0)[2]).collect();
    assert_eq!(columns.len(), 297);
    // Further columns continue from the cell on the left.
    assert_eq!(symbol(297, 1), [PLACEHOLDER]);
    let id = [0x75, 0x6d, 0x02];
    assert!(
        buffer
            .content
            .iter()
            .all(|cell| cell.fg == Color::Rgb(id[0], id[1], id[2])
                && matches!(cell.diff_option, CellDiffOption::ForcedWidth(_)))
    );
}

#[test]
fn tmux_passes_on_the_same_sequences() {
    let gradients = gradients(90, 70);
    for graphics in [
        |tmux| Graphics::Kitty { tmux },
        |tmux| Graphics::Sixel { tmux },
        |tmux| Graphics::Iterm2 { tmux },
    ] {
        let plain = first_symbol(graphics(false), [9, 4], &gradients);
        let wrapped = first_symbol(graphics(true), [9, 4], &gradients);
        let (passed, text) = through_tmux(&wrapped);
        assert_eq!(passed + &text, plain);
        // tmux displays the placeholder itself.
        let kitty = matches!(graphics(true), Graphics::Kitty { .. });
        assert_eq!(!text.is_empty(), kitty);
        assert!(!text.contains('\u{1b}'));
    }
}

#[test]
fn pictures_draw_only_in_their_area() {
    let gradients = gradients(90, 70);
    let area = Rect::new(3, 2, 9, 4);
    let at_least = Rect::new(3, 2, 12, 5);
    for graphics in [
        Graphics::Kitty { tmux: false },
        Graphics::Sixel { tmux: false },
        Graphics::Iterm2 { tmux: true },
    ] {
        let encoded = EncodedPicture::new(graphics, [9, 4], &gradients, 0).unwrap();
        // No room in the area or in the buffer.
        for small in [
            Rect::new(3, 2, 8, 4),
            Rect::new(3, 2, 9, 3),
            Rect::new(35, 2, 9, 4),
            Rect::new(3, 18, 9, 4),
            Rect::ZERO,
        ] {
            let untouched = Buffer::filled(Rect::new(0, 0, 40, 20), Cell::new("#"));
            assert_eq!(drawn(&encoded, small), untouched);
        }
        let buffer = drawn(&encoded, at_least);
        for (i, cell) in buffer.content.iter().enumerate() {
            let inside = area.contains(buffer.pos_of(i).into());
            assert_eq!(cell.diff_option != CellDiffOption::None, inside);
            assert!(inside || *cell == Cell::new("#"));
        }
    }
    for graphics in [
        Graphics::Sixel { tmux: false },
        Graphics::Iterm2 { tmux: false },
    ] {
        for [columns, rows] in [[9, 4], [5, 1]] {
            let sent = first_symbol(graphics, [columns, rows], &gradients);
            let (cells, end, _) = erased(&sent);
            let expected = (0..columns).flat_map(|x| (0..rows).map(move |y| (x, y)));
            assert_eq!(cells, expected.collect());
            assert_eq!(end, (0, 0), "the picture starts at the first cell");
        }
    }
    assert!(EncodedPicture::new(Graphics::Blocks, [9, 4], &gradients, 0).is_none());
}

/// Counts the bytes sent.
struct Counter(Rc<Shared<usize>>);

impl Write for Counter {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.set(self.0.get() + bytes.len());
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_picture_is_sent_once() {
    let noise = noise(90, 70);
    for graphics in [
        Graphics::Kitty { tmux: false },
        Graphics::Sixel { tmux: false },
        Graphics::Iterm2 { tmux: false },
    ] {
        let area = Rect::new(0, 0, 12, 6);
        let options = TerminalOptions {
            viewport: Viewport::Fixed(area),
        };
        let sent = Rc::new(Shared::new(0));
        let mut sizes = Vec::new();
        let encoded = EncodedPicture::new(graphics, [9, 4], &noise, 0).unwrap();
        let backend = CrosstermBackend::new(Counter(Rc::clone(&sent)));
        let mut terminal = Terminal::with_options(backend, options).unwrap();
        for _ in 0..3 {
            terminal
                .draw(|frame| frame.render_widget(&encoded, Rect::new(1, 1, 9, 4)))
                .unwrap();
            sizes.push(sent.get());
        }
        assert!(sizes[0] > 9000, "{graphics:?}: {sizes:?}");
        // The second frame replaces kitty's first cell by a placeholder alone.
        assert!(sizes[1] - sizes[0] < 200, "{graphics:?}: {sizes:?}");
        assert!(sizes[2] - sizes[1] < 100, "{graphics:?}: {sizes:?}");
    }
}

#[test]
fn a_new_picture_never_replaces_a_cached_one_in_the_terminal() {
    let mut cache = GraphicsCache::default();
    let content = || Arc::new(PreviewContent::Unavailable(String::new()));
    let graphics = Graphics::Kitty { tmux: false };
    // Returns the id of a picture, and whether it was encoded anew.
    let mut get = |kind, content: &Arc<PreviewContent>| {
        let mut made = false;
        let encoded = cache.get(graphics, kind, [4, 2], 0.0, content, || {
            made = true;
            Image::from_fn(32, 32, |_, _| [0.5; 3])
        });
        let buffer = drawn(encoded.unwrap(), Rect::new(0, 0, 4, 2));
        (buffer[(1, 0)].fg, made)
    };
    let reference = content();
    let (reference_id, _) = get(PictureMode::Reference, &reference);
    let mut last = None;
    for _ in 0..6 {
        let live = content();
        // A cached picture is shown until a multiple of its cost has passed.
        let id = loop {
            match get(PictureMode::Live, &live) {
                (id, true) => break id,
                _ => std::thread::sleep(Duration::from_millis(2)),
            }
        };
        assert_ne!(id, reference_id);
        // With the id of the picture before, cells on the screen would not change.
        assert_ne!(Some(id), last);
        last = Some(id);
        assert_eq!(
            get(PictureMode::Reference, &reference),
            (reference_id, false)
        );
    }
}
