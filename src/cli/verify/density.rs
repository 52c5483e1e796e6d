//! MIS weights and densities of `bdpt`, `guided_bdpt`, `vcm` and `lvc`, path by path, compared with
//! the products that define them. The comparison is deterministic: differences are rounding errors,
//! so a wrong weight is found even if it hardly changes a picture.

use std::rc::Rc;
use std::sync::Arc;

use serde_json::json;

use super::technique::Technique;
use super::{Check, Outcome, SeedFamily, Verdict, VerifyRequest};
use crate::cli::night::load;
use crate::cli::scene::builtin::{BuiltIn, scene_name};
use lumbre_light::scene::{CompiledScene, compile};
use lumbre_light::transport::arrival::SurfaceClasses;
use lumbre_light::transport::camera::{Camera, FilterSpec};
use lumbre_light::transport::integrator::guided::bidirectional;
use lumbre_light::transport::integrator::oracle::{self, COARSE, OracleReport, TOLERANCE};
use lumbre_light::transport::integrator::{
    Context, Settings, bdpt, integrator, lvc, settings, vcm,
};
use lumbre_light::transport::light::Lights;
use lumbre_light::transport::mis;
use lumbre_light::value::Value;
use lumbre_render::cpu::bvh::accel::Accel;
use lumbre_scene_io::load::MissingTextures;

/// Resolution of the pictures whose paths are checked.
const RESOLUTION: [u32; 2] = [64, 64];

/// Number of light subpaths of `vcm`, so that a camera vertex merges with few vertices.
const LIGHT_SUBPATHS: i64 = 256;

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
    let mut merging = integrator(vcm::ROW.name)
        .map(Technique::plain)
        .ok_or("no integrator `vcm`")?;
    let few = (settings::PHOTONS.key.to_owned(), Value::Int(LIGHT_SUBPATHS));
    merging.params.extend([few]);
    techniques.push(merging);
    let cached = integrator(lvc::ROW.name).map(Technique::plain);
    techniques.push(cached.ok_or("no integrator `lvc`")?);
    let guided = integrator(bidirectional::ROW.name).map(Technique::plain);
    techniques.push(guided.ok_or("no integrator `guided_bdpt`")?);
    let built_in = BuiltIn::unpack()?;
    let mut checks = Vec::new();
    for file in built_in.scenes() {
        let (desc, _) =
            load::load_scene(&file, MissingTextures::Fail).map_err(|e| e.to_string())?;
        let scene = Rc::new(Arc::new(compile(&desc).map_err(|e| e.to_string())?.0));
        for technique in &techniques {
            let seed = request.seed(SeedFamily::Density, checks.len());
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
    let camera = Camera::new(&scene.camera, RESOLUTION, FilterSpec::PIXEL);
    let (lights, classes) = (Lights::new(scene), SurfaceClasses::new(scene));
    let settings = Settings::new(&technique.params);
    let lend = |run: &mut dyn FnMut(&Context)| {
        run(&Context {
            scene,
            camera: &camera,
            lights: &lights,
            classes: &classes,
            trace: &accel,
            max_depth: scene.max_depth,
            rr_start: None,
            settings: &settings,
            params: &technique.params,
            timing: None,
            shared: None,
        });
    };
    if technique.row.name == vcm::ROW.name {
        return Ok(oracle::check_vcm(lend, samples, seed));
    }
    if technique.row.name == lvc::ROW.name {
        return Ok(oracle::check_lvc(lend, samples, seed));
    }
    if technique.row.name == bidirectional::ROW.name {
        return Ok(oracle::check_guided_bdpt(lend, samples, seed));
    }
    let mut report = OracleReport::default();
    lend(&mut |context| report = oracle::check(context, samples, seed));
    Ok(report)
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
/// Merging takes two vertices for one, so half of the merged paths may be coarse, and the weights of
/// one path in a thousand may not add up to one.
fn is_right(report: &OracleReport) -> bool {
    report.paths > 0
        && report.rough_weights * 1000 <= report.paths
        && report.worst_sum <= TOLERANCE
        && report.rough_densities * 2 <= report.paths
        && report.coarse_densities * 100 <= report.paths
        && report.rough_merge_weights * 1000 <= report.paths
        && report.rough_merged_sums * 1000 <= report.paths
        && report
            .median_merge_errors()
            .iter()
            .all(|error| *error <= COARSE)
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
    let merges = report.merges.iter().sum::<u64>();
    let [merged_weight, merged_density] = report.median_merge_errors();
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
            "merges": merges,
            "rough_merge_weights": report.rough_merge_weights,
            "rough_merged_sums": report.rough_merged_sums,
            "median_merged_weight": merged_weight,
            "median_merged_density": merged_density,
        }),
    }
}
