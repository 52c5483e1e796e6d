//! Index of finished runs: `out/index.sqlite` holds their results, so that ten thousand runs are
//! listed without opening ten thousand files.
//!
//! The index is a cache. An entry counts only while the run's last file has the size and
//! modification time that it was made from, so deleted, copied and re-rendered runs are noticed. An
//! index that is missing, damaged or of another version is rebuilt from the folders. If the index
//! cannot be written, the folders are read every time.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rusqlite::{Connection, params};
use serde_json::Value as Json;

use super::archive::read_json;
use crate::store::layout;
use crate::store::lock::filesystem_kind;
use crate::store::worker::registry;

/// Version of the table, incremented with every change.
const VERSION: i64 = 1;

const TABLE: &str = "CREATE TABLE runs (
    place TEXT PRIMARY KEY, changed INTEGER NOT NULL, size INTEGER NOT NULL,
    run TEXT NOT NULL, reason TEXT NOT NULL, samples INTEGER, render_s REAL, finished TEXT,
    metrics TEXT NOT NULL
) WITHOUT ROWID";

/// Results of a finished run, as in its last file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FinishedSummary {
    /// Id of the run.
    pub run: String,
    /// Reason that it ended.
    pub reason: String,
    /// Samples per pixel.
    pub samples: Option<u64>,
    /// Render time in seconds.
    pub render_s: Option<f64>,
    /// Date of the end, as [`utc`](crate::store::utc) writes it.
    pub finished: Option<String>,
    /// Final metrics by column, as a JSON object.
    pub metrics: String,
}

impl FinishedSummary {
    fn from_done(done: &Json) -> FinishedSummary {
        let text = |key: &str| done[key].as_str().map(str::to_owned);
        FinishedSummary {
            run: text("run").unwrap_or_default(),
            reason: text("reason").unwrap_or_default(),
            samples: done["samples"].as_u64(),
            render_s: done["render_s"].as_f64(),
            finished: text("finished"),
            metrics: if done["metrics"].is_object() {
                done["metrics"].to_string()
            } else {
                "{}".to_owned()
            },
        }
    }
}

/// Modification time of a file in nanoseconds since 1970, and its size in bytes.
type FileStamp = (i64, i64);

/// Index of one output folder.
#[derive(Debug)]
pub(crate) struct RunIndex {
    out: PathBuf,
    database: Option<Connection>,
    known: BTreeMap<String, (FileStamp, FinishedSummary)>,
    /// Folders whose entries are not in the database yet.
    new_entries: Vec<String>,
}

impl RunIndex {
    /// Path of the index of `out`: inside it, unless other machines use it too. SQLite's locks do
    /// not work across machines, so each user then has an index in the cache folder.
    pub(crate) fn path_for(out: &Path) -> PathBuf {
        let shared = filesystem_kind::detect(out)
            .is_some_and(|kind| filesystem_kind::is_network(&kind))
            || has_workers(out);
        let cache = shared.then(cache_folder).flatten();
        match cache.zip(out.canonicalize().ok()) {
            Some((cache, real)) => {
                let name = blake3::hash(real.as_os_str().as_encoded_bytes()).to_hex();
                cache.join(format!("index-{}.sqlite", &name[..16]))
            }
            None => out.join("index.sqlite"),
        }
    }

    /// Opens the index of `out`, or creates it if possible.
    pub(crate) fn open(out: &Path) -> RunIndex {
        let mut index = RunIndex {
            out: out.to_owned(),
            database: None,
            known: BTreeMap::new(),
            new_entries: Vec::new(),
        };
        if !out.is_dir() {
            return index;
        }
        let path = RunIndex::path_for(out);
        let opened = load(&path).or_else(|first| {
            tracing::debug!("rebuilding the index: {first}");
            // The index is damaged or of another version; the folders hold all of its content.
            let _ = fs::remove_file(&path);
            load(&path)
        });
        match opened {
            Ok((file, known)) => (index.database, index.known) = (Some(file), known),
            Err(e) => tracing::debug!("cannot open the index: {e}"),
        }
        index
    }

    /// Results of a finished run, by its folder and the name of its last file. Returns `None` if it
    /// is not finished.
    pub(crate) fn finished(&mut self, folder: &Path, marker: &str) -> Option<FinishedSummary> {
        let file = folder.join(marker);
        let facts = fs::metadata(&file).ok().filter(fs::Metadata::is_file)?;
        let stamp = file_stamp(&facts);
        let key = folder
            .strip_prefix(&self.out)
            .unwrap_or(folder)
            .to_string_lossy()
            .into_owned();
        if let Some((known, finished)) = self.known.get(&key)
            && *known == stamp
        {
            return Some(finished.clone());
        }
        let finished = FinishedSummary::from_done(&read_json(&file)?);
        self.known.insert(key.clone(), (stamp, finished.clone()));
        self.new_entries.push(key);
        Some(finished)
    }

    /// Writes new entries to the database. A failure only costs the next reader time.
    pub(crate) fn save(mut self) {
        let Some(mut file) = self
            .database
            .take()
            .filter(|_| !self.new_entries.is_empty())
        else {
            return;
        };
        if let Err(e) = self.write(&mut file) {
            tracing::debug!("cannot update the index: {e}");
        }
    }

    fn write(&self, file: &mut Connection) -> rusqlite::Result<()> {
        let transaction = file.transaction()?;
        {
            let mut insert = transaction.prepare(
                "INSERT OR REPLACE INTO runs VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)",
            )?;
            for key in &self.new_entries {
                let Some(((changed, size), f)) = self.known.get(key) else {
                    continue;
                };
                let samples = f.samples.and_then(|n| i64::try_from(n).ok());
                insert.execute(params![
                    key, changed, size, f.run, f.reason, samples, f.render_s, f.finished, f.metrics
                ])?;
            }
        }
        transaction.commit()
    }
}

/// Whether any night below `out` had workers.
fn has_workers(out: &Path) -> bool {
    layout::folders_in(out)
        .iter()
        .any(|night| night.join(registry::FOLDER).is_dir())
}

/// Cache folder of this program, which is created. Returns `None` if the user has none.
fn cache_folder() -> Option<PathBuf> {
    let given = |name: &str| {
        std::env::var_os(name)
            .filter(|value| !value.is_empty())
            .map(PathBuf::from)
    };
    let caches = given("XDG_CACHE_HOME").or_else(|| Some(given("HOME")?.join(".cache")))?;
    let folder = caches.join("lumbre");
    fs::create_dir_all(&folder).is_ok().then_some(folder)
}

fn file_stamp(facts: &fs::Metadata) -> FileStamp {
    let changed = facts
        .modified()
        .ok()
        .and_then(|t| t.duration_since(SystemTime::UNIX_EPOCH).ok());
    let nanoseconds = changed.map_or(0, |d| d.as_nanos());
    (
        i64::try_from(nanoseconds).unwrap_or(i64::MAX),
        i64::try_from(facts.len()).unwrap_or(i64::MAX),
    )
}

type Loaded = (Connection, BTreeMap<String, (FileStamp, FinishedSummary)>);

/// Opens the database, creates its table if it is new, and reads it.
fn load(path: &Path) -> rusqlite::Result<Loaded> {
    let file = Connection::open(path)?;
    // Concurrent readers wait for each other. A lost update does no harm.
    file.busy_timeout(Duration::from_millis(200))?;
    match file.query_row("PRAGMA user_version", [], |row| row.get(0))? {
        VERSION => {}
        0i64 => {
            file.execute_batch(TABLE)?;
            file.pragma_update(None, "user_version", VERSION)?;
        }
        _ => return Err(rusqlite::Error::InvalidQuery),
    }
    let mut known = BTreeMap::new();
    {
        let mut all = file.prepare("SELECT * FROM runs")?;
        let mut rows = all.query([])?;
        while let Some(row) = rows.next()? {
            let finished = FinishedSummary {
                run: row.get(3)?,
                reason: row.get(4)?,
                samples: row
                    .get::<_, Option<i64>>(5)?
                    .and_then(|n| u64::try_from(n).ok()),
                render_s: row.get(6)?,
                finished: row.get(7)?,
                metrics: row.get(8)?,
            };
            known.insert(row.get(0)?, ((row.get(1)?, row.get(2)?), finished));
        }
    }
    Ok((file, known))
}

#[cfg(test)]
mod tests {
    use crate::store::read::run_index::*;
    use std::fs::write;

    fn run(out: &Path, name: &str, reason: &str) -> PathBuf {
        let folder = out.join("night-3f9a/runs").join(name);
        fs::create_dir_all(&folder).unwrap();
        let done = format!(
            r#"{{"run":"{name}","reason":"{reason}","samples":4,"metrics":{{"rmse":0.5}}}}"#
        );
        write(folder.join("done.json"), done).unwrap();
        folder
    }

    fn reason(index: &mut RunIndex, folder: &Path) -> Option<String> {
        index.finished(folder, "done.json").map(|f| f.reason)
    }

    #[test]
    fn the_folders_decide_and_not_the_index() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (
            run(dir.path(), "aa", "long enough"),
            run(dir.path(), "bb", "samples"),
        );
        let mut index = RunIndex::open(dir.path());
        assert_eq!(reason(&mut index, &a).unwrap(), "long enough");
        assert_eq!(
            index.finished(&b, "done.json").unwrap().metrics,
            r#"{"rmse":0.5}"#
        );
        assert_eq!(index.new_entries.len(), 2);
        index.save();

        let mut index = RunIndex::open(dir.path());
        assert_eq!(reason(&mut index, &a).unwrap(), "long enough");
        assert!(index.new_entries.is_empty(), "no file had to be read");
        run(dir.path(), "aa", "rendered again, for longer");
        fs::remove_file(b.join("done.json")).unwrap();
        assert_eq!(
            reason(&mut index, &a).unwrap(),
            "rendered again, for longer"
        );
        assert_eq!(reason(&mut index, &b), None, "it is no longer done");
        index.save();
        assert_eq!(
            reason(&mut RunIndex::open(dir.path()), &a).unwrap(),
            "rendered again, for longer"
        );
    }

    #[test]
    fn a_damaged_or_foreign_index_is_rebuilt() {
        let dir = tempfile::tempdir().unwrap();
        let folder = run(dir.path(), "aa", "samples");
        let count_new_entries = || {
            let mut index = RunIndex::open(dir.path());
            assert_eq!(reason(&mut index, &folder).unwrap(), "samples");
            let count = index.new_entries.len();
            index.save();
            count
        };
        assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        for damage in [&[b'x'; 120][..], b""] {
            write(RunIndex::path_for(dir.path()), damage).unwrap();
            assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        }
        Connection::open(RunIndex::path_for(dir.path()))
            .unwrap()
            .pragma_update(None, "user_version", 99)
            .unwrap();
        assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        let nowhere = dir.path().join("nowhere");
        assert!(
            RunIndex::open(&nowhere).database.is_none() && !nowhere.exists(),
            "reading creates no folders"
        );
    }
}
