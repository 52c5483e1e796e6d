//! The guard of the terminal. The terminal and the panic hook are global to the process, so this
//! binary has only one test.

use std::io;
use std::sync::atomic::{AtomicUsize, Ordering};

use lumbre_tui::tui::terminal::terminal_guard::TerminalGuard;

/// Number of calls of [`restore`] since the last call of [`restored`].
static RESTORED: AtomicUsize = AtomicUsize::new(0);

fn restore() {
    RESTORED.fetch_add(1, Ordering::SeqCst);
}

fn restored() -> usize {
    RESTORED.swap(0, Ordering::SeqCst)
}

#[test]
fn the_terminal_is_restored_exactly_once() {
    let guard = TerminalGuard::acquire(|| Ok(()), restore).unwrap();
    assert!(guard.is_acquired());
    assert_eq!(guard.write(|| 7), Some(7));
    let busy = TerminalGuard::acquire(|| Ok(()), restore).unwrap_err();
    assert_eq!(busy.kind(), io::ErrorKind::ResourceBusy);
    assert!(
        guard.is_acquired(),
        "a rejected guard does not restore the terminal"
    );
    drop(guard);
    assert_eq!(restored(), 1, "restored by drop");

    let failed = TerminalGuard::acquire(|| Err(io::Error::other("no terminal")), restore);
    assert!(failed.is_err());
    assert_eq!(restored(), 1, "restored after a failed acquisition");

    let guard = TerminalGuard::acquire(|| Ok(()), restore).unwrap();
    let worker = std::thread::Builder::new()
        .name("worker".into())
        .spawn(|| panic!("deliberate panic of a test"));
    assert!(worker.unwrap().join().is_err());
    assert_eq!(restored(), 1, "restored by the panic of another thread");
    assert!(!guard.is_acquired());
    assert_eq!(guard.write(|| 7), None);
    guard.reacquire(|| Ok(())).unwrap();
    assert_eq!(guard.write(|| 7), Some(7), "after reacquiring the terminal");
    let worker = std::thread::Builder::new()
        .name("worker".into())
        .spawn(|| panic!("second deliberate panic"));
    assert!(worker.unwrap().join().is_err());
    assert_eq!(restored(), 1, "restored by the second panic");
    drop(guard);
    assert_eq!(restored(), 0, "not restored twice");

    let guard = TerminalGuard::acquire(|| Ok(()), restore).unwrap();
    let inside = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        guard.write(|| panic!("deliberate panic while a frame is written"));
    }));
    assert!(inside.is_err());
    assert_eq!(restored(), 1, "restored by a panic while writing");
    drop(guard);
    assert_eq!(restored(), 0);
}
