//! Claims: which process works on which run.
//!
//! A claim is the file `claim` in a run's folder. It is written under a temporary name, locked, and
//! then linked to its final name if no such file exists, so that it is locked from the first
//! moment. The operating system releases the lock when the owner dies, and a process on the same
//! boot of the same machine that gets the lock takes the claim over at once. The locks of other
//! machines may be invisible, and some file systems have none. There the lease decides: the owner
//! rewrites the file every [`HEARTBEAT`], and a claim that was not written for [`LEASE`], by the
//! file system's own clock, is taken over. No machine's clock is involved.
//!
//! Without locks, several processes may find the same lease ended. One of them gets the right to
//! replace that claim, looks at it again and renames its own claim over it. Two machines can work
//! on one run only if the owner wakes up, or the one with the right is suspended, in that moment.
//! Both then write the same bytes, each file atomically, and the one that lost its claim reports it
//! at the end of the run.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use tempfile::NamedTempFile;

use super::exclusive_file::{is_file_at, persist_exclusively, replace_exclusively};
use crate::experiment::run_progress::Claim;
use crate::paths::folder_of;
use crate::store::schema::StoredFile;
use crate::store::schema::process::{ClaimFile, Owner};
use crate::store::write::atomic;
use crate::store::{StoreError, layout, regular_file};

/// Name of the claim file in a run's folder.
pub const FILE: &str = ClaimFile::NAME;
/// Interval at which an owner rewrites its claims.
pub const HEARTBEAT: Duration = Duration::from_secs(20);
/// Time without a heartbeat after which an owner on another machine counts as dead.
pub const LEASE: Duration = Duration::from_secs(120);
/// Environment variable that disables file locks with `LUMBRE_LOCKS=none`, for file systems that
/// report locks but do not implement them. Leases remain in use.
const LOCKS_VARIABLE: &str = "LUMBRE_LOCKS";
/// Maximum number of attempts to create or take over a claim that other processes keep changing.
const MAX_ATTEMPTS: usize = 100;

/// Claims held by this process.
#[derive(Debug)]
pub struct Claims {
    owner: Owner,
    held: HeldClaims,
    /// Claims of other machines that were found alive: the modification time, and when it was read.
    /// Avoids asking the file system about the same claim again and again.
    alive: Mutex<BTreeMap<PathBuf, (SystemTime, Instant)>>,
    locks: bool,
    /// Whether a thread renews the claims, and leases expire in real time.
    has_heartbeat: bool,
    /// Dropping the sender ends the heartbeat thread.
    _end: SyncSender<()>,
}

/// Held claims by run folder, shared with the heartbeat thread.
type HeldClaims = Arc<Mutex<BTreeMap<PathBuf, HeldClaim>>>;

/// An open, locked claim file and its content.
#[derive(Debug)]
struct HeldClaim {
    file: File,
    text: String,
}

/// Result of trying to lock a claim file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum LockState {
    Acquired,
    HeldElsewhere,
    /// The file system has no locks, or they are disabled.
    Unavailable,
}

impl Claims {
    /// Creates an empty set of claims and starts the thread that renews them.
    pub(crate) fn new() -> Claims {
        Claims::with_locks(std::env::var(LOCKS_VARIABLE).map_or(true, |value| value != "none"))
    }

    /// Creates an empty set of claims without locks and without a heartbeat thread. The cluster
    /// simulation keeps a thousand of them in one process.
    pub fn without_heartbeat() -> Claims {
        let (end, _) = sync_channel(0);
        Claims {
            owner: Owner::current(),
            held: Arc::default(),
            alive: Mutex::default(),
            locks: false,
            has_heartbeat: false,
            _end: end,
        }
    }

    fn with_locks(locks: bool) -> Claims {
        let owner = Owner::current();
        let held = HeldClaims::default();
        let (end, ended) = sync_channel(0);
        let shared_claims = Arc::clone(&held);
        let beat = move || {
            while ended.recv_timeout(HEARTBEAT) == Err(RecvTimeoutError::Timeout) {
                for claim in lock_mutex(&shared_claims).values_mut() {
                    // A missed heartbeat does no harm yet.
                    let _ = claim.rewrite();
                }
            }
        };
        if let Err(e) = std::thread::Builder::new()
            .name("claims".to_owned())
            .spawn(beat)
        {
            tracing::warn!(
                "cannot start the heartbeat of this process's claims: {e}; other machines may take \
                 its runs over after {} s",
                LEASE.as_secs()
            );
        }
        Claims {
            owner,
            held,
            alive: Mutex::default(),
            locks,
            has_heartbeat: true,
            _end: end,
        }
    }

    /// Identity of the process that owns the claims.
    pub fn owner(&self) -> &Owner {
        &self.owner
    }

    /// Path of a journal that only this process writes to, in the `workers` folder of an
    /// experiment, which is created.
    ///
    /// # Errors
    /// When the folder cannot be created.
    pub fn own_journal(&self, experiment: &Path) -> Result<PathBuf, StoreError> {
        let workers = experiment.join(crate::store::worker::registry::FOLDER);
        fs::create_dir_all(&workers).map_err(|e| StoreError::io("create", &workers, &e))?;
        Ok(workers.join(format!("{}.jsonl", self.owner.name())))
    }

    /// Claims the run in a folder, which is created. Claiming a run that this process holds already
    /// succeeds.
    ///
    /// # Errors
    /// When the claim can be neither read nor written.
    pub fn acquire(&self, folder: &Path) -> Result<Claim, StoreError> {
        let path = folder.join(FILE);
        if lock_mutex(&self.held).contains_key(folder) {
            return Ok(Claim::Granted);
        }
        let text = self.owner.claim_text();
        let attempt = || -> io::Result<Result<File, String>> {
            fs::create_dir_all(folder)?;
            for _ in 0..MAX_ATTEMPTS {
                if let Some(file) = self.create(folder, &path, &text)? {
                    return Ok(Ok(file));
                }
                match self.take_over(folder, &path, &text)? {
                    TakeOver::Released => {}
                    TakeOver::Acquired(file) => return Ok(Ok(file)),
                    TakeOver::Held(owner) => return Ok(Err(owner)),
                }
            }
            Ok(Err(
                "a process that changes (the claim changed at every attempt)".to_owned(),
            ))
        };
        match attempt().map_err(|e| StoreError::io("claim", &path, &e))? {
            Ok(file) => {
                lock_mutex(&self.held).insert(folder.to_owned(), HeldClaim { file, text });
                Ok(Claim::Granted)
            }
            Err(owner) => Ok(Claim::HeldBy(owner)),
        }
    }

    /// Examines an existing claim, and takes it over if its owner is dead.
    fn take_over(&self, folder: &Path, path: &Path, text: &str) -> io::Result<TakeOver> {
        let mut file =
            match regular_file::open_with(OpenOptions::new().read(true).write(true), path) {
                Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(TakeOver::Released),
                opened => opened?,
            };
        let lock = self.try_lock(&file, path);
        let content = read_all(&mut file);
        let owner = Owner::parse(&content);
        let description = owner
            .as_ref()
            .map_or_else(|| "an unknown process".to_owned(), Owner::description);
        if lock == LockState::HeldElsewhere {
            return Ok(TakeOver::Held(description));
        }
        if !is_file_at(&file, path) {
            return Ok(TakeOver::Released);
        }
        // Locks of processes on this boot of this machine are visible, so the owner is dead. A
        // living owner would have rewritten a damaged claim.
        if lock == LockState::Acquired
            && owner
                .as_ref()
                .is_none_or(|owner| owner.same_machine(&self.owner))
        {
            tracing::info!("taking over the run of {description}, which has ended");
            let mut claim = HeldClaim {
                file,
                text: text.to_owned(),
            };
            claim.rewrite()?;
            return Ok(TakeOver::Acquired(claim.file));
        }
        if !self.lease_has_ended(&file, path)? {
            return Ok(TakeOver::Held(description));
        }
        let still_ended = |there: &mut File| {
            Ok(read_all(there) == content && atomic::age(there, folder)? > LEASE)
        };
        let new = self.locked_claim(folder, path, text)?;
        let Some(file) = replace_exclusively(path, content.as_bytes(), still_ended, new)? else {
            return Ok(TakeOver::Released);
        };
        if self.has_heartbeat {
            tracing::info!(
                "taking over the run of {description}: no heartbeat for {} s",
                LEASE.as_secs()
            );
        }
        Ok(TakeOver::Acquired(file))
    }

    fn try_lock(&self, file: &File, path: &Path) -> LockState {
        if !self.locks {
            return LockState::Unavailable;
        }
        match file.try_lock() {
            Ok(()) => LockState::Acquired,
            Err(TryLockError::WouldBlock) => LockState::HeldElsewhere,
            Err(TryLockError::Error(e)) => {
                tracing::debug!("cannot lock {}: {e}", path.display());
                LockState::Unavailable
            }
        }
    }

    /// Whether a claim of another machine was not written for longer than the lease. A claim that
    /// was found alive within the last heartbeat interval, or was written since, counts as alive.
    fn lease_has_ended(&self, file: &File, path: &Path) -> io::Result<bool> {
        let written = file.metadata()?.modified()?;
        let mut alive = lock_mutex(&self.alive);
        let recent = |(seen, checked): &(SystemTime, Instant)| {
            *seen != written || checked.elapsed() < HEARTBEAT
        };
        if self.has_heartbeat && alive.get(path).is_some_and(recent) {
            if let Some((seen, _)) = alive.get_mut(path) {
                *seen = written;
            }
            return Ok(false);
        }
        let ended = atomic::age(file, folder_of(path))? > LEASE;
        if ended {
            alive.remove(path);
        } else {
            alive.insert(path.to_owned(), (written, Instant::now()));
        }
        Ok(ended)
    }

    /// Creates a claim, locked. Returns `None` if another process has one.
    fn create(&self, folder: &Path, path: &Path, text: &str) -> io::Result<Option<File>> {
        if path.exists() {
            return Ok(None);
        }
        persist_exclusively(self.locked_claim(folder, path, text)?, path)
    }

    /// Writes a claim under a temporary name, and locks it.
    fn locked_claim(&self, folder: &Path, path: &Path, text: &str) -> io::Result<NamedTempFile> {
        let mut file = atomic::temporary(folder)?;
        self.try_lock(file.as_file(), path);
        file.write_all(text.as_bytes())?;
        file.as_file().sync_data()?;
        Ok(file)
    }

    /// Whether the claim of a folder still belongs to this process.
    pub fn holds(&self, folder: &Path) -> bool {
        let held = lock_mutex(&self.held);
        let Some(claim) = held.get(folder) else {
            return false;
        };
        match fs::read_to_string(folder.join(FILE)) {
            Ok(text) => text == claim.text,
            // A vanished file is still this process's claim, unless another process held it in
            // between and finished the run.
            Err(_) => !layout::is_done(folder),
        }
    }

    /// Releases a claim. Does nothing if this process does not hold it.
    pub fn release(&self, folder: &Path) {
        let Some(claim) = lock_mutex(&self.held).remove(folder) else {
            return;
        };
        let path = folder.join(FILE);
        if is_file_at(&claim.file, &path) {
            // The file is still locked, so no other process can take it over now. If it cannot be
            // removed, it is free as soon as the lock is released.
            let _ = fs::remove_file(&path);
        }
    }
}

/// Result of examining an existing claim.
enum TakeOver {
    /// Another process released or replaced the claim meanwhile.
    Released,
    /// This process holds the claim now.
    Acquired(File),
    /// Another process holds the claim; holds its description.
    Held(String),
}

impl HeldClaim {
    fn rewrite(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(self.text.as_bytes())?;
        self.file.set_len(self.text.len() as u64)?;
        // Network file systems may buffer writes for half a minute and so delay the heartbeat.
        self.file.sync_data()
    }
}

/// Reads a file from its beginning. Returns an empty string if it cannot be read.
fn read_all(file: &mut File) -> String {
    let mut text = String::new();
    let read = file
        .seek(SeekFrom::Start(0))
        .and_then(|_| file.read_to_string(&mut text));
    if read.is_ok() { text } else { String::new() }
}

pub(crate) fn lock_mutex<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    // No data behind these mutexes is inconsistent after a panic.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use crate::store::lock::claim::*;
    use crate::store::tests::eventually;

    fn held_elsewhere(claim: Result<Claim, StoreError>) -> bool {
        matches!(claim.unwrap(), Claim::HeldBy(_))
    }

    fn grow_old(path: &Path) {
        File::options()
            .write(true)
            .open(path)
            .unwrap()
            .set_modified(SystemTime::now() - 2 * LEASE)
            .unwrap();
    }

    #[test]
    fn a_claim_is_exclusive_until_it_is_released() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (Claims::new(), Claims::new());
        assert_eq!(a.acquire(dir.path()).unwrap(), Claim::Granted);
        assert_eq!(
            a.acquire(dir.path()).unwrap(),
            Claim::Granted,
            "claiming twice succeeds"
        );
        assert!(
            held_elsewhere(b.acquire(dir.path())) && a.holds(dir.path()) && !b.holds(dir.path())
        );
        a.release(dir.path());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        assert_eq!(b.acquire(dir.path()).unwrap(), Claim::Granted);
        assert!(held_elsewhere(a.acquire(dir.path())));
    }

    #[test]
    fn the_claim_of_a_dead_process_is_taken_over_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let a = Claims::new();
        a.acquire(dir.path()).unwrap();
        // Dropping the files releases the locks, as death does; the claim file stays.
        drop(a);
        assert!(dir.path().join(FILE).exists());
        let next = Claims::new();
        assert_eq!(
            eventually(|| next.acquire(dir.path()).unwrap()),
            Claim::Granted
        );
    }

    #[test]
    fn another_machine_keeps_its_claim_until_the_lease_ends() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let far = Owner {
            boot: "another".to_owned(),
            ..Owner::named("far away", 1)
        };
        fs::write(&path, far.claim_text()).unwrap();
        let here = Claims::new();
        match here.acquire(dir.path()).unwrap() {
            Claim::HeldBy(owner) => assert_eq!(owner, "process 1 on far away"),
            other => panic!("its lease has not ended: {other:?}"),
        }
        let here = Claims::new();
        assert!(held_elsewhere(here.acquire(dir.path())));
        grow_old(&path);
        assert!(
            held_elsewhere(here.acquire(dir.path())),
            "its age was read a moment ago"
        );
        let here = Claims::new();
        assert_eq!(here.acquire(dir.path()).unwrap(), Claim::Granted);
        assert_eq!(
            fs::read_dir(dir.path()).unwrap().count(),
            1,
            "no temporary file is left"
        );
        // The other machine resumes and rewrites its claim.
        fs::write(&path, far.claim_text()).unwrap();
        assert!(!here.holds(dir.path()));
        // It finishes the run and releases its claim.
        fs::remove_file(&path).unwrap();
        assert!(here.holds(dir.path()), "a deleted claim file");
        fs::write(dir.path().join("done.json"), "{}").unwrap();
        assert!(!here.holds(dir.path()));
    }

    #[test]
    fn a_damaged_claim_can_be_taken_over() {
        let dir = tempfile::tempdir().unwrap();
        for damage in ["", "{\"host\":", "{}", "\u{0}\u{1}"] {
            fs::write(dir.path().join(FILE), damage).unwrap();
            let here = Claims::new();
            assert_eq!(
                here.acquire(dir.path()).unwrap(),
                Claim::Granted,
                "{damage:?}"
            );
            here.release(dir.path());
        }
    }

    /// Lets all ask for a folder at the same time, and returns how many were granted it.
    fn winners(all: &[Claims], folder: &Path) -> usize {
        std::thread::scope(|scope| {
            let tries: Vec<_> = all
                .iter()
                .map(|claims| scope.spawn(|| claims.acquire(folder).unwrap() == Claim::Granted))
                .collect();
            let granted = tries.into_iter().map(|t| t.join().unwrap());
            granted.filter(|is_granted| *is_granted).count()
        })
    }

    #[test]
    fn exactly_one_of_many_processes_gets_the_claim() {
        let dir = tempfile::tempdir().unwrap();
        for _ in 0..20 {
            let all: Vec<Claims> = (0..6).map(|_| Claims::new()).collect();
            assert_eq!(winners(&all, dir.path()), 1);
            all.iter().for_each(|claims| claims.release(dir.path()));
        }
    }

    #[test]
    fn a_free_lock_of_the_same_host_name_on_another_boot_is_no_proof_of_death() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let twin = Owner {
            boot: "another".to_owned(),
            ..Owner::current()
        };
        fs::write(&path, twin.claim_text()).unwrap();
        // The lock is free here, as on two machines of one name that do not see each other's locks.
        assert!(held_elsewhere(Claims::new().acquire(dir.path())));
        grow_old(&path);
        assert_eq!(Claims::new().acquire(dir.path()).unwrap(), Claim::Granted);
    }

    #[test]
    fn without_locks_leases_decide() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let (a, b) = (Claims::with_locks(false), Claims::with_locks(false));
        assert_eq!(a.acquire(dir.path()).unwrap(), Claim::Granted);
        assert!(held_elsewhere(b.acquire(dir.path())) && a.holds(dir.path()));
        drop(a);
        let b = Claims::with_locks(false);
        assert!(
            held_elsewhere(b.acquire(dir.path())),
            "its death is not visible yet"
        );
        for _ in 0..20 {
            grow_old(&path);
            let all: Vec<Claims> = (0..6).map(|_| Claims::with_locks(false)).collect();
            assert_eq!(
                winners(&all, dir.path()),
                1,
                "of six that find the lease ended"
            );
            assert_eq!(
                all.iter().filter(|claims| claims.holds(dir.path())).count(),
                1
            );
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn a_locked_claim_is_held_however_old_it_is() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (Claims::new(), Claims::new());
        assert_eq!(a.acquire(dir.path()).unwrap(), Claim::Granted);
        // As if the process had been suspended.
        grow_old(&dir.path().join(FILE));
        assert!(held_elsewhere(b.acquire(dir.path())) && a.holds(dir.path()));
    }

    #[test]
    fn a_claim_of_another_machine_is_held_for_the_whole_lease() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let far = Owner {
            boot: "another".to_owned(),
            ..Owner::named("far away", 1)
        };
        fs::write(&path, far.claim_text()).unwrap();
        let file = File::options().write(true).open(&path).unwrap();
        file.set_modified(SystemTime::now() - LEASE / 2).unwrap();
        assert!(held_elsewhere(Claims::new().acquire(dir.path())));
    }

    #[test]
    fn a_release_leaves_the_claim_of_another_process() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let here = Claims::new();
        assert_eq!(here.acquire(dir.path()).unwrap(), Claim::Granted);
        // Another machine has taken the claim over after a suspension of this process.
        fs::remove_file(&path).unwrap();
        fs::write(&path, Owner::named("far away", 1).claim_text()).unwrap();
        here.release(dir.path());
        assert!(path.exists());
    }
}
