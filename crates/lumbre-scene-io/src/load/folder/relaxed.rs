//! Relaxed JSON, as in the hand-written scenes of thesis S1: single quotes, keys without quotes or
//! with a closing quote only, missing colons, and trailing commas.

use serde_json::{Map, Number, Value as Json};

/// Greatest nesting depth of values.
const MAX_DEPTH: usize = 64;

/// Line and column, counted from 1, and a description of the problem.
pub(super) type SyntaxError = ([usize; 2], String);

/// Parses a text as one value.
///
/// # Errors
/// Returns the position and the problem of the first text that is not relaxed JSON.
pub(super) fn parse(text: &str) -> Result<Json, SyntaxError> {
    let mut parser = RelaxedParser { text, at: 0 };
    let value = parser.value(0)?;
    parser.skip_whitespace();
    match parser.peek() {
        None => Ok(value),
        Some(c) => Err(parser.error(format!("expected the end of the file, found `{c}`"))),
    }
}

/// A parser at a position in a text.
struct RelaxedParser<'a> {
    text: &'a str,
    at: usize,
}

impl RelaxedParser<'_> {
    /// Creates an error at the current position.
    fn error(&self, problem: impl Into<String>) -> SyntaxError {
        let before = &self.text[..self.at];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        ([line, column], problem.into())
    }

    /// Returns the next character.
    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    /// Consumes the expected character if it is next; returns whether it was.
    fn accept(&mut self, expected: char) -> bool {
        let found = self.peek() == Some(expected);
        self.at += if found { expected.len_utf8() } else { 0 };
        found
    }

    /// Consumes and returns the characters up to the first one that does not satisfy the predicate.
    fn take_while(&mut self, predicate: impl Fn(char) -> bool) -> &str {
        let rest = &self.text[self.at..];
        let length = rest.find(|c| !predicate(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    /// Consumes white space and byte order marks.
    fn skip_whitespace(&mut self) {
        self.take_while(|c| c.is_whitespace() || c == '\u{feff}');
    }

    /// Parses a value at this nesting depth.
    fn value(&mut self, depth: usize) -> Result<Json, SyntaxError> {
        if depth > MAX_DEPTH {
            return Err(self.error(format!(
                "values are nested more than {MAX_DEPTH} levels deep"
            )));
        }
        self.skip_whitespace();
        match self.peek() {
            Some('{') => self.object(depth),
            Some('[') => self.list(depth),
            Some(quote @ ('"' | '\'')) => self.quoted(quote).map(Json::String),
            Some(_) => self.literal(),
            None => Err(self.error("expected a value, found the end of the file")),
        }
    }

    /// Parses an object, from its opening brace.
    fn object(&mut self, depth: usize) -> Result<Json, SyntaxError> {
        let mut map = Map::new();
        self.accept('{');
        loop {
            self.skip_whitespace();
            if self.accept('}') {
                return Ok(Json::Object(map));
            }
            let key = self.key()?;
            self.skip_whitespace();
            // A colon may be missing before a value that starts with a bracket.
            if !self.accept(':') && !matches!(self.peek(), Some('{' | '[')) {
                return Err(self.error(format!("expected `:` after the key `{key}`")));
            }
            let value = self.value(depth + 1)?;
            map.insert(key, value);
            self.skip_whitespace();
            if !self.accept(',') && self.peek() != Some('}') {
                return Err(self.error("expected `,` or `}`"));
            }
        }
    }

    /// Parses a list, from its opening bracket.
    fn list(&mut self, depth: usize) -> Result<Json, SyntaxError> {
        let mut items = Vec::new();
        self.accept('[');
        loop {
            self.skip_whitespace();
            if self.accept(']') {
                return Ok(Json::Array(items));
            }
            items.push(self.value(depth + 1)?);
            self.skip_whitespace();
            if !self.accept(',') && self.peek() != Some(']') {
                return Err(self.error("expected `,` or `]`"));
            }
        }
    }

    /// Parses a key with quotes, without quotes, or with a closing quote only.
    fn key(&mut self) -> Result<String, SyntaxError> {
        if let Some(quote @ ('"' | '\'')) = self.peek() {
            return self.quoted(quote);
        }
        let bare = self
            .take_while(|c| c.is_alphanumeric() || "_-.$".contains(c))
            .to_owned();
        if bare.is_empty() {
            return Err(self.error("expected a key"));
        }
        if !self.accept('\'') {
            self.accept('"');
        }
        Ok(bare)
    }

    /// Parses a string, from its opening quote.
    fn quoted(&mut self, quote: char) -> Result<String, SyntaxError> {
        let start = self.at;
        self.accept(quote);
        let mut out = String::new();
        loop {
            out.push_str(self.take_while(|c| c != quote && c != '\\' && c != '\n'));
            if self.accept(quote) {
                return Ok(out);
            }
            if !self.accept('\\') {
                self.at = start;
                return Err(self.error("the string is not terminated"));
            }
            // Other letters after a backslash are literal, as in Windows paths.
            match self.peek() {
                Some('n') => out.push('\n'),
                Some('t') => out.push('\t'),
                Some(c @ ('\\' | '/' | '"' | '\'')) => out.push(c),
                Some(c) => out.extend(['\\', c]),
                None => continue,
            }
            self.at += self.peek().map_or(0, char::len_utf8);
        }
    }

    /// Parses a number, a boolean or null.
    fn literal(&mut self) -> Result<Json, SyntaxError> {
        let start = self.at;
        let word = self
            .take_while(|c| c.is_alphanumeric() || "+-._".contains(c))
            .to_owned();
        let plain = word.trim_start_matches('+').trim_end_matches(['f', 'F']);
        match word.as_str() {
            "true" => Ok(Json::Bool(true)),
            "false" => Ok(Json::Bool(false)),
            "null" => Ok(Json::Null),
            _ => match plain
                .parse()
                .ok()
                .filter(|x: &f64| x.is_finite())
                .and_then(Number::from_f64)
            {
                Some(number) => Ok(Json::Number(number)),
                None => {
                    self.at = start;
                    Err(self.error("expected a value".to_owned()))
                }
            },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn the_template_of_the_original_program_is_parsed() {
        let text = "{\n 'camera' : {'xRes' : 1280, 'position' : {x : 0, y : 1, z : 2}, 'aperture' \
                    : 2.8},\n 'materials' : [{name' : 'mat1'}, {'name' : 'mat2', 'roughness' : \
                    0.2}],\n 'pointLights' : [{position' : {'x' : 0}, 'radiance' {'r' : \
                    1,}},]\n}\n";
        let expected = json!({
            "camera": {"xRes": 1280.0, "position": {"x": 0.0, "y": 1.0, "z": 2.0}, "aperture": 2.8},
            "materials": [{"name": "mat1"}, {"name": "mat2", "roughness": 0.2}],
            "pointLights": [{"position": {"x": 0.0}, "radiance": {"r": 1.0}}],
        });
        assert_eq!(parse(text).unwrap(), expected);
    }

    #[test]
    fn errors_have_the_position_of_the_problem() {
        for (text, place, word) in [
            ("{'a' 1}", [1, 6], "`:`"),
            ("{'a': 1\n 'b': 2}", [2, 2], "`,` or `}`"),
            ("[1, 'x", [1, 5], "not terminated"),
            ("[nan]", [1, 2], "expected a value"),
            ("{: 1}", [1, 2], "a key"),
            ("", [1, 1], "end of the file"),
            ("1 2", [1, 3], "`2`"),
        ] {
            let (found, problem) = parse(text).unwrap_err();
            assert!(
                found == place && problem.contains(word),
                "{text}: {found:?} {problem}"
            );
        }
        assert!(parse(&"[".repeat(100_000)).unwrap_err().1.contains("deep"));
        assert_eq!(parse(r"'C:\scenes\'").unwrap_err().0, [1, 1]);
        assert_eq!(parse(r"'C:\scenes'").unwrap(), json!(r"C:\scenes"));
    }

    proptest! {
        #[test]
        fn any_text_is_parsed_or_refused(text in r#"[\[\]{}:,'"\\ a-z0-9.é\n-]{0,60}"#) {
            let _ = parse(&text);
        }

        #[test]
        fn json_is_parsed_as_json(
            list in proptest::collection::vec(
                ("[a-z]{1,6}", -1e6..1e6f64, "[ -~]{0,8}"),
                0..6,
            ),
        ) {
            let pair = |(k, x, s): (String, f64, String)| {
                (k, json!([x, s.replace('\\', "/"), {"b": true}]))
            };
            let json: Json = list.into_iter().map(pair).collect::<Map<_, _>>().into();
            prop_assert_eq!(parse(&json.to_string()).unwrap(), json);
        }
    }
}
