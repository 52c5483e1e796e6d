//! The sums of finished references, from which longer ones go on to the same bits as if they had never ended.
//!
//! References that differ only in when they end have one stem; of each stem the longest is kept, as
//! `refs/sums/<stem>.<samples per pixel>`, in the form of a checkpoint: what the renderer saved, uncompressed, because the
//! digits of sums are noise. That is 96 bytes for a pixel, and twice as much where splats land.

use std::fs;
use std::path::{Path, PathBuf};

use super::{StoreError, checkpoint};
use crate::experiment::event::Save;
use crate::experiment::standing::{Checkpoint, Standing};

fn folder(out: &Path) -> PathBuf {
    out.join("refs").join("sums")
}

/// Everything that is kept of a stem: samples per pixel and file, the longest last.
pub(super) fn kept(out: &Path, stem: &str) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(folder(out)).into_iter().flatten().flatten();
    let own = entries.filter_map(|entry| {
        let name = entry.file_name();
        let samples = name.to_str()?.strip_prefix(stem)?.strip_prefix('.')?.parse().ok()?;
        Some((samples, entry.path()))
    });
    let mut own: Vec<(u64, PathBuf)> = own.collect();
    own.sort();
    own
}

/// Samples per pixel of the longest reference of a stem that is kept and has at most `most`.
pub(super) fn samples(out: &Path, stem: &str, most: u64) -> Option<u64> {
    kept(out, stem).into_iter().map(|(samples, _)| samples).rfind(|samples| *samples <= most)
}

/// The longest reference of a stem that is whole and has at most `most` samples per pixel.
pub(super) fn load(out: &Path, stem: &str, most: u64) -> Option<Checkpoint> {
    let fitting = kept(out, stem).into_iter().rev().filter(|(samples, _)| *samples <= most);
    for (samples, path) in fitting {
        match checkpoint::read_one(&path, stem).filter(|found| found.standing.samples() == samples) {
            Some(found) => return Some(found),
            None => tracing::warn!("{} is damaged: the reference starts again", path.display()),
        }
    }
    None
}

/// Keeps the sums of a finished reference, and lets go of those of shorter ones. Says whether they are kept, which they
/// are not if the renderer cannot be saved, or if longer ones are there.
///
/// # Errors
/// When they cannot be written; what was there before still is.
pub(super) fn keep(out: &Path, stem: &str, standing: &Standing, save: Save<'_>) -> Result<bool, StoreError> {
    let samples = standing.samples();
    let known = kept(out, stem);
    let path = folder(out).join(format!("{stem}.{samples}"));
    let longer = known.iter().any(|(other, _)| *other > samples);
    if longer || !checkpoint::write_one(&path, stem, samples, standing, save)? {
        return Ok(false);
    }
    for (_, shorter) in known.into_iter().filter(|(other, _)| *other < samples) {
        // One that stays is found and passed over.
        let _ = fs::remove_file(shorter);
    }
    Ok(true)
}

/// Removes the sums of a reference that turned out to be damaged.
///
/// # Errors
/// When they stay.
pub(super) fn remove(out: &Path, stem: &str, samples: u64) -> std::io::Result<()> {
    fs::remove_file(folder(out).join(format!("{stem}.{samples}")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::WaveRow;

    fn standing(samples: u64) -> Standing {
        let row = WaveRow { wave: 1, samples, render_s: samples as f64, ..WaveRow::default() };
        Standing { rows: vec![row], ..Standing::default() }
    }

    fn keep(out: &Path, stem: &str, samples: u64) -> bool {
        let save: Save<'_> = &|to| to.write_all(&samples.to_le_bytes()).map(|()| true);
        super::keep(out, stem, &standing(samples), save).unwrap()
    }

    #[test]
    fn the_longest_of_a_stem_is_kept_and_only_what_does_not_overshoot_is_given() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        assert!(load(out, "aa", u64::MAX).is_none() && samples(out, "aa", 9).is_none());
        assert!(keep(out, "aa", 64) && keep(out, "aa0", 16) && keep(out, "aa", 128));
        assert!(!keep(out, "aa", 32), "a longer one is there");
        assert_eq!(
            (samples(out, "aa", 4096), samples(out, "aa", 127), samples(out, "aa0", 99)),
            (Some(128), None, Some(16))
        );
        assert_eq!(kept(out, "aa").len(), 1);
        let found = load(out, "aa", 128).unwrap();
        assert_eq!((found.state, found.standing), (128u64.to_le_bytes().to_vec(), standing(128)));
        assert!(!super::keep(out, "bb", &standing(1), &|_| Ok(false)).unwrap(), "a renderer that cannot be saved");
        assert!(kept(out, "bb").is_empty());
    }

    #[test]
    fn what_is_cut_changed_or_of_another_stem_counts_for_nothing() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        keep(out, "aa", 64);
        let path = folder(out).join("aa.64");
        let whole = fs::read(&path).unwrap();
        for (i, bytes) in [whole[..whole.len() - 1].to_vec(), whole[..10].to_vec(), Vec::new()].iter().enumerate() {
            fs::write(&path, bytes).unwrap();
            assert!(load(out, "aa", 64).is_none(), "cut {i}");
        }
        let mut flipped = whole.clone();
        flipped[20] ^= 1;
        fs::write(&path, flipped).unwrap();
        assert!(load(out, "aa", 64).is_none());
        fs::write(folder(out).join("cc.64"), &whole).unwrap();
        assert!(load(out, "cc", 64).is_none(), "its content names another stem");
        fs::write(folder(out).join("aa.63"), &whole).unwrap();
        fs::remove_file(&path).unwrap();
        assert!(load(out, "aa", 64).is_none(), "its name says other than its content");
    }
}
