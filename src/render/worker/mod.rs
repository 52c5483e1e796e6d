//! Worker processes: a device that is lost is lost for its whole process, and a driver that crashes takes its process
//! along. So backends of devices render in a child process of the same program, and what dies with it is one try of one
//! run: the next try starts another worker, and goes on from the newest checkpoint.
//!
//! There is one worker for all runs of a process, as there is one device; it keeps the last scene, which cells that differ
//! in technique share. Requests and answers are [`message`]s in [`frame`]s with a checksum. A worker that dies, hangs up,
//! or says what makes no sense is ended, and its runs fail as [`RenderError::Lost`].
//!
//! The clock is the worker's: `render_s` is the time inside its renderer, and what goes through the pipe is none of it.

mod frame;
mod message;
mod process;
mod serve;
mod shape;
mod wire;

use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};

pub use process::{Launcher, Process};
pub use serve::serve;

use self::message::{Reply, Request};
use self::wire::Blob;
use super::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::film::Film;
use crate::film::layer::{LayerFilm, Layout};
use crate::scene::CompiledScene;

/// Both sides must be of the same build.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// What starts workers, and the one that runs.
#[derive(Debug)]
pub struct Pool {
    launcher: Launcher,
    current: Mutex<Option<Arc<Mutex<Process>>>>,
}

static POOL: OnceLock<Pool> = OnceLock::new();

/// From now on this process renders on devices by workers that are started so. Programs say it once, at their start;
/// without it, devices are used in this process itself.
pub fn employ(launcher: Launcher) {
    // Said twice, the first counts.
    let _ = POOL.set(Pool::new(launcher));
}

/// What starts workers, if this process has any.
pub fn pool() -> Option<&'static Pool> {
    POOL.get()
}

impl Pool {
    /// Starts workers when they are needed.
    pub fn new(launcher: Launcher) -> Pool {
        Pool { launcher, current: Mutex::new(None) }
    }

    /// The process id of the worker that runs, if one does.
    pub fn worker_id(&self) -> Option<u32> {
        let current = lock(&self.current).clone()?;
        let process = lock(&current);
        (!process.is_dead()).then(|| process.id())
    }

    fn worker(&self) -> Result<Arc<Mutex<Process>>, String> {
        let mut current = lock(&self.current);
        if let Some(process) = current.as_ref().filter(|process| !lock(process).is_dead()) {
            return Ok(Arc::clone(process));
        }
        let process = Arc::new(Mutex::new(Process::start(&self.launcher)?));
        *current = Some(Arc::clone(&process));
        Ok(process)
    }

    /// Opens a run of a backend in a worker.
    ///
    /// # Errors
    /// When the backend does not open there, or no worker lives long enough.
    pub fn open(
        &self,
        backend: &'static str,
        scene: &Arc<CompiledScene>,
        job: Job,
    ) -> Result<WorkerRenderer, RenderError> {
        let lost = |reason: String| RenderError::Lost { backend, reason };
        let composed = |row: usize| scene.delays.parts(row as u32).iter().any(|part| part.material as usize != row);
        if job.timing.is_some() || (0..scene.materials.len()).any(composed) {
            let reason = "a worker knows neither films with a time axis nor composed materials".to_owned();
            return Err(RenderError::Unsupported { backend, reason });
        }
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = Layout::new(&job.layers, job.max_depth, pixels)
            .map_err(|reason| RenderError::Unsupported { backend, reason })?;
        let film = Film::new(job.resolution[0], job.resolution[1]);
        let process = self.worker().map_err(lost)?;
        let mut there = lock(&process);
        // Scenes made in code have no hash.
        if there.scene != scene.content_hash || scene.content_hash == [0; 32] {
            there.tell(&Request::Scene(Arc::clone(scene))).map_err(lost)?;
            there.scene = scene.content_hash;
        }
        let run = there.runs;
        there.runs += 1;
        let reply = there.ask(&Request::Open(run, backend.to_owned(), job)).map_err(lost)?;
        let open_stats = match reply {
            Reply::Opened(stats) => stats,
            other => return Err(refused(&mut there, backend, other)),
        };
        drop(there);
        Ok(WorkerRenderer { backend, process, run, film, layout, open_stats })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// What an answer means that is not the one hoped for. A worker that has lost its device is ended.
fn refused(process: &mut Process, backend: &'static str, reply: Reply) -> RenderError {
    match reply {
        Reply::Failed(RenderError::Lost { reason, .. }) => {
            process.end(&reason);
            RenderError::Lost { backend, reason }
        }
        Reply::Failed(RenderError::Unsupported { reason, .. }) => RenderError::Unsupported { backend, reason },
        Reply::Failed(RenderError::Failed { reason, .. }) => RenderError::Failed { backend, reason },
        _ => RenderError::Lost { backend, reason: process.end("its answer is not to what it was asked") },
    }
}

/// A run in a worker.
pub struct WorkerRenderer {
    backend: &'static str,
    process: Arc<Mutex<Process>>,
    run: u64,
    film: Film,
    layout: Layout,
    open_stats: OpenStats,
}

impl WorkerRenderer {
    fn ask(&self, request: &Request) -> Result<Reply, RenderError> {
        let mut process = lock(&self.process);
        match process.ask(request) {
            Ok(Reply::Failed(error)) => Err(refused(&mut process, self.backend, Reply::Failed(error))),
            Ok(reply) => Ok(reply),
            Err(reason) => Err(RenderError::Lost { backend: self.backend, reason }),
        }
    }

    fn astray(&self) -> RenderError {
        let reason = lock(&self.process).end("its answer is not to what it was asked");
        RenderError::Lost { backend: self.backend, reason }
    }
}

impl Renderer for WorkerRenderer {
    fn advance(&mut self, samples: u64) -> Result<WaveStats, RenderError> {
        match self.ask(&Request::Advance(self.run, samples))? {
            Reply::Advanced(stats, film) => {
                self.film = film;
                Ok(stats)
            }
            _ => Err(self.astray()),
        }
    }

    fn film(&self) -> &Film {
        &self.film
    }

    fn layers(&self) -> &[LayerFilm] {
        self.layout.films()
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        match self.ask(&Request::Layer(self.run, index))? {
            Reply::Layer(film) => Ok(film),
            _ => Err(self.astray()),
        }
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        match self.ask(&Request::Save(self.run)).map_err(io::Error::other)? {
            Reply::Saved(Some(Blob(state))) => to.write_all(&state).map(|()| true),
            Reply::Saved(None) => Ok(false),
            Reply::Unsaved(problem) => Err(io::Error::other(problem)),
            _ => Err(io::Error::other(self.astray())),
        }
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        match self.ask(&Request::Restore(self.run, Blob(state.to_vec())))? {
            Reply::Restored(film) => {
                self.film = film;
                Ok(())
            }
            _ => Err(self.astray()),
        }
    }

    fn open_stats(&self) -> &OpenStats {
        &self.open_stats
    }
}

impl Drop for WorkerRenderer {
    fn drop(&mut self) {
        let mut process = lock(&self.process);
        if !process.is_dead() {
            // Where that does not arrive the worker is gone, and the run with it.
            let _ = process.tell(&Request::Close(self.run));
        }
    }
}
