//! Facts about the picture: samples, times, rates and noise.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use crate::explore::session::{Frame as Picture, Slot};
use crate::tui::format;
use crate::tui::panes::pane;

/// Draws the facts.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let caps = screen.caps;
    let block = pane(caps, Span::styled(" Progress ", caps.strong()));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let live = screen.published.slot(Slot::Live);
    let Some(picture) = &live.frame else {
        return;
    };
    let [width, height] = [picture.image.width, picture.image.height];
    let first = live.first_picture_s.map_or_else(String::new, |seconds| {
        format!(", first after {}", format::duration(seconds))
    });
    let mut rows = vec![
        format!(
            "{} samples in {}",
            format::count(picture.samples),
            format::duration(picture.render_s)
        ),
        rates(picture),
        format!("{width}x{height} px{first}"),
        noise(picture),
        live.device.clone(),
    ];
    if picture.invalid > 0 {
        rows.insert(0, format!("{} samples were not finite", picture.invalid));
    }
    let ellipsis = caps.glyphs().ellipsis;
    let lines: Vec<Line> = rows
        .into_iter()
        .map(|row| Line::from(format::fit(&row, usize::from(inner.width), ellipsis)))
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Samples of every pixel per second, and million paths and rays per second.
fn rates(picture: &Picture) -> String {
    if picture.render_s <= 0.0 || picture.samples == 0 {
        return String::new();
    }
    let per_second = |n: u64| n as f64 / picture.render_s;
    format!(
        "{} spp/s, {} Mpaths/s, {} Mrays/s",
        format::number(per_second(picture.samples)),
        format::number(per_second(picture.paths) / 1e6),
        format::number(per_second(picture.rays) / 1e6),
    )
}

fn noise(picture: &Picture) -> String {
    picture.noise.map_or_else(String::new, |noise| {
        format!("noise {} % of the mean", format::number(100.0 * noise))
    })
}
