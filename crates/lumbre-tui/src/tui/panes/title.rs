//! The title line, the line of key hints, and the only line of a very small terminal.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use crate::tui::command;
use crate::tui::format;
use crate::tui::model::eta::Eta;
use crate::tui::model::night::NightModel;
use crate::tui::modes::Focus;
use crate::tui::terminal::terminal_caps::TerminalCaps;
use crate::tui::view::{Prompt, View};
use lumbre_night::experiment::night::state_counts::StateCounts;

/// Seconds without an event after which a watched night may have been terminated.
const SILENCE_S: f64 = 60.0;

/// Name of the night's folder: the plan's name and the first digits of its hash.
pub fn night_name(model: &NightModel) -> String {
    model.planned().map_or_else(
        || "no plan yet".to_owned(),
        |night| {
            let digits: String = night.plan.hash.chars().take(4).collect();
            format::clean(&format!("{}-{digits}", night.plan.name))
        },
    )
}

/// State of the night in a few words.
fn status(model: &NightModel, view: &View) -> (&'static str, Style) {
    let caps = view.caps;
    if model.planned().is_none() {
        ("starting", caps.dim())
    } else if model.finished_s.is_some() {
        match model.night.counts().end_word() {
            word @ "finished" => (word, caps.good()),
            word => (word, caps.warn()),
        }
    } else if view.watching {
        ("watching", caps.accent())
    } else if view.requests.stopping {
        ("stopping", caps.warn())
    } else if view.requests.paused {
        ("paused", caps.warn())
    } else if view.requests.after_cell {
        ("stops after this cell", caps.warn())
    } else {
        ("running", caps.good())
    }
}

/// Formats the remaining time: `12.0 s left`, with a sign for "at most" or "about".
pub fn time_left(caps: TerminalCaps, eta: Eta) -> String {
    let sign = match eta {
        Eta { at_most: true, .. } => format!("{} ", caps.glyphs().at_most),
        Eta { forecast: true, .. } => format!("{} ", caps.glyphs().about),
        _ => String::new(),
    };
    format!("{sign}{} left", format::duration(eta.seconds))
}

/// Facts of the right-hand side, most important first.
fn facts(model: &NightModel, view: &View) -> Vec<(String, Style)> {
    let caps = view.caps;
    let mut facts = Vec::new();
    if model.planned().is_none() {
        return facts;
    }
    let cells = StateCounts::of_runs(&model.night.runs);
    let references = StateCounts::of_references(&model.night.references);
    facts.push((
        format!("{}/{} cells", cells.settled(), cells.total()),
        caps.strong(),
    ));
    let failed = cells.failed + references.failed;
    if failed > 0 {
        facts.push((format!("{failed} failed"), caps.bad()));
    }
    let all = model.night.references.iter();
    match all.filter(|reference| reference.is_contradicted()).count() {
        0 => {}
        1 => facts.push(("1 bias check failed".to_owned(), caps.bad())),
        n => facts.push((format!("{n} bias checks failed"), caps.bad())),
    }
    if let Some(eta) = model.night_eta(view.clock_s(model)) {
        facts.push((time_left(caps, eta), caps.strong()));
    }
    facts.push((
        format!("{} elapsed", format::duration(model.night_s(view.now_s))),
        caps.dim(),
    ));
    let silence = view.now_s - model.updated_s;
    if view.watching && model.finished_s.is_none() && silence >= SILENCE_S {
        facts.push((
            format!("no update for {}", format::duration(silence)),
            caps.warn(),
        ));
    }
    if model.invalid() > 0 {
        facts.push((
            format!("{} invalid", format::count(model.invalid())),
            caps.bad(),
        ));
    }
    if references.total() > 0 {
        let noun = if references.total() == 1 {
            "reference"
        } else {
            "references"
        };
        facts.push((
            format!("{}/{} {noun}", references.settled(), references.total()),
            caps.dim(),
        ));
    }
    facts
}

/// Draws the title line: name and state of the night, and its progress.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let (word, style) = status(model, view);
    let facts = facts(model, view);
    let mut left = Line::from(Span::styled(" Lumbre", caps.accent()));
    let first = facts.first().map_or(0, |(text, _)| format::width(text) + 2);
    let name = night_name(model);
    if left.width() + format::width(&name) + word.len() + first + 6 <= usize::from(area.width) {
        left.extend([Span::raw("  "), Span::styled(name, caps.strong())]);
    }
    left.extend([Span::raw("  "), Span::styled(word, style)]);
    let mut room = usize::from(area.width).saturating_sub(left.width() + 2);
    let mut right: Vec<Span> = Vec::new();
    for (text, style) in facts {
        let needed = format::width(&text) + 2;
        if needed > room {
            break;
        }
        room -= needed;
        right.push(Span::raw("  "));
        right.push(Span::styled(text, style));
    }
    right.push(Span::raw(" "));
    frame.render_widget(left, area);
    frame.render_widget(Line::from(right).right_aligned(), area);
}

/// Draws the line of key hints; while the night is stopping, how to quit at once.
pub fn hints(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let mut spans = vec![Span::raw(" ")];
    if let Some(prompt) = &view.prompt {
        return self::prompt(frame, area, prompt, view);
    }
    if let Some(notice) = view
        .notice
        .as_ref()
        .filter(|notice| view.now_s < notice.until_s)
    {
        spans.push(Span::styled(format::clean(&notice.text), caps.warn()));
        frame.render_widget(Line::from(spans), area);
        return;
    }
    if view.requests.stopping && model.finished_s.is_none() {
        spans.push(Span::styled("Stopping after this wave. ", caps.warn()));
        spans.push(Span::styled("q", caps.accent()));
        spans.push(Span::styled(" again: quit now.", caps.warn()));
        frame.render_widget(Line::from(spans), area);
        return;
    }
    // The key of the help is always shown.
    let help = [("?".to_owned(), "all keys")];
    let mut room = usize::from(area.width).saturating_sub(12);
    let fitting = key_hints(model, view)
        .into_iter()
        .take_while(|(key, text)| {
            let needed = key.len() + text.len() + 3;
            let fits = needed <= room;
            room = room.saturating_sub(needed);
            fits
        });
    for (key, text) in fitting.chain(help) {
        spans.push(Span::styled(key, caps.accent()));
        spans.push(Span::styled(format!(" {text}  "), caps.dim()));
    }
    frame.render_widget(Line::from(spans), area);
}

/// Returns the keys and their meaning, most important first.
fn key_hints(model: &NightModel, view: &View) -> Vec<(String, &'static str)> {
    let scroll = if view.focus == Focus::Log {
        "log"
    } else {
        "plan"
    };
    let night: &[(&'static str, &'static str)] = if view.watching {
        &[("q", "quit")]
    } else {
        let pause = if view.requests.paused {
            "resume"
        } else {
            "pause"
        };
        &[("q", "stop"), ("p", pause), ("s", "skip"), ("R", "restart")]
    };
    let enlarge = match view.focus.next() {
        Focus::Overview => "all panes",
        Focus::Picture => "zoom picture",
        Focus::Chart => "zoom chart",
        Focus::Log => "zoom log",
        Focus::Plan => "zoom plan",
    };
    let screen = [
        ("Tab", enlarge),
        ("v", "view"),
        ("f", "flicker"),
        ("/", "filter"),
        (":", "command"),
        ("j/k", scroll),
        ("e/E", "exposure"),
        ("g", "tree"),
    ];
    let metrics = model.metrics().len();
    let digits = (metrics > 1).then(|| (format!("1-{}", metrics.min(9)), "metric"));
    let owned = |(key, text): &(&str, &'static str)| ((*key).to_owned(), *text);
    let screen = screen.iter().map(owned);
    let mut hints: Vec<_> = night.iter().map(owned).chain(screen).collect();
    hints.splice(night.len() + 1..night.len() + 1, digits);
    hints
}

/// Draws the prompt so that its end is visible.
fn prompt(frame: &mut Frame, area: Rect, prompt: &Prompt, view: &View) {
    let caps = view.caps;
    let (sign, text) = match prompt {
        Prompt::Command(text) => (":", text),
        Prompt::Filter(text) => ("/", text),
    };
    let room = usize::from(area.width).saturating_sub(3);
    let mut shown = format::clean(&format!("|{text}|"))
        .trim_matches('|')
        .to_owned();
    while format::width(&shown) > room {
        shown.remove(0);
    }
    let mut spans = vec![
        Span::styled(sign, caps.accent()),
        Span::raw(shown),
        Span::styled(caps.glyphs().cursor, caps.accent()),
    ];
    let hint = match prompt {
        Prompt::Command(text) => hint(text),
        Prompt::Filter(_) => Some("axis values or a state; Enter applies, Esc clears".to_owned()),
    };
    let used: usize = spans.iter().map(Span::width).sum();
    if let Some(hint) =
        hint.filter(|hint| used + format::width(hint) + 3 <= usize::from(area.width))
    {
        spans.push(Span::styled(format!("  {hint}"), caps.dim()));
    }
    frame.render_widget(Line::from(spans), area);
}

/// Returns the commands that match the typed name, or the description of the only match.
fn hint(text: &str) -> Option<String> {
    let name = text.split_whitespace().next().unwrap_or("");
    let matching: Vec<&command::CommandInfo> = command::COMMANDS
        .iter()
        .filter(|(known, ..)| known.starts_with(name))
        .collect();
    match matching.as_slice() {
        [] => None,
        [(name, argument, description)] => {
            Some(format!("{name} {argument}: {description}").replace(" :", ":"))
        }
        several => Some(
            several
                .iter()
                .map(|(name, ..)| *name)
                .collect::<Vec<_>>()
                .join(" "),
        ),
    }
}

/// Draws the only line of a terminal that is too small for panes.
pub fn one_line(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let (word, style) = status(model, view);
    let mut spans = vec![
        Span::styled("Lumbre ", caps.accent()),
        Span::styled(word, style),
    ];
    let mut room = usize::from(area.width).saturating_sub(7 + word.len());
    for (text, style) in facts(model, view) {
        let needed = format::width(&text) + 1;
        if needed > room {
            break;
        }
        room -= needed;
        spans.push(Span::raw(" "));
        spans.push(Span::styled(text, style));
    }
    frame.render_widget(Line::from(spans), area);
}
