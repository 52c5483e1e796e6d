//! List of the workers of a night.

use ratatui::text::{Line, Span};

use crate::tui::format;
use crate::tui::terminal::terminal_caps::TerminalCaps;

/// Text and state of one worker.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkerLine {
    /// Host name, and the job id if there is one.
    pub node: String,
    /// Device on which the worker renders.
    pub device: String,
    /// Name of the cell that the worker renders, or another activity.
    pub activity: String,
    /// Seconds since the last heartbeat.
    pub age_s: f64,
    /// Whether the heartbeat is so old that other workers take over its cells.
    pub lost: bool,
}

/// Largest number of rows of the list.
const MOST_ROWS: usize = 16;

/// Number of rows that a list of `workers` workers needs.
pub fn rows_wanted(workers: usize) -> u16 {
    workers.min(MOST_ROWS) as u16
}

/// Draws the list: lost workers first, as many as fit, then the number of the others.
pub fn lines(
    caps: TerminalCaps,
    workers: &[WorkerLine],
    width: usize,
    height: usize,
) -> Vec<Line<'static>> {
    let mut sorted: Vec<&WorkerLine> = workers.iter().collect();
    sorted.sort_by_key(|worker| (!worker.lost, worker.node.clone()));
    let shown = if sorted.len() > height {
        height.saturating_sub(1)
    } else {
        sorted.len()
    };
    let widest = sorted
        .iter()
        .take(shown)
        .map(|w| format::width(&w.node))
        .max()
        .unwrap_or(0)
        .min(width / 3);
    let mut lines: Vec<Line<'static>> = sorted[..shown]
        .iter()
        .map(|w| line(caps, w, widest, width))
        .collect();
    if shown < sorted.len() && height > 0 {
        let more = sorted[shown..].len();
        lines.push(Line::styled(
            format::fit(&format!("and {more} more"), width, caps.glyphs().ellipsis),
            caps.dim(),
        ));
    }
    lines
}

fn line(caps: TerminalCaps, worker: &WorkerLine, widest: usize, width: usize) -> Line<'static> {
    let ellipsis = caps.glyphs().ellipsis;
    let node = format::fit(&format::clean(&worker.node), widest, ellipsis);
    let age = if worker.age_s < 60.0 {
        format!("{:.0} s", worker.age_s)
    } else {
        format::duration(worker.age_s)
    };
    let age = if worker.lost {
        format!("lost {age}")
    } else {
        age
    };
    let room = width.saturating_sub(widest + format::width(&age) + 2);
    let activity = format::clean(&worker.activity);
    // Omit the device if only a few of its letters would fit.
    let seen = room.saturating_sub(format::width(&activity) + 2);
    let text = if seen >= 8 {
        format!("{activity}  {}", format::clean(&worker.device))
    } else {
        activity
    };
    let text = format::fit(&text, room, ellipsis);
    let gap = " ".repeat(room - format::width(&text).min(room) + 1);
    let pad = " ".repeat(widest - format::width(&node).min(widest) + 1);
    let style = if worker.lost { caps.bad() } else { caps.dim() };
    Line::from(vec![
        Span::raw(node + &pad),
        Span::raw(text + &gap),
        Span::styled(age, style),
    ])
}
