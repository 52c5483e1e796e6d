//! Bitterli's scenes in Mitsuba's format against the pictures that Tungsten made of them.
//!
//! Those pictures come without standard errors, and by formulas that are not quite ours, so that this is no test of
//! hypotheses: the ratio of means has to be within [`MEAN_BOUND`] of one, and the error of a typical block of pixels within what
//! the table allows. Both are compared at a part of the pictures' resolution, theirs averaged down. Small lamps that are seen
//! decide these means, and with them the edges of lamps, so that pixels are sampled by `sobol`; the standard error is that of
//! [`PARTS`] pictures of their own seeds.

use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::references::picture;
use super::{Check, Outcome, Request, Verdict};
use crate::cli::load;
use crate::film::Image;
use crate::math::stats::median;
use crate::render::cpu::renderer::CpuRenderer;
use crate::render::{Job, Renderer};
use crate::scene::compile;
use crate::scene::load::Missing;
use crate::transport::integrator::integrator;
use crate::transport::sampler::SOBOL;

/// How far from one the ratio of means may be.
pub const MEAN_BOUND: f64 = 0.01;

/// A standard error of the ratio above which nothing is said.
const SHARP: f64 = 0.005;

/// How many pictures, each of a part of the samples, say how large the noise is.
pub const PARTS: u64 = 8;

/// Marks the seeds of these checks.
const KIND: u64 = 4;

/// Sides of a picture are divided by this, and by twice as much in a quick run.
const SHRINK: u32 = 8;

/// Blocks of this many pixels a side, of the smaller pictures, are compared.
const BLOCK: u32 = 4;

/// The first edge behind which roulette may end a path.
const ROULETTE: u32 = 6;

/// One scene with its picture.
#[derive(Debug)]
pub struct Row {
    /// The scene's file below the folder of scenes.
    pub file: &'static str,
    /// Greatest number of path edges of the picture.
    pub max_depth: u32,
    /// The integrator that finds its light best.
    pub integrator: &'static str,
    /// Samples of every pixel; a quick run has a quarter of them.
    pub samples: u64,
    /// The greatest relative error of the median block, noise included.
    pub block_bound: f64,
    /// Why the number of edges is not that of the file, or what else there is to say.
    pub doc: &'static str,
}

/// The scenes that are known.
pub const ROWS: &[Row] = &[
    Row {
        file: "cornell-box/scene.xml",
        max_depth: 65,
        integrator: "nee",
        samples: 256,
        block_bound: 0.03,
        doc: "as its file says but for the edges, of which it names 30",
    },
    Row {
        file: "veach-mis/scene.xml",
        max_depth: 2,
        integrator: "nee",
        samples: 2048,
        block_bound: 0.02,
        doc: "its picture shows direct light only; its file asks for 3 edges",
    },
    Row {
        file: "veach-bidir/scene.xml",
        max_depth: 6,
        integrator: "bdpt",
        samples: 1024,
        block_bound: 0.04,
        doc: "its file asks for 7 edges, as which Mitsuba 3 makes it brighter, too",
    },
    Row {
        file: "bedroom/scene_local.xml",
        max_depth: 65,
        integrator: "nee",
        samples: 512,
        block_bound: 0.08,
        doc: "without the fibres of its carpet",
    },
];

/// What a comparison found.
#[derive(Clone, Copy, Debug)]
pub struct Found {
    /// Ratio of the means of all channels, ours over theirs.
    pub ratio: f64,
    /// Its standard error, from the spread of our pictures.
    pub error: f64,
    /// The median of the blocks' relative errors.
    pub block: f64,
}

/// The checks of this kind: those of the scenes that are below the folder of scenes.
///
/// # Errors
/// None: scenes that are not there have no check.
pub fn plan(request: &Request) -> Result<Vec<Check>, String> {
    let Some(folder) = &request.scenes else { return Ok(Vec::new()) };
    let there = ROWS.iter().enumerate().filter(|(_, row)| folder.join(row.file).is_file());
    let check = |(i, row): (usize, &'static Row)| {
        let compared = format!("{} with {} edges, {}", row.integrator, row.max_depth, row.doc);
        let (seed, threads, folder) = (request.seed(KIND, i), request.threads, folder.clone());
        let (shrink, samples) = if request.quick { (2 * SHRINK, row.samples / 4) } else { (SHRINK, row.samples) };
        Check::new(row.name(), compared, move |_| {
            Ok(row.outcome(&row.compare(&folder, shrink, samples, seed, threads)?))
        })
    };
    Ok(there.map(check).collect())
}

impl Row {
    /// The folder of the scene.
    pub fn name(&self) -> &'static str {
        self.file.split('/').next().unwrap_or(self.file)
    }

    /// Renders the scene below a folder at a part of its picture's resolution and compares.
    ///
    /// # Errors
    /// A scene or picture that cannot be read, or not rendered, with a message for people.
    pub fn compare(
        &self,
        folder: &Path,
        shrink: u32,
        samples: u64,
        seed: u64,
        threads: usize,
    ) -> Result<Found, String> {
        let file = folder.join(self.file);
        let theirs = smaller(&picture(&file.with_file_name("TungstenRender.exr"))?, shrink);
        let (desc, _) = load::scene(&file, Missing::Refused).map_err(|e| e.to_string())?;
        let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
        let row = integrator(self.integrator).ok_or_else(|| format!("`{}` is no integrator", self.integrator))?;
        let scene = Arc::new(scene);
        let mut ours = Image::new(theirs.width, theirs.height);
        let mut ratios = Vec::new();
        let reference = theirs.mean().iter().sum::<f64>();
        for part in 0..PARTS {
            let seed = seed.wrapping_mul(PARTS).wrapping_add(part);
            let job = Job {
                rr_start: (self.max_depth > ROULETTE).then_some(ROULETTE),
                sampler: SOBOL,
                threads,
                ..Job::plain(row, [theirs.width, theirs.height], self.max_depth, seed)
            };
            let mut renderer = CpuRenderer::new(Arc::clone(&scene), job).map_err(|e| e.to_string())?;
            renderer.advance((samples / PARTS).max(1)).map_err(|e| e.to_string())?;
            let mean = renderer.film().mean();
            ratios.push(mean.mean().iter().sum::<f64>() / reference);
            for (sum, own) in ours.data.as_flattened_mut().iter_mut().zip(mean.data.as_flattened()) {
                *sum += own / PARTS as f32;
            }
        }
        let ratio = ratios.iter().sum::<f64>() / PARTS as f64;
        let spread = ratios.iter().map(|r| (r - ratio).powi(2)).sum::<f64>() / (PARTS * (PARTS - 1)) as f64;
        Ok(Found { ratio, error: spread.sqrt(), block: median_block(&ours, &theirs) })
    }

    /// Whether what was found is within both bounds.
    pub fn agrees(&self, found: &Found) -> bool {
        (found.ratio - 1.0).abs() <= MEAN_BOUND + 2.0 * found.error && found.block <= self.block_bound
    }

    fn outcome(&self, found: &Found) -> Outcome {
        let verdict = match self.agrees(found) {
            _ if found.error > SHARP => Verdict::Skipped,
            true => Verdict::Passed,
            false => Verdict::Failed,
        };
        let Found { ratio, error, block } = found;
        let percent = |x: f64| 100.0 * x;
        let noise = if *error > SHARP { ", too noisy to be judged" } else { "" };
        Outcome {
            verdict,
            statement: format!(
                "ratio {ratio:.4} ± {error:.4}, allowed {:.0} %; median block {:.1} %, allowed {:.0} %{noise}",
                percent(MEAN_BOUND),
                percent(*block),
                percent(self.block_bound)
            ),
            figures: json!({
                "ratio": ratio, "ratio_error": error, "ratio_bound": MEAN_BOUND,
                "median_block": block, "median_block_bound": self.block_bound,
            }),
        }
    }
}

/// The picture with the mean of squares of so many pixels a side; what is left at the right and below is cut off.
fn smaller(image: &Image, by: u32) -> Image {
    let count = f64::from(by * by);
    Image::from_fn(image.width / by, image.height / by, |x, y| {
        let mut sum = [0.0f64; 3];
        for [i, j] in (0..by * by).map(|k| [k % by, k / by]) {
            let pixel = image.at(x * by + i, y * by + j);
            (0..3).for_each(|c| sum[c] += f64::from(pixel[c]));
        }
        sum.map(|s| (s / count) as f32)
    })
}

/// The median of the relative errors of the blocks that are not black in their picture; NaN where all are.
fn median_block(ours: &Image, theirs: &Image) -> f64 {
    let (ours, theirs) = (smaller(ours, BLOCK), smaller(theirs, BLOCK));
    let sum = |p: &[f32; 3]| p.iter().map(|c| f64::from(*c)).sum::<f64>();
    let pairs = ours.data.iter().zip(&theirs.data).map(|(a, b)| (sum(a), sum(b)));
    median(pairs.filter(|(_, b)| *b > 0.0).map(|(a, b)| (a - b).abs() / b))
}
