//! Statistical tests of estimators, for the test suite and `lumbre verify`, and the median. All
//! computations are in double precision.

/// Returns the two-sided p-value of a standard normal deviate.
pub fn normal_two_sided_p(z: f64) -> f64 {
    upper_gamma_regularised(0.5, z * z / 2.0)
}

/// Returns the p-value of Pearson's chi-square test. Neighbouring cells are pooled until each has
/// an expected count of at least 5. `fitted` is the number of parameters estimated from the data.
///
/// Returns 0 if a cell with expected count 0 was observed, and 1 if no degree of freedom is left.
pub fn chi_square_p(observed: &[f64], expected: &[f64], fitted: usize) -> f64 {
    let mut chi2 = 0.0;
    let mut cells = 0usize;
    let (mut o, mut e) = (0.0, 0.0);
    for (i, (&oi, &ei)) in observed.iter().zip(expected).enumerate() {
        if ei <= 0.0 && oi > 0.0 {
            return 0.0;
        }
        o += oi;
        e += ei;
        if e >= 5.0 && expected[i + 1..].iter().sum::<f64>() >= 5.0 {
            chi2 += (o - e) * (o - e) / e;
            cells += 1;
            (o, e) = (0.0, 0.0);
        }
    }
    if e > 0.0 {
        chi2 += (o - e) * (o - e) / e;
        cells += 1;
    }
    let dof = cells.saturating_sub(1 + fitted);
    if dof == 0 {
        1.0
    } else {
        upper_gamma_regularised(dof as f64 / 2.0, chi2 / 2.0)
    }
}

/// Returns the significance of each of `tests` independent tests for a joint significance `alpha`
/// [Sidak 1967].
pub fn sidak(alpha: f64, tests: usize) -> f64 {
    1.0 - (1.0 - alpha).powf(1.0 / tests.max(1) as f64)
}

/// Returns the median; NaN if there are no values.
pub fn median(values: impl IntoIterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.into_iter().collect();
    values.sort_by(f64::total_cmp);
    match values.len() {
        0 => f64::NAN,
        n if n % 2 == 1 => values[n / 2],
        n => 0.5 * (values[n / 2 - 1] + values[n / 2]),
    }
}

/// Computes Q(a, x), the regularised upper incomplete gamma function, by series or continued
/// fraction.
fn upper_gamma_regularised(a: f64, x: f64) -> f64 {
    if x <= 0.0 {
        return 1.0;
    }
    let scale = (a * x.ln() - x - ln_gamma(a)).exp();
    if x < a + 1.0 {
        let (mut term, mut sum, mut k) = (1.0 / a, 1.0 / a, a);
        while term.abs() > sum.abs() * 1e-16 {
            k += 1.0;
            term *= x / k;
            sum += term;
        }
        (1.0 - scale * sum).clamp(0.0, 1.0)
    } else {
        // Modified Lentz evaluation of the continued fraction.
        let tiny = 1e-300;
        let mut b = x + 1.0 - a;
        let mut c = 1.0 / tiny;
        let mut d = 1.0 / b;
        let mut h = d;
        for i in 1..10_000 {
            let an = -f64::from(i) * (f64::from(i) - a);
            b += 2.0;
            d = 1.0 / (an * d + b).abs().max(tiny).copysign(an * d + b);
            c = b + an / c;
            if c.abs() < tiny {
                c = tiny;
            }
            let delta = d * c;
            h *= delta;
            if (delta - 1.0).abs() < 1e-15 {
                break;
            }
        }
        (scale * h).clamp(0.0, 1.0)
    }
}

/// Computes ln Gamma(x) for x > 0 by Stirling's series after shifting x above 10.
pub(super) fn ln_gamma(x: f64) -> f64 {
    let mut shift = 0.0;
    let mut y = x;
    while y < 10.0 {
        shift += y.ln();
        y += 1.0;
    }
    let r = 1.0 / (y * y);
    let series = (1.0 / 12.0 - r * (1.0 / 360.0 - r * (1.0 / 1260.0 - r / 1680.0))) / y;
    (y - 0.5) * y.ln() - y + 0.5 * std::f64::consts::TAU.ln() + series - shift
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tails_match_published_tables() {
        assert!((normal_two_sided_p(1.959_963_985) - 0.05).abs() < 1e-9);
        assert!((normal_two_sided_p(3.290_526_731) - 0.001).abs() < 1e-10);
        // Upper 5 % points of chi-square: 1 degree 3.841459, 10 degrees 18.307038, 100 degrees
        // 124.342113.
        for (dof, x) in [
            (1.0, 3.841_458_821),
            (10.0, 18.307_038_053),
            (100.0, 124.342_113_4),
        ] {
            assert!(
                (upper_gamma_regularised(dof / 2.0, x / 2.0) - 0.05).abs() < 1e-8,
                "{dof}"
            );
        }
    }

    #[test]
    fn gamma_of_small_arguments() {
        assert!((ln_gamma(0.5) - std::f64::consts::PI.sqrt().ln()).abs() < 1e-12);
        assert!((ln_gamma(5.0) - 24f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn impossible_observations_have_p_0_and_tests_without_freedom_p_1() {
        assert_eq!(chi_square_p(&[1.0, 99.0], &[0.0, 100.0], 0), 0.0);
        assert_eq!(chi_square_p(&[100.0], &[100.0], 0), 1.0);
        assert!(chi_square_p(&[60.0, 40.0], &[50.0, 50.0], 0) < 0.05);
        assert!(chi_square_p(&[51.0, 49.0], &[50.0, 50.0], 0) > 0.5);
    }

    #[test]
    fn median_of_odd_even_and_none() {
        assert_eq!(median([3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median([4.0, 1.0, 2.0, 3.0]), 2.5);
        assert!(median([]).is_nan());
    }

    #[test]
    fn sidak_splits_the_significance() {
        assert!((sidak(0.01, 1) - 0.01).abs() < 1e-12);
        assert!((sidak(0.01, 100) - 1.005e-4).abs() < 1e-6);
    }
}
