//! How much memory runs take, and how much the machine has.

use super::spec::CellConfig;
use crate::film::layer::{BYTES_PER_PIXEL, Layout, SPLAT_BYTES_PER_PIXEL};
use crate::film::time;
use crate::transport::integrator::integrator;

/// Bytes for each pixel of what measuring keeps beside the sums: the picture, the reference, what tone maps make of both,
/// and what FLIP sees of the reference.
const MEASURING_BYTES: u64 = 80;

/// The most bytes that the layers and bins of a run take.
pub fn beside_bytes(config: &CellConfig) -> u64 {
    let pixels = pixels(config);
    // A plan has none that is refused.
    let layers = Layout::new(&config.films, config.max_depth.unwrap_or(1), pixels).map_or(0, |layout| layout.bytes());
    let timing = config.timing.as_ref();
    let bins = timing.and_then(|timing| time::bytes(&timing.axis, pixels, splats(config)).ok()).unwrap_or(0);
    layers + bins
}

/// The most bytes that a run takes while it renders, its scene aside, with its hierarchy and what is
/// tabled of its surfaces and lamps: sums, layers, bins, and what measuring keeps.
pub fn run_bytes(config: &CellConfig) -> u64 {
    let each = BYTES_PER_PIXEL + u64::from(splats(config)) * SPLAT_BYTES_PER_PIXEL + MEASURING_BYTES;
    pixels(config) * each + beside_bytes(config)
}

/// Pixels of the picture; 0 where its size is still open.
pub(super) fn pixels(config: &CellConfig) -> u64 {
    let [width, height] = config.resolution.unwrap_or_default();
    u64::from(width) * u64::from(height)
}

fn splats(config: &CellConfig) -> bool {
    integrator(&config.integrator).is_some_and(|row| row.splats)
}

/// Bytes that there are for what is to be rendered.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Room {
    /// Those that can still be had.
    Free(u64),
    /// All of the machine's, whatever else is in them.
    Machine(u64),
}

/// Why runs that take turns, and so are in memory together, cannot be rendered where there is so much room; nothing where
/// they can.
pub fn refusal(runs: usize, need: u64, room: Room) -> Option<String> {
    let gib = |bytes: u64| format!("{:.1} GiB", bytes as f64 / (1u64 << 30) as f64);
    let (most, there) = match room {
        Room::Free(bytes) => (bytes, format!("{} are free", gib(bytes))),
        Room::Machine(bytes) => (bytes, format!("this machine has {}", gib(bytes))),
    };
    (need > most).then(|| {
        format!(
            "{runs} techniques that take turns on one picture need {} of memory together, and {there}: take another order \
             than \"interleave\", a smaller picture, or fewer films",
            gib(need)
        )
    })
}

/// Bytes of memory that can still be had, and all that there are, on systems that tell it in a file.
pub fn machine() -> Option<[u64; 2]> {
    told(&std::fs::read_to_string("/proc/meminfo").ok()?)
}

/// Bytes that the system gives under a key such as `VmRSS:` for a process, a number or `self`, where it tells it in a file.
pub fn of_process(process: &str, key: &str) -> Option<u64> {
    bytes_after(&std::fs::read_to_string(format!("/proc/{process}/status")).ok()?, key)
}

fn told(text: &str) -> Option<[u64; 2]> {
    Some([bytes_after(text, "MemAvailable:")?, bytes_after(text, "MemTotal:")?])
}

fn bytes_after(text: &str, key: &str) -> Option<u64> {
    number_after(text, key).map(|kilobytes| kilobytes * 1024)
}

fn number_after(text: &str, key: &str) -> Option<u64> {
    text.lines().find_map(|line| line.strip_prefix(key))?.split_whitespace().next()?.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_does_not_fit_is_said_in_gibibytes() {
        assert_eq!(refusal(3, 1 << 30, Room::Free(1 << 30)), None);
        for (room, words) in [(Room::Free(1 << 30), "1.0 GiB are free"), (Room::Machine(1 << 30), "has 1.0 GiB")] {
            let reason = refusal(3, 5 << 29, room).unwrap();
            let words = ["3 techniques", "need 2.5 GiB", words];
            assert!(words.iter().all(|part| reason.contains(part)), "{reason}");
        }
    }

    #[test]
    fn the_machine_is_read_as_it_says_it() {
        let text = "MemTotal:       16316412 kB\nMemFree:         1 kB\nMemAvailable:    8158206 kB\n";
        assert_eq!(told(text), Some([8_158_206 * 1024, 16_316_412 * 1024]));
        assert_eq!(told("MemTotal: 1 kB\n"), None);
        assert_eq!(number_after("VmPeak: 1 kB\nVmRSS:       16316412 kB\n", "VmRSS:"), Some(16_316_412));
    }
}
