//! Quantities against which figures of convergence show an error. [`FigureX`] has a row for each.

use serde::{Deserialize, Serialize};

use super::outcome::WaveRow;

/// Description of a [`FigureX`].
#[derive(Clone, Copy, Debug)]
pub struct FigureXRow {
    /// Name in scripts and in the hash of a plan.
    pub name: &'static str,
    /// Name in the files of reports.
    pub file: &'static str,
    /// Name in titles.
    pub quantity: &'static str,
    /// Label of the axis, with the unit.
    pub label: &'static str,
    /// Name in captions, with the unit.
    pub caption: &'static str,
    /// Whether it is a measured time, which devices have of their own.
    pub is_clock: bool,
    /// Whether it is a whole number, so that only whole numbers are marked.
    pub is_whole: bool,
    /// Value at a measurement.
    pub value: fn(&WaveRow) -> f64,
}

/// Declares the quantities: everything about one is in its row. `note` continues its name in the
/// reference of scripts.
macro_rules! figure_axes {
    ($($axis:ident {
        name: $name:literal,
        note: $note:literal,
        file: $file:literal,
        quantity: $quantity:literal,
        label: $label:literal,
        caption: $caption:literal,
        is_clock: $is_clock:literal,
        is_whole: $is_whole:literal,
        value: $value:expr,
    })+) => {
        /// Horizontal axis of a figure of convergence.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum FigureX {
            $(
                #[doc = concat!("Measurements against ", $caption, ".")]
                #[serde(rename = $name)]
                $axis,
            )+
        }

        impl FigureX {
            /// All quantities, in the order of reports. The first is the default of scripts.
            pub const ALL: &[FigureX] = &[$(FigureX::$axis),+];

            /// Description of the key `x` of figures in the reference of scripts.
            pub const X_DOC: &str = concat!(
                "horizontal axis: ",
                $("`", $name, "`", $note, ", ",)+
                "or an axis of the sweep, over which the final values of finished runs are drawn"
            );

            /// Returns the description.
            pub fn row(self) -> FigureXRow {
                match self {
                    $(FigureX::$axis => FigureXRow {
                        name: $name,
                        file: $file,
                        quantity: $quantity,
                        label: $label,
                        caption: $caption,
                        is_clock: $is_clock,
                        is_whole: $is_whole,
                        value: $value,
                    },)+
                }
            }
        }
    };
}

figure_axes! {
    RenderS {
        name: "render_s",
        note: " (render time in seconds)",
        file: "time",
        quantity: "render time",
        label: "render time (s)",
        caption: "render time in seconds",
        is_clock: true,
        is_whole: false,
        value: |row| row.render_s,
    }
    Samples {
        name: "samples",
        note: " (per pixel)",
        file: "samples",
        quantity: "samples",
        label: "samples per pixel",
        caption: "samples per pixel",
        is_clock: false,
        is_whole: true,
        value: |row| row.samples as f64,
    }
}

impl FigureX {
    /// Returns the quantity with this name in scripts.
    pub fn named(name: &str) -> Option<FigureX> {
        FigureX::ALL.iter().copied().find(|x| x.row().name == name)
    }
}
