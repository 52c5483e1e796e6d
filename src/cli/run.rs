//! `lumbre run`: a whole night.

use std::collections::BTreeSet;
use std::io::IsTerminal;
use std::path::Path;
use std::sync::Arc;

use super::again::{last_command, latest};
use super::args::{Global, NightArgs, RetryArgs, RunArgs, ScriptArgs};
use super::cluster::{Hands, freeze, me, say_apart};
use super::exit::{Exit, Failure, data, talk};
use super::load::{self, decode, shown};
use super::log::Log;
use super::recorder::Recorder;
use super::{signals, until};
use crate::experiment::event::{History, Level};
use crate::experiment::forecast::Paces;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::run::Options;
use crate::experiment::spec::FigureSpec;
use crate::experiment::{CellRef, CellResult, Control, NightSummary, Outcome, Plan, Sink, control, run};
use crate::output::devices::Devices;
use crate::output::{plot, summary, table};
use crate::render;
use crate::script::Script;
use crate::store::{Store, archived_paces};
use crate::tui;

/// Runs an experiment.
pub fn main(args: &RunArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    render_on_first(&args.night);
    let (script, plan) = load::plan(&args.script, global)?;
    if args.dry_run {
        return super::plan::print(&plan, global, false);
    }
    let how = How { night: &args.night, only_failed: false, script: Some(&args.script) };
    carry_out(&script, &plan, &how, global, log)
}

/// Runs what is not done of an experiment, or only what failed.
pub fn retry(args: &RetryArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    render_on_first(&args.night);
    let (wanted, global) = match args.script() {
        Some(script) => (script, global.clone()),
        None => last_command(&latest(&global.out)?, global)?,
    };
    let (script, plan) = load::plan(&wanted, &global)?;
    let named = args.script();
    let how = How { night: &args.night, only_failed: args.failed, script: named.as_ref() };
    carry_out(&script, &plan, &how, &global, log)
}

/// This process renders on the first of the devices that were named.
fn render_on_first(night: &NightArgs) {
    if let Some(first) = night.devices.first() {
        render::choice::use_device(first);
    }
}

/// How a night is to go.
struct How<'a> {
    night: &'a NightArgs,
    only_failed: bool,
    /// The script as the command named it, if it did: the command can then be given again, and by others.
    script: Option<&'a ScriptArgs>,
}

fn carry_out(script: &Script, plan: &Arc<Plan>, how: &How<'_>, global: &Global, log: &Log) -> Result<Exit, Failure> {
    let How { night, only_failed, script: script_of } = *how;
    let named = script_of.is_some();
    if !global.quiet {
        load::show_doubts(plan);
    }
    let devices = if only_failed { Vec::new() } else { Hands::devices(plan, night)? };
    let mut store = Store::open(&global.out, plan, decode).map_err(Failure::usage)?;
    let all = || {
        let references = (0..plan.references.len()).map(CellRef::Reference);
        references.chain((0..plan.cells.len()).map(CellRef::Cell))
    };
    let failed: BTreeSet<CellRef> =
        if only_failed { all().filter(|cell| store.failure(plan, *cell).is_some()).collect() } else { BTreeSet::new() };
    if only_failed && failed.is_empty() {
        if !global.quiet {
            talk(&format!("nothing to do: no run of {} has failed", shown(store.folder())));
        }
        return Ok(Exit::Done);
    }
    if named {
        store.write_env().map_err(Failure::usage)?;
    }
    if let Some(script) = script_of {
        freeze(&store, plan, script).map_err(Failure::usage)?;
    }
    let todo = Todo::of(plan, &store);
    if todo.is_empty() && !global.quiet {
        talk(&todo.nothing(plan, store.folder()));
    }
    let deadline = night.until.or(plan.night.deadline).map(until::moment).transpose().map_err(Failure::usage)?;
    let options = Options {
        threads: global.threads,
        max_fails: night.max_fails.map(|n| n as usize),
        smoke: !night.no_smoke,
        deadline,
        only: only_failed.then_some(failed),
        paces: if todo.is_empty() { Paces::default() } else { archived_paces(&global.out) },
        done: todo.done.clone(),
        memory: None,
        begin: None,
    };
    let mut hands = Hands::default();
    if !todo.is_empty() {
        store.take_part(plan, &me(plan, night.affinity)).map_err(Failure::usage)?;
        let open = |cell: CellRef| !todo.done.contains(&cell);
        hands = Hands::start(&devices, plan, store.folder(), night, global, &open)?;
    }
    let store = store;
    let Ended { night, exit, told, control } = render_night(script, plan, &store, global, log, &todo, options)?;
    // Others go on with what is for their devices alone, unless the night ended early.
    if !night.interrupted && night.results.len() + night.apart.len() == plan.cells.len() + plan.references.len() {
        hands.wait(&control);
    }
    hands.end();
    // What a narrowed night left alone is there nonetheless, and belongs into tables and figures, as does what was for
    // another's device.
    let night = if only_failed || !night.apart.is_empty() { with_the_rest(night, plan, &store) } else { night };
    let devices = devices_of(&store, plan, &night);
    let written = write_evidence(&store, plan, &night, &devices);
    print_tables(plan, &night, &devices)?;
    if !told {
        say_failures(plan, &night);
    }
    say_apart(plan, &night);
    say_disagreements(plan, &night);
    say_control(plan, &night, global.quiet);
    if !global.quiet {
        say_where(&store, plan, &night);
    }
    written?;
    Ok(exit_of(plan, &night, exit))
}

/// A night's results and those of the runs that it left alone and that are done.
fn with_the_rest(mut night: NightSummary, plan: &Plan, history: &dyn History) -> NightSummary {
    let seen: BTreeSet<CellRef> = night.results.iter().map(|result| result.cell).collect();
    for cell in (0..plan.cells.len()).map(CellRef::Cell).filter(|cell| !seen.contains(cell)) {
        if let Some(run) = history.done(plan, cell) {
            night.results.push(CellResult {
                cell,
                outcome: Outcome::Cached(run.folder),
                rows: Arc::new(run.rows),
                floors: run.floors,
                open: run.open,
            });
            night.apart.retain(|(apart, _)| *apart != cell);
        }
    }
    night
}

/// What is left to render.
struct Todo {
    cells: usize,
    references: usize,
    /// What is there.
    done: BTreeSet<CellRef>,
}

impl Todo {
    fn of(plan: &Plan, history: &dyn History) -> Todo {
        let rendered = |i: &usize| matches!(plan.references[*i].source, ReferenceSource::Render { .. });
        let references: Vec<CellRef> = (0..plan.references.len()).filter(rendered).map(CellRef::Reference).collect();
        let all = (0..plan.cells.len()).map(CellRef::Cell).chain(references.iter().copied());
        let done: BTreeSet<CellRef> = all.filter(|cell| history.done(plan, *cell).is_some()).collect();
        let finished = done.iter().filter(|cell| matches!(cell, CellRef::Reference(_))).count();
        Todo { cells: plan.cells.len() + finished - done.len(), references: references.len() - finished, done }
    }

    fn is_empty(&self) -> bool {
        self.cells == 0 && self.references == 0
    }

    fn nothing(&self, plan: &Plan, folder: &Path) -> String {
        if plan.cells.is_empty() {
            let absent = plan.absent().into_iter().map(|(reason, _)| format!("; {reason}")).collect::<String>();
            return format!("nothing to do: every point of the sweep is skipped{absent}");
        }
        format!(
            "nothing to do: all {} and {} were done in {}",
            counted(plan.cells.len(), "cell"),
            counted(plan.references.len(), "reference"),
            shown(folder)
        )
    }
}

/// `1 cell`, `3 cells`.
pub(super) fn counted(n: usize, what: &str) -> String {
    format!("{n} {what}{}", if n == 1 { "" } else { "s" })
}

/// A night that is over.
struct Ended {
    night: NightSummary,
    /// How the program ends if the night was ended from outside.
    exit: Exit,
    /// Whether failures have been shown as they happened, on what is still to be seen.
    told: bool,
    /// Hears whether the rest is to stop as well.
    control: Arc<Control>,
}

/// Renders what is left, and gathers what is there.
fn render_night(
    script: &Script,
    plan: &Arc<Plan>,
    store: &Store,
    global: &Global,
    log: &Log,
    todo: &Todo,
    options: Options,
) -> Result<Ended, Failure> {
    let control = Arc::new(Control::default());
    if todo.is_empty() {
        let night = run::run(plan, script, store, &mut [], &control, Options { smoke: false, ..options })
            .map_err(Failure::internal)?;
        return Ok(Ended { night, exit: Exit::Interrupted, told: false, control });
    }
    if !global.quiet {
        say_backends(plan);
    }
    let heard = signals::listen(Arc::clone(&control), tui::guard::give_back_now)
        .map_err(|e| Failure::internal(format!("cannot listen to signals: {e}")))?;
    let mut recorder = Recorder::new(store, Arc::clone(plan), log.clone(), Arc::clone(&control));
    let mut watcher = Watcher::new(&control, global, log);
    let night = run::run(plan, script, store, &mut [&mut recorder, watcher.sink()], &control, options);
    let told = matches!(watcher, Watcher::Lines(_));
    // The terminal is given back before anything is said on it.
    drop(watcher);
    log.release();
    Ok(Ended { night: night.map_err(Failure::internal)?, exit: heard.exit(), told, control })
}

/// Who shows the night.
pub(super) enum Watcher {
    Dashboard(tui::Dashboard),
    Lines(Box<tui::LineSink>),
}

impl Watcher {
    /// The dashboard if standard output is a terminal that can show it and nobody minds; plain lines on stderr
    /// otherwise.
    pub(super) fn new(control: &Arc<Control>, global: &Global, log: &Log) -> Watcher {
        let env = |name: &str| std::env::var(name).ok();
        let whole_screen = tui::wanted(std::io::stdout().is_terminal(), &env) == tui::Mode::Dashboard;
        if whole_screen && !global.no_tui && !global.quiet {
            log.hold();
            let leave = Box::new(|| std::process::exit(i32::from(Exit::Interrupted.code())));
            match tui::Dashboard::start(tui::Role::Run(Arc::clone(control)), leave) {
                Ok(dashboard) => {
                    let voice = dashboard.voice();
                    log.listen(Box::new(move |level, text| voice.say(importance(level), text)));
                    return Watcher::Dashboard(dashboard);
                }
                Err(e) => {
                    log.release();
                    tracing::warn!("no dashboard: {e}");
                }
            }
        }
        let color = tui::colored(std::io::stderr().is_terminal(), &env);
        let options = tui::LineOptions { quiet: global.quiet, color };
        Watcher::Lines(Box::new(tui::LineSink::new(Box::new(std::io::stderr()), options)))
    }

    pub(super) fn sink(&mut self) -> &mut dyn Sink {
        match self {
            Watcher::Dashboard(dashboard) => dashboard,
            Watcher::Lines(lines) => lines.as_mut(),
        }
    }
}

/// How the night's own messages are graded.
fn importance(level: tracing::Level) -> Level {
    match level {
        tracing::Level::ERROR => Level::Error,
        tracing::Level::WARN => Level::Warn,
        _ => Level::Info,
    }
}

/// Names the backends of a plan, the devices they found, and what `auto` means here.
fn say_backends(plan: &Plan) {
    let rendered = plan.references.iter().filter_map(|r| match &r.source {
        ReferenceSource::Render { config, .. } => Some(&config.backend),
        ReferenceSource::File { .. } => None,
    });
    let names: BTreeSet<&String> = plan.cells.iter().map(|c| &c.config.backend).chain(rendered).collect();
    let (auto, because) = render::automatic();
    for name in names.into_iter().filter(|name| *name != render::external::BACKEND) {
        let device = render::backend(name).map(|row| (row.probe)());
        let (Ok(device) | Err(device)) = device.unwrap_or_else(|| Err("unknown".to_owned()));
        let why = if auto == name.as_str() { format!("; what auto means here: {because}") } else { String::new() };
        talk(&format!("backend {name}: {device}{why}"));
    }
}

/// Writes the summary, figures and tables of what is there, be it a whole night or part of one.
pub(super) fn write_evidence(
    store: &Store,
    plan: &Plan,
    night: &NightSummary,
    devices: &Devices,
) -> Result<(), Failure> {
    let write = |name: &str, bytes: &[u8]| store.write(name, bytes).map_err(Failure::internal);
    write("summary.csv", summary::csv(plan, &night.results).as_bytes())?;
    for spec in &plan.tables {
        for table in table::tables(plan, spec, &night.results, devices) {
            for format in &spec.formats {
                let (extension, text) = match format {
                    crate::experiment::spec::TableFormat::Md => ("md", table.to_markdown()),
                    crate::experiment::spec::TableFormat::Csv => ("csv", table.to_csv()),
                };
                write(&format!("tables/{}.{extension}", table.name), text.as_bytes())?;
            }
        }
    }
    for spec in &plan.figures {
        for figure in plot::figures(plan, spec, &night.results, devices) {
            let stem = &figure.stem;
            write(&format!("figures/{stem}.svg"), figure.svg.as_bytes())?;
            write(&format!("figures/{stem}.csv"), figure.csv.as_bytes())?;
            let png = plot::rasterize(&figure.svg).map_err(Failure::internal)?;
            write(&format!("figures/{stem}.png"), &png)?;
        }
    }
    let repeats = summary::repeats_csv(plan, &night.results);
    if !repeats.is_empty() {
        write("repeats.csv", repeats.as_bytes())?;
    }
    let findings = control::check(plan, &night.results);
    if !findings.is_empty() {
        write("control.csv", summary::control_csv(&findings).as_bytes())?;
    }
    Ok(())
}

/// What the cells were rendered on, where figures or tables show a clock: nothing else needs to know, and every run has to
/// be asked.
pub(super) fn devices_of(store: &Store, plan: &Plan, night: &NightSummary) -> Devices {
    let timed = plan.tables.iter().any(|spec| spec.value.is_clock()) || plan.figures.iter().any(FigureSpec::is_timed);
    if !timed {
        return Devices::default();
    }
    Devices::new(plan, &night.results, |result| store.device(plan, result))
}

pub(super) fn print_tables(plan: &Plan, night: &NightSummary, devices: &Devices) -> Result<(), Failure> {
    let tables = plan.tables.iter().flat_map(|spec| table::tables(plan, spec, &night.results, devices));
    data(&tables.map(|table| table.to_markdown()).collect::<Vec<_>>().join("\n"))
}

pub(super) fn say_failures(plan: &Plan, night: &NightSummary) {
    for result in &night.results {
        if let Outcome::Failed(reason) = &result.outcome {
            let name = match result.cell {
                CellRef::Cell(i) => plan.cells[i].path.clone(),
                CellRef::Reference(i) => format!("reference {}", plan.references[i].id),
            };
            talk(&format!("failed: {name}: {reason}"));
        }
    }
}

/// Names the references that a second technique contradicts, also in quiet nights.
pub(super) fn say_disagreements(plan: &Plan, night: &NightSummary) {
    for found in &night.disagreements {
        let id = &plan.references[found.reference].id;
        talk(&format!("alarm: reference {id} {}; its folder has the map, and so exit code 6", found.found));
    }
}

/// Says what the A/A check found; in quiet nights only what chance does not explain.
fn say_control(plan: &Plan, night: &NightSummary, quiet: bool) {
    for finding in control::check(plan, &night.results).iter().filter(|finding| finding.alarm || !quiet) {
        let alarm = if finding.alarm { "alarm: " } else { "" };
        talk(&format!("{alarm}control: {}", finding.describe()));
    }
}

fn say_where(store: &Store, plan: &Plan, night: &NightSummary) {
    let folder = store.folder();
    let count = |wanted: fn(&Outcome) -> bool| night.results.iter().filter(|r| wanted(&r.outcome)).count();
    let failed = count(|o| matches!(o, Outcome::Failed(_)));
    let done = count(|o| matches!(o, Outcome::Done(_)));
    let cached = count(|o| matches!(o, Outcome::Cached(_)));
    let all = plan.cells.len() + plan.references.len();
    talk(&format!("{done} done, {cached} cached, {failed} failed, {} left of {all}", all - done - cached - failed));
    talk(&format!("pictures   {}", shown(&folder.join("runs"))));
    if !plan.figures.is_empty() {
        talk(&format!("curves     {}", shown(&folder.join("figures"))));
    }
    if !plan.tables.is_empty() {
        talk(&format!("tables     {}", shown(&folder.join("tables"))));
    }
    talk(&format!("all values {}", shown(&folder.join("summary.csv"))));
}

pub(super) fn exit_of(plan: &Plan, night: &NightSummary, ended: Exit) -> Exit {
    let settled = |o: &Outcome| matches!(o, Outcome::Done(_) | Outcome::Cached(_));
    let settled_cells =
        night.results.iter().filter(|r| matches!(r.cell, CellRef::Cell(_)) && settled(&r.outcome)).count();
    if night.interrupted {
        ended
    } else if !night.disagreements.is_empty() {
        // What is measured against a wrong truth is worse than what is not measured at all.
        Exit::Disagreement
    } else if night.results.iter().any(|r| matches!(r.outcome, Outcome::Failed(_))) {
        Exit::CellsFailed
    } else if settled_cells < plan.cells.len() {
        Exit::WorkLeft
    } else {
        Exit::Done
    }
}
