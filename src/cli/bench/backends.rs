//! What backends cost and how fast they are: `lumbre bench --backend NAME`, once for each backend, in one run.

use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use serde_json::{Value as Json, json};

use crate::cli::load;
use crate::cli::text::aligned;
use crate::math::stats::median;
use crate::render::{Job, backend};
use crate::scene::load::Missing;
use crate::scene::{CompiledScene, compile};
use crate::transport::integrator::{INTEGRATORS, IntegratorRow};

/// Edges of the paths, as in the tables of the first source.
const MAX_DEPTH: u32 = 5;

/// The shortest wave that is measured, in seconds: as often as a night measures its errors.
const WAVE_S: f64 = 0.5;

/// One scene, integrator and backend.
pub struct Row {
    scene: String,
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
    /// Share of the time of waves, from asking for one to having its film here, in which the device did not work; nothing
    /// for the processor itself.
    host_share: Option<f64>,
    /// Milliseconds of a wave in which the device did not work, median: they do not depend on how long the wave is.
    host_ms: Option<f64>,
}

/// Measures every integrator on some backends, at `resolution` and depth 5.
///
/// # Errors
/// When a scene cannot be loaded, or a backend is unknown or fails, with a message for people.
pub fn measure(
    name: &str,
    file: &Path,
    backends: &[String],
    resolution: [u32; 2],
    repeats: usize,
) -> Result<Vec<Row>, String> {
    let (desc, _) = load::scene(file, Missing::Refused).map_err(|e| e.to_string())?;
    let scene = Arc::new(compile(&desc).map_err(|e| e.to_string())?.0);
    let mut rows = Vec::new();
    for integrator in INTEGRATORS {
        for wanted in backends {
            rows.push(one(name, &scene, integrator, wanted, resolution, repeats)?);
        }
    }
    Ok(rows)
}

fn one(
    name: &str,
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
    let (mut rates, mut shares, mut idle) = (Vec::new(), Vec::new(), Vec::new());
    for _ in 0..repeats {
        let start = Instant::now();
        let wave = renderer.advance(samples).map_err(|e| e.to_string())?;
        let whole = start.elapsed().as_secs_f64();
        shares.push(1.0 - wave.device_s / whole);
        idle.push((whole - wave.device_s) * 1e3);
        rates.push(wave.paths as f64 / wave.render_s / 1e6);
    }
    let share = median(shares);
    Ok(Row {
        scene: name.to_owned(),
        integrator: integrator.name,
        backend: row.name,
        device,
        resolution,
        open_s,
        upload_s,
        build_s,
        pipeline_s,
        mpaths_per_s: median(rates),
        host_share: (share < 1.0).then_some(share),
        host_ms: (share < 1.0).then(|| median(idle)),
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
            "mpaths_per_s": self.mpaths_per_s, "frames_per_s": self.frames_per_s(), "host_share": self.host_share,
            "host_ms": self.host_ms,
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
    ];
    let mut lines = vec![head.map(str::to_owned).to_vec()];
    for r in rows {
        lines.push(vec![
            r.scene.clone(),
            r.integrator.to_owned(),
            r.backend.to_owned(),
            format!("{:.3}", r.mpaths_per_s),
            format!("{:.2}", r.frames_per_s()),
            format!("{:.2}", r.open_s),
            format!("{:.1}", r.upload_s * 1e3),
            format!("{:.1}", r.build_s * 1e3),
            format!("{:.2}", r.pipeline_s),
            r.host_share.map_or_else(|| "-".to_owned(), |share| format!("{:.1}", share * 100.0)),
            r.host_ms.map_or_else(|| "-".to_owned(), |ms| format!("{ms:.1}")),
        ]);
    }
    let mut devices: Vec<String> = rows.iter().map(|r| format!("{}: {}", r.backend, r.device)).collect();
    devices.sort();
    devices.dedup();
    format!("{}\n{}\n", aligned(&lines), devices.join("\n"))
}
