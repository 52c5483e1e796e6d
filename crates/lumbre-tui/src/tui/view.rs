//! State of the screen: focus, scrolling, prompt and modes, and the keys that change it.

use std::cell::RefCell;

use crossterm::event::{KeyCode, KeyEvent, KeyEventKind, KeyModifiers};
use ratatui::layout::Rect;

use super::command::{self, Action};
use super::confirmation::{Confirmation, question};
use super::model::night::NightModel;
use super::model::plan_rows::PlanRows;
use super::model::time_preview::TimePreview;
use super::modes::{ChartX, Focus, NightRequest, PictureMode, PlanLayout};
use super::panes;
use super::preview::PreviewCache;
use super::terminal::device_gauges::Gauges;
use super::terminal::graphics_protocols::GraphicsCache;
use super::terminal::terminal_caps::{Graphics, TerminalCaps};
use lumbre_night::experiment::{CellRef, NightControls, PauseAt};

/// Largest change of exposure in stops, up or down.
const MAX_STOPS: f32 = 12.0;

/// Pending requests to the night, as read from its [`NightControls`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PendingRequests {
    /// Whether rendering is paused.
    pub paused: bool,
    /// Limit at which rendering will pause.
    pub pause_at: Option<PauseAt>,
    /// Whether the night stops after this wave.
    pub stopping: bool,
    /// Whether the night stops after this cell.
    pub after_cell: bool,
}

impl PendingRequests {
    /// Reads the pending requests of a control.
    pub fn from_controls(control: &NightControls) -> PendingRequests {
        PendingRequests {
            paused: control.paused(),
            pause_at: control.pause_at(),
            stopping: control.stop_requested(),
            after_cell: control.stops_after_cell(),
        }
    }
}

/// Text that is being typed.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Prompt {
    /// A line of the command bar.
    Command(String),
    /// A filter of the plan, which is applied while it is typed.
    Filter(String),
}

/// A message on the last line, shown for a limited time.
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Text of the message.
    pub text: String,
    /// End of its display, in seconds on the model's clock.
    pub until_s: f64,
}

/// Display time of a message in seconds.
const NOTICE_S: f64 = 6.0;
/// Number of frames that a jump through time skips.
const FRAME_JUMP: isize = 10;
/// Display time in seconds of each of the two pictures that flicker.
const FLICKER_S: f64 = 0.6;
/// Display time in seconds of each frame of the time animation, equal to the frame interval.
const FRAME_S: f64 = 0.1;

/// State of the screen, as opposed to the state of the night in [`NightModel`].
#[derive(Debug)]
pub struct View {
    /// Capabilities of the terminal.
    pub caps: TerminalCaps,
    /// Graphics protocol, and the size of a character cell in pixels if the protocol needs it.
    pub graphics: (Graphics, [u16; 2]),
    /// Whether another process renders the night, so that keys cannot control it.
    pub watching: bool,
    /// Pane that is enlarged.
    pub focus: Focus,
    /// Whether the help overlay is shown.
    pub help: bool,
    /// Index of the metric in the chart.
    pub metric: usize,
    /// Horizontal axis of the chart.
    pub chart_x: ChartX,
    /// Content of the picture pane.
    pub picture: PictureMode,
    /// Whether picture and reference alternate.
    pub flicker: bool,
    /// Whether the strategies are shown without their MIS weights.
    pub unweighted: bool,
    /// Optical length whose frame of the time-resolved film is shown, in scene units.
    pub optical_length: f64,
    /// Start of the time animation: time in seconds, and index of its first frame.
    pub playing: Option<(f64, usize)>,
    /// Exposure of pictures in stops, on top of the plan's tone map.
    pub exposure: f32,
    /// Layout of the cells in the plan pane.
    pub layout: PlanLayout,
    /// Lower-case words that the listed cells must contain.
    pub filter: String,
    /// First visible row of the plan; `None` follows the current cell.
    pub plan_top: Option<usize>,
    /// Number of lines by which the log is scrolled back from its end.
    pub log_back: usize,
    /// Text that is being typed.
    pub prompt: Option<Prompt>,
    /// Reply to the last command.
    pub notice: Option<Notice>,
    /// Request that is made if it is repeated.
    pub(super) confirmation: Option<Confirmation>,
    /// Current time in seconds on the model's clock.
    pub now_s: f64,
    /// Pending requests to the night.
    pub requests: PendingRequests,
    /// Cell that the user requested to skip.
    pub skipping: Option<CellRef>,
    /// Cache of reduced pictures.
    pub(super) preview: RefCell<PreviewCache>,
    /// Cache of pictures in full resolution.
    pub(super) graphics_cache: RefCell<GraphicsCache>,
    /// Cache of the plan's rows.
    pub(super) rows: RefCell<PlanRows>,
    /// History of the device gauges.
    pub(super) gauges: RefCell<Gauges>,
}

impl View {
    /// Creates the initial view.
    pub fn new(caps: TerminalCaps) -> View {
        View {
            caps,
            graphics: (Graphics::Blocks, [0, 0]),
            watching: false,
            focus: Focus::default(),
            help: false,
            metric: 0,
            chart_x: ChartX::default(),
            picture: PictureMode::default(),
            flicker: false,
            unweighted: false,
            optical_length: f64::NEG_INFINITY,
            playing: None,
            exposure: 0.0,
            layout: PlanLayout::default(),
            filter: String::new(),
            plan_top: None,
            log_back: 0,
            prompt: None,
            notice: None,
            confirmation: None,
            now_s: 0.0,
            requests: PendingRequests::default(),
            skipping: None,
            preview: RefCell::default(),
            graphics_cache: RefCell::default(),
            rows: RefCell::default(),
            gauges: RefCell::default(),
        }
    }

    /// Time for estimates; it stands still while rendering is paused.
    pub fn clock_s(&self, model: &NightModel) -> f64 {
        match &model.current {
            Some(current) if self.requests.paused && current.running => {
                current.updated_s.min(self.now_s)
            }
            _ => self.now_s,
        }
    }

    /// Number that changes when the screen changes by time alone: frames with equal numbers look
    /// the same. It is constant after the end of the night.
    pub fn tick(&self, model: &NightModel, now_s: f64) -> u64 {
        let notice = self
            .notice
            .as_ref()
            .is_some_and(|notice| now_s < notice.until_s);
        let step = match model.finished_s {
            _ if self.flicker => FLICKER_S,
            _ if self.playing.is_some() => FRAME_S,
            None => 1.0,
            Some(_) if notice => NOTICE_S,
            Some(_) => return 0,
        };
        (now_s / step) as u64 * 2 + u64::from(notice)
    }

    /// Mode that the picture pane shows now; alternates while flickering.
    pub fn visible_mode(&self) -> PictureMode {
        match self.flicker {
            true if (self.now_s / FLICKER_S) as u64 % 2 == 1 => PictureMode::Reference,
            true => PictureMode::Live,
            false => self.picture,
        }
    }

    /// Index of the visible frame of the time-resolved film.
    pub fn frame(&self, time_preview: &TimePreview) -> usize {
        match self.playing {
            Some((since_s, from)) => {
                (from + ((self.now_s - since_s) / FRAME_S).max(0.0) as usize)
                    % time_preview.frame_count()
            }
            None => time_preview.frame_at(self.optical_length),
        }
    }

    /// Starts the time animation at the visible frame, or at the first if the visible one is the
    /// last; stops it if it is running.
    fn toggle_animation(&mut self, model: &NightModel) {
        if self.playing.is_some() {
            return self.stop_animation(model);
        }
        (self.picture, self.flicker) = (PictureMode::Time, false);
        self.playing = model.time_preview.as_ref().map(|time_preview| {
            let from = self.frame(time_preview);
            (
                self.now_s,
                if from + 1 < time_preview.frame_count() {
                    from
                } else {
                    0
                },
            )
        });
    }

    /// Stops the time animation at the visible frame.
    fn stop_animation(&mut self, model: &NightModel) {
        match &model.time_preview {
            Some(time_preview) if self.playing.is_some() => {
                self.select_frame(time_preview, self.frame(time_preview))
            }
            _ => self.playing = None,
        }
    }

    /// Moves by some frames, forwards or backwards.
    fn step_frames(&mut self, by: isize, model: &NightModel) {
        (self.picture, self.flicker) = (PictureMode::Time, false);
        if let Some(time_preview) = &model.time_preview {
            self.select_frame(
                time_preview,
                self.frame(time_preview)
                    .saturating_add_signed(by)
                    .min(time_preview.frame_count() - 1),
            );
        }
    }

    /// Selects a frame by its optical length, so that the selection survives new data.
    fn select_frame(&mut self, time_preview: &TimePreview, frame: usize) {
        let [begin, end] = time_preview.length_range(frame);
        (self.optical_length, self.playing) = (0.5 * (begin + end), None);
    }

    /// Handles a key on a screen of size `area`; returns the request to the night, if any.
    pub fn key(&mut self, key: KeyEvent, model: &NightModel, area: Rect) -> Option<NightRequest> {
        if key.kind == KeyEventKind::Release {
            return None;
        }
        if key.modifiers.contains(KeyModifiers::CONTROL) {
            return (key.code == KeyCode::Char('c')).then_some(NightRequest::Stop);
        }
        if key.modifiers.contains(KeyModifiers::ALT) {
            // A terminal sends the same bytes for Alt and a letter as for Escape followed by the
            // letter. No key here uses Alt.
            self.key(KeyEvent::new(KeyCode::Esc, KeyModifiers::NONE), model, area);
        }
        if let Some(prompt) = self.prompt.take() {
            let order = self.edit_prompt(prompt, key.code, model)?;
            return self.execute(order, model, area);
        }
        let order = match key.code {
            KeyCode::Char('q') => Action::Night(NightRequest::Stop),
            KeyCode::Char('Q') => Action::Night(NightRequest::StopAfterCell),
            KeyCode::Char('p' | ' ') => Action::Night(NightRequest::Pause(None)),
            KeyCode::Char('s') => Action::Night(NightRequest::Skip),
            KeyCode::Char('R') => Action::Night(NightRequest::Restart),
            KeyCode::Char('f') => Action::Flicker,
            KeyCode::Char('v') => Action::Picture(self.picture_after(1)),
            KeyCode::Char('V') => Action::Picture(self.picture_after(PictureMode::ALL.len() - 1)),
            KeyCode::Char('e') => Action::Exposure(self.exposure - 0.5),
            KeyCode::Char('E') => Action::Exposure(self.exposure + 0.5),
            KeyCode::Char('0') => Action::Exposure(0.0),
            KeyCode::Char(digit @ '1'..='9') => Action::Metric(digit as usize - '1' as usize),
            KeyCode::Char('?') | KeyCode::F(1) => Action::Help,
            other => {
                self.screen_key(other, model, area);
                return None;
            }
        };
        self.execute(order, model, area)
    }

    /// Handles keys that change the screen and have no command in the command bar.
    fn screen_key(&mut self, code: KeyCode, model: &NightModel, area: Rect) {
        match code {
            KeyCode::Char(':') => self.prompt = Some(Prompt::Command(String::new())),
            KeyCode::Char('/') => self.prompt = Some(Prompt::Filter(self.filter.clone())),
            KeyCode::Esc if self.help => self.help = false,
            KeyCode::Esc => {
                (self.focus, self.plan_top, self.log_back) = (Focus::Overview, None, 0);
                self.stop_animation(model);
                (self.flicker, self.notice) = (false, None);
                self.filter.clear();
            }
            KeyCode::Tab => self.focus = self.focus.next(),
            KeyCode::BackTab => self.focus = self.focus.moved(4),
            KeyCode::Char('x') => {
                self.chart_x = match self.chart_x {
                    ChartX::RenderS => ChartX::Samples,
                    ChartX::Samples => ChartX::RenderS,
                };
            }
            KeyCode::Char('w') => self.unweighted = !self.unweighted,
            KeyCode::Char('t') => self.toggle_animation(model),
            KeyCode::Left => self.step_frames(-1, model),
            KeyCode::Right => self.step_frames(1, model),
            KeyCode::Char('<') => self.step_frames(-FRAME_JUMP, model),
            KeyCode::Char('>') => self.step_frames(FRAME_JUMP, model),
            KeyCode::Char('g') => {
                self.plan_top = None;
                self.layout = match self.layout {
                    PlanLayout::Follow => PlanLayout::Open,
                    PlanLayout::Open => PlanLayout::Flat,
                    PlanLayout::Flat => PlanLayout::Follow,
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

    /// Handles a key while the prompt is open; returns the action once the line is complete.
    fn edit_prompt(
        &mut self,
        mut prompt: Prompt,
        code: KeyCode,
        model: &NightModel,
    ) -> Option<Action> {
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
                    Prompt::Filter(text) => Some(Action::Filter(text.to_lowercase())),
                    Prompt::Command(text) => match command::read(&text, model) {
                        Ok(order) => Some(order),
                        Err(answer) => {
                            self.notify(answer);
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

    /// Executes an action on the screen; returns the request to the night, if it is one.
    fn execute(&mut self, order: Action, model: &NightModel, area: Rect) -> Option<NightRequest> {
        match order {
            Action::Night(NightRequest::Stop) => return Some(NightRequest::Stop),
            Action::Night(_) if self.watching => {
                self.notify(
                    "this night is rendered by another process and can only be watched here"
                        .to_owned(),
                );
            }
            Action::Night(command @ (NightRequest::Skip | NightRequest::Restart)) => {
                let current = model.current.as_ref().filter(|current| current.running)?;
                if self.asks_again(command, current.cell, model) {
                    return None;
                }
                if command == NightRequest::Skip {
                    self.skipping = Some(current.cell);
                }
                return Some(command);
            }
            Action::Night(command) => return Some(command),
            Action::Filter(words) => (self.filter, self.plan_top) = (words, None),
            Action::Metric(index) => match model.metrics().len() {
                0 => self.notify("this plan has no metrics".to_owned()),
                n if index >= n => self.notify(format!("the last metric is number {n}")),
                _ => self.metric = index,
            },
            Action::ChartX(axis) => self.chart_x = axis,
            Action::Picture(kind) => {
                (self.picture, self.flicker, self.playing) = (kind, false, None)
            }
            Action::Play => self.toggle_animation(model),
            Action::OpticalLength(length) => {
                (
                    self.picture,
                    self.flicker,
                    self.playing,
                    self.optical_length,
                ) = (PictureMode::Time, false, None, length);
            }
            Action::Flicker => (self.flicker, self.playing) = (!self.flicker, None),
            Action::Exposure(stops) => self.exposure = stops.clamp(-MAX_STOPS, MAX_STOPS),
            Action::Cell(i) => {
                self.filter.clear();
                if self.layout == PlanLayout::Follow {
                    self.layout = PlanLayout::Open;
                }
                let row = self.row_of(CellRef::Cell(i), model);
                let page = panes::plan::page(panes::regions(area, self.focus, model).plan);
                self.plan_top = Some(row.saturating_sub(page / 2));
            }
            Action::Help => self.help = !self.help,
        }
        None
    }

    /// Asks the user to repeat a request that loses rendered work. Returns whether it is to wait.
    fn asks_again(&mut self, request: NightRequest, cell: CellRef, model: &NightModel) -> bool {
        let asked = self.confirmation.take().is_some_and(|asked| {
            (asked.request, asked.cell) == (request, cell) && self.now_s < asked.until_s
        });
        let Some(question) = question(request, cell, model).filter(|_| !asked) else {
            return false;
        };
        self.confirmation = Some(Confirmation {
            request,
            cell,
            until_s: self.now_s + NOTICE_S,
        });
        self.notify(question);
        true
    }

    fn notify(&mut self, text: String) {
        self.notice = Some(Notice {
            text,
            until_s: self.now_s + NOTICE_S,
        });
    }

    fn picture_after(&self, by: usize) -> PictureMode {
        let now = PictureMode::ALL
            .iter()
            .position(|kind| *kind == self.picture)
            .unwrap_or(0);
        PictureMode::ALL[(now + by) % PictureMode::ALL.len()]
    }

    /// Index of the row of a cell or reference, or of its group.
    pub(super) fn row_of(&self, cell: CellRef, model: &NightModel) -> usize {
        self.rows.borrow_mut().update(model, self).index_of(cell)
    }

    fn page(&self, model: &NightModel, area: Rect) -> isize {
        let regions = panes::regions(area, self.focus, model);
        match self.focus {
            Focus::Log => isize::from(regions.log.height as i16 - 3).max(1),
            _ => (panes::plan::page(regions.plan) as isize - 1).max(1),
        }
    }

    /// Scrolls the log if it is enlarged, otherwise the plan.
    fn scroll(&mut self, by: isize, model: &NightModel, area: Rect) {
        let regions = panes::regions(area, self.focus, model);
        if self.focus == Focus::Log {
            let most = panes::log::lines_back(model, self, regions.log);
            self.log_back = self
                .log_back
                .saturating_add_signed(by.saturating_neg())
                .min(most);
            return;
        }
        let page = panes::plan::page(regions.plan);
        let most = panes::plan::rows(model, self).saturating_sub(page);
        let top = panes::plan::top(model, self, page);
        self.plan_top = Some(top.saturating_add_signed(by).min(most));
    }
}
