//! `lumbre watch`: the dashboard of a night that another process renders, or has rendered.

use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::args::{Global, StatusArgs, WatchArgs};
use super::exit::{Exit, Failure};
use super::load::{decode, shown};
use super::log::Log;
use super::{signals, status};
use crate::experiment::Control;
use crate::store::{Doing, Follower, Seen, Sight, Worker, latest};
use crate::tui::model::Model;
use crate::tui::thumbs::Thumb;
use crate::tui::workers::WorkerLine;
use crate::tui::{self, Dashboard, Role};

/// How often files are looked at.
const LOOK: Duration = Duration::from_millis(500);
/// How soon the end of the dashboard is noticed.
const GLANCE: Duration = Duration::from_millis(50);

/// Shows a night.
pub fn main(args: &WatchArgs, global: &Global, log: &Log) -> Result<Exit, Failure> {
    let env = |name: &str| std::env::var(name).ok();
    let whole_screen = tui::wanted(std::io::stdout().is_terminal(), &env) == tui::Mode::Dashboard;
    if !whole_screen || global.no_tui {
        return status::main(&StatusArgs { folder: args.folder.clone(), json: false }, global);
    }
    let mut follower = follow(args.folder.as_deref(), global)?;
    // Signals only end the watching: whoever renders the night has its own.
    let control = Arc::new(Control::default());
    signals::listen(Arc::clone(&control), tui::guard::give_back_now)
        .map_err(|e| Failure::internal(format!("cannot listen to signals: {e}")))?;
    log.hold();
    let dashboard = Dashboard::start(Role::Watch, Box::new(|| {})).map_err(Failure::internal)?;
    dashboard.tell(|model| open(model, &follower));
    let mut waited = LOOK;
    while !dashboard.is_over() && !control.stop_requested() {
        if waited >= LOOK {
            // Files are read before the model is locked: a slow disk must not stop keys.
            let sights = follower.look();
            if !sights.is_empty() {
                dashboard.tell(|model| sights.into_iter().for_each(|sight| tell(model, sight)));
            }
            waited = Duration::ZERO;
        }
        std::thread::sleep(GLANCE);
        waited += GLANCE;
    }
    drop(dashboard);
    log.release();
    Ok(Exit::Done)
}

/// Follows what was asked for: an experiment's folder, or the latest of a folder of results.
pub(super) fn follow(folder: Option<&Path>, global: &Global) -> Result<Follower, Failure> {
    Follower::open(&home_of(folder, global)?, decode).map_err(Failure::usage)
}

/// The folder that was asked for.
pub(super) fn home_of(folder: Option<&Path>, global: &Global) -> Result<PathBuf, Failure> {
    let given = folder.unwrap_or(&global.out);
    if given.join("plan.json").is_file() {
        return Ok(given.to_owned());
    }
    let missing = || format!("there is no night in {} (`lumbre ls` lists what is there)", shown(given));
    latest(given).or_else(|| only_one(given)).ok_or_else(missing).map_err(Failure::usage)
}

/// The one experiment of a folder that has no `latest`, such as a copy.
fn only_one(folder: &Path) -> Option<PathBuf> {
    let entries = std::fs::read_dir(folder).ok()?.flatten().map(|entry| entry.path());
    let mut experiments = entries.filter(|path| path.join("plan.json").is_file());
    experiments.next().filter(|_| experiments.next().is_none())
}

/// A model of a night of which nothing is known but its plan.
pub(super) fn open(model: &mut Model, follower: &Follower) {
    model.begin(Arc::clone(follower.outline()), 0.0);
    // Only the journal knows when a night began, if one did.
    model.started_s = None;
}

/// Folds what was seen into the model.
pub(super) fn tell(model: &mut Model, Sight { at_s, seen }: Sight) {
    match seen {
        Seen::Began => model.begin_again(at_s),
        Seen::Started { cell, config, open, reference } => {
            model.start(cell, open, reference, at_s);
            if let Some(config) = config {
                model.configured(cell, Arc::new(*config));
            }
        }
        Seen::Underway { cell } => model.underway(cell, at_s),
        Seen::Part { reference, there, of } => model.part(reference, there, of, at_s),
        Seen::Crew(workers) => model.crew(crew_lines(&workers)),
        Seen::Measured { cell, row } => model.wave(cell, &row, 0.0, at_s),
        Seen::Pictured { cell, image } => model.picture(cell, image),
        Seen::Strategy { cell, s, t, weighted, image } => model.strategy(cell, Thumb::of(s, t, weighted, &image)),
        Seen::Ended { cell, outcome, last } => model.finish(cell, &outcome, last.as_ref(), at_s),
        Seen::Said { level, cell, text } => model.say(level, cell, &text, at_s),
        Seen::Foretold(left) => model.foretold(left, at_s),
        Seen::Over => model.end(at_s),
    }
}

/// The workers that have not left, as lines of the screen.
fn crew_lines(workers: &[Worker]) -> Vec<WorkerLine> {
    let line = |worker: &Worker| WorkerLine {
        node: if worker.job.is_empty() { worker.host.clone() } else { format!("{} {}", worker.host, worker.job) },
        device: worker.device.model.clone(),
        doing: doing(worker),
        age_s: worker.age_s,
        lost: worker.is_lost(),
    };
    workers.iter().filter(|worker| !matches!(worker.doing, Doing::Left(_))).map(line).collect()
}

/// What a worker does, in words.
pub(super) fn doing(worker: &Worker) -> String {
    match &worker.doing {
        Doing::Waiting => "waits".to_owned(),
        Doing::Rendering { path, .. } => path.clone(),
        Doing::Left(reason) => format!("left: {reason}"),
    }
}
