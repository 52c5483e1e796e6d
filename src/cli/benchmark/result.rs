//! The file of a benchmark: machine, settings, references, rates, errors and checksums of pictures.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Version of the suite. Scenes, techniques, sizes or seeds of another version may differ, so files
/// of different versions are not compared.
pub const SUITE_VERSION: u32 = 2;

/// Result of the suite on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkResult {
    /// Version of the suite: [`SUITE_VERSION`].
    pub benchmark: u32,
    /// Name and version of the program.
    pub program: String,
    /// Name of the machine in tables.
    pub name: String,
    /// Facts about the machine.
    pub machine: Machine,
    /// Sizes and durations.
    pub settings: SuiteSettings,
    /// Date and time of the start in UTC, as ISO 8601.
    pub date: String,
    /// Duration of the benchmark in seconds, without interruptions.
    pub duration_s: f64,
    /// Whether all measurements are in the file. If not, the suite resumes with the others.
    pub finished: bool,
    /// Device and driver of each backend that was measured, by its name.
    pub backends: BTreeMap<String, String>,
    /// References of the scenes.
    pub references: Vec<BenchmarkReference>,
    /// Measurements, by scene, technique and backend.
    pub cells: Vec<BenchmarkCell>,
}

/// Facts about a machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Machine {
    /// Operating system and architecture.
    pub os: String,
    /// Model of the processor.
    pub cpu: String,
    /// Number of cores that the program may use.
    pub cores: usize,
    /// Number of threads that the backend `cpu` used.
    pub threads: usize,
    /// Instruction sets of the processor that are relevant to ray tracing.
    pub features: Vec<String>,
}

/// Sizes and durations of the suite. Only results with equal settings are compared.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SuiteSettings {
    /// Width and height of the pictures in pixels.
    pub resolution: [u32; 2],
    /// Greatest number of path edges.
    pub max_depth: u32,
    /// Number of runs of each measurement.
    pub repeats: u32,
    /// Render time of each run in seconds.
    pub run_s: f64,
    /// Render times in seconds at which errors are compared.
    pub equal_times_s: Vec<f64>,
    /// Share of the suite's render times and of the samples of its references.
    pub reference_share: f64,
}

/// Identity of a picture of a fixed number of samples.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Fingerprint {
    /// Samples per pixel.
    pub samples: u64,
    /// Mean radiance by channel.
    pub mean: [f64; 3],
    /// BLAKE3 hash of the sums of the film, 64 hex digits: equal for equal bits.
    pub checksum: String,
}

/// Reference of a scene, rendered by the backend `cpu`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkReference {
    /// Name of the scene.
    pub scene: String,
    /// Name of the technique.
    pub technique: String,
    /// Render time in seconds.
    pub render_s: f64,
    /// Identity of the picture.
    pub picture: Fingerprint,
    /// Value that the true image would have against this reference, by metric.
    pub floors: BTreeMap<String, f64>,
}

/// Measurement of one technique on one scene and backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkCell {
    /// Name of the backend.
    pub backend: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the technique.
    pub technique: String,
    /// Samples of every pixel per second of each run: frames per second.
    pub frames_per_s: Vec<f64>,
    /// Camera paths per second of each run, in millions.
    pub mpaths_per_s: Vec<f64>,
    /// Rays per second, in millions, over all runs.
    pub mrays_per_s: f64,
    /// Errors at equal time, by metric and time.
    pub errors: Vec<ErrorAt>,
    /// Times to an error, by metric.
    pub times: Vec<TimeTo>,
    /// Seconds from the job to the first sample: uploads, acceleration structures, shaders.
    pub open_s: f64,
    /// Seconds for building acceleration structures, once for each scene on the backend `cpu`.
    pub build_s: f64,
    /// Identity of a picture of few samples.
    pub picture: Fingerprint,
}

/// Values of a metric at the same render time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ErrorAt {
    /// Name of the metric.
    pub metric: String,
    /// Render time in seconds.
    pub at_s: f64,
    /// Value of each run against the reference, whose noise is not subtracted; `null` if a run had
    /// no picture yet.
    pub values: Vec<Option<f64>>,
}

/// Render times until a metric stays at a threshold or better.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TimeTo {
    /// Name of the metric.
    pub metric: String,
    /// Value to reach, after the noise of the reference is subtracted where that is possible.
    pub threshold: f64,
    /// Render time in seconds of each run.
    pub seconds: Vec<f64>,
    /// Relation of each time to the true one: empty, `lower` if the run ended before it reached the
    /// threshold, `upper` if its first picture had reached it.
    pub bounds: Vec<String>,
}

/// The version of a file, whatever else is in it.
#[derive(Deserialize)]
struct VersionOnly {
    benchmark: u32,
}

impl BenchmarkResult {
    /// Returns the text of the file.
    pub fn to_text(&self) -> String {
        // Numbers and texts always have a JSON form.
        let text = serde_json::to_string_pretty(self).unwrap_or_default();
        format!("{text}\n")
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Returns a message if the file cannot be read, is no result, or has another version.
    pub fn read(file: &Path) -> Result<BenchmarkResult, String> {
        let fail = |problem: String| format!("{}: {problem}", file.display());
        let text = std::fs::read_to_string(file).map_err(|e| fail(e.to_string()))?;
        let head: VersionOnly = serde_json::from_str(&text).map_err(|e| {
            fail(format!(
                "this is not a result of `lumbre bench --suite`: {e}"
            ))
        })?;
        if head.benchmark != SUITE_VERSION {
            return Err(fail(format!(
                "the suite has version {}, but this program has version {SUITE_VERSION} and other \
                 scenes; measure the machine again into another file",
                head.benchmark
            )));
        }
        serde_json::from_str(&text).map_err(|e| fail(e.to_string()))
    }

    /// Returns this result with the measurements in an unfinished file, or as it is if there is no
    /// such file.
    ///
    /// # Errors
    /// Returns a message if the file is no unfinished result with the same settings.
    pub fn resumed(self, file: &Path) -> Result<BenchmarkResult, String> {
        if !file.exists() {
            return Ok(self);
        }
        let old = BenchmarkResult::read(file)?;
        let help = "name another file with `--to`, or delete this one to measure again";
        if old.finished {
            return Err(format!("{} is finished: {help}", file.display()));
        }
        let begun = BenchmarkResult {
            date: old.date.clone(),
            duration_s: old.duration_s,
            backends: old.backends.clone(),
            references: old.references.clone(),
            cells: old.cells.clone(),
            ..self
        };
        if begun != old {
            return Err(format!(
                "{} was begun with another program, machine, name or settings: {help}",
                file.display()
            ));
        }
        Ok(old)
    }

    /// Returns the reference of a scene.
    pub fn reference(&self, scene: &str) -> Option<&BenchmarkReference> {
        self.references.iter().find(|r| r.scene == scene)
    }

    /// Returns a measurement, if it is in the file.
    pub fn cell(&self, backend: &str, scene: &str, technique: &str) -> Option<&BenchmarkCell> {
        self.cells.iter().find(|cell| {
            (cell.backend.as_str(), cell.scene.as_str()) == (backend, scene)
                && cell.technique == technique
        })
    }
}
