//! Plain words: comments, docs and messages use the field's terms, and every doc comment is a
//! sentence.

use super::source::{project_files, root, sources, text};

/// Words and phrases that the project does not use, with what to write instead.
const REFUSED: &[(&str, &str)] = &[
    ("whoever", "name the caller, process or user"),
    ("nobody", "no process, no user, nothing"),
    ("somebody", "name the caller, process or user"),
    ("anybody", "any process, any user"),
    ("goes alone", "runs on the scalar path"),
    ("go alone", "run on the scalar path"),
    ("hears", "receives"),
    ("is said", "is stated, is reported"),
    ("are said", "are stated, are reported"),
    ("says nothing", "has no effect, does not state"),
    ("is told", "is given, is informed"),
    ("are told", "are given, are informed"),
    ("held against", "compared with"),
    ("none of its business", "unrelated"),
    ("makes no sense", "is corrupt, is invalid"),
    ("the first source", "name the thesis"),
    ("the second source", "name the thesis"),
    ("the third source", "name the thesis"),
];

/// First words of a doc comment that make it a fragment.
const FRAGMENT_STARTS: [&str; 7] = ["Of", "With", "Where", "What", "Which", "How", "Who"];

/// Fewest words of a doc comment.
const FEWEST_WORDS: usize = 3;

/// Returns whether a file holds prose or messages of the project.
fn is_prose(path: &str) -> bool {
    const SUFFIXES: [&str; 14] = [
        ".rs", ".md", ".lua", ".glsl", ".comp", ".rgen", ".rchit", ".rahit", ".rmiss", ".rint",
        ".toml", ".sh", ".js", ".html",
    ];
    // This file quotes what it refuses.
    let quotes = path == "tests/library/laws/words.rs";
    !quotes && SUFFIXES.iter().any(|suffix| path.ends_with(suffix))
}

/// Words of a text in lower case with their line numbers, without comment markers and punctuation.
fn words_by_line(text: &str) -> Vec<(usize, String)> {
    let mut words = Vec::new();
    for (number, line) in text.lines().enumerate() {
        let split = line.split(|c: char| !(c.is_alphanumeric() || "_-'`".contains(c)));
        words.extend(
            split
                .filter(|w| !w.is_empty())
                .map(|w| (number + 1, w.to_lowercase())),
        );
    }
    words
}

/// Returns every place in `text` where a refused phrase stands as whole words, also over a line
/// break.
fn refused(text: &str) -> Vec<(usize, &'static str, &'static str)> {
    let words = words_by_line(text);
    let mut found = Vec::new();
    for (phrase, instead) in REFUSED {
        let wanted: Vec<&str> = phrase.split(' ').collect();
        let places = words.windows(wanted.len());
        let hits = places.filter(|w| w.iter().zip(&wanted).all(|((_, word), want)| word == want));
        found.extend(hits.map(|hit| (hit[0].0, *phrase, *instead)));
    }
    found
}

/// Returns the first paragraph of each doc comment with the number of its first line.
fn doc_paragraphs(source: &str) -> Vec<(usize, String)> {
    let mut found: Vec<(usize, String)> = Vec::new();
    let mut open = false;
    let mut skipping = false;
    for (number, line) in source.lines().enumerate() {
        let line = line.trim_start();
        let doc = line
            .strip_prefix("///")
            .or_else(|| line.strip_prefix("//!"));
        match doc.map(str::trim) {
            None => (open, skipping) = (false, false),
            Some("") => skipping = open,
            Some(_) if skipping => {}
            Some(words) if open => {
                if let Some((_, paragraph)) = found.last_mut() {
                    paragraph.push(' ');
                    paragraph.push_str(words);
                }
            }
            Some(words) => {
                found.push((number + 1, words.to_owned()));
                open = true;
            }
        }
    }
    found
}

/// Returns why a paragraph is not a sentence; `None` if it is one.
fn fault(paragraph: &str) -> Option<String> {
    let first = paragraph.split_whitespace().next().unwrap_or_default();
    if FRAGMENT_STARTS.contains(&first) {
        return Some(format!("starts with `{first}`"));
    }
    if paragraph.split_whitespace().count() < FEWEST_WORDS {
        return Some(format!("has fewer than {FEWEST_WORDS} words"));
    }
    let ends = ['.', ':', '?', '|', '`', ')', ']'];
    (!paragraph.ends_with(ends)).then(|| "does not end with a full stop".to_owned())
}

#[test]
fn comments_docs_and_messages_use_plain_words() {
    let mut found = Vec::new();
    for path in project_files() {
        let name = path
            .strip_prefix(root())
            .unwrap()
            .to_string_lossy()
            .replace('\\', "/");
        if !is_prose(&name) {
            continue;
        }
        for (line, phrase, instead) in refused(&text(&name)) {
            found.push(format!("{name}:{line}: `{phrase}` ({instead})"));
        }
    }
    assert!(
        found.is_empty(),
        "{} places:\n{}",
        found.len(),
        found.join("\n")
    );
}

#[test]
fn every_doc_comment_is_a_sentence() {
    let mut found = Vec::new();
    for file in sources() {
        for (line, paragraph) in doc_paragraphs(&text(&file)) {
            if let Some(fault) = fault(&paragraph) {
                found.push(format!("{file}:{line}: {fault}: {paragraph}"));
            }
        }
    }
    assert!(
        found.is_empty(),
        "{} doc comments:\n{}",
        found.len(),
        found.join("\n")
    );
}

#[test]
fn the_checks_find_refused_phrases_and_faulty_doc_comments() {
    assert_eq!(refused("Whoever reads it.\nIs nobody here?").len(), 2);
    assert!(refused("everybody_else, `whoever_comes`").is_empty());
    let source =
        "/// Of the run.\nfn a() {}\n/// Path.\nfn b() {}\n/// Returns the path\n///\n/// More";
    let faults: Vec<_> = doc_paragraphs(source)
        .iter()
        .filter_map(|(_, p)| fault(p))
        .collect();
    assert_eq!(faults.len(), 3, "{faults:?}");
    assert_eq!(fault("Returns the path of the run."), None);
}
