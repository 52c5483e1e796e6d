//! What a report consists of, and where each part of it comes from.

use std::collections::BTreeSet;

use super::grid::Grid;
use super::study::Member;
use crate::experiment::evidence::Night;
use crate::output::plot;
use crate::output::{OutputError, pdf};

/// The program that writes.
pub const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

/// What kind of thing an item is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A figure.
    Figure,
    /// A table.
    Table,
    /// Data or text.
    Data,
}

/// One figure, table or text of a report.
#[derive(Clone, Debug)]
pub struct Item {
    /// What it is.
    pub kind: Kind,
    /// Its files' path without extension, relative to the report's folder, with `/`.
    pub stem: String,
    /// A few words.
    pub title: String,
    /// What it shows, in sentences.
    pub caption: String,
    /// The drawing, from which PNG and PDF are made; `None` where there is none.
    pub svg: Option<String>,
    /// The table, of which the page makes its own.
    pub grid: Option<Box<Grid>>,
    /// Further files: extension and content.
    pub extra: Vec<(&'static str, Vec<u8>)>,
    /// What it was made of.
    pub provenance: Provenance,
}

impl Item {
    /// Its files: path and content. A drawing is written as SVG, PNG and PDF.
    ///
    /// # Errors
    /// When the drawing cannot become a PNG or PDF.
    pub fn files(&self) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
        let mut files = Vec::new();
        if let Some(svg) = &self.svg {
            files.push((format!("{}.svg", self.stem), svg.as_bytes().to_vec()));
            files.push((format!("{}.png", self.stem), plot::rasterize(svg)?));
            files.push((format!("{}.pdf", self.stem), pdf::from_svg(svg)?));
        }
        let named =
            |(extension, bytes): &(&'static str, Vec<u8>)| (format!("{}.{extension}", self.stem), bytes.clone());
        files.extend(self.extra.iter().map(named));
        Ok(files)
    }
}

/// Which runs of which plans something shows, and which program made it of them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Name and hash of every plan.
    pub plans: Vec<(String, String)>,
    /// Id and readable path of every run, in the order of the plans.
    pub runs: Vec<(String, String)>,
}

impl Provenance {
    /// That of some runs; a run counts once, and what has not been measured not at all.
    pub fn of<'a>(members: impl IntoIterator<Item = Member<'a>>) -> Provenance {
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
        let plan = (night.name.clone(), night.plan.clone());
        if !self.plans.contains(&plan) {
            self.plans.push(plan);
        }
    }

    /// One line for the program, one for each plan, and one for each run: what files carry inside and
    /// [`Provenance::parse`] reads back.
    pub fn text(&self) -> String {
        let plans = self.plans.iter().map(|(name, hash)| format!("\nplan {name} {hash}"));
        let runs = self.runs.iter().map(|(id, path)| format!("\nrun {id} {path}"));
        std::iter::once(PROGRAM.to_owned()).chain(plans).chain(runs).collect()
    }

    /// The same as comment lines that begin with `mark`.
    pub fn comment(&self, mark: &str) -> String {
        self.text().lines().map(|line| format!("{mark}{line}\n")).collect()
    }

    /// The ids of the runs that a text names in lines that contain `run <32 hex digits>`, each once, in order.
    pub fn parse(text: &str) -> Vec<String> {
        let mut runs: Vec<String> = Vec::new();
        for line in text.lines() {
            let mut words = line.split(|c: char| !c.is_ascii_alphanumeric()).filter(|w| !w.is_empty()).peekable();
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
        let (a, b) = ("0123456789abcdef0123456789abcdef", "ffffffffffffffffffffffffffffffff");
        let provenance = Provenance {
            plans: vec![("night".to_owned(), "3f9a".to_owned())],
            runs: vec![(a.to_owned(), "scene=box/rep=0".to_owned()), (b.to_owned(), String::new())],
        };
        for mark in ["", "% ", "# ", "<!-- "] {
            assert_eq!(Provenance::parse(&provenance.comment(mark)), [a, b]);
        }
        assert_eq!(Provenance::parse(&format!("run 12ab\nrun {a}\nrun {a}")), [a]);
        assert!(Provenance::parse("a run of luck").is_empty());
    }
}
