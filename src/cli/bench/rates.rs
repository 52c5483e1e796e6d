//! The rates of one scene, and the tables of all.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::efficiency::{self, Measured, RELATIVE_RMSE};
use super::subject::Subject;
use crate::cli::text::{aligned, duration};
use crate::render::cpu::rates::{self, RayRates};
use crate::scene::compile;
use crate::transport::integrator::INTEGRATORS;

/// The rates of one scene.
pub struct Row {
    scene: String,
    label: String,
    primitives: usize,
    resolution: [u32; 2],
    max_depth: u32,
    /// Where they were asked for.
    rays: Option<RayRates>,
    /// By integrator, in the order of their table; none where they were not asked for.
    integrators: Vec<Measured>,
}

/// Measures a scene at its own resolution and depth: rays, integrators, or both.
///
/// # Errors
/// When it cannot be loaded or rendered, with a message for people.
pub fn measure(
    subject: &Subject,
    threads: usize,
    repeats: usize,
    [rays, integrators]: [bool; 2],
) -> Result<Row, String> {
    let desc = subject.load()?;
    let (compiled, _) = compile(&desc).map_err(|e| e.to_string())?;
    let scene = Arc::new(compiled);
    let resolution = scene.resolution;
    let rays = rays.then(|| rates::measure(&scene, resolution, threads, repeats)).transpose()?;
    let asked = INTEGRATORS.iter().filter(|_| integrators);
    let integrators = asked.map(|row| efficiency::measure(&scene, row, threads, repeats)).collect::<Result<_, _>>()?;
    Ok(Row {
        scene: subject.name.clone(),
        label: subject.label.clone(),
        primitives: scene.primitive_count(),
        resolution: scene.resolution,
        max_depth: scene.max_depth,
        rays,
        integrators,
    })
}

impl Row {
    /// The row's figures by name.
    pub fn to_json(&self) -> Json {
        let integrators: serde_json::Map<String, Json> =
            self.integrators.iter().map(|m| (m.name.to_owned(), m.to_json())).collect();
        let rays = self.rays.as_ref();
        json!({
            "scene": self.scene,
            "primitives": self.primitives,
            "resolution": self.resolution,
            "max_depth": self.max_depth,
            "bvh_build_s": rays.map(|r| r.build_s),
            "bvh_nodes": rays.map(|r| r.nodes),
            "bvh_bytes": rays.map(|r| r.bytes),
            "mrays_per_s": rays.map(|r| json!({ "primary": r.primary, "bounce": r.bounce, "shadow": r.shadow })),
            "integrators": integrators,
        })
    }
}

fn cells<const N: usize>(texts: [&str; N]) -> Vec<String> {
    texts.map(str::to_owned).to_vec()
}

/// The rows as tables for people.
pub fn table(rows: &[Row]) -> String {
    let or_dash = |text: Option<String>| text.unwrap_or_else(|| "-".to_owned());
    let head = ["scene", "primitives", "build ms", "nodes", "bytes each", "primary", "bounce", "shadow Mrays/s"];
    let mut rays = vec![cells(head)];
    for (row, measured) in rows.iter().filter_map(|row| Some((row, row.rays.as_ref()?))) {
        let rate = |x: Option<f64>| or_dash(x.map(|x| format!("{x:.2}")));
        rays.push(vec![
            row.label.clone(),
            row.primitives.to_string(),
            format!("{:.2}", measured.build_s * 1e3),
            measured.nodes.to_string(),
            format!("{:.0}", measured.bytes as f64 / row.primitives.max(1) as f64),
            rate(measured.primary),
            rate(measured.bounce),
            rate(measured.shadow),
        ]);
    }
    let time = format!("time to {:.0} %", RELATIVE_RMSE * 100.0);
    let head =
        ["scene", "size", "depth", "integrator", "Mpaths/s", "in lanes", "spread", "variance", "efficiency", &time];
    let mut paths = vec![cells(head)];
    for row in rows {
        for m in &row.integrators {
            paths.push(vec![
                row.label.clone(),
                format!("{}x{}", row.resolution[0], row.resolution[1]),
                row.max_depth.to_string(),
                m.name.to_owned(),
                format!("{:.3}", m.mpaths_per_s),
                format!("{:.3}", m.in_lanes),
                format!("{:.0} %", m.spread * 100.0),
                or_dash(m.variance.map(|v| format!("{v:.3e}"))),
                or_dash(m.efficiency().map(|e| format!("{e:.3e}"))),
                or_dash(m.time_to_rmse_s().map(duration)),
            ]);
        }
    }
    let tables: Vec<String> = [rays, paths].iter().filter(|t| t.len() > 1).map(|t| aligned(t)).collect();
    tables.join("\n")
}
