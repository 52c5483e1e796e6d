//! Starts the program with limits on its time and memory, and tells how it ended.

use std::io::Read;
use std::process::{Child, Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Longest duration of a command before it counts as hanging.
pub const LIMIT: Duration = Duration::from_secs(180);

/// Bytes of each output that are kept.
const KEPT: u64 = 1 << 20;

/// How a command ended.
pub struct Ended {
    /// Exit code; `None` if a signal or the limit on time ended the command.
    pub code: Option<i32>,
    /// Both outputs, errors last.
    pub text: String,
    /// Largest resident memory that was seen, in bytes.
    pub memory: u64,
    /// Whether the limit on time ended it.
    pub hung: bool,
}

impl Ended {
    /// Returns what is wrong with an end that no input may cause: a crash or a hang.
    pub fn crash(&self) -> Option<String> {
        let panicked = self.code == Some(101) || self.text.contains("panicked at");
        let problem = match self.code {
            _ if self.hung => format!("it did not end within {} s", LIMIT.as_secs()),
            _ if panicked => "it panicked".to_owned(),
            None => "a signal ended it".to_owned(),
            Some(0..=6 | 75 | 130) => return None,
            Some(code) => format!("it ended with the unknown code {code}"),
        };
        Some(format!("{problem}: {}", self.excerpt()))
    }

    /// Returns the last lines of the outputs.
    pub fn excerpt(&self) -> String {
        let lines: Vec<&str> = self.text.lines().rev().take(4).collect();
        lines.into_iter().rev().collect::<Vec<_>>().join(" / ")
    }
}

/// Runs a command to its end.
///
/// # Errors
/// Returns a message if it cannot be started.
pub fn end(command: &mut Command) -> Result<Ended, String> {
    // Pipes, since limits on the size of files apply to outputs into files.
    command
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped());
    let mut child = command
        .spawn()
        .map_err(|e| format!("cannot start {command:?}: {e}"))?;
    let (out, error) = (gather(child.stdout.take())?, gather(child.stderr.take())?);
    let start = Instant::now();
    let mut memory = 0;
    let (status, hung) = loop {
        memory = memory.max(resident_memory(&child));
        if let Some(status) = child.try_wait().map_err(|e| e.to_string())? {
            break (status, false);
        }
        if start.elapsed() > LIMIT {
            child.kill().map_err(|e| e.to_string())?;
            break (child.wait().map_err(|e| e.to_string())?, true);
        }
        std::thread::sleep(Duration::from_millis(2));
    };
    let bytes = [out, error].map(|thread| thread.join().unwrap_or_default());
    Ok(Ended {
        code: status.code(),
        text: String::from_utf8_lossy(&bytes.concat()).into_owned(),
        memory,
        hung,
    })
}

/// Reads an output to its end on a thread, and returns its first [`KEPT`] bytes.
fn gather(output: Option<impl Read + Send + 'static>) -> Result<JoinHandle<Vec<u8>>, String> {
    let read = move || {
        let mut kept = Vec::new();
        if let Some(mut output) = output {
            // An output that cannot be read has nothing to tell.
            let _ = output.by_ref().take(KEPT).read_to_end(&mut kept);
            let _ = std::io::copy(&mut output, &mut std::io::sink());
        }
        kept
    };
    let thread = std::thread::Builder::new().name("output".to_owned());
    thread.spawn(read).map_err(|e| e.to_string())
}

/// Returns the largest resident memory of a process so far in bytes, or 0 where the system does
/// not tell.
fn resident_memory(child: &Child) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{}/status", child.id()));
    let status = status.unwrap_or_default();
    let line = status.lines().find_map(|l| l.strip_prefix("VmHWM:"));
    let kib = line.and_then(|l| l.trim().trim_end_matches(" kB").parse::<u64>().ok());
    kib.unwrap_or_default() * 1024
}
