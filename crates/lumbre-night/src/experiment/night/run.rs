//! A run of a night: what was planned, its state, and what is known of its results.

use std::collections::BTreeMap;
use std::ops::Deref;
use std::path::PathBuf;
use std::sync::Arc;

use crate::experiment::outcome::{Outcome, WaveRow};
use crate::experiment::spec::Point;
use crate::experiment::stop::StopRule;
use lumbre_light::scene::SceneDesc;
use lumbre_light::transport::delay::Profile;
use lumbre_light::transport::time_settings::Timing;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::floor::Floor;
use lumbre_render::{OpenStats, Peer, Settings};

/// State of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum RunState {
    /// Not started yet.
    #[default]
    Pending,
    /// Rendered at this moment.
    Running,
    /// Ended. A run that is interrupted, or was when its process died, can be continued.
    Ended(Outcome),
    /// A file does not match its checksum, as the text describes.
    Damaged(String),
}

impl RunState {
    /// Returns whether the run is finished, in this night or an earlier one.
    pub fn is_done(&self) -> bool {
        matches!(self, Self::Ended(Outcome::Done(_) | Outcome::Cached(_)))
    }

    /// Returns whether the run needs no more work: it is done or has failed.
    pub fn is_settled(&self) -> bool {
        self.is_done() || matches!(self, Self::Ended(Outcome::Failed(_)))
    }

    /// Returns the outcome of a run that has ended.
    pub fn outcome(&self) -> Option<&Outcome> {
        match self {
            Self::Ended(outcome) => Some(outcome),
            Self::Pending | Self::Running | Self::Damaged(_) => None,
        }
    }

    /// Returns the name of the state: `pending`, `running`, `done`, `elsewhere`, `failed`,
    /// `unfinished` or `damaged`.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Pending => "pending",
            Self::Running => "running",
            Self::Ended(Outcome::Done(_)) => "done",
            Self::Ended(Outcome::Cached(_)) => "elsewhere",
            Self::Ended(Outcome::Failed(_)) => "failed",
            Self::Ended(Outcome::Interrupted) => "unfinished",
            Self::Damaged(_) => "damaged",
        }
    }

    /// Returns why the run is done, failed or damaged; empty for other states.
    pub fn reason(&self) -> &str {
        match self {
            Self::Ended(Outcome::Done(cause)) => &cause.clause,
            Self::Ended(Outcome::Failed(reason)) | Self::Damaged(reason) => reason,
            Self::Ended(Outcome::Cached(_) | Outcome::Interrupted)
            | Self::Pending
            | Self::Running => "",
        }
    }
}

/// A stop rule and its description.
#[derive(Clone, Debug, PartialEq)]
pub struct StopOutline {
    /// The rule; clauses that cannot be reconstructed from files are predicates.
    pub rule: StopRule,
    /// Description for people.
    pub text: String,
}

impl StopOutline {
    /// Describes a rule.
    pub fn from_rule(rule: &StopRule) -> Arc<StopOutline> {
        Arc::new(StopOutline {
            rule: rule.clone(),
            text: rule.describe(),
        })
    }
}

/// Plan of a run. A night that is read from files has neither `settings` nor `content`,
/// which `plan.json` leaves out.
#[derive(Clone, Debug, Default)]
pub struct RunPlan {
    /// Id of the run.
    pub id: String,
    /// Readable relative path.
    pub path: String,
    /// Axis values in the order of the axes.
    pub point: Point,
    /// Number of the repeat, from 0.
    pub repeat: u32,
    /// Repeat of the same point that it duplicates for the A/A check.
    pub double_of: Option<u32>,
    /// Seed of the random numbers.
    pub seed: u64,
    /// Name of the integrator.
    pub integrator: String,
    /// Name of the backend.
    pub backend: String,
    /// Name of the denoiser of its pictures, if any.
    pub denoise: Option<String>,
    /// Scene as written in the script.
    pub scene: String,
    /// Options of the scene and changes to it, by name and path.
    pub changes: BTreeMap<String, Value>,
    /// Greatest number of path edges, if the script sets it.
    pub max_depth: Option<u32>,
    /// Width and height in pixels, if known.
    pub resolution: Option<[u32; 2]>,
    /// Index into [`Night::references`](super::Night::references).
    pub reference: Option<usize>,
    /// Stop rule, if known.
    pub stop: Option<Arc<StopOutline>>,
    /// Render settings, if known.
    pub settings: Option<Arc<Settings>>,
    /// Scene with the cell's changes applied, if known.
    pub content: Option<Arc<SceneDesc>>,
    /// Time axis of its film, of nights that are read from files and whose script has `x:frames`.
    pub timing: Option<Timing>,
    /// Weights and profiles of the delays of the materials whose densities `x:frames` shows; known
    /// where `timing` is.
    pub delays: BTreeMap<String, Vec<(f32, Profile)>>,
}

/// The run of a cell. Facts that only a finished run or only its files state are `None` or empty
/// before.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// Plan of the run, whose fields are those of the run.
    pub planned: Arc<RunPlan>,
    /// State of the run.
    pub state: RunState,
    /// Measurements, oldest first. While the run is rendered, and where only the end of a run is
    /// known, the newest one alone.
    pub rows: Arc<Vec<WaveRow>>,
    /// Cost of opening its renderer.
    pub open: Option<OpenStats>,
    /// Noise floors of its reference by column: the values that the true picture would measure.
    pub floors: Vec<(String, Floor)>,
    /// Folder of the run, which may not exist; empty if the night is not read from files.
    pub folder: PathBuf,
    /// Stored pictures in ascending order of samples per pixel. If the run is done, the last one is
    /// its final picture.
    pub pictures: Vec<(u64, PathBuf)>,
    /// File names of the films, without extension.
    pub films: Vec<String>,
    /// Device that rendered the run, for people.
    pub device: Option<String>,
    /// Number of paths that the processor traced at a time, one in each lane of a vector.
    pub lanes: Option<u32>,
    /// External program that rendered the run.
    pub peer: Option<Peer>,
    /// Share of the time inside the renderer that other work on the machine took, or during which
    /// the process was stopped.
    pub lost_share: Option<f64>,
}

impl Deref for Run {
    type Target = RunPlan;

    fn deref(&self) -> &RunPlan {
        &self.planned
    }
}

impl Run {
    /// Returns whether the run is finished.
    pub fn is_done(&self) -> bool {
        self.state.is_done()
    }

    /// Returns the clause of the stop rule by which the run ended; empty if it is not finished in
    /// this night.
    pub fn end_clause(&self) -> &str {
        match &self.state {
            RunState::Ended(Outcome::Done(cause)) => &cause.clause,
            _ => "",
        }
    }

    /// Returns the text of the run's value on an axis.
    pub fn axis_value(&self, axis: &str) -> Option<String> {
        let mut values = self.point.iter();
        let value = values.find(|(name, _)| name == axis);
        value.map(|(_, value)| value.to_string())
    }

    /// Returns the texts of the run's values on some axes; an en dash where it has no value.
    pub fn axis_values(&self, axes: &[String]) -> Vec<String> {
        let value = |axis: &String| self.axis_value(axis).unwrap_or_else(|| "–".to_owned());
        axes.iter().map(value).collect()
    }

    /// Returns the noise floor of its reference for a column, if it is known.
    pub fn floor(&self, column: &str) -> Option<Floor> {
        let mut floors = self.floors.iter();
        let floor = floors.find(|(name, _)| name == column);
        floor.map(|(_, floor)| *floor)
    }

    /// Returns the error of a metric without the noise of the reference, where that is known: with
    /// the noise as estimated, and at both ends of its confidence interval, as
    /// [`MetricSpec::net_at_noise`].
    pub fn net_errors(&self, spec: &MetricSpec, error: f64) -> [f64; 3] {
        spec.net_at_noise(error, self.floor(&spec.column))
    }

    /// Returns the samples per pixel per second of render time over the whole run; `None` before
    /// the first wave.
    pub fn samples_per_s(&self) -> Option<f64> {
        let last = self.rows.last().filter(|row| row.render_s > 0.0)?;
        Some(last.samples as f64 / last.render_s)
    }

    /// Returns the millions of rays per second of render time over the whole run.
    pub fn mrays_per_s(&self) -> Option<f64> {
        let last = self.rows.last();
        let last = last.filter(|row| row.render_s > 0.0 && row.rays > 0)?;
        Some(last.rays as f64 / last.render_s / 1e6)
    }
}

/// Returns the efficiency of an estimator with a squared error after seconds of render time, its
/// inverse product; `None` unless it is positive and finite.
pub fn efficiency(squared_error: f64, render_s: f64) -> Option<f64> {
    Some(1.0 / (squared_error * render_s)).filter(|e| e.is_finite() && *e > 0.0)
}
