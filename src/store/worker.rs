//! A store of one worker among many, in a folder that another process made, or of the process that made it.

use std::cell::{Cell, RefCell};
use std::path::Path;

use serde_json::Value as Json;

use super::archive::{Archive, Decode};
use super::bonds::{Bond, Bonds};
use super::claim::Claims;
use super::crew::{Doing, Me, Presence};
use super::experiment::{Store, lock};
use super::frozen::Frozen;
use super::journal::Journal;
use super::marks::{Mark, Marks};
use super::{StoreError, failure, layout, write};
use crate::experiment::event::History;
use crate::experiment::groups::group;
use crate::experiment::standing::{Claim, Settled};
use crate::experiment::{CellRef, Plan};

/// Where a worker finds what is left when all is done, and who says so.
const CLOSING: &str = "closing";

/// What a worker has besides what every process has.
#[derive(Debug)]
pub(super) struct Aboard {
    presence: Presence,
    marks: Marks,
    /// Whether this process made the plan. It looks at every file of what it takes as done, and marks nothing but what
    /// failed.
    planner: bool,
    bonds: Bonds,
    /// The comparison of every cell of the plan.
    groups: Vec<String>,
}

impl Store {
    /// Joins the workers of an experiment whose plan was frozen. Nothing that is there is changed.
    ///
    /// # Errors
    /// When nothing can be written there.
    pub fn join(home: &Path, plan: &Plan, frozen: &Frozen, decode: Decode, me: &Me) -> Result<Store, StoreError> {
        write::probe(home)?;
        let (guard, alone) = lock(home)?;
        if alone && let Err(e) = guard.lock_shared() {
            tracing::warn!("{} cannot be shared: {e}", home.display());
        }
        let out = home.parent().unwrap_or(home).to_owned();
        let claims = Claims::new();
        let journal = RefCell::new(Journal::open(claims.own_journal(home)?)?);
        let presence = Presence::join(home, claims.owner(), me)?;
        let archive = Archive::for_worker(&out, home, decode, &plan.name, frozen.elsewhere.clone());
        let aboard = Aboard::new(home, plan, me, presence, false);
        let turns = RefCell::default();
        let (folder, full) = (home.to_owned(), Cell::default());
        Ok(Store { folder, out, archive, journal, claims, aboard: Some(aboard), turns, full, lock: guard })
    }

    /// Lets workers that come know of this process, which made the plan and renders as well: comparisons that it begins are
    /// bound to its device, and it leaves those alone that are bound to another's. What failed is open again.
    ///
    /// # Errors
    /// When that cannot be written.
    pub fn take_part(&mut self, plan: &Plan, me: &Me) -> Result<(), StoreError> {
        let presence = Presence::plan(&self.folder, self.claims.owner(), me)?;
        let aboard = Aboard::new(&self.folder, plan, me, presence, true);
        aboard.marks.forget_failures();
        self.aboard = Some(aboard);
        Ok(())
    }

    /// What is finished, as its own files say.
    pub fn archive(&self) -> &Archive {
        &self.archive
    }

    /// A number that differs between workers and says where each begins.
    pub fn turn(&self) -> u64 {
        let hash = blake3::hash(self.claims.owner().name().as_bytes());
        hash.as_bytes().iter().take(8).fold(0, |n, byte| n << 8 | u64::from(*byte))
    }

    /// Says that this worker leaves, and why.
    pub fn leave(&self, reason: &str) {
        if let Some(aboard) = &self.aboard {
            aboard.presence.say(Doing::Left(reason.to_owned()));
        }
    }

    /// Makes the closing of the night this process's own, so that one worker of many draws its tables. Until
    /// [`Store::closed`].
    ///
    /// # Errors
    /// When it cannot be known whose it is.
    pub fn close(&self) -> Result<Claim, StoreError> {
        self.claims.take(&self.folder.join(CLOSING))
    }

    /// Ends the closing. `what` says of what the tables were drawn; `None` if they were not.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn closed(&self, what: Option<&str>) -> Result<(), StoreError> {
        let folder = self.folder.join(CLOSING);
        let written = what.map_or(Ok(()), |what| write::atomic(&folder.join("of"), what.as_bytes()));
        self.claims.release(&folder);
        written
    }

    /// Of what the tables were drawn last.
    pub fn closed_of(&self) -> Option<String> {
        std::fs::read_to_string(self.folder.join(CLOSING).join("of")).ok()
    }

    /// Looks at every run of the plan afresh, believing no mark: those that are done, those that failed with their
    /// reasons, and how many are neither. What a mark was wrong about is open again, and what died beside a last file goes.
    pub fn take_stock(&self, plan: &Plan) -> Stock {
        let cells = (0..plan.cells.len()).map(CellRef::Cell);
        let all: Vec<CellRef> = (0..plan.references.len()).map(CellRef::Reference).chain(cells).collect();
        for cell in &all {
            let place = self.place(plan, *cell);
            if let CellRef::Cell(_) = cell
                && place.join("done.json").is_file()
            {
                // Its twins in the plan find it.
                self.archive.expect(&plan.name, &plan.id(*cell).0, &place);
            }
        }
        let mut stock = Stock::default();
        for cell in all {
            if self.archive.done(plan, cell).is_some() || self.is_file(plan, cell) {
                self.tidy(&self.place(plan, cell));
                stock.done.push(cell);
            } else if let Some(record) = failure::read(&self.place(plan, cell)) {
                stock.failed.push((cell, record.reason));
            } else {
                stock.open += 1;
                if let Some(aboard) = &self.aboard {
                    aboard.marks.forget(&plan.id(cell).0);
                }
            }
        }
        stock
    }

    fn is_file(&self, plan: &Plan, cell: CellRef) -> bool {
        use crate::experiment::plan::ReferenceSource::File;
        matches!(cell, CellRef::Reference(i) if matches!(plan.references[i].source, File { .. }))
    }
}

/// What has become of the runs of a plan.
#[derive(Clone, Debug, Default)]
pub struct Stock {
    /// Those that are done, and references that are files.
    pub done: Vec<CellRef>,
    /// Those whose last try failed, with the reason.
    pub failed: Vec<(CellRef, String)>,
    /// Number of all others.
    pub open: usize,
}

impl Aboard {
    fn new(home: &Path, plan: &Plan, me: &Me, presence: Presence, planner: bool) -> Aboard {
        let (marks, bonds) = (Marks::new(home), Bonds::new(home, me.device.clone(), me.affinity));
        Aboard { presence, marks, planner, bonds, groups: plan.cells.iter().map(group).collect() }
    }

    /// What another worker made of a run, as far as marks tell.
    pub(super) fn settled(&self, plan: &Plan, cell: CellRef, place: &Path) -> Option<Settled> {
        match self.marks.find(&plan.id(cell).0)? {
            Mark::Done if self.planner => None,
            Mark::Done => Some(Settled::Done(place.to_owned())),
            // A mark without a record is from before the run was tried again.
            Mark::Failed => failure::read(place).map(|record| Settled::Failed(record.reason)),
        }
    }

    /// Whether a cell is for workers with another device.
    pub(super) fn apart(&self, plan: &Plan, cell: CellRef) -> std::io::Result<Option<Claim>> {
        let CellRef::Cell(i) = cell else { return Ok(None) };
        let path = &plan.cells[i].path;
        Ok(match self.bonds.bind(&self.groups[i])? {
            Bond::Ours => None,
            Bond::Theirs(device) => Some(Claim::Theirs(format!("{path}, whose comparison is with {device}"))),
            Bond::Never(model) => {
                Some(Claim::Never(format!("its comparison is with another model of device: {model}")))
            }
        })
    }

    /// Marks a run that this worker has settled.
    pub(super) fn mark(&self, plan: &Plan, cell: CellRef, place: &Path) {
        let run = &plan.id(cell).0;
        if layout::is_done(place) {
            if !self.planner {
                self.marks.put(run, Mark::Done);
            }
        } else if failure::read(place).is_some() {
            self.marks.put(run, Mark::Failed);
        }
    }

    /// Hears what is written into the journal, and returns the name under which it is: who did not make the plan begins and
    /// ends no night.
    pub(super) fn tell<'a>(&self, event: &'a str, fields: &Json) -> &'a str {
        let text = |key: &str| fields[key].as_str().unwrap_or_default().to_owned();
        match event {
            "cell_started" => self.presence.say(Doing::Rendering { run: text("run"), path: text("path") }),
            "part_started" => self.presence.say(Doing::Rendering { run: text("run"), path: text("words") }),
            "cell_finished" | "part_finished" => self.presence.say(Doing::Waiting),
            "night_started" if !self.planner => return "worker_started",
            "night_finished" if !self.planner => return "worker_finished",
            _ => {}
        }
        event
    }
}
