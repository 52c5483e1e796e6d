//! How the night is looked at: which pane is large, what is scrolled where, and what the keys do.

use std::cell::RefCell;

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;

use super::command::{self, Order};
use super::device::Gauges;
use super::look::{Graphics, Look};
use super::model::Model;
use super::panes;
use super::preview::Previews;
use super::reel::Reel;
use super::rows::Rows;
use super::sharp::Sharp;
use crate::experiment::{CellRef, Control, PauseAt};

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
    /// The plan.
    Plan,
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

/// What the picture pane shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Picture {
    /// The picture as it renders.
    #[default]
    Live,
    /// What it is measured against.
    Reference,
    /// The absolute error of every pixel.
    Difference,
    /// The error as seen when the two are flickered between: FLIP.
    Flip,
    /// What each strategy found, of the last cell that kept it.
    Strategies,
    /// Light by its time, a frame of it.
    Time,
}

impl Picture {
    /// All of them, in the order in which a key goes through them.
    pub const ALL: [Picture; 6] =
        [Picture::Live, Picture::Reference, Picture::Difference, Picture::Flip, Picture::Strategies, Picture::Time];

    /// Its name in the command bar.
    pub fn name(self) -> &'static str {
        match self {
            Picture::Live => "live",
            Picture::Reference => "reference",
            Picture::Difference => "difference",
            Picture::Flip => "flip",
            Picture::Strategies => "strategies",
            Picture::Time => "time",
        }
    }
}

/// How cells are listed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Listing {
    /// A tree where that is shorter: the group at hand open, the others closed.
    #[default]
    Follow,
    /// A tree with every group open.
    Open,
    /// One row for each cell.
    Flat,
}

/// What a key asks of the night, beyond the screen.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// End after this wave; asked again, leave now. Where a night is only watched: leave.
    Stop,
    /// End after this cell, or not.
    StopAfterCell,
    /// Pause, go on, or the one that it is not.
    Pause(Option<bool>),
    /// Pause when the cell has come so far.
    PauseAt(Option<PauseAt>),
    /// Give up the current cell.
    Skip,
    /// Render the current cell from its first sample.
    Restart,
}

/// What the user wants of the night, as its [`Control`] says.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Wishes {
    /// Whether rendering is paused.
    pub paused: bool,
    /// Where it will pause.
    pub pause_at: Option<PauseAt>,
    /// Whether the night will end after this wave.
    pub stopping: bool,
    /// Whether it will end after this cell.
    pub after_cell: bool,
}

impl Wishes {
    /// What a control says.
    pub fn of(control: &Control) -> Wishes {
        Wishes {
            paused: control.paused(),
            pause_at: control.pause_at(),
            stopping: control.stop_requested(),
            after_cell: control.stops_after_cell(),
        }
    }
}

/// A line that is being typed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Prompt {
    /// A command.
    Command(String),
    /// What the plan is to show; it does so while it is typed.
    Filter(String),
}

/// An answer on the last line, until some time.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// What it says.
    pub text: String,
    /// Until when, in seconds on the model's clock.
    pub until_s: f64,
}

/// Seconds for which an answer stays.
const NOTICE_S: f64 = 6.0;
/// Frames that a leap through time passes over.
const LEAP: isize = 10;
/// Seconds for which each of two pictures shows when they flicker.
const FLICKER_S: f64 = 0.6;
/// Seconds for which each frame shows when light plays through time: as often as the screen is drawn.
const FRAME_S: f64 = 0.1;

/// The state of the screen that is not the state of the night.
#[derive(Debug)]
pub struct View {
    /// What the terminal can show.
    pub look: Look,
    /// How pictures are shown, and the size of a character cell in pixels where that needs it.
    pub graphics: (Graphics, [u16; 2]),
    /// Whether another process renders, so that keys cannot reach the night.
    pub watching: bool,
    /// Which pane is large.
    pub focus: Focus,
    /// Whether the help lies over everything.
    pub help: bool,
    /// Which of the plan's metrics the chart shows, from 0.
    pub metric: usize,
    /// The chart's horizontal axis.
    pub chart_x: ChartX,
    /// What the picture pane shows.
    pub picture: Picture,
    /// Whether live picture and reference are shown in turn.
    pub flicker: bool,
    /// Whether the strategies are shown without their weights.
    pub raw: bool,
    /// The optical length whose frame is shown of light by time.
    pub moment: f64,
    /// When light began to play through time, and at which frame.
    pub playing: Option<(f64, usize)>,
    /// Stops that pictures are brightened by, on top of the plan's tone map.
    pub exposure: f32,
    /// How cells are listed.
    pub listing: Listing,
    /// Lower-case words that the cells of the list contain.
    pub filter: String,
    /// First row of the plan on screen; `None` follows the current cell.
    pub plan_top: Option<usize>,
    /// Lines that the log is scrolled back from its end.
    pub log_back: usize,
    /// The line that is being typed.
    pub prompt: Option<Prompt>,
    /// An answer to what was typed.
    pub notice: Option<Notice>,
    /// Seconds on the same clock as the model's.
    pub now_s: f64,
    /// What the user wants of the night.
    pub wishes: Wishes,
    /// The cell that was asked to be given up.
    pub skipping: Option<CellRef>,
    /// The reduced picture of the last frame, so that an unchanged one is not reduced again.
    pub(super) preview: RefCell<Previews>,
    /// The pictures in full resolution of the last frames.
    pub(super) sharp: RefCell<Sharp>,
    /// The rows of the plan, so that an unchanged plan is not searched again.
    pub(super) rows: RefCell<Rows>,
    /// The device's gauges.
    pub(super) gauges: RefCell<Gauges>,
}

impl View {
    /// The view at the start.
    pub fn new(look: Look) -> View {
        View {
            look,
            graphics: (Graphics::Blocks, [0, 0]),
            watching: false,
            focus: Focus::default(),
            help: false,
            metric: 0,
            chart_x: ChartX::default(),
            picture: Picture::default(),
            flicker: false,
            raw: false,
            moment: f64::NEG_INFINITY,
            playing: None,
            exposure: 0.0,
            listing: Listing::default(),
            filter: String::new(),
            plan_top: None,
            log_back: 0,
            prompt: None,
            notice: None,
            now_s: 0.0,
            wishes: Wishes::default(),
            skipping: None,
            preview: RefCell::default(),
            sharp: RefCell::default(),
            rows: RefCell::default(),
            gauges: RefCell::default(),
        }
    }

    /// The time for estimates: while rendering is paused nothing of the rest goes by.
    pub fn clock_s(&self, model: &Model) -> f64 {
        match &model.current {
            Some(current) if self.wishes.paused && current.running => current.heard_s.min(self.now_s),
            _ => self.now_s,
        }
    }

    /// What changes by the clock alone, as a number: frames with the same one look the same. A night that is over has
    /// no clock that ticks.
    pub fn tick(&self, model: &Model, now_s: f64) -> u64 {
        let notice = self.notice.as_ref().is_some_and(|notice| now_s < notice.until_s);
        let step = match model.finished_s {
            _ if self.flicker => FLICKER_S,
            _ if self.playing.is_some() => FRAME_S,
            None => 1.0,
            Some(_) if notice => NOTICE_S,
            Some(_) => return 0,
        };
        (now_s / step) as u64 * 2 + u64::from(notice)
    }

    /// What the picture pane shows now; two in turn when they flicker.
    pub fn shown(&self) -> Picture {
        match self.flicker {
            true if (self.now_s / FLICKER_S) as u64 % 2 == 1 => Picture::Reference,
            true => Picture::Live,
            false => self.picture,
        }
    }

    /// The frame that shows of light by time.
    pub fn frame(&self, reel: &Reel) -> usize {
        match self.playing {
            Some((since_s, from)) => (from + ((self.now_s - since_s) / FRAME_S).max(0.0) as usize) % reel.count(),
            None => reel.at(self.moment),
        }
    }

    /// Light plays through time from the frame that shows, or from the first where that is the last; or stops.
    fn play(&mut self, model: &Model) {
        if self.playing.is_some() {
            return self.halt(model);
        }
        (self.picture, self.flicker) = (Picture::Time, false);
        self.playing = model.reel.as_ref().map(|reel| {
            let from = self.frame(reel);
            (self.now_s, if from + 1 < reel.count() { from } else { 0 })
        });
    }

    /// Stops at the frame that shows.
    fn halt(&mut self, model: &Model) {
        match &model.reel {
            Some(reel) if self.playing.is_some() => self.stay(reel, self.frame(reel)),
            _ => self.playing = None,
        }
    }

    /// Some frames on or back.
    fn step(&mut self, by: isize, model: &Model) {
        (self.picture, self.flicker) = (Picture::Time, false);
        if let Some(reel) = &model.reel {
            self.stay(reel, self.frame(reel).saturating_add_signed(by).min(reel.count() - 1));
        }
    }

    /// Shows a frame, wherever it will be among others once there is more light.
    fn stay(&mut self, reel: &Reel, frame: usize) {
        let [begin, end] = reel.span(frame);
        (self.moment, self.playing) = (0.5 * (begin + end), None);
    }

    /// Takes in a key while the screen has the size of `area`; what concerns the night is handed back.
    pub fn key(&mut self, key: KeyEvent, model: &Model, area: Rect) -> Option<Command> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (key.code == KeyCode::Char('c')).then_some(Command::Stop);
        }
        if key.modifiers.contains(KeyModifiers::ALT) {
            // A terminal sends the same for Alt and a letter as for Escape and the letter right after it; nothing here
            // wants Alt.
            self.key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE), model, area);
        }
        if let Some(prompt) = self.prompt.take() {
            let order = self.typed(prompt, key.code, model)?;
            return self.obey(order, model, area);
        }
        let order = match key.code {
            KeyCode::Char('q') => Order::Night(Command::Stop),
            KeyCode::Char('Q') => Order::Night(Command::StopAfterCell),
            KeyCode::Char('p' | ' ') => Order::Night(Command::Pause(None)),
            KeyCode::Char('s') => Order::Night(Command::Skip),
            KeyCode::Char('R') => Order::Night(Command::Restart),
            KeyCode::Char('f') => Order::Flicker,
            KeyCode::Char('v') => Order::Picture(self.picture_after(1)),
            KeyCode::Char('V') => Order::Picture(self.picture_after(Picture::ALL.len() - 1)),
            KeyCode::Char('e') => Order::Exposure(self.exposure - 0.5),
            KeyCode::Char('E') => Order::Exposure(self.exposure + 0.5),
            KeyCode::Char('0') => Order::Exposure(0.0),
            KeyCode::Char(digit @ '1'..='9') => Order::Metric(digit as usize - '1' as usize),
            KeyCode::Char('?') | KeyCode::F(1) => Order::Help,
            other => {
                self.look_at(other, model, area);
                return None;
            }
        };
        self.obey(order, model, area)
    }

    /// Keys that change the screen and nothing that a command could name.
    fn look_at(&mut self, code: KeyCode, model: &Model, area: Rect) {
        match code {
            KeyCode::Char(':') => self.prompt = Some(Prompt::Command(String::new())),
            KeyCode::Char('/') => self.prompt = Some(Prompt::Filter(self.filter.clone())),
            KeyCode::Esc if self.help => self.help = false,
            KeyCode::Esc => {
                (self.focus, self.plan_top, self.log_back) = (Focus::Overview, None, 0);
                self.halt(model);
                (self.flicker, self.notice) = (false, None);
                self.filter.clear();
            }
            KeyCode::Tab => self.turn(1),
            KeyCode::BackTab => self.turn(4),
            KeyCode::Char('x') => {
                self.chart_x = match self.chart_x {
                    ChartX::RenderS => ChartX::Samples,
                    ChartX::Samples => ChartX::RenderS,
                };
            }
            KeyCode::Char('w') => self.raw = !self.raw,
            KeyCode::Char('t') => self.play(model),
            KeyCode::Left => self.step(-1, model),
            KeyCode::Right => self.step(1, model),
            KeyCode::Char('<') => self.step(-LEAP, model),
            KeyCode::Char('>') => self.step(LEAP, model),
            KeyCode::Char('g') => {
                self.plan_top = None;
                self.listing = match self.listing {
                    Listing::Follow => Listing::Open,
                    Listing::Open => Listing::Flat,
                    Listing::Flat => Listing::Follow,
                };
            }
            KeyCode::Up | KeyCode::Char('k') => self.scroll(-1, model, area),
            KeyCode::Down | KeyCode::Char('j') => self.scroll(1, model, area),
            KeyCode::PageUp => self.scroll(-self.page(model, area), model, area),
            KeyCode::PageDown => self.scroll(self.page(model, area), model, area),
            KeyCode::Home => self.scroll(isize::MIN / 2, model, area),
            KeyCode::End => self.scroll(isize::MAX / 2, model, area),
            _ => {}
        }
    }

    /// Takes in a key while a line is typed; hands back what the line asks for, once it is whole.
    fn typed(&mut self, mut prompt: Prompt, code: KeyCode, model: &Model) -> Option<Order> {
        let (Prompt::Command(text) | Prompt::Filter(text)) = &mut prompt;
        match code {
            KeyCode::Esc => {
                if matches!(prompt, Prompt::Filter(_)) {
                    self.filter.clear();
                }
                return None;
            }
            KeyCode::Backspace if text.is_empty() => return None,
            KeyCode::Backspace => {
                text.pop();
            }
            KeyCode::Enter => {
                return match prompt {
                    Prompt::Filter(text) => Some(Order::Filter(text.to_lowercase())),
                    Prompt::Command(text) => match command::read(&text, model) {
                        Ok(order) => Some(order),
                        Err(answer) => {
                            self.answer(answer);
                            None
                        }
                    },
                };
            }
            KeyCode::Char(c) if text.len() < 200 => text.push(c),
            _ => {}
        }
        if let Prompt::Filter(text) = &prompt {
            (self.filter, self.plan_top) = (text.to_lowercase(), None);
        }
        self.prompt = Some(prompt);
        None
    }

    /// Carries out an order as far as it concerns the screen; what concerns the night is handed back.
    fn obey(&mut self, order: Order, model: &Model, area: Rect) -> Option<Command> {
        match order {
            Order::Night(Command::Stop) => return Some(Command::Stop),
            Order::Night(_) if self.watching => {
                self.answer("another process renders this night; it can only be watched from here".to_owned());
            }
            Order::Night(command @ (Command::Skip | Command::Restart)) => {
                let current = model.current.as_ref().filter(|current| current.running)?;
                if command == Command::Skip {
                    self.skipping = Some(current.cell);
                }
                return Some(command);
            }
            Order::Night(command) => return Some(command),
            Order::Filter(words) => (self.filter, self.plan_top) = (words, None),
            Order::Metric(index) => {
                if model.plan.as_ref().is_some_and(|plan| index < plan.metrics.len()) {
                    self.metric = index;
                }
            }
            Order::Axis(axis) => self.chart_x = axis,
            Order::Picture(kind) => (self.picture, self.flicker, self.playing) = (kind, false, None),
            Order::Play => self.play(model),
            Order::Moment(length) => {
                (self.picture, self.flicker, self.playing, self.moment) = (Picture::Time, false, None, length);
            }
            Order::Flicker => (self.flicker, self.playing) = (!self.flicker, None),
            Order::Exposure(stops) => self.exposure = stops.clamp(-MAX_STOPS, MAX_STOPS),
            Order::Cell(i) => {
                self.filter.clear();
                if self.listing == Listing::Follow {
                    self.listing = Listing::Open;
                }
                let row = self.row_of(CellRef::Cell(i), model);
                let page = panes::plan::page(panes::regions(area, self.focus, model).plan);
                self.plan_top = Some(row.saturating_sub(page / 2));
            }
            Order::Help => self.help = !self.help,
        }
        None
    }

    fn answer(&mut self, text: String) {
        self.notice = Some(Notice { text, until_s: self.now_s + NOTICE_S });
    }

    fn picture_after(&self, by: usize) -> Picture {
        let now = Picture::ALL.iter().position(|kind| *kind == self.picture).unwrap_or(0);
        Picture::ALL[(now + by) % Picture::ALL.len()]
    }

    /// The row on which a cell or reference stands, or the group that it is in.
    pub(super) fn row_of(&self, cell: CellRef, model: &Model) -> usize {
        self.rows.borrow_mut().update(model, self).place(cell)
    }

    fn turn(&mut self, by: usize) {
        const ORDER: [Focus; 5] = [Focus::Overview, Focus::Picture, Focus::Chart, Focus::Log, Focus::Plan];
        let now = ORDER.iter().position(|focus| *focus == self.focus).unwrap_or(0);
        self.focus = ORDER[(now + by) % ORDER.len()];
    }

    fn page(&self, model: &Model, area: Rect) -> isize {
        let regions = panes::regions(area, self.focus, model);
        match self.focus {
            Focus::Log => isize::from(regions.log.height as i16 - 3).max(1),
            _ => (panes::plan::page(regions.plan) as isize - 1).max(1),
        }
    }

    /// Scrolls the log where it is the large pane, and the plan everywhere else.
    fn scroll(&mut self, by: isize, model: &Model, area: Rect) {
        let regions = panes::regions(area, self.focus, model);
        if self.focus == Focus::Log {
            let most = panes::log::lines_back(model, self, regions.log);
            self.log_back = self.log_back.saturating_add_signed(by.saturating_neg()).min(most);
            return;
        }
        let page = panes::plan::page(regions.plan);
        let most = panes::plan::rows(model, self).saturating_sub(page);
        let top = panes::plan::top(model, self, page);
        self.plan_top = Some(top.saturating_add_signed(by).min(most));
    }
}
