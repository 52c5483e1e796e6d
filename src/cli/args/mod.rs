//! Definition of the command line: verbs, options and their help texts.
//!
//! clap turns the doc comments of [`Verb`] and of all option fields into the help, the manual page
//! and the shell completions. The first paragraph of a comment is the short help.

mod cluster;
mod inspect;
mod measure;
mod night;
mod output;
mod scene;
mod script;
mod typed;
mod without_script;

use std::path::PathBuf;

use clap::{Args, Parser, Subcommand};

pub use cluster::{CancelArgs, JobArgs, Scheduler, SubmitArgs, WorkArgs};
pub use inspect::{LsArgs, NoteArgs, ShowArgs, StatusArgs, WatchArgs};
pub use measure::{BenchArgs, VerifyArgs};
pub use night::{NightArgs, PlanArgs, RunArgs};
pub use output::{DiffArgs, MetricArgs, ReportArgs, ReproduceArgs, ViewArgs};
pub use scene::{BsdfArgs, CheckArgs, ExportArgs, TraceArgs};
pub use script::ScriptArgs;
pub use typed::{SceneArg, integrator_row, split, unknown_name, value};
pub use without_script::{
    CompareArgs, ComparisonArgs, ExploreArgs, NewArgs, NewExperimentArgs, NewTechniqueArgs,
    PictureArgs, RenderArgs,
};

use crate::cli::exit;
use lumbre_scene_io::load::MissingTextures;

/// Command line of the program: options for every verb, and one verb.
#[derive(Debug, Parser)]
#[command(
    name = "lumbre",
    version,
    about = "A terminal-driven, Lua-scripted experiment runner for light transport",
    long_about = "Lumbre runs light transport experiments. A Lua script lists the scenes, the \
                  techniques and their parameters, the references and the stop rules. Lumbre \
                  renders every cell of the sweep, measures its error while it renders, and \
                  writes pictures, curves and tables below out/.\n\n\
                  A night is a scheduled run of an experiment.",
    after_help = exit::EXIT_CODES_HELP,
    subcommand_required = true,
    arg_required_else_help = true
)]
pub struct Cli {
    /// Options that every verb accepts.
    #[command(flatten)]
    pub global: Global,
    /// Verb with its own options.
    #[command(subcommand)]
    pub verb: Verb,
}

/// Default of `--out`.
const DEFAULT_OUT: &str = "out";
/// Largest accepted number of threads.
const MAX_THREADS: usize = 1024;

/// Parses a number of threads.
fn threads(text: &str) -> Result<usize, String> {
    let number = text.parse().ok().filter(|number| *number <= MAX_THREADS);
    number.ok_or_else(|| {
        format!("expected a whole number of at most {MAX_THREADS}, 0 for all cores, found `{text}`")
    })
}

/// Options that every verb accepts.
#[derive(Args, Clone, Debug)]
pub struct Global {
    /// Read and write results in this folder.
    #[arg(long, global = true, value_name = "DIR", default_value = DEFAULT_OUT)]
    pub out: PathBuf,
    /// Render on this backend instead of the script's.
    ///
    /// `lumbre doctor` lists the backends.
    #[arg(long, global = true, value_name = "NAME")]
    pub backend: Option<String>,
    /// Use this many CPU threads (0 = one per core).
    ///
    /// The number of threads never changes a picture.
    #[arg(
        long,
        global = true,
        value_name = "N",
        default_value_t = 0,
        value_parser = threads,
        allow_negative_numbers = true
    )]
    pub threads: usize,
    /// Let runs take at most this much memory at a time, as in `8GiB`.
    ///
    /// A run that needs more fails, and the night goes on. Without this option, the limits are what
    /// is free on the machine, in the control group of the process, and in its address space.
    #[arg(long, global = true, value_name = "BYTES", value_parser = typed::bytes)]
    pub memory: Option<u64>,
    /// Print progress lines instead of showing the dashboard.
    #[arg(long, global = true)]
    pub no_tui: bool,
    /// Print only results, warnings and errors.
    #[arg(long, short, global = true)]
    pub quiet: bool,
    /// Refuse scenes, scripts and files that they name outside this folder.
    ///
    /// For scenes from strangers, which may name any file. Links are followed first.
    #[arg(long, global = true, value_name = "DIR")]
    pub confine: Option<PathBuf>,
    /// Run the commands of the script's `external` techniques and notices.
    ///
    /// `lumbre plan` shows them. Without this option, a question in the terminal asks once for each
    /// script.
    #[arg(long, global = true)]
    pub allow_commands: bool,
    /// Continue if a texture cannot be read.
    ///
    /// Prints a warning and uses the material's constant value instead. Without this option, an
    /// unreadable texture is an error.
    #[arg(long, global = true)]
    pub lenient: bool,
}

impl Global {
    /// Returns how the scene loaders treat textures that cannot be read.
    pub fn missing(&self) -> MissingTextures {
        if self.lenient {
            MissingTextures::Note
        } else {
            MissingTextures::Fail
        }
    }
}

/// Verbs of the program.
#[derive(Debug, Subcommand)]
pub enum Verb {
    /// Render one picture of a scene.
    ///
    /// Shows the picture in the terminal while it renders, and writes it to files. Settings are
    /// those of a script's render table; whatever a script can compare, this verb can try.
    ///
    /// Example: lumbre render scenes/cornell.lua -i bdpt --spp 256 --size 640x480 -o box.exr
    Render(RenderArgs),
    /// Change a scene's technique, camera and settings while it renders.
    ///
    /// Shows the picture in the terminal, in the resolution of its pane, beside all settings of a
    /// script's render table. Keys and the mouse change them, and `x` writes them as a script that
    /// renders the same bits. Without a file, a list of scenes is shown first. `?` lists the keys.
    ///
    /// Example: lumbre explore scenes/cornell.lua integrator=bdpt
    Explore(ExploreArgs),
    /// Compare techniques on one scene at equal render time.
    ///
    /// Writes a script to out/scripts and runs it: every technique takes turns in several repeats,
    /// and its error is measured against a longer reference. Prints how many times as efficient the
    /// best technique is as each other one, with a confidence interval and its significance. The
    /// efficiency is 1 / (relMSE x render time).
    ///
    /// A key that only some of the techniques have, such as `variant=llvm_ad_rgb` of
    /// `external:mitsuba`, is given to those.
    ///
    /// Two pictures in place of a scene are compared as by `lumbre diff`.
    ///
    /// Example: lumbre compare scenes/cornell.lua --technique nee,bdpt --time 10s
    Compare(CompareArgs),
    /// Write a commented script that compares techniques on a scene.
    ///
    /// Asks three questions in a terminal, unless `--yes` is given.
    New(NewArgs),
    /// Run an experiment and write its figures and tables.
    ///
    /// Renders all cells that are not finished yet; cells that an earlier night finished are not
    /// rendered again. If a night was interrupted, run the same command to resume it, or
    /// `lumbre run --retry`.
    ///
    /// Example: lumbre run latest --failed
    Run(RunArgs),
    /// Run one cluster worker for an already planned night.
    ///
    /// The worker needs access to the night's folder, in which `lumbre run` or `lumbre submit`
    /// saved the plan. It rebuilds the plan and stops with an error if any input file has changed.
    /// It then renders cells that no other worker has claimed, until all are done. Workers may
    /// start and stop at any time; unfinished runs are resumed by others. The last worker writes
    /// tables and figures.
    Work(WorkArgs),
    /// Submit a night to a cluster as a job array of workers.
    ///
    /// Saves the plan in the night's folder, so that every worker renders the same plan, and
    /// submits one job per worker.
    Submit(SubmitArgs),
    /// Cancel a night's cluster jobs.
    ///
    /// Finished runs are kept. Submit again to resume the rest.
    Cancel(CancelArgs),
    /// Show what a script would render, without rendering.
    ///
    /// Lists all cells and references, whether they are cached, and which points are skipped and
    /// why.
    Plan(PlanArgs),
    /// Check scripts and scene files for errors.
    ///
    /// Accepts every known format. Renders and writes nothing.
    Check(CheckArgs),
    /// Export a scene for another renderer, or a night for a viewer.
    ///
    /// Of a scene, meshes become PLY files, textures PNG or OpenEXR. A note names each feature that the other
    /// renderer does not support, and what replaces it. Prints the path of the scene file. Samples,
    /// depth and size are parameters of the XML: mitsuba -D spp=64 -D max_depth=5 scene.xml
    /// Of a night, final pictures and references are copied: `--jeri` writes `data.js` with the tree of the viewer's
    /// component, `--figuregen` a script with its data, `--csv` tables.
    Export(ExportArgs),
    /// Show a running or finished night in the dashboard.
    ///
    /// Only reads files, takes no lock and writes nothing. It therefore works from any terminal,
    /// and on a folder copied from another machine. Without a terminal it prints the same as
    /// `lumbre status`.
    Watch(WatchArgs),
    /// Show the progress of a night.
    ///
    /// Prints what is running, done and failed, and the estimated time left.
    Status(StatusArgs),
    /// List experiments and the states of their runs.
    Ls(LsArgs),
    /// Take a note on a night, or print its notes.
    ///
    /// Notes stand on the page of the report. `lumbre ls` shows their tags, and finds nights by
    /// their words.
    Note(NoteArgs),
    /// Show the configuration, last measurements and files of one run, or why it is rendered again.
    Show(ShowArgs),
    /// Print the script interface for editors and other programs.
    Schema(SchemaArgs),
    /// Show what this machine supports.
    ///
    /// Lists backends, devices, cores, features of the terminal, and whether results can be
    /// written.
    Doctor(DoctorArgs),
    /// Verify light transport against theory and other renderers.
    ///
    /// Compares pictures block by block with statistical tests. The significance levels are chosen
    /// so that all checks together reject a correct program with a probability of 1 in 1000, for
    /// any seed.
    ///
    /// Checks:
    ///
    ///   analytic   scenes with a closed-form solution
    ///   density    MIS weights of bdpt, path by path, against their definition
    ///   agreement  built-in scenes with every integrator and every variant of its parameters
    ///   reference  images made by other renderers; needs --scenes
    ///   picture    images without standard errors, compared by fixed bounds; needs --scenes
    ///
    /// Exits with code 5 if a check fails.
    #[command(
        verbatim_doc_comment,
        about = "Verify light transport against theory and other renderers"
    )]
    Verify(VerifyArgs),
    /// Measure the speed of this program and write out/bench.json.
    ///
    /// For every scene: rays per second by kind. For every integrator: camera paths per second with
    /// their spread over the repetitions, the variance of one sample per pixel (mean over pixels
    /// and channels), the efficiency 1 / (variance x seconds per sample of every pixel), and the
    /// time to a relative RMSE of 5 % (root of the mean squared error over the mean of the
    /// picture). The last three are a dash if an integrator found light too rarely to estimate its
    /// variance.
    ///
    /// With `--suite`, measures a fixed set of scenes instead, whose results of different machines
    /// can be compared.
    ///
    /// Example: lumbre bench --suite --name laptop -o laptop.json
    Bench(BenchArgs),
    /// Measure the error of a picture against a reference picture.
    ///
    /// Accepts EXR, HDR, PNG, JPEG and BMP files of any origin. Files with 8 or 16 bits are decoded
    /// with the sRGB curve. Metrics use linear values unless their option `on` names a tone map.
    Metric(MetricArgs),
    /// Compare two pictures and draw the error of every pixel.
    Diff(DiffArgs),
    /// Write figures, tables, data files and an offline page for nights.
    ///
    /// Uses only the files in the given folders and renders nothing; nights may be running or
    /// finished. Several nights are compared, each labelled by its device or by `--name`. Times
    /// measured on different devices never share an axis without such a label.
    Report(ReportArgs),
    /// Render the runs behind a result file again and compare them.
    ///
    /// FILE is a picture, figure, table or data file written by lumbre, or the folder of a run.
    /// Every run named in one of the files is located in its night and rendered again with the same samples. For
    /// each run the result is: identical (every bit of the picture), equal within noise (with the
    /// p-value), or differs here (with the position, and a map of the difference). Times are not
    /// compared. Exits with code 5 if a picture differs.
    Reproduce(ReproduceArgs),
    /// Trace one sample of one pixel, step by step.
    ///
    /// Prints rays, the vertices where they end, and the contribution of each vertex. FILE is a
    /// scene, rendered with the options below, or the folder of a run, rendered with its
    /// `config.json`. The steps are the same on every backend except for rounding; choose one with
    /// `--backend`.
    Trace(TraceArgs),
    /// Draw the lobe of a material, and what it samples beside the density that it states.
    ///
    /// Writes a figure as SVG and PNG: the value times the cosine in the plane of normal and viewer,
    /// the density on the sphere beside that of samples, and delays beside their density. Prints
    /// the p-values of chi-square tests of the samples. Exits with code 5 if samples do not follow
    /// the density (p below 1e-4).
    ///
    /// Example: lumbre bsdf scenes/material_ball.lua ball --at 60 --set materials.ball.metallic=1
    Bsdf(BsdfArgs),
    /// Draw frames, animations and curves from the time axis of a run.
    ///
    /// Redraws frames, animations, streak images, curves and arrival times for the given moments,
    /// pixels and regions, from the arrays of a finished run with `film = { time = .. }`. The last
    /// line of the output is an ffmpeg command that makes a video.
    View(ViewArgs),
    /// Serve render requests of another lumbre process through pipes.
    #[command(hide = true)]
    Worker,
}

/// Options of `lumbre schema`.
#[derive(Args, Debug)]
#[group(required = true, multiple = false)]
pub struct SchemaArgs {
    /// Print annotations for the Lua language server.
    #[arg(long)]
    pub lua: bool,
    /// Print integrators, metrics, backends, material parameters and formats as JSON.
    #[arg(long)]
    pub json: bool,
}

/// Options of `lumbre doctor`.
#[derive(Args, Debug)]
pub struct DoctorArgs {
    /// Print as JSON.
    #[arg(long)]
    pub json: bool,
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;

    #[test]
    fn the_definitions_are_consistent() {
        Cli::command().debug_assert();
    }

    #[test]
    fn global_flags_stand_before_and_after_the_verb() {
        let before = Cli::try_parse_from(["lumbre", "--out", "x", "-q", "run", "a.lua"]).unwrap();
        let after =
            Cli::try_parse_from(["lumbre", "run", "a.lua", "depth=5", "--out", "x", "-q"]).unwrap();
        for cli in [before, after] {
            assert_eq!(cli.global.out, PathBuf::from("x"));
            assert!(cli.global.quiet);
        }
        let map = |args: &[&str]| match Cli::try_parse_from(args).unwrap().verb {
            Verb::Diff(diff) => diff.map_file().map(std::path::Path::to_owned),
            other => panic!("{other:?}"),
        };
        assert_eq!(map(&["lumbre", "diff", "a", "b"]), None);
        assert_eq!(
            map(&["lumbre", "diff", "a", "b", "--out", "m.png"]),
            Some(PathBuf::from("m.png"))
        );
        assert!(Cli::try_parse_from(["lumbre", "schema"]).is_err());
        assert!(Cli::try_parse_from(["lumbre", "schema", "--lua", "--json"]).is_err());
    }
}
