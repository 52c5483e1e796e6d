//! The noise floors of references, and the thresholds that they put out of reach.

use std::sync::Arc;

use super::cell::guard;
use super::night::Night;
use crate::experiment::event::{CellRef, Event, Level};
use crate::experiment::floors::{Floors, HalfImages, floors};
use crate::experiment::plan::unreachable;
use crate::film::{Image, SharedImage};

impl Night<'_, '_> {
    /// The noise floors of a reference, from the halves that the history keeps of it; empty where there are none.
    pub(super) fn floors_of(&mut self, reference: Option<(usize, &SharedImage)>) -> Result<Floors, String> {
        let Some((place, image)) = reference else { return Ok(Floors::default()) };
        if self.floors[place].is_none() {
            match self.history.halves(self.plan, place) {
                Ok(Some(halves)) => self.learn_floors(place, image, &halves)?,
                Ok(None) => self.floors[place] = Some(Floors::default()),
                Err(error) => {
                    self.floors[place] = Some(Floors::default());
                    let text = format!("how noisy the reference is cannot be told: {error}");
                    self.say(Level::Warn, CellRef::Reference(place), text)?;
                }
            }
        }
        Ok(self.floors[place].clone().unwrap_or_default())
    }

    /// Computes the floors of a reference, and warns of thresholds below them.
    pub(super) fn learn_floors(&mut self, place: usize, image: &Image, halves: &HalfImages) -> Result<(), String> {
        let metrics = &self.plan.measure.metrics;
        if metrics.is_empty() {
            return Ok(());
        }
        let floors = Arc::new(guard("measuring the reference", || floors(metrics, image, halves))?);
        self.floors[place] = Some(Arc::clone(&floors));
        for text in unreachable(self.plan, place, &floors) {
            self.say(Level::Warn, CellRef::Reference(place), text)?;
        }
        self.emit(&Event::Floors { reference: place, floors })
    }
}
