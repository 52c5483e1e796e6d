//! Mean absolute error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, MetricRow, ON, pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `mae`.
pub const ROW: MetricRow = MetricRow {
    name: "mae",
    label: "MAE",
    long_name: "mean absolute error",
    unit: "radiance",
    doc: "Mean over pixels and channels of |i - r|.",
    better: Better::Lower,
    perfect: 0.0,
    options: Table {
        name: "MaeOptions",
        doc: "Options of `mae`.",
        fields: &[ON],
    },
    smallest: |_| 1,
    eval: |image, reference, _| pixels::mean(image, reference, |i, r| (i - r).abs()),
    prepare: None,
    map: Some(PixelMap {
        eval: |image, reference, _| pixels::each(image, reference, |i, r| (i - r).abs()),
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::Bounds,
    settle: None,
};
