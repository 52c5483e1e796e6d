//! Start-up cost and speed of backends: `lumbre bench --backend NAME`, repeatable.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use super::subject::Subject;
use crate::cli::format::aligned;
use lumbre_light::math::stats::median;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::integrator::{IntegratorRow, integrators};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_night::backends::backend;
use lumbre_render::shaders::Shaders;
use lumbre_render::{Advance, Job, Renderer};

/// Path depth in edges, as in the tables of thesis S0.
const MAX_DEPTH: u32 = 5;

/// Shortest measured wave in seconds: the interval at which a night measures errors.
const WAVE_S: f64 = 0.5;

/// Metrics of the first source's protocol, measured every half second by `scripts/overnight.lua`.
pub const PROTOCOL: [&str; 4] = ["mse", "rmse", "ssim", "flip"];

/// Returns the metrics of [`PROTOCOL`] with default options.
pub fn protocol_metrics() -> Vec<MetricSpec> {
    let spec = |name: &str| MetricSpec::new(name, name, BTreeMap::new()).ok();
    PROTOCOL.into_iter().filter_map(spec).collect()
}

/// Figures of one scene, integrator and backend.
pub struct BackendRates {
    scene: String,
    label: String,
    integrator: &'static str,
    backend: &'static str,
    device: String,
    resolution: [u32; 2],
    /// Seconds from creating the job to the first wave: uploads, acceleration structures, shaders.
    open_s: f64,
    /// Part of `open_s` for uploading scene and job, in seconds.
    upload_s: f64,
    /// Part of `open_s` for building acceleration structures, in seconds.
    build_s: f64,
    /// Part of `open_s` for shaders and pipelines, in seconds.
    pipeline_s: f64,
    /// Median camera paths per second, in millions.
    mpaths_per_s: f64,
    /// Idle time of the device; `None` for the CPU.
    host: Option<HostWait>,
}

/// Idle time of a device between waves, while the host evaluates the metrics of a night. Medians,
/// measured by the device's clock.
struct HostWait {
    /// Fraction of the device's time if it starts the next wave speculatively, as in a night.
    share: f64,
    /// Idle milliseconds per wave if it starts the next wave speculatively.
    ms: f64,
    /// Idle milliseconds per wave without speculative waves.
    sync_ms: f64,
}

/// Measures every integrator on each of `backends` that renders it, at `resolution` and depth 5.
///
/// # Errors
/// A message for the user if the scene cannot be loaded, or a backend is unknown or fails.
pub fn measure(
    subject: &Subject,
    backends: &[String],
    resolution: [u32; 2],
    repeats: usize,
) -> Result<Vec<BackendRates>, String> {
    let desc = subject.load()?;
    let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
    let mut rows = Vec::new();
    for integrator in integrators() {
        for name in backends.iter().filter(|name| renders(name, integrator)) {
            rows.push(measure_one(
                subject, &scene, integrator, name, resolution, repeats,
            )?);
        }
    }
    Ok(rows)
}

/// Returns whether a backend renders an integrator; an unknown backend is reported when it is opened.
pub fn renders(name: &str, integrator: &IntegratorRow) -> bool {
    backend(name).is_none_or(|row| (row.refuses)(integrator, &Shaders::Unset).is_none())
}

fn measure_one(
    subject: &Subject,
    scene: &Arc<CompiledScene>,
    integrator: &'static IntegratorRow,
    name: &str,
    resolution: [u32; 2],
    repeats: usize,
) -> Result<BackendRates, String> {
    let row = backend(name)
        .ok_or_else(|| format!("there is no backend `{name}`; `lumbre doctor` lists them"))?;
    let job = Job::plain(integrator, resolution, MAX_DEPTH, 1);
    let start = Instant::now();
    let mut renderer = (row.open)(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    let open_s = start.elapsed().as_secs_f64();
    let stats = renderer.open_stats();
    let (upload_s, build_s, pipeline_s) = (stats.upload_s, stats.accel_build_s, stats.pipeline_s);
    let device = stats.device_line();
    let samples = wave_samples(renderer.as_mut())?;
    let metrics = protocol_metrics();
    let evaluator = Evaluator::new(&metrics, Arc::new(renderer.film().mean()));
    let mut rates = Vec::new();
    let (mut shares, mut idle) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    let mut device_s = 0.0;
    for (mode, more) in [samples, 0].into_iter().enumerate() {
        // Round 0 of each mode follows a wave of the other mode and is not counted.
        for round in 0..=repeats {
            let wave = renderer
                .render(&Advance {
                    more,
                    ..Advance::by(samples)
                })
                .map_err(|e| e.to_string())?;
            evaluator
                .eval(&renderer.film().mean())
                .map_err(|e| e.to_string())?;
            if round > 0 {
                shares[mode].push(wave.idle_s / (wave.idle_s + wave.device_s));
                idle[mode].push(wave.idle_s * 1e3);
                rates.push(wave.paths as f64 / wave.render_s / 1e6);
                device_s += wave.device_s;
            }
        }
    }
    let ([share, _], [ms, sync_ms]) = (shares.map(median), idle.map(median));
    Ok(BackendRates {
        scene: subject.name.clone(),
        label: subject.label.clone(),
        integrator: integrator.name,
        backend: row.name,
        device,
        resolution,
        open_s,
        upload_s,
        build_s,
        pipeline_s,
        mpaths_per_s: median(rates),
        host: (device_s > 0.0).then_some(HostWait { share, ms, sync_ms }),
    })
}

/// Doubles the wave until it takes as long as a wave of a night; returns its number of samples.
fn wave_samples(renderer: &mut dyn Renderer) -> Result<u64, String> {
    let mut samples = 1;
    loop {
        let wave = renderer.advance(samples).map_err(|e| e.to_string())?;
        if wave.render_s >= WAVE_S || samples >= 1 << 16 {
            return Ok(samples);
        }
        samples *= 2;
    }
}

impl BackendRates {
    /// Pictures of one sample per pixel, per second.
    fn frames_per_s(&self) -> f64 {
        self.mpaths_per_s * 1e6 / (f64::from(self.resolution[0]) * f64::from(self.resolution[1]))
    }

    /// Returns the figures by name.
    pub fn to_json(&self) -> Json {
        json!({
            "scene": self.scene, "integrator": self.integrator, "backend": self.backend,
            "device": self.device,
            "resolution": self.resolution, "max_depth": MAX_DEPTH, "open_s": self.open_s,
            "upload_s": self.upload_s,
            "build_s": self.build_s, "pipeline_s": self.pipeline_s,
            "mpaths_per_s": self.mpaths_per_s, "frames_per_s": self.frames_per_s(),
            "host_share": self.host.as_ref().map(|host| host.share),
            "host_ms": self.host.as_ref().map(|host| host.ms),
            "host_ms_without_going_on": self.host.as_ref().map(|host| host.sync_ms),
        })
    }
}

/// Formats the figures as a table.
pub fn table(rows: &[BackendRates]) -> String {
    let head = [
        "scene",
        "integrator",
        "backend",
        "Mpaths/s",
        "FPS",
        "open s",
        "upload ms",
        "build ms",
        "pipeline s",
        "host %",
        "host ms",
        "sync ms",
    ];
    let mut lines = vec![head.map(str::to_owned).to_vec()];
    for r in rows {
        let host_column =
            |text: fn(&HostWait) -> String| r.host.as_ref().map_or_else(|| "-".to_owned(), text);
        lines.push(vec![
            r.label.clone(),
            r.integrator.to_owned(),
            r.backend.to_owned(),
            format!("{:.3}", r.mpaths_per_s),
            format!("{:.2}", r.frames_per_s()),
            format!("{:.2}", r.open_s),
            format!("{:.1}", r.upload_s * 1e3),
            format!("{:.1}", r.build_s * 1e3),
            format!("{:.2}", r.pipeline_s),
            host_column(|host| format!("{:.2}", host.share * 100.0)),
            host_column(|host| format!("{:.2}", host.ms)),
            host_column(|host| format!("{:.2}", host.sync_ms)),
        ]);
    }
    let mut devices: Vec<String> = rows
        .iter()
        .map(|r| format!("{}: {}", r.backend, r.device))
        .collect();
    devices.sort();
    devices.dedup();
    format!("{}\n{}\n", aligned(&lines), devices.join("\n"))
}
