//! Processor time of threads and processes. Unlike wall-clock time it hardly depends on other load,
//! apart from shared caches.

use std::fs;
use std::time::Duration;

/// Processor time of this thread; `None` on systems without a clock for it.
pub fn thread_time() -> Option<Duration> {
    #[cfg(unix)]
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime)
        .try_into()
        .ok();
    #[cfg(not(unix))]
    let time = None;
    time
}

/// Total processor time of all living threads of a process; `None` on systems without
/// `/proc/<id>/task`.
pub fn process_time(id: u32) -> Option<Duration> {
    let threads = fs::read_dir(format!("/proc/{id}/task")).ok()?.flatten();
    let times = threads.filter_map(|thread| {
        parse_schedstat(&fs::read_to_string(thread.path().join("schedstat")).ok()?)
    });
    times.reduce(|a, b| a + b)
}

/// Parses the first number of a `schedstat` file: nanoseconds on a processor.
fn parse_schedstat(schedstat: &str) -> Option<Duration> {
    schedstat
        .split_whitespace()
        .next()?
        .parse()
        .ok()
        .map(Duration::from_nanos)
}

#[cfg(test)]
mod tests {
    use crate::experiment::processor_time::*;

    #[test]
    fn nanoseconds_are_read() {
        assert_eq!(
            parse_schedstat("1500000000 7 3\n"),
            Some(Duration::from_millis(1500))
        );
        assert_eq!(parse_schedstat(""), None);
    }
}
