//! Results of nights, read back from their folders: the input of reports.
//!
//! Nothing here was planned in this process. A folder may come from another machine or another
//! version, so every fact that it may lack is optional, and missing facts are not guessed.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use super::WaveRow;
use super::spec::Presentation;
use lumbre_light::transport::integrator::bias_of;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_render::{OpenStats, Peer};

/// Describes what a biased technique of a reference does to a comparison, without a full stop.
pub fn biased_reference((technique, bias): (&str, &str)) -> String {
    format!(
        "the reference is rendered by `{technique}`, which is biased: {bias}. Errors are distances from \
         its limit, which favours `{technique}` and what is biased alike"
    )
}

/// Contents of one night's folder.
#[derive(Clone, Debug, Default)]
pub struct NightResults {
    /// Path of the folder.
    pub folder: PathBuf,
    /// Name of the experiment.
    pub name: String,
    /// Hash of the plan, hex.
    pub plan: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Axis names, slowest first.
    pub axes: Vec<String>,
    /// Metrics with their definitions, in the order of [`WaveRow::metrics`] of every run here.
    pub metrics: Vec<MetricSpec>,
    /// Presentation of the results that the script sets.
    pub report: Presentation,
    /// Order in which the runs were rendered, a name of [`Order`](super::spec::Order).
    pub order: String,
    /// The machine on which the night last rendered, if recorded.
    pub machine: Option<Machine>,
    /// Runs of all cells in the order of the plan, finished or not.
    pub runs: Vec<RunResult>,
    /// References in the order of the plan.
    pub references: Vec<ReferenceResult>,
    /// Messages about files that could not be read or do not belong here.
    pub notes: Vec<String>,
}

/// A machine, as `env.json` describes it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Machine {
    /// Host name; empty if unknown.
    pub host: String,
    /// Operating system and architecture.
    pub os: String,
    /// Model of the processor.
    pub cpu: String,
    /// Number of cores that the process could use.
    pub cores: u64,
    /// Program and version.
    pub program: String,
    /// Date when the night last rendered, UTC.
    pub date: String,
    /// Arguments of the command line.
    pub arguments: Vec<String>,
}

/// State of a run.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum RunState {
    /// Finished by its stop rule; the text names the clause that held.
    Done(String),
    /// Has measurements but is not finished.
    Unfinished,
    /// Has no measurements.
    #[default]
    Pending,
    /// Left out, since a file does not match its checksum.
    Damaged,
}

/// Result of one run of a cell.
#[derive(Clone, Debug, Default)]
pub struct RunResult {
    /// Id of the run.
    pub id: String,
    /// Readable relative path.
    pub path: String,
    /// Folder of the run, which may not exist.
    pub folder: PathBuf,
    /// Axis values in the order of the axes.
    pub point: Vec<(String, Value)>,
    /// Number of the repeat, from 0.
    pub repeat: u64,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Name of the integrator.
    pub integrator: String,
    /// Name of the denoiser of its pictures, if any.
    pub denoise: Option<String>,
    /// Scene as written in the script.
    pub scene: String,
    /// Greatest number of path edges, if the script sets it.
    pub max_depth: Option<u32>,
    /// Width and height in pixels, if known.
    pub resolution: Option<[u32; 2]>,
    /// Device that rendered the run, for people, if it is finished and the device is known.
    pub device: Option<String>,
    /// Number of paths that the processor traced at a time, one in each lane of a vector, if known.
    pub lanes: Option<u32>,
    /// External program that rendered the run, if any.
    pub peer: Option<Peer>,
    /// Share of the time inside the renderer that other work on the machine took, or during which
    /// the process was stopped; `None` if the run is not finished or that was not watched.
    pub lost_share: Option<f64>,
    /// State of the run.
    pub state: RunState,
    /// Measurements, oldest first.
    pub rows: Arc<Vec<WaveRow>>,
    /// Index into [`NightResults::references`].
    pub reference: Option<usize>,
    /// Stored pictures in ascending order of samples per pixel. If the run is done, the last one is
    /// its final picture.
    pub pictures: Vec<(u64, PathBuf)>,
    /// File names of the films, without extension.
    pub films: Vec<String>,
    /// Cost of opening its renderer, if it is finished.
    pub open: Option<OpenStats>,
    /// Noise floors of its reference by column: the values that the true picture would measure.
    /// Empty if unknown.
    pub floors: Vec<(String, f64)>,
}

impl RunResult {
    /// Whether the run is finished.
    pub fn is_done(&self) -> bool {
        matches!(self.state, RunState::Done(_))
    }

    /// Text of the run's value on an axis.
    pub fn axis_value(&self, axis: &str) -> Option<String> {
        self.point
            .iter()
            .find(|(name, _)| name == axis)
            .map(|(_, value)| value.to_string())
    }

    /// Texts of the run's values on some axes; an en dash where it has no value.
    pub fn axis_values(&self, axes: &[String]) -> Vec<String> {
        let value = |axis: &String| self.axis_value(axis).unwrap_or_else(|| "–".to_owned());
        axes.iter().map(value).collect()
    }

    /// Noise floor of its reference for a column, if it is known.
    pub fn floor(&self, column: &str) -> Option<f64> {
        let mut floors = self.floors.iter();
        floors
            .find(|(name, _)| name == column)
            .map(|(_, floor)| *floor)
    }

    /// Returns the error of a metric without the noise of the reference, where that is known.
    pub fn net_error(&self, spec: &MetricSpec, error: f64) -> f64 {
        self.floor(&spec.column)
            .and_then(|floor| spec.net(error, floor))
            .unwrap_or(error)
    }

    /// Samples per pixel per second of render time over the whole run; `None` before the first
    /// wave.
    pub fn samples_per_s(&self) -> Option<f64> {
        let last = self.rows.last().filter(|row| row.render_s > 0.0)?;
        Some(last.samples as f64 / last.render_s)
    }

    /// Millions of rays per second of render time over the whole run.
    pub fn mrays_per_s(&self) -> Option<f64> {
        let last = self
            .rows
            .last()
            .filter(|row| row.render_s > 0.0 && row.rays > 0)?;
        Some(last.rays as f64 / last.render_s / 1e6)
    }
}

/// Returns the efficiency of an estimator with a squared error after seconds of render time, its
/// inverse product; `None` unless it is positive and finite.
pub fn efficiency(squared_error: f64, render_s: f64) -> Option<f64> {
    Some(1.0 / (squared_error * render_s)).filter(|e| e.is_finite() && *e > 0.0)
}

/// A reference that runs were measured against.
#[derive(Clone, Debug)]
pub struct ReferenceResult {
    /// Id of the reference.
    pub id: String,
    /// File of the picture, if it exists.
    pub picture: Option<PathBuf>,
    /// Origin of the picture.
    pub origin: ReferenceOrigin,
    /// Comparisons with other techniques, if there were any.
    pub checks: Vec<BiasCheckSummary>,
}

/// Result of comparing a reference with the same picture by another technique.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BiasCheckSummary {
    /// Integrator of the second picture.
    pub technique: String,
    /// Whether no comparison found a difference.
    pub agrees: bool,
    /// The result in one sentence.
    pub finding: String,
}

/// Origin of the picture of a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ReferenceOrigin {
    /// It was rendered.
    Rendered {
        /// Name of the integrator.
        integrator: String,
        /// Samples per pixel.
        samples: u64,
    },
    /// It is a file or is not finished, as this text describes.
    Other(String),
}

impl ReferenceOrigin {
    /// Description for people: `bpt, 16 samples per pixel`, or the name of a file.
    pub fn describe(&self) -> String {
        match self {
            ReferenceOrigin::Rendered {
                integrator,
                samples,
            } => format!("{integrator}, {samples} samples per pixel"),
            ReferenceOrigin::Other(text) => text.clone(),
        }
    }
}

impl NightResults {
    /// References that runs were measured against, in the order of the plan.
    pub fn references_of_runs(&self) -> impl Iterator<Item = &ReferenceResult> {
        let is_used = |index: usize| self.runs.iter().any(|run| run.reference == Some(index));
        let references = self.references.iter().enumerate();
        references.filter_map(move |(i, reference)| is_used(i).then_some(reference))
    }

    /// Techniques of rendered references that are biased, with the source of the bias, sorted and
    /// without repetition.
    pub fn biased_references(&self) -> BTreeSet<(&str, &'static str)> {
        self.references_of_runs()
            .filter_map(|reference| match &reference.origin {
                ReferenceOrigin::Rendered { integrator, .. } => {
                    Some((integrator.as_str(), bias_of(integrator)?))
                }
                ReferenceOrigin::Other(_) => None,
            })
            .collect()
    }

    /// Devices of all finished runs in the order of the plan, without repetition.
    pub fn devices(&self) -> Vec<String> {
        let mut devices: Vec<String> = Vec::new();
        for device in self
            .runs
            .iter()
            .filter(|run| run.is_done())
            .filter_map(|run| run.device.clone())
        {
            if !devices.contains(&device) {
                devices.push(device);
            }
        }
        devices
    }

    /// Index of a column in [`NightResults::metrics`].
    pub fn metric_index(&self, name: &str) -> Option<usize> {
        self.metrics.iter().position(|metric| metric.column == name)
    }
}
