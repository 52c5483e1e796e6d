//! Options of the verbs that test and measure the program itself: `verify`, `bench` and `benchmark`.

use std::path::PathBuf;

use clap::Args;

use super::typed::{SceneArg, scene_arg, seconds};
use lumbre_light::scene::desc::MAX_SIDE;
use lumbre_night::experiment::spec::Order;

/// Options of `lumbre verify`.
#[derive(Args, Debug)]
pub struct VerifyArgs {
    /// Folder that contains the scenes of the references. Without it, references are skipped.
    #[arg(long, value_name = "DIR")]
    pub scenes: Option<PathBuf>,
    /// Folder of the references [default: `references` in the folder of the scenes].
    ///
    /// A reference is an EXR picture, an EXR of its standard errors, and a JSON file of its
    /// settings.
    #[arg(long, value_name = "DIR")]
    pub references: Option<PathBuf>,
    /// Run only checks whose kind, name or techniques contain this text (repeat to narrow further).
    #[arg(long, value_name = "TEXT")]
    pub only: Vec<String>,
    /// Use few samples and small pictures.
    ///
    /// Takes seconds and finds only large errors.
    #[arg(long)]
    pub quick: bool,
    /// Compare with Mitsuba 3 instead: every plugin and parameter that is read or exported.
    ///
    /// Both programs render small scenes. Each case must agree up to noise, or differ as a note
    /// states. Takes some minutes; with --quick, seconds. Needs the Python package `mitsuba`. With
    /// FILEs, scenes in Mitsuba's XML, these are compared, in small pictures.
    #[arg(long, conflicts_with_all = ["scenes", "references", "kill"])]
    pub mitsuba: bool,
    /// Scenes that are compared with Mitsuba (with --mitsuba) [default: a table of small scenes].
    #[arg(value_name = "FILE", requires = "mitsuba")]
    pub files: Vec<PathBuf>,
    /// Python interpreter that has the package (with --mitsuba).
    #[arg(
        long,
        value_name = "FILE",
        default_value = "python3",
        requires = "mitsuba"
    )]
    pub python: String,
    /// Write the results as a page in Markdown (with --mitsuba).
    #[arg(long, value_name = "FILE", requires = "mitsuba")]
    pub page: Option<PathBuf>,
    /// Test crash recovery instead: kill a small night this many times.
    ///
    /// Kills the night at random moments, restarts it, and compares its files with those of an
    /// undisturbed night.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub kill: Option<u32>,
    /// Run each night with this many processes at once (with --kill).
    #[arg(
        long,
        value_name = "N",
        default_value_t = 1,
        requires = "kill",
        value_parser = clap::value_parser!(u32).range(1..=64)
    )]
    pub processes: u32,
    /// Order the cells of each night this way (with --kill).
    #[arg(
        long,
        value_name = "ORDER",
        default_value = Order::NAMES[0],
        requires = "kill",
        value_parser = clap::builder::PossibleValuesParser::new(Order::NAMES)
    )]
    pub order: String,
    /// Seed of all random numbers. The same seed gives identical results.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre bench`.
#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Scene files to measure besides the built-in scenes.
    ///
    /// A Lua scene may be followed by options and a view: `atrium.lua?light=lamps,view=gallery`
    #[arg(value_name = "SCENE", value_parser = scene_arg)]
    pub scenes: Vec<SceneArg>,
    /// Measure only the given scenes, without the built-in ones.
    #[arg(long, requires = "scenes")]
    pub only: bool,
    /// Measure this backend with every integrator at depth 5 instead (repeat to compare backends).
    #[arg(long, value_name = "NAME")]
    pub backend: Vec<String>,
    /// Width of the pictures (with --backend).
    #[arg(
        long,
        value_name = "PIXELS",
        default_value_t = 1280,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SIDE))
    )]
    pub width: u32,
    /// Height of the pictures (with --backend).
    #[arg(
        long,
        value_name = "PIXELS",
        default_value_t = 720,
        value_parser = clap::value_parser!(u32).range(1..=i64::from(MAX_SIDE))
    )]
    pub height: u32,
    /// Measure only ray traversal.
    #[arg(long, conflicts_with = "mpaths")]
    pub traversal: bool,
    /// Measure only the integrators.
    #[arg(long)]
    pub mpaths: bool,
    /// Repeat every measurement this many times and report medians and spreads.
    #[arg(
        long,
        value_name = "N",
        default_value_t = 5,
        value_parser = clap::value_parser!(u32).range(1..=1000)
    )]
    pub repeats: u32,
    /// Measure this machine by the fixed suite instead, for comparisons with other machines.
    ///
    /// Renders eleven scenes by bpt, nee and bdpt on every backend of this machine, or on the given
    /// ones, and writes one file with machine, drivers, rates, errors at equal time and times to an
    /// error with their spread, and checksums of pictures. Takes under twenty minutes on two cores,
    /// and about six more for each backend besides the first. Scenes, sizes and seeds belong to the
    /// version of the suite and cannot be changed. The same command resumes an interrupted suite.
    /// Leave the machine alone meanwhile.
    #[arg(
        long,
        conflicts_with_all = ["scenes", "only", "width", "height", "traversal", "mpaths", "repeats", "json"]
    )]
    pub suite: bool,
    /// Measure the suite with short runs and noisy references, in about a minute.
    #[arg(long, requires = "suite")]
    pub quick: bool,
    /// Name of the machine in tables of the suite [default: the model of its processor].
    #[arg(long, value_name = "NAME", requires = "suite")]
    pub name: Option<String>,
    /// Compare results of the suite of several machines in tables, relative to the first one.
    ///
    /// Prints the sampling rate of every technique on every scene and backend, the same relative to
    /// the first one, errors at equal time, times to an error, and which pictures have the same
    /// bits.
    #[arg(long, value_name = "FILE", num_args = 1.., conflicts_with_all = ["suite", "scenes"])]
    pub compare: Vec<PathBuf>,
    /// Write the result of the suite to this file [default: benchmark-2.json], or the tables of
    /// `--compare` as Markdown, CSV and LaTeX to this folder.
    #[arg(short = 'o', long = "to", value_name = "FILE")]
    pub to: Option<PathBuf>,
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
    /// Width and height of the suite in pixels, for tests; results of other sizes are not compared.
    #[arg(long, hide = true, value_parser = crate::cli::scene::trace::size)]
    pub size: Option<[u32; 2]>,
    /// Greatest duration of the suite, for tests: shortens runs and references in proportion to the
    /// twenty minutes.
    #[arg(long, hide = true, value_parser = seconds)]
    pub time: Option<f64>,
}
