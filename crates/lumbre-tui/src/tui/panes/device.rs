//! The device pane: device name, utilisation, memory and temperature, or the list of workers.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{framed, pane};
use crate::tui::format;
use crate::tui::model::night::NightModel;
use crate::tui::model::worker_list;
use crate::tui::terminal::device_gauges::Reading;
use crate::tui::terminal::terminal_caps::TerminalCaps;
use crate::tui::view::View;

/// Height of the pane in rows, including its border.
pub const ROWS: u16 = 6;

/// Height of the pane in rows, including its border, on a screen of `screen` rows.
pub fn rows(model: &NightModel, screen: u16) -> u16 {
    let listed = worker_list::rows_wanted(model.workers.len()).saturating_add(2);
    listed.clamp(ROWS, (screen / 3).max(ROWS))
}

/// Draws the device pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    if !model.workers.is_empty() {
        return list(frame, area, model, caps);
    }
    let current = model.current.as_ref();
    let backend = current
        .and_then(|current| model.settings(current.cell))
        .map(|config| format::clean(&config.backend));
    let mut title = vec![Span::styled(" Device ", caps.strong())];
    if let Some(backend) = backend {
        title.push(Span::styled(format!("{backend} "), caps.accent()));
    }
    let inner = framed(frame, area, pane(caps, Line::from(title)));
    let width = usize::from(inner.width);
    let ellipsis = caps.glyphs().ellipsis;
    let device = current.map_or_else(String::new, |current| current.open.device_line());
    let mut lines = match device.as_str() {
        "" => vec![Line::styled("no run has started yet", caps.dim())],
        device => vec![Line::from(format::fit(
            &format::clean(device),
            width,
            ellipsis,
        ))],
    };
    if let Some(current) = current.filter(|current| current.open.accel_nodes > 0) {
        let (nodes, build) = (
            format::count(current.open.accel_nodes),
            format::duration(current.open.accel_build_s),
        );
        let open = &current.open;
        let text = if open.scene.geometry == 0 {
            format!("{nodes} BVH nodes built in {build}")
        } else {
            format!(
                "geometry {}, textures {}, BVH {} in {build}",
                size(open.scene.geometry),
                size(open.scene.textures),
                size(open.accel_bytes)
            )
        };
        lines.push(Line::styled(
            format::fit(&text, width, ellipsis),
            caps.dim(),
        ));
    }
    if !view.watching {
        let gauges = view.gauges.borrow();
        lines.extend(reading(caps, width, "gpu", &gauges.gpu, None));
        lines.extend(reading(caps, width, "cpu", &gauges.cpu, gauges.resident));
    }
    lines.truncate(usize::from(inner.height));
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Draws the list of workers, if there are several.
fn list(frame: &mut Frame, area: Rect, model: &NightModel, caps: TerminalCaps) {
    let lost = model.workers.iter().filter(|worker| worker.lost).count();
    let mut title = vec![Span::styled(
        format!(" Workers {} ", model.workers.len() - lost),
        caps.strong(),
    )];
    if lost > 0 {
        title.push(Span::styled(format!("{lost} lost "), caps.bad()));
    }
    let inner = framed(frame, area, pane(caps, Line::from(title)));
    let lines = worker_list::lines(
        caps,
        &model.workers,
        usize::from(inner.width),
        usize::from(inner.height),
    );
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Returns one line for utilisation and temperature, and one for memory, as far as readable.
fn reading(
    caps: TerminalCaps,
    width: usize,
    name: &str,
    reading: &Reading,
    own: Option<u64>,
) -> Vec<Line<'static>> {
    let mut lines = Vec::new();
    if let Some(busy) = reading.busy {
        let heat = reading
            .celsius
            .map_or_else(String::new, |celsius| format!("  {celsius:.0} C"));
        lines.push(gauge(
            caps,
            width,
            name,
            busy,
            &format!("{:>3.0} %{heat}", busy * 100.0),
        ));
    }
    if let Some([used, all]) = reading.memory.filter(|[_, all]| *all > 0) {
        let own = own.map_or_else(String::new, |bytes| format!(", process {}", size(bytes)));
        let text = format!("{} of {}{own}", size(used), size(all));
        lines.push(gauge(caps, width, "mem", used as f64 / all as f64, &text));
    }
    lines
}

/// Draws a gauge: `cpu ━━━━━━────  87 %`.
fn gauge(caps: TerminalCaps, width: usize, name: &str, share: f64, text: &str) -> Line<'static> {
    let glyphs = caps.glyphs();
    let room = width
        .saturating_sub(format::width(name) + format::width(text) + 2)
        .min(24);
    let full = ((room as f64 * share).round() as usize).min(room);
    Line::from(vec![
        Span::styled(format!("{name} "), caps.dim()),
        Span::styled(glyphs.bar.repeat(full), caps.glow()),
        Span::styled(glyphs.track.repeat(room - full), caps.dim()),
        Span::raw(format!(" {text}")),
    ])
}

/// Formats a size in bytes: `310 MiB`, `5.2 GiB`.
fn size(bytes: u64) -> String {
    const MIB: f64 = 1_048_576.0;
    let mib = bytes as f64 / MIB;
    if mib < 1.0 {
        format!("{:.0} KiB", mib * 1024.0)
    } else if mib < 1000.0 {
        format!("{mib:.0} MiB")
    } else {
        format!("{:.1} GiB", mib / 1024.0)
    }
}
