//! Tokens of pbrt's text: words, quoted strings, numbers and brackets.

pub(super) use crate::names::truncated;
use std::path::Path;
use std::rc::Rc;

use lumbre_light::scene::{Note, SceneError};

/// A token of a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Token {
    /// A directive, `true` or `false`.
    Word(String),
    /// A string between quotation marks, without them.
    Quoted(String),
    /// A number that is finite in single precision.
    Number(f64),
    /// The beginning of a list, `[`.
    Open,
    /// The end of a list, `]`.
    Close,
}

impl Token {
    /// Returns a short description of the token for messages. Of a file that is not named as a
    /// scene of pbrt nothing is quoted.
    fn shown(&self, quotes: bool) -> String {
        match self {
            Token::Word(_) | Token::Quoted(_) if !quotes => "other text".to_owned(),
            Token::Word(word) => format!("`{}`", truncated(word)),
            Token::Quoted(text) => format!("`\"{}\"`", truncated(text)),
            Token::Number(x) => format!("`{x}`"),
            Token::Open => "`[`".to_owned(),
            Token::Close => "`]`".to_owned(),
        }
    }
}

/// A place in a file.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Place {
    /// File of the place.
    pub file: Rc<Path>,
    /// Line, counted from 1.
    pub line: u32,
}

impl Place {
    /// Creates an error about this place.
    pub fn error(&self, problem: impl Into<String>) -> SceneError {
        SceneError::malformed(
            self.file.to_path_buf(),
            format!("line {}", self.line),
            problem,
        )
    }

    /// Creates a note about this place.
    pub fn note(&self, message: impl Into<String>) -> Note {
        Note::new(
            self.file.to_path_buf(),
            format!("line {}", self.line),
            message,
        )
    }
}

/// Splits the text of one file into tokens.
pub(super) struct Lexer {
    text: Rc<str>,
    at: usize,
    line: u32,
    file: Rc<Path>,
    /// Token that was looked at and not taken, with its line.
    peeked: Option<(Token, u32)>,
    /// Line of the token that was taken last.
    taken_line: u32,
    /// Whether errors may quote the file, since it is named as a scene of pbrt.
    quotes: bool,
}

impl Lexer {
    /// Creates a lexer at the beginning of a text.
    pub fn new(file: Rc<Path>, text: Rc<str>) -> Lexer {
        let quotes = file
            .extension()
            .is_some_and(|e| e.eq_ignore_ascii_case("pbrt"));
        Lexer {
            text,
            quotes,
            at: 0,
            line: 1,
            file,
            peeked: None,
            taken_line: 1,
        }
    }

    /// Returns the place of the token that was taken last.
    pub fn place(&self) -> Place {
        Place {
            file: self.file.clone(),
            line: self.taken_line,
        }
    }

    /// Returns the next token without taking it; `None` at the end of the file.
    pub fn peek(&mut self) -> Result<Option<&Token>, SceneError> {
        if self.peeked.is_none() {
            self.peeked = self.scan()?;
        }
        Ok(self.peeked.as_ref().map(|(token, _)| token))
    }

    /// Takes the next token; `None` at the end of the file.
    pub fn next(&mut self) -> Result<Option<Token>, SceneError> {
        let found = match self.peeked.take() {
            Some(found) => Some(found),
            None => self.scan()?,
        };
        Ok(found.map(|(token, line)| {
            self.taken_line = line;
            token
        }))
    }

    /// Takes the next token, which must exist.
    pub fn required(&mut self, expected: &str) -> Result<Token, SceneError> {
        match self.next()? {
            Some(token) => Ok(token),
            None => Err(self
                .place()
                .error(format!("the file ends early: expected {expected}"))),
        }
    }

    /// Takes a quoted string.
    pub fn quoted(&mut self, expected: &str) -> Result<String, SceneError> {
        match self.required(expected)? {
            Token::Quoted(text) => Ok(text),
            other => Err(self.unexpected(expected, &other)),
        }
    }

    /// Takes numbers, in brackets if `bracketed`.
    pub fn numbers<const N: usize>(&mut self, bracketed: bool) -> Result<[f64; N], SceneError> {
        if bracketed {
            match self.required("`[`")? {
                Token::Open => {}
                other => return Err(self.unexpected("`[`", &other)),
            }
        }
        let mut out = [0.0; N];
        for x in &mut out {
            *x = match self.required("a number")? {
                Token::Number(x) => x,
                other => return Err(self.unexpected(&format!("{N} numbers"), &other)),
            };
        }
        if bracketed {
            match self.required("`]`")? {
                Token::Close => {}
                other => return Err(self.unexpected("`]`", &other)),
            }
        }
        Ok(out)
    }

    /// Creates an error about the token that was taken last.
    pub fn unexpected(&self, expected: &str, found: &Token) -> SceneError {
        self.place().error(format!(
            "expected {expected}, found {}",
            found.shown(self.quotes)
        ))
    }

    /// Reads the next token and its line.
    fn scan(&mut self) -> Result<Option<(Token, u32)>, SceneError> {
        let bytes = self.text.as_bytes();
        loop {
            match bytes.get(self.at) {
                None => return Ok(None),
                Some(b'\n') => self.line = self.line.saturating_add(1),
                Some(b'\r') if bytes.get(self.at + 1) != Some(&b'\n') => {
                    self.line = self.line.saturating_add(1);
                }
                Some(b'#') => {
                    let rest = &bytes[self.at..];
                    self.at += rest
                        .iter()
                        .position(|b| [b'\n', b'\r'].contains(b))
                        .unwrap_or(rest.len());
                    continue;
                }
                Some(b) if b.is_ascii_whitespace() => {}
                Some(_) => break,
            }
            self.at += 1;
        }
        let line = self.line;
        let token = match bytes[self.at] {
            b'[' => {
                self.at += 1;
                Token::Open
            }
            b']' => {
                self.at += 1;
                Token::Close
            }
            b'"' => self.string()?,
            _ => self.word()?,
        };
        Ok(Some((token, line)))
    }

    /// Reads a quoted string, which ends on its line.
    fn string(&mut self) -> Result<Token, SceneError> {
        let fail = |problem: &str| {
            Err(Place {
                file: self.file.clone(),
                line: self.line,
            }
            .error(problem))
        };
        let mut out = String::new();
        let mut chars = self.text[self.at + 1..].char_indices();
        while let Some((i, c)) = chars.next() {
            match c {
                '"' => {
                    self.at += i + 2;
                    return Ok(Token::Quoted(out));
                }
                '\n' => break,
                '\\' => match chars.next() {
                    Some((_, 'n')) => out.push('\n'),
                    Some((_, 't')) => out.push('\t'),
                    Some((_, 'r')) => out.push('\r'),
                    Some((_, 'b')) => out.push('\u{8}'),
                    Some((_, 'f')) => out.push('\u{c}'),
                    Some((_, c @ ('\\' | '\'' | '"'))) => out.push(c),
                    _ => return fail("an unknown character follows `\\` in a string"),
                },
                c => out.push(c),
            }
        }
        fail("a string does not end on its line")
    }

    /// Reads a word or a number.
    fn word(&mut self) -> Result<Token, SceneError> {
        let rest = &self.text[self.at..];
        let ends = |b: &u8| b.is_ascii_whitespace() || b"[]\"#".contains(b);
        let length = rest.bytes().position(|b| ends(&b)).unwrap_or(rest.len());
        let word = &rest[..length];
        self.at += length;
        let numeric = word.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c));
        if !numeric {
            return Ok(Token::Word(word.to_owned()));
        }
        let place = Place {
            file: self.file.clone(),
            line: self.line,
        };
        let shown = || Token::Word(word.to_owned()).shown(self.quotes);
        match word.parse::<f64>() {
            Ok(x) if (x as f32).is_finite() => Ok(Token::Number(x)),
            Ok(_) => Err(place.error(format!("{} is not finite in single precision", shown()))),
            Err(_) => Err(place.error(format!("{} is not a number", shown()))),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tokens(text: &str) -> Result<Vec<Token>, String> {
        let mut lexer = Lexer::new(Path::new("a.pbrt").into(), text.into());
        let mut out = Vec::new();
        while let Some(token) = lexer.next().map_err(|e| e.to_string())? {
            out.push(token);
        }
        Ok(out)
    }

    #[test]
    fn words_strings_numbers_and_brackets_are_separated() {
        let found = tokens("Shape\"a \\\"b\\\"\"[1 -2.5e1 .5]# comment \" [\ntrue").unwrap();
        let expected = [
            Token::Word("Shape".to_owned()),
            Token::Quoted("a \"b\"".to_owned()),
            Token::Open,
            Token::Number(1.0),
            Token::Number(-25.0),
            Token::Number(0.5),
            Token::Close,
            Token::Word("true".to_owned()),
        ];
        assert_eq!(found, expected);
    }

    #[test]
    fn errors_name_their_line() {
        for (text, expected) in [
            ("\n\n\"open\n\"", "line 3: a string does not end"),
            ("\n1e99", "line 2: `1e99` is not finite"),
            ("1x", "line 1: `1x` is not a number"),
            ("\"\\q\"", "unknown character"),
        ] {
            let e = tokens(text).unwrap_err();
            assert!(e.contains(expected), "{text}: {e}");
        }
        let mut secret = Lexer::new(Path::new("passwd").into(), "1:root".into());
        let e = secret.next().unwrap_err().to_string();
        assert_eq!(e, "passwd: line 1: other text is not a number");
    }
}
