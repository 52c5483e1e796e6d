//! The time pane: one frame of a time-resolved film, its position and the animation.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};

use super::{framed, pane, picture};
use crate::tui::format;
use crate::tui::model::night::NightModel;
use crate::tui::model::time_preview::TimePreview;
use crate::tui::view::View;
use lumbre_light::film::time::time_unit;

/// Draws the time pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let mut title = vec![Span::styled(" Time ", caps.strong())];
    let (Some(time_preview), Some(night)) = (&model.time_preview, model.planned()) else {
        let inner = framed(frame, area, pane(caps, Line::from(title)));
        let note = "No time-resolved film yet. The script must set film = { time = .. }. It is \
                    updated whenever the sample count doubles; large films appear when the \
                    cell ends.";
        super::draw_note(frame, inner, caps, note);
        return;
    };
    let shown = view.frame(time_preview);
    if view.playing.is_some() {
        title.push(Span::styled("playing ", caps.warn()));
    }
    let name = format::cell_name(night, time_preview.cell);
    let room = usize::from(area.width).saturating_sub(18);
    title.push(Span::styled(
        format!("{} ", format::fit(&name, room, caps.glyphs().ellipsis)),
        caps.dim(),
    ));
    let mut block =
        pane(caps, Line::from(title)).title_bottom(position_line(time_preview, shown, model, view));
    let position = format!(" {} of {} ", shown + 1, time_preview.frame_count());
    if usize::from(area.width) > 46 + position.len() {
        block = block.title_bottom(Line::styled(position, caps.dim()).right_aligned());
    }
    let inner = framed(frame, area, block);
    if inner.height < 2 {
        return;
    }
    let [picture_at, bar_at] = super::rows(
        inner,
        [super::Constraint::Fill(1), super::Constraint::Length(1)],
    );
    picture::draw_image(
        frame,
        picture_at,
        caps,
        time_preview.frame(shown),
        time_preview.stops + view.exposure,
        night.plan.display,
    );
    let width = usize::from(bar_at.width);
    let full = ((shown + 1) * width / time_preview.frame_count()).clamp(1, width.max(1));
    let glyphs = caps.glyphs();
    let bar = vec![
        Span::styled(glyphs.bar.repeat(full), caps.glow()),
        Span::styled(glyphs.track.repeat(width.saturating_sub(full)), caps.dim()),
    ];
    frame.render_widget(Line::from(bar), bar_at);
}

/// Formats the optical length of a frame, its arrival time if known, and the exposure.
fn position_line(
    time_preview: &TimePreview,
    shown: usize,
    model: &NightModel,
    view: &View,
) -> Line<'static> {
    let caps = view.caps;
    let [begin, end] = time_preview.length_range(shown);
    // Use as many decimals as the bin width has.
    let decimals = (1.0 - time_preview.axis.bin.abs().log10())
        .ceil()
        .clamp(0.0, 6.0) as usize;
    let mut line = Line::from(Span::styled(
        format!(" {begin:.decimals$} to {end:.decimals$} "),
        caps.accent(),
    ));
    let timing = model
        .settings(time_preview.cell)
        .and_then(|config| config.timing.as_ref());
    if let Some(seconds) = timing.and_then(|timing| timing.seconds()) {
        let (unit, name) = time_unit(begin * seconds);
        line.push_span(Span::styled(
            format!("at {} {name} ", format::number(begin * seconds / unit)),
            caps.dim(),
        ));
    }
    if view.exposure != 0.0 {
        line.push_span(Span::styled(
            format!("{:+} stops ", view.exposure),
            caps.warn(),
        ));
    }
    line
}
