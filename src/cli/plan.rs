//! `lumbre plan`: what would run, and what would not.

use std::collections::BTreeSet;
use std::fmt::Write as _;

use serde_json::{Value as Json, json};

use super::args::{Global, PlanArgs};
use super::exit::{Exit, Failure, data};
use super::load::{self, decode, shown};
use super::run::counted;
use super::text;
use crate::experiment::event::History;
use crate::experiment::floors::floors;
use crate::experiment::plan::{Estimate, ReferenceSource, unreachable};
use crate::experiment::{Cell, CellRef, Plan, StopRule};
use crate::store::{Archive, plan_json};

/// Prints a script's plan.
pub fn main(args: &PlanArgs, global: &Global) -> Result<Exit, Failure> {
    let (_, plan) = load::plan(&args.script, global)?;
    print(&plan, global, args.json)
}

/// Prints a plan.
pub(super) fn print(plan: &Plan, global: &Global, as_json: bool) -> Result<Exit, Failure> {
    let archive = Archive::new(&global.out, decode);
    let found = |cell: CellRef| archive.done(plan, cell).map(|run| shown(&run.folder));
    let cells: Vec<Option<String>> = (0..plan.cells.len()).map(|i| found(CellRef::Cell(i))).collect();
    let references: Vec<Option<String>> = (0..plan.references.len()).map(|i| found(CellRef::Reference(i))).collect();
    let estimate = plan.estimate(&|cell| match cell {
        CellRef::Cell(i) => cells[i].is_none(),
        CellRef::Reference(i) => references[i].is_none(),
    });
    let reach = out_of_reach(plan, &archive);
    if as_json {
        let mut json = with_states(plan, &cells, &references, &estimate);
        json["out_of_reach"] = reach.into();
        data(&format!("{json:#}\n"))?;
    } else {
        data(&page(plan, &cells, &references, &estimate, &reach))?;
    }
    Ok(Exit::Done)
}

fn with_states(plan: &Plan, cells: &[Option<String>], references: &[Option<String>], estimate: &Estimate) -> Json {
    let mut json = plan_json(plan);
    for (key, found) in [("cells", cells), ("references", references)] {
        for (entry, folder) in json[key].as_array_mut().into_iter().flatten().zip(found) {
            let file = entry["kind"] == "file";
            entry["state"] = if folder.is_some() || file { "cached" } else { "new" }.into();
            entry["cached_in"] = folder.as_deref().into();
        }
    }
    json["estimate"] = json!({
        "runs_by_time": estimate.by_time, "seconds": estimate.seconds,
        "runs_by_samples": estimate.by_samples, "paths": estimate.paths,
        "runs_without_limit": estimate.unbounded, "layer_bytes": estimate.layer_bytes,
    });
    json
}

/// What the references that are there already put out of reach. Reading their halves takes a moment, so only those are
/// read on whose metrics a stop rule waits.
fn out_of_reach(plan: &Plan, history: &dyn History) -> Vec<String> {
    let waits = |cell: &Cell| {
        let mut waits = false;
        cell.stop.visit(&mut |rule| waits |= matches!(rule, StopRule::When { .. }));
        waits
    };
    let awaited: BTreeSet<usize> = plan.cells.iter().filter(|c| waits(c)).filter_map(|c| c.reference).collect();
    let sentences = |place: usize| -> Vec<String> {
        match (history.image(plan, place), history.halves(plan, place)) {
            (Ok(Some(image)), Ok(Some(halves))) => {
                unreachable(plan, place, &floors(&plan.measure.metrics, &image, &halves))
            }
            (_, Err(error)) | (Err(error), _) => vec![format!("how noisy a reference is cannot be told: {error}")],
            _ => Vec::new(),
        }
    };
    awaited.into_iter().flat_map(sentences).collect()
}

fn page(
    plan: &Plan,
    cells: &[Option<String>],
    references: &[Option<String>],
    estimate: &Estimate,
    reach: &[String],
) -> String {
    let mut out = format!("{}  plan {}\n\n", plan.name, &plan.hash[..plan.hash.len().min(8)]);
    let state = |folder: &Option<String>| match folder {
        Some(folder) => format!("cached in {folder}"),
        None => "new".to_owned(),
    };
    if !plan.references.is_empty() {
        let mut lines = vec![["reference", "source", "stop", "state"].map(str::to_owned).to_vec()];
        for (reference, folder) in plan.references.iter().zip(references) {
            let (source, stop, state) = match &reference.source {
                ReferenceSource::Render { config, stop, .. } => {
                    (format!("{} {}", config.integrator, config.scene), stop.describe(), state(folder))
                }
                ReferenceSource::File(file) => (shown(file), String::new(), "file".to_owned()),
            };
            lines.push(vec![short(&reference.id.0), source, stop, state]);
        }
        out += &text::aligned(&lines);
        out.push('\n');
    }
    let axes = plan.cells.first().map(|c| c.point.iter().map(|(name, _)| name.clone())).into_iter().flatten();
    let mut header = vec!["cell".to_owned()];
    header.extend(axes);
    header.extend(["repeat", "run", "state"].map(str::to_owned));
    let mut lines = vec![header];
    for (i, (cell, folder)) in plan.cells.iter().zip(cells).enumerate() {
        let mut line = vec![(i + 1).to_string()];
        line.extend(cell.point.iter().map(|(_, value)| value.to_string()));
        line.extend([cell.repeat.to_string(), short(&cell.id.0), state(folder)]);
        lines.push(line);
    }
    out += &text::aligned(&lines);
    for skipped in &plan.skipped {
        let point: Vec<String> = skipped.point.iter().map(|(axis, value)| format!("{axis}={value}")).collect();
        // Writing to a String cannot fail.
        let _ = writeln!(out, "skipped {}: {}", point.join(" "), skipped.reason);
    }
    let count = |found: &[Option<String>]| found.iter().flatten().count();
    let _ = writeln!(
        out,
        "\n{} ({} cached), {} ({} cached), {} skipped",
        counted(cells.len(), "cell"),
        count(cells),
        counted(references.len(), "reference"),
        count(references),
        counted(plan.skipped.len(), "point")
    );
    let _ = writeln!(out, "estimate: {}", in_words(estimate));
    for note in &plan.notes {
        let _ = writeln!(out, "note: {note}");
    }
    for warning in plan.warnings.iter().chain(reach) {
        let _ = writeln!(out, "warning: {warning}");
    }
    out
}

fn in_words(estimate: &Estimate) -> String {
    let mut parts = Vec::new();
    if estimate.by_time > 0 {
        let runs = counted(estimate.by_time, "run");
        parts.push(format!("at most {} of render time in {runs}", text::duration(estimate.seconds)));
    }
    if estimate.by_samples > 0 {
        let runs = counted(estimate.by_samples, "run");
        parts.push(format!("at most {} million camera paths in {runs}", text::rounded(estimate.paths / 1e6)));
    }
    if estimate.unbounded > 0 {
        parts.push(format!("{} without a limit of time or samples", counted(estimate.unbounded, "run")));
    }
    if estimate.layer_bytes > 0 {
        parts.push(format!("layers and bins take up to {} of memory", text::size(estimate.layer_bytes)));
    }
    if parts.is_empty() { "nothing to render".to_owned() } else { parts.join("; ") }
}

fn short(id: &str) -> String {
    id[..id.len().min(8)].to_owned()
}
