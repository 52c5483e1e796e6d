//! The screen: a pure function of the state of the night ([`NightModel`]) and of the screen
//! ([`View`]).
//!
//! There are three layouts: a stack below 80 columns or 24 rows, two columns of panes up to 160
//! columns and 40 rows, and from there on three columns above a strip of picture, reference and
//! error map. While a reference renders, which has neither of the last two, the chart is in their
//! place. Below 40 columns or 12 rows there is only one line.

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
use super::model::night::{CurrentRun, NightModel};
use super::modes::Focus;
use super::terminal::terminal_caps::TerminalCaps;
use super::view::View;
use lumbre_light::film::Image;

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
    /// Its reference, on wide screens.
    pub reference: Rect,
    /// Its error map, on wide screens.
    pub error_map: Rect,
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
    let current = model.current.as_ref();
    let image = current.and_then(|current| current.image.as_deref());
    let panes = match (area.width, area.height) {
        (160.., 40..) => wide(body, focus, current, device::rows(model, area.height)),
        (80.., 24..) => two_columns(body, focus, image, device::rows(model, area.height)),
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

fn two_columns(body: Rect, focus: Focus, image: Option<&Image>, device_rows: u16) -> Regions {
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
    let picture_height = picture_rows(image, left_width).min(body.height / 2);
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

/// Divides a wide screen: plan, cell and log above a strip of pictures.
fn wide(body: Rect, focus: Focus, current: Option<&CurrentRun>, device_rows: u16) -> Regions {
    let thirds = [Constraint::Fill(1); 3];
    if focus == Focus::Plan {
        return large(focus, body, Regions::default());
    }
    let image = current.and_then(|current| current.image.as_deref());
    let most = body.height * 11 / 20;
    let strip_height = if focus == Focus::Overview {
        picture_rows(image, body.width / 3).clamp(most / 2, most)
    } else {
        0
    };
    let [upper, strip] = rows(
        body,
        [Constraint::Fill(1), Constraint::Length(strip_height)],
    );
    let [left, middle, right] = columns(upper, thirds);
    let [device, log] = rows(
        right,
        [Constraint::Length(device_rows), Constraint::Fill(1)],
    );
    let [cell, below] = rows(middle, [Constraint::Length(12), Constraint::Fill(1)]);
    if focus != Focus::Overview {
        let width = middle.width + right.width;
        let panes = Regions {
            plan: left,
            cell: Rect { width, ..cell },
            ..Regions::default()
        };
        return large(focus, Rect { width, ..below }, panes);
    }
    let regions = Regions {
        plan: left,
        cell,
        device,
        log,
        ..Regions::default()
    };
    let [picture, reference, error_map] = columns(strip, thirds);
    if current.is_some_and(|current| current.reference.is_some()) {
        Regions {
            chart: below,
            picture,
            reference,
            error_map,
            ..regions
        }
    } else {
        Regions {
            cell: middle,
            chart: reference.union(error_map),
            picture,
            ..regions
        }
    }
}

/// Rows of a pane of `width` columns that its picture fills, both with the border. A character cell
/// is twice as high as wide. Without a picture yet, it is taken to be a square.
fn picture_rows(image: Option<&Image>, width: u16) -> u16 {
    let aspect = image.map_or(1.0, |image| {
        f64::from(image.height.max(1)) / f64::from(image.width.max(1))
    });
    let inside = f64::from(width.saturating_sub(2)) * aspect / 2.0;
    (inside.ceil() as u16).saturating_add(2)
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
        (regions.reference, picture::draw_reference),
        (regions.error_map, picture::draw_error_map),
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

/// Draws a block and returns the area inside it.
pub(crate) fn framed(frame: &mut Frame, area: Rect, block: Block) -> Rect {
    let inner = block.inner(area);
    frame.render_widget(block, area);
    inner
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
