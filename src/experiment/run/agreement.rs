//! Comparing references with second techniques, as soon as both are there.

use std::sync::Arc;

use super::Disagreement;
use super::night::Night;
use crate::experiment::agree::agree;
use crate::experiment::event::{CellRef, Event, Level};
use crate::experiment::plan::{Agree, ReferenceSource};
use crate::film::{Film, Image, SharedImage};
use crate::metrics::ztest::Estimate;

/// A reference as a comparison needs it.
#[derive(Clone)]
pub(super) struct Compared {
    mean: SharedImage,
    variance: SharedImage,
}

impl Night<'_, '_> {
    /// The comparisons of which a reference is one side: first, second, share of false discoveries.
    fn comparisons_of(&self, place: usize) -> Vec<(usize, Agree)> {
        let all = self.plan.references.iter().enumerate().filter_map(|(i, r)| Some((i, r.agree?)));
        all.filter(|(first, agree)| *first == place || agree.with == place).collect()
    }

    /// Keeps what a rendered reference's comparison needs until its other side is there.
    pub(super) fn remember(&mut self, place: usize, film: &Film) {
        if !self.comparisons_of(place).is_empty() {
            let (mean, variance) = (Arc::new(film.mean()), Arc::new(film.variance_of_mean()));
            self.compared.insert(place, Compared { mean, variance });
        }
    }

    /// Makes the comparisons that became possible when a reference was ready. What cannot be compared is said, and what
    /// was found counts even where nobody could record it.
    pub(super) fn compare(&mut self, place: usize) {
        if self.options.begin.is_some() {
            return;
        }
        if let Err(problem) = self.comparisons(place) {
            let text = format!("its comparison could not be recorded: {problem}");
            // Whoever could not record it may not be able to hear of that either.
            let _ = self.say(Level::Error, CellRef::Reference(place), text);
        }
    }

    fn comparisons(&mut self, place: usize) -> Result<(), String> {
        for (first, Agree { with, rate }) in self.comparisons_of(place) {
            if !(self.is_ready(first) && self.is_ready(with)) {
                continue;
            }
            let cell = CellRef::Reference(first);
            let sides = self.side(first).and_then(|a| Ok((a, self.side(with)?)));
            let (a, b) = match sides {
                Ok(sides) => sides,
                Err(problem) => {
                    self.say(
                        Level::Warn,
                        cell,
                        format!("it cannot be compared with {}: {problem}", self.technique(with)),
                    )?;
                    continue;
                }
            };
            let [x, y] = [&a, &b].map(|side| Estimate { mean: &side.mean, variance: &side.variance });
            let found = Arc::new(super::cell::guard("comparing references", || agree(x, y, rate))?);
            let text = found.describe();
            if found.agrees() {
                self.say(Level::Info, cell, format!("agrees with {}: {text}", self.technique(with)))?;
            } else {
                let text = format!("DISAGREES with {}: {text}", self.technique(with));
                self.summary.disagreements.push(Disagreement { reference: first, with, found: text.clone() });
                self.say(Level::Error, cell, text)?;
            }
            self.emit(&Event::Agreement { reference: first, with, found })?;
            // A side may be wanted again by another comparison; the history has it then.
            self.compared.remove(&first);
            self.compared.remove(&with);
        }
        Ok(())
    }

    /// One side of a comparison, from memory or from what is kept.
    fn side(&self, place: usize) -> Result<Compared, String> {
        if let Some(side) = self.compared.get(&place) {
            return Ok(side.clone());
        }
        let missing = || format!("the noise of {} is not known", self.technique(place));
        let mean = self.history.image(self.plan, place).map_err(|e| e.to_string())?.ok_or_else(missing)?;
        let mut noise: Image = self.history.noise(self.plan, place).map_err(|e| e.to_string())?.ok_or_else(missing)?;
        if [noise.width, noise.height] != [mean.width, mean.height] {
            return Err(format!("the noise of {} has another size than its picture", self.technique(place)));
        }
        noise.data.as_flattened_mut().iter_mut().for_each(|x| *x *= *x);
        Ok(Compared { mean: Arc::new(mean), variance: Arc::new(noise) })
    }

    /// The name of the technique of a reference, for people.
    fn technique(&self, place: usize) -> String {
        match &self.plan.references[place].source {
            ReferenceSource::Render { config, .. } => format!("`{}`", config.integrator),
            ReferenceSource::File { file, .. } => file.display().to_string(),
        }
    }
}
