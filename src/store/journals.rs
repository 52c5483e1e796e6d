//! The journals of a folder, read as one: that of whoever runs the night alone, and one of every worker.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde_json::Value as Json;

use super::crew;
use super::tail::Tail;

/// Journals of workers that one look reads, so that a thousand of them do not make it slow. The first reads all.
const LOOKS: usize = 64;

/// The key under which a line of a worker's journal says whose it is.
const WORKER: &str = "worker";

/// The worker whose journal holds this line, by its name in the crew; empty for that of a night that one renders alone.
pub(super) fn worker(line: &Json) -> &str {
    line[WORKER].as_str().unwrap_or_default()
}

/// Journals that grow.
#[derive(Debug)]
pub(super) struct Journals {
    main: Tail,
    workers: PathBuf,
    tails: BTreeMap<PathBuf, Tail>,
    /// The worker whose journal was read last.
    last: Option<PathBuf>,
}

/// What a look found.
#[derive(Debug, Default)]
pub(super) struct Lines {
    /// Whole new lines in the order of their dates; those of one process in the order in which they were written.
    pub(super) lines: Vec<Json>,
    /// Whether the first journal was begun anew.
    pub(super) anew: bool,
}

impl Journals {
    /// The journals of an experiment's folder, which need not be there yet.
    pub(super) fn new(experiment: &Path) -> Journals {
        Journals {
            main: Tail::new(experiment.join("journal.jsonl")),
            workers: experiment.join(crew::FOLDER),
            tails: BTreeMap::new(),
            last: None,
        }
    }

    /// Whether there are workers.
    pub(super) fn has_workers(&self) -> bool {
        !self.tails.is_empty()
    }

    /// What was appended since the last look.
    pub(super) fn look(&mut self) -> Lines {
        let news = self.main.look();
        let mut texts = vec![(String::new(), news.text)];
        for entry in fs::read_dir(&self.workers).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|e| e == "jsonl") && !self.tails.contains_key(&path) {
                let mut tail = Tail::new(path.clone());
                texts.push((name(&path), tail.look().text));
                self.tails.insert(path, tail);
            }
        }
        let after = |path: &&PathBuf| self.last.as_ref().is_none_or(|last| *path > last);
        let mut next: Vec<PathBuf> = self.tails.keys().filter(after).take(LOOKS).cloned().collect();
        let rest = LOOKS.min(self.tails.len()).saturating_sub(next.len());
        next.extend(self.tails.keys().take(rest).cloned().collect::<Vec<_>>());
        for path in &next {
            texts.extend(self.tails.get_mut(path).map(|tail| (name(path), tail.look().text)));
        }
        self.last = next.pop();
        let mut lines: Vec<Json> = Vec::new();
        for (worker, text) in &texts {
            let parsed = text.lines().filter_map(|line| serde_json::from_str(line).ok());
            lines.extend(parsed.map(|mut line: Json| {
                if let Some(fields) = line.as_object_mut().filter(|_| !worker.is_empty()) {
                    fields.insert(WORKER.to_owned(), worker.as_str().into());
                }
                line
            }));
        }
        if !self.tails.is_empty() {
            // Clocks of machines may differ by a little; nothing but the order of what is shown hangs on them.
            let order = |line: &Json| (line["date"].as_str().unwrap_or_default().to_owned(), worker(line).to_owned());
            lines.sort_by_cached_key(order);
        }
        Lines { lines, anew: news.anew }
    }

    /// When a journal was last written to.
    pub(super) fn written(&self) -> Option<SystemTime> {
        let all = std::iter::once(&self.main).chain(self.tails.values());
        all.filter_map(|tail| fs::metadata(tail.path()).and_then(|m| m.modified()).ok()).max()
    }
}

/// The name of the worker that writes a journal.
fn name(journal: &Path) -> String {
    journal.file_stem().unwrap_or_default().to_string_lossy().into_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs::OpenOptions;
    use std::io::Write;

    #[test]
    fn all_journals_are_read_as_one_by_date() {
        let dir = tempfile::tempdir().unwrap();
        let workers = dir.path().join(crew::FOLDER);
        fs::create_dir(&workers).unwrap();
        let append = |name: &str, second: u32, what: &str| {
            let mut file = OpenOptions::new().create(true).append(true).open(dir.path().join(name)).unwrap();
            writeln!(file, r#"{{"date":"2026-04-27T21:30:{second:02}Z","event":"{what}"}}"#).unwrap();
        };
        let mut journals = Journals::new(dir.path());
        append("journal.jsonl", 1, "a");
        append("workers/n1.jsonl", 3, "c");
        append("workers/n2.jsonl", 2, "b");
        let seen = |journals: &mut Journals| -> String {
            journals.look().lines.iter().flat_map(|line| [worker(line), line["event"].as_str().unwrap()]).collect()
        };
        assert_eq!(seen(&mut journals), "an2bn1c", "with the worker that each is of");
        assert!(journals.has_workers() && seen(&mut journals).is_empty());
        append("workers/n1.jsonl", 5, "d");
        append("workers/n3.jsonl", 4, "e");
        assert_eq!(seen(&mut journals), "n3en1d");
        for i in 0..200 {
            append(&format!("workers/m{i}.jsonl"), 6, "x");
        }
        let mut count = || journals.look().lines.len();
        assert_eq!(count(), 200);
        (0..200).for_each(|i| append(&format!("workers/m{i}.jsonl"), 7, "y"));
        let looks: Vec<usize> = (0..4).map(|_| count()).collect();
        assert_eq!(looks.iter().sum::<usize>(), 200, "each look takes some in: {looks:?}");
    }
}
