//! The seal of a finished run: its last file names every other one with its size and its hash, and ends in a hash of
//! itself. Whatever is cut off or changed afterwards is found.

use std::fs;
use std::io;
use std::path::Path;

use serde_json::{Map, Value as Json, json};

use super::{FILMS, checkpoint, claim, write};

/// Files that come and go, or that grow, or that are written anew whenever they differ.
const UNSEALED: [&str; 8] = [
    "config.json",
    "log.txt",
    "done.json",
    "ref.json",
    "failed.json",
    claim::FILE,
    checkpoint::SLOTS[0],
    checkpoint::SLOTS[1],
];

/// How the files begin that tell of comparisons, which come after a reference is finished.
const AGREE: &str = "agree-";

/// Adds to the last file of a run what its folder holds, and the hash of it all.
pub(super) fn seal(folder: &Path, done: &Json) -> io::Result<Json> {
    let mut sealed = done.as_object().cloned().unwrap_or_default();
    let mut files = Map::new();
    let mut names = names_in(folder, "")?;
    names.extend(names_in(&folder.join(FILMS), &format!("{FILMS}/")).unwrap_or_default());
    names.sort();
    for name in names {
        let bytes = fs::read(folder.join(&name))?;
        files.insert(name, json!([bytes.len(), blake3::hash(&bytes).to_hex().as_str()]));
    }
    sealed.insert("files".into(), files.into());
    let check = hash(&sealed);
    sealed.insert("check".into(), check.into());
    Ok(sealed.into())
}

fn names_in(folder: &Path, prefix: &str) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type()?.is_file()
            && !UNSEALED.contains(&name.as_str())
            && !name.starts_with(AGREE)
            && !write::is_temporary(&name)
        {
            names.push(format!("{prefix}{name}"));
        }
    }
    Ok(names)
}

/// Looks at a sealed file itself, and at the sizes of the files that it names. One that was never sealed passes.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn glance(folder: &Path, done: &Json) -> Result<(), String> {
    let Some(map) = done.as_object() else { return Err("its last file is damaged".to_owned()) };
    if !map.contains_key("files") && !map.contains_key("check") {
        return Ok(());
    }
    let mut unsealed = map.clone();
    let check = unsealed.shift_remove("check");
    if check.as_ref().and_then(Json::as_str) != Some(hash(&unsealed).as_str()) {
        return Err("its last file is damaged".to_owned());
    }
    for (name, facts) in sealed_files(done) {
        match fs::metadata(folder.join(name)) {
            Err(_) => return Err(format!("{name} is missing")),
            Ok(found) if Some(found.len()) != facts[0].as_u64() => return Err(format!("{name} is damaged")),
            Ok(_) => {}
        }
    }
    Ok(())
}

/// Reads every file that a sealed one names.
///
/// # Errors
/// What is wrong, in words.
pub(super) fn inspect(folder: &Path, done: &Json) -> Result<(), String> {
    glance(folder, done)?;
    for (name, facts) in sealed_files(done) {
        let bytes = fs::read(folder.join(name)).map_err(|e| format!("{name} cannot be read: {e}"))?;
        if facts[1].as_str() != Some(blake3::hash(&bytes).to_hex().as_str()) {
            return Err(format!("{name} is damaged"));
        }
    }
    Ok(())
}

fn sealed_files(done: &Json) -> impl Iterator<Item = (&String, &Json)> {
    done["files"].as_object().into_iter().flatten()
}

fn hash(map: &Map<String, Json>) -> String {
    let text = Json::Object(map.clone()).to_string();
    blake3::hash(text.as_bytes()).to_hex()[..32].to_owned()
}
