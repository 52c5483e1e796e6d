//! `lumbre work`: one worker of a night.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use serde_json::json;

use super::frozen::{Thawed, thaw};
use crate::cli::args::{Global, WorkArgs};
use crate::cli::exit::{Exit, Failure, talk};
use crate::cli::load::{decode, shown};
use crate::cli::log::Log;
use crate::cli::recorder::Recorder;
use crate::cli::run::{
    Watcher, counted, devices_of, exit_of, print_tables, say_disagreements, say_failures, write_evidence,
};
use crate::cli::signals::{self, Heard};
use crate::cli::space::{self, patiently};
use crate::cli::until;
use crate::experiment::event::Event;
use crate::experiment::forecast::Paces;
use crate::experiment::groups::{Affinity, Begin};
use crate::experiment::run::Options;
use crate::experiment::standing::Claim;
use crate::experiment::{CellRef, CellResult, Control, NightSummary, Outcome, Plan, Sink, SinkError, run};
use crate::render::{backend, choice, device_place};
use crate::script::Script;
use crate::store::{Device, Host, Me, Stock, Store};
use crate::tui;

/// How often a night that turns out not to be done is gone through again before its worker gives up.
const ROUNDS: usize = 3;
/// How often a worker looks whether another one has drawn the tables.
const GLANCE: Duration = Duration::from_millis(200);

/// Works on a night.
pub fn work(args: &WorkArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    if global.backend.is_some() {
        return Err(Failure::usage("the plan says on which backend each cell is rendered; leave --backend out"));
    }
    if let Some(device) = &args.device {
        choice::use_device(device);
    }
    let home = args.folder.canonicalize().map_err(|e| {
        Failure::usage(format!(
            "there is no folder {} on {}: {e} (workers need the folder of their night on a file system that they share)",
            shown(&args.folder),
            Host::here().name
        ))
    })?;
    let Thawed { script, plan, frozen } = thaw(&home, global)?;
    let me = me(&plan, args.affinity);
    if let (Some(device), true) = (&args.device, places_of(&plan).is_empty()) {
        talk(&format!(
            "note: nothing of this plan is rendered on a graphics device; --device {device} is not looked at"
        ));
    }
    // Those that came before may have filled the disk, and wait as well.
    let wait = || std::thread::sleep(space::STEP);
    let store = patiently(&Control::default(), &wait, || Store::join(&home, &plan, &frozen, decode, &me));
    let store = store.map_err(Failure::usage)?;
    let worker = Worker { script: &script, plan: &plan, store: &store, global, log, args };
    let ended = worker.work();
    store.leave(&match &ended {
        Ok(exit) => reason(*exit).to_owned(),
        Err(failure) => failure.report.to_string(),
    });
    ended
}

/// What this process says of itself to those that work on the same plan.
pub fn me(plan: &Plan, affinity: Affinity) -> Me {
    Me { device: device_of(plan), affinity, job: job() }
}

/// Says which cells a night left to workers with other devices.
pub fn say_apart(plan: &Plan, night: &NightSummary) {
    if let Some((cell, why)) = night.apart.first() {
        let (cells, name) = (counted(night.apart.len(), "cell"), plan.id(*cell));
        talk(&format!(
            "{cells} left to others, the first of them {name}: {why} (--affinity none renders them all the same, where \
             times are of no interest)"
        ));
    }
}

/// Asks a night to stop when standard input ends.
fn stop_with_stdin(control: &Arc<Control>) -> std::io::Result<()> {
    let control = Arc::clone(control);
    let listen = move || {
        // Nobody says anything; what cannot be read has ended too.
        let _ = std::io::copy(&mut std::io::stdin().lock(), &mut std::io::sink());
        control.request_stop();
    };
    std::thread::Builder::new().name("stdin".to_owned()).spawn(listen).map(drop)
}

/// Why a worker leaves.
fn reason(exit: Exit) -> &'static str {
    match exit {
        Exit::Done => "all is done",
        Exit::Checkpointed | Exit::Interrupted => "it was asked to",
        Exit::WorkLeft => "what is left is not for it",
        _ => "all is done, and some of it failed",
    }
}

/// The job that this process is part of, as the programs that start jobs tell it.
fn job() -> String {
    let env = |name: &str| std::env::var(name).ok().filter(|value| !value.is_empty());
    match (env("SLURM_ARRAY_JOB_ID"), env("SLURM_ARRAY_TASK_ID")) {
        (Some(job), Some(task)) => format!("{job}_{task}"),
        _ => match (env("HQ_JOB_ID"), env("HQ_TASK_ID")) {
            (Some(job), Some(task)) => format!("{job}_{task}"),
            _ => env("SLURM_JOB_ID").unwrap_or_default(),
        },
    }
}

/// The backends that a plan names.
fn backends_of(plan: &Plan) -> BTreeSet<&str> {
    plan.cells.iter().map(|cell| cell.config.backend.as_str()).collect()
}

/// The graphics devices that this process renders a plan on, by their places.
fn places_of(plan: &Plan) -> BTreeSet<String> {
    backends_of(plan).into_iter().map(device_place).filter(|place| !place.is_empty()).collect()
}

/// What this process renders the cells of a plan on.
fn device_of(plan: &Plan) -> Device {
    let host = Host::here();
    let places = places_of(plan);
    let mut key = host.name.clone();
    if !places.is_empty() {
        // Where each job sees its own devices only, each has a device 0: what it was given tells them apart.
        let given = ["SLURM_STEP_GPUS", "SLURM_JOB_GPUS", "CUDA_VISIBLE_DEVICES"];
        let given = given.iter().find_map(|name| std::env::var(name).ok().filter(|v| !v.is_empty()));
        let places: Vec<String> = places.into_iter().collect();
        key =
            format!("{key}, device {}{}", places.join(" and "), given.map_or_else(String::new, |g| format!(" of {g}")));
    }
    let model = |name: &str| -> String {
        if name == "cpu" {
            return format!("{}, {} threads", host.cpu, host.cores);
        }
        let (Ok(found) | Err(found)) = backend(name).map_or(Err(String::new()), |row| (row.probe)());
        found
    };
    let models: BTreeSet<String> = backends_of(plan).into_iter().map(model).collect();
    Device { key, model: models.into_iter().collect::<Vec<_>>().join("; ") }
}

struct Worker<'a> {
    script: &'a Script,
    plan: &'a Arc<Plan>,
    store: &'a Store,
    global: &'a Global,
    log: &'a Log,
    args: &'a WorkArgs,
}

impl Worker<'_> {
    fn work(&self) -> Result<Exit, Failure> {
        let control = Arc::new(Control::default());
        let heard = signals::listen(Arc::clone(&control), tui::guard::give_back_now)
            .map_err(|e| Failure::internal(format!("cannot listen to signals: {e}")))?;
        if self.args.while_stdin {
            stop_with_stdin(&control).map_err(Failure::internal)?;
        }
        let options = self.options()?;
        // Cells whose scenes or devices this worker lacks would all fail one after the other.
        for _ in 0..ROUNDS {
            let night = self.render(&control, options.clone())?;
            if night.interrupted {
                self.say(|| "leaves with a checkpoint; the same command goes on".to_owned());
                return Ok(heard.exit());
            }
            if !night.apart.is_empty() {
                say_apart(self.plan, &night);
                return Ok(Exit::WorkLeft);
            }
            if night.results.len() < self.plan.cells.len() + self.plan.references.len() && self.is_narrowed(&options) {
                self.say(|| "leaves with work left".to_owned());
                return Ok(Exit::WorkLeft);
            }
            if let Some(exit) = self.close(&control, &heard, &night)? {
                return Ok(exit);
            }
        }
        talk("runs that were finished are not any more, again and again: is something deleting them?");
        Ok(Exit::WorkLeft)
    }

    fn say(&self, line: impl FnOnce() -> String) {
        if !self.global.quiet {
            talk(&line());
        }
    }

    fn is_narrowed(&self, options: &Options) -> bool {
        options.only.is_some() || options.deadline.is_some() || options.max_fails.is_some()
    }

    fn options(&self) -> Result<Options, Failure> {
        let plan = self.plan;
        let chosen = (!self.args.only.is_empty()).then(|| self.chosen()).transpose()?;
        let deadline =
            self.args.until.or(plan.night.deadline).map(until::moment).transpose().map_err(Failure::usage)?;
        let turn = self.store.turn();
        Ok(Options {
            threads: self.global.threads,
            max_fails: self.args.max_fails.map(|n| n as usize),
            smoke: false,
            deadline,
            only: chosen,
            paces: Paces::default(),
            done: BTreeSet::new(),
            memory: None,
            begin: Some(if self.args.affinity == Affinity::None { Begin::Cell(turn) } else { Begin::Group(turn) }),
        })
    }

    /// The cells that `--only` leaves; their references are rendered when they are needed.
    fn chosen(&self) -> Result<BTreeSet<CellRef>, Failure> {
        for (axis, _) in &self.args.only {
            if !self.plan.axes.contains(axis) {
                let known = self.plan.axes.join(", ");
                return Err(Failure::usage(format!("the plan has no axis `{axis}` (it has: {known})")));
            }
        }
        let axes: BTreeSet<&String> = self.args.only.iter().map(|(axis, _)| axis).collect();
        let fits = |i: &usize| {
            let point = &self.plan.cells[*i].point;
            axes.iter().all(|axis| {
                let value = point.iter().find(|(name, _)| name == *axis).map(|(_, value)| value);
                self.args.only.iter().any(|(name, values)| name == *axis && value.is_some_and(|v| values.contains(v)))
            })
        };
        let cells: BTreeSet<CellRef> = (0..self.plan.cells.len()).filter(fits).map(CellRef::Cell).collect();
        if cells.is_empty() { Err(Failure::usage("--only leaves no cell")) } else { Ok(cells) }
    }

    fn render(&self, control: &Arc<Control>, options: Options) -> Result<NightSummary, Failure> {
        let mut recorder = Recorder::new(self.store, Arc::clone(self.plan), self.log.clone(), Arc::clone(control));
        let mut watcher = Watcher::new(control, self.global, self.log);
        let sinks: &mut [&mut dyn Sink] = &mut [&mut recorder, watcher.sink()];
        let night = run::run(self.plan, self.script, self.store, sinks, control, options);
        drop(watcher);
        self.log.release();
        night.map_err(Failure::internal)
    }

    /// Draws tables and figures, if nobody has: one of all workers does. `None` if the night is not done after all.
    fn close(&self, control: &Arc<Control>, heard: &Heard, night: &NightSummary) -> Result<Option<Exit>, Failure> {
        let what = self.what(night.results.iter().map(|result| (result.cell, &result.outcome)));
        loop {
            if control.stop_requested() {
                return Ok(Some(heard.exit()));
            }
            if self.store.closed_of().as_deref() == Some(&what) {
                self.say(|| format!("all is done; tables and figures are in {}", shown(self.store.folder())));
                return Ok(Some(exit_of(self.plan, night, heard.exit())));
            }
            if self.store.close().map_err(Failure::internal)? == Claim::Ours {
                break;
            }
            std::thread::sleep(GLANCE);
        }
        let drawn = self.draw(control);
        let of = drawn.as_ref().ok().and_then(|drawn| Some(drawn.as_ref()?.1.as_str()));
        self.store.closed(of).map_err(Failure::internal)?;
        Ok(drawn?.map(|(exit, _)| exit))
    }

    /// What became of every run, as one hash.
    fn what<'o>(&self, results: impl Iterator<Item = (CellRef, &'o Outcome)>) -> String {
        let word = |outcome: &Outcome| if matches!(outcome, Outcome::Failed(_)) { "failed" } else { "done" };
        let lines: BTreeSet<String> =
            results.map(|(cell, outcome)| format!("{:?} {} {}", cell, self.plan.id(cell), word(outcome))).collect();
        let lines: Vec<String> = lines.into_iter().collect();
        blake3::hash(lines.join("\n").as_bytes()).to_hex().to_string()
    }

    fn draw(&self, control: &Arc<Control>) -> Result<Option<(Exit, String)>, Failure> {
        let Stock { done, failed, open } = self.store.take_stock(self.plan);
        if open > 0 {
            return Ok(None);
        }
        let mut comparisons =
            Comparisons { to: Recorder::new(self.store, Arc::clone(self.plan), self.log.clone(), Arc::clone(control)) };
        let options = Options { only: Some(done.into_iter().collect()), ..Options::from(self.global.threads) };
        let archive = self.store.archive();
        let night = run::run(self.plan, self.script, archive, &mut [&mut comparisons], control, options);
        let mut night = night.map_err(Failure::internal)?;
        night.results.extend(failed.into_iter().map(|(cell, why)| CellResult {
            cell,
            outcome: Outcome::Failed(why),
            rows: Arc::default(),
            floors: Arc::default(),
            open: Default::default(),
        }));
        night.results.sort_by_key(|result| match result.cell {
            CellRef::Reference(place) => (0, place),
            CellRef::Cell(place) => (1, place),
        });
        let devices = devices_of(self.store, self.plan, &night);
        write_evidence(self.store, self.plan, &night, &devices)?;
        print_tables(self.plan, &night, &devices)?;
        say_failures(self.plan, &night);
        say_disagreements(self.plan, &night);
        self.say(|| format!("all is done; tables and figures were written to {}", shown(self.store.folder())));
        // Only for people: the folders say that all is done.
        let _ = self.store.journal("night_closed", &json!({}));
        let what = self.what(night.results.iter().map(|result| (result.cell, &result.outcome)));
        Ok(Some((exit_of(self.plan, &night, Exit::Interrupted), what)))
    }
}

/// Keeps what comparisons of references find, when a night is gone through once more to draw its tables.
struct Comparisons<'a> {
    to: Recorder<'a>,
}

impl Sink for Comparisons<'_> {
    fn hear(&mut self, event: &Event) -> Result<(), SinkError> {
        match event {
            Event::Agreement { .. } => self.to.hear(event),
            _ => Ok(()),
        }
    }
}

/// Whether a folder is one that other machines may not see, in words.
pub(super) fn looks_local(home: &Path) -> Option<String> {
    let kind = crate::store::mount::kind(home)?;
    (!crate::store::mount::is_network(&kind)).then(|| {
        format!(
            "{} lies on {kind}, which looks like a disk of this machine: workers elsewhere will not see it",
            shown(home)
        )
    })
}
