//! Relative mean squared error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, MetricRow, ON, pixels};
use lumbre_light::field;
use lumbre_light::value::schema::{Field, Table, Ty};

/// Table row of the metric `relmse`.
pub const ROW: MetricRow = MetricRow {
    name: "relmse",
    label: "relMSE",
    long_name: "relative mean squared error",
    unit: "",
    doc: "Mean over pixels and channels of (i - r)² / (r² + eps), so that dark regions count as much as bright ones \
          [Rousselle 2011].",
    better: Better::Lower,
    perfect: 0.0,
    options: Table {
        name: "RelMseOptions",
        doc: "Options of `relmse`.",
        fields: &[EPS, ON],
    },
    smallest: |_| 1,
    eval: |image, reference, spec| pixels::mean(image, reference, error(spec.number("eps"))),
    prepare: None,
    map: Some(PixelMap {
        eval: |image, reference, spec| pixels::each(image, reference, error(spec.number("eps"))),
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::AddsRelative,
    settle: None,
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
