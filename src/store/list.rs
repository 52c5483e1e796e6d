//! What is there: experiments, their runs and their states, read from files alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{first_invalid, read_json};
use super::index::Index;
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

/// Every experiment below `out`, ordered by folder. An `out` that is not there holds none. What is finished is read
/// through the index, which is kept up to date on the way.
pub fn list(out: &Path) -> Vec<ExperimentEntry> {
    let plans: Vec<(PathBuf, Json)> = layout::folders_in(out)
        .into_iter()
        .filter_map(|folder| read_json(&folder.join("plan.json")).map(|plan| (folder, plan)))
        .collect();
    let mut index = Index::open(out);
    let listed = plans.iter().map(|(folder, plan)| entry(out, folder, plan, &mut index)).collect();
    index.save();
    listed
}

/// The finished runs of the experiments with this name in the folders beside `folder`, by id.
pub(super) fn finished_beside(out: &Path, name: &str, folder: &Path) -> BTreeMap<String, PathBuf> {
    let beside = layout::siblings(out, name).into_iter().filter(|other| other != folder);
    let runs = beside.flat_map(|other| layout::runs_below(&other.join("runs")));
    let finished = runs.filter(|run| run.join("done.json").is_file());
    finished.filter_map(|run| Some((run.file_name()?.to_str()?.to_owned(), run))).collect()
}

fn entry(out: &Path, folder: &Path, plan: &Json, index: &mut Index) -> ExperimentEntry {
    let name = text(&plan["name"]);
    // Walking other folders takes a while, and only a run that is not here needs it.
    let mut beside = None;
    let mut here: BTreeMap<String, PathBuf> = BTreeMap::new();
    let mut make = |run: String, path: String, place: PathBuf, marker: &str| {
        let (state, finished) = if let Some(finished) = index.finished(&place, marker) {
            here.entry(run.clone()).or_insert_with(|| place.clone());
            (RunState::Done(finished.reason.clone()), Some(finished))
        } else if let Some(twin) = here.get(&run) {
            (RunState::Elsewhere(twin.clone()), index.finished(twin, marker))
        } else if let Some(other) = beside.get_or_insert_with(|| finished_beside(out, &name, folder)).get(&run) {
            (RunState::Elsewhere(other.clone()), index.finished(other, "done.json"))
        } else if let Some(failure) = failure::read(&place) {
            (RunState::Failed(failure.reason), None)
        } else if place.exists() {
            (RunState::Unfinished, None)
        } else {
            (RunState::Pending, None)
        };
        let finished = finished.unwrap_or_default();
        RunEntry { run, path, folder: place, state, samples: finished.samples, render_s: finished.render_s }
    };
    let list = |key: &str| plan[key].as_array().map_or(&[][..], Vec::as_slice);
    let runs = list("cells").iter().map(|cell| {
        let place = folder.join("runs").join(cell["folder"].as_str().unwrap_or_default());
        make(text(&cell["run"]), text(&cell["path"]), place, "done.json")
    });
    let runs: Vec<RunEntry> = runs.collect();
    let references = list("references").iter().filter(|r| r["kind"] == "render").map(|reference| {
        let id = text(&reference["run"]);
        let place = layout::reference_folder(out, &crate::experiment::RunId(id.clone()));
        make(id, String::new(), place, "ref.json")
    });
    let references = references.collect();
    ExperimentEntry { folder: folder.to_owned(), hash: text(&plan["hash"]), runs, references, name }
}

/// The folder of the experiment that was run last: where `latest` points.
pub fn latest(out: &Path) -> Option<PathBuf> {
    let link = out.join("latest");
    let target = match fs::read_link(&link) {
        Ok(target) => target,
        // Where there are no links, it is a text file with the name.
        Err(_) => PathBuf::from(fs::read_to_string(&link).ok()?.trim()),
    };
    let folder = out.join(target);
    folder.join("plan.json").is_file().then_some(folder)
}

/// The run that the journal of an experiment's folder names last.
fn latest_run(out: &Path) -> Option<PathBuf> {
    let folder = latest(out)?;
    let plan = read_json(&folder.join("plan.json"))?;
    let journal = fs::read_to_string(folder.join("journal.jsonl")).ok()?;
    let lines = journal.lines().rev().filter_map(|line| serde_json::from_str::<Json>(line).ok());
    let ids = lines.filter_map(|line| Some(line["run"].as_str()?.to_owned()));
    let cells = plan["cells"].as_array()?;
    let place = |id: &str| {
        let cell = cells.iter().find(|cell| cell["run"] == id)?;
        Some(folder.join("runs").join(cell["folder"].as_str()?))
    };
    ids.filter_map(|id| place(&id)).find(|run| run.join("config.json").is_file())
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

/// Reads a run by its folder, by the first digits of its id among all runs and references below `out`, or as `latest`:
/// the cell that started or ended last in the experiment that was run last.
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
    if what == "latest" {
        let run = latest_run(out).ok_or_else(|| missing("nothing has been rendered there yet"))?;
        return record(&run);
    }
    if what.is_empty() || !what.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(missing(
            "expected a run's folder, the first digits of its id, or `latest`; `lumbre ls` lists them",
        ));
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
