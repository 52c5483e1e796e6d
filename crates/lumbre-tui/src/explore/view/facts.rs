//! Facts about the picture: samples, times, rates and noise.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::Screen;
use crate::explore::reference::metrics;
use crate::explore::session::{Frame as Picture, Slot};
use crate::explore::settings::Settings;
use crate::tui::format;
use crate::tui::panes::{framed, pane};

/// Draws the facts.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen) {
    let caps = screen.caps;
    let block = pane(caps, Span::styled(" Progress ", caps.strong()));
    let inner = framed(frame, area, block);
    let rows = match &screen.state.comparison {
        Some(_) => compared(screen),
        None => alone(screen),
    };
    let ellipsis = caps.glyphs().ellipsis;
    let lines: Vec<Line> = rows
        .into_iter()
        .map(|row| Line::from(format::fit(&row, usize::from(inner.width), ellipsis)))
        .collect();
    frame.render_widget(Paragraph::new(lines), inner);
}

/// Facts about a single picture.
fn alone(screen: &Screen) -> Vec<String> {
    let live = screen.published.slot(screen.state.side);
    let Some(picture) = &live.frame else {
        return Vec::new();
    };
    let [width, height] = [picture.image.width, picture.image.height];
    let first = live.first_picture_s.map_or_else(String::new, |seconds| {
        format!(", first after {}", format::duration(seconds))
    });
    let mut rows = vec![
        samples(picture),
        rates(picture),
        format!("{width}x{height} px{first}"),
        noise(picture),
        live.device.clone(),
    ];
    if picture.invalid > 0 {
        rows.insert(0, format!("{} samples were not finite", picture.invalid));
    }
    rows
}

/// Facts about two pictures, and the difference between them.
fn compared(screen: &Screen) -> Vec<String> {
    let state = screen.state;
    let mut rows: Vec<String> = Slot::ALL
        .into_iter()
        .map(|slot| {
            let picture = screen.published.slot(slot).frame.as_ref();
            let facts = picture.map_or_else(String::new, |picture| samples(picture));
            format!("{}: {facts}", slot.name())
        })
        .collect();
    let mut specs = metrics();
    let spec = specs.swap_remove(state.metric.min(specs.len() - 1));
    let [a, b] = Slot::ALL.map(|slot| state.settings_of(slot).map(Settings::seed));
    let same_seed = a == b;
    let difference = state.difference.as_ref();
    let difference = difference.filter(|known| known.metric == state.metric);
    rows.extend(match difference {
        None => vec![format!("{} A to B: not measured yet", spec.column)],
        Some(known) => match &known.value {
            Err(reason) => vec![reason.clone()],
            Ok(value) => vec![
                format!(
                    "{} A to B: {}",
                    spec.column,
                    format::measured(&spec, *value)
                ),
                match known.noise {
                    _ if same_seed => "same seed: the noise is shared".to_owned(),
                    Some(noise) => format!(
                        "{} of noise alone: {}",
                        spec.column,
                        format::measured(&spec, noise)
                    ),
                    None => format!("no estimate of the noise in {}", spec.column),
                },
            ],
        },
    });
    let noise = |slot| {
        let frame = screen.published.slot(slot).frame.as_ref()?;
        Some(format!("{} %", format::number(100.0 * frame.noise?)))
    };
    if let (Some(a), Some(b)) = (noise(Slot::A), noise(Slot::B)) {
        rows.push(format!("noise A {a}, B {b} of the mean"));
    }
    rows
}

/// Samples per pixel and the time that they took.
fn samples(picture: &Picture) -> String {
    format!(
        "{} samples in {}",
        format::count(picture.samples),
        format::duration(picture.render_s)
    )
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
