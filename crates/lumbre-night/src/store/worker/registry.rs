//! Registry of the workers of a night. Every worker writes its own heartbeat,
//! `workers/<name>.json`, and its own journal, `workers/<name>.jsonl`; no file has two writers.
//!
//! A planner that also renders writes `planners/<name>.json` and removes it at the end, so that
//! workers that join see it and a night rendered by one process leaves no registry behind.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use crate::experiment::comparison_groups::Affinity;
use crate::store::lock::claim::{HEARTBEAT, LEASE, lock_mutex};
use crate::store::schema::process::{HeartbeatFile, Owner, RenderDevice, WorkerState};
use crate::store::schema::{StoredFile, one_line};
use crate::store::utc;
use crate::store::write::atomic;

/// Name of the workers' folder inside an experiment's folder.
pub(crate) const FOLDER: &str = "workers";
/// Name of the planners' folder inside an experiment's folder.
const PLANNERS: &str = "planners";
/// Interval at which the heartbeat thread looks for a changed state.
const STATE_POLL: Duration = Duration::from_secs(1);

/// Facts that a worker announces when it joins.
#[derive(Clone, Debug, Default)]
pub struct WorkerInfo {
    /// Device that it renders on.
    pub device: RenderDevice,
    /// Rule that binds cells to devices.
    pub affinity: Affinity,
    /// Cluster job that it is part of, such as `1207_3`; empty without one.
    pub job: String,
}

/// A registered worker, read from its heartbeat file.
#[derive(Clone, Debug, PartialEq)]
pub struct WorkerStatus {
    /// Name that is unique among all workers.
    pub name: String,
    /// Whether it made the plan and renders in the same process.
    pub planner: bool,
    /// Name of the machine.
    pub host: String,
    /// Process number on that machine.
    pub process: u32,
    /// Device that it renders on.
    pub device: RenderDevice,
    /// Cluster job that it is part of; empty without one.
    pub job: String,
    /// Its state at the last heartbeat.
    pub state: WorkerState,
    /// Seconds since its last heartbeat, by the clock of the folder's file system.
    pub age_s: f64,
}

impl WorkerStatus {
    /// Whether it has not left, but its heartbeat is older than the lease of a claim.
    pub fn is_lost(&self) -> bool {
        !matches!(self.state, WorkerState::Left(_)) && self.age_s > LEASE.as_secs_f64()
    }

    /// Whether it has neither left nor been lost.
    pub fn is_active(&self) -> bool {
        !matches!(self.state, WorkerState::Left(_)) && !self.is_lost()
    }
}

/// Lists every worker that ever joined an experiment, and the planners that render there now,
/// ordered by name.
pub fn list_workers(folder: &Path) -> Vec<WorkerStatus> {
    let mut found: Vec<WorkerStatus> = [FOLDER, PLANNERS]
        .iter()
        .flat_map(|name| read_heartbeats(&folder.join(name)))
        .collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

fn read_heartbeats(folder: &Path) -> Vec<WorkerStatus> {
    let files = fs::read_dir(folder)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path());
    let files: Vec<PathBuf> = files
        .filter(|f| f.extension().is_some_and(|e| e == "json"))
        .collect();
    if files.is_empty() {
        return Vec::new();
    }
    // In a read-only copy of the folder, this machine's clock is used.
    let now = atomic::now_in(folder).unwrap_or_else(|_| SystemTime::now());
    files
        .iter()
        .filter_map(|file| read_worker(file, now))
        .collect()
}

/// Removes the heartbeat files of planners that did not end normally: those without a heartbeat for
/// the length of a lease, and those of this machine whose process is gone.
pub(crate) fn remove_dead_planners(folder: &Path) {
    let planners = folder.join(PLANNERS);
    let here = Owner::current();
    for planner in read_heartbeats(&planners) {
        let file = planners.join(format!("{}.json", planner.name));
        let heartbeat = HeartbeatFile::read_from(&file);
        let same_machine = heartbeat.is_ok_and(|found| found.owner.same_machine(&here));
        let gone = cfg!(target_os = "linux")
            && !Path::new("/proc")
                .join(planner.process.to_string())
                .exists();
        if planner.is_lost() || (same_machine && gone) {
            // Another process may have removed it.
            let _ = fs::remove_file(file);
        }
    }
    // Fails, as intended, if the folder is not empty.
    let _ = fs::remove_dir(planners);
}

fn read_worker(file: &Path, now: SystemTime) -> Option<WorkerStatus> {
    let found = HeartbeatFile::read_from(file).ok()?;
    let written = fs::metadata(file).and_then(|facts| facts.modified()).ok()?;
    Some(WorkerStatus {
        name: file.file_stem()?.to_str()?.to_owned(),
        planner: file.parent()?.ends_with(PLANNERS),
        host: found.owner.host,
        process: found.owner.process,
        device: found.device,
        job: found.job,
        state: found.state,
        age_s: now.duration_since(written).map_or(0.0, |d| d.as_secs_f64()),
    })
}

/// Heartbeat file of this process, renewed by a thread until the value is dropped.
#[derive(Debug)]
pub(crate) struct Heartbeat {
    file: PathBuf,
    /// Its content, without the activity.
    facts: HeartbeatFile,
    planner: bool,
    activity: Arc<Mutex<Activity>>,
    /// Dropping it ends the thread.
    _end: SyncSender<()>,
}

/// State of a worker with the date of its last change.
#[derive(Debug)]
struct Activity {
    state: WorkerState,
    /// Date of the last change, as [`utc`] writes it.
    since: String,
    /// Whether the heartbeat file does not show the state yet.
    changed: bool,
}

impl Activity {
    fn new(state: WorkerState, changed: bool) -> Activity {
        Activity {
            state,
            since: utc(SystemTime::now()),
            changed,
        }
    }
}

impl Heartbeat {
    /// Registers a worker in a folder.
    ///
    /// # Errors
    /// When the heartbeat file cannot be written, since other workers would not see this one.
    pub(crate) fn join(
        folder: &Path,
        owner: &Owner,
        worker: &WorkerInfo,
    ) -> Result<Heartbeat, crate::store::StoreError> {
        Heartbeat::start(folder.join(FOLDER), owner, worker, false)
    }

    /// Registers a planner that also renders, until the value is dropped.
    ///
    /// # Errors
    /// When the heartbeat file cannot be written.
    pub(crate) fn join_as_planner(
        folder: &Path,
        owner: &Owner,
        worker: &WorkerInfo,
    ) -> Result<Heartbeat, crate::store::StoreError> {
        Heartbeat::start(folder.join(PLANNERS), owner, worker, true)
    }

    fn start(
        folder: PathBuf,
        owner: &Owner,
        worker: &WorkerInfo,
        planner: bool,
    ) -> Result<Heartbeat, crate::store::StoreError> {
        let facts = HeartbeatFile {
            owner: owner.clone(),
            device: worker.device.clone(),
            affinity: worker.affinity,
            job: worker.job.clone(),
            joined: utc(SystemTime::now()),
            ..HeartbeatFile::default()
        };
        let file = folder.join(format!("{}.json", owner.name()));
        let activity = Activity::new(WorkerState::Waiting, false);
        atomic::write_atomically(&file, heartbeat_text(&facts, &activity).as_bytes())?;
        let activity = Arc::new(Mutex::new(activity));
        let (end, ended) = sync_channel(0);
        let (shared, path, constant) = (Arc::clone(&activity), file.clone(), facts.clone());
        if let Err(e) = std::thread::Builder::new()
            .name("heartbeat".to_owned())
            .spawn(move || renew(&path, &constant, &shared, &ended))
        {
            tracing::warn!(
                "cannot start this worker's heartbeat: {e}; other workers will take it for lost"
            );
        }
        Ok(Heartbeat {
            file,
            facts,
            planner,
            activity,
            _end: end,
        })
    }

    /// Updates the state of the worker. Other workers see it within seconds, and see at once that
    /// it left.
    pub(crate) fn set_state(&self, state: WorkerState) {
        let mut activity = lock_mutex(&self.activity);
        if activity.state == state || matches!(activity.state, WorkerState::Left(_)) {
            return;
        }
        let leaves = matches!(state, WorkerState::Left(_));
        *activity = Activity::new(state, !leaves);
        let text = heartbeat_text(&self.facts, &activity);
        if leaves && let Err(e) = atomic::write_atomically(&self.file, text.as_bytes()) {
            tracing::warn!(
                "cannot record that this worker left: {e}; other workers will take it for lost"
            );
        }
    }
}

impl Drop for Heartbeat {
    fn drop(&mut self) {
        if self.planner {
            let mut activity = lock_mutex(&self.activity);
            activity.state = WorkerState::Left(String::new());
            // A file that stays is taken for lost and removed by the next planner.
            let _ = fs::remove_file(&self.file);
            let _ = self.file.parent().map(fs::remove_dir);
        }
    }
}

/// Rewrites a heartbeat file when the activity changed, and at least every [`HEARTBEAT`], until
/// `ended` is disconnected.
fn renew(file: &Path, facts: &HeartbeatFile, activity: &Mutex<Activity>, ended: &Receiver<()>) {
    let mut last = Instant::now();
    while ended.recv_timeout(STATE_POLL) == Err(RecvTimeoutError::Timeout) {
        let mut activity = lock_mutex(activity);
        let left = matches!(activity.state, WorkerState::Left(_));
        if !left && (activity.changed || last.elapsed() >= HEARTBEAT) {
            activity.changed = false;
            last = Instant::now();
            // A missed heartbeat does no harm yet. The mutex is held while writing, so that no
            // heartbeat follows the record that the worker left.
            let _ = atomic::write_atomically(file, heartbeat_text(facts, &activity).as_bytes());
        }
    }
}

/// Content of a heartbeat file: the constant facts and the activity.
fn heartbeat_text(facts: &HeartbeatFile, activity: &Activity) -> String {
    one_line(&HeartbeatFile {
        state: activity.state.clone(),
        since: activity.since.clone(),
        ..facts.clone()
    })
}

#[cfg(test)]
mod tests {
    use crate::store::worker::registry::*;

    fn worker_info(key: &str) -> WorkerInfo {
        let device = RenderDevice {
            key: key.to_owned(),
            model: "a lens".to_owned(),
        };
        WorkerInfo {
            device,
            affinity: Affinity::Device,
            job: "7_1".to_owned(),
        }
    }

    #[test]
    fn a_worker_is_active_until_it_leaves_and_lost_without_heartbeats() {
        let dir = tempfile::tempdir().unwrap();
        assert!(list_workers(dir.path()).is_empty());
        let owners = [Owner::current(), Owner::current()];
        let a = Heartbeat::join(dir.path(), &owners[0], &worker_info("a")).unwrap();
        let b = Heartbeat::join(dir.path(), &owners[1], &worker_info("b")).unwrap();
        a.set_state(WorkerState::Left("all is done".to_owned()));
        a.set_state(WorkerState::Waiting);
        let known = lock_mutex(&a.activity).state.clone();
        assert!(matches!(known, WorkerState::Left(_)), "it does not return");
        drop(b);
        let file = dir
            .path()
            .join(FOLDER)
            .join(format!("{}.json", owners[1].name()));
        let find = |owner: &Owner| {
            list_workers(dir.path())
                .into_iter()
                .find(|w| w.name == owner.name())
                .unwrap()
        };
        let first = find(&owners[0]);
        assert_eq!(
            (first.state, first.job.as_str()),
            (WorkerState::Left("all is done".to_owned()), "7_1")
        );
        let second = find(&owners[1]);
        assert!(
            second.is_active()
                && second.device == worker_info("b").device
                && second.process == std::process::id()
        );
        let grow_old = |by: Duration| {
            let open = fs::File::options().write(true).open(&file).unwrap();
            open.set_modified(SystemTime::now() - by).unwrap();
        };
        grow_old(LEASE / 2);
        assert!(find(&owners[1]).is_active(), "it may still be alive");
        grow_old(2 * LEASE);
        assert!(find(&owners[1]).is_lost() && !find(&owners[0]).is_lost());
    }

    #[test]
    fn a_planner_is_listed_while_it_renders_and_leaves_no_files() {
        let dir = tempfile::tempdir().unwrap();
        let first =
            Heartbeat::join_as_planner(dir.path(), &Owner::current(), &worker_info("a")).unwrap();
        first.set_state(WorkerState::Rendering {
            run: "ab".to_owned(),
            path: "depth=2".to_owned(),
        });
        let listed = list_workers(dir.path());
        assert!(
            listed.len() == 1
                && listed[0].planner
                && listed[0].is_active()
                && listed[0].device == worker_info("a").device
        );
        // A planner that was killed long ago, and one whose process is gone.
        for dead in [false, true] {
            let lost = Heartbeat::join_as_planner(dir.path(), &Owner::current(), &worker_info("b"))
                .unwrap();
            let file = lost.file.clone();
            std::mem::forget(lost);
            if dead {
                let text = fs::read_to_string(&file).unwrap();
                let gone = text.replace(&format!(":{}", std::process::id()), ":4294967295");
                assert_ne!(gone, text);
                fs::write(&file, gone).unwrap();
            } else {
                let old = SystemTime::now() - 2 * LEASE;
                fs::File::options()
                    .write(true)
                    .open(&file)
                    .unwrap()
                    .set_modified(old)
                    .unwrap();
            }
            assert_eq!(list_workers(dir.path()).len(), 2);
            remove_dead_planners(dir.path());
            assert!(!file.exists());
        }
        assert_eq!(list_workers(dir.path()).len(), 1, "a living planner stays");
        drop(first);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
