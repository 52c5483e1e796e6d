//! JSON as the second source writes it by hand: single quotes, keys without quotes or with half of them, missing colons
//! and commas at the end of lists.

use serde_json::{Map, Number, Value as Json};

/// How deep values may lie in one another.
const MAX_DEPTH: usize = 64;

/// Line and column, counted from 1, and what is wrong there.
pub(super) type Fault = ([usize; 2], String);

/// Reads a text as one value.
///
/// # Errors
/// What is not understood even so; the place is where it begins.
pub(super) fn parse(text: &str) -> Result<Json, Fault> {
    let mut reader = Reader { text, at: 0 };
    let value = reader.value(0)?;
    reader.space();
    match reader.peek() {
        None => Ok(value),
        Some(c) => Err(reader.fault(format!("expected the end of the file, found `{c}`"))),
    }
}

struct Reader<'a> {
    text: &'a str,
    at: usize,
}

impl Reader<'_> {
    fn fault(&self, problem: impl Into<String>) -> Fault {
        let before = &self.text[..self.at];
        let line = before.matches('\n').count() + 1;
        let column = before.rsplit('\n').next().map_or(0, |l| l.chars().count()) + 1;
        ([line, column], problem.into())
    }

    fn peek(&self) -> Option<char> {
        self.text[self.at..].chars().next()
    }

    fn take(&mut self, wanted: char) -> bool {
        let there = self.peek() == Some(wanted);
        self.at += if there { wanted.len_utf8() } else { 0 };
        there
    }

    fn while_(&mut self, keep: impl Fn(char) -> bool) -> &str {
        let rest = &self.text[self.at..];
        let length = rest.find(|c| !keep(c)).unwrap_or(rest.len());
        self.at += length;
        &rest[..length]
    }

    fn space(&mut self) {
        self.while_(|c| c.is_whitespace() || c == '\u{feff}');
    }

    fn value(&mut self, depth: usize) -> Result<Json, Fault> {
        if depth > MAX_DEPTH {
            return Err(self.fault(format!("values lie more than {MAX_DEPTH} deep in one another")));
        }
        self.space();
        match self.peek() {
            Some('{') => self.object(depth),
            Some('[') => self.list(depth),
            Some(quote @ ('"' | '\'')) => self.quoted(quote).map(Json::String),
            Some(_) => self.word(),
            None => Err(self.fault("expected a value, found the end of the file")),
        }
    }

    fn object(&mut self, depth: usize) -> Result<Json, Fault> {
        let mut map = Map::new();
        self.take('{');
        loop {
            self.space();
            if self.take('}') {
                return Ok(Json::Object(map));
            }
            let key = self.key()?;
            self.space();
            // A colon may be missing before what cannot be anything but a value.
            if !self.take(':') && !matches!(self.peek(), Some('{' | '[')) {
                return Err(self.fault(format!("expected `:` after the key `{key}`")));
            }
            let value = self.value(depth + 1)?;
            map.insert(key, value);
            self.space();
            if !self.take(',') && self.peek() != Some('}') {
                return Err(self.fault("expected `,` or `}`"));
            }
        }
    }

    fn list(&mut self, depth: usize) -> Result<Json, Fault> {
        let mut items = Vec::new();
        self.take('[');
        loop {
            self.space();
            if self.take(']') {
                return Ok(Json::Array(items));
            }
            items.push(self.value(depth + 1)?);
            self.space();
            if !self.take(',') && self.peek() != Some(']') {
                return Err(self.fault("expected `,` or `]`"));
            }
        }
    }

    /// A key in quotes, without any, or with one behind it only.
    fn key(&mut self) -> Result<String, Fault> {
        if let Some(quote @ ('"' | '\'')) = self.peek() {
            return self.quoted(quote);
        }
        let bare = self.while_(|c| c.is_alphanumeric() || "_-.$".contains(c)).to_owned();
        if bare.is_empty() {
            return Err(self.fault("expected a key"));
        }
        if !self.take('\'') {
            self.take('"');
        }
        Ok(bare)
    }

    fn quoted(&mut self, quote: char) -> Result<String, Fault> {
        let start = self.at;
        self.take(quote);
        let mut out = String::new();
        loop {
            out.push_str(self.while_(|c| c != quote && c != '\\' && c != '\n'));
            if self.take(quote) {
                return Ok(out);
            }
            if !self.take('\\') {
                self.at = start;
                return Err(self.fault("a text without its end"));
            }
            // Other letters stand for themselves behind a backslash, as in the paths of Windows.
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

    fn word(&mut self) -> Result<Json, Fault> {
        let start = self.at;
        let word = self.while_(|c| c.is_alphanumeric() || "+-._".contains(c)).to_owned();
        let plain = word.trim_start_matches('+').trim_end_matches(['f', 'F']);
        match word.as_str() {
            "true" => Ok(Json::Bool(true)),
            "false" => Ok(Json::Bool(false)),
            "null" => Ok(Json::Null),
            _ => match plain.parse().ok().filter(|x: &f64| x.is_finite()).and_then(Number::from_f64) {
                Some(number) => Ok(Json::Number(number)),
                None => {
                    self.at = start;
                    let found = if word.is_empty() { self.peek().map(String::from) } else { Some(word) };
                    let found: String = found.unwrap_or_default().chars().take(32).collect();
                    Err(self.fault(format!("expected a value, found `{found}`")))
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
    fn the_template_of_the_source_is_read() {
        let text = "{\n 'camera' : {'xRes' : 1280, 'position' : {x : 0, y : 1, z : 2}, 'aperture' : 2.8},\n \
                    'materials' : [{name' : 'mat1'}, {'name' : 'mat2', 'roughness' : 0.2}],\n \
                    'pointLights' : [{position' : {'x' : 0}, 'radiance' {'r' : 1,}},]\n}\n";
        let expected = json!({
            "camera": {"xRes": 1280.0, "position": {"x": 0.0, "y": 1.0, "z": 2.0}, "aperture": 2.8},
            "materials": [{"name": "mat1"}, {"name": "mat2", "roughness": 0.2}],
            "pointLights": [{"position": {"x": 0.0}, "radiance": {"r": 1.0}}],
        });
        assert_eq!(parse(text).unwrap(), expected);
    }

    #[test]
    fn what_is_no_value_is_an_error_with_its_place() {
        for (text, place, word) in [
            ("{'a' 1}", [1, 6], "`:`"),
            ("{'a': 1\n 'b': 2}", [2, 2], "`,` or `}`"),
            ("[1, 'x", [1, 5], "without its end"),
            ("[nan]", [1, 2], "`nan`"),
            ("{: 1}", [1, 2], "a key"),
            ("", [1, 1], "end of the file"),
            ("1 2", [1, 3], "`2`"),
        ] {
            let (found, problem) = parse(text).unwrap_err();
            assert!(found == place && problem.contains(word), "{text}: {found:?} {problem}");
        }
        assert!(parse(&"[".repeat(100_000)).unwrap_err().1.contains("deep"));
        assert_eq!(parse(r"'C:\scenes\'").unwrap_err().0, [1, 1]);
        assert_eq!(parse(r"'C:\scenes'").unwrap(), json!(r"C:\scenes"));
    }

    proptest! {
        #[test]
        fn any_text_is_read_or_refused(text in r#"[\[\]{}:,'"\\ a-z0-9.é\n-]{0,60}"#) {
            let _ = parse(&text);
        }

        #[test]
        fn json_is_read_as_json(list in proptest::collection::vec(("[a-z]{1,6}", -1e6..1e6f64, "[ -~]{0,8}"), 0..6)) {
            let json: Json = list.into_iter().map(|(k, x, s)| (k, json!([x, s.replace('\\', "/"), {"b": true}]))).collect::<Map<_, _>>().into();
            prop_assert_eq!(parse(&json.to_string()).unwrap(), json);
        }
    }
}
