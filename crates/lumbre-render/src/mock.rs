//! The mock backend: analytic convergence on a fake clock.
//!
//! After `n` samples a pixel holds `truth + sigma * z / sqrt(n)`, where `truth` is a smooth
//! function of the position, `sigma` is proportional to it, and `z` is a standard normal number
//! that is fixed for each seed, pixel and channel. Four times the samples therefore halve every
//! root mean square error exactly, so run loops, stop rules and convergence curves can be tested
//! without rendering. A run that begins at a later sample holds only what the samples from there on
//! add. The clock advances by [`SECONDS_PER_PATH`] for every camera path; the backend never sleeps.

use std::f64::consts::TAU;
use std::io::{self, Write};
use std::sync::Arc;

use super::shaders::Shaders;
use super::{Advance, BackendRow, Device, Job, OpenStats, RenderError, Renderer, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::state::StateReader;
use lumbre_light::scene::CompiledScene;
use lumbre_light::scene::desc::Model;

/// Simulated render time of one camera path, in seconds.
pub const SECONDS_PER_PATH: f64 = 1e-7;

/// Standard deviation of one sample as a fraction of the pixel's truth. Small enough that no
/// picture is ever negative: the normal numbers stay below 9.
pub const RELATIVE_SIGMA: f64 = 0.1;

/// Table row of this backend.
pub const ROW: BackendRow = BackendRow {
    name: "mock",
    doc: "Analytic convergence on a fake clock, for testing experiments without rendering.",
    probe: || Ok("a fake clock of 10 million paths per second".into()),
    // It simulates neither paths nor surfaces.
    layers: &[],
    times: false,
    blends: true,
    light_trees: true,
    uniform_directions: true,
    models: &Model::ALL,
    refuses: |_, _| None,
    shaders: Shaders::without_device,
    accel: true,
    open: |scene, job| {
        if job.settings.timing.is_some() {
            return Err(RenderError::unsupported(
                "mock",
                "films with a time axis are not supported",
            ));
        }
        if !job.settings.films.is_empty() {
            return Err(RenderError::unsupported("mock", "layers are not supported"));
        }
        Ok(Box::new(MockRenderer::new(scene, job)))
    },
    paths: |_, _, _| Err(RenderError::unsupported("mock", "it traces no paths")),
};

/// Run of the mock backend.
#[derive(Debug)]
pub struct MockRenderer {
    film: Film,
    truth: Vec<[f64; 3]>,
    normal: Vec<[f64; 3]>,
    max_depth: u32,
    first_sample: u64,
    fail_after: Option<u64>,
    open_stats: OpenStats,
}

impl MockRenderer {
    /// Starts a run of `job`. Only the content hash of the scene with the job's camera is used: it
    /// shifts the pattern, so that different scenes give different pictures.
    pub fn new(scene: Arc<CompiledScene>, job: Job) -> MockRenderer {
        let [width, height] = job.resolution;
        let view = job.view.as_ref();
        let content_hash = view.map_or(scene.content_hash, |view| view.content_hash);
        let phase = f64::from(content_hash[0]) / 256.0;
        let light = 1.0 - 0.5f64.powi(job.max_depth.min(64) as i32);
        let pixels = || (0..height).flat_map(move |y| (0..width).map(move |x| (x, y)));
        let truth = |(x, y): (u32, u32)| {
            let u = (f64::from(x) + 0.5) / f64::from(width);
            let v = (f64::from(y) + 0.5) / f64::from(height);
            [0.0, 1.0, 2.0].map(|channel| {
                let wave = (TAU * (u + phase)).sin() * (TAU * v / 2.0 + channel).cos();
                light * (0.5 + 0.3 * wave)
            })
        };
        let normal = |(i, _): (usize, (u32, u32))| {
            [0, 1, 2].map(|c| standard_normal(job.seed, 3 * i as u64 + c))
        };
        MockRenderer {
            film: Film::new(width, height),
            truth: pixels().map(truth).collect(),
            normal: pixels().enumerate().map(normal).collect(),
            max_depth: job.max_depth,
            first_sample: job.first_sample,
            fail_after: None,
            open_stats: OpenStats {
                devices: vec![Device::mock()],
                ..OpenStats::default()
            },
        }
    }

    /// Makes the wave fail that would exceed `samples` samples.
    pub fn failing_after(mut self, samples: u64) -> MockRenderer {
        self.fail_after = Some(samples);
        self
    }
}

impl Renderer for MockRenderer {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let samples = request.samples;
        if samples == 0 {
            return Ok(WaveStats::default());
        }
        let total = self.film.samples + samples;
        if let Some(limit) = self.fail_after.filter(|limit| total > *limit) {
            let reason = format!("asked to fail after {limit} samples");
            return Err(RenderError::failed("mock", reason));
        }
        let n = total as f64;
        let [before, after] =
            [self.first_sample, self.first_sample + total].map(|n| (n as f64).sqrt());
        for (i, (truth, z)) in self.truth.iter().zip(&self.normal).enumerate() {
            for c in 0..3 {
                let sigma = RELATIVE_SIGMA * truth[c];
                let sum = n * truth[c] + sigma * z[c] * (after - before);
                self.film.sum[i][c] = sum;
                // Chosen so that the sample variance, (sum2 - sum^2 / n) / (n - 1), is sigma
                // squared.
                self.film.sum2[i][c] = sum * sum / n + sigma * sigma * (n - 1.0);
            }
        }
        self.film.samples = total;
        let paths = samples * self.truth.len() as u64;
        Ok(WaveStats {
            samples,
            render_s: paths as f64 * SECONDS_PER_PATH,
            paths,
            rays: paths * u64::from(self.max_depth),
            ..WaveStats::default()
        })
    }

    fn film(&self) -> &Film {
        &self.film
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        self.film.save(to)?;
        Ok(true)
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        let mut from = StateReader::new(state);
        let restored = self.film.restore(&mut from).and_then(|()| from.finish());
        restored.map_err(|e| RenderError::failed("mock", e))
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

/// Returns a standard normal number for a seed and an index, by the polar form of two hashed
/// uniforms [Box and Muller 1958].
fn standard_normal(seed: u64, index: u64) -> f64 {
    let a = mix(seed ^ mix(index));
    let b = mix(a ^ 0x6a09_e667_f3bc_c908);
    let scale = 1.0 / (1u64 << 53) as f64;
    // In (0, 1], so that the logarithm is finite.
    let radius_uniform = ((a >> 11) + 1) as f64 * scale;
    let angle_uniform = (b >> 11) as f64 * scale;
    (-2.0 * radius_uniform.ln()).sqrt() * (TAU * angle_uniform).cos()
}

/// Returns the output of SplitMix64 after one step of its counter [Steele 2014].
fn mix(x: u64) -> u64 {
    let x = x.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let x = (x ^ (x >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let x = (x ^ (x >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    x ^ (x >> 31)
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::*;
    use lumbre_light::scene::desc::CameraDesc;
    use lumbre_light::transport::integrator::INTEGRATORS;

    fn scene() -> Arc<CompiledScene> {
        Arc::new(CompiledScene {
            content_hash: [7; 32],
            camera: CameraDesc::pinhole(Vec3::Z, Vec3::ZERO, 40.0),
            resolution: [24, 16],
            max_depth: 5,
            ..CompiledScene::default()
        })
    }

    fn job(seed: u64) -> Job {
        Job::plain(&INTEGRATORS[0], [24, 16], 5, seed).on_threads(1)
    }

    fn film_of(seed: u64, waves: &[u64]) -> Film {
        let mut renderer = MockRenderer::new(scene(), job(seed));
        for wave in waves {
            renderer.advance(*wave).unwrap();
        }
        renderer.film().clone()
    }

    #[test]
    fn parts_of_a_run_add_up_to_the_whole() {
        let part = |first_sample: u64, samples: u64| {
            let mut renderer = MockRenderer::new(
                scene(),
                Job {
                    first_sample,
                    ..job(3)
                },
            );
            renderer.advance(samples).unwrap();
            renderer.film().sum.clone()
        };
        let (whole, first, second) = (part(0, 8), part(0, 3), part(3, 5));
        for ((whole, a), b) in whole.iter().zip(&first).zip(&second) {
            for c in 0..3 {
                assert!((whole[c] - a[c] - b[c]).abs() < 1e-12);
            }
        }
    }

    fn rmse_to_truth(samples: u64) -> f64 {
        let mut renderer = MockRenderer::new(scene(), job(1));
        renderer.advance(samples).unwrap();
        let n = samples as f64;
        let squares: f64 = renderer
            .film
            .sum
            .iter()
            .zip(&renderer.truth)
            .map(|(s, t)| (0..3).map(|c| (s[c] / n - t[c]).powi(2)).sum::<f64>())
            .sum();
        (squares / renderer.truth.len() as f64 / 3.0).sqrt()
    }

    #[test]
    fn waves_may_be_cut_anywhere() {
        assert_eq!(film_of(3, &[1, 3]), film_of(3, &[4]));
        assert_eq!(film_of(3, &[1, 1, 1, 1]), film_of(3, &[2, 2]));
    }

    #[test]
    fn a_seed_decides_the_picture() {
        assert_eq!(film_of(3, &[8]), film_of(3, &[8]));
        assert_ne!(film_of(3, &[8]), film_of(4, &[8]));
    }

    #[test]
    fn four_times_the_samples_halve_the_error() {
        let ratio = rmse_to_truth(16) / rmse_to_truth(64);
        assert!((ratio - 2.0).abs() < 1e-9, "{ratio}");
    }

    #[test]
    fn the_variance_of_the_mean_is_sigma_squared_over_n_and_the_errors_follow_it() {
        let mut renderer = MockRenderer::new(scene(), job(9));
        renderer.advance(100).unwrap();
        let variance = renderer.film().variance_of_mean();
        let expected = (RELATIVE_SIGMA * renderer.truth[5][1]).powi(2) / 100.0;
        assert!((f64::from(variance.data[5][1]) / expected - 1.0).abs() < 1e-4);
        let z: Vec<f64> = renderer.normal.iter().flatten().copied().collect();
        let mean = z.iter().sum::<f64>() / z.len() as f64;
        let square = z.iter().map(|z| z * z).sum::<f64>() / z.len() as f64;
        // 1152 normals: three standard errors of their mean and of their second moment.
        assert!(mean.abs() < 3.0 / (z.len() as f64).sqrt(), "{mean}");
        assert!(
            (square - 1.0).abs() < 3.0 * (2.0 / z.len() as f64).sqrt(),
            "{square}"
        );
    }

    #[test]
    fn the_clock_counts_paths_and_a_failure_leaves_the_film_alone() {
        let mut renderer = MockRenderer::new(scene(), job(1)).failing_after(4);
        let stats = renderer.advance(4).unwrap();
        assert_eq!(
            (stats.samples, stats.paths, stats.rays),
            (4, 4 * 384, 4 * 384 * 5)
        );
        assert!((stats.render_s - 4.0 * 384.0 * SECONDS_PER_PATH).abs() < 1e-15);
        let before = renderer.film().clone();
        let error = renderer.advance(1).unwrap_err();
        assert_eq!(
            error.to_string(),
            "backend `mock` failed: asked to fail after 4 samples"
        );
        assert_eq!(renderer.film(), &before);
    }

    #[test]
    fn no_picture_is_negative() {
        assert!(film_of(11, &[1]).sum.iter().flatten().all(|x| *x > 0.0));
    }
}
