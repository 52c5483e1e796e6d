//! The verdict of a comparison: how many times as efficient one technique is as another, and how
//! certain that is.

use lumbre_report::comparison::{Comparison, Contrast, Score, ScoreScale};

/// Results of one technique: the efficiency of each repeat, 1 / (relMSE x seconds).
#[derive(Clone, Debug, PartialEq)]
pub struct TechniqueResults {
    /// Name of the technique.
    pub name: String,
    /// Efficiencies of its runs.
    pub runs: Vec<RunEfficiency>,
}

/// Efficiency of one run; NaN where its error is not above the noise of the reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunEfficiency {
    /// Number of the repeat.
    pub repeat: u32,
    /// Efficiency with the noise of the reference as estimated, and at both ends of its interval.
    pub at_noise: [f64; 3],
}

/// Comparison of the most efficient technique with another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Technique with the greater geometric mean of the efficiency.
    pub better: String,
    /// The other technique.
    pub worse: String,
    /// Comparison of the logarithms of their efficiencies.
    pub contrast: Contrast,
}

/// Compares the most efficient technique with each other one.
pub fn verdicts(results: &[TechniqueResults]) -> Vec<Verdict> {
    let score = |run: &RunEfficiency| Score {
        repeat: run.repeat,
        at_noise: run.at_noise.map(|efficiency| -efficiency.ln()),
    };
    let arms: Vec<Vec<Score>> = results
        .iter()
        .map(|r| r.runs.iter().map(score).collect())
        .collect();
    let Some(comparison) = Comparison::new(&arms, ScoreScale::Logarithm) else {
        return Vec::new();
    };
    let verdict = |(other, contrast): (&TechniqueResults, Option<Contrast>)| {
        Some(Verdict {
            better: results[comparison.best].name.clone(),
            worse: other.name.clone(),
            contrast: contrast?,
        })
    };
    results
        .iter()
        .zip(comparison.contrasts)
        .filter_map(verdict)
        .collect()
}
