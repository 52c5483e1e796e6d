//! State of a run while it is rendered: the request, the current attempt, and the result.

use std::sync::Arc;
use std::time::Instant;

use super::attempt::{Attempt, RetryState};
use super::waves::WaveSizer;
use crate::experiment::event::{Event, FinishedRun};
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, Outcome, WaveRow};
use crate::experiment::shards::{Shard, WorkUnit};
use crate::experiment::stop::StopRule;
use lumbre_light::film::layer::LayerImage;
use lumbre_light::film::time::TimeCube;
use lumbre_light::film::{Film, SharedImage};
use lumbre_light::scene::SceneDesc;
use lumbre_metrics::evaluator::Evaluator;
use lumbre_render::OpenStats;
use lumbre_render::Settings;

/// Request to render a run.
#[derive(Clone)]
pub(super) struct RunRequest<'a> {
    /// The cell or reference.
    pub(super) cell: CellRef,
    /// Resolved render settings.
    pub(super) config: &'a Settings,
    /// Scene with all changes applied.
    pub(super) scene: &'a Arc<SceneDesc>,
    /// One seed, or those of two halves.
    pub(super) seeds: &'a [u64],
    /// When the run is finished.
    pub(super) stop: StopRule,
    /// Shard of the reference, if the run is one of several shards.
    pub(super) shard: Option<Shard>,
    /// Image that the run is measured against.
    pub(super) reference: Option<SharedImage>,
    /// Resolution that replaces that of the settings.
    pub(super) resolution: Option<[u32; 2]>,
}

impl RunRequest<'_> {
    /// Returns the unit of work that one process at a time may claim.
    pub(super) fn unit(&self) -> WorkUnit {
        self.shard.map_or(WorkUnit::Run(self.cell), WorkUnit::Shard)
    }
}

/// Result of a run that has ended.
pub(super) struct EndedRun {
    /// Outcome of the run.
    pub(super) outcome: Outcome,
    /// The film, if anything was rendered.
    pub(super) film: Option<Arc<Film>>,
    /// The denoised picture, if it has a denoiser and is done.
    pub(super) denoised: Option<SharedImage>,
    /// Images of the requested layers, if it is done.
    pub(super) layers: Arc<Vec<LayerImage>>,
    /// The time-resolved film, if requested and done.
    pub(super) times: Option<Arc<TimeCube>>,
    /// Measurements, oldest first.
    pub(super) rows: Vec<WaveRow>,
    /// Films of the two halves, if it is a reference that is done.
    pub(super) halves: Option<[Arc<Film>; 2]>,
    /// Noise floors of the reference that it was measured against.
    pub(super) floors: NoiseFloors,
    /// Cost of opening the renderer.
    pub(super) open: OpenStats,
}

impl EndedRun {
    /// Result of a run that an earlier night finished.
    pub(super) fn cached(run: FinishedRun) -> EndedRun {
        let FinishedRun {
            folder,
            rows,
            floors,
            open,
        } = run;
        EndedRun {
            rows,
            floors,
            open,
            ..EndedRun::without_results(Outcome::Cached(folder))
        }
    }

    /// Result of a run that failed before it rendered anything.
    pub(super) fn failed(reason: String) -> EndedRun {
        EndedRun::without_results(Outcome::Failed(reason))
    }

    /// Result that consists only of its outcome.
    pub(super) fn without_results(outcome: Outcome) -> EndedRun {
        EndedRun {
            outcome,
            film: None,
            denoised: None,
            layers: Arc::default(),
            times: None,
            rows: Vec::new(),
            halves: None,
            floors: NoiseFloors::default(),
            open: OpenStats::default(),
        }
    }

    /// Returns the event of the end.
    pub(super) fn event(self, cell: CellRef) -> Event {
        Event::CellFinished {
            cell,
            outcome: self.outcome,
            film: self.film,
            denoised: self.denoised,
            layers: self.layers,
            times: self.times,
            rows: Arc::new(self.rows),
            floors: self.floors,
            open: Some(self.open),
        }
    }
}

/// A run that is being rendered.
pub(super) struct ActiveRun<'a> {
    /// The request to render.
    pub(super) request: RunRequest<'a>,
    /// The current attempt.
    pub(super) attempt: Attempt,
    /// Sizes of its waves; `None` before the renderer is open.
    pub(super) waves: Option<WaveSizer>,
    /// Evaluates its metrics; `None` before the renderer is open and without a reference.
    pub(super) evaluator: Option<Evaluator<'a>>,
    /// State of its retries.
    pub(super) retry: RetryState,
    /// Images of its layers, once it is done.
    pub(super) layers: Vec<LayerImage>,
    /// The denoised picture at the last measurement, if it has a denoiser.
    pub(super) denoised: Option<SharedImage>,
    /// Samples per pixel at the last [`Event::Times`](crate::experiment::Event::Times).
    pub(super) times_samples: u64,
    /// Number of turns so far.
    pub(super) turns: u64,
    /// Start of the current turn, and wall-clock seconds of the run at that time.
    pub(super) turn_start: (Instant, f64),
}

impl<'a> ActiveRun<'a> {
    /// A run that has not been opened yet.
    pub(super) fn new(request: RunRequest<'a>) -> ActiveRun<'a> {
        ActiveRun {
            request,
            attempt: Attempt::default(),
            waves: None,
            evaluator: None,
            retry: RetryState::default(),
            layers: Vec::new(),
            denoised: None,
            times_samples: 0,
            turns: 0,
            turn_start: (Instant::now(), 0.0),
        }
    }

    /// Returns the seconds of render time and the number of turns so far.
    pub(super) fn clock(&self) -> (f64, u64) {
        (self.attempt.progress.render_s(), self.turns)
    }

    /// Whether a checkpoint of the current attempt is stored.
    pub(super) fn has_checkpoint(&self) -> bool {
        self.attempt.checkpoints.stored
    }

    /// Discards the current attempt, so that the next turn opens the renderer again.
    pub(super) fn discard_attempt(&mut self) {
        (self.attempt, self.waves, self.times_samples) = (Attempt::default(), None, 0);
    }

    /// Wall-clock seconds so far, including the current turn.
    pub(super) fn wall_s(&self) -> f64 {
        self.turn_start.1 + self.turn_start.0.elapsed().as_secs_f64()
    }
}
