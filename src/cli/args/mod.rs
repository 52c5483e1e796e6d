//! What can be typed.

mod cluster;
mod evidence;
mod typed;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub use cluster::{CancelArgs, SlurmArgs, SubmitArgs, To, WorkArgs};
pub use evidence::{DiffArgs, MetricArgs, ReportArgs, ReproduceArgs, TraceArgs, ViewArgs};
pub use typed::{SceneArg, split, value};

use typed::{axis_values, scene_arg, setting};

use crate::cli::exit;
use crate::experiment::groups::Affinity;
use crate::experiment::spec::{Deadline, Order};
use crate::scene::load::Missing;
use crate::value::Value;

/// The whole command line.
#[derive(Debug, Parser)]
#[command(
    name = "lumbre",
    version,
    about = "A terminal-driven, Lua-scripted experiment runner for light transport",
    long_about = "Lumbre runs light-transport experiments that a Lua script describes: which scenes, which techniques \
                  and parameters, against which reference, and when to stop. It renders every cell of the sweep, \
                  measures the error while it renders, and leaves pictures, curves and tables under out/.",
    after_help = exit::EXPLAINED,
    subcommand_required = true,
    arg_required_else_help = true
)]
pub struct Cli {
    /// Options that every verb understands.
    #[command(flatten)]
    pub global: Global,
    /// What to do.
    #[command(subcommand)]
    pub verb: Verb,
}

/// Where results live if nobody says otherwise.
const DEFAULT_OUT: &str = "out";

/// Options that every verb understands.
#[derive(Args, Clone, Debug)]
pub struct Global {
    /// Where results live
    #[arg(long, global = true, value_name = "DIR", default_value = DEFAULT_OUT)]
    pub out: PathBuf,
    /// Render on this backend, whatever the script says (`lumbre doctor` lists them)
    #[arg(long, global = true, value_name = "NAME")]
    pub backend: Option<String>,
    /// Worker threads; 0 is one for each core. Never changes a picture
    #[arg(long, global = true, value_name = "N", default_value_t = 0)]
    pub threads: usize,
    /// Plain lines instead of the dashboard
    #[arg(long, global = true)]
    pub no_tui: bool,
    /// Say nothing but errors, warnings and data
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Go on where a material's texture cannot be read: its scalar value is used, with a note
    #[arg(long, global = true)]
    pub lenient: bool,
}

impl Global {
    /// What becomes of textures that cannot be read.
    pub fn missing(&self) -> Missing {
        if self.lenient { Missing::Noted } else { Missing::Refused }
    }
}

/// The verbs.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Run an experiment: render what is not done yet, then write figures and tables
    ///
    /// Cells that an earlier night finished are not rendered again. An interrupted night goes on where it was when
    /// the same command is given again.
    Run(RunArgs),
    /// Run what failed again
    ///
    /// `lumbre run` tries failed cells again too, along with everything else that is not done. `lumbre retry --failed`
    /// tries nothing else.
    Retry(RetryArgs),
    /// Take part in a night whose plan is frozen: one worker, on any machine that sees its folder
    ///
    /// `lumbre run` and `lumbre submit` leave the plan in the folder of their night. A worker makes it again from there,
    /// refuses when anything in it changed, takes cells that nobody works on, and leaves when all is done. Any number may
    /// come and go; what one leaves unfinished another finishes. The last one writes tables and figures.
    Work(WorkArgs),
    /// Hand a night to a cluster: freeze its plan, and submit a job of many workers
    Submit(SubmitArgs),
    /// Take the jobs of a night back; what is finished stays, and what is not goes on when it is submitted again
    Cancel(CancelArgs),
    /// Say why a run would be rendered again, or why it would not
    ///
    /// Names the field in which its identity differs from what the script asks for now, the file that is damaged or
    /// missing, the failure of its last try, or the checkpoint from which it would go on.
    Explain(ExplainArgs),
    /// Show the cells of an experiment, what is cached, what is skipped and why; render nothing
    Plan(PlanArgs),
    /// Check scripts and scene files of every known format; render and write nothing
    Check(CheckArgs),
    /// Write a scene of any known format as files for another renderer
    ///
    /// Meshes are PLY, textures PNG or OpenEXR. What the other renderer has no words for becomes a note that says what
    /// takes its place. The path of the scene's file goes to stdout. Samples, depth and size are parameters of it:
    /// mitsuba -D spp=64 -D max_depth=5 scene.xml
    Export(ExportArgs),
    /// Show a night that runs or has ended in the dashboard, from any terminal
    ///
    /// Reads files only: no lock is taken and nothing is written, so a folder that was copied from another machine will
    /// do. Without a terminal it prints what `status` does.
    Watch(WatchArgs),
    /// Say how far a night is: what runs, what is done, what failed, how long it will take
    Status(StatusArgs),
    /// List experiments and the states of their runs
    Ls(LsArgs),
    /// Show one run: its configuration, last measurements and files
    Show(ShowArgs),
    /// Print what a script may say, for editors and programs
    Schema(SchemaArgs),
    /// Say what this machine offers: backends, cores, terminal, a writable out/
    Doctor(DoctorArgs),
    /// Check light transport: against theory, techniques against each other, and against images by others
    ///
    /// Every check compares pictures block by block, as estimates with noise, and ends in a verdict. All
    /// checks together call a correct program wrong with a probability of one in a thousand, whatever
    /// the seed. Checks:
    ///
    ///   analytic   scenes whose radiance is known in closed form
    ///   density    the weights of bdpt, path by path, against their definition
    ///   agreement  the built-in scenes by every integrator and every variant of its parameters
    ///   reference  images made by others, with --scenes
    ///   picture    images made by others without standard errors, with --scenes: by bounds, not by chance
    ///
    /// Exit code 5 says that a check failed.
    #[command(verbatim_doc_comment)]
    Verify(VerifyArgs),
    /// Measure the program itself and write out/bench.json
    ///
    /// For every scene: rays per second by kind; and for every integrator camera paths per second with their spread over
    /// the repetitions, the variance of one sample per pixel (mean over pixels and channels), the efficiency
    /// 1 / (variance x seconds per sample of every pixel), and the time to a relative RMSE of 5 %: the root of the mean
    /// squared error over the mean of the picture. The last three are a dash where an integrator found light too rarely
    /// for its variance to be known.
    Bench(BenchArgs),
    /// Measure a picture against a reference: EXR, HDR, PNG, JPEG or BMP files from anywhere
    ///
    /// Files with 8 or 16 bits are decoded with the sRGB curve; metrics see linear light unless `on` names a tone map.
    Metric(MetricArgs),
    /// Show where two pictures differ, and draw the error of every pixel
    Diff(DiffArgs),
    /// Make figures, tables, data and an offline page of finished or running nights, without rendering
    ///
    /// Everything is drawn from what the folders say. Several nights are put side by side, each named by its device or
    /// by --name; times of different devices never share an axis unnamed.
    Report(ReportArgs),
    /// Render again what a file of ours shows, and say whether it is the same
    ///
    /// FILE is a picture, figure, table or data file that Lumbre wrote, or a run's folder. Every run that it names is
    /// found in its night and rendered again with the same samples. The answer for each is one of: identical (every bit
    /// of the picture), equal within noise (with the p-value), or differs here (with the place and a map). Times are not
    /// compared. Exit code 5 says that a picture differs.
    Reproduce(ReproduceArgs),
    /// Say what one sample of one pixel does, step by step: rays, the vertices where they end, and the light it brings
    ///
    /// FILE is a scene, rendered as the options say, or a run's folder, whose `config.json` says how. The steps are the
    /// same on every backend but for rounding; --backend chooses.
    Trace(TraceArgs),
    /// Look into the time axis of a run: frames, animations, streaks, curves and arrival
    ///
    /// Draws them anew from the arrays that a finished run with `film = { time = .. }` has left, for the moments, pixels
    /// and regions that are asked for, into a folder. The last line of the output makes a video of them with ffmpeg.
    View(ViewArgs),
    /// Print completions for a shell
    ///
    /// For example: lumbre completions bash > ~/.local/share/bash-completion/completions/lumbre
    Completions {
        /// The shell
        shell: clap_complete::Shell,
    },
    /// Print the manual page (roff; read it with `lumbre man | man -l -`)
    Man,
    /// Render for another process of this program, which asks through a pipe
    #[command(hide = true)]
    Worker,
}

/// A script and how it is narrowed.
#[derive(Args, Clone, Debug)]
pub struct ScriptArgs {
    /// The experiment's script
    pub script: PathBuf,
    /// Replace the values of an axis: `depth=5,9`
    #[arg(value_name = "AXIS=V,V", value_parser = axis_values)]
    pub axes: Vec<(String, Vec<Value>)>,
    /// Keep only cells with this value of an axis; give it again for further values or axes
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    pub only: Vec<(String, Vec<Value>)>,
}

/// `lumbre run`.
#[derive(Args, Debug)]
pub struct RunArgs {
    /// Which experiment.
    #[command(flatten)]
    pub script: ScriptArgs,
    /// How the night goes.
    #[command(flatten)]
    pub night: NightArgs,
    /// Print the plan and stop
    #[arg(long)]
    pub dry_run: bool,
}

/// How a night goes.
#[derive(Args, Clone, Debug, Default)]
pub struct NightArgs {
    /// End the night at this time of day, or after this long: 08:00, 90min, 7.5h. Cells then come from coarse to fine, so
    /// that what is finished is a complete smaller grid, and the same command goes on another time
    #[arg(long, value_name = "TIME", value_parser = super::until::parse)]
    pub until: Option<Deadline>,
    /// End the night once so many runs have failed
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub max_fails: Option<u32>,
    /// Leave out the smoke pass, which tries one small sample of every cell before the night begins
    #[arg(long)]
    pub no_smoke: bool,
    /// Render on these graphics devices, with a worker for each: their indices or parts of their names, as `lumbre doctor`
    /// lists them [default: every one of the model of the first, or the one that LUMBRE_DEVICE names]
    #[arg(long, value_name = "DEVICE,DEVICE", value_delimiter = ',')]
    pub devices: Vec<String>,
    /// What all techniques of a scene and depth share: one `device`, one `model` of device, or `none` of it
    #[arg(long, value_name = "WHAT", default_value = "device", value_parser = cluster::affinity)]
    pub affinity: Affinity,
}

/// `lumbre retry`.
#[derive(Args, Debug)]
pub struct RetryArgs {
    /// The experiment's script [default: the command that was run last]
    script: Option<PathBuf>,
    /// Replace the values of an axis: `depth=5,9`
    #[arg(value_name = "AXIS=V,V", value_parser = axis_values)]
    axes: Vec<(String, Vec<Value>)>,
    /// Keep only cells with this value of an axis; give it again for further values or axes
    #[arg(long, value_name = "AXIS=VALUE", value_parser = axis_values)]
    only: Vec<(String, Vec<Value>)>,
    /// How the night goes.
    #[command(flatten)]
    pub night: NightArgs,
    /// Only what failed when it was last tried. Without it everything that is not done, as `lumbre run` does
    #[arg(long)]
    pub failed: bool,
}

impl RetryArgs {
    /// Which experiment, if it is named.
    pub fn script(&self) -> Option<ScriptArgs> {
        let script = self.script.clone()?;
        Some(ScriptArgs { script, axes: self.axes.clone(), only: self.only.clone() })
    }
}

/// `lumbre explain`.
#[derive(Args, Debug)]
pub struct ExplainArgs {
    /// The run's folder, or the first digits of its id
    pub run: String,
    /// The script to hold it against [default: the one that its experiment was last run with]
    pub script: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre plan`.
#[derive(Args, Debug)]
pub struct PlanArgs {
    /// Which experiment.
    #[command(flatten)]
    pub script: ScriptArgs,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre check`.
#[derive(Args, Debug)]
pub struct CheckArgs {
    /// Scripts (.lua) and scene files
    #[arg(required = true)]
    pub files: Vec<PathBuf>,
}

/// `lumbre export`.
#[derive(Args, Debug)]
pub struct ExportArgs {
    /// The scene: a file of any known format, or Lua that returns one
    pub file: PathBuf,
    /// For Mitsuba 3: XML
    #[arg(long, required = true)]
    pub mitsuba: bool,
    /// The folder that is written; it must be new, empty, or hold an earlier export [default: NAME-mitsuba]
    #[arg(short = 'o', long = "folder", value_name = "DIR")]
    pub folder: Option<PathBuf>,
    /// Choose an option of a scene written in Lua; give it again for more
    #[arg(long, value_name = "NAME=VALUE", value_parser = setting)]
    pub option: Vec<(String, Value)>,
    /// Change something in the scene by its path: `materials.egg.ior=1.3`, `camera=table`; give it again for more
    #[arg(long, value_name = "PATH=VALUE", value_parser = setting)]
    pub set: Vec<(String, Value)>,
}

/// `lumbre watch`.
#[derive(Args, Debug)]
pub struct WatchArgs {
    /// An experiment's folder, or a folder of results, whose latest it is [default: --out]
    pub folder: Option<PathBuf>,
}

/// `lumbre status`.
#[derive(Args, Debug)]
pub struct StatusArgs {
    /// An experiment's folder, or a folder of results, whose latest it is [default: --out]
    pub folder: Option<PathBuf>,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// The states of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum StateName {
    /// Finished in its own folder
    Done,
    /// Finished in another folder of the same experiment
    Elsewhere,
    /// Its last try failed
    Failed,
    /// Started and not ended: running, or cut off
    Unfinished,
    /// Not started
    Pending,
}

/// `lumbre ls`.
#[derive(Args, Debug)]
pub struct LsArgs {
    /// Show only runs with all of these words in their experiment, path, id or reason: `depth=5`, `veach`
    pub words: Vec<String>,
    /// Show only runs in this state; give it again for more
    #[arg(long, value_name = "STATE")]
    pub state: Vec<StateName>,
    /// Show only the experiment that was run last
    #[arg(long)]
    pub latest: bool,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre show`.
#[derive(Args, Debug)]
pub struct ShowArgs {
    /// The run's folder, the first digits of its id, or `latest`: the one that started or ended last
    pub run: String,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre schema`.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
pub struct SchemaArgs {
    /// Print annotations for the Lua language server
    #[arg(long)]
    pub lua: bool,
    /// Print the tables of integrators, metrics, backends, material parameters and formats as JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre doctor`.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre verify`.
#[derive(Args, Debug)]
pub struct VerifyArgs {
    /// The folder below which the scenes of references lie; without it references are skipped
    #[arg(long, value_name = "DIR")]
    pub scenes: Option<PathBuf>,
    /// The folder of references: EXR, EXR of standard errors, JSON of settings [default: `references` beside the scenes]
    #[arg(long, value_name = "DIR")]
    pub references: Option<PathBuf>,
    /// Run only the checks whose kind, name or techniques contain this text; give it again to narrow further
    #[arg(long, value_name = "TEXT")]
    pub only: Vec<String>,
    /// Few samples and small pictures: seconds, and only large mistakes are found
    #[arg(long)]
    pub quick: bool,
    /// Instead of all this, kill a small night this often at random instants, start it again, and compare all that it
    /// leaves with what an undisturbed one leaves
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    pub kill: Option<u32>,
    /// With --kill: processes that work on each night at once
    #[arg(long, value_name = "N", default_value_t = 1, requires = "kill", value_parser = clap::value_parser!(u32).range(1..=64))]
    pub processes: u32,
    /// With --kill: the order of the cells of each night
    #[arg(long, value_name = "ORDER", default_value = Order::NAMES[0], requires = "kill", value_parser = Order::NAMES)]
    pub order: String,
    /// Seed of all random numbers; each seed repeats to the bit
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

/// `lumbre bench`.
#[derive(Args, Debug)]
pub struct BenchArgs {
    /// Scenes to measure besides the built-in ones: files, those in Lua with options and a view if wanted, as in
    /// `atrium.lua?light=lamps,camera=gallery`
    #[arg(value_name = "SCENE", value_parser = scene_arg)]
    pub scenes: Vec<SceneArg>,
    /// Measure the given scenes alone: neither the built-in ones nor the program's own overheads
    #[arg(long, requires = "scenes")]
    pub only: bool,
    /// Measure this backend with every integrator at depth 5 instead; give it again for more, side by side
    #[arg(long, value_name = "NAME")]
    pub backend: Vec<String>,
    /// Width of the pictures with `--backend`
    #[arg(long, value_name = "PIXELS", default_value_t = 1280, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub width: u32,
    /// Height of the pictures with `--backend`
    #[arg(long, value_name = "PIXELS", default_value_t = 720, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub height: u32,
    /// Rehearse a night of 10,000 cells over 1,000 workers with failures instead, in virtual time but with real claims in a
    /// real folder below --out
    #[arg(long, conflicts_with_all = ["traversal", "mpaths", "only", "backend"])]
    pub cluster_sim: bool,
    /// Measure the program's own overheads and nothing else
    #[arg(long, conflicts_with_all = ["traversal", "mpaths", "only", "backend", "cluster_sim"])]
    pub overheads: bool,
    /// Measure rays through the hierarchy and nothing else
    #[arg(long, conflicts_with = "mpaths")]
    pub traversal: bool,
    /// Measure the integrators and nothing else
    #[arg(long)]
    pub mpaths: bool,
    /// Measure loading a mesh of a million triangles and nothing else
    #[arg(long, conflicts_with_all = ["traversal", "mpaths", "backend"])]
    pub loading: bool,
    /// Measure what films with a time axis, delays and composed materials cost on the first scene and nothing else; with
    /// `--backend`, on that one
    #[arg(long, conflicts_with_all = ["traversal", "mpaths", "loading"])]
    pub time: bool,
    /// Measure what masks, ten thousand copies and ten thousand lights cost beside the same without them, and what a second
    /// thread brings, and nothing else
    #[arg(long, conflicts_with_all = ["scenes", "traversal", "mpaths", "backend", "loading", "time", "overheads"])]
    pub ratios: bool,
    /// Repetitions of every measurement; medians are reported, and the spread of the rates
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub repeats: u32,
    /// Print JSON
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definitions_hold_together() {
        Cli::command().debug_assert();
    }

    #[test]
    fn global_flags_stand_before_and_after_the_verb() {
        let before = Cli::try_parse_from(["lumbre", "--out", "x", "-q", "run", "a.lua"]).unwrap();
        let after = Cli::try_parse_from(["lumbre", "run", "a.lua", "depth=5", "--out", "x", "-q"]).unwrap();
        for cli in [before, after] {
            assert_eq!(cli.global.out, PathBuf::from("x"));
            assert!(cli.global.quiet);
        }
        let map = |args: &[&str]| match Cli::try_parse_from(args).unwrap().verb {
            Verb::Diff(diff) => diff.map_file().map(std::path::Path::to_owned),
            other => panic!("{other:?}"),
        };
        assert_eq!(map(&["lumbre", "diff", "a", "b"]), None);
        assert_eq!(map(&["lumbre", "diff", "a", "b", "--out", "m.png"]), Some(PathBuf::from("m.png")));
        assert!(Cli::try_parse_from(["lumbre", "schema"]).is_err());
        assert!(Cli::try_parse_from(["lumbre", "schema", "--lua", "--json"]).is_err());
    }
}
