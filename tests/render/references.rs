//! Images by Mitsuba 3 of scenes that nobody here made. Skipped where the shared folder is absent.

use std::path::Path;
use std::sync::Arc;

use lumbre::film::{Film, Image};
use lumbre::math::stats::{normal_two_sided_p, sidak};
use lumbre::output::exr;
use lumbre::scene::edit::set;
use lumbre::scene::{compile, load};

use crate::common::{job, render, shared};

/// Side of the square blocks whose means are compared: a block's mean is normal enough for a z-test where a pixel's,
/// with its rare bright samples, is not.
const BLOCK: u32 = 20;

fn image(path: &Path) -> Image {
    exr::decode(&std::fs::read(path).unwrap()).unwrap().0
}

struct Block {
    ours: f64,
    variance: f64,
    theirs: f64,
}

/// Light found by chance is rare: a block's mean is normal only if enough samples are expected to find some. Each brings
/// at most the lamp's radiance of 10, so the reference tells how many that are at least.
const MIN_EXPECTED_FINDS: f64 = 50.0;
const LAMP_RADIANCE: f64 = 10.0;

/// Sums over blocks and channels; the blocks too dark for a test of their own are one block together.
fn blocks(film: &Film, reference: &Image, stderr: &Image) -> Vec<Block> {
    let bright_enough = MIN_EXPECTED_FINDS * LAMP_RADIANCE / film.samples as f64;
    let mut dark = Block { ours: 0.0, variance: 0.0, theirs: 0.0 };
    let mean = film.mean();
    let variance = film.variance_of_mean();
    let mut all = Vec::new();
    for by in 0..film.height / BLOCK {
        for bx in 0..film.width / BLOCK {
            for c in 0..3 {
                let mut b = Block { ours: 0.0, variance: 0.0, theirs: 0.0 };
                for y in by * BLOCK..(by + 1) * BLOCK {
                    for x in bx * BLOCK..(bx + 1) * BLOCK {
                        b.ours += f64::from(mean.at(x, y)[c]);
                        b.theirs += f64::from(reference.at(x, y)[c]);
                        b.variance += f64::from(variance.at(x, y)[c]) + f64::from(stderr.at(x, y)[c]).powi(2);
                    }
                }
                if b.theirs >= bright_enough {
                    all.push(b);
                } else {
                    dark.ours += b.ours;
                    dark.variance += b.variance;
                    dark.theirs += b.theirs;
                }
            }
        }
    }
    all.push(dark);
    all
}

/// Renders a `.scn` at the references' settings and compares it with one of them.
fn compare(root: &Path, scene: &str, model: &str, reference: &str, depth: u32, samples: u64) -> Vec<Block> {
    let (mut desc, _) = load::load(&root.join("scenes/vkraytracing").join(scene)).unwrap();
    set(&mut desc, "materials.*.model", &model.into()).unwrap();
    let (compiled, _) = compile(&desc).unwrap();
    let film = render(&Arc::new(compiled), job([320, 180], depth, 77), samples);
    let theirs = image(&root.join(format!("references/{reference}.exr")));
    let stderr = image(&root.join(format!("references/{reference}.stderr.exr")));
    blocks(&film, &theirs, &stderr)
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
        let blocks = compare(&root, "cornellbox_original.scn", "lambert", &name, depth, 48);
        let alpha = sidak(0.01, blocks.len() * depths.len());
        for (i, b) in blocks.iter().enumerate() {
            let sigma = b.variance.sqrt();
            // A block without noise, deep inside the lamp or of nothing at all, has to be equal.
            let p = if sigma > 0.0 {
                normal_two_sided_p((b.ours - b.theirs) / sigma)
            } else {
                f64::from((b.ours - b.theirs).abs() <= 1e-5 * b.theirs)
            };
            assert!(p > alpha, "depth {depth}, block {i}: {} against {} +- {sigma}, p = {p}", b.ours, b.theirs);
        }
        let sum = |f: fn(&Block) -> f64| blocks.iter().map(f).sum::<f64>();
        let z = (sum(|b| b.ours) - sum(|b| b.theirs)) / sum(|b| b.variance).sqrt();
        assert!(z.abs() < 3.0, "depth {depth}: z = {z} of the mean");
        println!("depth {depth}: z of the mean {z:.2}, {} blocks", blocks.len());
    }
}
