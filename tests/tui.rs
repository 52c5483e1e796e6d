//! The terminal is the process's own, and so is the panic hook: this binary holds no other test.

use std::io;
use std::sync::atomic::{AtomicUsize, Ordering};

use lumbre::tui::guard::Guard;

static RESTORED: AtomicUsize = AtomicUsize::new(0);

fn restore() {
    RESTORED.fetch_add(1, Ordering::SeqCst);
}

fn restored() -> usize {
    RESTORED.swap(0, Ordering::SeqCst)
}

#[test]
fn the_terminal_is_given_back_exactly_once() {
    let guard = Guard::take(|| Ok(()), restore).unwrap();
    assert!(guard.holds());
    assert_eq!(guard.write(|| 7), Some(7));
    let busy = Guard::take(|| Ok(()), restore).unwrap_err();
    assert_eq!(busy.kind(), io::ErrorKind::ResourceBusy);
    assert!(guard.holds(), "a refused guard takes nothing away");
    drop(guard);
    assert_eq!(restored(), 1, "by drop");

    let failed = Guard::take(|| Err(io::Error::other("no terminal")), restore);
    assert!(failed.is_err());
    assert_eq!(restored(), 1, "after entering half-way");

    let guard = Guard::take(|| Ok(()), restore).unwrap();
    let worker = std::thread::Builder::new().name("worker".into()).spawn(|| panic!("on purpose, by a test"));
    assert!(worker.unwrap().join().is_err());
    assert_eq!(restored(), 1, "by the panic of another thread");
    assert!(!guard.holds());
    assert_eq!(guard.write(|| 7), None);
    guard.take_again(|| Ok(())).unwrap();
    assert_eq!(guard.write(|| 7), Some(7), "the night went on");
    let worker = std::thread::Builder::new().name("worker".into()).spawn(|| panic!("on purpose, once more"));
    assert!(worker.unwrap().join().is_err());
    assert_eq!(restored(), 1, "by the second panic");
    drop(guard);
    assert_eq!(restored(), 0, "and not again");

    let guard = Guard::take(|| Ok(()), restore).unwrap();
    let inside = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
        guard.write(|| panic!("on purpose, while a frame is written"));
    }));
    assert!(inside.is_err());
    assert_eq!(restored(), 1, "by a panic while writing");
    drop(guard);
    assert_eq!(restored(), 0);
}
