//! Files of scenes: opened and read within limits.

use std::borrow::Cow;
use std::fs::File;
use std::io::Read;
use std::path::{Path, PathBuf};

use super::files;
use lumbre_light::scene::SceneError;

/// Adds a hint at `--lenient` to an error about a texture.
pub(crate) fn with_lenient_hint(e: SceneError) -> SceneError {
    match e {
        SceneError::Malformed {
            file,
            place,
            problem,
        } => SceneError::malformed(
            file,
            place,
            format!("{problem} (pass `--lenient` to use the material's constant value instead)"),
        ),
        other => other,
    }
}

pub(crate) fn unreadable(path: &Path, reason: impl std::fmt::Display) -> SceneError {
    SceneError::Unreadable {
        file: path.to_owned(),
        reason: reason.to_string(),
    }
}

/// Returns a text whose lines end with line feeds: without a byte order mark, and with line feeds in
/// place of carriage returns if only these end lines. Bytes that are no UTF-8 are replaced: names and
/// comments in other encodings are common and harmless, and numbers are ASCII in all of them.
pub(crate) fn text_of_lines(bytes: &[u8]) -> Cow<'_, str> {
    let text = String::from_utf8_lossy(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes));
    if text.contains('\r') && !text.contains('\n') {
        return Cow::Owned(text.replace('\r', "\n"));
    }
    text
}

/// Returns the canonical path of a file, or the path itself if there is no such file.
pub(crate) fn canonical(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_owned())
}

/// Opens a regular file and returns its length in bytes. Pipes and devices are refused, since they
/// could block or never end.
pub(crate) fn open(path: &Path) -> Result<(File, u64), SceneError> {
    files::check(path).map_err(|e| unreadable(path, e))?;
    let meta = std::fs::metadata(path).map_err(|e| unreadable(path, e))?;
    if !meta.is_file() {
        return Err(unreadable(path, "it is not a regular file"));
    }
    files::record(path);
    Ok((
        File::open(path).map_err(|e| unreadable(path, e))?,
        meta.len(),
    ))
}

/// Reads a file of at most `limit` bytes. No more is read than its reported length, since special
/// files of length zero could block or never end.
pub(crate) fn read_file(path: &Path, limit: u64) -> Result<Vec<u8>, SceneError> {
    let (file, length) = open(path)?;
    if length > limit {
        return Err(unreadable(
            path,
            format!(
                "the file is larger than {} MiB, the limit for files of this type",
                limit >> 20
            ),
        ));
    }
    let mut bytes = Vec::new();
    file.take(length)
        .read_to_end(&mut bytes)
        .map_err(|e| unreadable(path, e))?;
    Ok(bytes)
}
