//! Pictures with their noise, and the judgement whether two of them show the same.

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::technique::Technique;
use super::{Outcome, SIGNIFICANCE, Verdict};
use crate::film::{Film, Image};
use crate::metrics::ztest::{self, Estimate, ZTest};
use crate::render::cpu::renderer::CpuRenderer;
use crate::render::{Job, Renderer};
use crate::scene::CompiledScene;

/// A sum over pixels is called normal if so many samples are expected to have found the light in it.
const ENOUGH_FINDS: f64 = 50.0;

/// How a picture is rendered.
#[derive(Clone, Copy, Debug)]
pub struct Setting {
    /// Width and height in pixels.
    pub resolution: [u32; 2],
    /// Greatest number of path edges.
    pub max_depth: u32,
    /// First edge behind which roulette may end a path.
    pub rr_start: Option<u32>,
    /// Samples per pixel, at least two.
    pub samples: u64,
    /// Its seed.
    pub seed: u64,
    /// Worker threads; 0 is one for each core.
    pub threads: usize,
}

/// A picture, the variance of its pixels, and how unevenly its light was found.
#[derive(Clone, Debug)]
pub struct Picture {
    /// The estimate.
    pub mean: Image,
    /// The variance of each pixel's mean; zero where the picture is exact.
    pub variance: Image,
    /// What a typical find adds to a pixel's mean: finds weighted by what they bring. Zero for a picture without noise.
    pub find: f64,
}

impl Picture {
    /// A picture known by other means.
    pub fn known(mean: Image, variance: Image) -> Picture {
        Picture { mean, variance, find: 0.0 }
    }

    /// What a film holds.
    pub fn of(film: &Film) -> Picture {
        let total = |sums: &[[f64; 3]]| sums.iter().flatten().sum::<f64>();
        let (sum, squares) = (total(&film.sum), total(&film.sum2));
        let find = if sum > 0.0 { squares / sum / film.samples as f64 } else { 0.0 };
        Picture { mean: film.mean(), variance: film.variance_of_mean(), find }
    }

    /// The same picture, black where `keep` says no.
    pub fn only(&self, keep: impl Fn(u32, u32) -> bool) -> Picture {
        let cut = |image: &Image| {
            Image::from_fn(image.width, image.height, |x, y| if keep(x, y) { image.at(x, y) } else { [0.0; 3] })
        };
        Picture { mean: cut(&self.mean), variance: cut(&self.variance), find: self.find }
    }

    /// Sum of all pixels and channels, and its standard error as if channels shared all of their noise.
    pub fn total(&self) -> (f64, f64) {
        let pixels = self.mean.data.len() as f64;
        let sum = |of: [f64; 3]| of.map(|mean| mean * pixels);
        (sum(self.mean.mean()).iter().sum(), sum(self.variance.mean()).map(f64::sqrt).iter().sum())
    }

    /// How many finds made the picture, weighted by what they brought.
    fn finds(&self) -> f64 {
        if self.find > 0.0 { self.total().0 / self.find } else { f64::INFINITY }
    }
}

/// Renders on the CPU.
///
/// # Errors
/// When the backend fails, or when samples are NaN or infinite, with a message for people.
pub fn render(scene: &Arc<CompiledScene>, technique: &Technique, setting: Setting) -> Result<Picture, String> {
    let job = Job {
        params: technique.params.clone(),
        rr_start: setting.rr_start,
        threads: setting.threads,
        ..Job::plain(technique.row, setting.resolution, setting.max_depth, setting.seed)
    };
    let mut renderer = CpuRenderer::new(Arc::clone(scene), job).map_err(|e| e.to_string())?;
    let wave = renderer.advance(setting.samples).map_err(|e| e.to_string())?;
    match wave.first_invalid {
        None => Ok(Picture::of(renderer.film())),
        Some([x, y, sample]) => Err(format!(
            "{technique} makes {} samples that are no numbers, the first in pixel {x},{y}, sample {sample}",
            wave.invalid
        )),
    }
}

/// Whether two pictures show the same, as one of `tests` such questions.
pub struct Judgement {
    /// What the comparison found.
    pub found: ZTest,
    /// Standard error of its ratio.
    pub ratio_error: f64,
    /// The fewest finds that made either picture.
    pub finds: f64,
    /// The significance of each of its comparisons.
    pub level: f64,
    /// Whether they do.
    pub agrees: bool,
}

/// Compares two pictures by blocks of `block` pixels a side; blocks where too little light was found are pooled.
pub fn judge(first: &Picture, second: &Picture, block: u32, tests: usize) -> Judgement {
    let ((a, ea), (b, eb)) = (first.total(), second.total());
    let found = ztest::compare(
        Estimate { mean: &first.mean, variance: &first.variance },
        Estimate { mean: &second.mean, variance: &second.variance },
        block,
        ENOUGH_FINDS * first.find.max(second.find),
    );
    Judgement {
        level: found.level(SIGNIFICANCE, tests),
        agrees: found.agrees(SIGNIFICANCE, tests),
        ratio_error: found.ratio * (ea / a).hypot(eb / b),
        finds: first.finds().min(second.finds()),
        found,
    }
}

impl Judgement {
    /// Whether so little light was found that nothing can be said.
    pub fn too_dark(&self) -> bool {
        self.finds < ENOUGH_FINDS
    }

    /// The statistic in words.
    pub fn statement(&self) -> String {
        let ZTest { comparisons, worst_p, worst_at, ratio, z } = &self.found;
        let place = match worst_at {
            Some([x, y]) => format!(" at {x},{y}"),
            None => String::new(),
        };
        let ratio = if ratio.is_finite() { format!("{ratio:.4} ± {:.4}", self.ratio_error) } else { "-".to_owned() };
        format!("ratio {ratio}, z = {z:.2}, least p = {worst_p:.1e}{place} of {comparisons}, level {:.1e}", self.level)
    }

    /// The statistic as numbers.
    pub fn figures(&self) -> Json {
        json!({
            "ratio": self.found.ratio,
            "ratio_error": self.ratio_error,
            "z": self.found.z,
            "least_p": self.found.worst_p,
            "least_p_at": self.found.worst_at,
            "comparisons": self.found.comparisons,
            "level": self.level,
            "finds": self.finds,
        })
    }

    /// The verdict with both.
    pub fn outcome(&self) -> Outcome {
        if self.too_dark() {
            return Outcome::skipped(format!(
                "light was found about {:.0} times, {ENOUGH_FINDS} are needed",
                self.finds
            ));
        }
        let verdict = if self.agrees { Verdict::Passed } else { Verdict::Failed };
        Outcome { verdict, statement: self.statement(), figures: self.figures() }
    }
}
