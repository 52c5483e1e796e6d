//! The workers of a night, as a list.

use ratatui::text::{Line, Span};

use super::look::Look;
use super::words;

/// One worker, in words.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct WorkerLine {
    /// The machine, and the job there, if there is one.
    pub node: String,
    /// What it renders on.
    pub device: String,
    /// The cell that it renders; what else it does otherwise.
    pub doing: String,
    /// Seconds since it was heard of.
    pub age_s: f64,
    /// Whether nothing was heard of it for so long that others take its cells.
    pub lost: bool,
}

/// Most rows that a list may ask for.
const MOST_ROWS: usize = 16;

/// Rows that a list of so many workers asks for.
pub fn rows_wanted(workers: usize) -> u16 {
    workers.min(MOST_ROWS) as u16
}

/// The list: lost ones first, as many as fit, and how many do not.
pub fn lines(look: Look, workers: &[WorkerLine], width: usize, height: usize) -> Vec<Line<'static>> {
    let mut sorted: Vec<&WorkerLine> = workers.iter().collect();
    sorted.sort_by_key(|worker| (!worker.lost, worker.node.clone()));
    let shown = if sorted.len() > height { height.saturating_sub(1) } else { sorted.len() };
    let widest = sorted.iter().take(shown).map(|w| words::width(&w.node)).max().unwrap_or(0).min(width / 3);
    let mut lines: Vec<Line<'static>> = sorted[..shown].iter().map(|w| line(look, w, widest, width)).collect();
    if shown < sorted.len() && height > 0 {
        let more = sorted[shown..].len();
        lines.push(Line::styled(words::fit(&format!("and {more} more"), width, look.glyphs().ellipsis), look.dim()));
    }
    lines
}

fn line(look: Look, worker: &WorkerLine, widest: usize, width: usize) -> Line<'static> {
    let ellipsis = look.glyphs().ellipsis;
    let node = words::fit(&words::clean(&worker.node), widest, ellipsis);
    let age = if worker.age_s < 60.0 { format!("{:.0} s", worker.age_s) } else { words::duration(worker.age_s) };
    let age = if worker.lost { format!("lost {age}") } else { age };
    let room = width.saturating_sub(widest + words::width(&age) + 2);
    let doing = words::clean(&worker.doing);
    // A device of which only a letter would be seen is left out.
    let seen = room.saturating_sub(words::width(&doing) + 2);
    let text = if seen >= 8 { format!("{doing}  {}", words::clean(&worker.device)) } else { doing };
    let text = words::fit(&text, room, ellipsis);
    let gap = " ".repeat(room - words::width(&text).min(room) + 1);
    let pad = " ".repeat(widest - words::width(&node).min(widest) + 1);
    let style = if worker.lost { look.bad() } else { look.dim() };
    Line::from(vec![Span::raw(node + &pad), Span::raw(text + &gap), Span::styled(age, style)])
}
