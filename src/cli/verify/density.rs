//! MIS weights and densities of `bdpt`, path by path, compared with the products that define them.
//! The comparison is deterministic: differences are rounding errors, so a wrong weight is found
//! even if it hardly changes a picture.

use std::rc::Rc;
use std::sync::Arc;

use serde_json::json;

use super::technique::Technique;
use super::{Check, Outcome, Verdict, VerifyRequest};
use crate::cli::night::load;
use crate::cli::scene::builtin::{BuiltIn, scene_name};
use lumbre_light::scene::load::MissingTextures;
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterSpec};
use lumbre_light::transport::integrator::oracle::{self, COARSE, OracleReport, TOLERANCE};
use lumbre_light::transport::integrator::{Context, Settings, bdpt, integrator};
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::mis;
use lumbre_render::cpu::bvh::accel::Accel;

/// Identifies the seeds of these checks.
const SEED_FAMILY: u64 = 4;

/// Resolution of the pictures whose paths are checked.
const RESOLUTION: [u32; 2] = [64, 64];

/// Lists the checks of densities.
///
/// # Errors
/// If a built-in scene cannot be loaded.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let samples = if request.quick { 2000 } else { 50_000 };
    let default = integrator(bdpt::ROW.name)
        .map(Technique::plain)
        .ok_or("no integrator `bdpt`")?;
    let mut techniques = default.variants();
    techniques.retain(|technique| technique.params.contains_key(mis::FIELD.key));
    techniques.insert(0, default);
    let built_in = BuiltIn::unpack()?;
    let mut checks = Vec::new();
    for file in built_in.scenes() {
        let (desc, _) =
            load::load_scene(&file, MissingTextures::Fail).map_err(|e| e.to_string())?;
        let scene = Rc::new(Arc::new(compile(&desc).map_err(|e| e.to_string())?.0));
        for technique in &techniques {
            let seed = request.seed(SEED_FAMILY, checks.len());
            let (scene, technique) = (Rc::clone(&scene), technique.clone());
            let compared = format!("{technique}: weights with their definition");
            checks.push(Check::new(scene_name(&file), compared, move |_| {
                Ok(outcome(&report(&scene, &technique, samples, seed)?))
            }));
        }
    }
    Ok(checks)
}

fn report(
    scene: &Arc<CompiledScene>,
    technique: &Technique,
    samples: u64,
    seed: u64,
) -> Result<OracleReport, String> {
    let accel = Accel::build(Arc::clone(scene)).map_err(|e| e.to_string())?;
    let context = Context {
        scene,
        camera: &Camera::new(&scene.camera, RESOLUTION, FilterSpec::PIXEL),
        lights: &Lights::new(scene),
        classes: &SurfaceClasses::new(scene),
        trace: &accel,
        max_depth: scene.max_depth,
        rr_start: None,
        settings: &Settings::new(&technique.params),
        timing: None,
        shared: None,
    };
    Ok(oracle::check(&context, samples, seed))
}

/// Whether errors are within the expected rounding.
///
/// Ray origins are offset from their surfaces by about 1e-5 of the coordinates, which rotates short
/// and grazing edges: in rooms with corners, and with lamps deep inside their shades, every tenth
/// to fourth path has a rough density. With offsets 16 times smaller it is 20 times rarer, so
/// there is no other cause. Up to half of the paths may have a rough density. A density with a
/// missing or duplicated factor is wrong in every path of its strategy, not rough: at most one
/// path in a hundred may differ by more than [`COARSE`] (several, because the paths of one sample
/// share edges). Weights are ratios and keep their digits: at most one in a thousand may be rough.
fn is_right(report: &OracleReport) -> bool {
    report.paths > 0
        && report.rough_weights * 1000 <= report.paths
        && report.worst_sum <= TOLERANCE
        && report.rough_densities * 2 <= report.paths
        && report.coarse_densities * 100 <= report.paths
}

fn outcome(report: &OracleReport) -> Outcome {
    let OracleReport {
        paths,
        worst_weight,
        rough_weights,
        worst_sum,
        worst_density,
        rough_densities,
        ..
    } = report;
    let coarse_densities = report.coarse_densities;
    Outcome {
        verdict: if is_right(report) {
            Verdict::Passed
        } else {
            Verdict::Failed
        },
        statement: format!(
            "{paths} paths, largest error of a weight {worst_weight:.1e} ({rough_weights} above \
             {TOLERANCE:.0e}), of their sum {worst_sum:.1e}, of a density {worst_density:.1e}; \
             {rough_densities} densities above {TOLERANCE:.0e}, {coarse_densities} above {COARSE}"
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
