//! Rays and paths per second of one scene.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::short;
use crate::math::stats::median;
use crate::render::cpu::rates::{self, RayRates};
use crate::render::{Job, backend};
use crate::scene::{CompiledScene, compile, load};
use crate::transport::camera::{FilterKind, FilterSpec};
use crate::transport::integrator::INTEGRATORS;
use crate::transport::sampler::INDEPENDENT;

/// The rates of one scene.
pub struct Row {
    scene: PathBuf,
    primitives: usize,
    resolution: [u32; 2],
    max_depth: u32,
    rays: RayRates,
    /// Million camera paths per second by integrator, in the order of the table.
    mpaths_per_s: Vec<f64>,
}

/// Measures a scene at its own resolution and depth.
///
/// # Errors
/// When it cannot be loaded or rendered, with a message for people.
pub fn measure(scene: &Path, threads: usize, repeats: usize) -> Result<Row, String> {
    let (desc, _) = load::load(scene).map_err(|e| e.to_string())?;
    let (compiled, _) = compile(&desc).map_err(|e| e.to_string())?;
    let compiled = Arc::new(compiled);
    let rays = rates::measure(&compiled, compiled.resolution, repeats).map_err(|e| e.to_string())?;
    let mpaths_per_s =
        INTEGRATORS.iter().map(|i| paths(&compiled, i.name, threads, repeats)).collect::<Result<_, _>>()?;
    Ok(Row {
        scene: scene.to_owned(),
        primitives: compiled.primitive_count(),
        resolution: compiled.resolution,
        max_depth: compiled.max_depth,
        rays,
        mpaths_per_s,
    })
}

/// Median rate over `repeats` waves after one for warming up, as long as a wave of a night.
fn paths(scene: &Arc<CompiledScene>, name: &str, threads: usize, repeats: usize) -> Result<f64, String> {
    let integrator = INTEGRATORS.iter().find(|i| i.name == name).ok_or("no such integrator")?;
    let job = Job {
        integrator,
        params: Default::default(),
        resolution: scene.resolution,
        max_depth: scene.max_depth,
        rr_start: None,
        filter: FilterSpec { kind: FilterKind::Box, radius: 0.5 },
        sampler: INDEPENDENT,
        seed: 1,
        threads,
    };
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let mut renderer = (cpu.open)(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    renderer.advance(1).map_err(|e| e.to_string())?;
    let mut rates = Vec::new();
    for _ in 0..repeats {
        let wave = renderer.advance(4).map_err(|e| e.to_string())?;
        rates.push(wave.paths as f64 / wave.render_s / 1e6);
    }
    Ok(median(rates))
}

impl Row {
    /// The row's figures by name.
    pub fn to_json(&self) -> Json {
        let mpaths: serde_json::Map<String, Json> =
            INTEGRATORS.iter().zip(&self.mpaths_per_s).map(|(i, rate)| (i.name.to_owned(), json!(rate))).collect();
        json!({
            "scene": self.scene.display().to_string(),
            "primitives": self.primitives,
            "resolution": self.resolution,
            "max_depth": self.max_depth,
            "bvh_build_s": self.rays.build_s,
            "bvh_nodes": self.rays.nodes,
            "mrays_per_s": {
                "primary": self.rays.primary,
                "bounce": self.rays.bounce,
                "shadow": self.rays.shadow,
            },
            "mpaths_per_s": mpaths,
        })
    }
}

/// The rows as a table for people.
pub fn table(rows: &[Row]) -> String {
    let width = rows.iter().map(|r| short(&r.scene).chars().count()).max().unwrap_or(0).max("scene".len());
    let mut text = format!(
        "{:<width$} {:>10} {:>5} {:>10} {:>8} {:>8} {:>8} {:>8}",
        "scene", "primitives", "depth", "build ms", "nodes", "primary", "bounce", "shadow"
    );
    INTEGRATORS.iter().for_each(|i| text += &format!(" {:>8}", i.name));
    text += &format!("\n{:<width$} {:>10} {:>5} {:>10} {:>8} {:>26}", "", "", "", "", "", "Mrays/s");
    text += &format!(" {:>8}\n", "Mpaths/s");
    for r in rows {
        let rate = |x: Option<f64>| x.map_or_else(|| format!("{:>8}", "-"), |x| format!("{x:>8.2}"));
        text += &format!(
            "{:<width$} {:>10} {:>5} {:>10.2} {:>8} {} {} {}",
            short(&r.scene),
            r.primitives,
            r.max_depth,
            r.rays.build_s * 1e3,
            r.rays.nodes,
            rate(r.rays.primary),
            rate(r.rays.bounce),
            rate(r.rays.shadow)
        );
        r.mpaths_per_s.iter().for_each(|x| text += &rate(Some(*x)).replacen("", " ", 1));
        text += "\n";
    }
    text
}
