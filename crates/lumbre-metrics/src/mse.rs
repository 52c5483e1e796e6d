//! Mean squared error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, MetricRow, ON, pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `mse`.
pub const ROW: MetricRow = MetricRow {
    name: "mse",
    label: "MSE",
    long_name: "mean squared error",
    unit: "radiance²",
    doc: "Mean over pixels and channels of (i - r)².",
    better: Better::Lower,
    perfect: 0.0,
    options: Table {
        name: "MseOptions",
        doc: "Options of `mse`.",
        fields: &[ON],
    },
    smallest: |_| 1,
    eval: |image, reference, _| pixels::mean(image, reference, |i, r| (i - r) * (i - r)),
    prepare: None,
    map: Some(PixelMap {
        eval: |image, reference, _| pixels::each(image, reference, |i, r| (i - r) * (i - r)),
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::Adds,
    settle: None,
};
