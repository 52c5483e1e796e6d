//! Metrics: errors between an image and its reference. This crate depends on images only.
//!
//! Each metric is one file and one row of [`METRICS`]; columns, curves, stop rules and
//! documentation follow from the row. Every metric sums in `f64`. A NaN in either image makes its
//! value NaN, so a broken pixel is never averaged away.
//!
//! Every metric except `hdr_flip`, which has its own tone mapper, takes the option `on`, a tone map
//! that is applied to both images first. Without it the metric receives linear radiance, except for
//! `psnr` and `ssim`, which use `srgb` unless a `range` is given. All options are part of
//! [`MetricSpec::identity`], since values are comparable only if all of them agree.
//!
//! `docs/bibliography.md` lists the works that the metrics cite.

mod bias;
pub mod colour;
pub mod common_error;
pub mod evaluator;
mod fireflies;
mod flip;
pub mod floor;
mod mae;
pub mod map;
mod mape;
mod mse;
mod pixels;
mod psnr;
mod reference;
mod relmse;
mod rmse;
mod ssim;
pub mod tonemap;
mod trimmed;

use std::collections::BTreeMap;

pub use reference::reference;

use floor::Noise;
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::Value;
use lumbre_light::value::schema::{Field, SchemaError, Table, Ty, unknown_name};
use map::{ErrorMap, PixelMap};
use tonemap::Tonemap;

/// Direction in which a metric improves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Better {
    /// Lower is better; zero is perfect.
    Lower,
    /// Higher is better; one, or infinity, is perfect.
    Higher,
    /// Nearer to zero is better; values have a sign.
    NearZero,
}

impl std::fmt::Display for Better {
    /// Returns `lower`, `higher`, or `nearer to zero`.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Better::Lower => "lower",
            Better::Higher => "higher",
            Better::NearZero => "nearer to zero",
        })
    }
}

/// A metric with its options, as a script asks for it.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricSpec {
    /// Name of the column: `rmse`, or the key that the script chose.
    pub column: String,
    /// Table row of the metric.
    pub row: &'static MetricRow,
    /// Options that were given, checked against the row's schema; defaults are not filled in.
    pub options: BTreeMap<String, Value>,
}

impl MetricSpec {
    /// Converts a value to a number that falls to zero as images become equal: the distance to the
    /// best value, the ratio behind decibels, the magnitude of signed values. `None` if there is
    /// none.
    pub fn distance(&self, value: f64) -> Option<f64> {
        let distance = match self.row.better {
            Better::Lower => value - self.row.perfect,
            Better::NearZero => value.abs(),
            Better::Higher if self.row.unit == "dB" => 10f64.powf(-value / 20.0),
            Better::Higher if self.row.perfect.is_finite() => self.row.perfect - value,
            Better::Higher => return None,
        };
        (!distance.is_nan()).then_some(distance)
    }
}

/// One row of [`METRICS`]: everything that the program knows of a metric.
pub struct MetricRow {
    /// Short name in scripts and columns.
    pub name: &'static str,
    /// Short name as papers print it.
    pub label: &'static str,
    /// Long name in plots.
    pub long_name: &'static str,
    /// Unit of the value on linear images: `radiance`, `radiance²`, `dB`; empty if it has none.
    pub unit: &'static str,
    /// Definition and source in one sentence.
    pub doc: &'static str,
    /// Direction in which the metric improves.
    pub better: Better,
    /// Value for two equal images: 0 for errors, 1 or infinity if higher is better.
    pub perfect: f64,
    /// Schema of the options in scripts. Documented defaults are the values that are used.
    pub options: Table,
    /// Fewest pixels along each side of an image that can be measured, given the options.
    pub smallest: fn(&MetricSpec) -> u32,
    /// Computes the value from image, reference and options. The images have equal size, are not
    /// too small, and are already tone-mapped.
    pub eval: fn(&Image, &Image, &MetricSpec) -> f64,
    /// Precomputes what depends on the reference alone, for metrics where that is expensive. The
    /// returned function gives the same values as `eval`.
    pub prepare: Option<Prepare>,
    /// Error map, if the metric has one. The images are as for `eval`.
    pub map: Option<PixelMap>,
    /// Effect of the noise of a reference on the value.
    pub noise: Noise,
    /// Chooses the values of `auto` options for a reference.
    pub settle: Option<Settle>,
}

/// Row of what most metrics have in common. Each metric adds its names and its computation.
const DEFAULTS: MetricRow = MetricRow {
    name: "",
    label: "",
    long_name: "",
    unit: "",
    doc: "",
    better: Better::Lower,
    perfect: 0.0,
    options: Table {
        name: "",
        doc: "",
        fields: &[],
    },
    smallest: |_| 1,
    eval: |_, _, _| f64::NAN,
    prepare: None,
    map: None,
    noise: Noise::Bounds,
    settle: None,
};

/// Part of the row of a metric that is the mean of an error of pixels and channels, which is also
/// its map: `of_pixels!(|options| error)`, where `error` is a function of the values of the image
/// and of the reference.
macro_rules! of_pixels {
    (|$spec:pat_param| $error:expr) => {
        $crate::MetricRow {
            eval: |image, reference, $spec| $crate::pixels::mean(image, reference, $error),
            map: Some($crate::map::PixelMap {
                eval: |image, reference, $spec| $crate::pixels::each(image, reference, $error),
                colours: $crate::map::Colours::Magma,
                top: None,
            }),
            ..$crate::DEFAULTS
        }
    };
}
use of_pixels;

/// A metric with a fixed reference. Images are as for [`MetricRow::eval`].
pub type Prepared = Box<dyn Fn(&Image) -> f64 + Send + Sync>;

/// Prepares a metric for a reference, which is as for [`MetricRow::eval`].
pub type Prepare = fn(&Image, &MetricSpec) -> Prepared;

/// Returns the options that are `auto`, with the values chosen for a reference.
pub type Settle = fn(&Image, &MetricSpec) -> BTreeMap<String, Value>;

impl PartialEq for MetricRow {
    fn eq(&self, other: &MetricRow) -> bool {
        self.name == other.name
    }
}

impl std::fmt::Debug for MetricRow {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "MetricRow({})", self.name)
    }
}

/// Reasons why a metric cannot be computed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MetricError {
    /// The two images differ in size.
    #[error("image is {}x{} but reference is {}x{}", image[0], image[1], reference[0], reference[1])]
    Size {
        /// Width and height of the image.
        image: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// The images are smaller than the metric's window.
    #[error(
        "`{metric}` needs at least {smallest}x{smallest} pixels but the image is {}x{}: render a larger one or leave the metric out",
        image[0], image[1]
    )]
    TooSmall {
        /// Name of the metric.
        metric: &'static str,
        /// Fewest pixels along each side.
        smallest: u32,
        /// Width and height of the image.
        image: [u32; 2],
    },
    /// The metric has no error map.
    #[error(
        "`{metric}` has no value of single pixels to show as a map (metrics that have: {known})"
    )]
    NoMap {
        /// Name of the metric.
        metric: &'static str,
        /// Names of the metrics with a map.
        known: String,
    },
}

/// All metrics, in the order of documentation.
pub const METRICS: &[MetricRow] = &[
    mse::ROW,
    rmse::ROW,
    mae::ROW,
    relmse::ROW,
    trimmed::ROW,
    mape::ROW,
    mape::SYMMETRIC_ROW,
    psnr::ROW,
    ssim::ROW,
    flip::ROW,
    flip::HDR_ROW,
    bias::ROW,
    bias::ERROR_ROW,
    fireflies::ROW,
];

/// Option of every metric without a tone mapper of its own.
const ON: Field = field! {
    on = "linear radiance, no tone map": Ty::Any("Tonemap"),
        "tone map applied to the image and to the reference first"
};

/// Option of metrics of displayed pictures, which depend on the largest possible value: see
/// [`MetricSpec::new`].
const DISPLAY_ON: Field = Field {
    default: "`tonemap.srgb()`; with `range`, linear radiance",
    ..ON
};

/// Option of metrics that depend on the largest possible value.
const RANGE: Field = field! {
    range = "1": Ty::num(1e-6, f64::MAX),
        "largest value minus smallest value that a channel can have; 1 for display values"
};

/// Returns the row with this name.
pub fn metric(name: &str) -> Option<&'static MetricRow> {
    METRICS.iter().find(|row| row.name == name)
}

impl MetricSpec {
    /// Makes the metric `name` with these options, for the column `column`. A metric with a `range`
    /// for which neither `range` nor `on` is given has the tone map `srgb`: radiance has no largest
    /// value.
    ///
    /// # Errors
    /// When the metric is unknown, or an option is unknown or out of range; error paths begin with
    /// the column.
    pub fn new(
        column: &str,
        name: &str,
        mut options: BTreeMap<String, Value>,
    ) -> Result<MetricSpec, SchemaError> {
        let row = metric(name)
            .ok_or_else(|| unknown_name(column, name, "metric", METRICS.iter().map(|m| m.name)))?;
        row.options.check(column, &options)?;
        let has_range = row.options.fields.iter().any(|f| f.key == RANGE.key);
        if has_range && !options.contains_key(RANGE.key) && !options.contains_key(ON.key) {
            options.insert(
                ON.key.to_owned(),
                Tonemap::Srgb { exposure: 0.0 }.to_value(),
            );
        }
        if let Some(on) = options.get(ON.key) {
            Tonemap::from_value(&format!("{column}.{}", ON.key), on)?;
        }
        Ok(MetricSpec {
            column: column.to_owned(),
            row,
            options,
        })
    }

    /// Computes the metric, after its tone map if it has one.
    ///
    /// # Errors
    /// When the sizes differ, or the images are smaller than the metric's window.
    pub fn eval(&self, image: &Image, reference: &Image) -> Result<f64, MetricError> {
        self.check_sizes(image, reference)?;
        Ok(match self.tonemap() {
            Some(on) => (self.row.eval)(&on.apply(image), &on.apply(reference), self),
            None => (self.row.eval)(image, reference, self),
        })
    }

    /// Computes the error of every pixel, after the metric's tone map if it has one.
    ///
    /// # Errors
    /// Those of [`MetricSpec::eval`], and metrics that have no such map.
    pub fn error_map(&self, image: &Image, reference: &Image) -> Result<ErrorMap, MetricError> {
        self.check_sizes(image, reference)?;
        let Some(map) = &self.row.map else {
            let known: Vec<&str> = METRICS
                .iter()
                .filter(|m| m.map.is_some())
                .map(|m| m.name)
                .collect();
            return Err(MetricError::NoMap {
                metric: self.row.name,
                known: known.join(", "),
            });
        };
        let values = match self.tonemap() {
            Some(on) => (map.eval)(&on.apply(image), &on.apply(reference), self),
            None => (map.eval)(image, reference, self),
        };
        let (width, height) = (image.width, image.height);
        Ok(ErrorMap {
            width,
            height,
            values,
            colours: map.colours,
            top: map.top,
        })
    }

    /// Returns the values of `auto` options for this reference; empty for metrics without such
    /// options.
    pub fn settled(&self, reference: &Image) -> BTreeMap<String, Value> {
        self.row
            .settle
            .map_or_else(BTreeMap::new, |settle| settle(reference, self))
    }

    fn check_sizes(&self, image: &Image, reference: &Image) -> Result<(), MetricError> {
        let size = [image.width, image.height];
        if size != [reference.width, reference.height] {
            return Err(MetricError::Size {
                image: size,
                reference: [reference.width, reference.height],
            });
        }
        let smallest = (self.row.smallest)(self);
        if size.into_iter().any(|side| side < smallest) {
            return Err(MetricError::TooSmall {
                metric: self.row.name,
                smallest,
                image: size,
            });
        }
        Ok(())
    }

    /// Tone map of the option `on`; `None` is linear radiance.
    pub fn tonemap(&self) -> Option<Tonemap> {
        self.options
            .get(ON.key)
            .and_then(|on| Tonemap::from_value(ON.key, on).ok())
    }

    /// Identity of the metric: everything that determines the value, with defaults filled in. The
    /// name of the column is not part of it.
    pub fn identity(&self) -> Value {
        Value::Map(BTreeMap::from([
            ("metric".to_owned(), Value::from(self.row.name)),
            ("options".to_owned(), Value::Map(self.all_options())),
        ]))
    }

    /// Returns all options that change the value, with their defaults.
    pub fn all_options(&self) -> BTreeMap<String, Value> {
        let mut options = BTreeMap::new();
        for field in self.row.options.fields.iter().filter(|f| f.key != ON.key) {
            if let Some(value) = self.option(field.key) {
                options.insert(field.key.to_owned(), value);
            }
        }
        if let Some(on) = self.tonemap() {
            options.insert(ON.key.to_owned(), on.to_value());
        }
        options
    }

    /// Unit of the value, empty if it has none; with a tone map, radiance becomes display value.
    pub fn unit(&self) -> String {
        match self.tonemap() {
            Some(_) => self.row.unit.replace("radiance", "display value"),
            None => self.row.unit.to_owned(),
        }
    }

    /// Options as text for captions:
    /// `range 1, window uniform, on reinhard (exposure 0, gamma 2.2)`.
    pub fn describe_options(&self) -> String {
        let shown = self.row.options.fields.iter().filter(|f| f.key != ON.key);
        let mut words: Vec<String> = shown
            .filter_map(|f| self.option(f.key).map(|v| format!("{} {v}", f.key)))
            .collect();
        words.extend(self.tonemap().map(|on| format!("on {on}")));
        words.join(", ")
    }

    /// Value of an option: as given in the script, or else the default of its row.
    fn option(&self, key: &str) -> Option<Value> {
        let default = || default_of(self.row.options.fields.iter().find(|f| f.key == key)?);
        self.options.get(key).cloned().or_else(default)
    }

    /// Value of a numeric option; NaN if the row has no option of this name.
    fn number(&self, key: &str) -> f64 {
        self.option(key)
            .and_then(|v| v.as_f64())
            .unwrap_or(f64::NAN)
    }

    /// Returns whether a text option has this value.
    fn says(&self, key: &str, word: &str) -> bool {
        self.option(key).is_some_and(|v| v.as_str() == Some(word))
    }
}

/// Default that a field documents, as a value.
fn default_of(field: &Field) -> Option<Value> {
    match field.ty {
        Ty::Num { .. } | Ty::Int { .. } => field.default.parse().ok().map(Value::number),
        Ty::OrAuto(_) => Some(Value::from(field.default)),
        Ty::Word(words) => words
            .iter()
            .find(|w| **w == field.default)
            .map(|w| Value::from(*w)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_documented_default_is_one_that_its_own_schema_allows() {
        for row in METRICS {
            for field in row.options.fields.iter().filter(|f| f.key != ON.key) {
                let default = default_of(field)
                    .unwrap_or_else(|| panic!("{}.{}: {}", row.name, field.key, field.default));
                field.ty.check(row.name, field.key, &default).unwrap();
            }
        }
    }

    #[test]
    fn unknown_names_get_the_nearest_one() {
        let e = MetricSpec::new("noise", "rmsee", BTreeMap::new()).unwrap_err();
        assert_eq!(
            e.to_string(),
            "noise: unknown metric `rmsee` (did you mean `rmse`?)"
        );
        let e = MetricSpec::new(
            "ssim",
            "ssim",
            BTreeMap::from([("rnage".to_owned(), Value::Int(1))]),
        )
        .unwrap_err();
        assert_eq!(
            (e.path.as_str(), e.help.as_deref()),
            ("ssim.rnage", Some("did you mean `range`?"))
        );
        let on = Value::Map(BTreeMap::from([("kind".to_owned(), "rienhard".into())]));
        let e =
            MetricSpec::new("ssim", "ssim", BTreeMap::from([("on".to_owned(), on)])).unwrap_err();
        assert_eq!(
            (e.path.as_str(), e.help.as_deref()),
            ("ssim.on", Some("did you mean `reinhard`?"))
        );
    }

    #[test]
    fn identity_fills_in_defaults_and_tells_options_apart_but_not_columns() {
        let spec = |column: &str, options: &[(&str, Value)]| {
            let options = options
                .iter()
                .map(|(k, v)| ((*k).to_owned(), v.clone()))
                .collect();
            MetricSpec::new(column, "ssim", options).unwrap().identity()
        };
        let srgb = |exposure: f64| {
            Value::Map(BTreeMap::from([
                ("kind".to_owned(), Value::from("srgb")),
                ("exposure".to_owned(), Value::number(exposure)),
            ]))
        };
        let plain = spec("a", &[]);
        assert_eq!(
            plain.to_string(),
            "{metric = ssim, options = {on = {exposure = 0, kind = srgb}, range = 1, window = uniform}}"
        );
        assert_eq!(plain, spec("b", &[("on", srgb(0.0))]));
        let linear = spec("a", &[("range", Value::Int(1))]);
        assert_ne!(plain, linear);
        assert_ne!(linear, spec("a", &[("range", Value::Int(2))]));
        assert_ne!(
            spec("a", &[("on", srgb(0.0))]),
            spec("a", &[("on", srgb(1.0))])
        );
    }

    #[test]
    fn units_follow_the_tone_map() {
        let on = Value::Map(BTreeMap::from([("kind".to_owned(), "srgb".into())]));
        let display = MetricSpec::new("m", "mse", BTreeMap::from([("on".to_owned(), on)])).unwrap();
        assert_eq!(display.unit(), "display value²");
        assert_eq!(display.describe_options(), "on srgb (exposure 0)");
        assert_eq!(
            MetricSpec::new("m", "mse", BTreeMap::new()).unwrap().unit(),
            "radiance²"
        );
    }
}
