//! Sheets of pictures that a script requests: pictures of runs side by side (`x:sheet`), or moments
//! of runs with a time axis (`x:frames`).

use std::collections::BTreeMap;

use super::outcome::WaveRow;
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
    /// Canonical form: the options of the script, with the keys `kind`, the name of the method that
    /// declares it, and `name`.
    pub options: BTreeMap<String, Value>,
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
    /// Final picture of a run.
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

    /// Returns whether it is after a measurement.
    pub fn is_after(self, row: &WaveRow) -> bool {
        match self {
            PictureMoment::End => false,
            PictureMoment::Time(seconds) => row.render_s < seconds,
            PictureMoment::Samples(samples) => row.samples < samples,
        }
    }
}

impl SheetSpec {
    /// Creates a sheet from its canonical form, whose types have been checked. Without `kind` it is
    /// a sheet of pictures.
    ///
    /// # Errors
    /// Returns an error for an invalid tone map or moment.
    pub fn new(options: BTreeMap<String, Value>) -> Result<SheetSpec, SchemaError> {
        let option = |key: &str| options.get(key);
        let text = |key: &str| option(key).and_then(Value::as_str);
        let items = |key: &str| option(key).map_or(&[][..], Value::one_or_many);
        let texts = |key: &str| {
            let texts = items(key).iter().filter_map(Value::as_str);
            texts.map(str::to_owned).collect()
        };
        let (kind, name) = (text("kind"), text("name").unwrap_or_default().to_owned());
        let path = |key: &str| format!("{}.{name}.{key}", kind.unwrap_or("sheet"));
        let content = if kind == Some("frames") {
            SheetContent::Frames {
                at: items("at").iter().filter_map(Value::as_f64).collect(),
                density: text("density").map(str::to_owned),
                complete: option("static") == Some(&Value::Bool(true)),
            }
        } else {
            let moment = |at: &Value| {
                PictureMoment::from_value(at).ok_or_else(|| {
                    let problem = format!("expected a moment of the runs, found `{at}`");
                    SchemaError::new(path("at"), "at", problem).with_help(
                        "use \"end\", a render time such as \"10s\", or samples per pixel such as \
                         64",
                    )
                })
            };
            SheetContent::Pictures {
                cols: texts("cols"),
                at: option("at").map_or(Ok(PictureMoment::End), moment)?,
            }
        };
        let display = option("display");
        let display = display.map(|value| Tonemap::from_value(&path("display"), value));
        Ok(SheetSpec {
            rows: texts("rows"),
            display: display.transpose()?,
            content,
            name,
            options,
        })
    }

    /// Returns the name of the script's method that declares it: `sheet` or `frames`.
    pub fn kind(&self) -> &'static str {
        match self.content {
            SheetContent::Pictures { .. } => "sheet",
            SheetContent::Frames { .. } => "frames",
        }
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

    #[test]
    fn a_moment_is_the_end_a_time_or_samples() {
        let at_of = |at: Value| {
            let options = [("name".to_owned(), "s".into()), ("at".to_owned(), at)];
            SheetSpec::new(options.into()).map(|spec| spec.content)
        };
        for (value, expected) in [
            ("end".into(), PictureMoment::End),
            ("1.5min".into(), PictureMoment::Time(90.0)),
            (Value::Int(64), PictureMoment::Samples(64)),
        ] {
            let (at, cols) = (expected, Vec::new());
            assert_eq!(at_of(value), Ok(SheetContent::Pictures { cols, at }));
        }
        for value in ["soon".into(), Value::Int(0), Value::Num(1.5), "0s".into()] {
            let error = at_of(value).unwrap_err();
            assert_eq!((&*error.path, &*error.key), ("sheet.s.at", "at"));
        }
    }
}
