//! The folder of one experiment: found or made, locked, and written to.

use std::cell::RefCell;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{Archive, Decode, read_json};
use super::journal::Journal;
use super::run::{RunWriter, pretty};
use super::{Host, StoreError, cell_json, layout, plan_json, write};
use crate::experiment::event::{FinishedRun, History};
use crate::experiment::floors::HalfImages;
use crate::experiment::{CellRef, Plan, SinkError};
use crate::film::Image;

/// An experiment's folder, held by this process alone.
#[derive(Debug)]
pub struct Store {
    folder: PathBuf,
    out: PathBuf,
    archive: Archive,
    journal: RefCell<Journal>,
    /// Holding it is holding the lock.
    _lock: File,
}

impl Store {
    /// Finds or makes the folder of a plan below `out`, locks it, and writes what describes it.
    ///
    /// The folder is `<name>-<first 4 digits of the plan's hash>`; where another plan has that name already, more
    /// digits are used.
    ///
    /// # Errors
    /// When nothing can be written there, or another process holds the folder. Both are found here, before rendering.
    pub fn open(out: &Path, plan: &Plan, decode: Decode) -> Result<Store, StoreError> {
        write::probe(out)?;
        let (folder, lock) = claim(out, plan)?;
        write::probe(&folder)?;
        for used in ["", "figures", "tables"] {
            write::sweep_temporaries(&folder.join(used));
        }
        write::if_changed(&folder.join("plan.json"), pretty(&plan_json(plan)).as_bytes())?;
        write::if_changed(&folder.join("experiment.lua"), plan.script_text.as_bytes())?;
        let journal = RefCell::new(Journal::open(folder.join("journal.jsonl"))?);
        if let Err(e) = point_latest(out, &folder) {
            tracing::warn!("{} was not updated: {e}", out.join("latest").display());
        }
        let archive = Archive::for_experiment(out, &folder, decode);
        Ok(Store { folder, out: out.to_owned(), archive, journal, _lock: lock })
    }

    /// The experiment's folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Starts a run or a reference: its folder, emptied of what an unfinished run left, with its `config.json`.
    ///
    /// # Errors
    /// When the folder cannot be made or written.
    pub fn start(&self, plan: &Plan, cell: CellRef) -> Result<RunWriter, StoreError> {
        let config = cell_json(plan, cell);
        match cell {
            CellRef::Cell(i) => {
                let folder = layout::run_folder(&self.folder, &plan.cells[i]);
                self.archive.expect(&plan.name, &plan.cells[i].id.0, &folder);
                RunWriter::create(folder, &config)
            }
            CellRef::Reference(i) => {
                let folder = layout::reference_folder(&self.out, &plan.references[i].id);
                RunWriter::shared(folder, "ref.json", &config)
            }
        }
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

    /// Records the machine in `env.json`; called when a night really renders something.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_env(&self) -> Result<(), StoreError> {
        write::atomic(&self.folder.join("env.json"), pretty(&Host::here().env_json()).as_bytes())
    }

    /// Appends a line to the journal: the date, the event, and the fields of an object.
    ///
    /// # Errors
    /// When it cannot be written.
    pub fn journal(&self, event: &str, fields: &Json) -> Result<(), StoreError> {
        self.journal.borrow_mut().append(event, fields)
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
        Some(_) => Owner::Other,
        None if folder.join("runs").exists() => Owner::Other,
        None => Owner::Nobody,
    }
}

/// The folder and its lock, with as few digits of the hash as are free.
fn claim(out: &Path, plan: &Plan) -> Result<(PathBuf, File), StoreError> {
    let unwritable =
        |path: &Path, e: &std::io::Error| StoreError::Unwritable { path: path.to_owned(), reason: e.to_string() };
    let mut digits = layout::HASH_DIGITS;
    loop {
        let folder = layout::experiment_folder(out, &plan.name, &plan.hash, digits);
        // With every digit the name is this plan's alone; it can only be damaged, and is then made whole.
        let last = digits >= plan.hash.len();
        let taken = |folder: &Path| matches!(owner(folder, &plan.hash), Owner::Other) && !last;
        if !taken(&folder) {
            fs::create_dir_all(&folder).map_err(|e| unwritable(&folder, &e))?;
            let lock = lock(&folder)?;
            // Between the look and the lock, another process may have moved in and out again.
            if !taken(&folder) {
                return Ok((folder, lock));
            }
        }
        digits += 1;
    }
}

fn lock(folder: &Path) -> Result<File, StoreError> {
    let path = folder.join("lock");
    let unwritable = |e: &std::io::Error| StoreError::Unwritable { path: path.clone(), reason: e.to_string() };
    let mut file = OpenOptions::new()
        .create(true)
        .read(true)
        .write(true)
        .truncate(false)
        .open(&path)
        .map_err(|e| unwritable(&e))?;
    match file.try_lock() {
        Ok(()) => {}
        Err(TryLockError::WouldBlock) => {
            let holder = fs::read_to_string(&path).unwrap_or_default();
            let holder = holder.trim().parse::<u32>().map(|pid| format!(" (process {pid})")).unwrap_or_default();
            return Err(StoreError::Locked { folder: folder.to_owned(), holder });
        }
        // Some network file systems have no locks; the night is worth more than the guard.
        Err(TryLockError::Error(e)) => tracing::warn!("{} cannot be locked: {e}", path.display()),
    }
    file.set_len(0).and_then(|()| writeln!(file, "{}", std::process::id())).map_err(|e| unwritable(&e))?;
    Ok(file)
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
