//! What backends cost and how fast they are: `lumbre bench --backend NAME`, once for each backend, in one run.

use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use super::metrics::of_a_night;
use super::subject::Subject;
use crate::cli::text::aligned;
use crate::math::stats::median;
use crate::metrics::gauge::Gauge;
use crate::render::{Job, backend};
use crate::scene::{CompiledScene, compile};
use crate::transport::integrator::{INTEGRATORS, IntegratorRow};

/// Edges of the paths, as in the tables of the first source.
const MAX_DEPTH: u32 = 5;

/// The shortest wave that is measured, in seconds: as often as a night measures its errors.
const WAVE_S: f64 = 0.5;

/// One scene, integrator and backend.
pub struct Row {
    scene: String,
    label: String,
    integrator: &'static str,
    backend: &'static str,
    device: String,
    resolution: [u32; 2],
    /// Seconds from the job to the first wave: copies, hierarchies, shaders.
    open_s: f64,
    /// Seconds of it for copying scene and job.
    upload_s: f64,
    /// Seconds of it for what rays are traced through.
    build_s: f64,
    /// Seconds of it for shaders and pipelines.
    pipeline_s: f64,
    /// Samples of pixels per second, in millions; median.
    mpaths_per_s: f64,
    /// How long the device waited for the host; nothing for the processor itself.
    host: Option<Host>,
}

/// The time of a device between waves in which it waited for the host, while the picture of each is measured by the metrics of a
/// night. By the device's clock; medians.
struct Host {
    /// Share of its time where it goes on with the next wave meanwhile, as nights let it.
    share: f64,
    /// Milliseconds of it for each wave.
    ms: f64,
    /// The same where it does not.
    alone_ms: f64,
}

/// Measures every integrator on some backends, at `resolution` and depth 5.
///
/// # Errors
/// When a scene cannot be loaded, or a backend is unknown or fails, with a message for people.
pub fn measure(
    subject: &Subject,
    backends: &[String],
    resolution: [u32; 2],
    repeats: usize,
) -> Result<Vec<Row>, String> {
    let desc = subject.load()?;
    let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
    let mut rows = Vec::new();
    for integrator in INTEGRATORS {
        for wanted in backends {
            rows.push(one(subject, &scene, integrator, wanted, resolution, repeats)?);
        }
    }
    Ok(rows)
}

fn one(
    subject: &Subject,
    scene: &Arc<CompiledScene>,
    integrator: &'static IntegratorRow,
    wanted: &str,
    resolution: [u32; 2],
    repeats: usize,
) -> Result<Row, String> {
    let row = backend(wanted).ok_or_else(|| format!("there is no backend `{wanted}`; `lumbre doctor` lists them"))?;
    let job = Job::plain(integrator, resolution, MAX_DEPTH, 1);
    let start = Instant::now();
    let mut renderer = (row.open)(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    let open_s = start.elapsed().as_secs_f64();
    let stats = renderer.open_stats();
    let (upload_s, build_s, pipeline_s) = (stats.upload_s, stats.accel_build_s, stats.pipeline_s);
    let device = stats.device.clone();
    // Waves grow until they take what a night's do.
    let mut samples = 1;
    loop {
        let wave = renderer.advance(samples).map_err(|e| e.to_string())?;
        if wave.render_s >= WAVE_S || samples >= 1 << 16 {
            break;
        }
        samples *= 2;
    }
    let metrics = of_a_night();
    let gauge = Gauge::new(&metrics, Arc::new(renderer.film().mean()));
    let mut rates = Vec::new();
    let (mut shares, mut idle) = ([Vec::new(), Vec::new()], [Vec::new(), Vec::new()]);
    let mut device_s = 0.0;
    for (ahead, more) in [samples, 0].into_iter().enumerate() {
        // The first of each kind follows one of the other.
        for round in 0..=repeats {
            let wave = renderer.advance_toward(samples, more).map_err(|e| e.to_string())?;
            gauge.eval(&renderer.film().mean()).map_err(|e| e.to_string())?;
            if round > 0 {
                shares[ahead].push(wave.idle_s / (wave.idle_s + wave.device_s));
                idle[ahead].push(wave.idle_s * 1e3);
                rates.push(wave.paths as f64 / wave.render_s / 1e6);
                device_s += wave.device_s;
            }
        }
    }
    let ([share, _], [ms, alone_ms]) = (shares.map(median), idle.map(median));
    Ok(Row {
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
        host: (device_s > 0.0).then_some(Host { share, ms, alone_ms }),
    })
}

impl Row {
    /// Pictures of one sample per second.
    fn frames_per_s(&self) -> f64 {
        self.mpaths_per_s * 1e6 / (f64::from(self.resolution[0]) * f64::from(self.resolution[1]))
    }

    /// The figures by name.
    pub fn to_json(&self) -> Json {
        json!({
            "scene": self.scene, "integrator": self.integrator, "backend": self.backend, "device": self.device,
            "resolution": self.resolution, "max_depth": MAX_DEPTH, "open_s": self.open_s, "upload_s": self.upload_s,
            "build_s": self.build_s, "pipeline_s": self.pipeline_s,
            "mpaths_per_s": self.mpaths_per_s, "frames_per_s": self.frames_per_s(),
            "host_share": self.host.as_ref().map(|host| host.share), "host_ms": self.host.as_ref().map(|host| host.ms),
            "host_ms_without_going_on": self.host.as_ref().map(|host| host.alone_ms),
        })
    }
}

/// The table for people.
pub fn table(rows: &[Row]) -> String {
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
        "alone ms",
    ];
    let mut lines = vec![head.map(str::to_owned).to_vec()];
    for r in rows {
        let of_host = |text: fn(&Host) -> String| r.host.as_ref().map_or_else(|| "-".to_owned(), text);
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
            of_host(|host| format!("{:.2}", host.share * 100.0)),
            of_host(|host| format!("{:.2}", host.ms)),
            of_host(|host| format!("{:.2}", host.alone_ms)),
        ]);
    }
    let mut devices: Vec<String> = rows.iter().map(|r| format!("{}: {}", r.backend, r.device)).collect();
    devices.sort();
    devices.dedup();
    format!("{}\n{}\n", aligned(&lines), devices.join("\n"))
}
