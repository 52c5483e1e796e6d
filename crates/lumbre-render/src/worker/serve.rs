//! The worker's side: opens, advances and closes runs as requested through the pipe, until it
//! closes.

use std::any::Any;
use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::frame;
use super::message::{Reply, Request};
use super::process::HEARTBEAT;
use super::shared::SharedFilm;
use crate::{Advance, Job, RenderError, Renderer};
use lumbre_light::scene::CompiledScene;

/// Function that opens a run of a backend in this process.
pub type Open<'a> =
    &'a dyn Fn(&str, Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// Functions of the program that a worker calls.
#[derive(Clone, Copy)]
pub struct WorkerCalls<'a> {
    /// Opens a run of a backend.
    pub open: Open<'a>,
    /// Opens the device that runs will be rendered on. Returns why it cannot be opened, or `None`
    /// if it was or there is none.
    pub device: &'a dyn Fn() -> Option<String>,
}

/// State of a worker: the cached scene and the open runs.
struct WorkerSession<'a> {
    calls: WorkerCalls<'a>,
    scene: Option<Arc<CompiledScene>>,
    runs: BTreeMap<u64, Run>,
}

/// Open run and the shared memory for its film; without it the film goes through the pipe.
struct Run {
    renderer: Box<dyn Renderer>,
    film: Option<SharedFilm>,
}

/// Serves requests until the pipe closes or a device is lost, and with it this process. A second
/// thread sends heartbeats all the while.
///
/// # Errors
/// Returns an error if a pipe fails or delivers a corrupt message, or no thread can be started.
pub fn serve(
    requests: impl Read,
    replies: impl Write + Send,
    calls: WorkerCalls<'_>,
) -> io::Result<()> {
    let replies = Mutex::new(replies);
    let reply_with = |reply: &Reply| {
        let message = reply.encode();
        frame::write(
            &mut *replies.lock().unwrap_or_else(PoisonError::into_inner),
            &message,
        )
    };
    thread::scope(|scope| {
        // Dropped at the end of the work, which ends the thread.
        let (_working, ended) = sync_channel::<()>(0);
        let reply_with = &reply_with;
        let beats = move || {
            while ended.recv_timeout(HEARTBEAT) == Err(RecvTimeoutError::Timeout) {
                // A broken pipe also ends the work itself.
                if reply_with(&Reply::Heartbeat).is_err() {
                    break;
                }
            }
        };
        thread::Builder::new()
            .name("worker-beats".to_owned())
            .spawn_scoped(scope, beats)?;
        answer(requests, reply_with, calls)
    })
}

/// Answers requests until the pipe closes or a device is lost.
fn answer(
    mut requests: impl Read,
    reply_with: &dyn Fn(&Reply) -> io::Result<()>,
    calls: WorkerCalls<'_>,
) -> io::Result<()> {
    reply_with(&Reply::Ready(super::VERSION.to_owned()))?;
    let mut session = WorkerSession {
        calls,
        scene: None,
        runs: BTreeMap::new(),
    };
    while let Some(message) = frame::read(&mut requests)? {
        let request = Request::decode(&message).map_err(|_| {
            io::Error::new(io::ErrorKind::InvalidData, "corrupt request to the worker")
        })?;
        drop(message);
        let result = catch_unwind(AssertUnwindSafe(|| session.handle(request)));
        let reply = match result {
            Ok(Ok(reply)) => reply,
            Ok(Err(error)) => Some(Reply::Failed(error)),
            Err(payload) => {
                let reason = format!("panic in the worker process: {}", panic_message(&*payload));
                Some(Reply::Failed(RenderError::failed("worker", reason)))
            }
        };
        if let Some(reply) = reply {
            reply_with(&reply)?;
            if let Reply::Failed(RenderError::Lost { .. }) = reply {
                return Ok(());
            }
        }
    }
    Ok(())
}

fn panic_message(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&'static str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str))
        .unwrap_or("no reason given")
}

impl WorkerSession<'_> {
    fn run(&mut self, run: u64) -> Result<&mut Run, RenderError> {
        let unknown =
            || RenderError::failed("worker", format!("run {run} is not open in this worker"));
        self.runs.get_mut(&run).ok_or_else(unknown)
    }

    fn renderer(&mut self, run: u64) -> Result<&mut dyn Renderer, RenderError> {
        Ok(self.run(run)?.renderer.as_mut())
    }

    fn handle(&mut self, request: Request) -> Result<Option<Reply>, RenderError> {
        Ok(Some(match request {
            Request::Scene(scene) => {
                // The previous scene is dropped: two large scenes need not fit into memory at once.
                self.scene = Some(scene);
                return Ok(None);
            }
            Request::Device => Reply::Device((self.calls.device)()),
            Request::Open(run, backend, job, film) => {
                let none = || RenderError::failed("worker", "no scene was sent to this worker");
                let scene = self.scene.clone().ok_or_else(none)?;
                let renderer = (self.calls.open)(&backend, scene, *job)?;
                let stats = renderer.open_stats().clone();
                // If the shared memory cannot be opened, the film goes through the pipe.
                let film = film.and_then(|name| SharedFilm::open(&name).ok());
                self.runs.insert(run, Run { renderer, film });
                Reply::Opened(stats)
            }
            Request::Advance(run, samples, more) => {
                let Run {
                    renderer,
                    film: shared,
                } = self.run(run)?;
                let stats = renderer.render(&Advance {
                    more,
                    ..Advance::by(samples)
                })?;
                let film = renderer.film();
                if shared
                    .as_ref()
                    .is_some_and(|shared| shared.write(film).is_ok())
                {
                    Reply::AdvancedShared(stats, film.samples)
                } else {
                    *shared = None;
                    Reply::Advanced(stats, film.clone())
                }
            }
            Request::Layer(run, index) => Reply::Layer(self.renderer(run)?.layer(index)?),
            Request::Times(run) => Reply::Times(self.renderer(run)?.times()),
            Request::Save(run) => {
                let mut state = Vec::new();
                match self.renderer(run)?.save(&mut state) {
                    Ok(saved) => Reply::Saved(saved.then_some(state)),
                    Err(problem) => Reply::SaveFailed(problem.to_string()),
                }
            }
            Request::Restore(run, state) => {
                let renderer = self.renderer(run)?;
                renderer.restore(&state)?;
                Reply::Restored(renderer.film().clone())
            }
            Request::Close(run) => {
                self.runs.remove(&run);
                return Ok(None);
            }
        }))
    }
}
