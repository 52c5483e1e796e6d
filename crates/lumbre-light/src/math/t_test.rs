//! Student's t distribution: confidence intervals of means, and Welch's test that two means are
//! equal. All computations are in double precision.

use super::stats::ln_gamma;

/// Returns the two-sided p-value of Student's t with `dof` degrees of freedom, not necessarily an
/// integer. Returns 1 if `dof` is not positive or an argument is NaN.
pub fn two_sided_p(t: f64, dof: f64) -> f64 {
    if dof.is_nan() || dof <= 0.0 || t.is_nan() {
        return 1.0;
    }
    if t.is_infinite() {
        return 0.0;
    }
    beta_regularised(dof / (dof + t * t), dof / 2.0, 0.5)
}

/// Returns the t whose two-sided p-value is `p` (0 < p < 1) for `dof` > 0, by bisection to 12
/// digits.
pub fn two_sided_t(p: f64, dof: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1.0);
    while two_sided_p(high, dof) > p && high < 1e12 {
        high *= 2.0;
    }
    while high - low > 1e-12 * high {
        let middle = 0.5 * (low + high);
        if middle <= low || middle >= high {
            break;
        }
        if two_sided_p(middle, dof) > p {
            low = middle
        } else {
            high = middle
        }
    }
    0.5 * (low + high)
}

/// Returns the mean and the half width of its 95 % confidence interval; `None` for the latter with
/// fewer than two values.
pub fn mean_and_interval(values: &[f64]) -> (f64, Option<f64>) {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let half = (values.len() > 1).then(|| two_sided_t(0.05, n - 1.0) * standard_error(values));
    (mean, half)
}

/// Returns the standard error of the mean of some values, of which there are at least two.
pub fn standard_error(values: &[f64]) -> f64 {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    (variance(values, mean) / n).sqrt()
}

/// Returns the two-sided p-value of Welch's test that two samples have the same mean [Welch 1947].
/// Returns 1 if either has fewer than two values. For samples without variance, returns 0 if they
/// differ and 1 if they are equal.
pub fn welch_p(a: &[f64], b: &[f64]) -> f64 {
    let Some(Welch {
        difference,
        error,
        dof,
    }) = Welch::new(a, b)
    else {
        return 1.0;
    };
    if error == 0.0 {
        return if difference == 0.0 { 1.0 } else { 0.0 };
    }
    two_sided_p(difference / error, dof)
}

/// Returns the confidence interval of the difference of two means, `a` minus `b`, at a level such as
/// 0.05 by Welch's approximation [Welch 1947]; `None` if either sample has fewer than two values.
pub fn welch_interval(a: &[f64], b: &[f64], level: f64) -> Option<[f64; 2]> {
    let Welch {
        difference,
        error,
        dof,
    } = Welch::new(a, b)?;
    let half = if error > 0.0 {
        two_sided_t(level, dof) * error
    } else {
        0.0
    };
    Some([difference - half, difference + half])
}

/// Difference of the means of two samples.
struct Welch {
    difference: f64,
    /// Standard error of the difference.
    error: f64,
    /// Degrees of freedom by Welch and Satterthwaite; NaN if the error is zero.
    dof: f64,
}

impl Welch {
    /// Returns `None` if either sample has fewer than two values.
    fn new(a: &[f64], b: &[f64]) -> Option<Welch> {
        if a.len() < 2 || b.len() < 2 {
            return None;
        }
        let mean = |v: &[f64]| v.iter().sum::<f64>() / v.len() as f64;
        let (ma, mb) = (mean(a), mean(b));
        let (na, nb) = (a.len() as f64, b.len() as f64);
        let (sa, sb) = (variance(a, ma) / na, variance(b, mb) / nb);
        let dof = (sa + sb).powi(2) / (sa * sa / (na - 1.0) + sb * sb / (nb - 1.0));
        Some(Welch {
            difference: ma - mb,
            error: (sa + sb).sqrt(),
            dof,
        })
    }
}

/// Returns the unbiased sample variance.
fn variance(values: &[f64], mean: f64) -> f64 {
    values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / (values.len() as f64 - 1.0)
}

/// Computes I_x(a, b), the regularised incomplete beta function, by its continued fraction (Lentz's
/// method), on the side where that converges fast.
fn beta_regularised(x: f64, a: f64, b: f64) -> f64 {
    if x <= 0.0 || x >= 1.0 {
        return if x <= 0.0 { 0.0 } else { 1.0 };
    }
    if x > (a + 1.0) / (a + b + 2.0) {
        return 1.0 - beta_regularised(1.0 - x, b, a);
    }
    let factor =
        (a * x.ln() + b * (1.0 - x).ln() + ln_gamma(a + b) - ln_gamma(a) - ln_gamma(b)).exp() / a;
    let tiny = 1e-300;
    let nonzero = |v: f64| if v.abs() < tiny { tiny } else { v };
    let (mut c, mut d) = (1.0, 1.0 / nonzero(1.0 - (a + b) * x / (a + 1.0)));
    let mut h = d;
    for i in 1..10_000 {
        let m = f64::from(i);
        let even = m * (b - m) * x / ((a + 2.0 * m - 1.0) * (a + 2.0 * m));
        let odd = -(a + m) * (a + b + m) * x / ((a + 2.0 * m) * (a + 2.0 * m + 1.0));
        for term in [even, odd] {
            d = 1.0 / nonzero(1.0 + term * d);
            c = nonzero(1.0 + term / c);
            h *= d * c;
        }
        if (d * c - 1.0).abs() < 1e-15 {
            break;
        }
    }
    (factor * h).clamp(0.0, 1.0)
}

#[cfg(test)]
mod tests {
    use crate::math::t_test::*;

    #[test]
    fn the_interval_contains_zero_exactly_if_the_test_does_not_reject() {
        let a = [1.0, 1.2, 0.9, 1.4];
        for shift in [0.0, 0.2, 0.35, 0.45, 0.8] {
            let b = a.map(|x| 0.9 * x + shift);
            let [low, high] = welch_interval(&a, &b, 0.05).unwrap();
            let inside = low < 0.0 && high > 0.0;
            assert_eq!(inside, welch_p(&a, &b) > 0.05, "{shift}: {low} to {high}");
        }
        assert_eq!(welch_interval(&[1.0], &a, 0.05), None);
        assert_eq!(welch_interval(&[2.0; 3], &[1.0; 3], 0.05), Some([1.0, 1.0]));
    }

    #[test]
    fn quantiles_match_published_tables() {
        // Upper 2.5 % points, two-sided 5 %: 1 degree 12.7062, 2 degrees 4.30265, 9 degrees
        // 2.26216, 30 degrees 2.04227.
        for (dof, t) in [
            (1.0, 12.706_204_74),
            (2.0, 4.302_652_73),
            (9.0, 2.262_157_163),
            (30.0, 2.042_272_456),
        ] {
            assert!(
                (two_sided_t(0.05, dof) - t).abs() < 1e-7,
                "{dof}: {}",
                two_sided_t(0.05, dof)
            );
            assert!((two_sided_p(t, dof) - 0.05).abs() < 1e-9, "{dof}");
        }
        assert!(
            (two_sided_p(1.959_963_985, 1e9) - 0.05).abs() < 1e-7,
            "with many degrees of freedom it is the normal distribution"
        );
        assert_eq!(
            (
                two_sided_p(0.0, 3.0),
                two_sided_p(f64::INFINITY, 3.0),
                two_sided_p(1.0, 0.0)
            ),
            (1.0, 0.0, 1.0)
        );
    }

    #[test]
    fn welch_agrees_with_a_worked_example() {
        // Means 3 and 6, variances 2.5 and 10, five values each: t = -3 / sqrt(2.5), nu = 5.882353.
        let (a, b) = ([1.0, 2.0, 3.0, 4.0, 5.0], [2.0, 4.0, 6.0, 8.0, 10.0]);
        let expected = two_sided_p(3.0 / 2.5f64.sqrt(), 100.0 / 17.0);
        assert!((welch_p(&a, &b) - expected).abs() < 1e-12);
        assert!((0.10..0.115).contains(&expected), "{expected}");
        assert_eq!(
            (
                welch_p(&a, &[1.0]),
                welch_p(&[1.0; 2], &[2.0; 2]),
                welch_p(&[1.0; 2], &[1.0; 3])
            ),
            (1.0, 0.0, 1.0)
        );
    }

    #[test]
    fn intervals_need_at_least_two_values() {
        let (mean, half) = mean_and_interval(&[1.0, 3.0]);
        assert!(mean == 2.0 && (half.unwrap() - 12.706_204_74).abs() < 1e-6);
        assert_eq!(mean_and_interval(&[4.0]), (4.0, None));
    }
}
