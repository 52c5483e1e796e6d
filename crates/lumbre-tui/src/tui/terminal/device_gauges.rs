//! Device gauges: utilisation, memory and temperature, as far as they are readable without
//! privileges. Linux exposes them in files; NVIDIA devices need `nvidia-smi`.

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use lumbre_night::experiment::memory;
use lumbre_render::Device;
use lumbre_render::device::{VENDOR_AMD, VENDOR_NVIDIA};

/// Time between two readings of files.
const EVERY: Duration = Duration::from_secs(2);
/// Time between two calls of `nvidia-smi`, which costs more than reading a file.
const EVERY_TOOL: Duration = Duration::from_secs(10);

/// One reading; values that cannot be read are `None`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reading {
    /// Utilisation in `0..=1`.
    pub busy: Option<f64>,
    /// Used and total memory in bytes.
    pub memory: Option<[u64; 2]>,
    /// Temperature in degrees Celsius.
    pub celsius: Option<f64>,
}

/// Latest readings, and when they were taken.
#[derive(Debug, Default)]
pub struct Gauges {
    asked: Option<Instant>,
    asked_tool: Option<Instant>,
    /// Busy and total jiffies of the previous reading.
    jiffies: Option<[u64; 2]>,
    /// Readings of the CPU.
    pub cpu: Reading,
    /// Resident memory of this process in bytes.
    pub resident: Option<u64>,
    /// Readings of the GPU, if the night renders on one that can be read.
    pub gpu: Reading,
}

impl Gauges {
    /// Updates readings that are out of date. `devices` are those that render.
    pub fn refresh(&mut self, devices: &[Device]) {
        if self.asked.is_some_and(|at| at.elapsed() < EVERY) {
            return;
        }
        self.asked = Some(Instant::now());
        let read = |path: &str| fs::read_to_string(path).unwrap_or_default();
        let now = jiffies(&read("/proc/stat"));
        self.cpu.busy = self
            .jiffies
            .zip(now)
            .and_then(|(before, now)| share(before, now));
        self.jiffies = now;
        self.cpu.memory =
            memory::available_and_total().map(|[free, all]| [all.saturating_sub(free), all]);
        self.resident = memory::process_bytes("self", "VmRSS:");
        self.cpu.celsius = hottest(Path::new("/sys/class/thermal"));
        if let Some(gpu) = self.graphics(devices) {
            self.gpu = gpu;
        }
    }

    /// Reads the GPU's gauges, if the night renders on one and they are out of date.
    fn graphics(&mut self, devices: &[Device]) -> Option<Reading> {
        let vendor = devices.iter().find_map(|device| device.vendor);
        if vendor == Some(VENDOR_NVIDIA) {
            if self.asked_tool.is_some_and(|at| at.elapsed() < EVERY_TOOL) {
                return None;
            }
            self.asked_tool = Some(Instant::now());
            let query = "--query-gpu=utilization.gpu,memory.used,memory.total,temperature.gpu";
            let mut tool = Command::new("nvidia-smi");
            tool.args([query, "--format=csv,noheader,nounits"])
                .stdin(Stdio::null())
                .stderr(Stdio::null());
            return Some(nvidia(&String::from_utf8_lossy(
                &tool.output().ok()?.stdout,
            )));
        }
        let cards = fs::read_dir("/sys/class/drm")
            .ok()?
            .flatten()
            .map(|card| card.path().join("device"));
        (vendor == Some(VENDOR_AMD)).then(|| {
            cards
                .map(|card| amd(&card))
                .find(|reading| reading.busy.is_some())
        })?
    }
}

/// Parses busy and total jiffies since boot from the first line of `/proc/stat`.
fn jiffies(stat: &str) -> Option<[u64; 2]> {
    let line = stat.lines().next()?.strip_prefix("cpu ")?;
    let times: Vec<u64> = line
        .split_whitespace()
        .filter_map(|n| n.parse().ok())
        .take(8)
        .collect();
    let all: u64 = times.iter().sum();
    // Columns four and five are idle time and idle time while waiting for I/O.
    Some([all - times.get(3)? - times.get(4)?, all])
}

fn share(before: [u64; 2], now: [u64; 2]) -> Option<f64> {
    let all = now[1].checked_sub(before[1]).filter(|all| *all > 0)?;
    Some((now[0].saturating_sub(before[0]) as f64 / all as f64).clamp(0.0, 1.0))
}

/// Temperature of the hottest thermal zone in degrees Celsius.
fn hottest(zones: &Path) -> Option<f64> {
    let zones = fs::read_dir(zones).ok()?.flatten();
    let degrees = zones.filter_map(|zone| {
        let millidegrees: f64 = fs::read_to_string(zone.path().join("temp"))
            .ok()?
            .trim()
            .parse()
            .ok()?;
        // A zone that is switched off reports zero or less.
        (millidegrees > 0.0).then_some(millidegrees / 1e3)
    });
    degrees.reduce(f64::max)
}

/// Parses the first line of `nvidia-smi`: per cent, used MiB, total MiB, degrees Celsius.
fn nvidia(text: &str) -> Reading {
    let line = text.lines().next().unwrap_or_default();
    let numbers: Vec<Option<f64>> = line.split(',').map(|n| n.trim().parse().ok()).collect();
    let at = |i: usize| numbers.get(i).copied().flatten();
    let bytes = |i: usize| at(i).map(|mib| (mib * 1048576.0) as u64);
    Reading {
        busy: at(0).map(|percent| (percent / 100.0).clamp(0.0, 1.0)),
        memory: bytes(1).zip(bytes(2)).map(|(used, all)| [used, all]),
        celsius: at(3),
    }
}

/// Reads the gauges in the device folder of an AMD driver.
fn amd(card: &Path) -> Reading {
    let number = |name: &str| {
        fs::read_to_string(card.join(name))
            .ok()?
            .trim()
            .parse::<f64>()
            .ok()
    };
    let bytes = |name: &str| number(name).map(|n| n as u64);
    let sensors = fs::read_dir(card.join("hwmon"))
        .into_iter()
        .flatten()
        .flatten();
    let degrees = sensors.filter_map(|s| {
        fs::read_to_string(s.path().join("temp1_input"))
            .ok()?
            .trim()
            .parse()
            .ok()
    });
    Reading {
        busy: number("gpu_busy_percent").map(|percent| (percent / 100.0).clamp(0.0, 1.0)),
        memory: bytes("mem_info_vram_used")
            .zip(bytes("mem_info_vram_total"))
            .map(|(used, all)| [used, all]),
        celsius: degrees
            .reduce(f64::max)
            .map(|millidegrees: f64| millidegrees / 1e3),
    }
}

#[cfg(test)]
mod tests {
    use crate::tui::terminal::device_gauges::*;

    #[test]
    fn system_readings_are_parsed() {
        let stat =
            |user: u64, idle: u64| format!("cpu  {user} 0 100 {idle} 50 0 0 0 7 7\ncpu0 1 1 1 1\n");
        let (before, now) = (
            jiffies(&stat(1000, 8000)).unwrap(),
            jiffies(&stat(1150, 8050)).unwrap(),
        );
        assert_eq!(before, [1100, 9150]);
        assert_eq!(share(before, now), Some(0.75));
        assert_eq!(share(now, now), None, "no time has passed");
        assert_eq!(jiffies("what"), None);
        let reading = nvidia("37, 1024, 81920, 61\n12, 1, 2, 3\n");
        assert_eq!(
            reading,
            Reading {
                busy: Some(0.37),
                memory: Some([1 << 30, 80 << 30]),
                celsius: Some(61.0)
            }
        );
        assert_eq!(nvidia("[N/A], 1024, 81920, 40").busy, None);
        assert_eq!(nvidia("no devices were found"), Reading::default());
    }

    #[test]
    fn the_folder_of_an_amd_device_is_read() {
        let dir = tempfile::tempdir().unwrap();
        let sensor = dir.path().join("hwmon/hwmon3");
        fs::create_dir_all(&sensor).unwrap();
        for (file, text) in [
            ("gpu_busy_percent", "42\n"),
            ("mem_info_vram_used", "1000\n"),
            ("mem_info_vram_total", "4000\n"),
        ] {
            fs::write(dir.path().join(file), text).unwrap();
        }
        fs::write(sensor.join("temp1_input"), "58000\n").unwrap();
        let expected = Reading {
            busy: Some(0.42),
            memory: Some([1000, 4000]),
            celsius: Some(58.0),
        };
        assert_eq!(amd(dir.path()), expected);
        assert_eq!(amd(&dir.path().join("nowhere")), Reading::default());
    }

    #[test]
    fn readings_are_not_repeated_for_every_frame() {
        let mut gauges = Gauges::default();
        gauges.refresh(&[]);
        let asked = gauges.asked;
        gauges.refresh(&[]);
        assert_eq!(gauges.asked, asked);
    }

    #[test]
    fn the_tool_of_a_vendor_is_called_for_its_devices_only() {
        let card = |vendor| Device {
            vendor: Some(vendor),
            ..Device::from_line("NVIDIA")
        };
        let is_called = |devices: &[Device]| {
            let mut gauges = Gauges::default();
            gauges.graphics(devices);
            gauges.asked_tool.is_some()
        };
        assert!(is_called(&[Device::processor(2), card(VENDOR_NVIDIA)]));
        assert!(!is_called(&[card(VENDOR_AMD)]));
        assert!(!is_called(&[Device::from_line("NVIDIA")]));
    }
}
