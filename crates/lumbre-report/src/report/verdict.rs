//! The answer of a study in short: which series is best at equal render time, for every facet and
//! metric, and what weakens the answer. Everything is read from the report's tables.

use std::collections::BTreeSet;
use std::ops::Range;

use super::Pictures;
use super::item::ReportItem;
use super::study::{ReportOptions, Study};
use super::tables::equal_time;
use crate::clock;
use crate::common_error;
use crate::comparison::{Contrast, LEVEL};
use crate::format::significant;
use crate::lanes;
use crate::metric_display::MetricDisplay;
use crate::plot::axis::Scale;
use crate::provenance::Provenance;
use crate::quantity::Bound;
use crate::table::markdown::markdown_table;
use crate::table::{Table, TableCell, TableKind};
use lumbre_night::experiment::spec::Order;
use lumbre_night::text::visible;

/// Number of repeats below which a test over repeats rarely finds a difference.
const FEW_REPEATS: usize = 3;

/// The best series of one facet by one metric.
#[derive(Clone, Debug, PartialEq)]
pub struct Winner {
    /// Index in the study of the series with the best mean.
    pub series: usize,
    /// Label of that series.
    pub label: String,
    /// Whether it is significantly better than every other one.
    pub is_significant: bool,
    /// The next best error divided by this one's; `None` for metrics without a logarithmic scale.
    pub ratio: Option<f64>,
    /// Comparison with the next best; `None` if they could not be compared.
    pub contrast: Option<Contrast>,
    /// Whether it would be significantly best, if the mean of the errors themselves confirmed it.
    pub unconfirmed: bool,
}

impl Winner {
    /// Returns the 95 % interval of the ratio and its p-value, such as ` (95 %: 1.8 to 3.1, p =
    /// 0.004)`; empty if they are not known.
    fn certainty(&self) -> String {
        let contrast = self.contrast.filter(|_| self.ratio.is_some());
        let certainty = |contrast: Contrast| {
            let [low, high] = contrast.ratio_interval()?.map(|end| significant(end, 2));
            Some(format!(
                " (95 %: {low} to {high}, p = {})",
                significant(contrast.p, 2)
            ))
        };
        contrast.and_then(certainty).unwrap_or_default()
    }

    /// Formats the winner, such as `bdpt (2.3x)`, or says that there is none.
    pub fn text(&self) -> String {
        match (self.is_significant, self.ratio) {
            (false, _) => "no clear winner".to_owned(),
            (true, Some(ratio)) => format!("{} ({}×)", self.label, significant(ratio, 2)),
            (true, None) => self.label.clone(),
        }
    }
}

/// The winners of all facets by one metric among the series of one group.
#[derive(Clone, Debug, PartialEq)]
pub struct Column {
    /// Name of the metric, with the group if there are several.
    pub heading: String,
    /// Winner of each facet; `None` where fewer than two series can be compared.
    pub winners: Vec<Option<Winner>>,
}

/// Answer of a study.
#[derive(Clone, Debug, Default)]
pub struct Verdict {
    /// Warnings of biased references, and one sentence for every column.
    pub sentences: Vec<String>,
    /// Labels of the facets, with the render time of the comparison.
    pub rows: Vec<String>,
    /// Winners by metric.
    pub columns: Vec<Column>,
    /// Sentences on what weakens the answer.
    pub caveats: Vec<String>,
}

impl Verdict {
    /// Reads the answer from the report's tables. Without two series it has no columns.
    pub fn new(study: &Study, items: &[ReportItem], pictures: &Pictures) -> Verdict {
        let tables: Vec<&Table> = items.iter().filter_map(|i| i.table.as_deref()).collect();
        let mut verdict = Verdict::default();
        for metric in 0..study.metrics.len() {
            let kind = TableKind::EqualTime(metric);
            let Some(table) = tables.iter().find(|table| table.kind == kind) else {
                continue;
            };
            let columns = columns(study, metric, table);
            if columns.is_empty() || is_root_of_shown(study, metric) {
                continue;
            }
            verdict.rows = row_labels(study, table);
            verdict.columns.extend(columns);
        }
        let mut sentences: Vec<String> = verdict.columns.iter().map(sentence).collect();
        if !sentences.is_empty() {
            sentences.splice(0..0, study.biased_references());
        }
        verdict.sentences = sentences;
        verdict.caveats = verdict.columns.iter().filter_map(unconfirmed).collect();
        verdict
            .caveats
            .extend(common_errors(study, &verdict.columns, pictures));
        verdict.caveats.extend(caveats(study, &tables));
        verdict
    }

    /// Converts the answer to an item of the report with a Markdown file. Returns `None` if nothing
    /// is compared.
    pub fn item(&self, study: &Study) -> Option<ReportItem> {
        if self.columns.is_empty() {
            return None;
        }
        let mut header = vec![String::new()];
        let heading = |c: &Column| visible(&c.heading.replace('|', "\\|")).into_owned();
        header.extend(self.columns.iter().map(heading));
        let row = |facet: usize| {
            let mut fields = vec![self.rows[facet].clone()];
            let winner = |column: &Column| match &column.winners[facet] {
                Some(winner) if winner.is_significant => format!("**{}**", winner.text()),
                Some(winner) => winner.text(),
                None => "–".to_owned(),
            };
            fields.extend(self.columns.iter().map(winner));
            fields
                .iter()
                .map(|field| field.replace(['\n', '\r'], " "))
                .map(|field| visible(&field.replace('|', "\\|")).into_owned())
                .collect()
        };
        let rows: Vec<Vec<String>> = (0..self.rows.len()).map(row).collect();
        let sentences = self.sentences.join("\n");
        let caveats: String = self.caveats.iter().map(|c| format!("- {c}\n")).collect();
        let winners = markdown_table(&header, &rows, 1);
        let provenance = Provenance::from_members(study.all().filter(|m| m.run.is_done()));
        let origin = provenance.markup_comment();
        let text = format!("{sentences}\n\n{winners}\n{EXPLANATION}\n\n{caveats}\n{origin}");
        let files = vec![("md", text.into_bytes())];
        let caption = self.sentences.join(" ");
        Some(ReportItem::data(
            "verdict", "Answer", caption, files, provenance,
        ))
    }
}

/// Returns the answer of a study in short: one sentence for every metric by which series can be
/// compared, as the first ones of its report after warnings.
pub fn answer(study: &Study, options: &ReportOptions) -> Vec<String> {
    if study.series.len() < 2 {
        return Vec::new();
    }
    let of_metric = |metric: usize| {
        let table = equal_time(study, options, metric)?;
        Some(columns(study, metric, &table))
    };
    let metrics = (0..study.metrics.len()).filter(|metric| !is_root_of_shown(study, *metric));
    let columns = metrics.filter_map(of_metric).flatten();
    let compared = columns.filter(|column| column.winners.iter().any(Option::is_some));
    compared.map(|column| sentence(&column)).collect()
}

/// Explanation of the table of winners.
pub const EXPLANATION: &str = "The best mean at equal render time, where it is significantly \
    better than every other: together all claims of a row are false in at most 5 % of nights. In \
    parentheses: the next best error divided by it.";

/// Returns whether a metric is the root of another one that is shown: it has the same winners.
pub(super) fn is_root_of_shown(study: &Study, metric: usize) -> bool {
    study.metrics[metric].row.name == "mse" && study.metrics.iter().any(|m| m.row.name == "rmse")
}

/// Returns the labels of the rows of a table: facet and render time.
fn row_labels(study: &Study, table: &Table) -> Vec<String> {
    let label = |(facet, (labels, _)): (usize, &(Vec<String>, Vec<TableCell>))| {
        let time = labels.last().map_or("–", String::as_str);
        match study.facet_label(facet).as_str() {
            "" => format!("after {time} s"),
            facet => format!("{facet}, after {time} s"),
        }
    };
    table.rows.iter().enumerate().map(label).collect()
}

/// Returns one column of winners for each group of series with at least two of them; none for a
/// metric that does not rank.
fn columns(study: &Study, metric: usize, table: &Table) -> Vec<Column> {
    let spec = &study.metrics[metric];
    let display = MetricDisplay::for_metric(spec);
    if display.is_magnitude() {
        return Vec::new();
    }
    let mut first = 0;
    let mut columns = Vec::new();
    for (group, span) in &table.groups {
        let range = first..first + span;
        first += span;
        if *span < 2 {
            continue;
        }
        let winner = |(_, cells): &(Vec<String>, Vec<TableCell>)| {
            winner(display, range.clone(), &table.columns, cells)
        };
        let heading = match group.as_str() {
            "" => spec.row.label.to_owned(),
            group => format!("{} ({group})", spec.row.label),
        };
        columns.push(Column {
            heading,
            winners: table.rows.iter().map(winner).collect(),
        });
    }
    columns
}

/// Returns the best of the cells of one row among the series of a group.
fn winner(
    display: MetricDisplay,
    group: Range<usize>,
    labels: &[String],
    cells: &[TableCell],
) -> Option<Winner> {
    let scored = group.filter_map(|series| {
        let cell = &cells[series];
        let drawn = display.drawn_value(cell.value?)?;
        let score = if display.scale == Scale::Log {
            drawn
        } else {
            -drawn
        };
        Some((score, series, cell))
    });
    let mut scored: Vec<(f64, usize, &TableCell)> = scored.collect();
    scored.sort_by(|a, b| a.0.total_cmp(&b.0));
    let [first, second, ..] = scored.as_slice() else {
        return None;
    };
    let contrasts = || scored.iter().filter_map(|(_, _, cell)| cell.contrast);
    let leads = contrasts().all(|contrast| contrast.p < LEVEL);
    Some(Winner {
        series: first.1,
        label: labels[first.1].clone(),
        is_significant: first.2.best,
        ratio: (display.scale == Scale::Log).then(|| second.0 / first.0),
        contrast: second.2.contrast,
        unconfirmed: leads && !first.2.best && contrasts().any(|c| !c.is_confirmed()),
    })
}

/// Returns how often each series is best, most often first.
fn sentence(column: &Column) -> String {
    let compared: Vec<&Winner> = column.winners.iter().flatten().collect();
    let mut counts: Vec<(&str, usize)> = Vec::new();
    for winner in compared.iter().filter(|w| w.is_significant) {
        match counts.iter_mut().find(|(label, _)| *label == winner.label) {
            Some((_, count)) => *count += 1,
            None => counts.push((&winner.label, 1)),
        }
    }
    counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
    let heading = &column.heading;
    let total = compared.len();
    match (total, counts.as_slice()) {
        (0, _) => format!("{heading} at equal time: nothing can be compared."),
        (1, [(label, _)]) => {
            let ratio = compared[0].ratio.map_or(String::new(), |ratio| {
                format!(
                    "; the next best is {} times as large{}",
                    significant(ratio, 2),
                    compared[0].certainty()
                )
            });
            format!("{heading} at equal time: {label} is significantly best{ratio}.")
        }
        (_, []) => format!(
            "{heading} at equal time: no series is significantly better than every other{}.",
            if total > 1 { " in any row" } else { "" }
        ),
        (_, [(label, count), others @ ..]) => {
            let mut text = format!(
                "{heading} at equal time: {label} is significantly best in {count} of {total} rows"
            );
            for (label, count) in others {
                text += &format!(", {label} in {count}");
            }
            let open = total - counts.iter().map(|(_, count)| count).sum::<usize>();
            if open > 0 {
                let verb = if open == 1 { "has" } else { "have" };
                text += &format!("; {open} {verb} no clear winner");
            }
            text + "."
        }
    }
}

/// Returns a sentence if a winner is not named because the mean of the errors does not confirm it.
fn unconfirmed(column: &Column) -> Option<String> {
    let winners = column.winners.iter().flatten();
    let labels: BTreeSet<&str> = winners
        .filter(|w| w.unconfirmed)
        .map(|w| &*w.label)
        .collect();
    (!labels.is_empty()).then(|| {
        let labels: Vec<&str> = labels.into_iter().collect();
        format!(
            "{}: {} leads in a typical run, but not in the mean over runs: a few runs have most of \
             the error, as where a light is found by few paths. No winner is named; more repeats or \
             time would tell.",
            column.heading,
            labels.join(", ")
        )
    })
}

/// Returns a sentence if runs of series that lead have most of their error in common.
fn common_errors(study: &Study, columns: &[Column], pictures: &Pictures) -> Option<String> {
    let winners = columns
        .iter()
        .flat_map(|column| column.winners.iter().enumerate());
    let leading = winners.filter_map(|(facet, winner)| {
        let winner = winner.as_ref().filter(|winner| winner.is_significant)?;
        Some((winner.series, facet))
    });
    let has_common_error = |series: usize, facet: usize| {
        let finished = study.finished(facet, series);
        let night = finished.first().map(|member| member.night);
        night.is_some_and(|night| {
            let runs = finished.iter().filter(|m| std::ptr::eq(m.night, night));
            common_error::exceeds_noise(night, runs.map(|m| m.run), |path| {
                pictures(path, None).ok()
            })
        })
    };
    let mut labels: Vec<String> = Vec::new();
    for (series, facet) in leading.collect::<BTreeSet<_>>() {
        let label = &study.series[series].label;
        if labels.last() != Some(label) && has_common_error(series, facet) {
            labels.push(label.clone());
        }
    }
    common_error::caveat(&labels)
}

/// Returns a sentence if some series traced one path at a time and others many.
fn mixed_lanes(study: &Study) -> Option<String> {
    let series = study.series.iter().enumerate();
    lanes::mixed_lanes(series.filter_map(|(index, series)| {
        let facets = 0..study.facets.len();
        let mut runs = facets.flat_map(|facet| study.members(facet, index));
        let known = runs.find(|member| member.run.lanes.is_some())?;
        Some((series.label.as_str(), known.run))
    }))
}

/// Returns sentences on the clocks of the study's runs, where other work disturbed them.
pub fn clocks(study: &Study) -> Vec<String> {
    let series = study.series.iter().enumerate();
    let runs = series.flat_map(|(index, series)| {
        let facets = 0..study.facets.len();
        let finished = facets.flat_map(move |facet| study.finished(facet, index));
        finished.map(move |member| (series.label.as_str(), member.run.lost_share))
    });
    let orders = study.nights.iter().map(|night| night.plan.order.as_str());
    let order = orders.min_by_key(|order| *order == Order::Interleave.name());
    clock::caveats(runs, order.unwrap_or_default())
}

/// Returns a sentence for each reference that does not agree with another technique.
fn disagreements(study: &Study) -> Vec<String> {
    let checks = study
        .nights
        .iter()
        .flat_map(|night| night.references_of_runs())
        .flat_map(|reference| &reference.checks);
    let failed = checks.filter(|check| !check.agrees);
    failed
        .map(|check| {
            format!(
                "A reference DISAGREES with `{}`: {}. One of the two is wrong or biased.",
                check.technique, check.finding
            )
        })
        .collect()
}

/// Returns what weakens the answer: few repeats, numbers at the noise of their reference,
/// thresholds that the first measurement had passed, clocks that were disturbed, series with and
/// without vectors, and references that are biased, too noisy, or contradicted by other techniques.
fn caveats(study: &Study, tables: &[&Table]) -> Vec<String> {
    let mut caveats = Vec::new();
    let finals = |table: &&&Table| matches!(table.kind, TableKind::Final(_));
    let runs = tables
        .iter()
        .filter(finals)
        .flat_map(|table| &table.rows)
        .flat_map(|(_, cells)| cells)
        .filter(|cell| cell.runs > 0)
        .map(|cell| cell.runs);
    if let Some(least) = runs.min().filter(|least| *least < FEW_REPEATS) {
        caveats.push(format!(
            "Some numbers are from {least} finished repeat{}: differences between techniques can \
             hardly be tested. Set `repeats` in experiment(name, {{ repeats = 5 }}).",
            if least == 1 { "" } else { "s" }
        ));
    }
    for table in tables {
        // The noise of a metric that is shown as its root too is stated once.
        let TableKind::Final(metric) = table.kind else {
            continue;
        };
        if is_root_of_shown(study, metric) {
            continue;
        }
        let (at_floor, all) = count(table, |cell| cell.at_floor);
        if at_floor > 0 {
            caveats.push(format!(
                "{}: {at_floor} of {all} numbers can be noise of the reference by half or more \
                 (†). References with more samples would tell.",
                table.title
            ));
        }
    }
    for table in tables
        .iter()
        .filter(|table| matches!(table.kind, TableKind::TimeTo(_)))
    {
        let (passed, all) = count(table, |cell| cell.bound == Bound::Upper);
        if passed > 0 {
            caveats.push(format!(
                "{}: {passed} of {all} times are of the first measurement, which had passed the \
                 threshold. Choose a harder threshold or measure earlier.",
                table.title
            ));
        }
    }
    let noisy = study
        .nights
        .iter()
        .flat_map(|night| night.noisy_references());
    caveats.extend(noisy.collect::<BTreeSet<String>>());
    caveats.extend(clocks(study));
    caveats.extend(mixed_lanes(study));
    caveats.extend(disagreements(study));
    if study.is_denoised() {
        caveats.push(
            "Denoised series are biased: they lead while noise is the larger part of the error, \
             and other series may pass them with more time."
                .to_owned(),
        );
    }
    if study.series.len() < 2 {
        caveats.push("There is only one series, so nothing is compared.".to_owned());
    }
    caveats
}

/// Counts the cells with a number for which `is` holds, and all cells with a number.
fn count(table: &Table, is: impl Fn(&TableCell) -> bool) -> (usize, usize) {
    let mut known = table.cells();
    known.retain(|cell| cell.value.is_some());
    (known.iter().filter(|cell| is(cell)).count(), known.len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_that_is_best_most_often_comes_first() {
        let winner = |label: &str, is_significant| {
            Some(Winner {
                series: 0,
                label: label.to_owned(),
                is_significant,
                ratio: Some(2.0),
                contrast: None,
                unconfirmed: false,
            })
        };
        let column = Column {
            heading: "RMSE".to_owned(),
            winners: vec![
                winner("nee", true),
                winner("bdpt", true),
                None,
                winner("bdpt", true),
                winner("bpt", false),
            ],
        };
        assert_eq!(
            sentence(&column),
            "RMSE at equal time: bdpt is significantly best in 2 of 4 rows, nee in 1; 1 has no \
             clear winner."
        );
    }
}
