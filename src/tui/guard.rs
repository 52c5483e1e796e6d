//! The terminal is given back whatever happens: by name, by drop, or by the panic of any thread.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, PoisonError, TryLockError};
use std::time::Duration;

/// How the terminal is given back; there while it is taken.
static RESTORE: Mutex<Option<fn()>> = Mutex::new(None);
/// Held while a frame is written, so that a panic elsewhere does not write into the middle of it.
static WRITING: Mutex<()> = Mutex::new(());
static HOOK: Once = Once::new();
static TAKEN: AtomicBool = AtomicBool::new(false);

/// The terminal, taken. Dropping it gives the terminal back.
#[derive(Debug)]
pub struct Guard {
    restore: fn(),
}

impl Guard {
    /// Takes the terminal by `enter`; from then on `restore` will be called once, at the latest when the guard is
    /// dropped. A panic hook that restores first and then does what hooks did before is installed with the first
    /// guard of the process.
    ///
    /// # Errors
    /// When `enter` fails (then `restore` has been called, since it may have failed half-way), or when another guard
    /// holds the terminal.
    pub fn take(enter: impl FnOnce() -> io::Result<()>, restore: fn()) -> io::Result<Guard> {
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                give_back_in_panic();
                before(info);
            }));
        });
        if TAKEN.swap(true, Ordering::SeqCst) {
            return Err(io::Error::new(io::ErrorKind::ResourceBusy, "another dashboard has the terminal"));
        }
        let guard = Guard { restore };
        guard.take_again(enter)?;
        Ok(guard)
    }

    /// Takes the terminal once more, after a panic elsewhere had given it back and the night went on.
    ///
    /// # Errors
    /// When `enter` fails.
    pub fn take_again(&self, enter: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
        *RESTORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.restore);
        enter()
    }

    /// Whether the terminal is still ours; a panic in another thread may have given it back.
    pub fn holds(&self) -> bool {
        RESTORE.lock().unwrap_or_else(PoisonError::into_inner).is_some()
    }

    /// Writes to the terminal if it is still ours; `None` if it is not.
    pub fn write<T>(&self, write: impl FnOnce() -> T) -> Option<T> {
        let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        self.holds().then(write)
    }
}

impl Drop for Guard {
    fn drop(&mut self) {
        give_back();
        TAKEN.store(false, Ordering::SeqCst);
    }
}

/// Gives the terminal back at once, if it is taken: for those who are about to end the process.
pub fn give_back_now() {
    give_back_in_panic();
}

fn give_back() {
    // The closure of a guard never outlives the lock: what is taken out here runs exactly once.
    let restore = RESTORE.lock().unwrap_or_else(PoisonError::into_inner).take();
    if let Some(restore) = restore {
        restore();
    }
}

/// Gives the terminal back between two frames, or after a moment in any case: the thread that panics may be the one
/// that writes.
fn give_back_in_panic() {
    for _ in 0..50 {
        match WRITING.try_lock() {
            Ok(_writing) => return give_back(),
            Err(TryLockError::Poisoned(_)) => return give_back(),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    give_back();
}
