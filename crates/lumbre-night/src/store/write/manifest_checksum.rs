//! Checksums of finished runs. The last file of a run (`done.json` or `ref.json`) is a manifest: it
//! lists every other file with its size and BLAKE3 hash, and ends with a hash of itself. Truncated,
//! changed and missing files are detected with it.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::Path;

use super::{atomic, checkpoint};
use crate::store::lock::claim;
use crate::store::schema::StoredFile;
use crate::store::schema::run::{ConfigFile, DONE, DoneFile, FailedFile, FileSum, REFERENCE};
use crate::store::{FILMS, regular_file};

/// Files that are not listed because they are temporary, grow, or are rewritten when they differ.
const EXCLUDED: [&str; 8] = [
    ConfigFile::NAME,
    "log.txt",
    DONE,
    REFERENCE,
    FailedFile::NAME,
    claim::FILE,
    checkpoint::SLOTS[0],
    checkpoint::SLOTS[1],
];

/// Prefix of the results of bias checks, which are written after a reference is finished.
pub const BIAS_CHECK_PREFIX: &str = "bias-check-";

/// Adds the sizes and hashes of all files in a run's folder to `done`, and a hash of the whole
/// manifest.
///
/// # Errors
/// When a file cannot be read.
pub fn add_checksums(folder: &Path, done: &DoneFile) -> io::Result<DoneFile> {
    let mut files = BTreeMap::new();
    let mut names = names_in(folder, "")?;
    names.extend(names_in(&folder.join(FILMS), &format!("{FILMS}/")).unwrap_or_default());
    for name in names {
        let bytes = regular_file::read(&folder.join(&name))?;
        let sum = FileSum {
            bytes: bytes.len() as u64,
            blake3: blake3::hash(&bytes).to_hex().to_string(),
        };
        files.insert(name, sum);
    }
    Ok(done.sealed(files))
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

/// Verifies the sizes of the files that a manifest lists.
///
/// # Errors
/// Description of the first problem.
pub(crate) fn verify_sizes(folder: &Path, done: &DoneFile) -> Result<(), String> {
    for (name, sum) in done.files() {
        match fs::metadata(folder.join(name)) {
            Err(_) => return Err(format!("{name} is missing")),
            Ok(found) if !found.is_file() || found.len() != sum.bytes => {
                return Err(format!("{name} is damaged"));
            }
            Ok(_) => {}
        }
    }
    Ok(())
}

/// Reads a file of a run, and compares it with its size and hash in the manifest.
///
/// # Errors
/// Description of the problem.
pub(crate) fn read(folder: &Path, name: &str, sum: &FileSum) -> Result<Vec<u8>, String> {
    let bytes = regular_file::read(&folder.join(name)).map_err(|e| match e.kind() {
        io::ErrorKind::NotFound => format!("{name} is missing"),
        _ => format!("{name} cannot be read: {e}"),
    })?;
    if bytes.len() as u64 != sum.bytes || sum.blake3 != blake3::hash(&bytes).to_hex().as_str() {
        return Err(format!("{name} is damaged"));
    }
    Ok(bytes)
}

/// Verifies the size and the hash of every file that a manifest lists.
///
/// # Errors
/// Description of the first problem.
pub(crate) fn verify_hashes(folder: &Path, done: &DoneFile) -> Result<(), String> {
    verify_sizes(folder, done)?;
    for (name, sum) in done.files() {
        read(folder, name, sum)?;
    }
    Ok(())
}
