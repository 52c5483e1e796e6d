//! References: taken as they are found, rendered, or joined from their parts.

use std::sync::Arc;
use std::time::{Duration, Instant};

use super::cell::{Ended, Work};
use super::night::{Look, Night};
use super::parts::Whole;
use crate::experiment::event::{CellRef, Event, Level, Outcome};
use crate::experiment::floors::HalfImages;
use crate::experiment::parts::Part;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::standing::Claim;
use crate::film::SharedImage;

/// A reference as far as the night has come.
pub(super) enum Truth {
    /// Not looked at yet.
    Ahead,
    /// Recorded; the history gives its picture.
    Recorded,
    /// Rendered, but the history does not keep it.
    Held(SharedImage),
    /// Not to be had; the text says why.
    Lost(String),
}

/// How long it is believed that another process has a reference while cells that need it are gone through.
const BELIEF: Duration = Duration::from_secs(5);

impl<'a> Night<'a, '_> {
    /// Looks at a reference, and renders it if that is to be done here.
    pub(super) fn reference(&mut self, place: usize) -> Look<'a> {
        let cell = CellRef::Reference(place);
        if self.is_settled(cell) {
            return Look::Ended;
        }
        if let Some((whose, at)) = self.away.get(&place)
            && at.elapsed() < BELIEF
        {
            return Look::Elsewhere(whose.clone());
        }
        let plan = self.plan;
        match &plan.references[place].source {
            ReferenceSource::File { file, .. } => {
                let ended = match self.history.image(plan, place) {
                    Ok(Some(image)) => {
                        self.recent = Some((place, Arc::new(image)));
                        Ended::only(Outcome::Cached(file.clone()))
                    }
                    Ok(None) => Ended::failed(format!("no image was found in {}", file.display())),
                    Err(error) => Ended::failed(error.to_string()),
                };
                let outcome = self.finish(cell, ended);
                self.truths[place] = if let Outcome::Cached(_) = outcome { Truth::Recorded } else { lost(&outcome) };
            }
            ReferenceSource::Render { config, scene, seeds, stop, .. } => {
                let stop = stop.clone();
                let work = Work { cell, config, scene, seeds, stop, part: None, reference: None, resolution: None };
                match self.rendered_reference(place, &work) {
                    Ok(truth) => {
                        self.truths[place] = truth;
                        self.compare(place);
                    }
                    Err(whose) => {
                        self.away.insert(place, (whose.clone(), Instant::now()));
                        return Look::Elsewhere(whose);
                    }
                }
            }
        }
        Look::Ended
    }

    /// The error says who else renders it.
    fn rendered_reference(&mut self, place: usize, work: &Work<'a>) -> Result<Truth, String> {
        if let Some(truth) = self.reference_that_is_there(place, work) {
            return Ok(truth);
        }
        let parts = self.plan.references[place].parts(place);
        loop {
            if let Some(ended) = self.render_parts(work, &parts)? {
                let outcome = self.finish(work.cell, ended);
                if let Outcome::Failed(_) = outcome {
                    // The others need not find out for themselves.
                    self.history.release(self.plan, work.cell.into());
                }
                return Ok(lost(&outcome));
            }
            match self.history.claim(self.plan, work.cell.into()) {
                Ok(Claim::Ours) => {}
                Ok(Claim::Theirs(whose) | Claim::Never(whose)) => return Err(whose),
                Err(error) => return Ok(lost(&self.finish(work.cell, Ended::failed(error.to_string())))),
            }
            // Between the look and the claim, another process may have finished it.
            let truth = match self.reference_that_is_there(place, work) {
                Some(truth) => Some(truth),
                None => self.new_reference(place, work, &parts),
            };
            self.history.release(self.plan, work.cell.into());
            if let Some(truth) = truth {
                return Ok(truth);
            }
        }
    }

    fn reference_that_is_there(&mut self, place: usize, work: &Work<'_>) -> Option<Truth> {
        match self.recorded_reference(place) {
            Ok(Some(ended)) => Some(match self.finish(work.cell, ended) {
                Outcome::Cached(_) => Truth::Recorded,
                outcome => lost(&outcome),
            }),
            Ok(None) => None,
            Err(problem) => {
                let text = format!("the reference that was there is rendered again: {problem}");
                let reason = self.say(Level::Warn, work.cell, text).err()?;
                Some(lost(&self.finish(work.cell, Ended::failed(reason))))
            }
        }
    }

    /// A reference that is rendered now, or joined from its parts; nothing if one of those has to be rendered again.
    fn new_reference(&mut self, place: usize, work: &Work<'a>, parts: &[Part]) -> Option<Truth> {
        if parts.is_empty() {
            let ended = self.perform(work.clone());
            return Some(self.recorded(place, work, ended));
        }
        match self.join(work, parts) {
            Whole::Missing(_) => None,
            Whole::Failed(reason) => Some(lost(&self.finish(work.cell, Ended::failed(reason)))),
            Whole::Joined(whole) => {
                let (ended, ground) = *whole;
                let truth = self.recorded(place, work, ended);
                if !matches!(truth, Truth::Lost(_)) {
                    self.keep_joined(work, parts, ground.as_ref());
                }
                Some(truth)
            }
        }
    }

    /// Has a reference recorded that has ended.
    fn recorded(&mut self, place: usize, work: &Work<'a>, mut ended: Ended) -> Truth {
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
                return lost(&self.finish(work.cell, Ended::failed(reason)));
            }
        }
        let outcome = self.finish(work.cell, ended);
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
        Ok(Some(Ended::cached(run)))
    }

    /// The picture of a reference, which must have the given size.
    pub(super) fn truth(&mut self, place: usize, size: Option<[u32; 2]>) -> Result<SharedImage, String> {
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
}

/// A reference that has ended otherwise.
pub(super) fn lost(outcome: &Outcome) -> Truth {
    Truth::Lost(match outcome {
        Outcome::Failed(reason) => reason.clone(),
        Outcome::Interrupted => "it was given up".to_owned(),
        Outcome::Done(_) | Outcome::Cached(_) => "it has no picture".to_owned(),
    })
}
