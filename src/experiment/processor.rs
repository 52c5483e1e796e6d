//! Processor time: what work takes of it does not depend on who else is busy, but for what caches lose.

use std::fs;
use std::time::Duration;

/// How long this thread has kept a processor busy, on systems that tell it in a file.
pub fn of_thread() -> Option<Duration> {
    spent(&fs::read_to_string("/proc/thread-self/schedstat").ok()?)
}

/// How long all threads of a process that are there have kept processors busy, on systems that tell it in files.
pub fn of_process(id: u32) -> Option<Duration> {
    let threads = fs::read_dir(format!("/proc/{id}/task")).ok()?.flatten();
    let times = threads.filter_map(|thread| spent(&fs::read_to_string(thread.path().join("schedstat")).ok()?));
    times.reduce(|a, b| a + b)
}

/// The first number: nanoseconds on a processor.
fn spent(schedstat: &str) -> Option<Duration> {
    schedstat.split_whitespace().next()?.parse().ok().map(Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_are_read() {
        assert_eq!(spent("1500000000 7 3\n"), Some(Duration::from_millis(1500)));
        assert_eq!(spent(""), None);
    }
}
