//! Formats names and numbers for tables, figures and CSV files.

use lumbre_light::transport::integrator::integrator;
use lumbre_metrics::MetricSpec;

/// Returns the index of a metric column, and its metric.
pub fn column<'a>(metrics: &'a [MetricSpec], name: &str) -> Option<(usize, &'a MetricSpec)> {
    metrics.iter().enumerate().find(|(_, m)| m.column == name)
}

/// Returns the long name of an integrator, or `None` if it is unknown.
pub fn integrator_long_name(name: &str) -> Option<&'static str> {
    integrator(name).map(|row| row.long_name)
}

/// Formats a metric, such as `RMSE (root mean square error)`. Appends the column name if it differs
/// from the metric's.
pub fn metric_title(spec: &MetricSpec) -> String {
    let also = if spec.column == spec.row.name {
        String::new()
    } else {
        format!(", column `{}`", spec.column)
    };
    format!("{} ({}{also})", spec.row.label, spec.row.long_name)
}

/// Formats a metric as [`metric_title`], followed by its options.
pub fn metric_description(spec: &MetricSpec) -> String {
    let options = spec.describe_options();
    if options.is_empty() {
        metric_title(spec)
    } else {
        format!("{} with {options}", metric_title(spec))
    }
}

/// Appends a unit to a name, such as `time (s)`. An empty unit leaves the name unchanged.
pub fn with_unit(name: &str, unit: &str) -> String {
    if unit.is_empty() {
        name.to_owned()
    } else {
        format!("{name} ({unit})")
    }
}

/// Formats a number with `digits` significant digits. Uses an exponent only outside of 1e-4 to 1e7.
/// Not-a-number is `NaN`.
pub fn significant(x: f64, digits: usize) -> String {
    if !x.is_finite() || x == 0.0 {
        return if x == f64::INFINITY {
            "inf".to_owned()
        } else {
            x.to_string()
        };
    }
    lumbre_night::text::significant(x, digits, -4..=6)
}

/// Formats a number for programs: the shortest text that parses to the same `f64`, or `nan`, `inf`,
/// `-inf`.
pub fn exact(x: f64) -> String {
    if x.is_nan() {
        "nan".to_owned()
    } else {
        x.to_string()
    }
}

#[cfg(test)]
mod tests {
    use crate::format::*;

    #[test]
    fn significant_digits() {
        let cases = [
            (0.012345, "0.01235"),
            (12.0, "12.00"),
            (1024.0, "1024"),
            (123_456.0, "123456"),
            (0.000_012_346, "1.235e-5"),
            (9.9999, "10.00"),
            (1e9, "1.000e9"),
            (-0.5, "-0.5000"),
            (0.0, "0"),
            (f64::INFINITY, "inf"),
            (f64::NAN, "NaN"),
        ];
        for (x, text) in cases {
            assert_eq!(significant(x, 4), text);
        }
    }

    #[test]
    fn exact_numbers_are_short_and_nan_has_a_name() {
        assert_eq!(exact(0.1), "0.1");
        assert_eq!(exact(f64::NAN), "nan");
    }
}
