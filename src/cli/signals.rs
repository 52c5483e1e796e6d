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
            signal_hook::consts::SIGTERM | signal_hook::consts::SIGUSR1 => Exit::Checkpointed,
            _ => Exit::Interrupted,
        }
    }
}

/// Starts to listen on a thread of its own. `leave` is called before the program is left at once, to give the
/// terminal back.
///
/// SIGINT, SIGTERM and SIGUSR1 ask `control` to stop, which writes a checkpoint; asked twice, the program ends at once
/// with 128 plus the signal's number. SIGUSR1 is what Slurm sends before the time of a job is over. SIGHUP asks for a
/// checkpoint and nothing more: the night goes on without its terminal.
///
/// # Errors
/// When the system refuses the handlers or the thread.
#[cfg(unix)]
pub fn listen(control: Arc<Control>, leave: fn()) -> std::io::Result<Heard> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

    let mut signals = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGUSR1, SIGHUP])?;
    let heard = Heard::default();
    let last = Arc::clone(&heard.last);
    let work = move || {
        for signal in signals.forever() {
            if signal == SIGHUP {
                tracing::info!("the terminal went away; the night goes on");
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

/// Where there are no signals, the dashboard's keys end the night.
///
/// # Errors
/// None.
#[cfg(not(unix))]
pub fn listen(_: Arc<Control>, _: fn()) -> std::io::Result<Heard> {
    Ok(Heard::default())
}
