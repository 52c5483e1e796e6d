//! Reads the journals of an experiment's folder as one: the journal of a process that renders the
//! night alone, and those of all workers.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::tail::Tail;
use crate::store::schema::journal::{self, JournalEvent, JournalLine, OutcomeKind};
use crate::store::worker::registry;

/// Maximum number of workers' journals that one poll reads. The first poll reads all.
const MAX_PER_POLL: usize = 64;

/// A line of a journal, and whose journal it is.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct WorkerLine {
    /// Name of the worker whose journal holds the line; empty for the main journal.
    pub(crate) worker: String,
    /// Date of the event, UTC.
    pub(crate) date: String,
    /// Event of the line.
    pub(crate) event: JournalEvent,
}

/// Parses the complete lines of a journal. Lines that are damaged or of another version are left
/// out.
pub(crate) fn parse_lines(text: &str) -> impl Iterator<Item = JournalLine> {
    text.lines()
        .filter_map(|line| serde_json::from_str(line).ok())
}

/// Journals that grow while they are read.
#[derive(Debug)]
pub(crate) struct MergedJournal {
    main: Tail,
    workers: PathBuf,
    tails: BTreeMap<PathBuf, Tail>,
    /// Path of the worker's journal that was read last.
    last: Option<PathBuf>,
}

/// Result of a poll.
#[derive(Debug, Default)]
pub(crate) struct JournalLines {
    /// Complete new lines ordered by date; lines of one process stay in the order of writing.
    pub(crate) lines: Vec<WorkerLine>,
    /// Whether the main journal was replaced by a new file.
    pub(crate) restarted: bool,
}

impl MergedJournal {
    /// Opens the journals of an experiment's folder, none of which need exist.
    pub(crate) fn new(experiment: &Path) -> MergedJournal {
        MergedJournal {
            main: Tail::new(experiment.join(journal::FILE)),
            workers: experiment.join(registry::FOLDER),
            tails: BTreeMap::new(),
            last: None,
        }
    }

    /// Whether any worker has a journal.
    pub(crate) fn has_workers(&self) -> bool {
        !self.tails.is_empty()
    }

    /// Returns the lines that were appended since the last poll.
    pub(crate) fn poll(&mut self) -> JournalLines {
        let update = self.main.poll();
        let mut texts = vec![(String::new(), update.text)];
        for entry in fs::read_dir(&self.workers).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.extension().is_some_and(|e| e == "jsonl") && !self.tails.contains_key(&path) {
                let mut tail = Tail::new(path.clone());
                texts.push((worker_of_journal(&path), tail.poll().text));
                self.tails.insert(path, tail);
            }
        }
        let after = |path: &&PathBuf| self.last.as_ref().is_none_or(|last| *path > last);
        let mut next: Vec<PathBuf> = self
            .tails
            .keys()
            .filter(after)
            .take(MAX_PER_POLL)
            .cloned()
            .collect();
        let rest = MAX_PER_POLL
            .min(self.tails.len())
            .saturating_sub(next.len());
        next.extend(self.tails.keys().take(rest).cloned().collect::<Vec<_>>());
        for path in &next {
            texts.extend(
                self.tails
                    .get_mut(path)
                    .map(|tail| (worker_of_journal(path), tail.poll().text)),
            );
        }
        self.last = next.pop();
        let mut lines: Vec<WorkerLine> = Vec::new();
        for (worker, text) in &texts {
            lines.extend(parse_lines(text).map(|line| WorkerLine {
                worker: worker.clone(),
                date: line.date,
                event: line.event,
            }));
        }
        if !self.tails.is_empty() {
            // Clocks of machines may differ slightly. Only the order of displayed events depends on
            // them.
            lines.sort_by(|a, b| (&a.date, &a.worker).cmp(&(&b.date, &b.worker)));
        }
        JournalLines {
            lines,
            restarted: update.restarted,
        }
    }

    /// Time at which a journal was last written to.
    pub(crate) fn last_modified(&self) -> Option<SystemTime> {
        let all = std::iter::once(&self.main).chain(self.tails.values());
        all.filter_map(|tail| fs::metadata(tail.path()).and_then(|m| m.modified()).ok())
            .max()
    }
}

/// Returns the ids of the runs and references that the journals of a night's folder state as
/// finished.
pub(crate) fn finished_runs(folder: &Path) -> BTreeSet<String> {
    let mut finished = BTreeSet::new();
    for line in MergedJournal::new(folder).poll().lines {
        match line.event {
            JournalEvent::CellFinished(end) if end.outcome == OutcomeKind::Done => {
                finished.insert(end.run);
            }
            JournalEvent::CellStarted(start) => {
                finished.remove(&start.run);
            }
            _ => {}
        }
    }
    finished
}

/// Name of the worker that writes a journal.
fn worker_of_journal(journal: &Path) -> String {
    journal
        .file_stem()
        .unwrap_or_default()
        .to_string_lossy()
        .into_owned()
}

#[cfg(test)]
mod tests {
    use crate::store::read::merged_journal::*;
    use crate::store::schema::journal::MessageRecord;
    use crate::store::schema::one_line;
    use std::fs::OpenOptions;
    use std::io::Write;

    #[test]
    fn all_journals_are_merged_by_date() {
        let dir = tempfile::tempdir().unwrap();
        let workers = dir.path().join(registry::FOLDER);
        fs::create_dir(&workers).unwrap();
        let append = |name: &str, second: u32, what: &str| {
            let mut file = OpenOptions::new()
                .create(true)
                .append(true)
                .open(dir.path().join(name))
                .unwrap();
            let line = JournalLine {
                date: format!("2026-04-27T21:30:{second:02}Z"),
                event: JournalEvent::Message(MessageRecord {
                    text: what.to_owned(),
                    ..MessageRecord::default()
                }),
            };
            file.write_all(one_line(&line).as_bytes()).unwrap();
        };
        let mut journals = MergedJournal::new(dir.path());
        append("journal.jsonl", 1, "a");
        append("workers/n1.jsonl", 3, "c");
        append("workers/n2.jsonl", 2, "b");
        let events = |journals: &mut MergedJournal| -> String {
            journals
                .poll()
                .lines
                .iter()
                .map(|line| match &line.event {
                    JournalEvent::Message(message) => format!("{}{}", line.worker, message.text),
                    other => panic!("{other:?}"),
                })
                .collect()
        };
        assert_eq!(
            events(&mut journals),
            "an2bn1c",
            "each line with its worker"
        );
        assert!(journals.has_workers() && events(&mut journals).is_empty());
        append("workers/n1.jsonl", 5, "d");
        append("workers/n3.jsonl", 4, "e");
        assert_eq!(events(&mut journals), "n3en1d");
        for i in 0..200 {
            append(&format!("workers/m{i}.jsonl"), 6, "x");
        }
        let mut count = || journals.poll().lines.len();
        assert_eq!(count(), 200);
        (0..200).for_each(|i| append(&format!("workers/m{i}.jsonl"), 7, "y"));
        let polls: Vec<usize> = (0..4).map(|_| count()).collect();
        assert_eq!(
            polls.iter().sum::<usize>(),
            200,
            "each poll reads some of them: {polls:?}"
        );
    }
}
