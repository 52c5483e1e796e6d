//! The glass egg of the scene in the thesis on bidirectional path tracing with Vulkan. Its path
//! tracer shows the light in the egg far too dark, and the reflection of the right light on it not
//! at all: strategies that could never have found those paths contributed to their weights. Here
//! all three techniques must show the same. Skipped if the shared folder is absent.

use std::sync::Arc;

use glam::Vec3;
use lumbre::film::Film;
use lumbre::metrics::ztest::{self, Estimate};
use lumbre::scene::{compile, load};

use crate::agreement::{Technique, technique};
use crate::common::{job, render, shared};

/// Expected finds in a block: its mean is normal only if enough samples are expected to find light
/// in it, each of which contributes at most the radiance of 100.
const MIN_EXPECTED_FINDS: f64 = 50.0;
const LAMP_RADIANCE: f64 = 100.0;

#[test]
fn caustic_and_reflection_on_the_egg_are_the_same_in_all() {
    let Some(root) = shared() else {
        println!("SKIPPED: no shared scenes beside this checkout");
        return;
    };
    let file = root.join("scenes/vkraytracing/Bidirectional/veach_lamps.scn");
    let (mut desc, _) = load::load(&file).unwrap();
    // The egg and its caustic on the table, from above.
    (desc.camera.position, desc.camera.target) =
        (Vec3::new(0.2, 1.0, 0.5), Vec3::new(0.17, 0.45, -0.45));
    desc.camera.fov_deg = 24.0;
    let scene = Arc::new(compile(&desc).unwrap().0);
    let with = |(row, params): Technique, seed: u64, samples: u64| -> Film {
        let mut j = job([36, 24], 5, seed);
        (j.integrator, j.params) = (row, params);
        render(&scene, j, samples)
    };
    let samples = 3000;
    let bpt = with(technique("bpt", &[]), 1, samples);
    let [truth, variance] = [bpt.mean(), bpt.variance_of_mean()];
    let truth = Estimate {
        mean: &truth,
        variance: &variance,
    };
    let bright = MIN_EXPECTED_FINDS * LAMP_RADIANCE / samples as f64;
    let others = [("nee", 600), ("bdpt", 300)];
    for (i, (name, samples)) in others.into_iter().enumerate() {
        let film = with(technique(name, &[]), 2 + i as u64, samples);
        let other = Estimate {
            mean: &film.mean(),
            variance: &film.variance_of_mean(),
        };
        let found = ztest::compare(other, truth, 6, bright);
        assert!(
            found.comparisons >= 30,
            "too little of the picture is bright enough to tell: {found:?}"
        );
        assert!(found.agrees(0.001, others.len()), "{name}: {found:?}");
    }
}
