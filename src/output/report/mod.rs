//! Reports: figures, tables and data of whole nights, made from what their folders say, without rendering.
//!
//! [`Study`] sorts runs; every other file here makes one kind of [`Item`] of it. Pictures are asked for through
//! [`Pictures`], because nothing in this room touches the disk.

mod convergence;
mod crops;
pub(super) mod curve;
mod films;
mod grid;
mod heat;
mod item;
mod latex;
mod methods;
mod page;
mod pgfplots;
mod shots;
pub(super) mod study;
mod sweep;
mod tables;
mod tidy;
mod times;

use std::path::{Path, PathBuf};

pub use item::{Item, Kind, PROGRAM, Provenance};
pub use study::{Member, Options, Study};

use crate::experiment::spec::FigureX;
use crate::film::Image;

/// Why there is no report.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReportError {
    /// There is nothing to report on.
    #[error("no night was given, or none has a run that was measured")]
    Nothing,
    /// An axis that is not there.
    #[error("no axis is called `{axis}` (axes: {known})")]
    NoAxis {
        /// What was asked for.
        axis: String,
        /// What there is.
        known: String,
    },
    /// A column that is not measured.
    #[error("no metric column is called `{column}` (columns: {known})")]
    NoColumn {
        /// What was asked for.
        column: String,
        /// What there is.
        known: String,
    },
    /// Times of unknown origin beside others.
    #[error(
        "{} does not say on what device it rendered (it has no env.json, or no finished run with a device): its times \
         cannot be drawn beside those of another night without naming both devices. Report it alone, or name every \
         night with --name",
        folder.display()
    )]
    NoDevice {
        /// The night's folder.
        folder: PathBuf,
    },
    /// Something could not be drawn.
    #[error(transparent)]
    Output(#[from] super::OutputError),
}

/// Where pictures come from: reads and decodes a file, or says for people why it cannot.
pub type Pictures<'a> = dyn Fn(&Path) -> Result<Image, String> + 'a;

/// What a report needs of the world around it.
pub struct Surroundings<'a> {
    /// Reads pictures.
    pub pictures: &'a Pictures<'a>,
    /// The address of a folder or file as seen from the report's page.
    pub link: &'a dyn Fn(&Path) -> String,
    /// The command that renders the run in a folder again.
    pub command: &'a dyn Fn(&Path) -> String,
}

/// A whole report.
#[derive(Debug)]
pub struct Report {
    /// Its parts, in the order in which a reader wants them.
    pub items: Vec<Item>,
    /// What was left out and why, in sentences.
    pub notes: Vec<String>,
}

/// Makes a report of a study.
///
/// # Errors
/// When an option names something that is not there, or a figure cannot be drawn. A picture that is missing becomes a
/// note.
pub fn build(study: &Study, options: &Options, around: &Surroundings) -> Result<Report, ReportError> {
    let mut notes = study.notes.clone();
    let mut items = Vec::new();
    for x in [FigureX::RenderS, FigureX::Samples] {
        for metric in 0..study.metrics.len() {
            items.extend(convergence::figures(study, metric, x));
        }
    }
    items.extend(sweep::all(study, options, &mut notes)?);
    items.extend(crops::all(study, options, around.pictures, &mut notes)?);
    items.extend(films::all(study, around.pictures, &mut notes)?);
    items.extend(times::all(study, around.pictures, &mut notes)?);
    items.extend(heat::all(study, options)?);
    items.extend(tables::all(study, options, &mut notes)?);
    items.extend(tidy::all(study));
    items.push(methods::item(study));
    let page = page::item(study, &items, around, &mut notes);
    items.push(page);
    Ok(Report { items, notes })
}

#[cfg(test)]
mod tests;
