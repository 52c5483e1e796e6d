//! Following a night from outside, by its files alone: the journals, the measurements of the run at hand, its pictures,
//! and the heartbeats of workers.
//!
//! Nothing is locked and nothing is written, so a folder can be followed while it grows, after its end, from another
//! process, or on another machine to which it was copied. Whether a run is done is whether its last file is there, as
//! everywhere; the journal only says when, and with what numbers.

mod run;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant, SystemTime};

use serde_json::Value as Json;

use super::archive::{self, Decode, read_json};
use super::crew::crew;
use super::journals::{self, Journals};
use super::seen::{Seen, Sight};
use super::{StoreError, layout, list, outline, seconds_of};
use crate::experiment::event::Level;
use crate::experiment::forecast::Forecast;
use crate::experiment::{CellRef, Outcome, Outline, WaveRow};
use crate::film::Image;
use run::Run;

/// How often workers are looked at.
const ROLL_CALL: Duration = Duration::from_secs(2);

/// Follows the night of one folder.
#[derive(Debug)]
pub struct Follower {
    out: PathBuf,
    decode: Decode,
    outline: Arc<Outline>,
    /// Cells and references by the ids of their runs.
    ids: BTreeMap<String, Vec<CellRef>>,
    /// The folder of every cell's run, and the reference that it is measured against.
    cells: Vec<(PathBuf, Option<usize>)>,
    /// The folder of every reference, or the file that it is.
    references: Vec<PathBuf>,
    journals: Journals,
    /// Runs that started and have not ended, by their ids, with the line that said so.
    underway: BTreeMap<String, Json>,
    /// The ids of runs of which a line said that they are done.
    done: BTreeSet<String>,
    /// Whether a night has begun and not ended.
    goes_on: bool,
    /// When workers were looked at.
    called: Option<Instant>,
    /// When the first look came, everything that is there has to be told.
    fresh: bool,
    /// The runs at hand, oldest first: several where they take turns, and the last one that ended.
    runs: Vec<Run>,
    /// The reference that was read last.
    recent: Option<(usize, Arc<Image>)>,
    folder: PathBuf,
}

impl Follower {
    /// Follows the night in an experiment's folder. References are looked for beside it, where a night keeps them.
    ///
    /// # Errors
    /// When the folder has no plan that can be read.
    pub fn open(folder: &Path, decode: Decode) -> Result<Follower, StoreError> {
        let file = folder.join("plan.json");
        let plan = read_json(&file).ok_or_else(|| StoreError::Io {
            action: "read",
            path: file.clone(),
            reason: "there is no plan, or it is not whole (expected an experiment's folder; `lumbre ls` lists them)"
                .into(),
            full: false,
        })?;
        let folder = fs::canonicalize(folder).unwrap_or_else(|_| folder.to_owned());
        let out = folder.parent().map(Path::to_owned).unwrap_or_default();
        let outline = outline::outline(&plan);
        let mut ids: BTreeMap<String, Vec<CellRef>> = BTreeMap::new();
        let lines = |key: &str| plan[key].as_array().map_or(&[][..], Vec::as_slice);
        let mut known = |json: &Json, cell| {
            let id = json["run"].as_str().unwrap_or_default().to_owned();
            ids.entry(id).or_default().push(cell);
        };
        let mut cells = Vec::new();
        for (i, cell) in lines("cells").iter().enumerate() {
            known(cell, CellRef::Cell(i));
            let place = folder.join("runs").join(cell["folder"].as_str().unwrap_or_default());
            let reference = cell["reference"].as_u64().and_then(|n| usize::try_from(n).ok());
            cells.push((place, reference));
        }
        let mut references = Vec::new();
        for (i, reference) in lines("references").iter().enumerate() {
            known(reference, CellRef::Reference(i));
            let id = reference["run"].as_str().unwrap_or_default().to_owned();
            let shelf = layout::reference_folder(&out, &crate::experiment::RunId(id));
            references.push(match reference["source"].as_str().map(PathBuf::from) {
                Some(file) if file.is_file() => file,
                // On another machine there is the copy.
                Some(file) => shelf.join(layout::imported(&file)),
                None => shelf,
            });
        }
        let journals = Journals::new(&folder);
        let outline = Arc::new(outline);
        Ok(Follower {
            out,
            decode,
            outline,
            ids,
            cells,
            references,
            journals,
            underway: BTreeMap::new(),
            done: BTreeSet::new(),
            goes_on: false,
            called: None,
            fresh: true,
            runs: Vec::new(),
            recent: None,
            folder,
        })
    }

    /// The plan.
    pub fn outline(&self) -> &Arc<Outline> {
        &self.outline
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// When a file of the night was last written to, as far as can be seen.
    pub fn news_at(&self) -> Option<SystemTime> {
        let written = |path: &Path| fs::metadata(path).and_then(|m| m.modified()).ok();
        let runs = self.runs.iter().filter_map(|run| written(run.measurements()));
        self.journals.written().max(runs.max())
    }

    /// What happened since the last look, oldest first. The first look tells everything that is there.
    pub fn look(&mut self) -> Vec<Sight> {
        let mut sights = Vec::new();
        let news = self.journals.look();
        let fresh = std::mem::take(&mut self.fresh) || news.anew;
        let lines = news.lines;
        // Only runs that have not ended, and the newest, are worth their rows and pictures: those of a whole night would be
        // read to be thrown away.
        let live = live(&lines);
        if fresh {
            self.what_is_there(&lines, &mut sights);
        }
        for (i, line) in lines.iter().enumerate() {
            self.journal_line(line, live.contains(&i), fresh, &mut sights);
        }
        self.roll_call(&mut sights);
        if self.journals.has_workers() && self.runs.iter().all(|run| !run.running) {
            let first = self.underway.values().next().map(|line| journals::worker(line).to_owned());
            first.iter().for_each(|worker| self.show_all(worker, &mut sights));
        }
        self.runs_at_hand(&mut sights);
        sights
    }

    /// Looks at the workers from time to time. What a lost one rendered is open again.
    fn roll_call(&mut self, sights: &mut Vec<Sight>) {
        if !self.journals.has_workers() || self.called.is_some_and(|at| at.elapsed() < ROLL_CALL) {
            return;
        }
        self.called = Some(Instant::now());
        let workers = crew(&self.folder);
        let at_s = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        let lost: BTreeSet<&str> = workers.iter().filter(|w| w.is_lost()).map(|w| w.name.as_str()).collect();
        let mut left = Vec::new();
        self.underway.retain(|key, line| {
            let gone = lost.contains(journals::worker(line));
            if gone {
                left.push((key.clone(), line["run"].as_str().unwrap_or_default().to_owned()));
            }
            !gone
        });
        for (key, run) in left {
            self.rest(&run);
            // A part is known by another key than a run: what it is of has not ended.
            for cell in self.ids.get(&key).into_iter().flatten().filter(|cell| !self.is_done(**cell)) {
                let ended = Seen::Ended { cell: *cell, outcome: Outcome::Interrupted, last: None };
                sights.push(Sight { at_s, seen: ended });
            }
        }
        sights.push(Sight { at_s, seen: Seen::Crew(workers) });
    }

    /// Shows what a worker renders: where it is more than one run, they take turns.
    fn show_all(&mut self, worker: &str, sights: &mut Vec<Sight>) {
        let at_hand = |line: &Json| {
            let which = line["run"].as_str().and_then(|id| self.ids.get(id)).and_then(|cells| cells.first());
            self.runs.iter().any(|run| run.running && Some(&run.cell) == which)
        };
        let of_it = |line: &&Json| journals::worker(line) == worker && !at_hand(line);
        let lines: Vec<Json> = self.underway.values().filter(of_it).cloned().collect();
        lines.iter().for_each(|line| self.show(line, sights));
    }

    /// What is shown of a run renders no more.
    fn rest(&mut self, id: &str) {
        let which = self.ids.get(id).map_or(&[][..], Vec::as_slice);
        self.runs.iter_mut().filter(|run| which.contains(&run.cell)).for_each(|run| run.running = false);
    }

    /// Shows a run that started, and those that still render.
    fn show(&mut self, line: &Json, sights: &mut Vec<Sight>) {
        let at_s = line["date"].as_str().and_then(seconds_of).unwrap_or(0) as f64;
        let id = line["run"].as_str().unwrap_or_default();
        if let Some(cell) = self.ids.get(id).and_then(|cells| cells.first()).copied() {
            let (seen, run) = self.start(cell, line);
            self.runs.retain(|other| other.running && other.cell != cell);
            self.runs.push(run);
            sights.push(Sight { at_s, seen });
        }
    }

    fn journal_line(&mut self, line: &Json, live: bool, fresh: bool, sights: &mut Vec<Sight>) {
        let at_s = line["date"].as_str().and_then(seconds_of).unwrap_or(0) as f64;
        let id = line["run"].as_str().unwrap_or_default();
        let which = self.ids.get(id).cloned().unwrap_or_default();
        if self.is_late(line, &which) {
            return;
        }
        let mut see = |seen| sights.push(Sight { at_s, seen });
        match line["event"].as_str().unwrap_or_default() {
            "night_started" => {
                self.goes_on = true;
                self.underway.clear();
                see(Seen::Began);
            }
            "worker_started" if !self.goes_on => {
                self.goes_on = true;
                see(Seen::Began);
            }
            "night_finished" | "night_closed" => {
                self.goes_on = false;
                see(Seen::Over);
            }
            "forecast" => see(Seen::Foretold(foretold(line))),
            "agreement" => {
                let which = line["reference"].as_str().and_then(|id| self.ids.get(id)).into_iter().flatten();
                let agrees = line["agrees"].as_bool().unwrap_or(true);
                for cell in which {
                    if let CellRef::Reference(reference) = *cell {
                        sights.push(Sight { at_s, seen: Seen::Compared { reference, agrees } });
                    }
                }
            }
            "cell_started" => {
                self.underway.insert(id.to_owned(), line.clone());
                // Where many render at once, the worker that is shown stays until its runs end. What it starts beside
                // one of them takes turns with it.
                let other = |run: &Run| run.running && run.worker != journals::worker(line);
                let busy = self.journals.has_workers() && self.runs.iter().any(other);
                if live && !busy {
                    self.show(line, sights);
                    if self.journals.has_workers() {
                        self.show_all(journals::worker(line), sights);
                    }
                } else if self.journals.has_workers() {
                    which.first().into_iter().for_each(|cell| see(Seen::Underway { cell: *cell }));
                }
            }
            "part_started" => {
                self.underway.insert(part_key(id, line["words"].as_str().unwrap_or_default()), line.clone());
                part_of(line, &which, None).into_iter().for_each(&mut see);
                which.first().into_iter().for_each(|cell| see(Seen::Underway { cell: *cell }));
            }
            "part_finished" => {
                let there = line["part"].as_u64().filter(|_| line["outcome"] == "done");
                part_of(line, &which, there).into_iter().for_each(&mut see);
                self.underway.remove(&part_key(id, line["words"].as_str().unwrap_or_default()));
                self.rest(id);
                let prefix = part_key(id, "");
                if self.underway.keys().any(|key| key.starts_with(&prefix)) {
                    which.first().into_iter().for_each(|cell| see(Seen::Underway { cell: *cell }));
                }
            }
            "cell_finished" => {
                self.underway.remove(id);
                if line["outcome"] == "done" {
                    self.done.insert(id.to_owned());
                    let prefix = part_key(id, "");
                    self.underway.retain(|key, _| !key.starts_with(&prefix));
                }
                if let Some(run) = self.runs.iter_mut().find(|run| which.contains(&run.cell)) {
                    run.running = false;
                    // What was measured last is told before the end is.
                    self.runs_at_hand(sights);
                }
                for cell in which {
                    let outcome = self.outcome(cell, line);
                    // In the first look the folders have told who is done; the journal knows the numbers.
                    let known = matches!(outcome, Outcome::Done(_)) == self.is_done(cell);
                    if !fresh || known {
                        sights.push(Sight { at_s, seen: Seen::Ended { cell, outcome, last: self.last_row(line) } });
                    }
                }
            }
            "message" => see(Seen::Said {
                level: match line["level"].as_str() {
                    Some("ERROR") => Level::Error,
                    Some("WARN") => Level::Warn,
                    _ => Level::Info,
                },
                cell: which.first().copied(),
                text: line["text"].as_str().unwrap_or_default().to_owned(),
            }),
            _ => {}
        }
    }

    /// Whether a line tells of work on what is done. Lines of several workers are in order to the second, so what one
    /// began can be told after another one ended it.
    fn is_late(&self, line: &Json, which: &[CellRef]) -> bool {
        matches!(line["event"].as_str(), Some("cell_started" | "part_started" | "part_finished"))
            && line["run"].as_str().is_some_and(|id| self.done.contains(id))
            && which.iter().all(|cell| self.is_done(*cell))
    }

    /// Runs that are done without the journal saying so: it was lost, or they lie in a folder beside this one.
    fn what_is_there(&self, lines: &[Json], sights: &mut Vec<Sight>) {
        let told: BTreeSet<&str> = lines
            .iter()
            .filter(|line| line["event"] == "cell_finished" && line["outcome"] == "done")
            .filter_map(|line| line["run"].as_str())
            .collect();
        let mut elsewhere = None;
        for (id, which) in self.ids.iter().filter(|(id, _)| !told.contains(id.as_str())) {
            for cell in which {
                let found = match cell {
                    _ if self.is_done(*cell) => Some(self.place(*cell)),
                    CellRef::Cell(_) => elsewhere
                        .get_or_insert_with(|| list::finished_beside(&self.out, &self.outline.name, &self.folder))
                        .get(id)
                        .cloned(),
                    CellRef::Reference(_) => None,
                };
                let Some(folder) = found else { continue };
                let last = read_json(&folder.join("done.json")).and_then(|done| self.last_row(&done));
                sights.push(Sight {
                    at_s: 0.0,
                    seen: Seen::Ended { cell: *cell, outcome: Outcome::Cached(folder), last },
                });
            }
        }
    }

    fn place(&self, cell: CellRef) -> PathBuf {
        match cell {
            CellRef::Cell(i) => self.cells.get(i).map(|(place, _)| place.clone()).unwrap_or_default(),
            CellRef::Reference(i) => self.references.get(i).cloned().unwrap_or_default(),
        }
    }

    fn is_done(&self, cell: CellRef) -> bool {
        let place = self.place(cell);
        match cell {
            CellRef::Cell(_) => place.join("done.json").is_file(),
            CellRef::Reference(_) => place.join("ref.json").is_file() || place.is_file(),
        }
    }

    fn outcome(&self, cell: CellRef, line: &Json) -> Outcome {
        let reason = line["reason"].as_str().unwrap_or_default().to_owned();
        match line["outcome"].as_str().unwrap_or_default() {
            "done" => Outcome::Done(reason),
            "failed" => Outcome::Failed(reason),
            "cached" => Outcome::Cached(self.place(cell)),
            _ => Outcome::Interrupted,
        }
    }

    /// The last row as the journal or a `done.json` tells it; `None` before the first wave.
    fn last_row(&self, json: &Json) -> Option<WaveRow> {
        let number = |key: &str| json[key].as_f64().unwrap_or(0.0);
        let count = |key: &str| json[key].as_u64().unwrap_or(0);
        let metric = |json: &Json| json.as_f64().or_else(|| json.as_str()?.parse().ok());
        let metrics: Vec<Option<f64>> =
            self.outline.metrics.iter().map(|m| metric(&json["metrics"][m.column.as_str()])).collect();
        let measured = metrics.iter().any(Option::is_some);
        (count("samples") > 0).then(|| WaveRow {
            wave: count("waves"),
            samples: count("samples"),
            render_s: number("render_s"),
            wall_s: number("wall_s"),
            measure_s: number("measure_s"),
            paths: count("paths"),
            rays: count("rays"),
            invalid: count("invalid"),
            first_invalid: archive::first_invalid(json),
            metrics: if measured { metrics.iter().map(|m| m.unwrap_or(f64::NAN)).collect() } else { Vec::new() },
        })
    }

    fn start(&mut self, cell: CellRef, line: &Json) -> (Seen, Run) {
        let folder = self.place(cell);
        let config = read_json(&folder.join("config.json")).and_then(|json| outline::config(&json["render"]));
        let open = archive::open_stats(line);
        let reference = match cell {
            CellRef::Cell(i) => self.cells.get(i).and_then(|(_, reference)| *reference),
            CellRef::Reference(_) => None,
        };
        let reference = reference.and_then(|i| self.reference(i));
        let axis = config.as_ref().and_then(|config| config.timing.as_ref()).map(|timing| timing.axis);
        let run = Run::new(cell, folder, journals::worker(line).to_owned(), axis);
        (Seen::Started { cell, config: config.map(Box::new), open, reference }, run)
    }

    fn reference(&mut self, i: usize) -> Option<Arc<Image>> {
        if let Some((recent, image)) = &self.recent
            && *recent == i
        {
            return Some(Arc::clone(image));
        }
        let place = self.references.get(i)?;
        let file = if place.is_file() { place.clone() } else { place.join("ref.exr") };
        let image = Arc::new(run::image(&file, self.decode)?);
        self.recent = Some((i, Arc::clone(&image)));
        Some(image)
    }

    /// What is new of the runs at hand.
    fn runs_at_hand(&mut self, sights: &mut Vec<Sight>) {
        let at_s = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
        for run in &mut self.runs {
            run.look(&self.outline, self.decode, &mut |seen| sights.push(Sight { at_s, seen }));
        }
    }
}

/// A line about a part of a reference as it is seen.
fn part_of(line: &Json, which: &[CellRef], there: Option<u64>) -> Vec<Seen> {
    let Some(of) = line["of"].as_u64().and_then(|n| usize::try_from(n).ok()) else { return Vec::new() };
    let there = there.and_then(|n| usize::try_from(n).ok());
    let one = |cell: &CellRef| match cell {
        CellRef::Reference(reference) => Some(Seen::Part { reference: *reference, there, of }),
        CellRef::Cell(_) => None,
    };
    which.iter().filter_map(one).collect()
}

/// What a part of a reference is known by while it renders.
fn part_key(run: &str, words: &str) -> String {
    format!("{run} {words}")
}

/// A forecast as the journal tells it.
fn foretold(line: &Json) -> Forecast {
    let count = |key: &str| line[key].as_u64().and_then(|n| usize::try_from(n).ok()).unwrap_or(0);
    let truth = |key: &str| line[key].as_bool().unwrap_or(false);
    let seconds = line["left_s"].as_f64().unwrap_or(0.0);
    let (known, unknown) = (count("known"), count("unknown"));
    Forecast { seconds, at_most: truth("at_most"), rough: truth("rough"), known, unknown }
}

/// The lines at which runs started that have not ended since, nor with their night; and that of the newest run.
fn live(lines: &[Json]) -> BTreeSet<usize> {
    let mut ended: BTreeSet<&str> = BTreeSet::new();
    let mut live = BTreeSet::new();
    let mut current = true;
    for (i, line) in lines.iter().enumerate().rev() {
        let run = line["run"].as_str().unwrap_or_default();
        match line["event"].as_str().unwrap_or_default() {
            "cell_started" if live.is_empty() || (current && !ended.contains(run)) => {
                live.insert(i);
                ended.insert(run);
            }
            "cell_finished" => {
                ended.insert(run);
            }
            "night_started" | "night_finished" => current = false,
            _ => {}
        }
    }
    live
}
