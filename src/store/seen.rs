//! What a follower tells of a night.

use std::path::PathBuf;
use std::sync::Arc;

use super::crew::Worker;
use crate::experiment::event::Level;
use crate::experiment::forecast::Forecast;
use crate::experiment::{CellConfig, CellRef, Outcome, WaveRow};
use crate::film::Image;
use crate::film::time::TimeAxis;
use crate::render::OpenStats;

/// Something that a follower saw.
#[derive(Clone, Debug)]
pub enum Seen {
    /// A night began in this folder; what earlier nights left is still there.
    Began,
    /// A run started.
    Started {
        /// Which.
        cell: CellRef,
        /// What it renders, as far as its folder says.
        config: Option<Box<CellConfig>>,
        /// What opening it cost.
        open: OpenStats,
        /// The image that it is measured against, if it is there.
        reference: Option<Arc<Image>>,
    },
    /// A run renders beside the one that is shown.
    Underway {
        /// Which.
        cell: CellRef,
    },
    /// A part of a reference started or ended.
    Part {
        /// Index of the reference.
        reference: usize,
        /// Its number, if its sums are there now.
        there: Option<usize>,
        /// How many parts there are.
        of: usize,
    },
    /// The workers of the night, all of them, when one or more were looked at.
    Crew(Vec<Worker>),
    /// It was measured; metrics are in the order of the outline.
    Measured {
        /// Which.
        cell: CellRef,
        /// The measurement.
        row: WaveRow,
    },
    /// There is a newer picture of it.
    Pictured {
        /// Which.
        cell: CellRef,
        /// The picture.
        image: Arc<Image>,
    },
    /// A film that it kept of one strategy.
    Strategy {
        /// Which.
        cell: CellRef,
        /// Vertices from the light.
        s: u32,
        /// Vertices from the camera.
        t: u32,
        /// Whether it is weighted against the others.
        weighted: bool,
        /// The film.
        image: Arc<Image>,
    },
    /// It left its light by time.
    Timed {
        /// Which.
        cell: CellRef,
        /// The array of mean radiance, [row][column][bin][rgb].
        file: PathBuf,
        /// The bins.
        axis: TimeAxis,
    },
    /// It ended, or was found to have ended.
    Ended {
        /// Which.
        cell: CellRef,
        /// How.
        outcome: Outcome,
        /// Its last measurement, if it is known.
        last: Option<WaveRow>,
    },
    /// A line for people.
    Said {
        /// Importance.
        level: Level,
        /// The run it is about, if any.
        cell: Option<CellRef>,
        /// The line.
        text: String,
    },
    /// A reference was compared with the same picture by a second technique.
    Compared {
        /// Its place in the plan.
        reference: usize,
        /// Whether they agree.
        agrees: bool,
    },
    /// What is left of the night was reckoned.
    Foretold(Forecast),
    /// The night is over.
    Over,
}

/// Something seen, and when it happened, in seconds since 1970.
#[derive(Clone, Debug)]
pub struct Sight {
    /// When it happened.
    pub at_s: f64,
    /// What.
    pub seen: Seen,
}
