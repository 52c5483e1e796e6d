//! Reports of one or several nights: figures, tables and data, computed from the nights' results
//! without rendering.
//!
//! A [`Study`] groups the runs of all nights. Each other module makes one kind of [`ReportItem`]
//! from it; [`requested`] makes what a script requests of its own night. Pictures are read through the callback [`Pictures`], since nothing in this module
//! accesses the disk.

mod bias;
mod cite;
mod convergence;
mod crops;
mod films;
mod heat;
pub(super) mod item;
mod methods;
mod page;
mod pgfplots;
mod presentation;
pub mod requested;
pub(super) mod series;
mod snapshots;
pub(super) mod study;
mod sweep;
mod tables;
mod tidy;
mod times;
mod verdict;

use std::path::{Path, PathBuf};

pub use item::{ItemKind, ReportItem};
pub use study::{Member, ReportOptions, Study};
pub use verdict::{answer, clocks};

use lumbre_light::film::Image;
use lumbre_night::experiment::spec::FigureX;

/// Errors of building a report.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum ReportError {
    /// No nights were given.
    #[error("no night was given, so there is nothing to report")]
    Nothing,
    /// An option names an axis that no night has.
    #[error("unknown axis `{axis}`; the axes are: {known}")]
    NoAxis {
        /// Name of the requested axis.
        axis: String,
        /// Names of the axes.
        known: String,
    },
    /// An option names a metric column that no night has.
    #[error("unknown metric column `{column}`; the columns are: {known}")]
    NoColumn {
        /// Name of the requested column.
        column: String,
        /// Names of the columns.
        known: String,
    },
    /// The device of one of several nights is unknown, so its times cannot be compared.
    #[error(
        "the device of {} is unknown (it has no env.json, or no finished run with a device), so \
         its times cannot be compared with those of another night. Report it alone, or name all \
         nights with --name",
        folder.display()
    )]
    NoDevice {
        /// Folder of the night.
        folder: PathBuf,
    },
    /// A figure could not be drawn.
    #[error(transparent)]
    Output(#[from] super::OutputError),
}

/// Callback that reads and decodes a picture file, or returns an error message.
pub type Pictures<'a> = dyn Fn(&Path, Option<&str>) -> Result<Image, String> + 'a;

/// Callback that reads a file, or returns an error message.
pub type Bytes<'a> = dyn Fn(&Path) -> Result<Vec<u8>, String> + 'a;

/// Callbacks to the program that a report needs.
pub struct ReportContext<'a> {
    /// Reads a picture, or a group of channels of its file such as `Bounces`.
    pub pictures: &'a Pictures<'a>,
    /// Reads any other file of a run.
    pub bytes: &'a Bytes<'a>,
    /// Descriptions of everything read so far that does not match its checksum, which is left out.
    pub problems: &'a dyn Fn() -> Vec<String>,
    /// Returns the relative URL of a file or folder as seen from the report's page.
    pub link: &'a dyn Fn(&Path) -> String,
    /// Returns the command that renders the run in a folder again.
    pub command: &'a dyn Fn(&Path) -> String,
    /// Command that makes the report again, to which the page appends options of crops.
    pub again: &'a str,
    /// Number of this state of the night, if a server has the page of newer states too.
    pub live: Option<u64>,
}

/// A complete report.
#[derive(Debug)]
pub struct Report {
    /// Items in reading order.
    pub items: Vec<ReportItem>,
    /// Notes on what was left out and why.
    pub notes: Vec<String>,
}

/// Returns the data of a study as CSV files: its runs, their measurements, and what the columns mean.
pub fn data(study: &Study) -> Vec<ReportItem> {
    tidy::all(study)
}

/// Builds a report of a study.
///
/// # Errors
/// Returns an error if an option names an unknown axis or column, or a figure cannot be drawn. A
/// missing picture becomes a note.
pub fn build(
    study: &Study,
    options: &ReportOptions,
    context: &ReportContext,
) -> Result<Report, ReportError> {
    let mut notes = study.notes.clone();
    let mut items = requested::items(study);
    let files = requested::RunFiles {
        pictures: context.pictures,
        bytes: context.bytes,
    };
    items.extend(requested::sheets(study.nights, files, false, &mut notes)?);
    for x in FigureX::ALL.iter().copied() {
        for metric in 0..study.metrics.len() {
            items.extend(convergence::figures(study, metric, x));
        }
    }
    items.extend(sweep::all(study, options, &mut notes)?);
    items.extend(crops::all(study, options, context.pictures, &mut notes)?);
    items.extend(films::all(study, context.pictures, &mut notes)?);
    items.extend(times::all(study, context.pictures, &mut notes)?);
    items.extend(heat::all(study, options)?);
    items.extend(tables::all(study, options, &mut notes)?);
    items.extend(tidy::all(study));
    items.extend(methods::items(study));
    let verdict = verdict::Verdict::new(study, &items, context.pictures);
    items.extend(verdict.item(study));
    let page = page::item(study, &items, &verdict, context, &mut notes)?;
    items.push(page);
    Ok(Report { items, notes })
}

#[cfg(test)]
mod tests;
