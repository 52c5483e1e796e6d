//! Reads the results of a whole night from its folder, finished or not, for reports. Nothing here
//! writes or locks.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::evidence::Evidence;
use super::merged_journal::finished_runs;
use super::night_reader::NightReader;
use super::planned_night::planned_night;
use super::run_reader::{RunReader, describe};
use crate::experiment::night::reference::{
    BiasCheckSummary, Reference, ReferenceOrigin, ReferencePlan,
};
use crate::experiment::night::run::{Run, RunPlan, RunState};
use crate::experiment::night::{Machine, Night};
use crate::experiment::{CellRef, EndCause, Outcome, Plan, WaveRow};
use crate::store::schema::plan::{EnvFile, PlannedReference};
use crate::store::schema::run::{BiasCheckFile, DONE, DoneFile, REFERENCE, RunResults};
use crate::store::{Store, StoreError};
use lumbre_metrics::MetricSpec;
use lumbre_render::device::devices_line;

/// Reads a night from its folder, without runs that duplicate others for the A/A check. References
/// are read from the folder `refs` beside it, and runs that an earlier night of the same name
/// finished from that night's folder. Runs and references that do not match their checksums are
/// left out, and `evidence` has the problems.
///
/// # Errors
/// When the folder holds no plan, or another version of the program wrote it. Everything else that
/// is missing becomes a note.
pub fn read_night(folder: &Path, evidence: &Evidence) -> Result<Night, StoreError> {
    let files = NightReader::open(folder)?;
    let mut night = planned_night(&files);
    let finished = finished_runs(files.folder());
    let metrics = &night.plan.metrics;
    for (i, run) in night.runs.iter_mut().enumerate() {
        let planned = Arc::clone(&run.planned);
        *run = Arc::new(read_run(&files, i, planned, metrics, &finished, evidence));
    }
    let is_measured = |run: &&Arc<Run>| run.rows.iter().any(|row| !row.metrics.is_empty());
    let used: BTreeSet<usize> = night
        .runs
        .iter()
        .filter(is_measured)
        .filter_map(|run| run.reference)
        .collect();
    for (i, reference) in night.references.iter_mut().enumerate() {
        // A night that was copied without its references has no folders of them.
        let expected = (used.contains(&i) || finished.contains(&reference.id))
            && files.run_folder(CellRef::Reference(i)).is_dir();
        let planned = Arc::clone(&reference.planned);
        *reference = Arc::new(read_reference(&files, i, planned, expected, evidence));
    }
    night.machine = read_machine(&files, evidence);
    Ok(night.without_doubles())
}

/// Reads the run of a cell. `finished` has the runs that the journal states as finished.
fn read_run(
    files: &NightReader,
    index: usize,
    planned: Arc<RunPlan>,
    metrics: &[MetricSpec],
    finished: &BTreeSet<String>,
    evidence: &Evidence,
) -> Run {
    let cell = CellRef::Cell(index);
    let folder = files.finished_folder(cell);
    let run = RunReader::new(folder.unwrap_or_else(|| files.run_folder(cell)));
    let expected = finished.contains(&planned.id);
    let found = evidence.expected(run.folder(), &planned.id, DONE, expected);
    let found = found.and_then(|done| {
        let rows = rows(&run, done.as_deref(), metrics);
        let rows = rows.map_err(|problem| evidence.report(run.folder(), &problem))?;
        Ok((rows, done))
    });
    let problem = found.as_ref().err().cloned();
    let (rows, done) = found.unwrap_or_default();
    let results = done.as_deref().and_then(DoneFile::rendered);
    let devices = results.map(RunResults::devices).unwrap_or_default();
    let pictures = match problem {
        Some(_) => Vec::new(),
        None => run.pictures(done.as_deref()),
    };
    let floors = results.and_then(|results| Some((results, results.floors.as_ref()?)));
    let floors = floors.map(|(results, floors)| {
        let columns = floors.0.iter().map(|(column, _)| column);
        let known = columns.filter_map(|c| Some((c.clone(), results.floor(c)?)));
        known.collect()
    });
    Run {
        planned,
        state: match (results, problem) {
            (Some(results), _) => RunState::Ended(Outcome::Done(EndCause::other(&results.reason))),
            (None, Some(problem)) => RunState::Damaged(problem),
            (None, None) if rows.is_empty() => RunState::Pending,
            (None, None) => RunState::Ended(Outcome::Interrupted),
        },
        device: results.map(device).filter(|device| !device.is_empty()),
        peer: devices.iter().find_map(|device| device.peer.clone()),
        lost_share: results.and_then(|results| {
            let lost_s = results.lost_s?;
            Some(lost_s / (results.render_s + lost_s)).filter(|share| share.is_finite())
        }),
        lanes: devices.iter().find_map(|device| device.features.lanes),
        open: results.map(|results| results.open.stats(devices.clone())),
        pictures,
        films: results
            .map(|results| results.films.clone())
            .unwrap_or_default(),
        floors: floors.unwrap_or_default(),
        rows: Arc::new(rows),
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
    pub fn device(&self, plan: &Plan, cell: CellRef, outcome: &Outcome) -> Option<String> {
        let folder = match outcome {
            Outcome::Cached(folder) => folder.clone(),
            Outcome::Done(_) => self.run_folder(plan, cell),
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
fn read_reference(
    files: &NightReader,
    index: usize,
    planned: Arc<ReferencePlan>,
    expected: bool,
    evidence: &Evidence,
) -> Reference {
    let mut picture = files.reference_picture(index);
    let folder = files.run_folder(CellRef::Reference(index));
    let other = |text: String| (ReferenceOrigin::Other(text), RunState::Pending);
    let (origin, state) = match files.plan().references.get(index) {
        None => other(String::new()),
        Some(PlannedReference::File(found)) => {
            if let Some(picture) = picture.as_ref().filter(|_| !found.blake3.is_empty()) {
                evidence.expect(picture, &found.blake3);
            }
            let name = PathBuf::from(&found.source);
            let name = name.file_name().unwrap_or_default().to_string_lossy();
            let maker = match found.made_by.as_str() {
                "" => String::new(),
                by => format!(", {by}"),
            };
            other(format!("{name}{maker}, its noise unknown"))
        }
        Some(PlannedReference::Render(rendered)) => {
            let integrator = rendered.source.integrator();
            let found = evidence.expected(&folder, &rendered.run, REFERENCE, expected);
            match found.ok().flatten().as_deref().and_then(DoneFile::rendered) {
                Some(results) => (
                    ReferenceOrigin::Rendered {
                        integrator: integrator.to_owned(),
                        samples: results.samples,
                    },
                    RunState::Ended(Outcome::Done(EndCause::other(&results.reason))),
                ),
                None => {
                    picture = None;
                    other(format!("{integrator}, not finished"))
                }
            }
        }
    };
    let checks = RunReader::new(folder.clone()).bias_checks();
    let checks = checks.map_err(|error| evidence.report(&error.path, &error.problem.to_string()));
    let own = |check: &BiasCheckFile| check.reference == planned.id;
    Reference {
        picture,
        origin,
        state,
        checks: checks
            .unwrap_or_default()
            .into_iter()
            .filter(own)
            .map(BiasCheckSummary::from)
            .collect(),
        folder,
        planned,
        ..Reference::default()
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
