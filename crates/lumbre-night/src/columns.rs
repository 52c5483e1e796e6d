//! Columns of every CSV file of an experiment, with unit and meaning. Writers take the names of
//! their header from here, and so do `data/columns.csv` of a report and the reference page of files.
//!
//! Columns of axes and metrics are named by the script. They stand here as [`AXIS`], [`METRIC`] and
//! the like, with the place of that name in angle brackets.

/// Column of a CSV file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Name in the header.
    pub name: &'static str,
    /// Unit; empty for what has none, such as names, `1` for counts.
    pub unit: &'static str,
    /// Meaning and range.
    pub doc: &'static str,
}

/// A CSV file of an experiment.
#[derive(Clone, Copy, Debug)]
pub struct CsvFile {
    /// Name of the file in the experiment's folder, in the style of the reference page.
    pub name: &'static str,
    /// Meaning of a line.
    pub doc: &'static str,
    /// Columns in the order of the file, in groups that other files may share.
    pub columns: &'static [&'static [Column]],
}

/// Declares a column.
const fn column(name: &'static str, unit: &'static str, doc: &'static str) -> Column {
    Column { name, unit, doc }
}

/// Returns the names of columns.
pub fn names<const N: usize>(columns: &[Column; N]) -> [String; N] {
    columns.map(|column| column.name.to_owned())
}

const SAMPLES_PER_PIXEL: Column = column("samples_per_pixel", "1", "samples per pixel so far");
const RENDER_S: Column = column(
    "render_s",
    "s",
    "seconds inside the renderer so far; all comparisons use this time",
);
const LOST_S: Column = column(
    "lost_s",
    "s",
    "seconds that other work took from the renderer, or during which the process was stopped; not in \
     `render_s`, 0 where that is not watched",
);
const WALL_S: Column = column(
    "wall_s",
    "s",
    "clock time of the run, with measuring and writing, without pauses and turns of others",
);
const PATHS: Column = column("paths", "1", "camera paths so far");
const RAYS: Column = column("rays", "1", "rays so far");
const REPEAT: Column = column("repeat", "", "number of the repeat, from 0");
const RUN: Column = column("run", "", "id of the run and name of its folder");
const SPEED: Column = column(
    "mpaths_per_s",
    "10^6/s",
    "camera paths per second of render time",
);
const WAVE: Column = column("wave", "", "number of the measurement, from 1");
const INVALID: &str = "samples that were NaN or infinite and count as black";

/// Value of a metric without the error of the reference.
const NET: Column = column(
    "<metric>_net",
    "of the metric",
    "value without the error of the reference; only where it can be computed",
);

/// Value of an axis.
const AXIS: [Column; 1] = [column(
    "<axis>",
    "",
    "value of an axis; named `axis.<axis>` where another column has that name",
)];

/// Value of a metric.
const METRIC: [Column; 1] = [column(
    "<metric>",
    "of the metric",
    "value against the reference; named `metric.<metric>` where another column has that name",
)];

/// Columns of `metrics.csv` before the metrics.
pub const MEASUREMENT: [Column; 9] = [
    WAVE,
    column("samples", "1", "samples per pixel so far"),
    RENDER_S,
    WALL_S,
    column("measure_s", "s", "time spent on metrics"),
    PATHS,
    RAYS,
    column("invalid", "1", INVALID),
    LOST_S,
];

/// Columns of `summary.csv` before the axes.
pub const SUMMARY_BEFORE: [Column; 2] = [column("cell", "", "index of the cell, from 0"), RUN];

/// Columns of `summary.csv` between the axes and the metrics.
pub const SUMMARY_AFTER: [Column; 8] = [
    REPEAT,
    column(
        "status",
        "",
        "`done`, `cached`, `failed`, `interrupted` or `not reached`",
    ),
    column("reason", "", "why"),
    SAMPLES_PER_PIXEL,
    RENDER_S,
    WALL_S,
    SPEED,
    column("invalid_samples", "1", INVALID),
];

/// Column of `summary.csv` before `status`, where there is an A/A check.
pub const CONTROL_OF: Column = column(
    "control_of",
    "",
    "repeat that this run duplicates, empty for results; only with an A/A check",
);

/// Columns of `summary.csv` after the metrics, where they are known.
const REFERENCE_NOISE: [Column; 2] = [
    column(
        "<metric>_floor",
        "of the metric",
        "value that a perfect picture would have; only where the noise of a reference is known",
    ),
    NET,
];

/// Column of `repeats.csv` after the axes.
pub const REPEATED: Column = column("runs", "1", "number of finished repeats");

/// Columns of `repeats.csv` before the metrics, each with its bounds.
pub const REPEATED_MEANS: [Column; 3] = [SAMPLES_PER_PIXEL, RENDER_S, SPEED];

/// Runs of a line, in `repeats.csv` and in tables of reports.
pub const RUN_IDS: Column = column("run_ids", "", "ids of the runs, separated by spaces");

/// Bounds of the columns of `repeats.csv`.
const BOUNDS: [Column; 1] = [column(
    "<column>_low, <column>_high",
    "of the column",
    "bounds of the 95 % confidence interval of every mean, by Student's t; empty for a single run",
)];

/// Columns of `aa-check.csv`.
pub const AA_CHECK: [Column; 9] = [
    column("technique", "", "technique that was rendered twice"),
    column("measure", "", "what was compared"),
    column("pairs", "1", "number of pairs of runs"),
    column("ratio", "1", "geometric mean of the ratios of the pairs"),
    column("low", "1", "lower bound of its 95 % confidence interval"),
    column("high", "1", "upper bound"),
    column("p", "1", "p-value of the ratio one"),
    column(
        "single_pair",
        "1",
        "difference of a single pair, where there is one",
    ),
    column("alarm", "", "`true` if the check found a difference"),
];

/// Columns of the data of a report before the axes.
pub const DATA_BEFORE: [Column; 4] = [
    column("program", "", "program that wrote the file"),
    column("night", "", "name of the experiment"),
    column("plan", "", "hash of the plan"),
    RUN,
];

/// Columns of the data of a report after the axes.
pub const DATA_AFTER: [Column; 5] = [
    REPEAT,
    column("seed", "", "seed of all random numbers of the run"),
    column("integrator", "", "technique"),
    column("scene", "", "scene as written in the script"),
    column(
        "device",
        "",
        "device that rendered the run; empty if the run has not finished",
    ),
];

/// Columns of `data/runs.csv` after those.
pub const DATA_STATE: [Column; 2] = [
    column("state", "", "done, unfinished or pending"),
    column("reason", "", "part of the stop rule that ended the run"),
];

/// Column of `data/waves.csv` after those of both files.
pub const DATA_WAVE: [Column; 1] = [WAVE];

/// Columns of the data of a report before the metrics.
pub const DATA_COUNTS: [Column; 5] = [SAMPLES_PER_PIXEL, RENDER_S, WALL_S, PATHS, RAYS];

/// Columns of `data/runs.csv` after the metrics.
pub const DATA_ACCEL: [Column; 5] = [
    column(
        "lanes",
        "1",
        "number of paths that the processor traced at a time, one in each lane of a vector; empty if \
         unknown",
    ),
    column(
        "accel_build_s",
        "s",
        "seconds spent building acceleration structures, before the first sample",
    ),
    column("accel_nodes", "1", "nodes of the acceleration structures"),
    column(
        "accel_bytes",
        "B",
        "size of the acceleration structures with their primitives; 0 or empty if unknown",
    ),
    column(
        "accel_cost",
        "1",
        "expected number of nodes and primitives tested by a ray (surface area heuristic); 0 or \
         empty if unknown",
    ),
];

/// Columns of `data/columns.csv`.
pub const DATA_COLUMNS: [Column; 3] = [
    column("column", "", "name of a column of the other files"),
    column("unit", "", "its unit"),
    column("meaning", "", "its meaning"),
];

/// Columns of the points of a figure, after the axes.
pub const FIGURE: [Column; 6] = [
    column("metric", "", "metric or value that is drawn"),
    column("x", "of the horizontal axis", "place of the point"),
    column(
        "mean",
        "of the metric",
        "mean over the repeats; where the distance from the best value is drawn, as of SSIM, the best value without the mean distance",
    ),
    column(
        "low",
        "of the metric",
        "lower end of the band: of two runs their range, of more the 95 % confidence interval; \
         empty for a single run",
    ),
    column("high", "of the metric", "upper end"),
    REPEATED,
];

/// Columns of a table of a report, after the labels of its rows.
pub const TABLE: [Column; 15] = [
    column("group", "", "heading above the column, if there is one"),
    column("column", "", "name of the column"),
    column("value", "of `unit`", "mean over the runs"),
    column(
        "ci95_low",
        "of `unit`",
        "lower bound of the 95 % confidence interval",
    ),
    column("ci95_high", "of `unit`", "upper bound"),
    column(
        "bound",
        "",
        "`lower` or `upper` if the value is only such a bound, `median` for that of runs of which some have one",
    ),
    column(
        "best",
        "",
        "1 for a value that is significantly better than each other one of its row and group, else 0",
    ),
    column(
        "worse",
        "",
        "how many times worse the value is than the best one of its row and group; by how much, if the values are not compared by ratios",
    ),
    column(
        "worse_low",
        "",
        "lower end of its 95 % interval, which holds for all pairs of the row together",
    ),
    column("worse_high", "", "upper end"),
    column("p", "", "its p-value, corrected in the same way"),
    column(
        "at_floor",
        "",
        "1 if the noise of the reference hides it, else 0",
    ),
    REPEATED,
    column("unit", "", "unit of the value"),
    RUN_IDS,
];

/// Labels of the rows of a table.
const LABELS: [Column; 1] = [column(
    "<label>",
    "",
    "label of the row, such as the value of an axis",
)];

/// Columns of a table of a script, after the labels of its rows.
const WIDE_TABLE: [Column; 3] = [
    column(
        "<column>",
        "of the value",
        "mean over the runs; empty if it is only a bound",
    ),
    column("runs: <column>", "1", "number of runs"),
    column(
        "±95 %: <column>",
        "of the value",
        "half width of the 95 % confidence interval; only if some value has one",
    ),
];

/// All CSV files, but for curves over the time axis and for what a script or a user names.
pub const CSV_FILES: &[CsvFile] = &[
    CsvFile {
        name: "`metrics.csv` of a run",
        doc: "One line per wave, in order; every line is the state after all samples so far. \
              Infinities and NaN are written as `inf`, `-inf` and `NaN`.",
        columns: &[&MEASUREMENT, &METRIC, &[NET]],
    },
    CsvFile {
        name: "`summary.csv`",
        doc: "One line per cell in the plan's order, of its last wave. What was not measured is \
              empty.",
        columns: &[
            &SUMMARY_BEFORE,
            &AXIS,
            &SUMMARY_AFTER,
            &[CONTROL_OF],
            &METRIC,
            &REFERENCE_NOISE,
        ],
    },
    CsvFile {
        name: "`repeats.csv`",
        doc: "One line per point of the sweep, where some point has several finished runs: means \
              over its repeats.",
        columns: &[
            &AXIS,
            &[REPEATED],
            &REPEATED_MEANS,
            &METRIC,
            &BOUNDS,
            &[RUN_IDS],
        ],
    },
    CsvFile {
        name: "`aa-check.csv`",
        doc: "One line per finding of the A/A check (with `x:control()`).",
        columns: &[&AA_CHECK],
    },
    CsvFile {
        name: "`figures/<name>_<facet>.csv`",
        doc: "One line per point that is drawn.",
        columns: &[&AXIS, &FIGURE],
    },
    CsvFile {
        name: "`tables/<name>.csv`",
        doc: "One line per row of the table.",
        columns: &[&LABELS, &WIDE_TABLE],
    },
    CsvFile {
        name: "`report/tables/*.csv`",
        doc: "One line per value of the table. What is missing is empty.",
        columns: &[&LABELS, &TABLE],
    },
    CsvFile {
        name: "`report/data/runs.csv`",
        doc: "One line per run of every plan, finished or not. Axes are named `axis.<axis>`, \
              metrics `metric.<metric>`.",
        columns: &[
            &DATA_BEFORE,
            &AXIS,
            &DATA_AFTER,
            &DATA_STATE,
            &DATA_COUNTS,
            &METRIC,
            &DATA_ACCEL,
        ],
    },
    CsvFile {
        name: "`report/data/waves.csv`",
        doc: "One line per measurement of each run, named likewise.",
        columns: &[
            &DATA_BEFORE,
            &AXIS,
            &DATA_AFTER,
            &DATA_WAVE,
            &DATA_COUNTS,
            &METRIC,
        ],
    },
    CsvFile {
        name: "`report/data/columns.csv`",
        doc: "One line per column of the two files above, with the metrics of the experiment.",
        columns: &[&DATA_COLUMNS],
    },
];
