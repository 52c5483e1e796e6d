//! Time and memory limits of scripts: [`Limits`], and the [`Watchdog`] that enforces the time
//! limit.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use super::error::{Problem, ScriptError};
use super::source::{SourcePlace, Sources};
use lumbre_night::experiment::processor_time;

/// Limits on the resources that a script may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Seconds for loading the script and its modules.
    pub load_s: f64,
    /// Seconds for each later call of one of the script's functions.
    pub hook_s: f64,
    /// Size of the Lua memory in bytes.
    pub memory: usize,
}

impl Default for Limits {
    /// Returns 10 s for loading, 2 s for each function call, and 256 MiB.
    fn default() -> Limits {
        Limits {
            load_s: 10.0,
            hook_s: 2.0,
            memory: 256 << 20,
        }
    }
}

/// Measures the time of a running Lua call and interrupts it when its limit has passed.
#[derive(Debug, Default)]
pub struct Watchdog {
    running: Cell<Option<RunningCall>>,
    expired: RefCell<Option<ScriptError>>,
    last_place: RefCell<Option<SourcePlace>>,
}

#[derive(Clone, Copy, Debug)]
struct RunningCall {
    deadline: Instant,
    /// Time at which the call ends even if the thread was mostly waiting; see
    /// [`Watchdog::is_late`].
    wall_deadline: Instant,
    /// Processor time that the call may use.
    allowed: Duration,
    /// Processor time of this thread at the start of the call; `None` if the system cannot report
    /// it.
    worked: Option<Duration>,
    seconds: f64,
    what: &'static str,
}

/// Largest ratio of wall time to time limit, for scripts that wait for a processor on a busy
/// machine.
const MAX_WALL_FACTOR: u32 = 20;

impl Watchdog {
    /// Starts the measurement of a call; `what` names it in errors.
    pub fn start(&self, what: &'static str, seconds: f64) {
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let now = Instant::now();
        let wall_deadline = limit
            .checked_mul(MAX_WALL_FACTOR)
            .and_then(|most| now.checked_add(most));
        self.running
            .set(wall_deadline.map(|wall_deadline| RunningCall {
                deadline: now + limit,
                wall_deadline,
                allowed: limit,
                worked: processor_time::thread_time(),
                seconds,
                what,
            }));
        self.expired.replace(None);
        self.last_place.replace(None);
    }

    /// Stops the measurement.
    pub fn stop(&self) {
        self.running.set(None);
    }

    /// Runs `read`, which loads a file named by the script, and does not count its time: files have
    /// limits of their own.
    pub fn pause_for<T>(&self, read: impl FnOnce() -> T) -> T {
        let (began, before) = (Instant::now(), processor_time::thread_time());
        let result = read();
        if let Some(mut running) = self.running.get() {
            let took = began.elapsed();
            let worked =
                before.and_then(|before| processor_time::thread_time()?.checked_sub(before));
            running.deadline += took;
            running.wall_deadline += took;
            running.allowed += worked.unwrap_or(took);
            self.running.set(Some(running));
        }
        result
    }

    /// Returns the running call if its time limit has passed. Both the wall time and the processor
    /// time of this thread must exceed the limit, so that a script on a busy machine is not
    /// interrupted while it waits for a processor.
    fn is_late(&self) -> Option<RunningCall> {
        let running = self.running.get()?;
        let now = Instant::now();
        if now < running.deadline {
            return None;
        }
        let spent = running
            .worked
            .and_then(|before| processor_time::thread_time()?.checked_sub(before));
        match spent.and_then(|spent| running.allowed.checked_sub(spent)) {
            Some(left) if now < running.wall_deadline && !left.is_zero() => {
                self.running.set(Some(RunningCall {
                    deadline: now + left,
                    ..running
                }));
                None
            }
            _ => Some(running),
        }
    }

    /// Stores the current position of the script and checks the time limit.
    ///
    /// # Errors
    /// Returns an error if the limit has passed. The first such error is stored and returned by
    /// every later check, so a script cannot catch it.
    pub fn check(&self, place: Option<SourcePlace>, sources: &Sources) -> Result<(), ScriptError> {
        if place.is_some() {
            self.last_place.replace(place);
        }
        let Some(running) = self.is_late() else {
            return Ok(());
        };
        if self.expired.borrow().is_none() {
            let problem = Problem::Time {
                what: running.what,
                seconds: running.seconds,
            };
            let help = "look for a loop that never ends: a script only describes what to render";
            self.expired
                .replace(Some(self.error_at_last_place(problem, help, sources)));
        }
        self.expired().map_or(Ok(()), Err)
    }

    /// Returns the error of the limit that passed since [`Watchdog::start`], if any.
    pub fn expired(&self) -> Option<ScriptError> {
        self.expired.borrow().clone()
    }

    /// Returns an error at the last stored position, or without a line if there is none.
    pub fn error_at_last_place(
        &self,
        problem: Problem,
        help: &str,
        sources: &Sources,
    ) -> ScriptError {
        match &*self.last_place.borrow() {
            Some(place) => sources.error(place, problem, Some(help.to_owned())),
            None => ScriptError::new(&sources.get(0).file, problem, Some(help.to_owned()), None),
        }
    }
}

/// Returns whether matching a Lua pattern against a text takes at most a few seconds in the worst
/// case.
///
/// The matcher backtracks: with `q` repetitions it may try every way of cutting a text of `n` bytes
/// into `q` pieces, from every start. `plain` searches compare at every position.
pub fn pattern_is_quick(text_len: usize, pattern: &[u8], plain: bool) -> bool {
    const MOST_STEPS: f64 = 4e9;
    let n = text_len as f64 + 1.0;
    let special = pattern.iter().any(|b| b"^$*+?.([%-".contains(b));
    if plain || !special {
        return n * pattern.len() as f64 <= MOST_STEPS;
    }
    let anchored = pattern.first() == Some(&b'^');
    let mut ways = if anchored { 1.0 } else { n };
    let mut repetitions = 0.0;
    let mut i = 0;
    while i < pattern.len() {
        let repeats = match pattern[i] {
            b'%' => {
                i += 1;
                pattern
                    .get(i)
                    .is_some_and(|b| b.is_ascii_digit() || *b == b'b')
            }
            b'*' | b'+' | b'-' | b'?' => true,
            _ => false,
        };
        if repeats {
            repetitions += 1.0;
            ways *= (n + repetitions) / repetitions;
        }
        i += 1;
    }
    ways <= MOST_STEPS
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn waiting_and_reading_files_do_not_count_as_a_scripts_time() {
        let watch = Watchdog::default();
        let limit = Duration::from_millis(20);
        watch.start("loading", limit.as_secs_f64());
        if processor_time::thread_time().is_some() {
            std::thread::sleep(2 * limit);
            assert!(watch.is_late().is_none(), "waiting does not count");
        }
        let work = || {
            let (worked, began) = (processor_time::thread_time(), Instant::now());
            let spent = || match worked {
                Some(then) => processor_time::thread_time()
                    .and_then(|now| now.checked_sub(then))
                    .unwrap_or_default(),
                None => began.elapsed(),
            };
            while spent() < 2 * limit {}
        };
        watch.pause_for(work);
        assert!(watch.is_late().is_none(), "reading a file does not count");
        if processor_time::thread_time().is_some() {
            std::thread::sleep(2 * limit);
            assert!(watch.is_late().is_none(), "nor does it later");
        }
        work();
        assert!(
            watch.is_late().is_some(),
            "the limit on processor time has passed"
        );
        watch.stop();
        assert!(watch.is_late().is_none());
    }

    #[test]
    fn everyday_patterns_are_quick_and_exploding_ones_are_not() {
        assert!(pattern_is_quick(200, b"^(%w+)_(%w+)_(%d+)%.scn$", false));
        assert!(pattern_is_quick(1 << 20, b"scene", false));
        assert!(pattern_is_quick(40_000, b"%s+", false));
        assert!(!pattern_is_quick(1000, b"a-a-a-a-a-a-a-a-b", false));
        assert!(!pattern_is_quick(1000, b".*.*.*.*x", false));
        assert!(!pattern_is_quick(1 << 28, &[b'a'; 1000], true));
    }
}
