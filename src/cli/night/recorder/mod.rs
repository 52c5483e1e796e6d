//! Sink that writes the results of a night to its run folders and to its journal.
//!
//! [`Recorder`] receives the events. The pictures of a run are written in [`run_files`], its
//! records in JSON are built in [`records`].

mod records;
mod run_facts;
mod run_files;

use std::collections::BTreeMap;
use std::fs::File;
use std::sync::Arc;

use tracing::Level as LogLevel;

use super::disk_full_retry::{retry_while_disk_full, sleep_before_retry};
use super::log::Log;
use lumbre_light::film::layer::LayerImage;
use lumbre_light::film::time::TimeCube;
use lumbre_light::film::{Film, Image};
use lumbre_night::experiment::noise_floor::{NoiseFloors, net_columns, net_values};
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::spec::Snapshots;
use lumbre_night::experiment::{
    CellRef, Event, NightControls, Outcome, Plan, Sink, SinkError, WaveRow,
};
use lumbre_night::store::schema::journal::JournalEvent;
use lumbre_night::store::{Host, RunWriter, Store, StoreError};
use lumbre_render::OpenStats;
use lumbre_report::{exr, png};
use run_facts::RunFacts;

/// Sink that writes the files of all runs during a night. `done.json` of a run is written last.
pub struct Recorder<'a> {
    store: &'a Store,
    plan: Arc<Plan>,
    log: Log,
    control: Arc<NightControls>,
    /// Runs in progress; several if runs are interleaved.
    open_runs: BTreeMap<CellRef, OpenRun>,
    /// Run whose log receives the log lines.
    logged: Option<CellRef>,
    /// Noise floors of the plan's references that are known so far, by index of the reference.
    floors: BTreeMap<usize, NoiseFloors>,
    /// Model of this machine's processor.
    processor: String,
}

/// Results of a finished run besides its film: the denoised picture, layers and time bins.
struct ExtraFilms<'a> {
    denoised: Option<&'a Image>,
    layers: &'a [LayerImage],
    times: Option<&'a TimeCube>,
}

/// Run in progress.
struct OpenRun {
    writer: RunWriter,
    log: File,
    open: OpenStats,
    facts: RunFacts,
    /// Noise floors of the reference with which the run is compared.
    floors: NoiseFloors,
    /// Numbers of samples of the two reference halves, once they are written.
    halves: Option<[u64; 2]>,
}

impl<'a> Recorder<'a> {
    /// Creates a recorder for one night of `plan`. If the disk is full, the recorder waits for
    /// space until `control` requests a stop.
    pub fn new(
        store: &'a Store,
        plan: Arc<Plan>,
        log: Log,
        control: Arc<NightControls>,
    ) -> Recorder<'a> {
        Recorder {
            store,
            plan,
            log,
            control,
            open_runs: BTreeMap::new(),
            logged: None,
            floors: BTreeMap::new(),
            processor: Host::detect().cpu,
        }
    }

    /// Creates the folder of a run that starts or resumes. `measured` means that it has a
    /// reference, `resumed` are the measurements up to its checkpoint.
    fn start_run(
        &mut self,
        cell: CellRef,
        open: &OpenStats,
        measured: bool,
        resumed: Option<&[WaveRow]>,
    ) -> Result<(), SinkError> {
        let earlier_rows = resumed.unwrap_or_default();
        let checkpoint_samples = resumed.map(|rows| rows.last().map_or(0, |row| row.samples));
        let mut writer =
            self.retry_while_full(|| self.store.start(&self.plan, cell, checkpoint_samples))?;
        let mut floors = NoiseFloors::default();
        if let CellRef::Cell(i) = cell {
            let known = self.plan.cells[i]
                .reference
                .and_then(|r| self.floors.get(&r));
            floors = known.filter(|_| measured).cloned().unwrap_or_default();
            let mut columns = if measured {
                self.plan.columns()
            } else {
                Vec::new()
            };
            columns.extend(
                net_columns(&self.plan, &floors)
                    .into_iter()
                    .map(|(_, name)| name),
            );
            let columns: Vec<&str> = columns.iter().map(String::as_str).collect();
            let earlier_rows: Vec<WaveRow> = earlier_rows
                .iter()
                .map(|row| with_net_values(&self.plan, &floors, row))
                .collect();
            self.retry_while_full(|| writer.open_metrics(&columns, &earlier_rows))?;
        }
        let log = self.retry_while_full(|| writer.open_log())?;
        let facts = RunFacts::new(&self.plan, cell, open);
        self.open_runs.insert(
            cell,
            OpenRun {
                writer,
                log,
                open: open.clone(),
                facts,
                floors,
                halves: None,
            },
        );
        self.select_log(cell);
        self.log.run_line(
            LogLevel::INFO,
            &format!("started on {}", open.device_line()),
        );
        Ok(())
    }

    /// Directs log lines to the log of a run, if it is in progress.
    fn select_log(&mut self, cell: CellRef) {
        if self.logged != Some(cell) {
            let log = self
                .open_runs
                .get(&cell)
                .and_then(|run| run.log.try_clone().ok());
            self.logged = log.is_some().then_some(cell);
            self.log.set_run(log);
        }
    }

    /// Repeats a write while the disk is full.
    fn retry_while_full<T>(
        &self,
        attempt: impl FnMut() -> Result<T, StoreError>,
    ) -> Result<T, SinkError> {
        retry_while_disk_full(&self.control, &sleep_before_retry, attempt).map_err(sink_error)
    }

    /// Returns the readable path of a run.
    fn path(&self, cell: CellRef) -> &str {
        match cell {
            CellRef::Cell(i) => &self.plan.cells[i].path,
            CellRef::Reference(_) => "reference",
        }
    }

    /// Appends a row of measurements of a cell, and writes snapshots if the plan asks for them.
    /// `pow2` means that the number of samples is a power of two.
    fn record_wave(
        &mut self,
        cell: CellRef,
        row: &WaveRow,
        image: &Image,
        pow2: bool,
    ) -> Result<(), SinkError> {
        let Some(run) = self.open_runs.get_mut(&cell) else {
            return Ok(());
        };
        if let CellRef::Reference(_) = cell {
            return Ok(());
        }
        let row = &with_net_values(&self.plan, &run.floors, row);
        let wait = &sleep_before_retry;
        retry_while_disk_full(&self.control, wait, || run.writer.append_row(row))
            .map_err(sink_error)?;
        if pow2 && self.plan.measure.snapshots == Snapshots::Pow2 {
            let metadata = run.facts.metadata(row.samples);
            let bytes = exr::encode(image, &metadata).map_err(sink_error)?;
            let name = format!("snap-{}.exr", row.samples);
            retry_while_disk_full(&self.control, wait, || run.writer.write(&name, &bytes))
                .map_err(sink_error)?;
        }
        if self.plan.measure.captures {
            let metadata = run.facts.metadata(row.samples);
            let bytes =
                png::encode(image, self.plan.measure.display, &metadata).map_err(sink_error)?;
            let name = format!("snap-{}.png", row.samples);
            retry_while_disk_full(&self.control, wait, || run.writer.write(&name, &bytes))
                .map_err(sink_error)?;
        }
        Ok(())
    }

    /// Writes the pictures of a finished run, and its `done.json` last.
    fn finish_run(
        &mut self,
        cell: CellRef,
        reason: &str,
        film: &Film,
        extra: &ExtraFilms<'_>,
        rows: &[WaveRow],
    ) -> Result<(), SinkError> {
        let Some(run) = self.open_runs.remove(&cell) else {
            return Err(SinkError("the run ended before it was started".to_owned()));
        };
        if let CellRef::Reference(_) = cell {
            self.retry_while_full(|| run.writer.write_rows(rows))?;
        }
        let films = self.write_pictures(cell, &run, film, extra)?;
        self.log
            .run_line(LogLevel::INFO, &format!("done: {reason}"));
        let last = rows.last().cloned().unwrap_or_default();
        let done = self.done_file(&run, reason, film.samples, &last, films);
        self.retry_while_full(|| run.writer.finish(&done))
    }

    /// Records the end of a run.
    fn end_run(
        &mut self,
        cell: CellRef,
        outcome: &Outcome,
        film: Option<&Film>,
        extra: &ExtraFilms<'_>,
        rows: &[WaveRow],
    ) -> Result<(), SinkError> {
        let written = match (outcome, film) {
            (Outcome::Done(cause), Some(film)) => {
                self.finish_run(cell, &cause.clause, film, extra, rows)
            }
            (Outcome::Done(_), None) => {
                Err(SinkError("the run is done without a picture".to_owned()))
            }
            (Outcome::Failed(reason), _) => {
                self.log
                    .run_line(LogLevel::ERROR, &format!("failed: {reason}"));
                self.store
                    .record_failure(&self.plan, cell, reason)
                    .map_err(sink_error)
            }
            (Outcome::Cached(_), _) => {
                if let CellRef::Reference(i) = cell
                    && let Err(e) = self.store.import_reference(&self.plan, i)
                {
                    // The night does not need the copy: it reads the file itself.
                    tracing::warn!("cannot copy the reference: {e}");
                }
                Ok(())
            }
            (Outcome::Interrupted, _) => Ok(()),
        };
        self.open_runs.remove(&cell);
        self.logged = None;
        self.log.set_run(None);
        written
    }

    /// Enters a message in the log of the current run.
    fn log_message(&self, level: Level, text: &str) {
        let log_level = match level {
            Level::Info => LogLevel::INFO,
            Level::Warn => LogLevel::WARN,
            Level::Error => LogLevel::ERROR,
        };
        self.log.run_line(log_level, text);
    }

    /// Enters an event in the journal. Errors are only logged: the journal repeats what the files of
    /// the runs contain.
    fn journal(&self, event: &Event) {
        if let Some(recorded) = JournalEvent::from_event(event, &self.plan)
            && let Err(e) = self.store.journal(recorded)
        {
            tracing::warn!("{e}");
        }
    }
}

impl Sink for Recorder<'_> {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        if let Some(cell) = event
            .cell()
            .filter(|cell| self.open_runs.contains_key(cell))
        {
            self.select_log(cell);
        }
        match event {
            Event::CellStarted {
                cell,
                open,
                reference,
                resumed,
                ..
            } => {
                let resumed = resumed.as_deref().map(Vec::as_slice);
                self.start_run(*cell, open, reference.is_some(), resumed)?;
            }
            Event::Wave {
                cell,
                row,
                image: Some(image),
                pow2,
                ..
            } => self.record_wave(*cell, row, image, *pow2)?,
            Event::NoiseFloors { reference, floors } => {
                self.floors.insert(*reference, Arc::clone(floors));
            }
            Event::ShardFinished {
                shard,
                sums: Some(sums),
                ..
            } => self.retry_while_full(|| self.store.save_shard(&self.plan, shard, sums))?,
            Event::BiasCheck {
                reference,
                check,
                compared: Some((with, found)),
            } => self.write_bias_check([*reference, *with], check, found)?,
            Event::Halves { reference, halves } => self.write_halves(*reference, halves)?,
            Event::CellFinished {
                cell,
                outcome,
                film,
                denoised,
                layers,
                times,
                rows,
                ..
            } => {
                let extra = ExtraFilms {
                    denoised: denoised.as_deref(),
                    layers,
                    times: times.as_deref(),
                };
                self.end_run(*cell, outcome, film.as_deref(), &extra, rows)?;
            }
            Event::Message { level, text, .. } => self.log_message(*level, text),
            // Time bins are written when the run is done; the journal has the rest, and runs of other
            // processes are recorded there.
            Event::Times { .. }
            | Event::RunActive { .. }
            | Event::ShardActive { .. }
            | Event::Wave { image: None, .. }
            | Event::Picture { .. }
            | Event::Layer { .. }
            | Event::BiasCheck { compared: None, .. }
            | Event::NightStarted { .. }
            | Event::ShardStarted { .. }
            | Event::ShardFinished { sums: None, .. }
            | Event::Forecast(_)
            | Event::NightFinished => {}
        }
        self.journal(event);
        Ok(())
    }
}

/// Converts an error of writing or encoding a file.
fn sink_error(error: impl std::fmt::Display) -> SinkError {
    SinkError(error.to_string())
}

/// Returns a row with the values of its net columns appended to its metrics.
fn with_net_values(plan: &Plan, floors: &NoiseFloors, row: &WaveRow) -> WaveRow {
    let net = net_values(plan, floors, &row.metrics);
    WaveRow {
        metrics: row.metrics.iter().copied().chain(net).collect(),
        ..row.clone()
    }
}
