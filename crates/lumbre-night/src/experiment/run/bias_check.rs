//! Bias checks of a night: each pair of references is compared as soon as both are available.

use std::sync::Arc;

use super::open::catch_panic;
use super::state::{NightRunner, ReferenceEstimate};
use super::summary::Disagreement;
use crate::experiment::bias_check::check_bias;
use crate::experiment::event::Event;
use crate::experiment::night::reference::BiasCheckSummary;
use crate::experiment::outcome::{CellRef, Level};
use crate::experiment::plan::{BiasCheck, ReferenceSource};
use lumbre_light::film::ztest::Estimate;
use lumbre_light::film::{Film, Image};

impl NightRunner<'_, '_> {
    /// Stores the estimate of a rendered reference until the other side of its bias check is
    /// available.
    pub(super) fn store_estimate(&mut self, reference: usize, film: &Film) {
        if self.bias_checks.contains_key(&reference) {
            let (mean, variance) = (Arc::new(film.mean()), Arc::new(film.variance_of_mean()));
            self.estimates
                .insert(reference, ReferenceEstimate { mean, variance });
        }
    }

    /// Carries out the bias checks that are possible now that a reference is available. Failures
    /// are reported; a disagreement counts even if no sink could record it.
    pub(super) fn check_bias(&mut self, reference: usize) {
        if self.options.start.is_some() {
            return;
        }
        if let Err(problem) = self.try_check_bias(reference) {
            let text = format!("the bias check could not be recorded: {problem}");
            // The sink that failed may fail again.
            let _ = self.emit_message(Level::Error, CellRef::Reference(reference), text);
        }
    }

    fn try_check_bias(&mut self, reference: usize) -> Result<(), String> {
        let checks = self.bias_checks.get(&reference).cloned();
        for (first, BiasCheck { with, rate }) in checks.unwrap_or_default() {
            if !(self.is_available(first) && self.is_available(with)) {
                continue;
            }
            let cell = CellRef::Reference(first);
            let sides = self
                .estimate(first)
                .and_then(|a| Ok((a, self.estimate(with)?)));
            let (a, b) = match sides {
                Ok(sides) => sides,
                Err(problem) => {
                    self.emit_message(
                        Level::Warn,
                        cell,
                        format!(
                            "it cannot be compared with {}: {problem}",
                            self.technique(with)
                        ),
                    )?;
                    continue;
                }
            };
            let [x, y] = [&a, &b].map(|side| Estimate {
                mean: &side.mean,
                variance: &side.variance,
            });
            let found = Arc::new(catch_panic("comparing references", || {
                check_bias(x, y, rate)
            })?);
            let text = found.describe();
            if found.agrees() {
                self.emit_message(
                    Level::Info,
                    cell,
                    format!("agrees with {}: {text}", self.technique(with)),
                )?;
            } else {
                let text = format!("DISAGREES with {}: {text}", self.technique(with));
                self.summary.disagreements.push(Disagreement {
                    reference: first,
                    with,
                    found: text.clone(),
                });
                self.emit_message(Level::Error, cell, text)?;
            }
            let check = BiasCheckSummary {
                technique: self.integrator(with).to_owned(),
                agrees: found.agrees(),
                finding: found.describe(),
            };
            self.emit(&Event::BiasCheck {
                reference: first,
                check,
                compared: Some((with, found)),
            })?;
            // Another bias check that needs one of them reads it from the history.
            self.estimates.remove(&first);
            self.estimates.remove(&with);
        }
        Ok(())
    }

    /// Returns one side of a bias check, from memory or from the history.
    fn estimate(&self, reference: usize) -> Result<ReferenceEstimate, String> {
        if let Some(estimate) = self.estimates.get(&reference) {
            return Ok(estimate.clone());
        }
        let missing = || format!("the noise of {} is not known", self.technique(reference));
        let mean = self
            .history
            .image(self.plan, reference)
            .map_err(|e| e.to_string())?
            .ok_or_else(missing)?;
        let mut noise: Image = self
            .history
            .noise(self.plan, reference)
            .map_err(|e| e.to_string())?
            .ok_or_else(missing)?;
        if [noise.width, noise.height] != [mean.width, mean.height] {
            return Err(format!(
                "the noise image of {} has another size than its picture",
                self.technique(reference)
            ));
        }
        noise
            .data
            .as_flattened_mut()
            .iter_mut()
            .for_each(|x| *x *= *x);
        Ok(ReferenceEstimate {
            mean: Arc::new(mean),
            variance: Arc::new(noise),
        })
    }

    /// Returns the integrator of a reference, or `file`.
    fn integrator(&self, reference: usize) -> &str {
        match &self.plan.references[reference].source {
            ReferenceSource::Render { config, .. } => &config.integrator,
            ReferenceSource::File { .. } => "file",
        }
    }

    /// Returns the name of a reference's technique for messages.
    fn technique(&self, reference: usize) -> String {
        match &self.plan.references[reference].source {
            ReferenceSource::Render { config, .. } => format!("`{}`", config.integrator),
            ReferenceSource::File { file, .. } => file.display().to_string(),
        }
    }
}
