//! `lumbre check`: reads scripts and scenes, renders and writes nothing.

use std::path::Path;

use super::args::{CheckArgs, Global, ScriptArgs};
use super::exit::{Exit, Failure, data, talk};
use super::load;
use super::run::counted;
use crate::scene::{self, Note};
use crate::script;

/// Checks every file and goes on after an error.
pub fn main(args: &CheckArgs, global: &Global) -> Result<Exit, Failure> {
    let mut exit = Exit::Done;
    for file in &args.files {
        let checked = if script::scene::is_lua(file) { lua(file, global) } else { scene(file, global) };
        match checked {
            Ok(_) if global.quiet => {}
            Ok(line) => data(&format!("ok  {}: {line}\n", file.display()))?,
            Err(failure) => {
                failure.show();
                exit = Exit::Usage;
            }
        }
    }
    Ok(exit)
}

/// An experiment, or a scene where the file turns out to describe one.
fn lua(file: &Path, global: &Global) -> Result<String, Failure> {
    load::expect_script(file)?;
    let script = match script::load(file) {
        Err(error) if script::scene::is_scene(&error) => return scene(file, global),
        read => read.map_err(Failure::diagnostic)?,
    };
    let args = ScriptArgs { script: file.to_owned(), axes: Vec::new(), only: Vec::new() };
    let plan = load::planned(&script, &args, global)?;
    load::show_doubts(&plan);
    Ok(format!(
        "experiment `{}`, {}, {}, {} skipped",
        plan.name,
        counted(plan.cells.len(), "cell"),
        counted(plan.references.len(), "reference"),
        counted(plan.skipped.len(), "point")
    ))
}

fn scene(file: &Path, global: &Global) -> Result<String, Failure> {
    if file.is_dir() && !scene::load::is_folder(file) {
        return Err(Failure::usage(format!("{} is a folder: name the files in it", file.display())));
    }
    let read = || -> Result<(scene::CompiledScene, Vec<Note>), Failure> {
        let (desc, mut notes) = load::scene(file, global.missing()).map_err(Failure::usage)?;
        // What is wrong with a scene as a whole has no file of its own.
        let (compiled, more) = scene::compile(&desc).map_err(|e| Failure::usage(format!("{}: {e}", file.display())))?;
        notes.extend(more);
        Ok((compiled, notes))
    };
    let (compiled, notes) = read()?;
    for note in &notes {
        // What compiling notes is about the scene as a whole, which several files may have made.
        let whole = note.file.as_os_str().is_empty();
        talk(&if whole { format!("note: {}: {note}", file.display()) } else { format!("note: {note}") });
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
