//! Plan snapshot: `snapshot.json` holds what a worker on another machine needs to reconstruct the
//! plan, and to detect that the result differs.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use crate::experiment::plan::{ReferenceSource, identity};
use crate::experiment::{Plan, RunId};
use crate::store::schema::plan::{PlanFile, PlanSnapshot};
use crate::store::schema::{Problem, StoredFile};
use crate::store::{StoreError, layout};

impl PlanSnapshot {
    /// Takes the snapshot of a plan whose folder exists and which `command` made.
    pub fn new(out: &Path, home: &Path, plan: &Plan, command: PlanCommand) -> PlanSnapshot {
        let ids: BTreeSet<&RunId> = plan.cells.iter().map(|cell| &cell.id).collect();
        let elsewhere = layout::finished_in_siblings(out, &plan.name, home);
        PlanSnapshot {
            plan: plan.hash.clone(),
            folder: as_text(&command.folder),
            script: as_text(&command.script),
            arguments: command.arguments,
            auto: command.auto,
            files: files_of(plan)
                .into_iter()
                .map(|file| (as_text(&file), hash(&file)))
                .collect(),
            elsewhere: elsewhere
                .into_iter()
                .filter(|(id, _)| ids.contains(&RunId(id.clone())))
                .map(|(id, folder)| (id, as_text(&folder)))
                .collect(),
            ..PlanSnapshot::default()
        }
    }

    /// Reads the snapshot in an experiment's folder.
    ///
    /// # Errors
    /// When there is none, or it cannot be parsed.
    pub fn load(home: &Path) -> Result<PlanSnapshot, StoreError> {
        PlanSnapshot::read(home).map_err(|error| match error.problem {
            Problem::OtherVersion { .. } => error.into(),
            problem => StoreError::Io {
                action: "read",
                path: error.path,
                reason: format!(
                    "it{problem} (`lumbre run` and `lumbre submit` write one into the folder of \
                     their night; check that this machine has access to that folder)"
                ),
                full: false,
            },
        })
    }

    /// Lists the files whose content has changed, or that are missing.
    pub fn changed_files(&self) -> Vec<PathBuf> {
        let changed = self
            .files
            .iter()
            .filter(|(file, then)| hash(&self.folder.join(file)) != **then);
        changed.map(|(file, _)| file.clone()).collect()
    }

    /// Describes the first cell of a plan that differs from the `plan.json` in a folder. Returns
    /// `None` if all cells are equal.
    pub fn first_difference(home: &Path, plan: &Plan) -> Option<String> {
        let then = PlanFile::read(home).ok()?;
        for (i, cell) in plan.cells.iter().enumerate() {
            match then.cells.get(i) {
                Some(was) if was.run == cell.id.0 && was.path == cell.path => {}
                Some(was) if was.path == cell.path => {
                    return Some(format!(
                        "cell {} was run {} and is now run {}",
                        cell.path, was.run, cell.id
                    ));
                }
                Some(was) => {
                    return Some(format!(
                        "cell {} was {} and is now {}",
                        i + 1,
                        was.path,
                        cell.path
                    ));
                }
                None => return Some(format!("cell {} is new", cell.path)),
            }
        }
        let lost = then.cells.get(plan.cells.len());
        lost.map(|was| format!("cell {} is missing", was.path))
    }
}

/// A path as files can store it: with replacement characters where it is no text.
fn as_text(path: &Path) -> PathBuf {
    PathBuf::from(path.display().to_string())
}

/// Command that a plan was made by.
#[derive(Clone, Debug, Default)]
pub struct PlanCommand {
    /// Working directory of the command.
    pub folder: PathBuf,
    /// Absolute path of the script.
    pub script: PathBuf,
    /// Arguments, without the program's name.
    pub arguments: Vec<String>,
    /// Backend that `auto` selects.
    pub auto: String,
}

/// All scene files, modules, and image files that serve as references.
fn files_of(plan: &Plan) -> BTreeSet<PathBuf> {
    let references = plan
        .references
        .iter()
        .map(|reference| match &reference.source {
            ReferenceSource::Render { config, .. } => config.scene_file.clone(),
            ReferenceSource::File { file, .. } => file.clone(),
        });
    let scenes = plan.cells.iter().map(|cell| cell.config.scene_file.clone());
    scenes
        .chain(references)
        .chain(plan.files.iter().cloned())
        .filter(|file| !file.is_dir())
        .collect()
}

/// Hash of a file's content; empty if it cannot be read.
fn hash(file: &Path) -> String {
    identity::file_hash(file).map_or_else(|_| String::new(), |hash| hash.to_hex().to_string())
}
