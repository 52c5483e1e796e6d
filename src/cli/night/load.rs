//! Loading of scripts, plans and scenes from the arguments of the command line.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use super::permission::{PlanUse, commands_allowed};
use crate::cli::args::{Global, ScriptArgs};
use crate::cli::exit::{Failure, print_status};
use crate::cli::format::display_path;
use lumbre_light::film::Image;
use lumbre_light::scene::{Note, SceneDesc, SceneError};
use lumbre_light::value::{Value, suggest};
use lumbre_lua::{Script, ScriptError};
use lumbre_night::experiment::Plan;
use lumbre_night::experiment::plan::{Overrides, PlanError, expand};
use lumbre_night::paths::folder_of;
use lumbre_report::exr;
use lumbre_scene_io::load::{FORMATS, MissingTextures, files};

/// Loads a script and expands its plan without rendering. Commands of the script run only with
/// permission; see [`permission`](super::permission).
///
/// # Errors
/// Returns an error if the script or one of its scenes cannot be read, or the plan is invalid.
pub fn load_plan(
    args: &ScriptArgs,
    usage: PlanUse,
    global: &Global,
) -> Result<(Script, Arc<Plan>), Failure> {
    expect_script(&args.script)?;
    let load = || lumbre_lua::load(&args.script).map_err(Failure::script);
    plan_of(&load, args, usage, global, false)
}

/// Loads a script and expands its plan for other machines, whose devices this one may lack.
///
/// # Errors
/// Returns the same errors as [`load_plan`].
pub fn load_plan_for_cluster(
    args: &ScriptArgs,
    usage: PlanUse,
    global: &Global,
) -> Result<(Script, Arc<Plan>), Failure> {
    expect_script(&args.script)?;
    let load = || lumbre_lua::load(&args.script).map_err(Failure::script);
    plan_of(&load, args, usage, global, true)
}

/// Expands the plan of a script that `load` loads. With `elsewhere`, its backends need not be
/// available on this machine.
///
/// # Errors
/// Returns an error if the script or one of its scenes cannot be read, the plan is invalid, or its
/// commands are not allowed.
pub fn plan_of(
    load: &dyn Fn() -> Result<Script, Failure>,
    args: &ScriptArgs,
    usage: PlanUse,
    global: &Global,
    elsewhere: bool,
) -> Result<(Script, Arc<Plan>), Failure> {
    let script = load()?;
    let plan = expand_plan(&script, args, global, elsewhere, global.allow_commands)?;
    if plan.commands_allowed || !commands_allowed(&script, &plan.commands, usage, global)? {
        return Ok((script, plan));
    }
    // The script is loaded again, so that its functions are called once for each plan.
    let script = load()?;
    let allowed = expand_plan(&script, args, global, elsewhere, true)?;
    if allowed.commands != plan.commands {
        return Err(Failure::usage(
            "the commands of the script changed meanwhile: try again",
        ));
    }
    Ok((script, allowed))
}

/// Expands the plan of a loaded script. With `elsewhere`, its backends need not be available on this
/// machine; `commands` is whether commands of the script may run.
///
/// # Errors
/// Returns an error if a scene cannot be read or the plan is invalid.
pub fn expand_plan(
    script: &Script,
    args: &ScriptArgs,
    global: &Global,
    elsewhere: bool,
    commands: bool,
) -> Result<Arc<Plan>, Failure> {
    let pairs = |(axis, values): &(String, Vec<Value>)| -> Vec<(String, Value)> {
        values
            .iter()
            .map(|value| (axis.clone(), value.clone()))
            .collect()
    };
    let overrides = Overrides {
        axes: args.changes.axes.clone(),
        quick: args.changes.quick,
        only: args.changes.only.iter().flat_map(pairs).collect(),
        backend: global.backend.clone(),
        elsewhere,
        commands,
    };
    let mut load = |path: &Path, options: &BTreeMap<String, Value>| {
        lumbre_lua::scene::read(path, options, global.missing())
    };
    let (plan, files) = files::opened_by(|| expand(&script.spec, script, &overrides, &mut load));
    let files = files.into_iter().chain(script.modules()).collect();
    plan.map(|plan| Arc::new(Plan { files, ..plan }))
        .map_err(|error| plan_failure(error, script))
}

/// Loads a scene file of any format, including Lua.
///
/// # Errors
/// Returns an error if the file cannot be read or is invalid.
pub fn load_scene(
    path: &Path,
    missing: MissingTextures,
) -> Result<(SceneDesc, Vec<Note>), SceneError> {
    lumbre_lua::scene::read(path, &BTreeMap::new(), missing)
}

/// Prints the notes and warnings of a plan, including the notes about its scene files.
pub fn print_notes_and_warnings(plan: &Plan, quiet: bool) {
    for note in plan.notes.iter().filter(|_| !quiet) {
        print_status(&format!("note: {note}"));
    }
    for warning in &plan.warnings {
        print_status(&format!("warning: {warning}"));
    }
}

/// Converts a plan error. An error in a declaration or a function of the script includes the source
/// line.
fn plan_failure(error: PlanError, script: &Script) -> Failure {
    if let Some(located) = script.locate_plan_error(&error) {
        return match &error {
            PlanError::Set { point, .. } if !point.is_empty() => {
                Failure::script_call(&format!("`render` at {point}"), located)
            }
            _ => Failure::script(located),
        };
    }
    match error {
        PlanError::Hook {
            function,
            point,
            error,
        } => {
            let call = if point.is_empty() {
                function
            } else {
                format!("{function} at {point}")
            };
            match error.0.downcast::<ScriptError>() {
                Ok(script) => Failure::script_call(&call, *script),
                Err(other) => Failure::usage(format!("{call}: {other}")),
            }
        }
        other => Failure::usage(other),
    }
}

/// Checks the path of a script before Lua reads it, and suggests a script with a similar name.
pub fn expect_script(path: &Path) -> Result<(), Failure> {
    if path.is_dir() {
        let scripts = scripts_in(path);
        let help = match scripts.as_slice() {
            [] => "it contains no .lua files".to_owned(),
            found => format!("scripts in it: {}", found.join(", ")),
        };
        return Err(Failure::usage(format!(
            "{} is a folder, not a script ({help})",
            path.display()
        )));
    }
    if let Some(format) = scene_format(path).filter(|_| path.exists()) {
        let file = path.display();
        return Err(Failure::usage(format!(
            "{file} is a scene ({format}), not a script: `lumbre render {file}` renders it, \
             `lumbre compare {file}` compares techniques on it"
        )));
    }
    if path.exists() {
        return Ok(());
    }
    let folder = folder_of(path);
    let help = match path.file_name().and_then(|n| n.to_str()) {
        _ if !folder.is_dir() => format!("there is no folder {}", folder.display()),
        Some(name) => {
            let scripts = scripts_in(folder);
            match suggest::nearest(name, scripts.iter().map(String::as_str)) {
                Some(near) => format!("did you mean `{}`?", display_path(&folder.join(near))),
                None if scripts.is_empty() => "that folder contains no scripts".to_owned(),
                None => format!("scripts in that folder: {}", scripts.join(", ")),
            }
        }
        None => "expected the path of a .lua file".to_owned(),
    };
    Err(Failure::usage(format!(
        "there is no script {} ({help})",
        path.display()
    )))
}

/// Returns the name of the scene format of a file by its extension, if it has one.
fn scene_format(path: &Path) -> Option<&'static str> {
    let extension = path.extension()?.to_string_lossy().to_ascii_lowercase();
    let row = FORMATS
        .iter()
        .find(|row| row.extensions.contains(&extension.as_str()))?;
    Some(row.name)
}

fn scripts_in(folder: &Path) -> Vec<String> {
    let names = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let mut scripts: Vec<String> = names
        .map(|e| e.file_name().to_string_lossy().into_owned())
        .filter(|n| n.ends_with(".lua"))
        .collect();
    scripts.sort();
    scripts
}

/// Decodes a stored picture (EXR). This is the decoder that [`lumbre_night::store`] uses.
pub fn decode_picture(bytes: &[u8]) -> Result<Image, String> {
    exr::decode(bytes)
        .map(|(image, _)| image)
        .map_err(|e| e.to_string())
}
