//! Images by Mitsuba 3 of scenes that nobody here made. Skipped where the shared folder is absent.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use lumbre::film::Image;
use lumbre::math::stats::{normal_two_sided_p, sidak};
use lumbre::metrics::ztest::{self, Estimate, ZTest};
use lumbre::output::exr;
use lumbre::scene::edit::set;
use lumbre::scene::{compile, load};
use lumbre::transport::integrator::integrator;

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

/// Whether a pixel shows a sphere of `cornellbox_sphere.scn`.
fn shows(center: Vec3, radius: f32, x: u32, y: u32) -> bool {
    let tan = 30f32.to_radians().tan();
    let at = |v: u32, n: f32| 2.0 * (v as f32 + 0.5) / n - 1.0;
    let dir = Vec3::new(at(x, 320.0) * tan * 320.0 / 180.0, -at(y, 180.0) * tan, -1.0).normalize_or(Vec3::Z);
    (center - Vec3::new(0.0, 0.7, 2.2)).cross(dir).length() < radius
}

/// The scene's own materials against Mitsuba's `principled`: walls of roughness 1 and index 1.5, a mirror-like metal, and
/// a ball of glass of index 2.5.
///
/// The formulas of the opaque lobes are the same, and the metal, of the least alpha there and a Dirac here, is narrower
/// than a pixel: those parts pass a z-test, the ball's caustics included. The ball differs in principle: there it is a
/// rough interface of alpha 0.001, evaluated in single precision, here a Dirac. So its mean is held within one per cent,
/// which is about the noise of these samples; with 480 of them it was 1.0015 +- 0.0031 of the reference, and all the rest
/// 1.0001 +- 0.0004. Light that comes through the ball is found by chance: with a quarter of the samples its bright
/// finds are too rare for sums to be normal.
#[test]
fn disney_cornell_box_with_spheres_equals_mitsubas_principled() {
    const SAMPLES: u64 = 128;
    const GLASS: (Vec3, f32) = (Vec3::new(0.44, 0.33, 0.38), 0.33);
    let Some(root) = shared() else {
        println!("SKIPPED: no shared references beside this checkout");
        return;
    };
    let (desc, _) = load::load(&root.join("scenes/vkraytracing/cornellbox_sphere.scn")).unwrap();
    let (compiled, _) = compile(&desc).unwrap();
    let mut job = job([320, 180], 5, 78);
    job.integrator = integrator("nee").unwrap();
    let film = render(&Arc::new(compiled), job, SAMPLES);
    let name = "references/cornellbox_sphere_principled_md5";
    let stderr = image(&root.join(format!("{name}.stderr.exr")));
    let reference = image(&root.join(format!("{name}.exr")));
    let squared = Image::from_fn(320, 180, |x, y| stderr.at(x, y).map(|e| e * e));
    // Sums over a part of the picture: ours, theirs, and the variance of their difference, in one channel.
    let (mean, variance) = (film.mean(), film.variance_of_mean());
    let sums = |c: usize, glass: bool| {
        let pixels = (0..180).flat_map(|y| (0..320).map(move |x| (x, y)));
        pixels.filter(|(x, y)| shows(GLASS.0, GLASS.1 * 1.02, *x, *y) == glass).fold([0.0; 3], |s, (x, y)| {
            let of = |image: &Image| f64::from(image.at(x, y)[c]);
            [s[0] + of(&mean), s[1] + of(&reference), s[2] + of(&variance) + of(&squared)]
        })
    };
    // Everything but the ball, in blocks and as a whole. Channels share their paths, so the whole is judged by each alone.
    let opaque = |image: &Image| {
        Image::from_fn(320, 180, |x, y| if shows(GLASS.0, GLASS.1 * 1.02, x, y) { [0.0; 3] } else { image.at(x, y) })
    };
    let found = ztest::compare(
        Estimate { mean: &opaque(&mean), variance: &opaque(&variance) },
        Estimate { mean: &opaque(&reference), variance: &opaque(&squared) },
        20,
        // The lamp's radiance is 1.
        MIN_EXPECTED_FINDS / SAMPLES as f64,
    );
    let level = sidak(0.01, found.comparisons + 3);
    assert!(found.comparisons > 200 && found.worst_p > level, "{found:?}");
    for c in 0..3 {
        let [ours, theirs, variance] = sums(c, false);
        assert!(variance.sqrt() / theirs < 0.002, "too noisy to tell");
        let p = normal_two_sided_p((ours - theirs) / variance.sqrt());
        assert!(p > level, "channel {c}: {ours} instead of {theirs}, p = {p}");
        let [ours, theirs, variance] = sums(c, true);
        assert!(variance.sqrt() / theirs < 0.015, "too noisy to tell: {}", variance.sqrt() / theirs);
        assert!((ours / theirs - 1.0).abs() < 0.01, "glass, channel {c}: {ours} instead of {theirs}");
    }
}
