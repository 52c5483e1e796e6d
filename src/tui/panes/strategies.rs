//! What each strategy found: one small picture for every pair (s, t), a row for each length of path.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{pane, picture};
use crate::tui::model::Model;
use crate::tui::thumbs::Thumb;
use crate::tui::view::View;
use crate::tui::words;

/// Draws the pane. Strategies are vertices from the light and from the camera: a path of k edges has s + t = k + 1.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let mut title = vec![Span::styled(" Strategies ", look.strong())];
    let (Some(thumbs), Some(plan)) = (&model.thumbs, &model.plan) else {
        let block = pane(look, Line::from(title));
        let inner = block.inner(area);
        frame.render_widget(block, area);
        let note = "No cell has kept films of its strategies yet: they come when a cell ends whose script asks for \
                    films = { \"strategies\" }.";
        let lines: Vec<Line> = words::wrap(note, usize::from(inner.width)).into_iter().map(Line::from).collect();
        frame.render_widget(Paragraph::new(lines).style(look.dim()), inner);
        return;
    };
    title.push(Span::styled(if view.raw { "each alone " } else { "weighted " }, look.warn()));
    let name = words::cell_name(plan, thumbs.cell);
    let room = usize::from(area.width).saturating_sub(30);
    title.push(Span::styled(format!("{} ", words::fit(&name, room, look.glyphs().ellipsis)), look.dim()));
    let key = Line::from(vec![Span::styled(" w", look.accent()), Span::styled(" weights ", look.dim())]);
    let block = pane(look, Line::from(title)).title_bottom(key.right_aligned());
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let films: Vec<&Thumb> = thumbs.films.iter().filter(|film| film.weighted != view.raw).collect();
    let longest = films.iter().map(|film| film.s + film.t).max().unwrap_or(2).saturating_sub(1).max(1);
    let (across, down) = (longest as u16 + 1, longest as u16);
    let (width, height) = (inner.width / across, inner.height / down);
    if width < 4 || height < 2 {
        frame.render_widget(Paragraph::new("too small here; Tab makes room").style(look.dim()), inner);
        return;
    }
    for film in films {
        let edges = film.s + film.t - 1;
        // A row has one picture more than its paths have edges; each row is centred, so that they make a pyramid.
        let left = (inner.width - width * (edges as u16 + 1)) / 2;
        let at = Rect {
            x: inner.x + left + width * film.s as u16,
            y: inner.y + height * (edges as u16 - 1),
            width: width - 1,
            height: height - 1,
        };
        picture::thumbnail(frame, at, look, &film.image, view.exposure, plan);
        let label = format!("s{} t{}", film.s, film.t);
        let label = Line::styled(words::fit(&label, usize::from(at.width), ""), look.dim()).centered();
        frame.render_widget(label, Rect { y: at.bottom(), height: 1, ..at });
    }
}
