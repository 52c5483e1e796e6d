//! `out/index.sqlite`: what every finished run says at its end, so that ten thousand of them are listed without opening
//! ten thousand files.
//!
//! It is a cache and never the truth. An entry counts only while the run's last file has the size and the time of
//! change that the entry was made from, so a run that was deleted, copied or rendered again is seen at once; an index
//! that is missing, damaged or of another version is made anew from the folders; and where none can be written, the
//! folders are read as if there were none.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

use rusqlite::{Connection, params};
use serde_json::Value as Json;

use super::archive::read_json;
use super::{crew, layout, mount};

/// Raised with every change of the table.
const VERSION: i64 = 1;

const TABLE: &str = "CREATE TABLE runs (
    place TEXT PRIMARY KEY, changed INTEGER NOT NULL, size INTEGER NOT NULL,
    run TEXT NOT NULL, reason TEXT NOT NULL, samples INTEGER, render_s REAL, finished TEXT, metrics TEXT NOT NULL
) WITHOUT ROWID";

/// What a finished run says at its end.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finished {
    /// Its id.
    pub run: String,
    /// Why it ended.
    pub reason: String,
    /// Samples per pixel.
    pub samples: Option<u64>,
    /// Render time in seconds.
    pub render_s: Option<f64>,
    /// When, as [`super::utc`] writes it.
    pub finished: Option<String>,
    /// Its metrics by column, as a JSON object.
    pub metrics: String,
}

impl Finished {
    fn of(done: &Json) -> Finished {
        let text = |key: &str| done[key].as_str().map(str::to_owned);
        Finished {
            run: text("run").unwrap_or_default(),
            reason: text("reason").unwrap_or_default(),
            samples: done["samples"].as_u64(),
            render_s: done["render_s"].as_f64(),
            finished: text("finished"),
            metrics: if done["metrics"].is_object() { done["metrics"].to_string() } else { "{}".to_owned() },
        }
    }
}

/// Size and time of change of a file: nanoseconds since 1970.
type Stamp = (i64, i64);

/// The index of one `out/`.
#[derive(Debug)]
pub(super) struct Index {
    out: PathBuf,
    file: Option<Connection>,
    known: BTreeMap<String, (Stamp, Finished)>,
    /// Places whose entries are new.
    fresh: Vec<String>,
}

impl Index {
    /// Where the index of `out` lies: in it, unless other machines see it too. Locks of a database do not hold between
    /// machines, so there everybody has an index of their own, in the folder of caches.
    pub(super) fn place(out: &Path) -> PathBuf {
        let shared = mount::kind(out).is_some_and(|kind| mount::is_network(&kind)) || has_workers(out);
        let cache = shared.then(cache_folder).flatten();
        match cache.zip(out.canonicalize().ok()) {
            Some((cache, real)) => {
                let name = blake3::hash(real.as_os_str().as_encoded_bytes()).to_hex();
                cache.join(format!("index-{}.sqlite", &name[..16]))
            }
            None => out.join("index.sqlite"),
        }
    }

    /// Opens the index of `out`, or makes one if that is possible.
    pub(super) fn open(out: &Path) -> Index {
        let mut index = Index { out: out.to_owned(), file: None, known: BTreeMap::new(), fresh: Vec::new() };
        if !out.is_dir() {
            return index;
        }
        let place = Index::place(out);
        let opened = load(&place).or_else(|first| {
            tracing::debug!("the index is made anew: {first}");
            // Damaged, or of another version: the folders have all of it.
            let _ = fs::remove_file(&place);
            load(&place)
        });
        match opened {
            Ok((file, known)) => (index.file, index.known) = (Some(file), known),
            Err(e) => tracing::debug!("there is no index: {e}"),
        }
        index
    }

    /// What a finished run says, by its folder and the name of its last file; `None` if it is not finished.
    pub(super) fn finished(&mut self, folder: &Path, marker: &str) -> Option<Finished> {
        let file = folder.join(marker);
        let facts = fs::metadata(&file).ok().filter(fs::Metadata::is_file)?;
        let stamp = stamp(&facts);
        let place = folder.strip_prefix(&self.out).unwrap_or(folder).to_string_lossy().into_owned();
        if let Some((known, finished)) = self.known.get(&place)
            && *known == stamp
        {
            return Some(finished.clone());
        }
        let finished = Finished::of(&read_json(&file)?);
        self.known.insert(place.clone(), (stamp, finished.clone()));
        self.fresh.push(place);
        Some(finished)
    }

    /// Keeps what was read. Failing costs the next reader time and nothing else.
    pub(super) fn save(mut self) {
        let Some(mut file) = self.file.take().filter(|_| !self.fresh.is_empty()) else { return };
        if let Err(e) = self.write(&mut file) {
            tracing::debug!("the index was not updated: {e}");
        }
    }

    fn write(&self, file: &mut Connection) -> rusqlite::Result<()> {
        let transaction = file.transaction()?;
        {
            let mut insert =
                transaction.prepare("INSERT OR REPLACE INTO runs VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8, ?9)")?;
            for place in &self.fresh {
                let Some(((changed, size), f)) = self.known.get(place) else { continue };
                let samples = f.samples.and_then(|n| i64::try_from(n).ok());
                insert.execute(params![
                    place, changed, size, f.run, f.reason, samples, f.render_s, f.finished, f.metrics
                ])?;
            }
        }
        transaction.commit()
    }
}

/// Whether any night of a folder had workers.
fn has_workers(out: &Path) -> bool {
    layout::folders_in(out).iter().any(|night| night.join(crew::FOLDER).is_dir())
}

/// The user's folder of caches, made for this program; `None` where there is none.
fn cache_folder() -> Option<PathBuf> {
    let given = |name: &str| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    let caches = given("XDG_CACHE_HOME").or_else(|| Some(given("HOME")?.join(".cache")))?;
    let folder = caches.join("lumbre");
    fs::create_dir_all(&folder).is_ok().then_some(folder)
}

fn stamp(facts: &fs::Metadata) -> Stamp {
    let changed = facts.modified().ok().and_then(|t| t.duration_since(SystemTime::UNIX_EPOCH).ok());
    let nanoseconds = changed.map_or(0, |d| d.as_nanos());
    (i64::try_from(nanoseconds).unwrap_or(i64::MAX), i64::try_from(facts.len()).unwrap_or(i64::MAX))
}

type Loaded = (Connection, BTreeMap<String, (Stamp, Finished)>);

/// Opens the file, makes its table if it is new, and reads it.
fn load(place: &Path) -> rusqlite::Result<Loaded> {
    let file = Connection::open(place)?;
    // Two readers at once wait for each other; losing an update is no loss.
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
            let finished = Finished {
                run: row.get(3)?,
                reason: row.get(4)?,
                samples: row.get::<_, Option<i64>>(5)?.and_then(|n| u64::try_from(n).ok()),
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
    use super::*;
    use std::fs::write;

    fn run(out: &Path, name: &str, reason: &str) -> PathBuf {
        let folder = out.join("night-3f9a/runs").join(name);
        fs::create_dir_all(&folder).unwrap();
        let done = format!(r#"{{"run":"{name}","reason":"{reason}","samples":4,"metrics":{{"rmse":0.5}}}}"#);
        write(folder.join("done.json"), done).unwrap();
        folder
    }

    fn reason(index: &mut Index, folder: &Path) -> Option<String> {
        index.finished(folder, "done.json").map(|f| f.reason)
    }

    #[test]
    fn the_folders_are_the_truth_whatever_the_index_says() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (run(dir.path(), "aa", "long enough"), run(dir.path(), "bb", "samples"));
        let mut index = Index::open(dir.path());
        assert_eq!(reason(&mut index, &a).unwrap(), "long enough");
        assert_eq!(index.finished(&b, "done.json").unwrap().metrics, r#"{"rmse":0.5}"#);
        assert_eq!(index.fresh.len(), 2);
        index.save();

        let mut index = Index::open(dir.path());
        assert_eq!(reason(&mut index, &a).unwrap(), "long enough");
        assert!(index.fresh.is_empty(), "nothing had to be read");
        run(dir.path(), "aa", "rendered again, for longer");
        fs::remove_file(b.join("done.json")).unwrap();
        assert_eq!(reason(&mut index, &a).unwrap(), "rendered again, for longer");
        assert_eq!(reason(&mut index, &b), None, "it is no longer done");
        index.save();
        assert_eq!(reason(&mut Index::open(dir.path()), &a).unwrap(), "rendered again, for longer");
    }

    #[test]
    fn an_index_that_is_damaged_or_foreign_is_made_anew() {
        let dir = tempfile::tempdir().unwrap();
        let folder = run(dir.path(), "aa", "samples");
        let fresh = || {
            let mut index = Index::open(dir.path());
            assert_eq!(reason(&mut index, &folder).unwrap(), "samples");
            let fresh = index.fresh.len();
            index.save();
            fresh
        };
        assert_eq!((fresh(), fresh()), (1, 0));
        for damage in [
            &b"no database at all, and longer than a header of one hundred bytes would be, by some more letters"[..],
            b"",
        ] {
            write(Index::place(dir.path()), damage).unwrap();
            assert_eq!((fresh(), fresh()), (1, 0));
        }
        Connection::open(Index::place(dir.path())).unwrap().pragma_update(None, "user_version", 99).unwrap();
        assert_eq!((fresh(), fresh()), (1, 0));
        let nowhere = dir.path().join("nowhere");
        assert!(Index::open(&nowhere).file.is_none() && !nowhere.exists(), "reading makes no folders");
    }
}
