//! Finds a finished run by its id and renders it again from the configuration in its folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::Value as Json;

use crate::backends::backend;
use crate::cli::args::Global;
use crate::cli::night::load::decode_picture;
use crate::experiment::shards::split;
use crate::script;
use crate::store;
use lumbre_light::film::layer::Layer;
use lumbre_light::film::{Film, Image};
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::scene::desc::content_hash;
use lumbre_light::scene::{CompiledScene, SceneDesc, edit};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::integrator::external::is_external;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::path_time::Timing;
use lumbre_light::transport::sampler::sampler;
use lumbre_light::value::Value;
use lumbre_render::hierarchy::AccelSpec;
use lumbre_render::reference_halves::ReferenceHalves;
use lumbre_render::{Job, Renderer, external};

/// Maximum number of samples per pixel rendered in one call.
const SAMPLES_PER_STEP: u64 = 64;

/// Finished run, read from its folder.
pub struct StoredRun {
    /// Id of the run.
    pub run: String,
    /// Readable path of the run, or its id.
    pub name: String,
    /// Picture to reproduce.
    pub image: Image,
    /// Number of samples per pixel of the picture.
    pub samples: u64,
    config: Json,
    scene_hash: Option<String>,
    /// Folder in which the night was started; paths in the configuration are relative to it.
    started_in: Option<PathBuf>,
}

/// Finds a run in the file's own folder, in the night that contains the file, or below `out`.
/// `samples` selects a snapshot with this number of samples per pixel if there is one.
///
/// # Errors
/// Returns a message if the run is not found, is not finished, or its picture cannot be read.
pub fn find(id: &str, file: &Path, out: &Path, samples: Option<u64>) -> Result<StoredRun, String> {
    let folder = find_folder(id, file, out)?;
    let record = store::read_run(out, &folder.to_string_lossy()).map_err(|e| e.to_string())?;
    let done = record.done.unwrap_or(Json::Null);
    let total = done["samples"].as_u64();
    let reference = folder.join("ref.exr");
    let last = if reference.is_file() {
        reference
    } else {
        folder.join("final.exr")
    };
    // A snapshot that exists only as PNG cannot be compared; the last picture of its run is used.
    let snapshot = samples
        .filter(|s| Some(*s) != total)
        .map(|s| folder.join(format!("snap-{s}.exr")));
    let (picture, samples) = match snapshot.filter(|file| file.is_file()) {
        Some(file) => (file, samples),
        None => (last, total),
    };
    let samples = samples.ok_or_else(|| format!("{} is not finished", folder.display()))?;
    let bytes = std::fs::read(&picture).map_err(|e| format!("{}: {e}", picture.display()))?;
    let image = decode_picture(&bytes).map_err(|e| format!("{}: {e}", picture.display()))?;
    let name = record.config["path"]
        .as_str()
        .filter(|p| !p.is_empty())
        .unwrap_or(id)
        .to_owned();
    let scene_hash = done["scene_hash"].as_str().map(str::to_owned);
    let started_in = started_in(&folder);
    Ok(StoredRun {
        run: id.to_owned(),
        name,
        image,
        samples,
        config: record.config,
        scene_hash,
        started_in,
    })
}

/// Returns the folder of a run, searched for as [`find`] describes.
fn find_folder(id: &str, file: &Path, out: &Path) -> Result<PathBuf, String> {
    let file = std::fs::canonicalize(file).map_err(|e| format!("{}: {e}", file.display()))?;
    for folder in file.ancestors() {
        if folder.file_name().is_some_and(|name| name == id) && folder.join("config.json").is_file()
        {
            return Ok(folder.to_owned());
        }
        if folder.join("plan.json").is_file()
            && let Ok(night) = store::read::night_reader::read_night(folder)
            && let Some(run) = night
                .runs
                .into_iter()
                .find(|run| run.id == id && run.folder.is_dir())
        {
            return Ok(run.folder);
        }
    }
    store::read_run(out, id)
        .map(|record| record.folder)
        .map_err(|e| e.to_string())
}

/// Returns the folder in which the night that contains `folder` was started, from its `env.json`.
fn started_in(folder: &Path) -> Option<PathBuf> {
    let env = folder
        .ancestors()
        .find_map(|above| std::fs::read(above.join("env.json")).ok())?;
    serde_json::from_slice::<Json>(&env).ok()?["folder"]
        .as_str()
        .map(PathBuf::from)
}

/// Loads the scene, the job and the name of the backend of a running or finished run from its
/// folder. For a reference, the job is that of its first half.
///
/// # Errors
/// Returns a message if the configuration or a file that it names cannot be read.
pub fn load_job(
    folder: &Path,
    global: &Global,
) -> Result<(Arc<CompiledScene>, Job, String), String> {
    let file = folder.join("config.json");
    let bytes = std::fs::read(&file).map_err(|e| format!("{}: {e}", file.display()))?;
    let config: Json =
        serde_json::from_slice(&bytes).map_err(|e| format!("{}: {e}", file.display()))?;
    let folder = std::fs::canonicalize(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let scene = load_scene(&config["render"], started_in(&folder).as_deref(), global)?;
    let sharing = accel_spec(&config["render"]).instances;
    let (compiled, _) = compile_sharing(&scene, sharing).map_err(|e| e.to_string())?;
    let seed = [&config["seed"], &config["seeds"][0]]
        .into_iter()
        .find_map(Json::as_u64);
    let job = Job {
        seed: seed.ok_or("config.json of the run has no seed")?,
        ..job_from_config(&config["render"], &scene, global)?
    };
    Ok((
        Arc::new(compiled),
        job,
        text(&config["render"], "backend")?.to_owned(),
    ))
}

/// Returns a string of the `render` table of a configuration.
fn text<'a>(render: &'a Json, key: &str) -> Result<&'a str, String> {
    render[key]
        .as_str()
        .ok_or_else(|| format!("config.json of the run has no `render.{key}`"))
}

/// Returns the options of the acceleration structure in a `render` table.
fn accel_spec(render: &Json) -> AccelSpec {
    match Value::from_json(&render["accel"]) {
        Value::Map(accel) => AccelSpec::from_identity(&accel),
        _ => AccelSpec::default(),
    }
}

/// Builds the job of a `render` table, without its seed.
fn job_from_config(render: &Json, scene: &SceneDesc, global: &Global) -> Result<Job, String> {
    let integer = |json: &Json| json.as_u64().and_then(|n| u32::try_from(n).ok());
    let pair = |json: &Json| Some([integer(&json[0])?, integer(&json[1])?]);
    let name = text(render, "integrator")?;
    let kind = render["aa"]["filter"]
        .as_str()
        .and_then(FilterKind::from_name);
    let radius = render["aa"]["radius"]
        .as_f64()
        .ok_or("config.json of the run has no `render.aa.radius`")? as f32;
    let films = render["films"]
        .as_array()
        .into_iter()
        .flatten()
        .filter_map(Json::as_str);
    let params = match Value::from_json(&render["params"]) {
        Value::Map(params) => params,
        _ => Default::default(),
    };
    let film = Value::from_json(&render["film"]);
    let timing = film
        .as_map()
        .map_or(Ok(None), |film| Timing::from_film(film, "film"))
        .map_err(|e| e.to_string())?;
    Ok(Job {
        integrator: integrator(name)
            .ok_or_else(|| format!("this version has no integrator `{name}`"))?,
        params,
        resolution: pair(&render["resolution"]).unwrap_or(scene.resolution),
        max_depth: integer(&render["max_depth"]).unwrap_or(scene.max_depth),
        rr_start: integer(&render["rr_start"]),
        filter: FilterSpec {
            kind: kind.ok_or("the pixel filter of the run is unknown")?,
            radius,
        },
        layers: films.filter_map(Layer::from_name).collect(),
        timing,
        sampler: text(render, "sampler")
            .map(sampler)?
            .ok_or("the sampler of the run is unknown")?,
        accel: accel_spec(render),
        seed: 0,
        first_sample: 0,
        threads: global.threads,
    })
}

/// Renders a run again.
///
/// # Errors
/// Returns a message if a file that the configuration names is missing or has changed, or the run
/// cannot be rendered on this machine.
pub fn render(stored: &StoredRun, global: &Global) -> Result<Film, String> {
    let render = &stored.config["render"];
    let scene = load_scene(render, stored.started_in.as_deref(), global)?;
    let hash = blake3::Hash::from(content_hash(&scene))
        .to_hex()
        .to_string();
    if let Some(before) = stored.scene_hash.as_ref().filter(|before| **before != hash) {
        let name = text(render, "scene")?;
        return Err(format!(
            "the scene {name} has changed (its hash is {hash:.8}, but was {before:.8})"
        ));
    }
    let (compiled, _) =
        compile_sharing(&scene, accel_spec(render).instances).map_err(|e| e.to_string())?;
    let job = job_from_config(render, &scene, global)?;
    let backend_name = global
        .backend
        .as_deref()
        .map_or_else(|| text(render, "backend"), Ok)?;
    let compiled = Arc::new(compiled);
    let row = if is_external(job.integrator) {
        external::probe(&job.params)?;
        None
    } else {
        let row =
            backend(backend_name).ok_or_else(|| format!("there is no backend `{backend_name}`"))?;
        (row.probe)().map_err(|reason| {
            format!("backend `{backend_name}` is not available on this machine: {reason}")
        })?;
        Some(row)
    };
    let open = |seed: u64, first_sample: u64| {
        let job = Job {
            seed,
            first_sample,
            ..job.clone()
        };
        let opened = match row {
            None => external::open(&scene, &job),
            Some(row) => (row.open)(Arc::clone(&compiled), job),
        };
        opened.map_err(|e| e.to_string())
    };
    let seed = |json: &Json| {
        json.as_u64()
            .ok_or_else(|| "config.json of the run has no seed".to_owned())
    };
    if let Some([first, second]) = stored.config["seeds"].as_array().map(Vec::as_slice) {
        return render_reference(stored, [seed(first)?, seed(second)?], &open);
    }
    let renderer = open(seed(&stored.config["seed"])?, 0)?;
    let renderer = advance_to(renderer, stored.samples)?;
    Ok(renderer.film().clone())
}

/// Renders a reference again: its two halves, shard by shard if it was rendered in shards. `open`
/// opens a renderer with a seed and the index of its first sample.
fn render_reference(
    stored: &StoredRun,
    [first, second]: [u64; 2],
    open: &dyn Fn(u64, u64) -> Result<Box<dyn Renderer>, String>,
) -> Result<Film, String> {
    let size = stored.config["part"]
        .as_u64()
        .unwrap_or(stored.samples)
        .max(2);
    let mut sums: Option<[Film; 2]> = None;
    for shard in split(0, size, stored.samples) {
        let at = shard.first / 2;
        let halves = ReferenceHalves::new([open(first, at)?, open(second, at)?]);
        let renderer = advance_to(Box::new(halves), shard.end - shard.first)?;
        let Some(films) = renderer.halves() else {
            return Ok(renderer.film().clone());
        };
        sums = Some(match sums {
            Some([a, b]) => [Film::pooled(&a, &films[0]), Film::pooled(&b, &films[1])],
            None => films.map(Arc::unwrap_or_clone),
        });
    }
    let [a, b] = sums.ok_or("the reference has no samples")?;
    Ok(Film::pooled(&a, &b))
}

/// Renders until there are `samples` samples per pixel.
fn advance_to(mut renderer: Box<dyn Renderer>, samples: u64) -> Result<Box<dyn Renderer>, String> {
    while renderer.film().samples < samples {
        let left = samples - renderer.film().samples;
        let stats = renderer
            .advance(left.min(SAMPLES_PER_STEP))
            .map_err(|e| e.to_string())?;
        if stats.samples == 0 {
            return Err("the renderer added no samples".to_owned());
        }
    }
    Ok(renderer)
}

/// Loads the scene of a `render` table with its changes. Its path is relative to the current folder
/// or to the folder in which the night was started.
fn load_scene(
    render: &Json,
    started_in: Option<&Path>,
    global: &Global,
) -> Result<SceneDesc, String> {
    let names = ["scene_file", "scene"]
        .iter()
        .filter_map(|key| render[*key].as_str());
    let candidates: Vec<PathBuf> = names
        .flat_map(|name| [Some(PathBuf::from(name)), started_in.map(|s| s.join(name))])
        .flatten()
        .collect();
    let file = candidates.iter().find(|path| path.is_file());
    let file = file.ok_or_else(|| {
        format!(
            "the scene of the run was not found; tried {}",
            candidates
                .iter()
                .map(|p| p.display().to_string())
                .collect::<Vec<_>>()
                .join(", ")
        )
    })?;
    let options = match Value::from_json(&render["scene_options"]) {
        Value::Map(options) => options,
        _ => Default::default(),
    };
    let (mut scene, _) =
        script::scene::read(file, &options, global.missing()).map_err(|e| e.to_string())?;
    if let Value::Map(changes) = Value::from_json(&render["set"]) {
        edit::apply(&mut scene, &changes).map_err(|e| e.to_string())?;
    }
    Ok(scene)
}
