//! Sheets of pictures that a script requests: pictures of runs side by side (`x:sheet`), or moments
//! of runs with a time axis (`x:frames`).

use std::collections::BTreeMap;

use lumbre_light::value::Value;
use lumbre_light::value::schema::{SchemaError, duration_s};
use lumbre_metrics::tonemap::Tonemap;

/// Greatest number of pictures of a sheet.
pub const MAX_PICTURES: usize = 400;

/// Greatest number of columns of a sheet. Pictures of more columns would be too narrow.
pub const MAX_COLUMNS: usize = 24;

/// A sheet of pictures.
#[derive(Clone, Debug, PartialEq)]
pub struct SheetSpec {
    /// Name of the sheet and of its files.
    pub name: String,
    /// Axes whose values are the rows. If empty, pictures of runs fill rows one after another, and
    /// frames have a row for each point of the sweep.
    pub rows: Vec<String>,
    /// Tone map of the pictures or frames, if the script sets one.
    pub display: Option<Tonemap>,
    /// Pictures of the sheet.
    pub content: SheetContent,
}

/// Pictures of a sheet.
#[derive(Clone, Debug, PartialEq)]
pub enum SheetContent {
    /// One picture of each run.
    Pictures {
        /// Axes whose values are the columns; empty for a single column.
        cols: Vec<String>,
        /// Picture that is shown of each run.
        at: PictureMoment,
    },
    /// Frames of each run at the same moments.
    Frames {
        /// Moments as optical lengths in scene units, one column each.
        at: Vec<f64>,
        /// Material whose density of delays begins each row.
        density: Option<String>,
        /// Whether the picture without time precedes the frames.
        complete: bool,
    },
}

/// Stored picture that a sheet shows of a run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PictureMoment {
    /// Final picture.
    End,
    /// Picture nearest to a render time in seconds.
    Time(f64),
    /// Picture nearest to a number of samples per pixel.
    Samples(u64),
}

impl PictureMoment {
    /// Parses `"end"`, a render time such as `"10s"`, or a number of samples per pixel. Returns
    /// `None` for any other value.
    fn from_value(value: &Value) -> Option<PictureMoment> {
        match value {
            Value::Str(text) if text == "end" => Some(PictureMoment::End),
            Value::Str(_) => {
                let time = duration_s(value).filter(|time| *time > 0.0);
                time.map(PictureMoment::Time)
            }
            Value::Int(samples @ 1..) => Some(PictureMoment::Samples(*samples as u64)),
            _ => None,
        }
    }

    fn to_value(self) -> Value {
        match self {
            PictureMoment::End => "end".into(),
            PictureMoment::Time(seconds) => Value::Str(format!("{seconds}s")),
            PictureMoment::Samples(samples) => Value::number(samples as f64),
        }
    }
}

impl SheetSpec {
    /// Returns the name of the script's method that declares it: `sheet` or `frames`.
    pub fn kind(&self) -> &'static str {
        match self.content {
            SheetContent::Pictures { .. } => "sheet",
            SheetContent::Frames { .. } => "frames",
        }
    }

    /// Creates the sheet of a method, `sheet` or `frames`, from its options, whose types have been
    /// checked.
    ///
    /// # Errors
    /// Returns an error for a tone map or a moment that is none.
    pub fn new(
        kind: &str,
        name: &str,
        options: &BTreeMap<String, Value>,
    ) -> Result<SheetSpec, SchemaError> {
        let path = |key: &str| format!("{kind}.{name}.{key}");
        let items = |key: &str| options.get(key).map_or(&[][..], Value::one_or_many);
        let texts = |key: &str| {
            let texts = items(key).iter().filter_map(Value::as_str);
            texts.map(str::to_owned).collect()
        };
        let content = if kind == "frames" {
            SheetContent::Frames {
                at: items("at").iter().filter_map(Value::as_f64).collect(),
                density: options
                    .get("density")
                    .and_then(Value::as_str)
                    .map(str::to_owned),
                complete: options.get("static") == Some(&Value::Bool(true)),
            }
        } else {
            let moment = |at: &Value| {
                PictureMoment::from_value(at).ok_or_else(|| {
                    let problem = format!("expected a moment of the runs, found `{at}`");
                    SchemaError::new(path("at"), "at", problem).with_help(
                        "at = \"end\", a render time such as \"10s\", or samples per pixel such as 64",
                    )
                })
            };
            SheetContent::Pictures {
                cols: texts("cols"),
                at: options.get("at").map_or(Ok(PictureMoment::End), moment)?,
            }
        };
        let display = options.get("display");
        Ok(SheetSpec {
            name: name.to_owned(),
            rows: texts("rows"),
            display: display
                .map(|display| Tonemap::from_value(&path("display"), display))
                .transpose()?,
            content,
        })
    }

    /// Returns the canonical form, which [`SheetSpec::from_value`] reads.
    pub fn to_value(&self) -> Value {
        let texts = |texts: &[String]| texts.iter().map(|t| t.as_str().into()).collect();
        let mut fields = vec![
            ("kind", self.kind().into()),
            ("name", self.name.as_str().into()),
            ("rows", Value::List(texts(&self.rows))),
        ];
        fields.extend(self.display.map(|display| ("display", display.to_value())));
        match &self.content {
            SheetContent::Pictures { cols, at } => {
                fields.extend([("cols", Value::List(texts(cols))), ("at", at.to_value())])
            }
            SheetContent::Frames {
                at,
                density,
                complete,
            } => {
                let at = at.iter().map(|at| Value::number(*at)).collect();
                fields.extend([("at", Value::List(at)), ("static", Value::Bool(*complete))]);
                fields.extend(density.as_deref().map(|name| ("density", name.into())));
            }
        }
        Value::from_iter(fields)
    }

    /// Parses the canonical form.
    ///
    /// # Errors
    /// Returns an error if it is none.
    pub fn from_value(value: &Value) -> Result<SheetSpec, SchemaError> {
        let invalid = || SchemaError::new("sheets", "sheets", format!("`{value}` is no sheet"));
        let options = value.as_map().ok_or_else(invalid)?;
        let text = |key: &str| options.get(key).and_then(Value::as_str);
        let (kind, name) = text("kind").zip(text("name")).ok_or_else(invalid)?;
        SheetSpec::new(kind, name, options)
    }

    /// Returns the material whose density of delays it shows.
    pub fn density(&self) -> Option<&str> {
        match &self.content {
            SheetContent::Frames { density, .. } => density.as_deref(),
            SheetContent::Pictures { .. } => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn options(json: serde_json::Value) -> BTreeMap<String, Value> {
        Value::from_json(&json).as_map().cloned().unwrap()
    }

    #[test]
    fn the_canonical_form_reads_back() {
        let display = serde_json::json!({ "kind": "srgb", "exposure": 1.5 });
        for (kind, json) in [
            ("sheet", serde_json::json!({ "cols": "a", "at": "90s" })),
            ("sheet", serde_json::json!({ "rows": ["a", "b"], "at": 64 })),
            (
                "sheet",
                serde_json::json!({ "rows": "a", "display": display }),
            ),
            (
                "frames",
                serde_json::json!({ "at": [4, 6.5], "density": "hare" }),
            ),
            (
                "frames",
                serde_json::json!({ "at": 4, "static": true, "rows": "c" }),
            ),
        ] {
            let spec = SheetSpec::new(kind, "s", &options(json)).unwrap();
            assert_eq!(SheetSpec::from_value(&spec.to_value()), Ok(spec));
        }
    }

    #[test]
    fn other_moments_are_refused() {
        for at in [serde_json::json!("soon"), 0.into(), 1.5.into(), "0s".into()] {
            let options = options(serde_json::json!({ "cols": "a", "at": at }));
            let error = SheetSpec::new("sheet", "s", &options).unwrap_err();
            assert_eq!((error.path.as_str(), &*error.key), ("sheet.s.at", "at"));
        }
    }
}
