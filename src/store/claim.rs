//! Claims: which process works on which run.
//!
//! A claim is the file `claim` in a run's folder. It is made beside its name, locked, and then given the name only if
//! nobody has it, so that it is locked from its first moment. The operating system lets go of the lock when the owner
//! dies, however it does: whoever then gets the lock on the same boot of the same machine takes the claim over at once.
//! Other machines' locks may not be seen, and some file systems have none. There the lease decides: the owner writes the
//! file anew every [`HEARTBEAT`], and one that has not been written for [`LEASE`], by the file system's own clock, is
//! taken over. No machine's clock is asked.
//!
//! Without locks, two may find the same lease ended. The claim is then renamed away, which one of them can do; what was
//! renamed is looked at again, and given its name back if it is not what was judged; and the new claim is made like
//! every other. Only where a third comes into that moment can two machines work on one run. Both then write the same
//! bytes, each file whole, and the one whose claim is gone says so at its end.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant, SystemTime};

use super::owner::Owner;
use super::{StoreError, layout, write};
use crate::experiment::standing::Claim;

/// The name of the file.
pub(super) const FILE: &str = "claim";
/// How often an owner shows that it is alive.
pub(super) const HEARTBEAT: Duration = Duration::from_secs(20);
/// After how long another machine's owner counts as dead.
pub const LEASE: Duration = Duration::from_secs(120);
/// Switches locks off where a file system says that it has them and does not: `LUMBRE_LOCKS=none`. Leases remain.
const LOCKS_VARIABLE: &str = "LUMBRE_LOCKS";
/// How often a claim that vanishes at every look is tried for.
const TRIES: usize = 100;

/// The claims of this process.
#[derive(Debug)]
pub(super) struct Claims {
    owner: Owner,
    held: Arc<Mutex<BTreeMap<PathBuf, Held>>>,
    /// Other machines' claims: when each was written and when its age was asked for, so that one that is looked at again
    /// and again costs the file system little.
    alive: Mutex<BTreeMap<PathBuf, (SystemTime, Instant)>>,
    locks: bool,
    /// Whether they are kept alive, and time passes for them as it does for everybody.
    attended: bool,
    /// Dropping it ends the heartbeat.
    _end: SyncSender<()>,
}

#[derive(Debug)]
struct Held {
    file: File,
    text: String,
}

/// What is known of a lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Lock {
    Ours,
    Theirs,
    /// There are no locks here.
    Unknown,
}

impl Claims {
    /// No claims yet. A thread keeps those that follow alive.
    pub(super) fn new() -> Claims {
        Claims::with_locks(std::env::var(LOCKS_VARIABLE).map_or(true, |word| word != "none"))
    }

    /// Claims without locks that nobody keeps alive: a thousand of them fit into one process.
    pub(super) fn unattended() -> Claims {
        let (end, _) = sync_channel(0);
        Claims {
            owner: Owner::here(),
            held: Arc::default(),
            alive: Mutex::default(),
            locks: false,
            attended: false,
            _end: end,
        }
    }

    fn with_locks(locks: bool) -> Claims {
        let owner = Owner::here();
        let held: Arc<Mutex<BTreeMap<PathBuf, Held>>> = Arc::default();
        let (end, ended) = sync_channel(0);
        let beating = Arc::clone(&held);
        let beat = move || {
            while ended.recv_timeout(HEARTBEAT) == Err(RecvTimeoutError::Timeout) {
                for claim in lock(&beating).values_mut() {
                    // A beat that is missed costs nothing yet.
                    let _ = claim.rewrite();
                }
            }
        };
        if let Err(e) = std::thread::Builder::new().name("claims".to_owned()).spawn(beat) {
            tracing::warn!("claims are not kept alive for other machines: {e}");
        }
        Claims { owner, held, alive: Mutex::default(), locks, attended: true, _end: end }
    }

    /// Whose claims they are.
    pub(super) fn owner(&self) -> &Owner {
        &self.owner
    }

    /// A journal that nobody else writes to, in a folder that is made.
    ///
    /// # Errors
    /// When the folder cannot be made.
    pub(super) fn own_journal(&self, experiment: &Path) -> Result<PathBuf, StoreError> {
        let workers = experiment.join(super::crew::FOLDER);
        fs::create_dir_all(&workers).map_err(|e| StoreError::io("create", &workers, &e))?;
        Ok(workers.join(format!("{}.jsonl", self.owner.name())))
    }

    /// Claims the run in a folder, which is made.
    ///
    /// # Errors
    /// When it cannot be known whose it is.
    pub(super) fn take(&self, folder: &Path) -> Result<Claim, StoreError> {
        let path = folder.join(FILE);
        if lock(&self.held).contains_key(folder) {
            return Ok(Claim::Ours);
        }
        let text = self.owner.text();
        let attempt = || -> io::Result<Result<File, String>> {
            fs::create_dir_all(folder)?;
            for _ in 0..TRIES {
                if let Some(file) = self.create(folder, &path, &text)? {
                    return Ok(Ok(file));
                }
                match self.take_over(folder, &path, &text)? {
                    Found::Gone => {}
                    Found::Taken(file) => return Ok(Ok(file)),
                    Found::Theirs(whose) => return Ok(Err(whose)),
                }
            }
            Ok(Err("somebody's who comes and goes".to_owned()))
        };
        match attempt().map_err(|e| StoreError::io("claim", &path, &e))? {
            Ok(file) => {
                lock(&self.held).insert(folder.to_owned(), Held { file, text });
                Ok(Claim::Ours)
            }
            Err(whose) => Ok(Claim::Theirs(whose)),
        }
    }

    /// Looks at a claim that is there, and takes it if its owner is dead.
    fn take_over(&self, folder: &Path, path: &Path, text: &str) -> io::Result<Found> {
        let mut file = match OpenOptions::new().read(true).write(true).open(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Found::Gone),
            opened => opened?,
        };
        let lock = self.try_lock(&file, path);
        let judged = read(&mut file);
        let owner = Owner::read(&judged);
        let whose = owner.as_ref().map_or_else(|| "a process that did not say".to_owned(), Owner::words);
        if lock == Lock::Theirs {
            return Ok(Found::Theirs(whose));
        }
        if !is_at(&file, path) {
            return Ok(Found::Gone);
        }
        // The lock of a process on this boot of this machine is seen. What is damaged its owner would have written anew.
        if lock == Lock::Ours && owner.as_ref().is_none_or(|owner| owner.same_machine(&self.owner)) {
            tracing::info!("taking over what {whose} left");
            let mut claim = Held { file, text: text.to_owned() };
            claim.rewrite()?;
            return Ok(Found::Taken(claim.file));
        }
        if !self.lease_has_ended(&file, path)? {
            return Ok(Found::Theirs(whose));
        }
        if !seize(folder, path, |moved| Ok(read(moved) == judged && age(moved, folder)? > LEASE))? {
            return Ok(Found::Gone);
        }
        match self.create(folder, path, text)? {
            Some(file) => {
                if self.attended {
                    tracing::info!("taking over what {whose} left: nothing was heard of it for {} s", LEASE.as_secs());
                }
                Ok(Found::Taken(file))
            }
            None => Ok(Found::Gone),
        }
    }

    fn try_lock(&self, file: &File, path: &Path) -> Lock {
        if !self.locks {
            return Lock::Unknown;
        }
        match file.try_lock() {
            Ok(()) => Lock::Ours,
            Err(TryLockError::WouldBlock) => Lock::Theirs,
            Err(TryLockError::Error(e)) => {
                tracing::debug!("{} cannot be locked: {e}", path.display());
                Lock::Unknown
            }
        }
    }

    /// Whether another machine's claim has not been written for so long that its owner counts as dead. What was found
    /// alive a heartbeat ago, or was written since, still is.
    fn lease_has_ended(&self, file: &File, path: &Path) -> io::Result<bool> {
        let written = file.metadata()?.modified()?;
        let mut alive = lock(&self.alive);
        let recent = |(then, asked): &(SystemTime, Instant)| *then != written || asked.elapsed() < HEARTBEAT;
        if self.attended && alive.get(path).is_some_and(recent) {
            if let Some((then, _)) = alive.get_mut(path) {
                *then = written;
            }
            return Ok(false);
        }
        let ended = age(file, path.parent().unwrap_or(Path::new(".")))? > LEASE;
        if ended {
            alive.remove(path);
        } else {
            alive.insert(path.to_owned(), (written, Instant::now()));
        }
        Ok(ended)
    }

    /// Makes a claim where there is none.
    fn create(&self, folder: &Path, path: &Path, text: &str) -> io::Result<Option<File>> {
        if path.exists() {
            return Ok(None);
        }
        let mut file = write::temporary(folder)?;
        self.try_lock(file.as_file(), path);
        file.write_all(text.as_bytes())?;
        file.as_file().sync_data()?;
        exclusively(file, path)
    }

    /// Whether the claim of a folder is still this process's.
    pub(super) fn holds(&self, folder: &Path) -> bool {
        let held = lock(&self.held);
        let Some(claim) = held.get(folder) else { return false };
        match fs::read_to_string(folder.join(FILE)) {
            Ok(text) => text == claim.text,
            // Where the file itself vanished nobody else has it either, unless somebody had it and finished.
            Err(_) => !layout::is_done(folder),
        }
    }

    /// Gives a claim back.
    pub(super) fn release(&self, folder: &Path) {
        let Some(claim) = lock(&self.held).remove(folder) else { return };
        let path = folder.join(FILE);
        if is_at(&claim.file, &path) {
            // While it is locked nobody else can have it. One that stays is free as soon as the lock is.
            let _ = fs::remove_file(&path);
        }
    }
}

enum Found {
    /// It was given back in this moment.
    Gone,
    Taken(File),
    /// Whose it is, in words.
    Theirs(String),
}

impl Held {
    fn rewrite(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(self.text.as_bytes())?;
        self.file.set_len(self.text.len() as u64)?;
        // A network file system may keep what was written to itself for half a minute, and the lease with it.
        self.file.sync_data()
    }
}

/// What a file says, from its beginning; nothing where it cannot be read.
fn read(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.seek(SeekFrom::Start(0)).and_then(|_| file.read_to_string(&mut text));
    if read.is_ok() { text } else { String::new() }
}

/// Gives a file that was written beside it a name that nobody has, and says whether it could.
pub(super) fn exclusively(file: tempfile::NamedTempFile, path: &Path) -> io::Result<Option<File>> {
    match file.persist_noclobber(path) {
        Ok(file) => Ok(Some(file)),
        // A network file system repeats what it got no answer to, and may then call its own success a collision.
        Err(e) if e.error.kind() == io::ErrorKind::AlreadyExists && is_at(e.file.as_file(), path) => {
            Ok(Some(e.file.as_file().try_clone()?))
        }
        // The owner of the claim that came first may have swept this one's temporary file away.
        Err(e) if matches!(e.error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound) => Ok(None),
        Err(e) => Err(e.error),
    }
}

/// Takes a file away from its name, which one process can do, and says whether it did: what turns out not to be what
/// was judged gets its name back, unless somebody has it by then.
pub(super) fn seize(folder: &Path, path: &Path, judge: impl FnOnce(&mut File) -> io::Result<bool>) -> io::Result<bool> {
    // Its name alone is wanted; as a temporary file, what a crash leaves of this is swept.
    let aside = write::temporary(folder)?.into_temp_path();
    match fs::rename(path, &aside) {
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(false),
        renamed => renamed?,
    }
    let judged = OpenOptions::new().read(true).write(true).open(&aside).and_then(|mut file| judge(&mut file));
    if !matches!(judged, Ok(true)) {
        // Whoever has the name by now has it rightly.
        let _ = fs::hard_link(&aside, path);
    }
    judged
}

/// How long ago a file was written, by the clock of the file system of a folder, which no machine's clock need agree
/// with.
fn age(file: &File, folder: &Path) -> io::Result<Duration> {
    let now = write::now_in(folder)?;
    Ok(now.duration_since(file.metadata()?.modified()?).unwrap_or_default())
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
pub(super) fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: fs::Metadata, b: fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().is_ok_and(|open| fs::metadata(path).is_ok_and(|there| same(open, there)))
}

#[cfg(not(unix))]
pub(super) fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

pub(super) fn lock<T>(shared: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing in here is half-done when its holder panics.
    shared.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::at_last;

    fn theirs(claim: Result<Claim, StoreError>) -> bool {
        matches!(claim.unwrap(), Claim::Theirs(_))
    }

    fn grow_old(path: &Path) {
        File::options().write(true).open(path).unwrap().set_modified(SystemTime::now() - 2 * LEASE).unwrap();
    }

    #[test]
    fn one_has_it_until_it_is_given_back() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (Claims::new(), Claims::new());
        assert_eq!(a.take(dir.path()).unwrap(), Claim::Ours);
        assert_eq!(a.take(dir.path()).unwrap(), Claim::Ours, "asked twice");
        assert!(theirs(b.take(dir.path())) && a.holds(dir.path()) && !b.holds(dir.path()));
        a.release(dir.path());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
        assert_eq!(b.take(dir.path()).unwrap(), Claim::Ours);
        assert!(theirs(a.take(dir.path())));
    }

    #[test]
    fn what_a_dead_process_left_is_taken_over_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let a = Claims::new();
        a.take(dir.path()).unwrap();
        // Dropping the files is what death does to them; the claim stays.
        drop(a);
        assert!(dir.path().join(FILE).exists());
        let next = Claims::new();
        assert_eq!(at_last(|| next.take(dir.path()).unwrap()), Claim::Ours);
    }

    #[test]
    fn another_machine_keeps_its_claim_until_the_lease_ends() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let far = Owner { boot: "another".to_owned(), ..Owner::named("far away", 1) };
        fs::write(&path, far.text()).unwrap();
        let here = Claims::new();
        match here.take(dir.path()).unwrap() {
            Claim::Theirs(whose) => assert_eq!(whose, "process 1 on far away"),
            other => panic!("its lease has not ended: {other:?}"),
        }
        let here = Claims::new();
        assert!(theirs(here.take(dir.path())));
        grow_old(&path);
        assert!(theirs(here.take(dir.path())), "its age was asked for a moment ago");
        let here = Claims::new();
        assert_eq!(here.take(dir.path()).unwrap(), Claim::Ours);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "nothing is left beside it");
        // The other machine wakes up and writes its claim anew.
        fs::write(&path, far.text()).unwrap();
        assert!(!here.holds(dir.path()));
        // It finishes the run and gives its claim back.
        fs::remove_file(&path).unwrap();
        assert!(here.holds(dir.path()), "a claim that somebody deleted");
        fs::write(dir.path().join("done.json"), "{}").unwrap();
        assert!(!here.holds(dir.path()));
    }

    #[test]
    fn a_damaged_claim_locks_nobody_out() {
        let dir = tempfile::tempdir().unwrap();
        for damage in ["", "{\"host\":", "{}", "\u{0}\u{1}"] {
            fs::write(dir.path().join(FILE), damage).unwrap();
            let here = Claims::new();
            assert_eq!(here.take(dir.path()).unwrap(), Claim::Ours, "{damage:?}");
            here.release(dir.path());
        }
    }

    #[test]
    fn of_many_that_want_it_one_gets_it() {
        let dir = tempfile::tempdir().unwrap();
        for _ in 0..20 {
            let all: Vec<Claims> = (0..6).map(|_| Claims::new()).collect();
            let winners = std::thread::scope(|scope| {
                let tries: Vec<_> = all
                    .iter()
                    .map(|claims| scope.spawn(|| u32::from(claims.take(dir.path()).unwrap() == Claim::Ours)))
                    .collect();
                tries.into_iter().map(|t| t.join().unwrap()).sum::<u32>()
            });
            assert_eq!(winners, 1);
            all.iter().for_each(|claims| claims.release(dir.path()));
        }
    }

    #[test]
    fn a_lock_of_the_same_name_on_another_boot_is_no_death() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let twin = Owner { boot: "another".to_owned(), ..Owner::here() };
        fs::write(&path, twin.text()).unwrap();
        // Nobody holds the lock here, as where two machines of one name do not see each other's.
        assert!(theirs(Claims::new().take(dir.path())));
        grow_old(&path);
        assert_eq!(Claims::new().take(dir.path()).unwrap(), Claim::Ours);
    }

    #[test]
    fn without_locks_one_has_it_and_leases_decide() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        let (a, b) = (Claims::with_locks(false), Claims::with_locks(false));
        assert_eq!(a.take(dir.path()).unwrap(), Claim::Ours);
        assert!(theirs(b.take(dir.path())) && a.holds(dir.path()));
        drop(a);
        let b = Claims::with_locks(false);
        assert!(theirs(b.take(dir.path())), "nobody knows of its death yet");
        for _ in 0..20 {
            grow_old(&path);
            let all: Vec<Claims> = (0..6).map(|_| Claims::with_locks(false)).collect();
            let winners = std::thread::scope(|scope| {
                let tries: Vec<_> = all
                    .iter()
                    .map(|claims| scope.spawn(|| u32::from(claims.take(dir.path()).unwrap() == Claim::Ours)))
                    .collect();
                tries.into_iter().map(|t| t.join().unwrap()).sum::<u32>()
            });
            assert_eq!(winners, 1, "of six that find the lease ended");
            assert_eq!(all.iter().filter(|claims| claims.holds(dir.path())).count(), 1);
            assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        }
    }

    #[test]
    fn what_was_not_judged_gets_its_name_back() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join(FILE);
        fs::write(&path, "somebody's by now").unwrap();
        assert!(!seize(dir.path(), &path, |_| Ok(false)).unwrap());
        assert_eq!(fs::read_to_string(&path).unwrap(), "somebody's by now");
        // Whoever made a claim meanwhile keeps it.
        let other = path.clone();
        assert!(!seize(dir.path(), &path, |_| fs::write(other, "a third").map(|()| false)).unwrap());
        assert_eq!(fs::read_to_string(&path).unwrap(), "a third");
        assert!(seize(dir.path(), &path, |_| Ok(true)).unwrap() && !path.exists());
        assert!(!seize(dir.path(), &path, |_| Ok(true)).unwrap(), "it is gone already");
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
