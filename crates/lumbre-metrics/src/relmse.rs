//! Relative mean squared error.

use super::floor::Noise;
use super::{MetricRow, ON, of_pixels};
use lumbre_light::field;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Table row of the metric `relmse`.
pub const ROW: MetricRow = MetricRow {
    name: "relmse",
    label: "relMSE",
    long_name: "relative mean squared error",
    doc: "Mean over pixels and channels of (i - r)² / (r² + eps), so that dark regions count as much as bright ones \
          [Rousselle 2011].",
    options: Table {
        name: "RelMseOptions",
        doc: "Options of `relmse`.",
        fields: &[EPS, ON],
    },
    noise: Noise::AddsRelative,
    ..of_pixels!(|spec| error(spec.number("eps")))
};

/// Option that bounds the weight of black pixels.
pub(super) const EPS: Field = field! {
    eps = "0.01": Ty::num(1e-9, f64::MAX),
        "added to the squared reference, in squared radiance; bounds the weight of black pixels"
};

/// Returns the squared error in proportion to the squared reference.
pub(super) fn error(eps: f64) -> impl Fn(f64, f64) -> f64 + Sync {
    move |i, r| (i - r) * (i - r) / (r * r + eps)
}
