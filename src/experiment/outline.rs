//! What it takes to show a night: its plan, as far as a reader knows it.
//!
//! The process that renders makes it [of its plan](Outline::of); one that only watches reads it from the files of the
//! night's folder, which say less: a watcher has neither the scenes nor the script.

use std::path::PathBuf;
use std::sync::Arc;

use super::event::CellRef;
use super::plan::{Plan, ReferenceSource};
use super::spec::{CellConfig, Point};
use super::stop::StopRule;
use crate::metrics::MetricSpec;
use crate::metrics::tonemap::Tonemap;
use crate::scene::SceneDesc;

/// A stop rule, and how it reads.
#[derive(Clone, Debug, PartialEq)]
pub struct Until {
    /// The rule; parts that a reader of files cannot know stand as predicates.
    pub rule: StopRule,
    /// The rule in words.
    pub words: String,
}

impl Until {
    /// A rule with its own words.
    pub fn of(rule: &StopRule) -> Arc<Until> {
        Arc::new(Until { rule: rule.clone(), words: rule.describe() })
    }
}

/// A cell, as far as it is known.
#[derive(Clone, Debug)]
pub struct CellOutline {
    /// Axis values in the order of the axes.
    pub point: Point,
    /// Number of the repeat, from 0.
    pub repeat: u32,
    /// When it is finished.
    pub until: Option<Arc<Until>>,
    /// Index of the reference that it is measured against.
    pub reference: Option<usize>,
    /// What it renders.
    pub config: Option<Arc<CellConfig>>,
    /// The scene, with the cell's changes made.
    pub scene: Option<Arc<SceneDesc>>,
}

/// A reference, as far as it is known.
#[derive(Clone, Debug, Default)]
pub struct ReferenceOutline {
    /// The file that it is, if it is not rendered.
    pub file: Option<PathBuf>,
    /// What it renders, otherwise.
    pub config: Option<Arc<CellConfig>>,
    /// The scene, with the changes made.
    pub scene: Option<Arc<SceneDesc>>,
    /// When it is good enough.
    pub until: Option<Arc<Until>>,
}

/// A plan, as far as it is known.
#[derive(Clone, Debug)]
pub struct Outline {
    /// The experiment's name.
    pub name: String,
    /// The plan's hash, hex.
    pub hash: String,
    /// Axis names in order.
    pub axes: Vec<String>,
    /// The cells in the order of the plan.
    pub cells: Vec<CellOutline>,
    /// The references in the order of the plan.
    pub references: Vec<ReferenceOutline>,
    /// Whether any point is rendered more than once.
    pub repeated: bool,
    /// Number of points left out.
    pub skipped: usize,
    /// The metrics in the order of their columns.
    pub metrics: Vec<MetricSpec>,
    /// The tone map of pictures for people.
    pub display: Tonemap,
}

impl Outline {
    /// All that is to be shown of a plan.
    pub fn of(plan: &Plan) -> Outline {
        let mut last: Option<(&StopRule, Arc<Until>)> = None;
        let mut until = |rule| match &last {
            // Neighbours mostly share their rule, and its words.
            Some((same, until)) if *same == rule => Arc::clone(until),
            _ => {
                let until = Until::of(rule);
                last = Some((rule, Arc::clone(&until)));
                until
            }
        };
        let cells = plan.cells.iter().map(|cell| CellOutline {
            point: cell.point.clone(),
            repeat: cell.repeat,
            until: Some(until(&cell.stop)),
            reference: cell.reference,
            config: Some(Arc::clone(&cell.config)),
            scene: Some(Arc::clone(&cell.scene)),
        });
        let cells: Vec<CellOutline> = cells.collect();
        let references = plan.references.iter().map(|reference| match &reference.source {
            ReferenceSource::Render { config, scene, stop, .. } => ReferenceOutline {
                file: None,
                config: Some(Arc::clone(config)),
                scene: Some(Arc::clone(scene)),
                until: Some(Until::of(stop)),
            },
            ReferenceSource::File { file, .. } => ReferenceOutline { file: Some(file.clone()), ..Default::default() },
        });
        Outline {
            name: plan.name.clone(),
            hash: plan.hash.clone(),
            axes: plan.axes.clone(),
            repeated: cells.iter().any(|cell| cell.repeat > 0),
            references: references.collect(),
            cells,
            skipped: plan.skipped.len(),
            metrics: plan.measure.metrics.clone(),
            display: plan.measure.display,
        }
    }

    /// What a cell or reference renders, where it is known.
    pub fn config(&self, cell: CellRef) -> Option<&Arc<CellConfig>> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.config.as_ref(),
            CellRef::Reference(i) => self.references.get(i)?.config.as_ref(),
        }
    }

    /// The scene of a cell or reference, where it is known.
    pub fn scene(&self, cell: CellRef) -> Option<&SceneDesc> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.scene.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.scene.as_deref(),
        }
    }

    /// When a cell or reference is finished, where it is known.
    pub fn until(&self, cell: CellRef) -> Option<&Until> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.until.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.until.as_deref(),
        }
    }
}
