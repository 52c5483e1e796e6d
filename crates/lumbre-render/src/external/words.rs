//! Command lines as lists of words, and the placeholders in them. No shell is involved: a word is
//! one argument of the program, whatever characters its placeholders are replaced by.

use std::collections::BTreeMap;

use lumbre_light::value::suggest;

/// Greatest number of words of a command, and greatest length of one in bytes.
const MAX_WORDS: usize = 256;
const MAX_LENGTH: usize = 8192;

/// Splits a command line into words at white space. Single and double quotes enclose words with
/// white space; there are no escapes, variables or patterns.
///
/// # Errors
/// Returns a message for a quote that is not closed.
pub fn split(line: &str) -> Result<Vec<String>, String> {
    let mut words = Vec::new();
    let mut word: Option<String> = None;
    let mut quote = None;
    for c in line.chars() {
        match (quote, c) {
            (Some(open), _) if c == open => quote = None,
            (Some(_), _) => word.get_or_insert_default().push(c),
            (None, '"' | '\'') => {
                quote = Some(c);
                word.get_or_insert_default();
            }
            (None, _) if c.is_whitespace() => words.extend(word.take()),
            (None, _) => word.get_or_insert_default().push(c),
        }
    }
    if let Some(open) = quote {
        return Err(format!("the quote {open} is not closed"));
    }
    words.extend(word);
    Ok(words)
}

/// Part of a word.
enum Piece<'a> {
    Text(&'a str),
    Placeholder(&'a str),
}

/// Splits a word at its placeholders. `{{` and `}}` are braces.
fn pieces(word: &str) -> Result<Vec<Piece<'_>>, String> {
    let mut pieces = Vec::new();
    let mut rest = word;
    while let Some(at) = rest.find(['{', '}']) {
        let (before, from) = rest.split_at(at);
        pieces.push(Piece::Text(before));
        if from.starts_with("{{") || from.starts_with("}}") {
            pieces.push(Piece::Text(&from[..1]));
            rest = &from[2..];
        } else if let Some((name, after)) = from[1..].split_once('}')
            && from.starts_with('{')
        {
            pieces.push(Piece::Placeholder(name));
            rest = after;
        } else {
            return Err(format!(
                "`{word}` has a single brace: write a placeholder such as {{spp}}, or `{{{{` and \
                 `}}}}` for braces"
            ));
        }
    }
    pieces.push(Piece::Text(rest));
    Ok(pieces)
}

/// Checks the words of a command, whose placeholders must be among `known`.
///
/// # Errors
/// Returns a message for the first word that is wrong, or if there are none or too many.
pub fn check(words: &[String], known: &[&str]) -> Result<(), String> {
    if words.first().is_none_or(String::is_empty) {
        return Err("there is no program to run".to_owned());
    }
    if words.len() > MAX_WORDS {
        return Err(format!("more than {MAX_WORDS} words"));
    }
    for word in words {
        if word.len() > MAX_LENGTH || word.contains('\0') {
            return Err(format!(
                "a word has more than {MAX_LENGTH} bytes or a zero byte"
            ));
        }
        for piece in pieces(word)? {
            let Piece::Placeholder(name) = piece else {
                continue;
            };
            if !known.contains(&name) {
                let near = suggest::nearest(name, known.iter().copied());
                let help = near.map_or_else(
                    || format!("known: {}", known.join(", ")),
                    |near| format!("did you mean {{{near}}}?"),
                );
                return Err(format!("unknown placeholder {{{name}}} ({help})"));
            }
        }
    }
    Ok(())
}

/// Returns whether a checked command has a placeholder.
pub fn has(words: &[String], name: &str) -> bool {
    words.iter().any(|word| {
        pieces(word).is_ok_and(|pieces| {
            pieces
                .iter()
                .any(|piece| matches!(piece, Piece::Placeholder(found) if *found == name))
        })
    })
}

/// Replaces placeholders by their values. Those without a value stay as they are.
pub fn fill(words: &[String], values: &BTreeMap<String, String>) -> Vec<String> {
    let filled = |word: &String| {
        let Ok(pieces) = pieces(word) else {
            return word.clone();
        };
        let text = |piece: &Piece<'_>| match piece {
            Piece::Text(text) => (*text).to_owned(),
            Piece::Placeholder(name) => values
                .get(*name)
                .cloned()
                .unwrap_or_else(|| format!("{{{name}}}")),
        };
        pieces.iter().map(text).collect()
    };
    words.iter().map(filled).collect()
}

/// Writes words as one line for people: words with white space, quotes or nothing are quoted.
pub fn line(words: &[String]) -> String {
    let shown = |word: &String| {
        let plain = |c: char| !c.is_whitespace() && !"\"'\\".contains(c);
        if !word.is_empty() && word.chars().all(plain) {
            word.clone()
        } else {
            format!("{word:?}")
        }
    };
    words.iter().map(shown).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        split(line).unwrap()
    }

    #[test]
    fn a_line_becomes_words_and_a_shell_has_no_part_in_it() {
        assert_eq!(words(" a  b\tc\n"), ["a", "b", "c"]);
        assert_eq!(
            words("x \"a b\" 'c \"d' e\"f g\"h ''"),
            ["x", "a b", "c \"d", "ef gh", ""]
        );
        assert_eq!(
            words("$(rm) `x` ; | > *"),
            ["$(rm)", "`x`", ";", "|", ">", "*"]
        );
        assert!(split("a 'b").unwrap_err().contains("not closed"));
    }

    #[test]
    fn placeholders_become_values_within_one_word() {
        let values = BTreeMap::from([
            ("spp".to_owned(), "4".to_owned()),
            ("scene".to_owned(), "a b; rm \"{spp}\"".to_owned()),
        ]);
        let filled = fill(&words("p --spp={spp} {scene} {{spp}} {seed}"), &values);
        assert_eq!(
            filled,
            ["p", "--spp=4", "a b; rm \"{spp}\"", "{spp}", "{seed}"]
        );
        assert_eq!(line(&filled[..3]), r#"p --spp=4 "a b; rm \"{spp}\"""#);
    }

    #[test]
    fn wrong_words_are_refused_with_help() {
        let known = ["scene", "spp"];
        let problem = |line: &str| check(&words(line), &known).unwrap_err();
        assert!(problem("p {sp}").contains("did you mean {spp}?"));
        assert!(problem("p {nonsense}").contains("known: scene, spp"));
        for line in ["p {spp", "p spp}", "p {"] {
            assert!(problem(line).contains("single brace"), "{line}");
        }
        assert!(problem("").contains("no program"));
        assert!(check(&words("p {spp} {{x}}"), &known).is_ok());
        assert!(has(&words("p -n{spp}"), "spp") && !has(&words("p {{spp}}"), "spp"));
    }
}
