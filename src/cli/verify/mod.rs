//! `lumbre verify`: the program checks its own light transport, and against images that others made.
//!
//! A check compares pictures and ends in a verdict. All checks of a run share one significance, [`SIGNIFICANCE`], which is
//! split among them and, within each, among the blocks of the pictures [Sidak 1967]: a correct program fails somewhere
//! with this probability, for all seeds together. The seed is fixed, so that a run can be repeated to the bit.

mod agreement;
mod analytic;
mod density;
mod kill;
pub(super) mod picture;
pub mod pictures;
pub mod references;
mod report;
pub mod technique;

use std::path::PathBuf;
use std::time::Instant;

use super::args::{Global, VerifyArgs};
use super::exit::{Exit, Failure, data, talk};
use super::text::duration;
use report::Report;

/// The probability that some check of a run calls a correct program wrong.
pub const SIGNIFICANCE: f64 = 1e-3;

/// What a run is asked for.
pub struct Request {
    /// Fewer samples, smaller pictures.
    pub quick: bool,
    /// Decides all random numbers.
    pub seed: u64,
    /// Worker threads; 0 is one for each core.
    pub threads: usize,
    /// Where scenes lie that references were made of.
    pub scenes: Option<PathBuf>,
    /// Where the references lie.
    pub references: Option<PathBuf>,
}

impl Request {
    /// A seed of its own for picture `index` of a kind of check, the same whichever other checks run.
    fn seed(&self, kind: u64, index: usize) -> u64 {
        self.seed.wrapping_mul(1 << 32) ^ kind << 24 ^ index as u64
    }
}

/// How a check ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// As it should be.
    Passed,
    /// Not as it should be.
    Failed,
    /// Nothing could be said, or nothing was there.
    Skipped,
}

/// What a check found.
pub struct Outcome {
    /// The verdict.
    pub verdict: Verdict,
    /// The statistic in words, or why the check was skipped.
    pub statement: String,
    /// The same as numbers by name.
    pub figures: serde_json::Value,
}

impl Outcome {
    fn skipped(reason: impl Into<String>) -> Outcome {
        Outcome { verdict: Verdict::Skipped, statement: reason.into(), figures: serde_json::Value::Null }
    }
}

/// One row of the printed table.
pub struct Check {
    /// What is checked.
    pub name: String,
    /// What is compared with what.
    pub compared: String,
    /// Does it, as one of so many checks that share [`SIGNIFICANCE`].
    run: Box<dyn FnOnce(usize) -> Result<Outcome, String>>,
}

impl Check {
    fn new(
        name: impl Into<String>,
        compared: impl Into<String>,
        run: impl FnOnce(usize) -> Result<Outcome, String> + 'static,
    ) -> Check {
        Check { name: name.into(), compared: compared.into(), run: Box::new(run) }
    }
}

/// One row of [`KINDS`].
struct Kind {
    name: &'static str,
    /// Lists the checks; an error is the user's and ends the program before any work.
    plan: fn(&Request) -> Result<Vec<Check>, String>,
}

/// Every kind of check there is.
const KINDS: &[Kind] = &[
    Kind { name: "analytic", plan: analytic::plan },
    Kind { name: "density", plan: density::plan },
    Kind { name: "agreement", plan: agreement::plan },
    Kind { name: "reference", plan: references::plan },
    Kind { name: "picture", plan: pictures::plan },
];

/// Kills nights and says what became of them.
fn killed(kills: u32, args: &VerifyArgs, global: &Global) -> Result<Exit, Failure> {
    let start = Instant::now();
    let found =
        kill::check(kills, args.processes, &args.order, args.seed, global.threads).map_err(Failure::internal)?;
    let passed = found.problems.is_empty();
    if args.json {
        let json = serde_json::json!({
            "kills": found.kills, "nights": found.nights, "processes": args.processes, "order": args.order, "checkpoints": found.checkpoints,
            "files": found.files, "problems": found.problems, "passed": passed, "seconds": start.elapsed().as_secs_f64(),
        });
        data(&format!("{json:#}\n"))?;
    } else {
        let kill::Killed { kills, nights, checkpoints, files, .. } = found;
        let mut page = format!(
            "{kills} kills in {nights} nights of {} processes, {checkpoints} of them with a checkpoint to go on from: \
             {files} files of each night compared in {}, {}\n",
            args.processes,
            duration(start.elapsed().as_secs_f64()),
            if passed { "all the same" } else { "NOT the same" },
        );
        page.extend(found.problems.iter().map(|problem| format!("  {problem}\n")));
        data(&page)?;
    }
    Ok(if passed { Exit::Done } else { Exit::NotVerified })
}

/// Runs every check and says what it found.
pub fn main(args: &VerifyArgs, global: &Global) -> Result<Exit, Failure> {
    if let Some(kills) = args.kill {
        return killed(kills, args, global);
    }
    let request = Request {
        quick: args.quick,
        seed: args.seed,
        threads: global.threads,
        scenes: args.scenes.clone(),
        references: args.references.clone(),
    };
    let say = |line: &str| {
        if !global.quiet {
            talk(line);
        }
    };
    let mut checks = Vec::new();
    for kind in KINDS {
        let planned = (kind.plan)(&request).map_err(Failure::usage)?;
        checks.extend(planned.into_iter().map(|check| (kind.name, check)));
    }
    let wanted = |kind: &str, check: &Check| {
        let row = format!("{kind} {} {}", check.name, check.compared);
        args.only.iter().all(|text| row.contains(text.as_str()))
    };
    checks.retain(|(kind, check)| wanted(kind, check));
    if checks.is_empty() {
        return Err(Failure::usage(format!("no check contains `{}`", args.only.join("` and `"))));
    }
    let count = checks.len();
    let mut report = Report::new(&request, checks.iter().map(|(kind, check)| (*kind, check)));
    if !args.json {
        data(&report.head())?;
    }
    for (number, (kind, check)) in checks.into_iter().enumerate() {
        let Check { name, compared, run } = check;
        say(&format!("{} of {count}: {kind} {name}: {compared}", number + 1));
        let start = Instant::now();
        let outcome = run(count).unwrap_or_else(|problem| Outcome {
            verdict: Verdict::Failed,
            statement: problem,
            figures: serde_json::Value::Null,
        });
        let line = report.add(kind, &name, &compared, outcome, start.elapsed().as_secs_f64());
        if !args.json {
            data(&line)?;
        }
    }
    data(&if args.json { format!("{:#}\n", report.json()) } else { report.tail() })?;
    say(&format!("took {}", duration(report.seconds())));
    Ok(if report.failed() > 0 { Exit::NotVerified } else { Exit::Done })
}
