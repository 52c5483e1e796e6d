//! Where log lines go: into the current run's `log.txt`, and to stderr unless the dashboard owns the screen.

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

use super::exit::talk;
use crate::store::utc;

/// The log, shared between the layer and those who say where lines go.
#[derive(Clone, Debug, Default)]
pub struct Log {
    state: Arc<Mutex<State>>,
}

/// Hears every line while the screen is taken: its level and its text.
pub type Listener = Box<dyn Fn(Level, &str) + Send>;

/// Most lines that wait for stderr; older ones are in the logs of the runs.
const MOST_HELD: usize = 1000;

/// Lines for stderr that wait while the dashboard owns the screen.
#[derive(Default)]
struct Held {
    lines: VecDeque<String>,
    /// How many were let go.
    dropped: usize,
    listener: Option<Listener>,
}

impl std::fmt::Debug for Held {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Held").field("lines", &self.lines).field("dropped", &self.dropped).finish_non_exhaustive()
    }
}

#[derive(Debug, Default)]
struct State {
    run: Option<File>,
    held: Option<Held>,
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

    /// Hands lines to whoever owns the screen too, as long as they are held. The listener must not log.
    pub fn listen(&self, listener: Listener) {
        if let Some(held) = &mut self.state().held {
            held.listener = Some(listener);
        }
    }

    /// Gives the lines that waited to stderr.
    pub fn release(&self) {
        let Some(held) = self.state().held.take() else { return };
        if held.dropped > 0 {
            talk(&format!("({} earlier lines are in the logs of the runs)", held.dropped));
        }
        held.lines.iter().for_each(|line| talk(line));
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
            _ => line.0.clone(),
        };
        let text = line.0;
        let mut state = self.log.state();
        if state.quiet && level > Level::WARN {
            return;
        }
        let Some(held) = &mut state.held else { return talk(&shown) };
        if let Some(listener) = &held.listener {
            listener(level, &text);
        }
        if held.lines.len() >= MOST_HELD {
            held.lines.pop_front();
            held.dropped += 1;
        }
        held.lines.push_back(shown);
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
        let pane = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&pane);
        log.listen(Box::new(move |level, text| lines.lock().unwrap().push(format!("{level} {text}"))));
        let subscriber = tracing_subscriber::registry().with(RunLog { log: log.clone(), most: Level::INFO });
        tracing::subscriber::with_default(subscriber, || {
            tracing::warn!(target: "lumbre::test", cells = 3, "the lens is dusty");
            tracing::debug!(target: "lumbre::test", "too much detail");
            tracing::error!(target: "somebody_else", "not ours");
        });
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 1);
        assert!(text.ends_with("WARN  the lens is dusty cells=3\n"), "{text}");
        assert_eq!(log.state().held.as_ref().unwrap().lines, ["warning: the lens is dusty cells=3"]);
        assert_eq!(*pane.lock().unwrap(), ["WARN the lens is dusty cells=3"], "the pane hears it at once");
    }
}
