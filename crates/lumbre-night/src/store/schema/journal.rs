//! The journal, `journal.jsonl` and `workers/<worker>.jsonl`: one line for each event of a night, in
//! the vocabulary of [`Event`]. The journal is informative: no decision about what is rendered
//! depends on it. Reports notice by it that the last file of a finished run was removed.

use serde::{Deserialize, Serialize};

use super::run::{BiasCheckFile, OpenCost};
use super::values::{Named, Real};
use super::{RecordRow, Version, field_rows, records};
use crate::experiment::forecast::Forecast;
use crate::experiment::outcome::Level;
use crate::experiment::shards::Shard;
use crate::experiment::{CellRef, EndCause, Event, Outcome, Plan, WaveRow};
use lumbre_light::scene::compile::SceneMemory;
use lumbre_render::{Device, OpenStats};

/// Fields of [`Forecast`], which the journal stores as it is.
pub(crate) const FORECAST: RecordRow = RecordRow {
    name: "Forecast",
    doc: "An estimate of the remaining time.",
    fields: field_rows! {
        seconds: "Wall-clock seconds of the runs that can be estimated.";
        at_most: "Whether it is an upper bound.";
        rough: "Whether part of it is estimated from other scenes or the smoke pass.";
        known: "Number of runs that are included.";
        unknown: "Number of runs that cannot be estimated.";
    },
};

/// Name of the journal in a night's folder.
pub const FILE: &str = "journal.jsonl";

/// One line of a journal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct JournalLine {
    /// Date of the event, UTC, to the second.
    pub date: String,
    /// Event: its name in `event`, and its fields.
    #[serde(flatten)]
    pub event: JournalEvent,
}

/// An event of a night as the journal stores it: run ids instead of indices into the plan, and no
/// pictures.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum JournalEvent {
    /// A process that made the plan began to render.
    NightStarted(NightStart),
    /// A worker began to render.
    WorkerStarted(NightStart),
    /// The remaining time was estimated.
    Forecast(Forecast),
    /// The renderer of a run is open.
    CellStarted(RunStart),
    /// A run ended. Cached runs are left out.
    CellFinished(RunEnd),
    /// The renderer of a reference's shard is open.
    ShardStarted(ShardStart),
    /// A shard of a reference ended.
    ShardFinished(ShardEnd),
    /// A reference was compared with the picture of a second technique.
    BiasCheck(BiasCheckFile),
    /// A warning or an error.
    Message(MessageRecord),
    /// The process that made the plan ended.
    NightFinished {},
    /// A worker ended.
    WorkerFinished {},
    /// The tables and figures of a night of several workers were written.
    NightClosed {},
}

records! {
    /// Start of a night or a worker.
    pub struct NightStart {
        /// Version of the journal's format.
        pub version: Version<1>,
        /// Program that renders, with its version.
        pub program: super::Program,
        /// Hash of the plan.
        pub plan: String,
        /// Number of cells of the plan.
        pub cells: usize,
        /// Arguments of the command, without the program's name.
        pub arguments: Vec<String>,
    }

    /// Start of a run.
    pub struct RunStart {
        /// Id of the run.
        pub run: String,
        /// Readable path; `reference` for references.
        pub path: String,
        /// Devices that render it, as in `done.json`.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub devices: Vec<Device>,
        /// Line about the device for people. Only of lines of earlier versions, without `devices`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub device: Option<String>,
        /// Cost of opening the renderer.
        pub open: OpenCost,
    }

    /// End of a run.
    pub struct RunEnd {
        /// Id of the run.
        pub run: String,
        /// Readable path; `reference` for references.
        pub path: String,
        /// Kind of the end.
        pub outcome: OutcomeKind,
        /// Clause of the stop rule that held, or reason of the failure; else empty.
        pub reason: String,
        /// Whether the clause is a limit of render time or of samples; absent if not.
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        pub limit: bool,
        /// Its last measurement; `null` if no wave was measured.
        pub last: Option<WaveRecord>,
    }

    /// A shard of a reference.
    pub struct ShardRecord {
        /// Index of its first sample per pixel.
        pub first: u64,
        /// Index one past its last sample per pixel.
        pub end: u64,
        /// Number within the reference, from 1.
        pub number: usize,
        /// Number of shards of the reference.
        pub count: usize,
    }

    /// Start of a shard.
    pub struct ShardStart {
        /// Id of the reference.
        pub run: String,
        /// Shard of the reference.
        pub shard: ShardRecord,
        /// Devices that render it, as in `done.json`.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub devices: Vec<Device>,
        /// Line about the device for people. Only of lines of earlier versions, without `devices`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub device: Option<String>,
    }

    /// End of a shard.
    pub struct ShardEnd {
        /// Id of the reference.
        pub run: String,
        /// Shard of the reference.
        pub shard: ShardRecord,
        /// Kind of the end.
        pub outcome: OutcomeKind,
        /// Reason of the failure; else empty.
        pub reason: String,
        /// Its last measurement; `null` if there is none.
        pub last: Option<WaveRecord>,
    }

    /// A warning or an error.
    pub struct MessageRecord {
        /// Severity: `warn` or `error`.
        pub level: Level,
        /// Id of the run that it is about; `null` for the night.
        pub run: Option<String>,
        /// Text of the message.
        pub text: String,
    }

    /// A measurement: totals of a run at the end of a wave.
    pub struct WaveRecord {
        /// Number of the wave, from 1.
        pub wave: u64,
        /// Samples per pixel.
        pub samples: u64,
        /// Seconds inside the renderer.
        pub render_s: f64,
        /// Seconds that other work took from the renderer; not in `render_s`.
        #[serde(default)]
        pub lost_s: f64,
        /// Wall-clock seconds, measuring included.
        pub wall_s: f64,
        /// Seconds spent measuring.
        pub measure_s: f64,
        /// Number of camera paths.
        pub paths: u64,
        /// Number of rays.
        pub rays: u64,
        /// Samples that were NaN or infinite.
        pub invalid: u64,
        /// Column, row and sample of the first invalid sample.
        pub first_invalid: Option<[u64; 3]>,
        /// Value of every metric by its column.
        pub metrics: Named<Real>,
    }
}

/// Kind of the end of a run or shard.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum OutcomeKind {
    /// Finished by its stop rule.
    Done,
    /// Found finished in a folder.
    Cached,
    /// Failed for a reason.
    Failed,
    /// Ended early by the user, a signal or the deadline.
    #[default]
    Interrupted,
}

impl OutcomeKind {
    /// Splits an outcome into its kind and its reason.
    fn split(outcome: &Outcome) -> (OutcomeKind, String) {
        match outcome {
            Outcome::Done(cause) => (OutcomeKind::Done, cause.clause.clone()),
            Outcome::Cached(folder) => (OutcomeKind::Cached, folder.display().to_string()),
            Outcome::Failed(reason) => (OutcomeKind::Failed, reason.clone()),
            Outcome::Interrupted => (OutcomeKind::Interrupted, String::new()),
        }
    }

    /// Joins the kind and reason of an outcome. `is_limit` is that of a clause, and `folder` that of
    /// a cached run.
    fn join(self, reason: &str, is_limit: bool, folder: std::path::PathBuf) -> Outcome {
        match self {
            OutcomeKind::Done => Outcome::Done(EndCause {
                clause: reason.to_owned(),
                is_limit,
            }),
            OutcomeKind::Cached => Outcome::Cached(folder),
            OutcomeKind::Failed => Outcome::Failed(reason.to_owned()),
            OutcomeKind::Interrupted => Outcome::Interrupted,
        }
    }
}

impl RunEnd {
    /// The outcome of the run, whose folder is `folder`.
    pub fn outcome(&self, folder: std::path::PathBuf) -> Outcome {
        self.outcome.join(&self.reason, self.limit, folder)
    }
}

impl ShardEnd {
    /// The outcome of the shard.
    pub fn outcome(&self) -> Outcome {
        self.outcome.join(&self.reason, false, Default::default())
    }
}

impl ShardRecord {
    /// The shard of the reference with this index.
    pub fn shard(&self, reference: usize) -> Shard {
        Shard {
            reference,
            first: self.first,
            end: self.end,
            number: self.number,
            count: self.count,
        }
    }
}

impl From<&Shard> for ShardRecord {
    fn from(shard: &Shard) -> ShardRecord {
        ShardRecord {
            first: shard.first,
            end: shard.end,
            number: shard.number,
            count: shard.count,
        }
    }
}

impl WaveRecord {
    /// Records a measurement, whose metrics have these columns.
    pub fn new(row: &WaveRow, columns: &[String]) -> WaveRecord {
        WaveRecord {
            wave: row.wave,
            samples: row.samples,
            render_s: row.render_s,
            lost_s: row.lost_s,
            wall_s: row.wall_s,
            measure_s: row.measure_s,
            paths: row.paths,
            rays: row.rays,
            invalid: row.invalid,
            first_invalid: row.first_invalid,
            metrics: named(columns, row.metrics.iter().copied().map(Some)),
        }
    }

    /// The measurement, with the metrics of these columns.
    pub fn row<'a>(&self, columns: impl Iterator<Item = &'a str>) -> WaveRow {
        WaveRow {
            wave: self.wave,
            samples: self.samples,
            render_s: self.render_s,
            lost_s: self.lost_s,
            wall_s: self.wall_s,
            measure_s: self.measure_s,
            paths: self.paths,
            rays: self.rays,
            invalid: self.invalid,
            first_invalid: self.first_invalid,
            metrics: in_order(&self.metrics, columns),
        }
    }
}

/// Returns values by their columns, without those that are not known.
pub fn named(columns: &[String], values: impl Iterator<Item = Option<f64>>) -> Named<Real> {
    let pairs = columns.iter().zip(values);
    pairs
        .filter_map(|(column, x)| Some((column.clone(), Real(x?))))
        .collect()
}

/// Returns values in the order of the columns, NaN where one is missing; empty if all are.
pub fn in_order<'a>(values: &Named<Real>, columns: impl Iterator<Item = &'a str>) -> Vec<f64> {
    let found: Vec<Option<f64>> = columns
        .map(|column| values.get(column).map(|x| x.0))
        .collect();
    if found.iter().any(Option::is_some) {
        found.into_iter().map(|x| x.unwrap_or(f64::NAN)).collect()
    } else {
        Vec::new()
    }
}

impl From<&OpenStats> for OpenCost {
    fn from(open: &OpenStats) -> OpenCost {
        OpenCost {
            accel_build_s: open.accel_build_s,
            accel_nodes: open.accel_nodes,
            accel_bytes: open.accel_bytes,
            accel_cost: open.accel_cost,
            geometry_bytes: (open.scene.geometry > 0).then_some(open.scene.geometry),
            texture_bytes: (open.scene.geometry > 0).then_some(open.scene.textures),
            ..OpenCost::default()
        }
    }
}

impl OpenCost {
    /// Statistics of opening a renderer on some devices.
    pub fn stats(&self, devices: Vec<Device>) -> OpenStats {
        OpenStats {
            devices,
            accel_build_s: self.accel_build_s,
            accel_nodes: self.accel_nodes,
            accel_bytes: self.accel_bytes,
            accel_cost: self.accel_cost,
            scene: SceneMemory {
                geometry: self.geometry_bytes.unwrap_or(0),
                textures: self.texture_bytes.unwrap_or(0),
            },
            ..OpenStats::default()
        }
    }
}

impl RunStart {
    /// Statistics of opening the renderer.
    pub fn stats(&self) -> OpenStats {
        let devices = self.open.devices(&self.devices, self.device.as_deref());
        self.open.stats(devices)
    }
}

impl ShardStart {
    /// Statistics of opening the renderer, of which only the devices are known.
    pub fn stats(&self) -> OpenStats {
        let open = OpenCost::default();
        open.stats(open.devices(&self.devices, self.device.as_deref()))
    }
}

impl JournalEvent {
    /// Returns what the journal stores of an event. Returns `None` for events whose content is in
    /// other files, for cached runs, and for messages below a warning.
    pub fn from_event(event: &Event, plan: &Plan) -> Option<JournalEvent> {
        let run = |cell: CellRef| plan.id(cell).0.clone();
        let recorded = match event {
            Event::NightStarted { .. } => JournalEvent::NightStarted(NightStart {
                plan: plan.hash.clone(),
                cells: plan.cells.len(),
                arguments: crate::text::arguments(),
                ..NightStart::default()
            }),
            Event::CellStarted { cell, open, .. } => JournalEvent::CellStarted(RunStart {
                run: run(*cell),
                path: path(plan, *cell).to_owned(),
                devices: open.devices.clone(),
                device: None,
                open: open.into(),
            }),
            Event::CellFinished {
                outcome: Outcome::Cached(_),
                ..
            } => return None,
            Event::CellFinished {
                cell,
                outcome,
                rows,
                ..
            } => {
                let limit = matches!(outcome, Outcome::Done(cause) if cause.is_limit);
                let (outcome, reason) = OutcomeKind::split(outcome);
                JournalEvent::CellFinished(RunEnd {
                    run: run(*cell),
                    path: path(plan, *cell).to_owned(),
                    outcome,
                    reason,
                    limit,
                    last: rows.last().map(|row| WaveRecord::new(row, &plan.columns())),
                })
            }
            Event::ShardStarted { shard, open, .. } => JournalEvent::ShardStarted(ShardStart {
                run: run(CellRef::Reference(shard.reference)),
                shard: shard.into(),
                devices: open.devices.clone(),
                device: None,
            }),
            Event::ShardFinished {
                shard,
                outcome,
                last,
                ..
            } => {
                let (outcome, reason) = OutcomeKind::split(outcome);
                JournalEvent::ShardFinished(ShardEnd {
                    run: run(CellRef::Reference(shard.reference)),
                    shard: shard.into(),
                    outcome,
                    reason,
                    last: last.as_ref().map(|row| WaveRecord::new(row, &[])),
                })
            }
            Event::BiasCheck {
                reference,
                check,
                compared: Some((with, found)),
            } => {
                let pair = [*reference, *with];
                JournalEvent::BiasCheck(BiasCheckFile::new(plan, pair, check, found))
            }
            Event::Message { level, cell, text } if *level >= Level::Warn => {
                JournalEvent::Message(MessageRecord {
                    level: *level,
                    run: cell.map(run),
                    text: text.clone(),
                })
            }
            Event::Forecast(left) => JournalEvent::Forecast(*left),
            Event::NightFinished => JournalEvent::NightFinished {},
            Event::Message { .. }
            | Event::RunActive { .. }
            | Event::ShardActive { .. }
            | Event::BiasCheck { compared: None, .. }
            | Event::Wave { .. }
            | Event::Picture { .. }
            | Event::Layer { .. }
            | Event::Times { .. }
            | Event::NoiseFloors { .. }
            | Event::Halves { .. } => return None,
        };
        Some(recorded)
    }

    /// Id of the run or reference that the event is about, if any.
    pub fn run(&self) -> Option<&str> {
        match self {
            JournalEvent::CellStarted(start) => Some(&start.run),
            JournalEvent::CellFinished(end) => Some(&end.run),
            JournalEvent::ShardStarted(start) => Some(&start.run),
            JournalEvent::ShardFinished(end) => Some(&end.run),
            JournalEvent::BiasCheck(check) => Some(&check.reference),
            JournalEvent::Message(message) => message.run.as_deref(),
            _ => None,
        }
    }
}

/// Readable path of a run.
fn path(plan: &Plan, cell: CellRef) -> &str {
    match cell {
        CellRef::Cell(i) => &plan.cells[i].path,
        CellRef::Reference(_) => "reference",
    }
}
