//! `lumbre status`: how far a night is, read from files alone.

use std::fmt::Write as _;
use std::time::SystemTime;

use serde_json::{Value as Json, json};

use super::args::{Global, StatusArgs};
use super::cluster::Roll;
use super::exit::{Exit, Failure, data};
use super::load::shown;
use super::run::counted;
use super::text;
use super::watch::{follow, open, tell};
use crate::experiment::CellRef;
use crate::store::utc;
use crate::tui::entry::{Counts, Entry, State};
use crate::tui::eta::Eta;
use crate::tui::model::Model;
use crate::tui::words;

/// Seconds without news after which it is said that there are none.
const SILENCE_S: f64 = 60.0;
/// Most failures that are listed.
const MOST_FAILURES: usize = 10;

/// Says how far a night is.
pub fn main(args: &StatusArgs, global: &Global) -> Result<Exit, Failure> {
    let mut follower = follow(args.folder.as_deref(), global)?;
    let mut model = Model::default();
    open(&mut model, &follower);
    follower.look().into_iter().for_each(|sight| tell(&mut model, sight));
    let now_s = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).map_or(0.0, |d| d.as_secs_f64());
    let silence_s = follower.news_at().and_then(|at| at.elapsed().ok()).map(|d| d.as_secs_f64());
    let night = Night { model: &model, now_s, silence_s, folder: shown(follower.folder()) };
    let roll = Roll::call(follower.folder());
    if args.json {
        let mut json = night.json();
        if !roll.is_empty() {
            json["cluster"] = roll.json();
        }
        data(&format!("{json:#}\n"))?;
    } else {
        let crew = if roll.is_empty() { String::new() } else { roll.page() };
        data(&(night.page() + &crew))?;
    }
    Ok(Exit::Done)
}

/// A night and the moment at which it is looked at.
struct Night<'a> {
    model: &'a Model,
    now_s: f64,
    /// Seconds since a file of it was last written to.
    silence_s: Option<f64>,
    folder: String,
}

impl Night<'_> {
    /// `running`, `silent`, `over`, `not started`.
    fn state(&self) -> &'static str {
        match (self.model.started_s, self.model.finished_s) {
            (None, _) => "not started",
            (_, Some(_)) => "over",
            _ if self.silence_s.is_some_and(|s| s >= SILENCE_S) => "silent",
            _ => "running",
        }
    }

    fn eta(&self) -> Option<Eta> {
        (self.state() == "running").then(|| self.model.night_eta(self.now_s)).flatten()
    }

    fn name(&self, cell: CellRef) -> String {
        self.model.plan.as_ref().map_or_else(String::new, |plan| words::cell_name(plan, cell))
    }

    fn failures(&self) -> impl Iterator<Item = (CellRef, &str)> {
        let reference = self.model.references.iter().enumerate().map(|(i, e)| (CellRef::Reference(i), e));
        let cells = self.model.cells.iter().enumerate().map(|(i, e)| (CellRef::Cell(i), e));
        reference.chain(cells).filter_map(|(cell, entry): (CellRef, &Entry)| match &entry.state {
            State::Failed(reason) => Some((cell, &**reason)),
            _ => None,
        })
    }

    fn page(&self) -> String {
        let model = self.model;
        let counts = Counts::of(&model.cells);
        let mut out = format!("{}  {}\n", self.folder, self.state());
        let parts = [
            (counts.done + counts.cached, "done"),
            (counts.failed, "failed"),
            (counts.interrupted, "interrupted"),
            (counts.running, "running"),
            (counts.waiting, "to go"),
        ];
        let parts: Vec<String> = parts.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect();
        let mut lines = vec![vec!["cells".to_owned(), format!("{}: {}", counts.total(), parts.join(", "))]];
        let references = Counts::of(&model.references);
        if references.total() > 0 {
            let mut settled = format!("{} of {}", references.settled(), references.total());
            if let Some((done, of)) = self.parts() {
                settled += &format!("; of what is missing, {done} of {of} parts are there");
            }
            lines.push(vec!["references".to_owned(), settled]);
        }
        if self.state() != "not started" {
            lines.push(vec!["elapsed".to_owned(), text::duration(model.night_s(self.now_s))]);
        }
        if let Some(eta) = self.eta() {
            let sign = if eta.at_most { "at most" } else { "about" };
            let end = SystemTime::UNIX_EPOCH + std::time::Duration::from_secs_f64((self.now_s + eta.seconds).max(0.0));
            lines.push(vec!["left".to_owned(), format!("{sign} {}, until {}", text::duration(eta.seconds), utc(end))]);
        }
        if let Some(silence) = self.silence_s.filter(|_| self.state() == "silent") {
            let hint = "it was cut off, or its waves are long";
            lines.push(vec!["news".to_owned(), format!("none for {} ({hint})", text::duration(silence))]);
        }
        if let Some(current) = model.current.as_ref().filter(|current| current.running) {
            lines.push(vec!["now".to_owned(), self.name(current.cell)]);
            if let Some(row) = current.curve.last() {
                let metrics = model.plan.iter().flat_map(|plan| plan.metrics.iter()).zip(&row.metrics);
                let metrics: Vec<String> =
                    metrics.map(|(m, v)| format!("  {} {}", m.column, words::number(*v))).collect();
                let facts = format!("{} spp  {}{}", row.samples, text::duration(row.render_s), metrics.concat());
                lines.push(vec![String::new(), facts]);
            }
        }
        out += &text::aligned(&lines);
        for (cell, reason) in self.failures().take(MOST_FAILURES) {
            // Writing to a String cannot fail.
            let _ = writeln!(out, "failed: {}: {reason}", self.name(cell));
        }
        let more = self.failures().count().saturating_sub(MOST_FAILURES);
        if more > 0 {
            let _ = writeln!(out, "and {} more (`lumbre ls --state failed`)", counted(more, "failure"));
        }
        out
    }

    /// How many parts there are of the references that are rendered in parts and not there yet, and of how many.
    fn parts(&self) -> Option<(usize, usize)> {
        let open = (0..self.model.references.len()).filter_map(|i| self.model.parts_of(CellRef::Reference(i)));
        open.reduce(|(done, of), more| (done + more.0, of + more.1))
    }

    fn json(&self) -> Json {
        let model = self.model;
        let counts = Counts::of(&model.cells);
        let current = model.current.as_ref().filter(|current| current.running).map(|current| {
            let row = current.curve.last();
            json!({
                "name": self.name(current.cell), "device": current.open.device,
                "samples": row.map(|r| r.samples), "render_s": row.map(|r| r.render_s),
            })
        });
        json!({
            "folder": self.folder,
            "state": self.state(),
            "cells": {
                "total": counts.total(), "done": counts.done + counts.cached, "failed": counts.failed,
                "interrupted": counts.interrupted, "running": counts.running, "waiting": counts.waiting,
            },
            "references": {
                "total": model.references.len(), "settled": Counts::of(&model.references).settled(),
                "parts": self.parts().map(|(done, of)| json!({ "done": done, "total": of })),
            },
            "elapsed_s": (self.state() != "not started").then(|| model.night_s(self.now_s)),
            "left_s": self.eta().map(|eta| eta.seconds),
            "silent_s": self.silence_s,
            "current": current,
            "failures": self.failures().map(|(cell, reason)| json!({ "name": self.name(cell), "reason": reason }))
                .collect::<Vec<_>>(),
        })
    }
}
