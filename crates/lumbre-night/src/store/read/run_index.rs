//! Index of finished runs: `out/index.jsonl` holds their results, so that ten thousand runs are
//! listed without opening ten thousand files.
//!
//! The index is a cache. An entry counts only while the run's last file has the size and
//! modification time that it was made from, so deleted, copied and re-rendered runs are noticed. An
//! index that is missing, damaged or of another version is rebuilt from the folders. If the index
//! cannot be written, the folders are read every time.
//!
//! The first line is a header: the format, its version, the names of the fields, and the BLAKE3
//! hash of all further bytes. Each further line is an object with one run: its folder and the
//! values of the fields. Ten thousand lines are parsed in half the time of objects in which every
//! field has its name. The file is read as a whole and replaced as a whole: if processes write at
//! the same time, the last one wins, and the entries of the others are made again when they are
//! next needed.

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use crate::experiment::WaveRow;
use crate::paths::folder_of;
use crate::store::lock::filesystem_kind;
use crate::store::schema::process::IndexHeader;
use crate::store::schema::run::DoneFile;
use crate::store::schema::{Problem, ReadError, StoredFile, one_line};
use crate::store::worker::registry;
use crate::store::write::atomic;
use crate::store::{layout, regular_file};

/// Fields of a line, in order: see [`Line`].
const FIELDS: [&str; 5] = ["changed", "size", "reason", "samples", "render_s"];

/// Results of a finished run that listings and forecasts need, from its last file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FinishedSummary {
    /// Reason that it ended.
    pub reason: String,
    /// Samples per pixel.
    pub samples: Option<u64>,
    /// Render time in seconds.
    pub render_s: Option<f64>,
}

impl FinishedSummary {
    /// Returns what is known of the last measurement, if the run was rendered.
    pub(crate) fn rows(&self) -> Vec<WaveRow> {
        let row = |(samples, render_s)| WaveRow {
            samples,
            render_s,
            ..WaveRow::default()
        };
        self.samples
            .zip(self.render_s)
            .map(row)
            .into_iter()
            .collect()
    }

    fn from_done(done: &DoneFile) -> FinishedSummary {
        done.rendered()
            .map_or_else(FinishedSummary::default, |results| FinishedSummary {
                reason: results.reason.clone(),
                samples: Some(results.samples),
                render_s: Some(results.render_s),
            })
    }
}

/// Modification time of a file in nanoseconds since 1970, and its size in bytes.
type FileStamp = (i64, i64);

/// Entries by the path of the run's folder below the output folder.
type Entries = BTreeMap<String, (FileStamp, FinishedSummary)>;

/// One line of the file, by the path of the run's folder.
type Line<Key, Text> = BTreeMap<Key, (i64, i64, Text, Option<u64>, Option<f64>)>;

/// Index of one output folder.
#[derive(Debug)]
pub(crate) struct RunIndex {
    out: PathBuf,
    /// Path of the index; `None` if the output folder does not exist.
    file: Option<PathBuf>,
    known: Entries,
    /// Number of entries that are not in the file yet.
    new_entries: usize,
}

impl RunIndex {
    /// Path of the index of `out`: inside it, unless other machines use it too. These would replace
    /// each other's index, so each user then has one in the cache folder.
    pub(crate) fn path_for(out: &Path) -> PathBuf {
        let shared = filesystem_kind::detect(out)
            .is_some_and(|kind| filesystem_kind::is_network(&kind))
            || has_workers(out);
        let cache = shared.then(cache_folder).flatten();
        match cache.zip(out.canonicalize().ok()) {
            Some((cache, real)) => {
                let name = blake3::hash(real.as_os_str().as_encoded_bytes()).to_hex();
                cache.join(format!("index-{}.jsonl", &name[..16]))
            }
            None => out.join(IndexHeader::NAME),
        }
    }

    /// Reads the index of `out`. It is empty if there is none that can be used.
    pub(crate) fn open(out: &Path) -> RunIndex {
        let file = out.is_dir().then(|| RunIndex::path_for(out));
        let known = file.as_deref().map_or_else(Entries::new, |file| {
            load(file).unwrap_or_else(|problem| {
                tracing::debug!("rebuilding the index: {problem}");
                Entries::new()
            })
        });
        RunIndex {
            out: out.to_owned(),
            file,
            known,
            new_entries: 0,
        }
    }

    /// Results of a finished run, by its folder and the name of its last file, which matches its
    /// checksum. Returns `None` if the run is not finished.
    ///
    /// # Errors
    /// When the last file is damaged, of another version, or of another run.
    pub(crate) fn finished(
        &mut self,
        folder: &Path,
        marker: &str,
    ) -> Result<Option<FinishedSummary>, ReadError> {
        let file = folder.join(marker);
        let Ok(facts) = fs::metadata(&file) else {
            return Ok(None);
        };
        let stamp = file_stamp(&facts);
        let key = folder
            .strip_prefix(&self.out)
            .unwrap_or(folder)
            .to_string_lossy()
            .into_owned();
        if let Some((known, finished)) = self.known.get(&key)
            && *known == stamp
        {
            return Ok(Some(finished.clone()));
        }
        let done = DoneFile::read_from(&file)?;
        if folder.file_name().is_none_or(|name| name != done.run()) {
            return Err(ReadError {
                path: file,
                problem: Problem::Damaged("it belongs to another run".to_owned()),
            });
        }
        let finished = FinishedSummary::from_done(&done);
        self.known.insert(key, (stamp, finished.clone()));
        self.new_entries += 1;
        Ok(Some(finished))
    }

    /// Replaces the file if there are new entries. A failure only costs the next reader time.
    pub(crate) fn save(self) {
        let Some(file) = self.file.filter(|_| self.new_entries > 0) else {
            return;
        };
        let written = encode(&self.known).and_then(|text| replace(&file, &text));
        if let Err(e) = written {
            tracing::debug!("cannot update the index: {e}");
        }
    }
}

/// Replaces the file and removes what earlier processes left beside it. Without a sync: if a power
/// failure damages the file, its hash is wrong and it is rebuilt.
fn replace(path: &Path, text: &str) -> io::Result<()> {
    let folder = folder_of(path);
    let mut file = atomic::temporary(folder)?;
    file.write_all(text.as_bytes())?;
    file.persist(path).map_err(|e| e.error)?;
    atomic::remove_old_temporaries(folder);
    // The index of version 0.1.0, an SQLite database. It is usually not there.
    let _ = fs::remove_file(path.with_extension("sqlite"));
    Ok(())
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

/// Text of the file with these entries.
fn encode(known: &Entries) -> io::Result<String> {
    let mut body = String::new();
    for (folder, ((changed, size), f)) in known {
        let fields = (*changed, *size, f.reason.as_str(), f.samples, f.render_s);
        let line: Line<&str, &str> = BTreeMap::from([(folder.as_str(), fields)]);
        body += &serde_json::to_string(&line)?;
        body.push('\n');
    }
    Ok(one_line(&header(&body)) + &body)
}

/// First line of a file whose further lines are `body`.
fn header(body: &str) -> IndexHeader {
    IndexHeader {
        fields: FIELDS.map(str::to_owned).to_vec(),
        blake3: blake3::hash(body.as_bytes()).to_hex().to_string(),
        ..IndexHeader::default()
    }
}

/// Reads the file.
///
/// # Errors
/// When it cannot be read, is damaged, or has another format or version; the text is a description.
fn load(path: &Path) -> Result<Entries, String> {
    let text = regular_file::read_to_string(path).map_err(|e| e.to_string())?;
    let (first, body) = text.split_once('\n').ok_or("it has no header")?;
    if IndexHeader::parse(first.as_bytes()) != Ok(header(body)) {
        return Err("it is damaged or of another version".to_owned());
    }
    let mut known = Entries::new();
    for line in body.lines() {
        let line: Line<String, String> = serde_json::from_str(line).map_err(|e| e.to_string())?;
        for (folder, (changed, size, reason, samples, render_s)) in line {
            let finished = FinishedSummary {
                reason,
                samples,
                render_s,
            };
            known.insert(folder, ((changed, size), finished));
        }
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use crate::store::read::run_index::*;
    use crate::store::schema::run::{DONE, RunResults};
    use std::fs::write;

    fn run(out: &Path, name: &str, reason: &str) -> PathBuf {
        let folder = out.join("night-3f9a/runs").join(name);
        fs::create_dir_all(&folder).unwrap();
        let done = DoneFile::Rendered(Box::new(RunResults {
            run: name.to_owned(),
            reason: reason.to_owned(),
            samples: 4,
            render_s: 0.5,
            ..RunResults::default()
        }));
        let done = done.sealed(BTreeMap::new());
        write(folder.join(DONE), done.text()).unwrap();
        folder
    }

    fn reason(index: &mut RunIndex, folder: &Path) -> Option<String> {
        let found = index.finished(folder, "done.json").ok()??;
        Some(found.reason)
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
        let of_b = index.finished(&b, "done.json").unwrap().unwrap();
        assert_eq!((of_b.samples, of_b.render_s), (Some(4), Some(0.5)));
        assert_eq!(index.new_entries, 2);
        index.save();

        let mut index = RunIndex::open(dir.path());
        assert_eq!(reason(&mut index, &a).unwrap(), "long enough");
        assert_eq!(index.new_entries, 0, "no file had to be read");
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
    fn a_run_of_the_same_size_but_another_time_is_read_again() {
        let dir = tempfile::tempdir().unwrap();
        let folder = run(dir.path(), "aa", "first");
        let mut index = RunIndex::open(dir.path());
        assert_eq!(reason(&mut index, &folder).unwrap(), "first");
        run(dir.path(), "aa", "again");
        let done = fs::File::options().write(true).open(folder.join(DONE));
        let later = SystemTime::now() + std::time::Duration::from_secs(60);
        done.unwrap().set_modified(later).unwrap();
        assert_eq!(reason(&mut index, &folder).unwrap(), "again");
    }

    #[test]
    fn a_run_that_was_copied_to_the_folder_of_another_is_not_done() {
        let dir = tempfile::tempdir().unwrap();
        let a = run(dir.path(), "aa", "samples");
        let b = run(dir.path(), "bb", "samples");
        fs::copy(a.join(DONE), b.join(DONE)).unwrap();
        let mut index = RunIndex::open(dir.path());
        assert!(index.finished(&a, DONE).unwrap().is_some());
        assert!(index.finished(&b, DONE).is_err());
    }

    #[test]
    fn every_field_survives_the_file() {
        let dir = tempfile::tempdir().unwrap();
        let full = FinishedSummary {
            reason: "samples \"64\"\n\u{e9}".to_owned(),
            samples: Some(u64::MAX),
            render_s: Some(0.1 + 0.2),
        };
        let known = Entries::from([
            ("night/runs/aa".to_owned(), ((i64::MAX, 7), full)),
            ("refs/bb".to_owned(), ((0, 0), FinishedSummary::default())),
        ]);
        let path = dir.path().join("index.jsonl");
        write(&path, encode(&known).unwrap()).unwrap();
        assert_eq!(load(&path).unwrap(), known);
    }

    #[test]
    fn a_damaged_or_foreign_index_is_rebuilt() {
        let dir = tempfile::tempdir().unwrap();
        let folder = run(dir.path(), "aa", "samples");
        let count_new_entries = || {
            let mut index = RunIndex::open(dir.path());
            assert_eq!(reason(&mut index, &folder).unwrap(), "samples");
            let count = index.new_entries;
            index.save();
            count
        };
        assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        let path = RunIndex::path_for(dir.path());
        let intact = fs::read_to_string(&path).unwrap();
        let body = "{\"night-3f9a/runs/aa\":[1,2]}\n";
        for damage in [
            "x".repeat(120),
            String::new(),
            intact.replace("samples", "simples"),
            intact[..intact.len() - 1].to_owned(),
            intact.replace("\"version\":2", "\"version\":99"),
            one_line(&header(body)) + body,
        ] {
            assert_ne!(damage, intact);
            write(&path, &damage).unwrap();
            assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        }
        write(&path, [0xff; 120]).unwrap();
        assert_eq!((count_new_entries(), count_new_entries()), (1, 0));
        let nowhere = dir.path().join("nowhere");
        let index = RunIndex::open(&nowhere);
        assert!(index.file.is_none());
        index.save();
        assert!(!nowhere.exists(), "reading creates no folders");
    }

    #[test]
    fn the_last_of_two_writers_wins() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (run(dir.path(), "aa", "time"), run(dir.path(), "bb", "time"));
        let (mut first, mut second) = (RunIndex::open(dir.path()), RunIndex::open(dir.path()));
        reason(&mut first, &a).unwrap();
        reason(&mut second, &b).unwrap();
        first.save();
        second.save();
        let mut index = RunIndex::open(dir.path());
        reason(&mut index, &b).unwrap();
        assert_eq!(index.new_entries, 0);
        reason(&mut index, &a).unwrap();
        assert_eq!(index.new_entries, 1, "the entry is made again");
    }

    #[test]
    fn the_database_of_earlier_versions_is_removed_when_the_index_is_written() {
        let dir = tempfile::tempdir().unwrap();
        let old = dir.path().join("index.sqlite");
        write(&old, b"SQLite format 3").unwrap();
        RunIndex::open(dir.path()).save();
        assert!(old.exists(), "nothing was written");
        let folder = run(dir.path(), "aa", "time");
        let mut index = RunIndex::open(dir.path());
        reason(&mut index, &folder).unwrap();
        index.save();
        assert!(!old.exists() && dir.path().join("index.jsonl").is_file());
    }

    #[test]
    fn an_index_that_cannot_be_written_changes_no_result() {
        let dir = tempfile::tempdir().unwrap();
        let folder = run(dir.path(), "aa", "time");
        fs::create_dir_all(dir.path().join("index.jsonl/inner")).unwrap();
        let old = dir.path().join("index.sqlite");
        write(&old, b"SQLite format 3").unwrap();
        for _ in 0..2 {
            let mut index = RunIndex::open(dir.path());
            assert_eq!(reason(&mut index, &folder).unwrap(), "time");
            assert_eq!(index.new_entries, 1);
            index.save();
        }
        assert!(old.exists(), "nothing was written");
    }
}
