//! Mean absolute error.

use super::floor::Noise;
use super::{MetricRow, ON, of_pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `mae`.
pub const ROW: MetricRow = MetricRow {
    name: "mae",
    label: "MAE",
    long_name: "mean absolute error",
    unit: "radiance",
    doc: "Mean over pixels and channels of |i - r|.",
    options: Table {
        name: "MaeOptions",
        doc: "Options of `mae`.",
        fields: &[ON],
    },
    noise: Noise::Bounds,
    ..of_pixels!(|_| |i, r| (i - r).abs())
};
