//! Worker processes. A lost device is lost for its whole process, and a crashing driver kills its
//! process. Device backends therefore render in a child process of the same program. If it dies,
//! one attempt of one run is lost; the retry starts another worker and resumes from the newest
//! checkpoint.
//!
//! There is one worker for all runs of a process, as there is one device. It caches the last scene,
//! which cells that differ only in technique share. Requests and replies are [`message`]s in
//! [`frame`]s with a checksum. A worker that exits, sends a corrupt message, sends no heartbeat or
//! takes many times as long as before is killed, and its runs fail with [`RenderError::Lost`].
//!
//! Render times are measured in the worker: `render_s` is the time inside its renderer and excludes
//! the pipe. The film after each wave does not go through the pipe either but through shared memory
//! ([`shared`]).

pub(crate) mod codec;
mod frame;
mod message;
mod process;
mod serve;
mod shared;

use std::io::{self, Write};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, Instant};

pub use process::{HEARTBEAT, HEARTBEAT_TIMEOUT, Launcher, WorkerProcess};
pub use serve::{WorkerCalls, serve};

use self::message::{Reply, Request};
use self::shared::SharedFilm;
use super::{Advance, Job, OpenStats, RenderError, Renderer, WaveStats};
use lumbre_light::film::Film;
use lumbre_light::film::layer::{LayerFilm, LayerLayout};
use lumbre_light::film::time::TimeCube;
use lumbre_light::scene::CompiledScene;

/// Version that both processes must have.
const VERSION: &str = env!("CARGO_PKG_VERSION");

/// Launcher of workers and the worker that is running.
#[derive(Debug)]
pub struct WorkerPool {
    launcher: Launcher,
    current: Mutex<Option<Arc<Mutex<WorkerProcess>>>>,
}

static POOL: OnceLock<WorkerPool> = OnceLock::new();

/// Time within which the loader and the drivers must have opened a device. Drivers that must wake
/// hardware take seconds.
const DEVICE_TIMEOUT: Duration = Duration::from_secs(60);

const PROTOCOL_ERROR: &str = "protocol error: the reply does not match the request";

/// Makes this process render on devices in workers started by `launcher`. Programs call this once,
/// at their start; without it, devices are used in this process itself.
pub fn use_workers(launcher: Launcher) {
    // The first call wins.
    let _ = POOL.set(WorkerPool::new(launcher));
}

/// Returns the worker pool of this process, if it has one.
pub fn pool() -> Option<&'static WorkerPool> {
    POOL.get()
}

impl WorkerPool {
    /// Creates a pool that starts its worker on demand.
    pub fn new(launcher: Launcher) -> WorkerPool {
        WorkerPool {
            launcher,
            current: Mutex::new(None),
        }
    }

    /// Returns the process id of the running worker, if there is one.
    pub fn worker_id(&self) -> Option<u32> {
        let current = lock(&self.current).clone()?;
        let process = lock(&current);
        (!process.is_dead()).then(|| process.id())
    }

    fn worker(&self) -> Result<Arc<Mutex<WorkerProcess>>, String> {
        let mut current = lock(&self.current);
        if let Some(process) = current.as_ref().filter(|process| !lock(process).is_dead()) {
            return Ok(Arc::clone(process));
        }
        let process = Arc::new(Mutex::new(WorkerProcess::start(&self.launcher)?));
        *current = Some(Arc::clone(&process));
        Ok(process)
    }

    /// Opens the device that runs will be rendered on, in a worker of its own, which a damaged
    /// loader or driver may crash. Returns why the device cannot be opened, or `None` if it was or
    /// there is none.
    ///
    /// # Errors
    /// Returns an error if the worker dies or does not answer.
    pub fn device(&self) -> Result<Option<String>, String> {
        let mut process = WorkerProcess::start(&self.launcher)?;
        match process.request(&Request::Device, Some(DEVICE_TIMEOUT))? {
            Reply::Device(refused) => Ok(refused),
            Reply::Failed(error) => Err(error.to_string()),
            _ => Err(process.end(PROTOCOL_ERROR)),
        }
    }

    /// Opens a run of a backend in the worker.
    ///
    /// # Errors
    /// Returns an error if the backend cannot open the run, or the worker dies.
    pub fn open(
        &self,
        backend: &'static str,
        scene: &Arc<CompiledScene>,
        job: Job,
    ) -> Result<WorkerRenderer, RenderError> {
        let lost = |reason: String| RenderError::Lost { backend, reason };
        let pixels = u64::from(job.resolution[0]) * u64::from(job.resolution[1]);
        let layout = LayerLayout::new(&job.settings.films, job.max_depth, pixels)
            .map_err(|reason| RenderError::Unsupported { backend, reason })?;
        let film = Film::new(job.resolution[0], job.resolution[1]);
        let process = self.worker().map_err(lost)?;
        let mut worker = lock(&process);
        let key = scene.key();
        if key.is_none() || worker.scene != key {
            worker
                .send(&Request::Scene(Arc::clone(scene)))
                .map_err(lost)?;
            worker.scene = key;
        }
        let run = worker.runs;
        worker.runs += 1;
        let shared = self
            .launcher
            .films
            .as_deref()
            .and_then(|folder| SharedFilm::new(folder).ok());
        let name = shared.as_ref().map(SharedFilm::name);
        let reply = worker
            .request(
                &Request::Open(run, backend.to_owned(), Box::new(job), name),
                None,
            )
            .map_err(lost)?;
        let open_stats = match reply {
            Reply::Opened(stats) => stats,
            other => return Err(refused(&mut worker, backend, other)),
        };
        drop(worker);
        Ok(WorkerRenderer {
            backend,
            process,
            run,
            film,
            shared,
            layout,
            slowest_sample_s: None,
            open_stats,
        })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Converts a reply of the wrong kind to an error. A worker that has lost its device is killed.
fn refused(process: &mut WorkerProcess, backend: &'static str, reply: Reply) -> RenderError {
    match reply {
        Reply::Failed(RenderError::Lost { reason, .. }) => {
            process.end(&reason);
            RenderError::Lost { backend, reason }
        }
        Reply::Failed(RenderError::Unsupported { reason, .. }) => {
            RenderError::Unsupported { backend, reason }
        }
        Reply::Failed(RenderError::Failed { reason, .. }) => {
            RenderError::Failed { backend, reason }
        }
        _ => RenderError::lost(backend, process.end(PROTOCOL_ERROR)),
    }
}

/// Run that renders in a worker.
pub struct WorkerRenderer {
    backend: &'static str,
    process: Arc<Mutex<WorkerProcess>>,
    run: u64,
    film: Film,
    /// Shared memory into which the worker writes the film, if available.
    shared: Option<SharedFilm>,
    layout: LayerLayout,
    /// Time per sample of the slowest wave so far, in seconds.
    slowest_sample_s: Option<f64>,
    open_stats: OpenStats,
}

/// Factor by which a wave may take longer than the slowest one before it, and additional time in
/// seconds: far more than load on a machine explains, and far less than a night.
const WAVE_TIMEOUT: (f64, f64) = (20.0, 60.0);

/// Returns the timeout of a wave of `samples` samples; the first wave has none.
fn timeout(slowest_sample_s: Option<f64>, samples: u64) -> Option<Duration> {
    let (factor, least_s) = WAVE_TIMEOUT;
    slowest_sample_s.map(|slowest_sample_s| {
        Duration::from_secs_f64((factor * slowest_sample_s * samples as f64 + least_s).min(1e9))
    })
}

impl WorkerRenderer {
    fn request(&self, request: &Request) -> Result<Reply, RenderError> {
        self.request_within(request, None)
    }

    fn request_within(
        &self,
        request: &Request,
        timeout: Option<Duration>,
    ) -> Result<Reply, RenderError> {
        let mut process = lock(&self.process);
        match process.request(request, timeout) {
            Ok(Reply::Failed(error)) => {
                Err(refused(&mut process, self.backend, Reply::Failed(error)))
            }
            Ok(reply) => Ok(reply),
            Err(reason) => Err(RenderError::lost(self.backend, reason)),
        }
    }

    fn protocol_error(&self) -> RenderError {
        RenderError::lost(self.backend, lock(&self.process).end(PROTOCOL_ERROR))
    }
}

impl Renderer for WorkerRenderer {
    fn render(&mut self, request: &Advance<'_>) -> Result<WaveStats, RenderError> {
        let Advance { samples, more, .. } = *request;
        let start = Instant::now();
        let stats = match self.request_within(
            &Request::Advance(self.run, samples, more),
            timeout(self.slowest_sample_s, samples),
        )? {
            Reply::Advanced(stats, film) => {
                self.film = film;
                stats
            }
            Reply::AdvancedShared(stats, samples) => {
                let read = self
                    .shared
                    .as_ref()
                    .map(|shared| shared.read(&mut self.film));
                if !matches!(read, Some(Ok(()))) {
                    return Err(self.protocol_error());
                }
                self.film.samples = samples;
                stats
            }
            _ => return Err(self.protocol_error()),
        };
        let slowest_sample_s = start.elapsed().as_secs_f64() / samples.max(1) as f64;
        self.slowest_sample_s = Some(
            self.slowest_sample_s
                .map_or(slowest_sample_s, |slowest| slowest.max(slowest_sample_s)),
        );
        Ok(stats)
    }

    fn film(&self) -> &Film {
        &self.film
    }

    fn layers(&self) -> &[LayerFilm] {
        self.layout.films()
    }

    fn layer(&self, index: usize) -> Result<Film, RenderError> {
        match self.request(&Request::Layer(self.run, index))? {
            Reply::Layer(film) => Ok(film),
            _ => Err(self.protocol_error()),
        }
    }

    fn times(&self) -> Option<TimeCube> {
        match self.request(&Request::Times(self.run)) {
            Ok(Reply::Times(cube)) => cube,
            other => {
                let error = other.err().unwrap_or_else(|| self.protocol_error());
                tracing::warn!("the time-resolved film of this run is lost: {error}");
                None
            }
        }
    }

    fn save(&self, to: &mut dyn Write) -> io::Result<bool> {
        match self
            .request(&Request::Save(self.run))
            .map_err(io::Error::other)?
        {
            Reply::Saved(Some(state)) => to.write_all(&state).map(|()| true),
            Reply::Saved(None) => Ok(false),
            Reply::SaveFailed(problem) => Err(io::Error::other(problem)),
            _ => Err(io::Error::other(self.protocol_error())),
        }
    }

    fn restore(&mut self, state: &[u8]) -> Result<(), RenderError> {
        match self.request(&Request::Restore(self.run, state.to_vec()))? {
            Reply::Restored(film) => {
                self.film = film;
                Ok(())
            }
            _ => Err(self.protocol_error()),
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
            // If the request does not arrive, the worker is gone, and the run with it.
            let _ = process.send(&Request::Close(self.run));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_follow_the_slowest_wave_and_the_first_has_none() {
        assert_eq!(timeout(None, 1 << 40), None);
        assert_eq!(timeout(Some(0.0), 7), Some(Duration::from_secs(60)));
        assert_eq!(timeout(Some(0.5), 8), Some(Duration::from_secs(60 + 80)));
        assert!(timeout(Some(1e300), u64::MAX).is_some());
    }
}
