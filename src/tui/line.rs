//! Plain progress lines, for pipes, files and terminals that can do no more.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::Instant;

use super::entry::{Counts, State};
use super::model::Model;
use super::words;
use crate::experiment::event::Level;
use crate::experiment::forecast::Forecast;
use crate::experiment::{CellRef, Event, Outcome, Plan, Sink, SinkError, WaveRow};
use crate::transport::integrator;

/// Longest wall time of a running cell without a line, in seconds.
const SILENCE_S: f64 = 10.0;
/// Wall time between two summaries of the night, in seconds.
const SUMMARY_S: f64 = 60.0;
/// Shortest wall time between two lines about powers of two, in seconds.
const MILESTONE_S: f64 = 2.0;

/// How much is written, and how.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LineOptions {
    /// Only warnings, errors, failed cells and the end.
    pub quiet: bool,
    /// Whether lines carry ANSI colours.
    pub color: bool,
}

/// A sink that writes a line for whatever matters. It never fails: a reader that has gone away costs no result.
pub struct LineSink {
    writer: Option<Box<dyn Write + Send>>,
    options: LineOptions,
    model: Model,
    /// Wall time of every running cell at its last line.
    spoken: BTreeMap<CellRef, f64>,
    /// Seconds on a monotonic clock.
    clock: Clock,
    /// When the night was summed up last.
    summed_s: f64,
    /// Whether it was said how long the night will take.
    foretold: bool,
}

/// Seconds on a monotonic clock, from any beginning.
pub type Clock = Box<dyn Fn() -> f64 + Send>;

/// SGR colours of the lines.
#[derive(Clone, Copy)]
enum Ink {
    Plain,
    Dim,
    Good,
    Warn,
    Bad,
}

impl LineSink {
    /// A sink that writes to `writer` and flushes after every line.
    pub fn new(writer: Box<dyn Write + Send>, options: LineOptions) -> LineSink {
        let start = Instant::now();
        LineSink::with_clock(writer, options, Box::new(move || start.elapsed().as_secs_f64()))
    }

    /// The same on a clock of the caller's.
    pub fn with_clock(writer: Box<dyn Write + Send>, options: LineOptions, clock: Clock) -> LineSink {
        let summed_s = clock();
        LineSink {
            writer: Some(writer),
            options,
            model: Model::default(),
            spoken: BTreeMap::new(),
            clock,
            summed_s,
            foretold: false,
        }
    }

    fn say(&mut self, ink: Ink, line: &str) {
        let Some(writer) = &mut self.writer else { return };
        let code = match ink {
            _ if !self.options.color => "",
            Ink::Plain => "",
            Ink::Dim => "\x1b[2m",
            Ink::Good => "\x1b[32m",
            Ink::Warn => "\x1b[33m",
            Ink::Bad => "\x1b[1;31m",
        };
        let reset = if code.is_empty() { "" } else { "\x1b[0m" };
        if writeln!(writer, "{code}{line}{reset}").and_then(|()| writer.flush()).is_err() {
            // Nobody reads any more: nothing is tried again.
            self.writer = None;
        }
    }

    fn talk(&mut self, ink: Ink, line: &str) {
        if !self.options.quiet {
            self.say(ink, line);
        }
    }

    fn night(&mut self, plan: &Plan) {
        let digits: String = plan.hash.chars().take(4).collect();
        let mut parts = vec![plural(plan.cells.len(), "cell")];
        if !plan.references.is_empty() {
            parts.push(plural(plan.references.len(), "reference"));
        }
        if !plan.skipped.is_empty() {
            parts.push(format!("{} left out", plural(plan.skipped.len(), "point")));
        }
        self.talk(Ink::Plain, &words::clean(&format!("night {}-{digits}: {}", plan.name, parts.join(", "))));
    }

    /// The measured facts of a row: `spp 256  3.21 s  4.12 Mpaths/s  rmse 0.0123`.
    fn facts(&self, row: &WaveRow) -> String {
        let mut facts = format!(
            "spp {}  {}  {} Mpaths/s",
            words::count(row.samples),
            words::duration(row.render_s),
            words::number(row.mpaths_per_s())
        );
        let metrics = self.model.plan.as_ref().map_or(&[][..], |plan| &plan.metrics[..]);
        for (spec, value) in metrics.iter().zip(&row.metrics) {
            facts.push_str(&format!("  {} {}", spec.column, words::measured(spec, *value)));
        }
        if let Some([x, y, sample]) = row.first_invalid.filter(|_| row.invalid > 0) {
            let n = words::count(row.invalid);
            facts.push_str(&format!("  {n} invalid (first: pixel {x}, {y}, sample {sample})"));
        }
        facts
    }

    /// Where in the plan a cell stands, and what it is: `[3/4] depth=5 aa=0.5`.
    fn name(&self, cell: CellRef) -> String {
        let Some(plan) = &self.model.plan else { return String::new() };
        let place = match cell {
            CellRef::Cell(i) => format!("[{}/{}]", i + 1, plan.cells.len()),
            CellRef::Reference(i) => format!("[ref {}/{}]", i + 1, plan.references.len()),
        };
        format!("{place} {}", words::cell_name(plan, cell))
    }

    fn started(&mut self, cell: CellRef, device: &str) {
        let config = self.model.plan.as_ref().and_then(|plan| plan.config(cell).cloned());
        let technique = config.map_or_else(String::new, |config| {
            let long = integrator::integrator(&config.integrator).map_or("", |row| row.long_name);
            format!("{} ({long}) on ", config.integrator)
        });
        let rule = self.model.stop_rule(cell).map_or_else(String::new, |r| format!("; until {}", r.describe()));
        let line = format!("{}  started: {technique}{device}{rule}", self.name(cell));
        self.talk(Ink::Dim, &words::clean(&line));
    }

    fn finished(&mut self, cell: CellRef, outcome: &Outcome, row: Option<&WaveRow>) {
        let facts = row.map_or_else(String::new, |row| format!("{}  ", self.facts(row)));
        let (ink, how) = match outcome {
            Outcome::Done(reason) => (Ink::Good, format!("done: {reason}")),
            Outcome::Cached(folder) => (Ink::Dim, format!("cached: {}", folder.display())),
            Outcome::Failed(reason) => (Ink::Bad, format!("failed: {reason}")),
            Outcome::Interrupted => (Ink::Warn, "interrupted".to_owned()),
        };
        let line = words::clean(&format!("{}  {facts}{how}", self.name(cell)));
        match outcome {
            Outcome::Failed(_) => self.say(ink, &line),
            _ => self.talk(ink, &line),
        }
        self.rest(outcome);
    }

    /// After a cell that took time: how much is left of the night.
    fn rest(&mut self, outcome: &Outcome) {
        let running = self.model.cells.iter().chain(&self.model.references).any(|e| e.state == State::Running);
        let waiting = Counts::of(&self.model.cells).waiting;
        if !matches!(outcome, Outcome::Done(_)) || running || waiting == 0 {
            return;
        }
        if let Some(eta) = self.model.night_eta((self.clock)()) {
            let at_most = if eta.at_most { "at most " } else { "about " };
            let line = format!("{} to go, {at_most}{}", plural(waiting, "cell"), words::duration(eta.seconds));
            self.talk(Ink::Dim, &line);
        }
    }

    fn wave(&mut self, cell: CellRef, row: &WaveRow, pow2: bool) {
        let limit = self.model.stop_rule(cell).and_then(|rule| rule.sample_limit());
        if limit.is_some_and(|limit| row.samples >= limit) {
            // The line that the cell is done follows at once, with the same numbers.
            return;
        }
        let since = row.wall_s - self.spoken.get(&cell).copied().unwrap_or(0.0);
        if since >= SILENCE_S || (pow2 && since >= MILESTONE_S) {
            self.spoken.insert(cell, row.wall_s);
            let line = format!("{}  {}", self.name(cell), self.facts(row));
            self.talk(Ink::Plain, &line);
        }
    }

    /// Before the first run, how long the night will take.
    fn foretell(&mut self, left: &Forecast) {
        if std::mem::replace(&mut self.foretold, true) || left.known == 0 {
            return;
        }
        let open = left.unknown;
        let unknown = if open > 0 { format!(", and {} of unknown length", plural(open, "run")) } else { String::new() };
        let length = words::duration(left.seconds);
        let line = format!("forecast: {} {length} for {}{unknown}", left.sign(), plural(left.known, "run"));
        self.talk(Ink::Dim, &line);
    }

    /// Once a minute, the whole night on one line.
    fn sum_up(&mut self) {
        let now_s = (self.clock)();
        if now_s - self.summed_s < SUMMARY_S || self.model.finished_s.is_some() {
            return;
        }
        self.summed_s = now_s;
        let Some(plan) = &self.model.plan else { return };
        let counts = Counts::of(&self.model.cells);
        let digits: String = plan.hash.chars().take(4).collect();
        let mut parts = vec![format!("{} of {}", counts.settled(), plural(counts.total(), "cell"))];
        let references = Counts::of(&self.model.references);
        if references.settled() < references.total() {
            parts.push(format!("{} of {}", references.settled(), plural(references.total(), "reference")));
        }
        if counts.failed + references.failed > 0 {
            parts.push(format!("{} failed", counts.failed + references.failed));
        }
        parts.push(format!("{} elapsed", words::duration(self.model.night_s(now_s))));
        if let Some(eta) = self.model.night_eta(now_s) {
            let sign = if eta.at_most { "at most" } else { "about" };
            parts.push(format!("{sign} {} left", words::duration(eta.seconds)));
        }
        let current = self.model.current.as_ref().filter(|current| current.running);
        if let Some(current) = current {
            parts.push(format!("now {}", words::cell_name(plan, current.cell)));
        }
        let line = words::clean(&format!("night {}-{digits}: {}", plan.name, parts.join(", ")));
        self.talk(Ink::Plain, &line);
    }

    fn end(&mut self) {
        let c = Counts::of(&self.model.cells);
        let r = Counts::of(&self.model.references);
        let named = [
            (c.done, "done"),
            (c.cached, "cached"),
            (c.failed, "failed"),
            (c.interrupted, "interrupted"),
            (c.waiting + c.running, "not reached"),
        ];
        let mut parts: Vec<String> =
            named.iter().filter(|(n, _)| *n > 0).map(|(n, word)| format!("{n} {word}")).collect();
        if r.failed > 0 {
            parts.push(format!("{} failed", plural(r.failed, "reference")));
        }
        if self.model.invalid() > 0 {
            parts.push(format!("{} invalid samples", words::count(self.model.invalid())));
        }
        let ink = if c.failed + r.failed > 0 { Ink::Bad } else { Ink::Plain };
        self.say(ink, &format!("night over: {} of {}", parts.join(", "), plural(c.total(), "cell")));
    }
}

fn plural(n: usize, noun: &str) -> String {
    if n == 1 { format!("{n} {noun}") } else { format!("{n} {noun}s") }
}

impl Sink for LineSink {
    fn hear(&mut self, event: &Event) -> Result<(), SinkError> {
        let now_s = (self.clock)();
        self.model.hear(event, now_s);
        match event {
            Event::NightStarted { plan } => self.night(plan),
            Event::CellStarted { cell, open, .. } => {
                self.spoken.remove(cell);
                self.started(*cell, &open.device);
            }
            Event::Wave { cell, row, pow2, .. } => self.wave(*cell, row, *pow2),
            Event::Times { .. } | Event::Floors { .. } | Event::Halves { .. } | Event::Agreement { .. } => {}
            Event::Forecast(left) => self.foretell(left),
            Event::CellFinished { cell, outcome, rows, .. } => {
                self.spoken.remove(cell);
                self.finished(*cell, outcome, rows.last());
            }
            Event::Message { level, .. } => {
                let text = self.model.messages.back().map_or_else(String::new, |message| message.text.clone());
                match level {
                    Level::Info => self.talk(Ink::Plain, &text),
                    Level::Warn => self.say(Ink::Warn, &format!("warning: {text}")),
                    Level::Error => self.say(Ink::Bad, &format!("error: {text}")),
                }
            }
            Event::NightFinished => self.end(),
        }
        self.sum_up();
        Ok(())
    }
}
