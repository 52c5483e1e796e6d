//! The command line: it joins the rooms of level 5, and is the only room that prints.
//!
//! Data goes to stdout, talk to stderr. Errors come here as values and are shown once, with the place in the script
//! where there is one; [`exit::Exit`] has the program's statuses.

mod again;
mod args;
mod bench;
mod builtin;
mod check;
mod cluster;
mod compare;
mod docs;
mod doctor;
mod exit;
mod explain;
mod export;
mod inspect;
mod load;
mod log;
mod plan;
mod recorder;
mod report;
mod reproduce;
mod run;
mod schema;
mod signals;
mod space;
mod status;
mod text;
mod trace;
mod until;
pub mod verify;
mod view;
mod watch;
mod worker;

use std::process::ExitCode;

use clap::Parser;

use args::{BenchArgs, Cli, Global, Verb};
use exit::{Exit, Failure, data, talk};

/// Runs the command line of this process and says how it ended.
pub fn main() -> ExitCode {
    exit::hook_panics();
    exit::hook_reports();
    // The hook has said what there is to say; a panic must not look like a result.
    let ended = std::panic::catch_unwind(|| match Cli::try_parse() {
        Ok(cli) => verb(&cli).unwrap_or_else(|failure| {
            failure.show();
            failure.exit
        }),
        Err(answer) => {
            // Help and version are answers too; clap knows which of them go to stdout. A closed pipe is no error.
            let _ = answer.print();
            if answer.use_stderr() { Exit::Usage } else { Exit::Done }
        }
    });
    ended.unwrap_or(Exit::Internal).into()
}

fn verb(cli: &Cli) -> Result<Exit, Failure> {
    let global = &cli.global;
    if let Verb::Worker = cli.verb {
        return worker::main();
    }
    let log = log::Log::install(global.quiet);
    worker::employ();
    match &cli.verb {
        Verb::Run(args) => run::main(args, global, &log),
        Verb::Retry(args) => run::retry(args, global, &log),
        Verb::Work(args) => cluster::work(args, global, &log),
        Verb::Submit(args) => cluster::submit(args, global),
        Verb::Cancel(args) => cluster::cancel(args, global),
        Verb::Explain(args) => explain::main(args, global),
        Verb::Plan(args) => plan::main(args, global),
        Verb::Check(args) => check::main(args, global),
        Verb::Export(args) => export::main(args, global),
        Verb::Watch(args) => watch::main(args, global, &log),
        Verb::Status(args) => status::main(args, global),
        Verb::Ls(args) => inspect::ls(args, global),
        Verb::Show(args) => inspect::show(args, global),
        Verb::Schema(args) => schema::main(args),
        Verb::Doctor(args) => doctor::main(args, global),
        Verb::Verify(args) => verify::main(args, global),
        Verb::Bench(args) => measure(args, global),
        Verb::Metric(args) => compare::metric(args, global),
        Verb::Diff(args) => compare::diff(args, global),
        Verb::Reproduce(args) => reproduce::main(args, global),
        Verb::View(args) => view::main(args, global),
        Verb::Report(args) => report::main(args, global),
        Verb::Trace(args) => trace::main(args, global),
        Verb::Completions { shell } => docs::completions(*shell),
        Verb::Man => docs::man(),
        Verb::Worker => worker::main(),
    }
}

/// `lumbre bench`: prints the figures and writes `bench.json` where results live.
fn measure(args: &BenchArgs, global: &Global) -> Result<Exit, Failure> {
    let file = global.out.join("bench.json");
    crate::store::probe(&global.out).map_err(Failure::usage)?;
    let mut say = |line: &str| {
        if !global.quiet {
            talk(line);
        }
    };
    let report = if args.cluster_sim {
        bench::cluster(&global.out, &mut say)
    } else {
        bench::measure(args, global.threads, global.missing(), &mut say)
    };
    let report = report.map_err(Failure::usage)?;
    let json = format!("{:#}\n", report.json());
    crate::store::atomic(&file, json.as_bytes()).map_err(Failure::internal)?;
    data(if args.json { &json } else { report.text() })?;
    say(&format!("written to {}", load::shown(&file)));
    Ok(Exit::Done)
}
