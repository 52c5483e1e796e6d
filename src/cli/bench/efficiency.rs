//! Speed and efficiency of an integrator on one scene.
//!
//! Let `v` be the variance of one sample of a pixel (mean over all pixels and channels), `t` the
//! seconds for one sample of every pixel, and `m` the mean of the picture over all pixels and
//! channels:
//!
//! - efficiency `1 / (v t)`: inverse of the mean squared error after one second
//!   [Veach 1997, 2.4.1];
//! - relative RMSE after `n` samples: `sqrt(v / n) / m`, so that [`RELATIVE_RMSE`] is reached after
//!   `t v / (RELATIVE_RMSE m)^2` seconds.
//!
//! Both use the measured variance and no reference; for unbiased integrators the expectation is
//! the same. A variance dominated by few samples is unreliable: see [`IntegratorRates::variance`].

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::interleave::interleaved;
use lumbre_light::film::Film;
use lumbre_light::math::stats::median;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::IntegratorRow;
use lumbre_night::backends::backend;
use lumbre_render::hierarchy::LaneMode;
use lumbre_render::{Job, WaveStats};

/// Relative RMSE for which times are reported.
pub const RELATIVE_RMSE: f64 = 0.05;

/// Samples per pixel of one repetition: about as long as a wave of a night.
const SAMPLES: u64 = 4;

/// Smallest effective number of contributions for which a variance is reported.
const MIN_CONTRIBUTIONS: f64 = 1000.0;

/// Figures of one integrator.
pub struct IntegratorRates {
    /// Name of the integrator.
    pub name: &'static str,
    /// Median camera paths per second of the scalar path, in millions.
    pub mpaths_per_s: f64,
    /// Median camera paths per second of the vectorised path, in millions, if scene and processor
    /// support it.
    pub vectorised_mpaths_per_s: f64,
    /// Difference between the largest and the smallest scalar rate, divided by the median.
    pub spread: f64,
    /// Variance of one sample, mean over pixels and channels. `None` if the effective number of
    /// contributions is below [`MIN_CONTRIBUTIONS`], since the next one could multiply it.
    pub variance: Option<f64>,
    /// Mean of the picture over pixels and channels.
    pub mean: f64,
    /// Median seconds for one sample of every pixel.
    pub sample_s: f64,
}

/// Renders `repeats` waves after a warm-up wave, interleaving the scalar and vectorised paths.
///
/// # Errors
/// A message for the user if the backend fails.
pub fn measure(
    scene: &Arc<CompiledScene>,
    integrator: &'static IntegratorRow,
    threads: usize,
    repeats: usize,
) -> Result<IntegratorRates, String> {
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let open = |lanes: LaneMode| {
        let mut job = Job::plain(integrator, scene.resolution, scene.max_depth, 1);
        job.threads = threads;
        job.settings.accel.lanes = lanes;
        (cpu.open)(Arc::clone(scene), job).map_err(|e| e.to_string())
    };
    let mut runs = [open(LaneMode::Never)?, open(LaneMode::Always)?];
    let rate = |wave: &WaveStats| wave.paths as f64 / wave.render_s;
    interleaved(&mut runs, 1, 1, rate)?;
    let rounds = interleaved(&mut runs, repeats, SAMPLES, rate)?;
    let [rates, vectorised] =
        [0, 1].map(|i| rounds.iter().map(|round| round[i]).collect::<Vec<f64>>());
    let rate = median(rates.iter().copied());
    let (least, most) = rates
        .iter()
        .fold((f64::MAX, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    let (mean, variance) = mean_and_variance(runs[0].film());
    Ok(IntegratorRates {
        name: integrator.name,
        mpaths_per_s: rate / 1e6,
        vectorised_mpaths_per_s: median(vectorised) / 1e6,
        spread: (most - least) / rate,
        variance,
        mean,
        sample_s: f64::from(scene.resolution[0]) * f64::from(scene.resolution[1]) / rate,
    })
}

fn mean_and_variance(film: &Film) -> (f64, Option<f64>) {
    let total = |sums: &[[f64; 3]]| sums.iter().flatten().sum::<f64>();
    let (sum, squares) = (total(&film.sum), total(&film.sum2));
    let (n, values) = (film.samples as f64, 3.0 * film.sum.len() as f64);
    let contributions = if squares > 0.0 {
        sum * sum / squares
    } else {
        0.0
    };
    let squared_errors: f64 = film
        .variance_of_mean()
        .data
        .iter()
        .flatten()
        .map(|v| f64::from(*v))
        .sum();
    (
        sum / n / values,
        (contributions >= MIN_CONTRIBUTIONS).then_some(n * squared_errors / values),
    )
}

impl IntegratorRates {
    /// Inverse of the mean squared error after one second; `None` if the variance is unknown or
    /// zero.
    pub fn efficiency(&self) -> Option<f64> {
        self.variance
            .filter(|v| *v > 0.0)
            .map(|v| 1.0 / (v * self.sample_s))
    }

    /// Seconds until the relative RMSE is [`RELATIVE_RMSE`].
    pub fn time_to_rmse_s(&self) -> Option<f64> {
        let allowed = RELATIVE_RMSE * self.mean;
        self.variance
            .map(|v| self.sample_s * v / (allowed * allowed))
    }

    /// Returns the figures by name.
    pub fn to_json(&self) -> Json {
        json!({
            "mpaths_per_s": self.mpaths_per_s,
            "mpaths_per_s_in_lanes": self.vectorised_mpaths_per_s,
            "spread": self.spread,
            "sample_s": self.sample_s,
            "mean": self.mean,
            "variance": self.variance,
            "efficiency": self.efficiency(),
            "time_to_rmse_s": self.time_to_rmse_s(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_follow_from_variance_and_time() {
        let measured = IntegratorRates {
            name: "x",
            mpaths_per_s: 1.0,
            vectorised_mpaths_per_s: 2.0,
            spread: 0.0,
            variance: Some(4.0),
            mean: 2.0,
            sample_s: 0.1,
        };
        assert!((measured.efficiency().unwrap() - 2.5).abs() < 1e-12);
        // 4 / n = (0.05 * 2)^2 holds for n = 400 samples.
        assert!((measured.time_to_rmse_s().unwrap() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn variance_does_not_depend_on_the_sample_count_and_needs_enough_contributions() {
        let film = |samples: u64, lit: usize| {
            let mut film = Film::new(100, 100);
            film.samples = samples;
            // Half of the samples of the lit pixels contribute 2.
            let hits = samples as f64 / 2.0;
            film.sum[..lit].fill([2.0 * hits; 3]);
            film.sum2[..lit].fill([4.0 * hits; 3]);
            mean_and_variance(&film)
        };
        for samples in [100, 10_000] {
            let (mean, variance) = film(samples, 10_000);
            assert!((mean - 1.0).abs() < 1e-9);
            assert!((variance.unwrap() - 1.0).abs() < 0.02, "{variance:?}");
        }
        assert_eq!(film(4, 2).1, None);
    }
}
