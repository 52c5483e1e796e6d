//! Time and memory limits of a script.

use std::cell::{Cell, RefCell};
use std::time::{Duration, Instant};

use super::error::{Problem, ScriptError};
use super::source::{Place, Sources};

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
    seconds: f64,
    what: &'static str,
}

impl Watch {
    /// Starts the clock for `what`.
    pub fn start(&self, what: &'static str, seconds: f64) {
        let limit = Duration::try_from_secs_f64(seconds).unwrap_or(Duration::MAX);
        let deadline = Instant::now().checked_add(limit);
        self.running.set(deadline.map(|deadline| Running { deadline, seconds, what }));
        self.expired.replace(None);
        self.last_seen.replace(None);
    }

    /// Stops the clock.
    pub fn stop(&self) {
        self.running.set(None);
    }

    /// Remembers where the script is, and says whether its time is up.
    ///
    /// # Errors
    /// When it is. The first such error is kept: a script cannot swallow it.
    pub fn check(&self, place: Option<Place>, sources: &Sources) -> Result<(), ScriptError> {
        if place.is_some() {
            self.last_seen.replace(place);
        }
        let Some(running) = self.running.get() else { return Ok(()) };
        if Instant::now() < running.deadline {
            return Ok(());
        }
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
    fn everyday_patterns_are_quick_and_exploding_ones_are_not() {
        assert!(pattern_is_quick(200, b"^(%w+)_(%w+)_(%d+)%.scn$", false));
        assert!(pattern_is_quick(1 << 20, b"scene", false));
        assert!(pattern_is_quick(40_000, b"%s+", false));
        assert!(!pattern_is_quick(1000, b"a-a-a-a-a-a-a-a-b", false));
        assert!(!pattern_is_quick(1000, b".*.*.*.*x", false));
        assert!(!pattern_is_quick(1 << 28, &[b'a'; 1000], true));
    }
}
