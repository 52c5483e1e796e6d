//! The folder of one experiment: found or made, shared, and written to.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde_json::{Value as Json, json};

use super::archive::{Archive, Decode, read_json};
use super::checkpoint::{self, Turn};
use super::claim::{self, Claims};
use super::failure::{self, FailureRecord};
use super::frozen::Frozen;
use super::journal::Journal;
use super::marks::Marks;
use super::run::{RunWriter, pretty};
use super::worker::Aboard;
use super::{Host, StoreError, cell_json, crew, layout, mount, parts, plan_json, sums, utc, write};
use crate::experiment::event::{FinishedRun, History, Save};
use crate::experiment::floors::HalfImages;
use crate::experiment::parts::{Part, Piece};
use crate::experiment::plan::{Reference, ReferenceSource};
use crate::experiment::standing::{Checkpoint, Claim, Settled, Standing};
use crate::experiment::{CellRef, Plan, SinkError};
use crate::film::Image;

/// Where files are written in an experiment's folder, besides the folders of runs.
const WRITTEN: [&str; 7] = ["", "figures", "tables", "planners", "workers", "bonds", "finished"];

/// An experiment's folder, in which any number of processes work at once, each on other runs.
#[derive(Debug)]
pub struct Store {
    pub(super) folder: PathBuf,
    pub(super) out: PathBuf,
    pub(super) archive: Archive,
    pub(super) journal: RefCell<Journal>,
    pub(super) claims: Claims,
    /// Where this process is one of many workers.
    pub(super) aboard: Option<Aboard>,
    /// Which slot of the checkpoints of a run is next, by run id.
    pub(super) turns: RefCell<BTreeMap<String, Turn>>,
    /// Whether the last claim found the disk full.
    pub(super) full: Cell<bool>,
    /// Shared by all who work here.
    pub(super) lock: File,
}

impl Store {
    /// Finds or makes the folder of a plan below `out`, and writes what describes it.
    ///
    /// The folder is `<name>-<first 4 digits of the plan's hash>`; where another plan has that name already, more
    /// digits are used.
    ///
    /// # Errors
    /// When nothing can be written there. That is found here, before rendering.
    pub fn open(out: &Path, plan: &Plan, decode: Decode) -> Result<Store, StoreError> {
        write::probe(out)?;
        let (folder, lock, alone) = home(out, plan)?;
        write::probe(&folder)?;
        let sweep = if alone { write::sweep_temporaries } else { write::sweep_old_temporaries };
        WRITTEN.iter().for_each(|used| sweep(&folder.join(used)));
        write::if_changed(&folder.join("plan.json"), pretty(&plan_json(plan)).as_bytes())?;
        write::if_changed(&folder.join("experiment.lua"), plan.script_text.as_bytes())?;
        let claims = Claims::new();
        // A line that two machines append at once may be lost on a file system that they share.
        let shared = mount::kind(&folder).is_some_and(|kind| mount::is_network(&kind));
        let journal = if shared { claims.own_journal(&folder)? } else { folder.join("journal.jsonl") };
        let journal = RefCell::new(Journal::open(journal)?);
        if let Err(e) = point_latest(out, &folder) {
            tracing::warn!("{} was not updated: {e}", out.join("latest").display());
        }
        if alone && let Err(e) = lock.lock_shared() {
            tracing::warn!("{} cannot be shared: {e}", folder.display());
        }
        let archive = Archive::for_experiment(out, &folder, decode);
        crew::sweep_planners(&folder);
        let turns = RefCell::default();
        let out = out.to_owned();
        let store = Store { folder, out, archive, journal, claims, aboard: None, turns, full: Cell::default(), lock };
        store.mend(plan)?;
        Ok(store)
    }

    /// Writes anew what says what the finished runs of the plan are, where that was damaged: it is known without them.
    fn mend(&self, plan: &Plan) -> Result<(), StoreError> {
        let cells = (0..plan.cells.len()).map(CellRef::Cell);
        for cell in cells.chain((0..plan.references.len()).map(CellRef::Reference)) {
            let folder = self.place(plan, cell);
            if layout::is_done(&folder) {
                self.tidy(&folder);
            }
            let path = folder.join("config.json");
            let Ok(found) = fs::read(&path) else { continue };
            let config = cell_json(plan, cell);
            let known = serde_json::from_slice::<Json>(&found).unwrap_or_default();
            // A run may be another plan's too, and a reference another experiment's, which call it otherwise.
            let same = |key: &str| known[key] == config[key];
            let ours = ["program", "experiment", "plan"].into_iter().all(same);
            if !same("identity") || !same("run") || (ours && known != config) {
                tracing::warn!("{} was damaged and is written anew", path.display());
                write::atomic(&path, pretty(&config).as_bytes())?;
            }
        }
        Ok(())
    }

    /// Removes what a process that died in the moment of finishing a run left beside its last file.
    pub(super) fn tidy(&self, folder: &Path) {
        if folder.join(claim::FILE).exists() && matches!(self.claims.take(folder), Ok(Claim::Ours)) {
            self.claims.release(folder);
        }
        if checkpoint::SLOTS.iter().any(|slot| folder.join(slot).exists()) {
            checkpoint::remove(folder);
        }
        failure::forget(folder);
    }

    /// The experiment's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Starts a run or a reference: its folder, emptied of what an unfinished run left, with its `config.json`. A run
    /// that goes on from a checkpoint, `kept` samples per pixel being measured, keeps what it has up to there.
    ///
    /// # Errors
    /// When the folder cannot be made or written.
    pub fn start(&self, plan: &Plan, cell: CellRef, kept: Option<u64>) -> Result<RunWriter, StoreError> {
        let config = cell_json(plan, cell);
        let folder = self.place(plan, cell);
        failure::forget(&folder);
        match cell {
            CellRef::Cell(i) => {
                self.archive.expect(&plan.name, &plan.cells[i].id.0, &folder);
                RunWriter::create(folder, &config, kept)
            }
            CellRef::Reference(_) => RunWriter::shared(folder, "ref.json", &config),
        }
    }

    /// Records that a run failed: the reason, with the last lines of its log, and what it was to be.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn fail(&self, plan: &Plan, cell: CellRef, reason: &str) -> Result<(), StoreError> {
        let folder = self.place(plan, cell);
        write::if_changed(&folder.join("config.json"), pretty(&cell_json(plan, cell)).as_bytes())?;
        failure::record(&folder, &plan.id(cell).0, reason)
    }

    /// Why the last try of a run failed, if it did and the run is not done since.
    pub fn failure(&self, plan: &Plan, cell: CellRef) -> Option<FailureRecord> {
        failure::read(&self.place(plan, cell))
    }

    /// The folder of a run or a reference, whether or not it is there.
    pub(super) fn place(&self, plan: &Plan, cell: CellRef) -> PathBuf {
        match cell {
            CellRef::Cell(i) => layout::run_folder(&self.folder, &plan.cells[i]),
            CellRef::Reference(i) => layout::reference_folder(&self.out, &plan.references[i].id),
        }
    }

    /// The folder of what one process at a time works on, and the name that its checkpoints bear.
    fn piece(&self, plan: &Plan, piece: Piece) -> (PathBuf, String) {
        let part = match piece {
            Piece::Run(_) => None,
            Piece::Part(part) => stem_of(plan, &part).map(|stem| (parts::folder(&self.out, stem, &part), stem, part)),
        };
        match part {
            Some((folder, stem, part)) => (folder, parts::name(stem, &part)),
            None => (self.place(plan, piece.cell()), plan.id(piece.cell()).0.clone()),
        }
    }

    /// Keeps the sums of a part of a reference that is done.
    ///
    /// # Errors
    /// When they cannot be written.
    pub fn keep_part(&self, plan: &Plan, part: &Part, kept: &Checkpoint) -> Result<(), StoreError> {
        stem_of(plan, part).map_or(Ok(()), |stem| parts::keep(&self.out, stem, part, kept))
    }

    /// Writes a file of the experiment whole: `summary.csv`, `figures/convergence.svg`.
    ///
    /// # Errors
    /// When it cannot be written; nothing new is then left under its name.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        write::if_changed(&self.folder.join(name), bytes)
    }

    /// Writes a further file into the folder of a reference that is there.
    ///
    /// # Errors
    /// When it cannot be written; nothing new is then left under its name.
    pub fn write_reference(&self, plan: &Plan, reference: usize, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        let folder = layout::reference_folder(&self.out, &plan.references[reference].id);
        write::if_changed(&folder.join(name), bytes)
    }

    /// Copies an image file that serves as a reference into the folder of references, with what is known of where it comes
    /// from, so that who looks at the night elsewhere has it too. What is there already stays.
    ///
    /// # Errors
    /// When it cannot be read or written.
    pub fn import(&self, plan: &Plan, reference: usize) -> Result<(), StoreError> {
        let ReferenceSource::File { file, source } = &plan.references[reference].source else { return Ok(()) };
        let folder = self.place(plan, CellRef::Reference(reference));
        if folder.join("ref.json").is_file() {
            return Ok(());
        }
        let bytes = fs::read(file).map_err(|e| StoreError::io("read", file, &e))?;
        let writer = RunWriter::shared(folder, "ref.json", &cell_json(plan, CellRef::Reference(reference)))?;
        writer.write(&layout::imported(file), &bytes)?;
        writer.finish(&json!({
            "run": plan.references[reference].id.0,
            "kind": "file",
            "imported_from": fs::canonicalize(file).unwrap_or_else(|_| file.clone()).display().to_string(),
            "blake3": blake3::hash(&bytes).to_hex().to_string(),
            "made_by": source,
            "noise": "unknown",
            "finished": utc(SystemTime::now()),
        }))
    }

    /// Records the machine and the command in `env.json`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_env(&self) -> Result<(), StoreError> {
        write::atomic(&self.folder.join("env.json"), pretty(&Host::here().env_json()).as_bytes())
    }

    /// Leaves in the folder what workers on other machines need, and lets what failed be tried again.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn freeze(&self, frozen: &Frozen) -> Result<(), StoreError> {
        Marks::new(&self.folder).forget_failures();
        frozen.write(&self.folder)
    }

    /// Appends a line to the journal: the date, the event, and the fields of an object.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn journal(&self, event: &str, fields: &Json) -> Result<(), StoreError> {
        let event = self.aboard.as_ref().map_or(event, |aboard| aboard.tell(event, fields));
        self.journal.borrow_mut().append(event, fields)
    }
}

impl Store {
    /// What came of asking for a claim. One that finds no space is nobody's for now, and is asked for again, as is one that
    /// another process holds.
    pub(super) fn with_space(&self, claim: Result<Claim, StoreError>) -> Result<Claim, SinkError> {
        match claim {
            Err(error) if error.is_full() => {
                if !self.full.replace(true) {
                    tracing::error!("the disk is full, and the night waits for space: {error}");
                }
                Ok(Claim::Theirs("none that could be claimed on a full disk".to_owned()))
            }
            claim => {
                if self.full.replace(false) {
                    tracing::info!("there is space again; the night goes on");
                }
                claim.map_err(|e| SinkError(e.to_string()))
            }
        }
    }
}

impl History for Store {
    fn done(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun> {
        self.archive.done(plan, cell)
    }

    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        self.archive.image(plan, reference)
    }

    fn noise(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        self.archive.noise(plan, reference)
    }

    fn halves(&self, plan: &Plan, reference: usize) -> Result<Option<HalfImages>, SinkError> {
        self.archive.halves(plan, reference)
    }

    fn settled(&self, plan: &Plan, cell: CellRef) -> Option<Settled> {
        self.aboard.as_ref()?.settled(plan, cell, &self.place(plan, cell))
    }

    fn claim(&self, plan: &Plan, piece: Piece) -> Result<Claim, SinkError> {
        let apart = self.aboard.as_ref().and_then(|aboard| aboard.apart(plan, piece.cell()).transpose());
        let place = self.piece(plan, piece).0;
        let apart = apart.map(|claim| claim.map_err(|e| StoreError::io("bind a comparison for", &place, &e)));
        self.with_space(apart.unwrap_or_else(|| self.claims.take(&place)))
    }

    fn holds(&self, plan: &Plan, piece: Piece) -> bool {
        self.claims.holds(&self.piece(plan, piece).0)
    }

    fn release(&self, plan: &Plan, piece: Piece) {
        let (place, _) = self.piece(plan, piece);
        if let (Some(aboard), Piece::Run(cell)) = (&self.aboard, piece) {
            aboard.mark(plan, cell, &place);
        }
        self.claims.release(&place);
        if let Piece::Part(_) = piece {
            parts::tidy(&place);
        }
    }

    fn beginning(&self, plan: &Plan, reference: usize, most: u64) -> Option<Checkpoint> {
        sums::load(&self.out, plan.references.get(reference)?.stem()?, most)
    }

    fn keep_sums(&self, plan: &Plan, reference: usize, standing: &Standing, save: Save<'_>) -> Result<bool, SinkError> {
        let Some(stem) = plan.references.get(reference).and_then(Reference::stem) else { return Ok(false) };
        sums::keep(&self.out, stem, standing, save).map_err(|e| SinkError(e.to_string()))
    }

    fn checkpoint(&self, plan: &Plan, piece: Piece) -> Option<Checkpoint> {
        let (place, name) = self.piece(plan, piece);
        let (found, turn, damaged) = checkpoint::load(&place, &name);
        self.turns.borrow_mut().insert(name, turn);
        for path in damaged {
            let rest = if found.is_some() { "the one before it counts" } else { "its run starts again" };
            tracing::warn!("{} is damaged: {rest}", path.display());
        }
        found
    }

    fn keep(&self, plan: &Plan, piece: Piece, standing: &Standing, save: Save<'_>) -> Result<bool, SinkError> {
        let (place, name) = self.piece(plan, piece);
        let mut turns = self.turns.borrow_mut();
        let turn = turns.entry(name.clone()).or_default();
        checkpoint::save(&place, &name, turn, standing, save).map_err(|e| SinkError(e.to_string()))
    }

    fn parts_there(&self, plan: &Plan, all: &[Part]) -> BTreeSet<usize> {
        let stem = all.first().and_then(|part| stem_of(plan, part));
        stem.map_or_else(BTreeSet::new, |stem| parts::there(&self.out, stem, all))
    }

    fn part(&self, plan: &Plan, part: &Part) -> Option<Checkpoint> {
        parts::load(&self.out, stem_of(plan, part)?, part)
    }

    fn joined(&self, plan: &Plan, all: &[Part]) -> Option<Checkpoint> {
        parts::joined(&self.out, stem_of(plan, all.first()?)?, all)
    }

    fn keep_joined(&self, plan: &Plan, all: &[Part], ground: Option<&Checkpoint>) -> Result<(), SinkError> {
        let Some(stem) = all.first().and_then(|part| stem_of(plan, part)) else { return Ok(()) };
        parts::keep_joined(&self.out, stem, all, ground).map_err(|e| SinkError(e.to_string()))
    }
}

/// The stem of the reference that a part is of.
fn stem_of<'a>(plan: &'a Plan, part: &Part) -> Option<&'a str> {
    plan.references.get(part.reference)?.stem()
}

/// Whose folder this is, as far as it says.
enum Owner {
    /// Nobody's: it is new, or was abandoned before its plan was written.
    Nobody,
    /// This plan's.
    Us,
    /// Another plan's, or somebody's files.
    Other,
}

fn owner(folder: &Path, hash: &str) -> Owner {
    match read_json(&folder.join("plan.json")) {
        Some(plan) if plan["hash"].as_str() == Some(hash) => Owner::Us,
        // What is not whole does not say whose it is, but any run does.
        plan => match layout::any_run_below(&folder.join("runs")).and_then(|run| read_json(&run.join("config.json"))) {
            Some(config) if config["plan"].as_str() == Some(hash) => Owner::Us,
            None if plan.is_none() && !folder.join("runs").exists() => Owner::Nobody,
            _ => Owner::Other,
        },
    }
}

/// The folder and its lock, with as few digits of the hash as are free, and whether nobody else works in it. The lock is
/// then exclusive, and to be shared once the folder is in order.
fn home(out: &Path, plan: &Plan) -> Result<(PathBuf, File, bool), StoreError> {
    let mut digits = layout::HASH_DIGITS;
    loop {
        let folder = layout::experiment_folder(out, &plan.name, &plan.hash, digits);
        // With every digit the name is this plan's alone; it can only be damaged, and is then made whole.
        let last = digits >= plan.hash.len();
        let taken = |folder: &Path| matches!(owner(folder, &plan.hash), Owner::Other) && !last;
        if !taken(&folder) {
            fs::create_dir_all(&folder).map_err(|e| StoreError::unwritable(&folder, &e))?;
            let (lock, alone) = lock(&folder)?;
            // Between the look and the lock, another process may have moved in.
            if !taken(&folder) {
                return Ok((folder, lock, alone));
            }
        }
        digits += 1;
    }
}

impl Drop for Store {
    /// Removes what died here while others worked: the last to leave finds nobody else.
    fn drop(&mut self) {
        // Both are of no use where there are no locks.
        if self.lock.unlock().is_ok() && self.lock.try_lock().is_ok() {
            WRITTEN.iter().for_each(|used| write::sweep_temporaries(&self.folder.join(used)));
        }
    }
}

/// The lock of a folder: exclusive and true if nobody has it, shared with those who do otherwise.
pub(super) fn lock(folder: &Path) -> Result<(File, bool), StoreError> {
    let path = folder.join("lock");
    let unwritable = |e: &std::io::Error| StoreError::unwritable(&path, e);
    let file = OpenOptions::new()
        .create(true)
        .read(true)
        .write(true)
        .truncate(false)
        .open(&path)
        .map_err(|e| unwritable(&e))?;
    let alone = match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => {
            // Whoever has it alone only puts the folder in order.
            file.lock_shared().map_err(|e| unwritable(&e))?;
            false
        }
        // Some network file systems have no locks; the night is worth more than the guard.
        Err(TryLockError::Error(e)) => {
            tracing::warn!("{} cannot be locked: {e}", path.display());
            false
        }
    };
    Ok((file, alone))
}

/// Points `out/latest` at the folder: a link where there are links, a text file with the name elsewhere.
fn point_latest(out: &Path, folder: &Path) -> std::io::Result<()> {
    let latest = out.join("latest");
    let name = folder.file_name().unwrap_or_default();
    #[cfg(unix)]
    {
        if fs::read_link(&latest).is_ok_and(|old| old.as_os_str() == name) {
            return Ok(());
        }
        let beside = out.join(format!(".lumbre-latest-{}.tmp", std::process::id()));
        std::os::unix::fs::symlink(name, &beside)?;
        fs::rename(&beside, &latest).inspect_err(|_| {
            // The link beside must not stay; that it could not replace what is there is what the caller hears.
            let _ = fs::remove_file(&beside);
        })
    }
    #[cfg(not(unix))]
    fs::write(latest, name.as_encoded_bytes())
}
