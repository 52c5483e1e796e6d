//! Warnings about a plan that are probable mistakes of a script.

use std::collections::{BTreeMap, BTreeSet};

use super::{Cell, Reference, ReferenceSource};
use crate::experiment::night::reference::biased_reference;
use crate::text::counted;
use lumbre_light::transport::integrator::bias_of;

/// Samples of a reference divided by those of a cell below which its noise is a large part of the
/// cell's error: at 4, a fifth of a squared error.
const SAMPLES_OF_A_REFERENCE: u64 = 4;

/// Returns a warning about references with hardly more samples than the cells measured against
/// them, by the same integrator: their own noise would be a large part of every error.
pub(super) fn short_references(cells: &[Cell], references: &[Reference]) -> Option<String> {
    let is_short = |cell: &&Cell| {
        let reference = cell.reference.map(|index| &references[index].source);
        let Some(ReferenceSource::Render { config, stop, .. }) = reference else {
            return false;
        };
        let samples = cell.stop.sample_limit().zip(stop.sample_limit());
        config.integrator == cell.config.integrator
            && samples.is_some_and(|(cell, own)| own < SAMPLES_OF_A_REFERENCE * cell)
    };
    let short = cells.iter().filter(is_short).count();
    (short > 0).then(|| {
        format!(
            "{short} of {} cells have a reference with less than {SAMPLES_OF_A_REFERENCE} \
             times their samples: much of their error will be its noise. Give references more \
             samples",
            cells.len()
        )
    })
}

/// Number of repeats below which a test over repeats rarely finds a difference.
const FEW_REPEATS: u32 = 3;

/// Returns a warning if integrators are compared at equal time with so few repeats that their
/// differences can hardly be tested.
pub(super) fn few_repeats(cells: &[Cell], repeats: u32) -> Option<String> {
    let is_compared = |cell: &&Cell| cell.reference.is_some() && cell.stop.time_limit_s().is_some();
    let integrators: BTreeSet<&str> = cells
        .iter()
        .filter(is_compared)
        .map(|cell| cell.config.integrator.as_str())
        .collect();
    (integrators.len() > 1 && repeats < FEW_REPEATS).then(|| {
        let plural = if repeats == 1 { "" } else { "s" };
        format!(
            "{} techniques are compared at equal time with {repeats} repeat{plural}, which can hardly tell whether \
             one is better: experiment(name, {{ repeats = 5 }}) would",
            integrators.len()
        )
    })
}

/// Returns a warning about cells whose pictures are denoised.
pub(super) fn denoised_cells(cells: &[Cell]) -> Option<String> {
    let denoised = |cell: &&Cell| cell.config.denoise.is_some();
    let count = cells.iter().filter(denoised).count();
    (count > 0).then(|| {
        format!(
            "{count} of {} cells are denoised, which makes them biased: part of their error does \
             not vanish with more samples",
            cells.len()
        )
    })
}

/// Returns a warning if several cells are the same run, which means that axes have no effect.
pub(super) fn duplicates(cells: &[Cell]) -> Option<String> {
    let mut by_run: BTreeMap<usize, Vec<&Cell>> = BTreeMap::new();
    for cell in cells {
        by_run.entry(cell.first).or_default().push(cell);
    }
    let groups: Vec<&Vec<&Cell>> = by_run.values().filter(|cells| cells.len() > 1).collect();
    let mut idle: BTreeSet<usize> = BTreeSet::new();
    for cells in &groups {
        let differs = |axis: &usize| {
            cells
                .iter()
                .any(|cell| cell.point[*axis].1 != cells[0].point[*axis].1)
        };
        idle.extend((0..cells[0].point.len()).filter(differs));
    }
    let name = |axis: usize| format!("`{}`", cells[0].point[axis].0);
    let names: Vec<String> = idle.into_iter().map(name).collect();
    let subject = match names.as_slice() {
        [] => return None,
        [one] => format!("axis {one} has"),
        _ => format!("axes {} have", names.join(", ")),
    };
    let same: usize = groups.iter().map(|cells| cells.len()).sum();
    Some(format!(
        "{subject} no effect in {same} of {} cells, which are {}",
        cells.len(),
        counted(groups.len() as u64, "run")
    ))
}
/// Describes, for each biased technique of references, what it does to comparisons; without a full
/// stop.
pub(super) fn biased_references(references: &[Reference]) -> Vec<String> {
    let biased = references.iter().filter_map(|r| match &r.source {
        ReferenceSource::Render { config, .. } => {
            Some((config.integrator.as_str(), bias_of(&config.integrator)?))
        }
        ReferenceSource::File { .. } => None,
    });
    let biased: BTreeSet<(&str, &str)> = biased.collect();
    biased.into_iter().map(biased_reference).collect()
}
