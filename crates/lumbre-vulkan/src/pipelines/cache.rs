//! Driver pipeline caches on disk, one file for each device and driver. They only save time: files
//! that cannot be read or written are ignored.

use std::path::{Path, PathBuf};

/// Maximum size of a cache file in bytes; larger files are ignored.
const MAX_BYTES: u64 = 256 << 20;

/// Returns the folder of pipeline caches in the user's cache directory, as given by the usual
/// environment variables; `None` if there is none.
fn folder() -> Option<PathBuf> {
    let variable = |name: &str| {
        std::env::var_os(name)
            .filter(|v| !v.is_empty())
            .map(PathBuf::from)
    };
    let base = variable("XDG_CACHE_HOME").or_else(|| variable("LOCALAPPDATA"));
    Some(
        base.or_else(|| Some(variable("HOME")?.join(".cache")))?
            .join("lumbre")
            .join("pipelines"),
    )
}

/// Returns the cache stored under a key; empty if there is none.
pub fn load(key: &str) -> Vec<u8> {
    folder()
        .map(|folder| load_from(&folder, key))
        .unwrap_or_default()
}

/// Stores a cache under a key.
pub fn store(key: &str, data: &[u8]) {
    let Some(folder) = folder() else { return };
    if let Err(e) = store_in(&folder, key, data) {
        tracing::debug!(
            "the pipeline cache cannot be written to {}: {e}",
            folder.display()
        );
    }
}

fn load_from(folder: &Path, key: &str) -> Vec<u8> {
    let path = folder.join(key);
    match std::fs::metadata(&path) {
        Ok(meta) if meta.len() <= MAX_BYTES => std::fs::read(path).unwrap_or_default(),
        _ => Vec::new(),
    }
}

fn store_in(folder: &Path, key: &str, data: &[u8]) -> std::io::Result<()> {
    if data == load_from(folder, key) {
        return Ok(());
    }
    std::fs::create_dir_all(folder)?;
    let mut file = tempfile::NamedTempFile::new_in(folder)?;
    std::io::Write::write_all(&mut file, data)?;
    file.persist(folder.join(key))
        .map(drop)
        .map_err(|e| e.error)
}

#[cfg(test)]
mod tests {
    use crate::pipelines::cache::*;

    #[test]
    fn caches_are_stored_and_loaded_by_key() {
        let dir = tempfile::tempdir().unwrap();
        let folder = dir.path().join("deep/er");
        assert!(load_from(&folder, "a").is_empty());
        store_in(&folder, "a", b"first").unwrap();
        store_in(&folder, "a", b"second").unwrap();
        assert_eq!(load_from(&folder, "a"), b"second");
        assert!(load_from(&folder, "b").is_empty());
        assert_eq!(
            std::fs::read_dir(&folder).unwrap().count(),
            1,
            "no partial file remains"
        );
    }
}
