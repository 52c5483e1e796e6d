//! The weights and densities of `bdpt`, path by path, against the products that define them. No statistics: they differ
//! by rounding alone, so a wrong weight shows even where it hardly changes a picture.

use std::rc::Rc;
use std::sync::Arc;

use serde_json::json;

use super::technique::Technique;
use super::{Check, Outcome, Request, Verdict};
use crate::cli::builtin::{BuiltIn, short};
use crate::cli::load;
use crate::render::cpu::accel::Accel;
use crate::scene::load::Missing;
use crate::scene::{CompiledScene, compile};
use crate::transport::camera::{Camera, FilterSpec};
use crate::transport::integrator::oracle::{self, COARSE, OracleReport, TOLERANCE};
use crate::transport::integrator::{Context, Settings, bdpt, integrator};
use crate::transport::light::Lights;
use crate::transport::mis;

/// Marks the seeds of these checks.
const KIND: u64 = 4;

/// Width and height of the pictures whose paths are looked at.
const RESOLUTION: [u32; 2] = [64, 64];

/// The checks of this kind.
///
/// # Errors
/// When a built-in scene cannot be loaded.
pub fn plan(request: &Request) -> Result<Vec<Check>, String> {
    let samples = if request.quick { 2000 } else { 50_000 };
    let default = integrator(bdpt::ROW.name).map(Technique::plain).ok_or("there is no `bdpt`")?;
    let mut techniques = default.variants();
    techniques.retain(|technique| technique.params.contains_key(mis::FIELD.key));
    techniques.insert(0, default);
    let built_in = BuiltIn::unpack()?;
    let mut checks = Vec::new();
    for file in built_in.scenes() {
        let (desc, _) = load::scene(&file, Missing::Refused).map_err(|e| e.to_string())?;
        let scene = Rc::new(Arc::new(compile(&desc).map_err(|e| e.to_string())?.0));
        for technique in &techniques {
            let seed = request.seed(KIND, checks.len());
            let (scene, technique) = (Rc::clone(&scene), technique.clone());
            let compared = format!("{technique}: weights with their definition");
            checks.push(Check::new(short(&file), compared, move |_| {
                Ok(outcome(&report(&scene, &technique, samples, seed)?))
            }));
        }
    }
    Ok(checks)
}

fn report(scene: &Arc<CompiledScene>, technique: &Technique, samples: u64, seed: u64) -> Result<OracleReport, String> {
    let accel = Accel::build(Arc::clone(scene)).map_err(|e| e.to_string())?;
    let context = Context {
        scene,
        camera: &Camera::new(&scene.camera, RESOLUTION, FilterSpec::PIXEL),
        lights: &Lights::new(scene),
        trace: &accel,
        max_depth: scene.max_depth,
        rr_start: None,
        settings: &Settings::new(&technique.params),
        timing: None,
    };
    Ok(oracle::check(&context, samples, seed))
}

/// Rays start off their surfaces by some 1e-5 of the coordinates, which turns short and grazing edges: in rooms with
/// corners, and with lamps deep in their shades, every tenth to fourth path has a rough density. With rays that start 16
/// times closer it is 20 times rarer, so nothing else is behind it. Half of the paths may have one. A density of which a
/// factor is missing or stands twice is not rough but wrong, in every path of its strategy: no more than one path in a
/// hundred may be off by more than [`COARSE`]; many, because the paths of one sample share their edges. Weights are ratios
/// and keep their digits: one in a thousand may not.
fn is_right(report: &OracleReport) -> bool {
    report.paths > 0
        && report.rough_weights * 1000 <= report.paths
        && report.worst_sum <= TOLERANCE
        && report.rough_densities * 2 <= report.paths
        && report.coarse_densities * 100 <= report.paths
}

fn outcome(report: &OracleReport) -> Outcome {
    let OracleReport { paths, worst_weight, rough_weights, worst_sum, worst_density, rough_densities, .. } = report;
    let coarse_densities = report.coarse_densities;
    Outcome {
        verdict: if is_right(report) { Verdict::Passed } else { Verdict::Failed },
        statement: format!(
            "{paths} paths, greatest error of a weight {worst_weight:.1e} ({rough_weights} beyond {TOLERANCE:.0e}), of their sum {worst_sum:.1e}, of a density \
             {worst_density:.1e}; {rough_densities} densities beyond {TOLERANCE:.0e}, {coarse_densities} beyond {COARSE}"
        ),
        figures: json!({
            "paths": paths,
            "dirac_paths": report.dirac_paths,
            "worst_weight": worst_weight,
            "rough_weights": rough_weights,
            "worst_sum": worst_sum,
            "worst_density": worst_density,
            "rough_densities": rough_densities,
            "coarse_densities": coarse_densities,
        }),
    }
}
