//! The verdict of a comparison: how many times as efficient one technique is as another, and how
//! certain that is.

use lumbre_light::math::t_test::{welch_interval, welch_p};

/// Significance level of the verdict.
const LEVEL: f64 = 0.05;

/// Results of one technique: the efficiency of each repeat, 1 / (relMSE x seconds).
#[derive(Clone, Debug, PartialEq)]
pub struct TechniqueResults {
    /// Name of the technique.
    pub name: String,
    /// Efficiencies, positive and finite.
    pub efficiencies: Vec<f64>,
}

/// Comparison of the most efficient technique with another one.
#[derive(Clone, Debug, PartialEq)]
pub struct Verdict {
    /// Technique with the greater geometric mean of the efficiency.
    pub better: String,
    /// The other technique.
    pub worse: String,
    /// Ratio of the geometric means of their efficiencies, at least 1.
    pub ratio: f64,
    /// 95 % confidence interval of the ratio; `None` with fewer than two repeats.
    pub interval: Option<[f64; 2]>,
    /// Two-sided p-value of Welch's test on the logarithms, corrected for the number of verdicts
    /// [Holm 1979, its first step].
    pub p: f64,
}

impl Verdict {
    /// Whether the difference is significant.
    pub fn is_significant(&self) -> bool {
        self.p < LEVEL
    }
}

/// Compares the most efficient technique with each other one.
pub fn verdicts(results: &[TechniqueResults]) -> Vec<Verdict> {
    let logarithms =
        |r: &TechniqueResults| -> Vec<f64> { r.efficiencies.iter().map(|x| x.ln()).collect() };
    let mean = |r: &TechniqueResults| {
        let logarithms = logarithms(r);
        logarithms.iter().sum::<f64>() / logarithms.len() as f64
    };
    let usable: Vec<&TechniqueResults> = results
        .iter()
        .filter(|r| !r.efficiencies.is_empty())
        .collect();
    let Some(best) = usable.iter().max_by(|a, b| mean(a).total_cmp(&mean(b))) else {
        return Vec::new();
    };
    let others: Vec<_> = usable.iter().filter(|r| r.name != best.name).collect();
    others
        .iter()
        .map(|other| {
            let (a, b) = (logarithms(best), logarithms(other));
            let interval = welch_interval(&a, &b, LEVEL);
            Verdict {
                better: best.name.clone(),
                worse: other.name.clone(),
                ratio: (mean(best) - mean(other)).exp(),
                interval: interval.map(|ends| ends.map(f64::exp)),
                p: (welch_p(&a, &b) * others.len() as f64).min(1.0),
            }
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn results(name: &str, efficiencies: &[f64]) -> TechniqueResults {
        TechniqueResults {
            name: name.to_owned(),
            efficiencies: efficiencies.to_vec(),
        }
    }

    #[test]
    fn the_better_technique_is_compared_with_each_other_one() {
        let all = [
            results("a", &[1.0, 1.1, 0.9]),
            results("b", &[4.0, 4.4, 3.6]),
            results("c", &[3.9, 4.1, 4.3]),
        ];
        let found = verdicts(&all);
        let names: Vec<_> = found.iter().map(|v| (&*v.better, &*v.worse)).collect();
        assert_eq!(names, [("c", "a"), ("c", "b")]);
        assert!(found[0].is_significant() && !found[1].is_significant());
        let [low, high] = found[0].interval.unwrap();
        assert!(low < found[0].ratio && found[0].ratio < high && low > 2.0);
        // Equal scaling of every repeat changes neither interval nor test.
        let [low, high] = found[1].interval.unwrap();
        assert!(low < 1.0 && high > 1.0);
    }

    #[test]
    fn p_values_are_corrected_for_the_number_of_verdicts() {
        // Logarithms with means `-t * error` and the standard error `error` of differences, so that
        // Welch's t is `t` with 4 degrees of freedom.
        let error = (2.0f64 / 3.0).sqrt();
        let arm = |name: &str, t: f64| {
            let values = [-1.0, 0.0, 1.0].map(|x| f64::exp(x - t * error));
            results(name, &values)
        };
        // Student's t distribution in closed form for 4 degrees of freedom.
        let p = |t: f64| 1.0 - t * (t * t + 6.0) / (t * t + 4.0).powf(1.5);
        for t in [[2.0, 4.0, 6.0], [5.0, 0.25, 3.0]] {
            for others in 1..=3 {
                let worse = (0..others).map(|i| arm(["b", "c", "d"][i], t[i]));
                let all: Vec<_> = std::iter::once(arm("a", 0.0)).chain(worse).collect();
                let found = verdicts(&all);
                assert_eq!(found.len(), others);
                for (verdict, t) in found.iter().zip(t) {
                    let expected = (others as f64 * p(t)).min(1.0);
                    assert!(
                        (verdict.p - expected).abs() < 1e-9,
                        "{others} verdicts, t = {t}: p = {}, not {expected}",
                        verdict.p
                    );
                }
            }
        }
    }

    #[test]
    fn a_single_repeat_has_no_interval_and_no_significance() {
        let found = verdicts(&[results("a", &[1.0]), results("b", &[8.0])]);
        assert!((found[0].ratio - 8.0).abs() < 1e-9);
        assert_eq!(found[0].interval, None);
        assert!(!found[0].is_significant());
        assert_eq!(verdicts(&[results("a", &[])]), []);
    }
}
