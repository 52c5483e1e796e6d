//! `lumbre show RUN --why`: why a run would or would not be rendered again.

use std::path::Path;

use serde_json::{Value as Json, json};

use crate::cli::args::{Global, ScriptArgs};
use crate::cli::exit::{Failure, print_result};
use crate::cli::format::display_path;
use crate::cli::json;
use crate::cli::night::last_command::last_command;
use crate::cli::night::load;
use crate::cli::night::permission::PlanUse;
use lumbre_light::value::Value;
use lumbre_night::experiment::{CellRef, Plan};
use lumbre_night::store::schema::plan::PlanFile;
use lumbre_night::store::{Integrity, RunReader, RunRecord, StoredFile};

/// Prints why a run would or would not be rendered again by a script, or by that with which its
/// experiment was last run.
pub fn print(
    record: &RunRecord,
    script: Option<&Path>,
    as_json: bool,
    global: &Global,
) -> Result<(), Failure> {
    let folder = std::path::absolute(&record.folder).map_err(Failure::usage)?;
    let (script, global) = match script {
        Some(script) => (
            ScriptArgs {
                script: script.to_owned(),
                ..ScriptArgs::default()
            },
            global.clone(),
        ),
        None => {
            let experiment = folder
                .ancestors()
                .find(|up| up.join(PlanFile::NAME).is_file());
            let Some(experiment) = experiment else {
                return Err(Failure::usage(
                    "references are shared by experiments: name the script, --why SCRIPT",
                ));
            };
            last_command(experiment, global)?
        }
    };
    let (_, plan) = load::load_plan(&script, PlanUse::Show, &global)?;
    let id = record.config.run.as_str();
    let verdict = match find_run(&plan, id) {
        Some(cell) => explain_planned_run(&plan, cell, &folder, id),
        None => explain_missing_run(&plan, record),
    };
    if as_json {
        let fields = verdict
            .fields
            .iter()
            .map(|[field, old, new]| json!({ "field": field, "run": old, "plan": new }));
        let fields: Vec<Json> = fields.collect();
        let json = json!({ "run": id, "again": verdict.again, "reasons": verdict.reasons,
            "fields": fields });
        json::print(json)
    } else {
        let mut page = format!(
            "{id}  {}\n",
            record.config.path.as_deref().unwrap_or("reference")
        );
        for reason in &verdict.reasons {
            page += &format!("  {reason}\n");
        }
        for [field, old, new] in &verdict.fields {
            page += &format!("    {field}: {old} in the run, {new} in the script\n");
        }
        print_result(&page)
    }
}

/// Whether a run is rendered again, and why.
struct Verdict {
    /// Whether the current script would render this run, completely or from a checkpoint.
    again: bool,
    /// Lines of text.
    reasons: Vec<String>,
    /// Fields of the identity that differ: name, value in the run, value in the plan.
    fields: Vec<[String; 3]>,
}

/// Returns the cell or reference of a plan with a run id.
fn find_run(plan: &Plan, id: &str) -> Option<CellRef> {
    let cell = plan
        .cells
        .iter()
        .position(|cell| cell.id.0 == id)
        .map(CellRef::Cell);
    cell.or_else(|| {
        plan.references
            .iter()
            .position(|r| r.id.0 == id)
            .map(CellRef::Reference)
    })
}

/// Explains a run that is part of the plan.
fn explain_planned_run(plan: &Plan, cell: CellRef, folder: &Path, id: &str) -> Verdict {
    let mut reasons = Vec::new();
    let again = match RunReader::new(folder.to_owned()).integrity(id) {
        Integrity::Intact(reason) => {
            reasons.push(format!(
                "would not be rendered again: it is done ({reason}), and all its files are intact"
            ));
            false
        }
        Integrity::Damaged(problem) => {
            reasons.push(format!("would be rendered again: {problem}"));
            true
        }
        Integrity::Unfinished {
            failure,
            checkpoint,
        } => {
            match failure {
                Some(failure) => {
                    reasons.push(format!(
                        "would be rendered again: its last attempt failed: {}",
                        failure.reason
                    ));
                    reasons.extend(failure.log.iter().map(|line| format!("  | {line}")));
                }
                None => reasons.push("would be rendered: it was never finished".to_owned()),
            }
            reasons.extend(checkpoint.map(|n| {
                format!("it would resume from its checkpoint after {n} samples per pixel")
            }));
            true
        }
    };
    let path = match cell {
        CellRef::Cell(i) => plan.cells[i].path.as_str(),
        CellRef::Reference(_) => "a reference",
    };
    reasons.push(format!("it is part of the script's plan as {path}"));
    Verdict {
        again,
        reasons,
        fields: Vec::new(),
    }
}

/// Explains a run that is no longer part of the plan: finds the most similar run and the
/// differences.
fn explain_missing_run(plan: &Plan, record: &RunRecord) -> Verdict {
    let path = record.config.path.as_deref().unwrap_or_default();
    let old = &record.config.identity;
    let compared: Vec<(&str, Vec<[String; 3]>)> = if path.is_empty() {
        plan.references
            .iter()
            .map(|r| (r.id.0.as_str(), differences(old, &r.identity)))
            .collect()
    } else {
        plan.cells
            .iter()
            .map(|cell| {
                let new = cell.identity.to_value();
                (cell.path.as_str(), differences(old, &new))
            })
            .collect()
    };
    let nearest = compared
        .into_iter()
        .min_by_key(|(name, fields)| (*name != path, fields.len()));
    let Some((name, fields)) = nearest else {
        let reasons = vec!["it is not part of the script's plan, which is empty".to_owned()];
        return Verdict {
            again: false,
            reasons,
            fields: Vec::new(),
        };
    };
    let mut reasons = vec![format!(
        "it is no longer part of the script's plan; the most similar run is {name}, which differs \
         in:"
    )];
    if let Some(settings) = record.config.settings()
        && fields.iter().any(|[field, ..]| field == "scene")
    {
        reasons.push(format!(
            "(`scene` is the hash of {} with the changes {})",
            display_path(&settings.scene_file),
            json!(settings.set)
        ));
    }
    Verdict {
        again: false,
        reasons,
        fields,
    }
}

/// Returns the innermost fields in which two values differ: path, old value, new value.
fn differences(old: &Value, new: &Value) -> Vec<[String; 3]> {
    let mut found = Vec::new();
    collect_differences("", old, new, &mut found);
    found
}

/// Appends the innermost fields below `path` in which two values differ.
fn collect_differences(path: &str, old: &Value, new: &Value, found: &mut Vec<[String; 3]>) {
    match (old, new) {
        (Value::Map(a), Value::Map(b)) => {
            let mut keys: Vec<&String> = a.keys().chain(b.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                let inner = if path.is_empty() {
                    key.clone()
                } else {
                    format!("{path}.{key}")
                };
                let missing = Value::Nil;
                collect_differences(
                    &inner,
                    a.get(key).unwrap_or(&missing),
                    b.get(key).unwrap_or(&missing),
                    found,
                );
            }
        }
        _ if old == new => {}
        _ => {
            let text = |value: &Value| json!(value).to_string();
            found.push([path.to_owned(), text(old), text(new)]);
        }
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::inspect::explain::*;

    #[test]
    fn differences_are_named_by_their_innermost_field() {
        let old = json!({ "a": { "b": 1, "c": [1, 2] }, "gone": true });
        let new = json!({ "a": { "b": 2, "c": [1, 2] }, "new": "x" });
        let [old, new] = [old, new].map(|json| Value::from_json(&json));
        let found: Vec<String> = differences(&old, &new)
            .into_iter()
            .map(|fields| fields.join(" "))
            .collect();
        assert_eq!(found, ["a.b 1 2", "gone true null", "new null \"x\""]);
        assert!(differences(&old, &old).is_empty());
    }
}
