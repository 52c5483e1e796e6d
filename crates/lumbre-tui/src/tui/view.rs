//! State of the screen: focus, scrolling, prompt and modes.

use std::cell::RefCell;

use super::confirmation::Confirmation;
use super::model::night::NightModel;
use super::model::plan_rows::PlanRows;
use super::model::time_preview::TimePreview;
use super::modes::{ChartX, Focus, PictureMode, PlanLayout};
use super::preview::PreviewCache;
use super::terminal::device_gauges::Gauges;
use super::terminal::graphics_protocols::GraphicsCache;
use super::terminal::terminal_caps::{Graphics, TerminalCaps};
use lumbre_night::experiment::{CellRef, NightControls, PauseAt};

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
            paused: control.paused.get(),
            pause_at: control.pause_at(),
            stopping: control.stop_requested(),
            after_cell: control.after_cell.get(),
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
pub(super) const NOTICE_S: f64 = 6.0;
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
    pub(super) fn toggle_animation(&mut self, model: &NightModel) {
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
    pub(super) fn stop_animation(&mut self, model: &NightModel) {
        match &model.time_preview {
            Some(time_preview) if self.playing.is_some() => {
                self.select_frame(time_preview, self.frame(time_preview))
            }
            _ => self.playing = None,
        }
    }

    /// Moves by some frames, forwards or backwards.
    pub(super) fn step_frames(&mut self, by: isize, model: &NightModel) {
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

    /// Index of the row of a cell or reference, or of its group.
    pub(super) fn row_of(&self, cell: CellRef, model: &NightModel) -> usize {
        self.rows
            .borrow_mut()
            .update(model, &self.filter, self.layout)
            .index_of(cell)
    }
}
