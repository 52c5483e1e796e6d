//! Errors of planning an experiment.

use std::path::PathBuf;

use crate::experiment::hook_error::HookError;
use crate::experiment::stop::StopError;
use lumbre_light::scene::SceneError;
use lumbre_light::value::schema::SchemaError;

/// Returns ` at ` and the description of a point; nothing for the only point of a sweep, which has
/// no description.
fn at(point: &str) -> String {
    if point.is_empty() {
        String::new()
    } else {
        format!(" at {point}")
    }
}

/// Returns the beginning of a message about a point, and about `what` there; nothing for the only
/// point of a sweep.
fn start(what: &str, point: &str) -> String {
    if point.is_empty() {
        String::new()
    } else {
        format!("{what}at {point}: ")
    }
}

/// Why no plan can be made of an experiment.
///
/// `point` is a description of the point of the sweep where the error was found; empty if it is the
/// only one.
#[derive(Debug, thiserror::Error)]
pub enum PlanError {
    /// An override or a selection names an axis that does not exist.
    #[error("there is no axis `{axis}` ({help})")]
    UnknownAxis {
        /// Name as given.
        axis: String,
        /// The most similar axis, or the existing ones.
        help: String,
    },
    /// An override names neither an axis nor a setting.
    #[error("there is no axis or setting `{name}` (did you mean `{near}`?)")]
    UnknownSetting {
        /// Name as given.
        name: String,
        /// The most similar setting.
        near: &'static str,
    },
    /// A selection or an override of zipped axes names a value that the axis does not have.
    #[error("axis `{axis}` has no value `{value}` ({help})")]
    UnknownValue {
        /// Name of the axis.
        axis: String,
        /// Value as given.
        value: String,
        /// The most similar value, or the existing ones.
        help: String,
    },
    /// An axis has no values.
    #[error("axis `{axis}` has no values: give at least one")]
    EmptyAxis {
        /// Name of the axis.
        axis: String,
    },
    /// Two axes have the same name.
    #[error("two axes are called `{axis}`: rename one of them")]
    DuplicateAxis {
        /// The common name.
        axis: String,
    },
    /// An axis has the same step twice.
    #[error("axis `{axis}` has the value `{value}` twice: remove one, or use `repeats`")]
    DuplicateValue {
        /// Name of the axis, or of the zipped axes.
        axis: String,
        /// The value, or the values of zipped axes.
        value: String,
    },
    /// Selections that no point fulfils together.
    #[error("no point of the sweep matches all of {wanted}: select other values with `--only`")]
    NothingSelected {
        /// The selections as given.
        wanted: String,
    },
    /// The number of repeats is zero.
    #[error("`repeats` is 0: set it to at least 1")]
    NoRepeats,
    /// The sweep has more cells than a plan may have.
    #[error(
        "the sweep has {cells} cells ({factors}), more than the limit of {limit}: shorten an axis, \
         or select points with `--only`"
    )]
    TooManyCells {
        /// Number of cells, in decimal.
        cells: String,
        /// Description of the factors whose product it is.
        factors: String,
        /// Greatest number of cells.
        limit: u64,
    },
    /// A function of the script failed.
    #[error("{function}{}: {error}", at(point))]
    Hook {
        /// Name of the function.
        function: String,
        /// Description of the point.
        point: String,
        /// Error of the script's function.
        error: HookError,
    },
    /// A scene cannot be loaded.
    #[error("{}{error}", start("scene ", point))]
    Scene {
        /// Description of the point.
        point: String,
        /// Cause of the failure.
        error: Box<SceneError>,
    },
    /// A change to the scene has an unknown path or a value of the wrong kind.
    #[error("{}{error}", start("`set` ", point))]
    Set {
        /// Description of the point.
        point: String,
        /// Cause of the failure.
        error: Box<SchemaError>,
    },
    /// An integrator does not exist.
    #[error("{}unknown integrator `{name}` ({help})", start("", point))]
    UnknownIntegrator {
        /// Description of the point.
        point: String,
        /// Name as written.
        name: String,
        /// The most similar name, or the existing ones.
        help: String,
    },
    /// A sampler does not exist.
    #[error("{}unknown sampler `{name}` ({help})", start("", point))]
    UnknownSampler {
        /// Description of the point.
        point: String,
        /// Name as written.
        name: String,
        /// The most similar name, or the existing ones.
        help: String,
    },
    /// A backend does not exist.
    #[error("{}unknown backend `{name}` ({help})", start("", point))]
    UnknownBackend {
        /// Description of the point.
        point: String,
        /// Name as written.
        name: String,
        /// The most similar name, or the existing ones.
        help: String,
    },
    /// A backend cannot be used on this machine.
    #[error(
        "{}backend `{name}` cannot be used on this machine: {reason}",
        start("", point)
    )]
    UnusableBackend {
        /// Description of the point.
        point: String,
        /// Name of the backend.
        name: String,
        /// Result of its probe.
        reason: String,
    },
    /// A picture has no pixels, or too many.
    #[error(
        "{}a picture of {width}x{height} pixels is not possible: use sides of at least 1 \
         and at most {limit} pixels in all",
        start("", point)
    )]
    Resolution {
        /// Description of the point.
        point: String,
        /// Width in pixels.
        width: u32,
        /// Height in pixels.
        height: u32,
        /// Greatest number of pixels.
        limit: u64,
    },
    /// Layers or time bins that the run cannot have.
    #[error("`films`{}: {reason}", at(point))]
    Films {
        /// Description of the point.
        point: String,
        /// Cause and remedy.
        reason: String,
    },
    /// The backend does not support something that the run needs.
    #[error("{}backend `{backend}` cannot render this: {reason}", start("", point))]
    Refused {
        /// Description of the point.
        point: String,
        /// Name of the backend.
        backend: String,
        /// The missing feature.
        reason: String,
    },
    /// A folder of shaders cannot be used.
    #[error("{}`shaders` cannot be used: {reason}", start("", point))]
    Shaders {
        /// Description of the point.
        point: String,
        /// The backend, and why it cannot use the folder.
        reason: String,
    },
    /// The path length is limited to zero edges.
    #[error(
        "{}`max_depth` is 0: set it to at least 1, the number of edges of a path from \
         the camera to a light",
        start("", point)
    )]
    NoDepth {
        /// Description of the point.
        point: String,
    },
    /// A stop rule is invalid.
    #[error("{rule}{}: {error}", at(point))]
    Stop {
        /// Name of the rule: of the cell or of the reference.
        rule: &'static str,
        /// Description of the point.
        point: String,
        /// Cause of the failure.
        error: Box<StopError>,
    },
    /// A reference has another size than the cell's picture.
    #[error(
        "{}the picture has {}x{} pixels but its reference {}x{}: use the same \
         `resolution`", start("", point),
        cell[0], cell[1], reference[0], reference[1]
    )]
    ReferenceSize {
        /// Description of the point.
        point: String,
        /// Width and height of the cell.
        cell: [u32; 2],
        /// Width and height of the reference.
        reference: [u32; 2],
    },
    /// The bias check cannot judge a technique.
    #[error(
        "`agree` of the reference{}: `{name}` is biased: {bias}. The bias \
         check takes pictures to differ by independent noise only: use an unbiased technique, such \
         as `bdpt`",
        at(point)
    )]
    BiasedCheck {
        /// Description of the point.
        point: String,
        /// Name of the integrator.
        name: String,
        /// Source of its bias.
        bias: &'static str,
    },
    /// A reference, or the second picture of its bias check, is denoised.
    #[error(
        "the reference{} has `denoise`: denoised pictures are biased, so errors against \
         them and bias checks with them mean nothing. Leave `denoise` out of `from` and `agree`; a \
         reference does not inherit it from the cell",
        at(point)
    )]
    DenoisedReference {
        /// Description of the point.
        point: String,
    },
    /// A reference cannot be split into shards.
    #[error("`parts` of the reference{}: {reason}", at(point))]
    Shards {
        /// Description of the point.
        point: String,
        /// Cause and remedy.
        reason: String,
    },
    /// A sheet of pictures or frames cannot be drawn.
    #[error("{error}")]
    Sheet {
        /// Name of the sheet.
        name: String,
        /// Option of the sheet, and what is wrong with it.
        error: Box<SchemaError>,
    },
    /// An external program is not installed. The points that need it are left out of the plan.
    #[error("{technique} is not installed: {reason}")]
    Absent {
        /// Name of the technique that needs it.
        technique: String,
        /// Description of what is missing.
        reason: String,
    },
    /// A reference file cannot be read.
    #[error("reference{}: cannot read {}: {reason}", at(point), file.display())]
    ReferenceFile {
        /// Description of the point.
        point: String,
        /// Path of the file.
        file: PathBuf,
        /// Error of the system.
        reason: String,
    },
}
