//! State of a night, folded from its events. Nothing here draws, and memory does not grow with
//! time.

use std::collections::{BTreeMap, VecDeque};
use std::sync::Arc;

use super::column::{Column, columns};
use super::comparison::Comparison;
use super::curve::Curve;
use super::end_message::end_message;
use super::strategy_thumbnails::{StrategyThumbnail, StrategyThumbnails};
use super::time_preview::TimePreview;
use super::worker_list::WorkerLine;
use crate::tui::format;
use lumbre_light::film::SharedImage;
use lumbre_light::film::layer::LayerImage;
use lumbre_metrics::MetricSpec;
use lumbre_night::experiment::forecast::Forecast;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::{CellRef, Event, Night, Outcome, StopRule, WaveRow};
use lumbre_render::{Device, OpenStats, Settings};

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
    /// Render settings, if the plan does not contain them.
    pub settings: Option<Arc<Settings>>,
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
    /// Plan, runs and references; empty before the night has begun.
    pub night: Night,
    /// Columns that distinguish cells from each other.
    pub columns: Arc<Vec<Column>>,
    /// Selection of the cells that the chart compares; `None` if no axis varies.
    pub comparison: Option<Arc<Comparison>>,
    /// The run that renders or rendered last; among interleaved runs, the first that is not done.
    pub current: Option<CurrentRun>,
    /// Other runs that are interleaved with the current one.
    pub interleaved: BTreeMap<CellRef, CurrentRun>,
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

    /// Returns the model of a night that has not started.
    pub fn new(night: Night) -> NightModel {
        let mut model = NightModel::default();
        model.show(night);
        model
    }

    /// Returns the night, once its plan is known.
    pub fn planned(&self) -> Option<&Night> {
        (!self.night.plan.hash.is_empty()).then_some(&self.night)
    }

    /// Returns the metrics of the plan.
    pub fn metrics(&self) -> &[MetricSpec] {
        &self.night.plan.metrics
    }

    /// Applies an event received at `at_s` seconds on the receiver's monotonic clock.
    ///
    /// Events about cells that are not in the plan are ignored, so any order of events is safe.
    pub fn receive(&mut self, event: &Event, at_s: f64) {
        self.revision += 1;
        if let Event::NightStarted { night } = event {
            self.begin_night(night, at_s);
            return;
        }
        self.night.apply(event);
        let is_planned = event
            .cell()
            .is_none_or(|cell| self.night.state(cell).is_some());
        if is_planned {
            self.updated_s = self.updated_s.max(at_s);
            self.show_event(event, at_s);
        }
    }

    /// Follows an event in what is shown beside the night itself.
    fn show_event(&mut self, event: &Event, at_s: f64) {
        match event {
            Event::CellStarted {
                cell,
                open,
                reference,
                resumed,
                settings,
            } => {
                let run = CurrentRun {
                    open: open.clone(),
                    reference: reference.clone(),
                    settings: settings.clone(),
                    ..CurrentRun::new(*cell, at_s)
                };
                self.start_run(run);
                // Measurements by an earlier process.
                for row in resumed.iter().flat_map(|rows| rows.iter()) {
                    self.add_wave(*cell, row, 0.0, at_s);
                }
            }
            Event::ShardStarted { shard, open, .. } => {
                let cell = CellRef::Reference(shard.reference);
                self.start_run(CurrentRun {
                    open: open.clone(),
                    ..CurrentRun::new(cell, at_s)
                });
            }
            Event::ShardActive { shard } | Event::ShardFinished { shard, .. } => {
                self.stop_current(CellRef::Reference(shard.reference));
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
                if let Some(image) = image {
                    self.set_image(*cell, image);
                }
                self.add_noise(*cell, row, *noise);
            }
            Event::Picture { cell, image } => self.set_image(*cell, image),
            Event::Layer { cell, layer } => self.add_strategy_thumbnail(*cell, layer),
            Event::CellFinished {
                cell,
                outcome,
                layers,
                rows,
                ..
            } => {
                self.finish_run(*cell, outcome, rows.last(), at_s);
                self.set_strategy_thumbnails(*cell, layers);
            }
            Event::Message { level, cell, text } => {
                self.append_message(*level, *cell, text, at_s);
            }
            Event::Forecast(left) => self.forecast = Some((*left, at_s)),
            Event::NightFinished => self.end_night(at_s),
            // Building a time preview is slow; the caller does it before locking the model and then
            // calls `set_time_preview`.
            Event::NightStarted { .. }
            | Event::RunActive { .. }
            | Event::NoiseFloors { .. }
            | Event::BiasCheck { .. }
            | Event::Times { .. }
            | Event::Halves { .. } => {}
        }
    }

    /// Begins a night. Messages are kept and, if the same plan is run again, pictures and curves
    /// too.
    fn begin_night(&mut self, night: &Night, at_s: f64) {
        if self.night.plan.hash == night.plan.hash {
            self.night = night.clone();
            self.interleaved.clear();
            if let Some(current) = &mut self.current {
                current.running = false;
            }
        } else {
            self.show(night.clone());
        }
        (self.started_s, self.finished_s, self.forecast) = (Some(at_s), None, None);
        self.updated_s = at_s;
    }

    /// Shows another night.
    fn show(&mut self, night: Night) {
        let columns = columns(&night);
        *self = NightModel {
            comparison: Comparison::new(&night, &columns).map(Arc::new),
            columns: Arc::new(columns),
            night,
            messages: std::mem::take(&mut self.messages),
            revision: self.revision,
            ..NightModel::default()
        };
    }

    /// Shows a run that was opened, for the first time or after a restart.
    fn start_run(&mut self, new: CurrentRun) {
        match &self.current {
            Some(current) if current.running && current.cell != new.cell => {
                self.interleaved.insert(new.cell, new);
            }
            _ => self.current = Some(new),
        }
    }

    /// Notes that the current run no longer renders, if it is this one.
    fn stop_current(&mut self, cell: CellRef) {
        if let Some(current) = self.current.as_mut().filter(|current| current.cell == cell) {
            current.running = false;
        }
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

    /// Replaces the list of workers.
    pub fn set_workers(&mut self, workers: Vec<WorkerLine>) {
        self.revision += 1;
        self.workers = Arc::new(workers);
    }

    /// Adds a measurement of a run.
    fn add_wave(&mut self, cell: CellRef, row: &WaveRow, measure_s: f64, at_s: f64) {
        let row = Arc::new(row.clone());
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
    fn set_image(&mut self, cell: CellRef, image: &SharedImage) {
        let current = self.current.as_mut().filter(|current| current.cell == cell);
        if let Some(current) = current.or(self.interleaved.get_mut(&cell)) {
            current.image = Some(Arc::clone(image));
        }
    }

    /// Ends a run; `last` is its last measurement.
    fn finish_run(&mut self, cell: CellRef, outcome: &Outcome, last: Option<&WaveRow>, at_s: f64) {
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

    /// Returns the numbers of finished shards and of all shards of a reference, until it has ended.
    pub fn shard_progress(&self, cell: CellRef) -> Option<(usize, usize)> {
        let CellRef::Reference(i) = cell else {
            return None;
        };
        let reference = self.night.references.get(i)?;
        let shards = reference.shards.as_ref();
        let shards = shards.filter(|_| !reference.state.is_settled())?;
        Some((shards.finished.len(), shards.count))
    }

    /// Noise floor of a metric for the reference of the current cell, if known.
    pub fn noise_floor(&self, metric: usize) -> Option<f64> {
        let CellRef::Cell(i) = self.current.as_ref()?.cell else {
            return None;
        };
        let reference = self.night.runs.get(i)?.reference?;
        let floors = self.night.references.get(reference)?.floors.as_ref()?;
        floors.get(metric)?.as_ref().map(|floor| floor.value)
    }

    /// Adds the thumbnail of one strategy of a cell.
    fn add_strategy_thumbnail(&mut self, cell: CellRef, layer: &LayerImage) {
        let Some(thumbnail) = StrategyThumbnail::from_layer(layer) else {
            return;
        };
        let mut thumbnails = match self.thumbnails.take() {
            Some(thumbnails) if thumbnails.cell == cell => thumbnails,
            _ => Arc::new(StrategyThumbnails {
                cell,
                films: Vec::new(),
            }),
        };
        Arc::make_mut(&mut thumbnails).films.push(thumbnail);
        self.thumbnails = Some(thumbnails);
    }

    /// Reduces and stores the per-strategy films among the layers of a cell.
    fn set_strategy_thumbnails(&mut self, cell: CellRef, layers: &[LayerImage]) {
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

    /// Appends a message about the program to the log.
    pub fn log(&mut self, level: Level, text: &str, at_s: f64) {
        self.revision += 1;
        self.updated_s = self.updated_s.max(at_s);
        self.append_message(level, None, text, at_s);
    }

    /// Appends a line to the log.
    fn append_message(&mut self, level: Level, cell: Option<CellRef>, text: &str, at_s: f64) {
        let name = |cell| format::cell_name(&self.night, cell);
        let about = match cell.filter(|_| self.planned().is_some()) {
            Some(cell @ CellRef::Cell(_)) => format!("{}: ", name(cell)),
            Some(cell) => format!("reference {}: ", name(cell)),
            None => String::new(),
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

    /// Ends the night.
    fn end_night(&mut self, at_s: f64) {
        self.finished_s = Some(at_s);
        self.interleaved.clear();
        if let Some(current) = &mut self.current {
            current.running = false;
        }
    }

    /// Returns the render settings of a cell or reference, if known.
    pub fn settings(&self, cell: CellRef) -> Option<&Settings> {
        let current = self.current.as_ref().filter(|current| current.cell == cell);
        let known = current.and_then(|current| current.settings.as_ref());
        known.or_else(|| self.night.settings(cell)).map(Arc::as_ref)
    }

    /// Returns the stop rule of a cell or reference; `None` for references that are files.
    pub fn stop_rule(&self, cell: CellRef) -> Option<&StopRule> {
        Some(&self.night.stop(cell)?.rule)
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
            settings: None,
        }
    }
}
