//! Text that several rooms write: counts with nouns, lines of limited width, CSV, and text from
//! outside without characters that control a terminal.

use std::borrow::Cow;
use std::ops::RangeInclusive;
use std::sync::OnceLock;

/// Returns whether a text is a line that says something: no note may move a terminal's cursor.
pub fn is_line(text: &str) -> bool {
    !text.trim().is_empty() && !text.contains(char::is_control)
}

/// Name and version of this program.
const PROGRAM: &str = concat!("lumbre ", env!("CARGO_PKG_VERSION"));

static WITH_COMMIT: OnceLock<String> = OnceLock::new();

/// Returns name and version of this program as files state them, with the commit that it was built
/// from if the binary states one: `lumbre 0.1.0 (commit 1234567890ab with changes)`.
pub fn program() -> &'static str {
    WITH_COMMIT.get().map_or(PROGRAM, String::as_str)
}

/// Sets the commit that the binary was built from. Only the first call has an effect.
pub fn set_commit(commit: &str) {
    // The first call wins.
    let _ = WITH_COMMIT.set(format!("{PROGRAM} (commit {commit})"));
}

/// Returns the arguments of this process, for records; what is not valid UTF-8 in them is replaced.
pub fn arguments() -> Vec<String> {
    let arguments = std::env::args_os().skip(1);
    arguments
        .map(|argument| argument.to_string_lossy().into_owned())
        .collect()
}

/// Formats a count with its noun: `1 cell`, `3 cells`.
pub fn counted(n: u64, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// Formats a number other than 0 with `digits` significant digits, with an exponent unless its power
/// of ten, after rounding, is in `plain`.
pub fn significant(x: f64, digits: usize, plain: RangeInclusive<i32>) -> String {
    let scientific = format!("{x:.*e}", digits.saturating_sub(1));
    let exponent = scientific.split_once('e').and_then(|(_, e)| e.parse().ok());
    let exponent: i32 = exponent.unwrap_or(0);
    if plain.contains(&exponent) {
        let decimals = usize::try_from(digits as i32 - 1 - exponent);
        format!("{x:.*}", decimals.unwrap_or(0))
    } else {
        scientific
    }
}

/// Breaks text at spaces into lines that fit, except for single words. Returns at least one line.
pub fn wrap(text: &str, fits: impl Fn(&str) -> bool) -> Vec<String> {
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let longer = if line.is_empty() {
            word.to_owned()
        } else {
            format!("{line} {word}")
        };
        if line.is_empty() || fits(&longer) {
            line = longer;
        } else {
            lines.push(std::mem::replace(&mut line, word.to_owned()));
        }
    }
    lines.push(line);
    lines
}

/// Whether a character controls the terminal or changes the order of the text around it. A line feed
/// and a tab do not count.
pub fn is_control(c: char) -> bool {
    let reorders = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
    (c.is_control() && c != '\n' && c != '\t') || reorders
}

/// Makes characters visible that control the terminal: an escape character becomes `\u001b`. All text
/// that reaches the terminal, a log or the data of a page passes here, since it may come from
/// scripts, scenes, names of files and other programs. The result is valid JSON if the text is.
pub fn visible(text: &str) -> Cow<'_, str> {
    if !text.contains(is_control) {
        return Cow::Borrowed(text);
    }
    let escaped = |c: char| match is_control(c) {
        true => format!("\\u{:04x}", u32::from(c)),
        false => c.to_string(),
    };
    Cow::Owned(text.chars().map(escaped).collect())
}

/// Describes an error of the operating system, with the limit of the process that it is due to.
pub fn describe_io(error: &std::io::Error) -> String {
    let text = error.to_string();
    // The kind of the first error has no name in the standard library.
    if text.contains("Too many open files") {
        format!("{text}; this process may open too few files: raise the limit, `ulimit -n`")
    } else if error.kind() == std::io::ErrorKind::FileTooLarge {
        format!("{text}; this process may write no file of this size: raise the limit, `ulimit -f`")
    } else {
        text
    }
}

/// Formats one CSV field, quoted if necessary [RFC 4180]. Spreadsheets take text that begins like a
/// formula for one, so an apostrophe goes before it, unless it is a number, and before text that
/// begins with an apostrophe itself.
pub fn csv_field(text: &str) -> String {
    if text.starts_with(MARKED) && text.parse::<f64>().is_err() {
        return quoted(&format!("'{text}"));
    }
    quoted(text)
}

/// Quotes a CSV field if necessary.
fn quoted(text: &str) -> String {
    if text.contains(['"', ',', '\n', '\r']) || text.trim() != text {
        format!("\"{}\"", text.replace('"', "\"\""))
    } else {
        text.to_owned()
    }
}

/// Characters with which formulas of spreadsheets begin, and the apostrophe that marks text.
const MARKED: [char; 7] = ['=', '+', '-', '@', '\t', '\r', '\''];

/// Formats one CSV line, including its line feed.
pub fn csv_line<S: AsRef<str>>(fields: &[S]) -> String {
    let fields: Vec<String> = fields.iter().map(|f| csv_field(f.as_ref())).collect();
    fields.join(",") + "\n"
}

/// Splits a CSV line into its fields, without their quotes and what [`csv_field`] adds.
pub fn csv_fields(line: &str) -> Vec<String> {
    let mut fields = vec![String::new()];
    let mut quoted = false;
    let mut chars = line.chars().peekable();
    while let Some(c) = chars.next() {
        let last = fields.len() - 1;
        match c {
            '"' if quoted && chars.peek() == Some(&'"') => {
                chars.next();
                fields[last].push('"');
            }
            '"' => quoted = !quoted,
            ',' if !quoted => fields.push(String::new()),
            _ => fields[last].push(c),
        }
    }
    for field in &mut fields {
        if field.starts_with('\'') {
            field.remove(0);
        }
    }
    fields
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_as_long_as_fits_and_words_are_whole() {
        let wrapped = |text: &str| wrap(text, |line| line.len() <= 7);
        assert_eq!(wrapped("one two three"), ["one two", "three"]);
        assert_eq!(wrapped("a considerable b"), ["a", "considerable", "b"]);
        assert_eq!(wrapped("  "), [""]);
    }

    #[test]
    fn csv_fields_read_back_with_commas_and_quotes() {
        let fields = ["plain", "a, b", "say \"hi\"", " ", ""];
        let line = csv_line(&fields);
        assert_eq!(line, "plain,\"a, b\",\"say \"\"hi\"\"\",\" \",\n");
        assert_eq!(csv_fields(line.trim_end_matches('\n')), fields);
        let fields = ["=1+1", "-2.5", "+inf", "-a, b", "@x", "'=x"];
        let line = csv_line(&fields);
        assert_eq!(line, "'=1+1,-2.5,+inf,\"'-a, b\",'@x,''=x\n");
        assert_eq!(csv_fields(line.trim_end_matches('\n')), fields);
    }

    #[test]
    fn control_characters_become_visible_and_json_stays_valid() {
        assert_eq!(visible("a\tb\n\u{e9}"), "a\tb\n\u{e9}");
        assert_eq!(visible("\u{1b}]0;x\u{7}\r"), "\\u001b]0;x\\u0007\\u000d");
        assert_eq!(visible("\u{9b}2J\u{7f}\u{202e}"), "\\u009b2J\\u007f\\u202e");
        let text = "\u{1b} \u{85} \u{202e}";
        let json = serde_json::to_string(text).unwrap();
        let read: String = serde_json::from_str(&visible(&json)).unwrap();
        assert_eq!(read, text);
    }

    #[test]
    fn nouns_have_a_plural() {
        assert_eq!(
            [counted(1, "cell"), counted(0, "cell")],
            ["1 cell", "0 cells"]
        );
    }
}
