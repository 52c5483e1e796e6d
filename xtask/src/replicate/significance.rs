//! Tests of claims with significance, as `scripts/theses/README.md` defines them.

use std::path::Path;

use lumbre_light::math::t_test::{standard_error, two_sided_p};
use lumbre_night::text::{counted, significant};
use lumbre_report::quantity::{Bound, RunValue};

use super::claims::{Claim, Side, Test};
use super::values::{NightValues, Quantity, Reading};

/// Significance level of each test.
pub const LEVEL: f64 = 0.01;

/// Rounding error of a mean of equal differences.
const ROUNDING: f64 = 1e-9;

/// Result of a claim.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    Holds,
    /// It holds without its factor.
    Weaker,
    TurnsAround,
    Unjudged,
}

impl Verdict {
    pub fn name(self) -> &'static str {
        match self {
            Verdict::Holds => "holds",
            Verdict::Weaker => "weaker",
            Verdict::TurnsAround => "turns around",
            Verdict::Unjudged => "cannot be judged",
        }
    }
}

/// Verdict on a claim with its numbers.
#[derive(Clone, Debug)]
pub struct Judgement {
    pub verdict: Verdict,
    /// Numbers of this program, or why there are none.
    pub shown: String,
    /// The p-value, if a test was made.
    pub p: Option<f64>,
}

impl Judgement {
    fn new((verdict, p): Tested, shown: String) -> Judgement {
        Judgement { verdict, shown, p }
    }
}

/// Verdict and p-value of a test; no p-value if numbers without spread were compared.
type Tested = (Verdict, Option<f64>);

/// An estimate with its standard error and degrees of freedom.
#[derive(Clone, Copy, Debug)]
struct Estimate {
    mean: f64,
    error: f64,
    dof: f64,
}

impl Estimate {
    /// Estimates the mean of at least two differences.
    fn of_mean(differences: &[f64]) -> Option<Estimate> {
        let n = differences.len() as f64;
        (n >= 2.0).then(|| Estimate {
            mean: differences.iter().sum::<f64>() / n,
            error: standard_error(differences),
            dof: n - 1.0,
        })
    }

    /// Estimates the slope of a line through points by least squares. Returns `None` for fewer than
    /// three positions.
    fn of_slope(points: &[(f64, f64)]) -> Option<Estimate> {
        let mut positions: Vec<f64> = points.iter().map(|(x, _)| *x).collect();
        positions.sort_by(f64::total_cmp);
        positions.dedup();
        if positions.len() < 3 {
            return None;
        }
        let n = points.len() as f64;
        let mean = |value: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(value).sum::<f64>() / n;
        let (x, y) = (mean(&|p| p.0), mean(&|p| p.1));
        let square = n * mean(&|p| (p.0 - x).powi(2));
        let slope = n * mean(&|p| (p.0 - x) * (p.1 - y)) / square;
        let residual = n * mean(&|p| (p.1 - y - slope * (p.0 - x)).powi(2));
        let dof = n - 2.0;
        Some(Estimate {
            mean: slope,
            error: (residual / dof / square).sqrt(),
            dof,
        })
    }

    /// Tests two-sided whether the true value is 0. The claim holds if it is below 0.
    fn below_zero(&self) -> Tested {
        let p = (self.error > 0.0).then(|| two_sided_p(self.mean / self.error, self.dof));
        let is_significant = p.map_or(self.mean != 0.0, |p| p < LEVEL);
        let verdict = match (is_significant, self.mean < 0.0) {
            (false, _) => Verdict::Unjudged,
            (true, true) => Verdict::Holds,
            (true, false) => Verdict::TurnsAround,
        };
        (verdict, p)
    }

    /// Returns the one-sided p-value of the hypothesis that the true value is at most `bound`.
    fn p_above(&self, bound: f64) -> f64 {
        let t = (self.mean - bound) / self.error;
        let half = two_sided_p(t, self.dof) / 2.0;
        if t > 0.0 { half } else { 1.0 - half }
    }

    /// Tests by two one-sided tests whether the true value is between two bounds. The p-value of
    /// that is the larger of the two; if the value is outside, it is that of the other side.
    fn between(&self, low: f64, high: f64) -> Tested {
        if self.error == 0.0 {
            let is_inside = (low - ROUNDING..=high + ROUNDING).contains(&self.mean);
            let verdict = [Verdict::TurnsAround, Verdict::Holds][usize::from(is_inside)];
            return (verdict, None);
        }
        let (above_low, above_high) = (self.p_above(low), self.p_above(high));
        let inside = above_low.max(1.0 - above_high);
        let outside = above_high.min(1.0 - above_low);
        let verdict = match (inside < LEVEL, outside < LEVEL) {
            (true, _) => Verdict::Holds,
            (false, true) => return (Verdict::TurnsAround, Some(outside)),
            (false, false) => Verdict::Unjudged,
        };
        (verdict, Some(inside))
    }
}

/// Judges a claim by a night.
pub fn judge(claim: &Claim, values: &NightValues) -> Judgement {
    let judged = match claim.test {
        Test::None => Err("nothing is measured".to_owned()),
        Test::Drawn => drawn(claim, &values.night().folder),
        Test::Less | Test::Equal | Test::Shift => compared(claim, values),
        Test::Rises | Test::Falls => trend(claim, values),
    };
    judged.unwrap_or_else(|reason| Judgement::new((Verdict::Unjudged, None), reason))
}

/// Judges whether a file exists.
fn drawn(claim: &Claim, night: &Path) -> Result<Judgement, String> {
    let file = claim.file.as_deref().unwrap_or_default();
    if has_file(night, &file.split('/').collect::<Vec<_>>()) {
        Ok(Judgement::new((Verdict::Holds, None), format!("`{file}`")))
    } else {
        Err("the picture is missing".to_owned())
    }
}

/// Returns whether a folder has a file of a pattern. `**` is any number of folders, `*` within a name
/// any characters.
fn has_file(folder: &Path, pattern: &[&str]) -> bool {
    let [first, rest @ ..] = pattern else {
        return folder.is_file();
    };
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let (start, end) = first.split_once('*').unwrap_or((first, ""));
    let is_match = |name: &str| match *first {
        "**" => true,
        _ if !first.contains('*') => name == *first,
        _ => {
            let is_long = name.len() >= start.len() + end.len();
            is_long && name.starts_with(start) && name.ends_with(end)
        }
    };
    let below = if *first == "**" { pattern } else { rest };
    let mut names = entries.filter(|entry| is_match(&entry.file_name().to_string_lossy()));
    *first == "**" && has_file(folder, rest) || names.any(|entry| has_file(&entry.path(), below))
}

/// Judges a comparison of pairs of runs.
fn compared(claim: &Claim, values: &NightValues) -> Result<Judgement, String> {
    let pairs = values.pairs(claim)?;
    if pairs.len() < 2 {
        return Err(format!(
            "{} of finished runs",
            counted(pairs.len() as u64, "pair")
        ));
    }
    let within = claim.within.unwrap_or(1.0);
    if claim.test == Test::Shift {
        let by = claim.by.unwrap_or(0.0);
        let differences: Vec<f64> = pairs.iter().filter_map(difference).collect();
        let estimate = Estimate::of_mean(&differences).ok_or("no differences")?;
        let name = &claim.quantity(Side::A)?.name;
        let shown = format!("`{name}`: {:.3} ± {:.3}", estimate.mean, estimate.error);
        return Ok(Judgement::new(
            estimate.between(by - within, by + within),
            shown,
        ));
    }
    let side = |i: usize| pairs.iter().map(|pair| pair[i].number()).collect();
    let sides: [Option<Vec<RunValue>>; 2] = [0, 1].map(side);
    let [Some(a), Some(b)] = &sides else {
        return Err("its values are no numbers".to_owned());
    };
    let tested = match claim.test {
        Test::Less => less(a, b, claim.factor.unwrap_or(1.0)),
        _ => equal(a, b, within),
    };
    let quantity = claim.quantity(Side::A)?;
    let [a, b] = [a, b].map(|values| summary(values, unit(quantity)));
    let perfect = values.similarity(quantity).map(|metric| metric.row.perfect);
    let perfect = perfect.map(|best| format!("{best} − ")).unwrap_or_default();
    let shown = format!("{perfect}`{}`: {a} against {b}", quantity.name);
    let tested = tested.ok_or_else(|| format!("{shown}; a value is not positive, or a bound"))?;
    Ok(Judgement::new(tested, shown))
}

/// Returns the difference of a pair, or its lag if it is of curves.
fn difference(pair: &[Reading; 2]) -> Option<f64> {
    match pair {
        [Reading::Curve(a, bin), Reading::Curve(b, _)] => Some(lag(a, b)? as f64 * bin),
        [a, b] => Some(a.number()?.number - b.number()?.number),
    }
}

/// Returns the number of bins by which `a` lags behind `b`, where their cross-correlation is largest.
fn lag(a: &[f64], b: &[f64]) -> Option<i64> {
    let lags = 1 - b.len() as i64..a.len() as i64;
    let correlation = |lag: i64| {
        let pairs = b.iter().enumerate().filter_map(|(i, b)| {
            let at = usize::try_from(i as i64 + lag).ok()?;
            Some(a.get(at)? * b)
        });
        pairs.sum::<f64>()
    };
    let lags = lags.map(|lag| (lag, correlation(lag)));
    lags.max_by(|x, y| x.1.total_cmp(&y.1)).map(|(lag, _)| lag)
}

/// Tests whether `factor` times `a` is less than `b`, by pairs.
fn less(a: &[RunValue], b: &[RunValue], factor: f64) -> Option<Tested> {
    let is_positive = a.iter().chain(b).all(|value| value.number > 0.0);
    let test = |factor: f64| {
        let difference = |(a, b): (&RunValue, &RunValue)| match is_positive {
            true => (factor * a.number / b.number).ln(),
            false => factor * a.number - b.number,
        };
        let differences: Vec<f64> = a.iter().zip(b).map(difference).collect();
        let (verdict, p) = Estimate::of_mean(&differences)?.below_zero();
        let has = |values: &[RunValue], bound| values.iter().any(|value| value.bound == bound);
        let is_open = match verdict {
            Verdict::Holds => has(a, Bound::Lower) || has(b, Bound::Upper),
            _ => has(a, Bound::Upper) || has(b, Bound::Lower),
        };
        Some((if is_open { Verdict::Unjudged } else { verdict }, p))
    };
    let judged = test(factor)?;
    if judged.0 == Verdict::TurnsAround && factor > 1.0 {
        let (verdict, p) = test(1.0)?;
        if verdict == Verdict::Holds {
            return Some((Verdict::Weaker, p));
        }
    }
    Some(judged)
}

/// Tests whether the ratio of `a` and `b` is at most `within` and at least its inverse, by pairs.
fn equal(a: &[RunValue], b: &[RunValue], within: f64) -> Option<Tested> {
    let pairs = a.iter().zip(b);
    let log = |(a, b): (&RunValue, &RunValue)| {
        let is_known = !a.bound.is_open() && !b.bound.is_open() && a.number > 0.0 && b.number > 0.0;
        is_known.then(|| (a.number / b.number).ln())
    };
    let logs: Vec<f64> = pairs.map(log).collect::<Option<_>>()?;
    Some(Estimate::of_mean(&logs)?.between(-within.ln(), within.ln()))
}

/// Formats the geometric mean of values; the mean, if one is not positive.
fn summary(values: &[RunValue], unit: &str) -> String {
    let n = values.len() as f64;
    let mean = if values.iter().all(|value| value.number > 0.0) {
        (values.iter().map(|value| value.number.ln()).sum::<f64>() / n).exp()
    } else {
        values.iter().map(|value| value.number).sum::<f64>() / n
    };
    let mut bounds = values.iter().map(|value| value.bound);
    let bound = bounds.find(|bound| bound.is_open()).unwrap_or_default();
    let number = match mean {
        0.0 => "0".to_owned(),
        _ => significant(mean, 3, -4..=6),
    };
    format!("{}{number}{unit}", bound.sign())
}

/// Returns the unit of a quantity with a leading space.
fn unit(quantity: &Quantity) -> &'static str {
    let name = quantity.name.as_str();
    match name {
        "render_s" | "accel_build_s" => " s",
        "fps" => " per s",
        "mpaths_s" => " M/s",
        _ if name.starts_with("time_to") => " s",
        _ if name.starts_with("samples_to") => " samples",
        _ => "",
    }
}

/// Judges whether a value rises or falls over an axis.
fn trend(claim: &Claim, values: &NightValues) -> Result<Judgement, String> {
    let mut points = values.series(claim)?;
    if points.iter().any(|(_, value)| *value <= 0.0) {
        return Err("a value is not positive".to_owned());
    }
    points.iter_mut().for_each(|(_, value)| *value = value.ln());
    let slope = Estimate::of_slope(&points).ok_or("fewer than three values of the axis")?;
    let sign = if claim.test == Test::Rises { -1.0 } else { 1.0 };
    let mean = sign * slope.mean;
    let name = &claim.quantity(Side::A)?.name;
    let shown = format!("`{name}`: factor {:.3} per step", slope.mean.exp());
    Ok(Judgement::new(
        Estimate { mean, ..slope }.below_zero(),
        shown,
    ))
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests may panic")]

    use super::*;

    fn exact(numbers: &[f64]) -> Vec<RunValue> {
        numbers.iter().map(|x| RunValue::exact(*x)).collect()
    }

    fn close(x: f64, expected: f64) {
        assert!((x / expected - 1.0).abs() < 1e-9, "{x} {expected}");
    }

    /// Expected numbers are those of `scipy` 1.17: `ttest_1samp` and `linregress`.
    #[test]
    fn p_values_are_those_of_another_program() {
        let below = Estimate::of_mean(&[-0.31, -0.12, -0.45, -0.22, -0.28]).unwrap();
        let (verdict, p) = below.below_zero();
        close(p.unwrap(), 0.007055938045984197);
        assert_eq!(verdict, Verdict::Holds);

        let near = Estimate::of_mean(&[0.02, -0.03, 0.05, 0.01, -0.01]).unwrap();
        close(near.p_above(-0.1), 0.0006740854878849013);
        close(near.p_above(0.1), 0.9987664784245228);
        let (verdict, p) = near.between(-0.1, 0.1);
        close(p.unwrap(), 0.0012335215754771674);
        assert_eq!(verdict, Verdict::Holds);

        let far = Estimate::of_mean(&[0.32, 0.28, 0.35]).unwrap();
        close(far.p_above(0.1), 0.004322006091622284);
        assert_eq!(far.between(-0.1, 0.1).0, Verdict::TurnsAround);
        assert_eq!(far.between(0.29, 0.34).0, Verdict::Unjudged);

        let points = [
            (0.0, 1.0),
            (0.0, 1.3),
            (1.0, 1.5),
            (1.0, 1.9),
            (2.0, 2.2),
            (2.0, 2.1),
            (3.0, 2.9),
            (3.0, 3.3),
        ];
        let slope = Estimate::of_slope(&points).unwrap();
        close(slope.mean, 0.63);
        close(slope.error, 0.07371114795831997);
        let (verdict, p) = slope.below_zero();
        close(p.unwrap(), 0.00014072774255449773);
        assert_eq!(verdict, Verdict::TurnsAround);
        assert!(Estimate::of_slope(&points[..4]).is_none());
    }

    #[test]
    fn equal_differences_are_compared_without_a_test() {
        let same = |x: f64| Estimate::of_mean(&[x; 3]).unwrap();
        let verdicts = [-0.5, 0.0, 0.5].map(|x| same(x).below_zero().0);
        assert_eq!(
            verdicts,
            [Verdict::Holds, Verdict::Unjudged, Verdict::TurnsAround]
        );
        assert_eq!(same(1.0).between(0.5, 1.0).0, Verdict::Holds);
        assert_eq!(same(1.1).between(0.5, 1.0).0, Verdict::TurnsAround);
        assert!(Estimate::of_mean(&[1.0]).is_none());
    }

    #[test]
    fn a_claim_with_a_factor_can_hold_more_weakly() {
        let (a, b) = (exact(&[1.0, 1.1, 0.9, 1.0]), exact(&[2.0, 2.1, 1.9, 2.0]));
        let verdict = |factor| less(&a, &b, factor).unwrap().0;
        assert_eq!([1.5, 3.0].map(verdict), [Verdict::Holds, Verdict::Weaker]);
        assert_eq!(less(&b, &a, 3.0).unwrap().0, Verdict::TurnsAround);
        // Differences are compared if a number is 0.
        let zero = exact(&[0.0, 0.0, 0.0, 0.0]);
        assert_eq!(less(&zero, &a, 1.0).unwrap().0, Verdict::Holds);
    }

    #[test]
    fn bounds_are_not_used_where_they_prove_nothing() {
        let (a, b) = (exact(&[1.0, 1.1, 0.9]), exact(&[5.0, 5.2, 4.9]));
        let open = |values: &[RunValue], bound| -> Vec<RunValue> {
            values
                .iter()
                .map(|v| RunValue::bounded(v.number, bound))
                .collect()
        };
        let verdict = |a: &[RunValue], b: &[RunValue]| less(a, b, 1.0).unwrap().0;
        assert_eq!(verdict(&a, &open(&b, Bound::Lower)), Verdict::Holds);
        assert_eq!(verdict(&open(&a, Bound::Lower), &b), Verdict::Unjudged);
        assert_eq!(verdict(&open(&b, Bound::Lower), &a), Verdict::TurnsAround);
        assert_eq!(verdict(&b, &open(&a, Bound::Lower)), Verdict::Unjudged);
        assert!(equal(&a, &open(&b, Bound::Lower), 1.1).is_none());
        assert_eq!(equal(&a, &a, 1.1).unwrap().0, Verdict::Holds);
    }

    #[test]
    fn a_lag_is_where_the_correlation_is_largest() {
        let (early, late) = (
            [0.0, 1.0, 3.0, 1.0, 0.0, 0.0],
            [0.0, 0.0, 0.0, 1.0, 3.0, 1.0],
        );
        assert_eq!(
            [lag(&late, &early), lag(&early, &late)],
            [Some(2), Some(-2)]
        );
    }

    #[test]
    fn a_pattern_finds_files_in_any_folder() {
        let folder = tempfile::tempdir().unwrap();
        let run = folder.path().join("runs/technique=bpt/rep=0/films");
        std::fs::create_dir_all(&run).unwrap();
        std::fs::write(run.join("a.png"), "").unwrap();
        let has = |pattern: &str| has_file(folder.path(), &pattern.split('/').collect::<Vec<_>>());
        assert!(has("runs/**/films/a.png") && has("**/a.png") && has("runs/technique=b*/**/*.png"));
        assert!(!has("runs/**/b.png") && !has("runs/technique=c*/**/*.png") && !has("runs"));
    }
}
