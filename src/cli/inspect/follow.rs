//! A night that another process renders or has rendered, followed by its files.

use std::path::Path;

use crate::cli::args::Global;
use crate::cli::exit::Failure;
use crate::cli::night::load::decode_picture;
use crate::cli::selector;
use lumbre_night::store::{Follower, TimedEvent, Update, WorkerState, WorkerStatus};
use lumbre_tui::tui::model::night::NightModel;
use lumbre_tui::tui::model::worker_list::WorkerLine;

/// Opens a follower on the files of the selected night.
pub(in crate::cli) fn open_follower(
    night: Option<&Path>,
    global: &Global,
) -> Result<Follower, Failure> {
    let folder = selector::night(night, &global.out)?;
    Follower::open(&folder, decode_picture).map_err(Failure::usage)
}

/// Applies what the follower found in the files to the model.
pub fn apply(model: &mut NightModel, changes: Update) {
    for TimedEvent { at_s, event } in changes.events {
        model.receive(&event, at_s);
    }
    if let Some(workers) = changes.workers {
        model.set_workers(worker_lines(&workers));
    }
}

/// Returns dashboard lines for the workers that have not exited.
fn worker_lines(workers: &[WorkerStatus]) -> Vec<WorkerLine> {
    let line = |worker: &WorkerStatus| WorkerLine {
        node: if worker.job.is_empty() {
            worker.host.clone()
        } else {
            format!("{} {}", worker.host, worker.job)
        },
        device: worker.device.model.clone(),
        activity: describe_state(worker),
        age_s: worker.age_s,
        lost: worker.is_lost(),
    };
    workers
        .iter()
        .filter(|worker| !matches!(worker.state, WorkerState::Left(_)))
        .map(line)
        .collect()
}

/// Describes what a worker is doing: waiting, the path of the run it renders, or why it exited.
pub(in crate::cli) fn describe_state(worker: &WorkerStatus) -> String {
    match &worker.state {
        WorkerState::Waiting => "waiting".to_owned(),
        WorkerState::Rendering { path, .. } => path.clone(),
        WorkerState::Left(reason) => format!("exited: {reason}"),
    }
}
