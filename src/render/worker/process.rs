//! One worker: a child process, the pipes to it, and what becomes of it.

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

/// How a worker is started: a program and its arguments.
#[derive(Clone, Debug)]
pub struct Launcher {
    /// The program.
    pub program: PathBuf,
    /// Its arguments.
    pub arguments: Vec<String>,
    /// How long a worker may give no sign of life before it counts as stopped.
    pub silence: Duration,
    /// The folder for films that program and worker both see; without one films go through the pipe.
    pub films: Option<PathBuf>,
}

impl Launcher {
    /// A program with its arguments, which counts as stopped after [`SILENCE`], and films in memory where that can be.
    pub fn new<const N: usize>(program: PathBuf, arguments: [&str; N]) -> Launcher {
        let films = shared::folder();
        Launcher { program, arguments: arguments.map(str::to_owned).into(), silence: SILENCE, films }
    }
}

/// How often a worker gives a sign of life.
pub const BEAT: Duration = Duration::from_millis(500);

/// How long a worker may give none. A machine that is out of breath delays a thread by seconds, not by half a minute.
pub const SILENCE: Duration = Duration::from_secs(30);

/// Requests that may wait for a worker that reads an earlier one.
const WAITING: usize = 16;

/// Lines of a worker that are kept, to be told when it dies.
const LAST_WORDS: usize = 3;

/// Looks at a process that may be about to end, ten milliseconds apart.
const LAST_MOMENTS: u32 = 50;

/// A worker that runs, or has died.
#[derive(Debug)]
pub struct Process {
    child: Child,
    /// To the thread that writes, so that nobody waits for a worker that does not read.
    requests: Option<SyncSender<Vec<u8>>>,
    /// From the thread that reads.
    replies: Receiver<io::Result<Option<Reply>>>,
    silence: Duration,
    last_words: Arc<Mutex<VecDeque<String>>>,
    /// Hears what it says until it ends.
    listener: Option<JoinHandle<()>>,
    /// The hash of the scene that it keeps.
    pub(super) scene: [u8; 32],
    /// The next run's number.
    pub(super) runs: u64,
    /// How it ended, once it has.
    dead: Option<String>,
}

impl Process {
    /// Starts a worker and waits for its first word.
    ///
    /// # Errors
    /// When it does not start, dies at once, or is of another version.
    pub fn start(launcher: &Launcher) -> Result<Process, String> {
        let mut command = Command::new(&launcher.program);
        command.args(&launcher.arguments);
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
        // A Ctrl-C in the terminal is for this program, which ends the wave and keeps what is there.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let failed = |e: io::Error| format!("no worker process: {} does not start: {e}", launcher.program.display());
        let mut child = command.spawn().map_err(failed)?;
        let (Some(requests), Some(replies), Some(talk)) =
            (child.stdin.take(), child.stdout.take(), child.stderr.take())
        else {
            return Err("no worker process: it has no pipes".to_owned());
        };
        let last_words = Arc::default();
        let listener = Some(listen(talk, Arc::clone(&last_words)).map_err(failed)?);
        let (requests, replies) = (Some(write(requests).map_err(failed)?), read(replies).map_err(failed)?);
        let silence = launcher.silence;
        let mut process =
            Process { child, requests, replies, silence, last_words, listener, scene: [0; 32], runs: 0, dead: None };
        match process.hear(None)? {
            Reply::Ready(version) if version == super::VERSION => Ok(process),
            Reply::Ready(version) => {
                let ours = super::VERSION;
                Err(process.end(&format!("it is version {version} of this program, which is {ours}; start it again")))
            }
            _ => Err(process.end("its first word is not what it should be")),
        }
    }

    /// Its process id.
    pub fn id(&self) -> u32 {
        self.child.id()
    }

    /// Whether it has died.
    pub fn is_dead(&self) -> bool {
        self.dead.is_some()
    }

    /// Asks it something and waits for the answer: as long as it gives signs of life and, where there is a `limit`, no longer.
    ///
    /// # Errors
    /// When it has died, is stopped, takes too long or makes no sense, in words; it is then gone for good.
    pub fn ask(&mut self, request: &Request, limit: Option<Duration>) -> Result<Reply, String> {
        self.tell(request)?;
        self.hear(limit)
    }

    /// Tells it something that has no answer.
    ///
    /// # Errors
    /// As [`Process::ask`].
    pub fn tell(&mut self, request: &Request) -> Result<(), String> {
        if let Some(how) = &self.dead {
            return Err(how.clone());
        }
        let sent = self.requests.as_ref().is_some_and(|requests| requests.try_send(request.encode()).is_ok());
        // A thread that has ended has met a broken pipe; what it says is in the answers.
        if sent { Ok(()) } else { Err(self.end("it does not listen")) }
    }

    fn hear(&mut self, limit: Option<Duration>) -> Result<Reply, String> {
        let start = Instant::now();
        // Beats that did not come are counted, not seconds: this process may have been stopped itself.
        let most = (self.silence.as_secs_f64() / BEAT.as_secs_f64()).ceil() as u32;
        let mut missed = 0;
        loop {
            match self.replies.recv_timeout(BEAT) {
                Ok(Ok(Some(Reply::Alive()))) => missed = 0,
                Ok(Ok(Some(reply))) => return Ok(reply),
                Ok(Ok(None)) | Err(RecvTimeoutError::Disconnected) => return Err(self.end("it ended")),
                Ok(Err(e)) => return Err(self.end(&format!("its answer broke off: {e}"))),
                Err(RecvTimeoutError::Timeout) => missed += 1,
            }
            if missed > most {
                return Err(self.end(&format!("it gave no sign of life for {} s", self.silence.as_secs())));
            }
            if let Some(limit) = limit.filter(|limit| start.elapsed() > *limit) {
                return Err(self.end(&format!("it did not answer within {} s", limit.as_secs())));
            }
        }
    }

    /// Whether it has ended by itself. A pipe is closed a moment before its process has a status.
    fn patient_wait(&mut self) -> bool {
        for _ in 0..LAST_MOMENTS {
            if self.child.try_wait().ok().flatten().is_some() {
                return true;
            }
            thread::sleep(Duration::from_millis(10));
        }
        false
    }

    /// Ends it, if it has not, and says what there is to say.
    pub fn end(&mut self, why: &str) -> String {
        if let Some(how) = &self.dead {
            return how.clone();
        }
        // It may have ended by itself, which its status tells; one that hangs tells nothing.
        let by_itself = self.patient_wait();
        let _ = self.child.kill();
        self.requests = None;
        let status = self.child.wait().map_or_else(|e| e.to_string(), |status| status.to_string());
        let status = if by_itself { format!(", {status}") } else { String::new() };
        if let Some(listener) = self.listener.take() {
            // A panic there would lose its last words and nothing else.
            let _ = listener.join();
        }
        let words = self.last_words.lock().unwrap_or_else(PoisonError::into_inner);
        let said = words.iter().map(String::as_str).collect::<Vec<_>>().join("; ");
        let said = if said.is_empty() { said } else { format!(" (it said: {said})") };
        self.dead.insert(format!("the worker process was lost: {why}{status}{said}")).clone()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        self.end("it is no longer needed");
    }
}

/// Writes what it is given to a worker, until there is no more, or the pipe breaks.
fn write(pipe: ChildStdin) -> io::Result<SyncSender<Vec<u8>>> {
    let (requests, waiting) = sync_channel::<Vec<u8>>(WAITING);
    let work = move || {
        let mut pipe = BufWriter::new(pipe);
        for message in waiting {
            // Whoever waits for the answer hears that the worker is gone.
            if frame::write(&mut pipe, &message).is_err() {
                break;
            }
        }
    };
    thread::Builder::new().name("worker-requests".to_owned()).spawn(work)?;
    Ok(requests)
}

/// Reads what a worker answers, until it ends or makes no sense.
fn read(pipe: ChildStdout) -> io::Result<Receiver<io::Result<Option<Reply>>>> {
    let (replies, heard) = sync_channel(1);
    let work = move || {
        let mut pipe = BufReader::with_capacity(1 << 16, pipe);
        loop {
            let message = frame::read(&mut pipe);
            let reply = message.and_then(|m| m.map(|m| Reply::decode(&m).map_err(io::Error::other)).transpose());
            let goes_on = matches!(reply, Ok(Some(_)));
            // Between requests nobody listens: a sign of life may be left out, an answer waits.
            let sent = match reply {
                Ok(Some(Reply::Alive())) => !matches!(replies.try_send(reply), Err(TrySendError::Disconnected(_))),
                reply => replies.send(reply).is_ok(),
            };
            if !goes_on || !sent {
                break;
            }
        }
    };
    thread::Builder::new().name("worker-replies".to_owned()).spawn(work)?;
    Ok(heard)
}

/// Hands what a worker says on to the log, and keeps the end of it.
fn listen(talk: ChildStderr, last: Arc<Mutex<VecDeque<String>>>) -> io::Result<JoinHandle<()>> {
    let work = move || {
        for line in BufReader::new(talk).lines().map_while(Result::ok).filter(|line| !line.is_empty()) {
            tracing::warn!("worker: {}", line.strip_prefix("warning: ").unwrap_or(&line));
            let mut last = last.lock().unwrap_or_else(PoisonError::into_inner);
            if last.len() == LAST_WORDS {
                last.pop_front();
            }
            last.push_back(line);
        }
    };
    thread::Builder::new().name("worker-log".to_owned()).spawn(work)
}
