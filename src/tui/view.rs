//! How the night is looked at: which pane is large, what is scrolled where, and what the keys do.

use std::cell::RefCell;

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;

use super::look::Look;
use super::model::Model;
use super::panes::{self, picture::Preview};
use crate::experiment::event::CellRef;

/// The largest change of exposure, in stops, up or down.
const MAX_STOPS: f32 = 12.0;

/// Which pane is large.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Focus {
    /// All panes share the screen.
    #[default]
    Overview,
    /// The picture.
    Picture,
    /// The chart.
    Chart,
    /// The log.
    Log,
}

/// The horizontal axis of the chart.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ChartX {
    /// Seconds inside the renderer.
    #[default]
    RenderS,
    /// Samples per pixel.
    Samples,
}

/// What a key asks of the night, beyond the screen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// End after this wave; asked again, leave now.
    Stop,
    /// Pause, or go on.
    Pause,
    /// Give up the current cell.
    Skip,
}

/// The state of the screen that is not the state of the night.
#[derive(Debug)]
pub struct View {
    /// What the terminal can show.
    pub look: Look,
    /// Which pane is large.
    pub focus: Focus,
    /// Whether the help lies over everything.
    pub help: bool,
    /// Which of the plan's metrics the chart shows, from 0.
    pub metric: usize,
    /// The chart's horizontal axis.
    pub chart_x: ChartX,
    /// Stops that the live picture is brightened by, on top of the plan's tone map.
    pub exposure: f32,
    /// First row of the plan on screen; `None` follows the current cell.
    pub plan_top: Option<usize>,
    /// Lines that the log is scrolled back from its end.
    pub log_back: usize,
    /// Seconds on the same clock as the model's.
    pub now_s: f64,
    /// Whether rendering is paused.
    pub paused: bool,
    /// Whether the night will end after this wave.
    pub stopping: bool,
    /// The cell that was asked to be given up.
    pub skipping: Option<CellRef>,
    /// The reduced picture of the last frame, so that an unchanged one is not reduced again.
    pub(super) preview: RefCell<Option<Preview>>,
}

impl View {
    /// The view at the start.
    pub fn new(look: Look) -> View {
        View {
            look,
            focus: Focus::default(),
            help: false,
            metric: 0,
            chart_x: ChartX::default(),
            exposure: 0.0,
            plan_top: None,
            log_back: 0,
            now_s: 0.0,
            paused: false,
            stopping: false,
            skipping: None,
            preview: RefCell::new(None),
        }
    }

    /// The time for estimates: while rendering is paused nothing of the rest goes by.
    pub fn clock_s(&self, model: &Model) -> f64 {
        match &model.current {
            Some(current) if self.paused && current.running => current.heard_s.min(self.now_s),
            _ => self.now_s,
        }
    }

    /// Takes in a key while the screen has the size of `area`; what concerns the night is handed back.
    pub fn key(&mut self, key: KeyEvent, model: &Model, area: Rect) -> Option<Command> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (key.code == KeyCode::Char('c')).then_some(Command::Stop);
        }
        match key.code {
            KeyCode::Char('q') => return Some(Command::Stop),
            KeyCode::Char('p' | ' ') => return Some(Command::Pause),
            KeyCode::Char('s') => {
                let current = model.current.as_ref().filter(|current| current.running)?;
                self.skipping = Some(current.cell);
                return Some(Command::Skip);
            }
            KeyCode::Char('?') | KeyCode::F(1) => self.help = !self.help,
            KeyCode::Esc if self.help => self.help = false,
            KeyCode::Esc => {
                (self.focus, self.plan_top, self.log_back) = (Focus::Overview, None, 0);
            }
            KeyCode::Tab => self.turn(1),
            KeyCode::BackTab => self.turn(3),
            KeyCode::Char('x') => {
                self.chart_x = match self.chart_x {
                    ChartX::RenderS => ChartX::Samples,
                    ChartX::Samples => ChartX::RenderS,
                };
            }
            KeyCode::Char('e') => self.exposure = (self.exposure - 0.5).max(-MAX_STOPS),
            KeyCode::Char('E') => self.exposure = (self.exposure + 0.5).min(MAX_STOPS),
            KeyCode::Char(digit @ '1'..='9') => {
                let index = digit as usize - '1' as usize;
                if model.plan.as_ref().is_some_and(|plan| index < plan.metrics.len()) {
                    self.metric = index;
                }
            }
            KeyCode::Up | KeyCode::Char('k') => self.scroll(-1, model, area),
            KeyCode::Down | KeyCode::Char('j') => self.scroll(1, model, area),
            KeyCode::PageUp => self.scroll(-self.page(area), model, area),
            KeyCode::PageDown => self.scroll(self.page(area), model, area),
            KeyCode::Home => self.scroll(isize::MIN / 2, model, area),
            KeyCode::End => self.scroll(isize::MAX / 2, model, area),
            _ => {}
        }
        None
    }

    fn turn(&mut self, by: usize) {
        const ORDER: [Focus; 4] = [Focus::Overview, Focus::Picture, Focus::Chart, Focus::Log];
        let now = ORDER.iter().position(|focus| *focus == self.focus).unwrap_or(0);
        self.focus = ORDER[(now + by) % ORDER.len()];
    }

    fn page(&self, area: Rect) -> isize {
        let regions = panes::regions(area, self.focus);
        match self.focus {
            Focus::Log => isize::from(regions.log.height as i16 - 3).max(1),
            _ => (panes::plan::page(regions.plan) as isize - 1).max(1),
        }
    }

    /// Scrolls the log where it is the large pane, and the plan everywhere else.
    fn scroll(&mut self, by: isize, model: &Model, area: Rect) {
        let regions = panes::regions(area, self.focus);
        if self.focus == Focus::Log {
            let most = panes::log::lines_back(model, self, regions.log);
            self.log_back = self.log_back.saturating_add_signed(by.saturating_neg()).min(most);
            return;
        }
        let page = panes::plan::page(regions.plan);
        let most = panes::plan::rows(model).saturating_sub(page);
        let top = panes::plan::top(model, self, page);
        self.plan_top = Some(top.saturating_add_signed(by).min(most));
    }
}
