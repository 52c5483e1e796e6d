//! `lumbre check`: validates scripts and scene files without rendering or writing anything.

use std::path::Path;

use crate::cli::args::{CheckArgs, Global, ScriptArgs};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::counted;
use crate::cli::night::load;
use crate::script;
use lumbre_light::scene::{self, Note};

/// Runs `lumbre check`: checks all files, also after an error in one of them.
pub fn main(args: &CheckArgs, global: &Global) -> Result<Exit, Failure> {
    let mut exit = Exit::Done;
    for file in &args.files {
        let checked = if script::scene::is_lua(file) {
            check_lua(file, global)
        } else {
            check_scene(file, global)
        };
        match checked {
            Ok(_) if global.quiet => {}
            Ok(line) => print_result(&format!("ok  {}: {line}\n", file.display()))?,
            Err(failure) => {
                failure.print();
                exit = Exit::Usage;
            }
        }
    }
    Ok(exit)
}

/// Checks a Lua file, which may be an experiment or a scene. Returns a summary.
fn check_lua(file: &Path, global: &Global) -> Result<String, Failure> {
    load::expect_script(file)?;
    let script = match script::load(file) {
        Err(error) if script::scene::is_scene(&error) => return check_scene(file, global),
        loaded => loaded.map_err(Failure::diagnostic)?,
    };
    let args = ScriptArgs {
        script: file.to_owned(),
        axes: Vec::new(),
        only: Vec::new(),
    };
    let plan = load::expand_plan(&script, &args, global, false, global.allow_commands)?;
    load::print_notes_and_warnings(&plan);
    Ok(format!(
        "experiment `{}`, {}, {}, {} skipped",
        plan.name,
        counted(plan.cells.len(), "cell"),
        counted(plan.references.len(), "reference"),
        counted(plan.skipped.len(), "point")
    ))
}

/// Checks a scene file of any format. Returns a summary.
fn check_scene(file: &Path, global: &Global) -> Result<String, Failure> {
    if file.is_dir() && !scene::load::is_folder(file) {
        return Err(Failure::usage(format!(
            "{} is a folder; give the files in it",
            file.display()
        )));
    }
    let read = || -> Result<(scene::CompiledScene, Vec<Note>), Failure> {
        let (desc, mut notes) = load::load_scene(file, global.missing()).map_err(Failure::usage)?;
        // Errors of compilation do not name a file.
        let (compiled, more) = scene::compile(&desc)
            .map_err(|e| Failure::usage(format!("{}: {e}", file.display())))?;
        notes.extend(more);
        Ok((compiled, notes))
    };
    let (compiled, notes) = read()?;
    for note in &notes {
        // Notes of compilation are about the whole scene and do not name a file.
        let has_no_file = note.file.as_os_str().is_empty();
        print_status(&if has_no_file {
            format!("note: {}: {note}", file.display())
        } else {
            format!("note: {note}")
        });
    }
    let [width, height] = compiled.resolution;
    Ok(format!(
        "scene, {}, {}, {}, {}, {width}x{height} pixels, depth {}",
        counted(compiled.triangles.len(), "triangle"),
        counted(compiled.spheres.len(), "sphere"),
        counted(compiled.materials.len(), "material"),
        counted(compiled.emitters.len(), "emitter"),
        compiled.max_depth
    ))
}
