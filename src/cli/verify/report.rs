//! Table of check results, as text that is printed row by row, and as JSON.

use serde_json::{Value as Json, json};

use super::check::{Check, Outcome, SIGNIFICANCE, Verdict, VerifyRequest};

/// Results so far.
pub struct VerifyReport {
    quick: bool,
    seed: u64,
    checks: usize,
    widths: [usize; 3],
    rows: Vec<Json>,
    skipped: Vec<String>,
    counts: [usize; 3],
    seconds: f64,
}

const HEAD: [&str; 5] = ["kind", "check", "compared", "verdict", "statistic"];

impl Verdict {
    fn name(self) -> &'static str {
        match self {
            Verdict::Passed => "passed",
            Verdict::Failed => "FAILED",
            Verdict::Skipped => "skipped",
        }
    }
}

impl VerifyReport {
    /// Creates an empty report for these checks.
    pub fn new<'a>(
        request: &VerifyRequest,
        checks: impl Iterator<Item = (&'static str, &'a Check)>,
    ) -> VerifyReport {
        let mut widths = [HEAD[0], HEAD[1], HEAD[2]].map(str::len);
        let mut count = 0;
        for (kind, check) in checks {
            count += 1;
            let lengths = [kind, &check.name, &check.compared].map(|cell| cell.chars().count());
            widths = [0, 1, 2].map(|i| widths[i].max(lengths[i]));
        }
        VerifyReport {
            quick: request.quick,
            seed: request.seed,
            checks: count,
            widths,
            rows: Vec::new(),
            skipped: Vec::new(),
            counts: [0; 3],
            seconds: 0.0,
        }
    }

    fn line(&self, cells: [&str; 5]) -> String {
        let [a, b, c] = self.widths;
        let [kind, name, compared, verdict, statistic] = cells;
        format!("{kind:<a$}  {name:<b$}  {compared:<c$}  {verdict:<7}  {statistic}")
            .trim_end()
            .to_owned()
            + "\n"
    }

    /// Returns the header above the rows.
    pub fn head(&self) -> String {
        format!(
            "{} checks, seed {}{}, significance {SIGNIFICANCE} shared by all\n{}",
            self.checks,
            self.seed,
            if self.quick { ", quick" } else { "" },
            self.line(HEAD)
        )
    }

    /// Adds a result and returns its row.
    pub fn add(
        &mut self,
        kind: &str,
        name: &str,
        compared: &str,
        outcome: Outcome,
        seconds: f64,
    ) -> String {
        let Outcome {
            verdict,
            statement,
            figures,
        } = outcome;
        self.counts[verdict as usize] += 1;
        self.seconds += seconds;
        if verdict == Verdict::Skipped {
            self.skipped
                .push(format!("{kind} {name}, {compared}: {statement}"));
        }
        self.rows.push(json!({
            "kind": kind,
            "check": name,
            "compared": compared,
            "verdict": verdict.name().to_lowercase(),
            "statement": statement,
            "figures": figures,
            "seconds": seconds,
        }));
        self.line([kind, name, compared, verdict.name(), &statement])
    }

    /// Returns the summary below the rows.
    pub fn tail(&self) -> String {
        let [passed, failed, skipped] = self.counts;
        let reasons: String = self
            .skipped
            .iter()
            .map(|reason| format!("skipped {reason}\n"))
            .collect();
        format!("{passed} passed, {failed} failed, {skipped} skipped\n{reasons}")
    }

    /// Returns all results as JSON.
    pub fn json(&self) -> Json {
        let [passed, failed, skipped] = self.counts;
        json!({
            "version": env!("CARGO_PKG_VERSION"),
            "seed": self.seed,
            "quick": self.quick,
            "significance": SIGNIFICANCE,
            "passed": passed,
            "failed": failed,
            "skipped": skipped,
            "checks": self.rows,
        })
    }

    /// Number of failed checks.
    pub fn failed(&self) -> usize {
        self.counts[Verdict::Failed as usize]
    }

    /// Total duration of the checks in seconds.
    pub fn seconds(&self) -> f64 {
        self.seconds
    }
}
