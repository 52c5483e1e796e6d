//! Compared series, and how they are labelled.

use crate::output::plot::style::Colour;

/// Mark at the end of the label of a series whose pictures are denoised.
pub const BIASED: &str = " (biased)";

/// One of the compared series: a curve of a figure, a column of a table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Series {
    /// Label within its group, such as `bdpt` or `mis = power`.
    pub label: String,
    /// Colour that the script gives to it.
    pub colour: Option<Colour>,
    /// Group of series of the same night and device, named after the night or the device. Empty if
    /// there is only one group.
    pub group: String,
    /// Device, if known.
    pub device: Option<String>,
    /// Long name of the integrator, if the label is its short name.
    pub long: Option<&'static str>,
}

impl Series {
    /// Returns the label with the group.
    pub fn full_label(&self) -> String {
        if self.group.is_empty() {
            self.label.clone()
        } else {
            format!("{}, {}", self.label, self.group)
        }
    }
}
