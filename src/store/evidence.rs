//! Reading a whole night back from its folder, finished or not, for reports. Nothing here writes or locks.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{first_invalid, read_json};
use super::{Store, StoreError, layout, rows, seal};
use crate::experiment::evidence::{Machine, Night, Run, State, Truth};
use crate::experiment::{CellResult, Outcome, Plan, WaveRow};
use crate::metrics::MetricSpec;
use crate::value::Value;

/// Reads a night from its folder, which holds a `plan.json`. References are looked for in the folder `refs` beside it,
/// and runs that an earlier night of the same name finished in that night's folder, as the runner does.
///
/// # Errors
/// When the folder holds no plan. What else is missing or damaged becomes a note.
pub fn night(folder: &Path) -> Result<Night, StoreError> {
    // `out/latest` is a link; what is beside it is beside the folder that it points at.
    let folder = &fs::canonicalize(folder).map_err(|e| StoreError::io("read", folder, &e))?;
    let plan = read_json(&folder.join("plan.json")).ok_or_else(|| StoreError::Io {
        action: "read",
        path: folder.join("plan.json"),
        reason: "it is not there or not whole; expected the folder of a night, such as out/latest".to_owned(),
        full: false,
    })?;
    let out = folder.parent().unwrap_or(folder);
    let name = text(&plan["name"]);
    let mut notes = absent(&plan);
    let mut reader = Reader { folder, elsewhere: elsewhere(out, &name), notes: &mut notes, metrics: Vec::new() };
    // Doubles of the A/A check are no results.
    let cells = list(&plan["cells"]).iter().filter(|cell| cell["control"].is_null());
    let runs: Vec<Run> = cells.map(|cell| reader.run(cell)).collect();
    let metrics = std::mem::take(&mut reader.metrics);
    let references = list(&plan["references"]).iter().map(|reference| truth(out, reference)).collect();
    Ok(Night {
        folder: folder.clone(),
        name,
        plan: text(&plan["hash"]),
        seed: plan["seed"].as_u64().unwrap_or(0),
        axes: list(&plan["axes"]).iter().map(text).collect(),
        metrics,
        machine: read_json(&folder.join("env.json")).map(|env| machine(&env)),
        runs,
        references,
        notes,
    })
}

/// The other program behind a technique as it called itself: the last part of its device.
fn peer(integrator: &str, done: &Json) -> Option<String> {
    let device = done["device"].as_str().filter(|_| integrator.starts_with("external:"))?;
    device.rsplit_once(", ").map(|(_, program)| program.to_owned())
}

/// What the machine lacked for points that were left out, each reason once.
fn absent(plan: &Json) -> Vec<String> {
    let mut reasons: Vec<(String, usize)> = Vec::new();
    for skipped in list(&plan["skipped"]).iter().filter(|s| s["absent"] == true) {
        let reason = text(&skipped["reason"]);
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => reasons.push((reason, 1)),
        }
    }
    let words = |(reason, count): (String, usize)| match count {
        1 => format!("1 point of the sweep is left out: {reason}"),
        _ => format!("{count} points of the sweep are left out: {reason}"),
    };
    reasons.into_iter().map(words).collect()
}

/// The folders of finished runs of all nights with this name, by run.
fn elsewhere(out: &Path, name: &str) -> BTreeMap<String, PathBuf> {
    let runs = layout::siblings(out, name).into_iter().flat_map(|night| layout::runs_below(&night.join("runs")));
    let finished = runs.filter(|run| run.join("done.json").is_file());
    finished.filter_map(|run| Some((run.file_name()?.to_str()?.to_owned(), run))).collect()
}

struct Reader<'a> {
    folder: &'a Path,
    elsewhere: BTreeMap<String, PathBuf>,
    notes: &'a mut Vec<String>,
    metrics: Vec<MetricSpec>,
}

impl Reader<'_> {
    fn run(&mut self, cell: &Json) -> Run {
        let id = text(&cell["run"]);
        let own = self.folder.join("runs").join(text(&cell["folder"]));
        let folder = match self.elsewhere.get(&id) {
            Some(other) if !own.join("done.json").is_file() => other.clone(),
            _ => own,
        };
        let sealed = read_json(&folder.join("done.json"));
        let done = sealed.filter(|done| match seal::glance(&folder, done) {
            Ok(()) => true,
            Err(reason) => {
                self.notes.push(format!("{}: {reason}; the run does not count as finished", folder.display()));
                false
            }
        });
        let config = read_json(&folder.join("config.json")).unwrap_or(Json::Null);
        self.learn_metrics(&config);
        let rows = self.rows(&folder, done.as_ref());
        let render = &config["render"];
        let state = match &done {
            Some(done) => State::Done(text(&done["reason"])),
            None if rows.is_empty() => State::Pending,
            None => State::Unfinished,
        };
        let side = |i: usize| render["resolution"].get(i).and_then(Json::as_u64).and_then(|n| u32::try_from(n).ok());
        let floors = done.as_ref().and_then(|done| done["floors"].as_object().cloned()).unwrap_or_default();
        let floors = floors.into_iter().filter_map(|(column, value)| Some((column, value.as_f64()?)));
        let films = done.as_ref().map(|done| list(&done["films"]).iter().map(text).collect());
        Run {
            path: text(&cell["path"]),
            point: point(&cell["point"]),
            repeat: cell["repeat"].as_u64().unwrap_or(0),
            seed: cell["seed"].as_u64().unwrap_or(0),
            integrator: text(&cell["integrator"]),
            scene: render["scene"].as_str().map(str::to_owned).unwrap_or_default(),
            resolution: side(0).zip(side(1)).map(|(w, h)| [w, h]),
            device: done.as_ref().and_then(device),
            peer: done.as_ref().and_then(|done| peer(&text(&cell["integrator"]), done)),
            accel: done.as_ref().and_then(|d| Some((d["accel_build_s"].as_f64()?, d["accel_nodes"].as_u64()?))),
            accel_size: done.as_ref().and_then(|d| Some((d["accel_bytes"].as_u64()?, d["accel_cost"].as_f64()?))),
            reference: cell["reference"].as_u64().and_then(|n| usize::try_from(n).ok()),
            pictures: pictures(&folder, done.as_ref()),
            films: films.unwrap_or_default(),
            floors: floors.collect(),
            state,
            rows,
            id,
            folder,
        }
    }

    /// The definitions of the metrics, which every run's identity carries; all measured runs of a plan have the same.
    fn learn_metrics(&mut self, config: &Json) {
        if !self.metrics.is_empty() {
            return;
        }
        for metric in list(&config["identity"]["measure"]["metrics"]) {
            let column = text(&metric["column"]);
            let options = match Value::from_json(&metric["value"]["options"]) {
                Value::Map(options) => options,
                _ => BTreeMap::new(),
            };
            match MetricSpec::new(&column, &text(&metric["value"]["metric"]), options) {
                Ok(spec) => self.metrics.push(spec),
                Err(e) => self.notes.push(format!("column `{column}` is left out: {e}")),
            }
        }
    }

    /// A run's measurements, with the metrics that are known, in their order.
    fn rows(&mut self, folder: &Path, done: Option<&Json>) -> Vec<WaveRow> {
        let Ok(csv) = fs::read_to_string(folder.join("metrics.csv")) else { return Vec::new() };
        if !csv.contains('\n') {
            return Vec::new();
        }
        let (columns, rows) = match rows::parse(&csv) {
            Ok(read) => read,
            Err(problem) => {
                self.notes.push(format!("{}: {problem}", folder.join("metrics.csv").display()));
                return Vec::new();
            }
        };
        let places: Vec<Option<usize>> =
            self.metrics.iter().map(|metric| columns.iter().position(|c| *c == metric.column)).collect();
        let measured = !columns.is_empty();
        let first_invalid = done.and_then(first_invalid);
        let pick = |row: &WaveRow| -> Vec<f64> {
            places.iter().map(|place| place.map_or(f64::NAN, |place| row.metrics[place])).collect()
        };
        rows.into_iter()
            .map(|row| WaveRow {
                metrics: if measured { pick(&row) } else { Vec::new() },
                first_invalid: first_invalid.filter(|_| row.invalid > 0),
                ..row
            })
            .collect()
    }
}

impl Store {
    /// What a cell was rendered on, as its folder says, if it is done.
    pub fn device(&self, plan: &Plan, result: &CellResult) -> Option<String> {
        let folder = match &result.outcome {
            Outcome::Cached(folder) => folder.clone(),
            Outcome::Done(_) => self.place(plan, result.cell),
            Outcome::Failed(_) | Outcome::Interrupted => return None,
        };
        device(&read_json(&folder.join("done.json"))?)
    }
}

/// What a run was rendered on. The `cpu` backend only says how many threads it had: which processor that was, the run
/// says too, since workers of one night may have several.
fn device(done: &Json) -> Option<String> {
    let device = done["device"].as_str()?;
    let threads = device.strip_prefix("cpu, ").and_then(|rest| rest.split(',').find(|part| part.contains("thread")));
    match (threads, done["processor"].as_str()) {
        (Some(threads), Some(processor)) if !processor.is_empty() => Some(format!("{processor}, {}", threads.trim())),
        _ => Some(device.to_owned()),
    }
}

/// The kept pictures of a run by samples per pixel.
fn pictures(folder: &Path, done: Option<&Json>) -> Vec<(u64, PathBuf)> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let samples = name.strip_prefix("snap-").and_then(|n| n.strip_suffix(".exr")).and_then(|n| n.parse().ok());
        if let Some(samples) = samples {
            found.insert(samples, entry.path());
        }
    }
    let last = folder.join("final.exr");
    if let Some(samples) = done.and_then(|done| done["samples"].as_u64()).filter(|_| last.is_file()) {
        found.insert(samples, last);
    }
    found.into_iter().collect()
}

fn truth(out: &Path, reference: &Json) -> Truth {
    let id = text(&reference["run"]);
    let shelf = out.join("refs").join(id.get(..2).unwrap_or("00")).join(&id);
    if reference["kind"] == "file" {
        let file = PathBuf::from(text(&reference["source"]));
        let name = file.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        let maker = reference["made_by"].as_str().filter(|by| !by.is_empty()).map(|by| format!(", {by}"));
        let words = format!("{name}{}, its noise unknown", maker.unwrap_or_default());
        let copy = shelf.join(layout::imported(&file));
        let picture = [file, copy].into_iter().find(|file| file.is_file());
        return Truth { id, picture, words };
    }
    let facts = read_json(&shelf.join("ref.json"));
    let integrator = text(&reference["source"]["integrator"]);
    let words = match facts.as_ref().and_then(|f| f["samples"].as_u64()) {
        Some(samples) => format!("{integrator}, {samples} samples per pixel"),
        None => format!("{integrator}, not finished"),
    };
    let picture = shelf.join("ref.exr");
    Truth { id, picture: picture.is_file().then_some(picture), words }
}

fn machine(env: &Json) -> Machine {
    Machine {
        host: text(&env["host"]),
        os: text(&env["os"]),
        cpu: text(&env["cpu"]),
        cores: env["cores"].as_u64().unwrap_or(0),
        program: text(&env["program"]),
        date: text(&env["date"]),
        arguments: list(&env["arguments"]).iter().map(text).collect(),
    }
}

fn point(json: &Json) -> Vec<(String, Value)> {
    let fields = json.as_object().into_iter().flatten();
    fields.map(|(axis, value)| (axis.clone(), Value::from_json(value))).collect()
}

fn list(json: &Json) -> &[Json] {
    json.as_array().map_or(&[], Vec::as_slice)
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}
