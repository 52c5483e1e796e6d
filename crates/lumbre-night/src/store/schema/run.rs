//! Files of a run's or a reference's folder: `config.json`, `done.json` or `ref.json`,
//! `failed.json`, results of bias checks, and the head of a checkpoint.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::values::{Named, Real};
use super::{Field, Problem, ReadError, RecordRow, Version, files, pretty, records};
use crate::experiment::Plan;
use crate::experiment::bias_check::BiasCheckResult;
use crate::experiment::night::reference::BiasCheckSummary;
use lumbre_light::film::ztest::Judged;
use lumbre_light::value::Value;
use lumbre_metrics::floor::Floor;
use lumbre_render::settings::{Settings, StoredSettings};
use lumbre_render::{Device, Peer};

/// Name of the last file of a run.
pub const DONE: &str = "done.json";
/// Name of the last file of a reference.
pub const REFERENCE: &str = "ref.json";

/// Row of the settings of a run in the reference page of files.
pub const SETTINGS: RecordRow = RecordRow {
    name: "Settings",
    doc: "Settings with which a run is rendered, under the keys that scripts use.",
    fields: &{
        let mut fields = [Field { name: "", doc: "" }; Settings::STORED.len()];
        let mut i = 0;
        while i < fields.len() {
            let (name, doc) = Settings::STORED[i];
            fields[i] = Field { name, doc };
            i += 1;
        }
        fields
    },
};

files! {
    /// Place of a run in its plan, its settings, and what its id is the hash of. The plan determines
    /// it; a damaged one is rewritten.
    pub file ConfigFile = "config.json", 1 {
        /// Name of the experiment.
        pub experiment: String,
        /// Id of the run: hash of `identity`.
        pub run: String,
        /// Hash of the plan. Only of cells; references are shared by plans.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub plan: Option<String>,
        /// Readable path. Only of cells.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub path: Option<String>,
        /// Axis values in the order of the axes. Only of cells.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub point: Option<Named<Value>>,
        /// Number of the repeat, from 0. Only of cells.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub repeat: Option<u32>,
        /// Seed of the random numbers. Only of cells.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub seed: Option<u64>,
        /// Seeds of the two halves. Only of rendered references.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub seeds: Option<[u64; 2]>,
        /// Hash that is equal for references which differ only in their length. Only of rendered
        /// references.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub stem: Option<String>,
        /// Samples per pixel of a shard. Only of references that are rendered in shards.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub shard_samples: Option<u64>,
        /// Settings with which it is rendered. Not of references that are files.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub render: Option<StoredSettings>,
        /// Id of the reference that it is measured against. Only of cells that have one.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub reference: Option<String>,
        /// Path of the image file. Only of references that are files.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub file: Option<String>,
        /// Origin of the image file as stated by the script. Only of references that are files.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub made_by: Option<String>,
        /// Everything that decides the picture and its measurements, in canonical form.
        pub identity: Value,
    }

    /// Why the last attempt of a run failed.
    pub file FailedFile = "failed.json", 1 {
        /// Id of the run.
        pub run: String,
        /// Reason of the failure.
        pub reason: String,
        /// Last lines of the run's log, oldest first, at most 20.
        pub log: Vec<String>,
        /// Date of the failure, UTC.
        pub date: String,
    }

    /// Result of comparing a reference with the same picture by a second technique.
    pub file BiasCheckFile = "bias-check-<technique>.json", 1 {
        /// Id of the reference.
        pub reference: String,
        /// Id of the second picture.
        pub second: String,
        /// Integrator of the second picture.
        pub technique: String,
        /// Whether no comparison found a difference.
        pub agrees: bool,
        /// The result in one sentence.
        pub finding: String,
        /// Number of comparisons: blocks times channels, and the channels of the whole picture.
        pub comparisons: usize,
        /// Expected share of blocks reported as different that differ only by chance.
        pub false_discovery_rate: f64,
        /// Sum of the reference over that of the second picture.
        pub ratio: Real,
        /// Standard error of the ratio.
        pub ratio_error: Real,
        /// Whether the sums over the whole pictures differ.
        pub whole_differs: bool,
        /// Blocks that differ, least p-value first.
        pub differing: Vec<DifferingBlock>,
    }
}

records! {
    /// Block of a picture in which a bias check found a difference.
    pub struct DifferingBlock {
        /// Column and row of its first pixel; `null` for the dark blocks together.
        pub at: Option<[u32; 2]>,
        /// Colour channel: 0 red, 1 green, 2 blue.
        pub channel: usize,
        /// Standard normal deviate of the difference.
        pub z: Real,
        /// Two-sided p-value of the deviate.
        pub p: Real,
    }

    /// Size and checksum of a file.
    pub struct FileSum {
        /// Size in bytes.
        pub bytes: u64,
        /// BLAKE3 hash of its content, in hexadecimal.
        pub blake3: String,
    }

    /// Cost of opening a renderer.
    pub struct OpenCost {
        /// Seconds spent building acceleration structures.
        pub accel_build_s: f64,
        /// Number of nodes of the acceleration structures.
        pub accel_nodes: u64,
        /// Bytes of nodes and primitives; 0 if unknown.
        pub accel_bytes: u64,
        /// Expected cost of a ray by the surface area heuristic; 0 if unknown.
        pub accel_cost: f64,
        /// Bytes of triangles, spheres, their attributes and instances; absent if unknown.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub geometry_bytes: Option<u64>,
        /// Bytes of texels, of the environment map too; absent if unknown.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub texture_bytes: Option<u64>,
        /// Threads of the processor. Only of files of earlier versions, whose `device` is a line.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub threads: Option<u32>,
        /// Number of paths that the processor traced at a time. Only of files of earlier versions.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub lanes: Option<u32>,
        /// External program that rendered. Only of files of earlier versions.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub peer: Option<Peer>,
    }

    /// `done.json` of a run, and `ref.json` of a rendered reference: how it ended.
    pub struct RunResults {
        /// Version of the format.
        pub version: Version<1>,
        /// Program that rendered it, with its version.
        pub program: super::Program,
        /// Id of the run.
        pub run: String,
        /// Clause of the stop rule that ended it.
        pub reason: String,
        /// Samples per pixel.
        pub samples: u64,
        /// Seconds inside the renderer.
        pub render_s: f64,
        /// Seconds that other work on the machine took from the renderer, or during which the
        /// process was stopped; not in `render_s`. Absent where that is not watched.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub lost_s: Option<f64>,
        /// Wall-clock seconds, measuring included.
        pub wall_s: f64,
        /// Seconds spent measuring.
        pub measure_s: f64,
        /// Number of waves.
        pub waves: u64,
        /// Number of camera paths.
        pub paths: u64,
        /// Number of rays.
        pub rays: u64,
        /// Samples that were NaN or infinite, and counted as black.
        pub invalid: u64,
        /// Column, row and sample of the first invalid sample.
        pub first_invalid: Option<[u64; 3]>,
        /// Last value of every metric by its column.
        pub metrics: Named<Real>,
        /// Noise floor of its reference by column; `null` if it is not known.
        pub floors: Option<Named<Real>>,
        /// Standard error of each noise floor by column, where it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub floor_errors: Option<Named<Real>>,
        /// Last value of every metric without the noise of the reference, by the names of the
        /// columns in `metrics.csv`.
        pub net: Option<Named<Real>>,
        /// Samples per pixel of the two halves. Only of references.
        pub halves: Option<[u64; 2]>,
        /// Names of the films of all layers, and of the stills of the time axis in `films/`.
        pub films: Vec<String>,
        /// Seed of the random numbers; of a reference, that of its first half.
        pub seed: u64,
        /// Devices that rendered it; one, unless shards of a reference were rendered on several.
        #[serde(default, skip_serializing_if = "Vec::is_empty")]
        pub devices: Vec<Device>,
        /// Line about the device for people. Only of files of earlier versions, without `devices`.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        pub device: Option<String>,
        /// Model of the processor.
        pub processor: String,
        /// Cost of opening the renderer.
        pub open: OpenCost,
        /// Hash of the scene's content, in hexadecimal; empty if unknown.
        pub scene_hash: String,
        /// Date at which it ended, UTC.
        pub finished: String,
        /// Size and checksum of every other file by its name.
        pub files: BTreeMap<String, FileSum>,
        /// First 32 digits of the BLAKE3 hash of this file with an empty `check`.
        pub check: String,
    }

    /// `ref.json` of a reference that is an image file.
    pub struct ImportedReference {
        /// Version of the format.
        pub version: Version<1>,
        /// Program that copied it, with its version.
        pub program: super::Program,
        /// Id of the reference.
        pub run: String,
        /// Path of the file that was copied.
        pub imported_from: String,
        /// BLAKE3 hash of the file, in hexadecimal.
        pub blake3: String,
        /// Origin of the file as stated by the script.
        pub made_by: String,
        /// Knowledge about its noise: `unknown`.
        pub noise: String,
        /// Date of the copy, UTC.
        pub finished: String,
        /// Size and checksum of every other file by its name.
        pub files: BTreeMap<String, FileSum>,
        /// First 32 digits of the BLAKE3 hash of this file with an empty `check`.
        pub check: String,
    }

    /// Head of a checkpoint: progress of a run. The renderer's state precedes it.
    pub struct CheckpointHead {
        /// Id of the run, or name of the shard.
        pub run: String,
        /// Number of the run's checkpoint, from 1.
        pub sequence: u64,
        /// Samples per pixel that the current wave still has to render.
        pub samples_left: u64,
        /// Greatest number of samples per pixel of the next wave.
        pub next_wave_max: u64,
        /// Wall-clock seconds of the run.
        pub wall_s: f64,
        /// The wave that is not complete.
        pub current_wave: WaveCounts,
        /// Column, row and sample of the first invalid sample.
        pub first_invalid: Option<[u64; 3]>,
        /// Measurements in the form of `metrics.csv`.
        pub rows: String,
    }

    /// Counters of a wave.
    pub struct WaveCounts {
        /// Samples per pixel.
        pub samples: u64,
        /// Seconds inside the renderer.
        pub render_s: f64,
        /// Seconds that other work took from the renderer.
        #[serde(default)]
        pub lost_s: f64,
        /// Seconds that a device other than the CPU was busy.
        pub device_s: f64,
        /// Number of camera paths.
        pub paths: u64,
        /// Number of rays.
        pub rays: u64,
        /// Samples that were NaN or infinite.
        pub invalid: u64,
        /// Column, row and sample of the first invalid sample.
        pub first_invalid: Option<[u64; 3]>,
    }
}

impl ConfigFile {
    /// Returns the settings with which the run is rendered, if it is rendered and this version knows
    /// them.
    pub fn settings(&self) -> Option<&Settings> {
        self.render.as_ref()?.known()
    }
}

impl BiasCheckFile {
    /// Records the comparison of a reference with the picture `with`.
    pub fn new(
        plan: &Plan,
        [reference, with]: [usize; 2],
        check: &BiasCheckSummary,
        found: &BiasCheckResult,
    ) -> Self {
        let [reference, second] = [reference, with].map(|i| plan.references[i].id.0.clone());
        BiasCheckFile {
            reference,
            second,
            technique: check.technique.clone(),
            agrees: check.agrees,
            finding: check.finding.clone(),
            comparisons: found.comparisons,
            false_discovery_rate: found.rate,
            ratio: Real(found.ratio),
            ratio_error: Real(found.ratio_error),
            whole_differs: found.whole_differs,
            differing: found.differing.iter().map(DifferingBlock::from).collect(),
            ..BiasCheckFile::default()
        }
    }
}

impl From<&Judged> for DifferingBlock {
    fn from(block: &Judged) -> DifferingBlock {
        DifferingBlock {
            at: block.at,
            channel: block.channel,
            z: Real(block.z),
            p: Real(block.p),
        }
    }
}

/// Last file of a run or a reference: a manifest of its folder. A run without it is incomplete.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase")]
pub enum DoneFile {
    /// It was rendered.
    Rendered(Box<RunResults>),
    /// It is a copy of an image file.
    Imported(Box<ImportedReference>),
}

impl super::StoredFile for DoneFile {
    const NAME: &'static str = DONE;
    const VERSION: u32 = 1;

    /// Parses the manifest and compares it with its checksum.
    fn parse(bytes: &[u8]) -> Result<DoneFile, Problem> {
        let done: DoneFile = super::parse_fields(bytes)?;
        if done.check() == done.computed_check() {
            Ok(done)
        } else {
            Err(super::wrong_checksum())
        }
    }
}

impl RunResults {
    /// The noise floor of its reference for a column, if it is known.
    pub fn floor(&self, column: &str) -> Option<Floor> {
        let errors = self.floor_errors.as_ref();
        Some(Floor {
            value: self.floors.as_ref()?.get(column)?.0,
            error: errors
                .and_then(|errors| errors.get(column))
                .map_or(0.0, |error| error.0),
        })
    }
}

impl DoneFile {
    /// Id of the run.
    pub fn run(&self) -> &str {
        match self {
            DoneFile::Rendered(results) => &results.run,
            DoneFile::Imported(reference) => &reference.run,
        }
    }

    /// Sizes and checksums of all other files.
    pub fn files(&self) -> &BTreeMap<String, FileSum> {
        match self {
            DoneFile::Rendered(results) => &results.files,
            DoneFile::Imported(reference) => &reference.files,
        }
    }

    /// Stored checksum of this file.
    pub fn check(&self) -> &str {
        match self {
            DoneFile::Rendered(results) => &results.check,
            DoneFile::Imported(reference) => &reference.check,
        }
    }

    /// Results, if it was rendered.
    pub fn rendered(&self) -> Option<&RunResults> {
        match self {
            DoneFile::Rendered(results) => Some(results),
            DoneFile::Imported(_) => None,
        }
    }

    /// Returns the manifest with these files and its own checksum.
    pub fn sealed(&self, files: BTreeMap<String, FileSum>) -> DoneFile {
        let mut sealed = self.clone();
        *sealed.parts_mut().0 = files;
        let check = sealed.computed_check();
        *sealed.parts_mut().1 = check;
        sealed
    }

    /// Checksum of the manifest, computed from its content.
    pub(crate) fn computed_check(&self) -> String {
        let mut unchecked = self.clone();
        unchecked.parts_mut().1.clear();
        blake3::hash(pretty(&unchecked).as_bytes()).to_hex()[..32].to_owned()
    }

    fn parts_mut(&mut self) -> (&mut BTreeMap<String, FileSum>, &mut String) {
        match self {
            DoneFile::Rendered(results) => (&mut results.files, &mut results.check),
            DoneFile::Imported(reference) => (&mut reference.files, &mut reference.check),
        }
    }

    /// Reads the last file of a run or reference. Returns `None` if there is none.
    ///
    /// # Errors
    /// When it cannot be read, is damaged, or has another version.
    pub fn find(folder: &std::path::Path) -> Result<Option<DoneFile>, ReadError> {
        for name in [DONE, REFERENCE] {
            match <DoneFile as super::StoredFile>::read_from(&folder.join(name)) {
                Err(error) if error.problem == Problem::Missing => {}
                found => return found.map(Some),
            }
        }
        Ok(None)
    }
}
