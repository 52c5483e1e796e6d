//! The sink that keeps results: it hears the night and fills the run folders.

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::Arc;
use std::time::SystemTime;

use serde_json::{Value as Json, json};
use tracing::Level as LogLevel;

use super::log::Log;
use super::space::{self, patiently};
use crate::experiment::agree::{Agreement, MAP_TOP};
use crate::experiment::event::Level;
use crate::experiment::floors::{Floors, net_columns, net_values};
use crate::experiment::plan::ReferenceSource;
use crate::experiment::spec::Snapshots;
use crate::experiment::{CellRef, Control, Event, Outcome, Plan, Sink, SinkError, WaveRow};
use crate::film::layer::LayerImage;
use crate::film::time::TimeCube;
use crate::film::{Film, Image};
use crate::output::{exr, layer, plot, png, time};
use crate::render::OpenStats;
use crate::scene::desc::content_hash;
use crate::store::{FILMS, HALVES, Host, NOISE, RunWriter, Store, StoreError, utc};

/// What wrote the files.
const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

/// Writes every run's files as the night goes on, each run's last file when it is done.
pub struct Recorder<'a> {
    store: &'a Store,
    plan: Arc<Plan>,
    log: Log,
    control: Arc<Control>,
    /// The runs that are being filled; several where they take turns.
    current: BTreeMap<CellRef, Current>,
    /// The run whose log is written.
    logged: Option<CellRef>,
    /// The noise floors of the plan's references, as far as they were told.
    floors: BTreeMap<usize, Floors>,
}

/// What a run has besides its picture.
struct Apart<'a> {
    layers: &'a [LayerImage],
    times: Option<&'a TimeCube>,
}

/// A run that is being filled.
struct Current {
    writer: RunWriter,
    log: File,
    open: OpenStats,
    facts: Facts,
    /// The noise floors of what it is measured against.
    floors: Floors,
    /// Samples of the two halves, once they are written.
    halves: Option<[u64; 2]>,
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
        Recorder { store, plan, log, control, current: BTreeMap::new(), logged: None, floors: BTreeMap::new() }
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
        let mut floors = Floors::default();
        if let CellRef::Cell(i) = cell {
            let known = self.plan.cells[i].reference.and_then(|r| self.floors.get(&r));
            floors = known.filter(|_| measured).cloned().unwrap_or_default();
            let mut columns = if measured { self.plan.columns() } else { Vec::new() };
            columns.extend(net_columns(&self.plan, &floors).into_iter().map(|(_, name)| name));
            let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
            let before: Vec<WaveRow> = before.iter().map(|row| with_net(&self.plan, &floors, row)).collect();
            self.patiently(|| writer.open_metrics(&columns, &before))?;
        }
        let log = self.patiently(|| writer.open_log())?;
        let facts = self.facts(cell, open);
        let fields = json!({
            "run": facts.run, "path": self.path(cell), "device": open.device,
            "accel_build_s": open.accel_build_s, "accel_nodes": open.accel_nodes, "accel_bytes": open.accel_bytes,
            "accel_cost": open.accel_cost,
        });
        self.current.insert(cell, Current { writer, log, open: open.clone(), facts, floors, halves: None });
        self.turn_to(cell);
        self.log.run_line(LogLevel::INFO, &format!("started on {}", open.device));
        self.tell("cell_started", &fields);
        Ok(())
    }

    /// Log lines are this run's from now on, if it is being filled.
    fn turn_to(&mut self, cell: CellRef) {
        if self.logged != Some(cell) {
            let log = self.current.get(&cell).and_then(|current| current.log.try_clone().ok());
            self.logged = log.is_some().then_some(cell);
            self.log.set_run(log);
        }
    }

    /// Writes, and waits where there is no space.
    fn patiently<T>(&self, attempt: impl FnMut() -> Result<T, StoreError>) -> Result<T, SinkError> {
        patiently(&self.control, &|| std::thread::sleep(space::STEP), attempt).map_err(lost)
    }

    fn facts(&self, cell: CellRef, open: &OpenStats) -> Facts {
        let (seed, scene) = match cell {
            CellRef::Cell(i) => (self.plan.cells[i].seed, Some(&self.plan.cells[i].scene)),
            CellRef::Reference(i) => match &self.plan.references[i].source {
                ReferenceSource::Render { seeds, scene, .. } => (seeds[0], Some(scene)),
                ReferenceSource::File { .. } => (0, None),
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
        let Some(current) = self.current.get_mut(&cell) else { return Ok(()) };
        if let CellRef::Reference(_) = cell {
            return Ok(());
        }
        let row = &with_net(&self.plan, &current.floors, row);
        let wait = || std::thread::sleep(space::STEP);
        patiently(&self.control, &wait, || current.writer.append_row(row)).map_err(lost)?;
        if keep {
            let metadata = current.facts.metadata(row.samples);
            let bytes = exr::encode(image, &metadata).map_err(failed)?;
            let name = format!("snap-{}.exr", row.samples);
            patiently(&self.control, &wait, || current.writer.write(&name, &bytes)).map_err(lost)?;
        }
        if self.plan.measure.captures {
            let metadata = current.facts.metadata(row.samples);
            let bytes = png::encode(image, self.plan.measure.display, &metadata).map_err(failed)?;
            let name = format!("snap-{}.png", row.samples);
            patiently(&self.control, &wait, || current.writer.write(&name, &bytes)).map_err(lost)?;
        }
        Ok(())
    }

    fn finish(
        &mut self,
        cell: CellRef,
        reason: &str,
        film: &Film,
        apart: Apart,
        rows: &[WaveRow],
    ) -> Result<(), SinkError> {
        let Some(current) = self.current.remove(&cell) else {
            return Err(SinkError("the run ended before it was started".to_owned()));
        };
        let Current { writer, open, facts, floors, halves, .. } = current;
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
        let layers = apart.layers;
        self.keep_layers(cell, &writer, layers, &metadata)?;
        let stills = match apart.times {
            Some(times) => self.keep_times(cell, &writer, times, &metadata)?,
            None => Vec::new(),
        };
        self.log.run_line(LogLevel::INFO, &format!("done: {reason}"));
        let mut done = done_json(&facts, &open, reason, film.samples, &last, &self.metrics(&last));
        if !floors.is_empty() {
            done["floors"] = self.by_column(floors.iter().copied());
            let net = net_columns(&self.plan, &floors).into_iter().map(|(_, name)| name);
            let values = net_values(&self.plan, &floors, &last.metrics);
            done["net"] = net.zip(values.into_iter().map(number)).collect::<serde_json::Map<_, _>>().into();
        }
        if let Some(halves) = halves {
            done["halves"] = halves.to_vec().into();
        }
        if !layers.is_empty() {
            done["films"] = layers.iter().map(|layer| layer.film.name()).collect();
        }
        if let (false, Some(films)) = (stills.is_empty(), done["films"].as_array_mut()) {
            films.extend(stills.into_iter().map(Json::from));
        } else if !stills.is_empty() {
            done["films"] = stills.into();
        }
        self.patiently(|| writer.finish(&done))
    }

    /// Writes what a film with a time axis has to show, and says the names of its stills.
    fn keep_times(
        &self,
        cell: CellRef,
        writer: &RunWriter,
        times: &TimeCube,
        metadata: &[(String, String)],
    ) -> Result<Vec<String>, SinkError> {
        let timing = match cell {
            CellRef::Cell(i) => self.plan.cells[i].config.timing.as_ref(),
            CellRef::Reference(_) => None,
        };
        let seconds = timing.and_then(|timing| timing.seconds());
        let mut stills = Vec::new();
        for file in time::files(times, seconds, metadata).map_err(failed)? {
            self.patiently(|| writer.write(&format!("{FILMS}/{}", file.name), &file.bytes))?;
            let still = file.name.strip_suffix(".exr").filter(|name| time::still_length(name).is_some());
            stills.extend(still.map(str::to_owned));
        }
        Ok(stills)
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

    /// Writes the halves of the reference that is being filled, and its standard error.
    fn halves(&mut self, reference: usize, halves: &[Arc<Film>; 2]) -> Result<(), SinkError> {
        let Some(current) = self.current.get_mut(&CellRef::Reference(reference)) else {
            return Err(SinkError("halves of a reference that was never started".to_owned()));
        };
        let wait = || std::thread::sleep(space::STEP);
        let seeds = match &self.plan.references[reference].source {
            ReferenceSource::Render { seeds, .. } => *seeds,
            ReferenceSource::File { .. } => [0; 2],
        };
        let metadata = |samples: u64, seed: u64| {
            let mut facts = current.facts.metadata(samples);
            facts.retain(|(key, _)| key != "seed");
            facts.push(("seed".to_owned(), seed.to_string()));
            facts
        };
        for ((half, seed), name) in halves.iter().zip(seeds).zip(HALVES) {
            let bytes = exr::encode(&half.mean(), &metadata(half.samples, seed)).map_err(failed)?;
            patiently(&self.control, &wait, || current.writer.write(name, &bytes)).map_err(lost)?;
        }
        let joint = Film::pooled(&halves[0], &halves[1]);
        let mut noise = joint.variance_of_mean();
        noise.data.as_flattened_mut().iter_mut().for_each(|x| *x = x.sqrt());
        let mut facts = metadata(joint.samples, seeds[0]);
        facts.push(("shows".to_owned(), "standard error of each pixel's mean".to_owned()));
        let bytes = exr::encode(&noise, &facts).map_err(failed)?;
        patiently(&self.control, &wait, || current.writer.write(NOISE, &bytes)).map_err(lost)?;
        current.halves = Some([halves[0].samples, halves[1].samples]);
        Ok(())
    }

    /// Writes what the comparison of a reference with a second technique found, beside the reference: the map of its
    /// deviates and the finding itself.
    fn agreement(&self, reference: usize, with: usize, found: &Agreement) -> Result<(), SinkError> {
        let technique = match &self.plan.references[with].source {
            ReferenceSource::Render { config, .. } => config.integrator.as_str(),
            ReferenceSource::File { .. } => "file",
        };
        let ids = [reference, with].map(|i| self.plan.references[i].id.0.clone());
        let finding = json!({
            "reference": ids[0], "second": ids[1], "technique": technique, "agrees": found.agrees(),
            "finding": found.describe(), "comparisons": found.comparisons, "false_discovery_rate": found.rate,
            "ratio": number(found.ratio), "ratio_error": number(found.ratio_error),
            "whole_differs": found.whole_differs, "program": PROGRAM,
            "differing": found.differing.iter().map(|block| json!({
                "at": block.at, "channel": block.channel, "z": number(block.z), "p": number(block.p),
            })).collect::<Vec<_>>(),
        });
        let metadata: Vec<(String, String)> = [
            ("run", ids[0].clone()),
            ("second", ids[1].clone()),
            ("shows", format!("deviates of blocks from {technique}, -{MAP_TOP} blue to {MAP_TOP} red")),
            ("program", PROGRAM.to_owned()),
        ]
        .into_iter()
        .map(|(key, value)| (key.to_owned(), value))
        .collect();
        let picture = png::encode_map(&found.map, found.map.scale(None), &metadata).map_err(failed)?;
        let name = |extension: &str| format!("agree-{technique}.{extension}");
        let write = |name: &str, bytes: &[u8]| self.store.write_reference(&self.plan, reference, name, bytes);
        write(&name("png"), &picture).map_err(lost)?;
        write(&name("json"), format!("{finding:#}\n").as_bytes()).map_err(lost)?;
        self.tell("agreement", &finding);
        Ok(())
    }

    fn metrics(&self, row: &WaveRow) -> Json {
        self.by_column(row.metrics.iter().copied().map(Some))
    }

    /// Values in the order of the plan's columns, by their names; what is not known is left out.
    fn by_column(&self, values: impl Iterator<Item = Option<f64>>) -> Json {
        let named = self.plan.columns().into_iter().zip(values);
        named.filter_map(|(column, x)| Some((column, number(x?)))).collect::<serde_json::Map<_, _>>().into()
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
        if let Some(cell) = event.cell().filter(|cell| self.current.contains_key(cell)) {
            self.turn_to(cell);
        }
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
            Event::Floors { reference, floors } => {
                self.floors.insert(*reference, Arc::clone(floors));
                Ok(())
            }
            // The bins of a run that is done are kept with its end.
            Event::Times { .. } => Ok(()),
            Event::Agreement { reference, with, found } => self.agreement(*reference, *with, found),
            Event::Halves { reference, halves } => self.halves(*reference, halves),
            Event::CellFinished { cell, outcome, film, layers, times, rows } => {
                let kept = match (outcome, film) {
                    (Outcome::Done(reason), Some(film)) => {
                        self.finish(*cell, reason, film, Apart { layers, times: times.as_deref() }, rows)
                    }
                    (Outcome::Done(_), None) => Err(SinkError("it is done but left no picture".to_owned())),
                    (Outcome::Failed(reason), _) => {
                        self.log.run_line(LogLevel::ERROR, &format!("failed: {reason}"));
                        self.store.fail(&self.plan, *cell, reason).map_err(lost)
                    }
                    (Outcome::Cached(_), _) => {
                        if let CellRef::Reference(place) = *cell
                            && let Err(e) = self.store.import(&self.plan, place)
                        {
                            // The night reads the file itself.
                            tracing::warn!("the reference was not copied: {e}");
                        }
                        Ok(())
                    }
                    (Outcome::Interrupted, _) => Ok(()),
                };
                self.current.remove(cell);
                self.logged = None;
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
            Event::Forecast(left) => {
                let fields = json!({
                    "left_s": left.seconds, "at_most": left.at_most, "rough": left.rough, "known": left.known,
                    "unknown": left.unknown,
                });
                self.tell("forecast", &fields);
                Ok(())
            }
            Event::NightFinished => {
                self.tell("night_finished", &json!({}));
                Ok(())
            }
        }
    }
}

/// A measurement with the values of its net columns behind those of its metrics.
fn with_net(plan: &Plan, floors: &Floors, row: &WaveRow) -> WaveRow {
    let net = net_values(plan, floors, &row.metrics);
    WaveRow { metrics: row.metrics.iter().copied().chain(net).collect(), ..row.clone() }
}

/// A number as JSON, which has no infinities: they are text, as everywhere in Lumbre.
fn number(x: f64) -> Json {
    serde_json::Number::from_f64(x).map_or_else(|| json!(x.to_string()), Json::Number)
}

fn done_json(facts: &Facts, open: &OpenStats, reason: &str, samples: u64, last: &WaveRow, metrics: &Json) -> Json {
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
        "processor": Host::here().cpu,
        "accel_build_s": open.accel_build_s,
        "accel_nodes": open.accel_nodes,
        "accel_bytes": open.accel_bytes,
        "accel_cost": open.accel_cost,
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
