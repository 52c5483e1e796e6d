//! Mean squared error.

use super::floor::Noise;
use super::{MetricRow, ON, of_pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `mse`.
pub const ROW: MetricRow = MetricRow {
    name: "mse",
    label: "MSE",
    long_name: "mean squared error",
    unit: "radiance²",
    doc: "Mean over pixels and channels of (i - r)².",
    options: Table {
        name: "MseOptions",
        doc: "Options of `mse`.",
        fields: &[ON],
    },
    noise: Noise::Adds,
    ..of_pixels!(|_| |i, r| (i - r) * (i - r))
};
