//! Notices of a night: the commands of `x:notify`, run on a thread of their own.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;
use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::thread::JoinHandle;
use std::time::Duration;

use crate::cli::format::counted;
use lumbre_night::experiment::event::{Event, Sink, SinkError};
use lumbre_night::experiment::spec::{NOTICE_PLACEHOLDERS, Notice, NoticeEvent};
use lumbre_night::experiment::{CellRef, Outcome, Plan};
use lumbre_render::external::{run_once, words};

/// Number of notices that wait to be sent; further ones are dropped, so that a night in which
/// everything fails does not wait for thousands of commands.
const QUEUE: usize = 16;

/// Something to tell.
type News = (NoticeEvent, String);

/// Sink that runs the commands of a plan's notices. Dropping it waits for those that are left, at
/// most one timeout for each command that hangs.
pub struct Notifier {
    plan: Arc<Plan>,
    /// `None` when the night is over.
    queue: Option<SyncSender<News>>,
    thread: Option<JoinHandle<()>>,
    /// Number of runs that are done, failed and interrupted.
    counts: [usize; 3],
    /// Number of notices that did not fit into the queue.
    dropped: usize,
}

impl Notifier {
    /// Starts the thread that runs the commands. Returns `None` if the plan has no notices.
    pub fn start(plan: &Arc<Plan>, folder: &Path) -> Option<Notifier> {
        let notices = plan.night.notices.clone();
        if notices.is_empty() || !plan.commands_allowed {
            return None;
        }
        let (queue, news) = sync_channel(QUEUE);
        let values = [
            ("name", plan.name.clone()),
            ("folder", folder.display().to_string()),
        ];
        let values = values.map(|(key, value)| (key.to_owned(), value)).into();
        let thread = std::thread::Builder::new().name("notices".to_owned());
        let thread = thread.spawn(move || send_all(&notices, &values, &news));
        match thread {
            Ok(thread) => Some(Notifier {
                plan: Arc::clone(plan),
                queue: Some(queue),
                thread: Some(thread),
                counts: [0; 3],
                dropped: 0,
            }),
            Err(e) => {
                tracing::warn!("no notices are sent: {e}");
                None
            }
        }
    }

    fn tell(&mut self, event: NoticeEvent, text: String) {
        let sent = self
            .queue
            .as_ref()
            .map(|queue| queue.try_send((event, text)));
        self.dropped += usize::from(sent.is_some_and(|sent| sent.is_err()));
    }

    fn path(&self, cell: CellRef) -> String {
        match cell {
            CellRef::Cell(i) => self.plan.cells[i].path.clone(),
            CellRef::Reference(i) => format!("reference {}", self.plan.references[i].id.0),
        }
    }

    /// Describes how the night ended.
    fn ending(&self) -> String {
        let [done, failed, interrupted] = self.counts;
        let mut text = format!("{}: {} done", self.plan.name, counted(done, "run"));
        for (count, word) in [(failed, "failed"), (interrupted, "interrupted")] {
            if count > 0 {
                text += &format!(", {count} {word}");
            }
        }
        text
    }
}

impl Sink for Notifier {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        match event {
            Event::CellFinished { cell, outcome, .. } => match outcome {
                Outcome::Done(_) | Outcome::Cached(_) => self.counts[0] += 1,
                Outcome::Failed(reason) => {
                    self.counts[1] += 1;
                    let text = format!("{} failed: {reason}", self.path(*cell));
                    self.tell(NoticeEvent::Failure, text);
                }
                Outcome::Interrupted => self.counts[2] += 1,
            },
            Event::BiasCheck {
                reference, check, ..
            } if !check.agrees => {
                let cell = self.path(CellRef::Reference(*reference));
                let text = format!("{cell}: {}", check.finding);
                self.tell(NoticeEvent::Alarm, text);
            }
            Event::NightFinished => {
                // The end is reported even if failures have filled the queue.
                let text = self.ending();
                if let Some(queue) = self.queue.take() {
                    let _ = queue.send((NoticeEvent::End, text));
                }
            }
            _ => {}
        }
        // A notice that cannot be sent is no reason to lose a result.
        Ok(())
    }
}

impl Drop for Notifier {
    fn drop(&mut self) {
        self.queue = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
        if self.dropped > 0 {
            tracing::warn!(
                "{} were not sent: too many at once",
                counted(self.dropped, "notice")
            );
        }
    }
}

/// Runs the commands of all news until the queue is closed. A command that hangs is not run again.
fn send_all(notices: &[Notice], values: &BTreeMap<String, String>, news: &Receiver<News>) {
    let mut hanging = BTreeSet::new();
    for (event, text) in news {
        let mut values = values.clone();
        values.insert("event".to_owned(), event.name().to_owned());
        values.insert("text".to_owned(), text);
        debug_assert!(
            NOTICE_PLACEHOLDERS
                .iter()
                .all(|key| values.contains_key(*key))
        );
        let wanted = notices.iter().enumerate();
        for (index, notice) in wanted.filter(|(_, notice)| notice.events.contains(&event)) {
            if hanging.contains(&index) {
                continue;
            }
            let command = words::fill(&notice.command, &values);
            let limit = Duration::from_secs_f64(notice.timeout_s.min(1e9));
            if let Err(failure) = run_once(&command, limit) {
                tracing::warn!(
                    "the command of x:notify for `{}`: {}",
                    event.name(),
                    failure.reason
                );
                if failure.timed_out {
                    hanging.insert(index);
                }
            }
        }
    }
}
