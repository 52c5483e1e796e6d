//! Pictures by other programs: a scene is exported, an interpreter is started with a script of ours, and asked for as
//! many samples at a time as a night wants next.
//!
//! So a peer has curves, stop rules and tables like any technique. Its clock is what it says itself to have spent inside
//! its renderer; starting it, exporting, reading the scene and exchanging files are outside, as they are for ours. It is
//! asked with another seed for every wave, so a run cannot be repeated to the bit unless its waves end where they did, and
//! it cannot go on from a checkpoint: what is cut off starts again.

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use super::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::film::{Film, Image};
use crate::math::rng::pcg4d;
use crate::scene::load::openexr;
use crate::scene::{SceneDesc, export};
use crate::transport::camera::{FilterKind, FilterSpec};
use crate::transport::integrator::external::{METHOD, PYTHON, VARIANT};
use crate::value::Value;
use crate::value::schema::Field;

/// What stands for a backend in runs of other programs.
pub const BACKEND: &str = "external";

const SCRIPT: &str = include_str!("lumbre_mitsuba.py");
const SCRIPT_FILE: &str = "lumbre_mitsuba.py";
/// What the interpreter says when something is wrong.
const ERRORS: &str = "errors.txt";
/// Lines of that in a reason.
const LAST_LINES: usize = 3;

/// What an interpreter is asked to find out whether it has the package: the variant is its argument.
const PROBE: &str = "import sys, mitsuba\nmitsuba.set_variant(sys.argv[1])\nprint(mitsuba.__version__)";

/// The version of the program behind a technique, or why this machine does not have it, in words for people.
///
/// # Errors
/// No interpreter, no package, or no such variant.
pub fn probe(params: &BTreeMap<String, Value>) -> Result<String, String> {
    let python = text(params, PYTHON);
    let asked = Command::new(&python).args(["-c", PROBE, &text(params, VARIANT)]).stdin(Stdio::null()).output();
    let output = asked.map_err(|e| format!("the interpreter `{python}` cannot be started: {e}"))?;
    if !output.status.success() {
        let said = String::from_utf8_lossy(&output.stderr);
        return Err(format!("`{python}` cannot load Mitsuba 3: {}", last_lines(&said, 1)));
    }
    Ok(String::from_utf8_lossy(&output.stdout).trim().to_owned())
}

/// What of a job another program cannot be asked for, in words for people.
pub fn refusal(filter: FilterSpec, sampler: &str, films: bool, rr_start: Option<u32>) -> Option<&'static str> {
    if films {
        Some("another program keeps no films")
    } else if filter.kind != FilterKind::Box || filter.radius != 0.5 {
        Some("another program is asked with the pixel itself as its filter: leave `aa` out")
    } else if sampler != "independent" {
        Some("another program has its own independent sampler: leave `sampler` out")
    } else if rr_start.is_some() {
        Some("another program has its own roulette: leave `rr` out")
    } else {
        None
    }
}

/// Starts a run of another program.
///
/// # Errors
/// A scene that cannot be exported, or an interpreter that does not get as far as reading it.
pub fn open(scene: &SceneDesc, job: &Job) -> Result<Box<dyn Renderer>, RenderError> {
    Peer::start(scene, job).map(|peer| Box::new(peer) as Box<dyn Renderer>)
}

fn text(params: &BTreeMap<String, Value>, field: Field) -> String {
    params.get(field.key).and_then(Value::as_str).unwrap_or(field.default).to_owned()
}

fn failed(reason: impl std::fmt::Display) -> RenderError {
    RenderError::Failed { backend: BACKEND, reason: reason.to_string() }
}

/// The last lines of a text that say something.
fn last_lines(text: &str, count: usize) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    lines[lines.len().saturating_sub(count)..].join("; ")
}

/// Another program at work.
struct Peer {
    child: Child,
    questions: ChildStdin,
    answers: BufReader<ChildStdout>,
    /// The exported scene and what is exchanged; removed in the end.
    folder: tempfile::TempDir,
    seed: u64,
    /// Index of the first sample of the film.
    first_sample: u64,
    sums: Sums,
    open_stats: OpenStats,
}

impl Peer {
    fn start(scene: &SceneDesc, job: &Job) -> Result<Peer, RenderError> {
        let folder = tempfile::tempdir().map_err(failed)?;
        let exported = export::mitsuba(scene, folder.path()).map_err(failed)?;
        let script = folder.path().join(SCRIPT_FILE);
        fs::write(&script, SCRIPT).map_err(failed)?;
        let errors = File::create(folder.path().join(ERRORS)).map_err(failed)?;
        let (variant, method) = (text(&job.params, VARIANT), text(&job.params, METHOD));
        let [width, height] = job.resolution;
        // Roulette begins beyond the last edge, so it never does.
        let numbers = [width, height, job.max_depth, job.max_depth.saturating_add(1), job.threads as u32];
        let mut child = Command::new(text(&job.params, PYTHON))
            .arg(&script)
            .args([&variant, &method])
            .arg(&exported.scene)
            .args(numbers.map(|n| n.to_string()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(errors)
            .spawn()
            .map_err(|e| failed(format!("the interpreter `{}` cannot be started: {e}", text(&job.params, PYTHON))))?;
        let (Some(questions), Some(answers)) = (child.stdin.take(), child.stdout.take()) else {
            return Err(failed("the interpreter has no pipes"));
        };
        let mut peer = Peer {
            child,
            questions,
            answers: BufReader::new(answers),
            folder,
            seed: job.seed,
            first_sample: job.first_sample,
            sums: Sums::new(width, height),
            open_stats: OpenStats::default(),
        };
        let ready = peer.answer()?;
        let Some((version, threads)) = ready.strip_prefix("ready ").and_then(|rest| rest.split_once(' ')) else {
            return Err(failed(format!("expected it to be ready, but it says `{ready}`")));
        };
        // Variants of the processor render where ours do, and are told apart by what they are, not by where they run.
        let place = if variant.starts_with("cuda") { "cuda".to_owned() } else { format!("cpu, {threads} threads") };
        peer.open_stats.device = format!("{place}, Mitsuba {version} {variant} {method}");
        Ok(peer)
    }

    /// The next line that it says.
    fn answer(&mut self) -> Result<String, RenderError> {
        let mut line = String::new();
        let read = self.answers.read_line(&mut line).map_err(failed)?;
        if read > 0 {
            return Ok(line.trim_end().to_owned());
        }
        let said = fs::read_to_string(self.folder.path().join(ERRORS)).unwrap_or_default();
        let said = last_lines(&said, LAST_LINES);
        Err(failed(if said.is_empty() { "it ended without a word".to_owned() } else { format!("it ended: {said}") }))
    }

    /// The picture of so many samples, and the seconds that they took.
    fn ask(&mut self, samples: u64) -> Result<(Image, f64), RenderError> {
        let file = self.folder.path().join("wave.exr");
        let seed = wave_seed(self.seed, self.first_sample + self.sums.film.samples);
        let question = format!("{samples} {seed} {}\n", file.display());
        // If it has ended, its last words are in the answer.
        let _ = self.questions.write_all(question.as_bytes()).and_then(|()| self.questions.flush());
        let answer = self.answer()?;
        let seconds: f64 = answer.parse().map_err(|_| failed(format!("expected seconds, but it says `{answer}`")))?;
        let film = &self.sums.film;
        let bytes = fs::read(&file).map_err(failed)?;
        let (image, _) = openexr::decode(&bytes, film.sum.len()).map_err(failed)?;
        if [image.width, image.height] != [film.width, film.height] {
            return Err(failed(format!("it rendered {}x{} pixels", image.width, image.height)));
        }
        Ok((image, seconds))
    }
}

impl Renderer for Peer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        if samples == 0 {
            return Ok(WaveStats::default());
        }
        let (image, render_s) = self.ask(samples)?;
        let invalid = self.sums.add(&image, samples);
        let paths = samples * image.data.len() as u64;
        Ok(WaveStats { samples, render_s, paths, invalid, ..WaveStats::default() })
    }

    fn film(&self) -> &Film {
        &self.sums.film
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// The seed of a wave, in the 32 bits that Mitsuba takes.
fn wave_seed(seed: u64, samples: u64) -> u32 {
    let halves = |x: u64| [x as u32, (x >> 32) as u32];
    let ([a, b], [c, d]) = (halves(seed), halves(samples));
    pcg4d([a, b, c, d])[0]
}

/// A film made of pictures of several samples each. What samples varied by within a picture is not known, so that the
/// film's variance is estimated by what pictures differ by: with `n_k` samples in picture `m_k` and `K` of them, one
/// sample has the variance `(sum n_k m_k² - S² / N) / (K - 1)`, and none is known of a single picture.
struct Sums {
    film: Film,
    /// `sum n_k m_k²`.
    squares: Vec<[f64; 3]>,
    pictures: u64,
}

impl Sums {
    fn new(width: u32, height: u32) -> Sums {
        let film = Film::new(width, height);
        Sums { squares: vec![[0.0; 3]; film.sum.len()], film, pictures: 0 }
    }

    /// Adds a picture of so many samples; values that are not finite count as black, and how many there are is returned.
    fn add(&mut self, image: &Image, samples: u64) -> u64 {
        let mut invalid = 0;
        self.pictures += 1;
        self.film.samples += samples;
        let (own, n) = (samples as f64, self.film.samples as f64);
        let free = self.pictures.saturating_sub(1).max(1) as f64;
        let sums = self.film.sum.iter_mut().zip(&mut self.film.sum2).zip(&mut self.squares);
        for (((sum, sum2), squares), pixel) in sums.zip(&image.data) {
            for c in 0..3 {
                let mean = f64::from(pixel[c]);
                let mean = if mean.is_finite() { mean } else { 0.0 };
                invalid += u64::from(!pixel[c].is_finite());
                sum[c] += own * mean;
                squares[c] += own * mean * mean;
                let of_the_mean = sum[c] * sum[c] / n;
                let variance = if self.pictures < 2 { 0.0 } else { (squares[c] - of_the_mean).max(0.0) / free };
                sum2[c] = of_the_mean + variance * (n - 1.0);
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
        let mut sums = Sums::new(1, 1);
        let picture = |x: f32| Image::from_fn(1, 1, |_, _| [x, f32::NAN, 0.0]);
        assert_eq!(sums.add(&picture(2.0), 4), 1);
        assert_eq!(sums.film.variance_of_mean().at(0, 0), [0.0; 3], "one picture says nothing");
        sums.add(&picture(5.0), 8);
        assert_eq!((sums.film.samples, sums.film.mean().at(0, 0)[0]), (12, 4.0));
        // Means 2 and 5 of 4 and 8 samples: 4 (2 - 4)² + 8 (5 - 4)² = 24 is one sample's variance, over 12 samples 2.
        assert!((sums.film.variance_of_mean().at(0, 0)[0] - 2.0).abs() < 1e-6);
        assert_eq!(sums.film.mean().at(0, 0)[1], 0.0);
    }

    #[test]
    fn waves_have_seeds_of_their_own() {
        let seeds = BTreeSet::from([(1, 0), (1, 1), (1, 2), (2, 0), (1 << 40, 0)].map(|(a, b)| wave_seed(a, b)));
        assert_eq!(seeds.len(), 5);
    }

    #[test]
    fn a_missing_interpreter_is_a_reason() {
        let params = BTreeMap::from([("python".to_owned(), Value::from("/nowhere/python"))]);
        let reason = probe(&params).unwrap_err();
        assert!(reason.contains("the interpreter `/nowhere/python` cannot be started"), "{reason}");
        assert_eq!(last_lines("Traceback\n  x\n\nNo module named 'mitsuba'\n", 1), "No module named 'mitsuba'");
    }
}
