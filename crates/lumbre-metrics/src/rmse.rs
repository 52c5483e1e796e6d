//! Root mean square error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{DEFAULTS, MetricRow, ON, pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `rmse`.
pub const ROW: MetricRow = MetricRow {
    name: "rmse",
    label: "RMSE",
    long_name: "root mean square error",
    unit: "radiance",
    doc: "Square root of `mse`.",
    options: Table {
        name: "RmseOptions",
        doc: "Options of `rmse`.",
        fields: &[ON],
    },
    eval: |image, reference, _| pixels::mean(image, reference, |i, r| (i - r) * (i - r)).sqrt(),
    map: Some(PixelMap {
        eval: |image, reference, _| {
            let squares = pixels::each(image, reference, |i, r| (i - r) * (i - r));
            squares.into_iter().map(f32::sqrt).collect()
        },
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::AddsSquared,
    ..DEFAULTS
};
