//! The folder of one run while it is being filled.

use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

use serde_json::Value as Json;

use super::{StoreError, rows, write};
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
    columns: usize,
}

impl RunWriter {
    /// Makes the folder of a cell, removes what an unfinished run left in it, and writes `config.json`.
    pub(super) fn create(folder: PathBuf, config: &Json) -> Result<RunWriter, StoreError> {
        let writer = RunWriter::shared(folder, "done.json", config)?;
        let entries = fs::read_dir(&writer.folder).map_err(|e| StoreError::io("read", &writer.folder, &e))?;
        let films = fs::read_dir(writer.folder.join(FILMS)).into_iter().flatten();
        let old = entries.flatten().map(|e| e.path()).filter(|p| is_result(p));
        for path in old.chain(films.flatten().map(|e| e.path()).filter(|p| is_film(p))) {
            fs::remove_file(&path).map_err(|e| StoreError::io("remove", &path, &e))?;
        }
        Ok(writer)
    }

    /// Makes the folder of a reference and writes `config.json`. Nothing is removed: another experiment may be
    /// rendering the same reference at this moment, and what both write is the same.
    pub(super) fn shared(folder: PathBuf, marker: &'static str, config: &Json) -> Result<RunWriter, StoreError> {
        fs::create_dir_all(&folder).map_err(|e| StoreError::io("create", &folder, &e))?;
        let writer = RunWriter { folder, marker, metrics: None, columns: 0 };
        writer.write("config.json", pretty(config).as_bytes())?;
        Ok(writer)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Starts `metrics.csv` with the columns that every row will have.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn open_metrics(&mut self, columns: &[&str]) -> Result<(), StoreError> {
        let path = self.folder.join("metrics.csv");
        let mut file = File::create(&path).map_err(|e| StoreError::io("create", &path, &e))?;
        let header = rows::header(columns.iter().copied());
        file.write_all(header.as_bytes()).map_err(|e| StoreError::io("write", &path, &e))?;
        self.columns = columns.len();
        self.metrics = Some(file);
        Ok(())
    }

    /// Appends a row to `metrics.csv`; readers see it at once.
    ///
    /// # Errors
    /// When the file is not open, cannot be written, or the row has another number of metrics than the header.
    pub fn append_row(&mut self, row: &WaveRow) -> Result<(), StoreError> {
        let path = self.folder.join("metrics.csv");
        let refuse = |reason: String| StoreError::Io { action: "append to", path: path.clone(), reason };
        let file = self.metrics.as_mut().ok_or_else(|| refuse("it was never opened".into()))?;
        if row.metrics.len() != self.columns {
            return Err(refuse(format!("a row of {} metrics, a header of {}", row.metrics.len(), self.columns)));
        }
        file.write_all(rows::line(row).as_bytes()).map_err(|e| StoreError::io("write", &path, &e))
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

    /// Declares the run done: syncs the measurements, then writes `done.json` (`ref.json` for a reference).
    ///
    /// # Errors
    /// When a file cannot be written; the run then counts as not done.
    pub fn finish(self, done: &Json) -> Result<(), StoreError> {
        if let Some(metrics) = &self.metrics {
            metrics.sync_all().map_err(|e| StoreError::io("write", &self.folder.join("metrics.csv"), &e))?;
        }
        self.write(self.marker, pretty(done).as_bytes())
    }
}

/// Whether a file in a run's folder is the result of a rendering, so that the next rendering replaces it.
fn is_result(path: &Path) -> bool {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    let snapshot = name.starts_with("snap-") && name.ends_with(".exr");
    let fixed = ["done.json", "metrics.csv", "log.txt", "final.exr", "final.png"].contains(&name);
    path.is_file() && (snapshot || fixed || write::is_temporary(name))
}

/// Whether a file in the folder of layers is one of ours.
fn is_film(path: &Path) -> bool {
    let name = path.file_name().and_then(|n| n.to_str()).unwrap_or_default();
    path.is_file() && (name.ends_with(".exr") || name.ends_with(".png") || write::is_temporary(name))
}

/// JSON for people, with a line end.
pub(super) fn pretty(json: &Json) -> String {
    format!("{json:#}\n")
}
