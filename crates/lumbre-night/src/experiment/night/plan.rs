//! The plan of a night: what a display and a report need of it, without its scenes and script.

use std::sync::Arc;

use super::reference::{Reference, ReferencePlan};
use super::run::{Run, RunPlan, StopOutline};
use super::{Night, NightPlan};
use crate::experiment::outcome::CellRef;
use crate::experiment::plan::{Plan, ReferenceSource};
use crate::experiment::stop::StopRule;
use lumbre_light::value::Value;

impl Night {
    /// Returns the night of a plan, of which nothing has been rendered.
    pub fn planned(plan: &Plan) -> Night {
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
        let runs = plan.cells.iter().map(|cell| RunPlan {
            id: cell.id.to_string(),
            path: cell.path.clone(),
            point: cell.point.clone(),
            repeat: cell.repeat,
            double_of: cell.double_of,
            seed: cell.seed,
            integrator: cell.config.integrator.clone(),
            backend: cell.config.backend.clone(),
            denoise: cell.config.denoise.as_ref().map(|d| d.name().to_owned()),
            scene: cell.config.scene.clone(),
            changes: cell.config.scene_changes(),
            max_depth: cell.config.max_depth,
            resolution: cell.config.resolution,
            reference: cell.reference,
            stop: Some(outline_stop(&cell.stop)),
            settings: Some(Arc::clone(&cell.config)),
            content: Some(Arc::clone(&cell.scene)),
            ..RunPlan::default()
        });
        let references = plan.references.iter().map(|reference| {
            let id = reference.id.to_string();
            match &reference.source {
                ReferenceSource::Render {
                    config,
                    scene,
                    stop,
                    ..
                } => ReferencePlan {
                    id,
                    settings: Some(Arc::clone(config)),
                    content: Some(Arc::clone(scene)),
                    stop: Some(StopOutline::from_rule(stop)),
                    ..ReferencePlan::default()
                },
                ReferenceSource::File { file, .. } => ReferencePlan {
                    id,
                    file: Some(file.clone()),
                    ..ReferencePlan::default()
                },
            }
        });
        let facts = NightPlan {
            name: plan.name.clone(),
            hash: plan.hash.clone(),
            seed: plan.seed,
            axes: plan.axes.clone(),
            settings: plan.settings.clone(),
            metrics: plan.measure.metrics.clone(),
            display: plan.measure.display,
            sheets: plan.sheets.clone(),
            report: plan.report.clone(),
            order: plan.night.order.name().to_owned(),
            skipped: plan.skipped.len(),
            absent: plan.absent(),
            figures: plan.figures.clone(),
            tables: plan.tables.clone(),
            ..NightPlan::default()
        };
        Night::new(facts, runs.collect(), references.collect())
    }

    /// Returns a night of which nothing has been rendered. Fills in which axes vary, whether there
    /// are repeats, and the axis values that distinguish each reference from the others: those that all cells measured
    /// against it share, of axes in which references differ.
    pub fn new(
        mut plan: NightPlan,
        runs: Vec<RunPlan>,
        mut references: Vec<ReferencePlan>,
    ) -> Night {
        plan.varying = varying(plan.axes.len(), &runs);
        plan.is_repeated = runs.iter().any(|run| run.repeat > 0);
        let values = distinctions(&plan.axes, &runs, references.len());
        for (reference, values) in references.iter_mut().zip(values) {
            reference.values = values;
        }
        let run = |planned| Run {
            planned: Arc::new(planned),
            ..Run::default()
        };
        let reference = |planned| Reference {
            planned: Arc::new(planned),
            ..Reference::default()
        };
        Night {
            plan: Arc::new(plan),
            runs: runs.into_iter().map(run).map(Arc::new).collect(),
            references: references
                .into_iter()
                .map(reference)
                .map(Arc::new)
                .collect(),
            ..Night::default()
        }
    }

    /// Returns the name of a reference for people: integrator and scene or the file, and the axis
    /// values that distinguish it, such as `bpt of cornell.scn, depth=5`.
    pub fn reference_name(&self, reference: usize) -> String {
        let Some(reference) = self.references.get(reference) else {
            return String::new();
        };
        let file_name = |path: &str| {
            let mut parts = path.rsplit(['/', '\\']);
            parts
                .find(|part| !part.is_empty())
                .unwrap_or(path)
                .to_owned()
        };
        let source = match (&reference.settings, &reference.file) {
            (Some(settings), _) => {
                format!("{} of {}", settings.integrator, file_name(&settings.scene))
            }
            (None, Some(file)) => file_name(&file.to_string_lossy()),
            (None, None) => String::new(),
        };
        let value = |(axis, value): &(String, String)| format!("{axis}={value}");
        let values: Vec<String> = reference.values.iter().map(value).collect();
        if values.is_empty() {
            source
        } else {
            format!("{source}, {}", values.join(" "))
        }
    }

    /// Returns the readable path of a cell, or the name of a reference after the word `reference`.
    pub fn path(&self, cell: CellRef) -> String {
        match cell {
            CellRef::Cell(i) => self
                .runs
                .get(i)
                .map_or_else(String::new, |r| r.path.clone()),
            CellRef::Reference(i) => format!("reference {}", self.reference_name(i)),
        }
    }
}

/// Returns for every axis whether any two runs differ in it.
fn varying(axes: usize, runs: &[RunPlan]) -> Vec<bool> {
    let varies = |axis: usize| {
        let mut values = runs.iter().map(|run| run.point.get(axis).map(|p| &p.1));
        let first = values.next();
        values.any(|value| Some(value) != first)
    };
    (0..axes).map(varies).collect()
}

/// Returns the axis values that distinguish each reference from the others.
fn distinctions(
    axes: &[String],
    runs: &[RunPlan],
    references: usize,
) -> Vec<Vec<(String, String)>> {
    // The value that the runs of a reference share on each axis: not seen, one, or several.
    let mut shared: Vec<Vec<Option<Option<&Value>>>> = vec![vec![None; axes.len()]; references];
    for run in runs {
        let Some(row) = run.reference.and_then(|i| shared.get_mut(i)) else {
            continue;
        };
        for (known, (_, value)) in row.iter_mut().zip(&run.point) {
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
    let differing: Vec<usize> = (0..axes.len()).filter(differs).collect();
    let values_of = |row: &Vec<Option<Option<&Value>>>| -> Vec<(String, String)> {
        let known = differing
            .iter()
            .filter_map(|axis| Some((axes[*axis].clone(), row[*axis]??.to_string())));
        known.collect()
    };
    shared.iter().map(values_of).collect()
}
