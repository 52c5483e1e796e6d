//! Checkpoints: two slots in a run's folder, written in turn, of which the newest valid one counts.
//!
//! ```text
//! magic and byte order | state of the renderer | head (JSON) | length of state, of head | blake3 of all before
//! ```
//!
//! A slot is written beside its name, synced and renamed, so that a process that dies at any moment leaves both slots
//! whole; the checksum is for disks that lie and for what changes afterwards.

use std::fs;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use serde_json::{Value as Json, json};

use super::{StoreError, rows, write};
use crate::experiment::WaveRow;
use crate::experiment::event::Save;
use crate::experiment::standing::{Checkpoint, Standing};
use crate::render::WaveStats;

/// The names of the slots.
pub(super) const SLOTS: [&str; 2] = ["ckpt.a", "ckpt.b"];

/// First bytes of a slot: format, version, and the byte order of the machine, whose numbers follow as they are.
const MAGIC: [u8; 16] = if cfg!(target_endian = "little") { *b"lumbre ckpt 1 le" } else { *b"lumbre ckpt 1 be" };

/// Bytes of the two lengths and of the checksum.
const TAIL: usize = 16 + blake3::OUT_LEN;

/// Which slot is next.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Turn {
    /// Number of the last checkpoint of the run, from 1; 0 before the first.
    sequence: u64,
    /// The slot that does not hold it.
    free: usize,
}

/// Counts and hashes what passes.
struct Hashing<W> {
    to: W,
    hasher: blake3::Hasher,
    length: u64,
}

impl<W: Write> Write for Hashing<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let n = self.to.write(bytes)?;
        self.hasher.update(&bytes[..n]);
        self.length += n as u64;
        Ok(n)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.to.flush()
    }
}

/// Writes a checkpoint into the free slot, and says whether the renderer could be saved.
///
/// # Errors
/// When it cannot be written; both slots are then as they were.
pub(super) fn save(
    folder: &Path,
    run: &str,
    turn: &mut Turn,
    standing: &Standing,
    state: Save<'_>,
) -> Result<bool, StoreError> {
    let saved = write_one(&folder.join(SLOTS[turn.free]), run, turn.sequence + 1, standing, state)?;
    if saved {
        *turn = Turn { sequence: turn.sequence + 1, free: 1 - turn.free };
    }
    Ok(saved)
}

/// Writes one file in the form of a slot, and says whether the renderer could be saved.
///
/// # Errors
/// When it cannot be written; what was under its name is then as it was.
pub(super) fn write_one(
    path: &Path,
    run: &str,
    sequence: u64,
    standing: &Standing,
    state: Save<'_>,
) -> Result<bool, StoreError> {
    let folder = path.parent().unwrap_or(Path::new("."));
    let attempt = || -> io::Result<bool> {
        fs::create_dir_all(folder)?;
        let mut file = write::temporary(folder)?;
        let buffer = BufWriter::with_capacity(1 << 20, file.as_file_mut());
        let mut to = Hashing { to: buffer, hasher: blake3::Hasher::new(), length: 0 };
        to.write_all(&MAGIC)?;
        if !state(&mut to)? {
            return Ok(false);
        }
        let state_length = to.length - MAGIC.len() as u64;
        let head = head(run, sequence, standing).to_string();
        to.write_all(head.as_bytes())?;
        to.write_all(&state_length.to_le_bytes())?;
        to.write_all(&(head.len() as u64).to_le_bytes())?;
        let hash = to.hasher.finalize();
        to.write_all(hash.as_bytes())?;
        to.flush()?;
        drop(to);
        file.as_file().sync_all()?;
        file.persist(path).map_err(|e| e.error)?;
        write::sync_folder(folder)?;
        Ok(true)
    };
    attempt().map_err(|e| StoreError::io("write", path, &e))
}

/// Reads one file in the form of a slot; nothing if it is not there, damaged, or another run's.
pub(super) fn read_one(path: &Path, run: &str) -> Option<Checkpoint> {
    Some(parse(fs::read(path).ok()?, run)?.1)
}

/// The newest valid checkpoint of a run, and which slot is next; and the slots that are damaged.
pub(super) fn load(folder: &Path, run: &str) -> (Option<Checkpoint>, Turn, Vec<PathBuf>) {
    let mut newest: Option<(u64, usize, Checkpoint)> = None;
    let mut damaged = Vec::new();
    for (slot, name) in SLOTS.iter().enumerate() {
        let path = folder.join(name);
        let Ok(bytes) = fs::read(&path) else { continue };
        match parse(bytes, run) {
            Some((sequence, checkpoint)) if newest.as_ref().is_none_or(|(best, ..)| sequence > *best) => {
                newest = Some((sequence, slot, checkpoint));
            }
            Some(_) => {}
            None => damaged.push(path),
        }
    }
    match newest {
        Some((sequence, slot, checkpoint)) => (Some(checkpoint), Turn { sequence, free: 1 - slot }, damaged),
        None => (None, Turn::default(), damaged),
    }
}

/// Removes the checkpoints of a run that needs them no more.
pub(super) fn remove(folder: &Path) {
    for name in SLOTS {
        // One that stays is overwritten or ignored.
        let _ = fs::remove_file(folder.join(name));
    }
}

/// Samples per pixel that the newest valid checkpoint of a run has, without keeping its sums.
pub(super) fn samples(folder: &Path, run: &str) -> Option<u64> {
    load(folder, run).0.map(|checkpoint| checkpoint.standing.samples())
}

fn head(run: &str, sequence: u64, standing: &Standing) -> Json {
    let width = standing.rows.first().map_or(0, |row| row.metrics.len());
    let columns: Vec<String> = (0..width).map(|i| format!("m{i}")).collect();
    let csv =
        rows::header(columns.iter().map(String::as_str)) + &standing.rows.iter().map(rows::line).collect::<String>();
    let part = &standing.part;
    json!({
        "run": run,
        "sequence": sequence,
        "left": standing.left,
        "growth": standing.growth,
        "wall_s": standing.wall_s,
        "part": {
            "samples": part.samples, "render_s": part.render_s, "device_s": part.device_s,
            "paths": part.paths, "rays": part.rays,
            "invalid": part.invalid, "first_invalid": part.first_invalid,
        },
        "first_invalid": standing.rows.iter().find_map(|row| row.first_invalid),
        "rows": csv,
    })
}

/// A slot's number and content; nothing if it is damaged or another run's.
fn parse(mut bytes: Vec<u8>, run: &str) -> Option<(u64, Checkpoint)> {
    let body = bytes.len().checked_sub(blake3::OUT_LEN)?;
    if !bytes.starts_with(&MAGIC) || blake3::hash(&bytes[..body]).as_bytes() != &bytes[body..] {
        return None;
    }
    let word = |at: usize| Some(u64::from_le_bytes(*bytes.get(at..)?.first_chunk()?) as usize);
    let lengths = bytes.len().checked_sub(TAIL)?;
    let (state, head) = (word(lengths)?, word(lengths + 8)?);
    if MAGIC.len() + state + head != lengths {
        return None;
    }
    let head: Json = serde_json::from_slice(&bytes[MAGIC.len() + state..lengths]).ok()?;
    if head["run"].as_str() != Some(run) {
        return None;
    }
    let standing = standing(&head)?;
    bytes.truncate(MAGIC.len() + state);
    bytes.drain(..MAGIC.len());
    Some((head["sequence"].as_u64()?, Checkpoint { standing, state: bytes }))
}

fn standing(head: &Json) -> Option<Standing> {
    let place = |json: &Json| Some([json.get(0)?.as_u64()?, json.get(1)?.as_u64()?, json.get(2)?.as_u64()?]);
    let first_invalid = place(&head["first_invalid"]);
    let (_, rows) = rows::parse(head["rows"].as_str()?).ok()?;
    let part = &head["part"];
    Some(Standing {
        rows: rows
            .into_iter()
            .map(|row| WaveRow { first_invalid: first_invalid.filter(|_| row.invalid > 0), ..row })
            .collect(),
        part: WaveStats {
            samples: part["samples"].as_u64()?,
            render_s: part["render_s"].as_f64()?,
            device_s: part["device_s"].as_f64()?,
            paths: part["paths"].as_u64()?,
            rays: part["rays"].as_u64()?,
            invalid: part["invalid"].as_u64()?,
            first_invalid: place(&part["first_invalid"]),
            ..WaveStats::default()
        },
        left: head["left"].as_u64()?,
        growth: head["growth"].as_u64()?,
        wall_s: head["wall_s"].as_f64()?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn standing(samples: u64) -> Standing {
        let row = |wave| WaveRow {
            wave,
            samples: wave,
            render_s: 0.1 * wave as f64,
            invalid: wave - 1,
            first_invalid: (wave > 1).then_some([3, 4, 1]),
            metrics: vec![f64::INFINITY, 1.0 / 3.0],
            ..WaveRow::default()
        };
        let part = WaveStats { samples: samples - 2, render_s: 1.0 / 3.0, ..WaveStats::default() };
        Standing { rows: vec![row(1), row(2)], part, left: 5, growth: 8, wall_s: 0.7 }
    }

    fn keep(folder: &Path, turn: &mut Turn, samples: u64, state: &[u8]) {
        let save_state = |to: &mut dyn Write| to.write_all(state).map(|()| true);
        assert!(save(folder, "ab", turn, &standing(samples), &save_state).unwrap());
    }

    #[test]
    fn the_newest_of_two_slots_comes_back_to_the_bit() {
        let dir = tempfile::tempdir().unwrap();
        let mut turn = Turn::default();
        for samples in [10, 20, 30] {
            keep(dir.path(), &mut turn, samples, &[samples as u8; 100]);
        }
        let (found, next, damaged) = load(dir.path(), "ab");
        let found = found.unwrap();
        assert_eq!((found.standing, found.state), (standing(30), vec![30; 100]));
        assert_eq!((next, damaged.len()), (turn, 0));
        assert_eq!(load(dir.path(), "cd").0, None, "another run's");
        assert_eq!(samples(dir.path(), "ab"), Some(30));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 2);
    }

    #[test]
    fn every_damage_leaves_the_slot_before() {
        let dir = tempfile::tempdir().unwrap();
        let mut turn = Turn::default();
        keep(dir.path(), &mut turn, 10, &[1; 40]);
        keep(dir.path(), &mut turn, 20, &[2; 40]);
        let newest = dir.path().join(SLOTS[1]);
        let whole = fs::read(&newest).unwrap();
        let mut harms: Vec<Vec<u8>> = (0..whole.len()).step_by(7).map(|cut| whole[..cut].to_vec()).collect();
        for at in 0..whole.len() {
            let mut flipped = whole.clone();
            flipped[at] ^= 1 << (at % 8);
            harms.push(flipped);
        }
        for harm in harms {
            fs::write(&newest, &harm).unwrap();
            let (found, next, damaged) = load(dir.path(), "ab");
            assert_eq!(found.unwrap().state, [1; 40]);
            assert_eq!(next.free, 1, "the damaged slot is next");
            assert_eq!(damaged, std::slice::from_ref(&newest));
        }
    }

    #[test]
    fn a_failed_write_leaves_both_slots() {
        let dir = tempfile::tempdir().unwrap();
        let mut turn = Turn::default();
        keep(dir.path(), &mut turn, 10, &[1; 40]);
        let full = |to: &mut dyn Write| {
            to.write_all(&[9; 10])?;
            Err(io::ErrorKind::StorageFull.into())
        };
        let before = turn;
        assert!(save(dir.path(), "ab", &mut turn, &standing(20), &full).unwrap_err().is_full());
        assert_eq!(turn, before);
        assert_eq!(load(dir.path(), "ab").0.unwrap().standing, standing(10));
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1);
        assert!(!save(dir.path(), "ab", &mut turn, &standing(20), &|_| Ok(false)).unwrap());
        assert_eq!(fs::read_dir(dir.path()).unwrap().count(), 1, "what cannot be saved leaves nothing");
    }
}
