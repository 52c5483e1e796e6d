//! Relative mean squared error.

use super::floor::Noise;
use super::map::{Colours, PixelMap};
use super::{Better, MetricRow, ON, pixels};
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
        fields: &[
            Field {
                key: "eps",
                ty: Ty::Num {
                    min: 1e-9,
                    max: f64::MAX,
                },
                required: false,
                default: "0.01",
                doc: "added to the squared reference, in squared radiance; bounds the weight of black pixels",
            },
            ON,
        ],
    },
    smallest: |_| 1,
    eval: |image, reference, spec| {
        let eps = spec.number("eps");
        pixels::mean(image, reference, |i, r| (i - r) * (i - r) / (r * r + eps))
    },
    prepare: None,
    map: Some(PixelMap {
        eval: |image, reference, spec| {
            let eps = spec.number("eps");
            pixels::each(image, reference, |i, r| (i - r) * (i - r) / (r * r + eps))
        },
        colours: Colours::Magma,
        top: None,
    }),
    noise: Noise::Adds,
    settle: None,
};
