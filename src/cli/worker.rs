//! `lumbre worker`: the main function of a device worker process, which only lumbre itself starts.

use std::path::{Path, PathBuf};

use super::exit::{Exit, Failure};
use super::night::log::Log;
use lumbre_render::worker::{Launcher, WorkerCalls, serve};

/// Makes the device backends of this process render in worker processes.
pub fn enable_worker_processes() {
    // /proc/self/exe is the running program even if its file was replaced since. Systems without it
    // use the path of the file.
    let itself = Path::new("/proc/self/exe");
    let program = if itself.exists() {
        Ok(PathBuf::from(itself))
    } else {
        std::env::current_exe()
    };
    if let Ok(program) = program {
        lumbre_render::worker::use_workers(Launcher::new(program, ["worker"]));
    }
}

/// Serves render requests from stdin until it closes. The parent process logs what this one writes
/// to stderr.
pub fn main() -> Result<Exit, Failure> {
    Log::install(true);
    ignore_signals().map_err(Failure::internal)?;
    serve(
        std::io::stdin().lock(),
        std::io::stdout(),
        WorkerCalls {
            open: &lumbre_night::backends::open,
            device: &lumbre_night::backends::open_device,
        },
    )
    .map_err(Failure::internal)?;
    Ok(Exit::Done)
}

/// Ignores signals that end a night. The parent process usually gets the same signal and still
/// needs this worker for its checkpoint; the worker ends when its stdin closes.
#[cfg(unix)]
fn ignore_signals() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

    [SIGINT, SIGTERM, SIGUSR1, SIGHUP]
        .into_iter()
        .try_for_each(|signal| {
            let flag = std::sync::Arc::default();
            signal_hook::flag::register(signal, flag).map(drop)
        })
}

/// Does nothing: there are no such signals on this system.
#[cfg(not(unix))]
fn ignore_signals() -> std::io::Result<()> {
    Ok(())
}
