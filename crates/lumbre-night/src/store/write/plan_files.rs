//! Plans and cells as files: the content of `plan.json` and of `config.json`.

use std::collections::BTreeMap;

use crate::experiment::plan::{Reference, ReferenceSource};
use crate::experiment::spec::{Presentation, SheetSpec};
use crate::experiment::{CellRef, Plan, Point, StopRule};
use crate::store::layout;
use crate::store::schema::plan::{
    BiasCheckPlan, FileReference, Measurement, MetricRecord, NightSettings, PlanFile, PlannedCell,
    PlannedReference, PresentationRecord, RenderedReference, SceneNote, SkippedPoint, StopRecord,
};
use crate::store::schema::run::ConfigFile;
use crate::store::schema::values::Named;
use lumbre_light::transport::delay;
use lumbre_light::value::Value;
use lumbre_metrics::MetricSpec;
use lumbre_render::Settings;
use lumbre_render::settings::StoredSettings;

/// Returns the content of `plan.json`.
pub fn plan_file(plan: &Plan) -> PlanFile {
    let mut stops: Vec<&StopRule> = Vec::new();
    let mut indices = BTreeMap::new();
    let mut stop_index = |rule| {
        *indices.entry(format!("{rule:?}")).or_insert_with(|| {
            stops.push(rule);
            stops.len() - 1
        })
    };
    let cells = plan
        .cells
        .iter()
        .enumerate()
        .map(|(i, cell)| planned_cell(plan, i, stop_index(&cell.stop)))
        .collect();
    let references = plan.references.iter();
    PlanFile {
        name: plan.name.clone(),
        hash: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        settings: plan.settings.clone(),
        night: NightSettings {
            order: plan.night.order.name().to_owned(),
            warmup: plan.night.warmup.map(|warmup| warmup.describe()),
        },
        measure: Measurement {
            every_s: plan.measure.every_s,
            metrics: plan.measure.metrics.iter().map(metric_record).collect(),
            display: plan.measure.display.to_value(),
        },
        cells,
        stops: stops.into_iter().map(stop_record).collect(),
        references: references
            .map(|reference| planned_reference(plan, reference))
            .collect(),
        skipped: plan
            .skipped
            .iter()
            .map(|skipped| SkippedPoint {
                point: point_record(&skipped.point),
                reason: skipped.reason.clone(),
                absent: skipped.absent,
            })
            .collect(),
        warnings: plan.warnings.clone(),
        notes: plan
            .notes
            .iter()
            .map(|note| SceneNote {
                file: note.file.display().to_string(),
                place: note.place.clone(),
                message: note.message.clone(),
            })
            .collect(),
        figures: plan.figures.clone(),
        tables: plan.tables.clone(),
        sheets: plan.sheets.iter().map(|s| s.options.clone()).collect(),
        report: (plan.report != Presentation::default()).then(|| PresentationRecord {
            display: plan.report.display.map_or(Value::Nil, |d| d.to_value()),
            names: plan.report.names.clone(),
            colours: plan.report.colours.clone(),
            notes: plan.report.notes.clone(),
        }),
        ..PlanFile::default()
    }
}

/// A stop rule, described and in canonical form. Predicates are not included; they need the script.
fn stop_record(rule: &StopRule) -> StopRecord {
    StopRecord {
        text: rule.describe(),
        rule: rule.canonical(&|_| Value::Nil),
    }
}

/// A reference of the plan, with its source and its bias check.
fn planned_reference(plan: &Plan, reference: &Reference) -> PlannedReference {
    let run = reference.id.0.clone();
    match &reference.source {
        ReferenceSource::Render {
            config,
            stop,
            shard_samples,
            ..
        } => PlannedReference::Render(Box::new(RenderedReference {
            run,
            source: stored(config),
            stop: stop_record(stop),
            bias_check: reference.bias_check.map(|check| BiasCheckPlan {
                with: plan.references[check.with].id.0.clone(),
                false_discovery_rate: check.rate,
            }),
            shard_samples: *shard_samples,
        })),
        ReferenceSource::File { file, source } => PlannedReference::File(FileReference {
            run,
            source: file.display().to_string(),
            blake3: reference.file_hash().unwrap_or_default().to_owned(),
            made_by: source.clone(),
        }),
    }
}

fn metric_record(metric: &MetricSpec) -> MetricRecord {
    MetricRecord {
        column: metric.column.clone(),
        metric: metric.row.name.to_owned(),
        options: metric.options.clone(),
    }
}

fn planned_cell(plan: &Plan, index: usize, stop: usize) -> PlannedCell {
    let cell = &plan.cells[index];
    let folder = layout::run_name(plan, index);
    let frames = plan.sheets.iter().any(|sheet| sheet.kind() == "frames");
    let timing = cell.config.timing.as_ref().filter(|_| frames).cloned();
    let densities = plan.sheets.iter().filter_map(SheetSpec::density);
    let densities = densities.filter(|_| timing.is_some());
    let mixture = |name: &str| Some((name.to_owned(), delay::mixture(&cell.scene, name).ok()?));
    PlannedCell {
        run: cell.id.0.clone(),
        path: cell.path.clone(),
        folder: folder.to_string_lossy().replace('\\', "/"),
        point: point_record(&cell.point),
        repeat: cell.repeat,
        seed: cell.seed,
        integrator: cell.config.integrator.clone(),
        backend: cell.config.backend.clone(),
        scene: cell.config.scene.clone(),
        changes: cell.config.scene_changes(),
        max_depth: cell.config.max_depth,
        resolution: cell.config.resolution,
        reference: cell.reference,
        stop,
        double_of: cell.double_of,
        denoise: cell.config.denoise.as_ref().map(|d| d.name().to_owned()),
        delays: densities.filter_map(mixture).collect(),
        timing,
    }
}

/// Returns the content of a run's or a reference's `config.json`, the same for all cells that are
/// one run.
pub fn config_file(plan: &Plan, cell: CellRef) -> ConfigFile {
    let common = ConfigFile {
        experiment: plan.name.clone(),
        run: plan.id(cell).0.clone(),
        ..ConfigFile::default()
    };
    match cell {
        CellRef::Cell(i) => {
            let cell = plan.first_cell(i);
            let reference = cell.reference.map(|i| plan.references[i].id.0.clone());
            ConfigFile {
                plan: Some(plan.hash.clone()),
                path: Some(cell.path.clone()),
                point: Some(point_record(&cell.point)),
                repeat: Some(cell.repeat),
                seed: Some(cell.seed),
                render: Some(stored(&cell.config)),
                reference,
                identity: cell.identity.to_value(),
                ..common
            }
        }
        CellRef::Reference(i) => {
            let reference = &plan.references[i];
            let common = ConfigFile {
                identity: reference.identity.clone(),
                ..common
            };
            match &reference.source {
                ReferenceSource::Render {
                    config,
                    seeds,
                    stem,
                    shard_samples,
                    ..
                } => ConfigFile {
                    seeds: Some(*seeds),
                    stem: Some(stem.0.clone()),
                    shard_samples: *shard_samples,
                    render: Some(stored(config)),
                    ..common
                },
                ReferenceSource::File { file, source } => ConfigFile {
                    file: Some(file.display().to_string()),
                    made_by: Some(source.clone()),
                    ..common
                },
            }
        }
    }
}

fn stored(settings: &Settings) -> StoredSettings {
    StoredSettings::Known(Box::new(settings.clone()))
}

fn point_record(point: &Point) -> Named<Value> {
    Named(point.clone())
}
