//! State of a night in progress.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use super::options::{Options, Seams};
use super::scenes::SceneCache;
use super::summary::NightSummary;
use crate::experiment::event::{History, NightControls, Sink};
use crate::experiment::forecast::ThroughputHistory;
use crate::experiment::night::Night;
use crate::experiment::noise_floor::NoiseFloors;
use crate::experiment::outcome::{CellRef, Outcome};
use crate::experiment::plan::{BiasCheck, Plan};
use crate::experiment::run_progress::Checkpoint;
use crate::experiment::spec::ScriptHooks;
use lumbre_light::film::SharedImage;
use lumbre_light::scene::Note;

/// State of a night in progress.
pub(super) struct NightRunner<'a, 's> {
    pub(super) seams: &'a Seams<'a>,
    pub(super) plan: &'a Arc<Plan>,
    pub(super) hooks: &'a dyn ScriptHooks,
    pub(super) control: &'a NightControls,
    pub(super) options: Options,
    pub(super) history: &'a dyn History,
    pub(super) sinks: &'a mut [&'s mut dyn Sink],
    /// State of every reference of the plan.
    pub(super) references: Vec<ReferenceState>,
    /// Cells that are measured against every reference of the plan.
    pub(super) measured: Vec<Vec<usize>>,
    /// Bias checks by reference on either side, each with the index of its first picture.
    pub(super) bias_checks: BTreeMap<usize, Vec<(usize, BiasCheck)>>,
    /// References that another process held in this round, with that process and the time.
    pub(super) references_elsewhere: BTreeMap<usize, (String, Instant)>,
    /// The reference that was used last; neighbouring cells mostly share it.
    pub(super) recent_reference: Option<(usize, SharedImage)>,
    /// Estimates of references that wait for the other side of a bias check.
    pub(super) estimates: BTreeMap<usize, ReferenceEstimate>,
    /// Shards that the history does not store, by reference and number.
    pub(super) shards_in_memory: BTreeMap<(usize, usize), Arc<Checkpoint>>,
    /// Noise floors of every reference, if known.
    pub(super) floors: Vec<Option<NoiseFloors>>,
    /// Whether a picture that is mostly background was reported.
    pub(super) is_background_noted: bool,
    /// Whether a threshold that the first measurement passed was reported.
    pub(super) is_threshold_noted: bool,
    /// Compiled scenes with their hierarchies.
    pub(super) scenes: SceneCache,
    /// Notes of scene compilation that were reported already.
    pub(super) reported_notes: BTreeSet<Note>,
    pub(super) summary: NightSummary,
    /// Number of runs that have ended.
    pub(super) ended: usize,
    /// Number of those that failed.
    pub(super) failed: usize,
    /// Number of requests for a checkpoint so far.
    pub(super) checkpoint_requests: u64,
    /// Throughputs of finished runs, for the forecast.
    pub(super) throughput: ThroughputHistory,
    /// Cells and references that have ended, with whatever outcome.
    pub(super) finished: BTreeSet<CellRef>,
    /// Earliest time of the next forecast.
    pub(super) next_forecast: Instant,
}

impl<'a, 's> NightRunner<'a, 's> {
    pub(super) fn new(
        seams: &'a Seams<'a>,
        plan: &'a Arc<Plan>,
        hooks: &'a dyn ScriptHooks,
        history: &'a dyn History,
        sinks: &'a mut [&'s mut dyn Sink],
        control: &'a NightControls,
        mut options: Options,
    ) -> NightRunner<'a, 's> {
        let (throughput, finished) = (
            std::mem::take(&mut options.throughput),
            std::mem::take(&mut options.done),
        );
        let mut bias_checks: BTreeMap<usize, Vec<(usize, BiasCheck)>> = BTreeMap::new();
        for (first, check) in plan.references.iter().map(|r| r.bias_check).enumerate() {
            for (side, check) in check.into_iter().flat_map(|c| [(first, c), (c.with, c)]) {
                bias_checks.entry(side).or_default().push((first, check));
            }
        }
        NightRunner {
            seams,
            plan,
            hooks,
            control,
            options,
            history,
            sinks,
            references: plan
                .references
                .iter()
                .map(|_| ReferenceState::Pending)
                .collect(),
            measured: plan.measured_cells(),
            bias_checks,
            references_elsewhere: BTreeMap::new(),
            recent_reference: None,
            estimates: BTreeMap::new(),
            shards_in_memory: BTreeMap::new(),
            floors: vec![None; plan.references.len()],
            is_background_noted: false,
            is_threshold_noted: false,
            scenes: SceneCache::new(plan),
            reported_notes: BTreeSet::new(),
            summary: NightSummary::of(Night::planned(plan)),
            ended: 0,
            failed: 0,
            checkpoint_requests: 0,
            throughput,
            finished,
            next_forecast: Instant::now(),
        }
    }
}

/// State of a reference during a night.
pub(super) enum ReferenceState {
    /// Not processed yet.
    Pending,
    /// Recorded; its picture is read from the history.
    Recorded,
    /// Rendered, but not stored by the history.
    InMemory(SharedImage),
    /// Failed or interrupted; the text is the reason.
    Unavailable(String),
}

impl ReferenceState {
    /// State of a reference that has ended without a picture.
    pub(super) fn unavailable(outcome: &Outcome) -> ReferenceState {
        ReferenceState::Unavailable(match outcome {
            Outcome::Failed(reason) => reason.clone(),
            Outcome::Interrupted => "it was interrupted".to_owned(),
            Outcome::Done(_) | Outcome::Cached(_) => "it has no picture".to_owned(),
        })
    }
}

/// Picture of a reference, with the variance of its pixels' means.
#[derive(Clone)]
pub(super) struct ReferenceEstimate {
    pub(super) mean: SharedImage,
    pub(super) variance: SharedImage,
    /// Samples per pixel; `None` if that is not known.
    pub(super) samples: Option<u64>,
}
