//! The picture pane: picture, reference and error maps, with two pixels in every character cell
//! if the terminal has colours and half blocks.

use std::sync::Arc;

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::{Color, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::pane;
use crate::tui::format;
use crate::tui::model::night::NightModel;
use crate::tui::modes::PictureMode;
use crate::tui::preview::{PreviewContent, box_average};
use crate::tui::terminal::terminal_caps::{Colors, Graphics, TerminalCaps};
use crate::tui::view::View;
use lumbre_light::film::Image;
use lumbre_light::math::luminance::luminance_f32;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::{CellRef, Night};

/// Characters from dark to bright, for terminals without colours.
const SHADES: &[u8] = b" .:-=+*#%@";

/// Number of pixels in one character cell, one above the other.
fn pixels_per_cell(caps: TerminalCaps) -> u32 {
    if caps.ascii || caps.colors == Colors::None {
        1
    } else {
        2
    }
}

/// Size in pixels at which an image fills `columns` x `rows` character cells at its aspect ratio.
/// A character cell is assumed to be twice as high as wide.
fn fitted(image: [u32; 2], columns: u16, rows: u16, per_cell: u32) -> [u32; 2] {
    let (w, h) = (f64::from(image[0].max(1)), f64::from(image[1].max(1)));
    // Lengths are in columns; a row is two columns high.
    let scale = (f64::from(columns) / w).min(f64::from(rows) * 2.0 / h);
    let pixel_height = 2.0 / f64::from(per_cell);
    let size = [w * scale, h * scale / pixel_height].map(|x| x.round().max(1.0) as u32);
    [
        size[0].min(u32::from(columns)),
        size[1].min(u32::from(rows) * per_cell),
    ]
}

/// Nearest of the 256 indexed colours: from the 6x6x6 cube, or one of 24 greys if that is closer.
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

/// Terminal colour of display values at a pixel. Indexed colours are dithered.
fn color(caps: TerminalCaps, display: [f32; 3], pixel: [u32; 2]) -> Color {
    let rgb = |display: [f32; 3]| display.map(|x| (x.clamp(0.0, 1.0) * 255.0).round() as u8);
    match caps.colors {
        Colors::True => {
            let [r, g, b] = rgb(display);
            Color::Rgb(r, g, b)
        }
        _ => Color::Indexed(indexed(rgb(dithered(display, pixel)))),
    }
}

/// Adds the threshold of a 4x4 ordered dither, as large as the distance of indexed colours: a quarter
/// of that for greys, of which there are more.
fn dithered(display: [f32; 3], [x, y]: [u32; 2]) -> [f32; 3] {
    const BAYER: [[f32; 4]; 4] = [
        [0.0, 8.0, 2.0, 10.0],
        [12.0, 4.0, 14.0, 6.0],
        [3.0, 11.0, 1.0, 9.0],
        [15.0, 7.0, 13.0, 5.0],
    ];
    let threshold = (BAYER[y as usize % 4][x as usize % 4] + 0.5) / 16.0 - 0.5;
    let [low, high] =
        [f32::min, f32::max].map(|end| display.into_iter().reduce(end).unwrap_or(0.0));
    let step = if high - low < 0.05 { 10.0 } else { 40.0 };
    display.map(|value| value + threshold * step / 255.0)
}

/// Character for the brightness of display values.
fn shade(display: [f32; 3]) -> char {
    let luma = luminance_f32(display);
    let index = (luma.clamp(0.0, 1.0) * SHADES.len() as f32) as usize;
    char::from(SHADES[index.min(SHADES.len() - 1)])
}

/// Draws the picture pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    match view.visible_mode() {
        PictureMode::Strategies => super::strategies::draw(frame, area, model, view),
        PictureMode::Time => super::time::draw(frame, area, model, view),
        // What is shown instead is not a choice: the mode returns with the next cell.
        kind if kind.needs_reference() && is_reference(model) => {
            draw_mode(frame, area, model, view, PictureMode::Live)
        }
        kind => draw_mode(frame, area, model, view, kind),
    }
}

/// Draws the reference beside the picture.
pub fn draw_reference(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    draw_mode(frame, area, model, view, PictureMode::Reference);
}

/// Draws the error map beside the picture: FLIP, or the difference where the picture pane shows
/// FLIP.
pub fn draw_error_map(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let kind = if view.visible_mode() == PictureMode::Flip {
        PictureMode::Difference
    } else {
        PictureMode::Flip
    };
    draw_mode(frame, area, model, view, kind);
}

/// Returns whether the current run is a reference.
fn is_reference(model: &NightModel) -> bool {
    let current = model.current.as_ref();
    current.is_some_and(|current| matches!(current.cell, CellRef::Reference(_)))
}

/// Draws the current run in one mode.
fn draw_mode(frame: &mut Frame, area: Rect, model: &NightModel, view: &View, kind: PictureMode) {
    let caps = view.caps;
    let current = model
        .current
        .as_ref()
        .and_then(|current| Some((current, current.image.as_ref()?)));
    let block = pane(caps, title(kind, current.map(|(_, image)| &**image), view));
    let inner = block.inner(area);
    let (Some((current, image)), Some(night)) = (current, model.planned()) else {
        frame.render_widget(block, area);
        frame.render_widget(Paragraph::new("no picture yet").style(caps.dim()), inner);
        return;
    };
    let per_cell = pixels_per_cell(caps);
    let resolution = [image.width, image.height];
    let cells = graphics_cells(resolution, inner, view);
    let size = match cells {
        Some([columns, rows]) => {
            let [wide, high] = view.graphics.1;
            [
                u32::from(columns) * u32::from(wide),
                u32::from(rows) * u32::from(high),
            ]
        }
        None => fitted(resolution, inner.width, inner.height, per_cell),
    };
    let content = view.preview.borrow_mut().get(
        kind,
        size,
        image,
        current.reference.as_ref(),
        &night.plan.metrics,
    );
    let (shown, note) = match display_image(&content, kind, view, night) {
        Ok(shown) => shown,
        Err(reason) => {
            frame.render_widget(block, area);
            super::draw_note(frame, inner, caps, reason);
            return;
        }
    };
    let block = match note {
        Some(note) => block.title_bottom(note),
        None => block,
    };
    frame.render_widget(block, area);
    match cells {
        Some(cells) => full_resolution(frame, inner, view, kind, cells, &content, shown),
        None => {
            let at = centred(inner, &shown, per_cell);
            paint(frame, at, caps, &shown, per_cell);
        }
    }
}

/// Returns the title of the pane: mode, flicker and resolution.
fn title(kind: PictureMode, image: Option<&Image>, view: &View) -> Line<'static> {
    let mut title = vec![Span::styled(heading(kind), view.caps.strong())];
    if view.flicker {
        title.push(Span::styled("flicker ", view.caps.warn()));
    }
    if let Some(image) = image {
        title.push(Span::styled(
            format!("{}x{} px ", image.width, image.height),
            view.caps.dim(),
        ));
    }
    Line::from(title)
}

/// Converts a preview to display values and the note at the bottom of the pane.
///
/// # Errors
/// The reason why there is no preview.
fn display_image<'c>(
    content: &'c PreviewContent,
    kind: PictureMode,
    view: &View,
    night: &Night,
) -> Result<(Image, Option<Line<'static>>), &'c str> {
    let caps = view.caps;
    match content {
        PreviewContent::Radiance(reduced) => {
            let note = (view.exposure != 0.0)
                .then(|| Line::styled(format!(" {:+} stops ", view.exposure), caps.warn()));
            Ok((displayed(reduced, view.exposure, night.plan.display), note))
        }
        PreviewContent::Map {
            width,
            height,
            colours,
            scale,
        } => {
            let unit = if kind == PictureMode::Flip {
                ""
            } else {
                " radiance"
            };
            let [low, high] = scale.map(|value| format::number(f64::from(value)));
            let note = Line::styled(format!(" {low} to {high}{unit} "), caps.dim());
            let data = colours
                .iter()
                .map(|rgb| rgb.map(|c| f32::from(c) / 255.0))
                .collect();
            let image = Image::from_pixels(*width, *height, data);
            Ok((image, Some(note)))
        }
        PreviewContent::Unavailable(reason) => Err(reason),
    }
}

/// Draws a picture through a graphics protocol in the middle of `inner`.
fn full_resolution(
    frame: &mut Frame,
    inner: Rect,
    view: &View,
    kind: PictureMode,
    cells: [u16; 2],
    content: &Arc<PreviewContent>,
    shown: Image,
) {
    let mut cache = view.graphics_cache.borrow_mut();
    let encoded = cache.get(view.graphics.0, kind, cells, view.exposure, content, || {
        shown
    });
    if let Some(encoded) = encoded {
        let [width, height] = cells;
        let at = Rect {
            x: inner.x + (inner.width - width) / 2,
            y: inner.y + (inner.height - height) / 2,
            width,
            height,
        };
        frame.render_widget(encoded, at);
    }
}

/// Size in character cells of a picture in full resolution; `None` if pictures are blocks. Sizes
/// are whole cells, so the aspect ratio is off by less than one cell.
fn graphics_cells(image: [u32; 2], inner: Rect, view: &View) -> Option<[u16; 2]> {
    let (graphics, [wide, high]) = view.graphics;
    // Text cannot be drawn over such a picture, so the help overlay is shown over blocks.
    let able = graphics != Graphics::Blocks
        && wide > 0
        && high > 0
        && view.caps.colors != Colors::None
        && !view.help;
    let (w, h) = (f64::from(image[0].max(1)), f64::from(image[1].max(1)));
    let (wide, high) = (f64::from(wide), f64::from(high));
    let scale = (f64::from(inner.width) * wide / w).min(f64::from(inner.height) * high / h);
    let fit = |pixels: f64, cell: f64, most: u16| {
        ((pixels * scale / cell).round() as u16).clamp(1, most.max(1))
    };
    able.then(|| [fit(w, wide, inner.width), fit(h, high, inner.height)])
}

/// Title of the pane in each mode.
fn heading(kind: PictureMode) -> &'static str {
    match kind {
        PictureMode::Live => " Picture ",
        PictureMode::Reference => " Reference ",
        PictureMode::Difference => " Difference ",
        PictureMode::Flip => " FLIP ",
        PictureMode::Strategies => " Strategies ",
        PictureMode::Time => " Time ",
    }
}

/// Converts linear radiance to display values by a tone map, `stops` brighter.
pub(super) fn displayed(linear: &Image, stops: f32, display: Tonemap) -> Image {
    let brightness = stops.exp2();
    let exposed = Image {
        data: linear
            .data
            .iter()
            .map(|pixel| pixel.map(|v| v * brightness))
            .collect(),
        ..linear.clone()
    };
    display.apply(&exposed)
}

/// Rectangle of a picture in the middle of an area.
fn centred(inner: Rect, shown: &Image, per_cell: u32) -> Rect {
    let (width, height) = (shown.width as u16, shown.height.div_ceil(per_cell) as u16);
    Rect {
        x: inner.x + inner.width.saturating_sub(width) / 2,
        y: inner.y + inner.height.saturating_sub(height) / 2,
        width: width.min(inner.width),
        height: height.min(inner.height),
    }
}

/// Draws a picture of linear radiance into `area` at its aspect ratio by a tone map, `stops`
/// brighter.
pub(in crate::tui) fn draw_image(
    frame: &mut Frame,
    area: Rect,
    caps: TerminalCaps,
    linear: &Image,
    stops: f32,
    display: Tonemap,
) {
    let per_cell = pixels_per_cell(caps);
    let [width, height] = fitted(
        [linear.width, linear.height],
        area.width,
        area.height,
        per_cell,
    );
    let shown = displayed(&box_average(linear, width, height), stops, display);
    let at = centred(area, &shown, per_cell);
    paint(frame, at, caps, &shown, per_cell);
}

/// Draws display values into `area` at their aspect ratio.
pub(crate) fn draw_display(frame: &mut Frame, area: Rect, caps: TerminalCaps, shown: &Image) {
    let per_cell = pixels_per_cell(caps);
    let size = fitted(
        [shown.width, shown.height],
        area.width,
        area.height,
        per_cell,
    );
    if size == [shown.width, shown.height] {
        paint(frame, centred(area, shown, per_cell), caps, shown, per_cell);
    } else {
        let reduced = box_average(shown, size[0], size[1]);
        let at = centred(area, &reduced, per_cell);
        paint(frame, at, caps, &reduced, per_cell);
    }
}

/// Draws display values as characters.
fn paint(frame: &mut Frame, at: Rect, caps: TerminalCaps, display: &Image, per_cell: u32) {
    let buffer = frame.buffer_mut();
    for (row, y) in (at.top()..at.bottom()).enumerate() {
        for (column, x) in (at.left()..at.right()).enumerate() {
            let (column, row) = (column as u32, row as u32 * per_cell);
            let pixel = display.at(column, row);
            let at_pixel = [column, row];
            let cell = &mut buffer[(x, y)];
            if caps.colors == Colors::None {
                cell.set_char(shade(pixel));
            } else if per_cell == 1 {
                cell.set_char(' ')
                    .set_style(Style::new().bg(color(caps, pixel, at_pixel)));
            } else {
                let upper = color(caps, pixel, at_pixel);
                cell.set_char('▀').set_fg(upper);
                // With an odd number of pixel rows, the last lower half stays unset.
                if row + 1 < display.height {
                    let lower = display.at(column, row + 1);
                    cell.set_bg(color(caps, lower, [column, row + 1]));
                }
            }
        }
    }
}
