//! Checkpoints of runs. Each run has two slots, written alternately; the newest valid one counts.
//!
//! ```text
//! magic and byte order | state of the renderer | head (JSON)
//!     | length of state | length of head | blake3 of everything before
//! ```
//!
//! A slot is written to a temporary file, synced and renamed, so that both slots are intact
//! whenever the process dies. The checksum detects disk errors and later changes.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::{atomic, metrics_csv};
use crate::experiment::WaveRow;
use crate::experiment::event::SaveState;
use crate::experiment::run_progress::{Checkpoint, RunProgress};
use crate::paths::folder_of;
use crate::store::schema::run::{CheckpointHead, WaveCounts};
use crate::store::{StoreError, regular_file};
use lumbre_render::WaveStats;

/// File names of the slots.
pub(crate) const SLOTS: [&str; 2] = ["ckpt.a", "ckpt.b"];

/// First bytes of a slot: format, version and byte order. Numbers are stored in that order.
const MAGIC: [u8; 16] = if cfg!(target_endian = "little") {
    *b"lumbre ckpt 2 le"
} else {
    *b"lumbre ckpt 2 be"
};

/// Number of bytes of the two lengths and the checksum.
const TAIL: usize = 16 + blake3::OUT_LEN;

/// Position in the alternation of the slots.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct SlotCursor {
    /// Number of the run's last checkpoint, from 1; 0 before the first.
    sequence: u64,
    /// Index of the slot that does not hold the last checkpoint.
    free: usize,
}

/// Writer that counts and hashes the bytes it passes on.
struct HashingWriter<W> {
    inner: W,
    hasher: blake3::Hasher,
    length: u64,
}

impl<W: Write> Write for HashingWriter<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.inner.write(bytes)?;
        self.hasher.update(&bytes[..n]);
        self.length += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Writes a checkpoint into the free slot. Returns whether the renderer's state could be saved.
///
/// # Errors
/// When the slot cannot be written; both slots are then unchanged.
pub(crate) fn save(
    folder: &Path,
    run: &str,
    cursor: &mut SlotCursor,
    progress: &RunProgress,
    state: SaveState<'_>,
) -> Result<bool, StoreError> {
    let saved = write_slot(
        &folder.join(SLOTS[cursor.free]),
        run,
        cursor.sequence + 1,
        progress,
        state,
    )?;
    if saved {
        *cursor = SlotCursor {
            sequence: cursor.sequence + 1,
            free: 1 - cursor.free,
        };
    }
    Ok(saved)
}

/// Writes a file in the format of a slot. Returns whether the renderer's state could be saved.
///
/// # Errors
/// When the file cannot be written; an existing file is then unchanged.
pub(crate) fn write_slot(
    path: &Path,
    run: &str,
    sequence: u64,
    progress: &RunProgress,
    state: SaveState<'_>,
) -> Result<bool, StoreError> {
    let folder = folder_of(path);
    let attempt = || -> io::Result<bool> {
        fs::create_dir_all(folder)?;
        let mut file = atomic::temporary(folder)?;
        let buffer = BufWriter::with_capacity(1 << 20, file.as_file_mut());
        let mut writer = HashingWriter {
            inner: buffer,
            hasher: blake3::Hasher::new(),
            length: 0,
        };
        writer.write_all(&MAGIC)?;
        if !state(&mut writer)? {
            return Ok(false);
        }
        let state_length = writer.length - MAGIC.len() as u64;
        let head = serde_json::to_string(&head(run, sequence, progress))?;
        writer.write_all(head.as_bytes())?;
        writer.write_all(&state_length.to_le_bytes())?;
        writer.write_all(&(head.len() as u64).to_le_bytes())?;
        let hash = writer.hasher.finalize();
        writer.write_all(hash.as_bytes())?;
        writer.flush()?;
        drop(writer);
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        atomic::sync_folder(folder)?;
        Ok(true)
    };
    attempt().map_err(|e| StoreError::io("write", path, &e))
}

/// Reads a file in the format of a slot. Returns `None` if it is missing, damaged or of another
/// run.
pub(crate) fn read_slot(path: &Path, run: &str) -> Option<Checkpoint> {
    Some(parse(regular_file::read(path).ok()?, run)?.1)
}

/// Loads the newest valid checkpoint of a run. Returns it with the position in the alternation and
/// the damaged slots.
pub(crate) fn load(folder: &Path, run: &str) -> (Option<Checkpoint>, SlotCursor, Vec<PathBuf>) {
    let mut newest: Option<(u64, usize, Checkpoint)> = None;
    let mut damaged = Vec::new();
    for (slot, name) in SLOTS.iter().enumerate() {
        let path = folder.join(name);
        let bytes = match regular_file::read(&path) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => continue,
            found => found.ok(),
        };
        match bytes.and_then(|bytes| parse(bytes, run)) {
            Some((sequence, checkpoint))
                if newest.as_ref().is_none_or(|(best, ..)| sequence > *best) =>
            {
                newest = Some((sequence, slot, checkpoint));
            }
            Some(_) => {}
            None => damaged.push(path),
        }
    }
    match newest {
        Some((sequence, slot, checkpoint)) => (
            Some(checkpoint),
            SlotCursor {
                sequence,
                free: 1 - slot,
            },
            damaged,
        ),
        None => (None, SlotCursor::default(), damaged),
    }
}

/// Removes the checkpoints of a run.
pub(crate) fn remove(folder: &Path) {
    for name in SLOTS {
        // A slot that cannot be removed is overwritten or ignored later.
        let _ = fs::remove_file(folder.join(name));
    }
}

/// Samples per pixel of the newest valid checkpoint of a run.
pub(crate) fn samples(folder: &Path, run: &str) -> Option<u64> {
    load(folder, run)
        .0
        .map(|checkpoint| checkpoint.progress.samples())
}

/// Head of a slot. The measurements are stored as CSV, which is exact to the bit.
fn head(run: &str, sequence: u64, progress: &RunProgress) -> CheckpointHead {
    let width = progress.rows.first().map_or(0, |row| row.metrics.len());
    let columns: Vec<String> = (0..width).map(|i| format!("m{i}")).collect();
    let csv = metrics_csv::header(columns.iter().map(String::as_str))
        + &progress
            .rows
            .iter()
            .map(metrics_csv::line)
            .collect::<String>();
    let wave = &progress.current_wave;
    CheckpointHead {
        run: run.to_owned(),
        sequence,
        samples_left: progress.samples_left,
        next_wave_max: progress.next_wave_max,
        wall_s: progress.wall_s,
        current_wave: WaveCounts {
            samples: wave.samples,
            render_s: wave.render_s,
            lost_s: wave.lost_s,
            device_s: wave.device_s,
            paths: wave.paths,
            rays: wave.rays,
            invalid: wave.invalid,
            first_invalid: wave.first_invalid,
        },
        first_invalid: progress.rows.iter().find_map(|row| row.first_invalid),
        rows: csv,
    }
}

/// Parses a slot into its number and content. Returns `None` if it is damaged or of another run.
fn parse(mut bytes: Vec<u8>, run: &str) -> Option<(u64, Checkpoint)> {
    let body = bytes.len().checked_sub(blake3::OUT_LEN)?;
    if !bytes.starts_with(&MAGIC) || blake3::hash(&bytes[..body]).as_bytes() != &bytes[body..] {
        return None;
    }
    let length = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize);
    let body_end = bytes.len().checked_sub(TAIL)?;
    let (state, head) = (length(body_end)?, length(body_end + 8)?);
    if MAGIC.len() + state + head != body_end {
        return None;
    }
    let head = &bytes[MAGIC.len() + state..body_end];
    let head: CheckpointHead = serde_json::from_slice(head).ok()?;
    if head.run != run {
        return None;
    }
    let progress = progress(&head)?;
    bytes.truncate(MAGIC.len() + state);
    bytes.drain(..MAGIC.len());
    Some((
        head.sequence,
        Checkpoint {
            progress,
            state: bytes,
        },
    ))
}

/// Reads the progress of a run from the head of a slot.
fn progress(head: &CheckpointHead) -> Option<RunProgress> {
    let (_, rows) = metrics_csv::parse(&head.rows).ok()?;
    let wave = &head.current_wave;
    Some(RunProgress {
        rows: rows
            .into_iter()
            .map(|row| WaveRow {
                first_invalid: head.first_invalid.filter(|_| row.invalid > 0),
                ..row
            })
            .collect(),
        current_wave: WaveStats {
            samples: wave.samples,
            render_s: wave.render_s,
            lost_s: wave.lost_s,
            device_s: wave.device_s,
            paths: wave.paths,
            rays: wave.rays,
            invalid: wave.invalid,
            first_invalid: wave.first_invalid,
            ..WaveStats::default()
        },
        samples_left: head.samples_left,
        next_wave_max: head.next_wave_max,
        wall_s: head.wall_s,
    })
}

#[cfg(test)]
mod tests {
    use crate::store::write::checkpoint::*;

    fn progress(samples: u64) -> RunProgress {
        let row = |wave| WaveRow {
            wave,
            samples: wave,
            render_s: 0.1 * wave as f64,
            invalid: wave - 1,
            first_invalid: (wave > 1).then_some([3, 4, 1]),
            metrics: vec![f64::INFINITY, 1.0 / 3.0],
            ..WaveRow::default()
        };
        let wave = WaveStats {
            samples: samples - 2,
            render_s: 1.0 / 3.0,
            lost_s: 0.2,
            device_s: 0.3,
            idle_s: 0.0,
            paths: 70,
            rays: 90,
            invalid: 3,
            first_invalid: Some([1, 2, 8]),
        };
        RunProgress {
            rows: vec![row(1), row(2)],
            current_wave: wave,
            samples_left: 5,
            next_wave_max: 8,
            wall_s: 0.7,
        }
    }

    fn keep(folder: &Path, cursor: &mut SlotCursor, samples: u64, state: &[u8]) {
        let save_state = |to: &mut dyn Write| to.write_all(state).map(|()| true);
        assert!(save(folder, "ab", cursor, &progress(samples), &save_state).unwrap());
    }

    #[test]
    fn the_newest_of_two_slots_is_restored_exactly() {
        let dir = tempfile::tempdir().unwrap();
        let mut cursor = SlotCursor::default();
        for samples in [10, 20, 30] {
            keep(dir.path(), &mut cursor, samples, &[samples as u8; 100]);
        }
        let (found, next, damaged) = load(dir.path(), "ab");
        let found = found.unwrap();
        assert_eq!((found.progress, found.state), (progress(30), vec![30; 100]));
        assert_eq!((next, damaged.len()), (cursor, 0));
        assert_eq!(
            load(dir.path(), "cd").0,
            None,
            "the checkpoint is of another run"
        );
        assert_eq!(samples(dir.path(), "ab"), Some(30));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn with_a_damaged_slot_the_older_one_counts() {
        let dir = tempfile::tempdir().unwrap();
        let mut cursor = SlotCursor::default();
        keep(dir.path(), &mut cursor, 10, &[1; 40]);
        keep(dir.path(), &mut cursor, 20, &[2; 40]);
        let newest = dir.path().join(SLOTS[1]);
        let intact = fs::read(&newest).unwrap();
        let mut damages: Vec<Vec<u8>> = (0..intact.len())
            .step_by(7)
            .map(|cut| intact[..cut].to_vec())
            .collect();
        for at in 0..intact.len() {
            let mut flipped = intact.clone();
            flipped[at] ^= 1 << (at % 8);
            damages.push(flipped);
        }
        for damage in damages {
            fs::write(&newest, &damage).unwrap();
            let (found, next, damaged) = load(dir.path(), "ab");
            assert_eq!(found.unwrap().state, [1; 40]);
            assert_eq!(next.free, 1, "the damaged slot is overwritten next");
            assert_eq!(damaged, std::slice::from_ref(&newest));
        }
    }

    #[test]
    fn a_failed_write_changes_no_slot() {
        let dir = tempfile::tempdir().unwrap();
        let mut cursor = SlotCursor::default();
        keep(dir.path(), &mut cursor, 10, &[1; 40]);
        let full = |to: &mut dyn Write| {
            to.write_all(&[9; 10])?;
            Err(io::ErrorKind::StorageFull.into())
        };
        let before = cursor;
        assert!(
            save(dir.path(), "ab", &mut cursor, &progress(20), &full)
                .unwrap_err()
                .is_full()
        );
        assert_eq!(cursor, before);
        assert_eq!(load(dir.path(), "ab").0.unwrap().progress, progress(10));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        assert!(!save(dir.path(), "ab", &mut cursor, &progress(20), &|_| Ok(false)).unwrap());
        assert_eq!(
            fs::read_dir(dir.path()).unwrap().count(),
            1,
            "a renderer that cannot be saved leaves no file"
        );
    }
}
