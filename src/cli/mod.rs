//! The command line. Connects the other modules and is the only module that prints.
//!
//! Results go to stdout, status messages to stderr. Errors arrive here as values and are printed
//! once, with their position in the script if they have one. [`exit::Exit`] lists the exit codes.

pub mod about;
mod args;
pub mod bench;
mod benchmark;
mod cluster;
mod exit;
mod figure_files;
pub mod format;
pub mod inspect;
mod json;
pub mod night;
mod own_techniques;
mod reproduce;
pub mod scene;
mod selector;
mod tev;
pub mod verify;
mod without_script;
mod worker;

use std::process::ExitCode;

use clap::FromArgMatches;

pub use about::reference::reference;

use args::{BenchArgs, Cli, Global, Verb};
use exit::{Exit, Failure, print_result, print_status};
use lumbre_night::experiment::memory;
use lumbre_render::own_technique::OwnTechnique;
use lumbre_scene_io::load::files;

pub use about::reference::command;

/// Size in bytes of the stack on which the program runs. That of the process may be limited to less.
const STACK: usize = 16 << 20;

/// Parses the arguments of this process, runs the requested verb and returns the exit code.
pub fn main() -> ExitCode {
    main_with(&[])
}

/// Does the same as [`main()`] in a program of one's own, in which `techniques` are known wherever the
/// built-in integrators are. Must be called before anything else of these crates, since techniques
/// are registered once for the process. If one has a name or a parameter that is taken or invalid,
/// the program prints which and exits with code 2.
pub fn main_with(techniques: &[OwnTechnique]) -> ExitCode {
    if let Err(reason) = own_techniques::register(techniques) {
        let failure = Failure::usage(format!("cannot register the techniques: {reason}"));
        failure.print();
        return failure.exit.into();
    }
    exit::install_panic_hook();
    if let Err(e) = night::signals::ignore_file_size_limit() {
        print_status(&format!("warning: cannot install a signal handler: {e}"));
    }
    let thread = std::thread::Builder::new()
        .name("main".to_owned())
        .stack_size(STACK);
    match thread.spawn(run) {
        Ok(running) => running.join().unwrap_or(Exit::Internal).into(),
        Err(e) => {
            print_status(&format!(
                "cannot start a thread: {e}; this process may use too little memory or too few \
                 threads: raise the limits, `ulimit -v` and `ulimit -u`"
            ));
            Exit::Internal.into()
        }
    }
}

/// Runs the verb that the arguments of this process request.
fn run() -> Exit {
    // The panic hook has already printed the message; a panic must not look like a result.
    let ended = std::panic::catch_unwind(|| match parse_arguments() {
        Ok(cli) => dispatch(&cli).unwrap_or_else(|failure| {
            failure.print();
            failure.exit
        }),
        Err(error) => {
            // clap reports help and version this way too, and chooses stdout or stderr. A closed
            // pipe is not an error. Arguments may have control characters.
            let shown = error.render().to_string();
            if shown.contains(lumbre_night::text::is_control) {
                print_status(&shown);
            } else {
                let _ = error.print();
            }
            if error.use_stderr() {
                Exit::Usage
            } else {
                Exit::Done
            }
        }
    });
    ended.unwrap_or(Exit::Internal)
}

/// Parses the arguments of this process.
fn parse_arguments() -> Result<Cli, clap::Error> {
    let arguments = about::usage::with_verb_of_pictures(std::env::args_os().collect());
    let version = lumbre_night::text::program().trim_start_matches("lumbre ");
    let mut command = command().version(version);
    let matches = command
        .try_get_matches_from_mut(&arguments)
        .map_err(|error| about::usage::with_remedy(error, &command, &arguments))?;
    for warning in about::reference::options_without_effect(&matches) {
        print_status(&warning);
    }
    Cli::from_arg_matches(&matches)
}

/// Runs the verb of a parsed command line.
fn dispatch(cli: &Cli) -> Result<Exit, Failure> {
    let global = &cli.global;
    if let Verb::Worker = cli.verb {
        return worker::main();
    }
    if let Some(shortage) = memory::address_space_shortage() {
        return Err(Failure::usage(shortage));
    }
    if let Some(folder) = &global.confine {
        files::confine(folder)
            .map_err(|e| Failure::usage(format!("--confine {}: {e}", folder.display())))?;
    }
    let log = night::log::Log::install(global.quiet);
    worker::enable_worker_processes();
    if !global.quiet && matches!(cli.verb, Verb::Run(_) | Verb::Plan(_) | Verb::Work(_)) {
        for library in own_techniques::libraries() {
            print_status(&library);
        }
    }
    match &cli.verb {
        Verb::Run(args) => night::run::main(args, global, &log),
        Verb::Work(args) => cluster::work(args, global, &log),
        Verb::Submit(args) => cluster::submit(args, global),
        Verb::Cancel(args) => cluster::cancel(args, global),
        Verb::Render(args) => without_script::picture::main(args, global),
        Verb::Explore(args) => without_script::explore::main(args, global),
        Verb::Compare(args) => without_script::compare::main(args, global, &log),
        Verb::New(args) => without_script::new::main(args, global),
        Verb::Plan(args) => night::plan::main(args, global),
        Verb::Check(args) => scene::check::main(args, global),
        Verb::Export(args) => scene::export::main(args, global),
        Verb::Watch(args) => inspect::watch::main(args, global, &log),
        Verb::Status(args) => inspect::status::main(args, global),
        Verb::Ls(args) => inspect::list::ls(args, global),
        Verb::Note(args) => inspect::note::main(args, global),
        Verb::Show(args) => inspect::list::show(args, global),
        Verb::Schema(args) => about::schema::main(args),
        Verb::Doctor(args) => about::doctor::main(args, global),
        Verb::Verify(args) => verify::main(args, global),
        Verb::Bench(args) if args.suite => benchmark::run(args, global),
        Verb::Bench(args) if !args.compare.is_empty() => benchmark::compare(args, global),
        Verb::Bench(args) => run_bench(args, global),
        Verb::Metric(args) => inspect::compare::metric(args, global),
        Verb::Diff(args) => inspect::compare::diff(args, global),
        Verb::Reproduce(args) => reproduce::main(args, global),
        Verb::View(args) => inspect::view::main(args, global),
        Verb::Report(args) => inspect::report::main(args, global),
        Verb::Trace(args) => scene::trace::main(args, global),
        Verb::Bsdf(args) => scene::bsdf::main(args, global),
        Verb::Worker => worker::main(),
    }
}

/// Runs `lumbre bench` on scenes: prints the measurements and writes `bench.json` to the results folder.
fn run_bench(args: &BenchArgs, global: &Global) -> Result<Exit, Failure> {
    let file = global.out.join("bench.json");
    lumbre_night::store::probe(&global.out).map_err(Failure::usage)?;
    let mut print_progress = |line: &str| {
        if !global.quiet {
            print_status(line);
        }
    };
    let report = bench::measure(args, global.threads, global.missing(), &mut print_progress)
        .map_err(Failure::usage)?;
    let json = format!("{:#}\n", json::versioned(report.json().clone()));
    lumbre_night::store::write_atomically(&file, json.as_bytes()).map_err(Failure::internal)?;
    print_result(if args.json { &json } else { report.text() })?;
    print_progress(&format!("written to {}", format::display_path(&file)));
    Ok(Exit::Done)
}
