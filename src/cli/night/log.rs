//! Log output. Lines go to the current run's `log.txt`, and to stderr unless the dashboard uses the
//! screen.

use std::collections::VecDeque;
use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};

use crate::cli::exit::print_status;
use lumbre_night::store::utc;
use lumbre_night::text::visible;

/// Handle to the log, shared between the `tracing` layer and the code that sets the destinations.
#[derive(Clone, Debug, Default)]
pub struct Log {
    state: Arc<Mutex<LogState>>,
}

/// Function that receives the level and text of every line while stderr is deferred.
pub type Listener = Box<dyn Fn(Level, &str) + Send>;

/// Maximum number of deferred lines. Older lines remain in the logs of the runs.
const MAX_DEFERRED: usize = 1000;

/// Lines for stderr that are deferred while the dashboard uses the screen.
#[derive(Default)]
struct DeferredLines {
    lines: VecDeque<String>,
    /// Number of lines dropped because of [`MAX_DEFERRED`].
    dropped: usize,
    listener: Option<Listener>,
}

impl std::fmt::Debug for DeferredLines {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("DeferredLines")
            .field("lines", &self.lines)
            .field("dropped", &self.dropped)
            .finish_non_exhaustive()
    }
}

#[derive(Debug, Default)]
struct LogState {
    /// Log file of the current run.
    run: Option<File>,
    /// Lines that wait for stderr; `None` if lines are printed at once.
    deferred: Option<DeferredLines>,
    quiet: bool,
}

impl Log {
    /// Installs the log for the whole process. If called again, as in tests, the first log stays
    /// installed.
    pub fn install(quiet: bool) -> Log {
        let log = Log::default();
        log.state().quiet = quiet;
        let subscriber = tracing_subscriber::registry().with(RunLog {
            log: log.clone(),
            max_level: max_level(),
        });
        // An earlier subscriber is not an error: it stays in place.
        let _ = tracing::subscriber::set_global_default(subscriber);
        log
    }

    fn state(&self) -> MutexGuard<'_, LogState> {
        // The state stays usable if a thread panicked while it held the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Sets the log file of the current run. With `None`, lines go to no file.
    pub fn set_run(&self, file: Option<File>) {
        self.state().run = file;
    }

    /// Defers lines for stderr until [`Log::resume_stderr`].
    pub fn defer_stderr(&self) {
        self.state().deferred.get_or_insert_default();
    }

    /// Passes every line to `listener` as well, as long as stderr is deferred. The listener must
    /// not log.
    pub fn set_listener(&self, listener: Listener) {
        if let Some(deferred) = &mut self.state().deferred {
            deferred.listener = Some(listener);
        }
    }

    /// Prints all deferred lines to stderr and stops deferring.
    pub fn resume_stderr(&self) {
        let Some(deferred) = self.state().deferred.take() else {
            return;
        };
        if deferred.dropped > 0 {
            print_status(&format!(
                "({} earlier lines are in the log.txt files of the runs)",
                deferred.dropped
            ));
        }
        deferred.lines.iter().for_each(|line| print_status(line));
    }

    /// Writes one line only to the log file of the current run.
    pub fn run_line(&self, level: Level, text: &str) {
        let line = format!("{} {level:5} {}\n", utc(SystemTime::now()), visible(text));
        if let Some(file) = &mut self.state().run {
            // A lost log line must not fail a run. A full disk is reported by the result files.
            let _ = file.write_all(line.as_bytes());
        }
    }
}

/// Returns the most verbose level to log, from `LUMBRE_LOG` (`error`, `warn`, `info`, `debug` or
/// `trace`; default `info`).
fn max_level() -> Level {
    std::env::var("LUMBRE_LOG")
        .ok()
        .and_then(|name| name.parse().ok())
        .unwrap_or(Level::INFO)
}

/// `tracing` layer that formats the events of all modules of this crate.
struct RunLog {
    log: Log,
    /// Most verbose level to log.
    max_level: Level,
}

impl<S: Subscriber> Layer<S> for RunLog {
    fn enabled(&self, metadata: &tracing::Metadata<'_>, _: Context<'_, S>) -> bool {
        *metadata.level() <= self.max_level && metadata.target().starts_with("lumbre")
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut message = EventMessage::default();
        event.record(&mut message);
        let text = visible(&message.0).into_owned();
        let level = *event.metadata().level();
        self.log.run_line(level, &text);
        let line = match level {
            Level::ERROR => format!("error: {text}"),
            Level::WARN => format!("warning: {text}"),
            _ => text.clone(),
        };
        let mut state = self.log.state();
        if state.quiet && level > Level::WARN {
            return;
        }
        let Some(deferred) = &mut state.deferred else {
            return print_status(&line);
        };
        if let Some(listener) = &deferred.listener {
            listener(level, &text);
        }
        if deferred.lines.len() >= MAX_DEFERRED {
            deferred.lines.pop_front();
            deferred.dropped += 1;
        }
        deferred.lines.push_back(line);
    }
}

/// Message of an event, followed by its fields as `name=value`.
#[derive(Default)]
struct EventMessage(String);

impl Visit for EventMessage {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        // Writing to a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(
                self.0,
                "{}{name}={value:?}",
                if self.0.is_empty() { "" } else { " " }
            ),
        };
    }
}

#[cfg(test)]
mod tests {
    use crate::cli::night::log::*;

    #[test]
    fn lines_reach_the_run_log_and_are_deferred_while_the_screen_is_in_use() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.txt");
        let log = Log::default();
        log.set_run(Some(File::create(&path).unwrap()));
        log.defer_stderr();
        let pane = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&pane);
        log.set_listener(Box::new(move |level, text| {
            lines.lock().unwrap().push(format!("{level} {text}"))
        }));
        let subscriber = tracing_subscriber::registry().with(RunLog {
            log: log.clone(),
            max_level: Level::INFO,
        });
        tracing::subscriber::with_default(subscriber, || {
            tracing::warn!(target: "lumbre::test", cells = 3, "the lens is dusty");
            tracing::debug!(target: "lumbre::test", "too much detail");
            tracing::error!(target: "another_crate", "not logged");
        });
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 1);
        assert!(
            text.ends_with("WARN  the lens is dusty cells=3\n"),
            "{text}"
        );
        assert_eq!(
            log.state().deferred.as_ref().unwrap().lines,
            ["warning: the lens is dusty cells=3"]
        );
        assert_eq!(
            *pane.lock().unwrap(),
            ["WARN the lens is dusty cells=3"],
            "the listener receives it at once"
        );
    }
}
