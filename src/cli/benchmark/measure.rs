//! The measurements of the suite.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

use super::result::{
    BenchmarkCell, BenchmarkReference, BenchmarkResult, ErrorAt, Fingerprint, SuiteSettings, TimeTo,
};
use super::suite::{RELATIVE_RMSE, SCENES, SuiteMetric, SuiteScene, TECHNIQUES, metrics};
use crate::cli::format::{duration, rounded};
use crate::cli::scene::builtin::BuiltIn;
use lumbre_light::film::Film;
use lumbre_light::math::stats::median;
use lumbre_light::scene::CompiledScene;
use lumbre_light::transport::integrator::{IntegratorRow, integrator};
use lumbre_metrics::MetricSpec;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_metrics::floor::Halves;
use lumbre_night::backends::{BACKENDS, backend};
use lumbre_render::cpu::kept_scenes::SceneKeeper;
use lumbre_render::reference_halves::ReferenceHalves;
use lumbre_render::shaders::Shaders;
use lumbre_render::{BackendRow, Job, RenderError, Renderer, WaveStats, mock};
use lumbre_report::metric_display::MetricDisplay;
use lumbre_report::quantity::time_to;
use lumbre_report::repeats::MetricCurve;

/// Seed of all runs, which are consecutive samples of one picture.
const SEED: u64 = 1;

/// Seeds of the two halves of a reference.
const REFERENCE_SEEDS: [u64; 2] = [1001, 1002];

/// Samples of the picture whose checksum is recorded. They come first, and also warm up.
const PICTURE_SAMPLES: u64 = 2;

/// One measurement to make.
type Task = (&'static BackendRow, &'static IntegratorRow);

/// Measures what is missing in a result. `save` receives the result after each measurement,
/// `progress` a line for each reference and measurement.
///
/// # Errors
/// Returns a message if a picture or `save` fails, or if a reference differs from that in the
/// result.
pub fn measure(
    result: &mut BenchmarkResult,
    backends: &[&'static BackendRow],
    threads: usize,
    save: &dyn Fn(&BenchmarkResult) -> Result<(), String>,
    progress: &mut dyn FnMut(&str),
) -> Result<(), String> {
    let start = Instant::now();
    let earlier_s = result.duration_s;
    let settings = result.settings.clone();
    let metrics = metrics()?;
    let specs: Vec<MetricSpec> = metrics.iter().map(|metric| metric.spec.clone()).collect();
    let built_in = BuiltIn::unpack()?;
    let all = tasks(backends)?;
    let missing = |scene: &'static SuiteScene| {
        let mut tasks = all.clone();
        tasks.retain(|(backend, technique)| {
            let measured = result.cell(backend.name, scene.name, technique.name);
            measured.is_none()
        });
        (scene, tasks)
    };
    let todo: Vec<(&SuiteScene, Vec<Task>)> = SCENES.iter().map(missing).collect();
    let count: usize = todo.iter().map(|(_, tasks)| tasks.len()).sum();
    let mut done = 0;
    for (scene, tasks) in todo.iter().filter(|(_, tasks)| !tasks.is_empty()) {
        progress(&format!(
            "reference of {}: {} samples by {}",
            scene.name,
            scene.reference_samples(&settings),
            scene.reference
        ));
        let studio = scene
            .load(&built_in)
            .and_then(|compiled| {
                Studio::open(scene, compiled, &settings, threads, (&metrics, &specs))
            })
            .map_err(|e| format!("{}: {e}", scene.name))?;
        let reference = &studio.reference;
        match result.reference(scene.name) {
            None => result.references.push(reference.clone()),
            Some(old) if old.picture == reference.picture => {}
            Some(_) => {
                return Err(format!(
                    "the reference of {} differs from that in the unfinished file, which another \
                     build of the program has begun: delete the file to measure again",
                    scene.name
                ));
            }
        }
        for task in tasks {
            let (backend, technique) = task;
            done += 1;
            let measured = studio.measure(task);
            let place = format!("{} {} {}", backend.name, scene.name, technique.name);
            let (cell, device) = match measured {
                Ok(measured) => measured,
                Err(reason @ RenderError::Unsupported { .. }) => {
                    progress(&format!("{place} is left out: {reason}"));
                    continue;
                }
                Err(e) => return Err(format!("{place}: {e}")),
            };
            let elapsed_s = start.elapsed().as_secs_f64();
            progress(&format!(
                "{done:>3} of {count}: {place}: {} frames/s, about {} left",
                rounded(median(cell.frames_per_s.iter().copied())),
                duration(elapsed_s / done as f64 * (count - done) as f64),
            ));
            result.backends.insert(cell.backend.clone(), device);
            result.cells.push(cell);
            result.duration_s = earlier_s + elapsed_s;
            save(result)?;
        }
    }
    result.finished = true;
    result.duration_s = earlier_s + start.elapsed().as_secs_f64();
    save(result)
}

/// Returns the backends to measure: those with these names, or all that this machine can use. The
/// mock backend renders nothing and is measured only if named.
///
/// # Errors
/// Returns a message if a backend that was asked for cannot be used.
pub fn usable_backends(
    names: &[String],
    progress: &mut dyn FnMut(&str),
) -> Result<Vec<&'static BackendRow>, String> {
    if let Some(name) = names
        .iter()
        .find(|name| !BACKENDS.iter().any(|row| row.name == **name))
    {
        return Err(format!(
            "there is no backend `{name}`; `lumbre doctor` lists them"
        ));
    }
    let mut usable = Vec::new();
    for row in BACKENDS {
        let is_named = names.iter().any(|name| name == row.name);
        if !is_named && (!names.is_empty() || row.name == mock::ROW.name) {
            continue;
        }
        match (row.probe)() {
            Ok(_) => usable.push(row),
            Err(reason) if is_named => return Err(format!("backend `{}`: {reason}", row.name)),
            Err(reason) => progress(&format!("backend {} is left out: {reason}", row.name)),
        }
    }
    Ok(usable)
}

/// Returns the measurements of one scene.
fn tasks(backends: &[&'static BackendRow]) -> Result<Vec<Task>, String> {
    let mut tasks = Vec::new();
    for name in TECHNIQUES {
        let technique = technique(name)?;
        let able = backends
            .iter()
            .filter(|row| (row.refuses)(technique, &Shaders::Unset).is_none());
        tasks.extend(able.map(|backend| (*backend, technique)));
    }
    Ok(tasks)
}

fn technique(name: &str) -> Result<&'static IntegratorRow, String> {
    integrator(name).ok_or_else(|| format!("there is no technique `{name}`"))
}

/// A scene with its reference.
struct Studio<'a> {
    settings: &'a SuiteSettings,
    metrics: &'a [SuiteMetric],
    threads: usize,
    scene: Arc<CompiledScene>,
    scene_name: &'static str,
    reference: BenchmarkReference,
    evaluator: Evaluator<'a>,
    /// Keeps the acceleration structures of the CPU for all runs.
    _keeper: SceneKeeper,
}

impl<'a> Studio<'a> {
    /// Renders the reference of a scene on the CPU.
    fn open(
        suite_scene: &SuiteScene,
        scene: Arc<CompiledScene>,
        settings: &'a SuiteSettings,
        threads: usize,
        (metrics, specs): (&'a [SuiteMetric], &'a [MetricSpec]),
    ) -> Result<Studio<'a>, String> {
        let cpu = backend("cpu").ok_or("no cpu backend")?;
        let technique = technique(suite_scene.reference)?;
        let keeper = SceneKeeper::new(Arc::clone(&scene));
        let open = |seed: u64| {
            let job = Job::plain(technique, settings.resolution, settings.max_depth, seed);
            (cpu.open)(Arc::clone(&scene), job.on_threads(threads)).map_err(|e| e.to_string())
        };
        let [first, second] = REFERENCE_SEEDS.map(open);
        let mut renderer = ReferenceHalves::new([first?, second?]);
        let samples = suite_scene.reference_samples(settings);
        let wave = renderer.advance(samples).map_err(|e| e.to_string())?;
        let picture = fingerprint(renderer.film());
        let image = Arc::new(renderer.film().mean());
        let mut floors = BTreeMap::new();
        if let Some([a, b]) = renderer.halves() {
            let means = [a.mean(), b.mean()];
            let halves = Halves {
                means: [&means[0], &means[1]],
                samples: [a.samples, b.samples],
            };
            for spec in specs {
                let floor = spec.floor(&image, halves).map_err(|e| e.to_string())?;
                let floor = floor.map(|floor| relative(spec, floor.value, &picture));
                floors.extend(
                    floor
                        .filter(|floor| floor.is_finite())
                        .map(|floor| (spec.column.clone(), floor)),
                );
            }
        }
        Ok(Studio {
            settings,
            metrics,
            threads,
            scene,
            scene_name: suite_scene.name,
            reference: BenchmarkReference {
                scene: suite_scene.name.to_owned(),
                technique: technique.name.to_owned(),
                render_s: wave.render_s,
                picture,
                floors,
            },
            evaluator: Evaluator::new(specs, image),
            _keeper: keeper,
        })
    }

    /// Renders a picture of few samples, and measures rate and errors of some runs. Also returns
    /// the device.
    fn measure(&self, (backend, technique): &Task) -> Result<(BenchmarkCell, String), RenderError> {
        let settings = self.settings;
        let job = Job::plain(technique, settings.resolution, settings.max_depth, SEED);
        let start = Instant::now();
        let mut renderer = (backend.open)(Arc::clone(&self.scene), job.on_threads(self.threads))?;
        let open_s = start.elapsed().as_secs_f64();
        renderer.advance(PICTURE_SAMPLES)?;
        let picture = fingerprint(renderer.film());
        let runs: Vec<Run> = (0..settings.repeats)
            .map(|_| self.run(backend, renderer.as_mut()))
            .collect::<Result<_, _>>()?;
        let opened = renderer.open_stats();
        let [width, height] = settings.resolution.map(f64::from);
        let rates = runs
            .iter()
            .map(|run| run.total.paths as f64 / run.total.render_s);
        let rays: u64 = runs.iter().map(|run| run.total.rays).sum();
        let seconds: f64 = runs.iter().map(|run| run.total.render_s).sum();
        let curves = |metric: usize| runs.iter().map(move |run| run.curves[metric].as_slice());
        let (mut errors, mut times) = (Vec::new(), Vec::new());
        for (i, metric) in self.metrics.iter().enumerate() {
            errors.extend(settings.equal_times_s.iter().map(|at_s| {
                ErrorAt {
                    metric: metric.spec.column.clone(),
                    at_s: *at_s,
                    values: curves(i)
                        .map(|curve| value_at(&metric.spec, curve, *at_s))
                        .collect(),
                }
            }));
            let floor = self.reference.floors.get(&metric.spec.column).copied();
            times.push(time_to_threshold(metric, curves(i), floor));
        }
        let cell = BenchmarkCell {
            backend: backend.name.to_owned(),
            scene: self.scene_name.to_owned(),
            technique: technique.name.to_owned(),
            frames_per_s: rates.clone().map(|rate| rate / (width * height)).collect(),
            mpaths_per_s: rates.map(|rate| rate / 1e6).collect(),
            mrays_per_s: rays as f64 / seconds / 1e6,
            errors,
            times,
            open_s,
            build_s: opened.accel_build_s,
            picture,
        };
        Ok((cell, opened.device_line()))
    }

    /// Renders for the time of a run, in waves that grow with the samples so far, and measures the
    /// errors of its own samples after each.
    fn run(&self, backend: &BackendRow, renderer: &mut dyn Renderer) -> Result<Run, RenderError> {
        let before = renderer.film().clone();
        let mut total = WaveStats::default();
        let mut curves = vec![Vec::new(); self.metrics.len()];
        while total.render_s < self.settings.run_s {
            let left = total.samples_in(self.settings.run_s - total.render_s);
            let growth = (total.samples / 2).max(1);
            total.add(&renderer.advance(growth.min(left + 1))?);
            let image = since(&before, renderer.film()).mean();
            let values = self.evaluator.eval(&image);
            let values = values.map_err(|e| RenderError::failed(backend.name, e))?;
            for ((curve, metric), value) in curves.iter_mut().zip(self.metrics).zip(values) {
                let value = relative(&metric.spec, value, &self.reference.picture);
                curve.push((total.render_s, value));
            }
        }
        Ok(Run { total, curves })
    }
}

/// A finished run.
struct Run {
    total: WaveStats,
    /// Curve of each metric: render times in seconds and values.
    curves: Vec<Vec<(f64, f64)>>,
}

/// Returns the samples that a film has received since it was copied.
fn since(before: &Film, now: &Film) -> Film {
    let mut own = now.clone();
    own.samples -= before.samples;
    for (own, before) in own.sum.iter_mut().zip(&before.sum) {
        for (own, before) in own.iter_mut().zip(before) {
            *own -= before;
        }
    }
    own
}

/// Divides a relative metric by the mean radiance of the reference.
fn relative(spec: &MetricSpec, value: f64, reference: &Fingerprint) -> f64 {
    if spec.column == RELATIVE_RMSE {
        value * 3.0 / reference.mean.iter().sum::<f64>()
    } else {
        value
    }
}

/// Returns the value of a curve at a render time, or `None` before its first picture.
fn value_at(spec: &MetricSpec, curve: &[(f64, f64)], at_s: f64) -> Option<f64> {
    let display = MetricDisplay::for_metric(spec);
    let drawn = MetricCurve::new(display, curve.iter().copied()).at(at_s)?;
    Some(display.metric_value(drawn))
}

/// Returns the times from which on runs stay at the threshold of a metric, after the noise of the
/// reference is subtracted where that is possible.
fn time_to_threshold<'c>(
    metric: &SuiteMetric,
    curves: impl Iterator<Item = &'c [(f64, f64)]>,
    floor: Option<f64>,
) -> TimeTo {
    let spec = &metric.spec;
    let times = curves.filter_map(|curve| {
        let curve: Vec<(f64, f64)> = curve
            .iter()
            .map(|(time, v)| (*time, metric.net(*v, floor)))
            .collect();
        let time = time_to(spec.row.better, &curve, metric.threshold)?;
        Some((time.number, time.bound.name().to_owned()))
    });
    let (seconds, bounds) = times.unzip();
    TimeTo {
        metric: spec.column.clone(),
        threshold: metric.threshold,
        seconds,
        bounds,
    }
}

/// Returns the identity of the picture in a film.
fn fingerprint(film: &Film) -> Fingerprint {
    let mut hasher = blake3::Hasher::new();
    let mut sum = [0.0; 3];
    for pixel in &film.sum {
        for (sum, value) in sum.iter_mut().zip(pixel) {
            hasher.update(&value.to_bits().to_le_bytes());
            *sum += value;
        }
    }
    let count = film.sum.len().max(1) as f64 * film.samples.max(1) as f64;
    Fingerprint {
        samples: film.samples,
        mean: sum.map(|sum| sum / count),
        checksum: hasher.finalize().to_hex().to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn curves_have_values_at_times_and_times_at_thresholds() {
        let metrics = metrics().unwrap();
        let rmse = &metrics[0];
        let curve = [(0.1, 1.2), (0.4, 0.6), (1.6, 0.3)];
        let at = |time| value_at(&rmse.spec, &curve, time);
        assert_eq!((at(0.05), at(0.1)), (None, Some(1.2)));
        assert!((at(0.8).unwrap() - 0.18f64.sqrt()).abs() < 1e-9);
        // Without the noise of the reference the last error is 0.2.
        let floor = (0.3f64.powi(2) - 0.2f64.powi(2)).sqrt();
        let times = |floor| time_to_threshold(rmse, [curve.as_slice()].into_iter(), floor);
        assert_eq!(times(None).bounds, ["lower"]);
        assert_eq!(times(None).seconds, [1.6]);
        assert_eq!(times(Some(floor)).bounds, [""]);
        assert!(times(Some(floor)).seconds[0] < 1.6);
        let lucky = [(0.1, 0.05), (0.4, 0.04)];
        let found = time_to_threshold(rmse, [lucky.as_slice()].into_iter(), None);
        assert_eq!(
            (found.seconds, found.bounds),
            (vec![0.1], vec!["upper".to_owned()])
        );
    }

    #[test]
    fn a_run_has_the_samples_since_its_start() {
        let mut film = Film::new(1, 1);
        film.samples = 2;
        film.sum[0] = [6.0; 3];
        let before = film.clone();
        film.samples = 6;
        film.sum[0] = [8.0; 3];
        let own = since(&before, &film);
        assert_eq!((own.samples, own.mean().at(0, 0)), (4, [0.5; 3]));
    }
}
