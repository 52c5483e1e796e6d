//! Events that a follower reports of a night, named like those of the night itself
//! ([`Event`](crate::experiment::Event)); the others report files and workers.

use std::path::PathBuf;
use std::sync::Arc;

use crate::experiment::forecast::Forecast;
use crate::experiment::outcome::Level;
use crate::experiment::{CellRef, Outcome, WaveRow};
use crate::store::worker::registry::WorkerStatus;
use lumbre_light::film::Image;
use lumbre_light::film::time::TimeAxis;
use lumbre_render::OpenStats;
use lumbre_render::Settings;

/// A change that a follower found in the files of a night.
#[derive(Clone, Debug)]
pub enum FollowEvent {
    /// A night started in this folder. Results of earlier nights remain.
    NightStarted,
    /// A run started, and its waves and images are reported from now on.
    CellStarted {
        /// Cell or reference of the run.
        cell: CellRef,
        /// Settings from its `config.json`, if they can be read.
        config: Option<Box<Settings>>,
        /// Statistics of opening its renderer.
        open: OpenStats,
        /// Image that it is measured against, if it can be read.
        reference: Option<Arc<Image>>,
    },
    /// A run renders on another worker; its waves and images are not reported.
    RunActive {
        /// Cell or reference of the run.
        cell: CellRef,
    },
    /// A shard of a reference started or ended.
    ShardChanged {
        /// Index of the reference.
        reference: usize,
        /// Number of the shard, if it has just been finished.
        finished: Option<usize>,
        /// Number of shards of the reference.
        total: usize,
    },
    /// State of all workers of the night, reported every two seconds.
    Workers(Vec<WorkerStatus>),
    /// A wave of a run was measured. Its metrics are in the order of the outline.
    Wave {
        /// Cell or reference of the run.
        cell: CellRef,
        /// Measurement at the end of the wave.
        row: WaveRow,
    },
    /// A newer image of a run was written.
    ImageUpdated {
        /// Cell or reference of the run.
        cell: CellRef,
        /// Image in linear sRGB.
        image: Arc<Image>,
    },
    /// A run stored the image of one bidirectional strategy.
    StrategyImage {
        /// Cell or reference of the run.
        cell: CellRef,
        /// Number of vertices on the light subpath.
        s: u32,
        /// Number of vertices on the camera subpath.
        t: u32,
        /// Whether the image includes the MIS weights.
        weighted: bool,
        /// Image in linear sRGB.
        image: Arc<Image>,
    },
    /// A run stored its time-resolved film.
    TimesWritten {
        /// Cell or reference of the run.
        cell: CellRef,
        /// NumPy array of mean radiance, \[row\]\[column\]\[bin\]\[rgb\].
        file: PathBuf,
        /// Time bins of the array.
        axis: TimeAxis,
    },
    /// A run ended, or was found to have ended.
    CellFinished {
        /// Cell or reference of the run.
        cell: CellRef,
        /// Outcome of the run.
        outcome: Outcome,
        /// Its last measurement, if it is known.
        last: Option<WaveRow>,
    },
    /// A message for users was logged.
    Message {
        /// Severity of the message.
        level: Level,
        /// Run that the message is about, if any.
        cell: Option<CellRef>,
        /// Text of the message.
        text: String,
    },
    /// A reference was compared with the image of a second technique.
    BiasCheck {
        /// Index of the reference in the plan.
        reference: usize,
        /// Whether the two images agree.
        agrees: bool,
    },
    /// A forecast of the remaining time was made.
    Forecast(Forecast),
    /// The night ended.
    NightFinished,
}

/// An event with the time at which it happened.
#[derive(Clone, Debug)]
pub struct TimedEvent {
    /// Time in seconds since 1970.
    pub at_s: f64,
    /// Event that happened.
    pub event: FollowEvent,
}
