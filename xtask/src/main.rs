//! Chores of developers: `cargo run -p xtask -- --help` lists them. Not part of the product and not
//! built with it.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program for terminals"
)]

mod shaders;

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Chores of the developers of Lumbre
#[derive(Parser)]
struct Args {
    #[command(subcommand)]
    chore: Chore,
}

/// A chore is a module of this program with a function `run`.
#[derive(Subcommand)]
enum Chore {
    /// Compile the shaders to the SPIR-V that is committed
    Shaders(shaders::Args),
}

fn main() -> ExitCode {
    let done = match Args::parse().chore {
        Chore::Shaders(args) => shaders::run(&args),
    };
    match done {
        Ok(()) => ExitCode::SUCCESS,
        Err(problem) => {
            eprintln!("error: {problem}");
            ExitCode::FAILURE
        }
    }
}

/// Returns the root of the repository.
fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..")
}
