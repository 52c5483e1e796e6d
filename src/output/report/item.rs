//! Items of a report, and their provenance.

use std::collections::BTreeSet;

use super::grid::Grid;
use super::study::Member;
use crate::experiment::night_results::NightResults;
use crate::output::plot;
use crate::output::{OutputError, pdf};

/// Name and version of this program.
pub const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

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
    pub grid: Option<Box<Grid>>,
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
            grid: None,
            extra: Vec::new(),
            provenance,
        }
    }

    /// Returns path and content of all files. A drawing is exported as SVG, PNG and PDF.
    ///
    /// # Errors
    /// Returns an error if the drawing cannot be converted to PNG or PDF.
    pub fn files(&self) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
        let mut files = Vec::new();
        if let Some(svg) = &self.svg {
            files.push((format!("{}.svg", self.stem), svg.as_bytes().to_vec()));
            files.push((format!("{}.png", self.stem), plot::rasterize(svg)?));
            files.push((format!("{}.pdf", self.stem), pdf::from_svg(svg)?));
        }
        let named = |(extension, bytes): &(&'static str, Vec<u8>)| {
            (format!("{}.{extension}", self.stem), bytes.clone())
        };
        files.extend(self.extra.iter().map(named));
        Ok(files)
    }
}

/// Plans and runs that an item is made from. They are embedded in its files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Name and hash of every plan.
    pub plans: Vec<(String, String)>,
    /// Identity and readable path of every run, in plan order.
    pub runs: Vec<(String, String)>,
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

    fn add_plan(&mut self, night: &NightResults) {
        let plan = (night.name.clone(), night.plan.clone());
        if !self.plans.contains(&plan) {
            self.plans.push(plan);
        }
    }

    /// Formats the provenance as text with one line each for the program, the plans and the runs.
    /// [`Provenance::parse`] reads the run identities back.
    pub fn text(&self) -> String {
        let plans = self
            .plans
            .iter()
            .map(|(name, hash)| format!("\nplan {name} {hash}"));
        let runs = self
            .runs
            .iter()
            .map(|(id, path)| format!("\nrun {id} {path}"));
        std::iter::once(PROGRAM.to_owned())
            .chain(plans)
            .chain(runs)
            .collect()
    }

    /// Formats the provenance as comment lines that begin with `mark`.
    pub fn comment(&self, mark: &str) -> String {
        self.text()
            .lines()
            .map(|line| format!("{mark}{line}\n"))
            .collect()
    }

    /// Parses the run identities in a text: each word `run` followed by 32 hexadecimal digits. Each
    /// identity is returned once, in order.
    pub fn parse(text: &str) -> Vec<String> {
        let mut runs: Vec<String> = Vec::new();
        for line in text.lines() {
            let mut words = line
                .split(|c: char| !c.is_ascii_alphanumeric())
                .filter(|w| !w.is_empty())
                .peekable();
            while let Some(word) = words.next() {
                if word != "run" {
                    continue;
                }
                let is_id = |w: &&&str| w.len() == 32 && w.bytes().all(|b| b.is_ascii_hexdigit());
                if let Some(id) = words.peek().filter(is_id)
                    && !runs.iter().any(|r| r == id)
                {
                    runs.push((*id).to_owned());
                }
            }
        }
        runs
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_are_read_back_from_any_comment() {
        let (a, b) = (
            "0123456789abcdef0123456789abcdef",
            "ffffffffffffffffffffffffffffffff",
        );
        let provenance = Provenance {
            plans: vec![("night".to_owned(), "3f9a".to_owned())],
            runs: vec![
                (a.to_owned(), "scene=box/rep=0".to_owned()),
                (b.to_owned(), String::new()),
            ],
        };
        for mark in ["", "% ", "# ", "<!-- "] {
            assert_eq!(Provenance::parse(&provenance.comment(mark)), [a, b]);
        }
        assert_eq!(
            Provenance::parse(&format!("run 12ab\nrun {a}\nrun {a}")),
            [a]
        );
        assert!(Provenance::parse("a run of luck").is_empty());
    }
}
