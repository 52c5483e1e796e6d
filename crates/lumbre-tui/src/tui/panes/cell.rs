//! The cell pane: what the current cell renders, its speed, progress and stop rule.

use ratatui::Frame;
use ratatui::layout::Rect;
use ratatui::style::Style;
use ratatui::text::{Line, Span};
use ratatui::widgets::Paragraph;

use super::{framed, pane, title};
use crate::tui::format;
use crate::tui::model::eta;
use crate::tui::model::night::{CurrentRun, NightModel};
use crate::tui::terminal::terminal_caps::TerminalCaps;
use crate::tui::view::View;
use lumbre_light::scene::SceneDesc;
use lumbre_light::scene::desc::CameraKind;
use lumbre_light::transport::integrator;
use lumbre_night::experiment::night::run::RunState;
use lumbre_night::experiment::{CellRef, Night, Outcome, WaveRow};
use lumbre_render::OpenStats;
use lumbre_render::Settings;

/// Draws the cell pane.
pub fn draw(frame: &mut Frame, area: Rect, model: &NightModel, view: &View) {
    let caps = view.caps;
    let (Some(night), Some(current)) = (model.planned(), &model.current) else {
        let block = pane(caps, Span::styled(" Cell ", caps.strong()));
        let text = if model.finished_s.is_some() {
            "all runs were already finished"
        } else {
            "no run has started yet"
        };
        frame.render_widget(Paragraph::new(text).style(caps.dim()).block(block), area);
        return;
    };
    let position = match current.cell {
        CellRef::Cell(i) => format!(" Cell {} of {} ", i + 1, night.runs.len()),
        CellRef::Reference(i) => format!(" Reference {} of {} ", i + 1, night.references.len()),
    };
    let (state, style) = state(model, view, current);
    let name = format::cell_name(night, current.cell);
    // Reserve space for corners, state, spaces around the name, and part of the border.
    let room =
        usize::from(area.width).saturating_sub(format::width(&position) + format::width(state) + 8);
    let named = format::width(&name) <= room;
    let mut title = vec![Span::styled(position, caps.strong())];
    if named {
        title.push(Span::styled(format!(" {name} "), caps.accent()));
    }
    let block = pane(caps, Line::from(title))
        .title(Line::from(Span::styled(format!(" {state} "), style)).right_aligned());
    let inner = framed(frame, area, block);
    let width = usize::from(inner.width);
    let device = super::regions(frame.area(), view.focus, model).device;
    let sheet = Sheet {
        caps,
        width,
        height: usize::from(inner.height),
        has_device_pane: device.height > 2,
    };
    let mut lines = sheet.lines(night, model, view, current);
    // For a rendered reference, the first line already describes it.
    let rendered_reference =
        matches!(current.cell, CellRef::Reference(_)) && model.settings(current.cell).is_some();
    if !named && !rendered_reference {
        lines.insert(0, (3, sheet.fit(&name, caps.accent())));
    }
    let lines = sheet.most_important(lines);
    frame.render_widget(Paragraph::new(lines), inner);
}

fn state(model: &NightModel, view: &View, current: &CurrentRun) -> (&'static str, Style) {
    let caps = view.caps;
    match model.night.state(current.cell) {
        Some(RunState::Running) if view.skipping == Some(current.cell) => {
            ("skipping after this wave", caps.warn())
        }
        Some(RunState::Running) if view.requests.paused => ("paused", caps.warn()),
        Some(RunState::Running) => ("rendering", caps.accent()),
        Some(RunState::Ended(outcome)) => match outcome {
            Outcome::Done(_) => ("done", caps.good()),
            Outcome::Cached(_) => ("cached", caps.good()),
            Outcome::Failed(_) => ("failed", caps.bad()),
            Outcome::Interrupted => ("interrupted", caps.warn()),
        },
        _ => ("waiting", caps.dim()),
    }
}

/// The inside of the pane: lines of at most `width` columns.
struct Sheet {
    caps: TerminalCaps,
    width: usize,
    height: usize,
    /// Whether another pane shows the device.
    has_device_pane: bool,
}

impl Sheet {
    /// Returns the lines in order, each with its rank; lines of rank 1 are dropped last.
    fn lines(
        &self,
        night: &Night,
        model: &NightModel,
        view: &View,
        current: &CurrentRun,
    ) -> Vec<(u8, Line<'static>)> {
        let empty = WaveRow::default();
        let row = current.curve.last().unwrap_or(&empty);
        let mut lines: Vec<(u8, Line<'static>)> = Vec::new();
        if let Some(config) = model.settings(current.cell) {
            lines.push((4, self.technique(config)));
            lines.push((5, self.subject(config)));
            let set: Vec<String> = config
                .set
                .iter()
                .map(|(path, value)| match path.as_str() {
                    // Scripts select a view of the scene's cameras by `view`.
                    "camera" => format!("view={value}"),
                    _ => format!("{path}={value}"),
                })
                .collect();
            let params = config
                .params
                .iter()
                .map(|(name, value)| format!("{name}={value}"));
            let changes = params.chain(set).collect::<Vec<_>>().join("  ");
            if !changes.is_empty() {
                lines.push((9, self.fit(&format::clean(&changes), self.caps.dim())));
            }
        }
        if let Some(scene) = night.scene(current.cell) {
            lines.push((10, self.camera(scene)));
        }
        if !current.open.devices.is_empty() && !self.has_device_pane {
            lines.push((8, self.device(&current.open)));
        }
        lines.push((1, self.speed(row)));
        lines.push((2, self.times(model, view, row)));
        if !row.metrics.is_empty() {
            let metrics = model.metrics().iter().zip(&row.metrics);
            let facts = metrics
                .map(|(m, x)| self.fact(&m.column, &format::measured(m, *x), Style::new()))
                .collect();
            lines.push((7, self.facts(facts)));
        }
        if let Some([x, y, sample]) = row.first_invalid {
            let text = format!("first invalid sample: pixel {x}, {y}, sample {sample}");
            lines.push((6, self.fit(&text, self.caps.bad())));
        }
        let (end, style) = self.end(model, current);
        // The second line of a long rule or reason has a low rank.
        let parts = format::wrap(&end, self.width);
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

    /// Drops the lines of the highest rank until the others fit.
    fn most_important(&self, mut lines: Vec<(u8, Line<'static>)>) -> Vec<Line<'static>> {
        while lines.len() > self.height.max(1) {
            let Some(least) = (0..lines.len()).max_by_key(|i| lines[*i].0) else {
                break;
            };
            lines.remove(least);
        }
        lines.into_iter().map(|(_, line)| line).collect()
    }

    fn fit(&self, text: &str, style: Style) -> Line<'static> {
        Line::styled(
            format::fit(text, self.width, self.caps.glyphs().ellipsis),
            style,
        )
    }

    /// Formats a label and its value.
    fn fact(&self, label: &str, value: &str, style: Style) -> Vec<Span<'static>> {
        vec![
            Span::styled(format!("{label} "), self.caps.dim()),
            Span::styled(value.to_owned(), style),
        ]
    }

    /// Joins as many facts as fit without truncation, with two columns between them.
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

    fn technique(&self, config: &Settings) -> Line<'static> {
        let long = integrator::integrator(&config.integrator).map_or("", |row| row.long_name);
        let edges = config.max_depth.map_or_else(String::new, |depth| {
            format!("{depth} {}", if depth == 1 { "edge" } else { "edges" })
        });
        self.facts(vec![
            vec![Span::styled(
                format::clean(&config.integrator),
                self.caps.accent(),
            )],
            vec![Span::raw(long)],
            vec![Span::raw(edges)],
        ])
    }

    fn subject(&self, config: &Settings) -> Line<'static> {
        let filter = config.filter.kind.name();
        let name = format::fit(
            &format::scene_name(&config.scene),
            self.width,
            self.caps.glyphs().ellipsis,
        );
        let size = config
            .resolution
            .map_or_else(String::new, |[w, h]| format!("{w}x{h} px"));
        let filter = format!("{filter} {} px", config.filter.radius);
        let facts = [name, size, filter, format::clean(&config.backend)];
        self.facts(
            facts
                .into_iter()
                .map(|fact| vec![Span::raw(fact)])
                .collect(),
        )
    }

    fn camera(&self, scene: &SceneDesc) -> Line<'static> {
        let camera = &scene.camera;
        let dim = |text: String| vec![Span::styled(text, self.caps.dim())];
        let view = match camera.kind {
            CameraKind::Perspective => format!(
                "field of view {} deg",
                format::number(f64::from(camera.view_deg()))
            ),
            CameraKind::Orthographic => format!(
                "orthographic, {} high",
                format::number(f64::from(camera.view_height))
            ),
            CameraKind::Spherical => "spherical".to_owned(),
        };
        let mut facts = vec![dim(view)];
        if camera.kind != CameraKind::Perspective {
            return self.facts(facts);
        }
        facts.push(match camera.lens_diameter() {
            0.0 => dim("pinhole".to_owned()),
            aperture => dim(format!("aperture {}", format::number(f64::from(aperture)))),
        });
        if let Some(focus) = camera.focus_distance {
            facts.push(dim(format!("focus {}", format::number(f64::from(focus)))));
        }
        self.facts(facts)
    }

    fn device(&self, open: &OpenStats) -> Line<'static> {
        let device = format::fit(
            &format::clean(&open.device_line()),
            self.width,
            self.caps.glyphs().ellipsis,
        );
        let mut facts = vec![vec![Span::styled(device, self.caps.dim())]];
        if open.accel_nodes > 0 {
            let (build, nodes) = (
                format::duration(open.accel_build_s),
                format::count(open.accel_nodes),
            );
            facts.push(vec![Span::styled(
                format!("{nodes} BVH nodes built in {build}"),
                self.caps.dim(),
            )]);
        }
        self.facts(facts)
    }

    fn speed(&self, row: &WaveRow) -> Line<'static> {
        // A reference rendered by another process has no measurements until it ends.
        if row.wave == 0 {
            return Line::styled("no measurement yet", self.caps.dim());
        }
        let mrays = if row.render_s > 0.0 {
            row.rays as f64 / row.render_s / 1e6
        } else {
            0.0
        };
        let unit = |value: String, unit: &str| {
            vec![
                Span::styled(value, self.caps.strong()),
                Span::styled(format!(" {unit}"), self.caps.dim()),
            ]
        };
        let mut facts = vec![unit(format::count(row.samples), "spp")];
        if row.invalid > 0 {
            facts.push(vec![Span::styled(
                format!("{} invalid", format::count(row.invalid)),
                self.caps.bad(),
            )]);
        }
        // A frame is one sample of every pixel.
        if row.samples > 0 && row.render_s > 0.0 {
            facts.push(unit(
                format::number(row.samples as f64 / row.render_s),
                "fps",
            ));
            facts.push(unit(
                format::number(row.render_s / row.samples as f64 * 1e3),
                "ms/frame",
            ));
        }
        facts.push(unit(format::number(row.mpaths_per_s()), "Mpaths/s"));
        facts.push(unit(format::number(mrays), "Mrays/s"));
        facts.push(unit(
            row.wave.to_string(),
            if row.wave == 1 { "wave" } else { "waves" },
        ));
        self.facts(facts)
    }

    fn times(&self, model: &NightModel, view: &View, row: &WaveRow) -> Line<'static> {
        let mut facts = vec![
            self.fact(
                "render",
                &format::duration(row.render_s),
                self.caps.strong(),
            ),
            self.fact(
                "wall",
                &format::duration(model.cell_wall_s(view.now_s)),
                Style::new(),
            ),
        ];
        if let Some(eta) = model.cell_eta(view.clock_s(model)) {
            facts.push(vec![Span::styled(
                title::time_left(self.caps, eta),
                self.caps.strong(),
            )]);
        }
        self.facts(facts)
    }

    /// Formats why the run ended, or its stop rule.
    fn end(&self, model: &NightModel, current: &CurrentRun) -> (String, Style) {
        let caps = self.caps;
        let stop = model.night.stop(current.cell);
        match (model.night.outcome(current.cell), stop) {
            (Some(Outcome::Done(cause)), _) => (
                format!("done: {}", format::clean(&cause.clause)),
                caps.good(),
            ),
            (Some(Outcome::Failed(reason)), _) => {
                (format!("failed: {}", format::clean(reason)), caps.bad())
            }
            (Some(Outcome::Interrupted), _) => (
                "interrupted before its stop rule was met".to_owned(),
                caps.warn(),
            ),
            (_, Some(stop)) => (format!("until {}", stop.text), caps.dim()),
            (_, None) => (String::new(), caps.dim()),
        }
    }

    fn fraction(&self, model: &NightModel, current: &CurrentRun, row: &WaveRow) -> Option<f64> {
        match model.night.state(current.cell) {
            Some(state) if state.is_done() => Some(1.0),
            _ => model
                .stop_rule(current.cell)
                .and_then(|rule| eta::fraction(rule, row)),
        }
    }

    fn gauge(&self, fraction: Option<f64>) -> Line<'static> {
        let glyphs = self.caps.glyphs();
        let Some(fraction) = fraction else {
            return Line::styled("no time or sample limit", self.caps.dim());
        };
        let room = self.width.saturating_sub(6);
        let full = ((room as f64 * fraction) as usize).min(room);
        Line::from(vec![
            Span::styled(glyphs.bar.repeat(full), self.caps.glow()),
            Span::styled(glyphs.track.repeat(room - full), self.caps.dim()),
            Span::raw(format!(" {:>3.0} %", (fraction * 100.0).floor())),
        ])
    }
}
