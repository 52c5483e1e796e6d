//! Comparison of techniques over repeats: for each pair a ratio, its interval and its p-value from
//! one computation, all of which hold together in 95 % of nights.
//!
//! - Repeats of the same number share their seed and their turns, so that a machine whose speed
//!   drifts disturbs both alike: two techniques are compared by the differences of their repeats
//!   (Student's t), or by Welch's test if they do not have the same repeats.
//! - The best technique is chosen by its results, so any pair can be the one that is shown:
//!   intervals and p-values are corrected for the number of all pairs [Dunn 1961].
//! - The noise of the reference is subtracted from errors. Its estimate has an error of its own,
//!   which all runs share and more repeats do not lessen: each pair is compared with the noise at
//!   both ends of its interval as well, and the widest answer counts.
//! - The mean of logarithms rewards a technique that finds its light in few runs. If the mean of
//!   the errors themselves does not confirm the lower end of the interval, no winner is named.
//!
//! `cargo xtask calibrate` measures how often these claims are false.

use lumbre_light::math::t_test::{
    standard_error, two_sided_p, two_sided_t, welch_interval, welch_p,
};

/// Probability of any false claim in a night.
pub const LEVEL: f64 = 0.05;

/// Result of one run on a scale on which differences are compared, such as the logarithm of its
/// error; smaller is better.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Score {
    /// Number of the repeat.
    pub repeat: u32,
    /// Score with the noise of the reference as estimated, and at both ends of its interval; NaN
    /// where an error is not above the noise.
    pub at_noise: [f64; 3],
}

impl Score {
    /// Creates a score on which the noise of a reference has no effect.
    pub fn new(repeat: u32, score: f64) -> Score {
        Score {
            repeat,
            at_noise: [score; 3],
        }
    }
}

/// The best technique against another one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contrast {
    /// Mean score of the other minus that of the best, at least 0; the logarithm of a ratio on a
    /// logarithmic scale.
    pub difference: f64,
    /// Simultaneous 95 % confidence interval of the difference; `None` with fewer than two
    /// repeats, or if it has no end because the error is not certainly above the noise of the
    /// reference.
    pub interval: Option<[f64; 2]>,
    /// Two-sided p-value, corrected as the interval: below 0.05 exactly if the interval excludes 0.
    pub p: f64,
    /// Logarithm of the ratio of the means of the errors themselves; `None` on a linear scale.
    pub difference_of_means: Option<f64>,
}

impl Contrast {
    /// Returns the ratio of the geometric means, of scores on a logarithmic scale.
    pub fn ratio(&self) -> f64 {
        self.difference.exp()
    }

    /// Returns the interval of [`Contrast::ratio`].
    pub fn ratio_interval(&self) -> Option<[f64; 2]> {
        self.interval.map(|ends| ends.map(f64::exp))
    }

    /// Returns the difference and its interval as ratios, on a logarithmic scale.
    pub fn shown(&self) -> (f64, Option<[f64; 2]>) {
        match self.difference_of_means {
            Some(_) => (self.ratio(), self.ratio_interval()),
            None => (self.difference, self.interval),
        }
    }

    /// Whether the best is significantly better, and the mean of the errors confirms it.
    pub fn is_significant(&self) -> bool {
        self.p < LEVEL && self.is_confirmed()
    }

    /// Whether the means of the errors differ at least as much as the interval says.
    pub fn is_confirmed(&self) -> bool {
        match (self.difference_of_means, self.interval) {
            (Some(means), Some([low, _])) => means >= low.max(0.0),
            _ => true,
        }
    }
}

/// Scale of the scores of a comparison.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ScoreScale {
    /// Scores are no logarithms.
    Linear,
    /// Scores are logarithms of what is averaged: a mean squared error, a time.
    Logarithm,
    /// Scores are logarithms of the root of what is averaged.
    LogarithmOfRoot,
}

/// Comparison of the best of several techniques with each other one.
#[derive(Clone, Debug, PartialEq)]
pub struct Comparison {
    /// Index of the technique with the best mean.
    pub best: usize,
    /// Contrast with each technique; `None` for the best, and for those without results.
    pub contrasts: Vec<Option<Contrast>>,
}

impl Comparison {
    /// Compares techniques by the scores of their runs. Returns `None` with fewer than two that have
    /// any.
    pub fn new(arms: &[Vec<Score>], scale: ScoreScale) -> Option<Comparison> {
        // A run whose error is not above the noise of the reference cannot be the best.
        let mean = |i: usize| {
            let mean = mean(&at(&arms[i], 0));
            if mean.is_nan() { f64::INFINITY } else { mean }
        };
        let some: Vec<usize> = (0..arms.len()).filter(|i| !arms[*i].is_empty()).collect();
        if some.len() < 2 {
            return None;
        }
        let best = some.iter().copied();
        let best = best.min_by(|a, b| mean(*a).total_cmp(&mean(*b)))?;
        let pairs = some.len() * (some.len() - 1) / 2;
        let contrast = |(i, arm): (usize, &Vec<Score>)| {
            (i != best && !arm.is_empty()).then(|| contrast(arm, &arms[best], scale, pairs))
        };
        let contrasts = arms.iter().enumerate().map(contrast).collect();
        Some(Comparison { best, contrasts })
    }

    /// Whether the best is significantly better than each other one.
    pub fn is_significant(&self) -> bool {
        self.contrasts
            .iter()
            .flatten()
            .all(Contrast::is_significant)
    }
}

/// Returns the scores of a technique with the noise of the reference as in [`Score::at_noise`].
fn at(arm: &[Score], noise: usize) -> Vec<f64> {
    arm.iter().map(|score| score.at_noise[noise]).collect()
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Compares one technique with the best, as one of so many pairs.
fn contrast(other: &[Score], best: &[Score], scale: ScoreScale, pairs: usize) -> Contrast {
    let level = LEVEL / pairs as f64;
    let is_paired = has_same_repeats(other, best);
    let with_noise = |noise: usize| {
        let (a, b) = (at(other, noise), at(best, noise));
        if is_paired {
            let differences: Vec<f64> = a.iter().zip(&b).map(|(a, b)| a - b).collect();
            paired(&differences, level)
        } else {
            (welch_interval(&a, &b, level), welch_p(&a, &b))
        }
    };
    let all = [0, 1, 2].map(with_noise);
    let ends: Option<Vec<[f64; 2]>> = all.iter().map(|(interval, _)| *interval).collect();
    let interval = ends.and_then(|ends| {
        let low = ends.iter().map(|ends| ends[0]).reduce(f64::min)?;
        let high = ends.iter().map(|ends| ends[1]).reduce(f64::max)?;
        let is_known = ends.iter().flatten().all(|end| end.is_finite());
        is_known.then_some([low, high])
    });
    let p = match interval {
        None => 1.0,
        Some([low, high]) => {
            let greatest = all.iter().map(|(_, p)| *p).fold(0.0, f64::max);
            let p = (greatest * pairs as f64).min(1.0);
            // With the noise at one end the first may lead, and at the other the second.
            if low <= 0.0 && high >= 0.0 {
                p.max(LEVEL)
            } else {
                p
            }
        }
    };
    let power = match scale {
        ScoreScale::Linear => None,
        ScoreScale::Logarithm => Some(1.0),
        ScoreScale::LogarithmOfRoot => Some(2.0),
    };
    let [a, b] = [other, best].map(|arm| at(arm, 0));
    let difference_of_means = power.map(|power| {
        let [a, b] = [&a, &b].map(|scores| {
            let values: Vec<f64> = scores.iter().map(|score| (power * score).exp()).collect();
            mean(&values).ln() / power
        });
        a - b
    });
    Contrast {
        difference: mean(&a) - mean(&b),
        interval,
        p,
        difference_of_means,
    }
}

/// Returns the interval and the p-value of the mean of some differences by Student's t; no interval
/// with fewer than two.
fn paired(differences: &[f64], level: f64) -> (Option<[f64; 2]>, f64) {
    if differences.len() < 2 {
        return (None, 1.0);
    }
    let dof = differences.len() as f64 - 1.0;
    let mean = differences.iter().sum::<f64>() / differences.len() as f64;
    let error = standard_error(differences);
    if error == 0.0 {
        return (Some([mean; 2]), if mean == 0.0 { 1.0 } else { 0.0 });
    }
    let half = two_sided_t(level, dof) * error;
    (
        Some([mean - half, mean + half]),
        two_sided_p(mean / error, dof),
    )
}

/// Whether two techniques have the same repeats, each once and in the same order.
fn has_same_repeats(a: &[Score], b: &[Score]) -> bool {
    let ascending = a.windows(2).all(|pair| pair[0].repeat < pair[1].repeat);
    let same = a.iter().map(|s| s.repeat).eq(b.iter().map(|s| s.repeat));
    ascending && same
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arm(scores: &[f64]) -> Vec<Score> {
        (0..)
            .zip(scores)
            .map(|(repeat, score)| Score::new(repeat, *score))
            .collect()
    }

    fn contrast_with(arms: &[Vec<Score>], other: usize) -> Contrast {
        let comparison = Comparison::new(arms, ScoreScale::Logarithm).unwrap();
        comparison.contrasts[other].unwrap()
    }

    #[test]
    fn repeats_are_compared_as_pairs_and_corrected_for_all_pairs() {
        // Differences 1, 2 and 3: t = 2 / sqrt(1 / 3), of 2 degrees of freedom, whose two-sided
        // p-value is 1 - t / sqrt(t^2 + 2).
        let (a, b) = (arm(&[10.0, -5.0, 2.0]), arm(&[11.0, -3.0, 5.0]));
        let t = 12.0f64.sqrt();
        let p = 1.0 - t / (t * t + 2.0).sqrt();
        let found = contrast_with(&[b.clone(), a.clone()], 0);
        assert!(
            (found.difference - 2.0).abs() < 1e-12 && (found.p - p).abs() < 1e-9,
            "{found:?}"
        );
        // With a third arm there are three pairs.
        let far = arm(&[40.0, 25.0, 33.0]);
        let corrected = contrast_with(&[b, a, far], 0);
        assert!((corrected.p - 3.0 * p).abs() < 1e-9, "{corrected:?}");
        let width = |c: Contrast| c.interval.map(|[low, high]| high - low).unwrap();
        assert!(width(corrected) > 1.5 * width(found));
    }

    #[test]
    fn the_interval_excludes_zero_exactly_if_p_is_below_the_level() {
        for arms in 2..6 {
            for shift in 0..40 {
                let shift = 0.05 * f64::from(shift);
                let mut all = vec![arm(&[0.0, 0.3, -0.2, 0.1])];
                all.push(arm(&[0.1, 0.2, -0.1, 0.4].map(|x| x + shift)));
                all.resize(arms, arm(&[9.0, 8.5, 9.5, 9.25]));
                let found = contrast_with(&all, 1);
                let [low, high] = found.interval.unwrap();
                assert_eq!(
                    low > 0.0 || high < 0.0,
                    found.p < LEVEL,
                    "{arms} {shift}: {found:?}"
                );
            }
        }
    }

    #[test]
    fn other_repeats_are_no_pairs() {
        let few = arm(&[1.0, 1.1, 0.9]);
        let more = arm(&[2.0, 2.2, 1.8, 2.1]);
        let found = contrast_with(&[more.clone(), few.clone()], 0);
        let scores = |arm: &[Score]| at(arm, 0);
        assert_eq!(found.p, welch_p(&scores(&more), &scores(&few)));
    }

    #[test]
    fn equal_or_missing_results_make_no_claim() {
        let same = arm(&[1.0, 2.0, 3.0]);
        let found = contrast_with(&[same.clone(), same.clone()], 1);
        assert_eq!((found.interval, found.p), (Some([0.0; 2]), 1.0));
        let single = contrast_with(&[arm(&[1.0]), arm(&[9.0])], 1);
        assert_eq!((single.interval, single.p), (None, 1.0));
        assert_eq!(
            Comparison::new(&[same.clone(), Vec::new()], ScoreScale::Linear),
            None
        );
        // A run that cannot be told from the noise of the reference might be the best.
        let lost = arm(&[0.0, f64::NAN, 0.0]);
        let found = Comparison::new(&[lost, same], ScoreScale::Logarithm).unwrap();
        assert_eq!((found.best, found.is_significant()), (1, false));
    }

    #[test]
    fn the_error_of_the_noise_of_the_reference_widens_the_interval() {
        // Errors 2 and 4 with a noise of 1, which may be 0.5 or 1.5.
        let with = |error: f64, noise: [f64; 3]| -> Vec<Score> {
            let scores = [0.99, 1.0, 1.01].map(|x| noise.map(|noise| (x * error - noise).ln()));
            let score = |(repeat, at_noise)| Score { repeat, at_noise };
            (0..).zip(scores).map(score).collect()
        };
        let exact = contrast_with(&[with(2.0, [1.0; 3]), with(4.0, [1.0; 3])], 1);
        let unsure = contrast_with(&[with(2.0, [1.0, 0.5, 1.5]), with(4.0, [1.0, 0.5, 1.5])], 1);
        assert_eq!(exact.difference, unsure.difference);
        let ([low, high], [lower, higher]) = (exact.interval.unwrap(), unsure.interval.unwrap());
        assert!(lower < (3.5f64 / 1.5).ln() && higher > (2.5f64 / 0.5).ln());
        assert!(lower < low && higher > high && unsure.p > exact.p);
        // If all of an error can be noise, its ratio has no end.
        let open = contrast_with(&[with(2.0, [1.0, 0.5, 2.5]), with(4.0, [1.0, 0.5, 2.5])], 1);
        assert_eq!((open.interval, open.p), (None, 1.0));
    }

    #[test]
    fn a_technique_that_finds_its_light_in_few_runs_does_not_win() {
        // One of four runs finds the light, and has all of the error; the other technique has the
        // same mean error.
        let rare: Vec<f64> = (0..16)
            .map(|i| if i % 4 == 0 { 4.0 } else { 0.001 })
            .collect();
        let steady: Vec<f64> = (0..16).map(|i| 1.05 + 0.001 * f64::from(i)).collect();
        let logarithms = |values: &[f64]| arm(&values.iter().map(|x| x.ln()).collect::<Vec<_>>());
        let arms = [logarithms(&rare), logarithms(&steady)];
        let found = Comparison::new(&arms, ScoreScale::Logarithm).unwrap();
        let contrast = found.contrasts[1].unwrap();
        assert!(found.best == 0 && contrast.p < 0.001, "{contrast:?}");
        assert!(!contrast.is_confirmed() && !found.is_significant());
        // The squares of roots are averaged.
        let roots = arms.map(|arm| {
            arm.iter()
                .map(|s| Score::new(s.repeat, s.at_noise[0] / 2.0))
                .collect()
        });
        let found = Comparison::new(&roots, ScoreScale::LogarithmOfRoot).unwrap();
        let of_roots = found.contrasts[1].unwrap().difference_of_means.unwrap();
        assert!((2.0 * of_roots - contrast.difference_of_means.unwrap()).abs() < 1e-12);
    }
}
