//! Why no plan can be made.

use std::path::PathBuf;

use crate::experiment::spec::HookError;
use crate::experiment::stop::StopError;
use crate::scene::SceneError;
use crate::value::schema::SchemaError;

/// Why no plan can be made of an experiment. `point` is the point of the sweep in words.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// An override or a selection names no axis.
    #[error("there is no axis `{axis}` ({help})")]
    UnknownAxis {
        /// The name as given.
        axis: String,
        /// The nearest axis, or all of them.
        help: String,
    },
    /// A selection, or an override of zipped axes, names a value that the axis does not have.
    #[error("axis `{axis}` has no value `{value}` ({help})")]
    UnknownValue {
        /// The axis.
        axis: String,
        /// The value as given.
        value: String,
        /// The nearest value, or all of them.
        help: String,
    },
    /// An axis without values.
    #[error("axis `{axis}` has no values: give at least one")]
    EmptyAxis {
        /// Its name.
        axis: String,
    },
    /// Two axes of the same name.
    #[error("two axes are called `{axis}`: rename one of them")]
    DuplicateAxis {
        /// The name.
        axis: String,
    },
    /// The same step twice in one axis.
    #[error("axis `{axis}` has `{value}` twice: leave one out, or ask for `repeats`")]
    DuplicateValue {
        /// The axis, or the zipped axes.
        axis: String,
        /// The value, or the values.
        value: String,
    },
    /// Selections that together leave nothing.
    #[error("no point of the sweep has all of {wanted}")]
    NothingSelected {
        /// What was asked for.
        wanted: String,
    },
    /// No repeats.
    #[error("`repeats` is 0: every point needs at least one run")]
    NoRepeats,
    /// More cells than a plan may have.
    #[error("the sweep has {cells} cells ({factors}), more than {limit}: shorten an axis or select with `--only`")]
    TooManyCells {
        /// How many, as a decimal number.
        cells: String,
        /// The factors in words.
        factors: String,
        /// The most there may be.
        limit: u64,
    },
    /// A function of the script failed.
    #[error("{function} at {point}: {error}")]
    Hook {
        /// Which function.
        function: String,
        /// Where in the sweep.
        point: String,
        /// What the script's side says.
        error: HookError,
    },
    /// A scene cannot be loaded.
    #[error("scene at {point}: {error}")]
    Scene {
        /// Where in the sweep.
        point: String,
        /// What is wrong.
        error: Box<SceneError>,
    },
    /// A change to the scene names nothing in it, or has a value of the wrong kind.
    #[error("`set` at {point}: {error}")]
    Set {
        /// Where in the sweep.
        point: String,
        /// What is wrong.
        error: Box<SchemaError>,
    },
    /// No such integrator.
    #[error("at {point}: unknown integrator `{name}` ({help})")]
    UnknownIntegrator {
        /// Where in the sweep.
        point: String,
        /// The name as written.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// No such sampler.
    #[error("at {point}: unknown sampler `{name}` ({help})")]
    UnknownSampler {
        /// Where in the sweep.
        point: String,
        /// The name as written.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// No such backend.
    #[error("at {point}: unknown backend `{name}` ({help})")]
    UnknownBackend {
        /// Where in the sweep.
        point: String,
        /// The name as written.
        name: String,
        /// The nearest name, or all of them.
        help: String,
    },
    /// A backend that this machine cannot use.
    #[error("at {point}: backend `{name}` cannot be used on this machine: {reason}")]
    UnusableBackend {
        /// Where in the sweep.
        point: String,
        /// The backend.
        name: String,
        /// What its probe says.
        reason: String,
    },
    /// A picture without pixels, or with too many.
    #[error("at {point}: a picture of {width}x{height} pixels: each side is at least 1, and all are at most {limit}")]
    Resolution {
        /// Where in the sweep.
        point: String,
        /// Columns.
        width: u32,
        /// Rows.
        height: u32,
        /// The most pixels there may be.
        limit: u64,
    },
    /// Layers that cannot be had.
    #[error("`films` at {point}: {reason}")]
    Films {
        /// Where in the sweep.
        point: String,
        /// What is wrong, and what to do.
        reason: String,
    },
    /// What the backend cannot do.
    #[error("at {point}: backend `{backend}` cannot render this: {reason}")]
    Refused {
        /// Where in the sweep.
        point: String,
        /// The backend.
        backend: String,
        /// What it lacks.
        reason: String,
    },
    /// A path length of zero.
    #[error("at {point}: `max_depth` is 0: a path from the camera to a light has at least 1 edge")]
    NoDepth {
        /// Where in the sweep.
        point: String,
    },
    /// A stop rule that makes no sense.
    #[error("{whose} at {point}: {error}")]
    Stop {
        /// The cell's rule or the reference's.
        whose: &'static str,
        /// Where in the sweep.
        point: String,
        /// What is wrong.
        error: Box<StopError>,
    },
    /// A reference of another size than the cell's picture.
    #[error("at {point}: the picture has {}x{} pixels but its reference {}x{}", cell[0], cell[1], reference[0], reference[1])]
    ReferenceSize {
        /// Where in the sweep.
        point: String,
        /// Width and height of the cell.
        cell: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// A reference that cannot be rendered in parts.
    #[error("`parts` of the reference at {point}: {reason}")]
    Parts {
        /// Where in the sweep.
        point: String,
        /// Why not, and what to do.
        reason: String,
    },
    /// Another program that this machine does not have. The points that need it are left out instead.
    #[error("{technique} is not here: {reason}")]
    Absent {
        /// The technique that needs it.
        technique: &'static str,
        /// What is missing.
        reason: String,
    },
    /// A reference file that cannot be read.
    #[error("reference at {point}: cannot read {}: {reason}", file.display())]
    ReferenceFile {
        /// Where in the sweep.
        point: String,
        /// The file.
        file: PathBuf,
        /// What the system says.
        reason: String,
    },
}
