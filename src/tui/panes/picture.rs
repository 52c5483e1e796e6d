//! The live picture: two pixels in every character cell where colours and half blocks can be had.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;
use std::sync::Arc;

use super::pane;
use crate::film::{Image, SharedImage};
use crate::tui::look::{Colors, Look};
use crate::tui::model::Model;
use crate::tui::view::View;

/// From dark to bright, for terminals without colours.
const SHADES: &[u8] = b" .:-=+*#%@";

/// A picture reduced to the pixels of a pane, with what it was made of.
#[derive(Debug)]
pub struct Preview {
    source: SharedImage,
    size: [u32; 2],
    reduced: Image,
}

/// Pixels that one character cell shows, one above the other.
fn pixels_per_cell(look: Look) -> u32 {
    if look.ascii || look.colors == Colors::None { 1 } else { 2 }
}

/// The size in pixels at which an image fills `columns` x `rows` cells as far as its aspect allows, when a character
/// cell is twice as high as wide.
fn fitted(image: [u32; 2], columns: u16, rows: u16, per_cell: u32) -> [u32; 2] {
    let (w, h) = (f64::from(image[0].max(1)), f64::from(image[1].max(1)));
    // Lengths in columns: a row is two of them high.
    let scale = (f64::from(columns) / w).min(f64::from(rows) * 2.0 / h);
    let pixel_height = 2.0 / f64::from(per_cell);
    let size = [w * scale, h * scale / pixel_height].map(|x| x.round().max(1.0) as u32);
    [size[0].min(u32::from(columns)), size[1].min(u32::from(rows) * per_cell)]
}

/// The image at another size, every new pixel the mean of the radiance that it covers. Non-finite pixels count as
/// black.
pub fn box_average(image: &Image, width: u32, height: u32) -> Image {
    let columns: Vec<Vec<(u32, f32)>> = (0..width).map(|x| cover(x, width, image.width)).collect();
    let rows: Vec<Vec<(u32, f32)>> = (0..height).map(|y| cover(y, height, image.height)).collect();
    Image::from_fn(width, height, |x, y| {
        let mut sum = [0.0f32; 3];
        for (row, row_weight) in &rows[y as usize] {
            for (column, weight) in &columns[x as usize] {
                let pixel = image.at(*column, *row);
                for c in 0..3 {
                    sum[c] += row_weight * weight * if pixel[c].is_finite() { pixel[c] } else { 0.0 };
                }
            }
        }
        sum
    })
}

/// The old pixels that new pixel `i` of `new` covers along one side, with their shares, which add up to one.
fn cover(i: u32, new: u32, old: u32) -> Vec<(u32, f32)> {
    let scale = f64::from(old) / f64::from(new);
    let (from, to) = (f64::from(i) * scale, f64::from(i + 1) * scale);
    let last = (to.ceil() as u32).min(old);
    let share = |k: u32| (f64::from(k + 1).min(to) - f64::from(k).max(from)) / scale;
    (from.floor() as u32..last).map(|k| (k, share(k) as f32)).filter(|(_, share)| *share > 0.0).collect()
}

/// The nearest of the 256 indexed colours: the 6x6x6 cube, or the 24 greys where they are closer.
fn indexed(rgb: [u8; 3]) -> u8 {
    const STEPS: [i32; 6] = [0, 95, 135, 175, 215, 255];
    let rgb = rgb.map(i32::from);
    let nearest = |x: i32| (0..6).min_by_key(|i| (STEPS[*i] - x).abs()).unwrap_or(0);
    let cube = rgb.map(nearest);
    let distance = |to: [i32; 3]| (0..3).map(|c| (to[c] - rgb[c]).pow(2)).sum::<i32>();
    let mean = rgb.iter().sum::<i32>() / 3;
    let grey = ((mean - 8 + 5) / 10).clamp(0, 23);
    let index = if distance([8 + 10 * grey; 3]) < distance(cube.map(|i| STEPS[i])) {
        232 + grey
    } else {
        16 + 36 * cube[0] as i32 + 6 * cube[1] as i32 + cube[2] as i32
    };
    index as u8
}

fn color(look: Look, display: [f32; 3]) -> Color {
    let rgb = display.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
    match look.colors {
        Colors::True => Color::Rgb(rgb[0], rgb[1], rgb[2]),
        _ => Color::Indexed(indexed(rgb)),
    }
}

fn shade(display: [f32; 3]) -> char {
    // Luma of display values, Rec. 709 weights.
    let luma = 0.2126 * display[0] + 0.7152 * display[1] + 0.0722 * display[2];
    let index = (luma.clamp(0.0, 1.0) * SHADES.len() as f32) as usize;
    char::from(SHADES[index.min(SHADES.len() - 1)])
}

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let mut title = vec![Span::styled(" Picture ", look.strong())];
    let current = model.current.as_ref().and_then(|current| Some((current, current.image.as_ref()?)));
    if let Some((_, image)) = current {
        title.push(Span::styled(format!("{}x{} px ", image.width, image.height), look.dim()));
    }
    if view.exposure != 0.0 {
        title.push(Span::styled(format!("{:+} stops ", view.exposure), look.warn()));
    }
    let block = pane(look, Line::from(title));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let (Some((_, image)), Some(plan)) = (current, &model.plan) else {
        frame.render_widget(Paragraph::new("no picture yet").style(look.dim()), inner);
        return;
    };
    let per_cell = pixels_per_cell(look);
    let size = fitted([image.width, image.height], inner.width, inner.height, per_cell);
    let mut preview = view.preview.borrow_mut();
    let fresh = |p: &&mut Preview| Arc::ptr_eq(&p.source, image) && p.size == size;
    let preview = match preview.as_mut().filter(fresh) {
        Some(preview) => preview,
        None => preview.insert(Preview { source: image.clone(), size, reduced: box_average(image, size[0], size[1]) }),
    };
    let brightness = view.exposure.exp2();
    let exposed = Image::from_fn(size[0], size[1], |x, y| preview.reduced.at(x, y).map(|v| v * brightness));
    let display = plan.display.apply(&exposed);
    let cell_rows = size[1].div_ceil(per_cell) as u16;
    let at = Rect {
        x: inner.x + (inner.width - size[0] as u16) / 2,
        y: inner.y + (inner.height - cell_rows) / 2,
        width: size[0] as u16,
        height: cell_rows,
    };
    paint(frame, at, look, &display, per_cell);
}

fn paint(frame: &mut Frame, at: Rect, look: Look, display: &Image, per_cell: u32) {
    let buffer = frame.buffer_mut();
    for (row, y) in (at.top()..at.bottom()).enumerate() {
        for (column, x) in (at.left()..at.right()).enumerate() {
            let (column, row) = (column as u32, row as u32 * per_cell);
            let pixel = display.at(column, row);
            let cell = &mut buffer[(x, y)];
            if look.colors == Colors::None {
                cell.set_char(shade(pixel));
            } else if per_cell == 1 {
                cell.set_char(' ').set_style(Style::new().bg(color(look, pixel)));
            } else {
                let upper = color(look, pixel);
                cell.set_char('▀').set_fg(upper);
                // An odd number of pixel rows leaves the last lower half to the terminal's own background.
                if row + 1 < display.height {
                    cell.set_bg(color(look, display.at(column, row + 1)));
                }
            }
        }
    }
}
