//! What an integrator does with its time on one scene.
//!
//! With `v` the variance of one sample of a pixel, mean over all pixels and channels, `t` the seconds for one sample of
//! every pixel, and `m` the mean of the picture over all pixels and channels:
//!
//! - efficiency `1 / (v t)`: the inverse of the mean squared error after one second [Veach 1997, 2.4.1];
//! - relative RMSE after `n` samples `sqrt(v / n) / m`, so that [`RELATIVE_RMSE`] takes `t v / (RELATIVE_RMSE m)^2` seconds.
//!
//! Both come from measured variance, not from a reference; for unbiased integrators that is the same in the mean. A
//! variance of which most comes from a few samples is not known: see [`Measured::variance`].

use std::sync::Arc;

use serde_json::{Value as Json, json};

use super::turns::in_turns;
use crate::film::Film;
use crate::math::stats::median;
use crate::render::hierarchy::{AccelSpec, InLanes};
use crate::render::{Job, WaveStats, backend};
use crate::scene::CompiledScene;
use crate::transport::integrator::IntegratorRow;

/// The relative error to which times are given.
pub const RELATIVE_RMSE: f64 = 0.05;

/// Samples per pixel of one repetition: as long as a wave of a night.
const SAMPLES: u64 = 4;

/// How many finds of light a variance needs to mean something.
const ENOUGH_FINDS: f64 = 1000.0;

/// The figures of one integrator.
pub struct Measured {
    /// Its name.
    pub name: &'static str,
    /// Median of camera paths per second, in millions, one path after the other.
    pub mpaths_per_s: f64,
    /// The same in the lanes of vectors, where the scene and the processor let it.
    pub in_lanes: f64,
    /// Difference of the greatest and the least of them, over the median.
    pub spread: f64,
    /// Variance of one sample, mean over pixels and channels; `None` where the picture was made by fewer than
    /// [`ENOUGH_FINDS`] finds of light, each weighted by what it brought: the next one could multiply it.
    pub variance: Option<f64>,
    /// Mean of the picture over pixels and channels.
    pub mean: f64,
    /// Median seconds for one sample of every pixel.
    pub sample_s: f64,
}

/// Renders `repeats` waves after one for warming up, alone and in lanes in turn.
///
/// # Errors
/// When the backend fails, with a message for people.
pub fn measure(
    scene: &Arc<CompiledScene>,
    integrator: &'static IntegratorRow,
    threads: usize,
    repeats: usize,
) -> Result<Measured, String> {
    let cpu = backend("cpu").ok_or("no cpu backend")?;
    let open = |lanes: InLanes| {
        let plain = Job::plain(integrator, scene.resolution, scene.max_depth, 1);
        let job = Job { threads, accel: AccelSpec { lanes, ..plain.accel }, ..plain };
        (cpu.open)(Arc::clone(scene), job).map_err(|e| e.to_string())
    };
    let mut both = [open(InLanes::Never)?, open(InLanes::Always)?];
    let rate = |wave: &WaveStats| wave.paths as f64 / wave.render_s;
    in_turns(&mut both, 1, 1, rate)?;
    let turns = in_turns(&mut both, repeats, SAMPLES, rate)?;
    let [rates, in_lanes] = [0, 1].map(|i| turns.iter().map(|turn| turn[i]).collect::<Vec<f64>>());
    let rate = median(rates.iter().copied());
    let (least, most) = rates.iter().fold((f64::MAX, 0.0f64), |(a, b), r| (a.min(*r), b.max(*r)));
    let (mean, variance) = mean_and_variance(both[0].film());
    Ok(Measured {
        name: integrator.name,
        mpaths_per_s: rate / 1e6,
        in_lanes: median(in_lanes) / 1e6,
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
    let finds = if squares > 0.0 { sum * sum / squares } else { 0.0 };
    let of_mean: f64 = film.variance_of_mean().data.iter().flatten().map(|v| f64::from(*v)).sum();
    (sum / n / values, (finds >= ENOUGH_FINDS).then_some(n * of_mean / values))
}

impl Measured {
    /// The inverse of the mean squared error after one second; `None` without a variance or without noise.
    pub fn efficiency(&self) -> Option<f64> {
        self.variance.filter(|v| *v > 0.0).map(|v| 1.0 / (v * self.sample_s))
    }

    /// Seconds to [`RELATIVE_RMSE`].
    pub fn time_to_rmse_s(&self) -> Option<f64> {
        let allowed = RELATIVE_RMSE * self.mean;
        self.variance.map(|v| self.sample_s * v / (allowed * allowed))
    }

    /// The figures by name.
    pub fn to_json(&self) -> Json {
        json!({
            "mpaths_per_s": self.mpaths_per_s,
            "mpaths_per_s_in_lanes": self.in_lanes,
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
        let measured = Measured {
            name: "x",
            mpaths_per_s: 1.0,
            in_lanes: 2.0,
            spread: 0.0,
            variance: Some(4.0),
            mean: 2.0,
            sample_s: 0.1,
        };
        assert!((measured.efficiency().unwrap() - 2.5).abs() < 1e-12);
        // 4 / n = (0.05 * 2)^2 after 400 samples.
        assert!((measured.time_to_rmse_s().unwrap() - 40.0).abs() < 1e-9);
    }

    #[test]
    fn variance_of_one_sample_is_independent_of_their_number_and_withheld_where_finds_are_few() {
        let film = |samples: u64, lit: usize| {
            let mut film = Film::new(100, 100);
            film.samples = samples;
            // Half of the samples of the lit pixels bring 2.
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
