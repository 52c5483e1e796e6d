//! Reading what earlier nights left. Nothing here writes.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::{FILMS, HALVES, NOISE, layout, rows, seal, sums};
use crate::experiment::event::{FinishedRun, History};
use crate::experiment::floors::HalfImages;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::{CellRef, Plan, SinkError, WaveRow};
use crate::film::Image;
use crate::render::OpenStats;

/// Decodes the bytes of a picture; the error is for people. Handed in, because this room knows no image format.
pub type Decode = fn(&[u8]) -> Result<Image, String>;

/// The finished runs and references below one `out/`.
#[derive(Debug)]
pub struct Archive {
    out: PathBuf,
    own: Option<PathBuf>,
    /// Whether a finished run was whole when every byte of it was read, by its folder and the hash in its last file;
    /// without it sizes are enough.
    inspected: Option<RefCell<BTreeMap<(PathBuf, String), bool>>>,
    /// What was said of folders, so that it is said once.
    told: RefCell<BTreeSet<(PathBuf, String)>>,
    decode: Decode,
    /// Folders of finished runs by experiment name and run id, filled when a name is first asked for.
    index: RefCell<BTreeMap<String, BTreeMap<String, PathBuf>>>,
}

impl Archive {
    /// What lies below `out`, which need not exist.
    pub fn new(out: &Path, decode: Decode) -> Archive {
        Archive {
            out: out.to_owned(),
            own: None,
            inspected: None,
            told: RefCell::default(),
            decode,
            index: RefCell::default(),
        }
    }

    /// The same, looking into one experiment's folder first and always afresh, and taking nothing for finished whose
    /// bytes have changed.
    pub(super) fn for_experiment(out: &Path, own: &Path, decode: Decode) -> Archive {
        Archive { own: Some(own.to_owned()), inspected: Some(RefCell::default()), ..Archive::new(out, decode) }
    }

    /// The same for a worker, which cannot walk all folders and read every byte of what a thousand others finish: it is
    /// told what lies elsewhere, and looks at sizes.
    pub(super) fn for_worker(
        out: &Path,
        own: &Path,
        decode: Decode,
        name: &str,
        elsewhere: BTreeMap<String, PathBuf>,
    ) -> Archive {
        let index = RefCell::new(BTreeMap::from([(name.to_owned(), elsewhere)]));
        Archive { own: Some(own.to_owned()), index, ..Archive::new(out, decode) }
    }

    /// Remembers where a run is about to be written, so that its twin in the same plan finds it.
    pub(super) fn expect(&self, name: &str, id: &str, folder: &Path) {
        if self.indexed(name, id).is_none() {
            let mut index = self.index.borrow_mut();
            index.entry(name.to_owned()).or_default().insert(id.to_owned(), folder.to_owned());
        }
    }

    /// The folder of a finished run of any experiment with this name.
    fn indexed(&self, name: &str, id: &str) -> Option<PathBuf> {
        let mut index = self.index.borrow_mut();
        let runs = index.entry(name.to_owned()).or_insert_with(|| {
            let all = layout::siblings(&self.out, name).into_iter().flat_map(|f| layout::runs_below(&f.join("runs")));
            let finished = all.filter(|run| run.join("done.json").is_file());
            finished.filter_map(|run| Some((run.file_name()?.to_str()?.to_owned(), run))).collect()
        });
        runs.get(id).cloned()
    }
}

impl Archive {
    /// Samples per pixel of the shorter reference from which one goes on that is not there, if there is one.
    pub fn begun(&self, plan: &Plan, reference: usize) -> Option<u64> {
        let ReferenceSource::Render { stem, stop, .. } = &plan.references.get(reference)?.source else { return None };
        sums::samples(&self.out, &stem.0, stop.sample_limit()?)
    }

    fn read(&self, file: &Path) -> Result<Image, String> {
        let bytes = fs::read(file).map_err(|e| format!("cannot be read: {e}"))?;
        (self.decode)(&bytes)
    }

    /// A run that says it is finished, unless something about it is not as it was; that is told once.
    fn sound(&self, folder: &Path, looked: Result<Option<FinishedRun>, String>) -> Option<FinishedRun> {
        match looked {
            Ok(run) => run,
            Err(problem) => {
                if self.inspected.is_some() && self.told.borrow_mut().insert((folder.to_owned(), problem.clone())) {
                    tracing::warn!("{}: {problem}; the run is rendered again", folder.display());
                }
                None
            }
        }
    }

    /// A finished run whose files are what they were when it was finished, if that is looked at.
    fn whole(&self, run: FinishedRun) -> Option<FinishedRun> {
        let Some(inspected) = &self.inspected else { return Some(run) };
        let marker = ["done.json", "ref.json"].iter().find_map(|name| read_json(&run.folder.join(name)))?;
        let key = (run.folder.clone(), marker["check"].as_str().unwrap_or_default().to_owned());
        let known = inspected.borrow().get(&key).copied();
        let whole = known.unwrap_or_else(|| {
            let problem = seal::inspect(&run.folder, &marker).err();
            if let Some(problem) = &problem {
                tracing::warn!("{}: {problem}; the run is rendered again", run.folder.display());
            }
            problem.is_none()
        });
        inspected.borrow_mut().insert(key, whole);
        whole.then_some(run)
    }
}

impl History for Archive {
    fn done(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun> {
        match cell {
            CellRef::Cell(i) => {
                let cell = plan.cells.get(i)?;
                let columns = if cell.reference.is_some() { plan.columns() } else { Vec::new() };
                let look = |folder: PathBuf| {
                    let looked = finished(&folder, &cell.id.0, "done.json", "final.exr", &columns);
                    self.whole(self.sound(&folder, looked)?)
                };
                let here = self.own.as_ref().and_then(|own| look(layout::run_folder(own, cell)));
                here.or_else(|| look(self.indexed(&plan.name, &cell.id.0)?))
            }
            CellRef::Reference(i) => {
                // A file is no run: what is kept of it here is a copy.
                let reference = plan.references.get(i).filter(|reference| reference.stem().is_some())?;
                let folder = layout::reference_folder(&self.out, &reference.id);
                let looked = finished(&folder, &reference.id.0, "ref.json", "ref.exr", &[]);
                self.whole(self.sound(&folder, looked)?)
            }
        }
    }

    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else { return Ok(None) };
        let (file, advice) = match &wanted.source {
            ReferenceSource::File { file, .. } => (file.clone(), ""),
            ReferenceSource::Render { .. } => match self.done(plan, CellRef::Reference(reference)) {
                Some(run) => (run.folder.join("ref.exr"), " (delete its folder to have it rendered again)"),
                None => return Ok(None),
            },
        };
        self.read(&file).map(Some).map_err(|problem| SinkError(format!("{}: {problem}{advice}", file.display())))
    }

    fn noise(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else { return Ok(None) };
        let file = layout::reference_folder(&self.out, &wanted.id).join(NOISE);
        if !file.is_file() {
            return Ok(None);
        }
        self.read(&file).map(Some).map_err(|problem| SinkError(format!("{}: {problem}", file.display())))
    }

    fn halves(&self, plan: &Plan, reference: usize) -> Result<Option<HalfImages>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else { return Ok(None) };
        let folder = layout::reference_folder(&self.out, &wanted.id);
        let known = read_json(&folder.join("ref.json")).filter(|done| done["run"].as_str() == Some(&wanted.id.0));
        let samples = |done: &Json| Some([0, 1].map(|i: usize| done["halves"].get(i).and_then(Json::as_u64)));
        let Some([Some(first), Some(second)]) = known.as_ref().and_then(samples) else { return Ok(None) };
        let read = |name: &str| {
            let file = folder.join(name);
            self.read(&file).map_err(|problem| SinkError(format!("{}: {problem}", file.display())))
        };
        Ok(Some(HalfImages { means: [read(HALVES[0])?, read(HALVES[1])?], samples: [first, second] }))
    }
}

/// A finished run, if the folder holds one: its last file is there and says so, its picture and the films that it names
/// are there, and its measurements can be read and have the columns that are asked for.
///
/// # Errors
/// What is wrong with a run whose last file says that it is finished, in words.
fn finished(
    folder: &Path,
    id: &str,
    marker: &str,
    picture: &str,
    columns: &[String],
) -> Result<Option<FinishedRun>, String> {
    let Ok(bytes) = fs::read(folder.join(marker)) else { return Ok(None) };
    let Ok(done) = serde_json::from_slice::<Json>(&bytes) else { return Err(format!("{marker} is damaged")) };
    seal::glance(folder, &done)?;
    if done["run"].as_str() != Some(id) {
        return Ok(None);
    }
    let missing = |file: &str| Err(format!("{file} is missing"));
    if !folder.join(picture).is_file() {
        return missing(picture);
    }
    for film in done["films"].as_array().into_iter().flatten().filter_map(Json::as_str) {
        let file = format!("{FILMS}/{film}.exr");
        if !folder.join(&file).is_file() {
            return missing(&file);
        }
    }
    let text =
        fs::read_to_string(folder.join("metrics.csv")).map_err(|e| format!("metrics.csv cannot be read: {e}"))?;
    let (found, rows) = rows::parse(&text).map_err(|problem| format!("metrics.csv is damaged: {problem}"))?;
    let place = |c: &String| found.iter().position(|f| f == c).ok_or_else(|| format!("metrics.csv has no column {c}"));
    let places: Vec<usize> = columns.iter().map(place).collect::<Result<_, String>>()?;
    let first_invalid = first_invalid(&done);
    let rows = rows.into_iter().map(|row| WaveRow {
        metrics: places.iter().map(|p| row.metrics[*p]).collect(),
        first_invalid: first_invalid.filter(|_| row.invalid > 0),
        ..row
    });
    let floor = |column: &String| done["floors"].get(column).and_then(number);
    let floors = if done["floors"].is_object() { columns.iter().map(floor).collect() } else { Vec::new() };
    let open = open_stats(&done);
    Ok(Some(FinishedRun { folder: folder.to_owned(), rows: rows.collect(), floors: floors.into(), open }))
}

/// What a run's last file, or the journal, says of how it was opened.
pub(super) fn open_stats(json: &Json) -> OpenStats {
    OpenStats {
        device: json["device"].as_str().unwrap_or_default().to_owned(),
        accel_build_s: json["accel_build_s"].as_f64().unwrap_or(0.0),
        accel_nodes: json["accel_nodes"].as_u64().unwrap_or(0),
        accel_bytes: json["accel_bytes"].as_u64().unwrap_or(0),
        accel_cost: json["accel_cost"].as_f64().unwrap_or(0.0),
        ..OpenStats::default()
    }
}

/// A number as Lumbre writes it into JSON, which has no infinities.
fn number(json: &Json) -> Option<f64> {
    json.as_f64().or_else(|| json.as_str()?.parse().ok())
}

/// The place of the first invalid sample as a `done.json` states it.
pub(super) fn first_invalid(done: &Json) -> Option<[u64; 3]> {
    let at = |i: usize| done["first_invalid"].get(i).and_then(Json::as_u64);
    Some([at(0)?, at(1)?, at(2)?])
}

/// A JSON file, if it is there and whole.
pub(super) fn read_json(path: &Path) -> Option<Json> {
    serde_json::from_slice(&fs::read(path).ok()?).ok()
}
