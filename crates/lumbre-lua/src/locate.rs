//! Search for the position of a table key in a script's text.
//!
//! Lua tables carry no line numbers. Lua reports only the line of a call, or the first and last
//! line of a function; from there the tokens of the text are searched for the key in its written
//! form: `key =` or `["key"] =`.

/// Lua token, as far as the search needs it.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Token<'a> {
    /// A name or keyword.
    Name(&'a str),
    /// Content of a quoted string, with its escape sequences.
    Text(&'a str),
    /// One byte of punctuation. `==`, `~=`, `<=` and `>=` become `~`, so that `=` is always an
    /// assignment.
    Mark(u8),
    /// A number or a long string.
    Other,
}

/// Token with its byte offset and the offset of its end.
#[derive(Clone, Copy, Debug)]
struct SpannedToken<'a> {
    token: Token<'a>,
    start: usize,
    end: usize,
}

/// Returns the byte offset and length of line `line` (from 1), without surrounding white space.
/// Lines after the last one are empty.
pub fn line_span(text: &str, line: usize) -> (usize, usize) {
    let start = line_start(text, line);
    let whole = text[start..].split('\n').next().unwrap_or("");
    let trimmed = whole.trim();
    let lead = whole.len() - whole.trim_start().len();
    if trimmed.is_empty() {
        (start, 0)
    } else {
        (start + lead, trimmed.len())
    }
}

/// Returns the line (from 1) that contains the byte at `offset`.
pub fn line_of(text: &str, offset: usize) -> usize {
    1 + text.as_bytes()[..offset.min(text.len())]
        .iter()
        .filter(|b| **b == b'\n')
        .count()
}

/// Returns the last line that is not blank.
pub fn last_line(text: &str) -> usize {
    line_of(text, text.trim_end().len())
}

fn line_start(text: &str, line: usize) -> usize {
    if line <= 1 {
        return 0;
    }
    text.bytes()
        .enumerate()
        .filter(|(_, b)| *b == b'\n')
        .nth(line - 2)
        .map_or(text.len(), |(i, _)| i + 1)
}

/// Searches for nested `keys` (outermost first) and returns the byte offset and length of the
/// innermost one.
///
/// `last` is the last line of the function that builds the table, or `None` for a call, which ends
/// at its closing bracket. Outer keys that are not found are skipped. If the innermost key is not
/// in the range, the whole text is searched; the key is then accepted only if it occurs exactly
/// once.
pub fn find_key(
    text: &str,
    first: usize,
    last: Option<usize>,
    keys: &[&str],
) -> Option<(usize, usize)> {
    let (innermost, outer) = keys.split_last()?;
    let tokens = tokenize(text);
    let from = line_start(text, first);
    let to = match last {
        Some(line) => line_start(text, line + 1),
        None => end_of_call(text, &tokens, from),
    };
    let inside: Vec<SpannedToken> = tokens
        .iter()
        .copied()
        .filter(|p| p.start >= from && p.start < to)
        .collect();
    let mut at = 0;
    for key in outer {
        at = keys_at(&inside, at, key).next().map_or(at, |(i, _)| i);
    }
    let found = keys_at(&inside, at, innermost)
        .next()
        .or_else(|| keys_at(&inside, 0, innermost).next());
    if let Some((_, span)) = found {
        return Some(span);
    }
    let mut anywhere = keys_at(&tokens, 0, innermost);
    match (anywhere.next(), anywhere.next()) {
        (Some((_, span)), None) => Some(span),
        _ => None,
    }
}

/// Returns the byte offset and length of the first `return {` between two lines: the position to
/// mark if a key is missing in the table that a function returns.
pub fn find_returned_table(text: &str, first: usize, last: usize) -> Option<(usize, usize)> {
    let tokens = tokenize(text);
    let (from, to) = (line_start(text, first), line_start(text, last + 1));
    tokens
        .windows(2)
        .find(|w| {
            w[0].start >= from
                && w[0].start < to
                && w[0].token == Token::Name("return")
                && w[1].is(b'{')
        })
        .map(|w| (w[0].start, w[1].end - w[0].start))
}

impl SpannedToken<'_> {
    fn is(&self, mark: u8) -> bool {
        self.token == Token::Mark(mark)
    }
}

/// Returns every assignment to `key` from token `at` on: index of the token, byte offset and
/// length.
fn keys_at<'t>(
    tokens: &'t [SpannedToken<'t>],
    at: usize,
    key: &'t str,
) -> impl Iterator<Item = (usize, (usize, usize))> + 't {
    (at..tokens.len()).filter_map(move |i| {
        let next = tokens.get(i + 1)?;
        let written = match tokens[i].token {
            Token::Name(name) => name == key && next.is(b'='),
            Token::Text(text) => {
                text == key
                    && i > 0
                    && tokens[i - 1].is(b'[')
                    && next.is(b']')
                    && tokens.get(i + 2)?.is(b'=')
            }
            _ => false,
        };
        written.then_some((i, (tokens[i].start, tokens[i].end - tokens[i].start)))
    })
}

/// Returns the end of the line that closes the first bracket opened at or after `from`.
fn end_of_call(text: &str, tokens: &[SpannedToken], from: usize) -> usize {
    let mut depth = 0usize;
    let mut end = text.len();
    for p in tokens.iter().filter(|p| p.start >= from) {
        match p.token {
            Token::Mark(b'(' | b'{' | b'[') => depth += 1,
            Token::Mark(b')' | b'}' | b']') => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    end = p.end;
                    break;
                }
            }
            _ => {}
        }
    }
    end + text[end..].find('\n').unwrap_or(text.len() - end)
}

/// Splits a Lua text into tokens. Comments are dropped; bytes that are not valid Lua become
/// punctuation.
fn tokenize(text: &str) -> Vec<SpannedToken<'_>> {
    let bytes = text.as_bytes();
    let mut tokens = Vec::new();
    let mut i = 0;
    while i < bytes.len() {
        let start = i;
        let b = bytes[i];
        let token = match b {
            _ if b.is_ascii_whitespace() => {
                i += 1;
                continue;
            }
            b'-' if bytes.get(i + 1) == Some(&b'-') => {
                i = match long_bracket(bytes, i + 2) {
                    Some(end) => end,
                    None => end_of_line(bytes, i),
                };
                continue;
            }
            b'"' | b'\'' => {
                i = quoted(bytes, i);
                Token::Text(
                    text.get(start + 1..i.saturating_sub(1).max(start + 1))
                        .unwrap_or(""),
                )
            }
            b'[' if long_bracket(bytes, i).is_some() => {
                i = long_bracket(bytes, i).unwrap_or(i + 1);
                Token::Other
            }
            _ if b.is_ascii_alphabetic() || b == b'_' => {
                i += bytes[i..]
                    .iter()
                    .take_while(|c| c.is_ascii_alphanumeric() || **c == b'_')
                    .count();
                Token::Name(&text[start..i])
            }
            _ if b.is_ascii_digit() => {
                i += bytes[i..]
                    .iter()
                    .take_while(|c| c.is_ascii_alphanumeric() || **c == b'.')
                    .count();
                Token::Other
            }
            b'=' | b'~' | b'<' | b'>' if bytes.get(i + 1) == Some(&b'=') => {
                i += 2;
                Token::Mark(b'~')
            }
            _ => {
                i += 1;
                Token::Mark(b)
            }
        };
        tokens.push(SpannedToken {
            token,
            start,
            end: i,
        });
    }
    tokens
}

fn end_of_line(bytes: &[u8], from: usize) -> usize {
    bytes[from..]
        .iter()
        .position(|b| *b == b'\n')
        .map_or(bytes.len(), |n| from + n)
}

/// Returns the offset after a quoted string that starts at `from`. A line break also ends the
/// string.
fn quoted(bytes: &[u8], from: usize) -> usize {
    let mut i = from + 1;
    while i < bytes.len() && bytes[i] != b'\n' {
        match bytes[i] {
            b'\\' => i += 2,
            b if b == bytes[from] => return i + 1,
            _ => i += 1,
        }
    }
    i.min(bytes.len())
}

/// Returns the offset after a long bracket `[==[ .. ]==]`, or `None` if none starts at `from`.
fn long_bracket(bytes: &[u8], from: usize) -> Option<usize> {
    if bytes.get(from) != Some(&b'[') {
        return None;
    }
    let level = bytes[from + 1..].iter().take_while(|b| **b == b'=').count();
    let open = from + 1 + level;
    if bytes.get(open) != Some(&b'[') {
        return None;
    }
    let mut close = vec![b'='; level + 2];
    close[0] = b']';
    close[level + 1] = b']';
    let rest = &bytes[open + 1..];
    Some(
        rest.windows(close.len())
            .position(|w| w == close)
            .map_or(bytes.len(), |n| open + 1 + n + close.len()),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "\
local radius = 3 -- radius = 9
x:render(function(p)
  --[[ aa = { raduis = 1 } ]]
  local note = \"raduis = 2\"
  return {
    camera = { raduis = 1 },
    aa = { filter = 'box',
           raduis = 2 }, [\"set\"] = {},
    ok = p.a == 3,
  }
end)
x:measure { every = 1 }
";

    fn line(found: Option<(usize, usize)>) -> Option<usize> {
        found.map(|(offset, _)| line_of(TEXT, offset))
    }

    #[test]
    fn keys_are_found_inside_their_parents_and_never_in_comments_or_strings() {
        assert_eq!(
            line(find_key(TEXT, 2, Some(11), &["render", "aa", "raduis"])),
            Some(8)
        );
        assert_eq!(
            line(find_key(TEXT, 2, Some(11), &["camera", "raduis"])),
            Some(6)
        );
        assert_eq!(line(find_key(TEXT, 2, Some(11), &["set"])), Some(8));
        assert_eq!(
            find_key(TEXT, 2, Some(11), &["a"]),
            None,
            "a comparison is no key"
        );
    }

    #[test]
    fn a_call_ends_with_its_brackets_and_unique_keys_elsewhere_count() {
        assert_eq!(
            line(find_key(TEXT, 12, None, &["measure", "every"])),
            Some(12)
        );
        assert_eq!(
            line(find_key(TEXT, 12, None, &["filter"])),
            Some(7),
            "written once in the whole text"
        );
        assert_eq!(
            find_key(TEXT, 12, None, &["raduis"]),
            None,
            "written twice elsewhere"
        );
    }

    #[test]
    fn spans_cover_exactly_what_is_written() {
        let (at, len) = find_key(TEXT, 2, Some(11), &["aa"]).unwrap();
        assert_eq!(&TEXT[at..at + len], "aa");
        let (at, len) = line_span(TEXT, 12);
        assert_eq!(&TEXT[at..at + len], "x:measure { every = 1 }");
        assert_eq!(line_span(TEXT, 99).1, 0);
        assert_eq!(last_line(TEXT), 12);
        let (at, _) = find_returned_table(TEXT, 2, 11).unwrap();
        assert_eq!(line_of(TEXT, at), 5);
    }

    #[test]
    fn broken_text_is_tokenized_without_panic() {
        for text in [
            "\"abc\\",
            "[==[ never closed",
            "--[[ open",
            "'",
            "é = { ü = \"ö",
            "\\",
        ] {
            let _ = tokenize(text);
            let _ = find_key(text, 1, None, &["k"]);
        }
    }
}
