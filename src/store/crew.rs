//! Who works in an experiment's folder when there are many: every worker's heartbeat, `workers/<name>.json`, beside its
//! own journal, `workers/<name>.jsonl`. Nobody writes another's file, and no file is appended to by two.

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

/// Every worker that ever joined an experiment's folder, ordered by name.
pub fn crew(folder: &Path) -> Vec<Worker> {
    let place = folder.join(FOLDER);
    let files = fs::read_dir(&place).into_iter().flatten().flatten().map(|entry| entry.path());
    let mut files: Vec<PathBuf> = files.filter(|f| f.extension().is_some_and(|e| e == "json")).collect();
    if files.is_empty() {
        return Vec::new();
    }
    files.sort();
    // A copy that cannot be written to is read by this machine's clock.
    let now = write::now_in(&place).unwrap_or_else(|_| SystemTime::now());
    files.iter().filter_map(|file| worker(file, now)).collect()
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
        let mut facts = owner.json();
        facts["device"] = me.device.key.as_str().into();
        facts["model"] = me.device.model.as_str().into();
        facts["affinity"] = me.affinity.word().into();
        facts["job"] = me.job.as_str().into();
        facts["program"] = concat!("lumbre ", env!("CARGO_PKG_VERSION")).into();
        facts["joined"] = utc(SystemTime::now()).into();
        let file = folder.join(FOLDER).join(format!("{}.json", owner.name()));
        let first = State { doing: Doing::Waiting, since: utc(SystemTime::now()), changed: false };
        write::atomic(&file, text(&facts, &first).as_bytes())?;
        let state = Arc::new(Mutex::new(first));
        let (end, ended) = sync_channel(0);
        let (beating, into, facts_too) = (Arc::clone(&state), file.clone(), facts.clone());
        let beat = move || {
            let mut last = Instant::now();
            while ended.recv_timeout(GLANCE) == Err(RecvTimeoutError::Timeout) {
                let mut state = lock(&beating);
                if state.changed || last.elapsed() >= HEARTBEAT {
                    state.changed = false;
                    let text = text(&facts_too, &state);
                    drop(state);
                    last = Instant::now();
                    // A beat that is missed costs nothing yet.
                    let _ = write::atomic(&into, text.as_bytes());
                }
            }
        };
        if let Err(e) = std::thread::Builder::new().name("heartbeat".to_owned()).spawn(beat) {
            tracing::warn!("others will not see that this worker is alive: {e}");
        }
        Ok(Presence { file, facts, state, _end: end })
    }

    /// Says what the worker does; others know within seconds, and at once that it left.
    pub(super) fn say(&self, doing: Doing) {
        let mut state = lock(&self.state);
        if state.doing == doing || matches!(state.doing, Doing::Left(_)) {
            return;
        }
        let leaves = matches!(doing, Doing::Left(_));
        *state = State { doing, since: utc(SystemTime::now()), changed: !leaves };
        if leaves {
            let text = text(&self.facts, &state);
            drop(state);
            if let Err(e) = write::atomic(&self.file, text.as_bytes()) {
                tracing::warn!("others will take this worker for lost: {e}");
            }
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
}
