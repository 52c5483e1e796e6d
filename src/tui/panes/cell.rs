//! Facts about the current cell: what it renders, how fast, how far, and when it stops.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{pane, title};
use crate::experiment::{CellConfig, CellRef, Outline, WaveRow};
use crate::render::OpenStats;
use crate::scene::SceneDesc;
use crate::transport::integrator;
use crate::tui::entry::State;
use crate::tui::eta;
use crate::tui::look::Look;
use crate::tui::model::{Current, Model};
use crate::tui::view::View;
use crate::tui::words;

/// Draws the pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &Model, view: &View) {
    let look = view.look;
    let (Some(plan), Some(current)) = (&model.plan, &model.current) else {
        let block = pane(look, Span::styled(" Cell ", look.strong()));
        let text = if model.finished_s.is_some() { "nothing was left to render" } else { "nothing renders yet" };
        frame.render_widget(Paragraph::new(text).style(look.dim()).block(block), area);
        return;
    };
    let place = match current.cell {
        CellRef::Cell(i) => format!(" Cell {} of {} ", i + 1, plan.cells.len()),
        CellRef::Reference(i) => format!(" Reference {} of {} ", i + 1, plan.references.len()),
    };
    let (state, style) = state(model, view, current);
    let name = words::cell_name(plan, current.cell);
    // Corners, the state, spaces around the name, and some frame in between.
    let room = usize::from(area.width).saturating_sub(words::width(&place) + words::width(state) + 8);
    let named = words::width(&name) <= room;
    let mut title = vec![Span::styled(place, look.strong())];
    if named {
        title.push(Span::styled(format!(" {name} "), look.accent()));
    }
    let block =
        pane(look, Line::from(title)).title(Line::from(Span::styled(format!(" {state} "), style)).right_aligned());
    let inner = block.inner(area);
    frame.render_widget(block, area);
    let width = usize::from(inner.width);
    let sheet = Sheet { look, width, height: usize::from(inner.height) };
    let mut lines = sheet.lines(plan, model, view, current);
    // What a rendered reference is stands on the first line in any case.
    let rendered_reference = matches!(current.cell, CellRef::Reference(_)) && model.config(current.cell).is_some();
    if !named && !rendered_reference {
        lines.insert(0, (3, sheet.fit(&name, look.accent())));
    }
    let lines = sheet.most_important(lines);
    frame.render_widget(Paragraph::new(lines), inner);
}

fn state(model: &Model, view: &View, current: &Current) -> (&'static str, Style) {
    let look = view.look;
    match model.entry(current.cell).map(|entry| &entry.state) {
        Some(State::Running) if view.skipping == Some(current.cell) => ("skipping after this wave", look.warn()),
        Some(State::Running) if view.wishes.paused => ("paused", look.warn()),
        Some(State::Running) => ("rendering", look.accent()),
        Some(State::Done(_)) => ("done", look.good()),
        Some(State::Cached) => ("cached", look.good()),
        Some(State::Failed(_)) => ("failed", look.bad()),
        Some(State::Interrupted) => ("interrupted", look.warn()),
        _ => ("waiting", look.dim()),
    }
}

/// The inside of the pane, as a sheet of lines of at most `width` columns.
struct Sheet {
    look: Look,
    width: usize,
    height: usize,
}

impl Sheet {
    /// The lines in order, each with its importance: 1 stays longest.
    fn lines(&self, plan: &Outline, model: &Model, view: &View, current: &Current) -> Vec<(u8, Line<'static>)> {
        let empty = WaveRow::default();
        let row = current.curve.last().unwrap_or(&empty);
        let mut lines: Vec<(u8, Line<'static>)> = Vec::new();
        if let Some(config) = model.config(current.cell) {
            lines.push((4, self.technique(config)));
            lines.push((5, self.subject(config)));
            let set: Vec<String> = config.set.iter().map(|(path, value)| format!("{path}={value}")).collect();
            let params = config.params.iter().map(|(name, value)| format!("{name}={value}"));
            let changes = params.chain(set).collect::<Vec<_>>().join("  ");
            if !changes.is_empty() {
                lines.push((9, self.fit(&words::clean(&changes), self.look.dim())));
            }
        }
        if let Some(scene) = plan.scene(current.cell) {
            lines.push((10, self.camera(scene)));
        }
        if !current.open.device.is_empty() {
            lines.push((8, self.device(&current.open)));
        }
        lines.push((1, self.speed(row)));
        lines.push((2, self.times(model, view, row)));
        if !row.metrics.is_empty() {
            let metrics = plan.metrics.iter().zip(&row.metrics);
            let facts = metrics.map(|(m, x)| self.fact(&m.column, &words::measured(m, *x), Style::new())).collect();
            lines.push((7, self.facts(facts)));
        }
        if let Some([x, y, sample]) = row.first_invalid {
            let text = format!("first invalid sample: pixel {x}, {y}, sample {sample}");
            lines.push((6, self.fit(&text, self.look.bad())));
        }
        let (end, style) = self.end(model, current);
        // The second line of a long rule or reason goes before anything else does.
        let parts = words::wrap(&end, self.width);
        match &parts[..] {
            [first, _, ..] => {
                lines.push((4, Line::styled(first.clone(), style)));
                lines.push((6, self.fit(&parts[1..].join(" "), style)));
            }
            _ => lines.push((4, Line::styled(end, style))),
        }
        lines.push((2, self.gauge(self.fraction(model, current, row))));
        lines
    }

    /// As many lines as fit, the most important ones.
    fn most_important(&self, mut lines: Vec<(u8, Line<'static>)>) -> Vec<Line<'static>> {
        while lines.len() > self.height.max(1) {
            let Some(least) = (0..lines.len()).max_by_key(|i| lines[*i].0) else { break };
            lines.remove(least);
        }
        lines.into_iter().map(|(_, line)| line).collect()
    }

    fn fit(&self, text: &str, style: Style) -> Line<'static> {
        Line::styled(words::fit(text, self.width, self.look.glyphs().ellipsis), style)
    }

    /// A label and its value.
    fn fact(&self, label: &str, value: &str, style: Style) -> Vec<Span<'static>> {
        vec![Span::styled(format!("{label} "), self.look.dim()), Span::styled(value.to_owned(), style)]
    }

    /// As many facts as fit whole, with two columns between them.
    fn facts(&self, facts: Vec<Vec<Span<'static>>>) -> Line<'static> {
        let mut line = Line::default();
        for fact in facts {
            let gap = if line.spans.is_empty() { 0 } else { 2 };
            if line.width() + gap + fact.iter().map(Span::width).sum::<usize>() > self.width {
                break;
            }
            if gap > 0 {
                line.push_span(Span::raw("  "));
            }
            line.extend(fact);
        }
        line
    }

    fn technique(&self, config: &CellConfig) -> Line<'static> {
        let long = integrator::integrator(&config.integrator).map_or("", |row| row.long_name);
        let edges = config
            .max_depth
            .map_or_else(String::new, |depth| format!("{depth} {}", if depth == 1 { "edge" } else { "edges" }));
        self.facts(vec![
            vec![Span::styled(words::clean(&config.integrator), self.look.accent())],
            vec![Span::raw(long)],
            vec![Span::raw(edges)],
        ])
    }

    fn subject(&self, config: &CellConfig) -> Line<'static> {
        let filter = config.filter.kind.name();
        let name = words::fit(&words::scene_name(&config.scene), self.width, self.look.glyphs().ellipsis);
        let size = config.resolution.map_or_else(String::new, |[w, h]| format!("{w}x{h} px"));
        let filter = format!("{filter} {} px", config.filter.radius);
        let facts = [name, size, filter, words::clean(&config.backend)];
        self.facts(facts.into_iter().map(|fact| vec![Span::raw(fact)]).collect())
    }

    fn camera(&self, scene: &SceneDesc) -> Line<'static> {
        let camera = &scene.camera;
        let dim = |text: String| vec![Span::styled(text, self.look.dim())];
        let mut facts = vec![dim(format!("field of view {} deg", words::number(f64::from(camera.fov_deg))))];
        facts.push(match camera.aperture {
            0.0 => dim("pinhole".to_owned()),
            aperture => dim(format!("aperture {}", words::number(f64::from(aperture)))),
        });
        if let Some(focus) = camera.focus_distance {
            facts.push(dim(format!("focus {}", words::number(f64::from(focus)))));
        }
        self.facts(facts)
    }

    fn device(&self, open: &OpenStats) -> Line<'static> {
        let device = words::fit(&words::clean(&open.device), self.width, self.look.glyphs().ellipsis);
        let mut facts = vec![vec![Span::styled(device, self.look.dim())]];
        if open.accel_nodes > 0 {
            let (build, nodes) = (words::duration(open.accel_build_s), words::count(open.accel_nodes));
            facts.push(vec![Span::styled(format!("{nodes} BVH nodes built in {build}"), self.look.dim())]);
        }
        self.facts(facts)
    }

    fn speed(&self, row: &WaveRow) -> Line<'static> {
        // Of a reference that another process renders nothing is known until its end.
        if row.wave == 0 {
            return Line::styled("nothing measured yet", self.look.dim());
        }
        let mrays = if row.render_s > 0.0 { row.rays as f64 / row.render_s / 1e6 } else { 0.0 };
        let unit = |value: String, unit: &str| {
            vec![Span::styled(value, self.look.strong()), Span::styled(format!(" {unit}"), self.look.dim())]
        };
        let mut facts = vec![unit(words::count(row.samples), "spp")];
        if row.invalid > 0 {
            facts.push(vec![Span::styled(format!("{} invalid", words::count(row.invalid)), self.look.bad())]);
        }
        // A frame is one sample of every pixel.
        if row.samples > 0 && row.render_s > 0.0 {
            facts.push(unit(words::number(row.samples as f64 / row.render_s), "fps"));
            facts.push(unit(words::number(row.render_s / row.samples as f64 * 1e3), "ms/frame"));
        }
        facts.push(unit(words::number(row.mpaths_per_s()), "Mpaths/s"));
        facts.push(unit(words::number(mrays), "Mrays/s"));
        facts.push(unit(row.wave.to_string(), if row.wave == 1 { "wave" } else { "waves" }));
        self.facts(facts)
    }

    fn times(&self, model: &Model, view: &View, row: &WaveRow) -> Line<'static> {
        let mut facts = vec![
            self.fact("render", &words::duration(row.render_s), self.look.strong()),
            self.fact("wall", &words::duration(model.cell_wall_s(view.now_s)), Style::new()),
        ];
        if let Some(eta) = model.cell_eta(view.clock_s(model)) {
            facts.push(vec![Span::styled(title::time_left(self.look, eta), self.look.strong())]);
        }
        self.facts(facts)
    }

    /// Why it ended, or when it will.
    fn end(&self, model: &Model, current: &Current) -> (String, Style) {
        let look = self.look;
        let until = model.plan.as_ref().and_then(|plan| plan.until(current.cell));
        match (model.entry(current.cell).map(|entry| &entry.state), until) {
            (Some(State::Done(reason)), _) => (format!("done: {reason}"), look.good()),
            (Some(State::Failed(reason)), _) => (format!("failed: {reason}"), look.bad()),
            (Some(State::Interrupted), _) => ("interrupted before its end".to_owned(), look.warn()),
            (_, Some(until)) => (format!("until {}", until.words), look.dim()),
            (_, None) => (String::new(), look.dim()),
        }
    }

    fn fraction(&self, model: &Model, current: &Current, row: &WaveRow) -> Option<f64> {
        match model.entry(current.cell).map(|entry| &entry.state) {
            Some(State::Done(_) | State::Cached) => Some(1.0),
            _ => model.stop_rule(current.cell).and_then(|rule| eta::fraction(rule, row)),
        }
    }

    fn gauge(&self, fraction: Option<f64>) -> Line<'static> {
        let glyphs = self.look.glyphs();
        let Some(fraction) = fraction else {
            return Line::styled("no limit of time or samples", self.look.dim());
        };
        let room = self.width.saturating_sub(6);
        let full = ((room as f64 * fraction) as usize).min(room);
        Line::from(vec![
            Span::styled(glyphs.bar.repeat(full), self.look.glow()),
            Span::styled(glyphs.track.repeat(room - full), self.look.dim()),
            Span::raw(format!(" {:>3.0} %", (fraction * 100.0).floor())),
        ])
    }
}
