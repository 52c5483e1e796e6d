//! The plan of a night: cells in a defined order, each with an identity that determines its run id.
//!
//! [`expand`] makes the plan from an [`ExperimentSpec`](super::ExperimentSpec). Axes vary slowest
//! first in the order of their declaration; repeats vary fastest. Planning renders nothing, but it
//! reads every scene and checks every name, size and stop rule, so that a night does not fail after
//! hours over an error that could have been reported at its start.

mod axes;
mod cell_identity;
mod error;
mod estimate;
mod expand;
pub mod identity;
pub mod identity_check;
mod order;
mod path;
mod reach;
mod resolve;
mod sheet_check;
mod technique_names;
mod warnings;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

pub use axes::{MAX_CELLS, Overrides};
pub use cell_identity::CellIdentity;
pub use error::PlanError;
pub use estimate::Estimate;
pub use expand::expand;
pub use reach::unreachable_thresholds;
pub use resolve::{LoadScene, LoadedScene};
pub use technique_names::integrator_help;

use super::outcome::CellRef;
use super::shards::{Shard, split};
use super::spec::{FigureSpec, MeasureSpec, NightSpec, Point, Presentation, SheetSpec, TableSpec};
use super::stop::StopRule;
use lumbre_light::scene::{Note, SceneDesc};
use lumbre_render::Settings;
use serde::Serialize;

/// Id of a run: BLAKE3 hash of everything that determines its picture and its measurements, as 32
/// hex digits.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunId(pub String);

impl std::fmt::Display for RunId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// A cell: one repeat of one point of the sweep.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Id of its run.
    pub id: RunId,
    /// Index of the first cell with this id, whose folder has the files of the run. Several cells
    /// are one run where an axis has no effect.
    pub first: usize,
    /// Axis values in the order of the axes.
    pub point: Point,
    /// Number of the repeat, from 0.
    pub repeat: u32,
    /// For a double of the A/A check, the repeat of the same point that it doubles; otherwise
    /// `None`. Doubles appear in no table and no figure: see [`aa_check`](super::aa_check).
    pub double_of: Option<u32>,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Resolved render settings: resolution and depth are those of the script or else of the scene,
    /// and a backend replaces `auto`.
    pub config: Arc<Settings>,
    /// Scene with the cell's changes applied; cells with the same file and changes share it.
    pub scene: Arc<SceneDesc>,
    /// When the cell is finished.
    pub stop: StopRule,
    /// Index into [`Plan::references`].
    pub reference: Option<usize>,
    /// Readable relative path: `scene=cornell/depth=5/rep=0`.
    pub path: String,
    /// Canonical form whose hash is `id`.
    pub identity: CellIdentity,
}

impl Cell {
    /// Returns the repeat that the cell is compared within: its own, or for a double that of its
    /// original.
    pub fn paired_repeat(&self) -> u32 {
        self.double_of.unwrap_or(self.repeat)
    }
}

/// A reference that cells are measured against.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Id of the reference.
    pub id: RunId,
    /// Origin of the picture.
    pub source: ReferenceSource,
    /// Canonical form whose hash is `id`.
    pub identity: lumbre_light::value::Value,
    /// Comparison with a second technique, if requested.
    pub bias_check: Option<BiasCheck>,
}

impl Reference {
    /// Returns its shards in order; empty if it is rendered as a whole. `index` is its index in
    /// [`Plan::references`].
    pub fn shards(&self, index: usize) -> Vec<Shard> {
        match &self.source {
            ReferenceSource::Render {
                shard_samples: Some(size),
                stop: StopRule::Samples(total),
                ..
            } => split(index, *size, *total),
            _ => Vec::new(),
        }
    }

    /// Returns its stem id (see [`ReferenceSource::Render`]), if it is rendered.
    pub fn stem(&self) -> Option<&str> {
        match &self.source {
            ReferenceSource::Render { stem, .. } => Some(&stem.0),
            ReferenceSource::File { .. } => None,
        }
    }

    /// Returns the BLAKE3 hash of its file in hexadecimal, if it is an image file.
    pub fn file_hash(&self) -> Option<&str> {
        self.identity.as_map()?.get(identity::FILE)?.as_str()
    }
}

/// Planned comparison of a reference with the same picture by a second technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BiasCheck {
    /// Index of the second picture into [`Plan::references`]; no cell is measured against it.
    pub with: usize,
    /// False discovery rate: the expected share of blocks reported as different that differ only by
    /// chance.
    pub rate: f64,
}

/// Origin of a reference.
#[derive(Clone, Debug)]
pub enum ReferenceSource {
    /// Rendered by Lumbre.
    Render {
        /// Resolved render settings, as in [`Cell::config`].
        config: Arc<Settings>,
        /// Scene with all changes applied.
        scene: Arc<SceneDesc>,
        /// Seeds of its two independent halves; different from those of all cells.
        seeds: [u64; 2],
        /// Id shared by references that differ only in their stop rule. A shorter one can be
        /// continued to a longer one.
        stem: RunId,
        /// When the reference is finished.
        stop: StopRule,
        /// Samples per pixel of each of its [shards](super::shards), if it is split.
        shard_samples: Option<u64>,
    },
    /// A file, identified by the hash of its content.
    File {
        /// Path of the file.
        file: PathBuf,
        /// Origin of the file as stated by the script; empty if not stated.
        source: String,
    },
}

/// A point that is left out of the plan.
#[derive(Clone, Debug, PartialEq)]
pub struct Skipped {
    /// Axis values of the point.
    pub point: Point,
    /// Reason of the skip rule, or what is missing on this machine.
    pub reason: String,
    /// Whether it is left out because an external program is not installed on this machine.
    pub absent: bool,
}

/// Commands of an external technique or of a notice that a script declares, as words.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
pub struct PlannedCommand {
    /// Name of the technique, or the events of the notice.
    pub technique: String,
    /// Command that renders or is run at the events; placeholders of runs and waves are in braces.
    pub command: Vec<String>,
    /// Command that prints the version, if there is one.
    pub version: Option<Vec<String>>,
}

impl PlannedCommand {
    /// Returns the command of a notice as the plan shows it.
    pub(super) fn of_notice(notice: &crate::experiment::spec::Notice) -> PlannedCommand {
        let events: Vec<&str> = notice.events.iter().map(|event| event.name()).collect();
        PlannedCommand {
            technique: format!("notify ({})", events.join(", ")),
            command: notice.command.clone(),
            version: None,
        }
    }
}

/// Plan of a night.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    /// Name of the experiment.
    pub name: String,
    /// Hash of all identities, figures, tables and sheets, hex. The name of the folder has its first
    /// digits.
    pub hash: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Axis names, slowest first.
    pub axes: Vec<String>,
    /// Settings of the command line, such as `max_depth = 3`.
    pub settings: Vec<String>,
    /// Cells in the order of the sweep.
    pub cells: Vec<Cell>,
    /// References that the cells need, and second pictures of bias checks, without repetition.
    pub references: Vec<Reference>,
    /// Points that are left out.
    pub skipped: Vec<Skipped>,
    /// Notes on contents of scene files that are not supported, without repetition.
    pub notes: Vec<Note>,
    /// Warnings about probable mistakes, such as a stop rule that may never hold or an axis without
    /// effect.
    pub warnings: Vec<String>,
    /// Metrics, their interval, and what is stored of each run.
    pub measure: MeasureSpec,
    /// Commands that its runs need, without repetition, and those of its notices.
    pub commands: Vec<PlannedCommand>,
    /// Whether these commands may run.
    pub commands_allowed: bool,
    /// Settings of its nights.
    pub night: NightSpec,
    /// Figures to draw.
    pub figures: Vec<FigureSpec>,
    /// Tables to write.
    pub tables: Vec<TableSpec>,
    /// Sheets of pictures and frames to draw.
    pub sheets: Vec<SheetSpec>,
    /// Presentation of the results in figures, tables and reports; not part of `hash`.
    pub report: Presentation,
    /// Text of the script.
    pub script_text: String,
    /// Files of its scenes and modules of its script, if known to the caller that expanded
    /// the plan.
    pub files: BTreeSet<PathBuf>,
}

/// Returns distinct reasons in order, each with the number of times that it was given.
pub(crate) fn counted_reasons<'a>(reasons: impl Iterator<Item = &'a str>) -> Vec<(String, usize)> {
    let mut counted: Vec<(String, usize)> = Vec::new();
    for reason in reasons {
        match counted.iter_mut().find(|(known, _)| known == reason) {
            Some((_, count)) => *count += 1,
            None => counted.push((reason.to_owned(), 1)),
        }
    }
    counted
}

impl Plan {
    /// Returns the reasons why points need a program that is not installed, each with its number of
    /// points.
    pub fn absent(&self) -> Vec<(String, usize)> {
        let absent = self.skipped.iter().filter(|skipped| skipped.absent);
        counted_reasons(absent.map(|skipped| skipped.reason.as_str()))
    }

    /// Returns the reasons why points are left out, each with its number of points.
    pub fn skip_reasons(&self) -> Vec<(String, usize)> {
        counted_reasons(self.skipped.iter().map(|skipped| skipped.reason.as_str()))
    }

    /// Returns the names of the metric columns, in the order of
    /// [`WaveRow::metrics`](super::WaveRow::metrics).
    pub fn columns(&self) -> Vec<String> {
        self.measure
            .metrics
            .iter()
            .map(|metric| metric.column.clone())
            .collect()
    }

    /// Returns the cells that are measured against each reference.
    pub fn measured_cells(&self) -> Vec<Vec<usize>> {
        let mut measured = vec![Vec::new(); self.references.len()];
        for (index, cell) in self.cells.iter().enumerate() {
            if let Some(reference) = cell.reference {
                measured[reference].push(index);
            }
        }
        measured
    }

    /// Returns the first cell that is the same run as a cell: see [`Cell::first`].
    ///
    /// # Panics
    /// If the index is out of range.
    pub fn first_cell(&self, index: usize) -> &Cell {
        &self.cells[self.cells[index].first]
    }

    /// Returns the id of a cell or a reference.
    ///
    /// # Panics
    /// If the index is out of range.
    pub fn id(&self, cell: CellRef) -> &RunId {
        match cell {
            CellRef::Cell(i) => &self.cells[i].id,
            CellRef::Reference(i) => &self.references[i].id,
        }
    }
}
