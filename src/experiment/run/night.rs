//! From the first event to the last: references, cells, and what becomes of them.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use super::agreement::Compared;
use super::cell::{Ended, Work};
use super::{CellResult, NightSummary, RunError, Seams};
use crate::experiment::event::{CellRef, Control, Event, History, Level, Outcome, Sink};
use crate::experiment::floors::{Floors, HalfImages};
use crate::experiment::plan::{Plan, ReferenceSource};
use crate::experiment::spec::ScriptHooks;
use crate::film::SharedImage;
use crate::scene::{CompiledScene, Note, SceneDesc};

/// A reference as far as the night has come.
enum Truth {
    /// Not looked at yet.
    Ahead,
    /// Recorded; the history gives its picture.
    Recorded,
    /// Rendered, but the history does not keep it.
    Held(SharedImage),
    /// Not to be had; the text says why.
    Lost(String),
}

/// A night in progress.
pub(super) struct Night<'a, 's> {
    pub(super) seams: &'a Seams<'a>,
    pub(super) plan: &'a Arc<Plan>,
    pub(super) hooks: &'a dyn ScriptHooks,
    pub(super) control: &'a Control,
    pub(super) threads: usize,
    pub(super) history: &'a dyn History,
    sinks: &'a mut [&'s mut dyn Sink],
    truths: Vec<Truth>,
    /// The reference that was used last: neighbouring cells mostly share it.
    recent: Option<(usize, SharedImage)>,
    /// The references that wait for the other side of a comparison.
    pub(super) compared: BTreeMap<usize, Compared>,
    /// The noise floors of the references as far as they are known.
    pub(super) floors: Vec<Option<Floors>>,
    /// The scene that was compiled last, and what it was compiled from.
    pub(super) compiled: Option<(Arc<SceneDesc>, Arc<CompiledScene>)>,
    /// What compiling has had to say, each once a night.
    pub(super) told: BTreeSet<Note>,
    pub(super) summary: NightSummary,
}

impl<'a, 's> Night<'a, 's> {
    pub(super) fn new(
        seams: &'a Seams<'a>,
        plan: &'a Arc<Plan>,
        hooks: &'a dyn ScriptHooks,
        history: &'a dyn History,
        sinks: &'a mut [&'s mut dyn Sink],
        control: &'a Control,
        threads: usize,
    ) -> Night<'a, 's> {
        Night {
            seams,
            plan,
            hooks,
            control,
            threads,
            history,
            sinks,
            truths: plan.references.iter().map(|_| Truth::Ahead).collect(),
            recent: None,
            compared: BTreeMap::new(),
            floors: vec![None; plan.references.len()],
            compiled: None,
            told: BTreeSet::new(),
            summary: NightSummary::default(),
        }
    }

    pub(super) fn carry_out(mut self) -> Result<NightSummary, RunError> {
        let started = Event::NightStarted { plan: Arc::clone(self.plan) };
        self.emit(&started).map_err(|reason| RunError::Start { reason })?;
        let references = (0..self.plan.references.len()).map(CellRef::Reference);
        for cell in references.chain((0..self.plan.cells.len()).map(CellRef::Cell)) {
            if self.control.stop_requested() {
                self.summary.interrupted = true;
                break;
            }
            // A request to give up that came too late for the cell before is not meant for this one.
            self.control.take_skip();
            match cell {
                CellRef::Reference(place) => self.reference(place),
                CellRef::Cell(place) => self.cell(place),
            }
        }
        match self.emit(&Event::NightFinished) {
            Ok(()) => Ok(self.summary),
            Err(reason) => Err(RunError::Finish { reason, summary: self.summary }),
        }
    }

    /// Tells every sink, even after one has failed; the first failure is returned.
    pub(super) fn emit(&mut self, event: &Event) -> Result<(), String> {
        let mut result = Ok(());
        for sink in self.sinks.iter_mut() {
            if let Err(error) = sink.hear(event) {
                result = result.and(Err(error.to_string()));
            }
        }
        result
    }

    /// A line for people. A sink that cannot record it fails the cell.
    pub(super) fn say(&mut self, level: Level, cell: CellRef, text: String) -> Result<(), String> {
        self.emit(&Event::Message { level, cell: Some(cell), text })
    }

    fn reference(&mut self, place: usize) {
        let cell = CellRef::Reference(place);
        let plan = self.plan;
        match &plan.references[place].source {
            ReferenceSource::File(file) => {
                let ended = match self.history.image(plan, place) {
                    Ok(Some(image)) => {
                        self.recent = Some((place, Arc::new(image)));
                        Ended::cached(file.clone(), Vec::new())
                    }
                    Ok(None) => Ended::failed(format!("no image was found in {}", file.display())),
                    Err(error) => Ended::failed(error.to_string()),
                };
                let outcome = self.finish(cell, ended, Floors::default());
                self.truths[place] = if let Outcome::Cached(_) = outcome { Truth::Recorded } else { lost(&outcome) };
            }
            ReferenceSource::Render { config, scene, seeds, stop, .. } => {
                let work = Work { cell, config, scene, seeds, stop, reference: None };
                self.truths[place] = self.rendered_reference(place, &work);
                if let Err(reason) = self.compare(place) {
                    self.truths[place] = lost(&self.finish(cell, Ended::failed(reason), Floors::default()));
                }
            }
        }
    }

    fn rendered_reference(&mut self, place: usize, work: &Work<'_>) -> Truth {
        match self.recorded_reference(place) {
            Ok(Some(ended)) => {
                return match self.finish(work.cell, ended, Floors::default()) {
                    Outcome::Cached(_) => Truth::Recorded,
                    outcome => lost(&outcome),
                };
            }
            Ok(None) => {}
            Err(problem) => {
                let text = format!("the reference that was there is rendered again: {problem}");
                if let Err(reason) = self.say(Level::Warn, work.cell, text) {
                    return lost(&self.finish(work.cell, Ended::failed(reason), Floors::default()));
                }
            }
        }
        let mut ended = self.perform(work);
        let image = ended.film.as_ref().map(|film| Arc::new(film.mean()));
        if let Some(film) = &ended.film {
            self.remember(place, film);
        }
        if let (Some(halves), Some(image)) = (ended.halves.take(), &image) {
            let images = HalfImages {
                means: [halves[0].mean(), halves[1].mean()],
                samples: [halves[0].samples, halves[1].samples],
            };
            let told = self.emit(&Event::Halves { reference: place, halves });
            if let Err(reason) = told.and_then(|()| self.learn_floors(place, image, &images)) {
                return lost(&self.finish(work.cell, Ended::failed(reason), Floors::default()));
            }
        }
        let outcome = self.finish(work.cell, ended, Floors::default());
        match (outcome, image) {
            (Outcome::Done(_), Some(image)) => {
                self.recent = Some((place, Arc::clone(&image)));
                // Many references of large pictures do not fit into memory, so one that can be read again is not held.
                match self.history.image(self.plan, place) {
                    Ok(Some(_)) => Truth::Recorded,
                    _ => Truth::Held(image),
                }
            }
            (outcome, _) => lost(&outcome),
        }
    }

    /// Whether a reference is there.
    pub(super) fn is_ready(&self, place: usize) -> bool {
        matches!(self.truths[place], Truth::Recorded | Truth::Held(_))
    }

    /// A reference that an earlier night finished, if its picture can be read.
    fn recorded_reference(&mut self, place: usize) -> Result<Option<Ended>, String> {
        let Some(run) = self.history.done(self.plan, CellRef::Reference(place)) else { return Ok(None) };
        let image = self.history.image(self.plan, place).map_err(|e| e.to_string())?;
        let Some(image) = image else { return Ok(None) };
        self.recent = Some((place, Arc::new(image)));
        Ok(Some(Ended::cached(run.folder, run.rows)))
    }

    fn cell(&mut self, place: usize) {
        let plan = self.plan;
        let it = &plan.cells[place];
        let cell = CellRef::Cell(place);
        if let Some(run) = self.history.done(plan, cell) {
            self.finish(cell, Ended::cached(run.folder, run.rows), run.floors);
            return;
        }
        let mut floors = Floors::default();
        let ended = match it.reference.map(|r| self.truth(r, it.config.resolution)).transpose() {
            Err(reason) => Ended::failed(reason),
            Ok(reference) => match self.floors_of(it.reference.zip(reference.as_ref())) {
                Err(reason) => Ended::failed(reason),
                Ok(known) => {
                    floors = known;
                    self.perform(&Work {
                        cell,
                        config: &it.config,
                        scene: &it.scene,
                        seeds: &[it.seed],
                        stop: &it.stop,
                        reference,
                    })
                }
            },
        };
        self.finish(cell, ended, floors);
    }

    /// The picture of a reference, which must have the given size.
    fn truth(&mut self, place: usize, size: Option<[u32; 2]>) -> Result<SharedImage, String> {
        let image = match (&self.truths[place], &self.recent) {
            (Truth::Lost(reason), _) => return Err(format!("its reference is missing: {reason}")),
            (Truth::Held(image), _) => Arc::clone(image),
            (_, Some((recent, image))) if *recent == place => Arc::clone(image),
            _ => match self.history.image(self.plan, place) {
                Ok(Some(image)) => Arc::new(image),
                Ok(None) => return Err("its reference is missing: it was there when the night began".to_owned()),
                Err(error) => return Err(format!("its reference cannot be read: {error}")),
            },
        };
        self.recent = Some((place, Arc::clone(&image)));
        match size {
            Some([width, height]) if [width, height] != [image.width, image.height] => Err(format!(
                "the picture has {width}x{height} pixels but its reference {}x{}",
                image.width, image.height
            )),
            _ => Ok(image),
        }
    }

    /// Tells how a cell ended and keeps it for the summary. If a sink cannot record it, it has failed after all.
    fn finish(&mut self, cell: CellRef, ended: Ended, floors: Floors) -> Outcome {
        let Ended { mut outcome, film, layers, rows, halves: _ } = ended;
        let rows = Arc::new(rows);
        let event = Event::CellFinished { cell, outcome: outcome.clone(), film, layers, rows: Arc::clone(&rows) };
        if let Err(reason) = self.emit(&event) {
            let reason = format!("it could not be recorded: {reason}");
            // The sink that failed may fail again; the others still hear of it, and the summary has the reason.
            let _ = self.say(Level::Error, cell, reason.clone());
            outcome = Outcome::Failed(reason);
        }
        if outcome == Outcome::Interrupted && self.control.stop_requested() {
            self.summary.interrupted = true;
        }
        self.summary.results.push(CellResult { cell, outcome: outcome.clone(), rows, floors });
        outcome
    }
}

fn lost(outcome: &Outcome) -> Truth {
    Truth::Lost(match outcome {
        Outcome::Failed(reason) => reason.clone(),
        Outcome::Interrupted => "it was given up".to_owned(),
        Outcome::Done(_) | Outcome::Cached(_) => "it has no picture".to_owned(),
    })
}
