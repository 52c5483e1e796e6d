//! What a script says, as typed plain data, and the hooks through which its functions are called.

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::event::WaveRow;
use super::stop::StopRule;
use crate::film::layer::Layer;
use crate::metrics::MetricSpec;
use crate::render::hierarchy::AccelSpec;
use crate::transport::camera::FilterSpec;
use crate::transport::flight::Timing;
use crate::value::Value;
use crate::value::schema::duration_s;

/// A point of the sweep: axis names and values in the order in which the axes were declared.
pub type Point = Vec<(String, Value)>;

/// One script's experiment.
#[derive(Clone, Debug)]
pub struct Spec {
    /// Its name: letters, digits, `_` and `-`.
    pub name: String,
    /// Seed from which every run's seed follows.
    pub seed: u64,
    /// How often every point is rendered, each time with another seed.
    pub repeats: u32,
    /// The script's file.
    pub script_file: PathBuf,
    /// The script's text, kept in the run folder.
    pub script_text: String,
    /// blake3 of the script and everything it required: the identity of its predicates.
    pub script_hash: [u8; 32],
    /// The axes, slowest first.
    pub axes: Vec<Axis>,
    /// Reasons of the skip rules, in order; the rule's number is its place here.
    pub skips: Vec<String>,
    /// What is measured and kept.
    pub measure: Measure,
    /// How its nights go.
    pub night: NightSpec,
    /// Whether some cells are rendered twice, to compare a technique with itself: see [`super::control`].
    pub control: bool,
    /// Figures.
    pub figures: Vec<FigureSpec>,
    /// Tables.
    pub tables: Vec<TableSpec>,
}

/// One axis, or several that move together (`zip`).
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// Its names: one, or one for each zipped axis.
    pub names: Vec<String>,
    /// Its steps: each holds one value for each name.
    pub steps: Vec<Vec<Value>>,
}

/// How the nights of an experiment go; nothing of it changes a result.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct NightSpec {
    /// Seconds of render time between two checkpoints of a cell. Without it, 60 s, and more where writing one takes so
    /// long that it would cost over 1 % of the time.
    pub checkpoint_s: Option<f64>,
    /// When a night ends, finished or not.
    pub deadline: Option<Deadline>,
    /// The order of the cells.
    pub order: Order,
    /// What every cell renders before its clock starts.
    pub warmup: Option<Warmup>,
}

/// The order in which the cells of a night are rendered. What drifts while a night lasts, such as the speed of a machine
/// that grows warm, falls on other cells in another order.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Order {
    /// That of the plan.
    #[default]
    Sequential,
    /// One that the experiment's seed decides, the same in every launch.
    Shuffled,
    /// Techniques of the same picture take turns: see [`Plan::heats`](super::Plan::heats).
    Interleave,
}

impl Order {
    /// The words of scripts.
    pub const NAMES: [&'static str; 3] = ["sequential", "shuffled", "interleave"];

    /// Its word.
    pub fn name(self) -> &'static str {
        Order::NAMES[self as usize]
    }

    /// The order that a word means.
    pub fn from_name(name: &str) -> Option<Order> {
        [Order::Sequential, Order::Shuffled, Order::Interleave].into_iter().find(|order| order.name() == name)
    }
}

/// Rendering with other random numbers that comes before a cell's clock and is thrown away, so that what a device does
/// only at first (to clock up, to fill its caches) counts for nobody.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Warmup {
    /// Seconds inside the renderer.
    Time(f64),
    /// Samples per pixel.
    Samples(u64),
}

impl Warmup {
    /// The warm-up in words.
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
    /// At the next moment when local clocks show so many minutes after midnight, 0 to 1439.
    Clock {
        /// Minutes after midnight.
        minutes: u16,
    },
    /// So long after it began.
    After {
        /// Milliseconds.
        milliseconds: u64,
    },
}

impl Deadline {
    /// Reads a deadline: text such as `08:00`, which is a time of day, or a duration.
    pub fn parse(value: &Value) -> Option<Deadline> {
        let clock = |text: &str| {
            let (hours, minutes) = text.trim().split_once(':')?;
            let short = |part: &str| (1..=2).contains(&part.len()) && part.bytes().all(|b| b.is_ascii_digit());
            if !short(hours) || minutes.len() != 2 || !short(minutes) {
                return None;
            }
            let (hours, minutes): (u16, u16) = (hours.parse().ok()?, minutes.parse().ok()?);
            (hours < 24 && minutes < 60).then_some(Deadline::Clock { minutes: 60 * hours + minutes })
        };
        let after = || {
            duration_s(value).filter(|s| *s > 0.0).map(|s| Deadline::After { milliseconds: (s * 1e3).ceil() as u64 })
        };
        value.as_str().and_then(clock).or_else(after)
    }
}

/// What is measured during a run and what is kept of it.
#[derive(Clone, Debug, PartialEq)]
pub struct Measure {
    /// Longest render time between two measurements in seconds.
    pub every_s: f64,
    /// The metrics, in the order of their columns.
    pub metrics: Vec<MetricSpec>,
    /// Which snapshots are kept as EXR besides the final picture.
    pub snapshots: Snapshots,
    /// Whether every measurement also keeps the picture as PNG.
    pub captures: bool,
    /// The tone map of PNG files and of the live picture.
    pub display: crate::metrics::tonemap::Tonemap,
}

/// Which snapshots are kept besides the final picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Snapshots {
    /// None.
    Last,
    /// After every power of two of samples per pixel.
    Pow2,
}

/// The horizontal axis of a convergence figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FigureX {
    /// Seconds inside the renderer.
    RenderS,
    /// Samples per pixel.
    Samples,
}

/// A figure: one picture for each combination of `facet` values.
#[derive(Clone, Debug, PartialEq)]
pub struct FigureSpec {
    /// Its name, which is its file's.
    pub name: String,
    /// What is drawn against what.
    pub kind: FigureKind,
    /// The axis that distinguishes curves; `None` is one curve for every cell of the facet, of a sweep for every
    /// combination of the other axes.
    pub by: Option<String>,
    /// The axes that distinguish pictures.
    pub facet: Vec<String>,
    /// Axes with the values that are drawn; of other axes all are.
    pub only: Vec<(String, Vec<Value>)>,
}

impl FigureSpec {
    /// Whether a cell at this point of the sweep is drawn.
    pub fn shows(&self, point: &[(String, Value)]) -> bool {
        let kept = |(axis, values): &(String, Vec<Value>)| {
            point.iter().find(|(name, _)| name == axis).is_some_and(|(_, value)| values.contains(value))
        };
        self.only.iter().all(kept)
    }

    /// Whether anything in it is read off a clock.
    pub fn is_timed(&self) -> bool {
        match &self.kind {
            FigureKind::Convergence { x, .. } => *x == FigureX::RenderS,
            FigureKind::Sweep { y, .. } => y.iter().any(TableValue::is_clock),
        }
    }
}

/// What a figure draws against what.
#[derive(Clone, Debug, PartialEq)]
pub enum FigureKind {
    /// Measurements as a run goes on.
    Convergence {
        /// Horizontal axis.
        x: FigureX,
        /// Metric columns, one panel each.
        y: Vec<String>,
    },
    /// What finished runs have in the end, over the values of an axis.
    Sweep {
        /// The axis.
        over: String,
        /// What is drawn, one panel each.
        y: Vec<TableValue>,
    },
}

/// What a table, or a figure over an axis, shows of each cell.
#[derive(Clone, Debug, PartialEq)]
pub enum TableValue {
    /// The final value of a metric column.
    Metric(String),
    /// Samples per pixel at the end.
    Samples,
    /// Render time at the end, seconds.
    RenderS,
    /// Million camera paths per second of render time.
    MpathsPerS,
    /// Frames per second of render time: samples of every pixel.
    Fps,
    /// Million rays per second of render time.
    MraysPerS,
    /// Seconds spent building the hierarchy.
    AccelBuildS,
    /// Nodes of the hierarchy.
    AccelNodes,
    /// Mebibytes of the hierarchy and the primitives in it.
    AccelMib,
    /// What a ray through the scene's box costs by the surface area heuristic.
    AccelCost,
    /// Render seconds until a metric column first reached a threshold.
    TimeTo {
        /// The column.
        column: String,
        /// The threshold.
        threshold: f64,
    },
}

impl TableValue {
    /// Those that need no metric, by the names that scripts use.
    pub const PLAIN: &[(&str, TableValue)] = &[
        ("samples", TableValue::Samples),
        ("render_s", TableValue::RenderS),
        ("mpaths_s", TableValue::MpathsPerS),
        ("fps", TableValue::Fps),
        ("mrays_s", TableValue::MraysPerS),
        ("accel_build_s", TableValue::AccelBuildS),
        ("accel_nodes", TableValue::AccelNodes),
        ("accel_mib", TableValue::AccelMib),
        ("accel_cost", TableValue::AccelCost),
    ];

    /// What scripts call it: `accel_nodes`, a metric's column, or `time_to(column, threshold)`.
    pub fn word(&self) -> String {
        match self {
            TableValue::Metric(column) => column.clone(),
            TableValue::TimeTo { column, threshold } => format!("time_to({column}, {threshold})"),
            plain => {
                let named = TableValue::PLAIN.iter().find(|(_, value)| value == plain);
                named.map_or_else(String::new, |(name, _)| (*name).to_owned())
            }
        }
    }

    /// Whether it is read off a clock.
    pub fn is_clock(&self) -> bool {
        match self {
            TableValue::RenderS
            | TableValue::MpathsPerS
            | TableValue::Fps
            | TableValue::MraysPerS
            | TableValue::AccelBuildS
            | TableValue::TimeTo { .. } => true,
            TableValue::Metric(_)
            | TableValue::Samples
            | TableValue::AccelNodes
            | TableValue::AccelMib
            | TableValue::AccelCost => false,
        }
    }
}

/// File formats of tables.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TableFormat {
    /// Markdown.
    Md,
    /// Comma-separated values.
    Csv,
}

/// A table over two axes; other axes and repeats are averaged, and the count is stated.
#[derive(Clone, Debug, PartialEq)]
pub struct TableSpec {
    /// Its name, which is its file's.
    pub name: String,
    /// What it shows.
    pub value: TableValue,
    /// Axes whose values make the rows.
    pub rows: Vec<String>,
    /// Axes whose values make the columns; empty is a single column.
    pub cols: Vec<String>,
    /// The files to write.
    pub formats: Vec<TableFormat>,
}

/// What one cell renders: the script's `render` table, typed.
#[derive(Clone, Debug, PartialEq)]
pub struct CellConfig {
    /// The scene as the script wrote it.
    pub scene: String,
    /// The scene's file, found.
    pub scene_file: PathBuf,
    /// What is chosen of the options that a scene written in Lua offers.
    pub scene_options: BTreeMap<String, Value>,
    /// Name of a row of [`INTEGRATORS`](crate::transport::integrator::INTEGRATORS).
    pub integrator: String,
    /// Parameters of the integrator, checked against its row.
    pub params: BTreeMap<String, Value>,
    /// Greatest number of path edges; `None` is the scene's own.
    pub max_depth: Option<u32>,
    /// Width and height in pixels; `None` is the scene's own.
    pub resolution: Option<[u32; 2]>,
    /// Russian roulette from this edge on; `None` is never.
    pub rr_start: Option<u32>,
    /// Pixel filter.
    pub filter: FilterSpec,
    /// Layers that are kept beside the picture, in the order of [`LAYERS`](crate::film::layer::LAYERS), each once.
    pub films: Vec<Layer>,
    /// The time axis of its film.
    pub timing: Option<Timing>,
    /// Name of a row of [`SAMPLERS`](crate::transport::sampler::SAMPLERS).
    pub sampler: String,
    /// How the hierarchy is built through which rays are traced.
    pub accel: AccelSpec,
    /// Changes to the scene by path, `camera` ones included.
    pub set: BTreeMap<String, Value>,
    /// Name of a backend, or `auto`.
    pub backend: String,
    /// The backend that renders it where that one fails: there is one if the script has left the choice to the program.
    pub fallback: Option<&'static str>,
}

/// What a cell is measured against.
#[derive(Clone, Debug, PartialEq)]
pub enum ReferenceRequest {
    /// A picture that Lumbre renders first and keeps.
    Render {
        /// What to render.
        config: Box<CellConfig>,
        /// When it is good enough.
        stop: StopRule,
        /// The second technique that has to mean the same picture, if any.
        agree: Option<Box<AgreeRequest>>,
        /// How many [parts](super::parts) it is rendered in, at most; 1 is as a whole.
        parts: u32,
    },
    /// An EXR file made elsewhere.
    File {
        /// The file.
        file: PathBuf,
        /// Who made it and how, in the script's words; empty if it does not say.
        source: String,
    },
}

/// A picture that a reference is compared with, so that a mistake of its integrator is found out.
#[derive(Clone, Debug, PartialEq)]
pub struct AgreeRequest {
    /// What to render: the reference's own picture by another technique.
    pub config: CellConfig,
    /// When it is good enough.
    pub stop: StopRule,
    /// Of the blocks that are called different, the share that may be so by chance, above 0 and below 1.
    pub rate: f64,
}

/// An error from the script's side, already fit for people.
#[derive(Debug, thiserror::Error)]
#[error(transparent)]
pub struct HookError(pub Box<dyn std::error::Error + Send + Sync>);

/// The script's functions, as seen from a room that knows no Lua.
pub trait ScriptHooks {
    /// Whether skip rule `rule` (an index of [`Spec::skips`]) leaves this point out.
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn skip(&self, rule: usize, point: &Point) -> Result<bool, HookError>;

    /// What to render at this point.
    ///
    /// # Errors
    /// When the script's function fails or its table is wrong.
    fn render(&self, point: &Point) -> Result<CellConfig, HookError>;

    /// What to measure this point against, if the script said so.
    ///
    /// # Errors
    /// When the script's function fails or its table is wrong.
    fn reference(&self, point: &Point) -> Result<Option<ReferenceRequest>, HookError>;

    /// When this point's cell is finished.
    ///
    /// # Errors
    /// When the script's function fails or its rule is wrong.
    fn stop(&self, point: &Point) -> Result<StopRule, HookError>;

    /// Whether the cells of this point are rendered twice for the A/A check, where a script with one says so; `None` is
    /// the first technique of every picture.
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn control(&self, _point: &Point) -> Result<Option<bool>, HookError> {
        Ok(None)
    }

    /// Whether predicate `id` (see [`StopRule::Predicate`]) says stop, given the columns of `rows` (oldest first).
    ///
    /// # Errors
    /// When the script's function fails or returns something other than true, false or nil.
    fn predicate(&self, id: usize, columns: &[String], rows: &[WaveRow]) -> Result<bool, HookError>;
}
