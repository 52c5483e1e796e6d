//! Program, plans and runs that a file is made from.

use lumbre_night::text::program;

/// Plans and runs that figures, tables and data are made from. They are embedded in
/// the files.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Provenance {
    /// Name and hash of every plan.
    pub plans: Vec<(String, String)>,
    /// Identity and readable path of every run, in plan order.
    pub runs: Vec<(String, String)>,
}

impl Provenance {
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
        std::iter::once(program().to_owned())
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

    /// Formats the provenance as a comment of Markdown and HTML, whose end it cannot contain.
    pub fn markup_comment(&self) -> String {
        format!("<!--\n{}\n-->\n", self.text().replace("--", "- -"))
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
