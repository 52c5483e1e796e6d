//! `lumbre bench --suite`: fixed scenes, lights, techniques and metrics with a version, measured on
//! every backend of a machine, with one file as the result; and tables of the files of many
//! machines.
//!
//! Otherwise `lumbre bench` measures whatever is asked for, in more detail, and its numbers are for
//! one machine. Here scenes, sizes and seeds are fixed, so that numbers of different machines can
//! stand in one table.

pub mod compare;
mod measure;
mod result;
mod suite;

use std::collections::BTreeMap;
use std::path::PathBuf;
use std::time::SystemTime;

use crate::cli::about::doctor;
use crate::cli::args::{BenchArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use lumbre_night::store::{self, Host, utc};

use result::{BenchmarkResult, Machine, SUITE_VERSION};

pub use compare::main as compare;

/// Measures this machine and writes the result after each measurement.
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
    let begun = begin(args, global).resumed(&file);
    let mut result = begun.map_err(Failure::usage)?;
    if !result.cells.is_empty() {
        let count = counted(result.cells.len(), "measurement");
        progress(&format!("{} has {count} already", display_path(&file)));
    }
    let backends =
        measure::usable_backends(&args.backend, &mut progress).map_err(Failure::usage)?;
    let save = |result: &BenchmarkResult| {
        store::write_atomically(&file, result.to_text().as_bytes()).map_err(|e| e.to_string())
    };
    measure::measure(&mut result, &backends, global.threads, &save, &mut progress)
        .map_err(Failure::usage)?;
    let page = compare::page(std::slice::from_ref(&result));
    print_result(&page.map_err(Failure::internal)?)?;
    progress(&format!("written to {}", display_path(&file)));
    Ok(Exit::Done)
}

/// Returns the result of this machine without measurements.
fn begin(args: &BenchArgs, global: &Global) -> BenchmarkResult {
    let host = Host::detect();
    let threads = if global.threads == 0 {
        host.cores
    } else {
        global.threads
    };
    let features = doctor::cpu_features().into_iter().map(str::to_owned);
    BenchmarkResult {
        benchmark: SUITE_VERSION,
        program: lumbre_night::text::program().to_owned(),
        name: args.name.clone().unwrap_or_else(|| host.cpu.clone()),
        machine: Machine {
            os: host.os,
            cpu: host.cpu,
            cores: host.cores,
            threads,
            features: features.collect(),
        },
        settings: suite::settings(args),
        date: utc(SystemTime::now()),
        duration_s: 0.0,
        finished: false,
        backends: BTreeMap::new(),
        references: Vec::new(),
        cells: Vec::new(),
    }
}
