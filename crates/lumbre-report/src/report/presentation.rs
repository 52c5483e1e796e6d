//! Presentation of a study as its script sets it: labels and styles of series, and the tone map of
//! pictures.

use std::collections::BTreeSet;

use super::series::Series;
use super::study::{Member, Study};
use crate::exposure;
use crate::plot::figure::SeriesEntry;
use crate::plot::style::{self, Colour, Style};
use lumbre_light::film::Image;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::night::Night;
use lumbre_night::experiment::night::run::Run;

impl Study<'_> {
    /// Returns the colour that the script gives to a run's series by one of its compared values.
    pub(super) fn series_colour(&self, night: &Night, run: &Run) -> Option<Colour> {
        let compared = self.by.iter().filter_map(|axis| run.axis_value(axis));
        let mut values = compared.chain([run.integrator.clone()]);
        values.find_map(|value| night.plan.report.colour(&value).and_then(Colour::parse))
    }

    /// Returns the name that the script gives to an axis value, or the value.
    pub fn name(&self, value: &str) -> String {
        let night = self.nights.first();
        night.map_or_else(|| value.to_owned(), |night| night.plan.report.name(value))
    }

    /// Returns the names of the values of a facet.
    pub fn facet_values(&self, facet: usize) -> Vec<String> {
        let values = self.facets[facet].iter();
        values.map(|value| self.name(value)).collect()
    }

    /// Returns the tone map of pictures in figures, if the script sets one.
    pub fn display(&self) -> Option<Tonemap> {
        self.nights
            .first()
            .and_then(|night| night.plan.report.display)
    }

    /// Returns the tone map at which a figure shows a picture and those beside it.
    pub fn display_of(&self, image: &Image) -> Tonemap {
        self.display().unwrap_or_else(|| exposure::automatic(image))
    }

    /// Sets the styles of all series: that of its technique where each has another one, or else by
    /// their order. A colour of the script replaces that of the style.
    pub(super) fn set_styles(&mut self) {
        let mut firsts: Vec<Option<Member>> = vec![None; self.series.len()];
        let mut is_mixed = false;
        for (member, (_, _, series)) in self.all().zip(self.run_positions()) {
            let first = firsts[series].get_or_insert(member);
            is_mixed |= first.run.integrator != member.run.integrator;
        }
        let firsts: Vec<Member> = firsts.into_iter().flatten().collect();
        let names: Vec<&str> = firsts.iter().map(|m| m.run.integrator.as_str()).collect();
        let colour = |m: &Member| self.series_colour(m.night, m.run);
        let colours: Vec<Option<Colour>> = firsts.iter().map(colour).collect();
        let distinct: BTreeSet<&str> = names.iter().copied().collect();
        let styles: Vec<Style> = if is_mixed || distinct.len() < self.series.len() {
            (0..self.series.len()).map(style::style).collect()
        } else {
            style::of_techniques(&names)
        };
        for ((series, style), colour) in self.series.iter_mut().zip(styles).zip(colours) {
            series.style = style.coloured(colour);
        }
    }

    /// Returns the series as figures show them.
    pub fn entries(&self) -> Vec<SeriesEntry> {
        let entry = |series: &Series| SeriesEntry {
            label: series.full_label(),
            style: series.style,
        };
        self.series.iter().map(entry).collect()
    }
}
