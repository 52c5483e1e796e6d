//! The glass egg of a scene of thesis S0. The path tracer of S0 shows the light in the egg far too
//! dark and lacks the reflection of the right light on it: strategies that cannot find those paths
//! contributed to their weights. Here all three integrators must agree. Skipped if the shared
//! folder is absent.

use std::sync::Arc;

use glam::Vec3;
use lumbre_light::film::Film;
use lumbre_light::film::ztest::{self, Estimate};
use lumbre_light::scene::compile;
use lumbre_scene_io::load;

use crate::common::{job, render, shared};
use crate::render::agreement::{Technique, technique};

/// Least number of samples expected to find light in a block that is compared. With fewer, its mean
/// is not normally distributed.
const MIN_EXPECTED_FINDS: f64 = 50.0;
/// Radiance of the lights, the most that a sample contributes.
const LAMP_RADIANCE: f64 = 100.0;

#[test]
fn integrators_agree_on_caustic_and_reflection_of_the_glass_egg() {
    let Some(root) = shared() else {
        crate::common::skipped("no shared scenes beside this checkout");
        return;
    };
    let file = root.join("scenes/vkraytracing/Bidirectional/veach_lamps.scn");
    let (mut desc, _) = load::load(&file).unwrap();
    // The egg and its caustic on the table, from above.
    (desc.camera.position, desc.camera.target) =
        (Vec3::new(0.2, 1.0, 0.5), Vec3::new(0.17, 0.45, -0.45));
    desc.camera.optics = desc.camera.optics.with_fov_deg(24.0);
    let scene = Arc::new(compile(&desc).unwrap().0);
    let picture = |(row, params): Technique, seed: u64, samples: u64| -> Film {
        let mut j = job([36, 24], 5, seed);
        (j.integrator, j.settings.params) = (row, params);
        render(&scene, j, samples)
    };
    let samples = 3000;
    let bpt = picture(technique("bpt", &[]), 1, samples);
    let [truth, variance] = [bpt.mean(), bpt.variance_of_mean()];
    let truth = Estimate {
        mean: &truth,
        variance: &variance,
    };
    let bright = MIN_EXPECTED_FINDS * LAMP_RADIANCE / samples as f64;
    let others = [("nee", 600), ("bdpt", 300)];
    for (i, (name, samples)) in others.into_iter().enumerate() {
        let film = picture(technique(name, &[]), 2 + i as u64, samples);
        let other = Estimate {
            mean: &film.mean(),
            variance: &film.variance_of_mean(),
        };
        let found = ztest::compare(other, truth, 6, bright);
        assert!(
            found.comparisons >= 30,
            "too few blocks are bright enough for this test: {found:?}"
        );
        assert!(found.agrees(0.001, others.len()), "{name}: {found:?}");
    }
}
