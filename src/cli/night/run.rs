//! `lumbre run`: renders a whole night in this process.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;

use super::last_command::last_command;
use super::load::{self, decode_picture};
use super::log::Log;
use super::notices::Notifier;
use super::permission::PlanUse;
use super::progress_view::ProgressView;
use super::recorder::Recorder;
use super::{deadline, load_average, results, signals};
use crate::cli::args::{Global, NightArgs, RunArgs, ScriptArgs};
use crate::cli::cluster::{LocalWorkers, save_plan_snapshot, worker_info};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use crate::cli::selector;
use crate::cli::tev::{Tev, TevSink};
use lumbre_lua::Script;
use lumbre_night::experiment::event::{History, Sink};
use lumbre_night::experiment::forecast::ThroughputHistory;
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::run::Options;
use lumbre_night::experiment::{CellRef, Night, NightControls, NightSummary, Plan, run};
use lumbre_night::store::{Store, list_experiments, throughput_history};

/// Runs `lumbre run`: renders an experiment, or what is left of a night, and writes its results.
pub fn main(args: &RunArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    use_first_device(&args.night);
    let given = args.script();
    let (script_args, global) = match &given {
        Some(script) => (script.clone(), global.clone()),
        None => {
            let night = selector::night(args.script.as_deref(), &global.out)?;
            last_command(&night, global)?
        }
    };
    let usage = if args.dry_run {
        PlanUse::Show
    } else {
        PlanUse::Render
    };
    let (script, plan) = load::load_plan(&script_args, usage, &global)?;
    if args.dry_run && args.is_again() {
        let intention = intention(&plan, &global.out, args.failed);
        print_result(&format!("{intention}\n"))?;
        return Ok(Exit::Done);
    }
    if args.dry_run {
        return crate::cli::night::plan::print(&plan, &global, false);
    }
    let request = NightRequest {
        args,
        script: given.as_ref(),
    };
    run_night(&script, &plan, &request, &global, log)
}

/// Makes this process render on the first device of `--devices`. The others get worker processes.
fn use_first_device(night: &NightArgs) {
    if let Some(first) = night.devices.first() {
        lumbre_render::backend_choice::use_device(first);
    }
}

/// Night that was requested on the command line.
struct NightRequest<'a> {
    args: &'a RunArgs,
    /// Script as given on the command line. If there is one, the command and a snapshot of the plan
    /// are saved, so that the night can be repeated and workers can join it.
    script: Option<&'a ScriptArgs>,
}

/// Renders what is left of a plan and writes the results.
fn run_night(
    script: &Script,
    plan: &Arc<Plan>,
    request: &NightRequest<'_>,
    global: &Global,
    log: &Log,
) -> Result<Exit, Failure> {
    load::print_notes_and_warnings(plan, global.quiet);
    let tev = request
        .args
        .night
        .tev
        .as_deref()
        .map(Tev::connect)
        .transpose()?;
    let devices = if request.args.failed {
        Vec::new()
    } else {
        LocalWorkers::devices(plan, &request.args.night)?
    };
    let mut store = Store::open(&global.out, plan, decode_picture).map_err(Failure::usage)?;
    let failed = request.args.failed.then(|| failed_runs(plan, &store));
    if failed.as_ref().is_some_and(BTreeSet::is_empty) {
        if !global.quiet {
            print_status(&format!(
                "nothing to do: no run of {} has failed",
                display_path(store.folder())
            ));
        }
        return Ok(Exit::Done);
    }
    if request.args.is_again() && !global.quiet {
        print_status(&intention(plan, &global.out, request.args.failed));
    }
    if let Some(script) = request.script {
        store.write_env().map_err(Failure::usage)?;
        save_plan_snapshot(&store, plan, script).map_err(Failure::usage)?;
    }
    let remaining = RemainingWork::new(plan, &store);
    if remaining.is_empty() && !global.quiet {
        print_status(&remaining.nothing_to_do(plan, store.folder()));
    }
    if !remaining.is_empty()
        && !global.quiet
        && let Some(warning) = load_average::warning(plan)
    {
        print_status(&format!("warning: {warning}"));
    }
    let options = night_options(plan, &request.args.night, global, &remaining, failed)?;
    let mut workers = LocalWorkers::default();
    if !remaining.is_empty() {
        store
            .join_as_planner(plan, &worker_info(plan, request.args.night.affinity))
            .map_err(Failure::usage)?;
        let is_open = |cell: CellRef| !remaining.done.contains(&cell);
        let folder = store.folder();
        workers = LocalWorkers::start(
            &devices,
            plan,
            folder,
            &request.args.night,
            global,
            &is_open,
        )?;
    }
    let viewer = tev.map(|tev| TevSink::new(tev, Night::planned(plan)));
    let notifier = (!remaining.is_empty()).then(|| Notifier::start(plan, store.folder()));
    let displays = Displays {
        global,
        log,
        viewer,
        notifier: notifier.flatten(),
    };
    let ended = render_night(script, plan, &store, displays, &remaining, options)?;
    // Local workers finish the runs that are reserved for their devices, unless the night ended
    // early.
    let night = &ended.night;
    if !night.interrupted
        && night.night.ended() + night.other_workers.len() == night.night.all().count()
    {
        workers.wait(&ended.control);
    }
    workers.stop();
    finish_night(plan, &store, ended, request, global)
}

/// Describes what is run again and what is kept.
fn intention(plan: &Plan, out: &Path, only_failed: bool) -> String {
    let nights = list_experiments(out).nights;
    let Some(night) = nights.iter().find(|night| night.plan.hash == plan.hash) else {
        return format!("{} has not been run yet: runs all of it", plan.name);
    };
    let is_rendered = |cell: &CellRef| match cell {
        CellRef::Cell(_) => true,
        CellRef::Reference(i) => night.references[*i].is_rendered(),
    };
    let states = night.all().filter(is_rendered);
    let counts = StateCounts::of(states.filter_map(|cell| night.state(cell)));
    let done = counts.done + counts.cached;
    let others = counts.total() - counts.settled();
    let folder = display_path(&night.folder);
    let failed = counted(counts.failed, "failed run");
    if only_failed {
        format!("{folder}: runs {failed} again; {done} done and {others} unfinished are left alone")
    } else {
        format!("{folder}: runs {failed} and {others} unfinished; {done} done are kept")
    }
}

/// Returns the runs of a plan whose last attempt failed.
fn failed_runs(plan: &Plan, store: &Store) -> BTreeSet<CellRef> {
    let references = (0..plan.references.len()).map(CellRef::Reference);
    references
        .chain((0..plan.cells.len()).map(CellRef::Cell))
        .filter(|cell| store.failure(plan, *cell).is_some())
        .collect()
}

/// Combines the limits of the command line and of the plan. With `only`, other runs are not
/// rendered.
fn night_options(
    plan: &Plan,
    night: &NightArgs,
    global: &Global,
    remaining: &RemainingWork,
    only: Option<BTreeSet<CellRef>>,
) -> Result<Options, Failure> {
    let deadline = night
        .until
        .or(plan.night.deadline)
        .map(deadline::deadline_time)
        .transpose()
        .map_err(Failure::usage)?;
    Ok(Options {
        threads: global.threads,
        max_fails: night.max_fails.map(|n| n as usize),
        smoke: !night.no_smoke,
        deadline,
        only,
        throughput: if remaining.is_empty() {
            ThroughputHistory::default()
        } else {
            throughput_history(&global.out)
        },
        done: remaining.done.clone(),
        memory: global.memory,
        start: None,
    })
}

/// Writes result files, prints tables and messages, and returns the exit code of a night.
fn finish_night(
    plan: &Plan,
    store: &Store,
    ended: EndedNight,
    request: &NightRequest<'_>,
    global: &Global,
) -> Result<Exit, Failure> {
    // Finished runs that this night did not render, or left to workers with other devices, also
    // belong in tables and figures.
    let mut night = ended.night;
    if request.args.failed || !night.other_workers.is_empty() {
        add_finished_runs(&mut night, plan, store);
    }
    let collected = results::collect(store, plan, &night.night);
    let written = results::write_results(store, plan, &night.night, &collected);
    let printed = if request.args.without_tables {
        Ok(())
    } else {
        results::print_tables(plan, &collected)
    };
    if !ended.failures_printed {
        results::print_failures(&night.night);
    }
    results::print_left_to_others(plan, &night);
    results::print_disagreements(plan, &night);
    results::print_aa_check(plan, &night.night, global.quiet);
    if !global.quiet {
        results::print_locations(store, plan, &night.night);
    }
    results::print_answer(&collected);
    let exit = results::night_exit(&night, ended.exit);
    results::exit_after(&night, exit, written.and(printed))
}

/// Adds the finished runs of a plan that are missing in the results of a night.
fn add_finished_runs(night: &mut NightSummary, plan: &Plan, history: &dyn History) {
    for cell in (0..plan.cells.len()).map(CellRef::Cell) {
        if night.night.outcome(cell).is_none()
            && let Some(run) = history.finished_run(plan, cell)
        {
            night.night.apply(&run.event(cell));
            night.other_workers.retain(|(other, _)| *other != cell);
        }
    }
}

/// Work that is left of a plan.
struct RemainingWork {
    /// Number of cells that are not finished.
    cells: usize,
    /// Number of references that are not finished.
    references: usize,
    /// Finished cells and rendered references.
    done: BTreeSet<CellRef>,
}

impl RemainingWork {
    /// Compares a plan with the finished runs on disk.
    fn new(plan: &Plan, history: &dyn History) -> RemainingWork {
        let is_rendered =
            |i: &usize| matches!(plan.references[*i].source, ReferenceSource::Render { .. });
        let references: Vec<CellRef> = (0..plan.references.len())
            .filter(is_rendered)
            .map(CellRef::Reference)
            .collect();
        let all = (0..plan.cells.len())
            .map(CellRef::Cell)
            .chain(references.iter().copied());
        let done: BTreeSet<CellRef> = all
            .filter(|cell| history.finished_run(plan, *cell).is_some())
            .collect();
        let finished = done
            .iter()
            .filter(|cell| matches!(cell, CellRef::Reference(_)))
            .count();
        RemainingWork {
            cells: plan.cells.len() + finished - done.len(),
            references: references.len() - finished,
            done,
        }
    }

    fn is_empty(&self) -> bool {
        self.cells == 0 && self.references == 0
    }

    /// Explains why nothing is left to render.
    fn nothing_to_do(&self, plan: &Plan, folder: &Path) -> String {
        if plan.cells.is_empty() {
            let reasons = plan
                .absent()
                .into_iter()
                .map(|(reason, _)| format!("; {reason}"))
                .collect::<String>();
            return format!("nothing to do: every point of the sweep is skipped{reasons}");
        }
        format!(
            "nothing to do: all {} and {} are already done in {}",
            counted(plan.cells.len(), "cell"),
            counted(plan.references.len(), "reference"),
            display_path(folder)
        )
    }
}

/// Results of a night that has ended.
struct EndedNight {
    night: NightSummary,
    /// Exit code if the night was stopped from outside.
    exit: Exit,
    /// Whether failures were printed as they happened and are still visible.
    failures_printed: bool,
    /// Controls of the night; report whether a stop was requested.
    control: Arc<NightControls>,
}

/// Displays of a night while it runs.
struct Displays<'a> {
    global: &'a Global,
    log: &'a Log,
    /// Viewer of pictures, if there is one.
    viewer: Option<TevSink>,
    /// Sender of notices, if the script asks for some.
    notifier: Option<Notifier>,
}

/// Renders the remaining work and collects the results of runs that were done before.
fn render_night(
    script: &Script,
    plan: &Arc<Plan>,
    store: &Store,
    displays: Displays<'_>,
    remaining: &RemainingWork,
    options: Options,
) -> Result<EndedNight, Failure> {
    let Displays {
        global,
        log,
        mut viewer,
        mut notifier,
    } = displays;
    let control = Arc::new(NightControls::default());
    if remaining.is_empty() {
        let options = Options {
            smoke: false,
            ..options
        };
        let night = run::run(plan, script, store, &mut [], &control, options);
        return Ok(EndedNight {
            night: night.map_err(Failure::internal)?,
            exit: Exit::Interrupted,
            failures_printed: false,
            control,
        });
    }
    if !global.quiet {
        results::print_backends(plan);
    }
    let stop_signal = signals::install(Arc::clone(&control))?;
    let mut recorder = Recorder::new(store, Arc::clone(plan), log.clone(), Arc::clone(&control));
    let mut view = ProgressView::new(&control, global, log);
    let mut sinks: Vec<&mut dyn Sink> = vec![&mut recorder, view.sink()];
    sinks.extend(viewer.iter_mut().map(|viewer| viewer as &mut dyn Sink));
    sinks.extend(
        notifier
            .iter_mut()
            .map(|notifier| notifier as &mut dyn Sink),
    );
    let night = run::run(plan, script, store, &mut sinks, &control, options);
    let failures_printed = matches!(view, ProgressView::Lines(_));
    // Restore the terminal before anything is printed to it.
    drop(view);
    log.resume_stderr();
    // Waits for notices that are still to be sent.
    drop(notifier);
    let exit = stop_signal.exit();
    let night = night.map_err(|error| {
        let mut failure = Failure::internal(error);
        // The reason of the stop outranks that of the error, such as a full disk.
        if control.stop_requested() {
            failure.exit = exit;
        }
        failure
    })?;
    Ok(EndedNight {
        night,
        exit,
        failures_printed,
        control,
    })
}
