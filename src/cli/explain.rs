//! `lumbre explain`: why a run would be rendered again, or why it would not.

use std::path::Path;

use serde_json::{Value as Json, json};

use super::again::last_command;
use super::args::{ExplainArgs, Global, ScriptArgs};
use super::exit::{Exit, Failure, data};
use super::load::{self, shown};
use crate::experiment::{CellRef, Plan};
use crate::store::{Condition, RunRecord, condition, read_run};

/// Explains one run.
pub fn main(args: &ExplainArgs, global: &Global) -> Result<Exit, Failure> {
    let record = read_run(&global.out, &args.run).map_err(Failure::usage)?;
    let folder = std::path::absolute(&record.folder).map_err(Failure::usage)?;
    let (script, global) = match &args.script {
        Some(script) => (ScriptArgs { script: script.clone(), axes: Vec::new(), only: Vec::new() }, global.clone()),
        None => {
            let experiment = folder.ancestors().find(|up| up.join("plan.json").is_file());
            let Some(experiment) = experiment else {
                return Err(Failure::usage("references belong to many experiments: name the script too"));
            };
            last_command(experiment, global)?
        }
    };
    let (_, plan) = load::plan(&script, &global)?;
    let id = record.config["run"].as_str().unwrap_or_default();
    let verdict = match find(&plan, id) {
        Some(cell) => present(&plan, cell, &folder, id),
        None => absent(&plan, &record),
    };
    if args.json {
        let fields =
            verdict.fields.iter().map(|[field, then, now]| json!({ "field": field, "run": then, "plan": now }));
        let fields: Vec<Json> = fields.collect();
        let json = json!({ "run": id, "again": verdict.again, "reasons": verdict.reasons, "fields": fields });
        data(&format!("{json:#}\n"))?;
    } else {
        let mut page = format!("{id}  {}\n", record.config["path"].as_str().unwrap_or("reference"));
        for reason in &verdict.reasons {
            page += &format!("  {reason}\n");
        }
        for [field, then, now] in &verdict.fields {
            page += &format!("    {field}: {then} then, {now} now\n");
        }
        data(&page)?;
    }
    Ok(Exit::Done)
}

/// What there is to say.
struct Verdict {
    /// Whether the script as it is now would have this very run rendered, in whole or in part.
    again: bool,
    reasons: Vec<String>,
    /// Fields of the identity that differ: name, the run's value, the plan's.
    fields: Vec<[String; 3]>,
}

fn find(plan: &Plan, id: &str) -> Option<CellRef> {
    let cell = plan.cells.iter().position(|cell| cell.id.0 == id).map(CellRef::Cell);
    cell.or_else(|| plan.references.iter().position(|r| r.id.0 == id).map(CellRef::Reference))
}

/// A run that the plan has.
fn present(plan: &Plan, cell: CellRef, folder: &Path, id: &str) -> Verdict {
    let mut reasons = Vec::new();
    let again = match condition(folder, id) {
        Condition::Whole(why) => {
            reasons
                .push(format!("would not be rendered again: it is done ({why}), and every file is what it was then"));
            false
        }
        Condition::Damaged(problem) => {
            reasons.push(format!("would be rendered again: {problem}"));
            true
        }
        Condition::Unfinished { failure, checkpoint } => {
            match failure {
                Some(failure) => {
                    reasons.push(format!("would be rendered again: its last try failed: {}", failure.reason));
                    reasons.extend(failure.log.iter().map(|line| format!("  | {line}")));
                }
                None => reasons.push("would be rendered: it was never finished".to_owned()),
            }
            reasons
                .extend(checkpoint.map(|n| format!("it would go on from its checkpoint after {n} samples per pixel")));
            true
        }
    };
    let path = match cell {
        CellRef::Cell(i) => plan.cells[i].path.as_str(),
        CellRef::Reference(_) => "a reference",
    };
    reasons.push(format!("the script asks for it as {path}"));
    Verdict { again, reasons, fields: Vec::new() }
}

/// A run that the plan has no more: what stands in its place, and where that differs.
fn absent(plan: &Plan, record: &RunRecord) -> Verdict {
    let path = record.config["path"].as_str().unwrap_or_default();
    let then = &record.config["identity"];
    let candidates: Vec<(&str, Json)> = if path.is_empty() {
        plan.references.iter().map(|r| (r.id.0.as_str(), r.identity.to_json())).collect()
    } else {
        plan.cells.iter().map(|cell| (cell.path.as_str(), cell.identity.to_json())).collect()
    };
    let nearest = candidates.iter().min_by_key(|(name, now)| (*name != path, differences(then, now).len()));
    let Some((name, now)) = nearest else {
        let reasons = vec!["the script asks for nothing like it".to_owned()];
        return Verdict { again: false, reasons, fields: Vec::new() };
    };
    let mut reasons = vec![format!("the script does not ask for it any more; nearest is {name}, which differs in:")];
    let fields = differences(then, now);
    if fields.iter().any(|[field, ..]| field == "scene") {
        let file = record.config["render"]["scene_file"].as_str().unwrap_or("the scene's file");
        let set = &record.config["render"]["set"];
        reasons.push(format!("(scene is the hash of {} after the changes {set})", shown(Path::new(file))));
    }
    Verdict { again: false, reasons, fields }
}

/// The innermost fields in which two values differ.
fn differences(then: &Json, now: &Json) -> Vec<[String; 3]> {
    let mut found = Vec::new();
    compare("", then, now, &mut found);
    found
}

fn compare(path: &str, then: &Json, now: &Json, found: &mut Vec<[String; 3]>) {
    match (then, now) {
        (Json::Object(a), Json::Object(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                let inner = if path.is_empty() { key.clone() } else { format!("{path}.{key}") };
                let missing = Json::Null;
                compare(&inner, a.get(key).unwrap_or(&missing), b.get(key).unwrap_or(&missing), found);
            }
        }
        _ if then == now => {}
        _ => found.push([path.to_owned(), then.to_string(), now.to_string()]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn differences_are_named_by_their_innermost_field() {
        let then = json!({ "a": { "b": 1, "c": [1, 2] }, "gone": true });
        let now = json!({ "a": { "b": 2, "c": [1, 2] }, "new": "x" });
        let found: Vec<String> = differences(&then, &now).into_iter().map(|fields| fields.join(" ")).collect();
        assert_eq!(found, ["a.b 1 2", "gone true null", "new null \"x\""]);
        assert!(differences(&then, &then).is_empty());
    }
}
