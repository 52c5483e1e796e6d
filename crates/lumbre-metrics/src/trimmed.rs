//! Relative mean squared error without the worst pixels.

use super::floor::Noise;
use super::{DEFAULTS, MetricRow, MetricSpec, ON, pixels, relmse};
use lumbre_light::field;
use lumbre_light::film::Image;
use lumbre_light::value::schema::{Table, Ty};

/// Table row of the metric `relmse_trimmed`.
pub const ROW: MetricRow = MetricRow {
    name: "relmse_trimmed",
    label: "trimmed relMSE",
    long_name: "relative mean squared error without the worst pixels",
    doc: "`relmse` over the pixels that remain without the worst ones: a few fireflies often decide `relmse`, and this \
          value tells how good the rest is [Müller et al. 2019]. Compare it only beside `relmse`: it also leaves out \
          rare light that a technique should find.",
    options: Table {
        name: "RelMseTrimmedOptions",
        doc: "Options of `relmse_trimmed`.",
        fields: &[
            field! {
                worst = "0.001": Ty::num(0.0, 0.5),
                    "fraction of the pixels that is left out, rounded down to whole pixels; papers \
                     use 0.001 and 0.0001"
            },
            relmse::EPS,
            ON,
        ],
    },
    eval: trimmed,
    noise: Noise::Bounds,
    ..DEFAULTS
};

/// Mean of [`relmse`] over all but the worst pixels. A NaN is never left out.
fn trimmed(image: &Image, reference: &Image, spec: &MetricSpec) -> f64 {
    let mut errors = pixels::each(image, reference, relmse::error(spec.number("eps")));
    if errors.iter().any(|e| e.is_nan()) {
        return f64::NAN;
    }
    let left_out = (spec.number("worst") * errors.len() as f64).floor() as usize;
    let kept = errors.len() - left_out;
    if left_out > 0 {
        errors.select_nth_unstable_by(kept, f32::total_cmp);
    }
    // The selection leaves an order that depends on its algorithm; the sum must not.
    errors.truncate(kept);
    errors.sort_unstable_by(f32::total_cmp);
    errors.iter().map(|e| f64::from(*e)).sum::<f64>() / kept as f64
}
