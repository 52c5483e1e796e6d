//! The line on top, the line of keys at the bottom, and the one line of a tiny terminal.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};

use crate::tui::command;
use crate::tui::entry::Counts;
use crate::tui::eta::Eta;
use crate::tui::look::Look;
use crate::tui::model::Model;
use crate::tui::view::{Focus, Prompt, View};
use crate::tui::words;

/// Seconds without news after which a night that is watched may have been cut off.
const SILENCE_S: f64 = 60.0;

/// The name of the night as its folder has it: the plan's name and the first digits of its hash.
pub fn night_name(model: &Model) -> String {
    model.plan.as_ref().map_or_else(
        || "no plan yet".to_owned(),
        |plan| {
            let digits: String = plan.hash.chars().take(4).collect();
            words::clean(&format!("{}-{digits}", plan.name))
        },
    )
}

/// What the night is doing, in a word or two.
fn status(model: &Model, view: &View) -> (&'static str, Style) {
    let look = view.look;
    match () {
        () if model.plan.is_none() => ("starting", look.dim()),
        () if model.finished_s.is_some() => ("finished", look.good()),
        () if view.watching => ("watching", look.accent()),
        () if view.wishes.stopping => ("stopping", look.warn()),
        () if view.wishes.paused => ("paused", look.warn()),
        () if view.wishes.after_cell => ("ends after this cell", look.warn()),
        () => ("running", look.good()),
    }
}

/// Time that is left: `12.0 s left`, with a sign for `at most` and `about`.
pub fn time_left(look: Look, eta: Eta) -> String {
    let sign = match eta {
        Eta { at_most: true, .. } => format!("{} ", look.glyphs().at_most),
        Eta { forecast: true, .. } => format!("{} ", look.glyphs().about),
        _ => String::new(),
    };
    format!("{sign}{} left", words::duration(eta.seconds))
}

/// The facts of the right-hand side, most important first.
fn facts(model: &Model, view: &View) -> Vec<(String, Style)> {
    let look = view.look;
    let mut facts = Vec::new();
    if model.plan.is_none() {
        return facts;
    }
    let cells = Counts::of(&model.cells);
    let references = Counts::of(&model.references);
    facts.push((format!("{}/{} cells", cells.settled(), cells.total()), look.strong()));
    let failed = cells.failed + references.failed;
    if failed > 0 {
        facts.push((format!("{failed} failed"), look.bad()));
    }
    match model.contradicted.len() {
        0 => {}
        1 => facts.push(("1 reference contradicted".to_owned(), look.bad())),
        n => facts.push((format!("{n} references contradicted"), look.bad())),
    }
    if let Some(eta) = model.night_eta(view.clock_s(model)) {
        facts.push((time_left(look, eta), look.strong()));
    }
    facts.push((format!("{} elapsed", words::duration(model.night_s(view.now_s))), look.dim()));
    let silence = view.now_s - model.heard_s;
    if view.watching && model.finished_s.is_none() && silence >= SILENCE_S {
        facts.push((format!("no news for {}", words::duration(silence)), look.warn()));
    }
    if model.invalid() > 0 {
        facts.push((format!("{} invalid", words::count(model.invalid())), look.bad()));
    }
    if references.total() > 0 {
        let noun = if references.total() == 1 { "reference" } else { "references" };
        facts.push((format!("{}/{} {noun}", references.settled(), references.total()), look.dim()));
    }
    facts
}

/// Draws the line on top: who, what, how far.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let (word, style) = status(model, view);
    let facts = facts(model, view);
    let mut left = Line::from(Span::styled(" Lumbre", look.accent()));
    let first = facts.first().map_or(0, |(text, _)| words::width(text) + 2);
    let name = night_name(model);
    if left.width() + words::width(&name) + word.len() + first + 6 <= usize::from(area.width) {
        left.extend([Span::raw("  "), Span::styled(name, look.strong())]);
    }
    left.extend([Span::raw("  "), Span::styled(word, style)]);
    let mut room = usize::from(area.width).saturating_sub(left.width() + 2);
    let mut right: Vec<Span> = Vec::new();
    for (text, style) in facts {
        let needed = words::width(&text) + 2;
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

/// Draws the line of keys; while the night is stopping, what that means.
pub fn hints(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let mut spans = vec![Span::raw(" ")];
    if let Some(prompt) = &view.prompt {
        return self::prompt(frame, area, prompt, view);
    }
    if let Some(notice) = view.notice.as_ref().filter(|notice| view.now_s < notice.until_s) {
        spans.push(Span::styled(words::clean(&notice.text), look.warn()));
        frame.render_widget(Line::from(spans), area);
        return;
    }
    if view.wishes.stopping && model.finished_s.is_none() {
        spans.push(Span::styled("Ends after this wave. ", look.warn()));
        spans.push(Span::styled("q", look.accent()));
        spans.push(Span::styled(" again leaves now.", look.warn()));
        frame.render_widget(Line::from(spans), area);
        return;
    }
    let scroll = if view.focus == Focus::Log { "log" } else { "plan" };
    let night: &[(&str, &str)] = if view.watching {
        &[("q", "leave")]
    } else {
        let pause = if view.wishes.paused { "go on" } else { "pause" };
        &[("q", "stop"), ("p", pause), ("s", "skip"), ("R", "restart")]
    };
    let screen = [
        ("Tab", "larger pane"),
        ("1-9", "metric"),
        ("v", "picture"),
        ("f", "flicker"),
        ("/", "filter"),
        (":", "command"),
        ("j/k", scroll),
        ("e/E", "exposure"),
        ("g", "tree"),
    ];
    let keys: Vec<(&str, &str)> = night.iter().copied().chain(screen).collect();
    // The way to the help is never left out.
    let help = [("?", "help")];
    let mut room = usize::from(area.width).saturating_sub(8);
    let fitting = keys.iter().take_while(|(key, text)| {
        let needed = key.len() + text.len() + 3;
        let fits = needed <= room;
        room = room.saturating_sub(needed);
        fits
    });
    for (key, text) in fitting.chain(&help) {
        spans.push(Span::styled(*key, look.accent()));
        spans.push(Span::styled(format!(" {text}  "), look.dim()));
    }
    frame.render_widget(Line::from(spans), area);
}

/// Draws the line that is being typed, with its end in view.
fn prompt(frame: &mut Frame, area: Rect, prompt: &Prompt, view: &View) {
    let look = view.look;
    let (sign, text) = match prompt {
        Prompt::Command(text) => (":", text),
        Prompt::Filter(text) => ("/", text),
    };
    let room = usize::from(area.width).saturating_sub(3);
    let mut shown = words::clean(&format!("|{text}|")).trim_matches('|').to_owned();
    while words::width(&shown) > room {
        shown.remove(0);
    }
    let mut spans =
        vec![Span::styled(sign, look.accent()), Span::raw(shown), Span::styled(look.glyphs().cursor, look.accent())];
    let hint = match prompt {
        Prompt::Command(text) => hint(text),
        Prompt::Filter(_) => Some("words of a cell or its state; Enter keeps, Esc clears".to_owned()),
    };
    let used: usize = spans.iter().map(Span::width).sum();
    if let Some(hint) = hint.filter(|hint| used + words::width(hint) + 3 <= usize::from(area.width)) {
        spans.push(Span::styled(format!("  {hint}"), look.dim()));
    }
    frame.render_widget(Line::from(spans), area);
}

/// The commands that what is typed may become, or what the only one is for.
fn hint(text: &str) -> Option<String> {
    let name = text.split_whitespace().next().unwrap_or("");
    let matching: Vec<&command::Row> = command::COMMANDS.iter().filter(|(known, ..)| known.starts_with(name)).collect();
    match matching.as_slice() {
        [] => None,
        [(name, argument, what)] => Some(format!("{name} {argument}: {what}").replace(" :", ":")),
        several => Some(several.iter().map(|(name, ..)| *name).collect::<Vec<_>>().join(" ")),
    }
}

/// Draws the one line of a terminal that is too small for panes.
pub fn one_line(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let (word, style) = status(model, view);
    let mut spans = vec![Span::styled("Lumbre ", look.accent()), Span::styled(word, style)];
    let mut room = usize::from(area.width).saturating_sub(7 + word.len());
    for (text, style) in facts(model, view) {
        let needed = words::width(&text) + 1;
        if needed > room {
            break;
        }
        room -= needed;
        spans.push(Span::raw(" "));
        spans.push(Span::styled(text, style));
    }
    frame.render_widget(Line::from(spans), area);
}
