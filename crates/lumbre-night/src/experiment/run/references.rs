//! References of a night: found in the history, rendered as a whole, or joined from shards.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::active_run::{EndedRun, RunRequest};
use super::cells::Readiness;
use super::state::{NightRunner, ReferenceState};
use super::work_units::JoinResult;
use crate::experiment::event::Event;
use crate::experiment::noise_floor::HalfImages;
use crate::experiment::outcome::{CellRef, Level, Outcome};
use crate::experiment::plan::ReferenceSource;
use crate::experiment::run_progress::Claim;
use crate::experiment::shards::Shard;
use lumbre_light::film::SharedImage;

/// Time for which another process is assumed to still hold a reference, while cells that need it
/// are processed.
const HELD_FOR: Duration = Duration::from_secs(5);

impl<'a> NightRunner<'a, '_> {
    /// Processes a reference: looks it up or renders it, unless another process works on it.
    pub(super) fn process_reference(&mut self, index: usize) -> Readiness<'a> {
        let cell = CellRef::Reference(index);
        if self.is_finished(cell) {
            return Readiness::Finished;
        }
        if let Some((owner, at)) = self.references_elsewhere.get(&index)
            && at.elapsed() < HELD_FOR
        {
            return Readiness::HeldBy(owner.clone());
        }
        let plan = self.plan;
        match &plan.references[index].source {
            ReferenceSource::File { file, .. } => {
                let ended = match self.history.image(plan, index) {
                    Ok(Some(image)) => {
                        self.recent_reference = Some((index, Arc::new(image)));
                        EndedRun::without_results(Outcome::Cached(file.clone()))
                    }
                    Ok(None) => {
                        EndedRun::failed(format!("no image was found in {}", file.display()))
                    }
                    Err(error) => EndedRun::failed(error.to_string()),
                };
                let outcome = self.finish(cell, ended);
                self.references[index] = if let Outcome::Cached(_) = outcome {
                    ReferenceState::Recorded
                } else {
                    ReferenceState::unavailable(&outcome)
                };
            }
            ReferenceSource::Render {
                config,
                scene,
                seeds,
                stop,
                ..
            } => {
                let stop = stop.clone();
                let request = RunRequest {
                    cell,
                    config,
                    scene,
                    seeds,
                    stop,
                    shard: None,
                    reference: None,
                    resolution: None,
                };
                match self.rendered_reference(index, &request) {
                    Ok(state) => {
                        self.references[index] = state;
                        self.check_bias(index);
                    }
                    Err(owner) => {
                        self.references_elsewhere
                            .insert(index, (owner.clone(), Instant::now()));
                        return Readiness::HeldBy(owner);
                    }
                }
            }
        }
        Readiness::Finished
    }

    /// Looks up a reference that Lumbre renders, or renders it. The error names the process that
    /// works on it.
    fn rendered_reference(
        &mut self,
        index: usize,
        request: &RunRequest<'a>,
    ) -> Result<ReferenceState, String> {
        if let Some(state) = self.stored_reference(index, request) {
            return Ok(state);
        }
        let shards = self.plan.references[index].shards(index);
        loop {
            if let Some(ended) = self.render_shards(request, &shards)? {
                let outcome = self.finish(request.cell, ended);
                if let Outcome::Failed(_) = outcome {
                    // Reports the failure to other workers, which would fail in the same way.
                    self.history.release(self.plan, request.cell.into());
                }
                return Ok(ReferenceState::unavailable(&outcome));
            }
            match self.history.claim(self.plan, request.cell.into()) {
                Ok(Claim::Granted) => {}
                Ok(Claim::HeldBy(owner) | Claim::WrongWorker(owner)) => return Err(owner),
                Err(error) => {
                    return Ok(ReferenceState::unavailable(
                        &self.finish(request.cell, EndedRun::failed(error.to_string())),
                    ));
                }
            }
            // Another process may have finished it before the claim was granted.
            let state = match self.stored_reference(index, request) {
                Some(state) => Some(state),
                None => self.new_reference(index, request, &shards),
            };
            self.history.release(self.plan, request.cell.into());
            if let Some(state) = state {
                return Ok(state);
            }
        }
    }

    /// Records a reference that an earlier night or another process finished. Returns `None` if
    /// there is none that can be read.
    fn stored_reference(
        &mut self,
        index: usize,
        request: &RunRequest<'_>,
    ) -> Option<ReferenceState> {
        match self.read_reference(index) {
            Ok(Some(ended)) => Some(match self.finish(request.cell, ended) {
                Outcome::Cached(_) => ReferenceState::Recorded,
                outcome => ReferenceState::unavailable(&outcome),
            }),
            Ok(None) => None,
            Err(problem) => {
                let text =
                    format!("the stored reference cannot be read and is rendered again: {problem}");
                let reason = self.emit_message(Level::Warn, request.cell, text).err()?;
                Some(ReferenceState::unavailable(
                    &self.finish(request.cell, EndedRun::failed(reason)),
                ))
            }
        }
    }

    /// Renders a reference, or joins it from its shards. Returns `None` if a shard must be rendered
    /// again.
    fn new_reference(
        &mut self,
        index: usize,
        request: &RunRequest<'a>,
        shards: &[Shard],
    ) -> Option<ReferenceState> {
        if shards.is_empty() {
            let ended = self.render_run(request.clone());
            return Some(self.record_reference(index, request, ended));
        }
        match self.join(request, shards) {
            JoinResult::Missing(_) => None,
            JoinResult::Failed(reason) => Some(ReferenceState::unavailable(
                &self.finish(request.cell, EndedRun::failed(reason)),
            )),
            JoinResult::Joined(joined) => {
                let (ended, continuable) = *joined;
                let state = self.record_reference(index, request, ended);
                if !matches!(state, ReferenceState::Unavailable(_)) {
                    self.save_joined_shards(request, shards, continuable.as_ref());
                }
                Some(state)
            }
        }
    }

    /// Records a reference that has ended.
    fn record_reference(
        &mut self,
        index: usize,
        request: &RunRequest<'a>,
        mut ended: EndedRun,
    ) -> ReferenceState {
        let image = ended.film.as_ref().map(|film| Arc::new(film.mean()));
        if let Some(film) = &ended.film {
            self.store_estimate(index, film);
        }
        if let (Some(halves), Some(image)) = (ended.halves.take(), &image) {
            let images = HalfImages {
                means: [halves[0].mean(), halves[1].mean()],
                samples: [halves[0].samples, halves[1].samples],
            };
            let emitted = self.emit(&Event::Halves {
                reference: index,
                halves,
            });
            if let Err(reason) =
                emitted.and_then(|()| self.compute_noise_floors(index, image, &images))
            {
                return ReferenceState::unavailable(
                    &self.finish(request.cell, EndedRun::failed(reason)),
                );
            }
        }
        let outcome = self.finish(request.cell, ended);
        match (outcome, image) {
            (Outcome::Done(_), Some(image)) => {
                self.recent_reference = Some((index, Arc::clone(&image)));
                // Many large references do not fit into memory; keep only those that the history
                // does not store.
                match self.history.image(self.plan, index) {
                    Ok(Some(_)) => ReferenceState::Recorded,
                    _ => ReferenceState::InMemory(image),
                }
            }
            (outcome, _) => ReferenceState::unavailable(&outcome),
        }
    }

    /// Whether the picture of a reference is available.
    pub(super) fn is_available(&self, index: usize) -> bool {
        matches!(
            self.references[index],
            ReferenceState::Recorded | ReferenceState::InMemory(_)
        )
    }

    /// Reads a reference that an earlier night finished, if there is one with a picture.
    fn read_reference(&mut self, index: usize) -> Result<Option<EndedRun>, String> {
        let Some(run) = self
            .history
            .finished_run(self.plan, CellRef::Reference(index))
        else {
            return Ok(None);
        };
        let image = self
            .history
            .image(self.plan, index)
            .map_err(|e| e.to_string())?;
        let Some(image) = image else { return Ok(None) };
        self.recent_reference = Some((index, Arc::new(image)));
        Ok(Some(EndedRun::cached(run)))
    }

    /// Returns the picture of a reference, which must have the given size.
    pub(super) fn reference_image(
        &mut self,
        index: usize,
        size: Option<[u32; 2]>,
    ) -> Result<SharedImage, String> {
        let image = match (&self.references[index], &self.recent_reference) {
            (ReferenceState::Unavailable(reason), _) => {
                return Err(format!("its reference is not available: {reason}"));
            }
            (ReferenceState::InMemory(image), _) => Arc::clone(image),
            (_, Some((recent, image))) if *recent == index => Arc::clone(image),
            _ => match self.history.image(self.plan, index) {
                Ok(Some(image)) => Arc::new(image),
                Ok(None) => {
                    return Err(
                        "its reference is not available: it was deleted during the night"
                            .to_owned(),
                    );
                }
                Err(error) => return Err(format!("its reference cannot be read: {error}")),
            },
        };
        self.recent_reference = Some((index, Arc::clone(&image)));
        match size {
            Some([width, height]) if [width, height] != [image.width, image.height] => {
                Err(format!(
                    "the picture has {width}x{height} pixels but its reference {}x{}",
                    image.width, image.height
                ))
            }
            _ => Ok(image),
        }
    }
}
