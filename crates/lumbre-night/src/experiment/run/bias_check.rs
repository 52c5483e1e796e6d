//! Bias checks of a night: each pair of references is compared as soon as both are available.

use std::sync::Arc;

use super::active_run::RunRequest;
use super::attempt::AttemptError;
use super::open::{advance, catch_panic};
use super::state::{NightRunner, ReferenceEstimate};
use super::summary::Disagreement;
use super::waves::SLICE_S;
use crate::experiment::bias_check::{BiasCheckResult, check_bias};
use crate::experiment::event::Event;
use crate::experiment::night::reference::BiasCheckSummary;
use crate::experiment::outcome::{CellRef, Level};
use crate::experiment::plan::{BiasCheck, ReferenceSource, identity};
use lumbre_light::film::ztest::Estimate;
use lumbre_light::film::{Film, Image};
use lumbre_render::{Advance, WaveStats};

impl NightRunner<'_, '_> {
    /// Stores the estimate of a rendered reference until the other side of its bias check is
    /// available.
    pub(super) fn store_estimate(&mut self, reference: usize, film: &Film) {
        if self.bias_checks.contains_key(&reference) {
            self.estimates
                .insert(reference, ReferenceEstimate::of_film(film));
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
            let at_first = compare(&a, &b, rate)?;
            let again = if at_first.agrees() {
                None
            } else {
                let again = self.compare_again([(first, a.samples), (with, b.samples)], rate);
                // An alarm that cannot be confirmed stands.
                again.or_else(|problem| {
                    let text = format!("the difference cannot be confirmed: {problem}");
                    self.emit_message(Level::Warn, cell, text)?;
                    Ok::<_, String>(None)
                })?
            };
            let confirms = again.is_some();
            let found = Arc::new(again.unwrap_or_else(|| at_first.clone()));
            let mut text = found.describe();
            if confirms {
                text += &format!(
                    "; with a quarter of the samples and other seeds: {}",
                    at_first.describe()
                );
            }
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

    /// Renders both sides of a bias check again, with four times the samples and other seeds, and
    /// compares these pictures: no test allows for all that rare bright paths can do, so an alarm
    /// counts only if it is found twice. Returns `None` if a side is a file, if its samples are not
    /// known, or if the night is to stop.
    fn compare_again(
        &mut self,
        sides: [(usize, Option<u64>); 2],
        rate: f64,
    ) -> Result<Option<BiasCheckResult>, String> {
        let mut estimates = Vec::new();
        for (reference, samples) in sides {
            let Some(samples) = samples else {
                return Ok(None);
            };
            let Some(film) = self.render_again(reference, 4 * samples)? else {
                return Ok(None);
            };
            estimates.push(ReferenceEstimate::of_film(&film));
        }
        compare(&estimates[0], &estimates[1], rate).map(Some)
    }

    /// Renders a reference with other seeds, without recording it.
    fn render_again(&mut self, reference: usize, samples: u64) -> Result<Option<Film>, String> {
        let plan = self.plan;
        let ReferenceSource::Render {
            config,
            scene,
            seeds,
            stop,
            ..
        } = &plan.references[reference].source
        else {
            return Ok(None);
        };
        let cell = CellRef::Reference(reference);
        let text = "differs, so it is rendered again with four times the samples";
        self.emit_message(Level::Warn, cell, text.to_owned())?;
        let seeds = identity::confirming_seeds(*seeds);
        let request = RunRequest {
            cell,
            config,
            scene,
            seeds: &seeds,
            stop: stop.clone(),
            shard: None,
            reference: None,
            resolution: None,
        };
        let compiled = self.compiled(&request)?;
        let opened = self.open(&request, &compiled, None);
        let mut renderer = Some(opened.map_err(AttemptError::into_reason)?);
        let mut done = WaveStats::default();
        while done.samples < samples {
            if self.control.stop_requested() || self.deadline_passed() {
                return Ok(None);
            }
            let next = done.samples_in(SLICE_S).min(samples - done.samples);
            let stats = advance(&mut renderer, &Advance::by(next));
            done.add(&stats.map_err(AttemptError::into_reason)?);
        }
        Ok(renderer.map(|renderer| renderer.film().clone()))
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
        let run = self
            .history
            .finished_run(self.plan, CellRef::Reference(reference));
        Ok(ReferenceEstimate {
            mean: Arc::new(mean),
            variance: Arc::new(noise),
            samples: run.and_then(|run| Some(run.rows.last()?.samples)),
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

impl ReferenceEstimate {
    /// Returns the estimate that a film holds.
    fn of_film(film: &Film) -> ReferenceEstimate {
        ReferenceEstimate {
            mean: Arc::new(film.mean()),
            variance: Arc::new(film.variance_of_mean()),
            samples: Some(film.samples),
        }
    }
}

/// Compares the pictures of two techniques.
fn compare(
    a: &ReferenceEstimate,
    b: &ReferenceEstimate,
    rate: f64,
) -> Result<BiasCheckResult, String> {
    let [x, y] = [a, b].map(|side| Estimate {
        mean: &side.mean,
        variance: &side.variance,
    });
    catch_panic("comparing references", || check_bias(x, y, rate))
}
