//! Noise floors of references, and warnings about thresholds below them or passed at once.

use std::sync::Arc;

use super::open::catch_panic;
use super::state::NightRunner;
use crate::experiment::event::Event;
use crate::experiment::noise_floor::{HalfImages, NoiseFloors, floors};
use crate::experiment::outcome::{CellRef, Level, WaveRow};
use crate::experiment::plan::unreachable_thresholds;
use crate::experiment::stop::StopRule;
use lumbre_light::film::{Image, SharedImage};

/// Share of pixels without noise in a reference above which a warning is given, once a night.
const MOST_BACKGROUND: f64 = 0.5;

impl NightRunner<'_, '_> {
    /// Returns the noise floors of a reference, computed from its stored halves; empty if there are
    /// none.
    pub(super) fn noise_floors(
        &mut self,
        reference: Option<(usize, &SharedImage)>,
    ) -> Result<NoiseFloors, String> {
        let Some((reference, image)) = reference else {
            return Ok(NoiseFloors::default());
        };
        if self.floors[reference].is_none() {
            match self.history.halves(self.plan, reference) {
                Ok(Some(halves)) => self.compute_noise_floors(reference, image, &halves)?,
                Ok(None) => self.floors[reference] = Some(NoiseFloors::default()),
                Err(error) => {
                    self.floors[reference] = Some(NoiseFloors::default());
                    let text = format!("the noise of the reference is not known: {error}");
                    self.emit_message(Level::Warn, CellRef::Reference(reference), text)?;
                }
            }
        }
        Ok(self.floors[reference].clone().unwrap_or_default())
    }

    /// Warns, once a night, of a run that its first measurement ended, past a threshold of its rule:
    /// such runs compare what the first samples cost.
    pub(super) fn warn_of_threshold(
        &mut self,
        cell: CellRef,
        rule: &StopRule,
        rows: &[WaveRow],
    ) -> Result<(), String> {
        let [first] = rows else {
            return Ok(());
        };
        let columns = self.plan.columns();
        let mut passed = None;
        rule.visit(&mut |rule| {
            if let StopRule::When {
                column, op, value, ..
            } = rule
                && let Some(metric) = columns.iter().position(|c| c == column)
                && first
                    .metrics
                    .get(metric)
                    .is_some_and(|x| op.holds(*x, *value))
            {
                passed = Some(format!("{column} {} {value}", op.symbol()));
            }
        });
        match passed {
            Some(threshold) if !self.is_threshold_noted => {
                self.is_threshold_noted = true;
                let text = format!(
                    "`{threshold}` held at the first measurement ({} spp): the time to it is that of \
                     these samples. Choose a stricter threshold",
                    first.samples
                );
                self.emit_message(Level::Warn, cell, text)
            }
            _ => Ok(()),
        }
    }

    /// Computes the noise floors of a reference, and warns about thresholds below them.
    pub(super) fn compute_noise_floors(
        &mut self,
        reference: usize,
        image: &Image,
        halves: &HalfImages,
    ) -> Result<(), String> {
        let metrics = &self.plan.measure.metrics;
        if metrics.is_empty() {
            return Ok(());
        }
        let floors = Arc::new(catch_panic("measuring the reference", || {
            floors(metrics, image, halves)
        })?);
        self.floors[reference] = Some(Arc::clone(&floors));
        let [black, coloured] = halves.shares_without_noise();
        if black + coloured > MOST_BACKGROUND && !self.is_background_noted {
            self.is_background_noted = true;
            let text = format!(
                "{:.0} % of the reference has no noise ({}): metrics are means over all pixels, so \
                 they hardly see the rest",
                100.0 * (black + coloured),
                match (black > 0.0, coloured > 0.0) {
                    (true, true) => "background, and black pixels that may be unlit so far",
                    (true, false) => "black: background, or pixels that no path has lit so far",
                    _ => "background of one colour",
                }
            );
            self.emit_message(Level::Warn, CellRef::Reference(reference), text)?;
        }
        for text in unreachable_thresholds(self.plan, &self.measured[reference], &floors) {
            self.emit_message(Level::Warn, CellRef::Reference(reference), text)?;
        }
        self.emit(&Event::NoiseFloors { reference, floors })
    }
}
