//! Access to the folder of one run or reference. Nothing here writes or locks.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use crate::experiment::WaveRow;
use crate::store::schema::run::{BiasCheckFile, ConfigFile, DoneFile, FailedFile};
use crate::store::schema::{ReadError, StoredFile};
use crate::store::write::{checkpoint, failure, manifest_checksum, metrics_csv};
use crate::store::{BIAS_CHECK_PREFIX, FILMS, StoreError, layout, regular_file};

/// Folder of a run or a reference.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct RunReader {
    folder: PathBuf,
}

/// Measurements of a run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Measurements {
    /// Names of the metric columns.
    pub columns: Vec<String>,
    /// Measurements, oldest first, with the metrics in the order of the columns.
    pub rows: Vec<WaveRow>,
}

/// Integrity of a run's folder.
#[derive(Clone, Debug, PartialEq)]
pub enum Integrity {
    /// The run is finished, for this reason, and every file matches its checksum.
    Intact(String),
    /// The run is finished, but a file is missing or changed; holds a description.
    Damaged(String),
    /// The run is not finished.
    Unfinished {
        /// Record of its last attempt, if that failed.
        failure: Option<FailedFile>,
        /// Samples per pixel of the checkpoint that it resumes from, if there is one.
        checkpoint: Option<u64>,
    },
}

impl RunReader {
    /// Reader of a folder, which need not exist.
    pub fn new(folder: PathBuf) -> RunReader {
        RunReader { folder }
    }

    /// Folder of the run.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Place of the run in its plan, and its settings.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn config(&self) -> Result<ConfigFile, ReadError> {
        ConfigFile::read(&self.folder)
    }

    /// Results of the run; `None` if it is not finished.
    ///
    /// # Errors
    /// When they cannot be read.
    pub fn done(&self) -> Result<Option<DoneFile>, ReadError> {
        DoneFile::find(&self.folder)
    }

    /// Results of the run, if all files that they list are there with their sizes; `None` if it is
    /// not finished.
    ///
    /// # Errors
    /// Description of the first problem.
    pub fn checked(&self) -> Result<Option<DoneFile>, String> {
        let Some(done) = self.manifest()? else {
            return Ok(None);
        };
        manifest_checksum::verify_sizes(&self.folder, &done)?;
        Ok(Some(done))
    }

    /// Results of the run with this id, if every file that they list matches its checksum; `None`
    /// if it is not finished.
    ///
    /// # Errors
    /// Description of the first problem.
    pub fn verified(&self, id: &str) -> Result<Option<DoneFile>, String> {
        let Some(done) = self.manifest()? else {
            return Ok(None);
        };
        if done.run() != id {
            let marker = layout::done_file(&self.folder).unwrap_or_default();
            return Err(format!("{marker} belongs to another run"));
        }
        manifest_checksum::verify_hashes(&self.folder, &done)?;
        Ok(Some(done))
    }

    /// Results of the run, or a description of why they cannot be read.
    pub(super) fn manifest(&self) -> Result<Option<DoneFile>, String> {
        self.done().map_err(|e| describe(&e))
    }

    /// Record of the last attempt, if it failed.
    pub fn failure(&self) -> Option<FailedFile> {
        failure::read(&self.folder)
    }

    /// Results of comparing the reference in this folder with other techniques, by file name.
    ///
    /// # Errors
    /// When one of them cannot be read.
    pub fn bias_checks(&self) -> Result<Vec<BiasCheckFile>, ReadError> {
        let entries = fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let is_check = |path: &PathBuf| {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            name.starts_with(BIAS_CHECK_PREFIX) && name.ends_with(".json")
        };
        let mut paths: Vec<PathBuf> = entries.map(|e| e.path()).filter(is_check).collect();
        paths.sort();
        let read = |path: &PathBuf| BiasCheckFile::read_from(path);
        paths.iter().map(read).collect()
    }

    /// Measurements of the run; none if its file is missing or has no complete line. `done` is how
    /// it ended: it names the first invalid sample, and the file has to match its checksum.
    ///
    /// # Errors
    /// When the file is damaged; the text is a description that names it.
    pub fn measurements(&self, done: Option<&DoneFile>) -> Result<Measurements, String> {
        let csv = match done.and_then(|done| done.files().get(metrics_csv::FILE)) {
            Some(sum) => manifest_checksum::read(&self.folder, metrics_csv::FILE, sum)?,
            None => regular_file::read(&self.folder.join(metrics_csv::FILE)).unwrap_or_default(),
        };
        let csv = match String::from_utf8(csv) {
            Ok(csv) if csv.contains('\n') => csv,
            _ => return Ok(Measurements::default()),
        };
        let damaged = |problem| format!("{} is damaged: {problem}", metrics_csv::FILE);
        let (columns, mut rows) = metrics_csv::parse(&csv).map_err(damaged)?;
        let first_invalid = done
            .and_then(DoneFile::rendered)
            .and_then(|results| results.first_invalid);
        rows.iter_mut()
            .filter(|row| row.invalid > 0)
            .for_each(|row| row.first_invalid = first_invalid);
        Ok(Measurements { columns, rows })
    }

    /// Stored images of the run in ascending order of samples per pixel; the last one is its final
    /// picture, if it is finished. Images that `done` does not list are no images of the run.
    pub fn pictures(&self, done: Option<&DoneFile>) -> Vec<(u64, PathBuf)> {
        let is_listed = |path: &Path| {
            let name = path.file_name().and_then(|name| name.to_str());
            done.is_none_or(|done| name.is_some_and(|name| done.files().contains_key(name)))
        };
        let mut found: BTreeMap<u64, PathBuf> = snapshots(&self.folder).into_iter().collect();
        found.retain(|_, path| is_listed(path));
        let last = self.folder.join("final.exr");
        let samples = done
            .and_then(DoneFile::rendered)
            .map(|results| results.samples);
        if let Some(samples) = samples.filter(|_| is_listed(&last)) {
            found.insert(samples, last);
        }
        found.into_iter().collect()
    }

    /// Names and sizes in bytes of the files, ordered by name.
    ///
    /// # Errors
    /// When the folder cannot be read.
    pub fn files(&self) -> Result<Vec<(String, u64)>, StoreError> {
        let list = |folder: &Path, prefix: &str| -> io::Result<Vec<(String, u64)>> {
            let facts = |entry: fs::DirEntry| {
                let facts = entry.metadata().ok().filter(fs::Metadata::is_file)?;
                let name = format!("{prefix}{}", entry.file_name().to_string_lossy());
                Some((name, facts.len()))
            };
            Ok(fs::read_dir(folder)?.flatten().filter_map(facts).collect())
        };
        let own = list(&self.folder, "").map_err(|e| StoreError::io("read", &self.folder, &e))?;
        let films = list(&self.folder.join(FILMS), &format!("{FILMS}/")).unwrap_or_default();
        let mut files: Vec<(String, u64)> = own.into_iter().chain(films).collect();
        files.sort();
        Ok(files)
    }

    /// Checks every file of the run with this id against its checksum.
    pub fn integrity(&self, id: &str) -> Integrity {
        match self.verified(id) {
            Ok(Some(done)) => {
                let reason = done.rendered().map(|results| results.reason.clone());
                Integrity::Intact(reason.unwrap_or_default())
            }
            Ok(None) => Integrity::Unfinished {
                failure: self.failure(),
                checkpoint: checkpoint::samples(&self.folder, id),
            },
            Err(problem) => Integrity::Damaged(problem),
        }
    }
}

impl Measurements {
    /// Rows with the metrics of these columns, NaN where the file has none; without metrics if none
    /// were measured.
    pub fn in_order<'a>(self, columns: impl Iterator<Item = &'a str>) -> Vec<WaveRow> {
        let index = |column: &str| self.columns.iter().position(|name| name == column);
        let indices: Vec<Option<usize>> = columns.map(index).collect();
        let rows = self.rows.into_iter();
        rows.map(|row| reordered(row, &indices)).collect()
    }
}

/// Returns a row with its metrics at these indices, NaN where there is none; without metrics if none
/// were measured.
pub(crate) fn reordered(row: WaveRow, indices: &[Option<usize>]) -> WaveRow {
    let at = |index: &Option<usize>| {
        let value = index.and_then(|i| row.metrics.get(i)).copied();
        value.unwrap_or(f64::NAN)
    };
    let metrics = if row.metrics.is_empty() {
        Vec::new()
    } else {
        indices.iter().map(at).collect()
    };
    WaveRow { metrics, ..row }
}

/// Snapshots in a run's folder: samples per pixel and EXR file.
pub(crate) fn snapshots(folder: &Path) -> Vec<(u64, PathBuf)> {
    let entries = fs::read_dir(folder).into_iter().flatten().flatten();
    let samples = |entry: fs::DirEntry| {
        let name = entry.file_name();
        let samples = name.to_str()?.strip_prefix("snap-")?.strip_suffix(".exr")?;
        Some((samples.parse().ok()?, entry.path()))
    };
    entries.filter_map(samples).collect()
}

/// Describes a file of a run that cannot be read, by its name.
pub(crate) fn describe(error: &ReadError) -> String {
    let name = error.path.file_name().unwrap_or_default().to_string_lossy();
    format!("{name}{}", error.problem)
}
