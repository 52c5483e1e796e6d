//! Plan snapshot: `frozen.json` holds what a worker on another machine needs to reconstruct the
//! plan, and to detect that the result differs.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::{Map, Value as Json, json};

use crate::experiment::plan::{ReferenceSource, identity};
use crate::experiment::{Plan, RunId};
use crate::store::StoreError;
use crate::store::read::archive::read_json;
use crate::store::read::night_index;
use crate::store::write::atomic;
use crate::store::write::run_folder::pretty;

/// Name of the file in an experiment's folder.
pub(crate) const FILE: &str = "frozen.json";

/// Snapshot of the command and the inputs from which a plan was made.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PlanSnapshot {
    /// Program that wrote the snapshot, with its version.
    pub program: String,
    /// Hash of the plan.
    pub plan: String,
    /// Working directory of the command; scripts name scenes relative to it.
    pub folder: PathBuf,
    /// Path of the script; modules and files are found next to it.
    pub script: PathBuf,
    /// Arguments of the command, without the program's name.
    pub arguments: Vec<String>,
    /// Backend that `auto` selected.
    pub auto: String,
    /// Files that the plan was made from besides the script, with hashes of their content.
    pub files: BTreeMap<PathBuf, String>,
    /// Run folders, by run id, of this plan's runs that are finished in sibling folders.
    pub elsewhere: BTreeMap<String, PathBuf>,
}

impl PlanSnapshot {
    /// Takes the snapshot of a plan whose folder exists and which `command` made.
    pub fn new(out: &Path, home: &Path, plan: &Plan, command: PlanCommand) -> PlanSnapshot {
        let ids: BTreeSet<&RunId> = plan.cells.iter().map(|cell| &cell.id).collect();
        let elsewhere = night_index::finished_in_siblings(out, &plan.name, home);
        PlanSnapshot {
            program: concat!("lumbre ", env!("CARGO_PKG_VERSION")).to_owned(),
            plan: plan.hash.clone(),
            folder: command.folder,
            script: command.script,
            arguments: command.arguments,
            auto: command.auto,
            files: files_of(plan)
                .into_iter()
                .map(|file| (file.clone(), hash(&file)))
                .collect(),
            elsewhere: elsewhere
                .into_iter()
                .filter(|(id, _)| ids.contains(&RunId(id.clone())))
                .collect(),
        }
    }

    /// Reads the snapshot in an experiment's folder.
    ///
    /// # Errors
    /// When there is none, or it cannot be parsed.
    pub fn read(home: &Path) -> Result<PlanSnapshot, StoreError> {
        let path = home.join(FILE);
        let json = read_json(&path).ok_or_else(|| StoreError::Io {
            action: "read",
            path: path.clone(),
            reason:
                "there is no plan snapshot, or it is damaged (`lumbre run` and `lumbre submit` \
                     write one into the folder of their night; check that this machine has access \
                     to that folder)"
                    .into(),
            full: false,
        })?;
        let text = |key: &str| json[key].as_str().unwrap_or_default().to_owned();
        let map = |key: &str| -> Vec<(String, String)> {
            let fields = json[key].as_object().into_iter().flatten();
            fields
                .filter_map(|(name, value)| Some((name.clone(), value.as_str()?.to_owned())))
                .collect()
        };
        Ok(PlanSnapshot {
            program: text("program"),
            plan: text("plan"),
            folder: text("folder").into(),
            script: text("script").into(),
            arguments: json["arguments"]
                .as_array()
                .into_iter()
                .flatten()
                .filter_map(Json::as_str)
                .map(str::to_owned)
                .collect(),
            auto: text("auto"),
            files: map("files")
                .into_iter()
                .map(|(file, hash)| (file.into(), hash))
                .collect(),
            elsewhere: map("elsewhere")
                .into_iter()
                .map(|(id, folder)| (id, folder.into()))
                .collect(),
        })
    }

    /// Writes the snapshot into an experiment's folder, if it differs from the one there.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub(crate) fn write(&self, home: &Path) -> Result<(), StoreError> {
        let files = self.files.iter();
        let files =
            files.map(|(file, hash)| (file.display().to_string(), Json::from(hash.as_str())));
        let elsewhere = self.elsewhere.iter();
        let elsewhere =
            elsewhere.map(|(id, folder)| (id.clone(), folder.display().to_string().into()));
        let json = json!({
            "program": self.program,
            "plan": self.plan,
            "folder": self.folder.display().to_string(),
            "script": self.script.display().to_string(),
            "arguments": self.arguments,
            "auto": self.auto,
            "files": files.collect::<Map<_, _>>(),
            "elsewhere": elsewhere.collect::<Map<_, _>>(),
        });
        atomic::write_if_changed(&home.join(FILE), pretty(&json).as_bytes())
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
        let then = read_json(&home.join("plan.json"))?;
        let cells = then["cells"].as_array()?;
        for (i, cell) in plan.cells.iter().enumerate() {
            match cells.get(i) {
                Some(was)
                    if was["run"] == cell.id.0.as_str() && was["path"] == cell.path.as_str() => {}
                Some(was) if was["path"] == cell.path.as_str() => {
                    return Some(format!(
                        "cell {} was run {} and is now run {}",
                        cell.path,
                        was["run"].as_str()?,
                        cell.id
                    ));
                }
                Some(was) => {
                    return Some(format!(
                        "cell {} was {} and is now {}",
                        i + 1,
                        was["path"].as_str()?,
                        cell.path
                    ));
                }
                None => return Some(format!("cell {} is new", cell.path)),
            }
        }
        let lost = cells
            .get(plan.cells.len())
            .and_then(|was| was["path"].as_str());
        lost.map(|path| format!("cell {path} is missing"))
    }
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
