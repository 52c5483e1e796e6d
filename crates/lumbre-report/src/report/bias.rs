//! Bias of a study: denoised pictures, and references that are rendered by biased techniques.

use std::collections::BTreeSet;

use super::series::BIASED;
use super::study::Study;
use lumbre_night::experiment::night::reference::biased_reference;
use lumbre_render::denoise;

impl Study<'_> {
    /// Marks the labels of the series whose pictures are all denoised.
    pub(super) fn mark_biased_series(&mut self) {
        for series in 0..self.series.len() {
            let mut members = (0..self.facets.len()).flat_map(|facet| self.members(facet, series));
            if members.all(|m| m.run.denoise.is_some()) {
                self.series[series].label += BIASED;
                self.series[series].short_label += BIASED;
            }
        }
    }

    /// Returns sentences for captions on what is biased: denoised pictures, and references.
    pub fn bias_sentences(&self) -> impl Iterator<Item = String> {
        let denoised = self.is_denoised().then(|| denoise::BIAS.to_owned());
        denoised.into_iter().chain(self.biased_references())
    }

    /// Returns whether pictures of the study are denoised.
    pub fn is_denoised(&self) -> bool {
        self.all().any(|m| m.run.denoise.is_some())
    }

    /// Returns a sentence for each biased technique of references.
    pub fn biased_references(&self) -> Vec<String> {
        let nights = self.nights.iter();
        let biased: BTreeSet<_> = nights.flat_map(|n| n.biased_references()).collect();
        let sentence = |biased| format!("Warning: {}.", biased_reference(biased));
        biased.into_iter().map(sentence).collect()
    }
}
