//! Progress lines of a hierarchy whose construction takes long.

use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

/// Number of primitives from which on progress is watched: smaller hierarchies are built within a
/// fraction of a second.
const WATCHED_FROM: usize = 200_000;

/// Time after which a line is logged, and between lines.
const INTERVAL: Duration = Duration::from_secs(1);

/// The step at which a construction is.
#[derive(Default)]
pub(super) struct BuildProgress {
    state: Mutex<State>,
    changed: Condvar,
}

#[derive(Default)]
struct State {
    step: &'static str,
    finished: bool,
}

/// Marks a construction as finished when it is dropped, also by a panic.
struct Finish<'a>(&'a BuildProgress);

impl Drop for Finish<'_> {
    fn drop(&mut self) {
        self.0.state().finished = true;
        self.0.changed.notify_all();
    }
}

impl BuildProgress {
    fn state(&self) -> MutexGuard<'_, State> {
        // The state stays usable if a thread panicked while it held the lock.
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// States the step that begins, as `the binary tree`.
    pub fn begin(&self, step: &'static str) {
        self.state().step = step;
    }

    /// Runs a construction over `count` primitives, and passes a line to `log` after every second of
    /// it.
    pub fn watch<T>(
        &self,
        count: usize,
        log: &(dyn Fn(&str) + Sync),
        build: impl FnOnce() -> T,
    ) -> T {
        if count < WATCHED_FROM {
            return build();
        }
        self.watch_every(INTERVAL, count, log, build)
    }

    fn watch_every<T>(
        &self,
        interval: Duration,
        count: usize,
        log: &(dyn Fn(&str) + Sync),
        build: impl FnOnce() -> T,
    ) -> T {
        let start = Instant::now();
        std::thread::scope(|scope| {
            scope.spawn(|| {
                let mut state = self.state();
                loop {
                    let running = |state: &mut State| !state.finished;
                    let waited = self.changed.wait_timeout_while(state, interval, running);
                    state = waited.unwrap_or_else(PoisonError::into_inner).0;
                    if state.finished {
                        return;
                    }
                    log(&format!(
                        "building the hierarchy of {count} primitives: {} ({:.0} s so far)",
                        state.step,
                        start.elapsed().as_secs_f64()
                    ));
                }
            });
            let _finish = Finish(self);
            build()
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_long_construction_states_its_step_and_a_short_one_says_nothing() {
        let lines = Mutex::new(Vec::new());
        let log = |line: &str| lines.lock().unwrap().push(line.to_owned());
        let progress = BuildProgress::default();
        let built = progress.watch_every(Duration::from_millis(5), 7, &log, || {
            progress.begin("the binary tree");
            // Until the second line.
            while lines.lock().unwrap().len() < 2 {
                std::thread::sleep(Duration::from_millis(1));
            }
            42
        });
        assert_eq!(built, 42);
        let lines = std::mem::take(&mut *lines.lock().unwrap());
        assert!(
            lines[1].contains("7 primitives: the binary tree"),
            "{lines:?}"
        );
        let silent = |_: &str| panic!("a small hierarchy is not watched");
        assert_eq!(BuildProgress::default().watch(1000, &silent, || 1), 1);
    }
}
