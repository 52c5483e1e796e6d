//! Limits of the difference of two pictures, and their results in the format of JUnit, which other
//! programs' tests read.

use serde_json::{Value as Json, json};

use crate::cli::exit::Failure;
use crate::cli::format::{counted, rounded};
use lumbre_light::film::Image;
use lumbre_light::film::ztest::Estimate;
use lumbre_metrics::{Better, MetricSpec};
use lumbre_night::experiment::bias_check::check_bias;
use lumbre_report::plot::escape;

/// Name of the limit of the noise.
const ZTEST: &str = "ztest";
/// Name of the limit of the bias that the noise may hide.
const DETECTS: &str = "detects";
/// False discovery rate at which that bias is stated.
const DETECTION_RATE: f64 = 0.001;

/// A limit of the difference of two pictures.
pub(super) enum Limit {
    /// The pictures differ by no more than their noise, at this false discovery rate.
    Noise {
        /// Text on the command line.
        text: String,
        /// Greatest share of false alarms, in (0, 1).
        rate: f64,
    },
    /// The noise is low enough for a test of the whole pictures to find this relative bias.
    Detects {
        /// Text on the command line.
        text: String,
        /// Relative bias of the total light, positive.
        bias: f64,
    },
    /// A metric is not worse than a value.
    Metric {
        /// Text on the command line.
        text: String,
        /// Metric with its options.
        spec: MetricSpec,
        /// Worst accepted value.
        worst: f64,
    },
}

/// Result of checking one limit.
pub(super) struct LimitResult {
    /// Limit as on the command line.
    pub limit: String,
    /// Measured value, or the result of the comparison, as text.
    pub found: String,
    /// Whether the limit holds.
    pub holds: bool,
}

impl Limit {
    /// Parses `ztest=RATE`, `detects=BIAS` or `METRIC=VALUE`, where `metric` parses the metric.
    ///
    /// # Errors
    /// Returns an error for another form, an unknown metric, and a rate or bias outside of (0, 1).
    pub fn parse(
        text: &str,
        metric: impl Fn(&str) -> Result<MetricSpec, Failure>,
    ) -> Result<Limit, Failure> {
        let expected = || {
            Failure::usage(format!(
                "--fail {text}: expected {ZTEST}=RATE with a rate such as 0.001, {DETECTS}=BIAS with \
                 a relative bias such as 0.01, or METRIC=VALUE"
            ))
        };
        let (name, value) = text.rsplit_once('=').ok_or_else(expected)?;
        let value: f64 = value.trim().parse().map_err(|_| expected())?;
        let text = text.to_owned();
        let noise = match name.trim() {
            ZTEST => Some(Limit::Noise {
                text: text.clone(),
                rate: value,
            }),
            DETECTS => Some(Limit::Detects {
                text: text.clone(),
                bias: value,
            }),
            _ => None,
        };
        if let Some(limit) = noise {
            let is_share = value > 0.0 && value < 1.0;
            return is_share.then_some(limit).ok_or_else(expected);
        }
        let spec = metric(name)?;
        Ok(Limit::Metric {
            text,
            spec,
            worst: value,
        })
    }

    /// Returns whether the limit compares the pictures with their noise.
    pub fn needs_noise(&self) -> bool {
        !matches!(self, Limit::Metric { .. })
    }

    /// Checks the limit on pictures of equal size. `variances` are those of the pixels of both;
    /// `None` for a picture without noise.
    ///
    /// # Errors
    /// Returns an error if the metric does not apply to the pictures.
    pub fn check(
        &self,
        images: [&Image; 2],
        variances: &[Option<Image>; 2],
    ) -> Result<LimitResult, Failure> {
        let [image, reference] = images;
        let checked = |rate: f64| {
            let exact = Image::new(image.width, image.height);
            let [a, b] = [0, 1].map(|i| Estimate {
                mean: images[i],
                variance: variances[i].as_ref().unwrap_or(&exact),
            });
            let all = [a, b].map(|estimate| [estimate.mean, estimate.variance]);
            match all.as_flattened().iter().find_map(|i| not_finite(i)) {
                Some(found) => Err(format!("a picture or its noise has {found}")),
                None => Ok(check_bias(a, b, rate)),
            }
        };
        let (limit, (found, holds)) = match self {
            Limit::Noise { text, rate } => {
                let found = checked(*rate).map(|result| {
                    let holds = result.comparisons > 0 && result.agrees();
                    (result.describe(), holds)
                });
                (text, found.unwrap_or_else(|broken| (broken, false)))
            }
            Limit::Detects { text, bias } => {
                let found = checked(DETECTION_RATE).map(|result| {
                    if result.comparisons == 0 || !result.is_whole_judged {
                        let why =
                            "few pixels have most of the noise, or too little light was found";
                        return (format!("{why}: the whole pictures are not compared"), false);
                    }
                    let least = result.least_bias();
                    let least_percent = rounded(100.0 * least);
                    let found = format!(
                        "a bias of the total light of {least_percent} % is found in four of five \
                         cases"
                    );
                    (found, least <= *bias)
                });
                (text, found.unwrap_or_else(|broken| (broken, false)))
            }
            Limit::Metric { text, spec, worst } => {
                let value = spec.eval(image, reference).map_err(Failure::usage)?;
                let holds = match spec.row.better {
                    Better::Lower => value <= *worst,
                    Better::Higher => value >= *worst,
                    Better::NearZero => value.abs() <= worst.abs(),
                };
                (text, (rounded(value), holds))
            }
        };
        Ok(LimitResult {
            limit: limit.clone(),
            found,
            holds,
        })
    }
}

/// Describes the pixels of a picture that are not finite, if there are any: how many, and the first.
pub(super) fn not_finite(image: &Image) -> Option<String> {
    let is_broken = |pixel: &&[f32; 3]| pixel.iter().any(|x| !x.is_finite());
    let at = image.data.iter().position(|pixel| is_broken(&pixel))?;
    let (x, y) = (at % image.width as usize, at / image.width as usize);
    let count = counted(image.data.iter().filter(is_broken).count(), "pixel");
    Some(format!("{count} not finite, the first at {x},{y}"))
}

impl LimitResult {
    /// Returns the result as JSON.
    pub fn json(&self) -> Json {
        json!({ "limit": self.limit, "found": self.found, "holds": self.holds })
    }
}

/// Formats results in the XML format of JUnit, one test case for each limit.
pub(super) fn junit(files: [&str; 2], results: &[LimitResult]) -> String {
    let [image, reference] = files.map(escape);
    let failures = results.iter().filter(|result| !result.holds).count();
    let cases = results.iter().map(|result| {
        let (limit, found) = (escape(&result.limit), escape(&result.found));
        let head = format!("  <testcase classname=\"{image}\" name=\"{limit}\"");
        if result.holds {
            format!("{head}>\n    <system-out>{found}</system-out>\n  </testcase>\n")
        } else {
            format!("{head}>\n    <failure message=\"{found}\"/>\n  </testcase>\n")
        }
    });
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<testsuite name=\"{image} against {reference}\" \
         tests=\"{}\" failures=\"{failures}\">\n{}</testsuite>\n",
        results.len(),
        cases.collect::<String>()
    )
}
