//! What is there: experiments, their runs and their states, read from files alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{first_invalid, read_json};
use super::{FILMS, StoreError, failure, layout, rows};
use crate::experiment::WaveRow;

/// How far a run is.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunState {
    /// Finished here, for this reason.
    Done(String),
    /// Finished in another folder of the same experiment.
    Elsewhere(PathBuf),
    /// Its last try failed, for this reason.
    Failed(String),
    /// Started and neither finished nor failed: it is running, or was cut off.
    Unfinished,
    /// Not started.
    Pending,
}

impl RunState {
    /// One word: `done`, `elsewhere`, `failed`, `unfinished`, `pending`.
    pub fn word(&self) -> &'static str {
        match self {
            RunState::Done(_) => "done",
            RunState::Elsewhere(_) => "elsewhere",
            RunState::Failed(_) => "failed",
            RunState::Unfinished => "unfinished",
            RunState::Pending => "pending",
        }
    }
}

/// One run of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct RunEntry {
    /// Its id.
    pub run: String,
    /// Readable path; empty for references.
    pub path: String,
    /// Its folder, whether or not it is there.
    pub folder: PathBuf,
    /// How far it is.
    pub state: RunState,
    /// Samples per pixel at the end, if it is done.
    pub samples: Option<u64>,
    /// Render time in seconds at the end, if it is done.
    pub render_s: Option<f64>,
}

/// One experiment folder.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentEntry {
    /// The folder.
    pub folder: PathBuf,
    /// The experiment's name.
    pub name: String,
    /// The plan's hash.
    pub hash: String,
    /// The runs of its cells, in the order of the plan.
    pub runs: Vec<RunEntry>,
    /// The references it renders.
    pub references: Vec<RunEntry>,
}

/// Every experiment below `out`, ordered by folder. An `out` that is not there holds none.
pub fn list(out: &Path) -> Vec<ExperimentEntry> {
    let plans: Vec<(PathBuf, Json)> = layout::folders_in(out)
        .into_iter()
        .filter_map(|folder| read_json(&folder.join("plan.json")).map(|plan| (folder, plan)))
        .collect();
    let mut finished: BTreeMap<(String, String), PathBuf> = BTreeMap::new();
    for (folder, plan) in &plans {
        for run in layout::runs_below(&folder.join("runs")) {
            if let Some(id) = run.file_name().and_then(|n| n.to_str())
                && run.join("done.json").is_file()
            {
                finished.insert((text(&plan["name"]), id.to_owned()), run.clone());
            }
        }
    }
    plans.iter().map(|(folder, plan)| entry(out, folder, plan, &finished)).collect()
}

fn entry(out: &Path, folder: &Path, plan: &Json, finished: &BTreeMap<(String, String), PathBuf>) -> ExperimentEntry {
    let name = text(&plan["name"]);
    let state = |run: &str, place: &Path, marker: &str| -> (RunState, Option<Json>) {
        if let Some(done) = read_json(&place.join(marker)) {
            return (RunState::Done(text(&done["reason"])), Some(done));
        }
        if let Some(other) = finished.get(&(name.clone(), run.to_owned())) {
            return (RunState::Elsewhere(other.clone()), read_json(&other.join("done.json")));
        }
        let state = match failure::read(place) {
            Some(failure) => RunState::Failed(failure.reason),
            None if place.exists() => RunState::Unfinished,
            None => RunState::Pending,
        };
        (state, None)
    };
    let make = |run: String, path: String, place: PathBuf, marker: &str| {
        let (state, done) = state(&run, &place, marker);
        let done = done.unwrap_or(Json::Null);
        let (samples, render_s) = (done["samples"].as_u64(), done["render_s"].as_f64());
        RunEntry { run, path, folder: place, state, samples, render_s }
    };
    let list = |key: &str| plan[key].as_array().cloned().unwrap_or_default();
    let runs = list("cells").into_iter().map(|cell| {
        let place = folder.join("runs").join(text(&cell["folder"]));
        make(text(&cell["run"]), text(&cell["path"]), place, "done.json")
    });
    let references = list("references").into_iter().filter(|r| r["kind"] == "render").map(|reference| {
        let id = text(&reference["run"]);
        let place = layout::reference_folder(out, &crate::experiment::RunId(id.clone()));
        make(id, String::new(), place, "ref.json")
    });
    ExperimentEntry {
        folder: folder.to_owned(),
        hash: text(&plan["hash"]),
        runs: runs.collect(),
        references: references.collect(),
        name: name.clone(),
    }
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}

/// Name and size of a file; nothing of a folder.
fn file(entry: &fs::DirEntry, folder: &str) -> Option<(String, u64)> {
    let facts = entry.metadata().ok().filter(fs::Metadata::is_file)?;
    Some((format!("{folder}{}", entry.file_name().to_string_lossy()), facts.len()))
}

/// Everything that a run's folder says.
#[derive(Clone, Debug, PartialEq)]
pub struct RunRecord {
    /// Its folder.
    pub folder: PathBuf,
    /// `config.json`.
    pub config: Json,
    /// `done.json` or `ref.json`, if the run is finished.
    pub done: Option<Json>,
    /// Metric columns.
    pub columns: Vec<String>,
    /// Measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// Names and sizes in bytes of its files, ordered by name.
    pub files: Vec<(String, u64)>,
}

/// Reads a run by its folder, or by the first digits of its id among all runs and references below `out`.
///
/// # Errors
/// When no run or more than one matches, or a file of it cannot be read.
pub fn read_run(out: &Path, what: &str) -> Result<RunRecord, StoreError> {
    let given = Path::new(what);
    if given.join("config.json").is_file() {
        return record(given);
    }
    let missing =
        |hint: &str| StoreError::NoSuchRun { what: what.to_owned(), out: out.to_owned(), hint: format!(" ({hint})") };
    if given.join("plan.json").is_file() {
        return Err(missing("that is an experiment's folder; `lumbre ls` lists its runs"));
    }
    if what.is_empty() || !what.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(missing("expected a run's folder or the first digits of its id; `lumbre ls` lists them"));
    }
    let prefix = what.to_ascii_lowercase();
    let named = |run: &PathBuf| run.file_name().and_then(|n| n.to_str()).is_some_and(|n| n.starts_with(&prefix));
    let shelves = layout::folders_in(&out.join("refs"));
    let experiments = layout::folders_in(out).into_iter().map(|folder| folder.join("runs"));
    let found: Vec<PathBuf> =
        experiments.chain(shelves).flat_map(|folder| layout::runs_below(&folder)).filter(named).collect();
    match found.as_slice() {
        [] => Err(missing("`lumbre ls` lists what is there")),
        [one] => record(one),
        several => Err(StoreError::Ambiguous {
            what: what.to_owned(),
            candidates: several.iter().take(8).map(|p| p.display().to_string()).collect(),
        }),
    }
}

fn record(folder: &Path) -> Result<RunRecord, StoreError> {
    let broken =
        |name: &str, reason: String| StoreError::Io { action: "read", path: folder.join(name), reason, full: false };
    let config = read_json(&folder.join("config.json"))
        .ok_or_else(|| broken("config.json", "it is not whole JSON".to_owned()))?;
    let done = read_json(&folder.join("done.json")).or_else(|| read_json(&folder.join("ref.json")));
    let (columns, mut rows) = match fs::read_to_string(folder.join("metrics.csv")) {
        Ok(csv) if csv.contains('\n') => rows::parse(&csv).map_err(|problem| broken("metrics.csv", problem))?,
        _ => Default::default(),
    };
    let first_invalid = done.as_ref().and_then(first_invalid);
    rows.iter_mut().filter(|r| r.invalid > 0).for_each(|r| r.first_invalid = first_invalid);
    let entries = fs::read_dir(folder).map_err(|e| StoreError::io("read", folder, &e))?.flatten();
    let mut files: Vec<(String, u64)> = entries.filter_map(|e| file(&e, "")).collect();
    let films = fs::read_dir(folder.join(FILMS)).into_iter().flatten().flatten();
    files.extend(films.filter_map(|e| file(&e, &format!("{FILMS}/"))));
    files.sort();
    Ok(RunRecord { folder: folder.to_owned(), config, done, columns, rows, files })
}
