//! The thread that renders. It owns the scene and its hierarchy, and restarts within one row of
//! pixels when the settings change.
//!
//! The user interface sends a [`Request`] for each of two pictures ([`Slot`]) and reads what the
//! thread published last. Both pictures share the scene and take turns.

mod run;
mod scenes;
mod shared;

use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::thread::JoinHandle;
use std::time::Instant;

use super::settings::Limits;
use run::Worker;
use shared::Shared;
pub(super) use shared::lock;
pub use shared::{
    Frame, LoadedScene, Published, Request, SLOTS, SessionOptions, Slot, SlotView, Status,
};

/// A render thread. It ends when this is dropped.
pub struct Session {
    shared: Arc<Shared>,
    thread: Option<JoinHandle<()>>,
}

impl Session {
    /// Starts the thread.
    ///
    /// # Errors
    /// If the thread cannot be started.
    pub fn start(options: SessionOptions) -> io::Result<Session> {
        let shared = Arc::new(Shared::default());
        let mut worker = Worker::new(options, Arc::clone(&shared));
        let thread = std::thread::Builder::new()
            .name("explore".to_owned())
            .spawn(move || worker.run())?;
        Ok(Session {
            shared,
            thread: Some(thread),
        })
    }

    /// Starts a picture anew, or ends it. Returns the number of the request.
    pub fn request(&self, slot: Slot, request: Option<Request>) -> u64 {
        let slot = slot.index();
        let mut wanted = self.shared.wanted();
        let number = self.shared.newest[slot].load(Ordering::SeqCst) + 1;
        wanted.requests[slot] = request.map(|request| (number, Instant::now(), Arc::new(request)));
        self.shared.newest[slot].store(number, Ordering::SeqCst);
        self.shared.changed.notify_all();
        number
    }

    /// Pauses or resumes all pictures.
    pub fn set_paused(&self, paused: bool) {
        self.shared.wanted().paused = paused;
        self.shared.changed.notify_all();
    }

    /// Sets the limits of a picture. They do not restart it.
    pub fn set_limits(&self, slot: Slot, limits: Limits) {
        self.shared.wanted().limits[slot.index()] = limits;
        self.shared.changed.notify_all();
    }

    /// Returns what was published last.
    pub fn published(&self) -> Published {
        lock(&self.shared.published).clone()
    }

    /// Returns the number of changes published so far.
    pub fn revision(&self) -> u64 {
        lock(&self.shared.published).revision
    }
}

impl Drop for Session {
    fn drop(&mut self) {
        {
            let mut wanted = self.shared.wanted();
            wanted.closed = true;
            for newest in &self.shared.newest {
                newest.fetch_add(1, Ordering::SeqCst);
            }
            self.shared.changed.notify_all();
        }
        if let Some(thread) = self.thread.take() {
            // The panic hook has reported a panic of the thread.
            let _ = thread.join();
        }
    }
}
