//! The device: what renders, how busy it is, its memory and its temperature.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::pane;
use crate::tui::device::Reading;
use crate::tui::look::Look;
use crate::tui::model::Model;
use crate::tui::view::View;
use crate::tui::{words, workers};

/// Rows of the pane, its frame included.
pub const ROWS: u16 = 6;

/// Rows of the pane, its frame included, on a screen of so many.
pub fn rows(model: &Model, screen: u16) -> u16 {
    let listed = workers::rows_wanted(model.workers.len()).saturating_add(2);
    listed.clamp(ROWS, (screen / 3).max(ROWS))
}

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    if !model.workers.is_empty() {
        return list(frame, area, model, look);
    }
    let current = model.current.as_ref();
    let backend = current.and_then(|current| model.config(current.cell)).map(|config| words::clean(&config.backend));
    let mut title = vec![Span::styled(" Device ", look.strong())];
    if let Some(backend) = backend {
        title.push(Span::styled(format!("{backend} "), look.accent()));
    }
    let block = pane(look, Line::from(title));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = usize::from(inner.width);
    let ellipsis = look.glyphs().ellipsis;
    let device = current.map_or("", |current| current.open.device.as_str());
    let mut lines = match device {
        "" => vec![Line::styled("nothing renders yet", look.dim())],
        device => vec![Line::from(words::fit(&words::clean(device), width, ellipsis))],
    };
    if let Some(current) = current.filter(|current| current.open.accel_nodes > 0) {
        let (nodes, build) = (words::count(current.open.accel_nodes), words::duration(current.open.accel_build_s));
        let text = format!("{nodes} BVH nodes built in {build}");
        lines.push(Line::styled(words::fit(&text, width, ellipsis), look.dim()));
    }
    if !view.watching {
        let gauges = view.gauges.borrow();
        lines.extend(reading(look, width, "gpu", &gauges.gpu, None));
        lines.extend(reading(look, width, "cpu", &gauges.cpu, gauges.resident));
    }
    lines.truncate(usize::from(inner.height));
    frame.render_widget(Paragraph::new(lines), inner);
}

/// The workers instead, where there are several.
fn list(frame: &mut Frame, area: Rect, model: &Model, look: Look) {
    let lost = model.workers.iter().filter(|worker| worker.lost).count();
    let mut title = vec![Span::styled(format!(" Workers {} ", model.workers.len() - lost), look.strong())];
    if lost > 0 {
        title.push(Span::styled(format!("{lost} lost "), look.bad()));
    }
    let block = pane(look, Line::from(title));
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let lines = workers::lines(look, &model.workers, usize::from(inner.width), usize::from(inner.height));
    frame.render_widget(Paragraph::new(lines), inner);
}

/// One line for each thing that could be read: how busy, with the temperature; and memory.
fn reading(look: Look, width: usize, name: &str, reading: &Reading, own: Option<u64>) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if let Some(busy) = reading.busy {
        let heat = reading.celsius.map_or_else(String::new, |celsius| format!("  {celsius:.0} C"));
        lines.push(gauge(look, width, name, busy, &format!("{:>3.0} %{heat}", busy * 100.0)));
    }
    if let Some([used, all]) = reading.memory.filter(|[_, all]| *all > 0) {
        let own = own.map_or_else(String::new, |bytes| format!(", {} ours", size(bytes)));
        let text = format!("{} of {}{own}", size(used), size(all));
        lines.push(gauge(look, width, "mem", used as f64 / all as f64, &text));
    }
    lines
}

/// `cpu ━━━━━━────  87 %`
fn gauge(look: Look, width: usize, name: &str, share: f64, text: &str) -> Line<'static> {
    let glyphs = look.glyphs();
    let room = width.saturating_sub(words::width(name) + words::width(text) + 2).min(24);
    let full = ((room as f64 * share).round() as usize).min(room);
    Line::from(vec![
        Span::styled(format!("{name} "), look.dim()),
        Span::styled(glyphs.bar.repeat(full), look.glow()),
        Span::styled(glyphs.track.repeat(room - full), look.dim()),
        Span::raw(format!(" {text}")),
    ])
}

/// `310 MiB`, `5.2 GiB`.
fn size(bytes: u64) -> String {
    const MIB: f64 = 1_048_576.0;
    let mib = bytes as f64 / MIB;
    if mib < 1000.0 { format!("{mib:.0} MiB") } else { format!("{:.1} GiB", mib / 1024.0) }
}
