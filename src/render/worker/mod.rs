//! Worker processes: a device that is lost is lost for its whole process, and a driver that crashes takes its process
//! along. So backends of devices render in a child process of the same program, and what dies with it is one try of one
//! run: the next try starts another worker, and goes on from the newest checkpoint.
//!
//! There is one worker for all runs of a process, as there is one device; it keeps the last scene, which cells that differ
//! in technique share. Requests and answers are [`message`]s in [`frame`]s with a checksum. A worker that dies, hangs up,
//! says what makes no sense, gives no sign of life or takes many times as long as before is ended, and its runs fail as
//! [`RenderError::Lost`].
//!
//! The clock is the worker's: `render_s` is the time inside its renderer, and what goes through the pipe is none of it. Nor is
//! the film after each wave, which the worker leaves in memory that both see ([`shared`]).

mod frame;
mod message;
mod process;
mod serve;
mod shape;
mod shared;
mod wire;

use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

pub use process::{BEAT, Launcher, Process, SILENCE};
pub use serve::serve;

use self::message::{Reply, Request};
use self::shared::SharedFilm;
use self::wire::Blob;
use super::{Job, OpenStats, RenderError, Renderer, WaveStats};
use crate::film::Film;
use crate::film::layer::{LayerFilm, Layout};
use crate::film::time::TimeCube;
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
        let shared = self.launcher.films.as_deref().and_then(|folder| SharedFilm::new(folder).ok());
        let name = shared.as_ref().map(SharedFilm::name);
        let reply = there.ask(&Request::Open(run, backend.to_owned(), Box::new(job), name), None).map_err(lost)?;
        let open_stats = match reply {
            Reply::Opened(stats) => stats,
            other => return Err(refused(&mut there, backend, other)),
        };
        drop(there);
        Ok(WorkerRenderer { backend, process, run, film, shared, layout, pace: None, open_stats })
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
    /// Where the worker leaves the film, if it can.
    shared: Option<SharedFilm>,
    layout: Layout,
    /// Seconds of a sample, of the slowest wave so far.
    pace: Option<f64>,
    open_stats: OpenStats,
}

/// By how much a wave may take longer than the slowest one before it, and how long it may take in any case, in seconds: far
/// more than a loaded machine makes of it, and far less than a night.
const PATIENCE: (f64, f64) = (20.0, 60.0);

/// How long a wave of so many samples may take; the first one as long as its device says.
fn limit(pace: Option<f64>, samples: u64) -> Option<Duration> {
    let (factor, least_s) = PATIENCE;
    pace.map(|pace| Duration::from_secs_f64((factor * pace * samples as f64 + least_s).min(1e9)))
}

impl WorkerRenderer {
    fn ask(&self, request: &Request) -> Result<Reply, RenderError> {
        self.ask_within(request, None)
    }

    fn ask_within(&self, request: &Request, limit: Option<Duration>) -> Result<Reply, RenderError> {
        let mut process = lock(&self.process);
        match process.ask(request, limit) {
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
        self.advance_toward(samples, 0)
    }

    fn advance_toward(&mut self, samples: u64, more: u64) -> Result<WaveStats, RenderError> {
        let start = Instant::now();
        let stats = match self.ask_within(&Request::Advance(self.run, samples, more), limit(self.pace, samples))? {
            Reply::Advanced(stats, film) => {
                self.film = film;
                stats
            }
            Reply::Left(stats, samples) => {
                let taken = self.shared.as_ref().map(|shared| shared.take(&mut self.film));
                if !matches!(taken, Some(Ok(()))) {
                    return Err(self.astray());
                }
                self.film.samples = samples;
                stats
            }
            _ => return Err(self.astray()),
        };
        let pace = start.elapsed().as_secs_f64() / samples.max(1) as f64;
        self.pace = Some(self.pace.map_or(pace, |slowest| slowest.max(pace)));
        Ok(stats)
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

    fn times(&self) -> Option<TimeCube> {
        match self.ask(&Request::Times(self.run)) {
            Ok(Reply::Times(cube)) => cube,
            other => {
                let error = other.err().unwrap_or_else(|| self.astray());
                tracing::warn!("the light of this run by its time is lost: {error}");
                None
            }
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_wave_may_take_many_times_as_long_as_before_and_the_first_one_as_long_as_it_takes() {
        assert_eq!(limit(None, 1 << 40), None);
        assert_eq!(limit(Some(0.0), 7), Some(Duration::from_secs(60)));
        assert_eq!(limit(Some(0.5), 8), Some(Duration::from_secs(60 + 80)));
        assert!(limit(Some(1e300), u64::MAX).is_some());
    }
}
