//! Records of runs in JSON: `done.json`, fields of journal entries, and metadata of pictures.

use std::time::SystemTime;

use serde_json::{Map, Value as Json, json};

use super::{OpenRun, Recorder};
use crate::experiment::forecast::Forecast;
use crate::experiment::noise_floor::{NoiseFloors, net_columns, net_values};
use crate::experiment::plan::ReferenceSource;
use crate::experiment::shards::Shard;
use crate::experiment::{CellRef, Outcome, Plan, WaveRow};
use crate::store::{Host, utc};
use lumbre_light::scene::desc::content_hash;
use lumbre_render::OpenStats;

/// Name and version of the program, as written to files.
pub(super) const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

/// Facts about a run that are written to the metadata of all its pictures.
pub(super) struct RunFacts {
    /// Id of the run.
    pub(super) run: String,
    /// Hash of the plan; empty for references, which do not belong to a single plan.
    plan: String,
    /// Hash of the scene's content in hexadecimal; empty if the reference is a file.
    scene_hash: String,
    /// Seed of the run. For a reference, the seed of its first half.
    seed: u64,
    /// Name of the device that renders it.
    device: String,
}

impl RunFacts {
    /// Collects the facts about a run of a plan.
    pub(super) fn new(plan: &Plan, cell: CellRef, open: &OpenStats) -> RunFacts {
        let (seed, scene) = match cell {
            CellRef::Cell(i) => (plan.cells[i].seed, Some(&plan.cells[i].scene)),
            CellRef::Reference(i) => match &plan.references[i].source {
                ReferenceSource::Render { seeds, scene, .. } => (seeds[0], Some(scene)),
                ReferenceSource::File { .. } => (0, None),
            },
        };
        let hex = |hash: [u8; 32]| blake3::Hash::from(hash).to_hex().to_string();
        RunFacts {
            run: plan.id(cell).0.clone(),
            plan: if let CellRef::Cell(_) = cell {
                plan.hash.clone()
            } else {
                String::new()
            },
            scene_hash: scene.map(|s| hex(content_hash(s))).unwrap_or_default(),
            seed,
            device: open.device.clone(),
        }
    }

    /// Returns the metadata of a picture. It contains no times, so that two nights that render the
    /// same pictures write the same bytes.
    pub(super) fn metadata(&self, samples: u64) -> Vec<(String, String)> {
        let plan = (!self.plan.is_empty()).then(|| ("plan", self.plan.clone()));
        let pairs = [
            ("run", self.run.clone()),
            ("scene_hash", self.scene_hash.clone()),
            ("samples", samples.to_string()),
            ("seed", self.seed.to_string()),
            ("device", self.device.clone()),
            ("program", PROGRAM.to_owned()),
        ];
        pairs
            .into_iter()
            .chain(plan)
            .map(|(name, value)| (name.to_owned(), value))
            .collect()
    }
}

impl Recorder<'_> {
    /// Returns the content of `done.json`. `films` are the names of the layers and of the stills of
    /// the time axis.
    pub(super) fn done_record(
        &self,
        run: &OpenRun,
        reason: &str,
        samples: u64,
        last: &WaveRow,
        films: Vec<String>,
    ) -> Json {
        let metrics = self.metrics(last);
        let mut done = base_record(&run.facts, &run.open, reason, samples, last, &metrics);
        let floors = &run.floors;
        if !floors.is_empty() {
            done["floors"] = self.by_column(floors.iter().copied());
            let net = net_columns(&self.plan, floors)
                .into_iter()
                .map(|(_, name)| name);
            let values = net_values(&self.plan, floors, &last.metrics);
            done["net"] = net
                .zip(values.into_iter().map(number))
                .collect::<Map<_, _>>()
                .into();
        }
        if let Some(halves) = run.halves {
            done["halves"] = halves.to_vec().into();
        }
        if !films.is_empty() {
            done["films"] = films.into();
        }
        done
    }

    /// Returns the metrics of a row by the names of their columns.
    fn metrics(&self, row: &WaveRow) -> Json {
        self.by_column(row.metrics.iter().copied().map(Some))
    }

    /// Returns values in the order of the plan's columns by the names of the columns, without
    /// unknown values.
    fn by_column(&self, values: impl Iterator<Item = Option<f64>>) -> Json {
        let named = self.plan.columns().into_iter().zip(values);
        named
            .filter_map(|(column, x)| Some((column, number(x?))))
            .collect::<Map<_, _>>()
            .into()
    }

    /// Returns the fields of the journal entry about the end of a run.
    pub(super) fn finished_fields(
        &self,
        cell: CellRef,
        outcome: &Outcome,
        rows: &[WaveRow],
    ) -> Json {
        let (outcome, reason) = outcome_fields(outcome);
        let last = rows.last().cloned().unwrap_or_default();
        json!({
            "run": self.plan.id(cell).0, "path": self.path(cell), "outcome": outcome,
            "reason": reason, "samples": last.samples, "render_s": last.render_s,
            "wall_s": last.wall_s, "waves": last.wave, "paths": last.paths, "rays": last.rays,
            "invalid": last.invalid, "metrics": self.metrics(&last),
        })
    }
}

/// Returns the fields of the journal entry about the start of a night.
pub(super) fn night_fields(plan: &Plan) -> Json {
    json!({
        "plan": plan.hash, "cells": plan.cells.len(), "program": PROGRAM,
        "arguments": std::env::args().skip(1).collect::<Vec<_>>(),
    })
}

/// Returns the fields of the journal entry about a forecast of the time left.
pub(super) fn forecast_fields(left: &Forecast) -> Json {
    json!({
        "left_s": left.seconds, "at_most": left.at_most, "rough": left.rough,
        "known": left.known, "unknown": left.unknown,
    })
}

/// Returns the name of an outcome in the journal, and its reason.
pub(super) fn outcome_fields(outcome: &Outcome) -> (&'static str, String) {
    match outcome {
        Outcome::Done(reason) => ("done", reason.clone()),
        Outcome::Cached(folder) => ("cached", folder.display().to_string()),
        Outcome::Failed(reason) => ("failed", reason.clone()),
        Outcome::Interrupted => ("interrupted", String::new()),
    }
}

/// Adds the fields that identify a shard of a reference to the fields of a journal entry.
pub(super) fn shard_fields(plan: &Plan, shard: &Shard, mut fields: Json) -> Json {
    let run = plan.id(CellRef::Reference(shard.reference));
    fields["run"] = run.0.as_str().into();
    fields["part"] = shard.number.into();
    fields["of"] = shard.count.into();
    fields["words"] = format!("reference, {}", shard.label()).into();
    fields
}

/// Returns a row with the values of its net columns appended to its metrics.
pub(super) fn with_net_values(plan: &Plan, floors: &NoiseFloors, row: &WaveRow) -> WaveRow {
    let net = net_values(plan, floors, &row.metrics);
    WaveRow {
        metrics: row.metrics.iter().copied().chain(net).collect(),
        ..row.clone()
    }
}

/// Converts a number to JSON. Infinities and NaN, which JSON lacks, become strings.
pub(super) fn number(x: f64) -> Json {
    serde_json::Number::from_f64(x).map_or_else(|| json!(x.to_string()), Json::Number)
}

/// Returns the fields of `done.json` that all runs have.
fn base_record(
    facts: &RunFacts,
    open: &OpenStats,
    reason: &str,
    samples: u64,
    last: &WaveRow,
    metrics: &Json,
) -> Json {
    json!({
        "run": facts.run,
        "reason": reason,
        "samples": samples,
        "render_s": last.render_s,
        "wall_s": last.wall_s,
        "measure_s": last.measure_s,
        "waves": last.wave,
        "paths": last.paths,
        "rays": last.rays,
        "invalid": last.invalid,
        "first_invalid": last.first_invalid,
        "metrics": metrics,
        "seed": facts.seed,
        "device": facts.device,
        "processor": Host::detect().cpu,
        "accel_build_s": open.accel_build_s,
        "accel_nodes": open.accel_nodes,
        "accel_bytes": open.accel_bytes,
        "accel_cost": open.accel_cost,
        "scene_hash": facts.scene_hash,
        "program": PROGRAM,
        "finished": utc(SystemTime::now()),
    })
}
