//! What is known about a night, folded from its events. Nothing here draws, and nothing grows with time.

use std::collections::VecDeque;
use std::sync::Arc;

use super::curve::Curve;
use super::eta::{self, Eta};
use super::words;
use crate::experiment::event::Level;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::{CellRef, Event, Outcome, Plan, StopRule, WaveRow};
use crate::film::SharedImage;
use crate::render::OpenStats;

/// Messages that are kept.
pub const MESSAGES: usize = 500;

/// Where a cell or reference stands.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum State {
    /// Its turn has not come.
    #[default]
    Waiting,
    /// It renders.
    Running,
    /// Finished; the text says by which part of its stop rule.
    Done(String),
    /// An earlier night had finished it.
    Cached,
    /// It failed, for this reason.
    Failed(String),
    /// The night ended first.
    Interrupted,
}

/// A cell or reference as the plan pane shows it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Entry {
    /// Where it stands.
    pub state: State,
    /// Its newest measurement.
    pub last: Option<WaveRow>,
}

/// How many cells (or references) there are in each state. The sum is their number.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counts {
    /// Waiting.
    pub waiting: usize,
    /// Running.
    pub running: usize,
    /// Done in this night.
    pub done: usize,
    /// Done by an earlier night.
    pub cached: usize,
    /// Failed.
    pub failed: usize,
    /// Interrupted.
    pub interrupted: usize,
}

impl Counts {
    /// Counts entries by their state.
    pub fn of(entries: &[Entry]) -> Counts {
        let mut counts = Counts::default();
        for entry in entries {
            match entry.state {
                State::Waiting => counts.waiting += 1,
                State::Running => counts.running += 1,
                State::Done(_) => counts.done += 1,
                State::Cached => counts.cached += 1,
                State::Failed(_) => counts.failed += 1,
                State::Interrupted => counts.interrupted += 1,
            }
        }
        counts
    }

    /// Those that need nothing more: done, cached or failed.
    pub fn settled(&self) -> usize {
        self.done + self.cached + self.failed
    }

    /// All of them.
    pub fn total(&self) -> usize {
        self.settled() + self.waiting + self.running + self.interrupted
    }
}

/// A column of the plan pane: an axis whose value differs between cells, or the number of the repeat.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Column {
    /// The axis.
    pub name: String,
    /// Its value in every cell.
    pub values: Vec<String>,
    /// Columns of the terminal that name and values take.
    pub width: usize,
    /// Whether every value is a number, which stands to the right.
    pub numeric: bool,
}

/// The cell that renders, or the one that rendered last.
#[derive(Clone, Debug)]
pub struct Current {
    /// Which.
    pub cell: CellRef,
    /// What opening it cost.
    pub open: OpenStats,
    /// The image it is measured against.
    pub reference: Option<SharedImage>,
    /// The newest picture.
    pub image: Option<SharedImage>,
    /// Its measurements.
    pub curve: Curve,
    /// Seconds spent measuring it so far.
    pub measure_s: f64,
    /// When it was last heard of, in seconds on the listener's clock.
    pub heard_s: f64,
    /// Whether it still renders.
    pub running: bool,
}

/// A message in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Message {
    /// Whole milliseconds on the listener's clock.
    pub at_ms: u64,
    /// Importance.
    pub level: Level,
    /// What it is about and what it says, on one line.
    pub text: String,
}

/// What is known about a night.
#[derive(Clone, Debug, Default)]
pub struct Model {
    /// The plan, once the night has begun.
    pub plan: Option<Arc<Plan>>,
    /// The state of every reference, in the order of the plan.
    pub references: Vec<Entry>,
    /// The state of every cell, in the order of the plan.
    pub cells: Vec<Entry>,
    /// The columns that tell cells apart.
    pub columns: Arc<Vec<Column>>,
    /// The cell that renders or rendered last.
    pub current: Option<Current>,
    /// The last [`MESSAGES`] messages, oldest first.
    pub messages: VecDeque<Message>,
    /// When the night began, in seconds on the listener's clock.
    pub started_s: Option<f64>,
    /// When it ended.
    pub finished_s: Option<f64>,
    /// Number of events heard.
    pub revision: u64,
}

impl Model {
    /// Takes in an event heard at `at_s` seconds on the listener's monotonic clock.
    ///
    /// Events about cells that the plan does not have are ignored, so that no order of events can do harm.
    pub fn hear(&mut self, event: &Event, at_s: f64) {
        self.revision += 1;
        match event {
            Event::NightStarted { plan } => {
                *self = Model {
                    references: vec![Entry::default(); plan.references.len()],
                    cells: vec![Entry::default(); plan.cells.len()],
                    columns: Arc::new(columns(plan)),
                    plan: Some(plan.clone()),
                    started_s: Some(at_s),
                    messages: std::mem::take(&mut self.messages),
                    revision: self.revision,
                    ..Model::default()
                };
            }
            Event::CellStarted { cell, open, reference, resumed } => {
                let Some(entry) = self.entry_mut(*cell) else { return };
                let before = resumed.iter().flat_map(|rows| rows.iter());
                *entry = Entry { state: State::Running, last: before.clone().next_back().cloned() };
                let mut current = Current::new(*cell, at_s);
                current.open = open.clone();
                current.reference = reference.clone();
                before.for_each(|row| current.curve.push(row.clone()));
                self.current = Some(current);
            }
            Event::Wave { cell, row, measure_s, image, pow2: _ } => {
                let Some(entry) = self.entry_mut(*cell) else { return };
                *entry = Entry { state: State::Running, last: Some(row.clone()) };
                let current = match &mut self.current {
                    Some(current) if current.cell == *cell => current,
                    other => other.insert(Current::new(*cell, at_s)),
                };
                current.curve.push(row.clone());
                current.image = Some(image.clone());
                current.measure_s += measure_s;
                current.heard_s = at_s;
                current.running = true;
            }
            Event::Floors { .. } | Event::Halves { .. } | Event::Agreement { .. } => {}
            Event::CellFinished { cell, outcome, film: _, layers: _, rows } => {
                let Some(entry) = self.entry_mut(*cell) else { return };
                entry.state = match outcome {
                    Outcome::Done(reason) => State::Done(words::clean(reason)),
                    Outcome::Cached(_) => State::Cached,
                    Outcome::Failed(reason) => State::Failed(words::clean(reason)),
                    Outcome::Interrupted => State::Interrupted,
                };
                if let Some(row) = rows.last() {
                    entry.last = Some(row.clone());
                }
                if let Some(current) = &mut self.current
                    && current.cell == *cell
                {
                    current.running = false;
                    current.heard_s = at_s;
                }
            }
            Event::Message { level, cell, text } => {
                let about = match (&self.plan, cell) {
                    (Some(plan), Some(cell @ CellRef::Cell(_))) => format!("{}: ", words::cell_name(plan, *cell)),
                    (Some(plan), Some(cell)) => format!("reference {}: ", words::cell_name(plan, *cell)),
                    _ => String::new(),
                };
                if self.messages.len() >= MESSAGES {
                    self.messages.pop_front();
                }
                let text = about + &words::clean(text);
                self.messages.push_back(Message { at_ms: (at_s.max(0.0) * 1e3) as u64, level: *level, text });
            }
            Event::NightFinished => {
                self.finished_s = Some(at_s);
                if let Some(current) = &mut self.current {
                    current.running = false;
                }
            }
        }
    }

    fn entry_mut(&mut self, cell: CellRef) -> Option<&mut Entry> {
        match cell {
            CellRef::Cell(i) => self.cells.get_mut(i),
            CellRef::Reference(i) => self.references.get_mut(i),
        }
    }

    /// The state of a cell or reference.
    pub fn entry(&self, cell: CellRef) -> Option<&Entry> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i),
            CellRef::Reference(i) => self.references.get(i),
        }
    }

    /// When a cell or reference is finished; files have no rule.
    pub fn stop_rule(&self, cell: CellRef) -> Option<&StopRule> {
        let plan = self.plan.as_deref()?;
        match cell {
            CellRef::Cell(i) => plan.cells.get(i).map(|cell| &cell.stop),
            CellRef::Reference(i) => match &plan.references.get(i)?.source {
                ReferenceSource::Render { stop, .. } => Some(stop),
                ReferenceSource::File(_) => None,
            },
        }
    }

    /// Seconds of wall time since the current cell started, at `now_s` on the listener's clock.
    pub fn cell_wall_s(&self, now_s: f64) -> f64 {
        let Some(current) = &self.current else { return 0.0 };
        let measured = current.curve.last().map_or(0.0, |row| row.wall_s);
        if current.running { measured + (now_s - current.heard_s).max(0.0) } else { measured }
    }

    /// Seconds since the night began, at `now_s` on the listener's clock; it stands still once the night is over.
    pub fn night_s(&self, now_s: f64) -> f64 {
        self.started_s.map_or(0.0, |started| (self.finished_s.unwrap_or(now_s) - started).max(0.0))
    }

    /// Wall time that the current cell still needs, as far as its stop rule tells.
    pub fn cell_eta(&self, now_s: f64) -> Option<Eta> {
        let current = self.current.as_ref().filter(|current| current.running)?;
        let row = current.curve.last()?;
        let left = eta::render_left(self.stop_rule(current.cell)?, row)?;
        // Measuring and writing take their share of the wall time beside rendering.
        let overhead = if row.render_s > 0.0 { (row.wall_s / row.render_s).max(1.0) } else { 1.0 };
        let since = (now_s - current.heard_s).max(0.0);
        Some(Eta { seconds: (left.seconds * overhead - since).max(0.0), ..left })
    }

    /// Wall time that the rest of the night needs: for every waiting cell the mean of the cells that were done, or,
    /// before there is one, the limit of its stop rule. `None` where nothing tells.
    pub fn night_eta(&self, now_s: f64) -> Option<Eta> {
        if self.finished_s.is_some() {
            return None;
        }
        self.plan.as_ref()?;
        let means = (mean_wall_s(&self.references), mean_wall_s(&self.cells));
        let mut sum = Eta { seconds: 0.0, at_most: false };
        let references = (0..self.references.len()).map(CellRef::Reference);
        for cell in references.chain((0..self.cells.len()).map(CellRef::Cell)) {
            let mean = if let CellRef::Reference(_) = cell { means.0 } else { means.1 };
            let left = match self.entry(cell)?.state {
                State::Waiting => match (mean, self.stop_rule(cell)) {
                    (_, None) => Eta { seconds: 0.0, at_most: false },
                    (Some(seconds), _) => Eta { seconds, at_most: false },
                    (None, Some(rule)) => eta::render_left(rule, &WaveRow::default())?,
                },
                State::Running if self.current.as_ref().is_some_and(|c| c.cell == cell) => {
                    let spent = self.cell_wall_s(now_s);
                    let by_mean = mean.map(|mean| Eta { seconds: (mean - spent).max(0.0), at_most: false });
                    self.cell_eta(now_s).or(by_mean)?
                }
                _ => continue,
            };
            sum = Eta { seconds: sum.seconds + left.seconds, at_most: sum.at_most || left.at_most };
        }
        Some(sum)
    }

    /// Invalid (NaN or infinite) samples of all runs of this night.
    pub fn invalid(&self) -> u64 {
        self.references.iter().chain(&self.cells).filter_map(|e| e.last.as_ref()).map(|row| row.invalid).sum()
    }
}

impl Current {
    fn new(cell: CellRef, at_s: f64) -> Current {
        Current {
            cell,
            open: OpenStats::default(),
            reference: None,
            image: None,
            curve: Curve::default(),
            measure_s: 0.0,
            heard_s: at_s,
            running: true,
        }
    }
}

fn mean_wall_s(entries: &[Entry]) -> Option<f64> {
    let done = entries.iter().filter(|e| matches!(e.state, State::Done(_))).filter_map(|e| e.last.as_ref());
    let (sum, n) = done.fold((0.0, 0u32), |(sum, n), row| (sum + row.wall_s, n + 1));
    (n > 0).then(|| sum / f64::from(n))
}

/// The axes whose values differ between cells, and the repeat if there are several.
fn columns(plan: &Plan) -> Vec<Column> {
    let mut columns = Vec::new();
    for (i, axis) in plan.axes.iter().enumerate() {
        let at = |cell: &crate::experiment::Cell| cell.point.get(i).map(|(_, value)| value.clone());
        let first = plan.cells.first().and_then(at);
        if plan.cells.iter().any(|cell| at(cell) != first) {
            let values = plan.cells.iter().map(|c| at(c).map_or_else(String::new, |v| words::clean(&v.to_string())));
            let numeric = plan.cells.iter().all(|cell| at(cell).is_some_and(|v| v.as_f64().is_some()));
            columns.push(Column::new(axis, values.collect(), numeric));
        }
    }
    if plan.cells.iter().any(|cell| cell.repeat > 0) {
        columns.push(Column::new("rep", plan.cells.iter().map(|cell| cell.repeat.to_string()).collect(), true));
    }
    columns
}

impl Column {
    fn new(name: &str, values: Vec<String>, numeric: bool) -> Column {
        let width = values.iter().map(|v| words::width(v)).chain([words::width(name)]).max().unwrap_or(0);
        Column { name: name.to_owned(), values, width, numeric }
    }
}
