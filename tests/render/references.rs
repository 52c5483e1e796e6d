//! Images by Mitsuba 3 of scenes that nobody here made. Skipped where the shared folder is absent.

use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use lumbre::film::Image;
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

/// The part of the picture on a sphere of `cornellbox_sphere.scn`, of a radius, as its camera sees it.
fn on_sphere(center: Vec3, radius: f32, x: u32, y: u32) -> bool {
    let tan = 30f32.to_radians().tan();
    let at = |v: u32, n: f32| 2.0 * (v as f32 + 0.5) / n - 1.0;
    let dir = Vec3::new(at(x, 320.0) * tan * 320.0 / 180.0, -at(y, 180.0) * tan, -1.0).normalize_or(Vec3::Z);
    let to = center - Vec3::new(0.0, 0.7, 2.2);
    to.cross(dir).length() < radius
}

#[test]
fn disney_cornell_box_with_spheres_equals_mitsubas_principled() {
    let Some(root) = shared() else {
        println!("SKIPPED: no shared references beside this checkout");
        return;
    };
    let (desc, _) = load::load(&root.join("scenes/vkraytracing/cornellbox_sphere.scn")).unwrap();
    let (compiled, _) = compile(&desc).unwrap();
    let mut job = job([320, 180], 5, std::env::var("SEED").map_or(78, |s| s.parse().unwrap()));
    job.integrator = integrator("nee").unwrap();
    let film = render(&Arc::new(compiled), job, std::env::var("SPP").map_or(32, |s| s.parse().unwrap()));
    let (mut ours, mut our_variance) = (film.mean(), film.variance_of_mean());
    let name = "references/cornellbox_sphere_principled_md5";
    let mut theirs = image(&root.join(format!("{name}.exr")));
    let mut their_variance = image(&root.join(format!("{name}.stderr.exr")));
    their_variance.data.iter_mut().for_each(|p| *p = p.map(|e| e * e));
    let glass = Vec3::new(0.44, 0.33, 0.38);
    let (mut on, mut variance) = ([0.0; 2], 0.0);
    for (x, y) in (0..180).flat_map(|y| (0..320).map(move |x| (x, y))) {
        if !on_sphere(glass, 0.34, x, y) {
            continue;
        }
        let i = (y * 320 + x) as usize;
        for c in 0..3 {
            on[0] += f64::from(ours.data[i][c]);
            on[1] += f64::from(theirs.data[i][c]);
            variance += f64::from(our_variance.data[i][c]) + f64::from(their_variance.data[i][c]);
        }
        for image in [&mut ours, &mut our_variance, &mut theirs, &mut their_variance] {
            image.data[i] = [0.0; 3];
        }
    }
    let found = ztest::compare(
        Estimate { mean: &ours, variance: &our_variance },
        Estimate { mean: &theirs, variance: &their_variance },
        20,
        0.5,
    );
    for by in 0..9 {
        for bx in 0..16 {
            for c in 0..3 {
                let (mut a, mut b, mut v) = (0.0, 0.0, 0.0);
                for i in (0..400).map(|k| (by * 20 + k / 20) * 320 + bx * 20 + k % 20) {
                    a += f64::from(ours.data[i][c]);
                    b += f64::from(theirs.data[i][c]);
                    v += f64::from(our_variance.data[i][c]) + f64::from(their_variance.data[i][c]);
                }
                let z = (a - b) / v.sqrt();
                if z.abs() > 3.0 {
                    println!("block {bx} {by} channel {c}: {a} {b} {} z {z}", a / b);
                }
            }
        }
    }
    for c in 0..3 {
        let sum = |f: &Image| f.data.iter().map(|p| f64::from(p[c])).sum::<f64>();
        let (a, b, v) = (sum(&ours), sum(&theirs), sum(&our_variance) + sum(&their_variance));
        println!("channel {c}: {a} {b} {} +- {} z {}", a / b, v.sqrt() / b, (a - b) / v.sqrt());
    }
    println!("{found:?} glass {on:?} {} +- {}", on[0] / on[1], variance.sqrt() / on[1]);
}
