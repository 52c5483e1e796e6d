//! Finds the blocks of planted bugs in the sources of the product, and replaces their marks.
//!
//! Code is compared by tokens: words and single other characters. Whitespace, lines that are
//! comments, and commas before a closing bracket do not count, so that neither rustfmt nor a
//! reworded comment makes an entry outdated.
//!
//! Only the standard library is used, since a test in `tests/library/laws/` includes this file.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::Path;

use super::list::{Bug, Piece};

/// Separates tokens in compact text. No source contains it.
const SEPARATOR: char = '\u{1}';

/// A source file of the product.
pub struct Source {
    /// Path from the root, with `/`.
    pub path: String,
    /// The text.
    pub text: String,
    tokens: Tokens,
}

/// The tokens of a text.
struct Tokens {
    /// All tokens, each between separators.
    compact: String,
    /// Start of each token in the compact text.
    starts: Vec<usize>,
    /// Place of each token in the text.
    places: Vec<Range<usize>>,
}

/// A piece of source code to replace.
pub struct Edit {
    /// Index of the source.
    pub source: usize,
    /// Bytes to replace; empty to insert code.
    pub range: Range<usize>,
    /// Index of the bug.
    pub bug: usize,
    /// The code with the bug.
    pub wrong: String,
    /// Whether the code is a statement or a block, and not an expression.
    pub statement: bool,
}

impl Source {
    /// Splits the text of a file into tokens.
    pub fn new(path: String, text: String) -> Self {
        let tokens = Tokens::of(&text);
        Self { path, text, tokens }
    }
}

/// Reads all Rust files below `src` and `crates/*/src`, sorted by path.
///
/// # Errors
/// Returns a message if a folder or a file cannot be read.
pub fn sources(root: &Path) -> Result<Vec<Source>, String> {
    let message = |path: &Path, e: std::io::Error| format!("{}: {e}", path.display());
    let crates = root.join("crates");
    let members = std::fs::read_dir(&crates).map_err(|e| message(&crates, e))?;
    let mut open: Vec<_> = members.flatten().map(|m| m.path().join("src")).collect();
    open.retain(|folder| folder.is_dir());
    open.push(root.join("src"));
    let mut found = Vec::new();
    while let Some(folder) = open.pop() {
        let entries = std::fs::read_dir(&folder).map_err(|e| message(&folder, e))?;
        for path in entries.flatten().map(|entry| entry.path()) {
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|e| e == "rs") {
                let text = std::fs::read_to_string(&path).map_err(|e| message(&path, e))?;
                let name = path.strip_prefix(root).unwrap_or(&path).to_string_lossy();
                found.push(Source::new(name.replace('\\', "/"), text));
            }
        }
    }
    found.sort_by(|a, b| a.path.cmp(&b.path));
    Ok(found)
}

/// Finds the blocks of all bugs.
///
/// # Errors
/// Returns a message for each bug whose block does not occur exactly once, and for each pair of bugs
/// that change the same code.
pub fn place(bugs: &[Bug], sources: &[Source]) -> Result<Vec<Edit>, String> {
    let (mut edits, mut problems) = (Vec::new(), Vec::new());
    for (index, bug) in bugs.iter().enumerate() {
        match place_one(index, bug, sources) {
            Ok(placed) => edits.extend(placed),
            Err(problem) => problems.push(format!("{} ({}.txt): {problem}", bug.name, bug.room)),
        }
    }
    edits.sort_by_key(|edit: &Edit| (edit.source, edit.range.start, edit.range.end, edit.bug));
    for pair in edits.windows(2) {
        let [a, b] = pair else { continue };
        let same = a.source == b.source && a.range == b.range && a.statement == b.statement;
        if a.source == b.source && b.range.start < a.range.end && !same {
            problems.push(format!(
                "{} and {} change overlapping code in {}: choose other marks",
                bugs[a.bug].name, bugs[b.bug].name, sources[a.source].path
            ));
        }
    }
    match problems.is_empty() {
        true => Ok(edits),
        false => Err(problems.join("\n")),
    }
}

/// Finds the block of a bug.
fn place_one(index: usize, bug: &Bug, sources: &[Source]) -> Result<Vec<Edit>, String> {
    let (mut text, mut marks) = (String::new(), Vec::new());
    for piece in &bug.block {
        match piece {
            Piece::Kept(code) => text.push_str(code),
            Piece::Mark { right, wrong } => {
                let start = text.len();
                text.push_str(right);
                marks.push((start..text.len(), wrong));
            }
        }
    }
    let wanted = Tokens::of(&text);
    let (source, first) = find_once(&wanted, sources)?;
    let found = &sources[source].tokens.places[first..first + wanted.places.len()];
    let edit = |(range, wrong): (Range<usize>, &String)| {
        let before = wanted.places.partition_point(|t| t.end <= range.start);
        let after = wanted.places.partition_point(|t| t.start < range.end);
        let whole = wanted
            .places
            .get(before)
            .is_none_or(|t| t.start >= range.start)
            && after
                .checked_sub(1)
                .is_none_or(|last| wanted.places[last].end <= range.end);
        if !whole {
            return Err("a mark splits a word".to_owned());
        }
        let place = if before < after {
            found[before].start..found[after - 1].end
        } else {
            // Nothing is replaced: the code is inserted after the token before the mark.
            let end = before
                .checked_sub(1)
                .map_or(found[0].start, |last| found[last].end);
            end..end
        };
        let is_statement = |code: &str| code.is_empty() || code.ends_with([';', '}']);
        Ok(Edit {
            source,
            range: place,
            bug: index,
            wrong: wrong.clone(),
            statement: is_statement(wrong) && is_statement(&text[range]),
        })
    };
    marks.into_iter().map(edit).collect()
}

/// Returns the source that contains the tokens, and the index of the first of them.
fn find_once(wanted: &Tokens, sources: &[Source]) -> Result<(usize, usize), String> {
    let mut found = Vec::new();
    for (index, source) in sources.iter().enumerate() {
        for (at, _) in source.tokens.compact.match_indices(&wanted.compact) {
            // The match begins with the separator in front of the first token.
            let first = source.tokens.starts.partition_point(|start| *start <= at);
            found.push((index, first));
        }
    }
    match found.as_slice() {
        [one] => Ok(*one),
        [] => Err(
            "its block is nowhere in the sources. The code was changed: write the block as \
                   the code is now, with the same mistake in the marks, or remove the entry if the \
                   mistake is no longer possible"
                .to_owned(),
        ),
        all => {
            let paths: Vec<&str> = all.iter().map(|(i, _)| sources[*i].path.as_str()).collect();
            Err(format!(
                "its block occurs {} times, in {}: write more lines of the code around the marks",
                all.len(),
                paths.join(", ")
            ))
        }
    }
}

/// Returns the texts of the sources that bugs change, with all bugs in them, by path.
pub fn planted(bugs: &[Bug], sources: &[Source], edits: &[Edit]) -> BTreeMap<String, String> {
    let mut texts = BTreeMap::new();
    // From the end, so that the places of earlier edits stay.
    let mut groups: Vec<&[Edit]> = edits
        .chunk_by(|a, b| a.source == b.source && a.range == b.range)
        .collect();
    groups.reverse();
    for group in groups {
        let (source, range) = (&sources[group[0].source], group[0].range.clone());
        let mut code = String::new();
        for Edit { bug, wrong, .. } in group {
            let number = bugs[*bug].number();
            code += &format!("if lumbre_planted::on({number}) {{ {wrong} }} else ");
        }
        code += &format!("{{ {} }}", &source.text[range.clone()]);
        if !group[0].statement {
            code = format!("({code})");
        }
        let text: &mut String = texts
            .entry(source.path.clone())
            .or_insert_with(|| source.text.clone());
        text.replace_range(range, &format!(" {code} "));
    }
    texts
}

impl Tokens {
    /// Splits a text. A comma at its end is left out, since a closing bracket may follow.
    fn of(text: &str) -> Self {
        let mut places = Vec::new();
        let mut line_start = 0;
        for line in text.split_inclusive('\n') {
            if !line.trim_start().starts_with("//") {
                line_tokens(line, line_start, &mut places);
            }
            line_start += line.len();
        }
        let is = |place: &Range<usize>, chars: &str| chars.contains(&text[place.clone()]);
        let kept = (0..places.len())
            .filter(|i| {
                let closes = places.get(i + 1).is_none_or(|next| is(next, ")]}"));
                !(closes && is(&places[*i], ","))
            })
            .map(|i| places[i].clone())
            .collect();
        Self::joined(text, kept)
    }

    /// Joins tokens to a compact text.
    fn joined(text: &str, places: Vec<Range<usize>>) -> Self {
        let (mut compact, mut starts) = (String::from(SEPARATOR), Vec::new());
        for place in &places {
            starts.push(compact.len());
            compact += &text[place.clone()];
            compact.push(SEPARATOR);
        }
        Self {
            compact,
            starts,
            places,
        }
    }
}

/// Appends the tokens of a line that begins at a place of its text.
fn line_tokens(line: &str, line_start: usize, places: &mut Vec<Range<usize>>) {
    let mut in_word = false;
    for (at, c) in line.char_indices() {
        let (start, end) = (line_start + at, line_start + at + c.len_utf8());
        let word = c.is_alphanumeric() || c == '_';
        match places.last_mut() {
            Some(last) if word && in_word => last.end = end,
            _ if !c.is_whitespace() => places.push(start..end),
            _ => {}
        }
        in_word = word;
    }
}
