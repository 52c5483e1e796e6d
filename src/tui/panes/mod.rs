//! The screen: a pure function of the state of the night ([`NightModel`]) and of the screen
//! ([`View`]).
//!
//! There are three layouts: a stack below 80 columns or 24 rows, two columns of panes up to 160
//! columns and 40 rows, and three columns from there on. Below 40 columns or 12 rows there is
//! only one line.

pub mod cell;
pub mod chart;
pub mod device;
pub mod help;
pub mod log;
pub mod picture;
pub mod plan;
pub mod strategies;
pub mod time;
pub mod title;

use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::text::Line;
use ratatui::widgets::{Block, Borders, Paragraph};

use super::format;
use super::model::night::NightModel;
use super::modes::Focus;
use super::terminal::terminal_caps::TerminalCaps;
use super::view::View;

/// Smallest screen with panes: columns and rows.
pub const SMALLEST: [u16; 2] = [40, 12];

/// Positions of the panes; a hidden pane has an empty rectangle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Regions {
    /// The title line.
    pub title: Rect,
    /// The plan pane.
    pub plan: Rect,
    /// Facts about the current cell.
    pub cell: Rect,
    /// The error chart of the current cell.
    pub chart: Rect,
    /// The picture of the current cell.
    pub picture: Rect,
    /// The device pane.
    pub device: Rect,
    /// The log pane.
    pub log: Rect,
    /// The line of key hints at the bottom.
    pub hints: Rect,
}

/// Divides the screen into panes.
pub fn regions(area: Rect, focus: Focus, model: &NightModel) -> Regions {
    let [title, body, hints] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Fill(1),
        Constraint::Length(1),
    ])
    .areas(area);
    let panes = match (area.width, area.height) {
        (160.., 40..) => three_columns(body, focus, device::rows(model, area.height)),
        (80.., 24..) => two_columns(body, focus, device::rows(model, area.height)),
        _ => stack(body, focus),
    };
    Regions {
        title,
        hints,
        ..panes
    }
}

fn columns<const N: usize>(area: Rect, constraints: [Constraint; N]) -> [Rect; N] {
    Layout::horizontal(constraints).areas(area)
}

pub(super) fn rows<const N: usize>(area: Rect, constraints: [Constraint; N]) -> [Rect; N] {
    Layout::vertical(constraints).areas(area)
}

/// Gives `area` to the enlarged pane.
fn large(focus: Focus, area: Rect, regions: Regions) -> Regions {
    match focus {
        Focus::Overview => regions,
        Focus::Picture => Regions {
            picture: area,
            ..regions
        },
        Focus::Chart => Regions {
            chart: area,
            ..regions
        },
        Focus::Log => Regions {
            log: area,
            ..regions
        },
        Focus::Plan => Regions {
            plan: area,
            ..regions
        },
    }
}

fn stack(body: Rect, focus: Focus) -> Regions {
    let [cell, rest] = rows(
        body,
        [
            Constraint::Length(if body.height >= 18 { 9 } else { 4 }),
            Constraint::Fill(1),
        ],
    );
    let regions = Regions {
        cell,
        ..Regions::default()
    };
    match focus {
        Focus::Overview if rest.width >= 72 => {
            let [plan, chart] = columns(rest, [Constraint::Percentage(42), Constraint::Fill(1)]);
            Regions {
                plan,
                chart,
                ..regions
            }
        }
        Focus::Overview => Regions {
            plan: rest,
            ..regions
        },
        _ => large(focus, rest, regions),
    }
}

fn two_columns(body: Rect, focus: Focus, device_rows: u16) -> Regions {
    let left_width = (body.width * 2 / 5).clamp(32, 56);
    let [left, right] = columns(body, [Constraint::Length(left_width), Constraint::Fill(1)]);
    let cell_height = if body.height >= 34 { 12 } else { 9 };
    let [cell, rest] = rows(
        right,
        [Constraint::Length(cell_height), Constraint::Fill(1)],
    );
    if focus == Focus::Plan {
        return large(focus, body, Regions::default());
    }
    if focus != Focus::Overview {
        return large(
            focus,
            rest,
            Regions {
                plan: left,
                cell,
                ..Regions::default()
            },
        );
    }
    let log_height = (body.height / 5).clamp(4, 10);
    let [chart, log] = rows(rest, [Constraint::Fill(1), Constraint::Length(log_height)]);
    // Half blocks make square pixels, so a square picture is half as many rows high as it is
    // columns wide.
    let picture_height = (left_width / 2 + 1).min(body.height / 2);
    let device_height = if body.height >= 34 { device_rows } else { 0 };
    let heights = [
        Constraint::Fill(1),
        Constraint::Length(device_height),
        Constraint::Length(picture_height),
    ];
    let [plan, device, picture] = rows(left, heights);
    Regions {
        plan,
        cell,
        chart,
        device,
        picture,
        log,
        ..Regions::default()
    }
}

fn three_columns(body: Rect, focus: Focus, device_rows: u16) -> Regions {
    let [left, middle, right] = columns(
        body,
        [
            Constraint::Fill(5),
            Constraint::Fill(6),
            Constraint::Fill(6),
        ],
    );
    let [cell, chart] = rows(middle, [Constraint::Length(12), Constraint::Fill(1)]);
    let [plan, device] = rows(left, [Constraint::Fill(1), Constraint::Length(device_rows)]);
    if focus == Focus::Plan {
        return large(focus, body, Regions::default());
    }
    if focus != Focus::Overview {
        let wide = Rect {
            width: middle.width + right.width,
            ..chart
        };
        let cell = Rect {
            width: middle.width + right.width,
            ..cell
        };
        return large(
            focus,
            wide,
            Regions {
                plan,
                device,
                cell,
                ..Regions::default()
            },
        );
    }
    let picture_height = (right.width / 2 + 1).min(body.height.saturating_sub(12));
    let [picture, log] = rows(
        right,
        [Constraint::Length(picture_height), Constraint::Fill(1)],
    );
    Regions {
        plan,
        cell,
        chart,
        device,
        picture,
        log,
        ..Regions::default()
    }
}

/// Function that draws one pane.
type Draw = fn(&mut Frame, Rect, &NightModel, &View);

/// Draws the whole screen.
pub fn draw(frame: &mut Frame, model: &NightModel, view: &View) {
    let area = frame.area();
    if area.width < SMALLEST[0] || area.height < SMALLEST[1] {
        title::one_line(frame, area, model, view);
        return;
    }
    let regions = regions(area, view.focus, model);
    title::draw(frame, regions.title, model, view);
    title::hints(frame, regions.hints, model, view);
    for (area, draw) in [
        (regions.plan, plan::draw as Draw),
        (regions.cell, cell::draw),
        (regions.chart, chart::draw),
        (regions.device, device::draw),
        (regions.picture, picture::draw),
        (regions.log, log::draw),
    ] {
        if area.width > 2 && area.height > 2 {
            draw(frame, area, model, view);
        }
    }
    if view.help {
        help::draw(frame, area, model, view);
    }
}

/// Returns a bordered block with a title.
pub(crate) fn pane<'a>(caps: TerminalCaps, title: impl Into<Line<'a>>) -> Block<'a> {
    Block::new()
        .borders(Borders::ALL)
        .border_set(caps.border())
        .border_style(caps.dim())
        .title(title)
}

/// Draws a dim text, broken into lines.
pub(crate) fn draw_note(frame: &mut Frame, area: Rect, caps: TerminalCaps, text: &str) {
    let lines: Vec<Line> = format::wrap(text, usize::from(area.width))
        .into_iter()
        .map(Line::from)
        .collect();
    frame.render_widget(Paragraph::new(lines).style(caps.dim()), area);
}
