//! Specification of an experiment: a script as typed plain data, and the hooks that call its
//! functions.

use std::collections::BTreeMap;
use std::path::PathBuf;

use serde::{Deserialize, Serialize};

pub use super::figure_x::FigureX;
use super::hook_error::HookError;
use super::outcome::WaveRow;
pub use super::sheet::{PictureMoment, SheetContent, SheetSpec};
use super::stop::StopRule;
pub use super::table_value::{RunColumn, TableValue};
use lumbre_light::value::Value;
use lumbre_light::value::schema::duration_s;
use lumbre_metrics::MetricSpec;
use lumbre_metrics::tonemap::Tonemap;
use lumbre_render::Settings;

/// A point of the sweep: axis names and values in the order in which the axes were declared.
pub type Point = Vec<(String, Value)>;

/// The experiment of one script.
#[derive(Clone, Debug, Default)]
pub struct ExperimentSpec {
    /// Name of the experiment: letters, digits, `_` and `-`.
    pub name: String,
    /// Seed from which the seed of every run is derived.
    pub seed: u64,
    /// Number of times that every point is rendered, each with another seed.
    pub repeats: u32,
    /// File of the script.
    pub script_file: PathBuf,
    /// Text of the script, stored in the run folder.
    pub script_text: String,
    /// BLAKE3 hash of the script and all modules that it requires; identifies its predicates.
    pub script_hash: [u8; 32],
    /// The axes, slowest first.
    pub axes: Vec<Axis>,
    /// Reasons of the skip rules; a rule's number is its index here.
    pub skips: Vec<String>,
    /// Metrics, their interval, and what is stored of each run.
    pub measure: MeasureSpec,
    /// Settings of its nights.
    pub night: NightSpec,
    /// Whether some cells are rendered twice, to compare a technique with itself: see
    /// [`super::aa_check`].
    pub aa_check: bool,
    /// Figures to draw.
    pub figures: Vec<FigureSpec>,
    /// Tables to write.
    pub tables: Vec<TableSpec>,
    /// Sheets of pictures and frames to draw.
    pub sheets: Vec<SheetSpec>,
    /// Presentation of the results in figures, tables and reports.
    pub report: Presentation,
}

/// Presentation of the results in figures, tables and reports. Nothing of it changes a result or an
/// id.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Presentation {
    /// Tone map of the pictures in figures; `None` is sRGB with an exposure for each figure.
    pub display: Option<Tonemap>,
    /// Names of techniques and of other axis values.
    pub names: BTreeMap<String, String>,
    /// Colours as `#rrggbb` of techniques and of other axis values.
    pub colours: BTreeMap<String, String>,
    /// Notes of the script, then those of `lumbre note` after their dates. Words that start with `#`
    /// are tags.
    pub notes: Vec<String>,
}

impl Presentation {
    /// Returns the name of a technique or of an axis value.
    pub fn name(&self, value: &str) -> String {
        self.names
            .get(value)
            .map_or(value, String::as_str)
            .to_owned()
    }

    /// Returns the colour of a technique or of an axis value, if the script sets one.
    pub fn colour(&self, value: &str) -> Option<&str> {
        self.colours.get(value).map(String::as_str)
    }

    /// Returns the distinct tags of all notes, in order.
    pub fn tags(&self) -> Vec<&str> {
        let mut tags = Vec::new();
        let words = self.notes.iter().flat_map(|note| note.split_whitespace());
        for word in words.filter(|word| word.len() > 1 && word.starts_with('#')) {
            if !tags.contains(&word) {
                tags.push(word);
            }
        }
        tags
    }
}

/// An axis of the sweep, or several that vary together (`zip`).
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Axis names: one, or one for each zipped axis.
    pub names: Vec<String>,
    /// Steps of the axis; each has one value for each name.
    pub steps: Vec<Vec<Value>>,
}

/// Settings of the nights of an experiment. None of them changes a result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NightSpec {
    /// Seconds of render time between two checkpoints of a cell. The default is 60 s, or longer if
    /// writing a checkpoint would otherwise take over 1 % of the time.
    pub checkpoint_s: Option<f64>,
    /// When a night ends, finished or not.
    pub deadline: Option<Deadline>,
    /// Order in which cells are rendered.
    pub order: Order,
    /// Warm-up of every cell before its clock starts.
    pub warmup: Option<Warmup>,
    /// Commands that are run at events of the night.
    pub notices: Vec<Notice>,
}

/// A command that is run at events of a night (`x:notify` in scripts).
#[derive(Clone, Debug, PartialEq)]
pub struct Notice {
    /// Program and arguments, with [`NOTICE_PLACEHOLDERS`] in braces.
    pub command: Vec<String>,
    /// Events that it is run for.
    pub events: Vec<NoticeEvent>,
    /// Seconds after which it is ended.
    pub timeout_s: f64,
}

/// Placeholders in the command of a notice.
pub const NOTICE_PLACEHOLDERS: [&str; 4] = ["event", "text", "name", "folder"];

lumbre_light::named! {
    /// Event of a night that a notice is sent for.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    pub enum NoticeEvent {
        /// The night is over.
        End = "end",
        /// A run failed.
        Failure = "failure",
        /// A bias check found a difference.
        Alarm = "alarm",
    }
}

lumbre_light::named! {
    /// The order in which the cells of a night are rendered.
    ///
    /// It decides which cells are affected by drift during a night, such as a machine that slows
    /// down as it warms up.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Order {
        /// The order of the plan.
        #[default]
        Sequential = "sequential",
        /// A random order derived from the experiment's seed, the same at every launch.
        Shuffled = "shuffled",
        /// Techniques of the same picture take turns: see
        /// [`Plan::interleave_groups`](super::Plan::interleave_groups).
        Interleave = "interleave",
    }
}

/// Rendering before a cell's clock starts, with a seed of its own and discarded afterwards, so that
/// start-up effects of a device (rising clock rates, cold caches) are not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warmup {
    /// Seconds inside the renderer.
    Time(f64),
    /// Samples per pixel.
    Samples(u64),
}

impl Warmup {
    /// Describes the warm-up for people.
    pub fn describe(self) -> String {
        match self {
            Warmup::Time(seconds) => format!("{seconds} s of rendering"),
            Warmup::Samples(1) => "1 sample per pixel".to_owned(),
            Warmup::Samples(n) => format!("{n} samples per pixel"),
        }
    }
}

/// When a night ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Deadline {
    /// The next time of day at which the local clock shows this.
    Clock {
        /// Minutes after midnight, 0 to 1439.
        minutes: u16,
    },
    /// This long after the night began.
    After {
        /// Duration in milliseconds.
        milliseconds: u64,
    },
}

impl Deadline {
    /// Parses a deadline: a time of day such as `08:00`, or a duration. Returns `None` if the value
    /// is neither.
    pub fn parse(value: &Value) -> Option<Deadline> {
        let clock = |text: &str| {
            let (hours, minutes) = text.trim().split_once(':')?;
            let short = |part: &str| {
                (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit())
            };
            if !short(hours) || minutes.len() != 2 || !short(minutes) {
                return None;
            }
            let (hours, minutes): (u16, u16) = (hours.parse().ok()?, minutes.parse().ok()?);
            (hours < 24 && minutes < 60).then_some(Deadline::Clock {
                minutes: 60 * hours + minutes,
            })
        };
        let after = || {
            duration_s(value)
                .filter(|s| *s > 0.0)
                .map(|s| Deadline::After {
                    milliseconds: (s * 1e3).ceil() as u64,
                })
        };
        value.as_str().and_then(clock).or_else(after)
    }
}

/// Measurements during a run, and what is stored of it.
#[derive(Clone, Debug, PartialEq)]
pub struct MeasureSpec {
    /// Longest render time between two measurements, seconds.
    pub every_s: f64,
    /// The metrics, in the order of their columns.
    pub metrics: Vec<MetricSpec>,
    /// Snapshots that are stored as EXR besides the final picture.
    pub snapshots: Snapshots,
    /// Whether the picture is stored as PNG at every measurement.
    pub captures: bool,
    /// Whether layers of a single film are stored in files of their own, and not in that of the
    /// final picture.
    pub film_files: bool,
    /// Tone map of PNG files and of the live picture.
    pub display: Tonemap,
}

impl Default for MeasureSpec {
    /// Returns the measurements of a script without `x:measure`: only the final picture is stored.
    fn default() -> MeasureSpec {
        MeasureSpec {
            every_s: 0.5,
            metrics: Vec::new(),
            snapshots: Snapshots::Last,
            captures: false,
            film_files: false,
            display: Tonemap::Srgb { exposure: 0.0 },
        }
    }
}

/// Snapshots that are stored besides the final picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Snapshots {
    /// No snapshots at all.
    Last,
    /// One at every power of two of samples per pixel.
    Pow2,
}

/// A figure: one image for each combination of `facet` values.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FigureSpec {
    /// Name of the figure and of its file.
    pub name: String,
    /// Quantities that are drawn.
    pub kind: FigureKind,
    /// Axis that distinguishes curves. `None` draws one curve for every cell of the facet; in a
    /// sweep figure, one for every combination of the other axes.
    pub by: Option<String>,
    /// Axes that distinguish images.
    pub facet: Vec<String>,
    /// Axes that are restricted to some values; other axes are drawn whole.
    pub only: Vec<(String, Vec<Value>)>,
}

impl FigureSpec {
    /// Whether a cell at this point of the sweep is drawn.
    pub fn shows(&self, point: &[(String, Value)]) -> bool {
        let kept = |(axis, values): &(String, Vec<Value>)| {
            point
                .iter()
                .find(|(name, _)| name == axis)
                .is_some_and(|(_, value)| values.contains(value))
        };
        self.only.iter().all(kept)
    }

    /// Whether the figure shows any measured time.
    pub fn is_timed(&self) -> bool {
        match &self.kind {
            FigureKind::Convergence { x, .. } => x.row().is_clock,
            FigureKind::Sweep { y, .. } => y.iter().any(TableValue::is_clock),
        }
    }
}

/// Quantities that a figure draws.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum FigureKind {
    /// Metrics over the course of each run.
    Convergence {
        /// Quantity of the horizontal axis.
        x: FigureX,
        /// Metric columns, one panel for each.
        y: Vec<String>,
    },
    /// Final values of finished runs over the values of an axis.
    Sweep {
        /// Axis of the sweep.
        over: String,
        /// Quantities, one panel for each.
        y: Vec<TableValue>,
    },
}

/// File format of a table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum TableFormat {
    /// A Markdown table.
    Md,
    /// Comma-separated values with a header.
    Csv,
}

/// A table over two groups of axes. Other axes and repeats are averaged, and their number is
/// stated.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TableSpec {
    /// Name of the table and of its file.
    pub name: String,
    /// Quantity in the cells of the table.
    pub value: TableValue,
    /// Axes whose values form the rows.
    pub rows: Vec<String>,
    /// Axes whose values form the columns; empty for a single column.
    pub cols: Vec<String>,
    /// File formats to write.
    pub formats: Vec<TableFormat>,
}

/// The reference that a cell is measured against.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceRequest {
    /// A picture that Lumbre renders first and stores.
    Render {
        /// Resolved render settings.
        config: Box<Settings>,
        /// When the reference is finished.
        stop: StopRule,
        /// Comparison with a second technique, if requested (`agree` in scripts).
        bias_check: Option<Box<BiasCheckRequest>>,
        /// Greatest number of [shards](super::shards) to split it into (`parts` in scripts); 1
        /// renders it as a whole.
        shards: u32,
    },
    /// An EXR file made elsewhere.
    File {
        /// Path of the file.
        file: PathBuf,
        /// Origin of the file as stated by the script; empty if not stated.
        source: String,
    },
}

/// A second picture that a reference is compared with, to detect bias of its integrator.
#[derive(Clone, Debug, PartialEq)]
pub struct BiasCheckRequest {
    /// Render settings: the picture of the reference by another technique.
    pub config: Settings,
    /// When the second picture is finished.
    pub stop: StopRule,
    /// False discovery rate: the expected share of blocks reported as different that differ only by
    /// chance, in (0, 1).
    pub rate: f64,
}

/// Functions of a script, independent of Lua.
pub trait ScriptHooks {
    /// Whether skip rule `rule`, an index into [`ExperimentSpec::skips`], leaves this point out.
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError>;

    /// Render settings at this point.
    ///
    /// # Errors
    /// When the script's function fails or its table is wrong.
    fn render(&self, point: &Point) -> Result<Settings, HookError>;

    /// Reference of this point, if the script defines one.
    ///
    /// # Errors
    /// When the script's function fails or its table is wrong.
    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError>;

    /// Stop rule of this point's cells.
    ///
    /// # Errors
    /// When the script's function fails or its rule is wrong.
    fn stop(&self, point: &Point) -> Result<StopRule, HookError>;

    /// Whether the cells of this point are rendered twice for the A/A check (`x:control`). `None`
    /// if the script leaves the choice to the program, which takes the first technique of every
    /// picture.
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn aa_check(&self, _point: &Point) -> Result<Option<bool>, HookError> {
        Ok(None)
    }

    /// Whether predicate `id` (see [`StopRule::Predicate`]) stops a run with the measurements
    /// `rows`, oldest first, whose metrics are named by `columns`.
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn predicate(&self, id: usize, columns: &[String], rows: &[WaveRow])
    -> Result<bool, HookError>;
}
