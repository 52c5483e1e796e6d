//! `lumbre bench`: the program measures itself.

use super::args::{BenchArgs, Global};
use super::exit::{Exit, Failure};

/// Measures, prints, and writes `bench.json`.
pub fn main(args: &BenchArgs, _: &Global) -> Result<Exit, Failure> {
    Err(Failure::usage(format!("no benchmarks in this build ({} scenes were named)", args.scenes.len())))
}
