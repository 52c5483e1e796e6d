//! Selection of the folder of a plan, its lock, and the `latest` link.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::path::{Path, PathBuf};

use crate::experiment::Plan;
use crate::store::read::night_reader::with_writer;
use crate::store::schema::plan::PlanFile;
use crate::store::schema::run::ConfigFile;
use crate::store::schema::{Problem, StoredFile};
use crate::store::{StoreError, layout, regular_file};

/// Plan that a folder belongs to, compared with the plan at hand.
enum FolderPlan {
    /// The folder is new, or was abandoned before its plan was written.
    None,
    /// The folder belongs to this plan.
    Same,
    /// The folder belongs to another plan, or holds other files.
    Other,
}

/// Compares the plan of a folder with the plan of this hash.
///
/// # Errors
/// When another version of the program wrote the folder.
fn plan_of_folder(folder: &Path, hash: &str) -> Result<FolderPlan, StoreError> {
    let plan = PlanFile::read(folder);
    if let Err(error) = &plan
        && let Problem::OtherVersion { .. } = error.problem
    {
        return Err(with_writer(error.clone(), folder).into());
    }
    // A damaged `plan.json` does not identify the plan, but any run does.
    let run_plan = || {
        let run = layout::any_run_below(&folder.join("runs"))?;
        ConfigFile::read(&run).ok()?.plan
    };
    Ok(match plan {
        Ok(plan) if plan.hash == hash => FolderPlan::Same,
        plan => match run_plan() {
            Some(found) if found == hash => FolderPlan::Same,
            None if plan.is_err() && !folder.join("runs").exists() => FolderPlan::None,
            _ => FolderPlan::Other,
        },
    })
}

/// Finds or creates the folder of a plan, with as few digits of the hash as are free, and locks it.
/// The `bool` is whether no other process works there; the lock is then exclusive, and the caller
/// shares it once the folder is in order.
pub(super) fn find_or_create(out: &Path, plan: &Plan) -> Result<(PathBuf, File, bool), StoreError> {
    let mut digits = layout::HASH_DIGITS;
    loop {
        let folder = layout::experiment_folder(out, &plan.name, &plan.hash, digits);
        // With all digits the name belongs to this plan alone; a damaged folder is then repaired.
        let last = digits >= plan.hash.len();
        let taken = |folder: &Path| -> Result<bool, StoreError> {
            let found = plan_of_folder(folder, &plan.hash)?;
            Ok(matches!(found, FolderPlan::Other) && !last)
        };
        if !taken(&folder)? {
            fs::create_dir_all(&folder).map_err(|e| StoreError::unwritable(&folder, &e))?;
            let (lock, alone) = lock_folder(&folder)?;
            // Another process may have occupied the folder between the check and the lock.
            if !taken(&folder)? {
                return Ok((folder, lock, alone));
            }
        }
        digits += 1;
    }
}

/// Opens and locks the lock file of a folder. The `bool` is whether the lock is exclusive;
/// otherwise it is shared with other processes.
pub(crate) fn lock_folder(folder: &Path) -> Result<(File, bool), StoreError> {
    let path = folder.join("lock");
    let unwritable = |e: &std::io::Error| StoreError::unwritable(&path, e);
    let file = regular_file::open_with(
        OpenOptions::new()
            .create(true)
            .read(true)
            .write(true)
            .truncate(false),
        &path,
    )
    .map_err(|e| unwritable(&e))?;
    let alone = match file.try_lock() {
        Ok(()) => true,
        Err(TryLockError::WouldBlock) => {
            // An exclusive owner only puts the folder in order, so waiting is short.
            file.lock_shared().map_err(|e| unwritable(&e))?;
            false
        }
        // Some network file systems have no locks; the night runs without them.
        Err(TryLockError::Error(e)) => {
            tracing::warn!("cannot lock {}: {e}", path.display());
            false
        }
    };
    Ok((file, alone))
}

/// Points `out/latest` at the folder: with a link, or with a text file on systems without links.
pub(super) fn point_latest(out: &Path, folder: &Path) -> std::io::Result<()> {
    let latest = out.join("latest");
    let name = folder.file_name().unwrap_or_default();
    #[cfg(unix)]
    {
        if fs::read_link(&latest).is_ok_and(|old| old.as_os_str() == name) {
            return Ok(());
        }
        let temporary = out.join(format!(".lumbre-latest-{}.tmp", std::process::id()));
        std::os::unix::fs::symlink(name, &temporary)?;
        fs::rename(&temporary, &latest).inspect_err(|_| {
            // The temporary link must not stay. The caller receives the error of the rename.
            let _ = fs::remove_file(&temporary);
        })
    }
    #[cfg(not(unix))]
    fs::write(latest, name.as_encoded_bytes())
}
