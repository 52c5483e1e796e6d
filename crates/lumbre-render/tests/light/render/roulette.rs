//! Russian roulette: after which edge it may end camera paths, and with which probability.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::{ConeDesc, ConeEdge};
use lumbre_light::transport::MAX_SURVIVAL;
use lumbre_light::transport::integrator::integrator;
use lumbre_render::path_trace::SampleAt;
use lumbre_render::{Job, cpu};

use crate::common::{SceneBuilder, grey, job};
use crate::render::consistent_fixtures::GLASS;

/// Integrators whose camera paths end by roulette.
const NAMES: [&str; 3] = ["bpt", "nee", "bdpt"];

/// Side of the film in pixels, and number of samples of a pixel.
const SIZE: [u32; 2] = [8, 48];

/// Adds a light that nothing in a scene sees, and that sees nothing.
fn unseen_light(scene: SceneBuilder) -> Arc<CompiledScene> {
    let narrow = ConeDesc {
        beam_deg: 5.0,
        cutoff_deg: 10.0,
        edge: ConeEdge::Linear,
    };
    let far = Vec3::new(0.0, 30.0, 0.0);
    scene.spot(far, Vec3::Y, Vec3::ONE, narrow).build()
}

/// Returns how many surfaces the camera path of each sample hits.
fn hits(scene: &Arc<CompiledScene>, name: &str, rr_start: u32) -> Vec<usize> {
    let [side, samples] = SIZE;
    let job = Job {
        integrator: integrator(name).unwrap(),
        threads: 1,
        ..job([side; 2], 40, 3)
    }
    .with(|settings| settings.rr_start = Some(rr_start));
    let at = |i: u32| SampleAt {
        pixel: [i % side, i / side % side],
        sample: u64::from(i / (side * side)),
    };
    let all: Vec<SampleAt> = (0..side * side * samples).map(at).collect();
    let events = (cpu::ROW.paths)(scene, &job, &all).unwrap();
    let hits = events
        .iter()
        .map(|events| events.iter().filter_map(|e| e.vertex()).count());
    hits.collect()
}

/// After edge number `rr_start` a path goes on with its throughput as the probability, which restores
/// a throughput of one; every later edge exists with the albedo as its probability.
#[test]
fn roulette_may_end_a_path_after_the_edge_that_the_job_states() {
    let albedo = 0.2f64;
    let camera = SceneBuilder::new(Vec3::new(0.1, 0.2, 0.3), Vec3::new(0.7, 0.1, -0.4), 70.0);
    let scene = unseen_light(camera.room(1.0, grey(albedo as f32)));
    for name in NAMES {
        for rr_start in [1, 2, 4] {
            let hits = hits(&scene, name, rr_start);
            let n = hits.len() as f64;
            let mean = hits.iter().sum::<usize>() as f64 / n;
            let first = albedo.powi(rr_start as i32);
            let expected = f64::from(rr_start) + first / (1.0 - albedo);
            // Five standard errors: the further edges have a geometric distribution if there are any.
            let margin = 5.0 * (first * (1.0 + albedo) / n).sqrt() / (1.0 - albedo);
            let what = format!("{name} after edge {rr_start}");
            assert!(
                (mean - expected).abs() < margin,
                "{what}: {mean}, expected {expected}"
            );
        }
    }
}

/// Refraction scales radiance by one over the square of the index, but no light is lost.
#[test]
fn paths_in_lossless_glass_end_as_rarely_as_outside() {
    let camera = SceneBuilder::new(Vec3::Z * 4.0, Vec3::ZERO, 5.0);
    let scene = unseen_light(camera.sphere(Vec3::ZERO, 1.0, GLASS));
    for name in NAMES {
        let hits = hits(&scene, name, 1);
        let n = hits.len() as f64;
        let inside = hits.iter().filter(|hits| **hits >= 2).count() as f64 / n;
        // The front reflects 4 % near normal incidence.
        let expected = 0.96 * f64::from(MAX_SURVIVAL);
        let margin = 5.0 * (expected * (1.0 - expected) / n).sqrt();
        assert!(
            (inside - expected).abs() < margin,
            "{name}: {inside}, expected {expected}"
        );
    }
}
