//! Plain progress lines for pipes, files and terminals without cursor control.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::Instant;

use super::format;
use super::model::night::NightModel;
use lumbre_light::transport::integrator;
use lumbre_night::experiment::forecast::Forecast;
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::outcome::Level;
use lumbre_night::experiment::shards::Shard;
use lumbre_night::experiment::{CellRef, Event, Night, Outcome, Sink, SinkError, WaveRow};
use lumbre_night::text::{self, counted};

/// Longest wall time in seconds without a line about a running cell.
const SILENCE_S: f64 = 10.0;
/// Wall time in seconds between two summaries of the night.
const SUMMARY_S: f64 = 60.0;
/// Shortest wall time in seconds between two lines at powers of two.
const MILESTONE_S: f64 = 2.0;
/// Shortest wall time in seconds between two lines about the remaining time.
const REMAINING_S: f64 = 2.0;

/// Verbosity and style of the lines.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProgressLineOptions {
    /// Print only warnings, errors, failed cells and the final summary.
    pub quiet: bool,
    /// Whether lines contain ANSI colours.
    pub color: bool,
}

/// A sink that prints progress lines. It never fails: output to a closed pipe is dropped.
pub struct ProgressLines {
    writer: Option<Box<dyn Write + Send>>,
    options: ProgressLineOptions,
    model: NightModel,
    /// Wall time of every running cell at its latest line.
    last_line_s: BTreeMap<CellRef, f64>,
    /// Clock of the night.
    clock: Clock,
    /// Time of the latest summary of the night.
    summary_s: f64,
    /// Time of the latest estimate of the remaining time.
    remaining_s: f64,
    /// Whether the forecast was printed.
    forecast_printed: bool,
}

/// Seconds on a monotonic clock with an arbitrary origin.
pub type Clock = Box<dyn Fn() -> f64 + Send>;

/// Colour of a line.
#[derive(Clone, Copy)]
enum LineColor {
    Plain,
    Dim,
    Good,
    Warn,
    Bad,
}

impl ProgressLines {
    /// Creates a sink that writes to `writer` and flushes after every line.
    pub fn new(writer: Box<dyn Write + Send>, options: ProgressLineOptions) -> ProgressLines {
        let start = Instant::now();
        ProgressLines::with_clock(
            writer,
            options,
            Box::new(move || start.elapsed().as_secs_f64()),
        )
    }

    /// Creates a sink with a clock of the caller, for tests.
    pub fn with_clock(
        writer: Box<dyn Write + Send>,
        options: ProgressLineOptions,
        clock: Clock,
    ) -> ProgressLines {
        let summary_s = clock();
        ProgressLines {
            writer: Some(writer),
            options,
            model: NightModel::default(),
            last_line_s: BTreeMap::new(),
            clock,
            summary_s,
            remaining_s: f64::NEG_INFINITY,
            forecast_printed: false,
        }
    }

    fn print(&mut self, color: LineColor, line: &str) {
        let Some(writer) = &mut self.writer else {
            return;
        };
        let code = match color {
            _ if !self.options.color => "",
            LineColor::Plain => "",
            LineColor::Dim => "\x1b[2m",
            LineColor::Good => "\x1b[32m",
            LineColor::Warn => "\x1b[33m",
            LineColor::Bad => "\x1b[1;31m",
        };
        let reset = if code.is_empty() { "" } else { "\x1b[0m" };
        if writeln!(writer, "{code}{}{reset}", text::visible(line))
            .and_then(|()| writer.flush())
            .is_err()
        {
            // The reader is gone: do not try again.
            self.writer = None;
        }
    }

    fn print_unless_quiet(&mut self, color: LineColor, line: &str) {
        if !self.options.quiet {
            self.print(color, line);
        }
    }

    fn print_start(&mut self, night: &Night) {
        let plan = &night.plan;
        let digits: String = plan.hash.chars().take(4).collect();
        let mut parts = vec![counted(night.runs.len() as u64, "cell")];
        if !night.references.is_empty() {
            parts.push(counted(night.references.len() as u64, "reference"));
        }
        if plan.skipped > 0 {
            parts.push(format!("{} skipped", counted(plan.skipped as u64, "point")));
        }
        self.print_unless_quiet(
            LineColor::Plain,
            &format::clean(&format!(
                "night {}-{digits}: {}",
                plan.name,
                parts.join(", ")
            )),
        );
    }

    /// Formats the measurements of a row: `spp 256  3.21 s  4.12 Mpaths/s  rmse 0.0123`.
    fn measurements(&self, row: &WaveRow) -> String {
        let mut facts = format!(
            "spp {}  {}  {} Mpaths/s",
            format::count(row.samples),
            format::duration(row.render_s),
            format::number(row.mpaths_per_s())
        );
        let metrics = self.model.metrics();
        for (spec, value) in metrics.iter().zip(&row.metrics) {
            facts.push_str(&format!(
                "  {} {}",
                spec.column,
                format::measured(spec, *value)
            ));
        }
        if let Some([x, y, sample]) = row.first_invalid.filter(|_| row.invalid > 0) {
            let n = format::count(row.invalid);
            facts.push_str(&format!(
                "  {n} invalid (first: pixel {x}, {y}, sample {sample})"
            ));
        }
        facts
    }

    /// Formats the position of a cell in the plan and its parameters: `[3/4] depth=5 aa=0.5`.
    fn name(&self, cell: CellRef) -> String {
        let Some(night) = self.model.planned() else {
            return String::new();
        };
        let position = match cell {
            CellRef::Cell(i) => format!("[{}/{}]", i + 1, night.runs.len()),
            CellRef::Reference(i) => format!("[ref {}/{}]", i + 1, night.references.len()),
        };
        format!("{position} {}", format::cell_name(night, cell))
    }

    fn print_run_started(&mut self, cell: CellRef, device: &str) {
        let config = self.model.night.settings(cell).cloned();
        let technique = config.map_or_else(String::new, |config| {
            let long = integrator::integrator(&config.integrator).map_or("", |row| row.long_name);
            format!("{} ({long}) on ", config.integrator)
        });
        let rule = self
            .model
            .stop_rule(cell)
            .map_or_else(String::new, |r| format!("; until {}", r.describe()));
        let line = format!("{}  started: {technique}{device}{rule}", self.name(cell));
        self.print_unless_quiet(LineColor::Dim, &format::clean(&line));
    }

    fn print_run_finished(&mut self, cell: CellRef, outcome: &Outcome, row: Option<&WaveRow>) {
        let facts = row.map_or_else(String::new, |row| format!("{}  ", self.measurements(row)));
        let (color, how) = match outcome {
            Outcome::Done(cause) => (
                LineColor::Good,
                format!("done (stop rule: {})", cause.clause),
            ),
            Outcome::Cached(folder) => (LineColor::Dim, format!("cached: {}", folder.display())),
            Outcome::Failed(reason) => (LineColor::Bad, format!("failed: {reason}")),
            Outcome::Interrupted => (LineColor::Warn, "interrupted".to_owned()),
        };
        let line = format::clean(&format!("{}  {facts}{how}", self.name(cell)));
        match outcome {
            Outcome::Failed(_) => self.print(color, &line),
            _ => self.print_unless_quiet(color, &line),
        }
        self.print_remaining(outcome);
    }

    /// After a cell that took time, prints the remaining time of the night, unless the latest
    /// estimate is recent: it looks at every cell.
    fn print_remaining(&mut self, outcome: &Outcome) {
        let now_s = (self.clock)();
        let current = self.model.current.as_ref();
        let running = current.is_some_and(|current| current.running);
        let recent = now_s - self.remaining_s < REMAINING_S;
        if !matches!(outcome, Outcome::Done(_)) || running || recent {
            return;
        }
        self.remaining_s = now_s;
        let waiting = StateCounts::of_runs(&self.model.night.runs).waiting;
        if waiting == 0 {
            return;
        }
        if let Some(eta) = self.model.night_eta(now_s) {
            let at_most = if eta.at_most { "at most " } else { "about " };
            let line = format!(
                "{} left, {at_most}{}",
                counted(waiting as u64, "cell"),
                format::duration(eta.seconds)
            );
            self.print_unless_quiet(LineColor::Dim, &line);
        }
    }

    fn print_wave(&mut self, cell: CellRef, row: &WaveRow, pow2: bool) {
        let limit = self
            .model
            .stop_rule(cell)
            .and_then(|rule| rule.sample_limit());
        if limit.is_some_and(|limit| row.samples >= limit) {
            // The line about the end of the cell follows at once, with the same numbers.
            return;
        }
        let since = row.wall_s - self.last_line_s.get(&cell).copied().unwrap_or(0.0);
        if since >= SILENCE_S || (pow2 && since >= MILESTONE_S) {
            self.last_line_s.insert(cell, row.wall_s);
            let line = format!("{}  {}", self.name(cell), self.measurements(row));
            self.print_unless_quiet(LineColor::Plain, &line);
        }
    }

    /// Prints the position of a shard, followed by `state`.
    fn print_shard(&mut self, shard: &Shard, state: &str) {
        let name = self.name(CellRef::Reference(shard.reference));
        let line = format!("{name}: {}{state}", shard.label());
        self.print_unless_quiet(LineColor::Plain, &format::clean(&line));
    }

    /// Before the first run, prints the forecast of the night's duration.
    fn print_forecast(&mut self, left: &Forecast) {
        if std::mem::replace(&mut self.forecast_printed, true) || left.known == 0 {
            return;
        }
        let open = left.unknown;
        let unknown = if open > 0 {
            format!(", plus {} of unknown duration", counted(open as u64, "run"))
        } else {
            String::new()
        };
        let length = format::duration(left.seconds);
        let line = format!(
            "forecast: {} {length} for {}{unknown}",
            left.qualifier(),
            counted(left.known as u64, "run")
        );
        self.print_unless_quiet(LineColor::Dim, &line);
    }

    /// Once a minute, prints a summary of the night.
    fn print_summary(&mut self) {
        let now_s = (self.clock)();
        if now_s - self.summary_s < SUMMARY_S || self.model.finished_s.is_some() {
            return;
        }
        self.summary_s = now_s;
        let Some(night) = self.model.planned() else {
            return;
        };
        let plan = &night.plan;
        let counts = StateCounts::of_runs(&self.model.night.runs);
        let digits: String = plan.hash.chars().take(4).collect();
        let mut parts = vec![format!(
            "{} of {}",
            counts.settled(),
            counted(counts.total() as u64, "cell")
        )];
        let references = StateCounts::of_references(&self.model.night.references);
        if references.settled() < references.total() {
            parts.push(format!(
                "{} of {}",
                references.settled(),
                counted(references.total() as u64, "reference")
            ));
        }
        if counts.failed + references.failed > 0 {
            parts.push(format!("{} failed", counts.failed + references.failed));
        }
        parts.push(format!(
            "{} elapsed",
            format::duration(self.model.night_s(now_s))
        ));
        if let Some(eta) = self.model.night_eta(now_s) {
            let sign = if eta.at_most { "at most" } else { "about" };
            parts.push(format!("{sign} {} left", format::duration(eta.seconds)));
        }
        let current = self
            .model
            .current
            .as_ref()
            .filter(|current| current.running);
        if let Some(current) = current {
            parts.push(format!("now {}", format::cell_name(night, current.cell)));
        }
        let line = format::clean(&format!(
            "night {}-{digits}: {}",
            plan.name,
            parts.join(", ")
        ));
        self.print_unless_quiet(LineColor::Plain, &line);
    }

    fn print_end(&mut self) {
        let c = StateCounts::of_runs(&self.model.night.runs);
        let r = StateCounts::of_references(&self.model.night.references);
        let named = [
            (c.done, "done"),
            (c.cached, "cached"),
            (c.failed, "failed"),
            (c.interrupted, "interrupted"),
            (c.waiting + c.running, "not started"),
        ];
        let mut parts: Vec<String> = named
            .iter()
            .filter(|(n, _)| *n > 0)
            .map(|(n, word)| format!("{n} {word}"))
            .collect();
        if r.failed > 0 {
            parts.push(format!("{} failed", counted(r.failed as u64, "reference")));
        }
        if self.model.invalid() > 0 {
            parts.push(format!(
                "{} invalid samples",
                format::count(self.model.invalid())
            ));
        }
        let color = if c.failed + r.failed > 0 {
            LineColor::Bad
        } else {
            LineColor::Plain
        };
        self.print(
            color,
            &format!(
                "night {}: {} of {}",
                self.model.night.counts().end_word(),
                parts.join(", "),
                counted(c.total() as u64, "cell")
            ),
        );
    }
}

impl Sink for ProgressLines {
    fn receive(&mut self, event: &Event) -> Result<(), SinkError> {
        let now_s = (self.clock)();
        self.model.receive(event, now_s);
        match event {
            Event::NightStarted { night } => self.print_start(night),
            Event::CellStarted { cell, open, .. } => {
                self.last_line_s.remove(cell);
                self.print_run_started(*cell, &open.device_line());
            }
            Event::Wave {
                cell, row, pow2, ..
            } => self.print_wave(*cell, row, *pow2),
            Event::ShardStarted { shard, open, .. } => {
                self.print_shard(shard, &format!(", on {}", open.device_line()));
            }
            Event::ShardFinished {
                shard,
                outcome: Outcome::Done(_),
                ..
            } => self.print_shard(shard, " done"),
            Event::ShardFinished { .. }
            | Event::Times { .. }
            | Event::NoiseFloors { .. }
            | Event::Halves { .. }
            | Event::BiasCheck { .. }
            | Event::RunActive { .. }
            | Event::ShardActive { .. }
            | Event::Picture { .. }
            | Event::Layer { .. } => {}
            Event::Forecast(left) => self.print_forecast(left),
            Event::CellFinished {
                cell,
                outcome,
                rows,
                ..
            } => {
                self.last_line_s.remove(cell);
                self.print_run_finished(*cell, outcome, rows.last());
            }
            Event::Message { level, .. } => {
                let text = self
                    .model
                    .messages
                    .back()
                    .map_or_else(String::new, |message| message.text.clone());
                match level {
                    Level::Info => self.print_unless_quiet(LineColor::Plain, &text),
                    Level::Warn => self.print(LineColor::Warn, &format!("warning: {text}")),
                    Level::Error => self.print(LineColor::Bad, &format!("error: {text}")),
                }
            }
            Event::NightFinished => self.print_end(),
        }
        self.print_summary();
        Ok(())
    }
}
