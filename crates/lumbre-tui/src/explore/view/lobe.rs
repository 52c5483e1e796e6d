//! The window of the inspector: the steps of a sample, and the lobe of the material beside a
//! histogram of the directions that are sampled.

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::Color;
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::canvas::{Canvas, Line as Stroke};
use ratatui::widgets::{Clear, Paragraph};

use super::Screen;
use crate::explore::inspect::{Inspection, Inspector, SurfaceFacts};
use crate::tui::format::{self, number};
use crate::tui::panes::{draw_note, framed, pane};
use crate::tui::terminal::terminal_caps::TerminalCaps;
use lumbre_render::lobe::{BINS, Lobe, STEPS, angle_of};

/// Draws the window.
pub fn draw(frame: &mut Frame, area: Rect, screen: &Screen, inspector: &Inspector) {
    let caps = screen.caps;
    frame.render_widget(Clear, area);
    let Some(found) = &inspector.found else {
        return draw_note(frame, area, caps, "tracing the sample");
    };
    let lower = (area.height / 2).clamp(area.height.min(10), 24);
    let parts = [Constraint::Fill(1), Constraint::Length(lower)];
    let [upper, lower] = Layout::vertical(parts).areas(area);
    steps(frame, upper, caps, found, inspector.scroll);
    let columns = [Constraint::Percentage(45), Constraint::Fill(1)];
    let [left, right] = Layout::horizontal(columns).areas(lower);
    let surface = found.surface.as_ref();
    match surface.and_then(|surface| Some((surface, surface.lobe.as_ref()?))) {
        Some((surface, lobe)) => {
            polar(frame, left, caps, surface, lobe);
            histogram(frame, right, caps, lobe);
        }
        None => {
            let text = "There is no surface at this pixel.";
            let block = pane(caps, Span::styled(" Lobe ", caps.strong()));
            let inner = framed(frame, lower, block);
            draw_note(frame, inner, caps, text);
        }
    }
}

/// Draws the steps of the sample.
fn steps(frame: &mut Frame, area: Rect, caps: TerminalCaps, found: &Inspection, scroll: usize) {
    let [x, y] = found.target.pixel;
    let title = format!(" Pixel {x}, {y}, sample {} ", found.target.sample);
    let hint = " n N sample  up down scroll  Enter close ";
    let block = pane(caps, Span::styled(title, caps.strong()))
        .title_bottom(Line::styled(hint, caps.dim()).right_aligned());
    let inner = framed(frame, area, block);
    let mut lines: Vec<Line> = Vec::new();
    for (index, step) in found.steps.iter().enumerate() {
        let room = usize::from(inner.width).saturating_sub(5);
        for (part, text) in format::wrap(step, room).into_iter().enumerate() {
            let number = if part == 0 {
                format!("{index:>3} ")
            } else {
                "      ".to_owned()
            };
            lines.push(Line::from(vec![
                Span::styled(number, caps.dim()),
                Span::raw(text),
            ]));
        }
    }
    let shown = usize::from(inner.height);
    let first = scroll.min(lines.len().saturating_sub(shown));
    let visible: Vec<Line> = lines.into_iter().skip(first).take(shown).collect();
    frame.render_widget(Paragraph::new(visible), inner);
}

/// Draws the polar plot of the value times the cosine in the plane of normal and camera.
fn polar(frame: &mut Frame, area: Rect, caps: TerminalCaps, surface: &SurfaceFacts, lobe: &Lobe) {
    let title = format!(" {} f cos ", format::clean(&surface.material));
    let most = lobe.greatest_value();
    let note = format!(" at most {} /sr ", number(most));
    let block = pane(caps, Span::styled(title, caps.strong()))
        .title_bottom(Line::styled(note, caps.dim()).right_aligned());
    let inner = framed(frame, area, block);
    if most <= 0.0 {
        return draw_note(frame, inner, caps, "This material has Dirac lobes only.");
    }
    let below = if lobe.is_transmissive() { 1.0 } else { 0.0 };
    // A cell is twice as high as wide, so that the plot is as wide as twice its rows allow.
    let height = f64::from(inner.height) * 2.0 / (1.0 + below);
    let width = f64::from(inner.width) / 2.0;
    let radius = height.min(width).max(1.0);
    let (wide, high) = (width / radius, f64::from(inner.height) * 2.0 / radius);
    let ink = caps.glow().fg.unwrap_or(Color::Reset);
    let faint = caps.behind().unwrap_or(Color::Reset);
    let point = |step: usize| {
        let (angle, r) = (f64::from(angle_of(step)), lobe.values[step] / most);
        [r * angle.sin(), r * angle.cos()]
    };
    let camera = -f64::from(lobe.angle);
    let canvas = Canvas::default()
        .marker(marker(caps))
        .x_bounds([-wide, wide])
        .y_bounds([-below, high - below])
        .paint(|ctx| {
            let stroke = |[x1, y1]: [f64; 2], [x2, y2]: [f64; 2], color| Stroke {
                x1,
                y1,
                x2,
                y2,
                color,
            };
            ctx.draw(&stroke([-1.0, 0.0], [1.0, 0.0], faint));
            ctx.draw(&stroke([0.0; 2], [camera.sin(), camera.cos()], faint));
            for step in 0..STEPS {
                ctx.draw(&stroke(point(step), point(step + 1), ink));
            }
            ctx.print(0.95 * camera.sin(), 0.95 * camera.cos(), "wo");
        });
    frame.render_widget(canvas, inner);
}

fn marker(caps: TerminalCaps) -> Marker {
    if caps.ascii {
        Marker::Custom('*')
    } else {
        Marker::Braille
    }
}

/// Draws bars of the density of sampled directions, and the density that the material states.
fn histogram(frame: &mut Frame, area: Rect, caps: TerminalCaps, lobe: &Lobe) {
    let title = Span::styled(" Sampled directions ", caps.strong());
    let facts = format!(
        " albedo {}, Dirac {} %, lost {} % ",
        number(lobe.albedo),
        number(100.0 * lobe.delta),
        number(100.0 * lobe.lost)
    );
    let block = pane(caps, title).title_bottom(Line::styled(facts, caps.dim()).right_aligned());
    let inner = framed(frame, area, block);
    // Directions below the surface have columns only if there are any.
    let whole = lobe.is_transmissive();
    let bins = if whole {
        0..BINS
    } else {
        BINS / 4..3 * BINS / 4
    };
    let range = bins.len();
    let columns = usize::from(inner.width);
    if columns < 20 || inner.height < 4 {
        return;
    }
    let most = lobe.histogram.iter().chain(&lobe.densities).copied();
    let most = most.fold(0.0, f64::max);
    if most <= 0.0 {
        return draw_note(frame, inner, caps, "No direction has a density.");
    }
    // The first row has the note, the last one the axis.
    let rows = inner.height - 2;
    let ink = caps.glow();
    for column in 0..columns {
        let bin = bins.start + column * range / columns;
        let share = lobe.histogram[bin] / most;
        let stated = lobe.densities[bin] / most;
        let x = inner.x + column as u16;
        let height = (share * f64::from(rows)).round() as u16;
        for row in 0..height {
            let y = inner.bottom() - 2 - row;
            frame
                .buffer_mut()
                .set_string(x, y, if caps.ascii { "#" } else { "█" }, ink);
        }
        if stated > 0.0 {
            let up = ((stated * f64::from(rows)) as u16).min(rows - 1);
            let y = inner.bottom() - 2 - up;
            frame.buffer_mut().set_string(x, y, "o", caps.strong());
        }
    }
    axis(frame, inner, caps, if whole { 180 } else { 90 });
    let note = format!("at most {} /sr; o: stated density", number(most));
    let note = format::fit(&note, columns, caps.glyphs().ellipsis);
    frame
        .buffer_mut()
        .set_string(inner.x, inner.y, note, caps.dim());
}

/// Writes angles in degrees under the bars.
fn axis(frame: &mut Frame, inner: Rect, caps: TerminalCaps, most: i32) {
    let y = inner.bottom() - 1;
    for (index, angle) in [-most, -most / 2, 0, most / 2, most]
        .into_iter()
        .enumerate()
    {
        let text = format!("{angle}");
        let width = text.len() as u16;
        let x = inner.x + inner.width * index as u16 / 4;
        let x = x
            .saturating_sub(width / 2)
            .clamp(inner.x, inner.right() - width);
        frame.buffer_mut().set_string(x, y, text, caps.dim());
    }
}
