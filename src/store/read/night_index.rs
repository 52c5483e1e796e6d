//! Lists experiments, their runs and the states of these, read from files alone.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{first_invalid, read_json};
use super::run_index::RunIndex;
use crate::experiment::{RunId, WaveRow};
use crate::store::write::{failure, metrics_csv};
use crate::store::{FILMS, StoreError, layout};

/// State of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RunState {
    /// Finished in its own folder, for this reason.
    Done(String),
    /// Finished in another folder of the same experiment.
    Elsewhere(PathBuf),
    /// The last attempt failed, for this reason.
    Failed(String),
    /// Started, but neither finished nor failed: it is running or was interrupted.
    Unfinished,
    /// The run was not started.
    Pending,
}

impl RunState {
    /// Name of the state: `done`, `elsewhere`, `failed`, `unfinished` or `pending`.
    pub fn name(&self) -> &'static str {
        match self {
            RunState::Done(_) => "done",
            RunState::Elsewhere(_) => "elsewhere",
            RunState::Failed(_) => "failed",
            RunState::Unfinished => "unfinished",
            RunState::Pending => "pending",
        }
    }
}

/// One run or reference of an experiment.
#[derive(Clone, Debug, PartialEq)]
pub struct RunEntry {
    /// Id of the run.
    pub run: String,
    /// Readable path; empty for references.
    pub path: String,
    /// Folder of the run, which need not exist.
    pub folder: PathBuf,
    /// State of the run.
    pub state: RunState,
    /// Samples per pixel of a finished run.
    pub samples: Option<u64>,
    /// Render time of a finished run in seconds.
    pub render_s: Option<f64>,
}

/// One experiment folder.
#[derive(Clone, Debug, PartialEq)]
pub struct ExperimentEntry {
    /// Folder of the experiment.
    pub folder: PathBuf,
    /// Name of the experiment.
    pub name: String,
    /// Hash of the plan.
    pub hash: String,
    /// Runs of the cells, in the order of the plan.
    pub runs: Vec<RunEntry>,
    /// References that the experiment renders.
    pub references: Vec<RunEntry>,
}

/// Lists the experiments below `out`, ordered by folder. A missing `out` has none. Finished runs
/// are read through the index, which is updated.
pub fn list_experiments(out: &Path) -> Vec<ExperimentEntry> {
    let plans: Vec<(PathBuf, Json)> = layout::folders_in(out)
        .into_iter()
        .filter_map(|folder| read_json(&folder.join("plan.json")).map(|plan| (folder, plan)))
        .collect();
    let mut index = RunIndex::open(out);
    let listed = plans
        .iter()
        .map(|(folder, plan)| experiment_entry(out, folder, plan, &mut index))
        .collect();
    index.save();
    listed
}

/// Lists the finished runs of this experiment in the folders beside `folder`, by id.
pub(crate) fn finished_in_siblings(
    out: &Path,
    name: &str,
    folder: &Path,
) -> BTreeMap<String, PathBuf> {
    let siblings = layout::siblings(out, name);
    layout::finished_runs(siblings.into_iter().filter(|other| other != folder))
}

fn experiment_entry(
    out: &Path,
    folder: &Path,
    plan: &Json,
    index: &mut RunIndex,
) -> ExperimentEntry {
    let list = |key: &str| plan[key].as_array().map_or(&[][..], Vec::as_slice);
    let mut reader = EntryReader {
        out,
        experiment: folder,
        name: text(&plan["name"]),
        index,
        finished_here: BTreeMap::new(),
        finished_in_siblings: None,
    };
    let mut runs = Vec::new();
    for cell in list("cells") {
        let run_folder = folder
            .join("runs")
            .join(cell["folder"].as_str().unwrap_or_default());
        let (run, path) = (text(&cell["run"]), text(&cell["path"]));
        runs.push(reader.entry(run, path, run_folder, "done.json"));
    }
    let mut references = Vec::new();
    for reference in list("references").iter().filter(|r| r["kind"] == "render") {
        let run = text(&reference["run"]);
        let run_folder = layout::reference_folder(out, &RunId(run.clone()));
        references.push(reader.entry(run, String::new(), run_folder, "ref.json"));
    }
    ExperimentEntry {
        folder: folder.to_owned(),
        name: reader.name,
        hash: text(&plan["hash"]),
        runs,
        references,
    }
}

/// State while the runs of one experiment are listed.
struct EntryReader<'a> {
    out: &'a Path,
    experiment: &'a Path,
    name: String,
    index: &'a mut RunIndex,
    /// Folders of the finished runs that were listed before, by run id.
    finished_here: BTreeMap<String, PathBuf>,
    /// Folders of the finished runs of sibling experiments, by run id. Read when it is first needed
    /// since scanning is slow.
    finished_in_siblings: Option<BTreeMap<String, PathBuf>>,
}

impl EntryReader<'_> {
    /// Determines the state of a run. `marker` is the name of its last file.
    fn entry(&mut self, run: String, path: String, folder: PathBuf, marker: &str) -> RunEntry {
        let (state, finished) = if let Some(finished) = self.index.finished(&folder, marker) {
            self.finished_here
                .entry(run.clone())
                .or_insert_with(|| folder.clone());
            (RunState::Done(finished.reason.clone()), Some(finished))
        } else if let Some(other) = self.finished_here.get(&run) {
            let finished = self.index.finished(other, marker);
            (RunState::Elsewhere(other.clone()), finished)
        } else if let Some(other) = self
            .finished_in_siblings
            .get_or_insert_with(|| finished_in_siblings(self.out, &self.name, self.experiment))
            .get(&run)
        {
            let finished = self.index.finished(other, "done.json");
            (RunState::Elsewhere(other.clone()), finished)
        } else if let Some(failure) = failure::read(&folder) {
            (RunState::Failed(failure.reason), None)
        } else if folder.exists() {
            (RunState::Unfinished, None)
        } else {
            (RunState::Pending, None)
        };
        let finished = finished.unwrap_or_default();
        RunEntry {
            run,
            path,
            folder,
            state,
            samples: finished.samples,
            render_s: finished.render_s,
        }
    }
}

/// Folder of the experiment that was run last, which `latest` points at.
pub fn latest_experiment(out: &Path) -> Option<PathBuf> {
    let link = out.join("latest");
    let target = match fs::read_link(&link) {
        Ok(target) => target,
        // On systems without links, it is a text file with the name.
        Err(_) => PathBuf::from(fs::read_to_string(&link).ok()?.trim()),
    };
    let folder = out.join(target);
    folder.join("plan.json").is_file().then_some(folder)
}

/// Folder of the run that the latest experiment's journal names last.
fn latest_run(out: &Path) -> Option<PathBuf> {
    let folder = latest_experiment(out)?;
    let plan = read_json(&folder.join("plan.json"))?;
    let journal = fs::read_to_string(folder.join("journal.jsonl")).ok()?;
    let lines = journal
        .lines()
        .rev()
        .filter_map(|line| serde_json::from_str::<Json>(line).ok());
    let ids = lines.filter_map(|line| Some(line["run"].as_str()?.to_owned()));
    let cells = plan["cells"].as_array()?;
    let run_folder = |id: &str| {
        let cell = cells.iter().find(|cell| cell["run"] == id)?;
        Some(folder.join("runs").join(cell["folder"].as_str()?))
    };
    ids.filter_map(|id| run_folder(&id))
        .find(|run| run.join("config.json").is_file())
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}

/// Name and size in bytes of a file. Returns `None` for a folder.
fn file(entry: &fs::DirEntry, folder: &str) -> Option<(String, u64)> {
    let facts = entry.metadata().ok().filter(fs::Metadata::is_file)?;
    Some((
        format!("{folder}{}", entry.file_name().to_string_lossy()),
        facts.len(),
    ))
}

/// Content of a run's folder.
#[derive(Clone, Debug, PartialEq)]
pub struct RunRecord {
    /// Folder of the run.
    pub folder: PathBuf,
    /// Content of `config.json`.
    pub config: Json,
    /// Content of `done.json` or `ref.json`, if the run is finished.
    pub done: Option<Json>,
    /// Names of the metric columns.
    pub columns: Vec<String>,
    /// Measurements, oldest first.
    pub rows: Vec<WaveRow>,
    /// Names and sizes in bytes of the files, ordered by name.
    pub files: Vec<(String, u64)>,
}

/// Reads a run, selected by its folder, by the first digits of its id among all runs and references
/// below `out`, or as `latest`: the cell that started or ended last in the latest experiment.
///
/// # Errors
/// When no run or more than one matches, or a file of it cannot be read.
pub fn read_run(out: &Path, what: &str) -> Result<RunRecord, StoreError> {
    let given = Path::new(what);
    if given.join("config.json").is_file() {
        return read_record(given);
    }
    let missing = |hint: &str| StoreError::NoSuchRun {
        what: what.to_owned(),
        out: out.to_owned(),
        hint: format!(" ({hint})"),
    };
    if given.join("plan.json").is_file() {
        return Err(missing(
            "this is an experiment's folder; `lumbre ls` lists its runs",
        ));
    }
    if what == "latest" {
        let run = latest_run(out).ok_or_else(|| missing("nothing has been rendered there yet"))?;
        return read_record(&run);
    }
    if what.is_empty() || !what.bytes().all(|b| b.is_ascii_hexdigit()) {
        return Err(missing(
            "expected a run's folder, the first digits of its id, or `latest`; `lumbre ls` lists \
             all runs",
        ));
    }
    let prefix = what.to_ascii_lowercase();
    let named = |run: &PathBuf| {
        run.file_name()
            .and_then(|n| n.to_str())
            .is_some_and(|n| n.starts_with(&prefix))
    };
    let shelves = layout::folders_in(&out.join("refs"));
    let experiments = layout::folders_in(out)
        .into_iter()
        .map(|folder| folder.join("runs"));
    let found: Vec<PathBuf> = experiments
        .chain(shelves)
        .flat_map(|folder| layout::runs_below(&folder))
        .filter(named)
        .collect();
    match found.as_slice() {
        [] => Err(missing("`lumbre ls` lists all runs")),
        [one] => read_record(one),
        several => Err(StoreError::Ambiguous {
            what: what.to_owned(),
            candidates: several
                .iter()
                .take(8)
                .map(|p| p.display().to_string())
                .collect(),
        }),
    }
}

fn read_record(folder: &Path) -> Result<RunRecord, StoreError> {
    let broken = |name: &str, reason: String| StoreError::Io {
        action: "read",
        path: folder.join(name),
        reason,
        full: false,
    };
    let config = read_json(&folder.join("config.json"))
        .ok_or_else(|| broken("config.json", "it is missing or not valid JSON".to_owned()))?;
    let done = read_json(&folder.join("done.json")).or_else(|| read_json(&folder.join("ref.json")));
    let (columns, mut rows) = match fs::read_to_string(folder.join("metrics.csv")) {
        Ok(csv) if csv.contains('\n') => {
            metrics_csv::parse(&csv).map_err(|problem| broken("metrics.csv", problem))?
        }
        _ => Default::default(),
    };
    let first_invalid = done.as_ref().and_then(first_invalid);
    rows.iter_mut()
        .filter(|r| r.invalid > 0)
        .for_each(|r| r.first_invalid = first_invalid);
    let entries = fs::read_dir(folder)
        .map_err(|e| StoreError::io("read", folder, &e))?
        .flatten();
    let mut files: Vec<(String, u64)> = entries.filter_map(|e| file(&e, "")).collect();
    let films = fs::read_dir(folder.join(FILMS))
        .into_iter()
        .flatten()
        .flatten();
    files.extend(films.filter_map(|e| file(&e, &format!("{FILMS}/"))));
    files.sort();
    Ok(RunRecord {
        folder: folder.to_owned(),
        config,
        done,
        columns,
        rows,
        files,
    })
}
