//! Options of a night, and its access to the outside world.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::time::SystemTime;

use crate::experiment::comparison_groups::StartOffset;
use crate::experiment::forecast::ThroughputHistory;
use crate::experiment::outcome::CellRef;
use lumbre_light::scene::CompiledScene;
use lumbre_render::{Job, RenderError, Renderer};

/// Opens a renderer on the backend of this name.
pub type Open<'a> =
    &'a dyn Fn(&str, Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Access of a night to the outside world other than its sinks, which tests replace.
pub struct Seams<'a> {
    /// Opens the renderer of a run.
    pub open: Open<'a>,
    /// Waits one tick, while the night is paused or only runs of other processes remain.
    pub wait: &'a dyn Fn(),
}

/// Options of a night.
#[derive(Clone, Debug, Default)]
pub struct Options {
    /// Number of threads of every renderer; 0 for one per core.
    pub threads: usize,
    /// Number of failed runs after which the night ends.
    pub max_fails: Option<usize>,
    /// Whether one small sample of every cell is rendered before the night begins.
    pub smoke: bool,
    /// Time at which the night ends, finished or not. References are then rendered when a cell
    /// first needs them, and cells come from coarse to fine: [`Plan::coarse_to_fine`](crate::experiment::Plan::coarse_to_fine).
    pub deadline: Option<SystemTime>,
    /// Bytes of memory that runs may take at the same time; the limits of the machine, of control
    /// groups and of the address space count, too.
    pub memory: Option<u64>,
    /// Cells and references to render; `None` for all of them.
    pub only: Option<BTreeSet<CellRef>>,
    /// Throughputs of earlier nights, for the forecast.
    pub throughput: ThroughputHistory,
    /// Cells and references that are known to be finished, for the forecast.
    pub done: BTreeSet<CellRef>,
    /// Offset at which to start in the order, if this process is one of many workers. Ignored with
    /// a deadline, which has the same order for all workers. Bias checks, which need all
    /// references, are then left to the worker that closes the night.
    pub start: Option<StartOffset>,
}

impl From<usize> for Options {
    /// Default options with this number of threads.
    fn from(threads: usize) -> Options {
        Options {
            threads,
            ..Options::default()
        }
    }
}
