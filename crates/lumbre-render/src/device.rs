//! Devices that render: facts that decide their speed, and the line about them for people.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Number of the vendor NVIDIA, as assigned by the PCI-SIG.
pub const VENDOR_NVIDIA: u32 = 0x10de;
/// Number of the vendor AMD, as assigned by the PCI-SIG.
pub const VENDOR_AMD: u32 = 0x1002;

/// Device that renders, with the facts that decide its speed.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Device {
    /// Name of the device: `cpu`, the model of a graphics device as its driver reports it, or what
    /// an external program states.
    pub name: String,
    /// Kind of the device.
    pub kind: DeviceKind,
    /// Number of the vendor of a graphics device, as assigned by the PCI-SIG or, above 65535, by
    /// Khronos.
    pub vendor: Option<u32>,
    /// Number of threads of the processor that render; `None` on another device, or if unknown.
    pub threads: Option<u32>,
    /// Name and version of the driver of a graphics device.
    pub driver: Option<String>,
    /// Features that decide its speed.
    pub features: Features,
    /// External program that renders, if any.
    pub peer: Option<Peer>,
}

/// Kind of a device.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// Threads of the processor.
    Processor,
    /// A graphics device.
    Graphics,
    /// A software implementation of a graphics device, which runs on the processor.
    EmulatedGraphics,
    /// No device: the mock backend renders nothing, on a fake clock.
    Mock,
    /// A device of an external program other than the processor.
    External,
    /// Unknown: earlier versions stored only a line for people, which is the name.
    #[default]
    Unknown,
}

/// Features of a device that decide its speed, as far as they are known and it has them.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Features {
    /// Bounding volume hierarchy of this program that rays traverse, with its settings.
    pub hierarchy: Option<String>,
    /// Instruction set of the processor, such as `avx2`.
    pub instructions: Option<String>,
    /// Number of paths that the processor traces at a time, one in each lane of a vector.
    pub lanes: Option<u32>,
    /// Way in which a graphics device traces rays, such as `ray queries`.
    pub tracing: Option<String>,
}

/// An external program that renders.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Peer {
    /// Name of the program, with its version if known.
    pub program: String,
    /// Whether its render time is the wall-clock time of its processes.
    pub wall_clock: bool,
}

impl Device {
    /// Returns this many threads of the processor, without features.
    pub fn processor(threads: u32) -> Device {
        Device {
            name: "cpu".to_owned(),
            kind: DeviceKind::Processor,
            threads: Some(threads),
            ..Device::default()
        }
    }

    /// Returns the device of the mock backend.
    pub fn mock() -> Device {
        Device {
            name: "mock".to_owned(),
            kind: DeviceKind::Mock,
            ..Device::default()
        }
    }

    /// Returns a device of which only a line for people is known; the line becomes its name.
    pub fn from_line(line: &str) -> Device {
        Device {
            name: line.to_owned(),
            ..Device::default()
        }
    }
}

/// Writes the line about the device for people. A device of unknown kind is its name.
impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        match self.kind {
            DeviceKind::Unknown => return Ok(()),
            DeviceKind::Mock => f.write_str(", on a fake clock")?,
            DeviceKind::Graphics | DeviceKind::EmulatedGraphics => {
                if let Some(driver) = &self.driver {
                    write!(f, " ({driver})")?;
                }
            }
            DeviceKind::External => {}
            DeviceKind::Processor => {
                if let Some(threads) = self.threads {
                    write!(f, ", {threads} threads")?;
                }
                let Features {
                    hierarchy,
                    instructions,
                    lanes,
                    ..
                } = &self.features;
                for feature in [hierarchy, instructions].into_iter().flatten() {
                    write!(f, ", {feature}")?;
                }
                if lanes.is_some_and(|lanes| lanes > 1) {
                    f.write_str(", vectorised")?;
                }
            }
        }
        if let Some(peer) = &self.peer {
            write!(f, ", {}", peer.program)?;
            if peer.wall_clock {
                f.write_str(" (wall clock)")?;
            }
        }
        Ok(())
    }
}

/// Adds the devices that a list does not contain yet.
pub fn add_devices(known: &mut Vec<Device>, more: &[Device]) {
    for device in more {
        if !known.contains(device) {
            known.push(device.clone());
        }
    }
}

/// Returns the line about some devices for people, without repeated lines; empty if there are none.
pub fn devices_line(devices: &[Device]) -> String {
    let mut lines: Vec<String> = Vec::new();
    for line in devices.iter().map(Device::to_string) {
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines.join("; ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_state_what_decides_the_speed_of_a_device() {
        let peer = |program: &str, wall_clock| {
            Some(Peer {
                program: program.to_owned(),
                wall_clock,
            })
        };
        let vectorised = |lanes| Device {
            features: Features {
                hierarchy: Some("eight-wide BVH".to_owned()),
                instructions: Some("avx2".to_owned()),
                lanes: Some(lanes),
                tracing: None,
            },
            ..Device::processor(2)
        };
        let graphics = |kind| Device {
            name: "NVIDIA L40S".to_owned(),
            kind,
            vendor: Some(VENDOR_NVIDIA),
            driver: Some("NVIDIA 550.54".to_owned()),
            features: Features {
                tracing: Some("ray queries".to_owned()),
                ..Features::default()
            },
            ..Device::default()
        };
        for (device, line) in [
            (vectorised(1), "cpu, 2 threads, eight-wide BVH, avx2"),
            (
                vectorised(8),
                "cpu, 2 threads, eight-wide BVH, avx2, vectorised",
            ),
            (
                Device {
                    peer: peer("Ray 2.1", true),
                    ..Device::processor(1)
                },
                "cpu, 1 threads, Ray 2.1 (wall clock)",
            ),
            (
                Device {
                    name: "cuda".to_owned(),
                    kind: DeviceKind::External,
                    peer: peer("Ray 2.1", false),
                    ..Device::default()
                },
                "cuda, Ray 2.1",
            ),
            (
                graphics(DeviceKind::Graphics),
                "NVIDIA L40S (NVIDIA 550.54)",
            ),
            (
                graphics(DeviceKind::EmulatedGraphics),
                "NVIDIA L40S (NVIDIA 550.54)",
            ),
            (Device::mock(), "mock, on a fake clock"),
            // A stored line is complete, whatever else is known.
            (
                Device {
                    threads: Some(4),
                    peer: peer("Ray 2.1", false),
                    ..Device::from_line("cpu, 4 threads, Ray 2.1")
                },
                "cpu, 4 threads, Ray 2.1",
            ),
        ] {
            assert_eq!(device.to_string(), line);
        }
    }

    #[test]
    fn lists_have_every_device_and_every_line_once() {
        let mut devices = vec![Device::processor(2)];
        let queries = Features {
            tracing: Some("ray queries".to_owned()),
            ..Features::default()
        };
        let card = Device {
            name: "card".to_owned(),
            kind: DeviceKind::Graphics,
            ..Device::default()
        };
        let other = Device {
            features: queries,
            ..card.clone()
        };
        add_devices(&mut devices, &[card.clone(), Device::processor(2)]);
        add_devices(&mut devices, &[other.clone(), card.clone()]);
        assert_eq!(devices, [Device::processor(2), card, other]);
        assert_eq!(devices_line(&devices), "cpu, 2 threads; card");
        assert_eq!(devices_line(&[]), "");
    }
}
