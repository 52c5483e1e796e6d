//! Acquires the terminal and restores it on every exit: explicitly, on drop, or on a panic.

use std::io;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, Once, PoisonError, TryLockError};
use std::time::Duration;

/// Function that restores the terminal; `Some` while the terminal is acquired.
static RESTORE: Mutex<Option<fn()>> = Mutex::new(None);
/// Locked while a frame is written, so that the panic of another thread does not interleave.
static WRITING: Mutex<()> = Mutex::new(());
static HOOK: Once = Once::new();
static ACQUIRED: AtomicBool = AtomicBool::new(false);

/// The acquired terminal. Dropping the guard restores it.
#[derive(Debug)]
pub struct TerminalGuard {
    restore: fn(),
}

impl TerminalGuard {
    /// Acquires the terminal by calling `enter`. `restore` is called exactly once afterwards, at
    /// the latest when the guard is dropped. The first guard of the process installs a panic hook
    /// that restores the terminal and then calls the previous hook.
    ///
    /// # Errors
    /// If `enter` fails (`restore` is then called, since `enter` may have failed half-way), or if
    /// another guard has acquired the terminal.
    pub fn acquire(
        enter: impl FnOnce() -> io::Result<()>,
        restore: fn(),
    ) -> io::Result<TerminalGuard> {
        HOOK.call_once(|| {
            let before = std::panic::take_hook();
            std::panic::set_hook(Box::new(move |info| {
                restore_between_frames();
                before(info);
            }));
        });
        if ACQUIRED.swap(true, Ordering::SeqCst) {
            return Err(io::Error::new(
                io::ErrorKind::ResourceBusy,
                "another dashboard has the terminal",
            ));
        }
        let guard = TerminalGuard { restore };
        guard.reacquire(enter)?;
        Ok(guard)
    }

    /// Acquires the terminal again after a panic of another thread restored it and the night
    /// continued.
    ///
    /// # Errors
    /// If `enter` fails.
    pub fn reacquire(&self, enter: impl FnOnce() -> io::Result<()>) -> io::Result<()> {
        *RESTORE.lock().unwrap_or_else(PoisonError::into_inner) = Some(self.restore);
        enter()
    }

    /// Whether the terminal is still acquired; a panic of another thread may have restored it.
    pub fn is_acquired(&self) -> bool {
        RESTORE
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .is_some()
    }

    /// Calls `write` if the terminal is still acquired; returns `None` if it is not.
    pub fn write<T>(&self, write: impl FnOnce() -> T) -> Option<T> {
        let _writing = WRITING.lock().unwrap_or_else(PoisonError::into_inner);
        self.is_acquired().then(write)
    }
}

impl Drop for TerminalGuard {
    fn drop(&mut self) {
        restore_once();
        ACQUIRED.store(false, Ordering::SeqCst);
    }
}

/// Restores the terminal at once if it is acquired. Call this before ending the process.
pub fn restore_now() {
    restore_between_frames();
}

fn restore_once() {
    // The function is taken out of the mutex, so it runs exactly once.
    let restore = RESTORE
        .lock()
        .unwrap_or_else(PoisonError::into_inner)
        .take();
    if let Some(restore) = restore {
        restore();
    }
}

/// Restores the terminal between two frames, or after 100 ms in any case: the panicking thread
/// may be the one that is writing.
fn restore_between_frames() {
    for _ in 0..50 {
        match WRITING.try_lock() {
            Ok(_writing) => return restore_once(),
            Err(TryLockError::Poisoned(_)) => return restore_once(),
            Err(TryLockError::WouldBlock) => std::thread::sleep(Duration::from_millis(2)),
        }
    }
    restore_once();
}
