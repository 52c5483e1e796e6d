//! From what was typed to a script and its plan.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use miette::{Report, WrapErr};

use super::args::{Global, ScriptArgs};
use super::exit::{Exit, Failure, talk};
use crate::experiment::Plan;
use crate::experiment::plan::{Overrides, PlanError, expand};
use crate::film::Image;
use crate::output::exr;
use crate::scene::load::{Missing, files};
use crate::scene::{Note, SceneDesc, SceneError};
use crate::script::{self, Script, ScriptError};
use crate::value::{Value, suggest};

/// Reads a script and expands its plan. Nothing renders.
pub fn plan(args: &ScriptArgs, global: &Global) -> Result<(Script, Arc<Plan>), Failure> {
    expect_script(&args.script)?;
    let script = script::load(&args.script).map_err(Failure::diagnostic)?;
    let plan = planned(&script, args, global)?;
    Ok((script, plan))
}

/// The same for other machines, whose devices this one may lack.
pub fn plan_elsewhere(args: &ScriptArgs, global: &Global) -> Result<(Script, Arc<Plan>), Failure> {
    expect_script(&args.script)?;
    let script = script::load(&args.script).map_err(Failure::diagnostic)?;
    let plan = planned_for(&script, args, global, true)?;
    Ok((script, plan))
}

/// Expands the plan of a script that was read.
pub fn planned(script: &Script, args: &ScriptArgs, global: &Global) -> Result<Arc<Plan>, Failure> {
    planned_for(script, args, global, false)
}

fn planned_for(script: &Script, args: &ScriptArgs, global: &Global, elsewhere: bool) -> Result<Arc<Plan>, Failure> {
    let pairs = |(axis, values): &(String, Vec<Value>)| -> Vec<(String, Value)> {
        values.iter().map(|value| (axis.clone(), value.clone())).collect()
    };
    let overrides = Overrides {
        axes: args.axes.clone(),
        only: args.only.iter().flat_map(pairs).collect(),
        backend: global.backend.clone(),
        elsewhere,
    };
    let mut load =
        |path: &Path, options: &BTreeMap<String, Value>| script::scene::read(path, options, global.missing());
    let (plan, files) = files::opened_by(|| expand(&script.spec, script, &overrides, &mut load));
    let files = files.into_iter().chain(script.modules()).collect();
    plan.map(|plan| Arc::new(Plan { files, ..plan })).map_err(plan_failure)
}

/// Reads a scene file of any format, Lua included.
///
/// # Errors
/// Whatever is wrong with the file.
pub fn scene(path: &Path, missing: Missing) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    script::scene::read(path, &BTreeMap::new(), missing)
}

/// Says what the plan warns of and what its scene files could not have.
pub fn show_doubts(plan: &Plan) {
    for note in &plan.notes {
        talk(&format!("note: {note}"));
    }
    for warning in &plan.warnings {
        talk(&format!("warning: {warning}"));
    }
}

/// A plan's error, with the line of the script where one of its functions is at fault.
fn plan_failure(error: PlanError) -> Failure {
    match error {
        PlanError::Hook { function, point, error } => match error.0.downcast::<ScriptError>() {
            Ok(script) => {
                let report: Result<(), Report> = Err(Report::new(*script));
                let report = report.wrap_err(format!("{function} at {point}"));
                report.map_or_else(|report| Failure { exit: Exit::Usage, report }, |()| Failure::usage(""))
            }
            Err(other) => Failure::usage(format!("{function} at {point}: {other}")),
        },
        other => Failure::usage(other),
    }
}

/// Finds the mistakes that a script's path may have before Lua sees it.
pub fn expect_script(path: &Path) -> Result<(), Failure> {
    if path.is_dir() {
        let scripts = scripts_in(path);
        let help = match scripts.as_slice() {
            [] => "it holds no .lua files".to_owned(),
            found => format!("scripts in it: {}", found.join(", ")),
        };
        return Err(Failure::usage(format!("{} is a folder, not a script ({help})", path.display())));
    }
    if path.exists() {
        return Ok(());
    }
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let help = match path.file_name().and_then(|n| n.to_str()) {
        _ if !folder.is_dir() => format!("there is no folder {}", folder.display()),
        Some(name) => {
            let scripts = scripts_in(folder);
            match suggest::nearest(name, scripts.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{}`?", shown(&folder.join(near))),
                None if scripts.is_empty() => "there is none in that folder".to_owned(),
                None => format!("scripts there: {}", scripts.join(", ")),
            }
        }
        None => "expected the path of a .lua file".to_owned(),
    };
    Err(Failure::usage(format!("there is no script {} ({help})", path.display())))
}

fn scripts_in(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut scripts: Vec<String> =
        names.map(|e| e.file_name().to_string_lossy().into_owned()).filter(|n| n.ends_with(".lua")).collect();
    scripts.sort();
    scripts
}

/// The decoder of the pictures that the store keeps.
pub fn decode(bytes: &[u8]) -> Result<Image, String> {
    exr::decode(bytes).map(|(image, _)| image).map_err(|e| e.to_string())
}

/// A path as people type it: relative to the current folder where it lies below it.
pub fn shown(path: &Path) -> String {
    let here = std::env::current_dir().unwrap_or_default();
    let relative = path.strip_prefix(&here).unwrap_or(path);
    let relative: PathBuf = relative.components().filter(|c| *c != std::path::Component::CurDir).collect();
    if relative.as_os_str().is_empty() { ".".to_owned() } else { relative.display().to_string() }
}
