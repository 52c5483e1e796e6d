//! Time and memory limits of a script.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use super::error::{Problem, ScriptError};
use super::source::{Place, Sources};
use crate::experiment::processor;

/// What a script may use.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Seconds for loading: the script and everything it requires.
    pub load_s: f64,
    /// Seconds for each later call of one of its functions.
    pub hook_s: f64,
    /// Bytes of Lua memory.
    pub memory: usize,
}

impl Default for Limits {
    /// Ten seconds, two seconds, 256 MiB.
    fn default() -> Limits {
        Limits { load_s: 10.0, hook_s: 2.0, memory: 256 << 20 }
    }
}

/// Watches the clock while Lua runs.
#[derive(Debug, Default)]
pub struct Watch {
    running: Cell<Option<Running>>,
    expired: RefCell<Option<ScriptError>>,
    last_seen: RefCell<Option<Place>>,
}

#[derive(Clone, Copy, Debug)]
struct Running {
    deadline: Instant,
    /// By then it ends even where nothing was done: see [`Watch::is_late`].
    last: Instant,
    /// What this thread may work, and had worked when the clock was started, where the system tells.
    allowed: Duration,
    worked: Option<Duration>,
    seconds: f64,
    what: &'static str,
}

/// How many times as long as its limit a script may take on a machine that is busy with other things.
const MOST_WAITING: u32 = 20;

impl Watch {
    /// Starts the clock for `what`.
    pub fn start(&self, what: &'static str, seconds: f64) {
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let now = Instant::now();
        let last = limit.checked_mul(MOST_WAITING).and_then(|most| now.checked_add(most));
        self.running.set(last.map(|last| Running {
            deadline: now + limit,
            last,
            allowed: limit,
            worked: processor::of_thread(),
            seconds,
            what,
        }));
        self.expired.replace(None);
        self.last_seen.replace(None);
    }

    /// Stops the clock.
    pub fn stop(&self) {
        self.running.set(None);
    }

    /// Reads a file that the script names, and takes off what was spent on it: files have limits of their own.
    pub fn excused<T>(&self, read: impl FnOnce() -> T) -> T {
        let (began, before) = (Instant::now(), processor::of_thread());
        let found = read();
        if let Some(mut running) = self.running.get() {
            let took = began.elapsed();
            let worked = before.and_then(|before| processor::of_thread()?.checked_sub(before));
            running.deadline += took;
            running.last += took;
            running.allowed += worked.unwrap_or(took);
            self.running.set(Some(running));
        }
        found
    }

    /// Whether the time is up: by the clock, and by what this thread has worked since, where the system tells, so that a
    /// script that waits for a processor on a busy machine has its time as well.
    fn is_late(&self) -> Option<Running> {
        let running = self.running.get()?;
        let now = Instant::now();
        if now < running.deadline {
            return None;
        }
        let spent = running.worked.and_then(|before| processor::of_thread()?.checked_sub(before));
        match spent.and_then(|spent| running.allowed.checked_sub(spent)) {
            Some(left) if now < running.last && !left.is_zero() => {
                self.running.set(Some(Running { deadline: now + left, ..running }));
                None
            }
            _ => Some(running),
        }
    }

    /// Remembers where the script is, and says whether its time is up.
    ///
    /// # Errors
    /// When it is. The first such error is kept: a script cannot swallow it.
    pub fn check(&self, place: Option<Place>, sources: &Sources) -> Result<(), ScriptError> {
        if place.is_some() {
            self.last_seen.replace(place);
        }
        let Some(running) = self.is_late() else { return Ok(()) };
        if self.expired.borrow().is_none() {
            let problem = Problem::Time { what: running.what, seconds: running.seconds };
            let help = "a script only describes what to render; is there a loop that never ends?";
            self.expired.replace(Some(self.here(problem, help, sources)));
        }
        self.expired().map_or(Ok(()), Err)
    }

    /// The error of a limit that was passed since the clock was started.
    pub fn expired(&self) -> Option<ScriptError> {
        self.expired.borrow().clone()
    }

    /// An error at the last line that was seen running, or about the whole script if none was.
    pub fn here(&self, problem: Problem, help: &str, sources: &Sources) -> ScriptError {
        match &*self.last_seen.borrow() {
            Some(place) => sources.error(place, problem, Some(help.to_owned())),
            None => ScriptError::new(&sources.get(0).file, problem, Some(help.to_owned()), None),
        }
    }
}

/// Whether matching a Lua pattern against a text stays below a few seconds in the worst case.
///
/// The matcher backtracks: with `q` repetitions it may try every way of cutting a text of `n` bytes into `q` pieces,
/// from every start. `plain` searches compare at every position.
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
                pattern.get(i).is_some_and(|b| b.is_ascii_digit() || *b == b'b')
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
    fn waiting_and_reading_files_are_not_a_scripts_own_time() {
        let watch = Watch::default();
        let limit = Duration::from_millis(20);
        watch.start("loading", limit.as_secs_f64());
        if processor::of_thread().is_some() {
            std::thread::sleep(2 * limit);
            assert!(watch.is_late().is_none(), "it has not worked");
        }
        let work = || {
            let (worked, began) = (processor::of_thread(), Instant::now());
            let spent = || match worked {
                Some(then) => processor::of_thread().and_then(|now| now.checked_sub(then)).unwrap_or_default(),
                None => began.elapsed(),
            };
            while spent() < 2 * limit {}
        };
        watch.excused(work);
        assert!(watch.is_late().is_none(), "that was the reading of a file");
        work();
        assert!(watch.is_late().is_some(), "it has worked twice as long as it may");
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
