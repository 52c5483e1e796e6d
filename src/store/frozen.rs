//! `frozen.json`: all that a worker on another machine needs to make the plan again, and to notice when it cannot.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::archive::read_json;
use super::run::pretty;
use super::{StoreError, list, write};
use crate::experiment::plan::{ReferenceSource, identity};
use crate::experiment::{Plan, RunId};

/// The name of the file.
pub(super) const FILE: &str = "frozen.json";

/// A plan as it was frozen.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Frozen {
    /// The program that froze it, with its version.
    pub program: String,
    /// The plan's hash.
    pub plan: String,
    /// The folder from which the command was given, where scripts name scenes from.
    pub folder: PathBuf,
    /// The script's own path, next to which it finds modules and files.
    pub script: PathBuf,
    /// The command, without the program's name.
    pub arguments: Vec<String>,
    /// What `auto` meant among backends.
    pub auto: String,
    /// The files that the plan was made of besides the script, with the hashes of what they held.
    pub files: BTreeMap<PathBuf, String>,
    /// Runs of the plan that nights in other folders had finished, by id.
    pub elsewhere: BTreeMap<String, PathBuf>,
}

impl Frozen {
    /// Freezes a plan whose folder has been made: the caller says which command made it.
    pub fn new(out: &Path, home: &Path, plan: &Plan, command: Command) -> Frozen {
        let ids: BTreeSet<&RunId> = plan.cells.iter().map(|cell| &cell.id).collect();
        let elsewhere = list::finished_beside(out, &plan.name, home);
        Frozen {
            program: concat!("lumbre ", env!("CARGO_PKG_VERSION")).to_owned(),
            plan: plan.hash.clone(),
            folder: command.folder,
            script: command.script,
            arguments: command.arguments,
            auto: command.auto,
            files: files_of(plan).into_iter().map(|file| (file.clone(), hash(&file))).collect(),
            elsewhere: elsewhere.into_iter().filter(|(id, _)| ids.contains(&RunId(id.clone()))).collect(),
        }
    }

    /// Reads what was frozen in an experiment's folder.
    ///
    /// # Errors
    /// When nothing was, or it cannot be read.
    pub fn read(home: &Path) -> Result<Frozen, StoreError> {
        let path = home.join(FILE);
        let json = read_json(&path).ok_or_else(|| StoreError::Io {
            action: "read",
            path: path.clone(),
            reason: "there is no frozen plan, or it is not whole (`lumbre run` and `lumbre submit` leave one in the \
                     folder of their night; if they did, this machine does not see that folder)"
                .into(),
            full: false,
        })?;
        let text = |key: &str| json[key].as_str().unwrap_or_default().to_owned();
        let map = |key: &str| -> Vec<(String, String)> {
            let fields = json[key].as_object().into_iter().flatten();
            fields.filter_map(|(name, value)| Some((name.clone(), value.as_str()?.to_owned()))).collect()
        };
        Ok(Frozen {
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
            files: map("files").into_iter().map(|(file, hash)| (file.into(), hash)).collect(),
            elsewhere: map("elsewhere").into_iter().map(|(id, folder)| (id, folder.into())).collect(),
        })
    }

    /// Writes it into an experiment's folder.
    ///
    /// # Errors
    /// When it cannot be written.
    pub(super) fn write(&self, home: &Path) -> Result<(), StoreError> {
        let paths = |pairs: &mut dyn Iterator<Item = (String, String)>| -> Json {
            pairs.map(|(name, value)| (name, Json::from(value))).collect::<serde_json::Map<_, _>>().into()
        };
        let json = json!({
            "program": self.program,
            "plan": self.plan,
            "folder": self.folder.display().to_string(),
            "script": self.script.display().to_string(),
            "arguments": self.arguments,
            "auto": self.auto,
            "files": paths(&mut self.files.iter().map(|(file, hash)| (file.display().to_string(), hash.clone()))),
            "elsewhere": paths(&mut self.elsewhere.iter().map(|(id, f)| (id.clone(), f.display().to_string()))),
        });
        write::if_changed(&home.join(FILE), pretty(&json).as_bytes())
    }

    /// The files that no longer hold what they held, or are not there.
    pub fn changed_files(&self) -> Vec<PathBuf> {
        let changed = self.files.iter().filter(|(file, then)| hash(&self.folder.join(file)) != **then);
        changed.map(|(file, _)| file.clone()).collect()
    }

    /// The first cell or reference of a plan that is not what it was when the plan of a folder was frozen, in words.
    pub fn first_difference(home: &Path, plan: &Plan) -> Option<String> {
        let then = read_json(&home.join("plan.json"))?;
        let cells = then["cells"].as_array()?;
        for (i, cell) in plan.cells.iter().enumerate() {
            match cells.get(i) {
                Some(was) if was["run"] == cell.id.0.as_str() && was["path"] == cell.path.as_str() => {}
                Some(was) if was["path"] == cell.path.as_str() => {
                    return Some(format!("cell {} was run {} and is run {}", cell.path, was["run"].as_str()?, cell.id));
                }
                Some(was) => return Some(format!("cell {} was {} and is {}", i + 1, was["path"].as_str()?, cell.path)),
                None => return Some(format!("cell {} is new", cell.path)),
            }
        }
        let lost = cells.get(plan.cells.len()).and_then(|was| was["path"].as_str());
        lost.map(|path| format!("cell {path} is gone"))
    }
}

/// The command that a plan was made by.
#[derive(Clone, Debug, Default)]
pub struct Command {
    /// The current folder.
    pub folder: PathBuf,
    /// The script's path, from the root.
    pub script: PathBuf,
    /// The command line without the program's name.
    pub arguments: Vec<String>,
    /// What `auto` means among backends.
    pub auto: String,
}

/// All files that scenes are made of, modules, and files that are references.
fn files_of(plan: &Plan) -> BTreeSet<PathBuf> {
    let references = plan.references.iter().map(|reference| match &reference.source {
        ReferenceSource::Render { config, .. } => config.scene_file.clone(),
        ReferenceSource::File { file, .. } => file.clone(),
    });
    let scenes = plan.cells.iter().map(|cell| cell.config.scene_file.clone());
    scenes.chain(references).chain(plan.files.iter().cloned()).filter(|file| !file.is_dir()).collect()
}

/// The hash of a file's content; empty where it cannot be read.
fn hash(file: &Path) -> String {
    identity::of_file(file).map_or_else(|_| String::new(), |hash| hash.to_hex().to_string())
}
