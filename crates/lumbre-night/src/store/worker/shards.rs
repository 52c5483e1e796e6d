//! Storage of reference shards. `refs/shards/<stem>/<first>-<end>/` holds a claim and checkpoints
//! while the shard is rendered, and the file `sums`, in the format of a checkpoint, when it is
//! finished.
//!
//! Once the shards of a reference are joined, the joined sums are stored in `refs/sums` under the
//! same stem, where longer references find them, and the shards are removed. Sums take 96 bytes per
//! pixel.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use crate::experiment::run_progress::Checkpoint;
use crate::experiment::shards::Shard;
use crate::store::StoreError;
use crate::store::write::{checkpoint, reference_sums};

/// Name of the file that holds the sums of a finished shard.
const SUMS: &str = "sums";

/// Folder of a shard.
pub(crate) fn folder(out: &Path, stem: &str, shard: &Shard) -> PathBuf {
    out.join("refs")
        .join("shards")
        .join(stem)
        .join(format!("{}-{}", shard.first, shard.end))
}

/// Name of a shard in its checkpoints and in journals.
pub(crate) fn checkpoint_name(run: &str, shard: &Shard) -> String {
    format!("{run} {}-{}", shard.first, shard.end)
}

/// Removes the folder of a shard, and its parent, if they are empty.
pub(crate) fn remove_if_empty(folder: &Path) {
    // Fails, as intended, if the folder is not empty.
    if fs::remove_dir(folder).is_ok()
        && let Some(all) = folder.parent()
    {
        let _ = fs::remove_dir(all);
    }
}

/// Samples per pixel of the longest stored sums that join the first shards.
fn joined_samples(out: &Path, stem: &str, shards: &[Shard]) -> Option<u64> {
    let stored = reference_sums::list_stored(out, stem)
        .into_iter()
        .map(|(samples, _)| samples);
    stored
        .rev()
        .find(|samples| shards.iter().any(|shard| shard.end == *samples))
}

/// Numbers of the shards that are finished, stored alone or joined.
pub(crate) fn available(out: &Path, stem: &str, shards: &[Shard]) -> BTreeSet<usize> {
    let joined = joined_samples(out, stem, shards).unwrap_or(0);
    let stored =
        |shard: &&Shard| shard.end <= joined || folder(out, stem, shard).join(SUMS).is_file();
    let numbers = shards.iter().filter(stored).map(|shard| shard.number);
    numbers.collect()
}

/// Loads the sums of a shard that is stored alone. Removes a damaged file, so that the shard is
/// rendered again.
pub(crate) fn load(out: &Path, stem: &str, shard: &Shard) -> Option<Checkpoint> {
    let path = folder(out, stem, shard).join(SUMS);
    let found = checkpoint::read_slot(&path, &checkpoint_name(stem, shard))
        .filter(|found| found.progress.samples() == shard.end - shard.first);
    if found.is_none() && path.is_file() {
        tracing::warn!(
            "{} is damaged; {} will be rendered again",
            path.display(),
            shard.label()
        );
        // If it cannot be removed, the next attempt finds it damaged again.
        let _ = fs::remove_file(path);
    }
    found
}

/// Stores the sums of a finished shard, and removes its checkpoints.
///
/// # Errors
/// When the sums cannot be written.
pub(crate) fn save(
    out: &Path,
    stem: &str,
    shard: &Shard,
    sums: &Checkpoint,
) -> Result<(), StoreError> {
    let folder = folder(out, stem, shard);
    let state = |to: &mut dyn std::io::Write| to.write_all(&sums.state).map(|()| true);
    checkpoint::write_slot(
        &folder.join(SUMS),
        &checkpoint_name(stem, shard),
        1,
        &sums.progress,
        &state,
    )?;
    checkpoint::remove(&folder);
    Ok(())
}

/// Loads the longest stored sums that join the first shards. Removes damaged files.
pub(crate) fn load_joined(out: &Path, stem: &str, shards: &[Shard]) -> Option<Checkpoint> {
    while let Some(samples) = joined_samples(out, stem, shards) {
        let found = reference_sums::load(out, stem, samples);
        if found
            .as_ref()
            .is_some_and(|found| found.progress.samples() == samples)
        {
            return found;
        }
        reference_sums::remove(out, stem, samples).ok()?;
    }
    None
}

/// Stores the joined sums of the first shards, unless longer ones are stored, and removes all
/// single shards.
///
/// # Errors
/// When the sums cannot be written; the shards then stay.
pub(crate) fn save_joined(
    out: &Path,
    stem: &str,
    shards: &[Shard],
    joined: Option<&Checkpoint>,
) -> Result<(), StoreError> {
    if let Some(joined) = joined {
        let state = |to: &mut dyn std::io::Write| to.write_all(&joined.state).map(|()| true);
        reference_sums::save(out, stem, &joined.progress, &state)?;
    }
    for shard in shards {
        // A shard that cannot be removed is only of use to a longer reference.
        let _ = fs::remove_dir_all(folder(out, stem, shard));
    }
    // Fails, as intended, if a longer reference has shards here.
    let _ = fs::remove_dir(out.join("refs").join("shards").join(stem));
    Ok(())
}

#[cfg(test)]
mod tests {
    use crate::experiment::WaveRow;
    use crate::experiment::run_progress::RunProgress;
    use crate::experiment::shards::split;
    use crate::store::worker::shards::*;

    const STEM: &str = "aa";

    fn sums(samples: u64) -> Checkpoint {
        let row = WaveRow {
            wave: 1,
            samples,
            render_s: samples as f64,
            ..WaveRow::default()
        };
        let progress = RunProgress {
            rows: vec![row],
            ..RunProgress::default()
        };
        Checkpoint {
            progress,
            state: samples.to_le_bytes().to_vec(),
        }
    }

    #[test]
    fn shards_are_stored_alone_until_they_are_joined() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let shards = split(0, 16, 40);
        assert!(available(out, STEM, &shards).is_empty() && load(out, STEM, &shards[0]).is_none());
        save(out, STEM, &shards[1], &sums(16)).unwrap();
        save(out, STEM, &shards[2], &sums(8)).unwrap();
        assert_eq!(available(out, STEM, &shards), BTreeSet::from([2, 3]));
        assert_eq!(load(out, STEM, &shards[1]), Some(sums(16)));
        assert!(available(out, "a", &shards).is_empty());
        save_joined(out, STEM, &shards, Some(&sums(32))).unwrap();
        assert_eq!(
            available(out, STEM, &shards),
            BTreeSet::from([1, 2]),
            "the last is shorter than the others"
        );
        assert_eq!(load_joined(out, STEM, &shards), Some(sums(32)));
        assert_eq!(fs::read_dir(out.join("refs/shards")).unwrap().count(), 0);
        assert_eq!(
            available(out, STEM, &split(0, 16, 64)),
            BTreeSet::from([1, 2]),
            "a longer reference continues from there"
        );
        assert!(
            available(out, STEM, &split(0, 10, 40)).is_empty(),
            "no shard ends at their last sample"
        );
        save_joined(out, STEM, &shards, Some(&sums(40))).unwrap();
        assert_eq!(available(out, STEM, &shards), BTreeSet::from([1, 2, 3]));
        assert_eq!(load_joined(out, STEM, &shards), Some(sums(40)));
    }

    #[test]
    fn damaged_files_do_not_count_as_finished() {
        let dir = tempfile::tempdir().unwrap();
        let out = dir.path();
        let shards = split(0, 16, 48);
        for shard in &shards {
            save(out, STEM, shard, &sums(16)).unwrap();
        }
        let file = folder(out, STEM, &shards[0]).join(SUMS);
        let intact = fs::read(&file).unwrap();
        fs::write(&file, &intact[..intact.len() - 1]).unwrap();
        assert!(load(out, STEM, &shards[0]).is_none());
        assert_eq!(available(out, STEM, &shards), BTreeSet::from([2, 3]));
        fs::write(folder(out, STEM, &shards[1]).join(SUMS), &intact).unwrap();
        assert!(
            load(out, STEM, &shards[1]).is_none(),
            "the file belongs to another shard"
        );
        save_joined(out, STEM, &shards, Some(&sums(32))).unwrap();
        let file = out.join("refs/sums/aa.32");
        fs::write(&file, b"").unwrap();
        assert!(load_joined(out, STEM, &shards).is_none() && !file.exists());
    }
}
