//! One worker: a child process, its pipes, and its supervision.

use std::collections::VecDeque;
use std::io::{self, BufRead, BufReader, BufWriter};
use std::path::PathBuf;
use std::process::{Child, ChildStderr, ChildStdin, ChildStdout, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use super::frame;
use super::message::{Reply, Request};
use super::shared;
use crate::backend_choice;
use lumbre_light::scene::compile::CompiledKey;

/// Program and arguments that start a worker.
#[derive(Clone, Debug)]
pub struct Launcher {
    /// Path of the program.
    pub program: PathBuf,
    /// Arguments of the program.
    pub arguments: Vec<String>,
    /// Time without a heartbeat after which a worker counts as stopped.
    pub heartbeat_timeout: Duration,
    /// Folder for films in shared memory; without one films go through the pipe.
    pub films: Option<PathBuf>,
}

impl Launcher {
    /// Creates a launcher with the default [`HEARTBEAT_TIMEOUT`], and shared memory for films if
    /// the system has it.
    pub fn new<const N: usize>(program: PathBuf, arguments: [&str; N]) -> Launcher {
        let films = shared::folder();
        Launcher {
            program,
            arguments: arguments.map(str::to_owned).into(),
            heartbeat_timeout: HEARTBEAT_TIMEOUT,
            films,
        }
    }
}

/// Interval of a worker's heartbeats.
pub const HEARTBEAT: Duration = Duration::from_millis(500);

/// Time without a heartbeat after which a worker counts as stopped. An overloaded machine delays a
/// thread by seconds, not by half a minute.
pub const HEARTBEAT_TIMEOUT: Duration = Duration::from_secs(30);

/// Maximum number of requests queued for a worker that is busy reading.
const MAX_QUEUED: usize = 16;

/// Number of last lines of a worker's error output that are quoted when it dies.
const QUOTED_LINES: usize = 3;

/// Number of checks, ten milliseconds apart, whether a process has exited by itself.
const EXIT_CHECKS: u32 = 50;

/// Running or dead worker.
#[derive(Debug)]
pub struct WorkerProcess {
    child: Child,
    /// Channel to the thread that writes, so that callers never wait for a worker that does not
    /// read.
    requests: Option<SyncSender<Vec<u8>>>,
    /// Channel from the thread that reads replies.
    replies: Receiver<io::Result<Option<Reply>>>,
    heartbeat_timeout: Duration,
    last_lines: Arc<Mutex<VecDeque<String>>>,
    /// Thread that logs its error output until it exits.
    logger: Option<JoinHandle<()>>,
    /// Scene that it caches, unless that has no key.
    pub(super) scene: Option<CompiledKey>,
    /// Number of the next run.
    pub(super) runs: u64,
    /// Description of how it died, once it has.
    dead: Option<String>,
}

impl WorkerProcess {
    /// Starts a worker and waits for its first message.
    ///
    /// # Errors
    /// Returns a message if it does not start, exits at once, or has another version.
    pub fn start(launcher: &Launcher) -> Result<WorkerProcess, String> {
        let mut command = Command::new(&launcher.program);
        command.args(&launcher.arguments);
        command
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped());
        // The device that the command line selected is known to this process alone.
        if let Some(device) = backend_choice::device() {
            command.env(backend_choice::DEVICE_VARIABLE, device);
        }
        // In a process group of its own, it does not receive Ctrl-C from the terminal: this process
        // handles it by ending the wave and saving.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let failed = |e: io::Error| {
            format!(
                "cannot start the worker process {}: {e}",
                launcher.program.display()
            )
        };
        let mut child = command.spawn().map_err(failed)?;
        let (Some(requests), Some(replies), Some(errors)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err("cannot start the worker process: it has no pipes".to_owned());
        };
        let last_lines = Arc::default();
        let logger = Some(spawn_logger(errors, Arc::clone(&last_lines)).map_err(failed)?);
        let (requests, replies) = (
            Some(spawn_writer(requests).map_err(failed)?),
            spawn_reader(replies).map_err(failed)?,
        );
        let heartbeat_timeout = launcher.heartbeat_timeout;
        let mut process = WorkerProcess {
            child,
            requests,
            replies,
            heartbeat_timeout,
            last_lines,
            logger,
            scene: None,
            runs: 0,
            dead: None,
        };
        match process.receive(None)? {
            Reply::Ready(version) if version == super::VERSION => Ok(process),
            Reply::Ready(version) => {
                let own = super::VERSION;
                Err(process.end(&format!(
                    "it has version {version}, this process has {own}: the program was replaced \
                     while it ran, start it again"
                )))
            }
            _ => Err(process.end("protocol error: its first message is not its version")),
        }
    }

    /// Returns its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Returns whether it has died.
    pub fn is_dead(&self) -> bool {
        self.dead.is_some()
    }

    /// Sends a request and waits for the reply, as long as heartbeats arrive and for at most
    /// `limit`.
    ///
    /// # Errors
    /// Returns a message if it has died, is stopped, takes too long or sends a corrupt reply. The
    /// worker cannot be used any more then.
    pub fn request(&mut self, request: &Request, limit: Option<Duration>) -> Result<Reply, String> {
        self.send(request)?;
        self.receive(limit)
    }

    /// Sends a request that has no reply.
    ///
    /// # Errors
    /// Returns a message in the cases of [`WorkerProcess::request`].
    pub fn send(&mut self, request: &Request) -> Result<(), String> {
        if let Some(how) = &self.dead {
            return Err(how.clone());
        }
        let sent = self
            .requests
            .as_ref()
            .is_some_and(|requests| requests.try_send(request.encode()).is_ok());
        // A writer thread that has ended met a broken pipe; the reader reports why.
        if sent {
            Ok(())
        } else {
            Err(self.end("it does not accept requests"))
        }
    }

    fn receive(&mut self, limit: Option<Duration>) -> Result<Reply, String> {
        let start = Instant::now();
        // Missed heartbeats are counted rather than seconds, since this process may have been
        // stopped itself.
        let max_missed =
            (self.heartbeat_timeout.as_secs_f64() / HEARTBEAT.as_secs_f64()).ceil() as u32;
        let mut missed = 0;
        loop {
            match self.replies.recv_timeout(HEARTBEAT) {
                Ok(Ok(Some(Reply::Heartbeat))) => missed = 0,
                Ok(Ok(Some(reply))) => return Ok(reply),
                Ok(Ok(None)) | Err(RecvTimeoutError::Disconnected) => {
                    return Err(self.end("it exited"));
                }
                Ok(Err(e)) => {
                    return Err(self.end(&format!("its reply was cut off or corrupt: {e}")));
                }
                Err(RecvTimeoutError::Timeout) => missed += 1,
            }
            if missed > max_missed {
                return Err(self.end(&format!(
                    "it sent no heartbeat for {} s",
                    self.heartbeat_timeout.as_secs()
                )));
            }
            if let Some(limit) = limit.filter(|limit| start.elapsed() > *limit) {
                return Err(self.end(&format!("it did not reply within {} s", limit.as_secs())));
            }
        }
    }

    /// Returns whether it has exited by itself. Its pipes close a moment before its status is
    /// available.
    fn has_exited(&mut self) -> bool {
        for _ in 0..EXIT_CHECKS {
            if self.child.try_wait().ok().flatten().is_some() {
                return true;
            }
            thread::sleep(Duration::from_millis(10));
        }
        false
    }

    /// Kills it, if it is running, and returns the description of its end.
    pub fn end(&mut self, why: &str) -> String {
        if let Some(how) = &self.dead {
            return how.clone();
        }
        // If it exited by itself, its status is informative; after a kill it is not.
        let by_itself = self.has_exited();
        let _ = self.child.kill();
        self.requests = None;
        let status = self
            .child
            .wait()
            .map_or_else(|e| e.to_string(), |status| status.to_string());
        let status = if by_itself {
            format!(", {status}")
        } else {
            String::new()
        };
        if let Some(logger) = self.logger.take() {
            // A panic of that thread would lose only the quoted lines.
            let _ = logger.join();
        }
        let lines = self
            .last_lines
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        let output = lines
            .iter()
            .map(String::as_str)
            .collect::<Vec<_>>()
            .join("; ");
        let output = if output.is_empty() {
            output
        } else {
            format!(" (its last output: {output})")
        };
        self.dead
            .insert(format!(
                "the worker process was lost: {why}{status}{output}"
            ))
            .clone()
    }
}

impl Drop for WorkerProcess {
    fn drop(&mut self) {
        let _ = self.child.kill();
        self.end("it is no longer needed");
    }
}

/// Starts a thread that writes messages to a worker until the channel closes or the pipe breaks.
fn spawn_writer(pipe: ChildStdin) -> io::Result<SyncSender<Vec<u8>>> {
    let (requests, waiting) = sync_channel::<Vec<u8>>(MAX_QUEUED);
    let work = move || {
        let mut pipe = BufWriter::new(pipe);
        for message in waiting {
            // The caller learns from the reader thread that the worker is gone.
            if frame::write(&mut pipe, &message).is_err() {
                break;
            }
        }
    };
    thread::Builder::new()
        .name("worker-requests".to_owned())
        .spawn(work)?;
    Ok(requests)
}

/// Starts a thread that reads replies until the worker exits or sends a corrupt message.
fn spawn_reader(pipe: ChildStdout) -> io::Result<Receiver<io::Result<Option<Reply>>>> {
    let (replies, received) = sync_channel(1);
    let work = move || {
        let mut pipe = BufReader::with_capacity(1 << 16, pipe);
        loop {
            let message = frame::read(&mut pipe);
            let reply = message.and_then(|m| {
                m.map(|m| Reply::decode(&m).map_err(io::Error::other))
                    .transpose()
            });
            let continues = matches!(reply, Ok(Some(_)));
            // Between requests no caller reads: a heartbeat may be dropped, a reply waits.
            let sent = match reply {
                Ok(Some(Reply::Heartbeat)) => {
                    !matches!(replies.try_send(reply), Err(TrySendError::Disconnected(_)))
                }
                reply => replies.send(reply).is_ok(),
            };
            if !continues || !sent {
                break;
            }
        }
    };
    thread::Builder::new()
        .name("worker-replies".to_owned())
        .spawn(work)?;
    Ok(received)
}

/// Starts a thread that logs a worker's error output and stores its last lines.
fn spawn_logger(
    errors: ChildStderr,
    last: Arc<Mutex<VecDeque<String>>>,
) -> io::Result<JoinHandle<()>> {
    let work = move || {
        for line in BufReader::new(errors)
            .lines()
            .map_while(Result::ok)
            .filter(|line| !line.is_empty())
        {
            tracing::warn!(
                "worker: {}",
                line.strip_prefix("warning: ").unwrap_or(&line)
            );
            let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
            if last.len() == QUOTED_LINES {
                last.pop_front();
            }
            last.push_back(line);
        }
    };
    thread::Builder::new()
        .name("worker-log".to_owned())
        .spawn(work)
}
