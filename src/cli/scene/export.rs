//! `lumbre export`: writes a scene as files for another renderer, or a night for programs of others.

use std::path::{Path, PathBuf};

use crate::cli::args::{ExportArgs, Global};
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use crate::cli::inspect::export_night;
use lumbre_scene_io::{edit, export};

/// Runs `lumbre export`: reads a scene, applies its options and settings, and writes it.
pub fn main(args: &ExportArgs, global: &Global) -> Result<Exit, Failure> {
    if args.jeri || args.figuregen || args.csv {
        return export_night::main(args, global);
    }
    let folder = args
        .folder
        .clone()
        .unwrap_or_else(|| default_folder(&args.file, args.pbrt));
    if !export::can_replace(&folder) {
        return Err(Failure::usage(format!(
            "{} contains files that are not from an export; choose another folder with -o",
            display_path(&folder)
        )));
    }
    let options = args.option.iter().cloned().collect();
    let (mut desc, mut notes) =
        lumbre_lua::scene::read(&args.file, &options, global.missing()).map_err(Failure::usage)?;
    for (path, value) in &args.set {
        edit::set(&mut desc, path, value).map_err(Failure::usage)?;
    }
    let write = if args.pbrt {
        export::pbrt
    } else {
        export::mitsuba
    };
    let exported = write(&desc, &folder).map_err(Failure::usage)?;
    notes.extend(exported.notes);
    if !global.quiet {
        notes
            .iter()
            .for_each(|note| print_status(&format!("note: {note}")));
        print_status(&format!(
            "wrote {} to {}",
            counted(exported.files.len(), "file"),
            display_path(&folder)
        ));
    }
    print_result(&format!("{}\n", exported.scene.display()))?;
    Ok(Exit::Done)
}

/// Returns the default folder, `NAME-mitsuba` or `NAME-pbrt` in the current folder.
fn default_folder(file: &Path, pbrt: bool) -> PathBuf {
    let stem = file
        .file_stem()
        .map_or("scene".into(), |s| s.to_string_lossy().into_owned());
    PathBuf::from(format!("{stem}-{}", if pbrt { "pbrt" } else { "mitsuba" }))
}
