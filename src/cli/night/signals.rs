//! Signal handling. The first Ctrl-C stops the night after the current wave, the second at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicI32, Ordering};

use crate::cli::exit::{Exit, Failure};
use lumbre_night::experiment::NightControls;
#[cfg(unix)]
use lumbre_night::text;
#[cfg(unix)]
use lumbre_tui::tui::terminal::terminal_guard::restore_now;

/// Number of the last signal that stopped the night; 0 if there was none.
#[derive(Clone, Debug, Default)]
pub struct StopSignal {
    last: Arc<AtomicI32>,
}

impl StopSignal {
    /// Returns the exit code for a night that was stopped from outside.
    pub fn exit(&self) -> Exit {
        match self.last.load(Ordering::SeqCst) {
            #[cfg(unix)]
            signal_hook::consts::SIGTERM | signal_hook::consts::SIGUSR1 => Exit::Checkpointed,
            _ => Exit::Interrupted,
        }
    }
}

/// Makes a write beyond the limit of file sizes an error. By default SIGXFSZ ends the process.
///
/// # Errors
/// Returns an error if the system refuses the handler.
pub fn ignore_file_size_limit() -> std::io::Result<()> {
    #[cfg(unix)]
    signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default())?;
    Ok(())
}

/// Time within which several SIGHUP count as one: a terminal that closes may send it, and its shell
/// too.
#[cfg(unix)]
const ONE_HANGUP: std::time::Duration = std::time::Duration::from_secs(1);

/// Starts a thread that handles signals. It restores the terminal before an immediate exit.
///
/// SIGINT, SIGTERM and SIGUSR1 request a stop, which saves a checkpoint; a second one exits at once
/// with 128 plus the number of the signal, and ends the external programs that this process started.
/// Slurm sends SIGUSR1 before the time limit of a job.
/// The first SIGHUP only requests a checkpoint, and the night continues without its terminal; another
/// one more than [`ONE_HANGUP`] later exits at once. SIGQUIT and SIGABRT restore the terminal before
/// they do what they do by default.
///
/// # Errors
/// Returns an error if the system refuses the handlers or the thread.
#[cfg(unix)]
pub fn install(control: Arc<NightControls>) -> Result<StopSignal, Failure> {
    handle(control).map_err(|e| {
        let reason = text::describe_io(&e);
        Failure::internal(format!("cannot install signal handlers: {reason}"))
    })
}

/// Does what [`install`] describes.
#[cfg(unix)]
fn handle(control: Arc<NightControls>) -> std::io::Result<StopSignal> {
    use lumbre_render::external::end_all;
    use signal_hook::consts::{SIGABRT, SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGUSR1};

    let handled = [SIGINT, SIGTERM, SIGUSR1, SIGHUP, SIGQUIT, SIGABRT];
    let mut signals = signal_hook::iterator::Signals::new(handled)?;
    let stop_signal = StopSignal::default();
    let last = Arc::clone(&stop_signal.last);
    let handle_signals = move || {
        let mut last_hangup: Option<std::time::Instant> = None;
        for signal in signals.forever() {
            if signal == SIGHUP {
                let before = last_hangup.replace(std::time::Instant::now());
                if before.is_some_and(|at| at.elapsed() > ONE_HANGUP) {
                    restore_now();
                    end_all();
                    std::process::exit(128 + signal);
                }
                if before.is_none() {
                    tracing::info!("the terminal was closed; the night continues");
                }
                control.checkpoint.set(true);
                continue;
            }
            if signal == SIGQUIT || signal == SIGABRT {
                restore_now();
                end_all();
                // Ends the process, with a core dump where these are enabled.
                let _ = signal_hook::low_level::emulate_default_handler(signal);
                std::process::exit(128 + signal);
            }
            last.store(signal, Ordering::SeqCst);
            if control.request_stop() > 1 {
                restore_now();
                end_all();
                std::process::exit(128 + signal);
            }
            tracing::info!("stopping after this wave with a checkpoint; repeat to exit at once");
        }
    };
    std::thread::Builder::new()
        .name("signals".to_owned())
        .spawn(handle_signals)?;
    Ok(stop_signal)
}

/// Does nothing on systems without signals; there the night is stopped by the dashboard's keys.
///
/// # Errors
/// Never returns an error on these systems.
#[cfg(not(unix))]
pub fn install(_: Arc<NightControls>) -> Result<StopSignal, Failure> {
    Ok(StopSignal::default())
}
