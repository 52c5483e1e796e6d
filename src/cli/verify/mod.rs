//! `lumbre verify`: checks of the program's light transport, among its techniques and against
//! images of other programs, and with `--mitsuba` of scenes against Mitsuba.
//!
//! A check compares pictures and ends in a verdict. All checks of a run share one significance
//! level, [`SIGNIFICANCE`]. It is split among the checks and, within each check, among the blocks
//! of the pictures [Sidak 1967]: this is the probability, over all seeds, that a correct program
//! fails any check. The seed is fixed, so a run is reproducible to the bit.

mod agreement;
mod analytic;
mod check;
mod consistent;
mod density;
mod kill;
mod mitsuba;
pub(super) mod picture;
pub mod pictures;
pub mod references;
mod report;
pub mod technique;

use std::time::Instant;

use super::args::{Global, VerifyArgs};
use super::exit::{Exit, Failure, print_result, print_status};
use super::format::duration;
use check::SeedFamily;
pub use check::{Check, Outcome, SIGNIFICANCE, Verdict, VerifyRequest};
use report::VerifyReport;

/// A family of checks: its name, and a function that lists its checks. An error of the function is
/// reported to the user before any check runs.
type CheckFamily = (
    &'static str,
    fn(&VerifyRequest) -> Result<Vec<Check>, String>,
);

/// All families of checks.
const FAMILIES: &[CheckFamily] = &[
    ("analytic", analytic::plan),
    ("consistent", consistent::plan),
    ("density", density::plan),
    ("agreement", agreement::plan),
    ("reference", references::plan),
    ("picture", pictures::plan),
];

/// The family of checks against Mitsuba, which replaces the others.
const MITSUBA: &[CheckFamily] = &[("mitsuba", mitsuba::plan)];

/// Runs the kill test and reports its result.
fn run_kill_test(kills: u32, args: &VerifyArgs, global: &Global) -> Result<Exit, Failure> {
    let start = Instant::now();
    let result = kill::check(
        kills,
        args.processes,
        &args.order,
        args.seed,
        global.threads,
    )
    .map_err(Failure::internal)?;
    let passed = result.problems.is_empty();
    if args.json {
        let json = serde_json::json!({
            "kills": result.kills, "nights": result.nights, "processes": args.processes,
            "order": args.order, "checkpoints": result.checkpoints,
            "files": result.files, "problems": result.problems, "passed": passed,
            "seconds": start.elapsed().as_secs_f64(),
        });
        crate::cli::json::print(json)?;
    } else {
        let kill::KillReport {
            kills,
            nights,
            checkpoints,
            files,
            ..
        } = result;
        let mut page = format!(
            "{kills} kills in {nights} nights of {} processes, {checkpoints} of them with a \
             checkpoint to resume from: {files} files per night compared in {}, {}\n",
            args.processes,
            duration(start.elapsed().as_secs_f64()),
            if passed {
                "all identical"
            } else {
                "NOT identical"
            },
        );
        page.extend(
            result
                .problems
                .iter()
                .map(|problem| format!("  {problem}\n")),
        );
        print_result(&page)?;
    }
    Ok(if passed {
        Exit::Done
    } else {
        Exit::NotVerified
    })
}

/// Returns the checks whose rows contain all texts of `only`, with the names of their families.
fn selected_checks(
    request: &VerifyRequest,
    families: &'static [CheckFamily],
    only: &[String],
) -> Result<Vec<(&'static str, Check)>, Failure> {
    let mut checks = Vec::new();
    for (name, plan) in families {
        let planned = plan(request).map_err(Failure::usage)?;
        checks.extend(planned.into_iter().map(|check| (*name, check)));
    }
    checks.retain(|(family, check)| {
        let row = format!("{family} {} {}", check.name, check.compared);
        only.iter().all(|text| row.contains(text.as_str()))
    });
    if checks.is_empty() {
        return Err(Failure::usage(format!(
            "no check contains `{}`; --only matches text of a row, such as `analytic` or `bdpt`",
            only.join("` and `")
        )));
    }
    Ok(checks)
}

/// Runs all selected checks and prints their results.
pub fn main(args: &VerifyArgs, global: &Global) -> Result<Exit, Failure> {
    if let Some(kills) = args.kill {
        return run_kill_test(kills, args, global);
    }
    let request = VerifyRequest {
        quick: args.quick,
        seed: args.seed,
        threads: global.threads,
        scenes: args.scenes.clone(),
        references: args.references.clone(),
        python: args.python.clone(),
        files: args.files.clone(),
    };
    let progress = |line: &str| {
        if !global.quiet {
            print_status(line);
        }
    };
    let families = if args.mitsuba { MITSUBA } else { FAMILIES };
    let checks = selected_checks(&request, families, &args.only)?;
    let count = checks.len();
    let mut report = VerifyReport::new(
        &request,
        checks.iter().map(|(family, check)| (*family, check)),
    );
    if !args.json {
        print_result(&report.head())?;
    }
    for (number, (family, check)) in checks.into_iter().enumerate() {
        let (name, compared) = (check.name, check.compared);
        progress(&format!(
            "{} of {count}: {family} {name}: {compared}",
            number + 1
        ));
        let start = Instant::now();
        let outcome = (check.run)(count).unwrap_or_else(Outcome::failed);
        let seconds = start.elapsed().as_secs_f64();
        let line = report.add(family, &name, &compared, outcome, seconds);
        if !args.json {
            print_result(&line)?;
        }
    }
    print_result(&if args.json {
        format!("{:#}\n", crate::cli::json::versioned(report.json()))
    } else {
        report.tail()
    })?;
    if let Some(file) = &args.page {
        let page = mitsuba::page::markdown(report.json()).map_err(Failure::internal)?;
        std::fs::write(file, page)
            .map_err(|e| Failure::usage(format!("cannot write `{}`: {e}", file.display())))?;
    }
    progress(&format!("took {}", duration(report.seconds())));
    Ok(if report.failed() > 0 {
        Exit::NotVerified
    } else {
        Exit::Done
    })
}
