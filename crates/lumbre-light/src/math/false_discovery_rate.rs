//! Selects the discoveries among many tests under a bound on the false discovery rate.

/// Returns which of many tests are discoveries, such that the expected share of false ones among
/// all discoveries is at most `rate`. This is the step-up procedure of [Benjamini and Hochberg
/// 1995], which is also valid for positively dependent tests [Benjamini and Yekutieli 2001].
///
/// If all null hypotheses are true, the probability of any discovery is at most `rate`. A NaN
/// p-value is never a discovery.
///
/// # Bibliography
/// [Benjamini and Hochberg 1995] Controlling the False Discovery Rate: A Practical and Powerful
/// Approach to Multiple Testing. [Benjamini and Yekutieli 2001] The Control of the False Discovery
/// Rate in Multiple Testing under Dependency.
pub fn discoveries(p_values: &[f64], rate: f64) -> Vec<bool> {
    let mut sorted: Vec<f64> = p_values.iter().copied().filter(|p| !p.is_nan()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    let tests = p_values.len() as f64;
    let step = |(i, p): (usize, &f64)| (*p <= rate * (i + 1) as f64 / tests).then_some(*p);
    let greatest = sorted.iter().enumerate().rev().find_map(step);
    p_values
        .iter()
        .map(|p| greatest.is_some_and(|limit| *p <= limit))
        .collect()
}

#[cfg(test)]
mod tests {
    use crate::math::false_discovery_rate::*;
    use crate::math::rng::{pcg4d, unit};

    #[test]
    fn the_worked_example_of_the_paper() {
        // Table 1 of Benjamini and Hochberg: at 5 % the four smallest of fifteen are rejected, the
        // fourth only because the procedure steps up.
        let p = [
            0.0001, 0.0004, 0.0019, 0.0095, 0.0201, 0.0278, 0.0298, 0.0344, 0.0459, 0.3240, 0.4262,
            0.5719, 0.6528, 0.7590, 1.0,
        ];
        assert_eq!(discoveries(&p, 0.05).iter().filter(|d| **d).count(), 4);
        assert!(discoveries(&p, 0.05)[..4].iter().all(|d| *d));
        // A larger p-value below its step also rejects smaller ones that are above theirs.
        assert_eq!(discoveries(&[0.039, 0.04, 0.9], 0.06), [true, true, false]);
        assert_eq!(discoveries(&[0.03, 0.9, 0.9], 0.06), [false; 3]);
        assert_eq!(discoveries(&[f64::NAN, 1e-9], 0.01), [false, true]);
        assert!(discoveries(&[], 0.01).is_empty());
    }

    #[test]
    fn false_discoveries_are_as_frequent_as_stated() {
        let uniform = |i: u32, seed: u32| f64::from(unit(pcg4d([i, seed, 17, 5])[0]));
        let has_discovery = |seed: &u32| {
            let p: Vec<f64> = (0..60).map(|i| uniform(i, *seed)).collect();
            discoveries(&p, 0.1).contains(&true)
        };
        // 2000 trials at 10 %: 200 +- 54 at four standard deviations.
        let discovered = (0..2000).filter(has_discovery).count();
        assert!((146..=254).contains(&discovered), "{discovered}");
    }
}
