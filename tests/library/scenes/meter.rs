//! An allocator that counts the bytes of the current thread, for memory limits of readers.

#![expect(
    unsafe_code,
    reason = "`GlobalAlloc` is an unsafe trait; this allocator counts bytes and forwards every call"
)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::cell::Cell;

/// The system's allocator with counters.
pub struct Meter;

thread_local! {
    /// Bytes that this thread holds now, and the most that it held since [`peak`] began.
    static TAKEN: Cell<[isize; 2]> = const { Cell::new([0; 2]) };
}

/// Adds to the bytes that this thread holds.
fn count(bytes: isize) {
    // A thread that is ending has no counter.
    let _ = TAKEN.try_with(|taken| {
        let [now, most] = taken.get();
        taken.set([now + bytes, most.max(now + bytes)]);
    });
}

/// Returns the result of a function, and the most bytes that this thread held while it ran, over
/// those held before.
pub fn peak<T>(run: impl FnOnce() -> T) -> (T, usize) {
    TAKEN.set([0; 2]);
    let result = run();
    (result, TAKEN.get()[1].max(0) as usize)
}

// SAFETY: every call is forwarded unchanged to the system's allocator.
unsafe impl GlobalAlloc for Meter {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: the caller's guarantees are the requirements of the system's allocator.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        count(layout.size() as isize);
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn dealloc(&self, place: *mut u8, layout: Layout) {
        count(-(layout.size() as isize));
        // SAFETY: as above.
        unsafe { System.dealloc(place, layout) }
    }

    unsafe fn realloc(&self, place: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks exist while the data is copied.
        count(size as isize);
        // SAFETY: as above.
        let moved = unsafe { System.realloc(place, layout, size) };
        count(-(layout.size() as isize));
        moved
    }
}
