//! Reads the results of a whole night from its folder, finished or not, for reports. Nothing here
//! writes or locks.

use std::path::{Path, PathBuf};

use super::night_reader::NightReader;
use super::run_reader::RunReader;
use crate::experiment::night_results::{
    Machine, NightResults, ReferenceResult, RunResult, RunState,
};
use crate::experiment::{CellRef, CellResult, Outcome, Plan, WaveRow};
use crate::metrics::MetricSpec;
use crate::store::schema::plan::{EnvFile, PlanFile, PlannedCell, PlannedReference};
use crate::store::schema::run::{DoneFile, RunResults};
use crate::store::write::metrics_csv;
use crate::store::{Store, StoreError};

/// Reads a night from its folder. References are read from the folder `refs` beside it, and runs
/// that an earlier night of the same name finished from that night's folder.
///
/// # Errors
/// When the folder holds no plan, or another version of the program wrote it. Everything else that
/// is missing or damaged becomes a note.
pub fn read_night(folder: &Path) -> Result<NightResults, StoreError> {
    let night = NightReader::open(folder)?;
    let plan = night.plan();
    let mut notes = missing_support(plan);
    let metrics = metrics(plan, &mut notes);
    let cells = plan.cells.iter().enumerate();
    // Duplicate cells of the A/A check are no results.
    let cells = cells.filter(|(_, cell)| cell.double_of.is_none());
    let runs = cells
        .map(|(i, cell)| run_result(&night, i, cell, &metrics, &mut notes))
        .collect();
    let references = plan.references.iter().enumerate();
    let references = references
        .map(|(i, reference)| reference_result(&night, i, reference))
        .collect();
    Ok(NightResults {
        folder: night.folder().to_owned(),
        name: plan.name.clone(),
        plan: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        metrics,
        machine: night.env().ok().map(machine),
        runs,
        references,
        notes,
    })
}

/// Describes points that were skipped because the machine lacks support, each reason once.
fn missing_support(plan: &PlanFile) -> Vec<String> {
    let mut reasons: Vec<(&str, usize)> = Vec::new();
    for skipped in plan.skipped.iter().filter(|skipped| skipped.absent) {
        match reasons
            .iter_mut()
            .find(|(known, _)| *known == skipped.reason)
        {
            Some((_, count)) => *count += 1,
            None => reasons.push((&skipped.reason, 1)),
        }
    }
    let note = |(reason, count): (&str, usize)| match count {
        1 => format!("1 point of the sweep is left out: {reason}"),
        _ => format!("{count} points of the sweep are left out: {reason}"),
    };
    reasons.into_iter().map(note).collect()
}

/// Reads the definitions of the metrics.
fn metrics(plan: &PlanFile, notes: &mut Vec<String>) -> Vec<MetricSpec> {
    let mut metrics = Vec::new();
    for metric in &plan.measure.metrics {
        match MetricSpec::new(&metric.column, &metric.metric, metric.options.clone()) {
            Ok(spec) => metrics.push(spec),
            Err(e) => notes.push(format!("column `{}` is left out: {e}", metric.column)),
        }
    }
    metrics
}

/// Reads the run of a cell.
fn run_result(
    night: &NightReader,
    index: usize,
    cell: &PlannedCell,
    metrics: &[MetricSpec],
    notes: &mut Vec<String>,
) -> RunResult {
    let cell_ref = CellRef::Cell(index);
    let finished = night.finished_folder(cell_ref);
    let run = RunReader::new(finished.unwrap_or_else(|| night.run_folder(cell_ref)));
    let done = run.checked().unwrap_or_else(|problem| {
        notes.push(format!(
            "{}: {problem}; the run is treated as unfinished",
            run.folder().display()
        ));
        None
    });
    let rows = rows(&run, done.as_ref(), metrics, notes);
    let results = done.as_ref().and_then(DoneFile::rendered);
    RunResult {
        path: cell.path.clone(),
        point: cell.point.0.clone(),
        repeat: u64::from(cell.repeat),
        seed: cell.seed,
        integrator: cell.integrator.clone(),
        scene: cell.scene.clone(),
        resolution: cell.resolution,
        device: results.map(device),
        peer: results.and_then(|results| external_program(&cell.integrator, results)),
        accel: results.map(|results| (results.open.accel_build_s, results.open.accel_nodes)),
        accel_size: results.map(|results| (results.open.accel_bytes, results.open.accel_cost)),
        reference: cell.reference,
        pictures: run.pictures(done.as_ref()),
        films: results
            .map(|results| results.films.clone())
            .unwrap_or_default(),
        floors: results
            .and_then(|results| results.floors.as_ref())
            .map(|floors| {
                floors
                    .0
                    .iter()
                    .map(|(name, x)| (name.clone(), x.0))
                    .collect()
            })
            .unwrap_or_default(),
        state: match results {
            Some(results) => RunState::Done(results.reason.clone()),
            None if rows.is_empty() => RunState::Pending,
            None => RunState::Unfinished,
        },
        rows,
        id: cell.run.clone(),
        folder: run.folder().to_owned(),
    }
}

/// Measurements of a run, with the known metrics in their order.
fn rows(
    run: &RunReader,
    done: Option<&DoneFile>,
    metrics: &[MetricSpec],
    notes: &mut Vec<String>,
) -> Vec<WaveRow> {
    match run.measurements(done) {
        Ok(found) => found.in_order(metrics.iter().map(|metric| metric.column.as_str())),
        Err(problem) => {
            notes.push(format!(
                "{}: {problem}",
                run.folder().join(metrics_csv::FILE).display()
            ));
            Vec::new()
        }
    }
}

/// Name and version of the external program that rendered a run: the last part of its device.
fn external_program(integrator: &str, results: &RunResults) -> Option<String> {
    let device = integrator
        .starts_with("external:")
        .then_some(&results.device)?;
    device
        .rsplit_once(", ")
        .map(|(_, program)| program.to_owned())
}

impl Store {
    /// Device that a cell was rendered on, if it is done.
    pub fn device(&self, plan: &Plan, result: &CellResult) -> Option<String> {
        let folder = match &result.outcome {
            Outcome::Cached(folder) => folder.clone(),
            Outcome::Done(_) => self.run_folder(plan, result.cell),
            Outcome::Failed(_) | Outcome::Interrupted => return None,
        };
        let done = RunReader::new(folder).done().ok()??;
        done.rendered().map(device)
    }
}

/// Device that a run was rendered on. The `cpu` backend reports its number of threads; the model of
/// the processor is added, since workers of one night may differ.
fn device(results: &RunResults) -> String {
    let device = &results.device;
    let threads = device
        .strip_prefix("cpu, ")
        .and_then(|rest| rest.split(',').find(|part| part.contains("thread")));
    match threads.filter(|_| !results.processor.is_empty()) {
        Some(threads) => format!("{}, {}", results.processor, threads.trim()),
        None => device.clone(),
    }
}

fn reference_result(
    night: &NightReader,
    index: usize,
    reference: &PlannedReference,
) -> ReferenceResult {
    let description = match reference {
        PlannedReference::File(found) => {
            let name = PathBuf::from(&found.source);
            let name = name.file_name().unwrap_or_default().to_string_lossy();
            let maker = match found.made_by.as_str() {
                "" => String::new(),
                by => format!(", {by}"),
            };
            format!("{name}{maker}, its noise unknown")
        }
        PlannedReference::Render(rendered) => {
            let integrator = &rendered.source.integrator;
            let done = night.run(CellRef::Reference(index)).done();
            match done.ok().flatten().as_ref().and_then(DoneFile::rendered) {
                Some(results) => format!("{integrator}, {} samples per pixel", results.samples),
                None => format!("{integrator}, not finished"),
            }
        }
    };
    ReferenceResult {
        id: reference.run().to_owned(),
        picture: night.reference_picture(index),
        description,
    }
}

fn machine(env: EnvFile) -> Machine {
    Machine {
        host: env.host,
        os: env.os,
        cpu: env.cpu,
        cores: env.cores,
        program: env.program.0,
        date: env.date,
        arguments: env.arguments,
    }
}
