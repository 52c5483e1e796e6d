//! Checks of Bitterli's scenes in Mitsuba's format against the pictures that Tungsten rendered.
//!
//! These pictures have no standard errors and use slightly different formulas, so this is not a
//! hypothesis test: the ratio of means must be within [`MEAN_BOUND`] of one, and the error of the
//! median block within the bound of the table. Both are compared at a reduced resolution, with
//! the reference averaged down. Small visible emitters and their edges dominate the means, so
//! pixels are sampled by `sobol`; the standard error is estimated from [`PARTS`] pictures with
//! different seeds.

use std::path::Path;
use std::sync::Arc;

use serde_json::json;

use super::references::picture;
use super::{Check, Outcome, SeedFamily, Verdict, VerifyRequest};
use crate::cli::night::load;
use lumbre_light::film::Image;
use lumbre_light::math::stats::median;
use lumbre_light::scene::compile;
use lumbre_light::scene::desc::Formulas;
use lumbre_light::transport::integrator::integrator;
use lumbre_light::transport::sampler::SOBOL;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};
use lumbre_scene_io::load::MissingTextures;

/// Largest difference of the ratio of means from one.
pub const MEAN_BOUND: f64 = 0.01;

/// Standard error of the ratio above which the check is skipped.
const MAX_RATIO_ERROR: f64 = 0.005;

/// Number of pictures, each with a part of the samples, from which the noise is estimated.
pub const PARTS: u64 = 8;

/// Factor by which pictures are reduced along each side; twice as much in a quick run.
const SHRINK: u32 = 8;

/// Side in pixels of the compared blocks of the reduced pictures.
const BLOCK: u32 = 4;

/// First edge after which Russian roulette may terminate a path.
const ROULETTE: u32 = 6;

/// A scene with its reference picture.
#[derive(Debug)]
pub struct KnownPicture {
    /// Scene file, relative to the folder of scenes.
    pub file: &'static str,
    /// Largest number of path edges of the reference picture.
    pub max_depth: u32,
    /// Integrator with the least noise for this scene.
    pub integrator: &'static str,
    /// Samples per pixel; a quick run uses a quarter of them.
    pub samples: u64,
    /// Largest relative error of the median block, including noise.
    pub block_bound: f64,
    /// Remarks, such as why the number of edges differs from that of the file.
    pub doc: &'static str,
}

/// All known scenes.
pub const KNOWN_PICTURES: &[KnownPicture] = &[
    KnownPicture {
        file: "cornell-box/scene.xml",
        max_depth: 65,
        integrator: "nee",
        samples: 256,
        block_bound: 0.03,
        doc: "as in its file, except that the file sets 30 edges",
    },
    KnownPicture {
        file: "veach-mis/scene.xml",
        max_depth: 2,
        integrator: "nee",
        samples: 2048,
        block_bound: 0.02,
        doc: "its reference shows direct light only; its file sets 3 edges",
    },
    KnownPicture {
        file: "veach-bidir/scene.xml",
        max_depth: 6,
        integrator: "bdpt",
        samples: 1024,
        block_bound: 0.04,
        doc: "its file sets 7 edges, which is too bright in Mitsuba 3 as well",
    },
    KnownPicture {
        file: "bedroom/scene_local.xml",
        max_depth: 65,
        integrator: "nee",
        samples: 512,
        block_bound: 0.08,
        doc: "without the fibres of the carpet",
    },
];

/// Result of a comparison.
#[derive(Clone, Copy, Debug)]
pub struct PictureComparison {
    /// Ratio of the means of all channels, rendered over reference.
    pub ratio: f64,
    /// Standard error of the ratio, from the spread of the rendered pictures.
    pub error: f64,
    /// Median of the relative errors of the blocks.
    pub block: f64,
}

/// Lists the checks of the scenes that exist below the folder of scenes.
///
/// # Errors
/// None: missing scenes have no check.
pub fn plan(request: &VerifyRequest) -> Result<Vec<Check>, String> {
    let Some(folder) = &request.scenes else {
        return Ok(Vec::new());
    };
    let available = KNOWN_PICTURES
        .iter()
        .enumerate()
        .filter(|(_, row)| folder.join(row.file).is_file());
    let check = |(i, row): (usize, &'static KnownPicture)| {
        let compared = format!(
            "{} with {} edges, {}",
            row.integrator, row.max_depth, row.doc
        );
        let (seed, threads, folder) = (
            request.seed(SeedFamily::Picture, i),
            request.threads,
            folder.clone(),
        );
        let (shrink, samples) = if request.quick {
            (2 * SHRINK, row.samples / 4)
        } else {
            (SHRINK, row.samples)
        };
        Check::new(row.name(), compared, move |_| {
            Ok(row.outcome(&row.compare(&folder, shrink, samples, seed, threads)?))
        })
    };
    Ok(available.map(check).collect())
}

impl KnownPicture {
    /// Name of the scene's folder.
    pub fn name(&self) -> &'static str {
        self.file.split('/').next().unwrap_or(self.file)
    }

    /// Renders the scene at the reduced resolution and compares it with its reference picture.
    ///
    /// # Errors
    /// A message for the user if the scene or picture cannot be read or rendered.
    pub fn compare(
        &self,
        folder: &Path,
        shrink: u32,
        samples: u64,
        seed: u64,
        threads: usize,
    ) -> Result<PictureComparison, String> {
        let file = folder.join(self.file);
        let reference_image = reduced(
            &picture(&file.with_file_name("TungstenRender.exr"))?,
            shrink,
        );
        let (mut desc, _) =
            load::load_scene(&file, MissingTextures::Fail).map_err(|e| e.to_string())?;
        // Tungsten's plastics have the formulas of this renderer, not those of Mitsuba.
        for material in &mut desc.materials {
            material.formulas = Formulas::Lumbre;
        }
        let (scene, _) = compile(&desc).map_err(|e| e.to_string())?;
        let row = integrator(self.integrator)
            .ok_or_else(|| format!("`{}` is no integrator", self.integrator))?;
        let scene = Arc::new(scene);
        let mut rendered = Image::new(reference_image.width, reference_image.height);
        let mut ratios = Vec::new();
        let reference = reference_image.mean().iter().sum::<f64>();
        for part in 0..PARTS {
            let seed = seed.wrapping_mul(PARTS).wrapping_add(part);
            let job = Job {
                sampler: SOBOL,
                threads,
                ..Job::plain(
                    row,
                    [reference_image.width, reference_image.height],
                    self.max_depth,
                    seed,
                )
            }
            .with(|settings| settings.rr_start = (self.max_depth > ROULETTE).then_some(ROULETTE));
            let mut renderer =
                CpuRenderer::new(Arc::clone(&scene), job).map_err(|e| e.to_string())?;
            renderer
                .advance((samples / PARTS).max(1))
                .map_err(|e| e.to_string())?;
            let mean = renderer.film().mean();
            ratios.push(mean.mean().iter().sum::<f64>() / reference);
            for (sum, value) in rendered
                .data
                .as_flattened_mut()
                .iter_mut()
                .zip(mean.data.as_flattened())
            {
                *sum += value / PARTS as f32;
            }
        }
        let ratio = ratios.iter().sum::<f64>() / PARTS as f64;
        let spread =
            ratios.iter().map(|r| (r - ratio).powi(2)).sum::<f64>() / (PARTS * (PARTS - 1)) as f64;
        Ok(PictureComparison {
            ratio,
            error: spread.sqrt(),
            block: median_block(&rendered, &reference_image),
        })
    }

    /// Whether the comparison is within both bounds.
    pub fn agrees(&self, comparison: &PictureComparison) -> bool {
        (comparison.ratio - 1.0).abs() <= MEAN_BOUND + 2.0 * comparison.error
            && comparison.block <= self.block_bound
    }

    fn outcome(&self, comparison: &PictureComparison) -> Outcome {
        let verdict = match self.agrees(comparison) {
            _ if comparison.error > MAX_RATIO_ERROR => Verdict::Skipped,
            true => Verdict::Passed,
            false => Verdict::Failed,
        };
        let PictureComparison {
            ratio,
            error,
            block,
        } = comparison;
        let percent = |x: f64| 100.0 * x;
        let noise = if *error > MAX_RATIO_ERROR {
            ", too noisy for a verdict"
        } else {
            ""
        };
        Outcome {
            verdict,
            statement: format!(
                "ratio {ratio:.4} ± {error:.4}, allowed {:.0} %; median block {:.1} %, \
                 allowed {:.0} %{noise}",
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

/// Averages blocks of `by` pixels a side; incomplete blocks at the right and bottom are dropped.
fn reduced(image: &Image, by: u32) -> Image {
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

/// Median relative error of the blocks that are not black in the reference; NaN if all are.
fn median_block(rendered: &Image, reference_image: &Image) -> f64 {
    let (rendered, reference_image) = (reduced(rendered, BLOCK), reduced(reference_image, BLOCK));
    let sum = |p: &[f32; 3]| p.iter().map(|c| f64::from(*c)).sum::<f64>();
    let pairs = rendered
        .data
        .iter()
        .zip(&reference_image.data)
        .map(|(a, b)| (sum(a), sum(b)));
    median(
        pairs
            .filter(|(_, b)| *b > 0.0)
            .map(|(a, b)| (a - b).abs() / b),
    )
}
