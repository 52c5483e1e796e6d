//! Plans and cells as JSON: `plan.json`, `config.json`, and the output of `lumbre plan --json`.

use serde_json::{Map, Value as Json, json};

use crate::experiment::plan::{Reference, ReferenceSource};
use crate::experiment::{Cell, CellConfig, CellRef, Plan, Point, StopRule};
use crate::metrics::MetricSpec;
use crate::store::layout;
use lumbre_light::value::Value;

/// Converts a plan to JSON: names, hash, axes, metrics, every cell with its point and identity,
/// references, skipped points and notes. Cells refer to their stop rule by its index in `stops`.
pub fn plan_json(plan: &Plan) -> Json {
    let mut stops: Vec<&StopRule> = Vec::new();
    let mut stop_index = |rule| {
        // Searched from the end, since neighbouring cells mostly have the same rule.
        stops
            .iter()
            .rposition(|known| *known == rule)
            .unwrap_or_else(|| {
                stops.push(rule);
                stops.len() - 1
            })
    };
    let cells: Vec<Json> = plan
        .cells
        .iter()
        .map(|cell| plan_cell_json(cell, stop_index(&cell.stop)))
        .collect();
    let references: Vec<Json> = plan
        .references
        .iter()
        .map(|reference| plan_reference_json(plan, reference))
        .collect();
    json!({
        "name": plan.name,
        "hash": plan.hash,
        "seed": plan.seed,
        "axes": plan.axes,
        "night": {
            "order": plan.night.order.name(),
            "warmup": plan.night.warmup.map(|warmup| warmup.describe()),
        },
        "metrics": plan.columns(),
        "measure": {
            "every_s": plan.measure.every_s,
            "metrics": plan.measure.metrics.iter().map(metric_json).collect::<Vec<_>>(),
            "display": plan.measure.display.to_value().to_json(),
        },
        "stops": stops.into_iter().map(stop_json).collect::<Vec<_>>(),
        "cells": cells,
        "references": references,
        "skipped": plan.skipped.iter().map(|s| json!({
            "point": point_json(&s.point), "reason": s.reason, "absent": s.absent,
        })).collect::<Vec<_>>(),
        "warnings": plan.warnings,
        "notes": plan.notes.iter().map(|n| json!({
            "file": n.file.display().to_string(), "place": n.place, "message": n.message,
        })).collect::<Vec<_>>(),
    })
}

/// A stop rule, described and in canonical form. Predicates are not included; they need the script.
fn stop_json(rule: &StopRule) -> Json {
    json!({ "words": rule.describe(), "rule": rule.canonical(&|_| Value::Nil).to_json() })
}

/// A reference in `plan.json`, with its source and its bias check.
fn plan_reference_json(plan: &Plan, reference: &Reference) -> Json {
    let agree = reference.bias_check.map(|check| {
        json!({
            "with": plan.references[check.with].id.0,
            "false_discovery_rate": check.rate,
        })
    });
    match &reference.source {
        ReferenceSource::Render {
            config,
            stop,
            shard_samples,
            ..
        } => json!({
            "run": reference.id.0,
            "kind": "render",
            "source": config_json(config),
            "stop": stop_json(stop),
            "agree": agree,
            "part": shard_samples,
        }),
        ReferenceSource::File { file, source } => {
            let fields = reference.identity.as_map();
            json!({
                "run": reference.id.0,
                "kind": "file",
                "source": file.display().to_string(),
                "agree": agree,
                "blake3": fields.and_then(|fields| fields.get("file")?.as_str()),
                "made_by": source,
            })
        }
    }
}

fn metric_json(metric: &MetricSpec) -> Json {
    json!({
        "column": metric.column,
        "metric": metric.row.name,
        "options": Value::Map(metric.options.clone()).to_json(),
    })
}

fn plan_cell_json(cell: &Cell, stop: usize) -> Json {
    let folder = layout::sanitize(&cell.path).join(&cell.id.0);
    let mut line = json!({
        "run": cell.id.0,
        "path": cell.path,
        "folder": folder.to_string_lossy().replace('\\', "/"),
        "point": point_json(&cell.point),
        "repeat": cell.repeat,
        "seed": cell.seed,
        "integrator": cell.config.integrator,
        "backend": cell.config.backend,
        "scene": cell.config.scene,
        "max_depth": cell.config.max_depth,
        "resolution": cell.config.resolution,
        "reference": cell.reference,
        "stop": stop,
    });
    if let (Some(double_of), Some(fields)) = (cell.double_of, line.as_object_mut()) {
        fields.insert("control".into(), double_of.into());
    }
    line
}

/// Content of a run's `config.json`: its place in the plan, its render settings, and the canonical
/// form that its id is the hash of.
pub fn cell_json(plan: &Plan, cell: CellRef) -> Json {
    let mut out = Map::new();
    out.insert(
        "program".into(),
        concat!("lumbre ", env!("CARGO_PKG_VERSION")).into(),
    );
    out.insert("experiment".into(), plan.name.as_str().into());
    match cell {
        CellRef::Cell(i) => {
            let cell = &plan.cells[i];
            out.insert("run".into(), cell.id.0.as_str().into());
            out.insert("plan".into(), plan.hash.as_str().into());
            out.insert("path".into(), cell.path.as_str().into());
            out.insert("point".into(), point_json(&cell.point));
            out.insert("repeat".into(), cell.repeat.into());
            out.insert("seed".into(), cell.seed.into());
            out.insert("render".into(), config_json(&cell.config));
            if let Some(reference) = cell.reference {
                out.insert(
                    "reference".into(),
                    plan.references[reference].id.0.as_str().into(),
                );
            }
            out.insert("identity".into(), cell.identity.to_json());
        }
        CellRef::Reference(i) => {
            let reference = &plan.references[i];
            out.insert("run".into(), reference.id.0.as_str().into());
            match &reference.source {
                ReferenceSource::Render {
                    config,
                    seeds,
                    stem,
                    shard_samples,
                    ..
                } => {
                    out.insert("seeds".into(), seeds.to_vec().into());
                    out.insert("stem".into(), stem.0.as_str().into());
                    if let Some(samples) = shard_samples {
                        out.insert("part".into(), (*samples).into());
                    }
                    out.insert("render".into(), config_json(config));
                }
                ReferenceSource::File { file, source } => {
                    out.insert("file".into(), file.display().to_string().into());
                    out.insert("made_by".into(), source.as_str().into());
                }
            }
            out.insert("identity".into(), reference.identity.to_json());
        }
    }
    Json::Object(out)
}

fn point_json(point: &Point) -> Json {
    Json::Object(
        point
            .iter()
            .map(|(axis, value)| (axis.clone(), value.to_json()))
            .collect(),
    )
}

/// Render settings under the keys that scripts use.
fn config_json(config: &CellConfig) -> Json {
    let kind = config.filter.kind.name();
    json!({
        "scene": config.scene,
        "scene_file": config.scene_file.display().to_string(),
        "scene_options": Value::Map(config.scene_options.clone()).to_json(),
        "integrator": config.integrator,
        "params": Value::Map(config.params.clone()).to_json(),
        "max_depth": config.max_depth,
        "resolution": config.resolution,
        "rr_start": config.rr_start,
        "aa": { "filter": kind, "radius": config.filter.radius },
        "films": config.films.iter().map(|layer| layer.row().name).collect::<Vec<_>>(),
        "film": config.timing.as_ref().map(|timing| timing.to_film(true).to_json()),
        "sampler": config.sampler,
        "accel": Value::Map(config.accel.identity()).to_json(),
        "set": Value::Map(config.set.clone()).to_json(),
        "backend": config.backend,
    })
}
