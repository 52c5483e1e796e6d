//! Who works in an experiment's folder when there are many: every worker's heartbeat, `workers/<name>.json`, beside its
//! own journal, `workers/<name>.jsonl`. Nobody writes another's file, and no file is appended to by two. Who makes the plan
//! and renders as well has `planners/<name>.json`, for as long as that takes: workers that come have to know of it, and a
//! night that one process renders alone keeps nothing of it.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant, SystemTime};

use serde_json::{Value as Json, json};

use super::archive::read_json;
use super::claim::{HEARTBEAT, LEASE, lock};
use super::owner::Owner;
use super::{utc, write};
use crate::experiment::groups::Affinity;

/// The folder of workers inside an experiment's.
pub(super) const FOLDER: &str = "workers";
/// That of planners.
const PLANNERS: &str = "planners";
/// How soon a change is told.
const GLANCE: Duration = Duration::from_secs(1);

/// A device that cells render on.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Device {
    /// Names this one device among all machines.
    pub key: String,
    /// What it is, for people; devices with the same words count as alike.
    pub model: String,
}

/// What a worker says of itself when it joins.
#[derive(Clone, Debug, Default)]
pub struct Me {
    /// What it renders on.
    pub device: Device,
    /// What of a comparison stays together.
    pub affinity: Affinity,
    /// The job that it is part of, such as `1207_3`; empty without one.
    pub job: String,
}

/// What a worker does.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Doing {
    /// It looks for something to do, or waits for others.
    Waiting,
    /// It renders a run.
    Rendering {
        /// The id of the run.
        run: String,
        /// Its readable path.
        path: String,
    },
    /// It has left, for this reason.
    Left(String),
}

impl Doing {
    fn word(&self) -> &'static str {
        match self {
            Doing::Waiting => "waiting",
            Doing::Rendering { .. } => "rendering",
            Doing::Left(_) => "left",
        }
    }
}

/// A worker as others see it.
#[derive(Clone, Debug, PartialEq)]
pub struct Worker {
    /// Its name among all workers.
    pub name: String,
    /// Whether it made the plan, and would be there without any other.
    pub planner: bool,
    /// The machine.
    pub host: String,
    /// Number of the process there.
    pub process: u32,
    /// What it renders on.
    pub device: Device,
    /// The job that it is part of; empty without one.
    pub job: String,
    /// What it does, or did when it was last heard of.
    pub doing: Doing,
    /// Seconds since its last heartbeat, by the clock of the folder.
    pub age_s: f64,
}

impl Worker {
    /// Whether it has not said that it left, and yet was not heard of for longer than a claim lasts.
    pub fn is_lost(&self) -> bool {
        !matches!(self.doing, Doing::Left(_)) && self.age_s > LEASE.as_secs_f64()
    }

    /// Whether it works.
    pub fn is_here(&self) -> bool {
        !matches!(self.doing, Doing::Left(_)) && !self.is_lost()
    }
}

/// Every worker that ever joined an experiment's folder, and whoever plans and renders there now, ordered by name.
pub fn crew(folder: &Path) -> Vec<Worker> {
    let mut found: Vec<Worker> = [FOLDER, PLANNERS].iter().flat_map(|place| heartbeats(&folder.join(place))).collect();
    found.sort_by(|a, b| a.name.cmp(&b.name));
    found
}

fn heartbeats(place: &Path) -> Vec<Worker> {
    let files = fs::read_dir(place).into_iter().flatten().flatten().map(|entry| entry.path());
    let files: Vec<PathBuf> = files.filter(|f| f.extension().is_some_and(|e| e == "json")).collect();
    if files.is_empty() {
        return Vec::new();
    }
    // A copy that cannot be written to is read by this machine's clock.
    let now = write::now_in(place).unwrap_or_else(|_| SystemTime::now());
    files.iter().filter_map(|file| worker(file, now)).collect()
}

/// Removes what planners left that did not end by themselves: those that were not heard of for as long as a claim lasts,
/// and those of this machine whose process is gone.
pub(super) fn sweep_planners(folder: &Path) {
    let place = folder.join(PLANNERS);
    let here = Owner::here();
    for planner in heartbeats(&place) {
        let file = place.join(format!("{}.json", planner.name));
        let owner = read_json(&file).and_then(|json| Owner::from_json(&json));
        let ours = owner.is_some_and(|owner| owner.same_machine(&here));
        let gone = cfg!(target_os = "linux") && !Path::new("/proc").join(planner.process.to_string()).exists();
        if planner.is_lost() || (ours && gone) {
            // Somebody else may have removed it.
            let _ = fs::remove_file(file);
        }
    }
    // What is not empty stays.
    let _ = fs::remove_dir(place);
}

fn worker(file: &Path, now: SystemTime) -> Option<Worker> {
    let json = read_json(file)?;
    let written = fs::metadata(file).and_then(|facts| facts.modified()).ok()?;
    let owner = Owner::from_json(&json)?;
    let text = |key: &str| json[key].as_str().unwrap_or_default().to_owned();
    let doing = match json["state"].as_str()? {
        "rendering" => Doing::Rendering { run: text("run"), path: text("path") },
        "left" => Doing::Left(text("reason")),
        _ => Doing::Waiting,
    };
    Some(Worker {
        name: file.file_stem()?.to_str()?.to_owned(),
        planner: file.parent()?.ends_with(PLANNERS),
        host: owner.host,
        process: owner.process,
        device: Device { key: text("device"), model: text("model") },
        job: text("job"),
        doing,
        age_s: now.duration_since(written).map_or(0.0, |d| d.as_secs_f64()),
    })
}

/// This worker's heartbeat, kept by a thread of its own until it is dropped.
#[derive(Debug)]
pub(super) struct Presence {
    file: PathBuf,
    facts: Json,
    planner: bool,
    state: Arc<Mutex<State>>,
    /// Dropping it ends the thread.
    _end: SyncSender<()>,
}

#[derive(Debug)]
struct State {
    doing: Doing,
    since: String,
    changed: bool,
}

impl Presence {
    /// Joins the workers of a folder.
    ///
    /// # Errors
    /// When the heartbeat cannot be written: nobody would know of this worker.
    pub(super) fn join(folder: &Path, owner: &Owner, me: &Me) -> Result<Presence, super::StoreError> {
        Presence::begin(folder.join(FOLDER), owner, me, false)
    }

    /// Shows workers that come that somebody plans and renders in a folder, until it is dropped.
    ///
    /// # Errors
    /// When the heartbeat cannot be written.
    pub(super) fn plan(folder: &Path, owner: &Owner, me: &Me) -> Result<Presence, super::StoreError> {
        Presence::begin(folder.join(PLANNERS), owner, me, true)
    }

    fn begin(place: PathBuf, owner: &Owner, me: &Me, planner: bool) -> Result<Presence, super::StoreError> {
        let mut facts = owner.json();
        facts["device"] = me.device.key.as_str().into();
        facts["model"] = me.device.model.as_str().into();
        facts["affinity"] = me.affinity.word().into();
        facts["job"] = me.job.as_str().into();
        facts["program"] = concat!("lumbre ", env!("CARGO_PKG_VERSION")).into();
        facts["joined"] = utc(SystemTime::now()).into();
        let file = place.join(format!("{}.json", owner.name()));
        let first = State { doing: Doing::Waiting, since: utc(SystemTime::now()), changed: false };
        write::atomic(&file, text(&facts, &first).as_bytes())?;
        let state = Arc::new(Mutex::new(first));
        let (end, ended) = sync_channel(0);
        let (beating, into, facts_too) = (Arc::clone(&state), file.clone(), facts.clone());
        let beat = move || {
            let mut last = Instant::now();
            while ended.recv_timeout(GLANCE) == Err(RecvTimeoutError::Timeout) {
                let mut state = lock(&beating);
                let left = matches!(state.doing, Doing::Left(_));
                if !left && (state.changed || last.elapsed() >= HEARTBEAT) {
                    state.changed = false;
                    last = Instant::now();
                    // A beat that is missed costs nothing yet. The lock is kept, so that none comes after the word that it left.
                    let _ = write::atomic(&into, text(&facts_too, &state).as_bytes());
                }
            }
        };
        if let Err(e) = std::thread::Builder::new().name("heartbeat".to_owned()).spawn(beat) {
            tracing::warn!("others will not see that this worker is alive: {e}");
        }
        Ok(Presence { file, facts, planner, state, _end: end })
    }

    /// Says what the worker does; others know within seconds, and at once that it left.
    pub(super) fn say(&self, doing: Doing) {
        let mut state = lock(&self.state);
        if state.doing == doing || matches!(state.doing, Doing::Left(_)) {
            return;
        }
        let leaves = matches!(doing, Doing::Left(_));
        *state = State { doing, since: utc(SystemTime::now()), changed: !leaves };
        if leaves && let Err(e) = write::atomic(&self.file, text(&self.facts, &state).as_bytes()) {
            tracing::warn!("others will take this worker for lost: {e}");
        }
    }
}

impl Drop for Presence {
    fn drop(&mut self) {
        if self.planner {
            let mut state = lock(&self.state);
            state.doing = Doing::Left(String::new());
            // What stays is taken for lost, and removed by the next planner.
            let _ = fs::remove_file(&self.file);
            let _ = self.file.parent().map(fs::remove_dir);
        }
    }
}

fn text(facts: &Json, state: &State) -> String {
    let mut json = facts.clone();
    json["state"] = state.doing.word().into();
    json["since"] = state.since.as_str().into();
    match &state.doing {
        Doing::Waiting => {}
        Doing::Rendering { run, path } => {
            json["run"] = json!(run);
            json["path"] = json!(path);
        }
        Doing::Left(reason) => json["reason"] = json!(reason),
    }
    json.to_string() + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn me(key: &str) -> Me {
        let device = Device { key: key.to_owned(), model: "a lens".to_owned() };
        Me { device, affinity: Affinity::Device, job: "7_1".to_owned() }
    }

    #[test]
    fn a_worker_is_seen_until_it_leaves_and_lost_when_it_falls_silent() {
        let dir = tempfile::tempdir().unwrap();
        assert!(crew(dir.path()).is_empty());
        let owners = [Owner::here(), Owner::here()];
        let a = Presence::join(dir.path(), &owners[0], &me("a")).unwrap();
        let b = Presence::join(dir.path(), &owners[1], &me("b")).unwrap();
        a.say(Doing::Left("all is done".to_owned()));
        a.say(Doing::Waiting);
        drop(b);
        let file = dir.path().join(FOLDER).join(format!("{}.json", owners[1].name()));
        let find = |owner: &Owner| crew(dir.path()).into_iter().find(|w| w.name == owner.name()).unwrap();
        let first = find(&owners[0]);
        assert_eq!((first.doing, first.job.as_str()), (Doing::Left("all is done".to_owned()), "7_1"));
        let second = find(&owners[1]);
        assert!(second.is_here() && second.device == me("b").device && second.process == std::process::id());
        let old = SystemTime::now() - 2 * LEASE;
        fs::File::options().write(true).open(&file).unwrap().set_modified(old).unwrap();
        assert!(find(&owners[1]).is_lost() && !find(&owners[0]).is_lost());
    }

    #[test]
    fn a_planner_is_seen_while_it_renders_and_leaves_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let first = Presence::plan(dir.path(), &Owner::here(), &me("a")).unwrap();
        first.say(Doing::Rendering { run: "ab".to_owned(), path: "depth=2".to_owned() });
        let seen = crew(dir.path());
        assert!(seen.len() == 1 && seen[0].planner && seen[0].is_here() && seen[0].device == me("a").device);
        // One that was killed long ago, and one of a process that is no more.
        for dead in [false, true] {
            let lost = Presence::plan(dir.path(), &Owner::here(), &me("b")).unwrap();
            let file = lost.file.clone();
            std::mem::forget(lost);
            if dead {
                let text = fs::read_to_string(&file).unwrap();
                let gone = text.replace(&format!(":{}", std::process::id()), ":4294967295");
                assert_ne!(gone, text);
                fs::write(&file, gone).unwrap();
            } else {
                let old = SystemTime::now() - 2 * LEASE;
                fs::File::options().write(true).open(&file).unwrap().set_modified(old).unwrap();
            }
            assert_eq!(crew(dir.path()).len(), 2);
            sweep_planners(dir.path());
            assert!(!file.exists());
        }
        assert_eq!(crew(dir.path()).len(), 1, "who lives stays");
        drop(first);
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
