//! Sums of finished references, from which longer references continue with bit-identical results.
//!
//! References that differ only in their length have the same stem. Of each stem the longest is
//! stored as `refs/sums/<stem>.<samples per pixel>`, in the format of a checkpoint. The renderer's
//! state is not compressed because sums have random digits. It takes 96 bytes per pixel, and twice
//! as much where splats are stored.

use std::fs;
use std::path::{Path, PathBuf};

use super::checkpoint;
use crate::experiment::event::SaveState;
use crate::experiment::run_progress::{Checkpoint, RunProgress};
use crate::store::StoreError;

fn folder(out: &Path) -> PathBuf {
    out.join("refs").join("sums")
}

/// Lists the stored sums of a stem: samples per pixel and file, the longest last.
pub(crate) fn list_stored(out: &Path, stem: &str) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(folder(out)).into_iter().flatten().flatten();
    let stored = entries.filter_map(|entry| {
        let name = entry.file_name();
        let samples = name
            .to_str()?
            .strip_prefix(stem)?
            .strip_prefix('.')?
            .parse()
            .ok()?;
        Some((samples, entry.path()))
    });
    let mut stored: Vec<(u64, PathBuf)> = stored.collect();
    stored.sort();
    stored
}

/// Samples per pixel of the longest stored reference of a stem with at most `most`.
pub(crate) fn samples(out: &Path, stem: &str, most: u64) -> Option<u64> {
    list_stored(out, stem)
        .into_iter()
        .map(|(samples, _)| samples)
        .rfind(|samples| *samples <= most)
}

/// Loads the longest intact reference of a stem with at most `most` samples per pixel.
pub(crate) fn load(out: &Path, stem: &str, most: u64) -> Option<Checkpoint> {
    let fitting = list_stored(out, stem)
        .into_iter()
        .rev()
        .filter(|(samples, _)| *samples <= most);
    for (samples, path) in fitting {
        match checkpoint::read_slot(&path, stem).filter(|found| found.progress.samples() == samples)
        {
            Some(found) => return Some(found),
            None => tracing::warn!(
                "{} is damaged; the reference starts again without it",
                path.display()
            ),
        }
    }
    None
}

/// Stores the sums of a finished reference, and removes those of shorter ones. Returns whether they
/// are stored, which they are not if the renderer's state cannot be saved, or if longer ones exist.
///
/// # Errors
/// When the sums cannot be written; the stored ones are then unchanged.
pub(crate) fn save(
    out: &Path,
    stem: &str,
    progress: &RunProgress,
    state: SaveState<'_>,
) -> Result<bool, StoreError> {
    let samples = progress.samples();
    let known = list_stored(out, stem);
    let path = folder(out).join(format!("{stem}.{samples}"));
    let longer = known.iter().any(|(other, _)| *other > samples);
    if longer || !checkpoint::write_slot(&path, stem, samples, progress, state)? {
        return Ok(false);
    }
    for (_, shorter) in known.into_iter().filter(|(other, _)| *other < samples) {
        // A file that cannot be removed is ignored because it is shorter.
        let _ = fs::remove_file(shorter);
    }
    Ok(true)
}

/// Removes the damaged sums of a stem, and names them.
pub(crate) fn remove_damaged(out: &Path, stem: &str) {
    for (samples, path) in list_stored(out, stem) {
        let found = checkpoint::read_slot(&path, stem);
        let intact = found.is_some_and(|found| found.progress.samples() == samples);
        if !intact && fs::remove_file(&path).is_ok() {
            tracing::warn!(
                "{} is damaged and has been removed; a longer reference starts without it",
                path.display()
            );
        }
    }
}

/// Removes damaged sums of a reference.
///
/// # Errors
/// When the file cannot be removed.
pub(crate) fn remove(out: &Path, stem: &str, samples: u64) -> std::io::Result<()> {
    fs::remove_file(folder(out).join(format!("{stem}.{samples}")))
}

#[cfg(test)]
mod tests {
    use crate::experiment::WaveRow;
    use crate::store::write::reference_sums::*;

    fn progress(samples: u64) -> RunProgress {
        let row = WaveRow {
            wave: 1,
            samples,
            render_s: samples as f64,
            ..WaveRow::default()
        };
        RunProgress {
            rows: vec![row],
            ..RunProgress::default()
        }
    }

    fn store(out: &Path, stem: &str, samples: u64) -> bool {
        let state: SaveState<'_> = &|to| to.write_all(&samples.to_le_bytes()).map(|()| true);
        save(out, stem, &progress(samples), state).unwrap()
    }

    #[test]
    fn the_longest_of_a_stem_is_stored_and_none_above_the_limit_is_loaded() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        assert!(load(out, "aa", u64::MAX).is_none() && samples(out, "aa", 9).is_none());
        assert!(store(out, "aa", 64) && store(out, "aa0", 16) && store(out, "aa", 128));
        assert!(!store(out, "aa", 32), "a longer one is stored");
        assert_eq!(
            (
                samples(out, "aa", 4096),
                samples(out, "aa", 127),
                samples(out, "aa0", 99)
            ),
            (Some(128), None, Some(16))
        );
        assert_eq!(list_stored(out, "aa").len(), 1);
        let found = load(out, "aa", 128).unwrap();
        assert_eq!(
            (found.state, found.progress),
            (128u64.to_le_bytes().to_vec(), progress(128))
        );
        assert!(
            !save(out, "bb", &progress(1), &|_| Ok(false)).unwrap(),
            "a renderer that cannot be saved"
        );
        assert!(list_stored(out, "bb").is_empty());
    }

    #[test]
    fn truncated_changed_or_foreign_sums_are_ignored() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        store(out, "aa", 64);
        let path = folder(out).join("aa.64");
        let intact = fs::read(&path).unwrap();
        for (i, bytes) in [
            intact[..intact.len() - 1].to_vec(),
            intact[..10].to_vec(),
            Vec::new(),
        ]
        .iter()
        .enumerate()
        {
            fs::write(&path, bytes).unwrap();
            assert!(load(out, "aa", 64).is_none(), "cut {i}");
        }
        let mut flipped = intact.clone();
        flipped[20] ^= 1;
        fs::write(&path, flipped).unwrap();
        assert!(load(out, "aa", 64).is_none());
        fs::write(folder(out).join("cc.64"), &intact).unwrap();
        assert!(
            load(out, "cc", 64).is_none(),
            "its content names another stem"
        );
        fs::write(folder(out).join("aa.63"), &intact).unwrap();
        fs::remove_file(&path).unwrap();
        assert!(
            load(out, "aa", 64).is_none(),
            "its name and its content differ"
        );
    }

    #[test]
    fn the_longest_sums_within_the_limit_are_loaded() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        store(out, "aa", 16);
        let shorter = folder(out).join("aa.16");
        let kept = fs::read(&shorter).unwrap();
        store(out, "aa", 64);
        // As if another process had stored them at the same time.
        fs::write(&shorter, kept).unwrap();
        let loaded = |most: u64| load(out, "aa", most).map(|found| found.progress.samples());
        assert_eq!(
            [15, 16, 63, 64].map(loaded),
            [None, Some(16), Some(16), Some(64)]
        );
    }
}
