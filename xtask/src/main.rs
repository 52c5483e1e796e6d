//! Chores of developers: `cargo xtask --help` lists them. Not part of the product and not
//! built with it.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program for terminals"
)]

mod bench;
#[cfg(unix)]
mod bugs;
mod calibrate;
mod command;
#[cfg(unix)]
mod fuzz;
mod inlining;
#[cfg(unix)]
mod page;
mod pages;
mod random;
mod release;
mod replicate;
mod shaders;
mod spirv;
#[cfg(unix)]
mod torture;

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
    /// Measure the program itself: overheads of a night, loading, metrics, dashboard
    Bench(bench::Args),
    /// Plant bugs in a copy of the code, and show which tests catch them
    #[cfg(unix)]
    Bugs(bugs::Args),
    /// Measure how often the claims of comparisons are false, on nights whose truth is known
    Calibrate(calibrate::Args),
    /// Feed changed files to every reader, and count what it accepted and what it reached
    #[cfg(unix)]
    Fuzz(fuzz::Args),
    /// Search the compiled program for vector instructions that are called as functions; needs
    /// `objdump`
    Inlining,
    /// Write the manual page of the program and its shell completions
    Pages(pages::Args),
    /// Pack the program, its manual page, completions and licences into an archive with a checksum
    Release(release::Args),
    /// Run the scripts of the theses, test their claims, and write the page about it
    Replicate(replicate::Args),
    /// Compile the shaders to the SPIR-V that is committed; needs `glslangValidator`
    Shaders(shaders::Args),
    /// Measure the memory that verbs take for the worst files of every format
    #[cfg(unix)]
    Memory(torture::memory::Args),
    /// Attack the program by kills, damage, limits, hostile scripts and scenes, and count what it
    /// noticed
    #[cfg(unix)]
    Torture(torture::Args),
}

fn main() -> ExitCode {
    let done = match Args::parse().chore {
        Chore::Bench(args) => bench::run(&args),
        #[cfg(unix)]
        Chore::Bugs(args) => bugs::run(&args),
        Chore::Calibrate(args) => calibrate::run(&args),
        #[cfg(unix)]
        Chore::Fuzz(args) => fuzz::run(&args),
        Chore::Inlining => inlining::run(),
        Chore::Pages(args) => pages::run(&args),
        Chore::Release(args) => release::run(&args),
        Chore::Replicate(args) => replicate::run(&args),
        Chore::Shaders(args) => shaders::run(&args),
        #[cfg(unix)]
        Chore::Memory(args) => torture::memory::run(&args),
        #[cfg(unix)]
        Chore::Torture(args) => torture::run(&args),
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

/// Returns whether a name contains one of the texts of `--only`; without any, all names count.
fn is_chosen(only: &[String], name: &str) -> bool {
    only.is_empty() || only.iter().any(|text| name.contains(text.as_str()))
}

/// Returns the program to start: the given one, or the one that was built beside this program.
///
/// # Errors
/// Returns a message if there is none.
fn program(given: Option<&Path>) -> Result<PathBuf, String> {
    let own = std::env::current_exe().map_err(|e| e.to_string())?;
    let beside = own.with_file_name(format!("lumbre{}", std::env::consts::EXE_SUFFIX));
    let program = given.map_or(beside, Path::to_owned);
    if program.is_file() {
        Ok(program)
    } else {
        Err(format!(
            "there is no program {}: run `cargo build` with the same profile, or use --program",
            program.display()
        ))
    }
}
