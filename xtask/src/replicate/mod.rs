//! `cargo xtask replicate`: runs the scripts of `scripts/theses`, judges the claims beside them, and
//! writes `docs/replication.md`.

mod claims;
mod page;
mod significance;
mod values;

use std::path::{Path, PathBuf};
use std::process::Command;

use lumbre_light::value::Value;
use lumbre_night::experiment::CellRef;
use lumbre_night::experiment::night::Night;
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{Evidence, NightReader};

use crate::command::execute;
use crate::{is_chosen, program, root};
use claims::{Claim, ClaimedScript, Selection, Test, matches};
use significance::{Judgement, Verdict, judge};
use values::NightValues;

/// Options of the chore.
#[derive(clap::Args)]
pub struct Args {
    /// Use the small form of every script, which takes half an hour on two cores instead of eight
    #[arg(long)]
    quick: bool,
    /// Run and judge only scripts whose name contains this text, and leave the page as it is
    #[arg(long, value_name = "TEXT")]
    only: Vec<String>,
    /// Folder of the nights; finished runs in it are kept
    #[arg(long, value_name = "FOLDER", default_value = "out/theses")]
    out: PathBuf,
    /// Judge the nights that exist, and render nothing
    #[arg(long)]
    judge: bool,
    /// Set an axis of the scripts that have it, such as `python=venv/bin/python` for Mitsuba
    #[arg(long, value_name = "AXIS=VALUE")]
    set: Vec<String>,
    /// Program to run; by default the one that was built beside this program
    #[arg(long, value_name = "FILE")]
    program: Option<PathBuf>,
}

/// A claim with its verdict.
struct Judged<'a> {
    script: &'a ClaimedScript,
    claim: &'a Claim,
    /// Value of the axis `each`, such as `stage = bedroom`; empty without one.
    place: String,
    judgement: Judgement,
    /// Judgement of the claim with its reason, if the claim does not hold and has one that runs
    /// show.
    reason: Option<Judgement>,
}

/// Runs the scripts, judges their claims and writes the page.
///
/// # Errors
/// Returns a message if a file of claims is invalid, a script fails, or the page cannot be written.
pub fn run(args: &Args) -> Result<(), String> {
    let scripts = claims::scripts()?;
    let chosen = || {
        scripts
            .iter()
            .filter(|script| is_chosen(&args.only, &script.name))
    };
    let out = std::path::absolute(&args.out).map_err(|e| e.to_string())?;
    let mut failures = Vec::new();
    if !args.judge {
        let program = program(args.program.as_deref())?;
        for script in chosen() {
            if let Err(problem) = render(&program, script, &out, args) {
                eprintln!("{}: {problem}", script.name);
                failures.push(script.name.as_str());
            }
        }
    }
    let evidence = Evidence::default();
    let readers: Vec<NightReader> = NightReader::all(&out).into_iter().flatten().collect();
    let (mut nights, mut judged) = (Vec::new(), Vec::new());
    for script in chosen() {
        let reader = best_night(&readers, &script.name, args.quick);
        let night = reader.map(|reader| read_night(reader.folder(), &evidence));
        let night = night.transpose().map_err(|e| e.to_string())?;
        let night = night.unwrap_or_default();
        judged.extend(judge_script(script, &night, &evidence));
        nights.push(night);
    }
    judged.iter().for_each(print);
    for problem in evidence.problems() {
        eprintln!("left out: {problem}");
    }
    if args.only.is_empty() {
        page::write(&judged, &nights, &out, args.quick)?;
        println!("{}", page::PAGE);
    }
    match failures.as_slice() {
        [] => Ok(()),
        _ => Err(format!("these scripts failed: {}", failures.join(", "))),
    }
}

/// Runs a script as a night.
fn render(program: &Path, script: &ClaimedScript, out: &Path, args: &Args) -> Result<(), String> {
    println!("{}", script.name);
    let file = script.file();
    let spec = lumbre_lua::load(&root().join(&file))
        .map_err(|e| e.to_string())?
        .spec;
    let has_axis = |set: &&String| {
        let axis = set.split_once('=').map_or(set.as_str(), |(axis, _)| axis);
        spec.axes
            .iter()
            .any(|a| a.names.iter().any(|name| name == axis))
    };
    let mut night = Command::new(program);
    night
        .current_dir(root())
        .args(["run", &file, "--no-tui", "--out"])
        .arg(out);
    night.args(args.quick.then_some("quick=true"));
    night.args(args.set.iter().filter(has_axis));
    execute(&mut night)
}

/// Returns the night of an experiment in the given form with the most finished runs, and the newest
/// of several.
fn best_night<'a>(readers: &'a [NightReader], name: &str, quick: bool) -> Option<&'a NightReader> {
    let form = Selection::from([("quick".to_owned(), Value::Bool(quick))]);
    let is_meant = |reader: &&NightReader| {
        let plan = reader.plan();
        plan.name == name && plan.cells.iter().all(|cell| matches(&cell.point.0, &form))
    };
    readers.iter().filter(is_meant).max_by_key(|reader| {
        let cells = (0..reader.plan().cells.len()).map(CellRef::Cell);
        let finished = cells
            .filter(|cell| reader.finished_folder(*cell).is_some())
            .count();
        (
            finished,
            reader.env().map(|env| env.date).unwrap_or_default(),
        )
    })
}

/// Judges the claims of a script by its night, which may be empty.
fn judge_script<'a>(
    script: &'a ClaimedScript,
    night: &Night,
    evidence: &Evidence,
) -> Vec<Judged<'a>> {
    let values = NightValues::new(night, evidence);
    let mut judged = Vec::new();
    for claim in &script.claims {
        let mut add = |placed: &Claim, place: String| {
            let judgement = judge(placed, &values);
            let arm = placed
                .with_reason()
                .filter(|_| judgement.verdict != Verdict::Holds);
            judged.push(Judged {
                script,
                claim,
                place,
                reason: arm.map(|arm| judge(&arm, &values)),
                judgement,
            });
        };
        let axis = claim.each.as_deref().unwrap_or_default();
        let places = values.axis_values(axis);
        if places.is_empty() {
            add(claim, String::new());
        }
        for value in places {
            add(&claim.at(axis, &value), format!("{axis} = {value}"));
        }
    }
    judged
}

impl Judged<'_> {
    /// Returns the claim as a sentence with its place.
    fn sentence(&self) -> String {
        match self.place.as_str() {
            "" => self.claim.says.clone(),
            place => format!("{} ({place})", self.claim.says),
        }
    }

    /// Whether it is a picture that was drawn, which is no result of a test.
    fn is_drawn(&self) -> bool {
        self.claim.test == Test::Drawn && self.judgement.verdict == Verdict::Holds
    }
}

/// Prints a verdict.
fn print(judged: &Judged) {
    let name = judged.judgement.verdict.name();
    let (item, numbers) = (&judged.claim.item, &judged.judgement.shown);
    println!(
        "{name:16} {} {item}: {} | {numbers}",
        judged.claim.document,
        judged.sentence()
    );
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use std::collections::BTreeSet;

    use lumbre_lua::scene;
    use lumbre_night::experiment::plan::{Overrides, Plan, expand};
    use lumbre_night::experiment::spec::Point;
    use lumbre_scene_io::load::MissingTextures;

    use super::claims::{Operand, Over, Side};
    use super::values::Quantity;
    use super::*;

    /// Plans the quick form of a script.
    fn plan(script: &ClaimedScript) -> Plan {
        let loaded = lumbre_lua::load(&root().join(script.file())).unwrap();
        let overrides = Overrides {
            axes: vec![("quick".to_owned(), vec![Value::Bool(true)])],
            ..Overrides::default()
        };
        let plan = expand(&loaded.spec, &loaded, &overrides, &mut |path, options| {
            scene::read(path, options, MissingTextures::Fail)
        });
        plan.unwrap_or_else(|e| panic!("{}: {e}", script.name))
    }

    /// Returns a fault of a claim: runs that the plan lacks or cannot distinguish, or a metric.
    fn fault(claim: &Claim, plan: &Plan) -> Option<String> {
        if matches!(claim.test, Test::Drawn | Test::None) {
            return None;
        }
        let columns = || {
            plan.measure
                .metrics
                .iter()
                .map(|metric| metric.column.as_str())
        };
        for side in [Side::A, Side::B] {
            let column = claim.quantity(side).ok().and_then(Quantity::column);
            if let Some(column) = column.filter(|column| !columns().any(|c| c == *column)) {
                return Some(format!("nothing measures `{column}`"));
            }
        }
        let mut selections = vec![claim.a.clone()];
        if let Some(Operand::Runs(b)) = &claim.b {
            selections.push(b.clone());
        }
        if let Some(Over { axis, values }) = &claim.over {
            let at = |value: &Value| {
                let mut selection = claim.a.clone();
                selection.insert(axis.clone(), value.clone());
                selection
            };
            selections = values.iter().map(at).collect();
        }
        // Points that need a program which is not installed are left out, and exist.
        let cells = plan.cells.iter().map(|cell| (&cell.point, cell.repeat));
        let absent = plan.skipped.iter().filter(|skipped| skipped.absent);
        let runs: Vec<(&Point, u32)> = cells.chain(absent.map(|s| (&s.point, 0))).collect();
        selections.iter().find_map(|selection| {
            let found = runs.iter().filter(|(point, _)| matches(point, selection));
            let repeats: Vec<u32> = found.map(|(_, repeat)| *repeat).collect();
            let distinct: BTreeSet<&u32> = repeats.iter().collect();
            let text = Value::Map(selection.clone());
            match (repeats.len(), distinct.len()) {
                (0, _) => Some(format!("no run matches {text}")),
                (runs, repeats) if runs > repeats => Some(format!("several runs match {text}")),
                _ => None,
            }
        })
    }

    #[test]
    fn every_claim_names_runs_and_metrics_of_its_script() {
        // Paths of scenes in scripts are relative to the current folder.
        std::env::set_current_dir(root()).unwrap();
        let scripts = claims::scripts().unwrap();
        assert!(scripts.len() > 30, "{}", scripts.len());
        let mut faults = Vec::new();
        for script in &scripts {
            assert!(!script.claims.is_empty(), "{}", script.name);
            let plan = plan(script);
            assert_eq!(plan.name, script.name);
            for (i, claim) in script.claims.iter().enumerate() {
                let mut check = |claim: &Claim| {
                    let fault = fault(claim, &plan);
                    faults.extend(
                        fault.map(|fault| format!("{}: claim {}: {fault}", script.name, i + 1)),
                    );
                };
                let Some(axis) = &claim.each else {
                    check(claim);
                    claim.with_reason().iter().for_each(check);
                    continue;
                };
                let values = plan.cells.iter().flat_map(|cell| &cell.point);
                let values: Vec<_> = values.filter(|(name, _)| name == axis).collect();
                assert!(!values.is_empty(), "{}: no axis `{axis}`", script.name);
                for (_, value) in values {
                    check(&claim.at(axis, value));
                }
            }
        }
        assert!(faults.is_empty(), "{}", faults.join("\n"));
    }

    #[test]
    fn an_item_is_covered_by_a_claim_or_listed_as_uncovered() {
        let scripts = claims::scripts().unwrap();
        let items = scripts.iter().flat_map(|script| &script.claims);
        let covered: BTreeSet<(&str, String)> = items
            .flat_map(|c| {
                claims::single_items(&c.item)
                    .into_iter()
                    .map(|item| (c.document.as_str(), item))
            })
            .collect();
        for item in claims::uncovered().unwrap() {
            assert!(
                !covered.contains(&(&item.document, item.item.clone())),
                "{}",
                item.item
            );
        }
    }
}
