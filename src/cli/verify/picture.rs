//! Pictures with per-pixel variance, and the test whether two of them have the same expectation.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::technique::Technique;
use super::{Outcome, SIGNIFICANCE, Verdict};
use lumbre_light::film::ztest::{self, Estimate, ZTest};
use lumbre_light::film::{Film, Image};
use lumbre_light::scene::CompiledScene;
use lumbre_render::cpu::renderer::CpuRenderer;
use lumbre_render::{Job, Renderer};

/// Expected number of contributions above which a sum over pixels is treated as normal.
const MIN_CONTRIBUTIONS: f64 = 50.0;

/// Parameters for rendering a picture.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Largest number of path edges.
    pub max_depth: u32,
    /// First edge after which Russian roulette may terminate a path.
    pub rr_start: Option<u32>,
    /// Samples per pixel, at least two.
    pub samples: u64,
    /// Seed of the picture.
    pub seed: u64,
    /// Number of worker threads; 0 means one per core.
    pub threads: usize,
}

impl Setting {
    /// Settings to start from: one pixel of emission alone, without Russian roulette.
    pub const PLAIN: Setting = Setting {
        resolution: [1, 1],
        max_depth: 1,
        rr_start: None,
        samples: 2,
        seed: 0,
        threads: 0,
    };
}

/// An attempt to judge pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Attempt {
    /// The first one.
    First,
    /// A second one, with four times the samples and other seeds.
    Confirmation,
}

impl Attempt {
    /// Returns the setting of this attempt for that of the first.
    pub fn setting(self, first: Setting) -> Setting {
        match self {
            Attempt::First => first,
            Attempt::Confirmation => Setting {
                samples: 4 * first.samples,
                seed: !first.seed,
                ..first
            },
        }
    }
}

/// Judges pictures. A failure counts only if a second attempt finds it again, since no test allows
/// for all that rare bright paths can do; the statement has both results.
///
/// # Errors
/// Those of `judge`.
pub fn confirmed(judge: impl Fn(Attempt) -> Result<Outcome, String>) -> Result<Outcome, String> {
    let first = judge(Attempt::First)?;
    if first.verdict != Verdict::Failed {
        return Ok(first);
    }
    let again = judge(Attempt::Confirmation)?;
    Ok(Outcome {
        statement: format!(
            "{}; with a quarter of the samples {}",
            again.statement, first.statement
        ),
        ..again
    })
}

/// A picture, the variance of its pixels, and the size of a typical contribution.
#[derive(Clone, Debug)]
pub struct NoisyPicture {
    /// Estimated radiance per pixel.
    pub mean: Image,
    /// Variance of each pixel's mean; zero if the picture is exact.
    pub variance: Image,
    /// Mean contribution of a sample to a pixel's mean, weighted by the contributions themselves.
    /// Zero for a picture without noise.
    pub contribution: f64,
}

impl NoisyPicture {
    /// Creates a picture from known values.
    pub fn from_values(mean: Image, variance: Image) -> NoisyPicture {
        NoisyPicture {
            mean,
            variance,
            contribution: 0.0,
        }
    }

    /// Creates a picture from a film.
    pub fn from_film(film: &Film) -> NoisyPicture {
        let total = |sums: &[[f64; 3]]| sums.iter().flatten().sum::<f64>();
        let (sum, squares) = (total(&film.sum), total(&film.sum2));
        let contribution = if sum > 0.0 {
            squares / sum / film.samples as f64
        } else {
            0.0
        };
        NoisyPicture {
            mean: film.mean(),
            variance: film.variance_of_mean(),
            contribution,
        }
    }

    /// Multiplies the variances by that of the sum over pixels, relative to independent pixels, for a
    /// picture whose pixels have common noise. The factor is that of the whole picture, which bounds
    /// that of blocks, and at least one. `totals` are the sums over pixels after each iteration.
    fn add_common_noise(&mut self, totals: &[[f64; 3]]) {
        let n = totals.len() as f64;
        let independent = self.variance.mean();
        let pixels = self.variance.data.len() as f64;
        let factors: [f64; 3] = std::array::from_fn(|c| {
            let mean = totals.last().map_or(0.0, |total| total[c]) / n;
            let before = std::iter::once(0.0).chain(totals.iter().map(|total| total[c]));
            let each = totals
                .iter()
                .zip(before)
                .map(|(total, before)| total[c] - before);
            let squares: f64 = each.map(|value| (value - mean) * (value - mean)).sum();
            let actual = squares / (n - 1.0) / n;
            let factor = actual / (independent[c] * pixels);
            if factor.is_finite() {
                factor.max(1.0)
            } else {
                1.0
            }
        });
        for variance in &mut self.variance.data {
            *variance = std::array::from_fn(|c| (f64::from(variance[c]) * factors[c]) as f32);
        }
    }

    /// Returns the picture with all pixels black for which `keep` is false.
    pub fn masked(&self, keep: impl Fn(u32, u32) -> bool) -> NoisyPicture {
        let mask = |image: &Image| {
            Image::from_fn(image.width, image.height, |x, y| {
                if keep(x, y) { image.at(x, y) } else { [0.0; 3] }
            })
        };
        NoisyPicture {
            mean: mask(&self.mean),
            variance: mask(&self.variance),
            contribution: self.contribution,
        }
    }

    /// Sum of all pixels and channels, and its standard error assuming fully correlated channels.
    pub fn total(&self) -> (f64, f64) {
        let pixels = self.mean.data.len() as f64;
        let sum = |means: [f64; 3]| means.map(|mean| mean * pixels);
        (
            sum(self.mean.mean()).iter().sum(),
            sum(self.variance.mean()).map(f64::sqrt).iter().sum(),
        )
    }

    /// Effective number of contributions, weighted by their size.
    fn contributions(&self) -> f64 {
        if self.contribution > 0.0 {
            self.total().0 / self.contribution
        } else {
            f64::INFINITY
        }
    }
}

/// Renders a picture on the CPU.
///
/// # Errors
/// A message for the user if the backend fails or samples are NaN or infinite.
pub fn render(
    scene: &Arc<CompiledScene>,
    technique: &Technique,
    setting: Setting,
) -> Result<NoisyPicture, String> {
    let job = Job::plain(
        technique.row,
        setting.resolution,
        setting.max_depth,
        setting.seed,
    )
    .on_threads(setting.threads)
    .with(|settings| {
        settings.params = technique.params.clone();
        settings.rr_start = setting.rr_start;
    });
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    // Iterations are independent; pixels whose samples share data are not.
    let shares = technique.row.has_common_noise();
    let waves = if shares { setting.samples } else { 1 };
    let mut totals = Vec::new();
    for _ in 0..waves {
        let wave = renderer
            .advance(setting.samples / waves)
            .map_err(|e| e.to_string())?;
        if let Some([x, y, sample]) = wave.first_invalid {
            return Err(format!(
                "{technique} produced {} NaN or infinite samples, the first in pixel {x},{y}, \
                 sample {sample}",
                wave.invalid
            ));
        }
        totals.push(column_sums(&renderer.film().sum));
    }
    let mut picture = NoisyPicture::from_film(renderer.film());
    if shares {
        picture.add_common_noise(&totals);
    }
    Ok(picture)
}

/// Sums each channel over all pixels.
fn column_sums(pixels: &[[f64; 3]]) -> [f64; 3] {
    pixels.iter().fold([0.0; 3], |sum, pixel| {
        std::array::from_fn(|c| sum[c] + pixel[c])
    })
}

/// Result of testing whether two pictures have the same expectation, as one of several tests.
pub struct Judgement {
    /// Result of the z-test.
    pub result: ZTest,
    /// Standard error of the ratio of means.
    pub ratio_error: f64,
    /// Smaller effective number of contributions of the two pictures.
    pub contributions: f64,
    /// Significance level of each block comparison.
    pub level: f64,
    /// Whether the pictures agree at this level.
    pub agrees: bool,
}

/// Compares two pictures by blocks of `block` pixels a side, as one of `tests` tests. Blocks with
/// too few contributions are pooled.
pub fn judge(first: &NoisyPicture, second: &NoisyPicture, block: u32, tests: usize) -> Judgement {
    let ((a, ea), (b, eb)) = (first.total(), second.total());
    let result = ztest::compare(
        Estimate {
            mean: &first.mean,
            variance: &first.variance,
        },
        Estimate {
            mean: &second.mean,
            variance: &second.variance,
        },
        block,
        MIN_CONTRIBUTIONS * first.contribution.max(second.contribution),
    );
    Judgement {
        level: result.level(SIGNIFICANCE, tests),
        agrees: result.agrees(SIGNIFICANCE, tests),
        ratio_error: result.ratio * (ea / a).hypot(eb / b),
        contributions: first.contributions().min(second.contributions()),
        result,
    }
}

impl Judgement {
    /// Whether there are too few contributions for a verdict.
    pub fn too_dark(&self) -> bool {
        self.contributions < MIN_CONTRIBUTIONS
    }

    /// Formats the statistic as text; ± is a 95 % confidence interval.
    pub fn statement(&self) -> String {
        let ZTest {
            comparisons,
            worst_p,
            worst_at,
            ratio,
            z,
        } = &self.result;
        let place = match worst_at {
            Some([x, y]) => format!(" at {x},{y}"),
            None => String::new(),
        };
        let ratio = if ratio.is_finite() {
            format!("{ratio:.4} ± {:.4}", 1.96 * self.ratio_error)
        } else {
            "-".to_owned()
        };
        format!(
            "ratio {ratio}, z = {z:.2}, least p = {worst_p:.1e}{place} of {comparisons}, \
             level {:.1e}",
            self.level
        )
    }

    /// Returns the statistic as numbers.
    pub fn figures(&self) -> Json {
        json!({
            "ratio": self.result.ratio,
            "ratio_error": self.ratio_error,
            "z": self.result.z,
            "least_p": self.result.worst_p,
            "least_p_at": self.result.worst_at,
            "comparisons": self.result.comparisons,
            "level": self.level,
            "finds": self.contributions,
        })
    }

    /// Returns the verdict with the statistic.
    pub fn outcome(&self) -> Outcome {
        if self.too_dark() {
            return Outcome::skipped(format!(
                "too dark: about {:.0} samples contributed light, {MIN_CONTRIBUTIONS} are needed",
                self.contributions
            ));
        }
        let verdict = if self.agrees {
            Verdict::Passed
        } else {
            Verdict::Failed
        };
        Outcome {
            verdict,
            statement: self.statement(),
            figures: self.figures(),
        }
    }
}
