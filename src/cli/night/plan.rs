//! `lumbre plan`: what a script would render, what is cached and what is skipped.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::Path;

use serde::Serialize;

use super::load::{self, decode_picture};
use super::permission::{self, PlanUse};
use crate::cli::args::{Global, PlanArgs};
use crate::cli::exit::{Exit, Failure, print_result};
use crate::cli::format::{self, counted, display_path};
use lumbre_night::experiment::event::{FinishedRun, History};
use lumbre_night::experiment::forecast::{
    Forecast, Throughput, ThroughputHistory, WorkloadKey, forecast,
};
use lumbre_night::experiment::memory;
use lumbre_night::experiment::noise_floor::floors;
use lumbre_night::experiment::plan::{
    Estimate, PlannedCommand, ReferenceSource, unreachable_thresholds,
};
use lumbre_night::experiment::spec::Order;
use lumbre_night::experiment::{CellRef, Plan, StopRule};
use lumbre_night::store::schema::plan::PlanFile;
use lumbre_night::store::{Archive, plan_file, throughput_history};
use lumbre_render::shaders::ShaderFolder;

/// Most points that are listed which one rule leaves out.
const MOST_SKIPPED: usize = 8;

/// Runs `lumbre plan`: prints the plan of a script.
pub fn main(args: &PlanArgs, global: &Global) -> Result<Exit, Failure> {
    let (_, plan) = load::load_plan(&args.script, PlanUse::Show, global)?;
    print(&plan, global, args.json)
}

/// Prints a plan with the states of its runs as text or JSON.
pub(in crate::cli) fn print(plan: &Plan, global: &Global, as_json: bool) -> Result<Exit, Failure> {
    let outlook = Outlook::new(plan, global);
    if as_json {
        let text = serde_json::to_string_pretty(&outlook.output()).map_err(Failure::internal)?;
        print_result(&(text + "\n"))?;
    } else {
        print_result(&outlook.page())?;
    }
    Ok(Exit::Done)
}

/// Output of `lumbre plan --json`: the content of `plan.json`, what of it is done, and estimates.
#[derive(Serialize)]
struct PlanOutput<'a> {
    #[serde(flatten)]
    plan: PlanFile,
    /// States of the cells, in their order.
    cell_states: Vec<StateOutput<'a>>,
    /// States of the references, in their order.
    reference_states: Vec<StateOutput<'a>>,
    /// Commands of external techniques, as words.
    commands: &'a [PlannedCommand],
    /// Whether these commands may run.
    commands_allowed: bool,
    estimate: &'a Estimate,
    forecast: &'a Forecast,
    /// For each reference, the samples per pixel of a shorter one from which it would resume.
    resumes_from: &'a [Option<u64>],
    /// Warnings about thresholds below the noise of finished references.
    unreachable: &'a [String],
}

/// State of a cell or reference.
#[derive(Serialize)]
struct StateOutput<'a> {
    /// `cached`, or `new` if it would be rendered.
    state: &'static str,
    /// Folder in which it is finished.
    cached_in: Option<&'a str>,
}

impl StateOutput<'_> {
    fn new(found: &Option<String>, is_file: bool) -> StateOutput<'_> {
        let cached = found.is_some() || is_file;
        StateOutput {
            state: if cached { "cached" } else { "new" },
            cached_in: found.as_deref(),
        }
    }
}

/// Plan with the states of its runs and estimates of the work left.
struct Outlook<'a> {
    plan: &'a Plan,
    /// Folders of the finished cells; `None` for cells to render.
    cells: Vec<Option<String>>,
    /// Folders of the finished references; `None` for references to render.
    references: Vec<Option<String>>,
    estimate: Estimate,
    /// Limit of the option `--memory`, in bytes.
    memory: Option<u64>,
    forecast: Forecast,
    /// For each reference, the samples per pixel of a shorter one from which it would resume.
    resume_samples: Vec<Option<u64>>,
    /// Warnings about thresholds below the noise of finished references.
    unreachable: Vec<String>,
}

impl<'a> Outlook<'a> {
    /// Compares a plan with the results on disk.
    fn new(plan: &'a Plan, global: &Global) -> Outlook<'a> {
        let archive = Archive::new(&global.out, decode_picture);
        let runs: Vec<Option<FinishedRun>> = (0..plan.cells.len())
            .map(|i| archive.finished_run(plan, CellRef::Cell(i)))
            .collect();
        let folder = |run: &FinishedRun| display_path(&run.folder);
        let cells: Vec<Option<String>> = runs.iter().map(|run| run.as_ref().map(folder)).collect();
        let references: Vec<Option<String>> = (0..plan.references.len())
            .map(|i| archive.finished_run(plan, CellRef::Reference(i)))
            .map(|run| run.as_ref().map(folder))
            .collect();
        let is_open = |cell: CellRef| match cell {
            CellRef::Cell(i) => cells[i].is_none(),
            CellRef::Reference(i) => references[i].is_none(),
        };
        Outlook {
            estimate: plan.estimate(&is_open),
            memory: global.memory,
            forecast: forecast(plan, &throughput(plan, &runs, &global.out), &is_open),
            resume_samples: (0..plan.references.len())
                .map(|i| archive.shorter_samples(plan, i))
                .collect(),
            unreachable: unreachable(plan, &archive),
            plan,
            cells,
            references,
        }
    }

    /// Returns the plan for output as JSON.
    fn output(&self) -> PlanOutput<'_> {
        let files = self.plan.references.iter().map(|r| r.stem().is_none());
        PlanOutput {
            plan: plan_file(self.plan),
            cell_states: self
                .cells
                .iter()
                .map(|found| StateOutput::new(found, false))
                .collect(),
            reference_states: self
                .references
                .iter()
                .zip(files)
                .map(|(found, is_file)| StateOutput::new(found, is_file))
                .collect(),
            commands: &self.plan.commands,
            commands_allowed: self.plan.commands_allowed,
            estimate: &self.estimate,
            forecast: &self.forecast,
            resumes_from: &self.resume_samples,
            unreachable: &self.unreachable,
        }
    }

    /// Formats the plan as text.
    fn page(&self) -> String {
        let plan = self.plan;
        let mut out = format!("{}  plan {}\n\n", plan.name, short_id(&plan.hash));
        if !plan.references.is_empty() {
            out += &format::aligned(&self.reference_lines());
            out.push('\n');
        }
        out += &format::aligned(&self.cell_lines());
        // Writing to a String cannot fail.
        for (reason, count) in plan.skip_reasons() {
            if count > MOST_SKIPPED {
                let _ = writeln!(out, "skipped {count} points (all with --json): {reason}");
                continue;
            }
            for skipped in plan.skipped.iter().filter(|s| s.reason == reason) {
                let point = skipped.point.iter();
                let point: Vec<String> = point.map(|(a, v)| format!("{a}={v}")).collect();
                let _ = writeln!(out, "skipped {}: {reason}", point.join(" "));
            }
        }
        let count = |found: &[Option<String>]| found.iter().flatten().count();
        let _ = writeln!(
            out,
            "\n{} ({} cached), {} ({} cached), {} skipped",
            counted(self.cells.len(), "cell"),
            count(&self.cells),
            counted(self.references.len(), "reference"),
            count(&self.references),
            counted(plan.skipped.len(), "point")
        );
        let _ = writeln!(out, "estimate: {}", describe_estimate(&self.estimate));
        if let Some(forecast) = describe_forecast(&self.forecast) {
            let _ = writeln!(out, "{forecast}");
        }
        out += &self.order_line();
        if let Some(warmup) = plan.night.warmup {
            let _ = writeln!(
                out,
                "warm-up of every cell (discarded): {}",
                warmup.describe()
            );
        }
        let doubles = plan
            .cells
            .iter()
            .filter(|cell| cell.double_of.is_some())
            .count();
        if doubles > 0 {
            let cells = counted(doubles, "cell");
            let _ = writeln!(out, "A/A check: {cells} repeat other cells");
        }
        out += &shader_lines(plan);
        if !plan.commands.is_empty() {
            let allowed = if plan.commands_allowed {
                "allowed"
            } else {
                "not allowed yet: `lumbre run` asks, or runs them with --allow-commands"
            };
            let commands = permission::listing(&plan.commands);
            let _ = write!(out, "commands of other programs ({allowed}):\n{commands}");
        }
        for note in &plan.notes {
            let _ = writeln!(out, "note: {note}");
        }
        let memory = self.memory_warning();
        for warning in plan.warnings.iter().chain(&self.unreachable).chain(&memory) {
            let _ = writeln!(out, "warning: {warning}");
        }
        out
    }

    /// Returns the table of references, with a header line.
    fn reference_lines(&self) -> Vec<Vec<String>> {
        let header = ["reference", "source", "stop", "state"];
        let mut lines = vec![header.map(str::to_owned).to_vec()];
        for (i, reference) in self.plan.references.iter().enumerate() {
            let (source, stop, state) = match &reference.source {
                ReferenceSource::Render {
                    config,
                    stop,
                    shard_samples,
                    ..
                } => {
                    let shards = shard_samples
                        .map_or_else(String::new, |samples| format!(", in shards of {samples}"));
                    let state = match (&self.references[i], self.resume_samples[i]) {
                        (None, Some(samples)) => {
                            format!("new, resumes from {samples} samples per pixel")
                        }
                        (folder, _) => describe_state(folder),
                    };
                    (
                        format!("{} {}", config.integrator, config.scene),
                        stop.describe() + &shards,
                        state,
                    )
                }
                ReferenceSource::File { file, source } => {
                    let digits = short_id(reference.file_hash().unwrap_or_default());
                    let source = if source.is_empty() {
                        "unknown source"
                    } else {
                        source
                    };
                    (
                        display_path(file),
                        String::new(),
                        format!("file, blake3 {digits}, {source}; its noise is unknown"),
                    )
                }
            };
            lines.push(vec![short_id(&reference.id.0), source, stop, state]);
        }
        lines
    }

    /// Returns the table of cells, with a header line.
    fn cell_lines(&self) -> Vec<Vec<String>> {
        let axes = self
            .plan
            .cells
            .first()
            .map(|c| c.point.iter().map(|(name, _)| name.clone()))
            .into_iter()
            .flatten();
        let mut header = vec!["cell".to_owned()];
        header.extend(axes);
        header.extend(["repeat", "run", "state"].map(str::to_owned));
        let mut lines = vec![header];
        for (i, (cell, folder)) in self.plan.cells.iter().zip(&self.cells).enumerate() {
            let mut line = vec![(i + 1).to_string()];
            line.extend(cell.point.iter().map(|(_, value)| value.to_string()));
            line.extend([
                cell.repeat.to_string(),
                short_id(&cell.id.0),
                describe_state(folder),
            ]);
            lines.push(line);
        }
        lines
    }

    /// Returns the line about the order of the runs; empty for sequential order.
    fn order_line(&self) -> String {
        match self.plan.night.order {
            Order::Sequential => String::new(),
            Order::Shuffled => "order: shuffled\n".to_owned(),
            Order::Interleave => {
                let groups = self
                    .plan
                    .interleave_groups(self.plan.night.deadline.is_some());
                let largest = groups.iter().map(Vec::len).max().unwrap_or(0);
                let memory = if self.estimate.interleaved_bytes > 0 {
                    format!(
                        "; a group needs up to {} of memory",
                        format::size(self.estimate.interleaved_bytes)
                    )
                } else {
                    String::new()
                };
                format!(
                    "order: {} of up to {largest} interleaved runs{memory}\n",
                    counted(groups.len(), "group")
                )
            }
        }
    }

    /// Returns a warning if a run, or the runs of an interleave group, do not fit into memory.
    fn memory_warning(&self) -> Option<String> {
        let limit = memory::total(self.memory)?;
        let estimate = &self.estimate;
        let (runs, bytes) = (estimate.interleaved_runs, estimate.interleaved_bytes);
        memory::shortage(1, estimate.run_bytes, &limit)
            .or_else(|| memory::shortage(runs, bytes, &limit))
    }
}

/// Returns a line for each folder of shaders that runs of a plan use.
fn shader_lines(plan: &Plan) -> String {
    let mut folders: BTreeMap<&ShaderFolder, usize> = BTreeMap::new();
    let cells = plan.cells.iter().map(|cell| &*cell.config);
    let references = plan
        .references
        .iter()
        .filter_map(|reference| match &reference.source {
            ReferenceSource::Render { config, .. } => Some(&**config),
            ReferenceSource::File { .. } => None,
        });
    for folder in cells.chain(references).filter_map(|c| c.shaders.folder()) {
        *folders.entry(folder).or_default() += 1;
    }
    let line = |(folder, runs): (&ShaderFolder, &usize)| {
        let path = display_path(&folder.path);
        let hash = short_id(&folder.hash);
        format!("shaders of {path} ({hash}): {}\n", counted(*runs, "run"))
    };
    folders
        .iter()
        .map(|(folder, runs)| line((folder, runs)))
        .collect()
}

/// Returns the throughput of earlier runs: those of other nights below `out`, and the finished
/// `runs` of this plan.
fn throughput(plan: &Plan, runs: &[Option<FinishedRun>], out: &Path) -> ThroughputHistory {
    let mut history = throughput_history(out);
    for (cell, run) in plan.cells.iter().zip(runs) {
        if let Some(throughput) = run
            .as_ref()
            .and_then(|run| Throughput::from_last_row(run.rows.last()?, &cell.stop))
        {
            history.record(WorkloadKey::from_config(&cell.config), throughput);
        }
    }
    history
}

/// Returns warnings about thresholds of stop rules below the noise floor of finished references.
/// Reads the halves of a reference only if a stop rule uses a metric against it, since reading
/// takes time.
fn unreachable(plan: &Plan, history: &dyn History) -> Vec<String> {
    let has_threshold = |cell: &usize| {
        let mut found = false;
        plan.cells[*cell]
            .stop
            .visit(&mut |rule| found |= matches!(rule, StopRule::When { .. }));
        found
    };
    let measured = plan.measured_cells().into_iter().enumerate();
    let measured = measured.filter(|(_, cells)| cells.iter().any(has_threshold));
    let warnings = |(i, cells): (usize, Vec<usize>)| -> Vec<String> {
        match (history.image(plan, i), history.halves(plan, i)) {
            (Ok(Some(image)), Ok(Some(halves))) => {
                let floors = floors(&plan.measure.metrics, &image, &halves);
                unreachable_thresholds(plan, &cells, &floors)
            }
            (_, Err(error)) | (Err(error), _) => {
                vec![format!("cannot estimate the noise of a reference: {error}")]
            }
            _ => Vec::new(),
        }
    };
    measured.flat_map(warnings).collect()
}

/// Describes whether a run is cached.
fn describe_state(folder: &Option<String>) -> String {
    match folder {
        Some(folder) => format!("cached in {folder}"),
        None => "new".to_owned(),
    }
}

/// Formats the forecast of the render time as a line; `None` without any earlier run to base it on.
fn describe_forecast(forecast: &Forecast) -> Option<String> {
    if forecast.known == 0 {
        return None;
    }
    let unknown = match forecast.unknown {
        0 => String::new(),
        n => format!("; {} unknown before the smoke pass", counted(n, "run")),
    };
    Some(format!(
        "forecast: {} {} for {}{unknown}",
        forecast.qualifier(),
        format::duration(forecast.seconds),
        counted(forecast.known, "run")
    ))
}

/// Formats the limits of the runs that are left, and their memory.
fn describe_estimate(estimate: &Estimate) -> String {
    let mut parts = Vec::new();
    if estimate.by_time > 0 {
        let runs = counted(estimate.by_time, "run");
        parts.push(format!(
            "at most {} of render time in {runs}",
            format::duration(estimate.seconds)
        ));
    }
    if estimate.by_samples > 0 {
        let runs = counted(estimate.by_samples, "run");
        parts.push(format!(
            "at most {} million camera paths in {runs}",
            format::rounded(estimate.paths / 1e6)
        ));
    }
    if estimate.unbounded > 0 {
        parts.push(format!(
            "{} without a limit of time or samples",
            counted(estimate.unbounded, "run")
        ));
    }
    if estimate.run_bytes > 0 {
        let layers = match estimate.layer_bytes {
            0 => String::new(),
            bytes => format!(", {} of it for layers and time bins", format::size(bytes)),
        };
        parts.push(format!(
            "a run takes up to {} of memory{layers}",
            format::size(estimate.run_bytes)
        ));
    }
    if parts.is_empty() {
        "nothing to render".to_owned()
    } else {
        parts.join("; ")
    }
}

/// Returns the first eight characters of an id or hash.
fn short_id(id: &str) -> String {
    id.chars().take(8).collect()
}
