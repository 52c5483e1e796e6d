//! The plan: cells in a defined order, each with an identity that says when it has to run again.
//!
//! [`expand`] makes it from a script's [`Spec`](super::Spec). Axes vary slowest first in the order of their
//! declaration, repeats fastest of all. Nothing is rendered here, but every scene is read and every name, size and
//! stop rule checked, so that a night does not fail at four in the morning over something that was known at ten.

mod axes;
mod error;
mod estimate;
mod expand;
pub mod identity;
mod order;
mod path;
mod reach;
mod resolve;

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::sync::Arc;

pub use axes::{MAX_CELLS, Overrides};
pub use error::PlanError;
pub use estimate::Estimate;
pub use expand::expand;
pub use reach::unreachable;
pub use resolve::{LoadScene, LoadedScene};

use super::event::CellRef;
use super::parts::{Part, split};
use super::spec::{CellConfig, FigureSpec, Measure, NightSpec, Point, TableSpec};
use super::stop::StopRule;
use crate::scene::{Note, SceneDesc};

/// The identity of a run: blake3 of everything that decides its picture and its measurements, as 32 hex digits.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct RunId(pub String);

impl std::fmt::Display for RunId {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

/// A cell: one point of the sweep, once.
#[derive(Clone, Debug)]
pub struct Cell {
    /// Its identity.
    pub id: RunId,
    /// Axis values in the order of the axes.
    pub point: Point,
    /// Number of the repeat, from 0.
    pub repeat: u32,
    /// In the A/A check, the repeat of the same point whose double this is. Such a cell stands in no table and no figure:
    /// see [`control`](super::control).
    pub control: Option<u32>,
    /// Seed of all its random numbers.
    pub seed: u64,
    /// What it renders, with nothing left open: resolution and depth are the script's or else the scene's, and the
    /// backend is the one that `auto` stands for.
    pub config: Arc<CellConfig>,
    /// The scene, with the cell's changes made; cells with the same file and changes share one.
    pub scene: Arc<SceneDesc>,
    /// When it is finished.
    pub stop: StopRule,
    /// Index into [`Plan::references`].
    pub reference: Option<usize>,
    /// Readable relative path: `scene=cornell/depth=5/rep=0`.
    pub path: String,
    /// The canonical form whose hash is `id`, for people and for `config.json`.
    pub identity: crate::value::Value,
}

impl Cell {
    /// The repeat that it belongs to: its own, or that of the cell whose double it is.
    pub fn pair(&self) -> u32 {
        self.control.unwrap_or(self.repeat)
    }
}

/// A reference that cells are measured against.
#[derive(Clone, Debug)]
pub struct Reference {
    /// Its identity.
    pub id: RunId,
    /// Where it comes from.
    pub source: ReferenceSource,
    /// The canonical form whose hash is `id`.
    pub identity: crate::value::Value,
    /// What it is compared with.
    pub agree: Option<Agree>,
}

impl Reference {
    /// Its parts in order, where it is rendered in several; `place` is its index in [`Plan::references`].
    pub fn parts(&self, place: usize) -> Vec<Part> {
        match &self.source {
            ReferenceSource::Render { part: Some(size), stop: StopRule::Samples(total), .. } => {
                split(place, *size, *total)
            }
            _ => Vec::new(),
        }
    }

    /// What it shares with references that differ only in when they end, if it is rendered.
    pub fn stem(&self) -> Option<&str> {
        match &self.source {
            ReferenceSource::Render { stem, .. } => Some(&stem.0),
            ReferenceSource::File { .. } => None,
        }
    }
}

/// The comparison of a reference with the same picture by a second technique.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Agree {
    /// Index of the second picture into [`Plan::references`]; no cell is measured against it.
    pub with: usize,
    /// Of the blocks that are called different, the share that may be so by chance.
    pub rate: f64,
}

/// Where a reference comes from.
#[derive(Clone, Debug)]
pub enum ReferenceSource {
    /// Lumbre renders it.
    Render {
        /// What it renders, with nothing left open, as in [`Cell::config`].
        config: Arc<CellConfig>,
        /// The scene, with the changes made.
        scene: Arc<SceneDesc>,
        /// The seeds of its two independent halves; never one of a cell's.
        seeds: [u64; 2],
        /// What it shares with references that differ only in when they end: one can be the beginning of another.
        stem: RunId,
        /// When it is good enough.
        stop: StopRule,
        /// Samples per pixel of each of its [parts](super::parts), where it is rendered in several.
        part: Option<u64>,
    },
    /// A file; the hash of its content is its identity.
    File {
        /// The file.
        file: PathBuf,
        /// Who made it and how, in the script's words; empty if it does not say.
        source: String,
    },
}

/// A point that is left out.
#[derive(Clone, Debug, PartialEq)]
pub struct Skipped {
    /// The point.
    pub point: Point,
    /// The skip rule's reason, or what this machine lacks.
    pub reason: String,
    /// Whether it is left out because of the machine, which does not have the other program that it needs.
    pub absent: bool,
}

/// A whole night.
#[derive(Clone, Debug)]
pub struct Plan {
    /// The experiment's name.
    pub name: String,
    /// Hash of all identities, figures and tables, hex; the folder's name carries its first digits.
    pub hash: String,
    /// Seed of the experiment.
    pub seed: u64,
    /// Axis names in order.
    pub axes: Vec<String>,
    /// The cells in the order in which they run.
    pub cells: Vec<Cell>,
    /// The references that the cells need, each once.
    pub references: Vec<Reference>,
    /// Points left out.
    pub skipped: Vec<Skipped>,
    /// What scene files say that could not be honoured, each once.
    pub notes: Vec<Note>,
    /// What is allowed but probably not meant: a stop rule that may never hold, an axis that changes nothing.
    pub warnings: Vec<String>,
    /// What is measured and kept.
    pub measure: Measure,
    /// How its nights go.
    pub night: NightSpec,
    /// Figures to draw.
    pub figures: Vec<FigureSpec>,
    /// Tables to write.
    pub tables: Vec<TableSpec>,
    /// The script's text.
    pub script_text: String,
    /// The files that its scenes were made of and the modules of its script, where whoever expanded it knows them.
    pub files: BTreeSet<PathBuf>,
}

impl Plan {
    /// What this machine lacks and how many points are left out for that, each reason once.
    pub fn absent(&self) -> Vec<(&str, usize)> {
        let mut reasons: Vec<(&str, usize)> = Vec::new();
        for skipped in self.skipped.iter().filter(|s| s.absent) {
            match reasons.iter_mut().find(|(reason, _)| *reason == skipped.reason) {
                Some((_, count)) => *count += 1,
                None => reasons.push((&skipped.reason, 1)),
            }
        }
        reasons
    }

    /// The names of the metric columns, in the order of [`WaveRow::metrics`](super::WaveRow::metrics).
    pub fn columns(&self) -> Vec<String> {
        self.measure.metrics.iter().map(|metric| metric.column.clone()).collect()
    }

    /// The identity of a cell or a reference.
    ///
    /// # Panics
    /// When the index is not one of this plan's.
    pub fn id(&self, cell: CellRef) -> &RunId {
        match cell {
            CellRef::Cell(i) => &self.cells[i].id,
            CellRef::Reference(i) => &self.references[i].id,
        }
    }
}
