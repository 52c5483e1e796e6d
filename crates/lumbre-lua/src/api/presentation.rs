//! `x:report` and `x:note`: how figures, tables and reports present the results.

use std::collections::BTreeMap;

use mlua::Value as LuaValue;

use super::{ApiFn, Args, functions};
use crate::error::ScriptError;
use crate::strict;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, Ty};
use lumbre_metrics::tonemap::Tonemap;
use lumbre_night::experiment::spec::Presentation;
use lumbre_night::text::is_line;

/// Longest name in characters.
const LONGEST_NAME: usize = 60;

lumbre_light::table! {
    /// Options of `x:report`.
    pub const PRESENTATION = "Presentation",
        "Presentation of the results. It changes neither a result nor an id.";
    names = "": Ty::Any("table<string, string>"),
        "names of techniques and of other axis values in figures and tables: names = { bdpt = \
         \"bidirectional\" }";
    colours = "": Ty::Any("table<string, string>"),
        "colours of techniques and of other axis values, as `#rrggbb`: colours = { bdpt = \
         \"#117733\" }";
    display = "that of `x:measure`, or sRGB with an exposure for each figure": Ty::Any("Tonemap"),
        "tone map of pictures in figures and on the page; exposure = 0 shows radiance 1 as white";
}

functions! {
    /// Methods that set the presentation.
    pub const METHODS;
    "x:note" = note, "Adds a note, which the report shows and `lumbre ls` finds." {
        "text": "string", "A line of text. Words that start with `#` are tags.";
    }
    "x:report" = report, "Sets how figures, tables and reports present the results." {
        "options": "Presentation", "Names, colours and tone map.";
    }
}

fn note(args: &Args) -> Result<LuaValue, ScriptError> {
    let text = args.text(0, "text")?;
    if !is_line(&text) {
        return Err(args.error("expected a line of text".to_owned(), None));
    }
    args.shared.builder.borrow_mut().notes.push(text);
    Ok(LuaValue::Nil)
}

fn report(args: &Args) -> Result<LuaValue, ScriptError> {
    let options = args.table(0, "options")?;
    let read = || -> Result<Presentation, SchemaError> {
        let fields = strict::fields(&options, &PRESENTATION, "report", false)?;
        let value = |key: &str| fields.values.get(key);
        Ok(Presentation {
            display: value("display")
                .map(|display| Tonemap::from_value("report.display", display))
                .transpose()?,
            names: texts("names", value("names"), |name| {
                let length = name.chars().count();
                (1..=LONGEST_NAME).contains(&length) && !name.contains(char::is_control)
            })?,
            colours: texts("colours", value("colours"), |colour| {
                let digits = colour.strip_prefix('#');
                digits.is_some_and(|digits| {
                    digits.len() == 6 && digits.bytes().all(|b| b.is_ascii_hexdigit())
                })
            })?,
            notes: Vec::new(),
        })
    };
    let presentation = read().map_err(|e| args.locate_error(e))?;
    let mut builder = args.shared.builder.borrow_mut();
    args.only_once(builder.report.as_ref().map(|(_, place)| place))?;
    builder.report = Some((presentation, args.place.clone()));
    Ok(LuaValue::Nil)
}

/// Converts a table of texts by axis values, each of which must be valid.
fn texts(
    key: &str,
    value: Option<&Value>,
    is_valid: impl Fn(&str) -> bool,
) -> Result<BTreeMap<String, String>, SchemaError> {
    let expected = match key {
        "colours" => "a colour such as \"#117733\"".to_owned(),
        _ => format!("a name of 1 to {LONGEST_NAME} characters"),
    };
    let fail = |path: String, found: String| {
        SchemaError::new(path, key, format!("expected {expected}, found {found}"))
    };
    let Some(value) = value else {
        return Ok(BTreeMap::new());
    };
    let map = match value {
        Value::Map(map) => map,
        other => return Err(fail(format!("report.{key}"), other.to_string())),
    };
    map.iter()
        .map(
            |(name, text)| match text.as_str().filter(|text| is_valid(text)) {
                Some(text) => Ok((name.clone(), text.to_owned())),
                None => Err(fail(format!("report.{key}.{name}"), text.to_string())),
            },
        )
        .collect()
}
