//! Translation of journal lines into events of a follower.

use std::collections::BTreeSet;

use serde_json::Value as Json;

use super::Follower;
use super::event::{FollowEvent, TimedEvent};
use super::run::FollowedRun;
use crate::experiment::event::Level;
use crate::experiment::forecast::Forecast;
use crate::experiment::{CellRef, Outcome, WaveRow};
use crate::store::parse_utc;
use crate::store::read::{archive, merged_journal};

impl Follower {
    /// Updates the state by a line of the journal, and reports its events. `live` is whether the
    /// line starts a run that is worth showing.
    pub(super) fn apply_line(
        &mut self,
        line: &Json,
        live: bool,
        first_poll: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        let at_s = date_s(line);
        let id = line["run"].as_str().unwrap_or_default();
        let cells = self.ids.get(id).cloned().unwrap_or_default();
        if self.is_outdated(line, &cells) {
            return;
        }
        let mut report = |event| events.push(TimedEvent { at_s, event });
        match line["event"].as_str().unwrap_or_default() {
            "night_started" => {
                self.night_active = true;
                self.active.clear();
                report(FollowEvent::NightStarted);
            }
            "worker_started" if !self.night_active => {
                self.night_active = true;
                report(FollowEvent::NightStarted);
            }
            "night_finished" | "night_closed" => {
                self.night_active = false;
                report(FollowEvent::NightEnded);
            }
            "forecast" => report(FollowEvent::ForecastUpdated(forecast(line))),
            "agreement" => self.bias_checks(line).into_iter().for_each(report),
            "cell_started" => self.cell_started(line, &cells, live, events),
            "part_started" => {
                self.active.insert(key_of_line(line), line.clone());
                let changes = shard_changes(line, &cells, None);
                changes
                    .into_iter()
                    .chain(run_active(&cells))
                    .for_each(report);
            }
            "part_finished" => self
                .shard_finished(line, &cells)
                .into_iter()
                .for_each(report),
            "cell_finished" => self.cell_finished(line, &cells, first_poll, events),
            "message" => report(FollowEvent::Message {
                level: match line["level"].as_str() {
                    Some("ERROR") => Level::Error,
                    Some("WARN") => Level::Warn,
                    _ => Level::Info,
                },
                cell: cells.first().copied(),
                text: line["text"].as_str().unwrap_or_default().to_owned(),
            }),
            _ => {}
        }
    }

    /// Shows a run that started, unless another worker's runs are shown. Runs that the shown worker
    /// starts beside its others are interleaved with them.
    fn cell_started(
        &mut self,
        line: &Json,
        cells: &[CellRef],
        live: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        let id = line["run"].as_str().unwrap_or_default();
        self.active.insert(id.to_owned(), line.clone());
        let worker = merged_journal::worker(line);
        let other = |run: &FollowedRun| run.running && run.worker != worker;
        let busy = self.journals.has_workers() && self.runs.iter().any(other);
        if live && !busy {
            self.show(line, events);
            if self.journals.has_workers() {
                self.show_worker(worker, events);
            }
        } else if self.journals.has_workers() {
            let at_s = date_s(line);
            events.extend(run_active(cells).map(|event| TimedEvent { at_s, event }));
        }
    }

    /// Reports the end of a run, after its last measurements.
    fn cell_finished(
        &mut self,
        line: &Json,
        cells: &[CellRef],
        first_poll: bool,
        events: &mut Vec<TimedEvent>,
    ) {
        let at_s = date_s(line);
        let id = line["run"].as_str().unwrap_or_default();
        self.active.remove(id);
        if line["outcome"] == "done" {
            self.done.insert(id.to_owned());
            let prefix = shard_key(id, "");
            self.active.retain(|key, _| !key.starts_with(&prefix));
        }
        if let Some(run) = self.runs.iter_mut().find(|run| cells.contains(&run.cell)) {
            run.running = false;
            self.poll_runs(events);
        }
        for cell in cells {
            let outcome = self.outcome(*cell, line);
            // In the first poll, the folders decide which runs are done; the journal adds numbers.
            let confirmed = matches!(outcome, Outcome::Done(_)) == self.is_done(*cell);
            if !first_poll || confirmed {
                let event = FollowEvent::RunEnded {
                    cell: *cell,
                    outcome,
                    last: self.last_row(line),
                };
                events.push(TimedEvent { at_s, event });
            }
        }
    }

    /// Events of a line that reports the end of a shard. Its reference stays active while other
    /// shards of it are.
    fn shard_finished(&mut self, line: &Json, cells: &[CellRef]) -> Vec<FollowEvent> {
        let id = line["run"].as_str().unwrap_or_default();
        let finished = line["part"].as_u64().filter(|_| line["outcome"] == "done");
        let mut events = shard_changes(line, cells, finished);
        self.active.remove(&key_of_line(line));
        self.mark_stopped(id);
        let prefix = shard_key(id, "");
        if self.active.keys().any(|key| key.starts_with(&prefix)) {
            events.extend(run_active(cells));
        }
        events
    }

    /// Events of a line that reports a bias check.
    fn bias_checks(&self, line: &Json) -> Vec<FollowEvent> {
        let id = line["reference"].as_str().unwrap_or_default();
        let agrees = line["agrees"].as_bool().unwrap_or(true);
        let cells = self.ids.get(id).into_iter().flatten();
        let checked = |cell: &CellRef| match *cell {
            CellRef::Reference(reference) => Some(FollowEvent::BiasChecked { reference, agrees }),
            CellRef::Cell(_) => None,
        };
        cells.filter_map(checked).collect()
    }

    /// Whether a line reports work on a run that is done. Lines of several workers are ordered to
    /// the second only, so the start of a shard may follow the end of its reference.
    fn is_outdated(&self, line: &Json, cells: &[CellRef]) -> bool {
        matches!(
            line["event"].as_str(),
            Some("cell_started" | "part_started" | "part_finished")
        ) && line["run"]
            .as_str()
            .is_some_and(|id| self.done.contains(id))
            && cells.iter().all(|cell| self.is_done(*cell))
    }

    fn outcome(&self, cell: CellRef, line: &Json) -> Outcome {
        let reason = line["reason"].as_str().unwrap_or_default().to_owned();
        match line["outcome"].as_str().unwrap_or_default() {
            "done" => Outcome::Done(reason),
            "failed" => Outcome::Failed(reason),
            "cached" => Outcome::Cached(self.path_of(cell)),
            _ => Outcome::Interrupted,
        }
    }

    /// Last measurement of a run, from a journal line or a `done.json`. Returns `None` if no wave
    /// was measured.
    pub(super) fn last_row(&self, json: &Json) -> Option<WaveRow> {
        let number = |key: &str| json[key].as_f64().unwrap_or(0.0);
        let count = |key: &str| json[key].as_u64().unwrap_or(0);
        let metric = |json: &Json| json.as_f64().or_else(|| json.as_str()?.parse().ok());
        let metrics: Vec<Option<f64>> = self
            .outline
            .metrics
            .iter()
            .map(|m| metric(&json["metrics"][m.column.as_str()]))
            .collect();
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
            metrics: if measured {
                metrics.iter().map(|m| m.unwrap_or(f64::NAN)).collect()
            } else {
                Vec::new()
            },
        })
    }
}

/// Date of a journal line in seconds since 1970; 0 if it has none.
pub(super) fn date_s(line: &Json) -> f64 {
    line["date"].as_str().and_then(parse_utc).unwrap_or(0) as f64
}

/// Indices of the lines that start runs of the current night which have not ended, and of the line
/// that starts the newest run.
pub(super) fn live_lines(lines: &[Json]) -> BTreeSet<usize> {
    let mut ended: BTreeSet<&str> = BTreeSet::new();
    let mut live = BTreeSet::new();
    let mut current_night = true;
    for (i, line) in lines.iter().enumerate().rev() {
        let run = line["run"].as_str().unwrap_or_default();
        match line["event"].as_str().unwrap_or_default() {
            "cell_started" if live.is_empty() || (current_night && !ended.contains(run)) => {
                live.insert(i);
                ended.insert(run);
            }
            "cell_finished" => {
                ended.insert(run);
            }
            "night_started" | "night_finished" => current_night = false,
            _ => {}
        }
    }
    live
}

/// Event that the first of these cells renders on a worker that is not shown.
fn run_active(cells: &[CellRef]) -> Option<FollowEvent> {
    cells
        .first()
        .map(|cell| FollowEvent::RunActive { cell: *cell })
}

/// Events of a line about a shard. `finished` is the number of the shard if it was finished.
fn shard_changes(line: &Json, cells: &[CellRef], finished: Option<u64>) -> Vec<FollowEvent> {
    let Some(total) = line["of"].as_u64().and_then(|n| usize::try_from(n).ok()) else {
        return Vec::new();
    };
    let finished = finished.and_then(|n| usize::try_from(n).ok());
    let change = |cell: &CellRef| match cell {
        CellRef::Reference(reference) => Some(FollowEvent::ShardChanged {
            reference: *reference,
            finished,
            total,
        }),
        CellRef::Cell(_) => None,
    };
    cells.iter().filter_map(change).collect()
}

/// Key of a shard among the active runs.
fn shard_key(run: &str, label: &str) -> String {
    format!("{run} {label}")
}

/// Key of the shard that a journal line is about.
fn key_of_line(line: &Json) -> String {
    shard_key(
        line["run"].as_str().unwrap_or_default(),
        line["words"].as_str().unwrap_or_default(),
    )
}

/// Reads a forecast from a journal line.
fn forecast(line: &Json) -> Forecast {
    let count = |key: &str| {
        line[key]
            .as_u64()
            .and_then(|n| usize::try_from(n).ok())
            .unwrap_or(0)
    };
    let flag = |key: &str| line[key].as_bool().unwrap_or(false);
    let seconds = line["left_s"].as_f64().unwrap_or(0.0);
    let (known, unknown) = (count("known"), count("unknown"));
    Forecast {
        seconds,
        at_most: flag("at_most"),
        rough: flag("rough"),
        known,
        unknown,
    }
}
