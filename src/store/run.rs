//! The folder of one run while it is being filled.

use std::fs::{self, File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::{StoreError, checkpoint, failure, rows, seal, write};
use crate::experiment::WaveRow;

/// The folder of a run's layers inside the run's own.
pub const FILMS: &str = "films";

/// The files of a reference's two independent halves.
pub const HALVES: [&str; 2] = ["half-a.exr", "half-b.exr"];

/// The file of a reference's standard error: the square root of the variance of each pixel's mean.
pub const NOISE: &str = "noise.exr";

/// Writes one run's files. Its last act is [`RunWriter::finish`]; without it the run counts as not done.
#[derive(Debug)]
pub struct RunWriter {
    folder: PathBuf,
    marker: &'static str,
    metrics: Option<File>,
    /// Bytes of whole lines in `metrics.csv`.
    whole: u64,
    columns: usize,
}

impl RunWriter {
    /// Makes the folder of a cell, removes what an unfinished run left in it beyond the given number of samples per
    /// pixel, from which it goes on, and writes `config.json`.
    pub(super) fn create(folder: PathBuf, config: &Json, kept: Option<u64>) -> Result<RunWriter, StoreError> {
        let writer = RunWriter::shared(folder, "done.json", config)?;
        let entries = fs::read_dir(&writer.folder).map_err(|e| StoreError::io("read", &writer.folder, &e))?;
        let films = fs::read_dir(writer.folder.join(FILMS)).into_iter().flatten();
        let old = entries.flatten().map(|e| e.path()).filter(|p| is_result(p, kept));
        for path in old.chain(films.flatten().map(|e| e.path()).filter(|p| is_film(p))) {
            fs::remove_file(&path).map_err(|e| StoreError::io("remove", &path, &e))?;
        }
        Ok(writer)
    }

    /// Makes the folder of a reference and writes `config.json`. What is there stays until it is replaced: another
    /// experiment may be reading it at this moment.
    pub(super) fn shared(folder: PathBuf, marker: &'static str, config: &Json) -> Result<RunWriter, StoreError> {
        fs::create_dir_all(&folder).map_err(|e| StoreError::io("create", &folder, &e))?;
        // Whoever writes here has the run to itself.
        write::sweep_temporaries(&folder);
        let writer = RunWriter { folder, marker, metrics: None, whole: 0, columns: 0 };
        writer.write("config.json", pretty(config).as_bytes())?;
        Ok(writer)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Starts `metrics.csv` with the columns that every row will have, and the rows that there are already.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn open_metrics(&mut self, columns: &[&str], before: &[WaveRow]) -> Result<(), StoreError> {
        let path = self.folder.join("metrics.csv");
        let mut file = File::create(&path).map_err(|e| StoreError::io("create", &path, &e))?;
        let text = rows::header(columns.iter().copied()) + &before.iter().map(rows::line).collect::<String>();
        file.write_all(text.as_bytes()).map_err(|e| StoreError::io("write", &path, &e))?;
        self.columns = columns.len();
        self.whole = text.len() as u64;
        self.metrics = Some(file);
        Ok(())
    }

    /// Appends a row to `metrics.csv`; readers see it at once.
    ///
    /// # Errors
    /// When the file is not open, cannot be written, or the row has another number of metrics than the header.
    pub fn append_row(&mut self, row: &WaveRow) -> Result<(), StoreError> {
        let path = self.folder.join("metrics.csv");
        let refuse = |reason: String| StoreError::Io { action: "append to", path: path.clone(), reason, full: false };
        let file = self.metrics.as_mut().ok_or_else(|| refuse("it was never opened".into()))?;
        if row.metrics.len() != self.columns {
            return Err(refuse(format!("a row of {} metrics, a header of {}", row.metrics.len(), self.columns)));
        }
        let line = rows::line(row);
        // What an earlier try left of a line is written over.
        let written = file.set_len(self.whole).and_then(|()| file.seek(SeekFrom::Start(self.whole)));
        written.and_then(|_| file.write_all(line.as_bytes())).map_err(|e| StoreError::io("write", &path, &e))?;
        self.whole += line.len() as u64;
        Ok(())
    }

    /// Writes `metrics.csv` whole, without metric columns: for references, whose folder may have two writers.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_rows(&self, rows: &[WaveRow]) -> Result<(), StoreError> {
        let bare = |row: &WaveRow| rows::line(&WaveRow { metrics: Vec::new(), ..row.clone() });
        let text = rows::header([]) + &rows.iter().map(bare).collect::<String>();
        self.write("metrics.csv", text.as_bytes())
    }

    /// Writes a file of the run whole.
    ///
    /// # Errors
    /// When it cannot be written; nothing is then left under its name.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        write::atomic(&self.folder.join(name), bytes)
    }

    /// Opens `log.txt` for appending.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open_log(&self) -> Result<File, StoreError> {
        let path = self.folder.join("log.txt");
        OpenOptions::new().create(true).append(true).open(&path).map_err(|e| StoreError::io("write", &path, &e))
    }

    /// Declares the run done: syncs the measurements, then writes `done.json` (`ref.json` for a reference) with the
    /// hashes of all files. Checkpoints, and the record of an earlier failure, are then needed no more.
    ///
    /// # Errors
    /// When a file cannot be written; the run then counts as not done.
    pub fn finish(&self, done: &Json) -> Result<(), StoreError> {
        if let Some(metrics) = &self.metrics {
            metrics.sync_all().map_err(|e| StoreError::io("write", &self.folder.join("metrics.csv"), &e))?;
        }
        let sealed = seal::seal(&self.folder, done).map_err(|e| StoreError::io("seal", &self.folder, &e))?;
        self.write(self.marker, pretty(&sealed).as_bytes())?;
        checkpoint::remove(&self.folder);
        failure::forget(&self.folder);
        Ok(())
    }
}

/// Whether a file in a run's folder is the result of a rendering, so that the next rendering replaces it.
///
/// What goes on from a checkpoint after some samples per pixel keeps its log and the snapshots up to there.
fn is_result(path: &Path, kept: Option<u64>) -> bool {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let snapshot = name.strip_prefix("snap-").and_then(|n| n.strip_suffix(".exr").or_else(|| n.strip_suffix(".png")));
    let beyond =
        snapshot.is_some_and(|samples| samples.parse::<u64>().map_or(true, |samples| samples > kept.unwrap_or(0)));
    let fixed = ["done.json", "metrics.csv", "final.exr", "final.png"].contains(&name);
    let fresh = kept.is_none() && (name == "log.txt" || checkpoint::SLOTS.contains(&name));
    path.is_file() && (beyond || fixed || fresh || write::is_temporary(name))
}

/// Whether a file in the folder of layers is one of ours.
fn is_film(path: &Path) -> bool {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let ours = [".exr", ".png"].iter().any(|end| name.ends_with(end)) || name.starts_with("time-");
    path.is_file() && (ours || write::is_temporary(name))
}

/// JSON for people, with a line end.
pub(super) fn pretty(json: &Json) -> String {
    format!("{json:#}\n")
}
