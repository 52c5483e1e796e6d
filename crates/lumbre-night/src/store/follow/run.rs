//! Follows one run: its measurements, its newest image, and the layer images that it stored when it
//! ended.

use std::collections::VecDeque;
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use crate::experiment::{CellRef, Event, WaveRow};
use crate::store::FILMS;
use crate::store::read::archive::Decode;
use crate::store::read::evidence::Evidence;
use crate::store::read::run_reader::{reordered, snapshots};
use crate::store::read::tail::Tail;
use crate::store::write::metrics_csv;
use lumbre_light::film::Image;
use lumbre_light::film::layer::{Layer, LayerFilm, LayerImage, PathSubset};
use lumbre_light::film::time::{CUBE_FILE, TimeAxis};
use lumbre_metrics::MetricSpec;

/// Time-resolved film of a finished run, as a file.
#[derive(Clone, Debug)]
pub struct TimesFile {
    /// Cell or reference of the run.
    pub cell: CellRef,
    /// NumPy array of mean radiance, \[row\]\[column\]\[bin\]\[rgb\].
    pub file: PathBuf,
    /// Time bins of the array.
    pub axis: TimeAxis,
}

/// A run that is shown.
#[derive(Debug)]
pub(super) struct FollowedRun {
    pub(super) cell: CellRef,
    /// Name of the worker that renders it; empty if one process renders the night alone.
    pub(super) worker: String,
    pub(super) running: bool,
    folder: PathBuf,
    metrics: Tail,
    /// Number of metrics in the file, and the position of every metric of the outline in its rows;
    /// `None` until the header was read.
    columns: Option<(usize, Vec<Option<usize>>)>,
    /// Samples per pixel of the newest image that was read; `u64::MAX` for the final one.
    image_samples: u64,
    /// Strategy images that are still to be read.
    strategies: VecDeque<PathBuf>,
    /// Time bins of its film, until the time-resolved film was reported.
    axis: Option<TimeAxis>,
}

impl FollowedRun {
    /// Begins to follow a run that has just started.
    pub(super) fn new(
        cell: CellRef,
        folder: PathBuf,
        worker: String,
        axis: Option<TimeAxis>,
    ) -> FollowedRun {
        let metrics = Tail::new(folder.join(metrics_csv::FILE));
        let strategies = VecDeque::new();
        FollowedRun {
            cell,
            worker,
            running: true,
            folder,
            metrics,
            columns: None,
            image_samples: 0,
            strategies,
            axis,
        }
    }

    /// Path of its measurements.
    pub(super) fn metrics_path(&self) -> &Path {
        self.metrics.path()
    }

    /// Returns new measurements and a newer image. After the end of the run, returns one strategy
    /// image per call, and the time-resolved film.
    pub(super) fn poll(
        &mut self,
        metrics: &[MetricSpec],
        decode: Decode,
    ) -> (Vec<Event>, Option<TimesFile>) {
        let cell = self.cell;
        let wave = |row: WaveRow| Event::Wave {
            cell,
            pow2: row.samples.is_power_of_two(),
            row,
            measure_s: 0.0,
            image: None,
            noise: None,
        };
        let mut events: Vec<Event> = self.new_rows(metrics).into_iter().map(wave).collect();
        let newest = newest_image(&self.folder, self.running);
        if let Some((samples, file)) = newest.filter(|(n, _)| *n > self.image_samples)
            && let Some(image) = read_image(&file, decode)
        {
            self.image_samples = samples;
            let image = Arc::new(image);
            events.push(Event::Picture { cell, image });
            if !self.running {
                self.strategies = strategy_files(&self.folder).into();
            }
        }
        if let Some(file) = self.strategies.pop_front()
            && let (Some(film), Some(image)) = (parse_strategy(&file), read_image(&file, decode))
        {
            let layer = Arc::new(LayerImage { film, image });
            events.push(Event::Layer { cell, layer });
        }
        let file = self.folder.join(FILMS).join(CUBE_FILE);
        let axis = self.axis.take_if(|_| !self.running && file.is_file());
        (events, axis.map(|axis| TimesFile { cell, file, axis }))
    }

    /// Reads the rows that were appended since the last call.
    fn new_rows(&mut self, metrics: &[MetricSpec]) -> Vec<WaveRow> {
        let update = self.metrics.poll();
        if update.restarted {
            self.columns = None;
        }
        let Some((count, columns)) = &self.columns else {
            // The header arrives with the first lines.
            let Ok((names, found)) = metrics_csv::parse(&update.text) else {
                return Vec::new();
            };
            let index = |column: &str| names.iter().position(|c| c == column);
            let columns: Vec<Option<usize>> = metrics.iter().map(|m| index(&m.column)).collect();
            let rows = found
                .into_iter()
                .map(|row| reordered(row, &columns))
                .collect();
            self.columns = Some((names.len(), columns));
            return rows;
        };
        let rows = metrics_csv::parse_more(&update.text, *count);
        rows.into_iter()
            .map(|row| reordered(row, columns))
            .collect()
    }
}

/// Reads an image file. Returns `None` if it is missing or damaged.
pub(super) fn read_image(file: &Path, decode: Decode) -> Option<Image> {
    decode(&Evidence::default().read(file).ok()?).ok()
}

/// Finds the newest image in a run's folder, with its samples per pixel. The final image of a run
/// that has ended counts as `u64::MAX` samples.
fn newest_image(folder: &Path, running: bool) -> Option<(u64, PathBuf)> {
    if !running {
        let last = ["final.exr", "ref.exr"]
            .map(|name| folder.join(name))
            .into_iter()
            .find(|file| file.is_file());
        if let Some(file) = last {
            return Some((u64::MAX, file));
        }
    }
    snapshots(folder)
        .into_iter()
        .max_by_key(|(samples, _)| *samples)
}

/// Lists the strategy images in a run's folder, ordered by name.
fn strategy_files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder.join(FILMS))
        .into_iter()
        .flatten()
        .flatten();
    let mut files: Vec<PathBuf> = entries
        .map(|e| e.path())
        .filter(|file| parse_strategy(file).is_some())
        .collect();
    files.sort();
    files
}

/// Parses the film of a strategy from a name such as `strategies-s2-t1-raw.exr`.
fn parse_strategy(file: &Path) -> Option<LayerFilm> {
    let name = file
        .file_name()?
        .to_str()?
        .strip_suffix(".exr")?
        .strip_prefix("strategies-s")?;
    let (s, rest) = name.split_once("-t")?;
    let (t, kind) = rest.split_once('-')?;
    Some(LayerFilm {
        layer: Layer::Strategies,
        subset: PathSubset::Strategy {
            s: s.parse().ok()?,
            t: t.parse().ok()?,
            weighted: kind == "weighted",
        },
        splats: true,
    })
}
