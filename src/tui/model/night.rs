//! State of a night, folded from its events. Nothing here draws, and memory does not grow with
//! time.

use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::sync::Arc;

use super::column::{Column, columns};
use super::comparison::Comparison;
use super::curve::Curve;
use super::end_message::end_message;
use super::entry::{EntryState, PlanEntry};
use super::strategy_thumbnails::{StrategyThumbnail, StrategyThumbnails};
use super::time_preview::TimePreview;
use super::worker_list::WorkerLine;
use crate::experiment::forecast::Forecast;
use crate::experiment::outcome::Level;
use crate::experiment::shards::Shard;
use crate::experiment::{CellRef, Event, Outcome, PlanOutline, StopRule, WaveRow};
use crate::tui::format;
use lumbre_light::film::SharedImage;
use lumbre_light::film::layer::LayerImage;
use lumbre_render::Settings;
use lumbre_render::{Device, OpenStats};

/// Number of log messages that are stored.
pub const MESSAGES: usize = 500;
/// Number of finished cells whose curves are stored beside the current one.
pub const PAST: usize = 16;

/// State of a run that renders, or of the one that rendered last.
#[derive(Clone, Debug)]
pub struct CurrentRun {
    /// Cell or reference that is rendered.
    pub cell: CellRef,
    /// Cost of opening it: device, acceleration structure and build time.
    pub open: OpenStats,
    /// Reference image that it is measured against.
    pub reference: Option<SharedImage>,
    /// Newest picture of the run.
    pub image: Option<SharedImage>,
    /// Its measurements so far.
    pub curve: Curve,
    /// Relative noise of a reference after each of its measurements, oldest first, thinned like a
    /// curve; empty for cells.
    pub noise: Curve,
    /// Seconds spent measuring it so far.
    pub measure_s: f64,
    /// Time of its last event, in seconds on the receiver's clock.
    pub updated_s: f64,
    /// Whether it is still rendering.
    pub running: bool,
    /// Configuration, if the plan does not contain it.
    pub config: Option<Arc<Settings>>,
}

/// A message in the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogMessage {
    /// Time in whole milliseconds on the receiver's clock.
    pub at_ms: u64,
    /// Severity of the message.
    pub level: Level,
    /// The message, prefixed by the cell it concerns, on one line.
    pub text: String,
}

/// Everything that the dashboard shows of a night.
#[derive(Clone, Debug, Default)]
pub struct NightModel {
    /// The plan, once the night has begun.
    pub plan: Option<Arc<PlanOutline>>,
    /// State of every reference, in plan order.
    pub references: Vec<PlanEntry>,
    /// State of every cell, in plan order.
    pub cells: Vec<PlanEntry>,
    /// Columns that distinguish cells from each other.
    pub columns: Arc<Vec<Column>>,
    /// Selection of the cells that the chart compares; `None` if no axis varies.
    pub comparison: Option<Arc<Comparison>>,
    /// The run that renders or rendered last; among interleaved runs, the first that is not done.
    pub current: Option<CurrentRun>,
    /// Other runs that are interleaved with the current one.
    pub interleaved: BTreeMap<CellRef, CurrentRun>,
    /// For every sharded reference: the indices of its finished shards, and the number of shards.
    pub shards: BTreeMap<usize, (BTreeSet<usize>, usize)>,
    /// For every reference with a known noise floor: its contribution to each metric.
    pub noise_floors: BTreeMap<usize, Arc<Vec<Option<f64>>>>,
    /// References whose bias check failed: a second technique disagrees beyond noise.
    pub contradicted: BTreeSet<usize>,
    /// Curves of the last [`PAST`] cells that ended with measurements, oldest first.
    pub past_curves: VecDeque<(CellRef, Arc<Curve>)>,
    /// Thumbnails of the last cell that stored per-strategy films.
    pub thumbnails: Option<Arc<StrategyThumbnails>>,
    /// Time-resolved film of the current cell, or of the last cell that had one.
    pub time_preview: Option<Arc<TimePreview>>,
    /// Active workers, if finished are several.
    pub workers: Arc<Vec<WorkerLine>>,
    /// The last [`MESSAGES`] messages, oldest first.
    pub messages: VecDeque<LogMessage>,
    /// Start of the night, in seconds on the receiver's clock.
    pub started_s: Option<f64>,
    /// End of the night, in seconds on the receiver's clock.
    pub finished_s: Option<f64>,
    /// Latest forecast of the remaining time, and when it was made.
    pub forecast: Option<(Forecast, f64)>,
    /// Time of the latest event.
    pub updated_s: f64,
    /// Number of events received.
    pub revision: u64,
}

impl NightModel {
    /// Returns the devices of the current run; none before the first.
    pub fn devices(&self) -> &[Device] {
        let current = self.current.as_ref();
        current.map_or(&[], |current| &current.open.devices)
    }

    /// Applies an event received at `at_s` seconds on the receiver's monotonic clock.
    ///
    /// Events about cells that are not in the plan are ignored, so any order of events is safe.
    pub fn receive(&mut self, event: &Event, at_s: f64) {
        match event {
            Event::NightStarted { plan } => {
                self.begin_night(Arc::new(PlanOutline::from_plan(plan)), at_s)
            }
            Event::CellStarted {
                cell,
                open,
                reference,
                resumed,
            } => {
                self.start_run(*cell, open.clone(), reference.clone(), at_s);
                // Measurements by an earlier process.
                for row in resumed.iter().flat_map(|rows| rows.iter()) {
                    self.add_wave(*cell, row, 0.0, at_s);
                }
            }
            Event::Wave {
                cell,
                row,
                measure_s,
                image,
                noise,
                pow2: _,
            } => {
                self.add_wave(*cell, row, *measure_s, at_s);
                self.set_image(*cell, image.clone());
                self.add_noise(*cell, row, *noise);
            }
            Event::NoiseFloors { reference, floors } => {
                self.set_noise_floors(*reference, Arc::clone(floors))
            }
            Event::ShardStarted { shard, open, .. } => self.start_shard(shard, open.clone(), at_s),
            Event::ShardFinished { shard, outcome, .. } => {
                let done = matches!(outcome, Outcome::Done(_));
                let finished = done.then_some(shard.number);
                self.update_shards(shard.reference, finished, shard.count, at_s);
            }
            // Building a time preview is slow; the caller does it before locking the model and then
            // calls `set_time_preview`.
            Event::Times { .. } | Event::Halves { .. } => {}
            Event::BiasCheck {
                reference, found, ..
            } => self.set_bias_check(*reference, found.agrees()),
            Event::CellFinished {
                cell,
                outcome,
                film: _,
                denoised: _,
                layers,
                times: _,
                rows,
            } => {
                self.finish_run(*cell, outcome, rows.last(), at_s);
                self.set_strategy_thumbnails(*cell, layers);
            }
            Event::Message { level, cell, text } => self.log(*level, *cell, text, at_s),
            Event::Forecast(left) => self.set_forecast(*left, at_s),
            Event::NightFinished => self.end_night(at_s),
        }
    }

    /// Begins a night. Earlier messages are kept.
    pub fn begin_night(&mut self, plan: Arc<PlanOutline>, at_s: f64) {
        let columns = columns(&plan);
        *self = NightModel {
            references: vec![PlanEntry::default(); plan.references.len()],
            cells: vec![PlanEntry::default(); plan.cells.len()],
            comparison: Comparison::new(&plan, &columns).map(Arc::new),
            columns: Arc::new(columns),
            plan: Some(plan),
            started_s: Some(at_s),
            messages: std::mem::take(&mut self.messages),
            revision: self.revision + 1,
            updated_s: at_s,
            ..NightModel::default()
        };
    }

    /// Begins another night in the same folder: finished runs become cached, all others wait.
    pub fn begin_next_night(&mut self, at_s: f64) {
        self.touch(at_s);
        for entry in self.references.iter_mut().chain(&mut self.cells) {
            entry.state = match entry.state {
                EntryState::Done(_) | EntryState::Cached => EntryState::Cached,
                _ => EntryState::Waiting,
            };
        }
        (self.started_s, self.finished_s, self.forecast) = (Some(at_s), None, None);
        self.interleaved.clear();
        if let Some(current) = &mut self.current {
            current.running = false;
        }
    }

    /// Marks a run as opened, for the first time or after a restart.
    pub fn start_run(
        &mut self,
        cell: CellRef,
        open: OpenStats,
        reference: Option<SharedImage>,
        at_s: f64,
    ) {
        self.touch(at_s);
        let Some(entry) = self.entry_mut(cell) else {
            return;
        };
        *entry = PlanEntry {
            state: EntryState::Running,
            last: None,
        };
        let new = CurrentRun {
            open,
            reference,
            ..CurrentRun::new(cell, at_s)
        };
        match &self.current {
            Some(current) if current.running && current.cell != cell => {
                self.interleaved.insert(cell, new);
            }
            _ => self.current = Some(new),
        }
    }

    /// Marks a reference as running because one of its shards has been opened.
    fn start_shard(&mut self, shard: &Shard, open: OpenStats, at_s: f64) {
        self.count_shards(shard.reference, None, shard.count);
        self.start_run(CellRef::Reference(shard.reference), open, None, at_s);
    }

    /// Returns the state of a run that renders: the current one or an interleaved one. A run that
    /// was not known to have started becomes the current one.
    fn running_mut(&mut self, cell: CellRef, at_s: f64) -> &mut CurrentRun {
        if self.interleaved.contains_key(&cell) {
            return self
                .interleaved
                .entry(cell)
                .or_insert_with(|| CurrentRun::new(cell, at_s));
        }
        match &mut self.current {
            Some(current) if current.cell == cell => {}
            other => *other = Some(CurrentRun::new(cell, at_s)),
        }
        self.current
            .get_or_insert_with(|| CurrentRun::new(cell, at_s))
    }

    /// Marks a run that renders beside the current one.
    pub fn mark_running(&mut self, cell: CellRef, at_s: f64) {
        self.touch(at_s);
        if let Some(entry) = self.entry_mut(cell) {
            entry.state = EntryState::Running;
        }
    }

    /// Replaces the list of workers.
    pub fn set_workers(&mut self, workers: Vec<WorkerLine>) {
        self.revision += 1;
        self.workers = Arc::new(workers);
    }

    /// Adds a measurement of a run.
    pub fn add_wave(&mut self, cell: CellRef, row: &WaveRow, measure_s: f64, at_s: f64) {
        self.touch(at_s);
        let row = Arc::new(row.clone());
        let Some(entry) = self.entry_mut(cell) else {
            return;
        };
        *entry = PlanEntry {
            state: EntryState::Running,
            last: Some(Arc::clone(&row)),
        };
        let current = self.running_mut(cell, at_s);
        current.curve.push(row);
        current.measure_s += measure_s;
        current.updated_s = at_s;
        current.running = true;
    }

    /// Adds the relative noise of a reference after a measurement, if it is known.
    fn add_noise(&mut self, cell: CellRef, row: &WaveRow, noise: Option<f64>) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        let run = current.or(self.interleaved.get_mut(&cell));
        if let (Some(run), Some(noise)) = (run, noise) {
            run.noise.push(Arc::new(WaveRow {
                metrics: vec![noise],
                ..row.clone()
            }));
        }
    }

    /// Replaces the picture of a run that renders.
    pub fn set_image(&mut self, cell: CellRef, image: SharedImage) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        if let Some(current) = current.or(self.interleaved.get_mut(&cell)) {
            current.image = Some(image);
        }
    }

    /// Marks a run as ended; `last` is its last measurement.
    pub fn finish_run(
        &mut self,
        cell: CellRef,
        outcome: &Outcome,
        last: Option<&WaveRow>,
        at_s: f64,
    ) {
        self.touch(at_s);
        let Some(entry) = self.entry_mut(cell) else {
            return;
        };
        entry.state = EntryState::from(outcome);
        if let Some(row) = last {
            entry.last = Some(Arc::new(row.clone()));
        }
        let (level, text) = end_message(outcome, last);
        if let Some(text) = text {
            self.append_message(level, Some(cell), &text, at_s);
        }
        let ended = match self.interleaved.remove(&cell) {
            Some(rival) => Some(rival.curve),
            None => self
                .current
                .as_mut()
                .filter(|current| current.cell == cell)
                .map(|current| {
                    current.running = false;
                    current.updated_s = at_s;
                    current.curve.thinned()
                }),
        };
        if let Some(curve) =
            ended.filter(|curve| curve.last().is_some_and(|row| !row.metrics.is_empty()))
        {
            self.past_curves.retain(|(other, _)| *other != cell);
            if self.past_curves.len() >= PAST {
                self.past_curves.pop_front();
            }
            self.past_curves
                .push_back((cell, Arc::new(curve.thinned())));
        }
        if self
            .current
            .as_ref()
            .is_some_and(|current| !current.running)
            && let Some((_, next)) = self.interleaved.pop_first()
        {
            self.current = Some(next);
        }
    }

    /// Updates a sharded reference after a shard ended. `finished` is the index of the shard if it
    /// is complete; `count` is the number of shards.
    pub fn update_shards(
        &mut self,
        reference: usize,
        finished: Option<usize>,
        count: usize,
        at_s: f64,
    ) {
        self.touch(at_s);
        let cell = CellRef::Reference(reference);
        let Some(entry) = self.entry_mut(cell) else {
            return;
        };
        if entry.state == EntryState::Running {
            *entry = PlanEntry::default();
        }
        self.count_shards(reference, finished, count);
        if let Some(current) = self.current.as_mut().filter(|current| current.cell == cell) {
            current.running = false;
        }
    }

    fn count_shards(&mut self, reference: usize, finished: Option<usize>, count: usize) {
        if reference < self.references.len() {
            let shards = self.shards.entry(reference).or_default();
            shards.0.extend(finished);
            shards.1 = count;
        }
    }

    /// Number of finished shards and of all shards of a reference, until the reference has ended.
    pub fn shard_progress(&self, cell: CellRef) -> Option<(usize, usize)> {
        let CellRef::Reference(i) = cell else {
            return None;
        };
        let open = |entry: &&PlanEntry| {
            matches!(
                entry.state,
                EntryState::Waiting | EntryState::Running | EntryState::Interrupted
            )
        };
        self.entry(cell).filter(open)?;
        self.shards
            .get(&i)
            .map(|(done, count)| (done.len(), *count))
    }

    /// Sets the noise floor of a reference: the smallest value that each metric of the plan can be
    /// measured to have against it.
    pub fn set_noise_floors(&mut self, reference: usize, floors: Arc<Vec<Option<f64>>>) {
        self.revision += 1;
        self.noise_floors.insert(reference, floors);
    }

    /// Records whether a reference agrees with the same picture rendered by a second technique.
    pub fn set_bias_check(&mut self, reference: usize, agrees: bool) {
        self.revision += 1;
        match agrees {
            true => self.contradicted.remove(&reference),
            false => self.contradicted.insert(reference),
        };
    }

    /// Noise floor of a metric for the reference of the current cell, if known.
    pub fn noise_floor(&self, metric: usize) -> Option<f64> {
        let CellRef::Cell(i) = self.current.as_ref()?.cell else {
            return None;
        };
        let reference = self.plan.as_ref()?.cells.get(i)?.reference?;
        self.noise_floors
            .get(&reference)?
            .get(metric)
            .copied()
            .flatten()
    }

    /// Sets the configuration of a run, for readers whose plan does not contain it.
    pub fn set_config(&mut self, cell: CellRef, config: Arc<Settings>) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        if let Some(current) = current.or(self.interleaved.get_mut(&cell)) {
            current.config = Some(config);
        }
    }

    /// Adds the thumbnail of one strategy of a cell.
    pub fn add_strategy_thumbnail(&mut self, cell: CellRef, thumb: StrategyThumbnail) {
        self.revision += 1;
        let mut thumbnails = match self.thumbnails.take() {
            Some(thumbnails) if thumbnails.cell == cell => thumbnails,
            _ => Arc::new(StrategyThumbnails {
                cell,
                films: Vec::new(),
            }),
        };
        Arc::make_mut(&mut thumbnails).films.push(thumb);
        self.thumbnails = Some(thumbnails);
    }

    /// Reduces and stores the per-strategy films among the layers of a cell.
    pub fn set_strategy_thumbnails(&mut self, cell: CellRef, layers: &[LayerImage]) {
        if let Some(thumbnails) = StrategyThumbnails::from_layers(cell, layers) {
            self.thumbnails = Some(Arc::new(thumbnails));
        }
    }

    /// Stores the time-resolved film of a run. Among interleaved runs, that of the current one is
    /// shown.
    pub fn set_time_preview(&mut self, time_preview: TimePreview) {
        let current = self
            .current
            .as_ref()
            .filter(|current| current.running)
            .map(|current| current.cell);
        let shown = self
            .time_preview
            .as_ref()
            .map(|time_preview| time_preview.cell);
        if Some(time_preview.cell) == current || shown != current || current.is_none() {
            self.revision += 1;
            self.time_preview = Some(Arc::new(time_preview));
        }
    }

    /// Appends a message to the log, about a run or about the night.
    pub fn log(&mut self, level: Level, cell: Option<CellRef>, text: &str, at_s: f64) {
        self.touch(at_s);
        self.append_message(level, cell, text, at_s);
    }

    /// Appends a line to the log.
    fn append_message(&mut self, level: Level, cell: Option<CellRef>, text: &str, at_s: f64) {
        let about = match (&self.plan, cell) {
            (Some(plan), Some(cell @ CellRef::Cell(_))) => {
                format!("{}: ", format::cell_name(plan, cell))
            }
            (Some(plan), Some(cell)) => format!("reference {}: ", format::cell_name(plan, cell)),
            _ => String::new(),
        };
        if self.messages.len() >= MESSAGES {
            self.messages.pop_front();
        }
        let text = about + &format::clean(text);
        self.messages.push_back(LogMessage {
            at_ms: (at_s.max(0.0) * 1e3) as u64,
            level,
            text,
        });
    }

    /// Stores a forecast of the remaining time.
    pub fn set_forecast(&mut self, left: Forecast, at_s: f64) {
        self.touch(at_s);
        self.forecast = Some((left, at_s));
    }

    /// Marks the night as ended.
    pub fn end_night(&mut self, at_s: f64) {
        self.touch(at_s);
        self.finished_s = Some(at_s);
        self.interleaved.clear();
        if let Some(current) = &mut self.current {
            current.running = false;
        }
    }

    fn touch(&mut self, at_s: f64) {
        self.revision += 1;
        self.updated_s = self.updated_s.max(at_s);
    }

    fn entry_mut(&mut self, cell: CellRef) -> Option<&mut PlanEntry> {
        match cell {
            CellRef::Cell(i) => self.cells.get_mut(i),
            CellRef::Reference(i) => self.references.get_mut(i),
        }
    }

    /// Configuration of a cell or reference, if known.
    pub fn config(&self, cell: CellRef) -> Option<&Settings> {
        let current = self.current.as_ref().filter(|current| current.cell == cell);
        let known = current.and_then(|current| current.config.as_ref());
        known
            .or_else(|| self.plan.as_ref()?.config(cell))
            .map(Arc::as_ref)
    }

    /// State of a cell or reference.
    pub fn entry(&self, cell: CellRef) -> Option<&PlanEntry> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i),
            CellRef::Reference(i) => self.references.get(i),
        }
    }

    /// Stop rule of a cell or reference; `None` for references that are files.
    pub fn stop_rule(&self, cell: CellRef) -> Option<&StopRule> {
        Some(&self.plan.as_deref()?.stop(cell)?.rule)
    }
}

impl CurrentRun {
    fn new(cell: CellRef, at_s: f64) -> CurrentRun {
        CurrentRun {
            cell,
            open: OpenStats::default(),
            reference: None,
            image: None,
            curve: Curve::default(),
            noise: Curve::default(),
            measure_s: 0.0,
            updated_s: at_s,
            running: true,
            config: None,
        }
    }
}
