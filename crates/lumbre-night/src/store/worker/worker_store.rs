//! The [`Store`] of one worker among many, which joins a folder that another process created, and
//! of the planner that created it.

use std::cell::{Cell, RefCell};
use std::path::Path;

use super::registry::{Heartbeat, WorkerInfo};
use super::session::WorkerSession;
use crate::experiment::event::History;
use crate::experiment::run_progress::Claim;
use crate::experiment::{CellRef, Plan};
use crate::store::StoreError;
use crate::store::lock::claim::Claims;
use crate::store::read::archive::{Archive, Decode};
use crate::store::schema::plan::PlanSnapshot;
use crate::store::schema::process::WorkerState;
use crate::store::schema::run::DONE;
use crate::store::write::experiment_folder::Store;
use crate::store::write::journal::Journal;
use crate::store::write::plan_folder::lock_folder;
use crate::store::write::{atomic, failure};

/// Folder of the night's closing: its claim, and [`RESULTS`].
const CLOSING: &str = "closing";
/// File with a hash of the results that the tables were drawn from.
const RESULTS: &str = "results";

impl Store {
    /// Joins the workers of an experiment whose plan snapshot exists. Changes no existing file.
    ///
    /// # Errors
    /// When the folder is not writable.
    pub fn join(
        home: &Path,
        plan: &Plan,
        snapshot: &PlanSnapshot,
        decode: Decode,
        worker: &WorkerInfo,
    ) -> Result<Store, StoreError> {
        atomic::probe(home)?;
        let (guard, alone) = lock_folder(home)?;
        if alone && let Err(e) = guard.lock_shared() {
            tracing::warn!("cannot take the shared lock of {}: {e}", home.display());
        }
        let out = home.parent().unwrap_or(home).to_owned();
        let claims = Claims::new();
        let journal = RefCell::new(Journal::open(claims.own_journal(home)?)?);
        let heartbeat = Heartbeat::join(home, claims.owner(), worker)?;
        let archive =
            Archive::for_worker(&out, home, decode, &plan.name, snapshot.elsewhere.clone());
        let session = WorkerSession::new(home, plan, worker, heartbeat, false);
        let slot_cursors = RefCell::default();
        let (folder, full) = (home.to_owned(), Cell::default());
        Ok(Store {
            folder,
            out,
            archive,
            journal,
            claims,
            session: Some(session),
            slot_cursors,
            full,
            lock: guard,
        })
    }

    /// Announces this process, which made the plan and also renders, to workers that join.
    /// Comparison groups that it begins are bound to its device, and it skips groups bound to other
    /// devices. Failed runs become open again.
    ///
    /// # Errors
    /// When the announcement cannot be written.
    pub fn join_as_planner(&mut self, plan: &Plan, worker: &WorkerInfo) -> Result<(), StoreError> {
        let heartbeat = Heartbeat::join_as_planner(&self.folder, self.claims.owner(), worker)?;
        let session = WorkerSession::new(&self.folder, plan, worker, heartbeat, true);
        session.markers.remove_failures();
        self.session = Some(session);
        Ok(())
    }

    /// The finished runs, read from their own files.
    pub fn archive(&self) -> &Archive {
        &self.archive
    }

    /// Number derived from the worker's name, which determines where in the plan the worker starts.
    pub fn start_offset(&self) -> u64 {
        let hash = blake3::hash(self.claims.owner().name().as_bytes());
        hash.as_bytes()
            .iter()
            .take(8)
            .fold(0, |n, byte| n << 8 | u64::from(*byte))
    }

    /// Records that this worker leaves, and why.
    pub fn leave(&self, reason: &str) {
        if let Some(session) = &self.session {
            session
                .heartbeat
                .set_state(WorkerState::Left(reason.to_owned()));
        }
    }

    /// Claims the closing of the night, so that only one worker draws its tables. Ends with
    /// [`Store::end_closing`].
    ///
    /// # Errors
    /// When the claim cannot be read or written.
    pub fn claim_closing(&self) -> Result<Claim, StoreError> {
        self.claims.acquire(&self.folder.join(CLOSING))
    }

    /// Ends the closing. `results` identifies the results that the tables were drawn from; `None`
    /// if they were not drawn.
    ///
    /// # Errors
    /// When the record cannot be written.
    pub fn end_closing(&self, results: Option<&str>) -> Result<(), StoreError> {
        let folder = self.folder.join(CLOSING);
        let written = results.map_or(Ok(()), |results| {
            atomic::write_atomically(&folder.join(RESULTS), results.as_bytes())
        });
        self.claims.release(&folder);
        written
    }

    /// Identifies the results that the tables were last drawn from.
    pub fn closed_results(&self) -> Option<String> {
        std::fs::read_to_string(self.folder.join(CLOSING).join(RESULTS)).ok()
    }

    /// Determines the state of every run of the plan from its own files, ignoring completion
    /// markers. Removes markers that turn out to be wrong, and leftovers of processes that died
    /// after writing a run's last file.
    pub fn plan_status(&self, plan: &Plan) -> PlanStatus {
        let cells = (0..plan.cells.len()).map(CellRef::Cell);
        let all: Vec<CellRef> = (0..plan.references.len())
            .map(CellRef::Reference)
            .chain(cells)
            .collect();
        for cell in &all {
            let folder = self.run_folder(plan, *cell);
            if let CellRef::Cell(_) = cell
                && folder.join(DONE).is_file()
            {
                // Other cells of the plan with the same id find it here.
                self.archive
                    .register(&plan.name, &plan.id(*cell).0, &folder);
            }
        }
        let mut status = PlanStatus::default();
        for cell in all {
            if self.archive.finished_run(plan, cell).is_some() || self.is_image_file(plan, cell) {
                self.remove_leftovers(&self.run_folder(plan, cell));
                status.done.push(cell);
            } else if let Some(record) = failure::read(&self.run_folder(plan, cell)) {
                status.failed.push((cell, record.reason));
            } else {
                status.open += 1;
                if let Some(session) = &self.session {
                    session.markers.remove(&plan.id(cell).0);
                }
            }
        }
        status
    }

    fn is_image_file(&self, plan: &Plan, cell: CellRef) -> bool {
        use crate::experiment::plan::ReferenceSource::File;
        matches!(cell, CellRef::Reference(i) if matches!(plan.references[i].source, File { .. }))
    }
}

/// State of all runs of a plan.
#[derive(Clone, Debug, Default)]
pub struct PlanStatus {
    /// Finished runs, and references that are image files.
    pub done: Vec<CellRef>,
    /// Runs whose last attempt failed, with the reason.
    pub failed: Vec<(CellRef, String)>,
    /// Number of all other runs.
    pub open: usize,
}
