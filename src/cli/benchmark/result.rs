//! The file of a benchmark: machine, settings, rates and checksums of pictures.

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Version of the suite. Scenes, techniques, sizes or seeds of another version may differ, so files of
/// different versions are not compared.
pub const SUITE_VERSION: u32 = 1;

/// Result of the suite on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkResult {
    /// Version of the suite: [`SUITE_VERSION`].
    pub benchmark: u32,
    /// Name and version of the program.
    pub program: String,
    /// Whether rates were measured for a short time only.
    pub quick: bool,
    /// Name of the machine in tables.
    pub name: String,
    /// Facts about the machine.
    pub machine: Machine,
    /// Date and time of the start in UTC, as ISO 8601.
    pub date: String,
    /// Duration of the whole benchmark in seconds.
    pub duration_s: f64,
    /// Width and height of the pictures in pixels.
    pub resolution: [u32; 2],
    /// Greatest number of path edges.
    pub max_depth: u32,
    /// Device and driver of each backend that was measured, by its name.
    pub backends: BTreeMap<String, String>,
    /// Measurements, by backend, scene and technique.
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

/// Measurement of one technique on one scene and backend.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct BenchmarkCell {
    /// Name of the backend.
    pub backend: String,
    /// Name of the scene.
    pub scene: String,
    /// Name of the technique.
    pub technique: String,
    /// Samples of every pixel per second of each repeat: frames per second.
    pub frames_per_s: Vec<f64>,
    /// Camera paths per second of each repeat, in millions.
    pub mpaths_per_s: Vec<f64>,
    /// Rays per second, in millions, over all repeats.
    pub mrays_per_s: f64,
    /// Seconds from the job to the first sample: uploads, acceleration structures, shaders.
    pub open_s: f64,
    /// Part of `open_s` for building acceleration structures.
    pub build_s: f64,
    /// Samples of the picture of `checksum`.
    pub picture_samples: u64,
    /// Mean radiance of that picture by channel.
    pub picture_mean: [f64; 3],
    /// BLAKE3 hash of the sums of that picture, 64 hex digits: equal for equal bits.
    pub checksum: String,
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
                "the suite has version {}, but this program compares version {SUITE_VERSION}; \
                 measure the machine again",
                head.benchmark
            )));
        }
        serde_json::from_str(&text).map_err(|e| fail(e.to_string()))
    }
}
