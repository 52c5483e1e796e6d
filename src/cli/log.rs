//! Where log lines go: into the current run's `log.txt`, and to stderr unless the dashboard owns the screen.

use std::fmt::Write as _;
use std::fs::File;
use std::io::Write as _;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::SystemTime;

use tracing::field::{Field, Visit};
use tracing::{Event, Level, Subscriber};
use tracing_subscriber::Layer;
use tracing_subscriber::layer::{Context, SubscriberExt};

use super::exit::talk;
use crate::store::utc;

/// The log, shared between the layer and those who say where lines go.
#[derive(Clone, Debug, Default)]
pub struct Log {
    state: Arc<Mutex<State>>,
}

#[derive(Debug, Default)]
struct State {
    run: Option<File>,
    /// Lines for stderr wait here while the dashboard owns the screen.
    held: Option<Vec<String>>,
    quiet: bool,
}

impl Log {
    /// Installs the log for the whole process. Asked twice, as tests do, the first one stays.
    pub fn install(quiet: bool) -> Log {
        let log = Log::default();
        log.state().quiet = quiet;
        let subscriber = tracing_subscriber::registry().with(RunLog { log: log.clone(), most: most_verbose() });
        // An earlier subscriber is no error: its lines go where it says.
        let _ = tracing::subscriber::set_global_default(subscriber);
        log
    }

    fn state(&self) -> MutexGuard<'_, State> {
        // A panic while holding the lock leaves nothing half-done here that matters more than the log itself.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Lines go to this file from now on, or to none.
    pub fn set_run(&self, file: Option<File>) {
        self.state().run = file;
    }

    /// Keeps lines off stderr until [`Log::release`].
    pub fn hold(&self) {
        self.state().held.get_or_insert_default();
    }

    /// Gives the lines that waited to stderr.
    pub fn release(&self) {
        let held = self.state().held.take();
        held.into_iter().flatten().for_each(|line| talk(&line));
    }

    /// Writes one line into the run's log alone.
    pub fn run_line(&self, level: Level, text: &str) {
        let line = format!("{} {level:5} {text}\n", utc(SystemTime::now()));
        if let Some(file) = &mut self.state().run {
            // A full disk is reported by the files that matter; a log line is not worth a cell.
            let _ = file.write_all(line.as_bytes());
        }
    }
}

/// The most verbose level that is kept, from `LUMBRE_LOG` (`error`, `warn`, `info`, `debug`, `trace`).
fn most_verbose() -> Level {
    std::env::var("LUMBRE_LOG").ok().and_then(|name| name.parse().ok()).unwrap_or(Level::INFO)
}

/// The layer that hears every room.
struct RunLog {
    log: Log,
    most: Level,
}

impl<S: Subscriber> Layer<S> for RunLog {
    fn enabled(&self, metadata: &tracing::Metadata<'_>, _: Context<'_, S>) -> bool {
        *metadata.level() <= self.most && metadata.target().starts_with("lumbre")
    }

    fn on_event(&self, event: &Event<'_>, _: Context<'_, S>) {
        let mut line = Line::default();
        event.record(&mut line);
        let level = *event.metadata().level();
        self.log.run_line(level, &line.0);
        let shown = match level {
            Level::ERROR => format!("error: {}", line.0),
            Level::WARN => format!("warning: {}", line.0),
            _ => line.0,
        };
        let mut state = self.log.state();
        if state.quiet && level > Level::WARN {
            return;
        }
        match &mut state.held {
            Some(held) => held.push(shown),
            None => talk(&shown),
        }
    }
}

/// An event's message, then its fields as `name=value`.
#[derive(Default)]
struct Line(String);

impl Visit for Line {
    fn record_debug(&mut self, field: &Field, value: &dyn std::fmt::Debug) {
        // Writing to a String cannot fail.
        let _ = match field.name() {
            "message" => write!(self.0, "{value:?}"),
            name => write!(self.0, "{}{name}={value:?}", if self.0.is_empty() { "" } else { " " }),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_reach_the_run_and_wait_while_the_screen_is_taken() {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("log.txt");
        let log = Log::default();
        log.set_run(Some(File::create(&path).unwrap()));
        log.hold();
        let subscriber = tracing_subscriber::registry().with(RunLog { log: log.clone(), most: Level::INFO });
        tracing::subscriber::with_default(subscriber, || {
            tracing::warn!(target: "lumbre::test", cells = 3, "the lens is dusty");
            tracing::debug!(target: "lumbre::test", "too much detail");
            tracing::error!(target: "somebody_else", "not ours");
        });
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 1);
        assert!(text.ends_with("WARN  the lens is dusty cells=3\n"), "{text}");
        assert_eq!(log.state().held.as_deref(), Some(&["warning: the lens is dusty cells=3".to_owned()][..]));
    }
}
