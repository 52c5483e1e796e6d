//! Access to finished runs and references of earlier nights. Nothing here writes.

use std::cell::RefCell;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use super::evidence::Evidence;
use super::run_reader::RunReader;
use crate::experiment::event::{FinishedRun, History};
use crate::experiment::noise_floor::HalfImages;
use crate::experiment::plan::ReferenceSource;
use crate::experiment::{CellRef, Plan, SinkError};
use crate::store::schema::run::DoneFile;
use crate::store::write::{manifest_checksum, metrics_csv, reference_sums};
use crate::store::{HALVES, NOISE, layout};
use lumbre_light::film::Image;

/// Decodes the bytes of an image; the error is for users. Supplied by callers, since this module
/// knows no image format.
pub type Decode = fn(&[u8]) -> Result<Image, String>;

/// The finished runs and references below one output folder.
#[derive(Debug)]
pub struct Archive {
    out: PathBuf,
    experiment: Option<PathBuf>,
    /// Results of verifying all checksums of a finished run, by its folder and the hash in its last
    /// file. `None` if only file sizes are checked.
    verified: Option<RefCell<BTreeMap<(PathBuf, String), bool>>>,
    /// Problems that were reported, so that each is reported once.
    reported: RefCell<BTreeSet<(PathBuf, String)>>,
    decode: Decode,
    /// Folders of finished runs by experiment name and run id, filled when a name is first
    /// requested.
    index: RefCell<BTreeMap<String, BTreeMap<String, PathBuf>>>,
}

impl Archive {
    /// Opens the archive of an output folder, which need not exist.
    pub fn new(out: &Path, decode: Decode) -> Archive {
        Archive {
            out: out.to_owned(),
            experiment: None,
            verified: None,
            reported: RefCell::default(),
            decode,
            index: RefCell::default(),
        }
    }

    /// Opens the archive for an experiment. Its own folder is searched first and never from the
    /// index, and finished runs count only if all their checksums match.
    pub(crate) fn for_experiment(out: &Path, experiment: &Path, decode: Decode) -> Archive {
        Archive {
            experiment: Some(experiment.to_owned()),
            verified: Some(RefCell::default()),
            ..Archive::new(out, decode)
        }
    }

    /// Opens the archive for a worker. A worker cannot scan all folders or read every byte of what
    /// other workers finish, so it receives the finished runs of sibling folders and checks file
    /// sizes only.
    pub(crate) fn for_worker(
        out: &Path,
        experiment: &Path,
        decode: Decode,
        name: &str,
        elsewhere: BTreeMap<String, PathBuf>,
    ) -> Archive {
        let index = RefCell::new(BTreeMap::from([(name.to_owned(), elsewhere)]));
        Archive {
            experiment: Some(experiment.to_owned()),
            index,
            ..Archive::new(out, decode)
        }
    }

    /// Registers the folder of a run that is about to be written, so that other cells with its id
    /// find it.
    pub(crate) fn register(&self, name: &str, id: &str, folder: &Path) {
        if self.indexed(name, id).is_none() {
            let mut index = self.index.borrow_mut();
            index
                .entry(name.to_owned())
                .or_default()
                .insert(id.to_owned(), folder.to_owned());
        }
    }

    /// Folder of a finished run in any experiment folder with this name.
    fn indexed(&self, name: &str, id: &str) -> Option<PathBuf> {
        let mut index = self.index.borrow_mut();
        let runs = index
            .entry(name.to_owned())
            .or_insert_with(|| layout::finished_runs(layout::siblings(&self.out, name)));
        runs.get(id).cloned()
    }
}

impl Archive {
    /// Samples per pixel of the stored shorter reference that an unfinished reference continues
    /// from, if there is one.
    pub fn shorter_samples(&self, plan: &Plan, reference: usize) -> Option<u64> {
        let ReferenceSource::Render { stem, stop, .. } = &plan.references.get(reference)?.source
        else {
            return None;
        };
        reference_sums::samples(&self.out, &stem.0, stop.sample_limit()?)
    }

    fn read_image(&self, file: &Path) -> Result<Image, SinkError> {
        let bytes = Evidence::default().read(file).map_err(SinkError)?;
        (self.decode)(&bytes).map_err(|problem| SinkError(format!("{}: {problem}", file.display())))
    }

    /// Returns a run that counts as finished. Warns once if it claims to be finished but is
    /// damaged.
    fn usable(
        &self,
        folder: &Path,
        loaded: Result<Option<FinishedRun>, String>,
    ) -> Option<FinishedRun> {
        match loaded {
            Ok(run) => run,
            Err(problem) => {
                if self.verified.is_some()
                    && self
                        .reported
                        .borrow_mut()
                        .insert((folder.to_owned(), problem.clone()))
                {
                    tracing::warn!(
                        "{}: {problem}; the run will be rendered again",
                        folder.display()
                    );
                }
                None
            }
        }
    }

    /// Returns a finished run if its files match their checksums, or if checksums are not verified.
    fn verify(&self, run: FinishedRun) -> Option<FinishedRun> {
        let Some(verified) = &self.verified else {
            return Some(run);
        };
        let done = DoneFile::find(&run.folder).ok()??;
        let key = (run.folder.clone(), done.check().to_owned());
        let known = verified.borrow().get(&key).copied();
        let intact = known.unwrap_or_else(|| {
            let problem = manifest_checksum::verify_hashes(&run.folder, &done).err();
            if let Some(problem) = &problem {
                tracing::warn!(
                    "{}: {problem}; the run will be rendered again",
                    run.folder.display()
                );
            }
            problem.is_none()
        });
        verified.borrow_mut().insert(key, intact);
        intact.then_some(run)
    }
}

impl History for Archive {
    fn finished_run(&self, plan: &Plan, cell: CellRef) -> Option<FinishedRun> {
        match cell {
            CellRef::Cell(i) => {
                let cell = plan.cells.get(i)?;
                let columns = if cell.reference.is_some() {
                    plan.columns()
                } else {
                    Vec::new()
                };
                let load = |folder: PathBuf| {
                    let loaded = load_finished(&folder, &cell.id.0, "final.exr", &columns);
                    self.verify(self.usable(&folder, loaded)?)
                };
                let here = self
                    .experiment
                    .as_ref()
                    .and_then(|experiment| load(layout::run_folder(experiment, plan, i)));
                here.or_else(|| load(self.indexed(&plan.name, &cell.id.0)?))
            }
            CellRef::Reference(i) => {
                // A reference that is an image file is no run; its folder holds a copy.
                let reference = plan
                    .references
                    .get(i)
                    .filter(|reference| reference.stem().is_some())?;
                let folder = layout::reference_folder(&self.out, &reference.id);
                let loaded = load_finished(&folder, &reference.id.0, "ref.exr", &[]);
                self.verify(self.usable(&folder, loaded)?)
            }
        }
    }

    fn image(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else {
            return Ok(None);
        };
        let (file, advice) = match &wanted.source {
            ReferenceSource::File { file, .. } => (file.clone(), ""),
            ReferenceSource::Render { .. } => {
                match self.finished_run(plan, CellRef::Reference(reference)) {
                    Some(run) => (
                        run.folder.join("ref.exr"),
                        " (delete its folder, and it will be rendered again)",
                    ),
                    None => return Ok(None),
                }
            }
        };
        self.read_image(&file)
            .map(Some)
            .map_err(|SinkError(problem)| SinkError(problem + advice))
    }

    fn noise(&self, plan: &Plan, reference: usize) -> Result<Option<Image>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else {
            return Ok(None);
        };
        let file = layout::reference_folder(&self.out, &wanted.id).join(NOISE);
        if !file.is_file() {
            return Ok(None);
        }
        self.read_image(&file).map(Some)
    }

    fn halves(&self, plan: &Plan, reference: usize) -> Result<Option<HalfImages>, SinkError> {
        let Some(wanted) = plan.references.get(reference) else {
            return Ok(None);
        };
        let folder = layout::reference_folder(&self.out, &wanted.id);
        let done = DoneFile::find(&folder).ok().flatten();
        let results = done.as_ref().and_then(DoneFile::rendered);
        let known = results.filter(|results| results.run == wanted.id.0);
        let Some(samples) = known.and_then(|results| results.halves) else {
            return Ok(None);
        };
        let read = |name: &str| self.read_image(&folder.join(name));
        Ok(Some(HalfImages {
            means: [read(HALVES[0])?, read(HALVES[1])?],
            samples,
        }))
    }
}

/// Loads a finished run. Returns `None` if the folder holds none with this id. Checks that all
/// files of its manifest and the image exist, and that the measurements are readable and have the
/// requested columns.
///
/// # Errors
/// Description of the first problem of a run whose last file exists.
fn load_finished(
    folder: &Path,
    id: &str,
    image: &str,
    columns: &[String],
) -> Result<Option<FinishedRun>, String> {
    let run = RunReader::new(folder.to_owned());
    let Some(done) = run.checked()? else {
        return Ok(None);
    };
    let Some(results) = done.rendered().filter(|results| results.run == id) else {
        return Ok(None);
    };
    if !folder.join(image).is_file() {
        return Err(format!("{image} is missing"));
    }
    let measurements = run.measurements(Some(&done))?;
    let lacking = columns.iter().find(|c| !measurements.columns.contains(c));
    if let Some(column) = lacking {
        return Err(format!("{} has no column {column}", metrics_csv::FILE));
    }
    let floors = if results.floors.is_some() {
        columns.iter().map(|column| results.floor(column)).collect()
    } else {
        Vec::new()
    };
    Ok(Some(FinishedRun {
        folder: folder.to_owned(),
        rows: measurements.in_order(columns.iter().map(String::as_str)),
        floors: floors.into(),
        open: results.open.stats(results.devices()),
    }))
}
