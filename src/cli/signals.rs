//! Signals: the first Ctrl-C ends the night after the current wave, the second ends it now.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use super::exit::Exit;
use crate::experiment::Control;

/// What was heard.
#[derive(Clone, Debug, Default)]
pub struct Heard {
    last: Arc<AtomicI32>,
}

impl Heard {
    /// How a night that was ended from outside ends the program.
    pub fn exit(&self) -> Exit {
        match self.last.load(Ordering::SeqCst) {
            #[cfg(unix)]
            signal_hook::consts::SIGTERM | signal_hook::consts::SIGHUP => Exit::Checkpointed,
            _ => Exit::Interrupted,
        }
    }
}

/// Starts to listen on a thread of its own. `leave` is called before the program is left at once, to give the
/// terminal back.
///
/// SIGINT, SIGTERM and SIGHUP ask `control` to stop, which writes a checkpoint; asked twice, the program ends at once
/// with 128 plus the signal's number. SIGUSR1 asks for a checkpoint and nothing more. A SIGHUP that was ignored when the
/// program started, as under `nohup`, stays so: the night then goes on without its terminal.
///
/// # Errors
/// When the system refuses the handlers or the thread.
#[cfg(unix)]
pub fn listen(control: Arc<Control>, leave: fn()) -> std::io::Result<Heard> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

    let mut wanted = vec![SIGINT, SIGTERM, SIGUSR1];
    if !ignored(SIGHUP) {
        wanted.push(SIGHUP);
    }
    let mut signals = signal_hook::iterator::Signals::new(wanted)?;
    let heard = Heard::default();
    let last = Arc::clone(&heard.last);
    let work = move || {
        for signal in signals.forever() {
            if signal == SIGUSR1 {
                control.request_checkpoint();
                continue;
            }
            last.store(signal, Ordering::SeqCst);
            if control.request_stop() > 1 {
                leave();
                std::process::exit(128 + signal);
            }
            tracing::info!("ending after this wave with a checkpoint; once more to leave at once");
        }
    };
    std::thread::Builder::new().name("signals".to_owned()).spawn(work)?;
    Ok(heard)
}

/// Whether a signal was ignored before this program began to listen, where the system says so.
#[cfg(unix)]
fn ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// Where there are no signals, the dashboard's keys end the night.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn listen(_: Arc<Control>, _: fn()) -> std::io::Result<Heard> {
    Ok(Heard::default())
}
