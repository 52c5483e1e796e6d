//! Parsers for values on the command line: axis values, settings, and scene files with options.

use std::path::PathBuf;

use lumbre_light::transport::integrator::external::is_declared;
use lumbre_light::transport::integrator::{IntegratorRow, canonical_name, integrator};
use lumbre_light::value::Value;
use lumbre_light::value::schema::duration_s;
use lumbre_light::value::suggest;
use lumbre_night::experiment::plan::integrator_help;

/// Scene file with its options, from the command line.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneArg {
    /// Text of the whole argument.
    pub text: String,
    /// Path of the scene file.
    pub file: PathBuf,
    /// Names and values of the options after the question mark.
    pub settings: Vec<(String, Value)>,
}

/// Parses a positive duration, such as `30s`, `5min` or `90`, to seconds.
pub(super) fn seconds(text: &str) -> Result<f64, String> {
    duration_s(&Value::from(text))
        .filter(|seconds| *seconds > 0.0)
        .ok_or_else(|| format!("expected a duration such as 30s or 5min, found `{text}`"))
}

/// Parses a whole number of at least 1 that fits into `T`.
pub(super) fn count<T: TryFrom<u64>>(text: &str) -> Result<T, String> {
    let number = text.parse::<u64>().ok().filter(|number| *number > 0);
    number
        .and_then(|number| T::try_from(number).ok())
        .ok_or_else(|| format!("expected a whole number of at least 1, found `{text}`"))
}

/// Units of [`bytes`].
const BYTE_UNITS: [(&str, u64); 9] = [
    ("KiB", 1 << 10),
    ("MiB", 1 << 20),
    ("GiB", 1 << 30),
    ("TiB", 1 << 40),
    ("kB", 1_000),
    ("MB", 1_000_000),
    ("GB", 1_000_000_000),
    ("TB", 1_000_000_000_000),
    ("B", 1),
];

/// Parses a positive number of bytes with a unit, such as `8GiB` or `512 MB`.
pub(super) fn bytes(text: &str) -> Result<u64, String> {
    let expected = || format!("expected a size such as 8GiB or 512MB, found `{text}`");
    let (number, factor) = BYTE_UNITS
        .iter()
        .find_map(|(unit, factor)| Some((text.strip_suffix(unit)?, *factor)))
        .ok_or_else(expected)?;
    let bytes = number.trim().parse::<f64>().map_err(|_| expected())? * factor as f64;
    if bytes.is_finite() && bytes >= 1.0 {
        Ok(bytes as u64)
    } else {
        Err(expected())
    }
}

/// Returns an integrator of this program, or a bridge to another one, by its name.
///
/// # Errors
/// Returns a message with the most similar name, or all of them.
pub fn integrator_row(name: &str) -> Result<&'static IntegratorRow, String> {
    integrator(name)
        .filter(|row| !is_declared(row))
        .ok_or_else(|| {
            let help = integrator_help(name, []);
            format!("there is no integrator `{name}` ({help})")
        })
}

/// Parses the name of an integrator.
pub(super) fn integrator_name(text: &str) -> Result<String, String> {
    integrator_row(text).map(|_| canonical_name(text).to_owned())
}

/// Describes the error of an unknown name, with the most similar name or all known ones.
pub fn unknown_name(what: &str, name: &str, known: &[&str]) -> String {
    let help = match suggest::nearest(name, known.iter().copied()) {
        Some(near) => format!("did you mean `{near}`?"),
        None => format!("known: {}", known.join(", ")),
    };
    format!("there is no {what} `{name}` ({help})")
}

/// Parses an option of the form `name=value`.
pub(super) fn setting(text: &str) -> Result<(String, Value), String> {
    let (name, text) = text.split_once('=').ok_or_else(|| no_setting(text))?;
    Ok((name.trim().to_owned(), value(text)?))
}

/// Describes the error of a word where `name=value` is expected.
fn no_setting(text: &str) -> String {
    let help = match integrator_row(text) {
        Ok(_) => " (a technique follows `-i`, several to compare follow `--technique`)",
        Err(_) => "",
    };
    format!("expected NAME=VALUE such as max_depth=5, found `{text}`{help}")
}

/// Parses `file` or `file?name=value,name=value`. If a file with the whole text as its name exists,
/// the text is a path.
pub(super) fn scene_arg(text: &str) -> Result<SceneArg, String> {
    let (file, settings) = match text.rsplit_once('?') {
        Some((file, rest)) if !PathBuf::from(text).exists() => (
            file,
            split(rest)
                .into_iter()
                .map(setting)
                .collect::<Result<_, _>>()?,
        ),
        _ => (text, Vec::new()),
    };
    Ok(SceneArg {
        text: text.to_owned(),
        file: file.into(),
        settings,
    })
}

/// Parses a selection of the form `axis=value,value`.
pub(super) fn axis_values(text: &str) -> Result<(String, Vec<Value>), String> {
    let (axis, values) = text
        .split_once('=')
        .ok_or_else(|| format!("expected AXIS=VALUE such as depth=5,9, found `{text}`"))?;
    let axis = axis.trim();
    if axis.is_empty() {
        return Err(format!(
            "expected AXIS=VALUE, but `{text}` has no axis before `=`"
        ));
    }
    let values: Vec<Value> = split(values)
        .into_iter()
        .map(value)
        .collect::<Result<_, _>>()?;
    Ok((axis.to_owned(), values))
}

/// Splits text at commas outside of brackets, braces and quotes.
pub fn split(text: &str) -> Vec<&str> {
    let (mut depth, mut quoted, mut start) = (0, false, 0);
    let mut parts = Vec::new();
    for (at, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth -= 1,
            ',' if depth == 0 && !quoted => {
                parts.push(&text[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

/// Parses a value: a number, `true`, `false`, or JSON if it starts with a bracket, brace or quote.
/// Everything else is a string.
pub fn value(text: &str) -> Result<Value, String> {
    let text = text.trim();
    if text.is_empty() {
        return Err("a value is missing".to_owned());
    }
    if text.starts_with(['[', '{', '"']) {
        let json = serde_json::from_str(text).map_err(|e| {
            let mend = if text.starts_with('{') {
                "; lists are written in brackets, as in `[0.5, 1]`"
            } else {
                ""
            };
            format!("`{text}` is not valid JSON: {e}{mend}")
        })?;
        return Ok(Value::from_json(&json));
    }
    Ok(match text {
        "true" => Value::Bool(true),
        "false" => Value::Bool(false),
        _ if text.starts_with(|c: char| c.is_ascii_digit() || "+-.".contains(c)) => text
            .parse::<f64>()
            .map_or_else(|_| Value::from(text), Value::number),
        _ => Value::from(text),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scene_options_follow_a_question_mark() {
        let read = |t: &str| scene_arg(t).unwrap();
        let plain = read("a/b.scn");
        assert_eq!((plain.file, plain.settings), ("a/b.scn".into(), vec![]));
        let with_options = read("a/b.lua?light=lamps,size=[2, 3],view=gallery");
        assert_eq!(
            (with_options.text.as_str(), with_options.file),
            (
                "a/b.lua?light=lamps,size=[2, 3],view=gallery",
                "a/b.lua".into()
            )
        );
        let size = Value::List(vec![Value::Int(2), Value::Int(3)]);
        let expected = [
            ("light", Value::from("lamps")),
            ("size", size),
            ("view", Value::from("gallery")),
        ];
        assert_eq!(
            with_options.settings,
            expected.map(|(name, value)| (name.to_owned(), value))
        );
        assert!(scene_arg("b.lua?lamps").unwrap_err().contains("NAME=VALUE"));
    }

    #[test]
    fn lists_are_json() {
        let list = Value::List(vec![Value::Num(0.5), Value::Int(1)]);
        assert_eq!(value("[0.5, 1]"), Ok(list));
        assert!(value("{0.5, 1}").unwrap_err().contains("in brackets"));
        assert!(!value("[0.5").unwrap_err().contains("in brackets"));
    }

    #[test]
    fn counts_are_whole_and_positive() {
        assert_eq!(count::<u64>("12"), Ok(12));
        for text in ["0", "-3", "1e3", "4.5", "many", "99999999999"] {
            let error = count::<u32>(text).unwrap_err();
            assert!(error.contains("whole number of at least 1"), "{error}");
        }
    }

    #[test]
    fn a_technique_without_its_option_is_explained() {
        assert!(setting("bdpt").unwrap_err().contains("follows `-i`"));
        assert!(!setting("zebra").unwrap_err().contains("`-i`"));
    }

    #[test]
    fn sizes_have_units() {
        let cases = [
            ("8GiB", 8 << 30),
            ("512 MB", 512_000_000),
            ("1.5kB", 1500),
            ("7B", 7),
        ];
        for (text, expected) in cases {
            assert_eq!(bytes(text), Ok(expected), "{text}");
        }
        for text in ["8", "GiB", "-1MB", "0B", "1e400GiB", "8 gib"] {
            assert!(bytes(text).unwrap_err().contains(text), "{text}");
        }
    }

    #[test]
    fn overrides_are_typed() {
        let read = |t: &str| axis_values(t).unwrap();
        assert_eq!(
            read("depth=5,9"),
            ("depth".into(), vec![Value::Int(5), Value::Int(9)])
        );
        assert_eq!(
            read("aa=0.5,1e-1").1,
            vec![Value::Num(0.5), Value::Num(0.1)]
        );
        assert_eq!(
            read("technique=bpt,nee").1,
            vec![Value::from("bpt"), Value::from("nee")]
        );
        assert_eq!(read("mis=true").1, vec![Value::Bool(true)]);
        assert_eq!(
            read("scene=infinity,nan").1,
            vec![Value::from("infinity"), Value::from("nan")]
        );
        assert_eq!(read("name=\"5,6\"").1, vec![Value::from("5,6")]);
        let pairs = read("res=[64, 32],[8,8]").1;
        assert_eq!(pairs[0], Value::List(vec![Value::Int(64), Value::Int(32)]));
        assert_eq!(pairs.len(), 2);
    }

    #[test]
    fn malformed_overrides_are_rejected() {
        for bad in ["depth", "=5", "depth=", "depth=5,,9", "res=[1,2"] {
            assert!(axis_values(bad).is_err(), "{bad}");
        }
    }
}
