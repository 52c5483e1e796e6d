//! A night: what was planned, and what is known of every run and reference.
//!
//! [`Night::planned`] begins with a plan, and [`Night::apply`] follows the events of the night, in
//! the process that renders, in dashboards, and in readers of a journal. Reports and lists read a
//! finished or unfinished night from its folder. Files may come from another machine or version, so
//! facts that they may lack are optional, and missing facts are not guessed.

mod apply;
mod plan;
pub mod reference;
pub mod run;
pub mod state_counts;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

use super::outcome::{CellRef, Outcome, WaveRow};
use super::spec::{FigureSpec, Presentation, SheetSpec, TableSpec};
use lumbre_light::scene::SceneDesc;
use lumbre_light::transport::integrator::bias_of;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::Settings;
use reference::{Reference, ReferenceOrigin};
use run::{Run, RunState, StopOutline};
use state_counts::StateCounts;

/// Plan of a night as a whole.
#[derive(Clone, Debug)]
pub struct NightPlan {
    /// Name of the experiment.
    pub name: String,
    /// Hash of the plan, hex.
    pub hash: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Axis names, slowest first.
    pub axes: Vec<String>,
    /// Settings of the command line, such as `max_depth = 3`.
    pub settings: Vec<String>,
    /// Whether cells differ in each axis, in the same order.
    pub varying: Vec<bool>,
    /// Whether any point is rendered more than once.
    pub is_repeated: bool,
    /// Metrics with their definitions, in the order of [`WaveRow::metrics`].
    pub metrics: Vec<MetricSpec>,
    /// Tone map of displayed pictures.
    pub display: Tonemap,
    /// Sheets of pictures and frames that the script requests.
    pub sheets: Vec<SheetSpec>,
    /// Presentation of the results that the script sets.
    pub report: Presentation,
    /// Order in which the runs are rendered, a name of [`Order`](super::spec::Order).
    pub order: String,
    /// Number of points left out by skip rules or for lack of a program.
    pub skipped: usize,
    /// Reasons why points need a program that is not installed, each with its number of points.
    pub absent: Vec<(String, usize)>,
    /// Figures that the script asks for.
    pub figures: Vec<FigureSpec>,
    /// Tables that the script asks for.
    pub tables: Vec<TableSpec>,
}

impl Default for NightPlan {
    fn default() -> NightPlan {
        NightPlan {
            name: String::new(),
            hash: String::new(),
            seed: 0,
            axes: Vec::new(),
            settings: Vec::new(),
            varying: Vec::new(),
            is_repeated: false,
            metrics: Vec::new(),
            display: Tonemap::Srgb { exposure: 0.0 },
            sheets: Vec::new(),
            report: Presentation::default(),
            order: String::new(),
            skipped: 0,
            absent: Vec::new(),
            figures: Vec::new(),
            tables: Vec::new(),
        }
    }
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

/// A night. Cloning it copies a pointer for each run.
#[derive(Clone, Debug, Default)]
pub struct Night {
    /// Plan of the night as a whole.
    pub plan: Arc<NightPlan>,
    /// Runs of all cells in the order of the plan. Reports leave out those that duplicate others
    /// for the A/A check: see [`Night::without_doubles`].
    pub runs: Vec<Arc<Run>>,
    /// References in the order of the plan.
    pub references: Vec<Arc<Reference>>,
    /// Folder of the night; empty if it is not read from files.
    pub folder: PathBuf,
    /// The machine on which the night last rendered, if recorded.
    pub machine: Option<Machine>,
    /// Messages about files that could not be read or do not belong here.
    pub notes: Vec<String>,
}

impl Night {
    /// Describes the settings of the command line, such as `run with max_depth = 3 on the command
    /// line`; empty without any.
    pub fn given_settings(&self) -> String {
        let given = &self.plan.settings;
        if given.is_empty() {
            return String::new();
        }
        format!("run with {} on the command line", given.join(", "))
    }

    /// Returns all references, then all cells.
    pub fn all(&self) -> impl Iterator<Item = CellRef> + use<> {
        let (references, runs) = (self.references.len(), self.runs.len());
        let references = (0..references).map(CellRef::Reference);
        references.chain((0..runs).map(CellRef::Cell))
    }

    /// Returns the number of runs and references that have ended, with whatever outcome.
    pub fn ended(&self) -> usize {
        let outcomes = self.all().filter_map(|cell| self.outcome(cell));
        outcomes.count()
    }

    /// Counts runs and references by state.
    pub fn counts(&self) -> StateCounts {
        StateCounts::of(self.all().filter_map(|cell| self.state(cell)))
    }

    /// Returns the id of a run or reference; empty if the plan has no such.
    pub fn id(&self, cell: CellRef) -> &str {
        let id = match cell {
            CellRef::Cell(i) => self.runs.get(i).map(|run| run.id.as_str()),
            CellRef::Reference(i) => self.references.get(i).map(|r| r.id.as_str()),
        };
        id.unwrap_or_default()
    }

    /// Returns the state of a run or reference; `None` if the plan has no such.
    pub fn state(&self, cell: CellRef) -> Option<&RunState> {
        match cell {
            CellRef::Cell(i) => self.runs.get(i).map(|run| &run.state),
            CellRef::Reference(i) => self.references.get(i).map(|reference| &reference.state),
        }
    }

    /// Returns the outcome of a run or reference that has ended.
    pub fn outcome(&self, cell: CellRef) -> Option<&Outcome> {
        self.state(cell)?.outcome()
    }

    /// Returns the newest measurement of a run or reference.
    pub fn last_row(&self, cell: CellRef) -> Option<&WaveRow> {
        match cell {
            CellRef::Cell(i) => self.runs.get(i)?.rows.last(),
            CellRef::Reference(i) => self.references.get(i)?.rows.last(),
        }
    }

    /// Returns the render settings of a run or reference, if known.
    pub fn settings(&self, cell: CellRef) -> Option<&Arc<Settings>> {
        match cell {
            CellRef::Cell(i) => self.runs.get(i)?.settings.as_ref(),
            CellRef::Reference(i) => self.references.get(i)?.settings.as_ref(),
        }
    }

    /// Returns the scene of a run or reference with all changes applied, if known.
    pub fn scene(&self, cell: CellRef) -> Option<&SceneDesc> {
        match cell {
            CellRef::Cell(i) => self.runs.get(i)?.content.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.content.as_deref(),
        }
    }

    /// Returns the stop rule of a run or reference, if known.
    pub fn stop(&self, cell: CellRef) -> Option<&StopOutline> {
        match cell {
            CellRef::Cell(i) => self.runs.get(i)?.stop.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.stop.as_deref(),
        }
    }

    /// Returns the night without runs that duplicate others for the A/A check, as reports show it.
    /// Indices of runs are no longer those of the plan's cells.
    pub fn without_doubles(mut self) -> Night {
        self.runs.retain(|run| run.double_of.is_none());
        self
    }

    /// Returns the references that runs are measured against, in the order of the plan.
    pub fn references_of_runs(&self) -> impl Iterator<Item = &Arc<Reference>> {
        let used: BTreeSet<usize> = self.runs.iter().filter_map(|run| run.reference).collect();
        let references = self.references.iter().enumerate();
        references.filter_map(move |(i, reference)| used.contains(&i).then_some(reference))
    }

    /// Returns the techniques of rendered references that are biased, with the source of the bias,
    /// sorted and without repetition.
    pub fn biased_references(&self) -> BTreeSet<(&str, &'static str)> {
        self.references_of_runs()
            .filter_map(|reference| {
                let integrator = reference.integrator()?;
                Some((integrator, bias_of(integrator)?))
            })
            .collect()
    }

    /// Returns sentences on references that are too noisy for ratios of a metric against them.
    pub fn noisy_references(&self) -> BTreeSet<String> {
        let too_noisy = |run: &Arc<Run>| {
            let reference = self.references.get(run.reference?)?;
            let ReferenceOrigin::Rendered { samples, .. } = &reference.origin else {
                return None;
            };
            let sentence = |metric: &MetricSpec| {
                let floor = run.floor(&metric.column)?;
                let needed = metric.samples_for_ratios(floor.value, *samples)?;
                Some(format!(
                    "The reference is too noisy for {}, which divides by it: nothing is claimed. A \
                     reference of {needed} samples per pixel would do; this one has {samples}.",
                    metric.row.label
                ))
            };
            Some(
                self.plan
                    .metrics
                    .iter()
                    .filter_map(sentence)
                    .collect::<Vec<_>>(),
            )
        };
        self.runs.iter().filter_map(too_noisy).flatten().collect()
    }

    /// Returns the devices of all finished runs in the order of the plan, without repetition.
    pub fn devices(&self) -> Vec<String> {
        let mut devices: Vec<String> = Vec::new();
        let finished = self.runs.iter().filter(|run| run.is_done());
        for device in finished.filter_map(|run| run.device.clone()) {
            if !devices.contains(&device) {
                devices.push(device);
            }
        }
        devices
    }

    /// Returns the index of a column in [`NightPlan::metrics`].
    pub fn metric_index(&self, name: &str) -> Option<usize> {
        let mut metrics = self.plan.metrics.iter();
        metrics.position(|metric| metric.column == name)
    }
}
