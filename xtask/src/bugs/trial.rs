//! Runs of test binaries with one bug or none.

use std::collections::BTreeMap;
use std::fs::File;
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use super::list::{Bug, TestCall};
use super::tree::TestBinary;
use crate::command::output;

/// Folder of the outputs of tests with bugs, in the root of the repository.
const OUTPUTS: &str = "target/bugs/output";

/// Shortest time in which tests with a bug have to end; more than that is a hang.
const SHORTEST_LIMIT: Duration = Duration::from_secs(120);

/// Limit on the time of tests with a bug, as a multiple of their time without one.
const LIMIT_FACTOR: u32 = 6;

/// Limit on the time of tests without a bug.
const LIMIT: Duration = Duration::from_secs(3600);

/// How a run of tests ended.
#[derive(Clone, PartialEq, Eq)]
pub enum End {
    /// All tests passed.
    Passed,
    /// These tests failed; none is named if the binary itself ended early.
    Failed(Vec<String>),
    /// The tests did not end in time.
    Hung,
}

/// The test binaries, and what is known about them without bugs.
pub struct Trials {
    binaries: BTreeMap<String, TestBinary>,
    /// Ends and times of tests without a bug.
    without_bug: BTreeMap<TestCall, (End, Duration)>,
}

impl Trials {
    /// Starts with test binaries by name.
    pub fn new(binaries: BTreeMap<String, TestBinary>) -> Self {
        Self {
            binaries,
            without_bug: BTreeMap::new(),
        }
    }

    /// Checks that calls name binaries, and that each filter selects a test.
    ///
    /// # Errors
    /// Returns a message with all wrong names.
    pub fn check<'a>(&self, calls: impl Iterator<Item = &'a TestCall>) -> Result<(), String> {
        let (mut lists, mut problems) = (BTreeMap::new(), Vec::new());
        for call in calls {
            let Some(binary) = self.binaries.get(&call.binary) else {
                let names: Vec<&str> = self.binaries.keys().map(String::as_str).collect();
                let names = names.join(", ");
                problems.push(format!("`{}` is no test binary: {names}", call.binary));
                continue;
            };
            if !lists.contains_key(&call.binary) {
                let listed = output(Command::new(&binary.path).arg("--list"))?;
                lists.insert(&call.binary, String::from_utf8_lossy(&listed).into_owned());
            }
            let tests = || {
                lists[&call.binary]
                    .lines()
                    .filter_map(|l| l.strip_suffix(": test"))
            };
            for filter in &call.filters {
                if !tests().any(|test| test.contains(filter.as_str())) {
                    problems.push(format!("`{}` has no test `{filter}`", call.binary));
                }
            }
        }
        match problems.is_empty() {
            true => Ok(()),
            false => Err(problems.join("\n")),
        }
    }

    /// Runs tests without a bug, unless that was done before, and returns how they ended and how
    /// long they took.
    ///
    /// # Errors
    /// Returns a message if the binary cannot be started.
    pub fn without_bug(&mut self, call: &TestCall) -> Result<(End, Duration), String> {
        if let Some(known) = self.without_bug.get(call) {
            return Ok(known.clone());
        }
        let found = self.execute(call, None, LIMIT)?;
        self.without_bug.insert(call.clone(), found.clone());
        Ok(found)
    }

    /// Runs tests with a bug, after they passed without it in the given time. The output is kept in
    /// a file with the name of the bug.
    ///
    /// # Errors
    /// Returns a message if the binary cannot be started.
    pub fn with_bug(&self, call: &TestCall, bug: &Bug, time: Duration) -> Result<End, String> {
        let limit = (time * LIMIT_FACTOR).max(SHORTEST_LIMIT);
        Ok(self.execute(call, Some(bug), limit)?.0)
    }

    /// Runs all tests of a binary with a bug, and returns how the first test fails that passes
    /// without it, also when it is run alone. `None` if there is no such test or no such binary.
    ///
    /// # Errors
    /// Returns a message if the binary cannot be started.
    pub fn find_failure(&mut self, binary: &str, bug: &Bug) -> Result<Option<String>, String> {
        if !self.binaries.contains_key(binary) {
            return Ok(None);
        }
        let call = |filters| TestCall {
            binary: binary.to_owned(),
            filters,
        };
        let all = call(Vec::new());
        let (without, time) = self.without_bug(&all)?;
        let failed = match self.with_bug(&all, bug, time)? {
            End::Passed => return Ok(None),
            End::Failed(tests) if !tests.is_empty() => tests,
            end => return Ok((without == End::Passed).then(|| end.describe(&all))),
        };
        for test in failed {
            let alone = call(vec![test]);
            let (without, time) = self.without_bug(&alone)?;
            if without != End::Passed {
                continue;
            }
            let end = self.with_bug(&alone, bug, time)?;
            if end != End::Passed {
                return Ok(Some(end.describe(&alone)));
            }
        }
        Ok(None)
    }

    /// Runs tests to their end or to the limit on their time.
    fn execute(
        &self,
        call: &TestCall,
        bug: Option<&Bug>,
        limit: Duration,
    ) -> Result<(End, Duration), String> {
        let binary = &self.binaries[&call.binary];
        let path = output_file(bug.map_or("without-bug", |bug| &bug.name));
        let message = |e: std::io::Error| format!("{}: {e}", path.display());
        std::fs::create_dir_all(crate::root().join(OUTPUTS)).map_err(message)?;
        let file = File::create(&path).map_err(message)?;
        let mut command = Command::new(&binary.path);
        command
            .args(&call.filters)
            .args(["--skip", "laws::"])
            .current_dir(&binary.package)
            .env("CARGO_MANIFEST_DIR", &binary.package)
            .env("INSTA_UPDATE", "no")
            .env("REQUIRE_DEVICE", "1")
            .env("LUMBRE_SHARED", shared())
            .env_remove("LUMBRE_BUG")
            .stdin(Stdio::null())
            .stderr(file.try_clone().map_err(message)?)
            .stdout(file)
            .process_group(0);
        if let Some(bug) = bug {
            command.env("LUMBRE_BUG", bug.number().to_string());
        }
        let start = Instant::now();
        let mut child = command.spawn().map_err(|e| format!("{command:?}: {e}"))?;
        let passed = await_end(&mut child, start + limit)?;
        // Programs that tests started and lost would run on beside the next tests.
        kill_group(&child)?;
        let _ = child.wait();
        let text = std::fs::read(&path).map_err(message)?;
        let end = match passed {
            None => End::Hung,
            Some(true) => End::Passed,
            Some(false) => End::Failed(failed_tests(&String::from_utf8_lossy(&text))),
        };
        Ok((end, start.elapsed()))
    }
}

impl End {
    /// Describes the end of a call in words.
    pub fn describe(&self, call: &TestCall) -> String {
        match self {
            Self::Passed => format!("{call} passes"),
            Self::Hung => format!("{call} does not end"),
            Self::Failed(tests) => match tests.as_slice() {
                [] => format!("{call} ends early"),
                [test] => format!("{} {test} fails", call.binary),
                [test, more @ ..] => {
                    format!("{} {test} and {} more fail", call.binary, more.len())
                }
            },
        }
    }
}

/// Returns the file with the output of the tests with a bug.
fn output_file(name: &str) -> PathBuf {
    crate::root().join(OUTPUTS).join(name).with_extension("txt")
}

/// Returns the folder of shared scenes and references of the original: that of the copy would be
/// elsewhere.
fn shared() -> PathBuf {
    let given = std::env::var_os("LUMBRE_SHARED");
    given.map_or_else(|| crate::root().join("../shared"), PathBuf::from)
}

/// Waits for the end of a process until an instant, and returns whether it succeeded; `None` if it
/// still runs.
fn await_end(child: &mut Child, until: Instant) -> Result<Option<bool>, String> {
    loop {
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            return Ok(Some(status.success()));
        }
        if Instant::now() > until {
            return Ok(None);
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Kills a process, which leads a group, and the processes that it started.
fn kill_group(child: &Child) -> Result<(), String> {
    let mut shell = Command::new("sh");
    shell.args([
        "-c",
        "kill -9 -- \"-$0\" 2>/dev/null",
        &child.id().to_string(),
    ]);
    // Fails where all have ended.
    shell.status().map_err(|e| e.to_string())?;
    Ok(())
}

/// Returns the tests that failed according to the output of a test binary.
fn failed_tests(text: &str) -> Vec<String> {
    let lines = text.lines();
    let failed = lines.filter_map(|l| l.strip_prefix("test ")?.strip_suffix(" ... FAILED"));
    failed.map(str::to_owned).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failed_tests_are_read_from_the_output() {
        let text = "test a::b ... ok\ntest a::c ... FAILED\ntest d ... ignored\n\n\
                    failures:\n    a::c\ntest result: FAILED. 1 passed; 1 failed\n";
        assert_eq!(failed_tests(text), ["a::c"]);
    }
}
