//! Checksums of finished runs. The last file of a run (`done.json` or `ref.json`) is a manifest: it
//! lists every other file with its size and BLAKE3 hash, and ends with a hash of itself. Truncated,
//! changed and missing files are detected with it.

use std::fs;
use std::io;
use std::path::Path;

use serde_json::{Map, Value as Json, json};

use super::{atomic, checkpoint};
use crate::store::FILMS;
use crate::store::lock::claim;

/// Files that are not listed because they are temporary, grow, or are rewritten when they differ.
const EXCLUDED: [&str; 8] = [
    "config.json",
    "log.txt",
    "done.json",
    "ref.json",
    "failed.json",
    claim::FILE,
    checkpoint::SLOTS[0],
    checkpoint::SLOTS[1],
];

/// Prefix of the results of bias checks, which are written after a reference is finished.
const BIAS_CHECK_PREFIX: &str = "agree-";

/// Adds the sizes and hashes of all files in a run's folder to `done`, and a hash of the whole
/// manifest.
///
/// # Errors
/// When a file cannot be read.
pub(crate) fn add_checksums(folder: &Path, done: &Json) -> io::Result<Json> {
    let mut manifest = done.as_object().cloned().unwrap_or_default();
    let mut files = Map::new();
    let mut names = names_in(folder, "")?;
    names.extend(names_in(&folder.join(FILMS), &format!("{FILMS}/")).unwrap_or_default());
    names.sort();
    for name in names {
        let bytes = fs::read(folder.join(&name))?;
        files.insert(
            name,
            json!([bytes.len(), blake3::hash(&bytes).to_hex().as_str()]),
        );
    }
    manifest.insert("files".into(), files.into());
    let check = hash(&manifest);
    manifest.insert("check".into(), check.into());
    Ok(manifest.into())
}

fn names_in(folder: &Path, prefix: &str) -> io::Result<Vec<String>> {
    let mut names = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if entry.file_type()?.is_file()
            && !EXCLUDED.contains(&name.as_str())
            && !name.starts_with(BIAS_CHECK_PREFIX)
            && !atomic::is_temporary(&name)
        {
            names.push(format!("{prefix}{name}"));
        }
    }
    Ok(names)
}

/// Verifies the manifest's own hash, and the sizes of the files that it lists. A manifest without
/// checksums passes.
///
/// # Errors
/// Description of the first problem.
pub(crate) fn verify_sizes(folder: &Path, done: &Json) -> Result<(), String> {
    let Some(map) = done.as_object() else {
        return Err("its manifest (done.json or ref.json) is damaged".to_owned());
    };
    if !map.contains_key("files") && !map.contains_key("check") {
        return Ok(());
    }
    let mut unhashed = map.clone();
    let check = unhashed.shift_remove("check");
    if check.as_ref().and_then(Json::as_str) != Some(hash(&unhashed).as_str()) {
        return Err("its manifest (done.json or ref.json) is damaged".to_owned());
    }
    for (name, facts) in listed_files(done) {
        match fs::metadata(folder.join(name)) {
            Err(_) => return Err(format!("{name} is missing")),
            Ok(found) if Some(found.len()) != facts[0].as_u64() => {
                return Err(format!("{name} is damaged"));
            }
            Ok(_) => {}
        }
    }
    Ok(())
}

/// Verifies the manifest, and the hash of every file that it lists.
///
/// # Errors
/// Description of the first problem.
pub(crate) fn verify_hashes(folder: &Path, done: &Json) -> Result<(), String> {
    verify_sizes(folder, done)?;
    for (name, facts) in listed_files(done) {
        let bytes =
            fs::read(folder.join(name)).map_err(|e| format!("{name} cannot be read: {e}"))?;
        if facts[1].as_str() != Some(blake3::hash(&bytes).to_hex().as_str()) {
            return Err(format!("{name} is damaged"));
        }
    }
    Ok(())
}

fn listed_files(done: &Json) -> impl Iterator<Item = (&String, &Json)> {
    done["files"].as_object().into_iter().flatten()
}

fn hash(map: &Map<String, Json>) -> String {
    let text = Json::Object(map.clone()).to_string();
    blake3::hash(text.as_bytes()).to_hex()[..32].to_owned()
}
