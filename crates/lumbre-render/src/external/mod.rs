//! Techniques of external programs: exports a scene, starts a Python interpreter with the bundled
//! script, and requests as many samples at a time as the run loop needs next.
//!
//! An external technique thus has curves, stop rules and tables like any other. Its render time is
//! what it reports to have spent inside its renderer; starting it, exporting, loading the scene and
//! exchanging files are not included, as for built-in backends. Every wave uses another seed, so a
//! run is repeatable to the bit only if its waves end at the same samples, and it cannot resume
//! from a checkpoint: an interrupted run starts again.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use super::{Job, OpenStats, RenderError, Renderer, WaveStats};
use lumbre_light::film::{Film, Image};
use lumbre_light::math::rng::pcg4d;
use lumbre_light::scene::load::openexr;
use lumbre_light::scene::{SceneDesc, export};
use lumbre_light::transport::camera::{FilterKind, FilterSpec};
use lumbre_light::transport::integrator::external::{METHOD, PYTHON, VARIANT};
use lumbre_light::value::Value;
use lumbre_light::value::schema::Field;

/// Name used as backend in runs of external programs.
pub const BACKEND: &str = "external";

const SCRIPT: &str = include_str!("lumbre_mitsuba.py");
const SCRIPT_FILE: &str = "lumbre_mitsuba.py";
/// File that receives the interpreter's error output.
const ERRORS: &str = "errors.txt";
/// Number of its last lines that are quoted in errors.
const LAST_LINES: usize = 3;

/// Script that checks whether an interpreter has the package; the variant is its argument.
const PROBE: &str =
    "import sys, mitsuba\nmitsuba.set_variant(sys.argv[1])\nprint(mitsuba.__version__)";

/// Returns the version of the program behind a technique.
///
/// # Errors
/// Returns a message if the interpreter, the package or the variant is missing on this machine.
pub fn probe(params: &BTreeMap<String, Value>) -> Result<String, String> {
    let python = text_param(params, PYTHON);
    let output = Command::new(&python)
        .args(["-c", PROBE, &text_param(params, VARIANT)])
        .stdin(Stdio::null())
        .output();
    let output =
        output.map_err(|e| format!("the interpreter `{python}` cannot be started: {e}"))?;
    if !output.status.success() {
        let errors = String::from_utf8_lossy(&output.stderr);
        return Err(format!(
            "`{python}` cannot load Mitsuba 3: {}",
            last_lines(&errors, 1)
        ));
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// Returns which setting of a job external programs do not support, as a message.
pub fn refusal(
    filter: FilterSpec,
    sampler: &str,
    films: bool,
    rr_start: Option<u32>,
) -> Option<&'static str> {
    if films {
        Some("external programs do not support `films`: leave `films` out")
    } else if filter.kind != FilterKind::Box || filter.radius != 0.5 {
        Some("external programs always use a box filter of one pixel: leave `aa` out")
    } else if sampler != "independent" {
        Some("external programs use their own independent sampler: leave `sampler` out")
    } else if rr_start.is_some() {
        Some("external programs do not support Russian roulette settings: leave `rr` out")
    } else {
        None
    }
}

/// Starts a run of an external program.
///
/// # Errors
/// Returns an error if the scene cannot be exported, or the interpreter fails before it has read
/// it.
pub fn open(scene: &SceneDesc, job: &Job) -> Result<Box<dyn Renderer>, RenderError> {
    ExternalRenderer::start(scene, job).map(|renderer| Box::new(renderer) as Box<dyn Renderer>)
}

fn text_param(params: &BTreeMap<String, Value>, field: Field) -> String {
    params
        .get(field.key)
        .and_then(Value::as_str)
        .unwrap_or(field.default)
        .to_owned()
}

fn failed(reason: impl std::fmt::Display) -> RenderError {
    RenderError::Failed {
        backend: BACKEND,
        reason: reason.to_string(),
    }
}

/// Returns the last non-empty lines of a text, joined by `; `.
fn last_lines(text: &str, count: usize) -> String {
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    lines[lines.len().saturating_sub(count)..].join("; ")
}

/// Run of an external program.
struct ExternalRenderer {
    child: Child,
    requests: ChildStdin,
    replies: BufReader<ChildStdout>,
    /// Folder of the exported scene and of exchanged files; removed in the end.
    folder: tempfile::TempDir,
    seed: u64,
    /// Index of the first sample of the film.
    first_sample: u64,
    batches: BatchFilm,
    open_stats: OpenStats,
}

impl ExternalRenderer {
    fn start(scene: &SceneDesc, job: &Job) -> Result<ExternalRenderer, RenderError> {
        let folder = tempfile::tempdir().map_err(failed)?;
        let exported = export::mitsuba(scene, folder.path()).map_err(failed)?;
        let script = folder.path().join(SCRIPT_FILE);
        fs::write(&script, SCRIPT).map_err(failed)?;
        let errors = File::create(folder.path().join(ERRORS)).map_err(failed)?;
        let (variant, method) = (
            text_param(&job.params, VARIANT),
            text_param(&job.params, METHOD),
        );
        let [width, height] = job.resolution;
        let mut child = spawn_interpreter(job, &script, &exported.scene, errors)?;
        let (Some(requests), Some(replies)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(failed("cannot open pipes to the interpreter"));
        };
        let mut renderer = ExternalRenderer {
            child,
            requests,
            replies: BufReader::new(replies),
            folder,
            seed: job.seed,
            first_sample: job.first_sample,
            batches: BatchFilm::new(width, height),
            open_stats: OpenStats::default(),
        };
        let ready = renderer.read_reply()?;
        let Some((version, threads)) = ready
            .strip_prefix("ready ")
            .and_then(|rest| rest.split_once(' '))
        else {
            return Err(failed(format!(
                "protocol error: the interpreter replied `{ready}` instead of `ready`"
            )));
        };
        // CPU variants run on the same hardware as the `cpu` backend, so the line reports threads;
        // the name of the program distinguishes them.
        let hardware = if variant.starts_with("cuda") {
            "cuda".to_owned()
        } else {
            format!("cpu, {threads} threads")
        };
        renderer.open_stats.device = format!("{hardware}, Mitsuba {version} {variant} {method}");
        Ok(renderer)
    }

    /// Reads the next line of its replies.
    fn read_reply(&mut self) -> Result<String, RenderError> {
        let mut line = String::new();
        let read = self.replies.read_line(&mut line).map_err(failed)?;
        if read > 0 {
            return Ok(line.trim_end().to_owned());
        }
        let errors = fs::read_to_string(self.folder.path().join(ERRORS)).unwrap_or_default();
        let errors = last_lines(&errors, LAST_LINES);
        Err(failed(if errors.is_empty() {
            "the interpreter exited without an error message".to_owned()
        } else {
            format!("the interpreter exited: {errors}")
        }))
    }

    /// Renders a picture of `samples` samples. Returns it and the render time in seconds.
    fn render(&mut self, samples: u64) -> Result<(Image, f64), RenderError> {
        let file = self.folder.path().join("wave.exr");
        let seed = wave_seed(self.seed, self.first_sample + self.batches.film.samples);
        let request = format!("{samples} {seed} {}\n", file.display());
        // If the interpreter has exited, reading the reply reports its last error output.
        let _ = self
            .requests
            .write_all(request.as_bytes())
            .and_then(|()| self.requests.flush());
        let reply = self.read_reply()?;
        let seconds: f64 = reply.parse().map_err(|_| {
            failed(format!(
                "protocol error: expected the render time in seconds, got `{reply}`"
            ))
        })?;
        let film = &self.batches.film;
        let bytes = fs::read(&file).map_err(failed)?;
        let (image, _) = openexr::decode(&bytes, film.sum.len()).map_err(failed)?;
        if [image.width, image.height] != [film.width, film.height] {
            return Err(failed(format!(
                "protocol error: the picture has {}x{} pixels instead of {}x{}",
                image.width, image.height, film.width, film.height
            )));
        }
        Ok((image, seconds))
    }
}

impl Renderer for ExternalRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        if samples == 0 {
            return Ok(WaveStats::default());
        }
        let (image, render_s) = self.render(samples)?;
        let invalid = self.batches.add(&image, samples);
        let paths = samples * image.data.len() as u64;
        Ok(WaveStats {
            samples,
            render_s,
            paths,
            invalid,
            ..WaveStats::default()
        })
    }

    fn film(&self) -> &Film {
        &self.batches.film
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

impl Drop for ExternalRenderer {
    fn drop(&mut self) {
        // It may have exited already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts the interpreter with the bundled script on an exported scene.
fn spawn_interpreter(
    job: &Job,
    script: &Path,
    scene: &Path,
    errors: File,
) -> Result<Child, RenderError> {
    let [width, height] = job.resolution;
    // Roulette starts beyond the last edge, so it has no effect.
    let numbers = [
        width,
        height,
        job.max_depth,
        job.max_depth.saturating_add(1),
        job.threads as u32,
    ];
    Command::new(text_param(&job.params, PYTHON))
        .arg(script)
        .args([VARIANT, METHOD].map(|field| text_param(&job.params, field)))
        .arg(scene)
        .args(numbers.map(|n| n.to_string()))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(errors)
        .spawn()
        .map_err(|e| {
            failed(format!(
                "the interpreter `{}` cannot be started: {e}",
                text_param(&job.params, PYTHON)
            ))
        })
}

/// Returns the seed of a wave, in the 32 bits that Mitsuba uses.
fn wave_seed(seed: u64, samples: u64) -> u32 {
    let halves = |x: u64| [x as u32, (x >> 32) as u32];
    let ([a, b], [c, d]) = (halves(seed), halves(samples));
    pcg4d([a, b, c, d])[0]
}

/// Film made of pictures of several samples each. The variance of the samples within a picture is
/// unknown, so the film's variance is estimated from the differences of pictures: with `n_k`
/// samples in picture `m_k` and `K` pictures, one sample has the variance `(sum n_k m_k² - S² / N)
/// / (K - 1)`. The variance of a single picture is unknown.
struct BatchFilm {
    film: Film,
    /// Weighted sum of squares of the pictures, `sum n_k m_k²`.
    squares: Vec<[f64; 3]>,
    pictures: u64,
}

impl BatchFilm {
    fn new(width: u32, height: u32) -> BatchFilm {
        let film = Film::new(width, height);
        BatchFilm {
            squares: vec![[0.0; 3]; film.sum.len()],
            film,
            pictures: 0,
        }
    }

    /// Adds a picture of `samples` samples. Values that are not finite count as black; returns
    /// their number.
    fn add(&mut self, image: &Image, samples: u64) -> u64 {
        let mut invalid = 0;
        self.pictures += 1;
        self.film.samples += samples;
        let (own, n) = (samples as f64, self.film.samples as f64);
        let degrees_of_freedom = self.pictures.saturating_sub(1).max(1) as f64;
        let batches = self
            .film
            .sum
            .iter_mut()
            .zip(&mut self.film.sum2)
            .zip(&mut self.squares);
        for (((sum, sum2), squares), pixel) in batches.zip(&image.data) {
            for c in 0..3 {
                let mean = f64::from(pixel[c]);
                let mean = if mean.is_finite() { mean } else { 0.0 };
                invalid += u64::from(!pixel[c].is_finite());
                sum[c] += own * mean;
                squares[c] += own * mean * mean;
                let mean_part = sum[c] * sum[c] / n;
                let variance = if self.pictures < 2 {
                    0.0
                } else {
                    (squares[c] - mean_part).max(0.0) / degrees_of_freedom
                };
                sum2[c] = mean_part + variance * (n - 1.0);
            }
        }
        invalid
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn pictures_are_weighted_by_their_samples_and_vary_as_their_means_do() {
        let mut batches = BatchFilm::new(1, 1);
        let picture = |x: f32| Image::from_fn(1, 1, |_, _| [x, f32::NAN, 0.0]);
        assert_eq!(batches.add(&picture(2.0), 4), 1);
        assert_eq!(
            batches.film.variance_of_mean().at(0, 0),
            [0.0; 3],
            "the variance of one picture is unknown"
        );
        batches.add(&picture(5.0), 8);
        assert_eq!(
            (batches.film.samples, batches.film.mean().at(0, 0)[0]),
            (12, 4.0)
        );
        // Means 2 and 5 of 4 and 8 samples: one sample's variance is 4 (2 - 4)² + 8 (5 - 4)² = 24,
        // over 12 samples that is 2.
        assert!((batches.film.variance_of_mean().at(0, 0)[0] - 2.0).abs() < 1e-6);
        assert_eq!(batches.film.mean().at(0, 0)[1], 0.0);
    }

    #[test]
    fn every_wave_has_its_own_seed() {
        let seeds = BTreeSet::from(
            [(1, 0), (1, 1), (1, 2), (2, 0), (1 << 40, 0)].map(|(a, b)| wave_seed(a, b)),
        );
        assert_eq!(seeds.len(), 5);
    }

    #[test]
    fn a_missing_interpreter_is_reported() {
        let params = BTreeMap::from([("python".to_owned(), Value::from("/nowhere/python"))]);
        let reason = probe(&params).unwrap_err();
        assert!(
            reason.contains("the interpreter `/nowhere/python` cannot be started"),
            "{reason}"
        );
        assert_eq!(
            last_lines("Traceback\n  x\n\nNo module named 'mitsuba'\n", 1),
            "No module named 'mitsuba'"
        );
    }
}
