//! The page of the documentation that `lumbre verify --mitsuba --page` writes.

use std::fmt::Write;

use serde::Deserialize;
use serde_json::Value as Json;

use super::{CaseFigures, MAX_DEPTH, MAX_SIDE};

/// A row of the report.
#[derive(Deserialize)]
struct Row {
    check: String,
    compared: String,
    verdict: String,
    figures: Option<CaseFigures>,
}

/// Report of a finished run.
#[derive(Deserialize)]
struct Report {
    significance: f64,
    failed: usize,
    skipped: usize,
    checks: Vec<Row>,
}

/// Returns the page of a finished report.
///
/// # Errors
/// Returns a message if the report is none of cases.
pub fn markdown(report: Json) -> Result<String, String> {
    let report: Report = serde_json::from_value(report).map_err(|e| e.to_string())?;
    let mut page = introduction(&report);
    let mut list = "";
    for row in &report.checks {
        if row.check != list {
            list = &row.check;
            _ = write!(
                page,
                "\n## {}\n\n| case | ratios | result | notes |\n|---|---|---|---|\n",
                heading(list)
            );
        }
        let (ratios, result, notes) = row.figures.as_ref().map_or_else(
            || (String::new(), row.verdict.as_str(), String::new()),
            |f| (ratios(&f.ratios), f.result.as_str(), f.notes.join("; ")),
        );
        _ = writeln!(
            page,
            "| `{}` | {ratios} | {result} | {} |",
            row.compared,
            notes.replace('|', "\\|"),
        );
    }
    Ok(page)
}

/// Returns the beginning of the page: what was compared, and how many cases agree.
fn introduction(report: &Report) -> String {
    let rows = &report.checks;
    let first = rows.iter().find_map(|row| row.figures.as_ref());
    let (samples, version) = first.map_or((0, "3"), |f| (f.samples, f.mitsuba.as_str()));
    let count = |result: &str| {
        let has = |row: &&Row| row.figures.as_ref().is_some_and(|f| f.result == result);
        rows.iter().filter(has).count()
    };
    let (title, command, scenes) = if rows.iter().any(|row| row.check == super::cases::FILES) {
        (
            ": scene files",
            "FILE.. --page PAGE",
            format!(
                "The scenes are files, rendered in pictures of at most {MAX_SIDE} pixels a side with a \
                 box filter, and paths have\nat most {MAX_DEPTH} edges"
            ),
        )
    } else {
        (
            "",
            "--page FILE",
            format!(
                "The scenes are small pictures of one object with the given parameters, and paths have \
                 at most {} edges.\nThe plugin `difftrans` of version 0.6, which version 3 lacks, is \
                 defined in Python for them",
                super::cases::MAX_DEPTH
            ),
        )
    };
    format!(
        "# Fidelity with Mitsuba{title}\n\nMade by `lumbre verify --mitsuba {command}`; do not edit.\n\n\
         Each case is a scene that both programs render with {samples} samples per pixel: Lumbre {} \
         with `nee`, Mitsuba\n{version} with `path`. {scenes}.\nA case agrees if no block of 8 x 8 \
         pixels and no mean differs significantly: with equal expectations, the probability that\nany of \
         the {} cases fails is {}. A case that differs must have a note when its file is loaded or \
         exported: a size in the\nnote bounds the difference of the means. Ratios are means over the \
         picture, Lumbre over Mitsuba, for red, green and blue.\n\n{} cases agree, {} differ as noted, \
         {} fail, {} are skipped.\n",
        env!("CARGO_PKG_VERSION"),
        rows.len(),
        report.significance,
        count("agrees"),
        count("noted"),
        report.failed,
        report.skipped,
    )
}

/// Returns the heading of a list of cases.
fn heading(list: &str) -> String {
    let name = if list == super::cases::MATERIALS {
        "exported materials"
    } else {
        list
    };
    let (first, rest) = name.split_at(1);
    first.to_uppercase() + rest
}

/// Formats the ratios of the channels.
fn ratios(values: &[Option<f64>; 3]) -> String {
    let format = |x: &Option<f64>| x.map_or("-".to_owned(), |x| format!("{x:.3}"));
    values.iter().map(format).collect::<Vec<_>>().join(" ")
}
