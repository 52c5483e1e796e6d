//! Processes of other programs: each is the leader of a process group of its own, which is ended as
//! a whole; the last of its output is kept, with a limit on memory and on waiting.

use std::collections::{BTreeSet, VecDeque};
use std::ffi::OsStr;
use std::io::{Read, Write};
use std::process::{Child, ChildStdin, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

/// Time between two checks whether a process has exited or is to be ended.
const POLL: Duration = Duration::from_millis(10);
/// Time that a process group has to exit after SIGTERM, before SIGKILL.
const GRACE: Duration = Duration::from_millis(500);
/// Greatest number of bytes of each output that are kept: the last ones.
const KEPT_BYTES: usize = 64 << 10;
/// Number of last lines that are quoted in errors, and the greatest length of each in characters.
const LAST_LINES: usize = 4;
const MAX_LINE: usize = 300;
/// Greatest number of lines of a reply that are kept until they are read.
const MAX_UNREAD: usize = 64;

/// Process groups that are running, ended by [`end_all`].
static RUNNING: Mutex<BTreeSet<u32>> = Mutex::new(BTreeSet::new());

/// Ends the processes of all external programs that this process started. For an exit that does not
/// unwind, such as after a second Ctrl-C.
pub fn end_all() {
    let running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
    for leader in running.iter() {
        signal_group(*leader, EndSignal::Kill);
    }
}

/// Runs a program, which reads nothing, to its end. Returns its exit status, and the lines of its
/// output that are not empty: of much output the last ones, with control characters made visible.
///
/// # Errors
/// Returns a message if it cannot be started, or has not exited within `limit`, when it is ended.
pub fn output<S: AsRef<OsStr>>(
    words: &[S],
    limit: Duration,
) -> Result<(ExitStatus, Vec<String>), String> {
    let mut process = Process::start(words, Talk::None)?;
    let patience = Patience {
        until: Instant::now() + limit,
        cancelled: &|| false,
    };
    let (status, _) = process
        .wait(&patience)
        .map_err(|_| format!("it was ended because it ran for {} s", limit.as_secs_f64()))?;
    let text = kept_text(&process.stdout) + &kept_text(&process.stderr);
    let lines = text.lines().map(str::trim).filter(|line| !line.is_empty());
    Ok((status, lines.map(printable).collect()))
}

/// Why waiting for a process ended early.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Interruption {
    /// The time limit passed.
    Timeout,
    /// The caller no longer wants the result.
    Cancelled,
}

/// Limits on waiting for a process.
pub(super) struct Patience<'a> {
    /// When to give up.
    pub(super) until: Instant,
    /// Whether the caller no longer wants the result.
    pub(super) cancelled: &'a dyn Fn() -> bool,
}

impl Patience<'_> {
    /// Returns why to stop waiting, if there is a reason.
    fn interruption(&self) -> Option<Interruption> {
        if (self.cancelled)() {
            Some(Interruption::Cancelled)
        } else if Instant::now() >= self.until {
            Some(Interruption::Timeout)
        } else {
            None
        }
    }
}

/// The last bytes of an output.
type Kept = Arc<Mutex<VecDeque<u8>>>;

/// Running program with its outputs.
pub(super) struct Process {
    child: Child,
    /// Standard input, if it is a pipe.
    input: Option<ChildStdin>,
    /// Complete lines of standard output, if they are read one by one.
    lines: Option<Receiver<String>>,
    stdout: Kept,
    stderr: Kept,
    /// Disconnects when both outputs have ended.
    outputs: Receiver<()>,
    started: Instant,
    exited: Option<ExitStatus>,
}

/// Communication with a program.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Talk {
    /// It reads nothing.
    None,
    /// It reads lines and replies with lines.
    Lines,
}

impl Process {
    /// Starts a program with its arguments, without a shell.
    ///
    /// # Errors
    /// Returns a message if it cannot be started.
    pub(super) fn start<S: AsRef<OsStr>>(words: &[S], talk: Talk) -> Result<Process, String> {
        let (program, arguments) = words.split_first().ok_or("there is no program to run")?;
        let mut command = Command::new(program);
        command
            .args(arguments)
            .stdin(match talk {
                Talk::None => Stdio::null(),
                Talk::Lines => Stdio::piped(),
            })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // A group of its own: a Ctrl-C in the terminal reaches this process only, which then ends
        // the group.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let started = Instant::now();
        let mut child = command
            .spawn()
            .map_err(|e| format!("`{}` cannot be started: {e}", program.as_ref().display()))?;
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        running.insert(child.id());
        drop(running);
        let (alive, outputs) = sync_channel(1);
        let (stdout, stderr) = (Kept::default(), Kept::default());
        let (send_lines, lines) = sync_channel(MAX_UNREAD);
        let send_lines = (talk == Talk::Lines).then_some(send_lines);
        let lines = (talk == Talk::Lines).then_some(lines);
        let pipes = child.stdout.take().zip(child.stderr.take());
        let input = child.stdin.take();
        let process = Process {
            child,
            input,
            lines,
            stdout,
            stderr,
            outputs,
            started,
            exited: None,
        };
        let (out, err) = pipes.ok_or("its output cannot be read")?;
        keep(out, &process.stdout, send_lines, alive.clone())?;
        keep(err, &process.stderr, None, alive)?;
        Ok(process)
    }

    /// Waits until the program has exited, and ends what it left running. Returns its exit status
    /// and the seconds since it was started.
    pub(super) fn wait(
        &mut self,
        patience: &Patience<'_>,
    ) -> Result<(ExitStatus, f64), Interruption> {
        let mut ended = false;
        loop {
            if self.has_exited() {
                let seconds = self.started.elapsed().as_secs_f64();
                if let Some(status) = self.end() {
                    return Ok((status, seconds));
                }
            }
            if let Some(why) = patience.interruption() {
                self.end();
                return Err(why);
            }
            // The end of the outputs mostly means that the program is about to exit.
            if ended {
                std::thread::sleep(Duration::from_millis(1));
            } else {
                ended = self.outputs.recv_timeout(POLL) == Err(RecvTimeoutError::Disconnected);
            }
        }
    }

    /// Writes a line to its standard input. If it has exited, reading its reply reports that.
    pub(super) fn write_line(&mut self, line: &str) {
        if let Some(input) = &mut self.input {
            let _ = input
                .write_all(format!("{line}\n").as_bytes())
                .and_then(|()| input.flush());
        }
    }

    /// Returns the next line of its standard output, or `None` if there are no more.
    pub(super) fn read_line(
        &mut self,
        patience: &Patience<'_>,
    ) -> Result<Option<String>, Interruption> {
        let Some(lines) = &self.lines else {
            return Ok(None);
        };
        loop {
            match lines.recv_timeout(POLL) {
                Ok(line) => return Ok(Some(line)),
                Err(RecvTimeoutError::Disconnected) => return Ok(None),
                Err(RecvTimeoutError::Timeout) => {}
            }
            if let Some(why) = patience.interruption() {
                return Err(why);
            }
        }
    }

    /// Closes its standard input and gives it a moment to exit by itself, then ends its process
    /// group. Returns its exit status.
    pub(super) fn close(&mut self) -> Option<ExitStatus> {
        self.input = None;
        self.wait_for_exit(GRACE);
        self.end()
    }

    /// Ends the process group and waits for the program, so that no process is left behind. Returns
    /// its exit status.
    fn end(&mut self) -> Option<ExitStatus> {
        if self.exited.is_some() {
            return self.exited;
        }
        self.input = None;
        let leader = self.child.id();
        if !self.has_exited() {
            signal_group(leader, EndSignal::Terminate);
            self.wait_for_exit(GRACE);
        }
        // The leader has not been waited for, so its number still belongs to its group.
        signal_group(leader, EndSignal::Kill);
        // Where there are no process groups.
        let _ = self.child.kill();
        self.exited = self.child.wait().ok();
        let mut running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        running.remove(&leader);
        drop(running);
        // A process that left the group may hold the outputs open for ever.
        let since = Instant::now();
        while since.elapsed() < GRACE {
            if self.outputs.recv_timeout(POLL) == Err(RecvTimeoutError::Disconnected) {
                break;
            }
        }
        self.exited
    }

    fn wait_for_exit(&mut self, limit: Duration) {
        let since = Instant::now();
        while !self.has_exited() && since.elapsed() < limit {
            std::thread::sleep(Duration::from_millis(2));
        }
    }

    /// Whether the program has exited. Its number remains reserved until it is waited for.
    #[cfg(unix)]
    fn has_exited(&mut self) -> bool {
        use rustix::process::{Pid, WaitId, WaitIdOptions, waitid};
        let Some(leader) = Pid::from_raw(self.child.id() as i32) else {
            return true;
        };
        let options = WaitIdOptions::EXITED | WaitIdOptions::NOHANG | WaitIdOptions::NOWAIT;
        !matches!(waitid(WaitId::Pid(leader), options), Ok(None))
    }

    /// Whether the program has exited.
    #[cfg(not(unix))]
    fn has_exited(&mut self) -> bool {
        !matches!(self.child.try_wait(), Ok(None))
    }

    /// Returns its standard output so far: the last part, if it is long.
    pub(super) fn stdout(&self) -> String {
        kept_text(&self.stdout)
    }

    /// Returns the last lines of its error output, or else of its standard output, for an error
    /// message; empty if it wrote nothing. Control characters are made visible.
    pub(super) fn last_lines(&self) -> String {
        [&self.stderr, &self.stdout]
            .map(|kept| last_lines(&kept_text(kept)))
            .into_iter()
            .find(|lines| !lines.is_empty())
            .unwrap_or_default()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.end();
    }
}

/// Signal that ends a process group.
#[derive(Clone, Copy)]
enum EndSignal {
    Terminate,
    Kill,
}

/// Sends a signal to all processes of a group.
fn signal_group(leader: u32, signal: EndSignal) {
    #[cfg(unix)]
    {
        use rustix::process::{Pid, Signal, kill_process_group};
        let signal = match signal {
            EndSignal::Terminate => Signal::TERM,
            EndSignal::Kill => Signal::KILL,
        };
        if let Some(leader) = Pid::from_raw(leader as i32) {
            // The group may have ended already.
            let _ = kill_process_group(leader, signal);
        }
    }
    #[cfg(not(unix))]
    let _ = (leader, signal);
}

/// Starts a thread that reads an output to its end, keeps its last bytes, and sends its lines. It
/// holds `alive` until then.
fn keep(
    mut from: impl Read + Send + 'static,
    kept: &Kept,
    lines: Option<SyncSender<String>>,
    alive: SyncSender<()>,
) -> Result<(), String> {
    let kept = Arc::clone(kept);
    let read = move || {
        let mut buffer = [0; 4096];
        let mut line = Vec::new();
        while let Ok(count @ 1..) = from.read(&mut buffer) {
            let bytes = &buffer[..count];
            let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
            kept.extend(bytes);
            let excess = kept.len().saturating_sub(KEPT_BYTES);
            kept.drain(..excess);
            drop(kept);
            for byte in bytes.iter().filter(|_| lines.is_some()) {
                if *byte != b'\n' {
                    // The rest of an endless line is dropped; it is no reply in any case.
                    if line.len() < KEPT_BYTES {
                        line.push(*byte);
                    }
                    continue;
                }
                let text = String::from_utf8_lossy(&line).trim_end().to_owned();
                line.clear();
                if let Some(lines) = &lines {
                    // Nothing replies that often, so lines are dropped if many are unread.
                    let _ = lines.try_send(text);
                }
            }
        }
        drop(alive);
    };
    std::thread::Builder::new()
        .name("output".to_owned())
        .spawn(read)
        .map(drop)
        .map_err(|e| format!("cannot start a thread: {e}"))
}

fn kept_text(kept: &Kept) -> String {
    let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
    String::from_utf8_lossy(kept.make_contiguous()).into_owned()
}

/// Returns the last non-empty lines of an output, joined by `; `, with control characters made
/// visible.
pub(super) fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text
        .lines()
        .map(str::trim)
        .filter(|line| !line.is_empty())
        .collect();
    let last = &lines[lines.len().saturating_sub(LAST_LINES)..];
    last.iter()
        .map(|line| printable(line))
        .collect::<Vec<_>>()
        .join("; ")
}

/// Makes control characters of a line visible, and cuts it if it is long.
pub(super) fn printable(line: &str) -> String {
    let mut shown: String = line
        .chars()
        .take(MAX_LINE)
        .map(|c| {
            // Some characters change the order of the text around them.
            let reorders = matches!(c, '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}');
            if c.is_control() || reorders {
                c.escape_unicode().to_string()
            } else {
                c.to_string()
            }
        })
        .collect();
    if line.chars().count() > MAX_LINE {
        shown += " ..";
    }
    shown
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    fn shell(script: &str, talk: Talk) -> Process {
        Process::start(&["sh", "-c", script].map(str::to_owned), talk).expect("sh starts")
    }

    fn patience(seconds: f64) -> Patience<'static> {
        Patience {
            until: Instant::now() + Duration::from_secs_f64(seconds),
            cancelled: &|| false,
        }
    }

    /// Whether a process exists; one that has exited and was not waited for counts.
    fn exists(process: u32) -> bool {
        rustix::process::Pid::from_raw(process as i32)
            .is_some_and(|process| rustix::process::test_kill_process(process).is_ok())
    }

    fn wait_until(what: impl Fn() -> bool) {
        let since = Instant::now();
        while !what() {
            assert!(since.elapsed() < Duration::from_secs(20), "waited too long");
            std::thread::sleep(Duration::from_millis(5));
        }
    }

    #[test]
    fn exit_status_output_and_time_are_those_of_the_program() {
        let mut process = shell("echo one; echo two >&2; sleep 0.2; exit 3", Talk::None);
        let (status, seconds) = process.wait(&patience(30.0)).unwrap();
        assert_eq!(status.code(), Some(3));
        assert!((0.2..20.0).contains(&seconds), "{seconds}");
        assert_eq!(
            (process.stdout().as_str(), process.last_lines().as_str()),
            ("one\n", "two")
        );
    }

    #[test]
    fn a_timeout_ends_the_whole_group_also_if_it_ignores_the_first_signal() {
        let script = "trap '' TERM; (trap '' TERM; while :; do sleep 1; done) & echo $!; wait";
        let mut process = shell(script, Talk::None);
        wait_until(|| !process.stdout().is_empty());
        let background: u32 = process.stdout().trim().parse().unwrap();
        let leader = process.child.id();
        assert_eq!(
            process.wait(&patience(0.05)).unwrap_err(),
            Interruption::Timeout
        );
        wait_until(|| !exists(background));
        assert!(!exists(leader), "the leader was not waited for");
        assert!(!RUNNING.lock().unwrap().contains(&leader));
    }

    #[test]
    fn what_a_program_leaves_running_is_ended_with_it() {
        let mut process = shell("sleep 600 & echo $!", Talk::None);
        let since = Instant::now();
        process.wait(&patience(30.0)).unwrap();
        assert!(since.elapsed() < Duration::from_secs(15));
        let background: u32 = process.stdout().trim().parse().unwrap();
        wait_until(|| !exists(background));
    }

    #[test]
    fn cancelling_ends_a_program_that_hangs() {
        let mut process = shell("sleep 600", Talk::None);
        let cancelled = Patience {
            cancelled: &|| true,
            ..patience(600.0)
        };
        assert_eq!(
            process.wait(&cancelled).unwrap_err(),
            Interruption::Cancelled
        );
        assert!(!exists(process.child.id()));
    }

    #[test]
    fn endless_output_is_kept_up_to_a_limit() {
        let mut process = shell(
            "yes nonsense | head -c 3000000; echo; echo last",
            Talk::None,
        );
        process.wait(&patience(60.0)).unwrap();
        assert!(process.stdout().len() <= KEPT_BYTES);
        assert!(process.last_lines().ends_with("; last"));
    }

    #[test]
    fn lines_are_exchanged_and_the_end_is_noticed() {
        let mut process = shell("echo ready; read x; echo got $x; exit 0", Talk::Lines);
        let line = |process: &mut Process| process.read_line(&patience(30.0)).unwrap();
        assert_eq!(line(&mut process).as_deref(), Some("ready"));
        process.write_line("7");
        assert_eq!(line(&mut process).as_deref(), Some("got 7"));
        assert_eq!(line(&mut process), None);
        assert!(process.close().unwrap().success());
        let mut silent = shell("sleep 600", Talk::Lines);
        assert_eq!(
            silent.read_line(&patience(0.02)),
            Err(Interruption::Timeout)
        );
    }

    #[test]
    fn a_missing_program_is_reported_and_control_characters_are_visible() {
        let reason = Process::start(&["/nowhere/renderer".to_owned()], Talk::None)
            .err()
            .unwrap();
        assert!(
            reason.contains("`/nowhere/renderer` cannot be started"),
            "{reason}"
        );
        assert_eq!(
            last_lines("a\n\n  \u{1b}[31mred\u{7}\u{202e}\n"),
            "a; \\u{1b}[31mred\\u{7}\\u{202e}"
        );
        assert!(last_lines(&"x".repeat(5000)).len() < 400);
    }
}
