//! Items of a report, and their provenance.

use std::collections::BTreeSet;

use super::study::Member;
use crate::plot;
use crate::provenance::Provenance;
use crate::table::Table;
use crate::{OutputError, pdf};
use lumbre_night::experiment::night::Night;

/// Extensions of the files of a drawing.
const DRAWN: [&str; 3] = ["svg", "png", "pdf"];

/// Kind of an item of a report.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ItemKind {
    /// Figure, with a drawing.
    Figure,
    /// Table, with its cells.
    Table,
    /// Data or text.
    Data,
}

/// One figure, table or text of a report, with its files.
#[derive(Clone, Debug)]
pub struct ReportItem {
    /// Kind of the item.
    pub kind: ItemKind,
    /// Heading of the page under which a figure or table is listed; empty for data.
    pub section: String,
    /// Path of its files without extension, relative to the report's folder, with `/` as separator.
    pub stem: String,
    /// Short title of the item.
    pub title: String,
    /// Caption in full sentences.
    pub caption: String,
    /// Drawing, which is exported as SVG, PNG and PDF; `None` if there is none.
    pub svg: Option<String>,
    /// Table data, from which the HTML page builds its table.
    pub table: Option<Box<Table>>,
    /// Further files as extension and content.
    pub extra: Vec<(&'static str, Vec<u8>)>,
    /// Runs and plans that the item is made from.
    pub provenance: Provenance,
}

impl ReportItem {
    /// Creates a figure without further files.
    pub fn figure(
        section: &str,
        stem: String,
        title: String,
        caption: String,
        svg: String,
        provenance: Provenance,
    ) -> ReportItem {
        ReportItem {
            kind: ItemKind::Figure,
            section: section.to_owned(),
            stem,
            title,
            caption,
            svg: Some(svg),
            table: None,
            extra: Vec::new(),
            provenance,
        }
    }

    /// Creates data or text with its files.
    pub fn data(
        stem: &str,
        title: &str,
        caption: String,
        files: Vec<(&'static str, Vec<u8>)>,
        provenance: Provenance,
    ) -> ReportItem {
        ReportItem {
            kind: ItemKind::Data,
            section: String::new(),
            stem: stem.to_owned(),
            title: title.to_owned(),
            caption,
            svg: None,
            table: None,
            extra: files,
            provenance,
        }
    }

    /// Creates a table with its files.
    pub fn table(table: Table) -> ReportItem {
        let extra = vec![
            ("md", table.to_markdown().into_bytes()),
            ("csv", table.to_long_csv().into_bytes()),
            ("tex", table.to_latex().into_bytes()),
        ];
        ReportItem {
            kind: ItemKind::Table,
            section: table.section.clone(),
            stem: format!("tables/{}", table.name),
            title: table.title.clone(),
            caption: table.caption.clone(),
            svg: None,
            extra,
            provenance: table.provenance.clone(),
            table: Some(Box::new(table)),
        }
    }

    /// Returns the extensions of all files, in the order of [`ReportItem::files`].
    pub fn extensions(&self) -> Vec<&'static str> {
        let drawn = self.svg.iter().flat_map(|_| DRAWN);
        drawn.chain(self.extra.iter().map(|(e, _)| *e)).collect()
    }

    /// Returns path and content of all files. A drawing is exported as SVG, PNG and PDF.
    ///
    /// # Errors
    /// Returns an error if the drawing cannot be converted to PNG or PDF.
    pub fn files(&self) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
        let mut contents = Vec::new();
        if let Some(svg) = &self.svg {
            contents = vec![
                svg.as_bytes().to_vec(),
                plot::rasterize(svg)?,
                pdf::from_svg(svg)?,
            ];
        }
        contents.extend(self.extra.iter().map(|(_, bytes)| bytes.clone()));
        let names = self
            .extensions()
            .into_iter()
            .map(|e| format!("{}.{e}", self.stem));
        Ok(names.zip(contents).collect())
    }
}

impl Provenance {
    /// Collects the provenance of some runs. Each run is listed once; runs without measurements are
    /// skipped.
    pub fn from_members<'a>(members: impl IntoIterator<Item = Member<'a>>) -> Provenance {
        let mut provenance = Provenance::default();
        let mut seen = BTreeSet::new();
        for Member { night, run, .. } in members {
            provenance.add_plan(night);
            if !run.rows.is_empty() && seen.insert(run.id.clone()) {
                provenance.runs.push((run.id.clone(), run.path.clone()));
            }
        }
        provenance
    }

    fn add_plan(&mut self, night: &Night) {
        let plan = (night.plan.name.clone(), night.plan.hash.clone());
        if !self.plans.contains(&plan) {
            self.plans.push(plan);
        }
    }
}
