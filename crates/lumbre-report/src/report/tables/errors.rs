//! Tables of errors and of times to reach an error.

use super::rates::SPEED;
use super::{empty_table, fill_table, mark_noise_floors, with_devices};
use crate::format;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::quantity::{self, RunValue, crossing};
use crate::repeats::MetricCurve;
use crate::report::study::{Member, ReportOptions, Study};
use crate::table::ranking::Ranking;
use crate::table::{Digits, Table, TableKind};
use lumbre_metrics::Better;
use lumbre_night::experiment::WaveRow;
use lumbre_night::experiment::night::run;
use lumbre_night::experiment::spec::TableValue;

/// Returns how values of a metric are ranked.
fn metric_ranking(study: &Study, metric: usize) -> Ranking {
    match study.metrics[metric].row.better {
        Better::NearZero => Ranking::Unranked,
        _ => Ranking::LowerError(MetricDisplay::for_metric(&study.metrics[metric])),
    }
}

/// Builds the table of a metric's final values.
pub(super) fn final_values(study: &Study, metric: usize) -> Table {
    let spec = &study.metrics[metric];
    let caption = format!(
        "{} at the end of each run. Mean over repeats.",
        format::metric_description(spec)
    );
    let table = Table {
        kind: TableKind::Final(metric),
        ..empty_table(
            study,
            spec.row.label,
            &format!("final-{}", spec.column),
            &format!("Final {}", spec.row.label),
            caption,
            &spec.unit(),
            Digits::Significant(4),
        )
    };
    let last = |_: usize, m: &Member| m.value(m.run.rows.last()?, metric);
    let mut table = fill_table(study, table, metric_ranking(study, metric), |facet, m| {
        last(facet, m).map(RunValue::exact)
    });
    mark_noise_floors(study, &mut table, metric, last);
    table
}

/// Builds the table of efficiency, the reciprocal of squared error times render time. For an
/// unbiased technique it does not depend on the render time [Veach 1997, 2.4.2]. The error of the
/// reference is subtracted if it is known. Returns `None` if no squared error is measured.
pub(super) fn efficiency(study: &Study) -> Option<Table> {
    let find = |name: &&str| study.metrics.iter().position(|m| m.row.name == *name);
    let metric = ["mse", "rmse", "relmse"].iter().find_map(find)?;
    let spec = &study.metrics[metric];
    let is_root = spec.row.name == "rmse";
    let error = if is_root {
        format!("square of {}", spec.row.label)
    } else {
        spec.row.label.to_owned()
    };
    let caption = format!(
        "1 / ({error} × render time) at the end of each run. The error of the reference is \
         subtracted if it is known. Mean over repeats."
    );
    let unit = if is_root {
        format!("({})²", spec.unit())
    } else {
        spec.unit()
    };
    let unit = if spec.unit().is_empty() {
        "1/s".to_owned()
    } else {
        format!("1/({unit} s)")
    };
    let table = empty_table(
        study,
        SPEED,
        "efficiency",
        "Efficiency",
        with_devices(study, &caption),
        &unit,
        Digits::Significant(3),
    );
    let mut table = fill_table(study, table, Ranking::HigherRate, |_, m| {
        let last = m.run.rows.last()?;
        let error = m.value(last, metric)?;
        let efficiency = |error: f64| {
            let squared = if is_root { error * error } else { error };
            run::efficiency(squared, last.render_s)
        };
        let [estimate, low, high] = m.run.net_errors(spec, error).map(efficiency);
        // An error that is not above the noise of the reference has no efficiency.
        let ends = [low, high].map(|end| end.unwrap_or(f64::NAN));
        Some(RunValue::at_each_noise([estimate?, ends[0], ends[1]]))
    });
    mark_noise_floors(study, &mut table, metric, |_, m| {
        m.value(m.run.rows.last()?, metric)
    });
    Some(table)
}

/// Returns the curve of a run's metric over render time.
fn curve_over_time(study: &Study, member: &Member, metric: usize) -> MetricCurve {
    let point = |row: &WaveRow| Some((row.render_s, member.value(row, metric)?));
    MetricCurve::new(
        MetricDisplay::for_metric(&study.metrics[metric]),
        member.run.rows.iter().filter_map(point),
    )
}

/// Returns the render time in seconds at which the runs of a facet are compared: that of the
/// options, or the longest that all finished runs reached.
pub(in crate::report) fn common_time(
    study: &Study,
    options: &ReportOptions,
    facet: usize,
) -> Option<f64> {
    options.at_time.or_else(|| {
        let finished = (0..study.series.len()).flat_map(|s| study.finished(facet, s));
        finished
            .filter_map(|m| Some(m.run.rows.last()?.render_s))
            .reduce(f64::min)
    })
}

/// Builds the table of a metric at equal render time.
pub(in crate::report) fn equal_time(
    study: &Study,
    options: &ReportOptions,
    metric: usize,
) -> Option<Table> {
    let spec = &study.metrics[metric];
    let times: Vec<Option<f64>> = (0..study.facets.len())
        .map(|f| common_time(study, options, f))
        .collect();
    times.iter().flatten().next()?;
    let subtracted = if spec.net(1.0, 0.5).is_some() {
        "The error of the reference is subtracted if it is known."
    } else {
        "The error of the reference is in the numbers, since it cannot be subtracted from this \
         metric."
    };
    let caption = format!(
        "{} after the render time in the row's label. Values between measurements are \
         interpolated linearly on the scales of the plots. {subtracted} Mean over repeats.",
        format::metric_description(spec)
    );
    let table = Table {
        kind: TableKind::EqualTime(metric),
        ..empty_table(
            study,
            spec.row.label,
            &format!("equal-time-{}", spec.column),
            &format!("{} at equal time", spec.row.label),
            with_devices(study, &caption),
            &spec.unit(),
            Digits::Significant(4),
        )
    };
    let display = MetricDisplay::for_metric(spec);
    let ranking = metric_ranking(study, metric);
    let at_time = |facet: usize, m: &Member| {
        let drawn = curve_over_time(study, m, metric).at(times[facet]?)?;
        Some(display.metric_value(drawn))
    };
    let mut table = fill_table(study, table, ranking, |facet, m| {
        let errors = m.run.net_errors(spec, at_time(facet, m)?);
        Some(RunValue::at_each_noise(errors))
    });
    mark_noise_floors(study, &mut table, metric, at_time);
    table.label_headers.push("time (s)".to_owned());
    for ((labels, _), time) in table.rows.iter_mut().zip(times) {
        labels.push(time.map_or("–".to_owned(), |t| format::significant(t, 3)));
    }
    Some(table)
}

/// Returns the drawn error at which the runs of a facet are compared: the largest final error of
/// any run, which all runs reach.
pub(in crate::report) fn common_error(study: &Study, facet: usize, metric: usize) -> Option<f64> {
    let finished = (0..study.series.len()).flat_map(|s| study.finished(facet, s));
    let last = |m: Member| {
        let curve = curve_over_time(study, &m, metric);
        curve.points.last().map(|p| p.1)
    };
    let finals = finished.filter_map(last);
    match MetricDisplay::for_metric(&study.metrics[metric]).scale {
        Scale::Log => finals.reduce(f64::max),
        Scale::Linear => finals.reduce(f64::min),
    }
}

/// Returns the time from which on a curve was at least as good as a drawn value.
fn reached(curve: &MetricCurve, drawn: f64, scale: Scale) -> Option<RunValue> {
    match scale {
        Scale::Log => crossing(&curve.points, drawn, |y| y <= drawn, f64::ln),
        Scale::Linear => crossing(&curve.points, drawn, |y| y >= drawn, |y| y),
    }
}

/// Builds the table of render times to an equal value of a metric.
pub(super) fn equal_error(study: &Study, metric: usize) -> Option<Table> {
    let spec = &study.metrics[metric];
    if matches!(spec.row.better, Better::NearZero) {
        return None;
    }
    let display = MetricDisplay::for_metric(spec);
    let errors: Vec<Option<f64>> = (0..study.facets.len())
        .map(|f| common_error(study, f, metric))
        .collect();
    errors.iter().flatten().next()?;
    let caption = format!(
        "Render time in seconds until {} reached the value in the row's label for good, which is \
         the worst final value of the row's runs. Times between measurements are interpolated. Mean \
         over repeats.",
        format::metric_description(spec)
    );
    let table = Table {
        kind: TableKind::EqualError(metric),
        ..empty_table(
            study,
            spec.row.label,
            &format!("equal-error-{}", spec.column),
            &format!("Time to equal {}", spec.row.label),
            with_devices(study, &caption),
            "s",
            Digits::Significant(3),
        )
    };
    let mut table = fill_table(study, table, Ranking::ShorterTime, |facet, m| {
        let curve = curve_over_time(study, m, metric);
        reached(&curve, errors[facet]?, display.scale)
    });
    table.label_headers.push(spec.row.label.to_owned());
    for ((labels, _), error) in table.rows.iter_mut().zip(errors) {
        labels.push(error.map_or("–".to_owned(), |e| {
            format::significant(display.metric_value(e), 4)
        }));
    }
    Some(table)
}

/// Builds the table of render times to a threshold of a metric.
pub(super) fn time_to(study: &Study, metric: usize, threshold: f64) -> Table {
    let spec = &study.metrics[metric];
    let sign = quantity::threshold_sign(spec.row.better);
    let caption = format!(
        "Render time in seconds until {} {sign} {threshold} for good. Times between measurements \
         are interpolated. Mean over repeats.",
        format::metric_description(spec)
    );
    let table = Table {
        kind: TableKind::TimeTo(metric),
        ..empty_table(
            study,
            spec.row.label,
            &format!("time-to-{}-{threshold}", spec.column),
            &format!("Time to {} {sign} {threshold}", spec.row.label),
            with_devices(study, &caption),
            "s",
            Digits::Significant(3),
        )
    };
    let value = TableValue::TimeTo {
        column: spec.column.clone(),
        threshold,
    };
    fill_table(study, table, Ranking::ShorterTime, |_, m| {
        study.run_value(&value, m)
    })
}
