//! Claims: which process works on which run.
//!
//! A claim is the file `claim` in a run's folder. It is made beside its name, locked, and then given the name only if
//! nobody has it, so that it is locked from its first moment. The operating system lets go of the lock when the owner
//! dies, however it does: whoever then gets the lock takes the claim over at once. Locks of other machines may not be
//! seen, so there the lease decides: the owner writes the file anew every [`HEARTBEAT`], and one that has not been
//! written for [`LEASE`], by the file system's own clock, is taken over. Should two machines ever work on one run
//! nevertheless, both write the same bytes, each file whole.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, SystemTime, UNIX_EPOCH};

use serde_json::{Value as Json, json};

use super::{Host, StoreError, utc, write};
use crate::experiment::standing::Claim;

/// The name of the file.
pub(super) const FILE: &str = "claim";
/// How often an owner shows that it is alive.
const HEARTBEAT: Duration = Duration::from_secs(20);
/// After how long another machine's owner counts as dead.
const LEASE: Duration = Duration::from_secs(120);
/// How often a claim that vanishes at every look is tried for.
const TRIES: usize = 100;

/// The claims of this process.
#[derive(Debug)]
pub(super) struct Claims {
    owner: Owner,
    held: Arc<Mutex<BTreeMap<PathBuf, Held>>>,
    /// Dropping it ends the heartbeat.
    _end: SyncSender<()>,
}

#[derive(Debug)]
struct Held {
    file: File,
    text: String,
}

#[derive(Clone, Debug, PartialEq, Eq)]
struct Owner {
    host: String,
    process: u32,
    /// Tells this process from another with the same number.
    token: String,
}

impl Claims {
    /// No claims yet. A thread keeps those that follow alive.
    pub(super) fn new() -> Claims {
        let moment = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_nanos();
        let process = std::process::id();
        let owner = Owner { host: Host::here().name, process, token: format!("{process}-{moment}") };
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
        Claims { owner, held, _end: end }
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
                if let Some(file) = create(folder, &path, &text)? {
                    return Ok(Ok(file));
                }
                match self.take_over(&path, &text)? {
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
    fn take_over(&self, path: &Path, text: &str) -> io::Result<Found> {
        let mut file = match OpenOptions::new().read(true).write(true).open(path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(Found::Gone),
            opened => opened?,
        };
        let locked = match file.try_lock() {
            Ok(()) => true,
            Err(TryLockError::WouldBlock) => return Ok(Found::Theirs(Owner::read(&mut file).0)),
            Err(TryLockError::Error(_)) => false,
        };
        if !is_at(&file, path) {
            return Ok(Found::Gone);
        }
        let (whose, owner) = Owner::read(&mut file);
        let dead = match owner {
            // Damaged: its owner would have written it anew.
            None => true,
            Some(owner) if locked && owner.host == self.owner.host => true,
            Some(_) => age(&file, path)? > LEASE,
        };
        if !dead {
            return Ok(Found::Theirs(whose));
        }
        tracing::info!("taking over what {whose} left");
        let mut claim = Held { file, text: text.to_owned() };
        claim.rewrite()?;
        Ok(Found::Taken(claim.file))
    }

    /// Whether the claim of a folder is still this process's.
    pub(super) fn holds(&self, folder: &Path) -> bool {
        let held = lock(&self.held);
        let Some(claim) = held.get(folder) else { return false };
        // Where the file itself vanished, nobody else has it either.
        fs::read_to_string(folder.join(FILE)).map_or(true, |text| text == claim.text)
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

impl Owner {
    fn text(&self) -> String {
        let Owner { host, process, token } = self;
        json!({ "host": host, "process": process, "token": token, "since": utc(SystemTime::now()) }).to_string() + "\n"
    }

    /// Who owns a claim: in words, and as far as it says.
    fn read(file: &mut File) -> (String, Option<Owner>) {
        let mut text = String::new();
        let read = file.seek(SeekFrom::Start(0)).and_then(|_| file.read_to_string(&mut text));
        let json: Json = read.ok().and_then(|_| serde_json::from_str(&text).ok()).unwrap_or_default();
        let owner = || {
            Some(Owner {
                host: json["host"].as_str()?.to_owned(),
                process: u32::try_from(json["process"].as_u64()?).ok()?,
                token: json["token"].as_str()?.to_owned(),
            })
        };
        match owner() {
            Some(owner) => (format!("process {} on {}", owner.process, owner.host), Some(owner)),
            None => ("a process that did not say".to_owned(), None),
        }
    }
}

impl Held {
    fn rewrite(&mut self) -> io::Result<()> {
        self.file.seek(SeekFrom::Start(0))?;
        self.file.write_all(self.text.as_bytes())?;
        self.file.set_len(self.text.len() as u64)
    }
}

/// Makes a claim where there is none.
fn create(folder: &Path, path: &Path, text: &str) -> io::Result<Option<File>> {
    if path.exists() {
        return Ok(None);
    }
    let mut file = write::temporary(folder)?;
    if let Err(TryLockError::Error(e)) = file.as_file().try_lock() {
        tracing::debug!("{} cannot be locked: {e}", path.display());
    }
    file.write_all(text.as_bytes())?;
    match file.persist_noclobber(path) {
        Ok(file) => Ok(Some(file)),
        // The owner of the claim that came first may have swept this one's temporary file away.
        Err(e) if matches!(e.error.kind(), io::ErrorKind::AlreadyExists | io::ErrorKind::NotFound) => Ok(None),
        Err(e) => Err(e.error),
    }
}

/// How long ago a file was written, by the clock of the file system, which another machine's clock need not agree with.
fn age(file: &File, path: &Path) -> io::Result<Duration> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let now = write::temporary(folder)?.as_file().metadata()?.modified()?;
    Ok(now.duration_since(file.metadata()?.modified()?).unwrap_or_default())
}

/// Whether an open file is the one at a path.
#[cfg(unix)]
fn is_at(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    let same = |a: fs::Metadata, b: fs::Metadata| (a.dev(), a.ino()) == (b.dev(), b.ino());
    file.metadata().is_ok_and(|open| fs::metadata(path).is_ok_and(|there| same(open, there)))
}

#[cfg(not(unix))]
fn is_at(_: &File, path: &Path) -> bool {
    path.exists()
}

fn lock(held: &Mutex<BTreeMap<PathBuf, Held>>) -> MutexGuard<'_, BTreeMap<PathBuf, Held>> {
    // Nothing in here is half-done when its holder panics.
    held.lock().unwrap_or_else(PoisonError::into_inner)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::tests::at_last;

    fn theirs(claim: Result<Claim, StoreError>) -> bool {
        matches!(claim.unwrap(), Claim::Theirs(_))
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
        let far = Owner { host: "far away".to_owned(), process: 1, token: "1-1".to_owned() };
        fs::write(&path, far.text()).unwrap();
        let here = Claims::new();
        match here.take(dir.path()).unwrap() {
            Claim::Theirs(whose) => assert_eq!(whose, "process 1 on far away"),
            Claim::Ours => panic!("its lease has not ended"),
        }
        File::options().write(true).open(&path).unwrap().set_modified(SystemTime::now() - 2 * LEASE).unwrap();
        assert_eq!(here.take(dir.path()).unwrap(), Claim::Ours);
        // The other machine wakes up and writes its claim anew.
        fs::write(&path, far.text()).unwrap();
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
}
