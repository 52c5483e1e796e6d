//! `lumbre watch`: the dashboard of a night that another process renders, or has rendered.

use std::fs::File;
use std::io::{BufReader, IsTerminal};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use super::args::{Global, StatusArgs, WatchArgs};
use super::exit::{Exit, Failure};
use super::load::{decode, shown};
use super::log::Log;
use super::{signals, status};
use crate::experiment::Control;
use crate::output::time;
use crate::store::{Doing, Follower, Seen, Sight, Worker, latest};
use crate::tui::model::Model;
use crate::tui::reel::{Reel, Winding};
use crate::tui::thumbs::Thumb;
use crate::tui::workers::WorkerLine;
use crate::tui::{self, Dashboard, Role};

/// How often files are looked at.
const LOOK: Duration = Duration::from_millis(500);
/// How soon the end of the dashboard is noticed.
const GLANCE: Duration = Duration::from_millis(50);

/// The longest side of a film with a time axis that is believed; its file says how long it is.
const MAX_SIDE: u32 = 1 << 16;

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
            let reel = sights.iter().rev().find_map(|sight| wound(&sight.seen));
            if !sights.is_empty() {
                dashboard.tell(|model| {
                    sights.into_iter().for_each(|sight| tell(model, sight));
                    reel.into_iter().for_each(|reel| model.wound(reel));
                });
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
        Seen::Crew(workers) => model.crew(crew_lines(&workers)),
        Seen::Measured { cell, row } => model.wave(cell, &row, 0.0, at_s),
        Seen::Pictured { cell, image } => model.picture(cell, image),
        Seen::Strategy { cell, s, t, weighted, image } => model.strategy(cell, Thumb::of(s, t, weighted, &image)),
        Seen::Ended { cell, outcome, last } => model.finish(cell, &outcome, last.as_ref(), at_s),
        Seen::Said { level, cell, text } => model.say(level, cell, &text, at_s),
        Seen::Compared { reference, agrees } => model.compared(reference, agrees),
        Seen::Foretold(left) => model.foretold(left, at_s),
        Seen::Over => model.end(at_s),
        // Read before the model is locked.
        Seen::Timed { .. } => {}
    }
}

/// Light by time that a run has left, row by row; nothing where it cannot be read.
fn wound(seen: &Seen) -> Option<Reel> {
    let Seen::Timed { cell, file, axis } = seen else { return None };
    let mut from = BufReader::new(File::open(file).ok()?);
    let [height, width, bins, 3] = time::read_shape(&mut from).ok()?[..] else { return None };
    let size = [u32::try_from(width).ok()?, u32::try_from(height).ok()?];
    if bins != axis.bins as usize || size[0].max(size[1]) > MAX_SIDE {
        return None;
    }
    let mut reel = Winding::new(*cell, *axis, size);
    for _ in 0..height {
        let row = time::read_numbers(&mut from, width * bins * 3).ok()?;
        reel.row(row.as_chunks::<3>().0.iter().copied());
    }
    reel.end()
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::CellRef;
    use crate::film::time::{TimeAxis, TimeCube};

    #[test]
    fn light_by_time_reads_as_it_was_rendered() {
        let axis = TimeAxis { start: 1.0, bin: 0.5, bins: 5 };
        let (width, height) = (7, 3);
        let slots = width * height * axis.slots();
        let sum: Vec<[f64; 3]> = (0..slots).map(|i| [i as f64 % 5.0, 0.25 * i as f64, 1.0]).collect();
        let cube = TimeCube { axis, width: 7, height: 3, samples: 4, square: vec![[0.0; 3]; slots], sum };
        let dir = tempfile::tempdir().unwrap();
        let file = dir.path().join("time-cube.npy");
        let left = time::files(&cube, None, &[]).unwrap();
        let bytes = left.iter().find(|f| f.name == "time-cube.npy").map(|f| f.bytes.clone()).unwrap();
        std::fs::write(&file, &bytes).unwrap();
        let cell = CellRef::Cell(3);
        let timed = |axis| Seen::Timed { cell, file: file.clone(), axis };
        assert_eq!(wound(&timed(axis)), Reel::of(cell, &cube));
        assert!(wound(&timed(axis)).is_some());
        assert_eq!(wound(&timed(TimeAxis { bins: 6, ..axis })), None, "of another run");
        std::fs::write(&file, &bytes[..bytes.len() - 1]).unwrap();
        assert_eq!(wound(&timed(axis)), None, "cut off");
    }
}
