//! Writes the folder of one run or reference.

use std::fs::{self, File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use super::{atomic, checkpoint, failure, manifest_checksum, metrics_csv};
use crate::experiment::WaveRow;
use crate::store::schema::StoredFile;
use crate::store::schema::run::{ConfigFile, DONE, DoneFile};
use crate::store::{FILMS, StoreError, regular_file};

/// File names of a reference's two independent halves.
pub const HALVES: [&str; 2] = ["half-a.exr", "half-b.exr"];

/// File name of a reference's standard error image: the square root of the variance of each pixel's
/// mean.
pub const NOISE: &str = "noise.exr";

/// File name of the mean of the samples of a run whose pictures are denoised.
pub const RAW: &str = "raw.exr";

/// Writer of one run's files. [`RunWriter::finish`] comes last; without it the run is incomplete.
#[derive(Debug)]
pub struct RunWriter {
    folder: PathBuf,
    marker: &'static str,
    metrics: Option<File>,
    /// Number of bytes of complete lines in `metrics.csv`.
    complete_bytes: u64,
    columns: usize,
}

impl RunWriter {
    /// Creates the folder of a cell, removes results of an unfinished attempt, and writes
    /// `config.json`. `resumed_samples` is the number of samples per pixel of the checkpoint that
    /// the run resumes from, if any; snapshots up to there stay.
    pub(crate) fn create(
        folder: PathBuf,
        config: &ConfigFile,
        resumed_samples: Option<u64>,
    ) -> Result<RunWriter, StoreError> {
        let writer = RunWriter::shared(folder, DONE, config)?;
        let entries =
            fs::read_dir(&writer.folder).map_err(|e| StoreError::io("read", &writer.folder, &e))?;
        let films = fs::read_dir(writer.folder.join(FILMS))
            .into_iter()
            .flatten();
        let old = entries
            .flatten()
            .map(|e| e.path())
            .filter(|p| is_result(p, resumed_samples));
        for path in old.chain(films.flatten().map(|e| e.path()).filter(|p| is_film(p))) {
            fs::remove_file(&path).map_err(|e| StoreError::io("remove", &path, &e))?;
        }
        Ok(writer)
    }

    /// Creates the folder of a reference and writes `config.json`. Existing files stay until they
    /// are replaced, since another experiment may be reading them.
    pub(crate) fn shared(
        folder: PathBuf,
        marker: &'static str,
        config: &ConfigFile,
    ) -> Result<RunWriter, StoreError> {
        fs::create_dir_all(&folder).map_err(|e| StoreError::io("create", &folder, &e))?;
        // The caller has claimed the run, so no other process writes here.
        atomic::remove_temporaries(&folder);
        let writer = RunWriter {
            folder,
            marker,
            metrics: None,
            complete_bytes: 0,
            columns: 0,
        };
        writer.write(ConfigFile::NAME, config.text().as_bytes())?;
        Ok(writer)
    }

    /// Folder of the run.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Creates `metrics.csv` with the metric columns that every row will have, and with the rows
    /// measured before a checkpoint.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn open_metrics(&mut self, columns: &[&str], before: &[WaveRow]) -> Result<(), StoreError> {
        let path = self.folder.join(metrics_csv::FILE);
        let mut file = regular_file::open_with(
            OpenOptions::new().write(true).create(true).truncate(true),
            &path,
        )
        .map_err(|e| StoreError::io("create", &path, &e))?;
        let text = metrics_csv::header(columns.iter().copied())
            + &before.iter().map(metrics_csv::line).collect::<String>();
        file.write_all(text.as_bytes())
            .map_err(|e| StoreError::io("write", &path, &e))?;
        self.columns = columns.len();
        self.complete_bytes = text.len() as u64;
        self.metrics = Some(file);
        Ok(())
    }

    /// Appends a row to `metrics.csv`. Readers see it at once.
    ///
    /// # Errors
    /// When the file is not open or cannot be written, or when the row and the header differ in
    /// their number of metrics.
    pub fn append_row(&mut self, row: &WaveRow) -> Result<(), StoreError> {
        let path = self.folder.join(metrics_csv::FILE);
        let refuse = |reason: String| StoreError::Io {
            action: "append to",
            path: path.clone(),
            reason,
            full: false,
        };
        let file = self
            .metrics
            .as_mut()
            .ok_or_else(|| refuse("the file is not open".into()))?;
        if row.metrics.len() != self.columns {
            return Err(refuse(format!(
                "the row has {} metrics, the header {}",
                row.metrics.len(),
                self.columns
            )));
        }
        let line = metrics_csv::line(row);
        // Overwrites what a failed attempt left of a line.
        let written = file
            .set_len(self.complete_bytes)
            .and_then(|()| file.seek(SeekFrom::Start(self.complete_bytes)));
        written
            .and_then(|_| file.write_all(line.as_bytes()))
            .map_err(|e| StoreError::io("write", &path, &e))?;
        self.complete_bytes += line.len() as u64;
        Ok(())
    }

    /// Writes `metrics.csv` atomically, without metric columns. Used for references, whose folder
    /// may have two writers.
    ///
    /// # Errors
    /// When the file cannot be written.
    pub fn write_rows(&self, rows: &[WaveRow]) -> Result<(), StoreError> {
        let without_metrics = |row: &WaveRow| {
            metrics_csv::line(&WaveRow {
                metrics: Vec::new(),
                ..row.clone()
            })
        };
        let text = metrics_csv::header([]) + &rows.iter().map(without_metrics).collect::<String>();
        self.write(metrics_csv::FILE, text.as_bytes())
    }

    /// Writes a file of the run atomically. It survives a power failure once the run is finished.
    ///
    /// # Errors
    /// When it cannot be written; an existing file is then unchanged.
    pub fn write(&self, name: &str, bytes: &[u8]) -> Result<(), StoreError> {
        atomic::write_before_others(&self.folder.join(name), bytes)
    }

    /// Opens `log.txt` for appending.
    ///
    /// # Errors
    /// When it cannot be opened.
    pub fn open_log(&self) -> Result<File, StoreError> {
        let path = self.folder.join("log.txt");
        regular_file::open_with(OpenOptions::new().create(true).append(true), &path)
            .map_err(|e| StoreError::io("write", &path, &e))
    }

    /// Finishes the run: syncs the measurements, then writes `done.json` (`ref.json` for a
    /// reference) with sizes and hashes of all files. Removes checkpoints, the record of
    /// an earlier failure and temporary files.
    ///
    /// # Errors
    /// When a file cannot be written; the run is then incomplete.
    pub fn finish(&self, done: &DoneFile) -> Result<(), StoreError> {
        if let Some(metrics) = &self.metrics {
            metrics
                .sync_all()
                .map_err(|e| StoreError::io("write", &self.folder.join(metrics_csv::FILE), &e))?;
        }
        let manifest = manifest_checksum::add_checksums(&self.folder, done)
            .map_err(|e| StoreError::io("compute checksums of", &self.folder, &e))?;
        let films = self.folder.join(FILMS);
        if films.is_dir() {
            atomic::sync_folder(&films).map_err(|e| StoreError::io("write", &films, &e))?;
        }
        let marker = self.folder.join(self.marker);
        atomic::write_atomically(&marker, manifest.text().as_bytes())?;
        checkpoint::remove(&self.folder);
        failure::remove(&self.folder);
        // A process that was killed while it tried to claim the run left one.
        atomic::remove_temporaries(&self.folder);
        Ok(())
    }
}

/// Whether a file in a run's folder is a result that the next attempt replaces. A run that resumes
/// from a checkpoint keeps its log, and its snapshots up to `resumed_samples` samples per pixel.
fn is_result(path: &Path, resumed_samples: Option<u64>) -> bool {
    let name = path
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or_default();
    let snapshot = name
        .strip_prefix("snap-")
        .and_then(|n| n.strip_suffix(".exr").or_else(|| n.strip_suffix(".png")));
    let beyond = snapshot.is_some_and(|samples| {
        samples
            .parse::<u64>()
            .map_or(true, |samples| samples > resumed_samples.unwrap_or(0))
    });
    let fixed = [DONE, metrics_csv::FILE, "final.exr", "final.png"].contains(&name);
    let fresh =
        resumed_samples.is_none() && (name == "log.txt" || checkpoint::SLOTS.contains(&name));
    path.is_file() && (beyond || fixed || fresh || atomic::is_temporary(name))
}

/// Whether a file in the folder of layer images was written by Lumbre.
fn is_film(path: &Path) -> bool {
    let name = path
        .file_name()
        .and_then(|n| n.to_str())
        .unwrap_or_default();
    let written_here =
        [".exr", ".png"].iter().any(|end| name.ends_with(end)) || name.starts_with("time-");
    path.is_file() && (written_here || atomic::is_temporary(name))
}
