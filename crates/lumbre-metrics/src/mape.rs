//! Errors in proportion to radiance: the mean absolute percentage error and its symmetric form.

use super::floor::Noise;
use super::{MetricRow, ON, of_pixels};
use lumbre_light::field;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Table row of the metric `mape`.
pub const ROW: MetricRow = MetricRow {
    name: "mape",
    label: "MAPE",
    long_name: "mean absolute percentage error",
    doc: "Mean over pixels and channels of |i - r| / (|r| + eps), as a fraction: 0.1 is 10 % [Müller et al. 2019].",
    options: Table {
        name: "MapeOptions",
        doc: "Options of `mape`.",
        fields: &[EPS, ON],
    },
    noise: Noise::Bounds,
    ..of_pixels!(|spec| relative(spec.number("eps")))
};

/// Table row of the metric `smape`.
pub const SYMMETRIC_ROW: MetricRow = MetricRow {
    name: "smape",
    label: "SMAPE",
    long_name: "symmetric mean absolute percentage error",
    doc: "Mean over pixels and channels of |i - r| / (|i| + |r| + eps), as a fraction of at most 1, so that no single \
          pixel dominates it [Vogels et al. 2018].",
    options: Table {
        name: "SmapeOptions",
        doc: "Options of `smape`.",
        fields: &[EPS, ON],
    },
    noise: Noise::Bounds,
    ..of_pixels!(|spec| symmetric(spec.number("eps")))
};

/// Option of both metrics.
const EPS: Field = field! {
    eps = "0.01": Ty::num(1e-9, f64::MAX),
        "added to the denominator, in radiance; bounds the weight of black pixels"
};

/// Returns the error in proportion to the reference.
fn relative(eps: f64) -> impl Fn(f64, f64) -> f64 + Sync {
    move |i, r| (i - r).abs() / (r.abs() + eps)
}

/// Returns the error in proportion to the sum of both values.
fn symmetric(eps: f64) -> impl Fn(f64, f64) -> f64 + Sync {
    move |i, r| (i - r).abs() / (i.abs() + r.abs() + eps)
}
