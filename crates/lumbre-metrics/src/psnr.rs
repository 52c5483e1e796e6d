//! Peak signal-to-noise ratio.

use super::floor::Noise;
use super::{Better, DEFAULTS, DISPLAY_ON, MetricRow, RANGE, pixels};
use lumbre_light::value::schema::Table;

/// Table row of the metric `psnr`.
pub const ROW: MetricRow = MetricRow {
    name: "psnr",
    label: "PSNR",
    long_name: "peak signal-to-noise ratio",
    unit: "dB",
    doc: "10 log10(range² / mse); infinite for equal images.",
    better: Better::Higher,
    perfect: f64::INFINITY,
    options: Table {
        name: "PsnrOptions",
        doc: "Options of `psnr`.",
        fields: &[RANGE, DISPLAY_ON],
    },
    eval: |image, reference, spec| {
        let range = spec.number(RANGE.key);
        let mse = pixels::mean(image, reference, |i, r| (i - r) * (i - r));
        10.0 * (range * range / mse).log10()
    },
    noise: Noise::Decibels,
    ..DEFAULTS
};
