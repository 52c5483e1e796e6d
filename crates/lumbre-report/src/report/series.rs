//! Compared series, and how they are labelled.

use crate::plot::style::Style;
use crate::plot::svg::{shorten, text_width, wrap};

/// Mark at the end of the label of a series whose pictures are denoised.
pub const BIASED: &str = " (biased)";

/// One of the compared series: a curve of a figure, a column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Series {
    /// Label within its group, such as `bdpt` or `mis = power`.
    pub label: String,
    /// The label without names of axes, such as `power`, for narrow places.
    pub short_label: String,
    /// Values of the compared axes.
    pub values: Vec<String>,
    /// Style of its curves.
    pub style: Style,
    /// Group of series of the same night and device, named after the night or the device. Empty if
    /// there is only one group.
    pub group: String,
    /// Device, if known.
    pub device: Option<String>,
    /// Whether the group is named after the device.
    pub names_device: bool,
    /// Long name of the integrator, if the label is its short name.
    pub long: Option<&'static str>,
}

impl Series {
    /// Returns the label with the group.
    pub fn full_label(&self) -> String {
        self.with_group(&self.label)
    }

    fn with_group(&self, label: &str) -> String {
        if self.group.is_empty() {
            label.to_owned()
        } else {
            format!("{label}, {}", self.group)
        }
    }

    /// Returns the label with the group for a place of this width in letters of this size: without
    /// names of axes where they do not fit.
    pub fn label_within(&self, size: f64, width: f64) -> String {
        let full = self.full_label();
        if text_width(&full, size) <= width {
            return full;
        }
        shorten(&self.with_group(&self.short_label), size, width)
    }

    /// Returns the label with the group as lines for a place of this width: without names of axes
    /// where they do not fit into one line.
    pub fn label_lines(&self, size: f64, width: f64) -> Vec<String> {
        let full = self.full_label();
        if text_width(&full, size) <= width {
            return vec![full];
        }
        wrap(&self.with_group(&self.short_label), size, width)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn narrow_places_have_no_names_of_axes() {
        let mut series = Series {
            label: "technique = bdpt".to_owned(),
            short_label: "bdpt".to_owned(),
            values: vec!["bdpt".to_owned()],
            style: Style::default(),
            group: String::new(),
            device: None,
            names_device: false,
            long: None,
        };
        assert_eq!(series.label_within(10.0, 200.0), "technique = bdpt");
        assert_eq!(series.label_within(10.0, 50.0), "bdpt");
        assert!(series.label_within(10.0, 15.0).ends_with('…'));
        series.group = "night".to_owned();
        assert_eq!(series.label_within(10.0, 65.0), "bdpt, night");
    }
}
