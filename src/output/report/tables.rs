//! The tables of a report: sampling rates, times to a threshold, errors at equal time, times to equal error, final
//! values, and acceleration structures.
//!
//! A best value is in bold only where repeats say that it is best by more than chance: Welch's test of it against every
//! other value of its row and group, on logarithms where a metric is drawn so, all of them significant at 5 % with
//! Holm's correction.

use super::ReportError;
use super::curve::Curve;
use super::grid::{Digits, Entry, Grid};
use super::item::{Item, Provenance};
use super::study::{Member, Options, Shown, Study};
use crate::experiment::WaveRow;
use crate::math::student::{mean_and_interval, welch_p};
use crate::metrics::Better;
use crate::output::labels;
use crate::output::plot::axis::Scale;

/// Significance of bold values.
const ALPHA: f64 = 0.05;

/// What bold and ± mean, at the end of captions; the page says it once.
pub(super) const TEST: &str = "Bold: best of its row and group, significant at 5 % against every other (Welch's test over repeats, \
                    Holm's correction). ± is the half width of the 95 % confidence interval of the mean.";

/// One run's contribution.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Sample {
    /// A value.
    Is(f64),
    /// It is larger than this.
    MoreThan(f64),
}

/// Which values are better, and how they are compared.
#[derive(Clone, Copy)]
enum Order {
    /// None is.
    No,
    /// Smaller ones, compared as they are drawn.
    Lower(Shown),
    /// Larger positive ones, compared by logarithms.
    Higher,
    /// Smaller positive ones, compared by logarithms.
    Sooner,
}

/// Every table that the study has data for.
pub fn all(study: &Study, options: &Options, notes: &mut Vec<String>) -> Result<Vec<Item>, ReportError> {
    let mut grids = vec![rates(study)];
    grids.extend(relative_rates(study));
    for metric in 0..study.metrics.len() {
        grids.push(final_values(study, metric));
    }
    grids.extend(efficiency(study));
    for metric in 0..study.metrics.len() {
        grids.extend(equal_time(study, options, metric));
        grids.extend(equal_error(study, metric));
    }
    for (column, threshold) in thresholds(study, options)? {
        let metric = study.metrics.iter().position(|m| m.column == column).unwrap_or(0);
        grids.push(time_to(study, metric, threshold));
    }
    grids.extend(structures(study));
    let unfinished = study.all().filter(|m| !m.run.done()).count();
    if unfinished > 0 {
        notes.push(format!("{unfinished} of {} runs have not finished; tables leave them out", study.all().count()));
    }
    let filled = |grid: &Grid| grid.rows.iter().flat_map(|(_, e)| e).any(|e| e.value.is_some());
    Ok(grids.into_iter().filter(filled).map(Grid::item).collect())
}

/// The thresholds that were asked for, and 0.95 for SSIM as in the first source.
fn thresholds(study: &Study, options: &Options) -> Result<Vec<(String, f64)>, ReportError> {
    let known = |column: &String| study.metrics.iter().any(|m| m.column == *column);
    let mut wanted = options.thresholds.clone();
    if let Some((column, _)) = wanted.iter().find(|(column, _)| !known(column)) {
        let all: Vec<&str> = study.metrics.iter().map(|m| m.column.as_str()).collect();
        return Err(ReportError::NoColumn { column: column.clone(), known: all.join(", ") });
    }
    for metric in study.metrics.iter().filter(|m| m.row.name == "ssim") {
        if !wanted.iter().any(|(column, _)| *column == metric.column) {
            wanted.push((metric.column.clone(), 0.95));
        }
    }
    Ok(wanted)
}

/// An empty table over facets and series.
fn frame(study: &Study, name: &str, title: &str, caption: String, unit: &str, digits: Digits) -> Grid {
    let groups = study.groups();
    let span = |group: &String| study.series.iter().filter(|s| s.group == *group).count();
    Grid {
        name: name.to_owned(),
        title: title.to_owned(),
        caption,
        unit: unit.to_owned(),
        corner: study.facet_axes.clone(),
        groups: groups.iter().map(|group| (group.clone(), span(group))).collect(),
        columns: study.series.iter().map(|s| s.label.clone()).collect(),
        rows: Vec::new(),
        digits,
        provenance: Provenance::of(study.all().filter(|m| m.run.done())),
    }
}

/// Fills a table with the mean over finished repeats of what `value` says of each.
fn fill(study: &Study, mut grid: Grid, order: Order, value: impl Fn(usize, &Member) -> Option<Sample>) -> Grid {
    for facet in 0..study.facets.len() {
        let (mut samples, mut entries): (Vec<Vec<Sample>>, Vec<Entry>) = Default::default();
        let mut complete = Vec::new();
        for series in 0..study.series.len() {
            let members = study.members(facet, series);
            let finished = || members.iter().filter(|m| m.run.done());
            let (of, values): (Vec<String>, Vec<Sample>) =
                finished().filter_map(|m| Some((m.run.id.clone(), value(facet, m)?))).unzip();
            complete.push(values.len() == finished().count());
            entries.push(Entry { of, ..entry(&values) });
            samples.push(values);
        }
        let mut first = 0;
        for (_, span) in &grid.groups {
            // What ran and has no value here may have been better.
            let known = complete[first..first + span].iter().all(|all| *all);
            if let Some(best) = best(&samples[first..first + span], order).filter(|_| known) {
                entries[first + best].best = true;
            }
            first += span;
        }
        grid.rows.push((study.facets[facet].clone(), entries));
    }
    if grid.rows.iter().flat_map(|(_, e)| e).any(|e| e.runs > 1) && !matches!(order, Order::No) {
        grid.caption += " ";
        grid.caption += TEST;
    }
    if grid.rows.iter().flat_map(|(_, e)| e).any(|e| e.more) {
        grid.caption += " `> t`: not reached within t seconds.";
    }
    grid
}

fn entry(samples: &[Sample]) -> Entry {
    let values: Vec<f64> = samples
        .iter()
        .map(|s| match s {
            Sample::Is(x) | Sample::MoreThan(x) => *x,
        })
        .collect();
    if values.is_empty() {
        return Entry::default();
    }
    let (mean, half) = mean_and_interval(&values);
    let more = samples.iter().any(|s| matches!(s, Sample::MoreThan(_)));
    Entry { value: Some(mean), more, half: half.filter(|h| h.is_finite()), runs: values.len(), ..Entry::default() }
}

/// The best of several samples, if it is so by more than chance.
fn best(samples: &[Vec<Sample>], order: Order) -> Option<usize> {
    let drawn = |sample: &Sample| -> Option<f64> {
        let Sample::Is(x) = sample else { return None };
        match order {
            Order::No => None,
            Order::Lower(shown) => shown.value(*x).map(|y| if shown.scale == Scale::Log { y.ln() } else { -y }),
            Order::Higher => (*x > 0.0).then(|| -x.ln()),
            Order::Sooner => (*x > 0.0).then(|| x.ln()),
        }
    };
    // A sample that has no number, or is only known to be larger, cannot be tested against.
    let read = |list: &Vec<Sample>| -> Option<Vec<f64>> { list.iter().map(drawn).collect() };
    let columns: Vec<(usize, Vec<f64>)> = samples
        .iter()
        .enumerate()
        .filter(|(_, list)| !list.is_empty())
        .filter_map(|(i, l)| Some((i, read(l)?)))
        .collect();
    if columns.len() < 2 {
        return None;
    }
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let (first, own) = columns.iter().min_by(|a, b| mean(&a.1).total_cmp(&mean(&b.1)))?;
    let mut p: Vec<f64> = columns.iter().filter(|(i, _)| i != first).map(|(_, other)| welch_p(own, other)).collect();
    p.sort_by(f64::total_cmp);
    let tests = p.len();
    p.iter().enumerate().all(|(i, p)| *p <= ALPHA / (tests - i) as f64).then_some(*first)
}

fn with_clock(study: &Study, text: &str) -> String {
    match study.clock() {
        clock if clock.is_empty() => format!("{text}."),
        clock => format!("{text}; {clock}."),
    }
}

/// As table 5.2 of the first source.
fn rates(study: &Study) -> Grid {
    let text = "Samples of every pixel per second of render time (FPS: one sample of every pixel is a frame), mean over \
                repeats";
    let grid = frame(study, "fps-absolute", "Sampling rate", with_clock(study, text), "1/s", Digits::Significant(4));
    fill(study, grid, Order::Higher, |_, m| m.run.samples_per_s().map(Sample::Is))
}

/// As table 5.3 of the first source: devices relative to the first one, or, of one device, series relative to the first.
fn relative_rates(study: &Study) -> Option<Grid> {
    let groups = study.groups();
    let absolute = rates(study);
    let of = |label: &str, group: &str| study.series.iter().position(|s| s.label == label && s.group == group);
    // Pairs of columns: numerator and denominator.
    let (mut heads, mut columns, mut pairs) = (Vec::new(), Vec::new(), Vec::new());
    let text = if groups.len() > 1 {
        let base = &groups[0];
        for group in &groups[1..] {
            let shared: Vec<(&str, usize, usize)> = study
                .series
                .iter()
                .filter(|s| s.group == *group)
                .filter_map(|s| Some((s.label.as_str(), of(&s.label, group)?, of(&s.label, base)?)))
                .collect();
            heads.push((format!("{group} / {base}"), shared.len()));
            columns.extend(shared.iter().map(|(label, ..)| (*label).to_owned()));
            pairs.extend(shared.iter().map(|(_, a, b)| (*a, *b)));
        }
        with_clock(study, &format!("Sampling rate of each device relative to that of {base}, same technique"))
    } else if study.series.len() > 1 {
        heads.push((String::new(), study.series.len()));
        columns = study.series.iter().map(|s| s.label.clone()).collect();
        pairs = (0..study.series.len()).map(|s| (s, 0)).collect();
        with_clock(study, &format!("Sampling rate relative to that of {}", study.series[0].label))
    } else {
        return None;
    };
    heads.retain(|(_, span)| *span > 0);
    let mut grid = frame(study, "fps-relative", "Relative sampling rate", text, "1", Digits::Percent);
    (grid.groups, grid.columns) = (heads, columns);
    grid.rows = absolute
        .rows
        .iter()
        .map(|(labels, entries)| {
            let ratio = |(a, b): &(usize, usize)| {
                let value = entries[*a].value.zip(entries[*b].value).map(|(a, b)| a / b);
                let of = [entries[*a].of.clone(), entries[*b].of.clone()].concat();
                Entry { value, runs: entries[*a].runs.min(entries[*b].runs), of, ..Entry::default() }
            };
            (labels.clone(), pairs.iter().map(ratio).collect())
        })
        .collect();
    Some(grid)
}

fn order_of(study: &Study, metric: usize) -> Order {
    match study.metrics[metric].row.better {
        Better::NearZero => Order::No,
        _ => Order::Lower(Shown::of(&study.metrics[metric])),
    }
}

fn described(study: &Study, metric: usize) -> String {
    let spec = &study.metrics[metric];
    let options = spec.describe_options();
    let options = if options.is_empty() { String::new() } else { format!(" with {options}") };
    labels::metric_title(spec) + &options
}

fn final_values(study: &Study, metric: usize) -> Grid {
    let spec = &study.metrics[metric];
    let caption = format!("{} when each run stopped, mean over repeats.", described(study, metric));
    let title = format!("Final {}", spec.row.label);
    let digits = Digits::Significant(4);
    let grid = frame(study, &format!("final-{}", spec.column), &title, caption, &spec.unit(), digits);
    fill(study, grid, order_of(study, metric), |_, m| Some(Sample::Is(m.value(m.run.rows.last()?, metric)?)))
}

/// What a second of each technique is worth: the reciprocal of squared error times render time, which stays the same
/// however long an unbiased technique runs [Veach 1997, 2.4.2]. The reference's own error is taken off where it is known.
fn efficiency(study: &Study) -> Option<Grid> {
    let named = |name: &&str| study.metrics.iter().position(|m| m.row.name == *name);
    let metric = ["mse", "rmse", "relmse"].iter().find_map(named)?;
    let spec = &study.metrics[metric];
    let square = spec.row.name == "rmse";
    let what = if square { format!("square of {}", spec.row.label) } else { spec.row.label.to_owned() };
    let text = format!(
        "Efficiency: 1 / ({what} × render time) when each run stopped, without the reference's own error where that is \
         known, mean over repeats"
    );
    let unit = if square { format!("({})²", spec.unit()) } else { spec.unit() };
    let unit = if spec.unit().is_empty() { "1/s".to_owned() } else { format!("1/({unit} s)") };
    let grid = frame(study, "efficiency", "Efficiency", with_clock(study, &text), &unit, Digits::Significant(3));
    Some(fill(study, grid, Order::Higher, |_, m| {
        let last = m.run.rows.last()?;
        let error = m.value(last, metric)?;
        let floor = m.run.floors.iter().find(|(column, _)| *column == spec.column).map(|(_, floor)| *floor);
        let error = floor.and_then(|floor| spec.net(error, floor)).unwrap_or(error);
        let error = if square { error * error } else { error };
        Some(1.0 / (error * last.render_s)).filter(|e| e.is_finite() && *e > 0.0).map(Sample::Is)
    }))
}

/// A run's curve of a metric over render time.
pub(super) fn over_time(study: &Study, member: &Member, metric: usize) -> Curve {
    let point = |row: &WaveRow| Some((row.render_s, member.value(row, metric)?));
    Curve::new(Shown::of(&study.metrics[metric]), member.run.rows.iter().filter_map(point))
}

/// The render time at which a facet's runs are compared: as asked for, or the longest that all its finished runs reached.
pub(super) fn common_time(study: &Study, options: &Options, facet: usize) -> Option<f64> {
    options.at_time.or_else(|| {
        let members = (0..study.series.len()).flat_map(|s| study.members(facet, s));
        members.filter(|m| m.run.done()).filter_map(|m| Some(m.run.rows.last()?.render_s)).reduce(f64::min)
    })
}

fn equal_time(study: &Study, options: &Options, metric: usize) -> Option<Grid> {
    let spec = &study.metrics[metric];
    let times: Vec<Option<f64>> = (0..study.facets.len()).map(|f| common_time(study, options, f)).collect();
    times.iter().flatten().next()?;
    let text = format!(
        "{} after the same render time, which is in the second last label column, read between measurements on straight \
         lines as drawn, mean over repeats",
        described(study, metric)
    )
    .replace("which is in the second last label column", "which the row names");
    let title = format!("{} at equal time", spec.row.label);
    let name = format!("equal-time-{}", spec.column);
    let grid = frame(study, &name, &title, with_clock(study, &text), &spec.unit(), Digits::Significant(4));
    let shown = Shown::of(spec);
    let mut grid = fill(study, grid, order_of(study, metric), |facet, m| {
        Some(Sample::Is(shown.back(over_time(study, m, metric).at(times[facet]?)?)))
    });
    grid.corner.push("time (s)".to_owned());
    for ((labels, _), time) in grid.rows.iter_mut().zip(times) {
        labels.push(time.map_or("–".to_owned(), |t| labels::significant(t, 3)));
    }
    Some(grid)
}

/// The error that a facet's runs are compared at: the largest at which one of them ended, so that all reach it.
pub(super) fn common_error(study: &Study, facet: usize, metric: usize) -> Option<f64> {
    let members = (0..study.series.len()).flat_map(|s| study.members(facet, s));
    let last = |m: Member| over_time(study, &m, metric).points.last().map(|p| p.1);
    let finals = members.filter(|m| m.run.done()).filter_map(last);
    match Shown::of(&study.metrics[metric]).scale {
        Scale::Log => finals.reduce(f64::max),
        Scale::Linear => finals.reduce(f64::min),
    }
}

/// When a curve first was at least as good as a drawn value.
fn first_at(curve: &Curve, drawn: f64, scale: Scale) -> Option<f64> {
    let good = |(_, y): &&(f64, f64)| if scale == Scale::Log { *y <= drawn } else { *y >= drawn };
    curve.points.iter().find(good).map(|p| p.0)
}

fn equal_error(study: &Study, metric: usize) -> Option<Grid> {
    let spec = &study.metrics[metric];
    if matches!(spec.row.better, Better::NearZero) {
        return None;
    }
    let shown = Shown::of(spec);
    let errors: Vec<Option<f64>> = (0..study.facets.len()).map(|f| common_error(study, f, metric)).collect();
    errors.iter().flatten().next()?;
    let text = format!(
        "Render time in seconds until a measurement first had the {} that the row names, the worst at which one of the \
         row's runs ended, mean over repeats",
        described(study, metric)
    );
    let (name, title) = (format!("equal-error-{}", spec.column), format!("Time to equal {}", spec.row.label));
    let grid = frame(study, &name, &title, with_clock(study, &text), "s", Digits::Significant(3));
    let mut grid = fill(study, grid, Order::Sooner, |facet, m| {
        let curve = over_time(study, m, metric);
        Some(match first_at(&curve, errors[facet]?, shown.scale) {
            Some(time) => Sample::Is(time),
            None => Sample::MoreThan(curve.span()?.1),
        })
    });
    grid.corner.push(spec.row.label.to_owned());
    for ((labels, _), error) in grid.rows.iter_mut().zip(errors) {
        labels.push(error.map_or("–".to_owned(), |e| labels::significant(shown.back(e), 4)));
    }
    Some(grid)
}

fn time_to(study: &Study, metric: usize, threshold: f64) -> Grid {
    let spec = &study.metrics[metric];
    let sign = match spec.row.better {
        Better::Lower => "≤",
        Better::Higher => "≥",
        Better::NearZero => "of either sign ≤",
    };
    let text = format!(
        "Render time in seconds until a measurement first had {} {sign} {threshold}, mean over repeats",
        described(study, metric)
    );
    let title = format!("Time to {} {sign} {threshold}", spec.row.label);
    let name = format!("time-to-{}-{threshold}", spec.column);
    let grid = frame(study, &name, &title, with_clock(study, &text), "s", Digits::Significant(3));
    fill(study, grid, Order::Sooner, |_, m| {
        let reached = |row: &&WaveRow| match (m.value(row, metric), spec.row.better) {
            (Some(x), Better::Lower) => x <= threshold,
            (Some(x), Better::Higher) => x >= threshold,
            (Some(x), Better::NearZero) => x.abs() <= threshold,
            (None, _) => false,
        };
        m.value(m.run.rows.first()?, metric)?;
        Some(match m.run.rows.iter().find(reached) {
            Some(row) => Sample::Is(row.render_s),
            None => Sample::MoreThan(m.run.rows.last()?.render_s),
        })
    })
}

/// Build time of acceleration structures against the rate at which rays were traced through them, as tables 4.2 and
/// 5.1 of the second source. Rates count all time inside the renderer, shading included.
fn structures(study: &Study) -> Option<Grid> {
    let text = "Acceleration structures: nodes, milliseconds to build them (least over runs), and million rays per \
                second of render time, shading included, mean over repeats";
    let mut grid = frame(study, "bvh", "Acceleration structures", with_clock(study, text), "", Digits::Significant(4));
    let groups = study.groups();
    let (mut heads, mut columns) = (Vec::new(), Vec::new());
    for group in &groups {
        let own: Vec<&str> = study.series.iter().filter(|s| s.group == *group).map(|s| s.label.as_str()).collect();
        heads.push((group.clone(), own.len() + 2));
        columns.extend(["nodes", "build (ms)"].map(str::to_owned));
        columns.extend(own.iter().map(|label| format!("{label} (Mrays/s)")));
    }
    (grid.groups, grid.columns) = (heads, columns);
    for facet in 0..study.facets.len() {
        let mut entries = Vec::new();
        for group in &groups {
            let own = || (0..study.series.len()).filter(|s| study.series[*s].group == *group);
            let accel: Vec<(f64, u64)> =
                own().flat_map(|s| study.members(facet, s)).filter_map(|m| m.run.accel).filter(|a| a.1 > 0).collect();
            let one = |value: Option<f64>| Entry { value, runs: accel.len(), ..Entry::default() };
            entries.push(one(accel.iter().map(|a| a.1 as f64).reduce(f64::max)));
            entries.push(one(accel.iter().map(|a| a.0 * 1e3).reduce(f64::min)));
            for series in own() {
                let members = study.members(facet, series);
                let finished = members.iter().filter(|m| m.run.done());
                let (of, rates): (Vec<String>, Vec<Sample>) =
                    finished.filter_map(|m| Some((m.run.id.clone(), Sample::Is(m.run.mrays_per_s()?)))).unzip();
                entries.push(Entry { of, ..entry(&rates) });
            }
        }
        grid.rows.push((study.facets[facet].clone(), entries));
    }
    Some(grid)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is(values: &[f64]) -> Vec<Sample> {
        values.iter().map(|v| Sample::Is(*v)).collect()
    }

    #[test]
    fn bold_needs_more_than_chance_against_every_other() {
        let clear = [is(&[1.0, 1.01, 0.99]), is(&[2.0, 2.02, 1.98]), is(&[3.0, 3.1, 2.9])];
        assert_eq!(best(&clear, Order::Sooner), Some(0));
        assert_eq!(best(&clear, Order::Higher), Some(2));
        assert_eq!(best(&clear, Order::No), None);
        let close = [is(&[1.0, 1.01, 0.99]), is(&[1.0, 1.02, 0.985]), is(&[3.0, 3.1, 2.9])];
        assert_eq!(best(&close, Order::Sooner), None, "the second is as good");
        assert_eq!(best(&[is(&[1.0]), is(&[9.0])], Order::Sooner), None, "one run each says nothing");
        assert_eq!(best(&[is(&[1.0, 1.1])], Order::Sooner), None, "there is nothing to be better than");
    }

    #[test]
    fn a_mean_with_a_run_that_never_arrived_is_a_bound() {
        let entry = entry(&[Sample::Is(1.0), Sample::MoreThan(3.0)]);
        assert!(entry.more && entry.value == Some(2.0) && entry.runs == 2);
        assert_eq!(super::entry(&[]), Entry::default());
    }
}
