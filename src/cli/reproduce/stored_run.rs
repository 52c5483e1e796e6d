//! Finds a finished run by its id and renders it again from the configuration in its folder.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::cli::args::Global;
use crate::cli::night::load::decode_picture;
use lumbre_light::film::{Film, Image, SharedImage};
use lumbre_light::scene::compile::compile_sharing;
use lumbre_light::scene::desc::content_hash;
use lumbre_light::scene::{CompiledScene, SceneDesc};
use lumbre_light::transport::integrator::external::{is_declared, is_external};
use lumbre_light::transport::integrator::{integrator, own};
use lumbre_night::backends::backend;
use lumbre_night::experiment::plan::identity;
use lumbre_night::experiment::shards::split;
use lumbre_night::store::schema::plan::{EnvFile, PlanFile};
use lumbre_night::store::schema::run::{ConfigFile, DoneFile};
use lumbre_night::store::{self, Evidence, NightReader, RunReader, StoredFile};
use lumbre_render::Settings;
use lumbre_render::denoise::{self, Denoise, oidn};
use lumbre_render::external::{self, Access, words};
use lumbre_render::reference_halves::ReferenceHalves;
use lumbre_render::shaders::Shaders;
use lumbre_render::{Job, RenderError, Renderer};
use lumbre_scene_io::edit;

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
    /// Mean of the samples of the picture, if the picture is denoised and its mean is stored.
    pub raw: Option<Image>,
    /// Number of samples per pixel of the picture.
    pub samples: u64,
    /// Samples per pixel at the end of each measured wave, ascending. Other programs render a wave
    /// at a time, with a seed for each.
    waves: Vec<u64>,
    config: ConfigFile,
    scene_hash: Option<String>,
    /// Folder in which the night was started; paths in the configuration are relative to it.
    started_in: Option<PathBuf>,
}

/// Reads the run with this id from its folder. `samples` selects a snapshot with this number of
/// samples per pixel if there is one.
///
/// # Errors
/// Returns a message if the run is not finished, a file of it does not match its checksum, or its
/// configuration does not agree with its id.
pub fn read(id: &str, folder: &Path, samples: Option<u64>) -> Result<StoredRun, String> {
    let record = store::read_run(folder, &folder.to_string_lossy()).map_err(|e| e.to_string())?;
    if let Some(problem) = record.problems.first() {
        return Err(format!("{}: {problem}", folder.display()));
    }
    if record.config.run != id {
        return Err(format!("{} holds another run", folder.display()));
    }
    let results = record.done.as_ref().and_then(DoneFile::rendered);
    let total = results.map(|results| results.samples);
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
    let decoded = |file: &Path| {
        let bytes = Evidence::default().read(file)?;
        decode_picture(&bytes).map_err(|e| format!("{}: {e}", file.display()))
    };
    let image = decoded(&picture)?;
    let raw = folder.join(store::RAW);
    let raw = (Some(samples) == total && raw.is_file()).then(|| decoded(&raw));
    let name = record.config.path.as_deref().unwrap_or(id).to_owned();
    let scene_hash = identity::scene_hash(&record.config.identity).map(str::to_owned);
    let started_in = started_in(folder);
    let measured = RunReader::new(folder.to_owned()).measurements(record.done.as_ref())?;
    let rows = measured.in_order(std::iter::empty());
    Ok(StoredRun {
        waves: rows.iter().map(|row| row.samples).collect(),
        run: id.to_owned(),
        name,
        image,
        raw: raw.transpose()?,
        samples,
        config: record.config,
        scene_hash,
        started_in,
    })
}

/// Returns the folder of a run: the file's own folder, one of the night that contains the file, or
/// one below `out`.
///
/// # Errors
/// Returns a message if there is no such run.
pub fn find_folder(id: &str, file: &Path, out: &Path) -> Result<PathBuf, String> {
    let file = std::fs::canonicalize(file).map_err(|e| format!("{}: {e}", file.display()))?;
    for folder in file.ancestors() {
        if folder.file_name().is_some_and(|name| name == id)
            && folder.join(ConfigFile::NAME).is_file()
        {
            return Ok(folder.to_owned());
        }
        if folder.join(PlanFile::NAME).is_file()
            && let Ok(night) = NightReader::open(folder)
            && let Some(cells) = night.cells_by_run().get(id)
            && let Some(run) = cells.iter().find_map(|cell| night.finished_folder(*cell))
        {
            return Ok(run);
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
        .find_map(|above| EnvFile::read(above).ok())?;
    Some(PathBuf::from(env.folder))
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
    let config = RunReader::new(folder.to_owned()).config();
    let config = config.map_err(|e| e.to_string())?;
    let render = render_config(&config)?;
    let folder = std::fs::canonicalize(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    let started_in = started_in(&folder);
    let scene = load_scene(&render, started_in.as_deref(), global)?;
    let (compiled, _) =
        compile_sharing(&scene, render.accel.instances).map_err(|e| e.to_string())?;
    let seed = config.seed.or(config.seeds.map(|[first, _]| first));
    let mut job = Job {
        seed: seed.ok_or("config.json of the run has no seed")?,
        ..render.job(scene.resolution, scene.max_depth, global.threads)?
    };
    find_shaders(&mut job.settings.shaders, started_in.as_deref());
    Ok((Arc::new(compiled), job, render.backend))
}

/// Returns a warning if the technique of a run is of a shared library whose file has changed since.
pub fn library_warning(stored: &StoredRun) -> Option<String> {
    let before = identity::library_hash(&stored.config.identity)?;
    let name = &stored.config.settings()?.integrator;
    let now = own::library(integrator(name)?)?;
    (now != before).then(|| {
        format!(
            "warning: the library of `{name}` has changed since: its hash is {now:.8}, but was \
             {before:.8}"
        )
    })
}

/// Returns the settings with which a run was rendered.
fn render_config(config: &ConfigFile) -> Result<Settings, String> {
    let render = config
        .render
        .as_ref()
        .ok_or("the run is an image file and cannot be rendered")?;
    render.known().cloned().ok_or_else(|| {
        "config.json of the run has a filter, layer or time axis that this version does not know"
            .to_owned()
    })
}

/// A run that was rendered again.
pub struct Rendered {
    /// Sums of its samples.
    pub film: Film,
    /// The picture, if it is denoised.
    pub denoised: Option<SharedImage>,
}

/// Renders a run again.
///
/// # Errors
/// Returns a message if a file that the configuration names is missing or has changed, or the run
/// cannot be rendered on this machine.
pub fn render(stored: &StoredRun, global: &Global) -> Result<Rendered, String> {
    let render = &render_config(&stored.config)?;
    check_denoiser(render)?;
    let scene = load_scene(render, stored.started_in.as_deref(), global)?;
    let hash = blake3::Hash::from(content_hash(&scene))
        .to_hex()
        .to_string();
    if let Some(before) = stored.scene_hash.as_ref().filter(|before| **before != hash) {
        let name = &render.scene;
        return Err(format!(
            "the scene {name} has changed (its hash is {hash:.8}, but was {before:.8})"
        ));
    }
    let (compiled, _) =
        compile_sharing(&scene, render.accel.instances).map_err(|e| e.to_string())?;
    let mut job = render.job(scene.resolution, scene.max_depth, global.threads)?;
    find_shaders(&mut job.settings.shaders, stored.started_in.as_deref());
    let backend_name = global.backend.as_deref().unwrap_or(&render.backend);
    let compiled = Arc::new(compiled);
    let row = if is_external(job.integrator) {
        probe_external(render, &job, global)?;
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
        let start = |job: Job| match row {
            None => {
                let access = Access {
                    commands: global.allow_commands,
                    cancelled: &|| false,
                };
                external::open(&scene, &render.integrator, &job, &access)
            }
            Some(row) => (row.open)(Arc::clone(&compiled), job),
        };
        let opened = denoise::open::<RenderError>(job, start);
        opened.map_err(|e| e.to_string())
    };
    let waves = if row.is_none() {
        stored.waves.as_slice()
    } else {
        &[]
    };
    if let Some(seeds) = stored.config.seeds {
        let film = render_reference(stored, seeds, waves, &open)?;
        return Ok(Rendered {
            film,
            denoised: None,
        });
    }
    let seed = stored.config.seed;
    let renderer = open(seed.ok_or("config.json of the run has no seed")?, 0)?;
    let mut renderer = advance_to(renderer, stored.samples, waves)?;
    let picture = renderer.picture().map_err(|e| e.to_string())?;
    Ok(Rendered {
        film: renderer.film().clone(),
        denoised: picture.denoised.then_some(picture.image),
    })
}

/// Checks that the library of a denoiser is the one that denoised the run.
fn check_denoiser(render: &Settings) -> Result<(), String> {
    let Some(Denoise::Oidn { version }) = &render.denoise else {
        return Ok(());
    };
    let found = oidn::version()?;
    if found == *version {
        return Ok(());
    }
    Err(format!(
        "it was denoised by Open Image Denoise {version}, and {} names version {found}",
        oidn::VARIABLE
    ))
}

/// Checks that the program of an external technique may run and is the one that rendered the run.
fn probe_external(render: &Settings, job: &Job, global: &Global) -> Result<(), String> {
    let technique =
        external::technique_of(job.integrator, &render.integrator, &job.settings.params)?;
    if is_declared(job.integrator) && !global.allow_commands {
        return Err(format!(
            "it was rendered by a command, `{}`; add --allow-commands to run it",
            words::line(&technique.command_lines().0)
        ));
    }
    let version = external::probe(&technique)?.unwrap_or_default();
    if !technique.found_version.is_empty() && technique.found_version != version {
        return Err(format!(
            "{} has another version: it was `{}` and is now `{version}`",
            render.integrator, technique.found_version
        ));
    }
    Ok(())
}

/// Renders a reference again: its two halves, shard by shard if it was rendered in shards. `open`
/// opens a renderer with a seed and the index of its first sample.
fn render_reference(
    stored: &StoredRun,
    [first, second]: [u64; 2],
    waves: &[u64],
    open: &dyn Fn(u64, u64) -> Result<Box<dyn Renderer>, String>,
) -> Result<Film, String> {
    let size = stored.config.shard_samples.unwrap_or(stored.samples).max(2);
    let mut sums: Option<[Film; 2]> = None;
    for shard in split(0, size, stored.samples) {
        let at = shard.first / 2;
        let halves = ReferenceHalves::new([open(first, at)?, open(second, at)?]);
        let renderer = advance_to(Box::new(halves), shard.end - shard.first, waves)?;
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

/// Renders until there are `samples` samples per pixel. Calls of the renderer end at `waves`, if there
/// are any.
fn advance_to(
    mut renderer: Box<dyn Renderer>,
    samples: u64,
    waves: &[u64],
) -> Result<Box<dyn Renderer>, String> {
    while renderer.film().samples < samples {
        let before = renderer.film().samples;
        let step = match waves.iter().find(|end| **end > before) {
            Some(end) => end - before,
            None if waves.is_empty() => SAMPLES_PER_STEP,
            None => samples,
        };
        let stats = renderer
            .advance(step.min(samples - before))
            .map_err(|e| e.to_string())?;
        if stats.samples == 0 {
            return Err("the renderer added no samples".to_owned());
        }
    }
    Ok(renderer)
}

/// Makes the path of a folder of shaders relative to the folder in which the night was started, if
/// it is not found from the current folder.
fn find_shaders(shaders: &mut Shaders, started_in: Option<&Path>) {
    if let Shaders::Folder(folder) = shaders
        && !folder.path.is_dir()
        && let Some(started_in) = started_in
    {
        folder.path = started_in.join(&folder.path);
    }
}

/// Loads the scene of a run with its changes. Its path is relative to the current folder
/// or to the folder in which the night was started.
fn load_scene(
    render: &Settings,
    started_in: Option<&Path>,
    global: &Global,
) -> Result<SceneDesc, String> {
    let candidates: Vec<PathBuf> = [&render.scene_file, Path::new(&render.scene)]
        .iter()
        .flat_map(|name| [Some(name.to_path_buf()), started_in.map(|s| s.join(name))])
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
    let read = lumbre_lua::scene::read(file, &render.scene_options, global.missing());
    let (mut scene, _) = read.map_err(|e| e.to_string())?;
    edit::apply(&mut scene, &render.set).map_err(|e| e.to_string())?;
    Ok(scene)
}
