//! Reads a whole night from its folder, finished or not, for reports. Nothing here writes or locks.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::archive::{first_invalid, read_json};
use crate::experiment::night_results::{
    Machine, NightResults, ReferenceResult, RunResult, RunState,
};
use crate::experiment::{CellResult, Outcome, Plan, WaveRow};
use crate::metrics::MetricSpec;
use crate::store::write::{manifest_checksum, metrics_csv};
use crate::store::{Store, StoreError, layout};
use lumbre_light::value::Value;

/// Reads a night from its folder, which holds a `plan.json`. References are read from the folder
/// `refs` beside it, and runs that an earlier night of the same name finished from that night's
/// folder.
///
/// # Errors
/// When the folder holds no plan. Everything else that is missing or damaged becomes a note.
pub fn read_night(folder: &Path) -> Result<NightResults, StoreError> {
    // `out/latest` is a link; siblings are those of the folder that it points at.
    let folder = &fs::canonicalize(folder).map_err(|e| StoreError::io("read", folder, &e))?;
    let plan = read_json(&folder.join("plan.json")).ok_or_else(|| StoreError::Io {
        action: "read",
        path: folder.join("plan.json"),
        reason: "it is missing or damaged; expected the folder of a night, such as out/latest"
            .to_owned(),
        full: false,
    })?;
    let out = folder.parent().unwrap_or(folder);
    let name = text(&plan["name"]);
    let mut notes = missing_support(&plan);
    let mut reader = NightReader {
        folder,
        elsewhere: layout::finished_runs(layout::siblings(out, &name)),
        notes: &mut notes,
        metrics: Vec::new(),
    };
    // Duplicate cells of the A/A check are no results.
    let cells = list(&plan["cells"])
        .iter()
        .filter(|cell| cell["control"].is_null());
    let runs: Vec<RunResult> = cells.map(|cell| reader.run(cell)).collect();
    let metrics = std::mem::take(&mut reader.metrics);
    let references = list(&plan["references"])
        .iter()
        .map(|reference| reference_result(out, reference))
        .collect();
    Ok(NightResults {
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

/// Name and version of the external program that rendered a run: the last part of its device.
fn external_program(integrator: &str, done: &Json) -> Option<String> {
    let device = done["device"]
        .as_str()
        .filter(|_| integrator.starts_with("external:"))?;
    device
        .rsplit_once(", ")
        .map(|(_, program)| program.to_owned())
}

/// Describes points that were skipped because the machine lacks support, each reason once.
fn missing_support(plan: &Json) -> Vec<String> {
    let mut reasons: Vec<(String, usize)> = Vec::new();
    for skipped in list(&plan["skipped"])
        .iter()
        .filter(|s| s["absent"] == true)
    {
        let reason = text(&skipped["reason"]);
        match reasons.iter_mut().find(|(known, _)| *known == reason) {
            Some((_, count)) => *count += 1,
            None => reasons.push((reason, 1)),
        }
    }
    let note = |(reason, count): (String, usize)| match count {
        1 => format!("1 point of the sweep is left out: {reason}"),
        _ => format!("{count} points of the sweep are left out: {reason}"),
    };
    reasons.into_iter().map(note).collect()
}

/// State while the runs of a night are read.
struct NightReader<'a> {
    folder: &'a Path,
    /// Folders of the finished runs of all nights with this name, by run id.
    elsewhere: BTreeMap<String, PathBuf>,
    notes: &'a mut Vec<String>,
    metrics: Vec<MetricSpec>,
}

impl NightReader<'_> {
    /// Reads the run of a cell.
    fn run(&mut self, cell: &Json) -> RunResult {
        let id = text(&cell["run"]);
        let own = self.folder.join("runs").join(text(&cell["folder"]));
        let folder = match self.elsewhere.get(&id) {
            Some(other) if !own.join("done.json").is_file() => other.clone(),
            _ => own,
        };
        let done = self.read_manifest(&folder);
        let config = read_json(&folder.join("config.json")).unwrap_or(Json::Null);
        self.read_metrics(&config);
        let rows = self.rows(&folder, done.as_ref());
        let render = &config["render"];
        let state = match &done {
            Some(done) => RunState::Done(text(&done["reason"])),
            None if rows.is_empty() => RunState::Pending,
            None => RunState::Unfinished,
        };
        let side = |i: usize| {
            render["resolution"]
                .get(i)
                .and_then(Json::as_u64)
                .and_then(|n| u32::try_from(n).ok())
        };
        let pictures = pictures(&folder, done.as_ref());
        let done = done.unwrap_or(Json::Null);
        let floors = done["floors"].as_object().into_iter().flatten();
        let floors = floors.filter_map(|(column, value)| Some((column.clone(), value.as_f64()?)));
        let accel_build = (&done["accel_build_s"], &done["accel_nodes"]);
        let accel_size = (&done["accel_bytes"], &done["accel_cost"]);
        RunResult {
            path: text(&cell["path"]),
            point: point(&cell["point"]),
            repeat: cell["repeat"].as_u64().unwrap_or(0),
            seed: cell["seed"].as_u64().unwrap_or(0),
            integrator: text(&cell["integrator"]),
            scene: render["scene"]
                .as_str()
                .map(str::to_owned)
                .unwrap_or_default(),
            resolution: side(0).zip(side(1)).map(|(w, h)| [w, h]),
            device: device(&done),
            peer: external_program(&text(&cell["integrator"]), &done),
            accel: accel_build.0.as_f64().zip(accel_build.1.as_u64()),
            accel_size: accel_size.0.as_u64().zip(accel_size.1.as_f64()),
            reference: cell["reference"]
                .as_u64()
                .and_then(|n| usize::try_from(n).ok()),
            pictures,
            films: list(&done["films"]).iter().map(text).collect(),
            floors: floors.collect(),
            state,
            rows,
            id,
            folder,
        }
    }

    /// Reads the last file of a run. Returns `None` if the run is not finished, or, with a note, if
    /// it is damaged.
    fn read_manifest(&mut self, folder: &Path) -> Option<Json> {
        let done = read_json(&folder.join("done.json"))?;
        if let Err(problem) = manifest_checksum::verify_sizes(folder, &done) {
            self.notes.push(format!(
                "{}: {problem}; the run is treated as unfinished",
                folder.display()
            ));
            return None;
        }
        Some(done)
    }

    /// Reads the definitions of the metrics, which are equal in all measured runs of a plan.
    fn read_metrics(&mut self, config: &Json) {
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
                Err(e) => self
                    .notes
                    .push(format!("column `{column}` is left out: {e}")),
            }
        }
    }

    /// Measurements of a run, with the known metrics in their order.
    fn rows(&mut self, folder: &Path, done: Option<&Json>) -> Vec<WaveRow> {
        let Ok(csv) = fs::read_to_string(folder.join("metrics.csv")) else {
            return Vec::new();
        };
        if !csv.contains('\n') {
            return Vec::new();
        }
        let (columns, rows) = match metrics_csv::parse(&csv) {
            Ok(read) => read,
            Err(problem) => {
                self.notes.push(format!(
                    "{}: {problem}",
                    folder.join("metrics.csv").display()
                ));
                return Vec::new();
            }
        };
        let indices: Vec<Option<usize>> = self
            .metrics
            .iter()
            .map(|metric| columns.iter().position(|c| *c == metric.column))
            .collect();
        let measured = !columns.is_empty();
        let first_invalid = done.and_then(first_invalid);
        let pick = |row: &WaveRow| -> Vec<f64> {
            indices
                .iter()
                .map(|index| index.map_or(f64::NAN, |i| row.metrics[i]))
                .collect()
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
    /// Device that a cell was rendered on, if it is done.
    pub fn device(&self, plan: &Plan, result: &CellResult) -> Option<String> {
        let folder = match &result.outcome {
            Outcome::Cached(folder) => folder.clone(),
            Outcome::Done(_) => self.run_folder(plan, result.cell),
            Outcome::Failed(_) | Outcome::Interrupted => return None,
        };
        device(&read_json(&folder.join("done.json"))?)
    }
}

/// Device that a run was rendered on. The `cpu` backend reports its number of threads; the model of
/// the processor is added, since workers of one night may differ.
fn device(done: &Json) -> Option<String> {
    let device = done["device"].as_str()?;
    let threads = device
        .strip_prefix("cpu, ")
        .and_then(|rest| rest.split(',').find(|part| part.contains("thread")));
    match (threads, done["processor"].as_str()) {
        (Some(threads), Some(processor)) if !processor.is_empty() => {
            Some(format!("{processor}, {}", threads.trim()))
        }
        _ => Some(device.to_owned()),
    }
}

/// Stored images of a run, by samples per pixel.
fn pictures(folder: &Path, done: Option<&Json>) -> Vec<(u64, PathBuf)> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let samples = name
            .strip_prefix("snap-")
            .and_then(|n| n.strip_suffix(".exr"))
            .and_then(|n| n.parse().ok());
        if let Some(samples) = samples {
            found.insert(samples, entry.path());
        }
    }
    let last = folder.join("final.exr");
    if let Some(samples) = done
        .and_then(|done| done["samples"].as_u64())
        .filter(|_| last.is_file())
    {
        found.insert(samples, last);
    }
    found.into_iter().collect()
}

fn reference_result(out: &Path, reference: &Json) -> ReferenceResult {
    let id = text(&reference["run"]);
    let folder = out.join("refs").join(id.get(..2).unwrap_or("00")).join(&id);
    if reference["kind"] == "file" {
        let file = PathBuf::from(text(&reference["source"]));
        let name = file
            .file_name()
            .map(|n| n.to_string_lossy().into_owned())
            .unwrap_or_default();
        let maker = reference["made_by"]
            .as_str()
            .filter(|by| !by.is_empty())
            .map(|by| format!(", {by}"));
        let description = format!("{name}{}, its noise unknown", maker.unwrap_or_default());
        let copy = folder.join(layout::imported_file_name(&file));
        let picture = [file, copy].into_iter().find(|file| file.is_file());
        return ReferenceResult {
            id,
            picture,
            description,
        };
    }
    let facts = read_json(&folder.join("ref.json"));
    let integrator = text(&reference["source"]["integrator"]);
    let description = match facts.as_ref().and_then(|f| f["samples"].as_u64()) {
        Some(samples) => format!("{integrator}, {samples} samples per pixel"),
        None => format!("{integrator}, not finished"),
    };
    let picture = folder.join("ref.exr");
    ReferenceResult {
        id,
        picture: picture.is_file().then_some(picture),
        description,
    }
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
    fields
        .map(|(axis, value)| (axis.clone(), Value::from_json(value)))
        .collect()
}

fn list(json: &Json) -> &[Json] {
    json.as_array().map_or(&[], Vec::as_slice)
}

fn text(json: &Json) -> String {
    json.as_str().unwrap_or_default().to_owned()
}
