//! Ray and path rates of one scene, and the tables of all scenes.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::efficiency::{self, IntegratorRates, RELATIVE_RMSE};
use super::subject::Subject;
use crate::cli::format::{aligned, duration};
use lumbre_light::scene::compile;
use lumbre_light::transport::integrator;
use lumbre_render::cpu::rates::{self, RayRates};

/// Rates of one scene.
pub struct SceneRates {
    scene: String,
    label: String,
    primitives: usize,
    resolution: [u32; 2],
    max_depth: u32,
    /// Ray rates, if requested.
    rays: Option<RayRates>,
    /// Path rates in the order of the integrators' table; empty if not requested.
    integrators: Vec<IntegratorRates>,
}

/// Measures a scene at its own resolution and depth: rays, integrators, or both.
///
/// # Errors
/// A message for the user if the scene cannot be loaded or rendered.
pub fn measure(
    subject: &Subject,
    threads: usize,
    repeats: usize,
    [rays, integrators]: [bool; 2],
) -> Result<SceneRates, String> {
    let desc = subject.load()?;
    let (compiled, _) = compile(&desc).map_err(|e| e.to_string())?;
    let scene = Arc::new(compiled);
    let resolution = scene.resolution;
    let rays = rays
        .then(|| rates::measure(&scene, resolution, threads, repeats))
        .transpose()?;
    let selected = integrator::integrators().filter(|_| integrators);
    let integrators = selected
        .map(|row| efficiency::measure(&scene, row, threads, repeats))
        .collect::<Result<_, _>>()?;
    Ok(SceneRates {
        scene: subject.name.clone(),
        label: subject.label.clone(),
        primitives: scene.primitive_count(),
        resolution: scene.resolution,
        max_depth: scene.max_depth,
        rays,
        integrators,
    })
}

impl SceneRates {
    /// Returns the figures by name.
    pub fn to_json(&self) -> Json {
        let integrators: serde_json::Map<String, Json> = self
            .integrators
            .iter()
            .map(|m| (m.name.to_owned(), m.to_json()))
            .collect();
        let rays = self.rays.as_ref();
        json!({
            "scene": self.scene,
            "primitives": self.primitives,
            "resolution": self.resolution,
            "max_depth": self.max_depth,
            "bvh_build_s": rays.map(|r| r.build_s),
            "bvh_nodes": rays.map(|r| r.nodes),
            "bvh_bytes": rays.map(|r| r.bytes),
            "mrays_per_s": rays.map(|r| json!({
                "primary": r.primary, "bounce": r.bounce, "shadow": r.shadow,
            })),
            "integrators": integrators,
        })
    }
}

/// Converts texts to a line of a table.
fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

/// Formats the rates of all scenes as tables.
pub fn table(rows: &[SceneRates]) -> String {
    let tables: Vec<String> = [ray_table(rows), path_table(rows)]
        .iter()
        .filter(|t| t.len() > 1)
        .map(|t| aligned(t))
        .collect();
    tables.join("\n")
}

/// Formats an optional figure.
fn or_dash(text: Option<String>) -> String {
    text.unwrap_or_else(|| "-".to_owned())
}

/// Lines of the table of ray rates.
fn ray_table(rows: &[SceneRates]) -> Vec<Vec<String>> {
    let head = [
        "scene",
        "primitives",
        "build ms",
        "nodes",
        "bytes/primitive",
        "primary",
        "bounce",
        "shadow Mrays/s",
    ];
    let mut rays = vec![cells(head)];
    for (row, measured) in rows
        .iter()
        .filter_map(|row| Some((row, row.rays.as_ref()?)))
    {
        let rate = |x: Option<f64>| or_dash(x.map(|x| format!("{x:.2}")));
        rays.push(vec![
            row.label.clone(),
            row.primitives.to_string(),
            format!("{:.2}", measured.build_s * 1e3),
            measured.nodes.to_string(),
            format!(
                "{:.0}",
                measured.bytes as f64 / row.primitives.max(1) as f64
            ),
            rate(measured.primary),
            rate(measured.bounce),
            rate(measured.shadow),
        ]);
    }
    rays
}

/// Lines of the table of path rates.
fn path_table(rows: &[SceneRates]) -> Vec<Vec<String>> {
    let time = format!("time to {:.0} %", RELATIVE_RMSE * 100.0);
    let head = [
        "scene",
        "size",
        "depth",
        "integrator",
        "Mpaths/s",
        "vectorised",
        "spread",
        "variance",
        "efficiency",
        &time,
    ];
    let mut paths = vec![cells(head)];
    for row in rows {
        for m in &row.integrators {
            paths.push(vec![
                row.label.clone(),
                format!("{}x{}", row.resolution[0], row.resolution[1]),
                row.max_depth.to_string(),
                m.name.to_owned(),
                format!("{:.3}", m.mpaths_per_s),
                format!("{:.3}", m.vectorised_mpaths_per_s),
                format!("{:.0} %", m.spread * 100.0),
                or_dash(m.variance.map(|v| format!("{v:.3e}"))),
                or_dash(m.efficiency().map(|e| format!("{e:.3e}"))),
                or_dash(m.time_to_rmse_s().map(duration)),
            ]);
        }
    }
    paths
}
