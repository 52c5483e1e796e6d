//! Citations in the text of a report: `[Veach 1997, 9.2; Kajiya 1986]` becomes `\cite` in LaTeX,
//! with the entries in `references.bib`.

use crate::latex;

/// All works that can be cited, as BibTeX entries below a comment with their citation.
const LIBRARY: &str = include_str!("references.bib");

/// A work that can be cited.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Work {
    /// Citation in texts: authors and year.
    citation: &'static str,
    /// Key of the entry.
    key: &'static str,
    /// Entry in BibTeX.
    entry: &'static str,
}

/// Returns all works, in the order of the library.
fn works() -> impl Iterator<Item = Work> {
    LIBRARY.split("\n\n").filter_map(|block| {
        let (citation, entry) = block.strip_prefix("% ")?.split_once('\n')?;
        let (_, rest) = entry.strip_prefix('@')?.split_once('{')?;
        Some(Work {
            citation,
            key: rest.split(',').next()?,
            entry,
        })
    })
}

/// Piece of a text.
#[derive(Clone, Debug, PartialEq)]
enum Piece<'a> {
    Text(&'a str),
    /// Works with the cited places; a place is empty where the whole work is cited.
    Citations(Vec<(Work, &'a str)>),
}

/// Splits a text into citations of known works and other text. Any other text in brackets stays
/// text.
fn pieces(text: &str) -> Vec<Piece<'_>> {
    let mut pieces = Vec::new();
    let mut rest = text;
    let mut from = 0;
    while let Some(open) = rest[from..].find('[').map(|at| from + at) {
        let Some(length) = rest[open + 1..].find(']') else {
            break;
        };
        let close = open + 1 + length;
        match citations(&rest[open + 1..close]) {
            Some(citations) => {
                pieces.push(Piece::Text(&rest[..open]));
                pieces.push(Piece::Citations(citations));
                (rest, from) = (&rest[close + 1..], 0);
            }
            None => from = open + 1,
        }
    }
    pieces.push(Piece::Text(rest));
    pieces
}

/// Parses the content of brackets. Returns `None` unless all of it cites known works.
fn citations(inside: &str) -> Option<Vec<(Work, &str)>> {
    let cited = inside.split("; ").map(|part| {
        let (citation, place) = part.split_once(", ").unwrap_or((part, ""));
        let work = works().find(|work| work.citation == citation)?;
        Some((work, place))
    });
    cited.collect()
}

/// Converts a text to LaTeX.
pub fn latex(text: &str) -> String {
    let piece = |piece| match piece {
        Piece::Text(text) => latex::escape(text),
        Piece::Citations(cited) => {
            let cite = |(work, place): &(Work, &str)| match *place {
                "" => format!("\\cite{{{}}}", work.key),
                place => format!("\\cite[{}]{{{}}}", latex::escape(place), work.key),
            };
            cited.iter().map(cite).collect::<Vec<_>>().join(", ")
        }
    };
    pieces(text).into_iter().map(piece).collect()
}

/// Returns the citations in a text as they are written there, in brackets, in order. It is empty if
/// there are none.
pub fn in_brackets(text: &str) -> String {
    let cited = pieces(text).into_iter().filter_map(|piece| match piece {
        Piece::Text(_) => None,
        Piece::Citations(cited) => Some(cited),
    });
    let one = |(work, place): (Work, &str)| match place {
        "" => work.citation.to_owned(),
        place => format!("{}, {place}", work.citation),
    };
    let all: Vec<String> = cited.flatten().map(one).collect();
    if all.is_empty() {
        String::new()
    } else {
        format!("[{}]", all.join("; "))
    }
}

/// Returns the BibTeX entries of the works that some texts cite, in the order of the library.
pub fn bibliography<'a>(texts: impl Iterator<Item = &'a str>) -> String {
    let texts: Vec<Vec<Piece>> = texts.map(pieces).collect();
    let is_cited = |work: &Work| {
        let cites = |piece: &Piece| match piece {
            Piece::Text(_) => false,
            Piece::Citations(cited) => cited.iter().any(|(w, _)| w.key == work.key),
        };
        texts.iter().flatten().any(cites)
    };
    let entries = works().filter(is_cited).map(|work| work.entry.trim_end());
    entries.map(|entry| format!("{entry}\n\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lumbre_light::transport::integrator::INTEGRATORS;
    use lumbre_metrics::METRICS;
    use std::collections::BTreeSet;

    #[test]
    fn known_works_are_cited_and_other_brackets_stay() {
        let text = "a_b [Veach 1997, 9.2; Kajiya 1986] in [0, 1] and [Unknown 1900]";
        assert_eq!(
            latex(text),
            "a\\_b \\cite[9.2]{veach1997}, \\cite{kajiya1986} in [0, 1] and [Unknown 1900]"
        );
        assert_eq!(in_brackets(text), "[Veach 1997, 9.2; Kajiya 1986]");
        assert_eq!(in_brackets("a [b"), "");
        let entries = bibliography([text].into_iter());
        assert_eq!(entries.matches('@').count(), 2);
        assert!(entries.contains("@phdthesis{veach1997,") && entries.contains("{kajiya1986,"));
    }

    #[test]
    fn every_citation_of_metrics_and_integrators_has_an_entry() {
        let docs = METRICS.iter().map(|row| row.doc);
        for doc in docs.chain(INTEGRATORS.iter().map(|row| row.doc)) {
            for piece in pieces(doc) {
                if let Piece::Text(text) = piece {
                    let has_year = |inside: &str| {
                        let mut digits = inside.split(|c: char| !c.is_ascii_digit());
                        digits.any(|word| word.len() == 4)
                    };
                    let brackets = text.split('[').skip(1);
                    let unknown = brackets.filter_map(|rest| rest.split(']').next());
                    let unknown: Vec<&str> = unknown.filter(|inside| has_year(inside)).collect();
                    assert!(unknown.is_empty(), "no entry for {unknown:?} of: {doc}");
                }
            }
        }
    }

    #[test]
    fn entries_are_works_of_the_bibliography_with_keys_of_their_own() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs/bibliography.md");
        let bibliography = std::fs::read_to_string(path).unwrap();
        assert_eq!(works().count(), LIBRARY.matches("\n@").count());
        let keys: BTreeSet<&str> = works().map(|work| work.key).collect();
        assert_eq!(keys.len(), works().count());
        for work in works() {
            let (_, title) = work.entry.split_once("title = {").unwrap();
            let title = title.split("},\n").next().unwrap();
            let title = title.replace(['{', '}'], "").replace(['`', '\''], "\"");
            let plain = bibliography.replace('\'', "\"");
            assert!(plain.contains(&title), "{title} is not in the bibliography");
            let (_, year) = work.citation.rsplit_once(' ').unwrap();
            assert!(work.entry.contains(&format!("year = {{{year}}}")), "{year}");
        }
    }
}
