//! The sink that keeps results: it hears the night and fills the run folders.

use std::sync::Arc;
use std::time::SystemTime;

use serde_json::{Value as Json, json};
use tracing::Level as LogLevel;

use super::log::Log;
use super::space::{self, patiently};
use crate::experiment::event::Level;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::spec::Snapshots;
use crate::experiment::{CellRef, Control, Event, Outcome, Plan, Sink, SinkError, WaveRow};
use crate::film::layer::LayerImage;
use crate::film::{Film, Image};
use crate::output::{exr, layer, plot, png};
use crate::render::OpenStats;
use crate::scene::desc::content_hash;
use crate::store::{FILMS, RunWriter, Store, StoreError, utc};

/// What wrote the files.
const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

/// Writes every run's files as the night goes on, each run's last file when it is done.
pub struct Recorder<'a> {
    store: &'a Store,
    plan: Arc<Plan>,
    log: Log,
    control: Arc<Control>,
    current: Option<Current>,
}

/// The run that is being filled.
struct Current {
    cell: CellRef,
    writer: RunWriter,
    open: OpenStats,
    facts: Facts,
}

/// What every picture of a run says about itself.
struct Facts {
    run: String,
    /// The plan that rendered it; empty for references, which belong to no single plan.
    plan: String,
    scene_hash: String,
    seed: u64,
    device: String,
}

impl Facts {
    /// No clock is among them: two nights that render the same write the same bytes.
    fn metadata(&self, samples: u64) -> Vec<(String, String)> {
        let plan = (!self.plan.is_empty()).then(|| ("plan", self.plan.clone()));
        let pairs = [
            ("run", self.run.clone()),
            ("scene_hash", self.scene_hash.clone()),
            ("samples", samples.to_string()),
            ("seed", self.seed.to_string()),
            ("device", self.device.clone()),
            ("program", PROGRAM.to_owned()),
        ];
        pairs.into_iter().chain(plan).map(|(name, value)| (name.to_owned(), value)).collect()
    }
}

impl<'a> Recorder<'a> {
    /// A recorder of one night of `plan`. Where the disk is full it waits until `control` is asked to stop.
    pub fn new(store: &'a Store, plan: Arc<Plan>, log: Log, control: Arc<Control>) -> Recorder<'a> {
        Recorder { store, plan, log, control, current: None }
    }

    fn start(
        &mut self,
        cell: CellRef,
        open: &OpenStats,
        measured: bool,
        resumed: Option<&[WaveRow]>,
    ) -> Result<(), SinkError> {
        let before = resumed.unwrap_or_default();
        let kept = resumed.map(|rows| rows.last().map_or(0, |row| row.samples));
        let mut writer = self.patiently(|| self.store.start(&self.plan, cell, kept))?;
        if let CellRef::Cell(_) = cell {
            let columns = if measured { self.plan.columns() } else { Vec::new() };
            let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
            self.patiently(|| writer.open_metrics(&columns, before))?;
        }
        self.log.set_run(Some(self.patiently(|| writer.open_log())?));
        self.log.run_line(LogLevel::INFO, &format!("started on {}", open.device));
        let facts = self.facts(cell, open);
        let fields = json!({
            "run": facts.run, "path": self.path(cell), "device": open.device,
            "accel_build_s": open.accel_build_s, "accel_nodes": open.accel_nodes,
        });
        self.current = Some(Current { cell, writer, open: open.clone(), facts });
        self.tell("cell_started", &fields);
        Ok(())
    }

    /// Writes, and waits where there is no space.
    fn patiently<T>(&self, attempt: impl FnMut() -> Result<T, StoreError>) -> Result<T, SinkError> {
        patiently(&self.control, &|| std::thread::sleep(space::STEP), attempt).map_err(lost)
    }

    fn facts(&self, cell: CellRef, open: &OpenStats) -> Facts {
        let (seed, scene) = match cell {
            CellRef::Cell(i) => (self.plan.cells[i].seed, Some(&self.plan.cells[i].scene)),
            CellRef::Reference(i) => match &self.plan.references[i].source {
                ReferenceSource::Render { seed, scene, .. } => (*seed, Some(scene)),
                ReferenceSource::File(_) => (0, None),
            },
        };
        let hex = |hash: [u8; 32]| blake3::Hash::from(hash).to_hex().to_string();
        Facts {
            run: self.plan.id(cell).0.clone(),
            plan: if let CellRef::Cell(_) = cell { self.plan.hash.clone() } else { String::new() },
            scene_hash: scene.map(|s| hex(content_hash(s))).unwrap_or_default(),
            seed,
            device: open.device.clone(),
        }
    }

    fn path(&self, cell: CellRef) -> &str {
        match cell {
            CellRef::Cell(i) => &self.plan.cells[i].path,
            CellRef::Reference(_) => "reference",
        }
    }

    fn wave(&mut self, cell: CellRef, row: &WaveRow, image: &Image, pow2: bool) -> Result<(), SinkError> {
        let keep = pow2 && self.plan.measure.snapshots == Snapshots::Pow2;
        let Some(current) = self.current.as_mut().filter(|c| c.cell == cell) else { return Ok(()) };
        if let CellRef::Reference(_) = cell {
            return Ok(());
        }
        let wait = || std::thread::sleep(space::STEP);
        patiently(&self.control, &wait, || current.writer.append_row(row)).map_err(lost)?;
        if keep {
            let metadata = current.facts.metadata(row.samples);
            let bytes = exr::encode(image, &metadata).map_err(failed)?;
            let name = format!("snap-{}.exr", row.samples);
            patiently(&self.control, &wait, || current.writer.write(&name, &bytes)).map_err(lost)?;
        }
        Ok(())
    }

    fn finish(
        &mut self,
        cell: CellRef,
        reason: &str,
        film: &Film,
        layers: &[LayerImage],
        rows: &[WaveRow],
    ) -> Result<(), SinkError> {
        let Some(current) = self.current.take_if(|c| c.cell == cell) else {
            return Err(SinkError("the run ended before it was started".to_owned()));
        };
        let Current { writer, open, facts, .. } = current;
        let last = rows.last().cloned().unwrap_or_default();
        let metadata = facts.metadata(film.samples);
        let image = film.mean();
        let name = match cell {
            CellRef::Cell(_) => "final",
            CellRef::Reference(_) => {
                self.patiently(|| writer.write_rows(rows))?;
                "ref"
            }
        };
        let linear = exr::encode(&image, &metadata).map_err(failed)?;
        self.patiently(|| writer.write(&format!("{name}.exr"), &linear))?;
        let shown = png::encode(&image, self.plan.measure.display, &metadata).map_err(failed)?;
        self.patiently(|| writer.write(&format!("{name}.png"), &shown))?;
        self.keep_layers(cell, &writer, layers, &metadata)?;
        self.log.run_line(LogLevel::INFO, &format!("done: {reason}"));
        let mut done = done_json(&facts, &open, reason, film.samples, &last, &self.metrics(&last));
        if !layers.is_empty() {
            done["films"] = layers.iter().map(|layer| layer.film.name()).collect();
        }
        self.patiently(|| writer.finish(&done))
    }

    /// Writes the films of all layers, and the sheets on which they stand side by side.
    fn keep_layers(
        &self,
        cell: CellRef,
        writer: &RunWriter,
        layers: &[LayerImage],
        metadata: &[(String, String)],
    ) -> Result<(), SinkError> {
        let display = self.plan.measure.display;
        for layer in layers {
            let row = layer.film.layer.row();
            let name = layer.film.name();
            let mut metadata = metadata.to_vec();
            metadata.push(("film".to_owned(), name.clone()));
            metadata.push(("channels".to_owned(), row.channels.join(", ")));
            let linear = exr::encode(&layer.image, &metadata).map_err(failed)?;
            self.patiently(|| writer.write(&format!("{FILMS}/{name}.exr"), &linear))?;
            let shown = layer::encode(layer, display, &metadata).map_err(failed)?;
            self.patiently(|| writer.write(&format!("{FILMS}/{name}.png"), &shown))?;
        }
        for (stem, bytes) in plot::sheets(layers, display, self.path(cell), metadata).map_err(failed)? {
            self.patiently(|| writer.write(&format!("{FILMS}/{stem}.png"), &bytes))?;
        }
        Ok(())
    }

    fn metrics(&self, row: &WaveRow) -> Json {
        let columns = self.plan.columns();
        // JSON has no infinities: they are text, as everywhere in Lumbre.
        let number = |x: &f64| serde_json::Number::from_f64(*x).map_or_else(|| json!(x.to_string()), Json::Number);
        columns.into_iter().zip(row.metrics.iter().map(number)).collect::<serde_json::Map<_, _>>().into()
    }

    fn finished_fields(&self, cell: CellRef, outcome: &Outcome, rows: &[WaveRow]) -> Json {
        let (word, reason) = match outcome {
            Outcome::Done(reason) => ("done", reason.clone()),
            Outcome::Cached(folder) => ("cached", folder.display().to_string()),
            Outcome::Failed(reason) => ("failed", reason.clone()),
            Outcome::Interrupted => ("interrupted", String::new()),
        };
        let last = rows.last().cloned().unwrap_or_default();
        json!({
            "run": self.plan.id(cell).0, "path": self.path(cell), "outcome": word, "reason": reason,
            "samples": last.samples, "render_s": last.render_s, "wall_s": last.wall_s, "waves": last.wave,
            "paths": last.paths, "rays": last.rays, "invalid": last.invalid, "metrics": self.metrics(&last),
        })
    }

    /// Adds a line to the journal. It repeats what the run's own files say, so that failing here costs no result.
    fn tell(&self, event: &str, fields: &Json) {
        if let Err(e) = self.store.journal(event, fields) {
            tracing::warn!("{e}");
        }
    }
}

impl Sink for Recorder<'_> {
    fn hear(&mut self, event: &Event) -> Result<(), SinkError> {
        match event {
            Event::NightStarted { plan } => {
                let fields = json!({
                    "plan": plan.hash, "cells": plan.cells.len(), "program": PROGRAM,
                    "arguments": std::env::args().skip(1).collect::<Vec<_>>(),
                });
                self.tell("night_started", &fields);
                Ok(())
            }
            Event::CellStarted { cell, open, reference, resumed } => {
                self.start(*cell, open, reference.is_some(), resumed.as_deref().map(Vec::as_slice))
            }
            Event::Wave { cell, row, image, pow2, .. } => self.wave(*cell, row, image, *pow2),
            Event::CellFinished { cell, outcome, film, layers, rows } => {
                let kept = match (outcome, film) {
                    (Outcome::Done(reason), Some(film)) => self.finish(*cell, reason, film, layers, rows),
                    (Outcome::Done(_), None) => Err(SinkError("it is done but left no picture".to_owned())),
                    (Outcome::Failed(reason), _) => {
                        self.log.run_line(LogLevel::ERROR, &format!("failed: {reason}"));
                        self.store.fail(&self.plan, *cell, reason).map_err(lost)
                    }
                    (Outcome::Cached(_) | Outcome::Interrupted, _) => Ok(()),
                };
                self.current = None;
                self.log.set_run(None);
                kept?;
                // What was there already is no news; ten thousand such lines every night would hide what is.
                if !matches!(outcome, Outcome::Cached(_)) {
                    self.tell("cell_finished", &self.finished_fields(*cell, outcome, rows));
                }
                Ok(())
            }
            Event::Message { level, cell, text } => {
                let log_level = match level {
                    Level::Info => LogLevel::INFO,
                    Level::Warn => LogLevel::WARN,
                    Level::Error => LogLevel::ERROR,
                };
                self.log.run_line(log_level, text);
                if *level >= Level::Warn {
                    let run = cell.map(|c| self.plan.id(c).0.clone());
                    let fields = json!({ "level": log_level.to_string(), "run": run, "text": text });
                    self.tell("message", &fields);
                }
                Ok(())
            }
            Event::NightFinished => {
                self.tell("night_finished", &json!({}));
                Ok(())
            }
        }
    }
}

fn done_json(facts: &Facts, open: &OpenStats, reason: &str, samples: u64, last: &WaveRow, metrics: &Json) -> Json {
    json!({
        "run": facts.run,
        "reason": reason,
        "samples": samples,
        "render_s": last.render_s,
        "wall_s": last.wall_s,
        "waves": last.wave,
        "paths": last.paths,
        "rays": last.rays,
        "invalid": last.invalid,
        "first_invalid": last.first_invalid,
        "metrics": metrics,
        "seed": facts.seed,
        "device": facts.device,
        "accel_build_s": open.accel_build_s,
        "accel_nodes": open.accel_nodes,
        "scene_hash": facts.scene_hash,
        "program": PROGRAM,
        "finished": utc(SystemTime::now()),
    })
}

/// A file that could not be written.
fn lost(error: StoreError) -> SinkError {
    SinkError(error.to_string())
}

/// A picture that could not be encoded.
fn failed(error: impl std::fmt::Display) -> SinkError {
    SinkError(error.to_string())
}
