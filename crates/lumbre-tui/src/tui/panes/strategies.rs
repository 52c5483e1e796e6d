//! Per-strategy films: one thumbnail for every pair (s, t), one row for each path length.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{framed, pane, picture};
use crate::tui::format;
use crate::tui::model::night::NightModel;
use crate::tui::model::strategy_thumbnails::{StrategyThumbnail, StrategyThumbnails};
use crate::tui::view::View;
use lumbre_night::experiment::Night;

/// Draws the pane. A strategy has s light vertices and t camera vertices; a path of k edges has
/// s + t = k + 1.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let mut title = vec![Span::styled(" Strategies ", caps.strong())];
    let (Some(thumbnails), Some(night)) = (&model.thumbnails, model.planned()) else {
        let inner = framed(frame, area, pane(caps, Line::from(title)));
        let note = "No strategy films yet. They appear when a cell ends whose script sets \
                    films = { \"strategies\" }.";
        super::draw_note(frame, inner, caps, note);
        return;
    };
    title.push(Span::styled(
        if view.unweighted {
            "unweighted "
        } else {
            "weighted "
        },
        caps.warn(),
    ));
    let name = format::cell_name(night, thumbnails.cell);
    let room = usize::from(area.width).saturating_sub(30);
    title.push(Span::styled(
        format!("{} ", format::fit(&name, room, caps.glyphs().ellipsis)),
        caps.dim(),
    ));
    let key = Line::from(vec![
        Span::styled(" w", caps.accent()),
        Span::styled(" weights ", caps.dim()),
    ]);
    let block = pane(caps, Line::from(title)).title_bottom(key.right_aligned());
    let inner = framed(frame, area, block);
    pyramid(frame, inner, view, thumbnails, night);
}

/// Draws the thumbnails with the selected weighting.
fn pyramid(
    frame: &mut Frame,
    inner: Rect,
    view: &View,
    thumbnails: &StrategyThumbnails,
    night: &Night,
) {
    let caps = view.caps;
    let films: Vec<&StrategyThumbnail> = thumbnails
        .films
        .iter()
        .filter(|film| film.weighted != view.unweighted)
        .collect();
    let longest = films
        .iter()
        .map(|film| film.s + film.t)
        .max()
        .unwrap_or(2)
        .saturating_sub(1)
        .max(1);
    let (across, down) = (longest as u16 + 1, longest as u16);
    let (width, height) = (inner.width / across, inner.height / down);
    if width < 4 || height < 2 {
        frame.render_widget(
            Paragraph::new("pane too small: press Tab to enlarge it").style(caps.dim()),
            inner,
        );
        return;
    }
    for film in films {
        let edges = film.s + film.t - 1;
        // A row has one thumbnail more than its paths have edges; centred rows form a pyramid.
        let left = (inner.width - width * (edges as u16 + 1)) / 2;
        let at = Rect {
            x: inner.x + left + width * film.s as u16,
            y: inner.y + height * (edges as u16 - 1),
            width: width - 1,
            height: height - 1,
        };
        picture::draw_image(
            frame,
            at,
            caps,
            &film.image,
            view.exposure,
            night.plan.display,
        );
        let label = format!("s{} t{}", film.s, film.t);
        let label =
            Line::styled(format::fit(&label, usize::from(at.width), ""), caps.dim()).centered();
        frame.render_widget(
            label,
            Rect {
                y: at.bottom(),
                height: 1,
                ..at
            },
        );
    }
}
