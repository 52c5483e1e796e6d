//! Quantities of runs that tables and figures over an axis show. [`RunColumn`] has a row for each
//! that every run has.

use serde::{Deserialize, Serialize};

use super::outcome::WaveRow;
use lumbre_render::OpenStats;

/// Description of a [`RunColumn`].
#[derive(Clone, Copy, Debug)]
pub struct RunColumnRow {
    /// Name in scripts.
    pub name: &'static str,
    /// Name in the hash of a plan.
    pub hashed: &'static str,
    /// Label of an axis or column, with the unit.
    pub label: &'static str,
    /// Description, as the beginning of a sentence.
    pub description: &'static str,
    /// Whether it is a measured time or depends on one.
    pub is_clock: bool,
    /// Computes it from the last measurement of a run and what was measured when it was opened.
    /// `None` if the run has no such value.
    pub value: fn(&WaveRow, &OpenStats) -> Option<f64>,
}

/// Declares the columns: everything about one is in its row. `note` continues its name in the
/// reference of scripts.
macro_rules! run_columns {
    ($($column:ident {
        name: $name:literal,
        note: $note:literal,
        hashed: $hashed:literal,
        label: $label:literal,
        description: $description:literal,
        is_clock: $is_clock:literal,
        value: $value:expr,
    })+) => {
        /// Quantity that every run has, at its end.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
        pub enum RunColumn {
            $(
                #[doc = concat!($description, ".")]
                #[serde(rename = $name)]
                $column,
            )+
        }

        impl RunColumn {
            /// All columns, in the order of the reference.
            pub const ALL: &[RunColumn] = &[$(RunColumn::$column),+];

            /// Description of the key `value` of tables in the reference of scripts.
            pub const VALUE_DOC: &str = concat!(
                "a metric column (final value), ",
                $("`", $name, "`", $note, ", ",)+
                "or time_to(column, threshold)"
            );

            /// Returns the description.
            pub fn row(self) -> RunColumnRow {
                match self {
                    $(RunColumn::$column => RunColumnRow {
                        name: $name,
                        hashed: $hashed,
                        label: $label,
                        description: $description,
                        is_clock: $is_clock,
                        value: $value,
                    },)+
                }
            }
        }
    };
}

/// Returns a number that was measured, which is positive.
fn measured(x: f64) -> Option<f64> {
    (x > 0.0).then_some(x)
}

run_columns! {
    Samples {
        name: "samples",
        note: " (per pixel)",
        hashed: "samples",
        label: "samples per pixel",
        description: "Samples per pixel at the end",
        is_clock: false,
        value: |last, _| Some(last.samples as f64),
    }
    RenderS {
        name: "render_s",
        note: " (s)",
        hashed: "render_s",
        label: "render time (s)",
        description: "Render time at the end in seconds",
        is_clock: true,
        value: |last, _| Some(last.render_s),
    }
    MpathsPerS {
        name: "mpaths_s",
        note: " (million paths per second)",
        hashed: "mpaths_per_s",
        label: "Mpaths/s",
        description: "Million camera paths per second of render time",
        is_clock: true,
        value: |last, _| Some(last.mpaths_per_s()),
    }
    Fps {
        name: "fps",
        note: " (samples of every pixel per second)",
        hashed: "fps",
        label: "FPS (1/s)",
        description: "Frames per second of render time (a frame is one sample of every pixel)",
        is_clock: true,
        value: |last, _| Some(last.fps()),
    }
    MraysPerS {
        name: "mrays_s",
        note: " (million rays per second)",
        hashed: "mrays_per_s",
        label: "Mrays/s",
        description: "Million rays per second of render time",
        is_clock: true,
        value: |last, _| (last.render_s > 0.0).then(|| last.rays as f64 / last.render_s / 1e6),
    }
    AccelBuildS {
        name: "accel_build_s",
        note: " (s)",
        hashed: "accel_build_s",
        label: "build (s)",
        description: "Build time of the acceleration structure in seconds",
        is_clock: true,
        value: |_, open| measured(open.accel_build_s),
    }
    AccelNodes {
        name: "accel_nodes",
        note: "",
        hashed: "accel_nodes",
        label: "nodes",
        description: "Number of nodes of the acceleration structure",
        is_clock: false,
        value: |_, open| measured(open.accel_nodes as f64),
    }
    AccelMib {
        name: "accel_mib",
        note: " (MiB)",
        hashed: "accel_mib",
        label: "acceleration structure (MiB)",
        description: "Size of the acceleration structure in MiB, including its primitives",
        is_clock: false,
        value: |_, open| measured(open.accel_bytes as f64 / f64::from(1 << 20)),
    }
    AccelCost {
        name: "accel_cost",
        note: "",
        hashed: "accel_cost",
        label: "SAH cost",
        description: "Expected number of nodes and primitives tested by a ray through the scene's \
                      bounding box (surface area heuristic)",
        is_clock: false,
        value: |_, open| measured(open.accel_cost),
    }
}

/// Quantity of a cell that a table or a sweep figure shows.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableValue {
    /// Final value of a metric column.
    Metric(String),
    /// Quantity that every run has.
    #[serde(rename = "column")]
    Run(RunColumn),
    /// Seconds of render time until a metric column reached a threshold for good.
    TimeTo {
        /// Column of the metric.
        column: String,
        /// Threshold in units of the metric.
        threshold: f64,
    },
}

impl TableValue {
    /// Returns the quantity with this name in scripts: a [`RunColumn`], or a metric column.
    pub fn named(name: String) -> TableValue {
        let column = RunColumn::ALL.iter().find(|c| c.row().name == name);
        column.map_or(TableValue::Metric(name), |c| TableValue::Run(*c))
    }

    /// Name in scripts: `accel_nodes`, a metric's column, or `time_to(column, threshold)`.
    pub fn name(&self) -> String {
        match self {
            TableValue::Metric(column) => column.clone(),
            TableValue::Run(column) => column.row().name.to_owned(),
            TableValue::TimeTo { column, threshold } => format!("time_to({column}, {threshold})"),
        }
    }

    /// Whether the quantity is a measured time or depends on one.
    pub fn is_clock(&self) -> bool {
        match self {
            TableValue::Metric(_) => false,
            TableValue::Run(column) => column.row().is_clock,
            TableValue::TimeTo { .. } => true,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_column_is_found_by_its_own_name() {
        let names: BTreeSet<&str> = RunColumn::ALL.iter().map(|c| c.row().name).collect();
        let hashed: BTreeSet<&str> = RunColumn::ALL.iter().map(|c| c.row().hashed).collect();
        assert_eq!([names.len(), hashed.len()], [RunColumn::ALL.len(); 2]);
        for column in RunColumn::ALL {
            let value = TableValue::named(column.row().name.to_owned());
            assert_eq!(value, TableValue::Run(*column));
            assert_eq!(value.name(), column.row().name);
        }
        assert_eq!(
            TableValue::named("rmse".to_owned()),
            TableValue::Metric("rmse".to_owned())
        );
    }
}
