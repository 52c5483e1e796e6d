//! The folder of one experiment: found or created, shared between processes, and written to.

use std::cell::{Cell, RefCell};
use std::collections::{BTreeMap, BTreeSet};
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::checkpoint::{self, SlotCursor};
use super::failure;
use super::journal::Journal;
use super::plan_folder::{find_or_create, point_latest};
use super::run_folder::RunWriter;
use super::{atomic, reference_sums};
use crate::experiment::event::{FinishedRun, History, SaveState};
use crate::experiment::noise_floor::HalfImages;
use crate::experiment::plan::{Reference, ReferenceSource};
use crate::experiment::run_progress::{Checkpoint, Claim, ReportedOutcome, RunProgress};
use crate::experiment::shards::{Shard, WorkUnit};
use crate::experiment::{CellRef, Plan, SinkError};
use crate::paths::SCRIPT_COPY;
use crate::store::lock::claim::{self, Claims};
use crate::store::lock::{device_affinity, filesystem_kind};
use crate::store::read::archive::{Archive, Decode};
use crate::store::schema::journal::{self, JournalEvent};
use crate::store::schema::plan::PlanSnapshot;
use crate::store::schema::run::{ConfigFile, DoneFile, FailedFile, ImportedReference, REFERENCE};
use crate::store::schema::{StoredFile, pretty};
use crate::store::worker::completion_markers::CompletionMarkers;
use crate::store::worker::session::WorkerSession;
use crate::store::worker::{registry, shards};
use crate::store::{Host, StoreError, config_file, layout, plan_file, utc};
use lumbre_light::film::Image;

/// Folders in an experiment's folder, besides those of runs, that files are written to.
const WRITABLE_FOLDERS: [&str; 7] = [
    "", "figures", "tables", "planners", "workers", "affinity", "finished",
];

/// An experiment's folder open for writing. Any number of processes may work in it, each on other
/// runs.
#[derive(Debug)]
pub struct Store {
    pub(crate) folder: PathBuf,
    pub(crate) out: PathBuf,
    pub(crate) archive: Archive,
    pub(crate) journal: RefCell<Journal>,
    pub(crate) claims: Claims,
    /// State of this process as one of many workers; `None` if it renders the night alone.
    pub(crate) session: Option<WorkerSession>,
    /// Positions in the alternation of checkpoint slots, by run id or shard name.
    pub(crate) slot_cursors: RefCell<BTreeMap<String, SlotCursor>>,
    /// Whether the last claim found the disk full.
    pub(crate) full: Cell<bool>,
    /// Lock file of the folder, shared by all processes that work in it.
    pub(crate) lock: File,
}

impl Store {
    /// Finds or creates the folder of a plan below `out`, and writes the files that describe the
    /// plan.
    ///
    /// The folder is `<name>-<first 4 digits of the plan's hash>`. If another plan has that name
    /// already, more digits are used.
    ///
    /// # Errors
    /// When the folder is not writable, which is detected here, before rendering.
    pub fn open(out: &Path, plan: &Plan, decode: Decode) -> Result<Store, StoreError> {
        atomic::probe(out)?;
        let (folder, lock, alone) = find_or_create(out, plan)?;
        atomic::probe(&folder)?;
        let remove = if alone {
            atomic::remove_temporaries
        } else {
            atomic::remove_old_temporaries
        };
        WRITABLE_FOLDERS
            .iter()
            .for_each(|name| remove(&folder.join(name)));
        plan_file(plan).write(&folder)?;
        atomic::write_if_changed(&folder.join(SCRIPT_COPY), plan.script_text.as_bytes())?;
        let claims = Claims::new();
        // On a network file system, lines that two machines append at once may be lost.
        let shared =
            filesystem_kind::detect(&folder).is_some_and(|kind| filesystem_kind::is_network(&kind));
        let journal = if shared {
            claims.own_journal(&folder)?
        } else {
            folder.join(journal::FILE)
        };
        let journal = RefCell::new(Journal::open(journal)?);
        if let Err(e) = point_latest(out, &folder) {
            tracing::warn!("cannot update {}: {e}", out.join("latest").display());
        }
        if alone && let Err(e) = lock.lock_shared() {
            tracing::warn!("cannot take the shared lock of {}: {e}", folder.display());
        }
        let archive = Archive::for_experiment(out, &folder, decode);
        registry::remove_dead_planners(&folder);
        let slot_cursors = RefCell::default();
        let out = out.to_owned();
        let store = Store {
            folder,
            out,
            archive,
            journal,
            claims,
            session: None,
            slot_cursors,
            full: Cell::default(),
            lock,
        };
        store.repair_configs(plan)?;
        device_affinity::remove_damaged(&store.folder);
        let stems: BTreeSet<&str> = plan.references.iter().filter_map(Reference::stem).collect();
        for stem in stems {
            reference_sums::remove_damaged(&store.out, stem);
        }
        Ok(store)
    }

    /// Rewrites the damaged `config.json` files of the plan's runs, which the plan determines, and
    /// those that are missing beside results. Removes leftovers beside finished runs.
    fn repair_configs(&self, plan: &Plan) -> Result<(), StoreError> {
        let cells = (0..plan.cells.len()).map(CellRef::Cell);
        for cell in cells.chain((0..plan.references.len()).map(CellRef::Reference)) {
            let folder = self.run_folder(plan, cell);
            let is_done = layout::is_done(&folder);
            if is_done {
                self.remove_leftovers(&folder);
            }
            let path = folder.join(ConfigFile::NAME);
            if !is_done && !path.exists() {
                continue;
            }
            let config = config_file(plan, cell);
            let stored = ConfigFile::read(&folder);
            let intact = stored.is_ok_and(|stored| is_config(&stored, &config));
            if !intact {
                tracing::warn!("{} was damaged and has been rewritten", path.display());
                config.write(&folder)?;
            }
        }
        Ok(())
    }

    /// Removes what a process left that died after writing a run's last file, or while it tried to
    /// claim the run: claim, checkpoints, failure record and temporary files. Nothing is removed
    /// while a process works in the folder: its run may be finished in the folder of another night.
    pub(crate) fn remove_leftovers(&self, folder: &Path) {
        let is_leftover = |entry: fs::DirEntry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            [claim::FILE, FailedFile::NAME].contains(&&*name)
                || checkpoint::SLOTS.contains(&&*name)
                || atomic::is_temporary(&name)
        };
        let mut entries = fs::read_dir(folder).into_iter().flatten().flatten();
        if !entries.any(is_leftover)
            || self.claims.holds(folder)
            || !matches!(self.claims.acquire(folder), Ok(Claim::Granted))
        {
            return;
        }
        atomic::remove_temporaries(folder);
        checkpoint::remove(folder);
        failure::remove(folder);
        self.claims.release(folder);
    }

    /// Folder of the experiment.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Prepares the folder of a run or a reference and writes its `config.json`. Results of an
    /// unfinished attempt are removed. A run that resumes from a checkpoint keeps its log, and its
    /// snapshots up to `resumed_samples` samples per pixel.
    ///
    /// # Errors
    /// When the folder cannot be created or written.
    pub fn start(
        &self,
        plan: &Plan,
        cell: CellRef,
        resumed_samples: Option<u64>,
    ) -> Result<RunWriter, StoreError> {
        let config = config_file(plan, cell);
        let folder = self.run_folder(plan, cell);
        failure::remove(&folder);
        match cell {
            CellRef::Cell(i) => {
                self.archive
                    .register(&plan.name, &plan.cells[i].id.0, &folder);
                RunWriter::create(folder, &config, resumed_samples)
            }
            CellRef::Reference(_) => RunWriter::shared(folder, REFERENCE, &config),
        }
    }

    /// Records that a run failed: the reason, the last lines of its log, and its `config.json`.
    ///
    /// # Errors
    /// When the record cannot be written.
    pub fn record_failure(
        &self,
        plan: &Plan,
        cell: CellRef,
        reason: &str,
    ) -> Result<(), StoreError> {
        let folder = self.run_folder(plan, cell);
        config_file(plan, cell).write(&folder)?;
        failure::record(&folder, &plan.id(cell).0, reason)
    }

    /// Record of the last attempt of a run, if it failed and the run is not finished since.
    pub fn failure(&self, plan: &Plan, cell: CellRef) -> Option<FailedFile> {
        failure::read(&self.run_folder(plan, cell))
    }

    /// Folder of a run or a reference, which need not exist.
    pub(crate) fn run_folder(&self, plan: &Plan, cell: CellRef) -> PathBuf {
        match cell {
            CellRef::Cell(i) => layout::run_folder(&self.folder, plan, i),
            CellRef::Reference(i) => layout::reference_folder(&self.out, &plan.references[i].id),
        }
    }

    /// Folder of a work unit, and the name in its checkpoints.
    fn unit_folder(&self, plan: &Plan, unit: WorkUnit) -> (PathBuf, String) {
        let shard = match unit {
            WorkUnit::Run(_) => None,
            WorkUnit::Shard(shard) => stem_of(plan, &shard)
                .map(|stem| (shards::folder(&self.out, stem, &shard), stem, shard)),
        };
        match shard {
            Some((folder, stem, shard)) => (folder, shards::checkpoint_name(stem, &shard)),
            None => (
                self.run_folder(plan, unit.cell()),
                plan.id(unit.cell()).0.clone(),
            ),
        }
    }

    /// Stores the sums of a finished reference shard.
    ///
    /// # Errors
    /// When the sums cannot be written.
    pub fn save_shard(
        &self,
        plan: &Plan,
        shard: &Shard,
        sums: &Checkpoint,
    ) -> Result<(), StoreError> {
        stem_of(plan, shard).map_or(Ok(()), |stem| shards::save(&self.out, stem, shard, sums))
    }

    /// Writes a file of the experiment atomically, such as `summary.csv` or
    /// `figures/convergence.svg`.
    ///
    /// # Errors
    /// When it cannot be written; an existing file is then unchanged.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        atomic::write_if_changed(&self.folder.join(name), bytes)
    }

    /// Writes an additional file into the folder of a finished reference.
    ///
    /// # Errors
    /// When it cannot be written; an existing file is then unchanged.
    pub fn write_reference(
        &self,
        plan: &Plan,
        reference: usize,
        name: &str,
        bytes: &[u8],
    ) -> Result<(), StoreError> {
        let folder = layout::reference_folder(&self.out, &plan.references[reference].id);
        atomic::write_if_changed(&folder.join(name), bytes)
    }

    /// Copies an image file that serves as a reference into the folder of references, with its
    /// origin, so that the night's folder can be read on other machines. Does nothing if the copy
    /// exists.
    ///
    /// # Errors
    /// When the image cannot be read or the copy cannot be written.
    pub fn import_reference(&self, plan: &Plan, reference: usize) -> Result<(), StoreError> {
        let ReferenceSource::File { file, source } = &plan.references[reference].source else {
            return Ok(());
        };
        let folder = self.run_folder(plan, CellRef::Reference(reference));
        if folder.join(REFERENCE).is_file() {
            return Ok(());
        }
        let bytes = fs::read(file).map_err(|e| StoreError::io("read", file, &e))?;
        let config = config_file(plan, CellRef::Reference(reference));
        let writer = RunWriter::shared(folder, REFERENCE, &config)?;
        writer.write(&layout::imported_file_name(file), &bytes)?;
        let origin = fs::canonicalize(file).unwrap_or_else(|_| file.clone());
        writer.finish(&DoneFile::Imported(Box::new(ImportedReference {
            run: plan.references[reference].id.0.clone(),
            imported_from: origin.display().to_string(),
            blake3: blake3::hash(&bytes).to_hex().to_string(),
            made_by: source.clone(),
            noise: "unknown".to_owned(),
            finished: utc(SystemTime::now()),
            ..ImportedReference::default()
        })))
    }

    /// Records the machine and the command in `env.json`.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_env(&self) -> Result<(), StoreError> {
        Host::detect().env_file().write(&self.folder)
    }

    /// Writes the plan snapshot that workers on other machines need, and marks failed runs for a
    /// retry.
    ///
    /// # Errors
    /// When the snapshot cannot be written.
    pub fn write_plan_snapshot(&self, snapshot: &PlanSnapshot) -> Result<(), StoreError> {
        CompletionMarkers::new(&self.folder).remove_failures();
        StoredFile::write(snapshot, &self.folder)
    }

    /// Appends an event to the journal.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn journal(&self, event: JournalEvent) -> Result<(), StoreError> {
        let event = match &self.session {
            Some(session) => session.observe_event(event),
            None => event,
        };
        self.journal.borrow_mut().append(event)
    }
}

impl Store {
    /// Converts the result of a claim. If the disk is full, the run counts as held by another
    /// process, so that the caller retries the claim later.
    pub(crate) fn wait_if_disk_full(
        &self,
        claim: Result<Claim, StoreError>,
    ) -> Result<Claim, SinkError> {
        match claim {
            Err(error) if error.is_full() => {
                if !self.full.replace(true) {
                    tracing::error!("the disk is full; the night waits for free space: {error}");
                }
                Ok(Claim::HeldBy(
                    "no process (the disk is too full for a claim)".to_owned(),
                ))
            }
            claim => {
                if self.full.replace(false) {
                    tracing::info!("there is space again; the night continues");
                }
                claim.map_err(|e| SinkError(e.to_string()))
            }
        }
    }
}

impl History for Store {
    fn finished_run(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun> {
        self.archive.finished_run(plan, cell)
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

    fn reported_outcome(&self, plan: &Plan, cell: CellRef) -> Option<ReportedOutcome> {
        self.session
            .as_ref()?
            .reported_outcome(plan, cell, &self.run_folder(plan, cell))
    }

    fn claim(&self, plan: &Plan, unit: WorkUnit) -> Result<Claim, SinkError> {
        let folder = self.unit_folder(plan, unit).0;
        let refusal = match &self.session {
            Some(session) => session
                .affinity_refusal(plan, unit.cell())
                .map_err(|e| StoreError::io("set the device of a comparison for", &folder, &e)),
            None => Ok(None),
        };
        let claim = match refusal {
            Ok(Some(refusal)) => Ok(refusal),
            Ok(None) => self.claims.acquire(&folder),
            Err(error) => Err(error),
        };
        self.wait_if_disk_full(claim)
    }

    fn holds_claim(&self, plan: &Plan, unit: WorkUnit) -> bool {
        self.claims.holds(&self.unit_folder(plan, unit).0)
    }

    fn release(&self, plan: &Plan, unit: WorkUnit) {
        let (folder, name) = self.unit_folder(plan, unit);
        self.slot_cursors.borrow_mut().remove(&name);
        if let (Some(session), WorkUnit::Run(cell)) = (&self.session, unit) {
            session.write_marker(plan, cell, &folder);
        }
        self.claims.release(&folder);
        if let WorkUnit::Shard(_) = unit {
            shards::remove_if_empty(&folder);
        }
    }

    fn shorter_reference(&self, plan: &Plan, reference: usize, most: u64) -> Option<Checkpoint> {
        reference_sums::load(&self.out, plan.references.get(reference)?.stem()?, most)
    }

    fn save_sums(
        &self,
        plan: &Plan,
        reference: usize,
        progress: &RunProgress,
        state: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        let Some(stem) = plan.references.get(reference).and_then(Reference::stem) else {
            return Ok(false);
        };
        reference_sums::save(&self.out, stem, progress, state).map_err(|e| SinkError(e.to_string()))
    }

    fn checkpoint(&self, plan: &Plan, unit: WorkUnit) -> Option<Checkpoint> {
        let (folder, name) = self.unit_folder(plan, unit);
        let (found, cursor, damaged) = checkpoint::load(&folder, &name);
        self.slot_cursors.borrow_mut().insert(name, cursor);
        for path in damaged {
            let consequence = if found.is_some() {
                "the older checkpoint is used"
            } else {
                "the run starts again"
            };
            tracing::warn!("{} is damaged; {consequence}", path.display());
        }
        found
    }

    fn save_checkpoint(
        &self,
        plan: &Plan,
        unit: WorkUnit,
        progress: &RunProgress,
        state: SaveState<'_>,
    ) -> Result<bool, SinkError> {
        let (folder, name) = self.unit_folder(plan, unit);
        let mut slot_cursors = self.slot_cursors.borrow_mut();
        let cursor = slot_cursors.entry(name.clone()).or_default();
        checkpoint::save(&folder, &name, cursor, progress, state)
            .map_err(|e| SinkError(e.to_string()))
    }

    fn available_shards(&self, plan: &Plan, all: &[Shard]) -> BTreeSet<usize> {
        let stem = all.first().and_then(|shard| stem_of(plan, shard));
        stem.map_or_else(BTreeSet::new, |stem| {
            shards::available(&self.out, stem, all)
        })
    }

    fn shard(&self, plan: &Plan, shard: &Shard) -> Option<Checkpoint> {
        shards::load(&self.out, stem_of(plan, shard)?, shard)
    }

    fn joined_shards(&self, plan: &Plan, all: &[Shard]) -> Option<Checkpoint> {
        shards::load_joined(&self.out, stem_of(plan, all.first()?)?, all)
    }

    fn save_joined_shards(
        &self,
        plan: &Plan,
        all: &[Shard],
        joined: Option<&Checkpoint>,
    ) -> Result<(), SinkError> {
        let Some(stem) = all.first().and_then(|shard| stem_of(plan, shard)) else {
            return Ok(());
        };
        shards::save_joined(&self.out, stem, all, joined).map_err(|e| SinkError(e.to_string()))
    }
}

/// Whether a stored `config.json` is that of a run. Runs may be shared with other plans, and
/// references with other experiments, which name them otherwise.
fn is_config(stored: &ConfigFile, config: &ConfigFile) -> bool {
    let same_plan = (&stored.program, &stored.experiment, &stored.plan)
        == (&config.program, &config.experiment, &config.plan);
    // Compared as text, in which numbers that are not finite are strings.
    if same_plan {
        return pretty(stored) == pretty(config);
    }
    (&stored.run, &stored.plan) == (&config.run, &config.plan)
        && pretty(&stored.identity) == pretty(&config.identity)
}

/// Stem of the reference that a shard belongs to.
fn stem_of<'a>(plan: &'a Plan, shard: &Shard) -> Option<&'a str> {
    plan.references.get(shard.reference)?.stem()
}

impl Drop for Store {
    /// Removes temporary files of processes that died while others worked; only the last process
    /// does.
    fn drop(&mut self) {
        // Without file locks, both calls fail and nothing is removed.
        if self.lock.unlock().is_ok() && self.lock.try_lock().is_ok() {
            WRITABLE_FOLDERS
                .iter()
                .for_each(|name| atomic::remove_temporaries(&self.folder.join(name)));
        }
    }
}
