//! `lumbre worker`: the side of a worker process, which only this program starts.

use std::path::{Path, PathBuf};

use super::exit::{Exit, Failure};
use super::log::Log;
use crate::render;
use crate::render::worker::{Launcher, serve};

/// Renders on devices by worker processes from now on.
pub fn employ() {
    // The very program that runs, also where its file has been replaced since; where the system has no name for that,
    // the file.
    let itself = Path::new("/proc/self/exe");
    let program = if itself.exists() { Ok(PathBuf::from(itself)) } else { std::env::current_exe() };
    if let Ok(program) = program {
        render::worker::employ(Launcher::new(program, ["worker"]));
    }
}

/// Works until the pipe ends. What this process says on stderr, the other one logs.
pub fn main() -> Result<Exit, Failure> {
    Log::install(true);
    deaf().map_err(Failure::internal)?;
    serve(std::io::stdin().lock(), std::io::stdout(), &render::open).map_err(Failure::internal)?;
    Ok(Exit::Done)
}

/// Leaves signals to the other process, which may get the same and still needs what is here: this one ends when the
/// other has ended.
#[cfg(unix)]
fn deaf() -> std::io::Result<()> {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};

    [SIGINT, SIGTERM, SIGUSR1, SIGHUP].into_iter().try_for_each(|signal| {
        let heard = std::sync::Arc::default();
        signal_hook::flag::register(signal, heard).map(drop)
    })
}

#[cfg(not(unix))]
fn deaf() -> std::io::Result<()> {
    Ok(())
}
