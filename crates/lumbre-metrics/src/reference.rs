//! Reference page of the metrics, generated from [`METRICS`].

use super::floor::Noise;
use super::{METRICS, MetricRow, MetricSpec};
use lumbre_light::value::markdown::{fields_table, row, sentence, table_head};

/// Returns the generated part of docs/reference/metrics.md: an overview and one section for each
/// metric.
pub fn reference() -> String {
    let mut out = "## Overview\n\n".to_owned();
    out += &table_head([
        "metric",
        "name",
        "unit",
        "better",
        "equal images",
        "error map",
    ]);
    for metric in METRICS {
        out += &row([
            &format!("[`{0}`](#{0})", metric.name),
            metric.long_name,
            unit(metric),
            &metric.better.to_string(),
            &perfect(metric),
            if metric.map.is_some() { "yes" } else { "no" },
        ]);
    }
    for metric in METRICS {
        out += &section(metric);
    }
    out
}

/// Returns the section of one metric.
fn section(metric: &MetricRow) -> String {
    let mut out = format!("\n## `{}`\n\n", metric.name);
    let name = sentence(metric.long_name);
    let name = name.trim_end_matches('.');
    out += &format!("{name} ({}). {}\n\n", metric.label, sentence(metric.doc));
    out += &format!("- Unit: {}\n", unit(metric));
    out += &format!(
        "- Better: {}; equal images have {}\n",
        metric.better,
        perfect(metric)
    );
    out += &format!("- Noise floor: {}\n", noise_text(metric.noise));
    let smallest = MetricSpec::new(metric.name, metric.name, Default::default())
        .map_or(1, |spec| (metric.smallest)(&spec));
    if smallest > 1 {
        out += &format!("- Smallest image with default options: {smallest} by {smallest} pixels\n");
    }
    if !metric.options.fields.is_empty() {
        out += "\n";
        out += &fields_table(&metric.options);
    }
    out
}

/// Returns the unit of a metric on linear images.
fn unit(metric: &MetricRow) -> &'static str {
    if metric.unit.is_empty() {
        "none"
    } else {
        metric.unit
    }
}

/// Returns the value for two equal images.
fn perfect(metric: &MetricRow) -> String {
    if metric.perfect.is_finite() {
        metric.perfect.to_string()
    } else {
        "infinity".to_owned()
    }
}

/// Describes the effect of the noise of a reference, and whether it can be subtracted.
fn noise_text(noise: Noise) -> &'static str {
    match noise {
        Noise::Adds | Noise::AddsRelative => {
            "estimated from the reference halves; it adds to the value and can be subtracted"
        }
        Noise::AddsSquared => {
            "estimated from the reference halves; its square adds to the square of the value and \
             can be subtracted"
        }
        Noise::Decibels => {
            "estimated from the reference halves; it adds to the squared error behind the decibels \
             and can be subtracted"
        }
        Noise::Similarity => {
            "estimated from the reference halves; a ceiling below 1 that no image can exceed, \
             which cannot be subtracted"
        }
        Noise::Bounds => {
            "estimated from the reference halves; the value stays above it by an unknown amount, \
             so it cannot be subtracted"
        }
        Noise::Silent => "no estimate",
    }
}
