//! State of a worker that renders a night with others.

use std::path::Path;

use super::completion_markers::{CompletionMarker, CompletionMarkers};
use super::registry::{Heartbeat, WorkerInfo};
use crate::experiment::comparison_groups::comparison_group;
use crate::experiment::run_progress::{Claim, ReportedOutcome};
use crate::experiment::{CellRef, Plan};
use crate::store::layout;
use crate::store::lock::device_affinity::{AffinityDecision, DeviceAffinity};
use crate::store::schema::journal::JournalEvent;
use crate::store::schema::process::WorkerState;
use crate::store::write::failure;

/// State of a worker, or of a planner that also renders.
#[derive(Debug)]
pub(crate) struct WorkerSession {
    pub(super) heartbeat: Heartbeat,
    pub(super) markers: CompletionMarkers,
    /// Whether this process made the plan. A planner verifies every file of a finished run and
    /// marks only failures.
    planner: bool,
    affinity: DeviceAffinity,
    /// Comparison group of every cell of the plan.
    groups: Vec<String>,
}

impl WorkerSession {
    /// Creates the state from what is known when the worker joins.
    pub(super) fn new(
        home: &Path,
        plan: &Plan,
        worker: &WorkerInfo,
        heartbeat: Heartbeat,
        planner: bool,
    ) -> WorkerSession {
        WorkerSession {
            heartbeat,
            markers: CompletionMarkers::new(home),
            planner,
            affinity: DeviceAffinity::new(home, worker.device.clone(), worker.affinity),
            groups: plan.cells.iter().map(comparison_group).collect(),
        }
    }

    /// Result of a run according to the completion markers of other workers. Returns `None` if no
    /// marker decides it.
    pub(crate) fn reported_outcome(
        &self,
        plan: &Plan,
        cell: CellRef,
        folder: &Path,
    ) -> Option<ReportedOutcome> {
        match self.markers.find(&plan.id(cell).0)? {
            CompletionMarker::Done if self.planner => None,
            CompletionMarker::Done => Some(ReportedOutcome::Done(folder.to_owned())),
            // A failure marker without a record is older than the current attempt.
            CompletionMarker::Failed => {
                failure::read(folder).map(|record| ReportedOutcome::Failed(record.reason))
            }
        }
    }

    /// Returns a refusal if the cell's comparison group is bound to another device.
    pub(crate) fn affinity_refusal(
        &self,
        plan: &Plan,
        cell: CellRef,
    ) -> std::io::Result<Option<Claim>> {
        let CellRef::Cell(i) = cell else {
            return Ok(None);
        };
        let path = &plan.cells[i].path;
        Ok(match self.affinity.bind(&self.groups[i])? {
            AffinityDecision::Allowed => None,
            AffinityDecision::OtherDevice(device) => Some(Claim::HeldBy(format!(
                "{path}, whose comparison runs on {device}"
            ))),
            AffinityDecision::OtherModel(model) => Some(Claim::WrongWorker(format!(
                "its comparison runs on another model of device: {model}"
            ))),
        })
    }

    /// Writes the completion marker of a run that this worker finished or failed.
    pub(crate) fn write_marker(&self, plan: &Plan, cell: CellRef, folder: &Path) {
        let run = &plan.id(cell).0;
        if layout::is_done(folder) {
            if !self.planner {
                self.markers.write(run, CompletionMarker::Done);
            }
        } else if failure::read(folder).is_some() {
            self.markers.write(run, CompletionMarker::Failed);
        }
    }

    /// Updates the heartbeat from an event, and returns the event that is recorded. Only the
    /// planner starts and finishes a night; other workers start and finish their own work.
    pub(crate) fn observe_event(&self, event: JournalEvent) -> JournalEvent {
        match event {
            JournalEvent::NightStarted(start) if !self.planner => {
                return JournalEvent::WorkerStarted(start);
            }
            JournalEvent::NightFinished {} if !self.planner => {
                return JournalEvent::WorkerFinished {};
            }
            _ => {}
        }
        match &event {
            JournalEvent::CellStarted(start) => self.heartbeat.set_state(WorkerState::Rendering {
                run: start.run.clone(),
                path: start.path.clone(),
            }),
            JournalEvent::ShardStarted(start) => self.heartbeat.set_state(WorkerState::Rendering {
                run: start.run.clone(),
                path: format!("reference, {}", start.shard.shard(0).label()),
            }),
            JournalEvent::CellFinished(_) | JournalEvent::ShardFinished(_) => {
                self.heartbeat.set_state(WorkerState::Waiting);
            }
            _ => {}
        }
        event
    }
}
