//! Files of a night's folder that say what is rendered, by whom and where: `plan.json`, `env.json`,
//! `snapshot.json`, and `job/job.json`.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

use super::values::Named;
use super::{Problem, StoredFile, Version, files, pretty, records};
use crate::experiment::spec::{FigureSpec, TableSpec};
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_render::settings::StoredSettings;

files! {
    /// The machine and the command that last rendered the night.
    pub file EnvFile = "env.json", 1 {
        /// Name of the machine; empty if unknown.
        pub host: String,
        /// Operating system and architecture.
        pub os: String,
        /// Model of the processor.
        pub cpu: String,
        /// Number of cores that the process could use.
        pub cores: u64,
        /// Date of the command, UTC.
        pub date: String,
        /// Working directory of the command.
        pub folder: String,
        /// Arguments, without the program's name.
        pub arguments: Vec<String>,
    }

    /// Plan snapshot: what a worker on another machine needs to make the same plan, and to detect
    /// that it differs.
    pub file PlanSnapshot = "snapshot.json", 1 {
        /// Hash of the plan.
        pub plan: String,
        /// Working directory of the command; scripts name scenes relative to it.
        pub folder: PathBuf,
        /// Path of the script; modules and files are found next to it.
        pub script: PathBuf,
        /// Arguments of the command, without the program's name.
        pub arguments: Vec<String>,
        /// Backend that `auto` selected.
        pub auto: String,
        /// BLAKE3 hashes of the files that the plan was made from besides the script; empty if a
        /// file could not be read.
        pub files: BTreeMap<PathBuf, String>,
        /// Run folders, by run id, of this plan's runs that are finished in sibling folders.
        pub elsewhere: BTreeMap<String, PathBuf>,
    }

    /// Notes that were taken on the night by `lumbre note`.
    pub file NotesFile = "notes.json", 1 {
        /// Notes, oldest first.
        pub notes: Vec<NightNote>,
    }

    /// Jobs that were submitted to a scheduler for the night.
    pub file JobFile = "job.json", 1 {
        /// Submitted jobs, oldest first.
        pub jobs: Vec<SubmittedJob>,
    }
}

records! {
    /// The plan of an experiment: every cell, every reference, and what is left out.
    pub struct PlanFile {
        /// Version of the format.
        pub version: Version<2>,
        /// Program that wrote the file, with its version.
        pub program: super::Program,
        /// Name of the experiment.
        pub name: String,
        /// Hash of the plan, in hexadecimal.
        pub hash: String,
        /// Seed from which the seed of every run is derived.
        pub seed: u64,
        /// Names of the axes, slowest first.
        pub axes: Vec<String>,
        /// Settings of the command line, such as `max_depth = 3`. Only if there are any.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub settings: Vec<String>,
        /// Settings of the night.
        pub night: NightSettings,
        /// Metrics and their interval.
        pub measure: Measurement,
        /// Stop rules of the cells, each once.
        pub stops: Vec<StopRecord>,
        /// Cells in the order of the plan.
        pub cells: Vec<PlannedCell>,
        /// References of the cells.
        pub references: Vec<PlannedReference>,
        /// Points of the sweep that are left out.
        pub skipped: Vec<SkippedPoint>,
        /// Warnings about the plan.
        pub warnings: Vec<String>,
        /// Notes about scene files.
        pub notes: Vec<SceneNote>,
        /// Figures that the script asks for. Only if there are any.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub figures: Vec<FigureSpec>,
        /// Tables that the script asks for. Only if there are any.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub tables: Vec<TableSpec>,
        /// Options of the sheets of pictures and frames, with `kind` and `name`. Only of scripts
        /// that declare any.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub sheets: Vec<BTreeMap<String, Value>>,
        /// Presentation of the results in reports. Only of scripts that set it.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub report: Option<PresentationRecord>,
        /// First 32 digits of the BLAKE3 hash of this file with an empty `check`.
        pub check: String,
    }

    /// Settings of the nights of an experiment. None of them changes a result.
    pub struct NightSettings {
        /// Order of the runs: `sequential`, `shuffled` or `interleave`.
        pub order: String,
        /// Description of the warm-up of every cell; `null` without one.
        pub warmup: Option<String>,
    }

    /// Measurements during a run.
    pub struct Measurement {
        /// Longest render time between two measurements in seconds.
        pub every_s: f64,
        /// Metrics in the order of their columns.
        pub metrics: Vec<MetricRecord>,
        /// Tone map of PNG files.
        pub display: Value,
    }

    /// Presentation of the results in figures, tables and reports.
    pub struct PresentationRecord {
        /// Tone map of pictures in figures; `null` for sRGB with an exposure for each figure.
        pub display: Value,
        /// Names of techniques and of other axis values.
        pub names: BTreeMap<String, String>,
        /// Colours as `#rrggbb` of techniques and of other axis values.
        pub colours: BTreeMap<String, String>,
        /// Notes of the script. Only if there are any.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub notes: Vec<String>,
    }

    /// A metric with its options.
    pub struct MetricRecord {
        /// Name of the column.
        pub column: String,
        /// Name of the metric.
        pub metric: String,
        /// Options of the metric.
        pub options: BTreeMap<String, Value>,
    }

    /// A stop rule.
    pub struct StopRecord {
        /// Description for people.
        pub text: String,
        /// Canonical form. Predicates are left out, since they need the script.
        pub rule: Value,
    }

    /// A cell of the plan.
    pub struct PlannedCell {
        /// Id of its run.
        pub run: String,
        /// Readable path of the cell.
        pub path: String,
        /// Folder of its run below `runs/`.
        pub folder: String,
        /// Axis values in the order of the axes.
        pub point: Named<Value>,
        /// Number of the repeat, from 0.
        pub repeat: u32,
        /// Seed of the random numbers.
        pub seed: u64,
        /// Name of the integrator.
        pub integrator: String,
        /// Name of the backend.
        pub backend: String,
        /// Scene as written in the script.
        pub scene: String,
        /// Options of the scene and changes to it, by name and path. Only of cells that have any.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        pub changes: BTreeMap<String, Value>,
        /// Greatest number of path edges; `null` for the value of the scene.
        pub max_depth: Option<u32>,
        /// Width and height in pixels; `null` for the value of the scene.
        pub resolution: Option<[u32; 2]>,
        /// Index of the reference that it is measured against.
        pub reference: Option<usize>,
        /// Index of its stop rule in `stops`.
        pub stop: usize,
        /// Repeat of the same point that it doubles for the A/A check. Only of such cells.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub double_of: Option<u32>,
        /// Name of its denoiser. Only of cells that have one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub denoise: Option<String>,
        /// Time axis of its film. Only of scripts with `x:frames`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub timing: Option<Timing>,
        /// Distributions of delays that frames show, by material: weights and profiles. Only of
        /// scripts with such frames.
        #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
        pub delays: BTreeMap<String, Vec<(f32, Profile)>>,
    }

    /// A reference that is rendered.
    pub struct RenderedReference {
        /// Id of the reference.
        pub run: String,
        /// Settings with which it is rendered.
        pub source: StoredSettings,
        /// When it is finished.
        pub stop: StopRecord,
        /// Comparison with a second technique; `null` without one.
        pub bias_check: Option<BiasCheckPlan>,
        /// Samples per pixel of a shard; `null` if it is rendered as a whole.
        pub shard_samples: Option<u64>,
    }

    /// A reference that is an image file.
    pub struct FileReference {
        /// Id of the reference.
        pub run: String,
        /// Path of the file.
        pub source: String,
        /// BLAKE3 hash of the file, in hexadecimal.
        pub blake3: String,
        /// Origin of the file as stated by the script; empty if not stated.
        pub made_by: String,
    }

    /// A bias check of a reference.
    pub struct BiasCheckPlan {
        /// Id of the second picture, which is a reference too.
        pub with: String,
        /// Expected share of blocks reported as different that differ only by chance.
        pub false_discovery_rate: f64,
    }

    /// A point of the sweep that is left out.
    pub struct SkippedPoint {
        /// Axis values of the point.
        pub point: Named<Value>,
        /// Reason of the skip rule, or what this machine lacks.
        pub reason: String,
        /// Whether this machine lacks what the point needs.
        pub absent: bool,
    }

    /// A note about a scene file.
    pub struct SceneNote {
        /// Path of the file.
        pub file: String,
        /// Place in the file.
        pub place: String,
        /// Text of the note.
        pub message: String,
    }

    /// A note on a night.
    pub struct NightNote {
        /// Date of the note, UTC.
        pub date: String,
        /// Text of the note; words that start with `#` are tags.
        pub text: String,
    }

    /// A job array that was submitted to a scheduler.
    pub struct SubmittedJob {
        /// Scheduler to which it was submitted.
        pub kind: SchedulerKind,
        /// Number of the job at the scheduler.
        pub id: String,
        /// Number of its workers.
        pub workers: u32,
        /// Date of submission, UTC.
        pub date: String,
    }
}

impl NightNote {
    /// Date and text on a line.
    pub fn line(&self) -> String {
        format!("{} {}", self.date, self.text)
    }
}

impl StoredFile for PlanFile {
    const NAME: &'static str = "plan.json";
    const VERSION: u32 = 2;

    /// Parses the plan and compares it with its checksum.
    fn parse(bytes: &[u8]) -> Result<PlanFile, Problem> {
        let plan: PlanFile = super::parse_fields(bytes)?;
        let text = String::from_utf8_lossy(bytes);
        let unchecked = with_check(&text, &plan.check, "");
        if plan.check == checksum(&unchecked) {
            Ok(plan)
        } else {
            Err(super::wrong_checksum())
        }
    }

    /// Content of the file with its checksum, whatever `check` is.
    fn text(&self) -> String {
        let unchecked = PlanFile {
            check: String::new(),
            ..self.clone()
        };
        let text = pretty(&unchecked);
        let check = checksum(&text);
        with_check(&text, "", &check)
    }
}

/// Replaces the value of the field `check`, which is the last of a plan.
fn with_check(text: &str, from: &str, to: &str) -> String {
    let [from, to] = [from, to].map(|check| format!("\"check\": \"{check}\""));
    match text.rfind(&from) {
        Some(at) => format!("{}{to}{}", &text[..at], &text[at + from.len()..]),
        None => text.to_owned(),
    }
}

/// Checksum of the text of a plan whose field `check` is empty.
fn checksum(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex()[..32].to_owned()
}

/// A reference of the plan.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum PlannedReference {
    /// It is rendered.
    Render(Box<RenderedReference>),
    /// It is an image file.
    File(FileReference),
}

impl PlannedReference {
    /// Id of the reference.
    pub fn run(&self) -> &str {
        match self {
            PlannedReference::Render(reference) => &reference.run,
            PlannedReference::File(reference) => &reference.run,
        }
    }
}

lumbre_light::named! {
    /// Job scheduler of a cluster.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
    #[serde(rename_all = "lowercase")]
    pub enum SchedulerKind {
        /// Slurm workload manager.
        #[default]
        Slurm = "slurm",
        /// HyperQueue task scheduler.
        Hq = "hq",
    }
}

impl SchedulerKind {
    /// Returns the programs that submit and cancel jobs.
    pub fn programs(self) -> [&'static str; 2] {
        match self {
            SchedulerKind::Slurm => ["sbatch", "scancel"],
            SchedulerKind::Hq => ["hq", "hq"],
        }
    }
}
