//! Outline of a plan: the part of it that a display needs.
//!
//! The rendering process makes it [from its plan](PlanOutline::from_plan). A process that only
//! watches reads it from the files of the night's folder, which contain neither scenes nor script,
//! so that many fields are optional.

use std::path::PathBuf;
use std::sync::Arc;

use super::outcome::CellRef;
use super::plan::{Plan, ReferenceSource};
use super::spec::Point;
use super::stop::StopRule;
use lumbre_light::scene::SceneDesc;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::Settings;

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

/// Outline of a cell.
#[derive(Clone, Debug)]
pub struct CellOutline {
    /// Axis values in the order of the axes.
    pub point: Point,
    /// Number of the repeat, from 0.
    pub repeat: u32,
    /// Stop rule, if known.
    pub stop: Option<Arc<StopOutline>>,
    /// Index of the reference that the cell is measured against.
    pub reference: Option<usize>,
    /// Render settings, if known.
    pub config: Option<Arc<Settings>>,
    /// Scene with the cell's changes applied, if known.
    pub scene: Option<Arc<SceneDesc>>,
}

/// Outline of a reference.
#[derive(Clone, Debug, Default)]
pub struct ReferenceOutline {
    /// Names and values of the axes that distinguish it from other references.
    pub values: Vec<(String, String)>,
    /// Image file, if it is not rendered.
    pub file: Option<PathBuf>,
    /// Render settings, if it is rendered.
    pub config: Option<Arc<Settings>>,
    /// Scene with all changes applied, if known.
    pub scene: Option<Arc<SceneDesc>>,
    /// Stop rule, if it is rendered.
    pub stop: Option<Arc<StopOutline>>,
}

/// Outline of a plan.
#[derive(Clone, Debug)]
pub struct PlanOutline {
    /// Name of the experiment.
    pub name: String,
    /// Hash of the plan, hex.
    pub hash: String,
    /// Axis names, slowest first.
    pub axes: Vec<String>,
    /// Whether cells differ in each axis, in the same order.
    pub varying: Vec<bool>,
    /// Cells in the order of the plan.
    pub cells: Vec<CellOutline>,
    /// References in the order of the plan.
    pub references: Vec<ReferenceOutline>,
    /// Whether any point is rendered more than once.
    pub repeated: bool,
    /// Number of points left out by skip rules or for lack of a program.
    pub skipped: usize,
    /// Metrics in the order of their columns.
    pub metrics: Vec<MetricSpec>,
    /// Tone map for displayed pictures.
    pub display: Tonemap,
}

impl PlanOutline {
    /// Makes the outline of a plan.
    pub fn from_plan(plan: &Plan) -> PlanOutline {
        let mut last: Option<(&StopRule, Arc<StopOutline>)> = None;
        let mut outline_stop = |rule| match &last {
            // Neighbouring cells mostly have the same rule; describe it once.
            Some((same, stop)) if *same == rule => Arc::clone(stop),
            _ => {
                let stop = StopOutline::from_rule(rule);
                last = Some((rule, Arc::clone(&stop)));
                stop
            }
        };
        let cells = plan.cells.iter().map(|cell| CellOutline {
            point: cell.point.clone(),
            repeat: cell.repeat,
            stop: Some(outline_stop(&cell.stop)),
            reference: cell.reference,
            config: Some(Arc::clone(&cell.config)),
            scene: Some(Arc::clone(&cell.scene)),
        });
        let cells: Vec<CellOutline> = cells.collect();
        let references = plan
            .references
            .iter()
            .map(|reference| match &reference.source {
                ReferenceSource::Render {
                    config,
                    scene,
                    stop,
                    ..
                } => ReferenceOutline {
                    values: Vec::new(),
                    file: None,
                    config: Some(Arc::clone(config)),
                    scene: Some(Arc::clone(scene)),
                    stop: Some(StopOutline::from_rule(stop)),
                },
                ReferenceSource::File { file, .. } => ReferenceOutline {
                    file: Some(file.clone()),
                    ..Default::default()
                },
            });
        PlanOutline {
            name: plan.name.clone(),
            hash: plan.hash.clone(),
            axes: plan.axes.clone(),
            varying: Vec::new(),
            repeated: cells.iter().any(|cell| cell.repeat > 0),
            references: references.collect(),
            cells,
            skipped: plan.skipped.len(),
            metrics: plan.measure.metrics.clone(),
            display: plan.measure.display,
        }
        .with_distinctions()
    }

    /// Fills in which axes vary, and the axis values that distinguish each reference from the
    /// others: those that all cells measured against it share, of axes in which references differ.
    pub(crate) fn with_distinctions(mut self) -> PlanOutline {
        let axes = self.axes.len();
        let value = |cell: &CellOutline, axis: usize| cell.point.get(axis).map(|p| p.1.clone());
        let varies = |axis: usize| {
            let mut values = self.cells.iter().map(|cell| value(cell, axis));
            let first = values.next();
            values.any(|value| Some(value) != first)
        };
        self.varying = (0..axes).map(varies).collect();
        // The value that the cells of a reference share on each axis: not seen, one, or several.
        let mut shared: Vec<Vec<Option<Option<&Value>>>> =
            vec![vec![None; axes]; self.references.len()];
        for cell in &self.cells {
            let Some(row) = cell.reference.and_then(|i| shared.get_mut(i)) else {
                continue;
            };
            for (known, (_, value)) in row.iter_mut().zip(&cell.point) {
                *known = match known {
                    None => Some(Some(value)),
                    Some(Some(same)) if *same == value => Some(Some(value)),
                    Some(_) => Some(None),
                };
            }
        }
        let differs = |axis: &usize| {
            shared
                .windows(2)
                .any(|pair| pair[0][*axis] != pair[1][*axis])
        };
        let differing: Vec<usize> = (0..axes).filter(differs).collect();
        let values_of = |row: &Vec<Option<Option<&Value>>>| -> Vec<(String, String)> {
            let known = differing
                .iter()
                .filter_map(|axis| Some((self.axes[*axis].clone(), row[*axis]??.to_string())));
            known.collect()
        };
        let values: Vec<Vec<(String, String)>> = shared.iter().map(values_of).collect();
        for (reference, values) in self.references.iter_mut().zip(values) {
            reference.values = values;
        }
        self
    }

    /// Returns the name of a reference for people: integrator and scene or the file, and the axis
    /// values that distinguish it, such as `bpt of cornell.scn, depth=5`.
    pub fn reference_name(&self, reference: usize) -> String {
        let Some(outline) = self.references.get(reference) else {
            return String::new();
        };
        let file_name = |path: &str| {
            let mut parts = path.rsplit(['/', '\\']);
            parts
                .find(|part| !part.is_empty())
                .unwrap_or(path)
                .to_owned()
        };
        let source = match (&outline.config, &outline.file) {
            (Some(config), _) => format!("{} of {}", config.integrator, file_name(&config.scene)),
            (None, Some(file)) => file_name(&file.to_string_lossy()),
            (None, None) => String::new(),
        };
        let value = |(axis, value): &(String, String)| format!("{axis}={value}");
        let values: Vec<String> = outline.values.iter().map(value).collect();
        if values.is_empty() {
            source
        } else {
            format!("{source}, {}", values.join(" "))
        }
    }

    /// Render settings of a cell or reference, if known.
    pub fn config(&self, cell: CellRef) -> Option<&Arc<Settings>> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.config.as_ref(),
            CellRef::Reference(i) => self.references.get(i)?.config.as_ref(),
        }
    }

    /// Scene of a cell or reference, if known.
    pub fn scene(&self, cell: CellRef) -> Option<&SceneDesc> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.scene.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.scene.as_deref(),
        }
    }

    /// Stop rule of a cell or reference, if known.
    pub fn stop(&self, cell: CellRef) -> Option<&StopOutline> {
        match cell {
            CellRef::Cell(i) => self.cells.get(i)?.stop.as_deref(),
            CellRef::Reference(i) => self.references.get(i)?.stop.as_deref(),
        }
    }
}
