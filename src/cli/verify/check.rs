//! Checks, their verdicts, and the parameters of a run that they share.

use std::path::PathBuf;

/// Probability that any check of a run fails for a correct program.
pub const SIGNIFICANCE: f64 = 1e-3;

/// Parameters of a run.
pub struct VerifyRequest {
    /// Use fewer samples and smaller pictures.
    pub quick: bool,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of worker threads; 0 means one per core.
    pub threads: usize,
    /// Folder of the scenes that belong to the references.
    pub scenes: Option<PathBuf>,
    /// Folder of the references.
    pub references: Option<PathBuf>,
    /// Python interpreter with the package `mitsuba`.
    pub python: String,
    /// Scenes that are compared with Mitsuba instead of the table of cases.
    pub files: Vec<PathBuf>,
}

/// Families of checks by the number in their seeds.
#[derive(Clone, Copy)]
pub(super) enum SeedFamily {
    Analytic = 1,
    Agreement = 2,
    Reference = 3,
    Picture = 4,
    Consistent = 5,
    Density = 6,
    Mitsuba = 7,
}

impl VerifyRequest {
    /// Seed of picture `index` in a family of checks; independent of which other checks run.
    pub(super) fn seed(&self, family: SeedFamily, index: usize) -> u64 {
        self.seed.wrapping_mul(1 << 32) ^ (family as u64) << 24 ^ index as u64
    }
}

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// The check passed.
    Passed,
    /// The check failed.
    Failed,
    /// The check was not possible, for lack of data or of significance.
    Skipped,
}

/// Verdict of a check and the statistics behind it.
pub struct Outcome {
    /// Verdict of the check.
    pub verdict: Verdict,
    /// The statistic as text, or why the check was skipped.
    pub statement: String,
    /// The statistic as numbers by name.
    pub figures: serde_json::Value,
}

impl Outcome {
    /// Returns the result of a check that was not possible.
    pub(super) fn skipped(reason: impl Into<String>) -> Outcome {
        Outcome::without_figures(Verdict::Skipped, reason.into())
    }

    /// Returns the result of a check that an error ended.
    pub(super) fn failed(error: String) -> Outcome {
        Outcome::without_figures(Verdict::Failed, error)
    }

    fn without_figures(verdict: Verdict, statement: String) -> Outcome {
        Outcome {
            verdict,
            statement,
            figures: serde_json::Value::Null,
        }
    }
}

/// One check, which prints one row of the table.
pub struct Check {
    /// Name of the scene or reference.
    pub name: String,
    /// Description of what is compared.
    pub compared: String,
    /// Runs the check; its argument is the number of checks that share [`SIGNIFICANCE`].
    pub(super) run: Box<dyn FnOnce(usize) -> Result<Outcome, String>>,
}

impl Check {
    /// Creates a check that was not run yet.
    pub(super) fn new(
        name: impl Into<String>,
        compared: impl Into<String>,
        run: impl FnOnce(usize) -> Result<Outcome, String> + 'static,
    ) -> Check {
        Check {
            name: name.into(),
            compared: compared.into(),
            run: Box::new(run),
        }
    }
}
