//! Pictures: live, reference, and their errors; two pixels in every character cell where colours and half blocks can be
//! had.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::pane;
use crate::experiment::Outline;
use crate::film::Image;
use crate::tui::look::{Colors, Graphics, Look};
use crate::tui::model::Model;
use crate::tui::preview::{Content, box_average};
use crate::tui::view::{Picture, View};
use crate::tui::words;

/// From dark to bright, for terminals without colours.
const SHADES: &[u8] = b" .:-=+*#%@";

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
    let kind = view.shown();
    match kind {
        Picture::Strategies => return super::strategies::draw(frame, area, model, view),
        Picture::Time => return super::time::draw(frame, area, model, view),
        _ => {}
    }
    let current = model.current.as_ref().and_then(|current| Some((current, current.image.as_ref()?)));
    let mut title = vec![Span::styled(heading(kind), look.strong())];
    if view.flicker {
        title.push(Span::styled("flickers ", look.warn()));
    }
    if let Some((_, image)) = current {
        title.push(Span::styled(format!("{}x{} px ", image.width, image.height), look.dim()));
    }
    let mut block = pane(look, Line::from(title));
    let inner = block.inner(area);
    let (Some((current, image)), Some(plan)) = (current, &model.plan) else {
        frame.render_widget(block, area);
        frame.render_widget(Paragraph::new("no picture yet").style(look.dim()), inner);
        return;
    };
    let per_cell = pixels_per_cell(look);
    let mut size = fitted([image.width, image.height], inner.width, inner.height, per_cell);
    let cells = sharp_cells([image.width, image.height], inner, view);
    if let Some([columns, rows]) = cells {
        let [wide, high] = view.graphics.1;
        size = [u32::from(columns) * u32::from(wide), u32::from(rows) * u32::from(high)];
    }
    let content = view.preview.borrow_mut().get(kind, size, image, current.reference.as_ref(), &plan.metrics);
    let shown = match &*content {
        Content::Radiance(reduced) => {
            if view.exposure != 0.0 {
                block = block.title_bottom(Line::styled(format!(" {:+} stops ", view.exposure), look.warn()));
            }
            displayed(reduced, view.exposure, plan)
        }
        Content::Map { width, height, colours, scale } => {
            let unit = if kind == Picture::Flip { "" } else { " radiance" };
            let (low, high) = (words::number(f64::from(scale[0])), words::number(f64::from(scale[1])));
            block = block.title_bottom(Line::styled(format!(" {low} to {high}{unit} "), look.dim()));
            let data = colours.iter().map(|rgb| rgb.map(|c| f32::from(c) / 255.0)).collect();
            Image { width: *width, height: *height, data }
        }
        Content::Nothing(why) => {
            frame.render_widget(block, area);
            let lines: Vec<Line> = words::wrap(why, usize::from(inner.width)).into_iter().map(Line::from).collect();
            frame.render_widget(Paragraph::new(lines).style(look.dim()), inner);
            return;
        }
    };
    frame.render_widget(block, area);
    let Some(cells) = cells else {
        return paint(frame, centred(inner, &shown, per_cell), look, &shown, per_cell);
    };
    let mut sharp = view.sharp.borrow_mut();
    if let Some(protocol) = sharp.get(view.graphics.0, kind, cells, view.exposure, &content, || shown) {
        let [width, height] = cells;
        let at =
            Rect { x: inner.x + (inner.width - width) / 2, y: inner.y + (inner.height - height) / 2, width, height };
        frame.render_widget(ratatui_image::Image::new(protocol), at);
    }
}

/// The character cells that a picture in full resolution takes, as many as its aspect allows; `None` where pictures are
/// blocks. Cells are whole, so that the aspect is off by less than one of them.
fn sharp_cells(image: [u32; 2], inner: Rect, view: &View) -> Option<[u16; 2]> {
    let (graphics, [wide, high]) = view.graphics;
    // What lies over a picture would have to wait for its protocol, so that the help is shown over blocks.
    let able = graphics != Graphics::Blocks && wide > 0 && high > 0 && view.look.colors != Colors::None && !view.help;
    let (w, h) = (f64::from(image[0].max(1)), f64::from(image[1].max(1)));
    let (wide, high) = (f64::from(wide), f64::from(high));
    let scale = (f64::from(inner.width) * wide / w).min(f64::from(inner.height) * high / h);
    let fit = |pixels: f64, cell: f64, most: u16| ((pixels * scale / cell).round() as u16).clamp(1, most.max(1));
    able.then(|| [fit(w, wide, inner.width), fit(h, high, inner.height)])
}

/// What a picture is called on its frame.
fn heading(kind: Picture) -> &'static str {
    match kind {
        Picture::Live => " Picture ",
        Picture::Reference => " Reference ",
        Picture::Difference => " Difference ",
        Picture::Flip => " FLIP ",
        Picture::Strategies => " Strategies ",
        Picture::Time => " Time ",
    }
}

/// Display values of linear radiance under the plan's tone map, `stops` brighter.
pub(super) fn displayed(linear: &Image, stops: f32, plan: &Outline) -> Image {
    let brightness = stops.exp2();
    let exposed =
        Image { data: linear.data.iter().map(|pixel| pixel.map(|v| v * brightness)).collect(), ..linear.clone() };
    plan.display.apply(&exposed)
}

/// Where a picture lies in the middle of an area.
fn centred(inner: Rect, shown: &Image, per_cell: u32) -> Rect {
    let (width, height) = (shown.width as u16, shown.height.div_ceil(per_cell) as u16);
    Rect {
        x: inner.x + inner.width.saturating_sub(width) / 2,
        y: inner.y + inner.height.saturating_sub(height) / 2,
        width: width.min(inner.width),
        height: height.min(inner.height),
    }
}

/// Draws a small picture into `area`, as large as its aspect allows and `stops` brighter.
pub(super) fn thumbnail(frame: &mut Frame, area: Rect, look: Look, linear: &Image, stops: f32, plan: &Outline) {
    let per_cell = pixels_per_cell(look);
    let [width, height] = fitted([linear.width, linear.height], area.width, area.height, per_cell);
    let shown = displayed(&box_average(linear, width, height), stops, plan);
    paint(frame, centred(area, &shown, per_cell), look, &shown, per_cell);
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
