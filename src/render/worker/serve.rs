//! The worker's side: runs are opened, rendered and closed as the pipe says, until it ends.

use std::any::Any;
use std::collections::BTreeMap;
use std::io::{self, Read, Write};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;

use super::frame;
use super::message::{Reply, Request};
use super::process::BEAT;
use super::shared::SharedFilm;
use super::wire::Blob;
use crate::render::{Job, RenderError, Renderer};
use crate::scene::CompiledScene;

/// Opens a run of a backend in this process.
pub type Open<'a> = &'a dyn Fn(&str, Arc<CompiledScene>, Job) -> Result<Box<dyn Renderer>, RenderError>;

/// What a worker has in hand.
struct Bench<'a> {
    open: Open<'a>,
    scene: Option<Arc<CompiledScene>>,
    runs: BTreeMap<u64, Run>,
}

/// A run, and where its film is left; through the pipe if nowhere.
struct Run {
    renderer: Box<dyn Renderer>,
    film: Option<SharedFilm>,
}

/// Works until the requests end, or a device is lost, and with it this process. A thread of its own gives signs of life all
/// the while.
///
/// # Errors
/// When a pipe fails or brings what makes no sense, or there is no thread to be had.
pub fn serve(requests: impl Read, replies: impl Write + Send, open: Open<'_>) -> io::Result<()> {
    let replies = Mutex::new(replies);
    let say = |reply: &Reply| {
        let message = reply.encode();
        frame::write(&mut *replies.lock().unwrap_or_else(PoisonError::into_inner), &message)
    };
    thread::scope(|scope| {
        // Dropped when there is nothing more to do, which ends the thread.
        let (_working, ended) = sync_channel::<()>(0);
        let say = &say;
        let beats = move || {
            while ended.recv_timeout(BEAT) == Err(RecvTimeoutError::Timeout) {
                // A pipe that is broken ends the work itself.
                if say(&Reply::Alive()).is_err() {
                    break;
                }
            }
        };
        thread::Builder::new().name("worker-beats".to_owned()).spawn_scoped(scope, beats)?;
        answer(requests, say, open)
    })
}

/// Answers requests until they end, or a device is lost.
fn answer(mut requests: impl Read, say: &dyn Fn(&Reply) -> io::Result<()>, open: Open<'_>) -> io::Result<()> {
    say(&Reply::Ready(super::VERSION.to_owned()))?;
    let mut bench = Bench { open, scene: None, runs: BTreeMap::new() };
    while let Some(message) = frame::read(&mut requests)? {
        let request = Request::decode(&message).map_err(io::Error::other)?;
        drop(message);
        let guarded = catch_unwind(AssertUnwindSafe(|| bench.carry_out(request)));
        let reply = match guarded {
            Ok(Ok(reply)) => reply,
            Ok(Err(error)) => Some(Reply::Failed(error)),
            Err(payload) => {
                let reason = format!("panic in the worker process: {}", text_of(&*payload));
                Some(Reply::Failed(RenderError::Failed { backend: "worker", reason }))
            }
        };
        if let Some(reply) = reply {
            say(&reply)?;
            if let Reply::Failed(RenderError::Lost { .. }) = reply {
                return Ok(());
            }
        }
    }
    Ok(())
}

fn text_of(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&'static str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no reason given")
}

impl Bench<'_> {
    fn run(&mut self, run: u64) -> Result<&mut Run, RenderError> {
        let unknown = || RenderError::Failed { backend: "worker", reason: format!("there is no run {run}") };
        self.runs.get_mut(&run).ok_or_else(unknown)
    }

    fn renderer(&mut self, run: u64) -> Result<&mut dyn Renderer, RenderError> {
        Ok(self.run(run)?.renderer.as_mut())
    }

    fn carry_out(&mut self, request: Request) -> Result<Option<Reply>, RenderError> {
        Ok(Some(match request {
            Request::Scene(scene) => {
                // Two large scenes need not fit into memory at once.
                self.scene = Some(scene);
                return Ok(None);
            }
            Request::Open(run, backend, job, film) => {
                let none = || RenderError::Failed { backend: "worker", reason: "there is no scene".to_owned() };
                let scene = self.scene.clone().ok_or_else(none)?;
                let renderer = (self.open)(&backend, scene, *job)?;
                let stats = renderer.open_stats().clone();
                // What cannot be opened here is not needed.
                let film = film.and_then(|name| SharedFilm::open(&name).ok());
                self.runs.insert(run, Run { renderer, film });
                Reply::Opened(stats)
            }
            Request::Advance(run, samples, more) => {
                let Run { renderer, film: shared } = self.run(run)?;
                let stats = renderer.advance_toward(samples, more)?;
                let film = renderer.film();
                if shared.as_ref().is_some_and(|shared| shared.put(film).is_ok()) {
                    Reply::Left(stats, film.samples)
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
                    Ok(saved) => Reply::Saved(saved.then_some(Blob(state))),
                    Err(problem) => Reply::Unsaved(problem.to_string()),
                }
            }
            Request::Restore(run, Blob(state)) => {
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
