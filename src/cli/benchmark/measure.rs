//! The measurements of the suite.

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Instant, SystemTime};

use super::result::{BenchmarkCell, BenchmarkResult, Machine, SUITE_VERSION};
use crate::cli::about::doctor;
use crate::cli::args::{BenchArgs, Global};
use crate::cli::format::duration;
use crate::cli::scene::builtin::{BuiltIn, scene_name};
use lumbre_light::film::Film;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::{INTEGRATORS, IntegratorRow};
use lumbre_night::backends::BACKENDS;
use lumbre_night::store::{Host, utc};
use lumbre_render::shaders::Shaders;
use lumbre_render::{BackendRow, Job, Renderer, WaveStats, mock};
use lumbre_scene_io::load;

/// Scenes of the suite: the built-in ones, except for a chart of pixel filters.
const SCENES: [&str; 6] = [
    "cornell",
    "cornell_spheres",
    "veach_lamps",
    "material_ball",
    "masked_leaves",
    "lamp_row",
];

/// Width and height of the pictures in pixels.
const RESOLUTION: [u32; 2] = [640, 360];

/// Greatest number of path edges, as in the tables of thesis S0.
const MAX_DEPTH: u32 = 5;

/// Seed of all pictures.
const SEED: u64 = 1;

/// Samples of the picture whose checksum is recorded. They also warm up.
const PICTURE_SAMPLES: u64 = 2;

/// Number of repeats of a rate.
const REPEATS: u32 = 5;

/// Seconds of the whole suite, and with `--quick`.
const BUDGET_S: [f64; 2] = [20.0 * 60.0, 60.0];

/// Least duration of one repeat in seconds, below which clocks and start-up would matter.
const SHORTEST_S: f64 = 0.02;

/// One measurement to make.
struct Task {
    backend: &'static BackendRow,
    scene: Arc<CompiledScene>,
    scene_name: String,
    technique: &'static IntegratorRow,
}

/// Measures all techniques on all scenes and backends of this machine. `progress` receives a line
/// for each measurement.
///
/// # Errors
/// Returns a message if a backend that was asked for cannot be used, or a picture fails.
pub fn measure(
    args: &BenchArgs,
    global: &Global,
    progress: &mut dyn FnMut(&str),
) -> Result<BenchmarkResult, String> {
    let start = Instant::now();
    let date = utc(SystemTime::now());
    let backends = usable_backends(&args.backend, progress)?;
    let tasks = tasks(&backends)?;
    let resolution = args.size.unwrap_or(RESOLUTION);
    let budget_s = args.time.unwrap_or(BUDGET_S[usize::from(args.quick)]);
    let mut cells = Vec::new();
    let mut devices = BTreeMap::new();
    for (done, task) in tasks.iter().enumerate() {
        let left_s = (budget_s - start.elapsed().as_secs_f64()).max(0.0);
        let share_s = left_s / (tasks.len() - done) as f64;
        let job =
            Job::plain(task.technique, resolution, MAX_DEPTH, SEED).on_threads(global.threads);
        let (cell, device) = measure_task(task, job, share_s)
            .map_err(|e| format!("{} by {}: {e}", task.scene_name, task.technique.name))?;
        progress(&format!(
            "{:>3} of {}: {} {} {}: {:.3} Mpaths/s, {} left",
            done + 1,
            tasks.len(),
            cell.backend,
            cell.scene,
            cell.technique,
            cell.mpaths_per_s.iter().sum::<f64>() / f64::from(REPEATS),
            duration((budget_s - start.elapsed().as_secs_f64()).max(0.0)),
        ));
        devices.insert(cell.backend.clone(), device);
        cells.push(cell);
    }
    let host = Host::detect();
    let threads = if global.threads == 0 {
        host.cores
    } else {
        global.threads
    };
    Ok(BenchmarkResult {
        benchmark: SUITE_VERSION,
        program: lumbre_night::text::program().to_owned(),
        quick: args.quick,
        name: args.name.clone().unwrap_or_else(|| host.cpu.clone()),
        machine: Machine {
            os: host.os,
            cpu: host.cpu,
            cores: host.cores,
            threads,
            features: doctor::cpu_features()
                .into_iter()
                .map(str::to_owned)
                .collect(),
        },
        date,
        duration_s: start.elapsed().as_secs_f64(),
        resolution,
        max_depth: MAX_DEPTH,
        backends: devices,
        cells,
    })
}

/// Returns the backends to measure: those with these names, or all that this machine can use. The
/// mock backend renders nothing and is measured only if named.
fn usable_backends(
    names: &[String],
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<&'static BackendRow>, String> {
    if let Some(name) = names
        .iter()
        .find(|name| !BACKENDS.iter().any(|row| row.name == **name))
    {
        return Err(format!(
            "there is no backend `{name}`; `lumbre doctor` lists them"
        ));
    }
    let mut usable = Vec::new();
    for row in BACKENDS {
        let is_named = names.iter().any(|name| name == row.name);
        if !is_named && (!names.is_empty() || row.name == mock::ROW.name) {
            continue;
        }
        match (row.probe)() {
            Ok(_) => usable.push(row),
            Err(reason) if is_named => return Err(format!("backend `{}`: {reason}", row.name)),
            Err(reason) => progress(&format!("backend {} is left out: {reason}", row.name)),
        }
    }
    Ok(usable)
}

/// Returns all measurements: scene by scene, so that the techniques and backends of a scene are
/// measured close together.
fn tasks(backends: &[&'static BackendRow]) -> Result<Vec<Task>, String> {
    let built_in = BuiltIn::unpack()?;
    let files = built_in.scenes();
    let mut tasks = Vec::new();
    for name in SCENES {
        let file: &PathBuf = files
            .iter()
            .find(|file| scene_name(file) == name)
            .ok_or_else(|| format!("there is no built-in scene `{name}`"))?;
        let (desc, _) = load::load(file).map_err(|e| e.to_string())?;
        let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
        // Registered techniques are left out: programs are compared by the same measurements.
        for technique in INTEGRATORS {
            let able = backends
                .iter()
                .filter(|row| (row.refuses)(technique, &Shaders::Unset).is_none());
            tasks.extend(able.map(|backend| Task {
                backend,
                scene: Arc::clone(&scene),
                scene_name: name.to_owned(),
                technique,
            }));
        }
    }
    Ok(tasks)
}

/// Renders a picture and measures the rate for about `share_s` seconds. Also returns the device.
fn measure_task(task: &Task, job: Job, share_s: f64) -> Result<(BenchmarkCell, String), String> {
    let pixels = f64::from(job.resolution[0]) * f64::from(job.resolution[1]);
    let start = Instant::now();
    let mut renderer =
        (task.backend.open)(Arc::clone(&task.scene), job).map_err(|e| e.to_string())?;
    let open_s = start.elapsed().as_secs_f64();
    let advance = |renderer: &mut dyn Renderer, samples: u64| {
        renderer.advance(samples).map_err(|e| e.to_string())
    };
    let first = advance(renderer.as_mut(), PICTURE_SAMPLES)?;
    let (checksum, picture_mean) = fingerprint(renderer.film());
    let left_s = share_s - start.elapsed().as_secs_f64();
    let repeat_s = (left_s / f64::from(REPEATS)).max(SHORTEST_S);
    let samples = first.samples_in(repeat_s);
    let waves: Vec<WaveStats> = (0..REPEATS)
        .map(|_| advance(renderer.as_mut(), samples))
        .collect::<Result<_, _>>()?;
    let rate = |count: fn(&WaveStats) -> u64| {
        waves
            .iter()
            .map(move |wave| count(wave) as f64 / wave.render_s)
    };
    let seconds: f64 = waves.iter().map(|wave| wave.render_s).sum();
    let rays: u64 = waves.iter().map(|wave| wave.rays).sum();
    let stats = renderer.open_stats();
    let cell = BenchmarkCell {
        backend: task.backend.name.to_owned(),
        scene: task.scene_name.clone(),
        technique: task.technique.name.to_owned(),
        frames_per_s: rate(|wave| wave.paths).map(|rate| rate / pixels).collect(),
        mpaths_per_s: rate(|wave| wave.paths).map(|rate| rate / 1e6).collect(),
        mrays_per_s: rays as f64 / seconds / 1e6,
        open_s,
        build_s: stats.accel_build_s,
        picture_samples: PICTURE_SAMPLES,
        picture_mean,
        checksum,
    };
    Ok((cell, stats.device_line()))
}

/// Returns the hash of the sums of a film, and its mean radiance.
fn fingerprint(film: &Film) -> (String, [f64; 3]) {
    let mut hasher = blake3::Hasher::new();
    let mut sum = [0.0; 3];
    for pixel in &film.sum {
        for (sum, value) in sum.iter_mut().zip(pixel) {
            hasher.update(&value.to_bits().to_le_bytes());
            *sum += value;
        }
    }
    let count = film.sum.len().max(1) as f64 * film.samples.max(1) as f64;
    (
        hasher.finalize().to_hex().to_string(),
        sum.map(|sum| sum / count),
    )
}
