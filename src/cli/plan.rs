//! `lumbre plan`: what would run, and what would not.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::path::Path;

use serde_json::{Value as Json, json};

use super::args::{Global, PlanArgs};
use super::exit::{Exit, Failure, data};
use super::load::{self, decode, shown};
use super::run::counted;
use super::text;
use crate::experiment::event::{FinishedRun, History};
use crate::experiment::floors::floors;
use crate::experiment::forecast::{Forecast, Kind, Pace, Paces, forecast};
use crate::experiment::memory;
use crate::experiment::plan::{Estimate, ReferenceSource, unreachable};
use crate::experiment::spec::Order;
use crate::experiment::{Cell, CellRef, Plan, StopRule};
use crate::store::{Archive, archived_paces, plan_json};

/// Prints a script's plan.
pub fn main(args: &PlanArgs, global: &Global) -> Result<Exit, Failure> {
    let (_, plan) = load::plan(&args.script, global)?;
    print(&plan, global, args.json)
}

/// Prints a plan.
pub(super) fn print(plan: &Plan, global: &Global, as_json: bool) -> Result<Exit, Failure> {
    let archive = Archive::new(&global.out, decode);
    let found = |cell: CellRef| archive.done(plan, cell).map(|run| shown(&run.folder));
    let runs: Vec<Option<FinishedRun>> = (0..plan.cells.len()).map(|i| archive.done(plan, CellRef::Cell(i))).collect();
    let cells: Vec<Option<String>> = runs.iter().map(|run| run.as_ref().map(|run| shown(&run.folder))).collect();
    let references: Vec<Option<String>> = (0..plan.references.len()).map(|i| found(CellRef::Reference(i))).collect();
    let estimate = plan.estimate(&|cell| match cell {
        CellRef::Cell(i) => cells[i].is_none(),
        CellRef::Reference(i) => references[i].is_none(),
    });
    let reach = out_of_reach(plan, &archive);
    let begun: Vec<Option<u64>> = (0..plan.references.len()).map(|i| archive.begun(plan, i)).collect();
    let left = forecast(plan, &paces(plan, &runs, &global.out), &|cell| match cell {
        CellRef::Cell(i) => cells[i].is_none(),
        CellRef::Reference(i) => references[i].is_none(),
    });
    let ahead = Ahead { estimate, left, begun, reach };
    if as_json {
        let mut json = with_states(plan, &cells, &references, &ahead.estimate);
        let left = ahead.left;
        json["forecast"] = json!({
            "seconds": left.seconds, "at_most": left.at_most, "rough": left.rough, "runs": left.known,
            "unknown_runs": left.unknown,
        });
        json["goes_on_from"] = ahead.begun.into();
        json["out_of_reach"] = ahead.reach.into();
        data(&format!("{json:#}\n"))?;
    } else {
        data(&page(plan, &cells, &references, &ahead))?;
    }
    Ok(Exit::Done)
}

/// What is known of the work ahead.
struct Ahead {
    estimate: Estimate,
    left: Forecast,
    /// Of each reference, the samples per pixel of a shorter one from which it goes on.
    begun: Vec<Option<u64>>,
    /// What the noise of references puts out of reach.
    reach: Vec<String>,
}

impl Ahead {
    /// What is to be rendered in turns and does not fit into this machine's memory.
    fn crowded(&self) -> Option<String> {
        let [_, all] = memory::machine()?;
        memory::refusal(self.estimate.heat_runs, self.estimate.heat_bytes, memory::Room::Machine(all))
    }
}

/// How fast the runs were that are there: those of this plan, and those of all other nights.
fn paces(plan: &Plan, runs: &[Option<FinishedRun>], out: &Path) -> Paces {
    let mut paces = archived_paces(out);
    for (cell, run) in plan.cells.iter().zip(runs) {
        if let Some(pace) = run.as_ref().and_then(|run| Pace::of(run.rows.last()?, &cell.stop)) {
            paces.learn(Kind::of(&cell.config), pace);
        }
    }
    paces
}

/// The forecast in words.
fn foretold(left: &Forecast) -> Option<String> {
    if left.known == 0 {
        return None;
    }
    let unknown = match left.unknown {
        0 => String::new(),
        n => format!("; of {} nothing can be said before the smoke pass", counted(n, "run")),
    };
    let runs = counted(left.known, "run");
    Some(format!("forecast: {} {} for {runs}{unknown}", left.sign(), text::duration(left.seconds)))
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
        "heat_runs": estimate.heat_runs, "heat_bytes": estimate.heat_bytes,
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

fn page(plan: &Plan, cells: &[Option<String>], references: &[Option<String>], ahead: &Ahead) -> String {
    let Ahead { estimate, left, begun, reach } = ahead;
    let mut out = format!("{}  plan {}\n\n", plan.name, &plan.hash[..plan.hash.len().min(8)]);
    let state = |folder: &Option<String>| match folder {
        Some(folder) => format!("cached in {folder}"),
        None => "new".to_owned(),
    };
    if !plan.references.is_empty() {
        let mut lines = vec![["reference", "source", "stop", "state"].map(str::to_owned).to_vec()];
        for (place, (reference, folder)) in plan.references.iter().zip(references).enumerate() {
            let (source, stop, state) = match &reference.source {
                ReferenceSource::Render { config, stop, part, .. } => {
                    let begun = begun[place].map(|samples| format!("new, goes on from {samples} samples per pixel"));
                    let state = begun.filter(|_| folder.is_none()).unwrap_or_else(|| state(folder));
                    let parts = part.map_or_else(String::new, |samples| format!(", in parts of {samples}"));
                    (format!("{} {}", config.integrator, config.scene), stop.describe() + &parts, state)
                }
                ReferenceSource::File { file, source } => {
                    let content = reference.identity.as_map().and_then(|fields| fields.get("file")?.as_str());
                    let digits: String = content.unwrap_or_default().chars().take(8).collect();
                    let maker = if source.is_empty() { "nobody says who made it" } else { source };
                    (shown(file), String::new(), format!("file, blake3 {digits}, {maker}; its noise is unknown"))
                }
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
    if let Some(forecast) = foretold(left) {
        let _ = writeln!(out, "{forecast}");
    }
    let heats = plan.heats(plan.night.deadline.is_some());
    let most = heats.iter().map(Vec::len).max().unwrap_or(0);
    match plan.night.order {
        Order::Sequential => {}
        Order::Shuffled => out += "order: shuffled\n",
        Order::Interleave => {
            let heats = counted(heats.len(), "heat");
            let _ = write!(out, "order: {heats}, of up to {most} runs that take turns");
            if estimate.heat_bytes > 0 {
                let _ = write!(out, " and are in memory together: up to {}", text::size(estimate.heat_bytes));
            }
            out.push('\n');
        }
    }
    if let Some(warmup) = plan.night.warmup {
        let _ = writeln!(out, "warm-up of every cell, thrown away: {}", warmup.describe());
    }
    let doubles = plan.cells.iter().filter(|cell| cell.control.is_some()).count();
    if doubles > 0 {
        let _ = writeln!(out, "control: {} of the cells double others for the A/A check", doubles);
    }
    for note in &plan.notes {
        let _ = writeln!(out, "note: {note}");
    }
    let crowded = ahead.crowded();
    for warning in plan.warnings.iter().chain(reach).chain(&crowded) {
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
