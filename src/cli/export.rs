//! `lumbre export`: a scene as files for another renderer.

use std::path::{Path, PathBuf};

use super::args::{ExportArgs, Global};
use super::exit::{Exit, Failure, data, talk};
use super::load::shown;
use super::run::counted;
use crate::scene::{edit, export};
use crate::script;

/// Reads a scene, applies options and settings, and writes it.
pub fn main(args: &ExportArgs, global: &Global) -> Result<Exit, Failure> {
    let folder = args.folder.clone().unwrap_or_else(|| beside(&args.file));
    if !export::is_ours(&folder) {
        let shown = shown(&folder);
        return Err(Failure::usage(format!("{shown} holds files that no export wrote: name another folder with -o")));
    }
    let options = args.option.iter().cloned().collect();
    let (mut desc, mut notes) = script::scene::read(&args.file, &options, global.missing()).map_err(Failure::usage)?;
    for (path, value) in &args.set {
        edit::set(&mut desc, path, value).map_err(Failure::usage)?;
    }
    let exported = export::mitsuba(&desc, &folder).map_err(Failure::usage)?;
    notes.extend(exported.notes);
    if !global.quiet {
        notes.iter().for_each(|note| talk(&format!("note: {note}")));
        talk(&format!("{} in {}", counted(exported.files.len(), "file"), shown(&folder)));
    }
    data(&format!("{}\n", exported.scene.display()))?;
    Ok(Exit::Done)
}

/// `NAME-mitsuba` in the current folder.
fn beside(file: &Path) -> PathBuf {
    let stem = file.file_stem().map_or("scene".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{stem}-mitsuba"))
}
