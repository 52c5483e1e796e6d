//! Access to the folder of one night: its plan, and where its runs and references are. Listings,
//! the status, the dashboard of another process, reports and the reproduction of results all read a
//! night through [`NightReader`]. Nothing here writes or locks.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use super::run_reader::RunReader;
use crate::experiment::{CellRef, RunId};
use crate::store::schema::plan::{EnvFile, PlanFile, PlannedReference};
use crate::store::schema::run::{DONE, REFERENCE};
use crate::store::schema::{self, Problem, ReadError, StoredFile};
use crate::store::{StoreError, layout};

/// A night's folder with its plan.
#[derive(Debug)]
pub struct NightReader {
    folder: PathBuf,
    out: PathBuf,
    plan: PlanFile,
    /// Folders of this night's runs that are finished in sibling folders, by run id. Read when it is
    /// first needed, since scanning is slow.
    elsewhere: OnceCell<BTreeMap<String, PathBuf>>,
}

impl NightReader {
    /// Opens the folder of a night, or a link to it such as `out/latest`. References are read from
    /// the folder `refs` beside it.
    ///
    /// # Errors
    /// When it has no readable plan, or another version of the program wrote it.
    pub fn open(folder: &Path) -> Result<NightReader, StoreError> {
        // Siblings are those of the folder that a link points at.
        let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        NightReader::at(folder).map_err(|error| match error.problem {
            Problem::OtherVersion { .. } => error.into(),
            problem => StoreError::Io {
                action: "read",
                path: error.path,
                reason: format!(
                    "it{problem} (expected the folder of a night, such as out/latest; `lumbre ls` \
                     lists them)"
                ),
                full: false,
            },
        })
    }

    /// Opens the folder of a night by a path that is no link.
    pub(crate) fn at(folder: PathBuf) -> Result<NightReader, ReadError> {
        let plan = PlanFile::read(&folder).map_err(|error| with_writer(error, &folder))?;
        Ok(NightReader {
            out: folder.parent().map(Path::to_owned).unwrap_or_default(),
            folder,
            plan,
            elsewhere: OnceCell::new(),
        })
    }

    /// Opens all nights below an output folder, ordered by folder. A missing folder has none.
    pub fn all(out: &Path) -> Vec<Result<NightReader, ReadError>> {
        let folders = layout::folders_in(out).into_iter();
        folders
            .filter(|folder| folder.join(PlanFile::NAME).is_file())
            .map(NightReader::at)
            .collect()
    }

    /// Folder of the night.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Output folder that contains it.
    pub fn out(&self) -> &Path {
        &self.out
    }

    /// Plan of the night.
    pub fn plan(&self) -> &PlanFile {
        &self.plan
    }

    /// The machine and the command that last rendered it.
    ///
    /// # Errors
    /// When they are not recorded, or cannot be read.
    pub fn env(&self) -> Result<EnvFile, ReadError> {
        EnvFile::read(&self.folder)
    }

    /// Cells and references of the plan by the ids of their runs.
    pub fn cells_by_run(&self) -> BTreeMap<String, Vec<CellRef>> {
        let mut ids: BTreeMap<String, Vec<CellRef>> = BTreeMap::new();
        for (i, cell) in self.plan.cells.iter().enumerate() {
            ids.entry(cell.run.clone())
                .or_default()
                .push(CellRef::Cell(i));
        }
        for (i, reference) in self.plan.references.iter().enumerate() {
            let cells = ids.entry(reference.run().to_owned()).or_default();
            cells.push(CellRef::Reference(i));
        }
        ids
    }

    /// Folder of a cell's run in this night, or of a reference; it need not exist. Empty for an
    /// index that the plan does not have.
    pub fn run_folder(&self, cell: CellRef) -> PathBuf {
        match cell {
            CellRef::Cell(i) => self.plan.cells.get(i).map_or_else(PathBuf::new, |cell| {
                self.folder.join("runs").join(&cell.folder)
            }),
            CellRef::Reference(i) => self
                .plan
                .references
                .get(i)
                .map_or_else(PathBuf::new, |reference| {
                    layout::reference_folder(&self.out, &RunId(reference.run().to_owned()))
                }),
        }
    }

    /// Name of the last file of a run or reference.
    pub fn done_name(cell: CellRef) -> &'static str {
        match cell {
            CellRef::Cell(_) => DONE,
            CellRef::Reference(_) => REFERENCE,
        }
    }

    /// Whether a run or reference is finished in its own folder. A reference that is an image file
    /// is, if the file or its copy exists.
    pub fn is_done(&self, cell: CellRef) -> bool {
        let is_file = || match cell {
            CellRef::Cell(_) => false,
            CellRef::Reference(i) => self.image_file(i).is_some_and(|file| file.is_file()),
        };
        let folder = self.run_folder(cell);
        folder.join(NightReader::done_name(cell)).is_file() || is_file()
    }

    /// Folder in which a cell's run is finished: its own, or that of another night with the same
    /// name.
    pub fn finished_folder(&self, cell: CellRef) -> Option<PathBuf> {
        let own = self.run_folder(cell);
        match cell {
            _ if self.is_done(cell) => Some(own),
            CellRef::Cell(i) => self.elsewhere().get(&self.plan.cells.get(i)?.run).cloned(),
            CellRef::Reference(_) => None,
        }
    }

    /// Finished runs of the nights beside this one that have its name, by run id.
    pub fn elsewhere(&self) -> &BTreeMap<String, PathBuf> {
        self.elsewhere
            .get_or_init(|| layout::finished_in_siblings(&self.out, &self.plan.name, &self.folder))
    }

    /// Image file of a reference that is one: the copy in `refs`, which has a checksum, or the
    /// original if there is no copy.
    pub fn image_file(&self, reference: usize) -> Option<PathBuf> {
        match self.plan.references.get(reference)? {
            PlannedReference::Render(_) => None,
            PlannedReference::File(found) => {
                let file = PathBuf::from(&found.source);
                let folder = self.run_folder(CellRef::Reference(reference));
                let copy = folder.join(layout::imported_file_name(&file));
                Some(if copy.is_file() { copy } else { file })
            }
        }
    }

    /// File of a reference's picture, if it exists.
    pub fn reference_picture(&self, reference: usize) -> Option<PathBuf> {
        let rendered = || {
            let folder = self.run_folder(CellRef::Reference(reference));
            folder.join("ref.exr")
        };
        let file = self.image_file(reference).unwrap_or_else(rendered);
        file.is_file().then_some(file)
    }

    /// Reader of a run or reference in its own folder.
    pub fn run(&self, cell: CellRef) -> RunReader {
        RunReader::new(self.run_folder(cell))
    }
}

/// Completes the error of a plan that another version wrote. Plans did not always name their
/// program, but the record of the command did.
pub(crate) fn with_writer(error: ReadError, folder: &Path) -> ReadError {
    match error.problem {
        Problem::OtherVersion {
            version,
            program: None,
        } => ReadError {
            problem: Problem::OtherVersion {
                version,
                program: schema::writer_of(&folder.join(EnvFile::NAME)),
            },
            ..error
        },
        _ => error,
    }
}
