//! `lumbre bench --suite`: a fixed set of scenes and techniques with a version, measured on every backend
//! of a machine, with one file as the result; and tables of the files of many machines.
//!
//! Otherwise `lumbre bench` measures whatever is asked for, in more detail, and its numbers are for
//! one machine. Here scenes, sizes and seeds are fixed, so that numbers of different machines can stand
//! in one table.

pub mod compare;
mod measure;
mod result;

use std::path::PathBuf;

use crate::cli::args::{BenchArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::display_path;
use lumbre_night::store;

use result::SUITE_VERSION;

pub use compare::main as compare;

/// Measures this machine and writes the result.
pub fn run(args: &BenchArgs, global: &Global) -> Result<Exit, Failure> {
    let file = args.to.clone().unwrap_or_else(|| {
        let kind = if args.quick { "-quick" } else { "" };
        PathBuf::from(format!("benchmark-{SUITE_VERSION}{kind}.json"))
    });
    let mut progress = |line: &str| {
        if !global.quiet {
            print_status(line);
        }
    };
    let result = measure::measure(args, global, &mut progress).map_err(Failure::usage)?;
    store::write_atomically(&file, result.to_text().as_bytes()).map_err(Failure::usage)?;
    print_result(&compare::page(std::slice::from_ref(&result)))?;
    progress(&format!("written to {}", display_path(&file)));
    Ok(Exit::Done)
}
