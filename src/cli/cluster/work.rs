//! `lumbre work`: one worker of a night.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use super::plan_snapshot::{RestoredPlan, restore_plan};
use crate::cli::args::{Global, WorkArgs};
use crate::cli::exit::{Exit, Failure, print_status};
use crate::cli::format::display_path;
use crate::cli::night::deadline;
use crate::cli::night::disk_full_retry::{retry_while_disk_full, sleep_before_retry};
use crate::cli::night::load::decode_picture;
use crate::cli::night::log::Log;
use crate::cli::night::progress_view::ProgressView;
use crate::cli::night::recorder::Recorder;
use crate::cli::night::results;
use crate::cli::night::signals::{self, StopSignal};
use crate::cli::selector;
use lumbre_lua::Script;
use lumbre_night::backends::{backend, device_index};
use lumbre_night::experiment::comparison_groups::{Affinity, StartOffset};
use lumbre_night::experiment::event::Event;
use lumbre_night::experiment::forecast::ThroughputHistory;
use lumbre_night::experiment::run::Options;
use lumbre_night::experiment::run_progress::Claim;
use lumbre_night::experiment::{
    CellRef, Night, NightControls, NightSummary, Outcome, Plan, Sink, SinkError, run,
};
use lumbre_night::store::schema::journal::JournalEvent;
use lumbre_night::store::{Host, PlanStatus, RenderDevice, Store, WorkerInfo};
use lumbre_render::backend_choice;

/// Number of passes over the plan before a worker gives up on a night that is still not done.
const MAX_PASSES: usize = 3;
/// Time between two checks whether another worker has written the tables and figures.
const POLL_INTERVAL: Duration = Duration::from_millis(200);

/// Runs `lumbre work`: joins a night as one of its workers until no work is left for it.
pub fn work(args: &WorkArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    if global.backend.is_some() {
        return Err(Failure::usage(
            "--backend cannot be used with `lumbre work`: the plan sets the backend of each cell",
        ));
    }
    if let Some(device) = &args.device {
        backend_choice::use_device(device);
    }
    // A night that is not found is named as it was given.
    let night = selector::night(Some(&args.folder), &global.out);
    let home = night.unwrap_or_else(|_| args.folder.clone());
    let home = home.canonicalize().map_err(|e| {
        Failure::usage(format!(
            "there is no folder {} on {}: {e} (all workers need access to the night's folder on a \
             shared file system)",
            display_path(&args.folder),
            Host::detect().name
        ))
    })?;
    let RestoredPlan {
        script,
        plan,
        snapshot,
    } = restore_plan(&home, global)?;
    let info = worker_info(&plan, args.affinity);
    if let (Some(device), true) = (&args.device, device_indices(&plan).is_empty()) {
        print_status(&format!(
            "note: --device {device} is ignored, because this plan does not use a graphics device"
        ));
    }
    // Other workers may have filled the disk already.
    let store = retry_while_disk_full(&NightControls::default(), &sleep_before_retry, || {
        Store::join(&home, &plan, &snapshot, decode_picture, &info)
    });
    let store = store.map_err(Failure::usage)?;
    let worker = ClusterWorker {
        script: &script,
        plan: &plan,
        store: &store,
        global,
        log,
        args,
    };
    let exit = worker.work();
    store.leave(&match &exit {
        Ok(exit) => exit_reason(*exit).to_owned(),
        Err(failure) => failure.message.clone(),
    });
    exit
}

/// Describes this process for the registry of workers.
pub fn worker_info(plan: &Plan, affinity: Affinity) -> WorkerInfo {
    WorkerInfo {
        device: render_device(plan),
        affinity,
        job: job_id(),
    }
}

/// Starts a thread that requests a stop when stdin closes.
fn stop_with_stdin(control: &Arc<NightControls>) -> std::io::Result<()> {
    let control = Arc::clone(control);
    let wait_for_end = move || {
        // The parent writes nothing. A read error counts as closed.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        control.request_stop();
    };
    std::thread::Builder::new()
        .name("stdin".to_owned())
        .spawn(wait_for_end)
        .map(drop)
}

/// Returns why a worker exited, for the registry of workers.
fn exit_reason(exit: Exit) -> &'static str {
    match exit {
        Exit::Done => "all runs are done",
        Exit::Checkpointed | Exit::Interrupted => "stopped on request",
        Exit::WorkLeft => "the remaining runs are for other workers",
        _ => "all runs have ended, some of them failed",
    }
}

/// Returns the job and task number of this process from the environment of Slurm or HyperQueue;
/// empty outside of a job.
fn job_id() -> String {
    let env = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    match (env("SLURM_ARRAY_JOB_ID"), env("SLURM_ARRAY_TASK_ID")) {
        (Some(job), Some(task)) => format!("{job}_{task}"),
        _ => match (env("HQ_JOB_ID"), env("HQ_TASK_ID")) {
            (Some(job), Some(task)) => format!("{job}_{task}"),
            _ => env("SLURM_JOB_ID").unwrap_or_default(),
        },
    }
}

/// Returns the names of the backends of a plan's cells.
fn backend_names(plan: &Plan) -> BTreeSet<&str> {
    plan.cells
        .iter()
        .map(|cell| cell.config.backend.as_str())
        .collect()
}

/// Returns the indices of the graphics devices on which this process renders a plan.
fn device_indices(plan: &Plan) -> BTreeSet<String> {
    backend_names(plan)
        .into_iter()
        .map(device_index)
        .filter(|index| !index.is_empty())
        .collect()
}

/// Describes the device on which this process renders the cells of a plan.
fn render_device(plan: &Plan) -> RenderDevice {
    let host = Host::detect();
    let indices = device_indices(plan);
    let mut key = host.name.clone();
    if !indices.is_empty() {
        // If each job sees only its own devices, each of them has a device 0. The devices that the
        // scheduler assigned to the job distinguish them.
        let variables = ["SLURM_STEP_GPUS", "SLURM_JOB_GPUS", "CUDA_VISIBLE_DEVICES"];
        let assigned = variables
            .iter()
            .find_map(|name| std::env::var(name).ok().filter(|v| !v.is_empty()));
        let indices: Vec<String> = indices.into_iter().collect();
        key = format!(
            "{key}, device {}{}",
            indices.join(" and "),
            assigned.map_or_else(String::new, |assigned| format!(" of {assigned}"))
        );
    }
    let model = |name: &str| -> String {
        if name == "cpu" {
            return format!("{}, {} threads", host.cpu, host.cores);
        }
        let (Ok(model) | Err(model)) =
            backend(name).map_or(Err(String::new()), |row| (row.probe)());
        model
    };
    let models: BTreeSet<String> = backend_names(plan).into_iter().map(model).collect();
    RenderDevice {
        key,
        model: models.into_iter().collect::<Vec<_>>().join("; "),
    }
}

/// One worker of a night.
struct ClusterWorker<'a> {
    script: &'a Script,
    plan: &'a Arc<Plan>,
    store: &'a Store,
    global: &'a Global,
    log: &'a Log,
    args: &'a WorkArgs,
}

impl ClusterWorker<'_> {
    /// Renders until no work is left for this worker.
    fn work(&self) -> Result<Exit, Failure> {
        let control = Arc::new(NightControls::default());
        let stop_signal = signals::install(Arc::clone(&control))?;
        if self.args.while_stdin {
            stop_with_stdin(&control).map_err(Failure::internal)?;
        }
        let options = self.options()?;
        // The number of passes is limited, so that the worker ends if files of the night keep
        // changing.
        for _ in 0..MAX_PASSES {
            let night = self.render(&control, options.clone())?;
            if night.interrupted {
                self.print_unless_quiet(|| {
                    "stopped with a checkpoint; run the same command to resume".to_owned()
                });
                return Ok(stop_signal.exit());
            }
            if !night.other_workers.is_empty() {
                results::print_left_to_others(self.plan, &night);
                return Ok(Exit::WorkLeft);
            }
            if night.night.ended() < night.night.all().count() && self.is_limited(&options) {
                self.print_unless_quiet(|| "stopped with work left".to_owned());
                return Ok(Exit::WorkLeft);
            }
            if let Some(exit) = self.finish_night(&control, &stop_signal, &night)? {
                return Ok(exit);
            }
        }
        print_status(&format!(
            "stopped: after {MAX_PASSES} passes finished runs are still missing; check whether \
             another program deletes files in {}",
            display_path(self.store.folder())
        ));
        Ok(Exit::WorkLeft)
    }

    /// Prints a status line unless `--quiet` was given.
    fn print_unless_quiet(&self, line: impl FnOnce() -> String) {
        if !self.global.quiet {
            print_status(&line());
        }
    }

    /// Returns whether the worker may end before the plan is done.
    fn is_limited(&self, options: &Options) -> bool {
        options.only.is_some() || options.deadline.is_some() || options.max_fails.is_some()
    }

    /// Combines the limits of the command line and of the plan.
    fn options(&self) -> Result<Options, Failure> {
        let plan = self.plan;
        let selected = (!self.args.only.is_empty())
            .then(|| self.selected_cells())
            .transpose()?;
        let deadline = self
            .args
            .until
            .or(plan.night.deadline)
            .map(deadline::deadline_time)
            .transpose()
            .map_err(Failure::usage)?;
        let offset = self.store.start_offset();
        Ok(Options {
            threads: self.global.threads,
            max_fails: self.args.max_fails.map(|n| n as usize),
            smoke: false,
            deadline,
            only: selected,
            throughput: ThroughputHistory::default(),
            done: BTreeSet::new(),
            memory: self.global.memory,
            start: Some(if self.args.affinity == Affinity::None {
                StartOffset::Cell(offset)
            } else {
                StartOffset::Group(offset)
            }),
        })
    }

    /// Returns the cells selected by `--only`. Their references are rendered when needed.
    fn selected_cells(&self) -> Result<BTreeSet<CellRef>, Failure> {
        for (axis, _) in &self.args.only {
            if !self.plan.axes.contains(axis) {
                let known = self.plan.axes.join(", ");
                return Err(Failure::usage(format!(
                    "--only: the plan has no axis `{axis}` (axes: {known})"
                )));
            }
        }
        let axes: BTreeSet<&String> = self.args.only.iter().map(|(axis, _)| axis).collect();
        let fits = |i: &usize| {
            let point = &self.plan.cells[*i].point;
            axes.iter().all(|axis| {
                let value = point
                    .iter()
                    .find(|(name, _)| name == *axis)
                    .map(|(_, value)| value);
                self.args.only.iter().any(|(name, values)| {
                    name == *axis && value.is_some_and(|v| values.contains(v))
                })
            })
        };
        let cells: BTreeSet<CellRef> = (0..self.plan.cells.len())
            .filter(fits)
            .map(CellRef::Cell)
            .collect();
        if cells.is_empty() {
            Err(Failure::usage("--only selects no cell of the plan"))
        } else {
            Ok(cells)
        }
    }

    fn render(
        &self,
        control: &Arc<NightControls>,
        options: Options,
    ) -> Result<NightSummary, Failure> {
        let mut recorder = Recorder::new(
            self.store,
            Arc::clone(self.plan),
            self.log.clone(),
            Arc::clone(control),
        );
        let mut view = ProgressView::new(control, self.global, self.log);
        let sinks: &mut [&mut dyn Sink] = &mut [&mut recorder, view.sink()];
        let night = run::run(self.plan, self.script, self.store, sinks, control, options);
        drop(view);
        self.log.resume_stderr();
        night.map_err(Failure::internal)
    }

    /// Writes tables and figures unless another worker does. Exactly one worker writes them; the
    /// others wait for it. Returns `None` if the night turns out not to be done.
    fn finish_night(
        &self,
        control: &Arc<NightControls>,
        stop_signal: &StopSignal,
        night: &NightSummary,
    ) -> Result<Option<Exit>, Failure> {
        let hash = results_hash(&night.night);
        loop {
            if control.stop_requested() {
                return Ok(Some(stop_signal.exit()));
            }
            if self.store.closed_results().as_deref() == Some(&hash) {
                self.print_unless_quiet(|| {
                    format!(
                        "all runs are done; tables and figures are in {}",
                        display_path(self.store.folder())
                    )
                });
                return Ok(Some(results::night_exit(night, stop_signal.exit())));
            }
            if self.store.claim_closing().map_err(Failure::internal)? == Claim::Granted {
                break;
            }
            std::thread::sleep(POLL_INTERVAL);
        }
        let written = self.write_results(control);
        let hash = written
            .as_ref()
            .ok()
            .and_then(|written| Some(written.as_ref()?.1.as_str()));
        self.store.end_closing(hash).map_err(Failure::internal)?;
        match written {
            Err(failure) if control.stop_requested() => {
                failure.print();
                Ok(Some(stop_signal.exit()))
            }
            written => Ok(written?.map(|(exit, _)| exit)),
        }
    }

    /// Writes and prints the results of the whole night. Returns the exit code and the hash of the
    /// results, or `None` if some runs are not done.
    fn write_results(
        &self,
        control: &Arc<NightControls>,
    ) -> Result<Option<(Exit, String)>, Failure> {
        let Some(night) = self.collect_results(control)? else {
            return Ok(None);
        };
        let collected = results::collect(self.store, self.plan, &night.night);
        results::write_results(self.store, self.plan, &night.night, &collected)?;
        results::print_tables(self.plan, &collected)?;
        results::print_failures(&night.night);
        results::print_disagreements(self.plan, &night);
        self.print_unless_quiet(|| {
            format!(
                "all runs are done; tables and figures were written to {}",
                display_path(self.store.folder())
            )
        });
        // The entry is only informative: workers find out from other files that the night is done.
        let _ = self.store.journal(JournalEvent::NightClosed {});
        let exit = results::night_exit(&night, Exit::Interrupted);
        Ok(Some((exit, results_hash(&night.night))))
    }

    /// Reads the results of all runs of the plan, and compares references with second techniques.
    /// Returns `None` if some runs are not done.
    fn collect_results(
        &self,
        control: &Arc<NightControls>,
    ) -> Result<Option<NightSummary>, Failure> {
        let PlanStatus { done, failed, open } = self.store.plan_status(self.plan);
        if open > 0 {
            return Ok(None);
        }
        let mut bias_checks = BiasCheckSink {
            recorder: Recorder::new(
                self.store,
                Arc::clone(self.plan),
                self.log.clone(),
                Arc::clone(control),
            ),
        };
        let options = Options {
            only: Some(done.into_iter().collect()),
            ..Options::from(self.global.threads)
        };
        let archive = self.store.archive();
        let night = run::run(
            self.plan,
            self.script,
            archive,
            &mut [&mut bias_checks],
            control,
            options,
        );
        let mut night = night.map_err(Failure::internal)?;
        for (cell, reason) in failed {
            let event = Event::ended(cell, Outcome::Failed(reason), Vec::new());
            night.night.apply(&event);
        }
        Ok(Some(night))
    }
}

/// Returns a hash of the ids of all runs and whether each one failed.
fn results_hash(night: &Night) -> String {
    let line = |cell: CellRef| {
        let state = match night.outcome(cell)? {
            Outcome::Failed(_) => "failed",
            _ => "done",
        };
        Some(format!("{cell:?} {} {state}", night.id(cell)))
    };
    let lines: BTreeSet<String> = night.all().filter_map(line).collect();
    let lines: Vec<String> = lines.into_iter().collect();
    blake3::hash(lines.join("\n").as_bytes())
        .to_hex()
        .to_string()
}

/// Sink that records only bias checks of references, while the results of a finished night are
/// collected.
struct BiasCheckSink<'a> {
    recorder: Recorder<'a>,
}

impl Sink for BiasCheckSink<'_> {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        match event {
            Event::BiasCheck { .. } => self.recorder.receive(event),
            _ => Ok(()),
        }
    }
}

/// Returns a warning if a folder seems to be on a disk that other machines cannot access.
pub(super) fn local_disk_warning(home: &Path) -> Option<String> {
    let kind = lumbre_night::store::lock::filesystem_kind::detect(home)?;
    (!lumbre_night::store::lock::filesystem_kind::is_network(&kind)).then(|| {
        format!(
            "{} is on a local file system ({kind}); workers on other machines cannot access it",
            display_path(home)
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_night::experiment::EndCause;
    use lumbre_night::experiment::night::NightPlan;
    use lumbre_night::experiment::night::run::RunPlan;

    #[test]
    fn the_hash_of_results_tells_failed_runs_from_finished_ones() {
        let run = |id: &str| RunPlan {
            id: id.to_owned(),
            ..RunPlan::default()
        };
        let hash = |events: [Event; 2]| {
            let runs = ["ab12", "cd34"].map(run).into();
            let mut night = Night::new(NightPlan::default(), runs, Vec::new());
            events.iter().for_each(|event| night.apply(event));
            results_hash(&night)
        };
        let ended = |cell, outcome| Event::ended(CellRef::Cell(cell), outcome, Vec::new());
        let finished = |cell| ended(cell, Outcome::Done(EndCause::limit("64 samples")));
        let failed = |cell| ended(cell, Outcome::Failed("no memory".to_owned()));
        let cached = |cell| ended(cell, Outcome::Cached("runs/0".into()));
        let different = [
            hash([finished(0), finished(1)]),
            hash([failed(0), finished(1)]),
            hash([finished(0), failed(1)]),
            hash([failed(0), failed(1)]),
        ];
        assert_eq!(different.iter().collect::<BTreeSet<_>>().len(), 4);
        // Workers agree on runs of others, and on results that they found in another order.
        assert_eq!(hash([finished(1), finished(0)]), different[0]);
        assert_eq!(hash([cached(0), finished(1)]), different[0]);
    }
}
