//! Device affinity of comparison groups: all cells of one comparison render on the same device, so
//! that their times can be compared. `affinity/<group>.json` names the device of a group.
//!
//! The first worker that claims a cell of a group creates the file exclusively; workers with
//! another device skip the group. If no active worker has that device any more, a worker with the
//! same model of device takes the group over and logs it. A worker with another model never does.

use std::cell::RefCell;
use std::collections::BTreeSet;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use tempfile::NamedTempFile;

use super::exclusive_file::{persist_exclusively, replace_exclusively};
use crate::experiment::comparison_groups::Affinity;
use crate::store::schema::process::{AffinityFile, RenderDevice};
use crate::store::schema::{StoredFile, one_line};
use crate::store::worker::registry::{WorkerStatus, list_workers};
use crate::store::write::atomic;
use crate::store::{layout, regular_file};

/// Name of the folder inside an experiment's folder.
const FOLDER: &str = "affinity";
/// Time for which a listing of the workers is reused.
const WORKERS_VALID: Duration = Duration::from_secs(20);
/// Number of attempts while other workers keep changing the file of a group.
const ATTEMPTS: usize = 8;

/// Device affinities of one experiment, as seen by one worker.
#[derive(Debug)]
pub(crate) struct DeviceAffinity {
    experiment: PathBuf,
    device: RenderDevice,
    affinity: Affinity,
    /// Groups known to be bound to this worker's device, or to its model.
    bound_groups: RefCell<BTreeSet<String>>,
    /// Keys of the devices of active workers, and when they were listed.
    active_devices: RefCell<Option<(Vec<String>, Instant)>>,
}

/// Decision whether this worker may render the cells of a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum AffinityDecision {
    /// The worker may render cells of the group.
    Allowed,
    /// The group is bound to another device of the same model; holds its key.
    OtherDevice(String),
    /// The group is bound to another model of device; holds the model.
    OtherModel(String),
}

impl DeviceAffinity {
    pub(crate) fn new(
        experiment: &Path,
        device: RenderDevice,
        affinity: Affinity,
    ) -> DeviceAffinity {
        DeviceAffinity {
            experiment: experiment.to_owned(),
            device,
            affinity,
            bound_groups: RefCell::default(),
            active_devices: RefCell::default(),
        }
    }

    /// Binds a group to this worker's device if it is bound to none, or to one without a worker.
    /// Returns whether this worker may render the group's cells.
    ///
    /// # Errors
    /// When the file of the group can be neither read nor created.
    pub(crate) fn bind(&self, group: &str) -> io::Result<AffinityDecision> {
        if self.affinity == Affinity::None || self.bound_groups.borrow().contains(group) {
            return Ok(AffinityDecision::Allowed);
        }
        let folder = self.experiment.join(FOLDER);
        let path = folder.join(format!("{group}.json"));
        for _ in 0..ATTEMPTS {
            if let Some(decision) = self.try_bind(&folder, &path)? {
                if decision == AffinityDecision::Allowed {
                    self.bound_groups.borrow_mut().insert(group.to_owned());
                }
                return Ok(decision);
            }
        }
        Ok(AffinityDecision::OtherDevice(
            "an unknown device (the file changed at every attempt)".to_owned(),
        ))
    }

    /// Reads the file of a group once, and creates or replaces it if allowed. Returns `None` if
    /// another worker changed the file meanwhile.
    fn try_bind(&self, folder: &Path, path: &Path) -> io::Result<Option<AffinityDecision>> {
        let bytes = match regular_file::read(path) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                fs::create_dir_all(folder)?;
                let created = persist_exclusively(self.bound_file(folder)?, path)?;
                return Ok(created.map(|_| AffinityDecision::Allowed));
            }
            Err(e) => return Err(e),
        };
        let bound = parse_device(&bytes);
        if let Some(bound) = &bound {
            if bound.model != self.device.model {
                return Ok(Some(AffinityDecision::OtherModel(bound.model.clone())));
            }
            if self.affinity == Affinity::Model || bound.key == self.device.key {
                return Ok(Some(AffinityDecision::Allowed));
            }
            if self.has_active_worker(&bound.key) {
                return Ok(Some(AffinityDecision::OtherDevice(bound.key.clone())));
            }
        }
        let unchanged = |file: &mut fs::File| {
            let mut now = Vec::new();
            file.read_to_end(&mut now).map(|_| now == bytes)
        };
        if replace_exclusively(path, &bytes, unchanged, self.bound_file(folder)?)?.is_none() {
            return Ok(None);
        }
        match bound {
            Some(bound) => tracing::warn!(
                "a comparison continues on {} because {} has no worker any more (both are {})",
                self.device.key,
                bound.key,
                bound.model
            ),
            None => tracing::warn!(
                "{} is damaged: the comparison is bound again, to this worker's device",
                path.display()
            ),
        }
        Ok(Some(AffinityDecision::Allowed))
    }

    /// Writes a file that binds a group to this worker's device, under a temporary name.
    fn bound_file(&self, folder: &Path) -> io::Result<NamedTempFile> {
        let mut file = atomic::temporary(folder)?;
        let content = AffinityFile {
            device: self.device.clone(),
            check: Some(checksum(&self.device)),
            ..AffinityFile::default()
        };
        file.write_all(one_line(&content).as_bytes())?;
        file.as_file().sync_data()?;
        Ok(file)
    }

    /// Whether any active worker renders on the device with this key.
    fn has_active_worker(&self, key: &str) -> bool {
        let mut active = self.active_devices.borrow_mut();
        let valid = active
            .as_ref()
            .is_some_and(|(_, at)| at.elapsed() < WORKERS_VALID);
        if !valid {
            let workers = list_workers(&self.experiment)
                .into_iter()
                .filter(WorkerStatus::is_active);
            *active = Some((workers.map(|w| w.device.key).collect(), Instant::now()));
        }
        active
            .as_ref()
            .is_some_and(|(keys, _)| keys.iter().any(|k| k == key))
    }
}

/// Removes the damaged files of groups in an experiment's folder, and names them. The next worker
/// that renders a cell of such a group binds it again.
pub(crate) fn remove_damaged(experiment: &Path) {
    for path in layout::files_in(&experiment.join(FOLDER)) {
        let is_group = path
            .extension()
            .is_some_and(|extension| extension == "json");
        let intact = || regular_file::read(&path).is_ok_and(|bytes| parse_device(&bytes).is_some());
        if is_group && !intact() && fs::remove_file(&path).is_ok() {
            tracing::warn!(
                "{} is damaged and has been removed: its comparison is bound to a device again",
                path.display()
            );
        }
    }
}

/// Parses the file of a group. Returns `None` if it is damaged. A file without a checksum, written
/// by hand, is accepted.
fn parse_device(bytes: &[u8]) -> Option<RenderDevice> {
    let AffinityFile { device, check, .. } = AffinityFile::parse(bytes).ok()?;
    let intact = check.is_none_or(|stored| stored == checksum(&device));
    intact.then_some(device)
}

fn checksum(RenderDevice { key, model }: &RenderDevice) -> String {
    blake3::hash(format!("{key}\n{model}").as_bytes()).to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use crate::store::lock::device_affinity::*;
    use crate::store::schema::process::{Owner, WorkerState};
    use crate::store::worker::registry::{Heartbeat, WorkerInfo};

    fn device(key: &str, model: &str) -> RenderDevice {
        RenderDevice {
            key: key.to_owned(),
            model: model.to_owned(),
        }
    }

    #[test]
    fn a_comparison_stays_on_its_device_and_never_changes_its_model() {
        let dir = tempfile::tempdir().unwrap();
        let affinities =
            |d: &RenderDevice, affinity| DeviceAffinity::new(dir.path(), d.clone(), affinity);
        let (a, b, other) = (
            device("n1/0", "lens"),
            device("n2/0", "lens"),
            device("n3/0", "mirror"),
        );
        let worker = WorkerInfo {
            device: a.clone(),
            affinity: Affinity::Device,
            job: String::new(),
        };
        let heartbeat = Heartbeat::join(dir.path(), &Owner::current(), &worker).unwrap();
        assert_eq!(
            affinities(&a, Affinity::Device).bind("g").unwrap(),
            AffinityDecision::Allowed
        );
        assert_eq!(
            affinities(&b, Affinity::Device).bind("g").unwrap(),
            AffinityDecision::OtherDevice("n1/0".to_owned())
        );
        assert_eq!(
            affinities(&b, Affinity::Device).bind("h").unwrap(),
            AffinityDecision::Allowed
        );
        assert_eq!(
            affinities(&b, Affinity::Model).bind("g").unwrap(),
            AffinityDecision::Allowed
        );
        assert_eq!(
            affinities(&other, Affinity::Model).bind("g").unwrap(),
            AffinityDecision::OtherModel("lens".to_owned())
        );
        assert_eq!(
            affinities(&other, Affinity::None).bind("g").unwrap(),
            AffinityDecision::Allowed
        );
        heartbeat.set_state(WorkerState::Left("its time is over".to_owned()));
        assert_eq!(
            affinities(&other, Affinity::Device).bind("g").unwrap(),
            AffinityDecision::OtherModel("lens".to_owned())
        );
        assert_eq!(
            affinities(&b, Affinity::Device).bind("g").unwrap(),
            AffinityDecision::Allowed,
            "its device has no worker any more"
        );
        let text = fs::read_to_string(dir.path().join(FOLDER).join("g.json")).unwrap();
        assert!(text.contains("n2/0"), "{text}");
    }

    #[test]
    fn a_damaged_file_is_bound_again() {
        let dir = tempfile::tempdir().unwrap();
        let (a, other) = (device("n1/0", "lens"), device("n3/0", "mirror"));
        let bind = |d: &RenderDevice| {
            DeviceAffinity::new(dir.path(), d.clone(), Affinity::Device)
                .bind("g")
                .unwrap()
        };
        assert_eq!(bind(&a), AffinityDecision::Allowed);
        let path = dir.path().join(FOLDER).join("g.json");
        let intact = fs::read(&path).unwrap();
        let flipped = String::from_utf8_lossy(&intact)
            .replace("lens", "hens")
            .into_bytes();
        for damaged in [&intact[..intact.len() / 2], &flipped, b"", b"\xff"] {
            fs::write(&path, &intact).unwrap();
            assert_eq!(
                bind(&other),
                AffinityDecision::OtherModel("lens".to_owned())
            );
            fs::write(&path, damaged).unwrap();
            assert_eq!(bind(&other), AffinityDecision::Allowed);
            assert_eq!(
                bind(&a),
                AffinityDecision::OtherModel("mirror".to_owned()),
                "it is bound again"
            );
        }
    }
}
