//! Light by its time: one frame, where it is on the axis, and how it plays.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{pane, picture};
use crate::film::time::unit_of;
use crate::tui::model::Model;
use crate::tui::reel::Reel;
use crate::tui::view::View;
use crate::tui::words;

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let mut title = vec![Span::styled(" Time ", look.strong())];
    let (Some(reel), Some(plan)) = (&model.reel, &model.plan) else {
        let block = pane(look, Line::from(title));
        let inner = block.inner(area);
        frame.render_widget(block, area);
        let note = "No cell has shown its light by time yet: its script asks for it by film = { time = .. }. While a cell \
                    renders it comes whenever its samples have doubled, of large films only at the end.";
        let lines: Vec<Line> = words::wrap(note, usize::from(inner.width)).into_iter().map(Line::from).collect();
        frame.render_widget(Paragraph::new(lines).style(look.dim()), inner);
        return;
    };
    let shown = view.frame(reel);
    if view.playing.is_some() {
        title.push(Span::styled("plays ", look.warn()));
    }
    let name = words::cell_name(plan, reel.cell);
    let room = usize::from(area.width).saturating_sub(16);
    title.push(Span::styled(format!("{} ", words::fit(&name, room, look.glyphs().ellipsis)), look.dim()));
    let mut block = pane(look, Line::from(title)).title_bottom(moment(reel, shown, model, view));
    let place = format!(" {} of {} ", shown + 1, reel.count());
    if usize::from(area.width) > 46 + place.len() {
        block = block.title_bottom(Line::styled(place, look.dim()).right_aligned());
    }
    let inner = block.inner(area);
    frame.render_widget(block, area);
    if inner.height < 2 {
        return;
    }
    let [picture_at, bar_at] = super::rows(inner, [super::Constraint::Fill(1), super::Constraint::Length(1)]);
    picture::thumbnail(frame, picture_at, look, reel.frame(shown), reel.stops + view.exposure, plan);
    let width = usize::from(bar_at.width);
    let full = ((shown + 1) * width / reel.count()).clamp(1, width.max(1));
    let glyphs = look.glyphs();
    let bar = vec![
        Span::styled(glyphs.bar.repeat(full), look.glow()),
        Span::styled(glyphs.track.repeat(width.saturating_sub(full)), look.dim()),
    ];
    frame.render_widget(Line::from(bar), bar_at);
}

/// When the light of a frame arrives, as a path length and, where that is known, as a time; and the change of exposure.
fn moment(reel: &Reel, shown: usize, model: &Model, view: &View) -> Line<'static> {
    let look = view.look;
    let [begin, end] = reel.span(shown);
    // As many decimals as the width of a bin has.
    let decimals = (1.0 - reel.axis.bin.abs().log10()).ceil().clamp(0.0, 6.0) as usize;
    let mut line = Line::from(Span::styled(format!(" {begin:.decimals$} to {end:.decimals$} "), look.accent()));
    let timing = model.config(reel.cell).and_then(|config| config.timing.as_ref());
    if let Some(seconds) = timing.and_then(|timing| timing.seconds()) {
        let (unit, name) = unit_of(begin * seconds);
        line.push_span(Span::styled(format!("at {} {name} ", words::number(begin * seconds / unit)), look.dim()));
    }
    if view.exposure != 0.0 {
        line.push_span(Span::styled(format!("{:+} stops ", view.exposure), look.warn()));
    }
    line
}
