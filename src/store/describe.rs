//! Plans and cells as JSON: `plan.json`, `config.json`, and what `lumbre plan --json` prints.

use serde_json::{Map, Value as Json, json};

use super::layout;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::{Cell, CellConfig, CellRef, Plan, Point, StopRule};
use crate::metrics::MetricSpec;
use crate::value::Value;

/// A whole plan: names, hash, axes, what is measured, every cell with its point and identity, references, what was left
/// out, notes. Cells name their stop rule by its place among `stops`.
pub fn plan_json(plan: &Plan) -> Json {
    let mut stops: Vec<&StopRule> = Vec::new();
    let mut place = |rule| {
        // The rule of the cell before is looked for first: neighbours mostly share theirs.
        stops.iter().rposition(|known| *known == rule).unwrap_or_else(|| {
            stops.push(rule);
            stops.len() - 1
        })
    };
    let cells: Vec<Json> = plan.cells.iter().map(|cell| cell_line(cell, place(&cell.stop))).collect();
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
        "references": plan.references.iter().map(|r| {
            let agree = r.agree.map(|a| json!({ "with": plan.references[a.with].id.0, "false_discovery_rate": a.rate }));
            match &r.source {
                ReferenceSource::Render { config, stop, part, .. } => json!({
                    "run": r.id.0, "kind": "render", "source": config_json(config), "stop": stop_json(stop),
                    "agree": agree, "part": part,
                }),
                ReferenceSource::File { file, source } => json!({
                    "run": r.id.0, "kind": "file", "source": file.display().to_string(), "agree": agree,
                    "blake3": r.identity.as_map().and_then(|fields| fields.get("file")?.as_str()), "made_by": source,
                }),
            }
        }).collect::<Vec<_>>(),
        "skipped": plan.skipped.iter().map(|s| json!({ "point": point_json(&s.point), "reason": s.reason, "absent": s.absent }))
            .collect::<Vec<_>>(),
        "warnings": plan.warnings,
        "notes": plan.notes.iter().map(|n| json!({
            "file": n.file.display().to_string(), "place": n.place, "message": n.message,
        })).collect::<Vec<_>>(),
    })
}

/// A rule in words and in its canonical form. What a predicate is cannot be said without its script.
fn stop_json(rule: &StopRule) -> Json {
    json!({ "words": rule.describe(), "rule": rule.canonical(&|_| Value::Nil).to_json() })
}

fn metric_json(metric: &MetricSpec) -> Json {
    json!({
        "column": metric.column,
        "metric": metric.row.name,
        "options": Value::Map(metric.options.clone()).to_json(),
    })
}

fn cell_line(cell: &Cell, stop: usize) -> Json {
    let mut line = json!({
        "run": cell.id.0,
        "path": cell.path,
        "folder": layout::safe(&cell.path).join(&cell.id.0).to_string_lossy().replace('\\', "/"),
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
    if let (Some(double_of), Some(fields)) = (cell.control, line.as_object_mut()) {
        fields.insert("control".into(), double_of.into());
    }
    line
}

/// The content of a run's `config.json`: what it is, what it renders, and the canonical form behind its id.
pub fn cell_json(plan: &Plan, cell: CellRef) -> Json {
    let mut out = Map::new();
    out.insert("program".into(), concat!("lumbre ", env!("CARGO_PKG_VERSION")).into());
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
                out.insert("reference".into(), plan.references[reference].id.0.as_str().into());
            }
            out.insert("identity".into(), cell.identity.to_json());
        }
        CellRef::Reference(i) => {
            let reference = &plan.references[i];
            out.insert("run".into(), reference.id.0.as_str().into());
            match &reference.source {
                ReferenceSource::Render { config, seeds, stem, part, .. } => {
                    out.insert("seeds".into(), seeds.to_vec().into());
                    out.insert("stem".into(), stem.0.as_str().into());
                    if let Some(samples) = part {
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
    Json::Object(point.iter().map(|(axis, value)| (axis.clone(), value.to_json())).collect())
}

/// A `render` table with the keys that scripts use.
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
