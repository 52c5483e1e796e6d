//! A run found by its id, and rendered again from what its folder says.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value as Json;

use crate::cli::args::Global;
use crate::cli::load::decode;
use crate::experiment::parts::split;
use crate::film::layer::Layer;
use crate::film::{Film, Image};
use crate::render::halves::Halves;
use crate::render::hierarchy::AccelSpec;
use crate::render::{Job, Renderer, backend, external};
use crate::scene::compile::compile_sharing;
use crate::scene::desc::content_hash;
use crate::scene::{CompiledScene, SceneDesc, edit};
use crate::script;
use crate::store;
use crate::transport::camera::{FilterKind, FilterSpec};
use crate::transport::flight::Timing;
use crate::transport::integrator::external::is_external;
use crate::transport::integrator::integrator;
use crate::transport::sampler::sampler;
use crate::value::Value;

/// Samples that are added at a time.
const STEP: u64 = 64;

/// A run as its folder has it.
pub struct Stored {
    /// Its id.
    pub run: String,
    /// Its readable path, or the id.
    pub name: String,
    /// The picture that is to be made again.
    pub image: Image,
    /// Its samples per pixel.
    pub samples: u64,
    config: Json,
    scene_hash: Option<String>,
    /// The folder in which the night was started, from which its paths are meant.
    started_in: Option<PathBuf>,
}

/// Finds a run: in the file's own folder, in the night that the file lies in, or below `out`.
///
/// # Errors
/// When it is nowhere, or has no picture with that many samples; in words for people.
pub fn find(id: &str, file: &Path, out: &Path, samples: Option<u64>) -> Result<Stored, String> {
    let folder = folder_of(id, file, out)?;
    let record = store::read_run(out, &folder.to_string_lossy()).map_err(|e| e.to_string())?;
    let done = record.done.unwrap_or(Json::Null);
    let total = done["samples"].as_u64();
    let reference = folder.join("ref.exr");
    let last = if reference.is_file() { reference } else { folder.join("final.exr") };
    // A picture that is kept as PNG alone stands for its run, which is compared by its last one.
    let snapshot = samples.filter(|s| Some(*s) != total).map(|s| folder.join(format!("snap-{s}.exr")));
    let (picture, samples) = match snapshot.filter(|file| file.is_file()) {
        Some(file) => (file, samples),
        None => (last, total),
    };
    let samples = samples.ok_or_else(|| format!("{} is not finished", folder.display()))?;
    let bytes = std::fs::read(&picture).map_err(|e| format!("{}: {e}", picture.display()))?;
    let image = decode(&bytes).map_err(|e| format!("{}: {e}", picture.display()))?;
    let name = record.config["path"].as_str().filter(|p| !p.is_empty()).unwrap_or(id).to_owned();
    let scene_hash = done["scene_hash"].as_str().map(str::to_owned);
    let started_in = started_in(&folder);
    Ok(Stored { run: id.to_owned(), name, image, samples, config: record.config, scene_hash, started_in })
}

fn folder_of(id: &str, file: &Path, out: &Path) -> Result<PathBuf, String> {
    let file = std::fs::canonicalize(file).map_err(|e| format!("{}: {e}", file.display()))?;
    for folder in file.ancestors() {
        if folder.file_name().is_some_and(|name| name == id) && folder.join("config.json").is_file() {
            return Ok(folder.to_owned());
        }
        if folder.join("plan.json").is_file()
            && let Ok(night) = store::evidence::night(folder)
            && let Some(run) = night.runs.into_iter().find(|run| run.id == id && run.folder.is_dir())
        {
            return Ok(run.folder);
        }
    }
    store::read_run(out, id).map(|record| record.folder).map_err(|e| e.to_string())
}

/// Where the night that a folder belongs to was started.
fn started_in(folder: &Path) -> Option<PathBuf> {
    let env = folder.ancestors().find_map(|above| std::fs::read(above.join("env.json")).ok())?;
    serde_json::from_slice::<Json>(&env).ok()?["folder"].as_str().map(PathBuf::from)
}

/// What a run in progress or done renders, from its folder: scene, job and the name of its backend. Of a reference it is
/// the first half.
///
/// # Errors
/// When what its folder names is not there, in words for people.
pub fn job(folder: &Path, global: &Global) -> Result<(Arc<CompiledScene>, Job, String), String> {
    let file = folder.join("config.json");
    let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let config: Json = serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", file.display()))?;
    let folder = std::fs::canonicalize(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let scene = scene(&config["render"], started_in(&folder).as_deref(), global)?;
    let sharing = accel_of(&config["render"]).instances;
    let (compiled, _) = compile_sharing(&scene, sharing).map_err(|e| e.to_string())?;
    let seed = [&config["seed"], &config["seeds"][0]].into_iter().find_map(Json::as_u64);
    let job = Job { seed: seed.ok_or("its config.json has no seed")?, ..job_of(&config["render"], &scene, global)? };
    Ok((Arc::new(compiled), job, text(&config["render"], "backend")?.to_owned()))
}

fn text<'a>(render: &'a Json, key: &str) -> Result<&'a str, String> {
    render[key].as_str().ok_or_else(|| format!("its config.json has no `render.{key}`"))
}

/// How a `render` table builds the hierarchy.
fn accel_of(render: &Json) -> AccelSpec {
    match Value::from_json(&render["accel"]) {
        Value::Map(accel) => AccelSpec::from_identity(&accel),
        _ => AccelSpec::default(),
    }
}

/// The job of a `render` table, but for its seed.
fn job_of(render: &Json, scene: &SceneDesc, global: &Global) -> Result<Job, String> {
    let whole = |json: &Json| json.as_u64().and_then(|n| u32::try_from(n).ok());
    let pair = |json: &Json| Some([whole(&json[0])?, whole(&json[1])?]);
    let name = text(render, "integrator")?;
    let kind = render["aa"]["filter"].as_str().and_then(FilterKind::from_name);
    let radius = render["aa"]["radius"].as_f64().ok_or("its config.json has no `render.aa.radius`")? as f32;
    let films = render["films"].as_array().into_iter().flatten().filter_map(Json::as_str);
    let params = match Value::from_json(&render["params"]) {
        Value::Map(params) => params,
        _ => Default::default(),
    };
    let film = Value::from_json(&render["film"]);
    let timing = film.as_map().map_or(Ok(None), |film| Timing::from_film(film, "film")).map_err(|e| e.to_string())?;
    Ok(Job {
        integrator: integrator(name).ok_or_else(|| format!("there is no integrator `{name}` any more"))?,
        params,
        resolution: pair(&render["resolution"]).unwrap_or(scene.resolution),
        max_depth: whole(&render["max_depth"]).unwrap_or(scene.max_depth),
        rr_start: whole(&render["rr_start"]),
        filter: FilterSpec { kind: kind.ok_or("its pixel filter is unknown")?, radius },
        layers: films.filter_map(Layer::from_name).collect(),
        timing,
        sampler: text(render, "sampler").map(sampler)?.ok_or("its sampler is unknown")?,
        accel: accel_of(render),
        seed: 0,
        first_sample: 0,
        threads: global.threads,
    })
}

/// Renders a run again.
///
/// # Errors
/// When what its folder names is not there or is not what it was, in words for people.
pub fn render(stored: &Stored, global: &Global) -> Result<Film, String> {
    let render = &stored.config["render"];
    let scene = scene(render, stored.started_in.as_deref(), global)?;
    let hash = blake3::Hash::from(content_hash(&scene)).to_hex().to_string();
    if let Some(before) = stored.scene_hash.as_ref().filter(|before| **before != hash) {
        let name = text(render, "scene")?;
        return Err(format!("the scene {name} is not what it was (hash {hash:.8}, then {before:.8})"));
    }
    let (compiled, _) = compile_sharing(&scene, accel_of(render).instances).map_err(|e| e.to_string())?;
    let job = job_of(render, &scene, global)?;
    let wanted = global.backend.as_deref().map_or_else(|| text(render, "backend"), Ok)?;
    let compiled = Arc::new(compiled);
    let row = if is_external(job.integrator) {
        external::probe(&job.params)?;
        None
    } else {
        let row = backend(wanted).ok_or_else(|| format!("there is no backend `{wanted}`"))?;
        (row.probe)().map_err(|reason| format!("backend `{wanted}` cannot be used here: {reason}"))?;
        Some(row)
    };
    let open = |seed: u64, first_sample: u64| {
        let job = Job { seed, first_sample, ..job.clone() };
        let opened = match row {
            None => external::open(&scene, &job),
            Some(row) => (row.open)(Arc::clone(&compiled), job),
        };
        opened.map_err(|e| e.to_string())
    };
    let seed = |json: &Json| json.as_u64().ok_or_else(|| "its config.json has no seed".to_owned());
    let [first, second] = match stored.config["seeds"].as_array().map(Vec::as_slice) {
        Some([first, second]) => [seed(first)?, seed(second)?],
        _ => return Ok(rendered(open(seed(&stored.config["seed"])?, 0)?, stored.samples)?.film().clone()),
    };
    // A reference is made of two halves, and perhaps of parts.
    let size = stored.config["part"].as_u64().unwrap_or(stored.samples).max(2);
    let mut joined: Option<[Film; 2]> = None;
    for part in split(0, size, stored.samples) {
        let at = part.first / 2;
        let halves = Halves::new([open(first, at)?, open(second, at)?]);
        let renderer = rendered(Box::new(halves), part.end - part.first)?;
        let Some(own) = renderer.halves() else { return Ok(renderer.film().clone()) };
        joined = Some(match joined {
            Some([a, b]) => [Film::pooled(&a, &own[0]), Film::pooled(&b, &own[1])],
            None => own.map(Arc::unwrap_or_clone),
        });
    }
    let [a, b] = joined.ok_or("it has no samples")?;
    Ok(Film::pooled(&a, &b))
}

/// A run with so many samples per pixel.
fn rendered(mut renderer: Box<dyn Renderer>, samples: u64) -> Result<Box<dyn Renderer>, String> {
    while renderer.film().samples < samples {
        let left = samples - renderer.film().samples;
        let stats = renderer.advance(left.min(STEP)).map_err(|e| e.to_string())?;
        if stats.samples == 0 {
            return Err("the renderer adds no samples".to_owned());
        }
    }
    Ok(renderer)
}

/// The scene with its changes, from the file where it was, as seen from here or from where the night was started.
fn scene(render: &Json, started_in: Option<&Path>, global: &Global) -> Result<SceneDesc, String> {
    let names = ["scene_file", "scene"].iter().filter_map(|key| render[*key].as_str());
    let places: Vec<PathBuf> =
        names.flat_map(|name| [Some(PathBuf::from(name)), started_in.map(|s| s.join(name))]).flatten().collect();
    let file = places.iter().find(|path| path.is_file()).ok_or_else(|| {
        format!(
            "its scene is not there: {}",
            places.iter().map(|p| p.display().to_string()).collect::<Vec<_>>().join(", ")
        )
    })?;
    let options = match Value::from_json(&render["scene_options"]) {
        Value::Map(options) => options,
        _ => Default::default(),
    };
    let (mut scene, _) = script::scene::read(file, &options, global.missing()).map_err(|e| e.to_string())?;
    if let Value::Map(changes) = Value::from_json(&render["set"]) {
        edit::apply(&mut scene, &changes).map_err(|e| e.to_string())?;
    }
    Ok(scene)
}
