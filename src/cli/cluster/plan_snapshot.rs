//! Plan snapshots in a night's folder, from which workers on other machines rebuild the plan.

use std::path::Path;
use std::sync::Arc;

use crate::cli::args::{Global, ScriptArgs};
use crate::cli::exit::Failure;
use crate::cli::format::display_path;
use crate::cli::night::last_command::parse;
use crate::cli::night::load;
use crate::cli::night::permission::PlanUse;
use lumbre_lua::{Limits, Script};
use lumbre_night::backends::auto_backend;
use lumbre_night::experiment::Plan;
use lumbre_night::paths::SCRIPT_COPY;
use lumbre_night::store::{PlanCommand, PlanSnapshot, Store, StoreError, StoredFile};
use lumbre_night::text::program;

/// Saves in a night's folder what workers need to rebuild its plan.
///
/// # Errors
/// Returns an error if the snapshot cannot be written.
pub fn save_plan_snapshot(
    store: &Store,
    plan: &Plan,
    script: &ScriptArgs,
) -> Result<(), StoreError> {
    let folder = std::env::current_dir().unwrap_or_default();
    let command = PlanCommand {
        script: folder.join(&script.script),
        folder,
        arguments: lumbre_night::text::arguments(),
        auto: auto_backend().0.to_owned(),
    };
    let out = store.folder().parent().unwrap_or(store.folder());
    store.write_plan_snapshot(&PlanSnapshot::new(out, store.folder(), plan, command))
}

/// Plan that was rebuilt from its snapshot.
pub struct RestoredPlan {
    /// Script as it was when the snapshot was saved.
    pub script: Script,
    /// Rebuilt plan, with the same hash as in the snapshot.
    pub plan: Arc<Plan>,
    /// Snapshot from which it was rebuilt.
    pub snapshot: PlanSnapshot,
}

/// Rebuilds the plan of a night's folder. Changes the current folder to the one in which the plan
/// was made, since the paths in a script are relative to it.
///
/// # Errors
/// Returns an error if there is no snapshot, it was saved by another version of the program, a file
/// or folder that the plan needs does not exist on this machine, or the plan has changed. In the
/// last case the message names the changes.
pub fn restore_plan(home: &Path, global: &Global) -> Result<RestoredPlan, Failure> {
    let snapshot = PlanSnapshot::load(home).map_err(Failure::usage)?;
    if !snapshot.program.is_same_version() {
        return Err(Failure::usage(format!(
            "the plan in {} was saved by {}, but this is {}; pictures of different \
             versions may differ. Use that version, or plan the night again with `lumbre run` or \
             `lumbre submit`",
            display_path(home),
            snapshot.program.0,
            program()
        )));
    }
    std::env::set_current_dir(&snapshot.folder).map_err(|e| {
        Failure::usage(format!(
            "cannot open {}, the folder in which the plan was made: {e} (is it shared with this \
             machine?)",
            snapshot.folder.display()
        ))
    })?;
    let damaged = |why: &str| {
        Failure::usage(format!(
            "{} in {} is damaged: {why}",
            PlanSnapshot::NAME,
            display_path(home)
        ))
    };
    let (script_args, recorded) =
        parse(snapshot.arguments.iter().map(String::as_str), home).map_err(damaged)?;
    let script_args = ScriptArgs {
        script: snapshot.script.clone(),
        ..script_args
    };
    lumbre_night::backends::set_auto_backend(&snapshot.auto);
    let file = home.join(SCRIPT_COPY);
    let text = std::fs::read_to_string(&file)
        .map_err(|e| damaged(&format!("{}: {e}", display_path(&file))))?;
    let global = Global {
        backend: recorded.backend,
        lenient: recorded.lenient,
        ..global.clone()
    };
    let load = || {
        lumbre_lua::load_text(&snapshot.script, text.clone(), Limits::default())
            .map_err(Failure::script)
    };
    let rebuilt = load::plan_of(&load, &script_args, PlanUse::Render, &global, false);
    let (script, plan) = rebuilt.map_err(|failure| {
        let changes = changed_files(&snapshot);
        if changes.is_empty() {
            failure
        } else {
            // The changed files are the likely cause of the error.
            Failure::usage(format!("{}{changes}", failure.message))
        }
    })?;
    if plan.hash != snapshot.plan {
        return Err(changed_plan(home, &plan, &snapshot));
    }
    Ok(RestoredPlan {
        script,
        plan,
        snapshot,
    })
}

/// Returns the error for a rebuilt plan that differs from its snapshot.
fn changed_plan(home: &Path, plan: &Plan, snapshot: &PlanSnapshot) -> Failure {
    let difference = PlanSnapshot::first_difference(home, plan)
        .unwrap_or_else(|| "its figures or tables".to_owned());
    let changes = changed_files(snapshot);
    Failure::usage(format!(
        "the plan in {} has changed since it was saved: its hash was {} and is now {}; first \
         difference: {difference}{changes}. Undo the change, or submit the night again (finished \
         runs that have not changed are not rendered again)",
        display_path(home),
        snapshot.plan,
        plan.hash,
    ))
}

/// Formats the files that have changed since a snapshot was saved, as the end of a message; empty
/// if there are none.
fn changed_files(snapshot: &PlanSnapshot) -> String {
    let files: Vec<String> = snapshot
        .changed_files()
        .iter()
        .map(|file| file.display().to_string())
        .collect();
    if files.is_empty() {
        String::new()
    } else {
        format!("; changed or missing files: {}", files.join(", "))
    }
}
