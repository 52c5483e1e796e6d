//! What is new of one run: its measurements, its newest picture, and the films that it left when it ended.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::Seen;
use crate::experiment::{CellRef, Outline, WaveRow};
use crate::film::Image;
use crate::film::time::{CUBE_FILE, TimeAxis};
use crate::store::archive::Decode;
use crate::store::tail::Tail;
use crate::store::{FILMS, rows};

/// A run at hand.
#[derive(Debug)]
pub(super) struct Run {
    pub(super) cell: CellRef,
    /// Who renders it; empty where nobody but the night does.
    pub(super) worker: String,
    pub(super) running: bool,
    folder: PathBuf,
    metrics: Tail,
    /// For every metric of the outline its place in the rows of the file, once the header was read.
    places: Option<Vec<Option<usize>>>,
    /// Samples of the newest picture that was read.
    pictured: u64,
    /// Films of strategies that are still to be read.
    films: VecDeque<PathBuf>,
    /// Its bins, if its film has a time axis that was not told of yet.
    axis: Option<TimeAxis>,
}

impl Run {
    /// A run that has just started.
    pub(super) fn new(cell: CellRef, folder: PathBuf, worker: String, axis: Option<TimeAxis>) -> Run {
        let metrics = Tail::new(folder.join("metrics.csv"));
        let films = VecDeque::new();
        Run { cell, worker, running: true, folder, metrics, places: None, pictured: 0, films, axis }
    }

    /// The file of its measurements.
    pub(super) fn measurements(&self) -> &Path {
        self.metrics.path()
    }

    /// New rows and a newer picture; once it has ended, the films of its strategies, one at a look, and its light by time.
    pub(super) fn look(&mut self, outline: &Outline, decode: Decode, see: &mut impl FnMut(Seen)) {
        let cell = self.cell;
        for row in self.new_rows(outline) {
            see(Seen::Measured { cell, row });
        }
        let last = if self.running { self.pictured } else { u64::MAX };
        if let Some((samples, file)) = newest_picture(&self.folder, self.running).filter(|(n, _)| *n > self.pictured)
            && let Some(image) = image(&file, decode)
        {
            self.pictured = samples;
            see(Seen::Pictured { cell, image: Arc::new(image) });
            if !self.running && last == u64::MAX {
                self.films = strategies(&self.folder).into();
            }
        }
        if let Some(file) = self.films.pop_front()
            && let (Some((s, t, weighted)), Some(image)) = (strategy(&file), image(&file, decode))
        {
            see(Seen::Strategy { cell, s, t, weighted, image: Arc::new(image) });
        }
        let file = self.folder.join(FILMS).join(CUBE_FILE);
        if let Some(axis) = self.axis.take_if(|_| !self.running && file.is_file()) {
            see(Seen::Timed { cell, file, axis });
        }
    }

    fn new_rows(&mut self, outline: &Outline) -> Vec<WaveRow> {
        let news = self.metrics.look();
        if news.anew {
            self.places = None;
        }
        let Some(places) = &self.places else {
            // The header comes with the first lines.
            let Ok((columns, found)) = rows::parse(&news.text) else { return Vec::new() };
            let place = |column: &str| columns.iter().position(|c| c == column);
            let places: Vec<Option<usize>> = outline.metrics.iter().map(|m| place(&m.column)).collect();
            let rows = found.into_iter().map(|row| placed(row, &places)).collect();
            self.places = Some(places);
            return rows;
        };
        let rows = rows::parse_more(&news.text);
        rows.into_iter().map(|row| placed(row, places)).collect()
    }
}

/// The picture in a file, if it is whole.
pub(super) fn image(file: &Path, decode: Decode) -> Option<Image> {
    decode(&fs::read(file).ok()?).ok()
}

/// A row with its metrics in the order of the outline; none where none was measured.
fn placed(row: WaveRow, places: &[Option<usize>]) -> WaveRow {
    let metrics = if row.metrics.is_empty() {
        Vec::new()
    } else {
        places.iter().map(|p| p.and_then(|p| row.metrics.get(p)).copied().unwrap_or(f64::NAN)).collect()
    };
    WaveRow { metrics, ..row }
}

/// The newest picture in a run's folder, and how new it is: snapshots count by their samples, the final picture of a run
/// that has ended counts more than any of them.
fn newest_picture(folder: &Path, running: bool) -> Option<(u64, PathBuf)> {
    if !running {
        let last = ["final.exr", "ref.exr"].map(|name| folder.join(name)).into_iter().find(|file| file.is_file());
        if let Some(file) = last {
            return Some((u64::MAX, file));
        }
    }
    let entries = fs::read_dir(folder).ok()?.flatten();
    let snapshots = entries.filter_map(|entry| {
        let name = entry.file_name();
        let samples = name.to_str()?.strip_prefix("snap-")?.strip_suffix(".exr")?.parse().ok()?;
        Some((samples, entry.path()))
    });
    snapshots.max_by_key(|(samples, _)| *samples)
}

/// The films of strategies in a run's folder, ordered by name.
fn strategies(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(FILMS)).into_iter().flatten().flatten();
    let mut files: Vec<PathBuf> = entries.map(|e| e.path()).filter(|file| strategy(file).is_some()).collect();
    files.sort();
    files
}

/// Vertices from the light and from the camera, and whether it is weighted: `strategies-s2-t1-raw.exr`.
fn strategy(file: &Path) -> Option<(u32, u32, bool)> {
    let name = file.file_name()?.to_str()?.strip_suffix(".exr")?.strip_prefix("strategies-s")?;
    let (s, rest) = name.split_once("-t")?;
    let (t, kind) = rest.split_once('-')?;
    Some((s.parse().ok()?, t.parse().ok()?, kind == "weighted"))
}
