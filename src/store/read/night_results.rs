//! Reads the results of a whole night from its folder, finished or not, for reports. Nothing here
//! writes or locks.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::evidence::Evidence;
use super::merged_journal::finished_runs;
use super::night_reader::NightReader;
use super::run_reader::{RunReader, describe};
use crate::experiment::night_results::{
    BiasCheckSummary, Machine, NightResults, ReferenceOrigin, ReferenceResult, RunResult, RunState,
};
use crate::experiment::spec::Presentation;
use crate::experiment::{CellRef, CellResult, Outcome, Plan, WaveRow};
use crate::store::schema::plan::{
    EnvFile, PlanFile, PlannedCell, PlannedReference, PresentationRecord,
};
use crate::store::schema::run::{BiasCheckFile, DONE, DoneFile, REFERENCE, RunResults};
use crate::store::{Store, StoreError};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::device::devices_line;

/// Reads a night from its folder. References are read from the folder `refs` beside it, and runs
/// that an earlier night of the same name finished from that night's folder. Runs and references
/// that do not match their checksums are left out, and `evidence` has the problems.
///
/// # Errors
/// When the folder holds no plan, or another version of the program wrote it. Everything else that
/// is missing becomes a note.
pub fn read_night(folder: &Path, evidence: &Evidence) -> Result<NightResults, StoreError> {
    let night = NightReader::open(folder)?;
    let plan = night.plan();
    let mut notes = missing_support(plan);
    let metrics = metrics(plan, &mut notes);
    let cells = plan.cells.iter().enumerate();
    // Duplicate cells of the A/A check are no results.
    let cells = cells.filter(|(_, cell)| cell.double_of.is_none());
    let finished = finished_runs(night.folder());
    let runs: Vec<RunResult> = cells
        .map(|(i, cell)| run_result(&night, i, cell, &metrics, &finished, evidence))
        .collect();
    let is_measured = |run: &&RunResult| run.rows.iter().any(|row| !row.metrics.is_empty());
    let used: BTreeSet<usize> = runs
        .iter()
        .filter(is_measured)
        .filter_map(|run| run.reference)
        .collect();
    let references = plan.references.iter().enumerate();
    let references = references
        .map(|(i, reference)| {
            // A night that was copied without its references has no folders of them.
            let expected = (used.contains(&i) || finished.contains(reference.run()))
                && night.run_folder(CellRef::Reference(i)).is_dir();
            reference_result(&night, i, reference, expected, evidence)
        })
        .collect();
    Ok(NightResults {
        folder: night.folder().to_owned(),
        name: plan.name.clone(),
        plan: plan.hash.clone(),
        seed: plan.seed,
        axes: plan.axes.clone(),
        metrics,
        report: plan
            .report
            .as_ref()
            .map_or_else(Presentation::default, presentation),
        order: plan.night.order.clone(),
        machine: read_machine(&night, evidence),
        runs,
        references,
        notes,
    })
}

/// Reads the presentation of the results. A tone map that this version does not know is left
/// out.
fn presentation(record: &PresentationRecord) -> Presentation {
    Presentation {
        display: Tonemap::from_value("report.display", &record.display).ok(),
        names: record.names.clone(),
        colours: record.colours.clone(),
    }
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

/// Reads the run of a cell. `finished` has the runs that the journal states as finished.
fn run_result(
    night: &NightReader,
    index: usize,
    cell: &PlannedCell,
    metrics: &[MetricSpec],
    finished: &BTreeSet<String>,
    evidence: &Evidence,
) -> RunResult {
    let cell_ref = CellRef::Cell(index);
    let folder = night.finished_folder(cell_ref);
    let run = RunReader::new(folder.unwrap_or_else(|| night.run_folder(cell_ref)));
    let expected = finished.contains(&cell.run);
    let found = evidence.expected(run.folder(), &cell.run, DONE, expected);
    let found = found.and_then(|done| {
        let rows = rows(&run, done.as_deref(), metrics);
        let rows = rows.map_err(|problem| evidence.report(run.folder(), &problem))?;
        Ok((rows, done))
    });
    let damaged = found.is_err();
    let (rows, done) = found.unwrap_or_default();
    let results = done.as_deref().and_then(DoneFile::rendered);
    let devices = results.map(RunResults::devices).unwrap_or_default();
    RunResult {
        path: cell.path.clone(),
        point: cell.point.0.clone(),
        repeat: u64::from(cell.repeat),
        seed: cell.seed,
        integrator: cell.integrator.clone(),
        denoise: cell.denoise.clone(),
        scene: cell.scene.clone(),
        max_depth: cell.max_depth,
        resolution: cell.resolution,
        device: results.map(device).filter(|device| !device.is_empty()),
        peer: devices.iter().find_map(|device| device.peer.clone()),
        lost_share: results.and_then(|results| {
            let lost_s = results.lost_s?;
            Some(lost_s / (results.render_s + lost_s)).filter(|share| share.is_finite())
        }),
        lanes: devices.iter().find_map(|device| device.features.lanes),
        open: results.map(|results| results.open.stats(devices.clone())),
        reference: cell.reference,
        pictures: if damaged {
            Vec::new()
        } else {
            run.pictures(done.as_deref())
        },
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
            None if damaged => RunState::Damaged,
            None if rows.is_empty() => RunState::Pending,
            None => RunState::Unfinished,
        },
        rows: Arc::new(rows),
        id: cell.run.clone(),
        folder: run.folder().to_owned(),
    }
}

/// Measurements of a run, with the known metrics in their order.
fn rows(
    run: &RunReader,
    done: Option<&DoneFile>,
    metrics: &[MetricSpec],
) -> Result<Vec<WaveRow>, String> {
    let found = run.measurements(done)?;
    Ok(found.in_order(metrics.iter().map(|metric| metric.column.as_str())))
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

/// Device that a run was rendered on, for people. Of threads of a processor, the model of the
/// processor is stated, since workers of one night may differ.
fn device(results: &RunResults) -> String {
    let devices = results.devices();
    match devices.first().and_then(|device| device.threads) {
        Some(threads) if !results.processor.is_empty() => {
            format!("{}, {threads} threads", results.processor)
        }
        _ => devices_line(&devices),
    }
}

/// Reads a reference. `expected` is whether it must be finished.
fn reference_result(
    night: &NightReader,
    index: usize,
    reference: &PlannedReference,
    expected: bool,
    evidence: &Evidence,
) -> ReferenceResult {
    let mut picture = night.reference_picture(index);
    let origin = match reference {
        PlannedReference::File(found) => {
            if let Some(picture) = picture.as_ref().filter(|_| !found.blake3.is_empty()) {
                evidence.expect(picture, &found.blake3);
            }
            let name = PathBuf::from(&found.source);
            let name = name.file_name().unwrap_or_default().to_string_lossy();
            let maker = match found.made_by.as_str() {
                "" => String::new(),
                by => format!(", {by}"),
            };
            ReferenceOrigin::Other(format!("{name}{maker}, its noise unknown"))
        }
        PlannedReference::Render(rendered) => {
            let integrator = rendered.source.integrator();
            let folder = night.run_folder(CellRef::Reference(index));
            let found = evidence.expected(&folder, &rendered.run, REFERENCE, expected);
            match found.ok().flatten().as_deref().and_then(DoneFile::rendered) {
                Some(results) => ReferenceOrigin::Rendered {
                    integrator: integrator.to_owned(),
                    samples: results.samples,
                },
                None => {
                    picture = None;
                    ReferenceOrigin::Other(format!("{integrator}, not finished"))
                }
            }
        }
    };
    let checks = RunReader::new(night.run_folder(CellRef::Reference(index))).bias_checks();
    let checks = checks.map_err(|error| evidence.report(&error.path, &error.problem.to_string()));
    let own = |check: &BiasCheckFile| check.reference == reference.run();
    ReferenceResult {
        id: reference.run().to_owned(),
        picture,
        origin,
        checks: checks
            .unwrap_or_default()
            .into_iter()
            .filter(own)
            .map(BiasCheckSummary::from)
            .collect(),
    }
}

impl From<BiasCheckFile> for BiasCheckSummary {
    fn from(check: BiasCheckFile) -> BiasCheckSummary {
        BiasCheckSummary {
            technique: check.technique,
            agrees: check.agrees,
            finding: check.finding,
        }
    }
}

/// Reads the machine that last rendered a night. Without an intact record of it, that is a problem.
fn read_machine(night: &NightReader, evidence: &Evidence) -> Option<Machine> {
    let env = night.env();
    env.map_err(|error| evidence.report(night.folder(), &describe(&error)))
        .ok()
        .map(machine)
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
