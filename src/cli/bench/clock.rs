//! Processor time: what work takes of it does not depend on who else is busy, but for what caches lose.

use std::fs;

/// Seconds of processor time of this thread, on systems that tell it in a file.
pub fn thread_s() -> Option<f64> {
    seconds(&fs::read_to_string("/proc/thread-self/schedstat").ok()?)
}

/// Seconds of processor time of all threads of a process that are there.
pub fn process_s(pid: u32) -> Option<f64> {
    let threads = fs::read_dir(format!("/proc/{pid}/task")).ok()?.flatten();
    let times = threads.filter_map(|thread| seconds(&fs::read_to_string(thread.path().join("schedstat")).ok()?));
    times.reduce(|a, b| a + b)
}

/// The first number: nanoseconds on a processor.
fn seconds(schedstat: &str) -> Option<f64> {
    schedstat.split_whitespace().next()?.parse::<u64>().ok().map(|ns| ns as f64 * 1e-9)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nanoseconds_are_read() {
        assert_eq!(seconds("1500000000 7 3\n"), Some(1.5));
        assert_eq!(seconds(""), None);
    }
}
