//! Measures the program itself. Reports figures and never passes or fails, since machines are shared
//! and noisy. Rates of techniques on scenes and backends are measured by `lumbre bench`.

mod checkpoint;
mod cluster;
mod cluster_simulation;
mod dashboard;
mod handover;
mod loading;
mod long;
mod metrics;
mod mitsuba;
mod night;
mod ratios;
mod scale;
mod time;

use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use clap::Subcommand;
use lumbre::cli::bench::processor_line;
use lumbre::cli::bench::subject::Subject;
use lumbre_light::math::stats::median;

use crate::{program, root};

/// Number of program starts whose median is reported.
const STARTS: usize = 11;

/// Scene of the measurements that need any scene.
const SCENE: &str = "scenes/cornell/cornell.scn";

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    #[command(subcommand)]
    subject: Measured,
    /// Repeat every measurement this many times and report medians
    #[arg(long, global = true, value_name = "N", default_value_t = 5)]
    repeats: usize,
    /// Program to start where a process of its own is measured; by default the one that was built
    /// beside this program
    #[arg(long, global = true, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// What is measured. The variants are in alphabetical order, as the help prints them.
#[derive(Subcommand)]
enum Measured {
    /// A simulated night of 10,000 cells on 1,000 cluster workers with failures
    ///
    /// Time is simulated, but claims are real lock files in a temporary folder.
    Cluster,
    /// Processor time of the dashboard on two screens
    Dashboard,
    /// Transfer of images from a worker process
    Handover,
    /// Loading of a mesh of a million triangles
    Loading,
    /// Every metric on pictures of 1280x720
    Metrics,
    /// Processor time of a path of `nee` beside Mitsuba 3's `path`, on the same scenes
    Mitsuba(mitsuba::MitsubaArgs),
    /// Start-up, planning, bookkeeping, checkpoints, listing, and a night of short cells
    Overheads,
    /// Cost ratios: alpha masks, 10,000 instances, 10,000 lights, and a second thread
    ///
    /// Each is measured beside the same scene without it.
    Ratios,
    /// Cost of time axes, delays and composed materials
    Time {
        /// Backend to measure (repeat to compare backends)
        #[arg(long, value_name = "NAME", default_value = "cpu")]
        backend: Vec<String>,
    },
}

/// Measures and prints.
///
/// # Errors
/// Returns a message if a scene of the repository cannot be rendered, the program cannot be started
/// or a temporary file cannot be written.
pub fn run(args: &Args) -> Result<(), String> {
    println!("{}\n\n{}", processor_line(), measure(args)?);
    Ok(())
}

/// Measures and returns the figures as text.
fn measure(args: &Args) -> Result<String, String> {
    let repeats = args.repeats.max(1);
    let scene = Subject::built_in(root().join(SCENE));
    let program = || program(args.program.as_deref());
    Ok(match &args.subject {
        Measured::Cluster => cluster::ClusterCost::measure(&std::env::temp_dir())?.table(),
        Measured::Dashboard => dashboard::table(&dashboard::measure()?),
        Measured::Handover => {
            handover::ImageTransfer::measure(&program()?, &scene, repeats)?.table()
        }
        Measured::Loading => loading::Loading::measure(repeats)?.table(),
        Measured::Metrics => metrics::table(&metrics::measure(repeats)),
        Measured::Mitsuba(options) => mitsuba::BesideMitsuba::measure(options, repeats)?.table(),
        Measured::Overheads => overheads(&program()?, &scene, repeats)?,
        Measured::Ratios => {
            let subject =
                |name: &str| Subject::built_in(root().join(format!("scenes/{name}/{name}.scn")));
            let (masked, plain) = (subject("masked_leaves"), subject("cornell_spheres"));
            let mut progress = |line: &str| eprintln!("{line}");
            ratios::Ratios::measure(&masked, &plain, repeats, &mut progress)?.table()
        }
        Measured::Time { backend } => time::table(&time::measure(&scene, backend, repeats)?),
    })
}

/// Measures the overheads of a night: start-up, planning, bookkeeping, checkpoints and listing.
fn overheads(program: &Path, scene: &Subject, repeats: usize) -> Result<String, String> {
    let (plan, plan_s) = night::plan_10_000_cells()?;
    let start_up_s = start_up_s(program);
    let outside = night::share_outside_advance(&scene.file, 0)?;
    let checkpoint_s = checkpoint::checkpoint_s(&scene.file, 0, repeats)?;
    let listing = scale::ListingCost::measure(&plan)?;
    let short_cells = long::ShortCellCost::measure(program)?;
    Ok(format!(
        "start-up (--version)                 {:>9.1} ms\n\
         plan of 10,000 cells                 {plan_s:>9.3} s\n\
         time outside `advance`, 4 s cell     {:>9.2} %\n\
         checkpoint of bdpt at 1280x720       {:>9.1} ms\n\
         \x20 share of the 60 s interval         {:>9.2} %\n{}{}",
        start_up_s * 1e3,
        outside * 100.0,
        checkpoint_s * 1e3,
        checkpoint_s / 60.0 * 100.0,
        listing.table(),
        short_cells.table(),
    ))
}

/// Median seconds from starting the program to its end when it has nothing to do.
fn start_up_s(program: &Path) -> f64 {
    median((0..STARTS).map(|_| {
        let start = Instant::now();
        match Command::new(program).arg("--version").output() {
            Ok(_) => start.elapsed().as_secs_f64(),
            Err(_) => f64::NAN,
        }
    }))
}
