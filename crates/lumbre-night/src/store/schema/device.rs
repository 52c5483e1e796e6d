//! Devices in files: the fields of [`Device`], which files store as it is, and devices of files of
//! earlier versions.

use super::run::{OpenCost, RunResults};
use super::{RecordRow, field_rows};
use lumbre_render::Device;
use lumbre_render::device::Features;

/// Fields of [`Device`], which files store as it is.
pub(crate) const DEVICE: RecordRow = RecordRow {
    name: "Device",
    doc: "Device that renders, with what decides its speed. A field is `null` if it is unknown or does \
          not apply.",
    fields: field_rows! {
        name:
            "`cpu`, the model of a graphics device as its driver reports it, or what an external \
             program states.";
        kind:
            "`processor`, `graphics`, `emulated_graphics` for a software driver, `mock` for none, \
             `external` for another device of an external program, or `unknown`.";
        vendor:
            "Number of the vendor of a graphics device, as assigned by the PCI-SIG or, above \
             65535, by Khronos.";
        threads: "Number of threads of the processor that render.";
        driver: "Name and version of the driver of a graphics device.";
        features: "Features that decide its speed.";
        peer: "External program that renders.";
    },
};

/// Fields of [`Features`], which files store as it is.
pub(crate) const FEATURES: RecordRow = RecordRow {
    name: "Features",
    doc: "Features of a device that decide its speed.",
    fields: field_rows! {
        hierarchy:
            "Bounding volume hierarchy of this program that rays traverse, with its settings.";
        instructions: "Instruction set of the processor, such as `avx2`.";
        lanes: "Number of paths that the processor traces at a time, one in each lane of a vector.";
        tracing: "Way in which a graphics device traces rays, such as `ray queries`.";
    },
};

/// Fields of [`Peer`], which files store as it is.
pub(crate) const PEER: RecordRow = RecordRow {
    name: "Peer",
    doc: "External program that renders.",
    fields: field_rows! {
        program: "Name of the program, with its version if known.";
        wall_clock: "Whether its render time is the wall-clock time of its processes.";
    },
};

impl OpenCost {
    /// Returns the devices of a run with this cost: a stored list, or of files of earlier versions
    /// the one of a stored line for people, with what the cost states about it.
    pub fn devices(&self, list: &[Device], line: Option<&str>) -> Vec<Device> {
        let Some(line) = line.filter(|line| !line.is_empty()) else {
            return list.to_vec();
        };
        vec![Device {
            threads: self.threads,
            features: Features {
                lanes: self.lanes,
                ..Features::default()
            },
            peer: self.peer.clone(),
            ..Device::from_line(line)
        }]
    }
}

impl RunResults {
    /// Returns the devices that rendered the run; none if they are unknown.
    pub fn devices(&self) -> Vec<Device> {
        self.open.devices(&self.devices, self.device.as_deref())
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use crate::store::StoredFile;
    use crate::store::schema::journal::{JournalEvent, JournalLine};
    use crate::store::schema::one_line;
    use crate::store::schema::run::DoneFile;
    use lumbre_render::{DeviceKind, Peer};

    use super::*;

    /// `done.json` as version 0.1.0 wrote it before devices were lists.
    const EARLIER_DONE: &str = r#"{"kind":"rendered","version":1,"program":"lumbre 0.1.0",
"run":"bfe87a912cce124c271d8dd698cb38ba","reason":"4 samples per pixel","samples":4,
"render_s":0.0011157100088894367,"wall_s":0.15911101300000002,"measure_s":2.754e-6,"waves":3,
"paths":1024,"rays":0,"invalid":0,"first_invalid":null,"metrics":{},"floors":null,"net":null,
"halves":null,"films":[],"seed":6808896390189072400,"device":"cpu, 1 threads, noise 1.0",
"processor":"AMD EPYC","open":{"accel_build_s":0.0,"accel_nodes":0,"accel_bytes":0,
"accel_cost":0.0,"threads":1,"peer":{"program":"noise 1.0","wall_clock":false}},
"scene_hash":"cbd6fd84b0ddc3ea888b003dbb5cfda0df21d3a4dfa441db1b1db2439b43fe4f",
"finished":"2026-11-26T21:25:28Z","files":{"final.exr":{"bytes":3849,
"blake3":"44323e46c2dd696921a7d029444e4fc6da26ab829709089b7febe8b3c7cf2574"},
"final.png":{"bytes":1214,
"blake3":"07313d1968be23877ed6f77ba6f4776a43bfbb9e0fefc4ed5d99dbaca0e54a56"},
"metrics.csv":{"bytes":232,
"blake3":"8b9db4413611dc2f01ae15959b59595ec3d898495ea101b4a22bb5c8d0a56902"}},
"check":"fd39e318fff9733222708bf0dcd7d527"}"#;

    /// Line of a journal from the same night.
    const EARLIER_LINE: &str = r#"{"date":"2026-11-26T21:25:28Z","event":"cell_started","run":"0562b0dcd055d36f93194a7956b7ac3b",
"path":"technique=nee/rep=0","device":"cpu, 2 threads, eight-wide BVH, avx512, vectorised",
"open":{"accel_build_s":0.000024967,"accel_nodes":0,"accel_bytes":1760,"accel_cost":38.0,
"geometry_bytes":3976,"texture_bytes":0,"threads":2,"lanes":16}}"#;

    #[test]
    fn a_line_of_an_earlier_version_is_a_device_of_unknown_kind() {
        let done = DoneFile::parse(EARLIER_DONE.as_bytes()).unwrap();
        let devices = done.rendered().unwrap().devices();
        let device = Device {
            threads: Some(1),
            peer: Some(Peer {
                program: "noise 1.0".to_owned(),
                wall_clock: false,
            }),
            ..Device::from_line("cpu, 1 threads, noise 1.0")
        };
        assert_eq!(devices, [device]);
        let changed = EARLIER_DONE.replace("noise 1.0\",", "noise 2.0\",");
        assert!(
            DoneFile::parse(changed.as_bytes()).is_err(),
            "the checksum covers the line"
        );
        let line: JournalLine = serde_json::from_str(EARLIER_LINE).unwrap();
        assert_eq!(
            one_line(&line).trim_end().replace('\n', ""),
            EARLIER_LINE.replace('\n', "")
        );
        let JournalEvent::CellStarted(start) = line.event else {
            panic!("{line:?}")
        };
        let open = start.stats();
        assert_eq!(
            open.device_line(),
            "cpu, 2 threads, eight-wide BVH, avx512, vectorised"
        );
        assert_eq!(
            (
                open.devices[0].kind,
                open.devices[0].threads,
                open.devices[0].features.lanes
            ),
            (DeviceKind::Unknown, Some(2), Some(16))
        );
    }

    #[test]
    fn a_list_of_devices_reads_back() {
        let devices = vec![Device::processor(2), Device::mock()];
        let results = RunResults {
            devices: devices.clone(),
            ..RunResults::default()
        };
        let done = DoneFile::Rendered(Box::new(results)).sealed(Default::default());
        let text = done.text();
        let read = DoneFile::parse(text.as_bytes()).unwrap();
        assert_eq!(read.rendered().unwrap().devices(), devices);
        assert!(
            !text.contains("\"device\""),
            "the line of earlier versions is absent: {text}"
        );
        let unknown = text.replace("\"kind\": \"mock\"", "\"kind\": \"abacus\"");
        assert!(DoneFile::parse(unknown.as_bytes()).is_err());
    }

    #[test]
    fn every_field_of_a_device_is_described() {
        let device = Device {
            peer: Some(Peer::default()),
            ..Device::default()
        };
        let json = serde_json::to_value(&device).unwrap();
        for (row, value) in [
            (DEVICE, &json),
            (FEATURES, &json["features"]),
            (PEER, &json["peer"]),
        ] {
            let described: BTreeSet<&str> = row.fields.iter().map(|field| field.name).collect();
            let stored: BTreeSet<&str> = value
                .as_object()
                .unwrap()
                .keys()
                .map(String::as_str)
                .collect();
            assert_eq!(described, stored, "{}", row.name);
        }
    }
}
