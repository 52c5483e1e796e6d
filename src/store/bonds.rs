//! `bonds/`: which device the cells of one comparison render on. The first worker that claims a cell of a group writes
//! the file, exclusively; workers with another device leave the group alone. Where the bound device has no worker any
//! more, one of the same model may take the group over, and says so; one of another model never does.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde_json::{Value as Json, json};

use super::claim::{exclusively, seize};
use super::crew::{Device, crew};
use super::write;
use crate::experiment::groups::Affinity;

/// The folder inside an experiment's.
const FOLDER: &str = "bonds";
/// How long what is known of the workers is believed.
const FRESH: Duration = Duration::from_secs(20);

/// The bonds of one experiment, as one worker sees them.
#[derive(Debug)]
pub(super) struct Bonds {
    experiment: PathBuf,
    mine: Device,
    affinity: Affinity,
    /// Groups that are bound to this worker's device, or model.
    ours: RefCell<BTreeMap<String, ()>>,
    /// The devices of workers that are here, and when that was looked at.
    present: RefCell<Option<(Vec<String>, Instant)>>,
}

/// Whether a worker may render the cells of a group.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Bond {
    Ours,
    /// Not now: it is bound to another device of the same model.
    Theirs(String),
    /// Never: it is bound to another model.
    Never(String),
}

impl Bonds {
    pub(super) fn new(experiment: &Path, mine: Device, affinity: Affinity) -> Bonds {
        let experiment = experiment.to_owned();
        Bonds { experiment, mine, affinity, ours: RefCell::default(), present: RefCell::default() }
    }

    /// Binds a group to this worker's device if it is bound to none, or to one that is gone.
    pub(super) fn bind(&self, group: &str) -> io::Result<Bond> {
        if self.affinity == Affinity::None || self.ours.borrow().contains_key(group) {
            return Ok(Bond::Ours);
        }
        let folder = self.experiment.join(FOLDER);
        let path = folder.join(format!("{group}.json"));
        // What vanishes between two looks is somebody's who takes it over.
        for _ in 0..8 {
            let bytes = match fs::read(&path) {
                Ok(bytes) => bytes,
                Err(e) if e.kind() == io::ErrorKind::NotFound => {
                    if self.create(&folder, &path)? {
                        self.ours.borrow_mut().insert(group.to_owned(), ());
                        return Ok(Bond::Ours);
                    }
                    continue;
                }
                Err(e) => return Err(e),
            };
            let unchanged = |file: &mut fs::File| {
                let mut now = Vec::new();
                file.read_to_end(&mut now).map(|_| now == bytes)
            };
            let Some(bound) = bound(&bytes) else {
                if seize(&folder, &path, unchanged)? && self.create(&folder, &path)? {
                    tracing::warn!("{} is damaged: the comparison is bound anew", path.display());
                    self.ours.borrow_mut().insert(group.to_owned(), ());
                    return Ok(Bond::Ours);
                }
                continue;
            };
            let alike = bound.model == self.mine.model;
            if alike && (self.affinity == Affinity::Model || bound.key == self.mine.key) {
                self.ours.borrow_mut().insert(group.to_owned(), ());
                return Ok(Bond::Ours);
            }
            if !alike {
                return Ok(Bond::Never(bound.model));
            }
            if self.is_here(&bound.key) {
                return Ok(Bond::Theirs(bound.key));
            }
            if seize(&folder, &path, unchanged)? && self.create(&folder, &path)? {
                tracing::warn!(
                    "a comparison goes on with {} instead of {}, which has no worker any more; both are {}",
                    self.mine.key,
                    bound.key,
                    bound.model
                );
                self.ours.borrow_mut().insert(group.to_owned(), ());
                return Ok(Bond::Ours);
            }
        }
        Ok(Bond::Theirs("somebody who comes and goes".to_owned()))
    }

    fn create(&self, folder: &Path, path: &Path) -> io::Result<bool> {
        fs::create_dir_all(folder)?;
        let mut file = write::temporary(folder)?;
        let Device { key, model } = &self.mine;
        let bond = json!({ "device": key, "model": model, "sum": sum(key, model) });
        file.write_all(format!("{bond}\n").as_bytes())?;
        file.as_file().sync_data()?;
        Ok(exclusively(file, path)?.is_some())
    }

    /// Whether any worker renders on a device.
    fn is_here(&self, key: &str) -> bool {
        let mut present = self.present.borrow_mut();
        let fresh = present.as_ref().is_some_and(|(_, at)| at.elapsed() < FRESH);
        if !fresh {
            let workers = crew(&self.experiment).into_iter().filter(super::crew::Worker::is_here);
            *present = Some((workers.map(|w| w.device.key).collect(), Instant::now()));
        }
        present.as_ref().is_some_and(|(keys, _)| keys.iter().any(|k| k == key))
    }
}

/// The device that a file binds to; `None` if it is damaged. One that somebody wrote by hand need have no sum.
fn bound(bytes: &[u8]) -> Option<Device> {
    let json: Json = serde_json::from_slice(bytes).ok()?;
    let (key, model) = (json["device"].as_str()?, json["model"].as_str()?);
    let whole = json.get("sum").is_none_or(|kept| kept.as_str() == Some(&sum(key, model)));
    whole.then(|| Device { key: key.to_owned(), model: model.to_owned() })
}

fn sum(key: &str, model: &str) -> String {
    blake3::hash(format!("{key}\n{model}").as_bytes()).to_hex()[..16].to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::crew::{Doing, Me, Presence};
    use crate::store::owner::Owner;

    fn device(key: &str, model: &str) -> Device {
        Device { key: key.to_owned(), model: model.to_owned() }
    }

    #[test]
    fn a_comparison_stays_on_its_device_and_never_changes_its_model() {
        let dir = tempfile::tempdir().unwrap();
        let bonds = |d: &Device, affinity| Bonds::new(dir.path(), d.clone(), affinity);
        let (a, b, other) = (device("n1/0", "lens"), device("n2/0", "lens"), device("n3/0", "mirror"));
        let me = Me { device: a.clone(), affinity: Affinity::Device, job: String::new() };
        let presence = Presence::join(dir.path(), &Owner::here(), &me).unwrap();
        assert_eq!(bonds(&a, Affinity::Device).bind("g").unwrap(), Bond::Ours);
        assert_eq!(bonds(&b, Affinity::Device).bind("g").unwrap(), Bond::Theirs("n1/0".to_owned()));
        assert_eq!(bonds(&b, Affinity::Device).bind("h").unwrap(), Bond::Ours);
        assert_eq!(bonds(&b, Affinity::Model).bind("g").unwrap(), Bond::Ours);
        assert_eq!(bonds(&other, Affinity::Model).bind("g").unwrap(), Bond::Never("lens".to_owned()));
        assert_eq!(bonds(&other, Affinity::None).bind("g").unwrap(), Bond::Ours);
        presence.say(Doing::Left("its time is over".to_owned()));
        assert_eq!(bonds(&other, Affinity::Device).bind("g").unwrap(), Bond::Never("lens".to_owned()));
        assert_eq!(bonds(&b, Affinity::Device).bind("g").unwrap(), Bond::Ours, "its device has no worker any more");
        let text = fs::read_to_string(dir.path().join(FOLDER).join("g.json")).unwrap();
        assert!(text.contains("n2/0"), "{text}");
    }

    #[test]
    fn a_damaged_bond_binds_nobody() {
        let dir = tempfile::tempdir().unwrap();
        let (a, other) = (device("n1/0", "lens"), device("n3/0", "mirror"));
        let bind = |d: &Device| Bonds::new(dir.path(), d.clone(), Affinity::Device).bind("g").unwrap();
        assert_eq!(bind(&a), Bond::Ours);
        let path = dir.path().join(FOLDER).join("g.json");
        let whole = fs::read(&path).unwrap();
        let flipped = String::from_utf8_lossy(&whole).replace("lens", "hens").into_bytes();
        for damaged in [&whole[..whole.len() / 2], &flipped, b"", b"\xff"] {
            fs::write(&path, &whole).unwrap();
            assert_eq!(bind(&other), Bond::Never("lens".to_owned()));
            fs::write(&path, damaged).unwrap();
            assert_eq!(bind(&other), Bond::Ours);
            assert_eq!(bind(&a), Bond::Never("mirror".to_owned()), "it is bound anew");
        }
    }
}
