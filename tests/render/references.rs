//! Images by Mitsuba 3 of scenes that nobody here made. Skipped where the shared folder is absent.

use std::path::Path;
use std::sync::Arc;

use lumbre::film::Image;
use lumbre::metrics::ztest::{self, Estimate, ZTest};
use lumbre::output::exr;
use lumbre::scene::edit::set;
use lumbre::scene::{compile, load};

use crate::common::{job, render, shared};

/// Light found by chance is rare: a block's mean is normal only if enough samples are expected to find some. Each brings
/// at most the lamp's radiance of 10, so the reference tells how many that are at least.
const MIN_EXPECTED_FINDS: f64 = 50.0;
const LAMP_RADIANCE: f64 = 10.0;

fn image(path: &Path) -> Image {
    exr::decode(&std::fs::read(path).unwrap()).unwrap().0
}

/// Renders a `.scn` at the references' settings and compares it with one of them.
fn compare(root: &Path, scene: &str, model: &str, reference: &str, depth: u32, samples: u64) -> ZTest {
    let (mut desc, _) = load::load(&root.join("scenes/vkraytracing").join(scene)).unwrap();
    set(&mut desc, "materials.*.model", &model.into()).unwrap();
    let (compiled, _) = compile(&desc).unwrap();
    let film = render(&Arc::new(compiled), job([320, 180], depth, 77), samples);
    let theirs = image(&root.join(format!("references/{reference}.exr")));
    let mut variance = image(&root.join(format!("references/{reference}.stderr.exr")));
    variance.data.iter_mut().for_each(|p| *p = p.map(|e| e * e));
    ztest::compare(
        Estimate { mean: &film.mean(), variance: &film.variance_of_mean() },
        Estimate { mean: &theirs, variance: &variance },
        20,
        MIN_EXPECTED_FINDS * LAMP_RADIANCE / samples as f64,
    )
}

#[test]
fn diffuse_cornell_box_equals_mitsuba_at_every_depth() {
    let Some(root) = shared() else {
        println!("SKIPPED: no shared references beside this checkout");
        return;
    };
    let depths = [1, 2, 3, 5];
    for depth in depths {
        let name = format!("cornellbox_original_diffuse_md{depth}");
        let found = compare(&root, "cornellbox_original.scn", "lambert", &name, depth, 48);
        assert!(found.comparisons > if depth == 1 { 3 } else { 100 }, "{found:?}");
        assert!(found.agrees(0.01, depths.len()), "depth {depth}: {found:?}");
    }
}
