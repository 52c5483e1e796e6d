//! Results of a night: its files, tables, messages and exit code.

use std::collections::BTreeSet;

use crate::cli::exit::{Exit, Failure, print_result, print_status};
use crate::cli::format::{counted, display_path};
use crate::cli::inspect::report::read_picture;
use lumbre_night::experiment::aa_check;
use lumbre_night::experiment::night::state_counts::StateCounts;
use lumbre_night::experiment::plan::ReferenceSource;
use lumbre_night::experiment::spec::{FigureSpec, TableFormat};
use lumbre_night::experiment::{CellRef, Night, NightSummary, Outcome, Plan};
use lumbre_night::store::read::night::read_night;
use lumbre_night::store::{Evidence, Store};
use lumbre_report::report::requested::{self, RunFiles};
use lumbre_report::report::{self, ReportOptions, Study};
use lumbre_report::{plot, summary};

/// Prints the backends of a plan with their devices, and why `auto` selects one of them.
pub(super) fn print_backends(plan: &Plan) {
    let rendered = plan.references.iter().filter_map(|r| match &r.source {
        ReferenceSource::Render { config, .. } => Some(&config.backend),
        ReferenceSource::File { .. } => None,
    });
    let names: BTreeSet<&String> = plan
        .cells
        .iter()
        .map(|c| &c.config.backend)
        .chain(rendered)
        .collect();
    let (auto, reason) = lumbre_night::backends::auto_backend();
    for name in names
        .into_iter()
        .filter(|name| *name != lumbre_render::external::BACKEND)
    {
        let device = lumbre_night::backends::backend(name).map(|row| (row.probe)());
        let (Ok(device) | Err(device)) = device.unwrap_or_else(|| Err("unknown".to_owned()));
        let selected = if auto == name.as_str() {
            format!(" (auto selects {name}: {reason})")
        } else {
            String::new()
        };
        print_status(&format!("backend {name}: {device}{selected}"));
    }
}

/// Writes `summary.csv`, tables, figures, sheets and the CSV files of repeats and of the A/A check. The
/// night may be complete or partial.
pub(in crate::cli) fn write_results(
    store: &Store,
    plan: &Plan,
    night: &Night,
    results: &Night,
) -> Result<(), Failure> {
    let write = |name: &str, bytes: &[u8]| store.write(name, bytes).map_err(Failure::internal);
    write("summary.csv", summary::csv(plan, night).as_bytes())?;
    for spec in &plan.tables {
        for table in requested::tables(results, spec) {
            for format in &spec.formats {
                let (extension, text) = match format {
                    TableFormat::Md => {
                        let origin = table.provenance.markup_comment();
                        ("md", format!("{}\n{origin}", table.to_text()))
                    }
                    TableFormat::Csv => ("csv", table.to_wide_csv()),
                };
                write(
                    &format!("tables/{}.{extension}", table.name),
                    text.as_bytes(),
                )?;
            }
        }
    }
    for spec in &plan.figures {
        for figure in requested::figures(results, spec) {
            let stem = &figure.stem;
            write(&format!("figures/{stem}.svg"), figure.svg.as_bytes())?;
            write(&format!("figures/{stem}.csv"), figure.csv.as_bytes())?;
            let png = plot::rasterize(&figure.svg).map_err(Failure::internal)?;
            write(&format!("figures/{stem}.png"), &png)?;
        }
    }
    write_sheets(store, plan)?;
    let repeats = summary::repeats_csv(results);
    if !repeats.is_empty() {
        write("repeats.csv", repeats.as_bytes())?;
    }
    let findings = aa_check::check(plan, night);
    if !findings.is_empty() {
        write("aa-check.csv", summary::aa_check_csv(&findings).as_bytes())?;
    }
    Ok(())
}

/// Writes the sheets of pictures and frames, which are drawn from the files of finished runs. Prints
/// what cannot be read.
fn write_sheets(store: &Store, plan: &Plan) -> Result<(), Failure> {
    if plan.sheets.is_empty() {
        return Ok(());
    }
    let evidence = Evidence::default();
    let night = read_night(store.folder(), &evidence).map_err(Failure::internal)?;
    let files = RunFiles {
        pictures: &|path, _| read_picture(path, &evidence),
        bytes: &|path| evidence.read(path),
    };
    let mut notes = Vec::new();
    let sheets = requested::sheets(&[night], files, true, &mut notes);
    for item in sheets.map_err(Failure::internal)? {
        for (name, bytes) in item.files().map_err(Failure::internal)? {
            store.write(&name, &bytes).map_err(Failure::internal)?;
        }
    }
    notes
        .iter()
        .for_each(|note| print_status(&format!("note: {note}")));
    Ok(())
}

/// Collects the results of a night for its figures and tables. Devices are found only if one of them
/// shows times, which depend on devices, since that reads a file of every run.
pub(in crate::cli) fn collect(store: &Store, plan: &Plan, night: &Night) -> Night {
    let timed = plan.tables.iter().any(|spec| spec.value.is_clock())
        || plan.figures.iter().any(FigureSpec::is_timed);
    requested::night(night, |cell, outcome| {
        timed.then(|| store.device(plan, cell, outcome)).flatten()
    })
}

/// Prints all tables of a plan to stdout as Markdown, once a run has finished.
pub(in crate::cli) fn print_tables(plan: &Plan, results: &Night) -> Result<(), Failure> {
    if !results.runs.iter().any(|run| run.is_done()) {
        return Ok(());
    }
    let tables = plan
        .tables
        .iter()
        .flat_map(|spec| requested::tables(results, spec));
    print_result(
        &tables
            .map(|table| table.to_text())
            .collect::<Vec<_>>()
            .join("\n"),
    )
}

/// Prints the failed runs of a night and the reasons.
pub(in crate::cli) fn print_failures(night: &Night) {
    for cell in night.all() {
        if let Some(Outcome::Failed(reason)) = night.outcome(cell) {
            print_status(&format!("failed: {}: {reason}", night.path(cell)));
        }
    }
}

/// Prints how many cells were left to workers with other devices.
pub(in crate::cli) fn print_left_to_others(plan: &Plan, night: &NightSummary) {
    if let Some((cell, reason)) = night.other_workers.first() {
        let (cells, id) = (counted(night.other_workers.len(), "cell"), plan.id(*cell));
        print_status(&format!(
            "{cells} left to workers with other devices; the first is {id}: {reason} (if times do \
             not matter, --affinity none renders all cells on any device)"
        ));
    }
}

/// Prints the references that a second technique contradicts, also with `--quiet`.
pub(in crate::cli) fn print_disagreements(plan: &Plan, night: &NightSummary) {
    for found in &night.disagreements {
        let cell = CellRef::Reference(found.reference);
        let (path, id) = (night.night.path(cell), plan.id(cell));
        print_status(&format!(
            "alarm: {path} {}; see the map in its folder, refs/{}/{id} (exit code 6)",
            found.found,
            &id.0[..2]
        ));
    }
}

/// Prints the findings of the A/A check. With `quiet`, prints only those that chance does not
/// explain.
pub(super) fn print_aa_check(plan: &Plan, night: &Night, quiet: bool) {
    for finding in aa_check::check(plan, night)
        .iter()
        .filter(|finding| finding.alarm || !quiet)
    {
        let alarm = if finding.alarm { "alarm: " } else { "" };
        print_status(&format!("{alarm}A/A check: {}", finding.describe()));
    }
}

/// Prints how many runs are done, cached, failed or left, and where the results are.
pub(super) fn print_locations(store: &Store, plan: &Plan, night: &Night) {
    let folder = store.folder();
    let StateCounts {
        done,
        cached,
        failed,
        ..
    } = night.counts();
    let all = night.all().count();
    let left = all - done - cached - failed;
    let resumes = match left {
        0 => "",
        _ => "; the same command resumes",
    };
    print_status(&format!(
        "{done} done, {cached} cached, {failed} failed, {left} left of {all}{resumes}"
    ));
    if done + cached == 0 {
        return;
    }
    print_status(&format!(
        "pictures   {}",
        display_path(&folder.join("runs"))
    ));
    if !plan.figures.is_empty() {
        print_status(&format!(
            "curves     {}",
            display_path(&folder.join("figures"))
        ));
    }
    if !plan.sheets.is_empty() {
        print_status(&format!(
            "sheets     {}",
            display_path(&folder.join("sheets"))
        ));
    }
    if !plan.tables.is_empty() {
        print_status(&format!(
            "tables     {}",
            display_path(&folder.join("tables"))
        ));
    }
    print_status(&format!(
        "all values {}",
        display_path(&folder.join("summary.csv"))
    ));
}

/// Prints which technique is best, by how much and how certainly, as the report says it.
pub(super) fn print_answer(results: &Night) {
    let options = ReportOptions::default();
    // A night without measurements has no answer.
    let Ok(study) = Study::new(std::slice::from_ref(results), &options) else {
        return;
    };
    let sentences = report::answer(&study, &options);
    for sentence in &sentences {
        print_status(&format!("\n{sentence}"));
    }
    let caveats = report::clocks(&study);
    for caveat in caveats.iter().filter(|_| !sentences.is_empty()) {
        print_status(&format!("warning: {caveat}"));
    }
}

/// Returns the exit code of a night whose tables and figures were written, or not. A night that was
/// stopped keeps the exit code of the stop, since the same command resumes it and writes them.
///
/// # Errors
/// When a night that was not stopped could not write them.
pub(in crate::cli) fn exit_after(
    night: &NightSummary,
    exit: Exit,
    written: Result<(), Failure>,
) -> Result<Exit, Failure> {
    match written {
        Err(failure) if night.interrupted => {
            failure.print();
            Ok(exit)
        }
        written => written.map(|()| exit),
    }
}

/// Returns the exit code for a night. `interrupted` is the code if the night was interrupted.
pub(in crate::cli) fn night_exit(night: &NightSummary, interrupted: Exit) -> Exit {
    let is_failed = |cell| matches!(night.night.outcome(cell), Some(Outcome::Failed(_)));
    if night.interrupted {
        interrupted
    } else if !night.disagreements.is_empty() {
        // This outranks failed cells: errors measured against a wrong reference are worse than
        // none.
        Exit::Disagreement
    } else if night.night.all().any(is_failed) {
        Exit::CellsFailed
    } else if !night.night.runs.iter().all(|run| run.is_done()) {
        Exit::WorkLeft
    } else {
        Exit::Done
    }
}
