//! The parts of references: `refs/parts/<stem>/<first>-<end>/` with a claim and checkpoints while one is rendered, and with
//! `sums` when it is done, which is in the form of a checkpoint.
//!
//! Once a reference is joined from its parts, what a longer one goes on from lies in `refs/sums` under the same stem, and the
//! parts go. They are 96 bytes for a pixel each.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use super::{StoreError, checkpoint, sums};
use crate::experiment::parts::Part;
use crate::experiment::standing::Checkpoint;

/// The file of a part that is done.
const SUMS: &str = "sums";

/// The folder of a part.
pub(super) fn folder(out: &Path, stem: &str, part: &Part) -> PathBuf {
    out.join("refs").join("parts").join(stem).join(format!("{}-{}", part.first, part.end))
}

/// What a part is called in its checkpoints and in journals.
pub(super) fn name(run: &str, part: &Part) -> String {
    format!("{run} {}-{}", part.first, part.end)
}

/// Removes the folder of a part if nothing is in it any more.
pub(super) fn tidy(folder: &Path) {
    // What is not empty stays.
    if fs::remove_dir(folder).is_ok()
        && let Some(all) = folder.parent()
    {
        let _ = fs::remove_dir(all);
    }
}

/// Samples per pixel of the most parts, from the first on, that are kept joined.
fn joined_samples(out: &Path, stem: &str, parts: &[Part]) -> Option<u64> {
    let kept = sums::kept(out, stem).into_iter().map(|(samples, _)| samples);
    kept.rev().find(|samples| parts.iter().any(|part| part.end == *samples))
}

/// The numbers of those parts that are kept, alone or joined.
pub(super) fn there(out: &Path, stem: &str, parts: &[Part]) -> BTreeSet<usize> {
    let joined = joined_samples(out, stem, parts).unwrap_or(0);
    let kept = |part: &&Part| part.end <= joined || folder(out, stem, part).join(SUMS).is_file();
    parts.iter().filter(kept).map(|part| part.number).collect()
}

/// The sums of a part that is kept alone. What is damaged is removed, so that it is rendered again.
pub(super) fn load(out: &Path, stem: &str, part: &Part) -> Option<Checkpoint> {
    let path = folder(out, stem, part).join(SUMS);
    let found = checkpoint::read_one(&path, &name(stem, part))
        .filter(|found| found.standing.samples() == part.end - part.first);
    if found.is_none() && path.is_file() {
        tracing::warn!("{} is damaged: {} is rendered again", path.display(), part.words());
        // One that stays is found damaged again.
        let _ = fs::remove_file(path);
    }
    found
}

/// Keeps the sums of a part that is done, and removes its checkpoints.
///
/// # Errors
/// When they cannot be written.
pub(super) fn keep(out: &Path, stem: &str, part: &Part, kept: &Checkpoint) -> Result<(), StoreError> {
    let folder = folder(out, stem, part);
    let state = |to: &mut dyn std::io::Write| to.write_all(&kept.state).map(|()| true);
    checkpoint::write_one(&folder.join(SUMS), &name(stem, part), 1, &kept.standing, &state)?;
    checkpoint::remove(&folder);
    Ok(())
}

/// The sums of the most parts, from the first on, that are kept joined. What is damaged is removed.
pub(super) fn joined(out: &Path, stem: &str, parts: &[Part]) -> Option<Checkpoint> {
    while let Some(samples) = joined_samples(out, stem, parts) {
        let found = sums::load(out, stem, samples);
        if found.as_ref().is_some_and(|found| found.standing.samples() == samples) {
            return found;
        }
        sums::remove(out, stem, samples).ok()?;
    }
    None
}

/// Keeps the sums of the first parts joined, unless more are, and removes all single parts.
///
/// # Errors
/// When they cannot be written; the parts then stay.
pub(super) fn keep_joined(
    out: &Path,
    stem: &str,
    parts: &[Part],
    ground: Option<&Checkpoint>,
) -> Result<(), StoreError> {
    if let Some(ground) = ground {
        let state = |to: &mut dyn std::io::Write| to.write_all(&ground.state).map(|()| true);
        sums::keep(out, stem, &ground.standing, &state)?;
    }
    for part in parts {
        // One that stays is of use to a longer reference at most.
        let _ = fs::remove_dir_all(folder(out, stem, part));
    }
    // A longer reference may have parts here.
    let _ = fs::remove_dir(out.join("refs").join("parts").join(stem));
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::experiment::WaveRow;
    use crate::experiment::parts::split;
    use crate::experiment::standing::Standing;

    const STEM: &str = "aa";

    fn kept(samples: u64) -> Checkpoint {
        let row = WaveRow { wave: 1, samples, render_s: samples as f64, ..WaveRow::default() };
        let standing = Standing { rows: vec![row], ..Standing::default() };
        Checkpoint { standing, state: samples.to_le_bytes().to_vec() }
    }

    #[test]
    fn parts_are_kept_alone_until_they_are_joined() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let parts = split(0, 16, 40);
        assert!(there(out, STEM, &parts).is_empty() && load(out, STEM, &parts[0]).is_none());
        keep(out, STEM, &parts[1], &kept(16)).unwrap();
        keep(out, STEM, &parts[2], &kept(8)).unwrap();
        assert_eq!(there(out, STEM, &parts), BTreeSet::from([2, 3]));
        assert_eq!(load(out, STEM, &parts[1]), Some(kept(16)));
        assert!(there(out, "a", &parts).is_empty());
        keep_joined(out, STEM, &parts, Some(&kept(32))).unwrap();
        assert_eq!(there(out, STEM, &parts), BTreeSet::from([1, 2]), "the last is shorter than the others");
        assert_eq!(joined(out, STEM, &parts), Some(kept(32)));
        assert_eq!(fs::read_dir(out.join("refs/parts")).unwrap().count(), 0);
        assert_eq!(there(out, STEM, &split(0, 16, 64)), BTreeSet::from([1, 2]), "a longer one goes on from there");
        assert!(there(out, STEM, &split(0, 10, 40)).is_empty(), "no part ends where they do");
    }

    #[test]
    fn what_is_damaged_is_there_no_more() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let parts = split(0, 16, 48);
        for part in &parts {
            keep(out, STEM, part, &kept(16)).unwrap();
        }
        let file = folder(out, STEM, &parts[0]).join(SUMS);
        let whole = fs::read(&file).unwrap();
        fs::write(&file, &whole[..whole.len() - 1]).unwrap();
        assert!(load(out, STEM, &parts[0]).is_none());
        assert_eq!(there(out, STEM, &parts), BTreeSet::from([2, 3]));
        fs::write(folder(out, STEM, &parts[1]).join(SUMS), &whole).unwrap();
        assert!(load(out, STEM, &parts[1]).is_none(), "it is another part's");
        keep_joined(out, STEM, &parts, Some(&kept(32))).unwrap();
        let file = out.join("refs/sums/aa.32");
        fs::write(&file, b"").unwrap();
        assert!(joined(out, STEM, &parts).is_none() && !file.exists());
    }
}
