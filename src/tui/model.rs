//! What is known about a night, folded from its events. Nothing here draws, and nothing grows with time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::column::{Column, columns};
use super::curve::Curve;
use super::entry::{Entry, State, mean_wall_s};
use super::eta::{self, Eta};
use super::reel::Reel;
use super::thumbs::{Thumb, Thumbs};
use super::words;
use super::workers::WorkerLine;
use crate::experiment::event::Level;
use crate::experiment::forecast::Forecast;
use crate::experiment::{CellConfig, CellRef, Event, Outcome, Outline, StopRule, WaveRow};
use crate::film::SharedImage;
use crate::film::layer::LayerImage;
use crate::render::OpenStats;

/// Messages that are kept.
pub const MESSAGES: usize = 500;
/// Finished cells whose curves are kept beside the current one.
pub const PAST: usize = 6;

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
    /// What it renders, where the plan does not know.
    pub config: Option<Arc<CellConfig>>,
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
    pub plan: Option<Arc<Outline>>,
    /// The state of every reference, in the order of the plan.
    pub references: Vec<Entry>,
    /// The state of every cell, in the order of the plan.
    pub cells: Vec<Entry>,
    /// The columns that tell cells apart.
    pub columns: Arc<Vec<Column>>,
    /// The cell that renders or rendered last; of cells that take turns, the first that is not done.
    pub current: Option<Current>,
    /// The others with which it takes turns.
    pub rivals: BTreeMap<CellRef, Current>,
    /// For every reference whose noise is known, what it leaves of each metric to be measured.
    pub floors: BTreeMap<usize, Arc<Vec<Option<f64>>>>,
    /// The references that a second technique contradicts.
    pub contradicted: BTreeSet<usize>,
    /// The curves of the last [`PAST`] cells that ended after measuring, oldest first.
    pub past: VecDeque<(CellRef, Arc<Curve>)>,
    /// The films by strategy of the last cell that kept them.
    pub thumbs: Option<Arc<Thumbs>>,
    /// Light by time: of the current cell, or of the last that had it.
    pub reel: Option<Arc<Reel>>,
    /// The workers that take part and have not left, where there are several.
    pub workers: Arc<Vec<WorkerLine>>,
    /// The last [`MESSAGES`] messages, oldest first.
    pub messages: VecDeque<Message>,
    /// When the night began, in seconds on the listener's clock.
    pub started_s: Option<f64>,
    /// When it ended.
    pub finished_s: Option<f64>,
    /// What was left of the night when it was reckoned last, and when that was.
    pub forecast: Option<(Forecast, f64)>,
    /// When anything was heard last.
    pub heard_s: f64,
    /// Number of events heard.
    pub revision: u64,
}

impl Model {
    /// Takes in an event heard at `at_s` seconds on the listener's monotonic clock.
    ///
    /// Events about cells that the plan does not have are ignored, so that no order of events can do harm.
    pub fn hear(&mut self, event: &Event, at_s: f64) {
        match event {
            Event::NightStarted { plan } => self.begin(Arc::new(Outline::of(plan)), at_s),
            Event::CellStarted { cell, open, reference, resumed } => {
                self.start(*cell, open.clone(), reference.clone(), at_s);
                // What an earlier process measured of it.
                for row in resumed.iter().flat_map(|rows| rows.iter()) {
                    self.wave(*cell, row, 0.0, at_s);
                }
            }
            Event::Wave { cell, row, measure_s, image, pow2: _ } => {
                self.wave(*cell, row, *measure_s, at_s);
                self.picture(*cell, image.clone());
            }
            Event::Floors { reference, floors } => self.floor(*reference, Arc::clone(floors)),
            // Winding a reel takes a while; whoever hears the event does it first and hands it to `wound`.
            Event::Times { .. } | Event::Halves { .. } => {}
            Event::Agreement { reference, found, .. } => self.compared(*reference, found.agrees()),
            Event::CellFinished { cell, outcome, film: _, layers, times: _, rows } => {
                self.finish(*cell, outcome, rows.last(), at_s);
                self.layers(*cell, layers);
            }
            Event::Message { level, cell, text } => self.say(*level, *cell, text, at_s),
            Event::Forecast(left) => self.foretold(*left, at_s),
            Event::NightFinished => self.end(at_s),
        }
    }

    /// A night begins. Messages from before stay.
    pub fn begin(&mut self, plan: Arc<Outline>, at_s: f64) {
        *self = Model {
            references: vec![Entry::default(); plan.references.len()],
            cells: vec![Entry::default(); plan.cells.len()],
            columns: Arc::new(columns(&plan)),
            plan: Some(plan),
            started_s: Some(at_s),
            messages: std::mem::take(&mut self.messages),
            revision: self.revision + 1,
            heard_s: at_s,
            ..Model::default()
        };
    }

    /// Another night begins in the same folder: what the one before had done is there, the rest is open again.
    pub fn begin_again(&mut self, at_s: f64) {
        self.heard(at_s);
        for entry in self.references.iter_mut().chain(&mut self.cells) {
            entry.state = match entry.state {
                State::Done(_) | State::Cached => State::Cached,
                _ => State::Waiting,
            };
        }
        (self.started_s, self.finished_s, self.forecast) = (Some(at_s), None, None);
        self.rivals.clear();
        if let Some(current) = &mut self.current {
            current.running = false;
        }
    }

    /// A cell opens, for the first time or once more.
    pub fn start(&mut self, cell: CellRef, open: OpenStats, reference: Option<SharedImage>, at_s: f64) {
        self.heard(at_s);
        let Some(entry) = self.entry_mut(cell) else { return };
        *entry = Entry { state: State::Running, last: None };
        let new = Current { open, reference, ..Current::new(cell, at_s) };
        match &self.current {
            Some(current) if current.running && current.cell != cell => {
                self.rivals.insert(cell, new);
            }
            _ => self.current = Some(new),
        }
    }

    /// A cell that renders, be it the one at hand or a rival; what was not known to have started is at hand.
    fn live(&mut self, cell: CellRef, at_s: f64) -> &mut Current {
        if self.rivals.contains_key(&cell) {
            return self.rivals.entry(cell).or_insert_with(|| Current::new(cell, at_s));
        }
        match &mut self.current {
            Some(current) if current.cell == cell => {}
            other => *other = Some(Current::new(cell, at_s)),
        }
        self.current.get_or_insert_with(|| Current::new(cell, at_s))
    }

    /// A cell renders beside the current one.
    pub fn underway(&mut self, cell: CellRef, at_s: f64) {
        self.heard(at_s);
        if let Some(entry) = self.entry_mut(cell) {
            entry.state = State::Running;
        }
    }

    /// Who takes part.
    pub fn crew(&mut self, workers: Vec<WorkerLine>) {
        self.revision += 1;
        self.workers = Arc::new(workers);
    }

    /// A cell was measured.
    pub fn wave(&mut self, cell: CellRef, row: &WaveRow, measure_s: f64, at_s: f64) {
        self.heard(at_s);
        let row = Arc::new(row.clone());
        let Some(entry) = self.entry_mut(cell) else { return };
        *entry = Entry { state: State::Running, last: Some(Arc::clone(&row)) };
        let current = self.live(cell, at_s);
        current.curve.push(row);
        current.measure_s += measure_s;
        current.heard_s = at_s;
        current.running = true;
    }

    /// There is a newer picture of the current cell.
    pub fn picture(&mut self, cell: CellRef, image: SharedImage) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        if let Some(current) = current.or(self.rivals.get_mut(&cell)) {
            current.image = Some(image);
        }
    }

    /// A cell ended; `last` is its last measurement.
    pub fn finish(&mut self, cell: CellRef, outcome: &Outcome, last: Option<&WaveRow>, at_s: f64) {
        self.heard(at_s);
        let Some(entry) = self.entry_mut(cell) else { return };
        entry.state = State::from(outcome);
        if let Some(row) = last {
            entry.last = Some(Arc::new(row.clone()));
        }
        let (level, text) = ended(outcome, last);
        if let Some(text) = text {
            self.note(level, Some(cell), &text, at_s);
        }
        let ended = match self.rivals.remove(&cell) {
            Some(rival) => Some(rival.curve),
            None => self.current.as_mut().filter(|current| current.cell == cell).map(|current| {
                current.running = false;
                current.heard_s = at_s;
                current.curve.thinned()
            }),
        };
        if let Some(curve) = ended.filter(|curve| curve.last().is_some_and(|row| !row.metrics.is_empty())) {
            self.past.retain(|(other, _)| *other != cell);
            if self.past.len() >= PAST {
                self.past.pop_front();
            }
            self.past.push_back((cell, Arc::new(curve.thinned())));
        }
        if self.current.as_ref().is_some_and(|current| !current.running)
            && let Some((_, next)) = self.rivals.pop_first()
        {
            self.current = Some(next);
        }
    }

    /// The noise of a reference is known: no picture can be measured to be better than these values, in the order of the
    /// plan's metrics.
    pub fn floor(&mut self, reference: usize, floors: Arc<Vec<Option<f64>>>) {
        self.revision += 1;
        self.floors.insert(reference, floors);
    }

    /// A reference was compared with the same picture by a second technique.
    pub fn compared(&mut self, reference: usize, agrees: bool) {
        self.revision += 1;
        match agrees {
            true => self.contradicted.remove(&reference),
            false => self.contradicted.insert(reference),
        };
    }

    /// What the noise of the current cell's reference leaves of a metric to be measured, where it is known.
    pub fn floor_of(&self, metric: usize) -> Option<f64> {
        let CellRef::Cell(i) = self.current.as_ref()?.cell else { return None };
        let reference = self.plan.as_ref()?.cells.get(i)?.reference?;
        self.floors.get(&reference)?.get(metric).copied().flatten()
    }

    /// What the current cell renders, for a reader whose plan does not say it.
    pub fn configured(&mut self, cell: CellRef, config: Arc<CellConfig>) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        if let Some(current) = current.or(self.rivals.get_mut(&cell)) {
            current.config = Some(config);
        }
    }

    /// One more film of a strategy of a cell.
    pub fn strategy(&mut self, cell: CellRef, thumb: Thumb) {
        self.revision += 1;
        let mut thumbs = match self.thumbs.take() {
            Some(thumbs) if thumbs.cell == cell => thumbs,
            _ => Arc::new(Thumbs { cell, films: Vec::new() }),
        };
        Arc::make_mut(&mut thumbs).films.push(thumb);
        self.thumbs = Some(thumbs);
    }

    /// A cell kept films; those of its strategies are remembered as small pictures.
    pub fn layers(&mut self, cell: CellRef, layers: &[LayerImage]) {
        if let Some(thumbs) = Thumbs::of(cell, layers) {
            self.thumbs = Some(Arc::new(thumbs));
        }
    }

    /// There is light by time of a cell. Of cells that take turns, that of the one at hand is kept.
    pub fn wound(&mut self, reel: Reel) {
        let at_hand = self.current.as_ref().filter(|current| current.running).map(|current| current.cell);
        let shown = self.reel.as_ref().map(|reel| reel.cell);
        if Some(reel.cell) == at_hand || shown != at_hand || at_hand.is_none() {
            self.revision += 1;
            self.reel = Some(Arc::new(reel));
        }
    }

    /// Something is said, about a cell or the night.
    pub fn say(&mut self, level: Level, cell: Option<CellRef>, text: &str, at_s: f64) {
        self.heard(at_s);
        self.note(level, cell, text, at_s);
    }

    /// Adds a line to the log.
    fn note(&mut self, level: Level, cell: Option<CellRef>, text: &str, at_s: f64) {
        let about = match (&self.plan, cell) {
            (Some(plan), Some(cell @ CellRef::Cell(_))) => format!("{}: ", words::cell_name(plan, cell)),
            (Some(plan), Some(cell)) => format!("reference {}: ", words::cell_name(plan, cell)),
            _ => String::new(),
        };
        if self.messages.len() >= MESSAGES {
            self.messages.pop_front();
        }
        let text = about + &words::clean(text);
        self.messages.push_back(Message { at_ms: (at_s.max(0.0) * 1e3) as u64, level, text });
    }

    /// What is left of the night was reckoned.
    pub fn foretold(&mut self, left: Forecast, at_s: f64) {
        self.heard(at_s);
        self.forecast = Some((left, at_s));
    }

    /// The night is over.
    pub fn end(&mut self, at_s: f64) {
        self.heard(at_s);
        self.finished_s = Some(at_s);
        self.rivals.clear();
        if let Some(current) = &mut self.current {
            current.running = false;
        }
    }

    fn heard(&mut self, at_s: f64) {
        self.revision += 1;
        self.heard_s = self.heard_s.max(at_s);
    }

    fn entry_mut(&mut self, cell: CellRef) -> Option<&mut Entry> {
        match cell {
            CellRef::Cell(i) => self.cells.get_mut(i),
            CellRef::Reference(i) => self.references.get_mut(i),
        }
    }

    /// What a cell or reference renders, where it is known.
    pub fn config(&self, cell: CellRef) -> Option<&CellConfig> {
        let current = self.current.as_ref().filter(|current| current.cell == cell);
        let known = current.and_then(|current| current.config.as_ref());
        known.or_else(|| self.plan.as_ref()?.config(cell)).map(Arc::as_ref)
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
        Some(&self.plan.as_deref()?.until(cell)?.rule)
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
        let metrics = self.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
        let fits = |column: &str| eta::fit(&current.curve, metrics, column);
        let left = eta::render_left(self.stop_rule(current.cell)?, row, &fits)?;
        // Measuring and writing take their share of the wall time beside rendering.
        let overhead = if row.render_s > 0.0 { (row.wall_s / row.render_s).max(1.0) } else { 1.0 };
        let since = (now_s - current.heard_s).max(0.0);
        Some(Eta { seconds: (left.seconds * overhead - since).max(0.0), ..left })
    }

    /// Wall time that the rest of the night needs: what was reckoned of it, less what has gone by since; or, where that
    /// was not told or does not know every run, for every waiting cell the mean of the cells that were done, or,
    /// before there is one, the limit of its stop rule. `None` where nothing tells.
    pub fn night_eta(&self, now_s: f64) -> Option<Eta> {
        if self.finished_s.is_some() {
            return None;
        }
        self.plan.as_ref()?;
        if let Some((left, at_s)) = self.forecast.filter(|(left, _)| left.unknown == 0 && left.known > 0) {
            let seconds = (left.seconds - (now_s - at_s)).max(0.0);
            return Some(Eta { seconds, at_most: left.at_most, forecast: left.rough });
        }
        let means = (mean_wall_s(&self.references), mean_wall_s(&self.cells));
        let mut sum = Eta::default();
        let references = (0..self.references.len()).map(CellRef::Reference);
        for cell in references.chain((0..self.cells.len()).map(CellRef::Cell)) {
            let mean = if let CellRef::Reference(_) = cell { means.0 } else { means.1 };
            let left = match self.entry(cell)?.state {
                State::Waiting => match (mean, self.stop_rule(cell)) {
                    (_, None) => Eta::default(),
                    (Some(seconds), _) => Eta { seconds, ..Eta::default() },
                    (None, Some(rule)) => eta::render_left(rule, &WaveRow::default(), &|_| None)?,
                },
                State::Running if self.current.as_ref().is_some_and(|c| c.cell == cell) => {
                    let spent = self.cell_wall_s(now_s);
                    let by_mean = mean.map(|mean| Eta { seconds: (mean - spent).max(0.0), ..Eta::default() });
                    self.cell_eta(now_s).or(by_mean)?
                }
                _ => continue,
            };
            sum = sum.then(left);
        }
        Some(sum)
    }

    /// Invalid (NaN or infinite) samples of all runs of this night.
    pub fn invalid(&self) -> u64 {
        self.references.iter().chain(&self.cells).filter_map(|e| e.last.as_ref()).map(|row| row.invalid).sum()
    }
}

/// How an end reads in the log; what was there before is no news.
fn ended(outcome: &Outcome, last: Option<&WaveRow>) -> (Level, Option<String>) {
    let far = last.map_or_else(String::new, |row| {
        format!(" after {} spp, {}", words::count(row.samples), words::duration(row.render_s))
    });
    match outcome {
        Outcome::Done(reason) => (Level::Info, Some(format!("done{far}: {reason}"))),
        Outcome::Failed(reason) => (Level::Error, Some(format!("failed{far}: {reason}"))),
        Outcome::Interrupted => (Level::Warn, Some(format!("interrupted{far}"))),
        Outcome::Cached(_) => (Level::Info, None),
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
            config: None,
        }
    }
}
