//! Output of `lumbre status --json`: progress of a night, in a form that programs may rely on. A
//! field that is added keeps the version; one that is removed or changes its meaning raises it.

use std::collections::BTreeSet;

use serde_json::Value as Json;

use super::{files, records};
use lumbre_render::Device;

files! {
    /// Progress of a night.
    pub file StatusReport = "status --json", 1 {
        /// Path of the night's folder.
        pub folder: String,
        /// `not started`, `running`, `silent` if nothing was written for a minute, `finished`, or
        /// `ended` if work is left.
        pub state: String,
        /// Number of cells by state.
        pub cells: CellCounts,
        /// Number of references by state.
        pub references: ReferenceCounts,
        /// Seconds since the night started; `null` before.
        pub elapsed_s: Option<f64>,
        /// Estimated seconds that are left; `null` if unknown.
        pub left_s: Option<f64>,
        /// Seconds since a file of the night was last written; `null` if unknown.
        pub silent_s: Option<f64>,
        /// Descriptions of runs that are left out, because they do not match their checksums.
        pub problems: BTreeSet<String>,
        /// Run that is rendered; `null` if none is.
        pub current: Option<CurrentRun>,
        /// Runs that failed.
        pub failures: Vec<FailureRecord>,
        /// Workers and jobs of the night; `null` without any.
        pub cluster: Option<Json>,
    }
}

records! {
    /// Number of cells by state.
    pub struct CellCounts {
        /// Number of all cells.
        pub total: usize,
        /// Finished cells, those of earlier nights included.
        pub done: usize,
        /// Cells that failed.
        pub failed: usize,
        /// Cells that ended early.
        pub interrupted: usize,
        /// Cells that are rendered now.
        pub running: usize,
        /// Cells that were not started.
        pub waiting: usize,
    }

    /// Number of references by state.
    pub struct ReferenceCounts {
        /// Number of all references.
        pub total: usize,
        /// References that are finished or failed.
        pub settled: usize,
        /// Shards of references that are not finished; `null` without any.
        pub shards: Option<ShardCounts>,
    }

    /// Number of shards.
    pub struct ShardCounts {
        /// Shards that are done.
        pub done: usize,
        /// Number of all shards.
        pub total: usize,
    }

    /// Run that is rendered.
    pub struct CurrentRun {
        /// Readable name of the cell or reference.
        pub name: String,
        /// Line about the devices that render it, for people.
        pub device: String,
        /// Devices that render it, as in `done.json`.
        pub devices: Vec<Device>,
        /// Samples per pixel at its last measurement; `null` before.
        pub samples: Option<u64>,
        /// Seconds inside the renderer at its last measurement; `null` before.
        pub render_s: Option<f64>,
    }

    /// Run that failed.
    pub struct FailureRecord {
        /// Readable name of the cell or reference.
        pub name: String,
        /// Reason of the failure.
        pub reason: String,
    }
}
