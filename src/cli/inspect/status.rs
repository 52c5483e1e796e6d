//! `lumbre status`: progress of a night, read only from its files.

use std::collections::BTreeSet;
use std::fmt::Write as _;
use std::time::SystemTime;

use super::follow::{apply, open_follower};
use crate::cli::args::{Global, StatusArgs};
use crate::cli::cluster::WorkerList;
use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{self, counted, display_path};
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::{CellRef, Outcome};
use lumbre_night::store::schema::status::{
    CellCounts, CurrentRun, FailureRecord, ReferenceCounts, ShardCounts, StatusReport,
};
use lumbre_night::store::{StoredFile, utc};
use lumbre_tui::tui::format as tui_format;
use lumbre_tui::tui::model::eta::Eta;
use lumbre_tui::tui::model::night::NightModel;

/// Time without changes of files after which a night is reported as silent, in seconds.
const SILENCE_S: f64 = 60.0;
/// Maximum number of failures that are listed.
const MAX_FAILURES: usize = 10;

/// Runs `lumbre status`: prints the progress of a night and its workers.
pub fn main(args: &StatusArgs, global: &Global) -> Result<Exit, Failure> {
    let mut follower = open_follower(args.folder.as_deref(), global)?;
    let mut model = NightModel::new(follower.night().clone());
    if let Some(changes) = follower.poll() {
        apply(&mut model, changes);
    }
    let now_s = SystemTime::now()
        .duration_since(SystemTime::UNIX_EPOCH)
        .map_or(0.0, |d| d.as_secs_f64());
    let silence_s = follower
        .last_modified()
        .and_then(|at| at.elapsed().ok())
        .map(|d| d.as_secs_f64());
    let night = NightStatus {
        model: &model,
        now_s,
        silence_s,
        folder: display_path(follower.folder()),
        problems: follower.problems(),
    };
    let workers = WorkerList::read(follower.folder());
    for problem in night.problems {
        print_status(&format!("left out: {problem}"));
    }
    if args.json {
        print_result(&night.report(&workers).text())?;
    } else {
        let workers_page = if workers.is_empty() {
            String::new()
        } else {
            workers.page()
        };
        print_result(&(night.page() + &workers_page))?;
    }
    Ok(Exit::unless_problems(!night.problems.is_empty()))
}

/// State of a night at one point in time.
struct NightStatus<'a> {
    model: &'a NightModel,
    /// Time of the status, in seconds since the Unix epoch.
    now_s: f64,
    /// Time since a file of the night was last written, in seconds.
    silence_s: Option<f64>,
    folder: String,
    /// Descriptions of runs that are left out, since they do not match their checksums.
    problems: &'a BTreeSet<String>,
}

impl NightStatus<'_> {
    /// Returns `running`, `silent`, `finished`, `ended` with work left, or `not started`.
    fn state(&self) -> &'static str {
        match (self.model.started_s, self.model.finished_s) {
            (None, _) => "not started",
            (_, Some(_)) => self.model.night.counts().end_word(),
            _ if self.silence_s.is_some_and(|s| s >= SILENCE_S) => "silent",
            _ => "running",
        }
    }

    fn eta(&self) -> Option<Eta> {
        (self.state() == "running")
            .then(|| self.model.night_eta(self.now_s))
            .flatten()
    }

    fn name(&self, cell: CellRef) -> String {
        tui_format::cell_name(&self.model.night, cell)
    }

    fn failures(&self) -> impl Iterator<Item = (CellRef, String)> {
        let night = &self.model.night;
        night.all().filter_map(|cell| match night.outcome(cell)? {
            Outcome::Failed(reason) => Some((cell, tui_format::clean(reason))),
            _ => None,
        })
    }

    /// Formats the status as text.
    fn page(&self) -> String {
        let mut lines = self.count_lines();
        lines.extend(self.time_lines());
        lines.extend(self.current_lines());
        let mut out = format!("{}  {}\n", self.folder, self.state());
        out += &format::aligned(&lines);
        for (cell, reason) in self.failures().take(MAX_FAILURES) {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "failed: {}: {reason}", self.name(cell));
        }
        let more = self.failures().count().saturating_sub(MAX_FAILURES);
        if more > 0 {
            let _ = writeln!(
                out,
                "and {} more (`lumbre ls --state failed`)",
                counted(more, "failure")
            );
        }
        out
    }

    /// Returns the lines with the numbers of cells and references by state.
    fn count_lines(&self) -> Vec<Vec<String>> {
        let model = self.model;
        let counts = StateCounts::of_runs(&model.night.runs);
        let parts = [
            (counts.done + counts.cached, "done"),
            (counts.failed, "failed"),
            (counts.interrupted, "interrupted"),
            (counts.running, "running"),
            (counts.waiting, "to go"),
        ];
        let parts: Vec<String> = parts
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, word)| format!("{n} {word}"))
            .collect();
        let mut lines = vec![vec![
            "cells".to_owned(),
            format!("{}: {}", counts.total(), parts.join(", ")),
        ]];
        let references = StateCounts::of_references(&model.night.references);
        if references.total() > 0 {
            let mut settled = format!("{} of {}", references.settled(), references.total());
            if let Some((done, of)) = self.shards() {
                settled += &format!("; {done} of {of} shards of the others are done");
            }
            lines.push(vec!["references".to_owned(), settled]);
        }
        lines
    }

    /// Returns the lines with the elapsed time, the estimated time left, and silence.
    fn time_lines(&self) -> Vec<Vec<String>> {
        let model = self.model;
        let mut lines = Vec::new();
        if self.state() != "not started" {
            lines.push(vec![
                "elapsed".to_owned(),
                tui_format::duration(model.night_s(self.now_s)),
            ]);
        }
        if let Some(eta) = self.eta() {
            let qualifier = if eta.at_most { "at most" } else { "about" };
            let end = SystemTime::UNIX_EPOCH
                + std::time::Duration::from_secs_f64((self.now_s + eta.seconds).max(0.0));
            lines.push(vec![
                "left".to_owned(),
                format!(
                    "{qualifier} {}, until {}",
                    tui_format::duration(eta.seconds),
                    utc(end)
                ),
            ]);
        }
        if let Some(silence) = self.silence_s.filter(|_| self.state() == "silent") {
            lines.push(vec![
                "activity".to_owned(),
                format!(
                    "none for {} (the night was interrupted, or its waves are long)",
                    tui_format::duration(silence)
                ),
            ]);
        }
        lines
    }

    /// Returns the lines with the current run and its last measurements.
    fn current_lines(&self) -> Vec<Vec<String>> {
        let model = self.model;
        let mut lines = Vec::new();
        if let Some(current) = model.current.as_ref().filter(|current| current.running) {
            lines.push(vec!["now".to_owned(), self.name(current.cell)]);
            if let Some(row) = current.curve.last() {
                let metrics = model.metrics().iter().zip(&row.metrics);
                let metrics: Vec<String> = metrics
                    .map(|(m, v)| format!("  {} {}", m.column, tui_format::number(*v)))
                    .collect();
                let facts = format!(
                    "{} spp  {}{}",
                    row.samples,
                    tui_format::duration(row.render_s),
                    metrics.concat()
                );
                lines.push(vec![String::new(), facts]);
            }
        }
        lines
    }

    /// Returns the numbers of finished shards and of all shards, summed over the unfinished
    /// references that are rendered in shards; `None` if there are no such references.
    fn shards(&self) -> Option<(usize, usize)> {
        let open = (0..self.model.night.references.len())
            .filter_map(|i| self.model.shard_progress(CellRef::Reference(i)));
        open.reduce(|(done, of), more| (done + more.0, of + more.1))
    }

    /// Returns the status as a record for programs.
    fn report(&self, workers: &WorkerList) -> StatusReport {
        let model = self.model;
        let counts = StateCounts::of_runs(&model.night.runs);
        let running = model.current.as_ref().filter(|current| current.running);
        let current = running.map(|current| {
            let row = current.curve.last();
            CurrentRun {
                name: self.name(current.cell),
                device: current.open.device_line(),
                devices: current.open.devices.clone(),
                samples: row.map(|r| r.samples),
                render_s: row.map(|r| r.render_s),
            }
        });
        let shards = self
            .shards()
            .map(|(done, total)| ShardCounts { done, total });
        let failures = self.failures().map(|(cell, reason)| FailureRecord {
            name: self.name(cell),
            reason,
        });
        StatusReport {
            folder: self.folder.clone(),
            state: self.state().to_owned(),
            cells: CellCounts {
                total: counts.total(),
                done: counts.done + counts.cached,
                failed: counts.failed,
                interrupted: counts.interrupted,
                running: counts.running,
                waiting: counts.waiting,
            },
            references: ReferenceCounts {
                total: model.night.references.len(),
                settled: StateCounts::of_references(&model.night.references).settled(),
                shards,
            },
            elapsed_s: (self.state() != "not started").then(|| model.night_s(self.now_s)),
            left_s: self.eta().map(|eta| eta.seconds),
            silent_s: self.silence_s,
            problems: self.problems.clone(),
            current,
            failures: failures.collect(),
            cluster: (!workers.is_empty()).then(|| workers.json()),
            ..StatusReport::default()
        }
    }
}
